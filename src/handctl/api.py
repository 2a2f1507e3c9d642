"""handctl as a library: `connect` and `simulate` give a device whose methods are the commands of its family.

    with handctl.connect("exo", "/dev/ttyUSB0") as hand:
        for row in hand.get("temperature"):
            print(row["finger"], row["value"])

Rows are those of `--json`, errors those of `handctl.errors`. Nothing is printed and nobody is asked: what needs a confirmation takes
`confirm=True` or a function `(question, steps) -> bool`, and raises NotConfirmed without. The environment plays no part, and of the
configuration file only the device that `connect("left")` names. `handctl.hands` has the types; `handctl help library` is the guide.
"""

from __future__ import annotations

import keyword
import re
import shlex
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from handctl.command.command_tree import Command
from handctl.command.family import Family, load
from handctl.command.library_call import Confirm, LibrarySession, Samples
from handctl.command.open_links import Session
from handctl.errors import HandctlError, UsageError
from handctl.families import FAMILIES, HISTORY
from handctl.model.command_settings import Settings
from handctl.model.result import Row, Table, name_of
from handctl.wording import sentence

if TYPE_CHECKING:
    from handctl.command.command_tree import Command


HOST = ("timeout", "deadline", "retries", "trace", "history", "assume_identity")
"""Settings of this end of a link, whatever is at the other."""
SHARED = ("id", "baud")


class Argument(NamedTuple):
    """One argument of a method.

    name     as it is given
    key      click's name of it
    param    click's parameter
    pairs    takes NAME=VALUE: a mapping does too
    """

    name: str
    key: str
    param: click.Parameter
    pairs: bool

    @property
    def positional(self) -> bool:
        """Whether it is given without its name."""
        return isinstance(self.param, click.Argument)

    @property
    def variadic(self) -> bool:
        """Whether it takes all that is left."""
        return self.param.nargs == -1


class Method(NamedTuple):
    """A command as a method. `words` are those that are typed for it."""

    name: str
    words: str
    command: Command
    arguments: tuple[Argument, ...]

    def values(self, args: tuple[Any, ...], named: Mapping[str, Any]) -> dict[str, Any]:
        """Click's name -> value. Raises TypeError for arguments that there are not."""
        found: dict[str, Any] = {}
        rest = list(args)
        for argument in self.arguments:
            if argument.name in named:
                found[argument.key] = _plain(argument, named[argument.name])
            elif argument.positional and argument.variadic:
                given, rest = rest, []
                found[argument.key] = tuple(_texts(argument, given))
            elif argument.positional and rest:
                size = argument.param.nargs
                found[argument.key] = _plain(argument, rest[0] if size == 1 else tuple(rest[:size]))
                rest = rest[size:]
        known = {argument.name for argument in self.arguments}
        unknown = [name for name in named if name not in known]
        for argument in self.arguments if unknown and not args else ():  # position(ring=900), as it is typed
            if argument.positional and argument.pairs and not found.get(argument.key):
                found[argument.key] = tuple(_texts(argument, [{name: named[name] for name in unknown}]))
                unknown = []
        if rest or unknown:
            what = f"unexpected argument {unknown[0]!r}" if unknown else f"{len(rest)} arguments too many"
            raise TypeError(f"{self.name}(): {what}")
        return found


def _plain(argument: Argument, value: Any) -> Any:
    if argument.variadic:
        return tuple(_texts(argument, [value] if isinstance(value, str | int | float | Mapping) else list(value)))
    return value


def _texts(argument: Argument, values: list[Any]) -> Iterator[str]:
    """Values as they would be typed; a mapping as NAME=VALUE each."""
    for value in values:
        if isinstance(value, Mapping):
            for name, one in value.items():
                several = isinstance(one, list | tuple)
                yield f"{name}={','.join(map(str, one)) if several else one}"
        else:
            yield str(value)


@cache
def methods(kind: str) -> dict[str, Method]:
    """The commands of a family that are methods, by their names in Python."""
    group = load(kind, "cli").cli
    return {method.name: method for method in _below(group, "")}


