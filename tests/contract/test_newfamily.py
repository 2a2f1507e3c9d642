"""`python -m handctl.newfamily NAME`: a copy of the tree gets a sixth family, which passes the contract; mistakes do not."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from handctl import guides
from handctl.newfamily import Refused, plan
from handctl.newfamily.__main__ import NEXT
from tests.kernel.budget import code_lines
from tests.support.each_row import each_row
from tests.support.places import TESTS

TOP = TESTS.parent
NAME = "gripper"
MOST_LINES = 300
"""Code lines of a family and its simulator."""
MOST_GENERATED = 16
"""Files that the generator changes for a new family, besides its own two pages."""
FILES = ("device", "codec", "parameter_map", "probe", "cli", "explain_bytes", "stopper")
DEVICE, CODEC, MAP, PROBE, CLI, EXPLAIN, STOPPER = (f"src/handctl/devices/{NAME}/{file}.py" for file in FILES)


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
    here = {**os.environ, "PYTHONPATH": str(top / "src")}
    here.pop("PYTHONDONTWRITEBYTECODE", None)  # some ten processes import the same copy: the first compiles it
    return subprocess.run(
        [sys.executable, "-m", *words], cwd=top, env=here, capture_output=True, text=True, timeout=300, check=False
    )


def contract(top: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """The contract of the new family alone, as the guide has it, without its pins."""
    marked = ("-q", "-n", "0", "-m", "not real", "-k", NAME, "-p", "no:cacheprovider", "--tb", "line")
    return python(top, "pytest", *marked, *words, "tests/contract")


def commands_of_the_guide() -> list[list[str]]:
    """What handctl-development(7) says to run for a new family, its creation left out."""
    found = re.search(r"```\n(python -m handctl\.newfamily .*?)```", guides.source("development"), re.DOTALL)
    assert found is not None
    return [line.split()[2:] for line in found[1].splitlines()[1:]]


@pytest.mark.real
def test_it_runs_at_once_and_is_short(tree: Path) -> None:
    done = python(tree, "handctl", NAME, "status", "-p", f"fake://{NAME}?clock=virtual", "--format", "plain")
    assert done.returncode == 0, done
    assert "temperature\t31.4" in done.stdout.splitlines()
    assert f"handctl\\-{NAME}" in (tree / "man/man1" / f"handctl-{NAME}.1").read_text("utf-8")
    assert f"handctl\\-{NAME}" in (tree / "man/man7" / f"handctl-{NAME}-guide.7").read_text("utf-8")
    row = (
        f"| Not yet run on real hardware: tested only with simulators. | The manual alone. | handctl-{NAME}-guide(7) |"
    )
    assert row in (tree / "README.md").read_text("utf-8")
    folders = (tree / "src/handctl/devices" / NAME, tree / "src/handctl/sim" / NAME)
    texts = [path.read_text("utf-8") for folder in folders for path in folder.glob("*.py")]
    assert sum(map(code_lines, texts)) <= MOST_LINES
    changed = [path for path in _files(tree) if _is_other(path, TOP / path.relative_to(tree))]
    assert len(changed) <= MOST_GENERATED + 1, "\n".join(map(str, changed))  # and the registry, in which it has its row


def _files(tree: Path) -> Iterator[Path]:
    """What somebody wrote, or the generator; not what Python keeps of it."""
    return (path for path in tree.rglob("*") if path.is_file() and path.parent.name != "__pycache__")


def _is_other(path: Path, before: Path) -> bool:
    return before.is_file() and path.read_bytes() != before.read_bytes()


@each_row("name", ["exo", "sim", "aidin", "Gripper", "two words", "../x", "class", "1st", ""])
def test_a_name_that_cannot_be_is_refused(name: str) -> None:
    with pytest.raises(Refused):
        plan(TOP, name)


@pytest.mark.real
def test_a_family_that_is_there_is_left_alone(tree: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in _files(tree)}
    done = python(tree, "handctl.newfamily", NAME)
    assert done.returncode == 2, done
    assert {path: path.stat().st_mtime_ns for path in _files(tree)} == before


@pytest.mark.real
def test_it_is_green_by_the_commands_of_its_guide(tree: Path) -> None:
    assert NEXT.count("python -m") == len(commands_of_the_guide())
    for words in commands_of_the_guide():
        assert f"python -m {' '.join(words)}" in NEXT.format(name=NAME)
        more = ("-n", "0", "-p", "no:cacheprovider") if words[0] == "pytest" else ()
        done = python(tree, *words, *more)
        assert done.returncode == 0, done.stdout[-3000:]


MUTANTS = {
    "a probe that writes": (PROBE, ".value(POSITION)", ".ask(b'S speed 40\\n')"),
    "a stop that is not sent on Ctrl-C": (DEVICE, "self.driven(prompts)", "self.keeping(lambda: [])"),
    "a dry run that sends": (CLI, "run.planner().plan(", "run.device().plan_and_look("),
    "a look that asks nothing": (DEVICE, "lambda: self.value(POSITION))", "lambda: 0)"),
    "a register that moves without being marked": (MAP, " acts=MOVES, verb", " verb"),
    "arrived under a blocked finger": (DEVICE, "AxisReading(self.conversation.value(POSITION))", "AxisReading(target)"),
    "a refusal told as confirmed": (EXPLAIN, 'frame.kind != "E"', "True"),
    "a register explained by another's name": (
        EXPLAIN,
        "key, asks = rest[0]",
        'key, asks = rest[0].replace("speed", "force")',
    ),
    "a value in another unit": (MAP, "high=50, decimals=1", "high=50"),
    "garbage taken for a line": (CODEC, "ANSWER.fullmatch(text)", "ANSWER.match(text)"),
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

    def forgotten() -> None:
        """Python keeps a module by second and size: a mistake must not be taken for what is right, nor the other way."""
        shutil.rmtree(path.parent / "__pycache__", ignore_errors=True)

    try:
        path.write_text(text.replace(right, wrong), "utf-8")
        if "plan_and_look" in wrong:
            more.write_text(whole + looking, "utf-8")
        forgotten()
        done = contract(tree, "-x")
    finally:
        path.write_text(text, "utf-8")
        if path != more:
            more.write_text(whole, "utf-8")
        forgotten()
    assert done.returncode == 1, f"not found: {mistake}\n{done.stdout[-2000:]}"
