"""The line editor of the interactive GCL prompt: readline with history and completion. Imported only for it."""

from __future__ import annotations

import contextlib
from pathlib import Path

from handctl.devices.barrett.gcl.passthrough import candidates
from handctl.files import state_path


def line_reader() -> object:
    """Prepare readline; returns the history file to be written by `leave`, None where there is no readline."""
    try:
        import readline
    except ImportError:
        return None
    path = state_path("gcl-history")
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        readline.read_history_file(path)
    readline.set_history_length(1000)
    readline.set_completer_delims(" ")

    def complete(word: str, state: int) -> str | None:
        found = candidates(readline.get_line_buffer()[: readline.get_endidx()], word)
        return found[state] if state < len(found) else None

    readline.set_completer(complete)
    readline.parse_and_bind("tab: complete")
    return path


def leave(path: object) -> None:
    """Keep the history."""
    if isinstance(path, Path):
        import readline

        with contextlib.suppress(OSError):
            readline.write_history_file(path)
