"""What handctl keeps for a user between commands: a folder of its own for each test and each row of a table, never in a home."""

from __future__ import annotations

import itertools
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from unittest import mock

NUMBERS = itertools.count()
BELOW: list[Path] = []
"""The folder of the run below which the next one is made."""
MADE: list[str] = []
"""The last one."""


IN_MEMORY = Path("/dev/shm")
ROOM = 2 << 30
"""Bytes that must be free there: a run leaves 100 MB, and pytest keeps three."""


def memory() -> str | None:
    """Where the folders of a run are made, if there is room: it has tens of thousands, and each takes a disk up to a hundred times as long."""
    usable = os.access(IN_MEMORY, os.R_OK | os.W_OK | os.X_OK)
    return str(IN_MEMORY) if usable and shutil.disk_usage(IN_MEMORY).free >= ROOM else None


@contextmanager
def scratch() -> Iterator[Path]:
    """A folder for all that this process and its children make for a while: it is gone at the end, after Ctrl-C too."""
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(dir=memory(), ignore_cleanup_errors=True))
        if (shared := sys.modules.get("handctl.system.user_folders")) is not None:  # else it is not used here
            stack.enter_context(mock.patch.object(shared, "shared_folder", lambda: folder))
        before, tempfile.tempdir = tempfile.tempdir, folder
        try:
            yield Path(folder)
        finally:
            tempfile.tempdir = before


def begin() -> None:
    """A new empty state: for locks, for the simulators behind a plain --fake, for what was learned of links.

    A place that a test has chosen itself stays. What all users of a machine share has no variable: it lies with the rest.
    """
    from handctl.system import user_folders  # not sooner: a mistake is seeded before handctl is imported

    user_folders.shared_folder = lambda: MADE[-1] if MADE else tempfile.gettempdir()
    if os.environ["XDG_STATE_HOME"] not in ("", *MADE):
        return
    if not (MADE and _untouched(MADE[-1])):
        own = BELOW[-1] / f"state{next(NUMBERS)}"
        (own / "run").mkdir(0o700, parents=True)
        MADE[:] = [str(own)]
    os.environ["XDG_STATE_HOME"] = MADE[-1]
    os.environ["XDG_RUNTIME_DIR"] = os.path.join(MADE[-1], "run")
    os.environ["TMPDIR"] = MADE[-1]  # the second place for what a user's --fake keeps


def _untouched(own: str) -> bool:
    """Whether nobody has left anything there: most tests keep nothing, and a folder is costly to make and to remove."""
    try:
        return os.listdir(own) == ["run"] and not os.listdir(os.path.join(own, "run"))
    except OSError:
        return False
