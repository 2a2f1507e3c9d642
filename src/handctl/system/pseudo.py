"""Pseudo terminals, and the serial speed that a client sets on one."""

from __future__ import annotations

import os
import sys

if sys.platform == "win32":
    HERE = False

    def opened(speed: int | None) -> tuple[int, int]:
        """Raises OSError: there are none."""
        raise OSError("this system has no pseudo terminals")

    def name(slave: int) -> str:
        raise OSError("this system has no pseudo terminals")

    def speed_of(master: int) -> int:
        return -1

    def unread(slave: int) -> bool:
        return False

else:
    import fcntl
    import pty
    import termios
    import tty

    HERE = True
    """Whether the system has such things."""
    SPEEDS = {getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()}

    def opened(speed: int | None) -> tuple[int, int]:
        """Master and slave of a new one, raw, at this speed in bit/s; the master does not wait. Raises OSError."""
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

    def name(slave: int) -> str:
        """What a client opens."""
        return os.ttyname(slave)

    def speed_of(master: int) -> int:
        """The speed that the client set, visible on the master side; -1 for one without a constant."""
        return SPEEDS.get(termios.tcgetattr(master)[5], -1)

    def unread(slave: int) -> bool:
        """Whether the client has something to read still."""
        return any(fcntl.ioctl(slave, termios.FIONREAD, bytes(4)))
