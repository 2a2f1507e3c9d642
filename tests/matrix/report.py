"""The bound of a command in this process."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

AGAIN = 5.0
BUSY = 3.0


class Hang(BaseException):
    """A command that does not end. Not an Exception: handctl must not take it for one of its own."""


@contextmanager
def bounded(seconds: float, what: str = "") -> Iterator[None]:
    """Raise Hang in this process when the block takes longer, and again every `AGAIN` s: something may have caught it.

    Where others keep the machine busy, until it has had so much of a processor, but at most `BUSY` times as long.
    A thread calls, not SIGALRM: handctl uses the system's one alarm itself and switches it off.
    """
    over, caller = threading.Event(), threading.get_ident()

    def stop(number: int, frame: FrameType | None) -> None:
        if not over.is_set():
            raise Hang(f"no end within {seconds:g} s{what and f': {what}'}")

    began, used = time.monotonic(), time.process_time()

    def watch() -> None:
        wait = seconds
        while not over.wait(wait):
            left = began + BUSY * seconds - time.monotonic()
            wait = min(left, used + seconds - time.process_time())
            if wait <= 0:
                signal.pthread_kill(caller, signal.SIGUSR2)
                wait = AGAIN

    old = signal.signal(signal.SIGUSR2, stop)
    watcher = threading.Thread(target=watch, name="bound", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()
        signal.signal(signal.SIGUSR2, old)


# `tests/conftest.py` still names these hooks; nothing is left of what they told.
def pytest_runtest_call() -> None: ...
def pytest_runtest_makereport() -> None: ...
def pytest_runtest_logreport() -> None: ...
def pytest_terminal_summary() -> None: ...
