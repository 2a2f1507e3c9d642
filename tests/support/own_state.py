"""What handctl keeps for a user between commands: a folder of its own for each test and each row of a table, never in a home."""

from __future__ import annotations

import itertools
import os
from pathlib import Path

NUMBERS = itertools.count()
BELOW: list[Path] = []
"""The folder of the run below which the next one is made."""
MADE: list[str] = []
"""The last one."""


def begin() -> None:
    """A new empty state: for locks, for the simulators behind a plain --fake, for what was learned of links.

    A place that a test has chosen itself stays.
    """
    if os.environ["XDG_STATE_HOME"] not in ("", *MADE):
        return
    own = BELOW[-1] / f"state{next(NUMBERS)}"
    runtime = own / "run"
    runtime.mkdir(0o700, parents=True)
    os.environ["XDG_STATE_HOME"] = str(own)
    MADE[:] = [str(own)]
    os.environ["XDG_RUNTIME_DIR"] = str(runtime)
    os.environ["TMPDIR"] = str(own)  # the second place for what a user's --fake keeps
