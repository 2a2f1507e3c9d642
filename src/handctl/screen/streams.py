"""stdout and stderr of this process: what happens to a character that they cannot take. Help loads it."""

from __future__ import annotations

import contextlib
import os
import sys

from handctl.screen.filter import encodable

ERRORS = "handctl"
"""Name of our error handler for streams."""


def substitute_what_is_missing() -> None:
    """A character that the encoding of stdout or stderr lacks gets a substitute, never an error."""
    import codecs

    codecs.register_error(ERRORS, encodable)
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors=ERRORS)


def utf8_stdout() -> None:
    """From now on stdout is UTF-8 with plain newlines, whatever the locale says: JSON is that everywhere."""
    reconfigure = getattr(sys.stdout, "reconfigure", None)
    if reconfigure is not None and ((sys.stdout.encoding or "").lower() != "utf-8" or os.linesep != "\n"):
        with contextlib.suppress(OSError):  # it flushes: what cannot be written is told when the data are
            reconfigure(encoding="utf-8", errors="strict", newline="\n")
