"""Read and check the configuration file: its keys, their values, and the line of each.

    port = "/dev/ttyUSB0"        # any shared option, by its long name with _ for -
    format = "plain"

    [devices.left]               # one named device: kind and port, and what else the line needs
    kind = "exo"
    port = "/dev/serial/by-id/usb-FTDI_FT232R_A1-if00-port0"
    id = 2

Nothing in it is ignored: an unknown key, a wrong type or a value out of range is a UsageError with the line. What a key
may hold is what its option accepts. Knows no precedence and does not write.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import click

from handctl.command.options import lasting_options
from handctl.errors import UsageError
from handctl.families import FAMILIES, WIRES
from handctl.fast_classes import fast_dataclass
from handctl.files import NoFile, read
from handctl.system.user_folders import config_path

Check = Callable[[Any], Any]
"""Value as TOML has it -> value of the option. Raises ValueError with what is wrong."""

DEVICE_KEYS = ("port", "facts", "id", "baud", "timeout", "deadline", "retries")
"""What a named device may say beside its kind, and what `families` has for its family; port must be there."""
NAME_HELP = "letters, digits, - and _"


def is_name(text: object) -> bool:
    """Whether a device may have this name: it must fit into a shell word and a bare TOML key."""
    return (
        isinstance(text, str)
        and bool(text)
        and text.isascii()
        and text.replace("-", "a").replace("_", "a").isalnum()
        and not text.startswith("-")
    )


def check_name(name: str) -> None:
    """Raises UsageError for a name that no device may have."""
    if not is_name(name):
        raise UsageError(f"{name!r} cannot be the name of a device", hint=f"allowed: {NAME_HELP}")


class Entry(NamedTuple):
    """One checked value and its line, None if it is not known."""

    value: Any
    line: int | None


class Device(NamedTuple):
    """One `[devices.NAME]`. `kind` is "" where that is wrong and passed over."""

    name: str
    kind: str
    entries: dict[str, Entry]
    line: int | None


class Config(NamedTuple):
    """The whole file; empty when there is none. `unusable`: devices that were left out, and what is wrong with each."""

    path: str
    text: str
    values: dict[str, Entry]
    devices: dict[str, Device]
    unusable: Mapping[str, UsageError] = MappingProxyType({})

    def find(self, name: str) -> Device:
        """The device of this name. Raises UsageError with what is known."""
        found = self.devices.get(name)
        if found is not None:
            return found
        if name in self.unusable:
            raise self.unusable[name]
        known = f"Named so far: {', '.join(self.devices)}" if self.devices else "No device has been named yet"
        from handctl.misspellings import near

        close = near(name, self.devices)
        meant = f"Did you mean {' or '.join(close)}? " if close else ""
        raise UsageError(
            f"no device is named {name!r} in {self.path}",
            hint=f"{meant}{known}. `handctl devices add {name} FAMILY -p LINK` adds one.",
            code="unknown-device",
        )


class Statement(NamedTuple):
    """One table header or one KEY = VALUE of a TOML text.

    start, end   offsets of its lines, line feed included
    code_end     offset behind its last character that is neither space nor comment
    path         the full key, table included
    """

    start: int
    end: int
    code_end: int
    path: tuple[str, ...]
    header: bool


MOST_BYTES = 1_000_000
DEEPEST = 4
"""Parts of a key whose line is known: one more than any key has. A key of 20,000 parts must not cost their square."""


def key_checks() -> dict[str, Check]:
    """Key of the configuration file -> what it may hold: every shared option by its name."""
    return {str(option.name): partial(_checked, option) for option in lasting_options(WIRES)}


def _checked(option: click.Parameter, value: Any) -> Any:
    """A value of the file as the option would have it; texts are not numbers there. Raises ValueError."""
    kind = option.type
    if getattr(option, "is_flag", False):
        if not isinstance(value, bool):
            raise ValueError("expected true or false")
        return value
    if isinstance(kind, click.FloatRange):
        wanted, text = isinstance(value, int | float), "expected a number"
    elif kind.name.startswith("integer"):
        wanted, text = isinstance(value, int), "expected a whole number"
    else:
        wanted, text = isinstance(value, str) and bool(value), "expected a text in quotes"
    if not wanted or isinstance(value, bool):
        raise ValueError(text)
    try:
        return kind.convert(value, option, None)
    except click.UsageError as exc:
        raise ValueError(exc.message) from exc


def read_config(path: str = "", passed: list[UsageError] | None = None) -> Config:
    """Read and check the user's configuration file, or that at `path`; one that is missing is empty. Raises UsageError.

    With `passed` an entry that is wrong is noted there and left out, of a device without a port all; what is no TOML is an error
    all the same.
    """
    path = path or config_path()
    hint = "make it readable, or set HANDCTL_CONFIG to another file"
    try:
        content = read(path, "the configuration file", MOST_BYTES, hint=hint, code="config")
    except NoFile:
        return Config(path, "", {}, {})
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as exc:
        line = content[: exc.start].count(b"\n") + 1
        raise _wrong(path, line, f"byte {content[exc.start]:02X} is not UTF-8", "save the file as UTF-8") from exc
    return parse(path, text, passed)


def parse(path: str, text: str, passed: list[UsageError] | None = None) -> Config:
    """The configuration in `text`; `path` is for the messages. Raises UsageError, see `read_config`."""
    data = _toml(path, text)
    book = _Book(path, lines_of(text), key_checks(), passed)
    tables = data.pop("devices", {})
    values = book.entries((), data, tuple(book.checks), "option")
    devices: dict[str, Device] = {}
    unusable: dict[str, UsageError] = {}
    with book.noted():
        if not isinstance(tables, dict):
            raise book.wrong(("devices",), "devices must be a table", "write [devices.NAME]")
        for name, table in tables.items():
            with book.noted():
                devices[name] = book.device(name, table)
            if passed and name not in devices:
                unusable[name] = passed[-1]
    return Config(path, text, values, devices, unusable)


def from_toml(text: str) -> dict[str, Any]:
    """TOML as data. Raises ValueError and, nested too deeply, RecursionError."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib
    data: dict[str, Any] = tomllib.loads(text)
    return data


