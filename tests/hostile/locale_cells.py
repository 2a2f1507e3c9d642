"""Places whose stdout cannot show every character: help of every group and command, and the main verbs of every family."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

from handctl.command.command_tree import root
from handctl.families import FAMILIES
from tests.harm.lines import leaves
from tests.hostile.cell import FORMATS, harmless, judge_json
from tests.hostile.texts import LINK
from tests.support.cli import Result, clean_environment

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


def rows() -> Iterator[tuple[str, tuple[str, ...], str]]:
    """Encoding, words, format."""
    for encoding in ENCODINGS:
        for words in lines():
            for how in ("table", "always", "csv", "json") if "-h" not in words else ("table",):
                yield encoding, words, how


def try_locale(encoding: str, words: tuple[str, ...], how: str, folder: Path) -> tuple[int, str]:
    """One command there: its exit code, and what is wrong."""
    code, out, err = run_in(encoding, (*words, *FORMATS[how]), folder)
    return code, judge(code, out, err, encoding, how)