def _below(group: click.Group, path: str) -> Iterator[Method]:
    for name, command in group.commands.items():
        if isinstance(command, click.Group):
            yield from _below(command, f"{path}{name} ")
        elif isinstance(command, Command):
            words = f"{path}{name}"
            yield Method(_identifier(words), words, command, tuple(_arguments(command)))


def _identifier(words: str) -> str:
    name = words.replace(" ", "_").replace("-", "_")
    return f"{name}_" if keyword.iskeyword(name) else name


def _arguments(command: Command) -> Iterator[Argument]:
    for param in command.params:
        key = param.name or ""
        name = key if isinstance(param, click.Argument) else next(name for name in param.opts if name[:2] == "--")[2:]
        yield Argument(_identifier(name), key, param, "=VALUE" in (getattr(param, "metavar", None) or ""))


class Rows(list[Row]):
    """What a command returns."""

    def named(self) -> dict[str, Any]:
        """The values by name, such as ``position.F1``."""
        return {name_of(row): row.get("value") for row in self}

    def frame(self) -> Any:
        """The rows as a pandas DataFrame. Raises ImportError where pandas is not installed."""
        pandas = import_module("pandas")
        table = pandas.DataFrame(list(self))
        if "time" in table:
            table["time"] = pandas.to_datetime(table["time"])
        return table


class Stream(Iterator[Rows]):
    """What a command of samples returns: the rows of each, until it ends or is closed. A `with` closes it."""

    def __init__(
        self, samples: Iterator[list[Row]], kind: str, table: Table | None, failure: Callable[[], HandctlError | None]
    ) -> None:
        self._samples, self._kind, self._table, self._failure = samples, kind, table, failure

    def __enter__(self) -> Stream:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __next__(self) -> Rows:
        try:
            return Rows(next(self._samples))
        except HandctlError as exc:
            raise error_in_python(exc, self._kind) from None

    def close(self) -> None:
        """End it, and leave the device. Raises what the command would have ended with."""
        if isinstance(self._samples, Samples) and self._samples.close() and (failure := self._failure()) is not None:
            raise error_in_python(failure, self._kind)

    def step(self, **values: Any) -> Rows:
        """Send these control values in one block, and return its rows; what is left out keeps its value. Raises UsageError."""
        steer = self._table.steer if self._table is not None else None
        try:
            if steer is not None and isinstance(self._samples, Samples):
                return Rows(self._samples.behind(partial(steer, values)))
            if values:
                raise UsageError("this command takes no values", hint="take its samples in a loop")
            return Rows(next(self._samples))
        except StopIteration:
            raise error_in_python(UsageError("the stream has ended", hint="start it again"), self._kind) from None
        except HandctlError as exc:
            raise error_in_python(exc, self._kind) from None

    def frame(self) -> Any:
        """The rows of all samples as a pandas DataFrame, when it has ended."""
        return Rows(row for sample in self for row in sample).frame()


def error_in_python(error: HandctlError, kind: str) -> HandctlError:
    """An error as a program meets it: in its words, with the hint as a note, and without the way that it came."""
    error.text, error.hint = _texts_in_python(kind, error.text, error.hint)
    if error.hint and hasattr(error, "add_note"):  # Python 3.11
        error.add_note(f"Next: {sentence(error.hint)}")
    return error.with_traceback(None)


def _texts_in_python(kind: str, *texts: str) -> Iterator[str]:
    known = {name: method.command for name, method in methods(kind).items()} if kind in FAMILIES else {}
    return (in_python(text, kind, known) for text in texts)


