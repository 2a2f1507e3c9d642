"""One process at a time: locks on open files. They end with their process, however that ends."""

from __future__ import annotations

import os
import sys

if sys.platform == "win32":
    import msvcrt

    FAR = 1 << 30
    """A lock keeps others from reading there: it lies behind everything that a file holds."""

    def _lock(descriptor: int, place: int) -> None:
        os.lseek(descriptor, place, os.SEEK_SET)
        try:
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        except OSError as exc:
            raise BlockingIOError(exc.errno, exc.strerror) from exc

    def whole(descriptor: int) -> None:
        """Hold a file, without waiting; until it is closed. Raises BlockingIOError where another one holds it, OSError."""
        _lock(descriptor, FAR)

    def turn(descriptor: int) -> None:
        """The same beside `whole`, until `end_turn`."""
        _lock(descriptor, FAR + 1)

    def end_turn(descriptor: int) -> None:
        """Raises OSError."""
        os.lseek(descriptor, FAR + 1, os.SEEK_SET)
        msvcrt.locking(descriptor, msvcrt.LK_UNLCK, 1)

    def folder(path: str) -> int:
        """A descriptor that stands for a folder: a file in it. Raises OSError."""
        return os.open(os.path.join(path, ".lock"), os.O_RDWR | os.O_CREAT | os.O_NOINHERIT | os.O_BINARY)

else:
    import fcntl

    def whole(descriptor: int) -> None:
        """Hold a file, without waiting; until it is closed. Raises BlockingIOError where another one holds it, OSError."""
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def turn(descriptor: int) -> None:
        """The same beside `whole`, until `end_turn`: a range lock, which whole-file locks do not touch."""
        fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def end_turn(descriptor: int) -> None:
        """Raises OSError."""
        fcntl.lockf(descriptor, fcntl.LOCK_UN)

    def folder(path: str) -> int:
        """A descriptor that stands for a folder. Raises OSError."""
        return os.open(path, os.O_RDONLY)
