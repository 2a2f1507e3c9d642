"""Keep an ordinary test in this process and on virtual time: what starts a process, opens a terminal, connects or sleeps raises.

A test that needs the real world says so with `pytest.mark.real`. What was tried is remembered too, because the code under test may
take the error for one of its own.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

from tests.support.swap import swapped

REFUSED = {
    "os.exec": "starts a program",
    "os.fork": "forks",
    "os.forkpty": "forks",
    "os.posix_spawn": "starts a process",
    "os.spawn": "starts a process",
    "os.system": "starts a shell",
    "pty.spawn": "starts a process",
    "socket.connect": "connects",
    "subprocess.Popen": "starts a process",
}
"""Audit events of the interpreter that an ordinary test must not cause."""


class OutsideWorld(AssertionError):
    """An ordinary test reached for a process, a terminal, a connection or real time."""


class _Watch:
    """What the running test tried; None while a test may do all of it."""

    def __init__(self) -> None:
        self.tried: list[str] | None = None

    def refuse(self, what: str) -> None:
        if self.tried is not None:
            self.tried.append(what)
            raise OutsideWorld(f"a test that is not marked `real` {what}")


_WATCH = _Watch()


def _audit(event: str, _args: tuple[Any, ...]) -> None:
    """Called for each file that is opened and each object that is looked into: most must leave at once."""
    if event in REFUSED and _WATCH.tried is not None:
        _WATCH.refuse(REFUSED[event])


@cache
def _listen() -> None:
    """From the first test on: collecting opens thousands of files, and no hook can be taken away again."""
    sys.addaudithook(_audit)


def _no_sleep(seconds: float) -> None:
    _WATCH.refuse(f"sleeps for {seconds} s")


def _no_terminal() -> tuple[int, int]:
    _WATCH.refuse("opens a pseudo-terminal")
    raise OutsideWorld


def _no_disk(_descriptor: object) -> None:
    """No power fails in a test, and each of some thousand calls would wait for a disk."""


@contextmanager
def in_process() -> Iterator[None]:
    """Refuse the outside world for one test. Raises OutsideWorld at the end, too, where something was tried and swallowed."""
    _listen()
    _WATCH.tried = tried = []
    try:
        with swapped(
            (time, "sleep", _no_sleep),
            (os, "openpty", _no_terminal),
            (os, "fsync", _no_disk),
        ):
            yield
    finally:
        _WATCH.tried = None
    if tried:
        raise OutsideWorld(f"a test that is not marked `real` {tried[0]}")
