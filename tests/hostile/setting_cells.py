"""Variables and a configuration file full of nonsense: every HANDCTL_*, every key, before commands that talk, stop and list."""

from __future__ import annotations

import zlib
from collections.abc import Iterator

from handctl.command.options import lasting_options
from handctl.families import FAMILIES
from tests.hostile.cell import FORMATS, Folder, Tried, attempt
from tests.hostile.texts import LINK, TEXTS

NAMES = sorted({str(option.name) for option in lasting_options(("serial", "can"))})
TOML = {
    "a whole number": "7",
    "a negative number": "-1",
    "not a number": "nan",
    "no bound": "-inf",
    "digits": "9" * 5_000,
    "a truth": "true",
    "a list": '["a", {b = 1}]',
    "a table": '{a = "b"}',
    "a date": "1979-05-27T07:32:00Z",
    "an empty text": '""',
    "escapes": '"\\u001b]0;x\\u0007\\u202e\\u009b31m\\u0000"',
    "a huge text": '"' + "A" * 100_000 + '"',
    "not UTF-8": "'\udcff'",
    "half a text": '"a',
}


def commands() -> list[tuple[str, ...]]:
    """What is tried with each: a reading command and the stop of every family, and tools that open no device."""
    found: list[tuple[str, ...]] = [("devices", "list"), ("ports",), ("completion", "bash"), ("trace", "show", "none")]
    for family in FAMILIES:
        found += [(family, "status", "-p", LINK.format(family)), (family, "status"), (family, "stop", "-p", LINK.format(family)), (family, "describe")]  # fmt: skip
    return found


def turns(name: str, kind: str, count: int = 3) -> list[tuple[str, ...]]:
    """The commands of one cell: they take turns."""
    every = commands()
    start = zlib.crc32(f"{name}{kind}".encode())
    return [every[(start + number * 7) % len(every)] for number in range(count)]


def _how(*of: object) -> str:
    return tuple(FORMATS)[zlib.crc32(repr(of).encode()) % len(FORMATS)]


def variables() -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Variable, text, command."""
    for name in NAMES:
        for kind in TEXTS:
            for words in turns(name, kind):
                yield name, kind, words


def try_variable(name: str, kind: str, words: tuple[str, ...], folder: Folder) -> Tried:
    """A command with nonsense in a variable."""
    how = _how(name, kind, words)
    env = {f"HANDCTL_{name.upper()}": TEXTS[kind]}
    return attempt([*words, *FORMATS[how]], "json" if how == "json" else "any", folder, env)


def settings() -> Iterator[tuple[str, str, str, tuple[str, ...]]]:
    """Key, text, where it stands, command."""
    for name in (*NAMES, "devices", "unknown"):
        for kind in TOML:
            for where in ("top", "device"):
                for words in turns(name, kind, 2):
                    yield name, kind, where, words


def try_key(name: str, kind: str, where: str, words: tuple[str, ...], folder: Folder) -> Tried:
    """A command with nonsense in its configuration: at the top of the file, or in a named device."""
    body = f"{name} = {TOML[kind]}\n" if where == "top" else f'[devices.left]\nkind = "exo"\n{name} = {TOML[kind]}\n'
    config = folder.path / "config.toml"
    config.write_bytes(body.encode("utf-8", "surrogateescape"))
    folder.keep()
    how = _how(name, kind, words)
    more = ("-d", "left") if where == "device" and "-p" not in words and words[0] in FAMILIES else ()
    env = {"HANDCTL_CONFIG": str(config)}
    return attempt([*words, *more, *FORMATS[how]], "json" if how == "json" else "any", folder, env)
