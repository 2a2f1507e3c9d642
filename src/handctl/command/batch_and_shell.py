"""Command lines of `batch` and `shell`: parse them, plan them without a device, and run them in one session.

`batch` runs a script of them: all of it is understood, planned and confirmed before it begins. `shell` is a prompt, on links that
stay open: a port that was lost is opened again by the next line.
"""

from __future__ import annotations

import contextlib
import io
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

import click

from handctl.command.command_tree import ALONE, Command, root
from handctl.command.connection import Session
from handctl.command.envelope import from_click
from handctl.command.family import load, map_of
from handctl.command.help_text import NoCommand
from handctl.command.invocation import check_before, shown_steps, unsent
from handctl.command.options import COMMAND_LINE, SECONDS, command_line, words_of
from handctl.command.precedence import resolve
from handctl.command.run import Asked, PlannedAction, Run
from handctl.command.terminal_prompts import print_message
from handctl.errors import HandctlError, Hint, Interrupted, NotConfirmed, UsageError, joined
from handctl.families import COMMANDS, FAMILIES
from handctl.files import atomic_write, read_text, state_path, writing
from handctl.interrupts import asked, end_on_signals
from handctl.model.prompts import Prompts
from handctl.model.result import Table
from handctl.system import terminal
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.link import Link
    from handctl.model.result import Journal
    from handctl.model.settings import Settings

HERE = ("stop", "sleep")
"""Commands without a family that use the links of a session."""


class ScriptLine(NamedTuple):
    """A command line whose words make sense.

    number   in its script, from 1
    command  all its words that name the command, such as "exo get"
    """

    number: int
    command: str
    context: click.Context
    leaf: Command
    settings: Settings

    @property
    def shared(self) -> bool:
        """Whether it uses the links of its session."""
        return self.leaf.family is not None or self.leaf.offline or self.command in HERE

    def plan(self) -> Asked:
        """What it asks. Raises UsageError and what else it finds wrong without the device."""
        run = Planning(self.context, self.settings, self.leaf.family, Prompts())
        if "-" in self.context.params.values():
            raise UsageError("standard input cannot be read here", hint="give a file instead of -")
        if self.leaf.offline and run.outputs:
            return Asked()  # it writes its files where it stands
        check_before(run)
        with suppress(_UsesDeviceError):
            if isinstance(made := self.leaf.body(run)(), PlannedAction):
                return made.asked
        return Asked()

    def confirmed(self) -> ScriptLine:
        """The same line with a yes."""
        told = command_line(self.context)
        told.sources = {**told.sources, "yes": COMMAND_LINE}
        return self._replace(settings=self.settings._replace(yes=True))

    def run(self, session: Session, journal: Journal) -> None:
        """Carry it out and show its result. Raises HandctlError."""
        if not self.shared:
            session.release(journal)  # it may want the port for itself
        told = command_line(self.context)
        run, told.run = told.run, None
        if run is None:
            run = Run(self.context, self.settings, self.leaf.family, session=session)
        else:
            run.begin(run.journal.line)
        with run.shown():
            run.carry_out(self.leaf.body(run))
        if self.leaf.only_reads and not run.settings.output:  # the same line again asks the same
            told.run, run.checked = run, True


@click.command("sleep", cls=Command)
@click.argument("seconds", metavar="S", type=SECONDS)
def sleep(run: Run, seconds: float) -> None:
    """Wait S seconds. The link stays open. Ctrl-C ends the wait."""
    deadline = run.settings.deadline
    if deadline is not None and seconds > deadline:
        raise UsageError(
            f"sleep {seconds:g} takes longer than the --deadline of {deadline:g} s",
            hint=f"write `sleep {seconds:g} --deadline {seconds + 1:g}`. Nothing was sent.",
        )
    if run.session is not None:  # else it is only planned
        run.session.sleep(seconds)


root.in_lines["sleep"] = sleep


def line(words: Sequence[str], given: Mapping[str, Any], number: int = 0) -> ScriptLine:
    """Take the words apart; `given` are common options that hold where the line says nothing else.

    Raises UsageError, click's Exit where the line only asked for help.
    """
    context = click.Context(root, info_name="handctl", **root.context_settings)
    told = command_line(context)
    told.given = dict(given)
    told.bare = not any(word.startswith("-") for word in words)
    found: list[click.Context] = []
    told.taken = found.append
    try:
        with context.scope(cleanup=False):
            root.parse_args(context, list(words))
            root.invoke(context)
        (leaf,) = found
        assert isinstance(leaf.command, Command)
        for key in {"dry_run", "assume_identity"} & leaf.command.refused():
            if key not in told.levels:
                told.given.pop(key, None)
        told.taken = None
        command = " ".join(words_of(leaf))
        return ScriptLine(
            number, command, leaf, leaf.command, resolve(leaf, leaf.command.wires, urgent=leaf.command.stops)
        )
    except NoCommand as exc:
        raise UsageError(
            "no command", hint=f"`{exc.ctx.command_path if exc.ctx else 'handctl'} -h` lists them"
        ) from exc
    except click.UsageError as exc:
        raise from_click(exc) from exc


