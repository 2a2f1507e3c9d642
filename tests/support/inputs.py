"""The files that command lines name: thousands of runs begin with the same ones, so they are made once in a process."""

from __future__ import annotations

import functools
import os
import tempfile
from collections.abc import Callable
from pathlib import Path


def made_once(prepare: Callable[[Path], None]) -> Callable[[Path], Path]:
    """Decorator: what it puts into a folder is written again into the next one. Returns the folder."""
    made: dict[str, bytes] = {}

    @functools.wraps(prepare)
    def again(folder: Path) -> Path:
        if not made:
            with tempfile.TemporaryDirectory() as first:
                prepare(Path(first))
                made.update({path.name: path.read_bytes() for path in Path(first).iterdir()})
        for name, content in made.items():
            file = os.open(f"{folder}/{name}", os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
            os.write(file, content)
            os.close(file)
        return folder

    return again
