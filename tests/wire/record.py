"""One cell of the golden wire: run in process and on virtual time, and the parts of what it left behind, as text.

Everything that belongs to a machine, a checkout, a user or a moment is taken away here, and only here.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any
from unittest import mock

from handctl import __version__
from handctl.system import user_folders
from tests.contract.commands import scratch_of
from tests.contract.facts import facts_of
from tests.harm.lines import prepare
from tests.support.cli import Result, environment, run
from tests.wire import seams
from tests.wire.cells import Cell
from tests.wire.seams import Passed, Wire

FIELD = Path(__file__).parents[1] / "field"
"""Recordings and facts of simulators, one of each family."""
PARTS = ("wire", "pace", "envelope", "text", "files")
"""wire      what passed on the links, and what the child is told that outlives the process
pace      when the host spoke, by the clock of the link, and every time that the envelope tells
envelope  rows and envelope of NDJSON, without times and version
text      stdout and stderr as people get them
files     what was left in the folder
"""
# A year is looked for by its first digits, and that it begins a word behind them: the other way each place would be tried.
MOMENTS = re.compile(r"20(?<!\w20)\d\d-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d+)?(?:Z| ?[+-]\d\d:?\d\d)?")
STAMPS = re.compile(r"20(?<!\w20)\d{6}T\d{6}Z\b")
A_SUM = re.compile(r"[0-9a-f]{64}")
SUMS = re.compile(r"(\b\d+( +))?\b[0-9a-f]{64}\b")
KEYS = re.compile(r'("(?:host|user|size)": )(?:"[^"]*"|\d+)')
TIMED = {"t", "host_t", "seconds", "round_trip_ms", "spread_ms"}
"""Keys whose value is a time."""
DROPPED = {"version", "time", "started", "size", "sha256"}
ENDING = (signal.SIGINT, signal.SIGQUIT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP)
HASHED = 6
"""Digits of a hash."""


@dataclass
class Record:
    """What came of a cell: its exit codes, in JSON and for people, and its parts."""

    codes: tuple[int, ...]
    parts: dict[str, str] = field(default_factory=dict)

    @property
    def line(self) -> str:
        """What golden.txt has behind the name."""
        codes = "/".join(map(str, dict.fromkeys(self.codes)))
        return " | ".join([f"exit {codes}", *(f"{part} {digest(text)}" for part, text in self.parts.items() if text)])

    def shown(self) -> str:
        """All of it, to be read and compared."""
        codes = f"=== exit\n{'/'.join(map(str, dict.fromkeys(self.codes)))}\n"
        return codes + "".join(f"=== {part}\n{text.rstrip()}\n" for part, text in self.parts.items() if text)


def digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:HASHED]


# -- the place ------------------------------------------------------------------------------------------------------------


class Scratch:
    """A folder with the files that command lines name; it is as before behind every run."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        prepare(folder)
        scratch_of(folder)
        for recording in FIELD.glob("simulated-*"):
            shutil.copyfile(recording, folder / recording.name)
        self._kept = {name: (folder / name).read_bytes() for name in self._files()}
        self._seen = {name: (folder / name).stat().st_mtime_ns for name in self._kept}

    def _files(self) -> dict[str, int]:
        """The files by name, with the moment at which each was changed."""
        found: dict[str, int] = {}
        folders = [("", str(self.folder))]
        while folders:
            above, path = folders.pop()
            with os.scandir(path) as entries:
                for entry in entries:
                    if entry.is_dir(follow_symlinks=False):
                        folders.append((f"{above}{entry.name}/", entry.path))
                    elif entry.is_file(follow_symlinks=False):
                        found[above + entry.name] = entry.stat().st_mtime_ns
        return dict(sorted(found.items(), key=lambda item: item[0].split("/")))

    def swept(self) -> dict[str, bytes]:
        """What a run has left, by name; then it is gone."""
        left = {}
        present = self._files()
        for name, changed in present.items():
            if self._seen.get(name) == changed:
                continue
            path = self.folder / name
            left[name] = path.read_bytes()
            if name in self._kept:
                path.write_bytes(self._kept[name])
                self._seen[name] = path.stat().st_mtime_ns
            else:
                path.unlink()
        for name in sorted(self._kept.keys() - present.keys()):
            left[name] = b"(removed)"
            (self.folder / name).write_bytes(self._kept[name])
        return left