def defaults(context: click.Context) -> dict[str, Any]:
    """The common options of a command that runs others, as far as each of these takes them over."""
    given = dict(command_line(context).given)
    given.pop("output", None)
    if given.get("format") == "json":
        given["format"] = "ndjson"
    return given


def placed(error: HandctlError, one: ScriptLine) -> HandctlError:
    """The error, beginning with the line that it is of."""
    return error.reworded(f"line {one.number} ({one.command}): {error.text}")


# -- what a line means to do ----------------------------------------------------------------------------------------


class _UsesDeviceError(BaseException):
    """From here on the body would need the device. No Exception: no body may take it for a failure."""


class Planning(Run):
    """A run that ends where the device would be used. Sends nothing, shows nothing, asks nothing."""

    def device(self) -> NoReturn:
        self.link_name()
        raise _UsesDeviceError

    def open_link(self, *, again: bool = False, baud: int | None = None) -> Link:
        return self.device()


# -- a script of them, on one open link -----------------------------------------------------------------------------


MOST_BYTES = 4_000_000
LONGEST = 20_000
"""Characters of a line."""
SHOWN = 20
"""Steps of one line that the question shows."""


def batch(run: Run, file: str, *, keep_going: bool) -> Table | None:
    """Run the lines of `file`, or of stdin for "-". The failure of the whole is that of the first line that failed."""
    text = _script(file)
    with _no_stdin():
        lines = list(_lines(text, run.context))
        if not lines:
            raise UsageError("the script has no command", hint="write one command a line, without `handctl`")
        plans = list(_plans(lines))
    lines = _confirmed(run, lines, plans)
    if path := run.settings.output:  # the last line of JSON goes there too, behind all others
        run.after_output.enter_context(_one_file(path))
        run.settings = run.settings._replace(output=None)
    with _no_stdin():
        return _run(run, lines, keep_going=keep_going)


def _script(file: str) -> str:
    if file != "-":
        return read_text(file, "a script", MOST_BYTES)
    if sys.stdin.isatty():
        raise UsageError(
            "no script given", hint=Hint("name a file, or send the lines on stdin. {} is a prompt", "shell")
        )
    try:
        text = sys.stdin.read(MOST_BYTES + 1)
    except (OSError, UnicodeDecodeError) as exc:
        raise UsageError(f"stdin: the script cannot be read: {exc}", hint="send text in UTF-8") from exc
    if len(text) > MOST_BYTES:
        raise UsageError(f"stdin: larger than {MOST_BYTES // 1_000_000} MB: not a script", hint="send fewer lines")
    return text


@contextlib.contextmanager
def _no_stdin() -> Iterator[None]:
    """No line reads what the script came from, and none asks: that was done before."""
    before, sys.stdin = sys.stdin, io.StringIO()
    try:
        yield
    finally:
        sys.stdin = before


def _lines(text: str, context: click.Context) -> Iterator[ScriptLine]:
    """The commands of a script. Raises UsageError with the number of the line."""
    given = defaults(context)
    known: dict[str, ScriptLine] = {}  # a line that occurs again is the same
    for number, raw in enumerate(text.splitlines(), 1):
        if not (typed := raw.strip()):
            continue
        if len(typed) > LONGEST:
            raise UsageError(
                f"line {number} has {plural(len(typed), 'character')}: not a command", hint="write one command a line"
            )
        try:
            if typed in known:
                yield known[typed]._replace(number=number)
                continue
            words = shlex.split(typed, comments=True)
            if words[:1] == ["handctl"]:
                raise UsageError(
                    "leave out the word handctl in a script", hint="start with the device, such as `exo get id`"
                )
            if words:
                with contextlib.redirect_stdout(io.StringIO()):  # of a line that asks for help
                    known[typed] = line(words, given, number)
                yield known[typed]
        except ValueError as exc:
            raise UsageError(f"line {number}: {exc}: {typed}", hint="close the quote") from exc
        except click.exceptions.Exit as exc:
            raise UsageError(f"line {number} asks for help: {typed}", hint="remove that line") from exc
        except HandctlError as exc:
            raise exc.reworded(f"line {number} ({typed}): {exc.text}") from exc


