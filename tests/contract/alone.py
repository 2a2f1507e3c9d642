"""A command run by itself: what a batch and the library are compared with."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tests.contract.facts import facts_of
from tests.support.cli import Result, run

PASSES = ("t", "time", "host_t", "seconds", "file", "sidecar", "size", "sha256")
"""Keys of a row that tell a time, a file, or what holds one."""


def words_of(family: str, name: str, folder: Path) -> list[str]:
    """The command as it is typed behind `handctl`."""
    return [family, *name.split(), *facts_of(family).words(name, folder)]


def alone(words: list[str], folder: Path, *more: str) -> Result:
    """Run one command as it is."""
    (folder / "trace.txt").unlink(missing_ok=True)
    env = {"XDG_STATE_HOME": str(folder / "state")}
    return run(*words, "--format", "ndjson", "--trace", folder / "trace.txt", *more, env=env)


def steady(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [{key: value for key, value in row.items() if key not in PASSES} for row in rows]
