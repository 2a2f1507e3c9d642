"""Ctrl-C at each line of the program that runs behind the first byte of a command that writes: between two steps too, not
only where it waits.

Either the exit code is 130, and what moves was told to stop, or the command had done its work, and its result is there
with exit code 0. In both cases the ledger knows what went out.

A place is a line by its text, in a function of a module, when it runs for the first or for the last time: it stays where it
is when other lines move. Only the package's own lines are followed, and not its simulators'.
"""

from __future__ import annotations

import ast
import json
import os
import shlex
import shutil
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import CodeType, FrameType
from typing import Any, NamedTuple
from unittest import mock

import handctl
from handctl.families import FAMILIES
from handctl.link.fake import FakeFrames, FakeLink
from handctl.model.stop_on_interrupt import NOT_STOPPED
from tests.contract.cell import judge, wrote
from tests.contract.commands import ELSEWHERE, SECONDS, commands, scratch_of
from tests.contract.facts import Passed, facts_of, passed
from tests.search.suite import Suite, bounded, key, parts
from tests.support import syntax
from tests.support.cli import Result, run

PACKAGE = os.path.join(os.path.dirname(handctl.__file__), "")
DEVICES = os.path.join(PACKAGE, "sim", "")
"""Code that is no part of the command."""
FIRST, LAST = "first", "last"


class Moving(NamedTuple):
    """A command line of a family, and the bytes that stop what it has set going; b"" = nothing has to."""

    family: str
    words: str
    halt: bytes

    @property
    def key(self) -> str:
        """How the cells of it begin."""
        return key(AnyLine.name, self.family, self.words)


@cache
def writing() -> dict[str, Moving]:
    """Every command line that is tried, by how its cells begin."""
    found = [Moving(family, *row) for family in FAMILIES for row in (facts_of(family).unwatched or {}).items()]
    for family in FAMILIES:
        facts = facts_of(family)
        found += [
            Moving(family, f"{name} {shlex.join(facts.words(name, Path('{dir}')))}", (facts.halts or {}).get(name, b""))
            for name, command in commands(family)
            if command.writes and not command.stops and (family, name) not in ELSEWHERE
        ]
    return {one.key: one for one in found}


# -- places -----------------------------------------------------------------------------------------------------------


@cache
def lines_of(path: str) -> tuple[tuple[str, str], ...]:
    """Function and text of each line of a module; the first is line 0. A comprehension is in the function around it."""
    with open(path, encoding="utf-8") as file:
        source = file.read()
    owners = ["-"] * (len(texts := ["", *source.split("\n")]))

    def below(node: ast.AST, name: str) -> None:
        for child in syntax.below(node):
            inner = name
            if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                inner = f"{name}.{child.name}".removeprefix("-.")
                last = child.end_lineno or child.lineno
                owners[child.lineno : last + 1] = [inner] * (last + 1 - child.lineno)
            below(child, inner)

    below(ast.parse(source), "-")
    return tuple((owner, key(text)) for owner, text in zip(owners, texts, strict=True))


Place = tuple[str, str, str]
"""Module below the package, function, text of the line."""


def place_of(path: str, line: int) -> Place:
    return (os.path.relpath(path, PACKAGE).replace(os.sep, "/"), *lines_of(path)[line])


def numbers(place: Place) -> tuple[str, frozenset[int]]:
    """The file of a place, and the lines that have its text; none where it has gone."""
    path = os.path.join(PACKAGE, place[0])
    found = enumerate(lines_of(path)) if os.path.exists(path) else ()
    return path, frozenset(number for number, line in found if line == place[1:])


# -- a run ------------------------------------------------------------------------------------------------------------


