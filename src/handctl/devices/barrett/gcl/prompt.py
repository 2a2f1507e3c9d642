"""The line editor of the interactive GCL prompt: history and completion. Imported only for it."""

from __future__ import annotations

import contextlib
from pathlib import Path

from handctl.devices.barrett.gcl.passthrough import candidates
from handctl.files import state_path
from handctl.system import terminal


def line_reader() -> object:
    """Prepare the editor; returns the history file to be written by `leave`, None where there is no editor."""
    path = state_path("gcl-history")
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
    return path if terminal.edit_lines(str(path), 1000, candidates) else None


def leave(path: object) -> None:
    """Keep the history."""
    if isinstance(path, Path):
        terminal.keep_history(str(path))