def _plans(lines: Sequence[ScriptLine]) -> Iterator[Asked]:
    """The plan of each. Raises UsageError."""
    known: dict[int, Asked] = {}
    for one in lines:
        key = id(one.context)
        if key not in known:
            known[key] = _planned(one)
        yield known[key]


def _planned(one: ScriptLine) -> Asked:
    try:
        return one.plan()
    except click.UsageError as exc:
        raise placed(UsageError(exc.format_message(), hint="correct that line. Nothing was sent."), one) from exc
    except HandctlError as exc:
        raise placed(exc, one) from exc


def _confirmed(run: Run, lines: Sequence[ScriptLine], plans: Sequence[Asked]) -> list[ScriptLine]:
    """The lines, confirmed where needed: one question for all, after showing the plan. Raises NotConfirmed."""
    open_ = [
        (one, plan)
        for one, plan in zip(lines, plans, strict=True)
        if plan.question and not one.settings.yes and not one.settings.dry_run
    ]
    if not open_:
        return list(lines)
    for one, plan in open_:
        run.prompts.say(f"line {one.number}: {one.command}: {plan.question}")
        for text in shown_steps(plan.steps[:SHOWN], run.settings):
            run.prompts.say(text)
        if len(plan.steps) > SHOWN:
            run.prompts.say(f"  and {plural(len(plan.steps) - SHOWN, 'more step')}. -n shows them")
    first, plan = open_[0]
    if not run.prompts.interactive:
        where = f"line {first.number} ({first.command}): {plan.question}"
        raise NotConfirmed(f"{where}. {run.prompts.nobody}", hint=joined(run.prompts.otherwise, unsent(run.journal)))
    words = dict.fromkeys(plan.word for _, plan in open_ if plan.word)
    count = f"{len(open_)} of {len(lines)} lines ask" if len(open_) > 1 else "One line asks"
    if not run.prompts.ask(f"{count} for confirmation", " ".join(words)):
        raise NotConfirmed("not confirmed: nothing was sent", hint="run the command again to confirm it")
    asking = {one.number for one, _ in open_}
    answered = [one.confirmed() if one.number in asking else one for one in lines]
    for one in answered:
        if one.number in asking:
            _planned(one)  # a yes without a person may need more words, such as who it was
    return answered


@contextlib.contextmanager
def _one_file(path: str) -> Iterator[None]:
    """What would go to stdout goes to a file, which appears whole. Raises OutputError."""
    with writing(path), atomic_write(path) as file, contextlib.redirect_stdout(file):
        yield


def _run(run: Run, lines: Sequence[ScriptLine], *, keep_going: bool) -> Table | None:
    dry = run.settings.dry_run
    session = Session(run.command, writes=any(one.leaf.writes and not one.settings.dry_run for one in lines))
    failed: list[tuple[ScriptLine, HandctlError]] = []
    done = 0
    try:
        for one in lines:
            if dry and not one.leaf.writes and not one.leaf.offline:
                run.journal.info("left-out", f"line {one.number} ({one.command}) only reads: skipped in a dry run")
                continue
            done += 1
            session.place = {"line": one.number, "command": one.command}
            error = _carried_out(one, session, run)
            if error is not None:
                failed.append((one, error))
            if error is not None and not (keep_going and error.exit_code != Interrupted.exit_code):
                break
    finally:
        error = session.close(run.journal)
    failure = _failure(failed, done) if failed else error
    if run.settings.format in ("json", "ndjson"):
        return Table(extra={"lines": done, "failed": len(failed)}, failure=failure)
    if failure is not None:
        raise failure
    return None


def _carried_out(one: ScriptLine, session: Session, run: Run) -> HandctlError | None:
    """Run one line; the error with which it ended."""
    try:
        one.run(session, run.journal)
    except HandctlError as exc:
        if exc.text != "interrupted":
            told = placed(exc, one)
            print_message("error", told.text, told.hint)
        return exc
    return Interrupted("interrupted") if asked() else None


def _failure(failed: Sequence[tuple[ScriptLine, HandctlError]], done: int) -> HandctlError:
    """The failure of the whole: it ends as the first line that failed."""
    one, first = failed[0]
    if first.exit_code == Interrupted.exit_code:
        return Interrupted("interrupted")
    text = f"{len(failed)} of {plural(done, 'line')} failed, the first is line {one.number} ({one.command})"
    failure = HandctlError(text, hint=f"see the message of line {one.number}", code="line-failed")
    failure.exit_code = first.exit_code
    return failure


