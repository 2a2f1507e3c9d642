"""The programs of README and of handctl-library(7) run as they stand; only the port is a simulated one."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.support.each_row import each_row
from tests.support.places import GUIDES

TEXT = (GUIDES / "library.md").read_text(encoding="utf-8")
README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```python( fixture)?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
BLOCKS = [(bool(fixture), text) for fixture, text in BLOCK.findall(TEXT) + BLOCK.findall(README)]


def test_there_are_such_programs() -> None:
    assert [fixture for fixture, _ in BLOCKS].count(True) == 1 and len(BLOCKS) == 7
    assert len(BLOCKS[-1][1].splitlines()) <= 5


@pytest.mark.real
@each_row("text", [text for fixture, text in BLOCKS if not fixture and (find_spec("pandas") or "pandas" not in text)])
def test_a_program_runs(text: str) -> None:
    code = text.replace('"/dev/ttyUSB0"', '"fake://exo?clock=virtual"')
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    assert done.stdout


@pytest.mark.real
def test_the_fixture_is_one(tmp_path: Path) -> None:
    (text,) = [text for fixture, text in BLOCKS if fixture]
    (tmp_path / "test_hot.py").write_text(text, encoding="utf-8")
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", tmp_path, tmp_path]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False, cwd=tmp_path)
    assert "1 passed" in done.stdout, done.stdout


TYPED = """
from collections.abc import Iterator
import handctl
from handctl.hands import Barrett, Confirm, Exo, Row

def warm(hand: Exo, confirm: Confirm = False) -> list[int]:
    rows: list[Row] = hand.set({"position_set.index": 300, "force_set": [1, 2, 3, 4, 5]}, confirm=confirm)
    samples: Iterator[list[Row]] = hand.watch("temperature", rate=50, count=3)
    return [int(row["value"]) for sample in samples for row in sample] + [len(rows)]

with handctl.connect("exo", "/dev/ttyUSB0", id=2) as hand:
    print(warm(hand), hand.position(1, 2, 3, 4, 5, confirm=lambda question, steps: bool(steps)))
with handctl.simulate("barrett", fault="silent") as other:
    device: Barrett = other
    print(device.status(check=True), handctl.errors.HandctlError("x").hint)
"""
WRONG = """
import handctl
with handctl.connect("exo", "/dev/ttyUSB0") as hand:
    hand.nonsense()
    hand.status(check="yes")
    hand.position(1, 2, 3)
handctl.connect(7)
"""


@pytest.mark.real
def test_a_strict_checker_takes_it_from_outside(tmp_path: Path) -> None:
    """Right programs pass, and each mistake is one error."""
    for name, text, errors in (("typed.py", TYPED, 0), ("wrong.py", WRONG, 3)):
        (tmp_path / name).write_text(text, encoding="utf-8")
        words = [sys.executable, "-m", "mypy", "--strict", "--config-file=", name]
        done = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False, cwd=tmp_path)
        assert done.stdout.count(": error:") == errors, done.stdout
