"""The stop key of a live view: s on the terminal. A thread waits for it, so the loop on the wire never looks."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import termios
import threading
import tty
from typing import TYPE_CHECKING, Any

from handctl.frame.console import is_terminal

if TYPE_CHECKING:
    from handctl.stop.holding import Hold

KEY = b"s"
BACKGROUND_SECONDS = 0.5
"""How often a view in the background looks whether it has come back: reading the terminal there would stop the job."""


class StopKey:
    """Waits for the key until it is closed; then the terminal is as it was."""

    def __init__(self, hold: Hold, descriptor: int) -> None:
        """Raises OSError, termios.error, ValueError where it cannot be."""
        self._hold = hold
        self._descriptor = descriptor
        self._before = termios.tcgetattr(descriptor)
        self._signal = signal.signal(signal.SIGUSR1, self._pressed)
        self._wake, self._waker = os.pipe()
        tty.setcbreak(descriptor, termios.TCSANOW)  # Ctrl-C and Ctrl-Z work as before
        self._thread = threading.Thread(target=self._wait, daemon=True)
        self._thread.start()

    @classmethod
    def on_terminal(cls, hold: Hold) -> StopKey | None:
        """The key, where a person can press one: stdin is a terminal, this is the job in front, and its main thread."""
        if not is_terminal(sys.stdin) or threading.current_thread() is not threading.main_thread():
            return None
        descriptor = sys.stdin.fileno()
        try:
            return cls(hold, descriptor) if _in_front(descriptor) else None
        except (OSError, termios.error, ValueError):
            return None

    def close(self) -> None:
        """No key any more."""
        os.write(self._waker, b"x")
        self._thread.join()
        with contextlib.suppress(OSError, termios.error):
            if _in_front(self._descriptor):
                termios.tcsetattr(self._descriptor, termios.TCSANOW, self._before)
        signal.signal(signal.SIGUSR1, self._signal)
        os.close(self._wake)
        os.close(self._waker)

    def _wait(self) -> None:
        while True:
            if not _in_front(self._descriptor):
                if select.select([self._wake], [], [], BACKGROUND_SECONDS)[0]:
                    return
                continue
            ready = select.select([self._descriptor, self._wake], [], [])[0]
            if self._wake in ready:
                return
            if not _in_front(self._descriptor):
                continue
            try:
                came = os.read(self._descriptor, 64)
            except OSError:
                return
            if not came:
                return
            if KEY in came.lower():
                signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGUSR1)
                return

    def _pressed(self, _number: int, frame: Any) -> None:
        self._hold.stop("stopped by the key s")
        self._hold.end(frame)


def _in_front(descriptor: int) -> bool:
    try:
        return os.tcgetpgrp(descriptor) == os.getpgrp()
    except OSError:
        return False