class Device:
    """A device with an open link. Its methods are the commands of its family, see `handctl.hands`."""

    kind = ""

    def __init__(self, line: LibrarySession) -> None:
        self._line = line

    def __enter__(self) -> Device:
        """Raises UsageError if it is closed."""
        try:
            self._line.check_open()
        except UsageError as exc:
            raise error_in_python(exc, self.kind) from None
        return self

    def __exit__(self, *error: object) -> None:
        """Close the link. Where an error or Ctrl-C ends the `with`, what calls have left moving is stopped first.

        Raises what went wrong; behind an error only that a stop was not acknowledged.
        """
        early = any(isinstance(one, Exception | KeyboardInterrupt) for one in error)
        moving = self._line.stop_moving() if early else None
        failure = self._line.close()
        failure = moving or (failure if error[0] is None else None)
        if failure is not None:
            raise error_in_python(failure, self.kind)

    def disconnect(self) -> None:
        """Close the link, and stop nothing. A `with` does so at its end. From then on only `stop` opens it, for itself. Raises LinkError."""
        self.__exit__(None)

    @property
    def envelope(self) -> dict[str, Any]:
        """The JSON of the last call without its rows: device, line, messages, counters, writes."""
        call = self._line.last
        assert call is not None
        return call.envelope(call.outcome.failure, call.outcome.extra)

    @property
    def messages(self) -> list[Row]:
        """What the last call had to say: `level`, `code`, `text`, `hint` each."""
        found: list[Row] = self.envelope["messages"]
        for row in found:
            row["text"], row["hint"] = _texts_in_python(self.kind, row["text"], row["hint"])
        return found

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *methods(self.kind)]

    def __getattr__(self, name: str) -> Callable[..., Any]:
        found = methods(self.kind).get(name) if not name.startswith("_") else None
        if found is None:
            raise AttributeError(f"{self.kind} has no command {name!r}")
        method, line = found, self._line

        def call(*args: Any, confirm: Confirm = False, dry_run: bool = False, **named: Any) -> Any:
            key = (name, args) if not (named or confirm or dry_run) else None
            output = named.pop("output", None) if method.command.to_file else None
            try:
                if key is not None and (again := line.again(key)) is not None:
                    return Rows(again)
                values = method.values(args, named)
                found = line.call(
                    method.command, method.words, values, confirm=confirm, dry_run=dry_run, output=output, key=key
                )
            except HandctlError as exc:
                raise error_in_python(exc, self.kind) from None
            if isinstance(found, list):
                return Rows(found)
            one = line.last
            assert one is not None
            return Stream(found, self.kind, one.outcome.table, lambda: one.outcome.failure)

        call.__name__, call.__doc__ = name, method.command.help
        self.__dict__[name] = call
        return call


@cache
def class_of(kind: str) -> type[Device]:
    """The class of a family's devices, as `handctl.hands` names it."""
    return type(
        kind.capitalize(), (Device,), {"kind": kind, "__doc__": FAMILIES[kind].help, "__module__": "handctl.hands"}
    )


def connect(family: str, link: Any = None, **settings: Any) -> Device:
    """Open LINK, a port or another link as after `-p`, to a device of this family. Without LINK: the device of this name.

    A name is that of `handctl devices list`, with the settings there. Settings are `id`, `baud`, `timeout`, `deadline`, `retries`, `trace`, `history`, `assume_identity` and the family's own options by their
    long names with _ for -. Raises UsageError, LinkError.
    """
    try:
        if link is None:
            from handctl.command.config_file import read_config

            device = read_config().find(family)
            settings = {key: entry.value for key, entry in device.entries.items()} | settings
            family, link = device.kind, settings.pop("port")
        return _opened(family, str(link), settings)
    except HandctlError as exc:
        raise error_in_python(exc, family) from None


def _opened(family: str, link: str, settings: Mapping[str, Any]) -> Device:
    if family not in FAMILIES:
        raise UsageError(f"no device family {family!r}", hint=f"use one of {', '.join(FAMILIES)}")
    options = {option.key: option for option in FAMILIES[family].options}
    known = (*SHARED, *HOST, *options)
    choices = {"history": HISTORY, **{name: option.choices for name, option in options.items()}}
    for name, value in settings.items():
        if name not in known:
            raise UsageError(f"{name}: no such setting of {family}", hint=f"use one of {', '.join(known)}")
        if (allowed := choices.get(name)) and value not in allowed:
            raise UsageError(f"{name} = {value!r} is not a valid value", hint=f"use one of {', '.join(allowed)}")
    known_family: Family = load(family, "cli").cli.family
    chosen = Settings(kind=family, port=link, format="json", quiet=True, time=True).having(settings)
    line = LibrarySession(known_family, chosen, Session("library", writes=True, guards=True))
    try:
        line.open()
    except BaseException:
        line.close()
        raise
    return class_of(family)(line)


