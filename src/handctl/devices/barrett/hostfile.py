"""Small files of this machine about hands, below the user's state folder: JSON objects, read whole, written whole.

A hand keeps no record of its care; the host does, per serial number. Knows no hand.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from handctl import files
from handctl.errors import OutputError, UsageError

MOST_BYTES = 4_000_000


def load(path: Path, what: str, valid: Callable[[object], bool]) -> dict[str, Any]:
    """The object in `path`; empty when there is no file. Raises UsageError when an entry is not `valid`."""
    hint = "move the file away to start a new one"
    try:
        content = json.loads(files.read_text(path, f"the {what}", MOST_BYTES, hint=hint))
    except files.NoFile:
        return {}
    except (ValueError, RecursionError) as exc:
        raise UsageError(f"{path}: the {what} cannot be read: {exc}", hint=hint) from exc
    if not isinstance(content, dict) or not all(valid(entry) for entry in content.values()):
        raise UsageError(f"{path}: not a {what}", hint=hint)
    return content


def store(path: Path, what: str, content: dict[str, Any]) -> None:
    """Write `content`, whole or not at all. Raises OutputError."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with files.atomic_write(path) as file:
            json.dump(content, file, indent=1, sort_keys=True)
    except OSError as exc:
        text = f"{path}: the {what} cannot be written: {exc.strerror or exc}"
        raise OutputError(text, hint="check the folder's permissions and its free space") from exc