# -- a prompt for them ----------------------------------------------------------------------------------------------


ENDS = ("exit", "quit")
HISTORY = 1000
"""Lines that are kept."""
NAMING = ("get", "watch", "set", "describe")
"""Commands whose words are quantities."""


class Shell:
    """One session at a prompt.

    family  that a line may leave out, "" = each line has its own
    given   the common options that hold for every line
    """

    def __init__(self, run: Run, family: str, read_line: Callable[[str], str]) -> None:
        self._run = run
        self._read_line = read_line
        self._given = defaults(run.context)
        self.family = family or run.settings.kind or ""
        self._session = Session(run.command, writes=True)

    @property
    def prompt(self) -> str:
        """Device and link."""
        settings = self._run.settings
        link = settings.port or ("simulated" if settings.fake else "")
        return f"{' '.join(filter(None, (settings.device or self.family, link))) or 'handctl'}> "

    def run(self) -> None:
        """Take lines until Ctrl-D or `exit`."""
        run = self._run
        path = state_path("shell-history")
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
        editing = terminal.edit_lines(str(path), HISTORY, self.candidates)
        run.prompts.say("Lines are commands without `handctl`. TAB completes them. Ctrl-D or `exit` ends.")
        try:
            while self._one():
                pass
        finally:
            if editing:
                terminal.keep_history(str(path))
            failure = self._session.close(run.journal)
        if failure is not None:
            raise failure

    def _one(self) -> bool:
        """Take a line and carry it out; False at the end."""
        end_on_signals(suspend=False)
        try:
            typed = self._read_line(self.prompt)
        except EOFError:
            self._run.out("")
            return False
        except KeyboardInterrupt:
            stopped = self._session.stopped(self._run.journal)
            print_message("note", stopped.text if stopped is not None else "Ctrl-D ends the shell", "")
            return True
        try:
            words = shlex.split(typed, comments=True)
        except ValueError as exc:
            print_message("error", str(exc), "close the quote")
            return True
        if words[:1] == ["handctl"]:
            del words[0]
        if words[:1] and words[0] in ENDS:
            return False
        if words:
            self.carry_out(words)
        return True

    def carry_out(self, words: Sequence[str]) -> None:
        """Run one line; an error is shown, and the shell continues."""
        try:
            line(self._whole(words), self._given).run(self._session, self._run.journal)
        except click.exceptions.Exit:
            return  # it asked for help
        except HandctlError as exc:
            if exc.text != "interrupted":
                print_message("error", exc.text, exc.hint)
        except click.ClickException as exc:
            print_message("error", exc.format_message(), "")

    def _whole(self, words: Sequence[str]) -> list[str]:
        """The line with its family, where the shell knows that and the line leaves it out."""
        first = next((word for word in words if not word.startswith("-")), "")
        leave = not self.family or (first in COMMANDS and first != "stop") or first in root.in_lines
        return list(words) if leave else [self.family, *words]

    # -- completion --

    def candidates(self, before: str, word: str) -> list[str]:
        """What fits at the cursor: commands, then their quantities."""
        words = before[: len(before) - len(word)].split()
        with contextlib.suppress(HandctlError, click.ClickException):
            return [f"{name} " for name in sorted(set(self._fitting(words))) if name.startswith(word)]
        return []

    def _fitting(self, words: Sequence[str]) -> Iterator[str]:
        words = [name for name in words if not name.startswith("-")]
        if not words:
            yield from (name for name in COMMANDS if name not in ALONE)
            yield from (*root.in_lines, *ENDS)
        if self.family and (not words or words[0] not in COMMANDS):
            words = [self.family, *words]
        if not words or words[0] not in FAMILIES:
            return
        node: Any = load(words[0], "cli").cli
        rest = list(words[1:])
        while rest and isinstance(node, click.Group):
            node = node.commands.get(rest.pop(0))
        if isinstance(node, click.Group):
            yield from node.commands
        elif node is not None and node.name in NAMING and (params := map_of(words[0])) is not None:
            for param in params:
                yield param.name
                yield from (f"{param.name}.{part}" for part in param.elements)


def shell(run: Run, family: str) -> None:
    """Open the prompt. Raises UsageError where nobody can type."""
    if not run.prompts.interactive:
        raise UsageError("the shell needs a terminal", hint=Hint("send the lines to {}", "batch"), code="no-terminal")
    if run.settings.output:
        raise UsageError("the shell writes to the terminal", hint="give -o in a line of it")
    Shell(run, family, input).run()
