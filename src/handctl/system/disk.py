"""Files: how they are opened, and flushing them to the disk."""

from __future__ import annotations

import os
import stat
import sys

if sys.platform == "win32":
    BINARY = os.O_BINARY
    """A descriptor opened without it changes line ends."""
    AT_ONCE = 0
    """Opening does not wait, as for who reads a pipe."""
    CLOSED_IN_CHILDREN = os.O_NOINHERIT
    NO_LINK = 0
    """A symbolic link is not followed."""
    TERMINAL_OF_NOBODY = 0
else:
    BINARY = 0
    """A descriptor opened without it changes line ends."""
    AT_ONCE = os.O_NONBLOCK
    """Opening does not wait, as for who reads a pipe."""
    CLOSED_IN_CHILDREN = os.O_CLOEXEC
    NO_LINK = os.O_NOFOLLOW
    """A symbolic link is not followed."""
    TERMINAL_OF_NOBODY = os.O_NOCTTY
    """A port that is opened does not become the terminal of this process."""


def sync(descriptor: int) -> None:
    """Wait until the content is on the disk. Raises OSError."""
    if sys.platform == "darwin":
        import fcntl

        try:
            fcntl.fcntl(descriptor, fcntl.F_FULLFSYNC)  # fsync there ends at the disk's own buffer
        except OSError:
            os.fsync(descriptor)  # not every file system has it
    else:
        os.fsync(descriptor)


def sync_folder(folder: str | os.PathLike[str]) -> None:
    """Wait until the names in a folder are on the disk. Raises OSError. Windows keeps them in its own journal."""
    if sys.platform == "win32":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        sync(handle)
    finally:
        os.close(handle)


def read_at(descriptor: int, size: int, place: int) -> bytes:
    """Read `size` bytes at `place`, without moving the file position. Raises OSError."""
    if sys.platform == "win32":
        os.lseek(descriptor, place, os.SEEK_SET)
        return os.read(descriptor, size)
    return os.pread(descriptor, size, place)


def torn(descriptor: int) -> bool:
    """Whether its last line has no end: the disk was full, its writer was killed, or an editor left it out. Raises OSError."""
    size = os.fstat(descriptor).st_size
    return size > 0 and read_at(descriptor, 1, size - 1) != b"\n"


def write_at(descriptor: int, data: bytes, place: int) -> None:
    """Write at `place`. Raises OSError."""
    if sys.platform == "win32":
        os.lseek(descriptor, place, os.SEEK_SET)
        os.write(descriptor, data)
    else:
        os.pwrite(descriptor, data, place)


def waiting(descriptor: int) -> int:
    """The same descriptor, which waits from now on where it was opened AT_ONCE."""
    if sys.platform != "win32":
        os.set_blocking(descriptor, True)
    return descriptor


def inherit_owner(old: os.stat_result, path: str) -> None:
    """Give a file the owner of another one, where root edits another user's; no permission is no error."""
    if sys.platform != "win32" and (old.st_uid, old.st_gid) != (os.getuid(), os.getgid()):
        try:
            os.chown(path, old.st_uid, old.st_gid)
        except PermissionError:
            return


STREAMS = ("/dev/null", "/dev/full", "/dev/stdout", "/dev/stderr", "/dev/tty", "/dev/fd/", "/proc/self/fd/")
"""No devices that anybody wears."""


def is_device(path: str) -> bool:
    """Whether it is a port, as in `-o /dev/ttyUSB0`: whatever is connected would get what is written there."""
    if sys.platform == "win32":
        name = path.upper().removeprefix("\\\\.\\").rstrip(":")
        return name.startswith("COM") and name[3:].isdigit()
    try:
        if not stat.S_ISCHR(os.stat(path).st_mode):
            return False
    except (OSError, ValueError):
        return False
    return not (path.startswith(STREAMS) or os.path.realpath(path).startswith(STREAMS))
