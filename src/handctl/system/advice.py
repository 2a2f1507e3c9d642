"""Instructions for this system, in words. `where` is replaced by tests."""

from __future__ import annotations

import sys


def set_clock(where: str = sys.platform) -> str:
    """The clock of the computer is wrong."""
    if where == "win32":
        return "turn on `Set time automatically` in Settings, Time & language, Date & time"
    if where == "darwin":
        return "run `sudo systemsetup -setusingnetworktime on`"
    return "run `sudo timedatectl set-ntp true`, or `sudo date -s 'YYYY-MM-DD HH:MM'`"


def set_encoding(where: str = sys.platform) -> str:
    """Output is not UTF-8."""
    if where == "win32":
        return "set the variable PYTHONUTF8 to 1"
    return "run `export LC_ALL=C.UTF-8`, or `export PYTHONUTF8=1`"


def terminal_is_named(where: str = sys.platform) -> bool:
    """Whether terminals set the variable TERM."""
    return where != "win32"


def set_latency(path: str, milliseconds: int, where: str = sys.platform) -> str:
    """An adapter holds back the end of answers, and its driver keeps the time; "" where the system has a file for it."""
    if where == "win32":
        return (
            f"open the Device Manager, Ports (COM & LPT), the properties of {path}, Port Settings, Advanced. "
            f"Set the latency timer to {milliseconds} ms"
        )
    return ""


def find_driver(chip: str, where: str = sys.platform) -> str:
    """An adapter is plugged in but has no port; "" if the system's own log explains it better."""
    if where == "win32":
        return (
            f"install the driver that the maker of the {chip} offers, then plug the adapter in again. "
            "The Device Manager shows it with its error"
        )
    return ""