class Stepper:
    """Follows the program line by line once it has sent something."""

    def __init__(self, only: str = "", lines: frozenset[int] = frozenset()) -> None:
        self.only, self.lines = only, lines
        """The one file that is followed, where a function has one of these lines; "" = all."""
        self.began = False
        self._passed: dict[CodeType, bool] = {}

    def call(self, frame: FrameType, _event: str, _arg: object) -> Any:
        """What the interpreter asks at each call: who follows its lines."""
        code = frame.f_code
        name = code.co_filename
        if self.only:
            if code not in self._passed:
                own = name == self.only and not self.lines.isdisjoint(line or 0 for *_, line in code.co_lines())
                self._passed[code] = not own
            return None if self._passed[code] else self.line
        return self.line if name.startswith(PACKAGE) and not name.startswith(DEVICES) else None

    def line(self, frame: FrameType, event: str, _arg: object) -> Any:
        if self.began and event == "line":
            self.stepped(frame.f_code.co_filename, frame.f_lineno)
        return self.line

    def stepped(self, path: str, line: int) -> None:
        """At each line."""

    def telling(self, speak: Any) -> Any:
        def spoken(*args: Any) -> Any:
            self.began = True
            return speak(*args)

        return spoken

    @contextmanager
    def following(self) -> Iterator[None]:
        handler, tracer = signal.getsignal(signal.SIGINT), sys.gettrace()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            with (
                mock.patch.object(FakeLink, "write", self.telling(FakeLink.write)),
                mock.patch.object(FakeFrames, "send", self.telling(FakeFrames.send)),
            ):
                sys.settrace(self.call)
                try:
                    yield
                finally:
                    sys.settrace(tracer)
        finally:
            signal.signal(signal.SIGINT, handler)


class Alone(Stepper):
    """Follows nothing: the interpreter is not even told to ask."""

    call: Any = None


class Counting(Stepper):
    """Counts how often each line runs, or each of these."""

    def __init__(self, only: str = "", lines: frozenset[int] = frozenset()) -> None:
        super().__init__(only, lines)
        self.count: Counter[tuple[str, int]] = Counter()

    def stepped(self, path: str, line: int) -> None:
        self.count[path, line] += 1


class Pressing(Stepper):
    """Ctrl-C when one of these lines runs for the `at`-th time; `then` follows what runs behind it."""

    def __init__(self, path: str, lines: frozenset[int], at: int, *, then: bool = False) -> None:
        super().__init__("" if then else path, lines)
        self.path, self.at, self.then = path, at, then
        self.behind: set[tuple[str, int]] = set()

    def stepped(self, path: str, line: int) -> None:
        if self.at <= 0:
            self.behind.add((path, line))
        elif line in self.lines and path == self.path:
            self.at -= 1
            if not self.at:
                if self.only:
                    sys.settrace(None)  # nothing behind it is looked at
                signal.raise_signal(signal.SIGINT)


class Ended(NamedTuple):
    """How a command ended, and what passed."""

    result: Result
    envelope: dict[str, Any]
    transcript: list[Passed]


def go(moving: Moving, stepper: Stepper) -> Ended:
    """Run it in the folder in which this process is, which is empty: paths are the same ones every time."""
    scratch_of(Path())
    link = facts_of(moving.family).link(moving.family, moving.words)
    typed = [word.replace("{dir}", ".") for word in (moving.family, *shlex.split(moving.words))]
    more = ["-y", "-p", link, "--format", "ndjson", "--trace", "trace.txt"]
    with stepper.following(), bounded(SECONDS):
        result = run(*typed, *more, env={"XDG_STATE_HOME": "state"})
    return Ended(result, json.loads(result.lines[-1])["end"], passed(Path("trace.txt")))


def _apart(moving: Moving, stepper: Stepper) -> Ended:
    """Run it in a folder that is gone behind it."""
    here, folder = os.getcwd(), tempfile.mkdtemp()
    os.chdir(folder)
    try:
        return go(moving, stepper)
    finally:
        os.chdir(here)
        shutil.rmtree(folder)


@cache
def whole(moving: Moving) -> Ended:
    """The command that nobody interrupts: it comes first, for an import that is cut off would spoil what comes after it."""
    ended = _apart(moving, Alone())
    assert ended.result.code in (0, 7), ended.result
    return ended


