"""Other processes: whether one is running, when it started, how to end it."""

from __future__ import annotations

import os
import sys

ENDS = "taskkill /f /pid" if sys.platform == "win32" else "kill -9"
"""The command of a shell that ends a process, whatever it does."""


if sys.platform == "win32":
    import ctypes
    from ctypes import wintypes

    MAY = 0x1000 | 0x100000 | 0x1
    """PROCESS_QUERY_LIMITED_INFORMATION, SYNCHRONIZE, PROCESS_TERMINATE."""

    class _Process:
        """A process, by a handle: it keeps its number from being given to another. False where there is none."""

        def __init__(self, pid: int) -> None:
            self._system = ctypes.WinDLL("kernel32")
            self._system.OpenProcess.restype = wintypes.HANDLE
            self.handle = wintypes.HANDLE(self._system.OpenProcess(MAY, False, pid & 0xFFFFFFFF))

        def __enter__(self) -> _Process:
            return self

        def __exit__(self, *_: object) -> None:
            self._system.CloseHandle(self.handle)

        def lives(self) -> bool:
            return bool(self.handle) and not self.gone(0.0)

        def gone(self, seconds: float) -> bool:
            """Wait until it has ended."""
            return bool(self._system.WaitForSingleObject(self.handle, int(seconds * 1000)) == 0)

        def began(self) -> str:
            """Its beginning, in the system's 100 ns."""
            times = [ctypes.c_uint64() for _ in range(4)]
            done = self._system.GetProcessTimes(self.handle, *(ctypes.byref(time) for time in times))
            return str(times[0].value) if done else ""

        def end(self) -> None:
            """Raises OSError."""
            if not self._system.TerminateProcess(self.handle, 137):
                raise OSError("not permitted")


def began(pid: int) -> str:
    """When a process began, in ticks since the system did; with its number it names one process for good. "" if unknown."""
    if sys.platform == "win32":
        with _Process(pid) as process:
            return process.began() if process.lives() else ""
    return _stat(pid)[2]


def is_ours(pid: int) -> bool:
    """Whether this is our own process, or a fork of it that runs the same program."""
    if pid == os.getpid():
        return True
    if _stat(pid)[1] != str(os.getpid()):
        return False
    try:
        with open(f"/proc/{pid}/cmdline", "rb") as theirs, open("/proc/self/cmdline", "rb") as ours:
            return theirs.read() == ours.read()
    except OSError:
        return False


def sleeps(pid: int) -> bool:
    """Whether a process has been stopped (SIGSTOP, Ctrl-Z): it cannot answer."""
    return _stat(pid)[0] in ("T", "t")


def lives(pid: int) -> bool:
    """Whether there is a process of this number that has not ended."""
    if sys.platform == "win32":
        with _Process(pid) as process:
            return process.lives()
    if _stat(pid)[0] == "Z":
        return False
    try:
        os.kill(pid, 0)
    except PermissionError:
        return True
    except (OverflowError, ProcessLookupError):
        return False
    return True


def _stat(pid: int) -> tuple[str, str, str]:
    """State, parent and start time of a process; "" if the system does not report them."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:
            words = file.read().rpartition(b")")[2].split()
        return words[0].decode(), words[1].decode(), words[19].decode()
    except (OSError, IndexError):
        return "", "", ""


ASKED, KILLED, GONE = "asked", "killed", "gone"
"""How a process came to its end: it did so when it was asked, by force, or before."""


def end(pid: int, start: str, seconds: float, asking: float = 0.0) -> str:
    """End the process that `began` at `start`, and wait for that; how, "" where it cannot be told from a later one of its
    number. `asking`: seconds that it has to end by itself (SIGTERM), where the system can ask. Raises OSError.
    """
    if sys.platform == "win32":
        if not start:
            return ""
        with _Process(pid) as process:
            if not process.lives() or process.began() != start:
                return GONE
            process.end()
            process.gone(seconds)
        return KILLED
    if sys.platform == "linux":
        import select
        import signal

        if not start or not hasattr(os, "pidfd_open"):
            return ""
        try:
            process = os.pidfd_open(pid)
        except OSError:
            return GONE
        try:
            if began(pid) != start:
                return GONE
            if asking:
                signal.pidfd_send_signal(process, signal.SIGTERM)
                if select.select([process], [], [], asking)[0]:
                    return ASKED
            signal.pidfd_send_signal(process, signal.SIGKILL)
            select.select([process], [], [], seconds)
        finally:
            os.close(process)
        return KILLED
    return ""


def user_name() -> str:
    """The name of this user; "" where it is not known."""
    if sys.platform == "win32":
        return os.environ.get("USERNAME", "")
    import pwd

    try:
        return pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return ""


def group_name(number: int) -> str:
    """The name of a group; "" where it has none. A directory service may know more than /etc/group."""
    if sys.platform == "win32":
        return ""
    import grp

    try:
        return grp.getgrgid(number).gr_name
    except KeyError:
        return ""


def system_name() -> str:
    """The system in words, such as ``Linux 6.1.0 x86_64``."""
    import platform

    return f"{platform.system()} {platform.release()} {platform.machine()}".strip()
