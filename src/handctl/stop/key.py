"""The stop key of a live view: s on the terminal. A thread waits for it, so the loop on the wire never looks."""

from __future__ import annotations

import sys
import threading
from typing import TYPE_CHECKING, Any

from handctl.frame.console import is_terminal
from handctl.system import signals, terminal

if TYPE_CHECKING:
    from handctl.stop.holding import Hold

KEY = b"s"


class StopKey:
    """Waits for the key until it is closed; then the terminal is as it was."""

    def __init__(self, hold: Hold, descriptor: int) -> None:
        """Raises `terminal.TROUBLE` where it cannot be."""
        self._hold = hold
        self._keys = terminal.Listener(descriptor)
        self._bell = signals.Bell(self._pressed)
        self._thread = threading.Thread(target=self._wait, daemon=True)
        self._thread.start()

    @classmethod
    def on_terminal(cls, hold: Hold) -> StopKey | None:
        """The key, where a person can press one: stdin is a terminal, this is the job in front, and its main thread."""
        if not is_terminal(sys.stdin) or threading.current_thread() is not threading.main_thread():
            return None
        descriptor = sys.stdin.fileno()
        try:
            return cls(hold, descriptor) if terminal.in_front(descriptor) else None
        except terminal.TROUBLE:
            return None

    def close(self) -> None:
        """No key any more."""
        self._keys.wake()
        self._thread.join()
        self._keys.close()
        self._bell.close()

    def _wait(self) -> None:
        while came := self._keys.wait():
            if KEY in came.lower():
                self._bell.ring()
                return

    def _pressed(self, frame: Any) -> None:
        self._hold.stop("stopped by the key s")
        self._hold.end(frame)
