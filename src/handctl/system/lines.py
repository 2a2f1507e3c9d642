"""Editing of lines at a prompt: history and TAB, where the system has readline. Windows edits lines by itself."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable

if sys.platform == "win32":

    def prepare(history: str, longest: int, complete: Callable[[str, str], list[str]]) -> bool:
        """False: there is no readline."""
        return False

    def keep(history: str) -> None: ...

else:

    def prepare(history: str, longest: int, complete: Callable[[str, str], list[str]]) -> bool:
        """From now on `input` knows the lines of the file `history`, and TAB; False where there is no readline.

        `complete` gives for what stands before the cursor, and for the word there, the words that fit.
        """
        try:
            import readline
        except ImportError:
            return False
        with contextlib.suppress(OSError):  # none yet, or one that cannot be read
            readline.read_history_file(history)
        readline.set_history_length(longest)
        readline.set_completer_delims(" ")

        def completer(word: str, state: int) -> str | None:
            found = complete(readline.get_line_buffer()[: readline.get_endidx()], word)
            return found[state] if state < len(found) else None

        readline.set_completer(completer)
        libedit = "libedit" in (readline.__doc__ or "")  # on macOS it stands in for readline
        readline.parse_and_bind("bind ^I rl_complete" if libedit else "tab: complete")
        return True

    def keep(history: str) -> None:
        """Write the history, as far as that can be."""
        import readline

        with contextlib.suppress(OSError):
            readline.write_history_file(history)
