"""The group that a port belongs to, who is in it, and what to do when this session may not open the port. Opens nothing."""

from __future__ import annotations

import os
from pathlib import Path

from handctl.link.port_users import ROOT
from handctl.system.processes import group_name


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
