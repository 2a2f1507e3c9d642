"""What the search, the pins and `--cell` know of a generated suite: its cells, one line of text each, and how one is run.

A module of this folder that holds `SUITES = (…)` is found by its name alone.
"""

from __future__ import annotations

import importlib
import linecache
import os
import pkgutil
import signal
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import cache, cached_property
from pathlib import Path
from types import FrameType
from typing import Any

import tests.search
from tests.support.cli import restored_environment

BAR = " | "
SECONDS = 120.0
"""No cell takes so long: a suite may bound its commands more tightly."""
AGAIN = 5.0
BUSY = 3.0


def key(*parts: object) -> str:
    """One cell as one line of text."""
    return BAR.join(map(_part, map(str, parts)))


@cache
def _part(text: str) -> str:
    """The few words of which a hundred thousand cells are made."""
    return " ".join(text.replace("|", "¦").split()) or "-"


def parts(cell: str) -> list[str]:
    """The parts of a cell, the name of its suite first."""
    return cell.split(BAR)


class Suite:
    """A product of cells.

    A cell is named by words that stay when lines of the source move: names, texts, numbers of a seed. It begins with
    the name of its suite.
    """

    name = ""
    seed = 0
    """Where cells without an end begin."""

    def cells(self) -> Iterator[str]:
        """All of them, in a fixed order; there may be no end."""
        raise NotImplementedError

    def run(self, cell: str, folder: Path) -> str:
        """Run one in this process, with an empty folder. Returns how it ended, such as "exit 5 no-answer".

        Raises AssertionError with what is wrong.
        """
        raise NotImplementedError

    def groups(self) -> Iterator[tuple[str, Iterator[str]]]:
        """The cells by how their keys begin; the search begins all groups alike. To override where listing takes time."""
        yield self.name, self.cells()

    def wanted(self) -> Iterable[str]:
        """What needs at least one pin, such as "command exo move": quickly told, from the registry."""
        return ()

    def shows(self, cell: str) -> Iterable[str]:
        """What of `wanted` a cell is a pin for."""
        return ()

    def group(self, cell: str) -> str:
        """The test of the gate in which a pin is replayed: a family, mostly."""
        return parts(cell)[1]

    def stale(self, cell: str) -> str:
        """Why a pin can no longer be run; "" where it can."""
        return ""

    def followed(self, cell: str, folder: Path) -> tuple[str, Iterable[object]]:
        """`run`, and what it ran: to override where coverage cannot follow it."""
        raise NotImplementedError


class Listed(Suite):
    """A suite whose cells are the rows of a table."""

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        """What a cell is named by, behind the name of the suite, and what `tried` is given for it."""
        raise NotImplementedError

    def tried(self, row: Any, folder: Path) -> str:
        """`run` of a row."""
        raise NotImplementedError

    @cached_property
    def table(self) -> dict[str, Any]:
        """The rows by their keys."""
        return {key(self.name, *names): row for names, row in self.rows()}

    def cells(self) -> Iterator[str]:
        return iter(self.table)

    def run(self, cell: str, folder: Path) -> str:
        assert cell in self.table, self.stale(cell)
        return self.tried(self.table[cell], folder)

    def stale(self, cell: str) -> str:
        return "" if cell in self.table else "there is no such cell any more"


@cache
def suites() -> dict[str, Suite]:
    """Every suite by its name."""
    found: dict[str, Suite] = {}
    for module in pkgutil.iter_modules(tests.search.__path__):
        if module.name.startswith(("__", "test_")):
            continue
        for suite in getattr(importlib.import_module(f"tests.search.{module.name}"), "SUITES", ()):
            assert suite.name and suite.name not in found, f"two suites named {suite.name!r}"
            found[suite.name] = suite
    return dict(sorted(found.items()))


def suite_of(cell: str) -> Suite:
    """The suite of a cell. Raises SystemExit with the names where there is none of that name."""
    name = parts(cell)[0]
    if name not in suites():
        raise SystemExit(f"no suite {name!r}: {', '.join(suites())}")
    return suites()[name]


