"""What plain --fake keeps of a simulated device from one command to the next: a state file, until this user logs out.

The file lies beside the locks, in a folder that is this user's. A `fake://…` keeps nothing. Knows no simulator: the file
is read and written by the simulated device, as with `state=FILE`.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator

from handctl.system.folders import own_folder, private_folders


class Kept:
    """What one command has of a simulated device that is kept.

    path     of the state file, "" where there is no place for one
    before   the state file as this command found it (inode, time), None without one
    """

    def __init__(self, link: str, *, writes: bool) -> None:
        """`writes`: what this command does to the device is kept."""
        self.kind, _, _query = link.removeprefix("fake://").partition("?")
        self._writes = writes
        self.path = _path(_file_name(link), make=writes)
        self.before = self._stamp()

    def options(self) -> dict[str, str]:
        """Those of the simulator."""
        if not self.path or not (self._writes or self.before):
            return {}
        age = max(0.0, time.time() - self.before[1] / 1e9) if self.before else 0.0
        return {"state": self.path, "save": "changed" if self._writes else "never", "elapse": f"{min(age, 1e9):.3f}"}

    def discard(self) -> None:
        """The state file is of no use: this command resets it."""
        if self._writes:
            with contextlib.suppress(OSError):
                os.unlink(self.path)
        self.before = None
        if os.path.lexists(self.path):
            self.path = ""

    @property
    def begun(self) -> bool:
        """Whether this command is the first whose doing is kept."""
        return self.before is None and self._stamp() is not None

    @property
    def text(self) -> str:
        """How the device is found, or left, and how to begin afresh."""
        state = "has the state that it was left in" if self.before is not None else "keeps its state until you log out"
        return f"the simulated {self.kind} {state}. `handctl sim forget {self.kind}` resets it"

    def _stamp(self) -> tuple[int, int] | None:
        try:
            found = os.stat(self.path)
        except OSError:
            return None
        return found.st_ino, found.st_mtime_ns


def forget(kind: str) -> bool:
    """Remove what is kept of a simulated device, on every wire, and what a killed command left of it; whether there was any.

    Raises OSError.
    """
    found = False
    begin = _file_name(f"fake://{kind}").removesuffix(".json")
    for folder in _folders():
        for name in os.listdir(folder):
            if name.startswith((f"{begin}.json", f"{begin}-")):
                with contextlib.suppress(FileNotFoundError):
                    os.unlink(os.path.join(folder, name))
                    found = True
    return found


def _file_name(link: str) -> str:
    """One for each device, model and wire: ``sim-exo.json``, ``sim-wrist-can.json``, ``sim-hand-df.json``."""
    kind, _, more = link.removeprefix("fake://").partition("?")
    said = [word.partition("=")[2] for word in more.split("&") if word]
    return f"sim-{'-'.join([kind, *said])}.json"


def _path(name: str, *, make: bool) -> str:
    """Where the file is; else where it is going to be if it may be made, "" where it cannot."""
    for folder in _folders():
        if os.path.lexists(path := os.path.join(folder, name)):
            return path
    return os.path.join(folder, name) if make and (folder := next(_folders(make=True), "")) else ""


def _folders(*, make: bool = False) -> Iterator[str]:
    """Those that are this user's."""
    for folder in private_folders():
        with contextlib.suppress(OSError):
            if own_folder(folder, make=make):
                yield folder
