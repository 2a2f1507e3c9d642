"""Who has a port open and whose it is, as the system tells. Opens nothing.

`root` is where the system's own files begin: "/" but for tests, which build a small system of their own.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from handctl.system.ports import asked_holders

ROOT = Path("/")


class Process(NamedTuple):
    """A running process; as text ``screen (pid 4711)``."""

    pid: int
    name: str

    def __str__(self) -> str:
        return f"{self.name} (pid {self.pid})"


def processes(root: Path = ROOT) -> Iterator[Process]:
    """All processes but our own. Nothing where the system has no /proc."""
    try:
        entries = [entry for entry in os.listdir(root / "proc") if entry.isdecimal()]
    except OSError:
        return
    for entry in sorted(entries, key=int):
        if int(entry) == os.getpid() and root == ROOT:
            continue
        try:
            name = (root / "proc" / entry / "comm").read_text(encoding="utf-8", errors="replace").strip()
        except OSError:
            name = ""  # just ended, or not ours to look at
        yield Process(int(entry), name or "a process")


def holders(device: str, root: Path = ROOT) -> list[Process]:
    """Processes that have `device` open, as far as the system tells."""
    if root == ROOT and (asked := asked_holders(device)):
        return [Process(pid, name) for pid, name in asked]
    target = device if root != ROOT else os.path.realpath(device)
    return [process for process in processes(root) if _has_open(root / "proc" / str(process.pid) / "fd", target)]


def _has_open(descriptors: Path, target: str) -> bool:
    try:
        names = os.listdir(descriptors)
    except OSError:
        return False  # not ours to look at, or just ended
    for name in names:
        try:
            if os.readlink(descriptors / name) == target:
                return True
        except OSError:
            continue
    return False


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
        from handctl.system.processes import group_name

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