def _toml(path: str, text: str) -> dict[str, Any]:
    try:
        return from_toml(text)
    except (ValueError, RecursionError) as exc:  # ValueError: TOMLDecodeError, and numbers beyond Python's limit
        import re

        what = str(exc) if isinstance(exc, ValueError) else "nested too deeply"
        place = re.search(r" \(at line (\d+), column (\d+)\)$", what)
        line = int(place[1]) if place else text.count("\n") + 1 if "at end of document" in what else None
        what = what.partition(" (at ")[0] + (f" at column {place[2]}" if place else "")
        raise _wrong(path, line, f"not valid TOML: {what}", "correct that line: put texts in quotes") from exc


@fast_dataclass(eq=False)
class _Book:
    """Check the entries of one file and know the line of each."""

    path: str
    lines: Mapping[tuple[str, ...], int]
    checks: Mapping[str, Check]
    passed: list[UsageError] | None

    def line(self, place: tuple[str, ...]) -> int | None:
        while place and place not in self.lines:
            place = place[:-1]
        return self.lines.get(place)

    def wrong(self, place: tuple[str, ...], text: str, hint: str) -> UsageError:
        return _wrong(self.path, self.line(place), text, hint)

    @contextlib.contextmanager
    def noted(self) -> Iterator[None]:
        """Ignore errors in here, if requested."""
        try:
            yield
        except UsageError as exc:
            if self.passed is None:
                raise
            self.passed.append(exc)

    def entries(
        self, place: tuple[str, ...], table: Mapping[str, Any], known: tuple[str, ...], what: str
    ) -> dict[str, Entry]:
        found: dict[str, Entry] = {}
        for key, value in table.items():
            with self.noted():
                found[key] = self.entry((*place, key), value, known, what)
        return found

    def entry(self, place: tuple[str, ...], value: Any, known: tuple[str, ...], what: str) -> Entry:
        key = place[-1]
        if key not in known:
            from handctl.misspellings import near

            close = near(key, known)
            meant = f"Did you mean {' or '.join(close)}? " if close else ""
            raise self.wrong(place, f"{key}: no such {what}", f"{meant}Known: {', '.join(known)}")
        try:
            return Entry(self.checks[key](value), self.line(place))
        except ValueError as exc:
            shown = repr(value) if isinstance(value, str | int | float) else "the value"
            raise self.wrong(place, f"{key} = {shown}: {exc}", "correct that line") from exc

    def device(self, name: str, table: Any) -> Device:
        place = ("devices", name)
        if not is_name(name):
            raise self.wrong(place, f"{name!r} cannot be the name of a device", f"allowed: {NAME_HELP}")
        if not isinstance(table, dict):
            raise self.wrong(place, f"devices.{name} must be a table", f"write [devices.{name}]")
        try:
            kind = self.kind(name, table)
        except UsageError as exc:
            if self.passed is None or "port" not in (entries := self.rest(place, table)):
                raise
            self.passed.append(exc)
            return Device(name, "", entries, self.line(place))
        if "port" not in table:
            raise self.lacks(name, "port")
        known = ("kind", *DEVICE_KEYS, *(option.key for option in FAMILIES[kind].options if option.named))
        table = {key: value for key, value in table.items() if key != "kind"}
        entries = self.entries(place, table, known, f"key of a device of family {kind}")
        return Device(name, kind, entries, self.line(place))

    def rest(self, place: tuple[str, ...], table: Mapping[str, Any]) -> dict[str, Entry]:
        """What a device of no family says that every one may say, as far as it is right."""
        silent = _Book(self.path, self.lines, self.checks, [])
        return silent.entries(place, table, DEVICE_KEYS, "key")

    def kind(self, name: str, table: Mapping[str, Any]) -> str:
        """The family of a device. Raises UsageError."""
        if "kind" not in table:
            raise self.lacks(name, "kind")
        kind = table["kind"]
        if kind not in list(FAMILIES):
            place = ("devices", name, "kind")
            raise self.wrong(place, f"kind = {kind!r}: no such device family", f"one of {', '.join(FAMILIES)}")
        return str(kind)

    def lacks(self, name: str, key: str) -> UsageError:
        """The error of a device without a key that every one has."""
        return self.wrong(
            ("devices", name), f"device {name} has no {key}", f"add a line {key} = …, or remove the table"
        )


