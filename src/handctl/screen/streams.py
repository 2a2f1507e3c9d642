"""stdout and stderr of this process: what happens to a character that they cannot take. Help loads it."""

from __future__ import annotations

import contextlib
import sys

from handctl.screen.filter import encodable

ERRORS = "handctl"
"""Name of our error handler for streams."""


def substitute_what_is_missing() -> None:
    """A character that the encoding of stdout or stderr lacks gets a substitute, never an error."""
    import codecs

    from handctl.system.streams import settings

    codecs.register_error(ERRORS, encodable)
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors=ERRORS, **settings(stream))


def utf8_stdout() -> None:
    """From now on stdout is UTF-8 with plain newlines, whatever the locale says: JSON is that everywhere."""
    from handctl.system.streams import CHANGES_LINE_ENDS

    reconfigure = getattr(sys.stdout, "reconfigure", None)
    if reconfigure is not None and ((sys.stdout.encoding or "").lower() != "utf-8" or CHANGES_LINE_ENDS):
        with contextlib.suppress(OSError):  # it flushes: what cannot be written is told when the data are
            reconfigure(encoding="utf-8", errors="strict", newline="\n")
