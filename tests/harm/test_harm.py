"""Do no harm: unless a command is of the device's family and confirmed, nothing on the device changes.

`pytest -m harm` tries every cell; the ordinary suite a share of them, always the same. One state, one line:
`pytest -m harm tests/harm -k "closing and not 600"`, and HANDCTL_HARM_LINE="barrett status" for the lines that begin so.
"""

from __future__ import annotations

import os
import zlib
from pathlib import Path

import pytest

from tests.harm import lines, states
from tests.harm.cell import PLAIN, Cell, cells, judge, share, try_cell
from tests.harm.excuses import EXCUSES
from tests.harm.table import PROPERTY

pytestmark = pytest.mark.harm


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("harm")
    lines.prepare(folder)
    return folder


@pytest.fixture(scope="module")
def inputs(scratch: Path) -> frozenset[Path]:
    """The files that were there before any command ran."""
    return frozenset(scratch.rglob("*"))


def test_every_command_has_a_line() -> None:
    """A command or family that is new in the tree is asked for by name."""
    assert set(lines.examples()) == set(lines.tree())


def test_an_excuse_is_needed_where_it_is_given() -> None:
    """Each covers cells; one that sent bytes and changed nothing fails, and what an excuse does not fit is harm."""
    every_line = [line for found in lines.examples().values() for line in found]
    given: dict[str, tuple[states.State, lines.Line, str]] = {}
    for state in states.states():
        for line, mode in cells(state, every_line):
            excuse = next((one for one in EXCUSES if one.grants(state, line)), None)
            if excuse is not None and mode == PLAIN and not line.asks:
                given.setdefault(excuse.why, (state, line, mode))
    assert set(given) == {excuse.why for excuse in EXCUSES}
    for why, (state, line, mode) in given.items():
        harm, excused = judge(state, line, mode, 4, 9, [], "")
        assert "needs its excuse no more" in harm and why in harm and not excused
        assert judge(state, line, mode, 4, 0, [], "") == ("", "")
    loop = next(state for state in states.states() if state.looping and not state.in_block)
    (force,) = [line for line in every_line if line.path == ("exo", "dump")]
    velocity = "hand.motors[0].drive.velocity: 0 -> 20"
    assert judge(loop, force, PLAIN, 5, 9, [velocity], "") == (velocity, "")


@pytest.mark.parametrize("state", states.states(), ids=str)
def test_no_harm(state: states.State, scratch: Path, inputs: frozenset[Path], request: pytest.FixtureRequest) -> None:
    each, wanted = share(request.config), os.environ.get("HANDCTL_HARM_LINE", "")
    every_line = [line for found in lines.examples().values() for line in found if str(line).startswith(wanted)]
    tried: list[Cell] = []
    for line, mode in cells(state, every_line):
        if zlib.crc32(f"{state}|{line}|{mode}".encode()) % each:
            continue
        tried.append(try_cell(state, line, mode, scratch))
        for path in set(scratch.rglob("*")) - inputs:
            if path.is_file():
                path.unlink()
    request.node.user_properties.append((PROPERTY, [
        {"state": str(state), "family": cell.line.family, "line": str(cell.line), "mode": cell.mode, "code": cell.code,
         "fed": cell.fed, "harm": cell.harm, "excused": cell.excused}
        for cell in tried
    ]))  # fmt: skip
    harmed = [f"handctl {cell.line} ({cell.mode}, exit {cell.code}): {cell.harm}" for cell in tried if cell.harm]
    assert not harmed, "\n".join(harmed)