def _wrong(path: str, line: int | None, text: str, hint: str) -> UsageError:
    where = f"{path}, line {line}" if line is not None else path
    return UsageError(f"{where}: {text}", hint=hint, code="config")


# -- where things stand in the text ---------------------------------------------------------------------------------

TOKENS = (
    r'"""(?:\\[\s\S]|[^\\])*?""""{0,2}'
    r"|'''[\s\S]*?''''{0,2}"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'[^'\n]*'"
    r"|#[^\n]*|[\[\]{}\n]"
    r"""|[^"'#\[\]{}\n]+"""
)
"""The pieces of a valid TOML text: strings, comments, brackets, line ends, and the rest."""


def statements(text: str) -> Iterator[Statement]:
    """The statements of a valid TOML text in order; blank and comment lines are none."""
    import re
    from itertools import chain

    table: tuple[str, ...] = ()
    start = code_end = depth = 0
    for found in chain(re.finditer(TOKENS, text), (None,)):
        token = found[0] if found is not None else "\n"
        if token == "\n" and depth == 0:
            end = found.end() if found is not None else len(text)
            body = text[start:code_end].strip()
            if code_end > start and body:
                header = body.startswith("[")
                path = (*(() if header else table), *_key(body))
                table = path if header else table
                yield Statement(start, end, code_end, path, header)
            start = code_end = end
        elif found is not None and not token.startswith("#"):
            depth += (token in "[{") - (token in "]}")
            code_end = found.start() + len(token.rstrip()) if token.strip() else code_end


def _key(body: str) -> Iterator[str]:
    node: Any = from_toml(body)
    while True:
        if isinstance(node, list) and len(node) == 1:
            node = node[0]
        if not isinstance(node, dict) or len(node) != 1:
            return
        ((key, node),) = node.items()
        yield key


def lines_of(text: str) -> dict[tuple[str, ...], int]:
    """Key -> number of its line, or of the first line below it."""
    lines: dict[tuple[str, ...], int] = {}
    line, counted = 1, 0
    for statement in statements(text):
        line += text.count("\n", counted, statement.start)
        counted = statement.start
        for length in range(1, min(len(statement.path), DEEPEST) + 1):
            lines.setdefault(statement.path[:length], line)
    return lines
