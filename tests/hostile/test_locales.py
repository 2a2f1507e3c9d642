"""The same as tests/hostile/locale_cells.py with handctl as a program, in locales of the system."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from tests.hostile.locale_cells import judge
from tests.support.cli import clean_environment, program

pytestmark = pytest.mark.real

PLACES = (
    {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    {"LC_ALL": "POSIX", "LANG": "nonsense"},
    {"PYTHONIOENCODING": "ascii:strict"},
)
PROGRAMS = (
    (b"-h",),
    (b"exo", b"dump", b"--fake"),
    (b"exo", b"get", b"\xff\x9b31m", b"--fake", b"--json"),
    (b"ekso", b"describe"),
)


@pytest.mark.real
@pytest.mark.parametrize("place", PLACES, ids=lambda place: " ".join(place.values()))
def test_the_same_as_a_program(place: dict[str, str], tmp_path: Path) -> None:
    """The locale of the system, and bytes in an argument."""
    encoding = place.get("PYTHONIOENCODING", "ascii").partition(":")[0]
    env = clean_environment({**place, "XDG_STATE_HOME": str(tmp_path)})
    for words in PROGRAMS:
        command = [*map(os.fsencode, program()), *words]
        done = subprocess.run(command, capture_output=True, env=env, timeout=60, check=False, stdin=subprocess.DEVNULL)
        how = "json" if b"--json" in words else "table"
        spoken = "utf-8" if "POSIX" in place.values() else encoding  # Python takes UTF-8 there
        failure = judge(done.returncode, done.stdout, done.stderr, spoken, how)
        assert not failure, (words, failure)
