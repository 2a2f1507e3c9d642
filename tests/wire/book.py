"""golden.txt: one line a cell, in the order of `cells`; written, read, replayed and compared."""

from __future__ import annotations

import multiprocessing
import os
import tempfile
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path

from tests.wire.cells import cells, groups
from tests.wire.record import Record, Recorder

GOLDEN = Path(__file__).with_name("golden.txt")
HEAD = """\
# What every command of handctl sends, shows and returns, cell by cell: see tests/wire/__init__.py. Not written by hand.
# A change of behaviour changes lines here, and its commit says why. `python -m tests.wire` replays all,
# `--diff CELL` shows what changed, `--write` (with `--only TEXT`) writes them again.
"""
Lines = dict[str, str]
"""Cell -> what it came to."""


def golden() -> Lines:
    """What is written down."""
    lines = GOLDEN.read_text(encoding="utf-8").splitlines() if GOLDEN.exists() else []
    return dict(parted(line) for line in lines if line and not line.startswith("#"))


def parted(line: str) -> tuple[str, str]:
    """A line of the file: its cell, and what that came to."""
    name, _, rest = line.partition(" | exit ")
    return name, f"exit {rest}"


def write(found: Mapping[str, str]) -> None:
    """Write the file: these cells, and what is known of the others that there are."""
    known = {**golden(), **found}
    lines = [f"{key} | {known[key]}" for key in cells() if key in known]
    GOLDEN.write_text(HEAD + "\n".join(lines) + "\n", encoding="utf-8")


def differing(found: Mapping[str, str], known: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """The cells of `found` that are not as they are `known`, each with the parts that differ."""
    for key, line in found.items():
        if key not in known:
            yield key, "not in golden.txt"
        elif known[key] != line:
            yield key, ", ".join(_parts(known[key], line))


def _parts(before: str, after: str) -> list[str]:
    """``exit 0 -> 5``, ``wire``."""
    one, other = (dict(part.split(" ", 1) for part in line.split(" | ")) for line in (before, after))
    names = [name for name in {**one, **other} if one.get(name) != other.get(name)]
    return [f"exit {one[name]} -> {other[name]}" if name == "exit" else name for name in names]


# -- replayed -------------------------------------------------------------------------------------------------------------


def record(key: str) -> Record:
    """One cell, in a folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        return Recorder(Path(folder)).record(cells()[key])


def line(record: Record) -> str:
    """What golden.txt has of it."""
    return record.line


def replayed(recorder: Recorder, keys: Iterable[str], of: Callable[[Record], str] = line) -> Lines:
    """These cells, one behind the other."""
    return {key: of(recorder.record(cells()[key])) for key in keys}


def replay(keys: list[str], jobs: int, of: Callable[[Record], str] = line) -> Lines:
    """These cells, in so many processes; in their order. Raises RuntimeError, naming the cell, where one cannot be run.

    `of` takes from a record what is kept; it begins with its exit code.
    """
    found: Lines = {}
    pool = multiprocessing.get_context("fork").Pool(jobs)
    for lines in pool.imap_unordered(partial(_group, of), groups(keys)):
        found |= lines
    pool.close()  # its processes end by themselves: a signal might be taken for the Ctrl-C of a cell
    pool.join()
    failed = [f"{key}: {line}" for key, line in found.items() if not line.startswith("exit ")]
    if failed:
        raise RuntimeError("\n".join(failed))
    return {key: found[key] for key in keys}


_recorders: dict[int, tuple[tempfile.TemporaryDirectory[str], Recorder]] = {}
"""That of a process of the pool, which keeps its folder."""


def _group(of: Callable[[Record], str], keys: list[str]) -> Lines:
    if os.getpid() not in _recorders:
        folder = tempfile.TemporaryDirectory()
        _recorders[os.getpid()] = folder, Recorder(Path(folder.name))
    try:
        return replayed(_recorders[os.getpid()][1], keys, of)
    except Exception:  # noqa: BLE001 - told by whoever waits for it, with the cell's name
        return {keys[0]: traceback.format_exc()}