def simulate(family: str, **options: Any) -> Device:
    """A simulated device of this family in this process: `fault`, `seed` and what else `handctl sim FAMILY -h` lists.

    Its time jumps from event to event, so nothing waits, and each exchange takes as long as on its line (`wire`);
    `clock="real"` lets time pass. `timeout`, `deadline`, `retries`, `trace`, `history` and
    `assume_identity` are those of `connect`. Raises UsageError.
    """
    from urllib.parse import quote

    host = {name: options.pop(name) for name in HOST if name in options}
    if "id" in options:
        host["id"] = options["id"]
    said = {"clock": "virtual", "wire": "auto", **{name.replace("_", "-"): value for name, value in options.items()}}
    link = "&".join(f"{name}={quote(str(value), safe='')}" for name, value in said.items())
    return connect(family, f"fake://{family}?{link}", **host)


__all__ = ["Device", "HandctlError", "Rows", "Stream", "connect", "simulate"]


# -- messages in the words of a program: methods for commands, arguments for options ----------------------------------

OPTION = re.compile(r"(?<![\w-])(--[a-z]+(?:-[a-z]+)*|-[pdnyo]\b)(?:=(?=\w))?")
MEANS = {
    "-p": "link",
    "-d": "a named device",
    "-n": "dry_run",
    "-y": "confirm",
    "-o": "output",
    "--yes": "confirm=True",
    "--fake": "simulate()",
}
"""Options that have another name there; of all others - becomes _."""
OPENED = ("-p", "--port", "-d", "--device")
"""Options whose value says which device: it is open already."""


def in_python(text: str, kind: str, known: Mapping[str, Command]) -> str:
    """`text` for a program that has a device of family `kind`, whose methods are the commands `known`.

    A command of another program, or of handctl as a whole, stays as it is typed.
    """
    return "".join(
        _code(piece, kind, known) if piece[:1] == "`" else OPTION.sub(_name, piece)
        for piece in re.split("(`[^`]*`)", text)
    )


def _name(found: re.Match[str]) -> str:
    return MEANS.get(found[1]) or found[1].lstrip("-").replace("-", "_")


def _code(piece: str, kind: str, known: Mapping[str, Command]) -> str:
    """What stands between backticks: a command of this family becomes a call, an option an argument."""
    try:
        words = shlex.split(piece.strip("`"))
    except ValueError:
        return piece
    typed = words[:1] == ["handctl"]
    own = words[1:2] == [kind] or words[1:2] in (["-d"], ["--device"])
    words = [word for word in words[typed:] if word != kind]
    while words and words[0] in OPENED:
        del words[:2]
    for count in (2, 1) if own or not typed else ():
        name = "_".join(words[:count]).replace("-", "_")
        if len(words) >= count and name in known and (typed or " -" in piece):
            return f"`{name}({', '.join(_call_arguments(words[count:], known[name]))})`"
    return piece if typed else OPTION.sub(_name, piece)


def _call_arguments(words: list[str], command: click.Command) -> list[str]:
    """Words behind a command as arguments of a method."""
    options = {name: param for param in command.params if isinstance(param, click.Option) for name in param.opts}
    found, rest = [], list(words)
    while rest:
        word = rest.pop(0)
        if not re.match("--?[a-z]", word):
            found.append(_literal(word))
            continue
        option, takes = options.get(word), word in OPENED or bool(rest and rest[0].isupper())
        if option is not None:
            takes = not option.is_flag
        value: Any = _literal(rest.pop(0)) if takes and rest else True
        if word not in OPENED:
            found.append(f"{MEANS.get(word, word.lstrip('-')).partition('=')[0].replace('-', '_')}={value}")
    return found


def _literal(word: str) -> str:
    return word if re.fullmatch("-?[0-9.]+|…", word) else f'"{word}"'
