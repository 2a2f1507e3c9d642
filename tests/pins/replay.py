"""Replay pins: the tests of this folder are these two, for some suites each, so that no file takes long."""

from __future__ import annotations

from pathlib import Path

from tests.pins import HERE, file_of, pins
from tests.search.suite import Suite, command, run, suites, told

ALL = {
    "test_any_line": "any-line",
    "test_contract": "contract contact",
    "test_faults": "faults lines prove",
    "test_hostile": "harm hostile",
    "test_wire": "wire",
}
"""Of which suites each file replays the pins, by how their names begin; the last one is in tests/wire."""


def pinned(file: str = "") -> list[Suite]:
    """Suites that have pins: those of a test file, or all."""
    begins = tuple(ALL[Path(file).stem].split()) if file else ""
    return [suite for suite in suites().values() if suite.name.startswith(begins) and file_of(suite).exists()]


def groups(file: str) -> list[tuple[str, str]]:
    """Suite and family of each test."""
    return [(suite.name, group) for suite in pinned(file) for group in dict.fromkeys(map(suite.group, pins(suite)))]


def replay(name: str, group: str, folder: Path) -> None:
    """Run the pins of a suite and family, and name each that fails, with what repeats it."""
    suite, wrong = suites()[name], []
    for number, cell in enumerate(cell for cell in pins(suite) if suite.group(cell) == group):
        place = folder / str(number)
        place.mkdir()
        if why := suite.stale(cell):
            wrong.append(f"{cell}\n  {why}")
            continue
        try:
            run(cell, place)
        except Exception as exc:  # noqa: BLE001 - every pin is tried, and what failed is named
            wrong.append(f"repeat: {command(cell)}\n  {told(exc)}")
    assert not wrong, f"{len(wrong)} failed\n" + "\n".join(wrong)


def complete(suite: Suite) -> None:
    """What needs a pin has one."""
    shown = {what for cell in pins(suite) for what in suite.shows(cell)}
    missing = sorted(set(suite.wanted()) - shown)
    assert not missing, f"no pin for {missing}: `python -m tests.pins {suite.name} --only TEXT`"


def files() -> set[str]:
    """The names of the files of pins."""
    return {path.stem for path in HERE.glob("*.txt")}