def run(cell: str, folder: Path) -> str:
    """Run a cell in a place of its own."""
    return apart(suite_of(cell).run, cell, folder)


def apart(what: Callable[[str, Path], Any], cell: str, folder: Path) -> Any:
    """Call it with a cell and a folder where nothing of this user is, and nothing of another cell."""
    own, place = str(folder / "own"), folder / "cell"
    os.mkdir(own)
    os.mkdir(f"{own}/run", 0o700)
    place.mkdir()
    places = {"XDG_STATE_HOME": own, "XDG_RUNTIME_DIR": f"{own}/run", "TMPDIR": own}
    here = os.getcwd()
    os.chdir(place)
    try:
        with restored_environment(), bounded(SECONDS):
            os.environ.update(places)
            return what(cell, place)
    finally:
        os.chdir(here)


def command(cell: str) -> str:
    """What is typed to repeat a cell."""
    quoted = cell.replace("'", "'\"'\"'")
    return f"python -m tests.search --cell '{quoted}'"


def told(exc: BaseException) -> str:
    """What is wrong: the message, or the assertion that failed and what it looked at."""
    if str(exc):
        return str(exc) if isinstance(exc, AssertionError) else f"{type(exc).__name__}: {exc}"
    (frame, line) = list(traceback.walk_tb(exc.__traceback__))[-1]
    values = {name: value for name, value in frame.f_locals.items() if not callable(value)}
    text = linecache.getline(frame.f_code.co_filename, line).strip()
    return f"{type(exc).__name__}: {text}, with " + ", ".join(f"{n} = {v!r:.300}" for n, v in values.items())


class Hang(BaseException):
    """A command that does not end. Not an Exception: handctl must not take it for one of its own."""


@contextmanager
def bounded(seconds: float, what: str = "") -> Iterator[None]:
    """Raise Hang in this process when the block takes longer, and again every `AGAIN` s: something may have caught it.

    Where others keep the machine busy, until it has had so much of a processor, but at most `BUSY` times as long.
    A thread calls, not SIGALRM: handctl uses the system's one alarm itself and switches it off. It is one for all blocks.
    """
    bound = _Bound(seconds)

    def stop(number: int, frame: FrameType | None) -> None:
        if bound in _BOUNDS:
            raise Hang(f"no end within {seconds:g} s{what and f': {what}'}")

    old = signal.signal(signal.SIGUSR2, stop)
    _BOUNDS.append(bound)
    _watched(os.getpid())
    if bound.next < _looks[0]:
        _sooner.set()
    try:
        yield
    finally:
        _BOUNDS.remove(bound)
        signal.signal(signal.SIGUSR2, old)


class _Bound:
    """A block that must end, and when it is looked after next."""

    def __init__(self, seconds: float) -> None:
        self.seconds, self.caller = seconds, threading.get_ident()
        self.began, self.used = time.monotonic(), time.process_time()
        self.next = self.began + seconds

    def look(self) -> None:
        now = time.monotonic()
        if now < self.next:
            return
        wait = min(self.began + BUSY * self.seconds - now, self.used + self.seconds - time.process_time())
        if wait <= 0:
            signal.pthread_kill(self.caller, signal.SIGUSR2)
        self.next = now + (wait if wait > 0 else AGAIN)


_BOUNDS: list[_Bound] = []
_looks = [0.0]  # when the thread looks next
_sooner = threading.Event()


@cache
def _watched(_process: int) -> None:
    """A thread looks after the blocks of this process: one for each would cost more than a short cell."""

    def watch() -> None:
        while True:
            for bound in [*_BOUNDS]:
                bound.look()
            _looks[0] = min([bound.next for bound in [*_BOUNDS]], default=time.monotonic() + SECONDS)
            _sooner.wait(min(AGAIN, max(0.001, _looks[0] - time.monotonic())))  # a block that just began is seen then
            _sooner.clear()

    watcher = threading.Thread(
        target=watch, name="bound", daemon=True
    )  # it reads from nothing, and ends with the process
    watcher.start()