@contextmanager
def at(scratch: Scratch) -> Iterator[None]:
    """In the scratch folder, with an environment that is the same on every machine."""
    before = os.getcwd()
    folder = str(scratch.folder)
    own = {
        **{name: os.path.join(folder, "own") for name in ("XDG_STATE_HOME", "XDG_RUNTIME_DIR", "TMPDIR", "HOME")},
        "TZ": "UTC",
        "LANG": "C.UTF-8",
        "PATH": os.defpath,
        "LOGNAME": "tester",
        "USER": "tester",
    }
    (scratch.folder / "own").mkdir(mode=0o700, exist_ok=True)
    before_all = {number: signal.getsignal(number) for number in ENDING}
    with environment(own), mock.patch.object(user_folders, "shared_folder", lambda: own["HOME"]):
        os.chdir(folder)
        time.tzset()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            yield
        finally:
            for number, handler in before_all.items():
                signal.signal(number, handler)
            os.chdir(before)
    time.tzset()


# -- a cell ---------------------------------------------------------------------------------------------------------------


class Recorder:
    """Runs cells in one scratch folder."""

    def __init__(self, folder: Path) -> None:
        self.scratch = Scratch(folder)
        self._usual: dict[tuple[str, ...], list[Passed]] = {}
        """Command line -> what passes when nothing disturbs it."""

    def record(self, cell: Cell) -> Record:
        """Run a cell twice, for a program and for a person; one that dies once, for its frames are all that is kept."""
        with at(self.scratch):
            place = self._place(cell) if cell.end else None
            shown = ("--format", cell.format) if cell.format else ()
            wire, result, _ = self._ran(cell, "ndjson", place)
            if place is None:
                self._usual[cell.words] = wire.passed
            elif cell.end == "death":
                return Record((), {"wire": "\n".join(_lines(wire))})
            people, told, files = self._ran(cell, cell.format, place)
        rows, envelope, times = _read(result)
        record = Record((result.code, told.code))
        record.parts["wire"] = "\n".join(_lines(wire))
        if (other := "\n".join(_lines(people))) != record.parts["wire"]:
            record.parts["wire"] += f"\n--- {' '.join(shown) or 'for people'}\n{other}"
        record.parts["pace"] = "\n".join([*_moments(wire), *times])
        record.parts["envelope"] = self._plain("\n".join([*rows, *envelope]))
        record.parts["text"] = self._plain(f"--- stdout\n{told.out}--- stderr\n{told.err}")
        record.parts["files"] = self._plain("".join(f"--- {name}\n{_text(data)}\n" for name, data in files.items()))
        return record

    def _place(self, cell: Cell) -> Any:
        """Makes what acts at the cell's place, which the undisturbed run tells."""
        usual = self._usual.get(cell.words)
        if usual is None:
            wire, _, _ = self._ran(cell, "ndjson", None)
            usual = self._usual[cell.words] = wire.passed
        mark = ">" if any(one.mark == ">" for one in usual) else "<"
        count = sum(one.mark == mark for one in usual)
        behind = {"behind the first frame": 1, "in the middle": max(1, count // 2)}.get(cell.place)
        if behind is None:
            behind = (cell.writes and _last_writing(cell, usual)) or count
        return partial(seams.Place, behind, mark)

    def _ran(self, cell: Cell, form: str, place: Any) -> tuple[Wire, Result, dict[str, bytes]]:
        """One run: what passed, what it showed, what it left."""
        wire = Wire()
        heir = seams.Child(wire)
        acts = {"ctrl-c": seams.ctrl_c, "other": seams.other_handctl, "death": heir.act}
        wire.place = place(acts[cell.end]) if place is not None else None
        with ExitStack() as stack:
            stack.enter_context(seams.watched(wire))
            if place is not None and cell.end == "death":
                stack.enter_context(seams.mortal(wire, heir))
            try:
                result = run(*cell.words, *(("--format", form) if form else ()))
            except seams.Dead:
                result = Result(0, b"", b"")
        return wire, result, self.scratch.swept()

    def _plain(self, text: str) -> str:
        """Without what belongs to this machine, this checkout or this moment."""
        text = text.replace(str(self.scratch.folder), "<folder>").replace(__version__, "<version>")
        text = STAMPS.sub("<stamp>", MOMENTS.sub("<moment>", text))
        text = KEYS.sub(r"\1<own>", SUMS.sub("<sum>", text) if A_SUM.search(text) else text)
        return text.replace(sys.executable, "<python>")


def _last_writing(cell: Cell, passed: list[Passed]) -> int:
    """The number of the last frame that writes, by the family's own rule; 0 = none."""
    rule = facts_of(cell.family).rule(cell.command)
    sent = last = 0
    for one in passed:
        if one.mark not in "<>":
            continue
        writes = rule(one)  # type: ignore[arg-type]
        sent += one.mark == ">"
        if writes and one.mark == ">":
            last = sent
    return last


def _lines(wire: Wire) -> list[str]:
    """What passed, one frame a line; what came in pieces is one line, for who reads decides how large they are."""
    several, lines = len(wire.links) > 1, []

    def kind(one: Passed) -> tuple[Any, ...]:
        joined = one.mark == "<" and one.can_id is None
        return (one.link, "<") if joined else (one.link, id(one))

    for _, group in groupby(wire.passed, kind):
        first, *more = group
        data = b"".join(one.data for one in (first, *more))
        can = f"can {first.can_id:08X} [{len(data)}] " if first.can_id is not None else ""
        where = f"{first.link + 1} " if several and first.mark != "+" else ""
        lines.append(f"{where}{first.mark} {first.text or can + data.hex(' ').upper()}".rstrip())
    return lines


def _moments(wire: Wire) -> list[str]:
    """When the host spoke, and when each link was left, in seconds."""
    sent = [f"> {one.at:.3f}" for one in wire.frames()]
    return [*sent, *(f"left at {link.now():.3f}" for link in wire.links)]


def _read(result: Result) -> tuple[list[str], list[str], list[str]]:
    """Rows and envelope of NDJSON without times, and the times; of what is no JSON the lines as they are."""
    times: list[str] = []
    rows: list[str] = []
    envelope: list[str] = []
    for text in result.lines:
        try:
            content = json.loads(text)
        except ValueError:
            rows.append(text)
            continue
        if isinstance(content, dict) and set(content) == {"end"}:
            end = _steady(content["end"], times)
            envelope += [f"{key}: {line}" for key, value in end.items() for line in _spread(value)]
        else:
            rows.append(json.dumps(_steady(content, times), ensure_ascii=False))
    return rows, [*envelope, *(f"stderr: {line}" for line in result.err.splitlines())], times


def _spread(value: Any) -> list[str]:
    """A list as a line for each of its members."""
    return [json.dumps(one, ensure_ascii=False) for one in (value if isinstance(value, list) else [value])]


def _steady(value: Any, times: list[str]) -> Any:
    if isinstance(value, list):
        return [_steady(one, times) for one in value]
    if not isinstance(value, dict):
        return value
    times += [f"{key} {value[key]}" for key in value if key in TIMED]
    return {key: _steady(one, times) for key, one in value.items() if key not in TIMED | DROPPED}


def _text(data: bytes) -> str:
    """A file for people: bytes that are no text by their digits."""
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.hex(" ")
