"""The terminal: single keys without waiting for a line, line editing at a prompt, and pseudo terminals."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TextIO

BACKGROUND_SECONDS = 0.5
"""How often a program in the background looks whether it has come back: reading the terminal there would stop the job."""
AT_ONCE = 64
"""Bytes that are taken at once."""
LONGEST_LINE = 4096
"""Bytes of a line that a terminal hands over."""


HISTORY = 1000
"""Lines of a prompt that are kept."""

if sys.platform == "win32":
    import msvcrt

    TROUBLE: tuple[type[Exception], ...] = (OSError, ValueError)
    """What goes wrong with a terminal."""

    def in_front(descriptor: int) -> bool:
        """Whether this process may touch the terminal."""
        return True

    LOOK_SECONDS = 0.05

    class Listener:
        """Keys for a thread that waits for them."""

        def __init__(self, descriptor: int) -> None:
            """The console has one keyboard, whatever the descriptor. Raises TROUBLE where it cannot be."""
            import threading

            self._pressed()  # what was typed ahead was not meant for this
            self._woken = threading.Event()

        def wait(self) -> bytes:
            """What was pressed; b"" once it is woken, or the terminal has gone."""
            while not self._woken.wait(LOOK_SECONDS):
                if came := self._pressed():
                    return came.encode("utf-8", "replace")
            return b""

        @staticmethod
        def _pressed() -> str:
            """Those since the last call."""
            text = ""
            while msvcrt.kbhit():
                key = msvcrt.getwch()
                if key in ("\x00", "\xe0"):
                    msvcrt.getwch()  # the second half of an arrow or a function key
                else:
                    text += key
            return text

        def wake(self) -> None:
            """End the wait."""
            self._woken.set()

        def close(self) -> None:
            """The terminal is as it was."""

    def typed_line(stream: TextIO) -> str | None:
        """What has been typed: None while there is nothing, "" at its end. Waits for Enter once a key was pressed."""
        return stream.readline() if msvcrt.kbhit() else None

    def discard_typed_ahead(_stream: TextIO) -> None:
        """What was typed before a question was shown is no answer to it."""
        Listener._pressed()

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

    class Listener:
        """Keys for a thread that waits for them."""

        def __init__(self, descriptor: int) -> None:
            """Raises TROUBLE where it cannot be."""
            self._descriptor = descriptor
            self._before = termios.tcgetattr(descriptor)
            self._wake, self._waker = os.pipe()
            tty.setcbreak(descriptor, termios.TCSANOW)  # Ctrl-C and Ctrl-Z work as before
            termios.tcflush(descriptor, termios.TCIFLUSH)  # what was typed ahead was not meant for this

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

    def typed_line(stream: TextIO) -> str | None:
        """The line that has been typed: None while there is none, "" at the end. What was typed ahead answers no question."""
        descriptor = stream.fileno()
        if not in_front(descriptor) or not select.select([descriptor], [], [], 0)[0]:
            return None
        try:
            return os.read(descriptor, LONGEST_LINE).decode("utf-8", "replace")
        except OSError:
            return ""

    def discard_typed_ahead(stream: TextIO) -> None:
        """What was typed before a question was shown is no answer to it."""
        with contextlib.suppress(*TROUBLE):
            if in_front(stream.fileno()):
                termios.tcflush(stream.fileno(), termios.TCIFLUSH)

    FINE = True
    """Whether eighths of a block can be shown."""


# -- lines at a prompt: history and TAB ----------------------------------------------------------------------------------


@contextlib.contextmanager
def edited_lines(history: Path, complete: Callable[[str, str], list[str]]) -> Iterator[None]:
    """While it lasts `input` knows the lines of the file `history`, and TAB; at its end the file has those that were typed.

    `complete` gives for what stands before the cursor, and for the word there, the words that fit. Nothing of all that where
    there is no readline.
    """
    if sys.platform == "win32":  # which edits lines by itself
        yield
        return
    try:
        import readline
    except ImportError:
        yield
        return
    with contextlib.suppress(OSError):  # none yet, or one that cannot be read
        history.parent.mkdir(parents=True, exist_ok=True)
        readline.read_history_file(history)
    readline.set_history_length(HISTORY)
    readline.set_completer_delims(" ")

    def completer(word: str, state: int) -> str | None:
        found = complete(readline.get_line_buffer()[: readline.get_endidx()], word)
        return found[state] if state < len(found) else None

    readline.set_completer(completer)
    libedit = "libedit" in (readline.__doc__ or "")  # on macOS it stands in for readline
    readline.parse_and_bind("bind ^I rl_complete" if libedit else "tab: complete")
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            readline.write_history_file(history)


# -- pseudo terminals, and the serial speed that a client sets on one ---------------------------------------------------


if sys.platform == "win32":
    HERE = False

    def pseudo(speed: int | None) -> tuple[int, int]:
        """Raises OSError: there are none."""
        raise OSError("this system has no pseudo terminals")

    def pseudo_name(slave: int) -> str:
        raise OSError("this system has no pseudo terminals")

    def speed_of(master: int) -> int:
        return -1

    def unread(slave: int) -> bool:
        return False

else:
    HERE = True
    """Whether the system has such things."""
    SPEEDS = {getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()}

    def pseudo(speed: int | None) -> tuple[int, int]:
        """Master and slave of a new one, raw, at this speed in bit/s; the master does not wait. Raises OSError."""
        import pty

        master, slave = pty.openpty()
        tty.setraw(slave)
        attributes = termios.tcgetattr(slave)
        constant = {rate: value for value, rate in SPEEDS.items()}.get(speed or 0)
        if constant is not None:
            # A client that sets no speed, such as a shell redirection, then talks at the right one.
            attributes[4] = attributes[5] = constant
            termios.tcsetattr(slave, termios.TCSANOW, attributes)
        os.set_blocking(master, False)
        return master, slave

    def pseudo_name(slave: int) -> str:
        """What a client opens."""
        return os.ttyname(slave)

    def speed_of(master: int) -> int:
        """The speed that the client set, visible on the master side; -1 for one without a constant."""
        return SPEEDS.get(termios.tcgetattr(master)[5], -1)

    def unread(slave: int) -> bool:
        """Whether the client has something to read still."""
        import fcntl

        return any(fcntl.ioctl(slave, termios.FIONREAD, bytes(4)))
