"""Files that are there whole or not at all. Knows no device; errors of the system are the callers' to translate."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path


@contextlib.contextmanager
def whole(path: str | os.PathLike[str], mode: str = "w") -> Iterator[IO[Any]]:
    """A file to be written: a new one beside `path`, at the end on the disk and in its place; gone when the body raises.

    What is replaced keeps its permissions and its owner, and a symbolic link stays one. A device or a pipe is written to, never
    replaced. `mode` "w" is UTF-8 with line ends as they come, or "wb". Raises OSError.
    """
    how = {} if "b" in mode else {"encoding": "utf-8", "newline": ""}
    if os.path.exists(path) and not os.path.isfile(path):
        with open(path, mode, **how) as file:  # type: ignore[call-overload]
            yield file
        return
    target = os.path.realpath(path)
    part = f"{target}.{os.getpid()}.part"
    try:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(part)  # of a process of this number that was killed
        with open(part, mode.replace("w", "x"), **how) as file:  # type: ignore[call-overload]
            with contextlib.suppress(FileNotFoundError):
                _inherit(os.stat(target), part)
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, target)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(part)
        raise


def _inherit(old: os.stat_result, path: str) -> None:
    """Permissions and, where root edits another user's file, owner."""
    os.chmod(path, old.st_mode & 0o7777)
    if hasattr(os, "chown") and (old.st_uid, old.st_gid) != (os.getuid(), os.getgid()):
        with contextlib.suppress(PermissionError):
            os.chown(path, old.st_uid, old.st_gid)


def why_unwritable(path: str) -> str:
    """Why no file can be written there, as far as can be told without trying; "" when nothing speaks against it."""
    folder = os.path.dirname(path) or "."
    if os.path.isdir(path):
        return "it is a folder"
    if os.path.exists(path) and not os.path.isfile(path):  # a terminal, a pipe: written to as it is
        return ""
    if not os.path.isdir(folder) or not os.access(folder, os.W_OK):
        return f"{folder} is no folder that can be written to"
    return ""


def state_path(name: str) -> Path:
    """$XDG_STATE_HOME/handctl/NAME, by default ~/.local/state/handctl/NAME: what this machine keeps for this user."""
    from pathlib import Path

    base = os.environ.get("XDG_STATE_HOME", "")
    if not os.path.isabs(base):  # so says the XDG specification
        base = os.path.join(os.path.expanduser("~"), ".local", "state")
    return Path(base) / "handctl" / name
