"""Places whose stdout cannot show every character: help of every group and command, and the main verbs of every family."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path
from unittest import mock

import pytest

from handctl.families import FAMILIES
from handctl.frame.clikit import root
from tests.harm.lines import leaves
from tests.hostile.cell import FORMATS, Cell, harmless, judge_json
from tests.hostile.table import Tried, note, share
from tests.hostile.texts import LINK
from tests.support.cli import Result, clean_environment, program

pytestmark = pytest.mark.hostile

ENCODINGS = ("ascii", "latin-1", "gbk", "cp1252", "cp437", "utf-16")
VERBS = ("status", "dump", "describe", "watch")


def _groups() -> list[tuple[str, ...]]:
    paths = {path[:size] for path, _ in leaves(root, ()) for size in range(len(path) + 1)}
    return sorted(paths)


def lines() -> list[tuple[str, ...]]:
    """Help of everything in the tree, and what the families show."""
    found = [(*path, "-h") for path in _groups()]
    for family in FAMILIES:
        for verb in VERBS:
            more = () if verb == "describe" else ("-p", LINK.format(family))
            found.append((family, verb, *more, *(("--count", "2") if verb == "watch" else ())))
        found.append((family, "get", "\u00b0é手\x1b", "-p", LINK.format(family)))
    return [*found, ("doctor",), ("ports",), ("devices", "list"), ("nonsense °",)]


def run_in(encoding: str, words: tuple[str, ...], folder: Path) -> tuple[int, bytes, bytes]:
    """Run handctl in this process with streams of this encoding, strict as a locale makes them."""
    from handctl import cli

    out, err = (io.TextIOWrapper(io.BytesIO(), encoding=encoding, errors="strict", newline="") for _ in range(2))
    env = clean_environment({"XDG_STATE_HOME": str(folder / "state"), "XDG_RUNTIME_DIR": str(folder)})
    with (
        mock.patch.dict(os.environ, env, clear=True),
        mock.patch.object(sys, "stdout", out),
        mock.patch.object(sys, "stderr", err),
        mock.patch.object(sys, "stdin", io.StringIO()),
    ):
        code = cli.main(list(words))
        out.flush()
        err.flush()
    return code, out.buffer.getvalue(), err.buffer.getvalue()  # type: ignore[attr-defined]


def judge(code: int, out: bytes, err: bytes, encoding: str, how: str) -> str:
    """What is wrong with what came out there."""
    told = err.decode(encoding)
    if code not in (0, 2, 7) or "Traceback" in told or "internal error" in told:
        return f"exit {code}: {told[-200:]}"
    if not harmless(told):
        return f"stderr acts on a terminal: {told[-200:]!r}"
    if how == "json":
        return judge_json(Result(code, out, told.encode()))
    try:
        text = out.decode(encoding)
    except UnicodeError as exc:
        return f"stdout is not {encoding}: {exc}"
    return "" if harmless(text, "\r\n") else "stdout acts on a terminal"


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_place_that_lacks_characters(encoding: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    tried = Tried(request)
    for words in lines():
        hows = ("table", "always", "csv", "json") if "-h" not in words else ("table",)
        for how in hows:
            if share(request.config, f"{encoding}|{words}|{how}"):
                code, out, err = run_in(encoding, (*words, *FORMATS[how]), tmp_path)
                failure = judge(code, out, err, encoding, how)
                name = words[0] if words[0] in FAMILIES else "tools"
                tried.append(Cell(name, f"locale: {encoding}", f"{' '.join(words)} --{how}", code, failure))
    note(request, tried)


PLACES = (
    {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    {"LC_ALL": "POSIX", "LANG": "nonsense"},
    {"PYTHONIOENCODING": "ascii:strict"},
    {"PYTHONIOENCODING": "latin-1"},
    {"PYTHONIOENCODING": "gbk"},
)
PROGRAMS = (
    (b"-h",),
    (b"exo", b"dump", b"--fake"),
    (b"exo", b"get", b"\xff\x9b31m", b"--fake", b"--json"),
    (b"ekso", b"describe"),
)


@pytest.mark.real
@pytest.mark.parametrize("place", PLACES, ids=lambda place: " ".join(place.values()))
def test_the_same_as_a_program(place: dict[str, str], tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """The locale of the system, and bytes in an argument."""
    tried = Tried(request)
    encoding = place.get("PYTHONIOENCODING", "ascii").partition(":")[0]
    env = clean_environment({**place, "XDG_STATE_HOME": str(tmp_path)})
    for words in PROGRAMS:
        if not share(request.config, f"{place}|{words!r}", 4):
            continue
        command = [*map(os.fsencode, program()), *words]
        done = subprocess.run(command, capture_output=True, env=env, timeout=60, check=False, stdin=subprocess.DEVNULL)
        how = "json" if b"--json" in words else "table"
        spoken = "utf-8" if "POSIX" in place.values() else encoding  # Python takes UTF-8 there
        failure = judge(done.returncode, done.stdout, done.stderr, spoken, how)
        line = b" ".join(words).decode("ascii", "backslashreplace")
        tried.append(Cell("tools", f"program: {' '.join(place.values())}", line, done.returncode, failure))
    note(request, tried)
