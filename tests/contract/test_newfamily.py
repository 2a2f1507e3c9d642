"""`python -m handctl.newfamily NAME`: a copy of the tree gets a sixth family, which passes the contract; mistakes do not."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from handctl.newfamily import Refused, plan
from tests.support.places import TESTS

TOP = TESTS.parent
NAME = "gripper"
MOST_LINES = 350
"""In a family and its simulator, every line counted."""
DEVICE, CODEC, MAP, PROBE, CLI = (
    f"src/handctl/devices/{NAME}/{file}.py" for file in ("device", "codec", "map", "probe", "cli")
)


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A copy of the source tree with the family in it."""
    top = tmp_path_factory.mktemp("tree") / "handctl"
    unwanted = shutil.ignore_patterns("__pycache__", "pictures", "bench")
    for part in ("src", "tests", "man", "completions"):
        shutil.copytree(TOP / part, top / part, ignore=unwanted)
    for file in ("README.md", "pyproject.toml"):
        shutil.copy(TOP / file, top / file)
    done = python(top, "handctl.newfamily", NAME)
    assert done.returncode == 0, done
    yield top
    shutil.rmtree(top)


def python(top: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """A module of that tree, with that tree's own package."""
    here = {**os.environ, "PYTHONPATH": str(top / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(
        [sys.executable, "-m", *words], cwd=top, env=here, capture_output=True, text=True, timeout=300, check=False
    )


def contract(top: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """The contract of the new family alone."""
    marked = ("-q", "-n", "0", "-m", "not real", "-k", NAME, "-p", "no:cacheprovider", "--tb", "line")
    return python(top, "pytest", *marked, *words, "tests/contract/test_contract.py")


@pytest.mark.real
def test_it_runs_at_once_and_is_short(tree: Path) -> None:
    done = python(tree, "handctl", NAME, "status", "-p", f"fake://{NAME}?clock=virtual", "--format", "plain")
    assert done.returncode == 0, done
    assert "temperature\t31.4" in done.stdout.splitlines()
    assert f"handctl\\-{NAME}" in (tree / "man/man1" / f"handctl-{NAME}.1").read_text("utf-8")
    assert f"handctl\\-{NAME}" in (tree / "man/man7" / f"handctl-{NAME}-guide.7").read_text("utf-8")
    assert f"| Not yet. Simulators only. | The manual alone. | handctl-{NAME}-guide(7) |" in (
        tree / "README.md"
    ).read_text("utf-8")
    folders = (tree / "src/handctl/devices" / NAME, tree / "src/handctl/sim" / NAME)
    texts = [path.read_text("utf-8") for folder in folders for path in folder.glob("*.py")]
    assert sum(text.count("\n") for text in texts) < MOST_LINES


@pytest.mark.parametrize("name", ["exo", "sim", "aidin", "Gripper", "two words", "../x", "class", "1st", ""])
def test_a_name_that_cannot_be_is_refused(name: str) -> None:
    with pytest.raises(Refused):
        plan(TOP, name)


@pytest.mark.real
def test_a_family_that_is_there_is_left_alone(tree: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in tree.rglob("*")}
    done = python(tree, "handctl.newfamily", NAME)
    assert done.returncode == 2, done
    assert {path: path.stat().st_mtime_ns for path in tree.rglob("*")} == before


@pytest.mark.real
def test_it_passes_the_contract(tree: Path) -> None:
    done = contract(tree)
    assert done.returncode == 0, done.stdout[-3000:]


ASKING = "src/handctl/model/asking.py"
WRITES = "lambda talk, _: talk.answer(b'S speed 40\\n', 'A', 'speed')"
MUTANTS = {
    "a probe that writes": (PROBE, "prober(Talk, ", f"prober(type('Wrong', (Talk,), {{'value': {WRITES}}}), "),
    "a stop that is not sent on Ctrl-C": (DEVICE, "self.driving(guide)", "self.keeping(lambda: [])"),
    "a dry run that sends": (CLI, "run.planner().plan(", "run.device().plan_and_look("),
    "a look that asks nothing": (DEVICE, "return self.value(POSITION)", "return 0"),
}
"""Mistake -> file, what stands there, what the mistake makes of it."""


@pytest.mark.real
@pytest.mark.parametrize("mistake", MUTANTS)
def test_the_contract_finds_a_mistake(tree: Path, mistake: str) -> None:
    file, right, wrong = MUTANTS[mistake]
    path = tree / file
    text = path.read_text("utf-8")
    assert text.count(right) == 1, mistake
    looking = "\n    def plan_and_look(self, changes: Sequence[tuple[Element, Number]]) -> list[Step]:\n        self.dump()\n        return self.plan(changes)\n"
    more = tree / DEVICE
    whole = more.read_text("utf-8")
    try:
        path.write_text(text.replace(right, wrong), "utf-8")
        if "plan_and_look" in wrong:
            more.write_text(whole + looking, "utf-8")
        done = contract(tree, "-x")
    finally:
        path.write_text(text, "utf-8")
        if path != more:
            more.write_text(whole, "utf-8")
    assert done.returncode == 1, f"not found: {mistake}\n{done.stdout[-2000:]}"
