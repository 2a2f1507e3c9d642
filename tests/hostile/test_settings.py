"""Variables and a configuration file full of nonsense: every HANDCTL_*, every key, before commands that talk, stop and list."""

from __future__ import annotations

import zlib
from pathlib import Path

import pytest

from handctl.families import FAMILIES
from handctl.frame.options import lasting_options
from tests.harm import lines
from tests.hostile.cell import FORMATS, Cell, Folder, attempt
from tests.hostile.table import Tried, note, share
from tests.hostile.texts import LINK, TEXTS

pytestmark = pytest.mark.hostile

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


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Folder:
    """A folder to stand in: nonsense may be the name of an output."""
    (tmp_path / "here").mkdir()
    (tmp_path / "exo").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return Folder(tmp_path)


def chosen(name: str, kind: str, count: int = 3) -> list[tuple[str, ...]]:
    """The commands of one cell: they take turns."""
    every = commands()
    start = zlib.crc32(f"{name}{kind}".encode())
    return [every[(start + number * 7) % len(every)] for number in range(count)]


def _how(*of: object) -> str:
    return tuple(FORMATS)[zlib.crc32(repr(of).encode()) % len(FORMATS)]


@pytest.mark.parametrize("name", NAMES)
def test_a_variable_of_nonsense(name: str, folder: Folder, request: pytest.FixtureRequest) -> None:
    tried = Tried(request)
    for kind, text in TEXTS.items():
        for words in chosen(name, kind):
            if not share(request.config, f"{name}|{kind}|{words}"):
                continue
            how = _how(name, kind, words)
            env = {f"HANDCTL_{name.upper()}": text}
            code, failure = attempt([*words, *FORMATS[how]], "json" if how == "json" else "any", folder, env)
            tried.append(
                Cell(words[0], f"variable: {kind}", f"HANDCTL_{name.upper()} {' '.join(words)} --{how}", code, failure)
            )
    note(request, tried)


@pytest.mark.parametrize("name", [*NAMES, "devices", "unknown"])
def test_a_key_of_nonsense(name: str, folder: Folder, request: pytest.FixtureRequest) -> None:
    """At the top of the file, and in a named device."""
    tried = Tried(request)
    for kind, text in TOML.items():
        for where, body in (
            ("top", f"{name} = {text}\n"),
            ("device", f'[devices.left]\nkind = "exo"\n{name} = {text}\n'),
        ):
            for words in chosen(name, kind, 2):
                if not share(request.config, f"{name}|{kind}|{words}|{where}"):
                    continue
                config = folder.path / "config.toml"
                config.write_bytes(body.encode("utf-8", "surrogateescape"))
                folder.keep()
                how = _how(name, kind, words)
                more = ("-d", "left") if where == "device" and "-p" not in words and words[0] in FAMILIES else ()
                code, failure = attempt(
                    [*words, *more, *FORMATS[how]],
                    "json" if how == "json" else "any",
                    folder,
                    {"HANDCTL_CONFIG": str(config)},
                )
                line = f"{name} ({where}) {' '.join(words)} --{how}"
                tried.append(Cell(words[0], f"key: {kind}", line, code, failure))
    note(request, tried)


def test_each_option_is_tried() -> None:
    assert {"port", "timeout", "format", "yes", "trace", "output", "debug", "poll_json"} <= set(NAMES)
    assert {words[0] for words in commands()} >= set(FAMILIES)
    assert lines.tree()