@cache
def usual(moving: Moving) -> Counter[Place]:
    """How often it then runs each line."""
    whole(moving)
    _apart(moving, counting := Counting())
    count: Counter[Place] = Counter()
    for step, times in counting.count.items():
        count[place_of(*step)] += times
    assert len(count) > 200, f"only {len(count)} lines were followed"
    return count


@cache
def times(moving: Moving, place: Place) -> int:
    """How often it then runs the lines of one place."""
    whole(moving)
    path, lines = numbers(place)
    _apart(moving, counting := Counting(path, lines))
    return sum(counting.count[path, line] for line in lines)


def judged(moving: Moving, ended: Ended) -> str:
    """How it ended. Raises AssertionError where it tells less than happened, or has not stopped what it says to have ended."""
    family, name, halt = moving.family, moving.words.split()[0], moving.halt
    over = facts_of(family).over
    healthy = whole(moving)
    done = ended.result.code == healthy.result.code
    gone_on = not halt and ended.result.code == 6  # no command stops it, and it says so
    assert done or ended.result.code == 130 or (gone_on and ended.envelope["messages"][-1]["code"] == NOT_STOPPED), (
        ended.result
    )
    assert ended.envelope["device"] is not None, "the envelope knows of no device"
    went = wrote(family, name, ended.transcript)
    if went or done:
        writes = ended.envelope["writes"]
        judge(family, name, writes, ended.transcript)
    if done:
        assert went == wrote(family, name, healthy.transcript), "it says to have done its work"
        return f"exit {ended.result.code}"
    if halt and went and not went[-1].startswith(halt):
        sent = max(place for place, entry in enumerate(ended.transcript) if entry.data == went[-1])
        came = b"".join(entry.data for entry in ended.transcript[sent:] if entry.mark == "<")
        assert over and came.endswith(over), f"not stopped: {ended.result.err}"
        return "exit 130 over"
    states = dict.fromkeys(step["state"] for step in ended.envelope["writes"])
    return f"exit {ended.result.code} {'stopped' if halt and went else ''} {','.join(states)}"


# -- the suite --------------------------------------------------------------------------------------------------------

NOT_REACHED = "the line was not reached"


class AnyLine(Suite):
    name = "any-line"

    def groups(self) -> Iterator[tuple[str, Iterator[str]]]:
        for begin, moving in writing().items():
            yield begin, self._places(begin, moving)

    def cells(self) -> Iterator[str]:
        for _, cells in self.groups():
            yield from cells

    def _places(self, begin: str, moving: Moving) -> Iterator[str]:
        for place, times in usual(moving).items():
            for when in (FIRST, LAST)[: min(times, 2)]:
                yield f"{begin} | {key(*place, when)}"

    def run(self, cell: str, folder: Path) -> str:
        return self._run(cell)[0]

    def followed(self, cell: str, folder: Path) -> tuple[str, Iterable[object]]:
        outcome, stepper = self._run(cell, then=True)
        return outcome, {place_of(*step) for step in stepper.behind}

    def _run(self, cell: str, *, then: bool = False) -> tuple[str, Pressing]:
        moving, place, when = taken(cell)
        path, lines = numbers(place)
        whole(moving)
        stepper = Pressing(path, lines, times(moving, place) if when == LAST else 1, then=then)
        ended = go(moving, stepper)
        if stepper.at > 0:
            return NOT_REACHED, stepper
        return judged(moving, ended), stepper

    def stale(self, cell: str) -> str:
        begin, place = key(*parts(cell)[:3]), parts(cell)[3:6]
        if begin not in writing():
            return "there is no such command line any more"
        if not numbers((place[0], place[1], place[2]))[1]:
            return f"its line has gone from {place[1]} of {place[0]}: `python -m tests.pins any-line --only '{begin}'`"
        return ""

    def wanted(self) -> Iterable[str]:
        return writing()

    def shows(self, cell: str) -> Iterable[str]:
        return (key(*parts(cell)[:3]),)


def taken(cell: str) -> tuple[Moving, Place, str]:
    """What a key says."""
    _, _, _, module, function, text, when = parts(cell)
    return writing()[key(*parts(cell)[:3])], (module, function, text), when


SUITES = (AnyLine(),)
