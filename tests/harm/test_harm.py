"""The lines and the excuses of the harm matrix; its cells are the suite `harm`."""

from __future__ import annotations

from tests.harm import lines, states
from tests.harm.cell import PLAIN, cells, judge
from tests.harm.excuses import EXCUSES


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
