"""The processes that have a port open, and the group whose members may open it, as the system reports them. Opens nothing.

`root` is where the system's own files begin: "/" but for tests, which build a small system of their own.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Container, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from handctl.errors import LinkError
from handctl.link.link_interface import Link
from handctl.system.processes import group_name, is_ours
from handctl.system.serial_ports import IN_SYS, held_by_name, holders_by_lsof, name_of

ROOT = Path("/")


class Process(NamedTuple):
    """A running process; as text ``screen (pid 4711)``."""

    pid: int
    name: str

    def __str__(self) -> str:
        return f"{self.name} (pid {self.pid})"


def processes(names: Container[str], root: Path = ROOT) -> list[Process]:
    """All processes of these names but our own and its forks. Nothing where the system has no /proc."""
    found = (_named(pid, root) for pid in _pids(root))
    return [process for process in found if process.name in names and _foreign(process.pid, root)]


def _pids(root: Path) -> list[int]:
    try:
        return sorted(int(entry) for entry in os.listdir(root / "proc") if entry.isdecimal())
    except OSError:
        return []


def _foreign(pid: int, root: Path) -> bool:
    """Neither our own process nor a fork of it: asked last, for it reads a file of each process."""
    return root != ROOT or not is_ours(pid)


def _named(pid: int, root: Path) -> Process:
    try:
        name = (root / "proc" / str(pid) / "comm").read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        name = ""  # just ended, or not ours to look at
    return Process(pid, name or "a process")


def holders(device: str, root: Path = ROOT) -> list[Process]:
    """Processes that have `device` open, as far as the system reports them.

    Who holds the master of a pseudo terminal is its device, and not one of two that ask it.
    """
    if root == ROOT and (asked := holders_by_lsof(device)):
        return [Process(pid, name) for pid, name in asked]
    target = device if root != ROOT else os.path.realpath(device)
    number = target.removeprefix("/dev/pts/") if target.startswith("/dev/pts/") else ""
    found = []
    for pid in _pids(root):
        names = _descriptors(pid, root) or {}
        held = target in names.values() and not (number and _has_master(pid, names, number, root))
        if held and _foreign(pid, root):
            found.append(_named(pid, root))
    return found


def handctl_commands(is_there: Callable[[str], bool], root: Path = ROOT) -> Iterator[tuple[int, list[str]]]:
    """The handctl commands that use a place, whoever has started them: number of the process, and the words behind `handctl`.

    Either the port is open in it, or its -p leads there: `is_there` tells whether a LINK does. What a process has open
    only its own user sees, its command line everybody does.
    """
    for pid in _pids(root):
        try:
            line = (root / "proc" / str(pid) / "cmdline").read_bytes()
        except OSError:
            continue
        if b"handctl" not in line:
            continue
        words = line.decode("utf-8", "replace").rstrip("\0").split("\0")
        begin = next((at for at, word in enumerate(words[:4]) if _is_handctl(word)), None)
        if begin is None or not _foreign(pid, root):
            continue
        links = [_value(words, at, ("-p", "--port")) for at in range(begin + 1, len(words))]
        if any(map(is_there, filter(None, links))) or has_open(pid, is_there, root):
            yield pid, words[begin + 1 :]


def has_open(pid: int, is_there: Callable[[str], bool], root: Path = ROOT, *, hidden: bool = False) -> bool:
    """Whether a process has a place open; `hidden` where it is not ours to look at."""
    names = _descriptors(pid, root)
    return hidden if names is None else any(map(is_there, filter(held_by_name, names.values())))


def _is_handctl(word: str) -> bool:
    folder, _, name = word.replace("\\", "/").rpartition("/")
    return name in ("handctl", "handctl.exe") or (name == "__main__.py" and folder.endswith("handctl"))


def _value(words: Sequence[str], at: int, names: tuple[str, str]) -> str:
    """The value that the option at this position has, "" where it is another one."""
    word, (short, long) = words[at], names
    if word in names:
        return words[at + 1] if at + 1 < len(words) else ""
    if word.startswith(f"{long}="):
        return word.removeprefix(f"{long}=")
    return word.removeprefix(short) if short and word.startswith(short) and not word.startswith("--") else ""


def option_in(words: Sequence[str], *names: str) -> str:
    """The value of an option among the words of a command, the last one; "" without it. Names: a short one or "", and a long one."""
    short, long = names
    return next((found for at in reversed(range(len(words))) if (found := _value(words, at, (short, long)))), "")


def _descriptors(pid: int, root: Path) -> dict[str, str] | None:
    """Number and file of what a process has open; None where it is not ours to look at."""
    folder = f"{root}/proc/{pid}/fd"  # some thousand files are looked at
    try:
        names = os.listdir(folder)
    except PermissionError:
        return None
    except OSError:
        return {}  # just ended
    found = {}
    for name in names:
        try:
            found[name] = os.readlink(f"{folder}/{name}")
        except OSError:
            continue
    return found


def _has_master(pid: int, names: dict[str, str], number: str, root: Path) -> bool:
    for name, target in names.items():
        if target in ("/dev/ptmx", "/dev/pts/ptmx"):
            try:
                told = (root / "proc" / str(pid) / "fdinfo" / name).read_text(encoding="utf-8")
            except OSError:
                continue
            if ["tty-index:", number] in [line.split() for line in told.splitlines()]:
                return True
    return False


class OtherUsers(NamedTuple):
    """Other programs that have the port of a link open: `names`, and whether there are processes that we may not see."""

    names: list[Process]
    hidden: bool = False


def rivals(link: Link) -> OtherUsers:
    """Others at the other end of an open link: on its port, or connected from this machine to the same server.

    A CAN bus, and the clients of other machines, cannot be known: then there are none.
    """
    raw_access = link.raw_access()
    if raw_access is None:
        return OtherUsers([])
    if port := name_of(raw_access.descriptor):
        guard = link.guard.pid if link.guard is not None else None
        names = [one for one in holders(port) if one.pid != guard]
        return OtherUsers(
            names, not names and any(_descriptors(pid, ROOT) is None and _foreign(pid, ROOT) for pid in _pids(ROOT))
        )
    return OtherUsers(_connected(raw_access.descriptor) if IN_SYS else [])


def _connected(descriptor: int) -> list[Process]:
    """Processes of this machine with another connection to the server that this socket has one to."""
    rows = [row for name in ("tcp", "tcp6") for row in _table(name)]
    if not rows:
        return []
    ours = f"socket:[{os.fstat(descriptor).st_ino}]"
    server = next((remote for remote, socket in rows if socket == ours), None)
    others = {socket for remote, socket in rows if remote == server and socket != ours}
    if server is None or not others:
        return []
    found = (pid for pid in _pids(ROOT) if others & set((_descriptors(pid, ROOT) or {}).values()))
    return [_named(pid, ROOT) for pid in found if _foreign(pid, ROOT)]


def _table(name: str) -> Iterator[tuple[str, str]]:
    """The established connections of this machine: the other end, and the socket as a descriptor shows it."""
    try:
        lines = (ROOT / "proc" / "net" / name).read_text(encoding="ascii").splitlines()[1:]
    except (OSError, ValueError):
        return
    for words in map(str.split, lines):
        if len(words) > 9 and words[3] == "01":
            yield words[2], f"socket:[{words[9]}]"


def refuse_held(link: str, device: str) -> None:
    """Raise LinkError for a port that another process has open: two readers would each get half of the bytes."""
    if held_by_name(device) and (names := holders(device)):
        raise busy(link, names)


def busy(link: str, names: Sequence[Process]) -> LinkError:
    """The error of a port or server that another program is using."""
    who = ", ".join(map(str, names)) if names else "another program (the system does not report its name)"
    return LinkError(
        f"{link}: the port is in use by {who}", hint="close that program, then run the command again", code="busy"
    )


# -- who may open it -------------------------------------------------------------------------------------------------


def group_of(path: Path, root: Path = ROOT) -> tuple[int, str] | None:
    """Number and name of the group that a device file belongs to; None where there are no groups."""
    try:
        number = os.stat(path).st_gid
    except OSError:
        return None
    for name, (known, _) in groups(root).items():
        if known == number:
            return number, name
    if root == ROOT:  # a directory service may know more than the file
        return (number, name) if (name := group_name(number)) else None
    return None


def groups(root: Path = ROOT) -> dict[str, tuple[int, tuple[str, ...]]]:
    """Group name -> (number, members) from /etc/group; empty where there is none."""
    found: dict[str, tuple[int, tuple[str, ...]]] = {}
    try:
        lines = (root / "etc" / "group").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return found
    for line in lines:
        parts = line.split(":")
        if len(parts) == 4 and parts[2].isdecimal():
            found[parts[0]] = (int(parts[2]), tuple(filter(None, parts[3].split(","))))
    return found


def group_remedy(group: str, path: str, *, member: bool = False) -> str:
    """What to do when a port belongs to `group` and this session does not; `member`: /etc/group lists us there already."""
    if group in ("", "root"):  # who joins root may do anything, not only open a port
        return f"the port belongs to root: sudo chmod a+rw {path} (until it is plugged in again)"
    if member:
        return f"you are in group {group} already, but not in this session: log out and in again"
    return f"the port belongs to group {group}: sudo usermod -aG {group} $USER, then log in again"
