"""One process at a time on a device: an advisory lock held while a link is open.

The lock is an flock on a file of this user, so it ends with its process however that ends. The file tells who holds
it. Two names of one place (a by-id link and /dev/ttyUSB0, a path below slcan or spy) are one lock. Knows no link's
inside; where the system has no flock, there is no lock.
"""

from __future__ import annotations

import os
import stat
import time

from handctl.errors import LinkError

OURS = ("fake://", "replay:", "loop://")
"""Links that nobody else can reach."""
NOBODY = "another handctl"
"""The holder when the file names no process that lives."""
LAST_STOP_SECONDS = 2.5
"""How long such a lock is waited for: a command that was killed leaves it to the child that stops the device."""


class Lock:
    """A held lock; `release` may be called twice."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    @property
    def descriptors(self) -> tuple[int, ...]:
        """What is open while it is held: whoever keeps it open keeps the lock."""
        return (self._descriptor,) if self._descriptor >= 0 else ()

    def release(self) -> None:
        """Let others in. The file stays: taking it away would let two processes lock two files of one name."""
        descriptor, self._descriptor = self._descriptor, -1  # first: a Ctrl-C behind the close must not close it again
        if descriptor >= 0:
            os.ftruncate(descriptor, 0)
            os.close(descriptor)


def hold(link: str, command: str, tcp_port: int | None = None) -> Lock | None:
    """Lock what `link` leads to; `command` is told to those who come second, `tcp_port` is that of a tcp:// without one.

    None where there is nothing to lock. Raises LinkError (code "busy") naming the holder.
    """
    if link.startswith(OURS):
        return None
    try:
        import fcntl
    except ImportError:
        return None
    descriptor = _open(_file_name(canonical(link, tcp_port)))
    patience = time.monotonic() + LAST_STOP_SECONDS
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            break
        except OSError as exc:
            who, pid = _holder(descriptor)
            if who == NOBODY and time.monotonic() < patience:
                time.sleep(0.005)
                continue
            os.close(descriptor)
            raise LinkError(
                f"{link}: the device is in use by {who}",
                hint=f"wait for it, or end it: kill {pid} (it stops its device first)"
                if pid
                else "wait for it, then run the command again",
                code="busy",
            ) from exc
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, f"{os.getpid()} {command}\n".encode(), 0)
    return Lock(descriptor)


def canonical(link: str, tcp_port: int | None = None) -> str:
    """The place that a LINK leads to, the same for all its names: ``tty 188:0``, ``tcp host:port``, or the LINK."""
    if link.startswith("can:"):
        interface, _, channel = link.removeprefix("can:").partition("?")[0].partition(":")
        return canonical(channel) if interface == "slcan" else f"can {interface}:{channel}"
    if link.startswith("spy://"):
        return canonical(link.removeprefix("spy://").partition("?")[0])
    scheme, separator, rest = link.partition("://")
    if separator and scheme in ("tcp", "socket", "rfc2217"):
        host, colon, port = rest.partition("?")[0].rstrip("/").casefold().rpartition(":")
        if not colon or not port.isdecimal():
            host, port = f"{host}{colon}{port}", str(tcp_port or "")
        return f"tcp {'127.0.0.1' if host == 'localhost' else host}:{port}"
    if separator or link.startswith("usb:") or os.name != "posix":
        return link.casefold()
    try:
        found = os.stat(link)
    except OSError:
        return os.path.realpath(link)  # opening it will say what is wrong
    if stat.S_ISCHR(found.st_mode):
        return f"tty {os.major(found.st_rdev)}:{os.minor(found.st_rdev)}"
    return os.path.realpath(link)


def _file_name(place: str) -> str:
    plain = "".join(char if char.isascii() and char.isalnum() else f"%{ord(char):02X}" for char in place)
    if len(plain) > 200:
        import hashlib

        plain = hashlib.sha256(place.encode("utf-8", "surrogateescape")).hexdigest()
    return f"lock-{plain}"


def _folders() -> list[str]:
    """Where this user's lock files may lie, the best first; the second for a job without a login's environment."""
    user = os.getuid()
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    found = [os.path.join(runtime, "handctl")] if os.path.isabs(runtime) else [f"/run/user/{user}/handctl"]
    return [*found, os.path.join(os.environ.get("TMPDIR") or "/tmp", f"handctl-{user}")]  # noqa: S108 - made 0700, checked


def _open(name: str) -> int:
    problem: OSError | None = None
    for folder in _folders():
        try:
            if not os.path.isdir(folder):
                os.mkdir(folder, 0o700)
            if os.stat(folder).st_uid != os.getuid():
                continue  # somebody else's: not to be trusted
            return os.open(os.path.join(folder, name), os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        except FileExistsError:
            continue
        except OSError as exc:
            problem = exc
    raise LinkError(
        f"no place for the lock that keeps two programs off one device: {', '.join(_folders())}"
        + (f": {problem.strerror}" if problem is not None else ""),
        hint="set XDG_RUNTIME_DIR or TMPDIR to a directory that you may write to",
        code="no-lock",
    ) from problem


def _holder(descriptor: int) -> tuple[str, str]:
    """Who wrote into the lock file: ("`handctl exo watch` (pid 4711)", "4711")."""
    pid, _, command = os.pread(descriptor, 400, 0).decode("utf-8", "replace").strip().partition(" ")
    try:
        os.kill(int(pid), 0)
    except (ValueError, OverflowError, ProcessLookupError):
        return NOBODY, ""  # it died, and its stop goes out; or it has not written its own line yet
    except PermissionError:
        return f"`{command}` (pid {pid})", ""
    return f"`{command}` (pid {pid})", pid
