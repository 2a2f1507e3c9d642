"""Single keys of the terminal, without waiting for a line. Only while this process is in the foreground."""

from __future__ import annotations

import contextlib
import os
import sys
from typing import Any

BACKGROUND_SECONDS = 0.5
"""How often a program in the background looks whether it has come back: reading the terminal there would stop the job."""
AT_ONCE = 64
"""Bytes that are taken at once."""

if sys.platform == "win32":
    import msvcrt

    TROUBLE: tuple[type[Exception], ...] = (OSError, ValueError)
    """What goes wrong with a terminal."""

    def in_front(descriptor: int) -> bool:
        """Whether this process may touch the terminal."""
        return True

    LOOK_SECONDS = 0.05

    class Keys:
        """Keys that have been pressed; `close` leaves the terminal as it was."""

        def __init__(self, descriptor: int) -> None:
            """The console has one keyboard, whatever the descriptor."""

        def pressed(self) -> str:
            """Those since the last call."""
            text = ""
            while msvcrt.kbhit():
                key = msvcrt.getwch()
                if key in ("\x00", "\xe0"):
                    msvcrt.getwch()  # the second half of an arrow or a function key
                else:
                    text += key
            return text

        def close(self) -> None:
            """Nothing was changed."""

    class Listener:
        """Keys for a thread that waits for them."""

        def __init__(self, descriptor: int) -> None:
            """Raises TROUBLE where it cannot be."""
            import threading

            self._keys = Keys(descriptor)
            self._woken = threading.Event()

        def wait(self) -> bytes:
            """What was pressed; b"" once it is woken, or the terminal has gone."""
            while not self._woken.wait(LOOK_SECONDS):
                if came := self._keys.pressed():
                    return came.encode("utf-8", "replace")
            return b""

        def wake(self) -> None:
            """End the wait."""
            self._woken.set()

        def close(self) -> None:
            """The terminal is as it was."""

    FINE = bool(os.environ.get("WT_SESSION") or os.environ.get("TERM_PROGRAM"))
    """Whether eighths of a block can be shown: the old console's letters have halves only."""

else:
    import select
    import termios
    import tty

    TROUBLE = (OSError, termios.error, ValueError)
    """What goes wrong with a terminal."""

    def in_front(descriptor: int) -> bool:
        """Whether this process may touch the terminal: from the background that would stop it."""
        try:
            return os.tcgetpgrp(descriptor) == os.getpgrp()
        except OSError:
            return False

    class Keys:
        """Keys that have been pressed; `close` leaves the terminal as it was."""

        def __init__(self, descriptor: int) -> None:
            self._descriptor = descriptor
            self._before: list[Any] = termios.tcgetattr(descriptor)
            mode = termios.tcgetattr(descriptor)
            mode[3] &= ~(termios.ICANON | termios.ECHO)
            mode[6][termios.VMIN] = mode[6][termios.VTIME] = 0
            termios.tcsetattr(descriptor, termios.TCSANOW, mode)

        def pressed(self) -> str:
            """Those since the last call."""
            try:
                return os.read(self._descriptor, AT_ONCE).decode("utf-8", "ignore")
            except OSError:
                return ""

        def close(self) -> None:
            with contextlib.suppress(termios.error):  # it went away
                termios.tcsetattr(self._descriptor, termios.TCSANOW, self._before)

    class Listener:
        """Keys for a thread that waits for them."""

        def __init__(self, descriptor: int) -> None:
            """Raises TROUBLE where it cannot be."""
            self._descriptor = descriptor
            self._before = termios.tcgetattr(descriptor)
            self._wake, self._waker = os.pipe()
            tty.setcbreak(descriptor, termios.TCSANOW)  # Ctrl-C and Ctrl-Z work as before

        def wait(self) -> bytes:
            """What was pressed; b"" once it is woken, or the terminal has gone."""
            while True:
                if not in_front(self._descriptor):
                    if select.select([self._wake], [], [], BACKGROUND_SECONDS)[0]:
                        return b""
                    continue
                ready = select.select([self._descriptor, self._wake], [], [])[0]
                if self._wake in ready:
                    return b""
                if not in_front(self._descriptor):
                    continue
                try:
                    return os.read(self._descriptor, AT_ONCE)
                except OSError:
                    return b""

        def wake(self) -> None:
            """End the wait."""
            os.write(self._waker, b"x")

        def close(self) -> None:
            """The terminal is as it was."""
            with contextlib.suppress(OSError, termios.error):
                if in_front(self._descriptor):
                    termios.tcsetattr(self._descriptor, termios.TCSANOW, self._before)
            os.close(self._wake)
            os.close(self._waker)

    FINE = True
    """Whether eighths of a block can be shown."""
