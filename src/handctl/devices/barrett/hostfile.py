"""Small files of this machine about hands, below the user's state folder: JSON objects, read whole, written whole.

A hand keeps no record of its care; the host does, per serial number. Knows no hand.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from handctl.errors import OutputError, UsageError


def state_path(name: str) -> Path:
    """$XDG_STATE_HOME/handctl/NAME, by default ~/.local/state/handctl/NAME."""
    base = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    return Path(base) / "handctl" / name


def load(path: Path, what: str, whole: Callable[[object], bool]) -> dict[str, Any]:
    """The object in `path`; empty when there is no file. Raises UsageError when an entry is not `whole`."""
    hint = "move it away to begin a new one"
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as exc:
        raise UsageError(f"{path}: the {what} cannot be read: {exc}", hint=hint) from exc
    if not isinstance(content, dict) or not all(whole(entry) for entry in content.values()):
        raise UsageError(f"{path}: not a {what}", hint=hint)
    return content


def store(path: Path, what: str, content: dict[str, Any]) -> None:
    """Write `content` atomically. Raises OutputError."""
    temporary = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(temporary, "w", encoding="utf-8") as file:
            json.dump(content, file, indent=1, sort_keys=True)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as exc:
        raise OutputError(f"{path}: the {what} cannot be written: {exc.strerror or exc}") from exc
