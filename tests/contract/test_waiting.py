"""What waits in a device: no command lets it go unasked, whichever road it takes (contract §7).

A family names the states in which something waits, in its facts, or says why nothing ever does. Every line of its commands that
writes and asks nothing by itself is tried in each state, unconfirmed: what moves must not have moved.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from handctl.command.family import load
from handctl.families import FAMILIES
from handctl.link import NoLink
from handctl.model.command_settings import Settings
from handctl.model.device import Device
from handctl.model.result import Journal
from tests.contract.facts import Waiting, facts_of
from tests.harm.cell import connected, link_of
from tests.harm.lines import Line, lines_of, prepare
from tests.harm.states import State
from tests.support.cli import run
from tests.support.each_row import each_row

SECONDS = 3.0
"""Until whatever was let go has moved."""


def device_of(family: str) -> Device:
    made: Device = load(family, "cli").cli.family.open(NoLink(), Settings(), Journal())
    return made


@each_row("family", sorted(FAMILIES))
def test_a_family_has_states_in_which_something_waits_or_says_why_not(family: str) -> None:
    facts = facts_of(family)
    assert bool(facts.waiting) != bool(facts.nothing_waits)
    assert bool(facts.waiting) == bool(device_of(family).releases)
    asked = {release.by for release in device_of(family).releases}
    assert asked <= {name for state in facts.waiting for name in state.by}, (
        "each write that lets something go has its state"
    )


def tried(family: str, waiting: Waiting, line: Line, scratch: Path, *more: str) -> tuple[int, bool]:
    """Exit code of a line, and whether anything has moved behind it."""
    state = State(family, waiting.name, family, family, dict(waiting.options), waiting.before)
    words = [word.replace("{dir}", str(scratch / family)) for word in line.words]
    with connected(state) as port:
        before = waiting.places(port.line)
        environment = {"XDG_STATE_HOME": str(scratch / "state"), "XDG_RUNTIME_DIR": str(scratch)}
        done = run(*words, "-p", link_of(state), *more, env=environment)
        port.line.advance(port.line.now + SECONDS)
        after = waiting.places(port.line)
    return done.code, any(abs(b - a) > waiting.near for a, b in zip(before, after, strict=True))


STATES = [(family, state) for family in sorted(FAMILIES) for state in facts_of(family).waiting]


@pytest.mark.parametrize(("family", "waiting"), STATES, ids=[f"{family}, {state.name}" for family, state in STATES])
def test_nothing_is_let_go_unasked(family: str, waiting: Waiting, tmp_path: Path) -> None:
    prepare(tmp_path)
    lines = [line for line in lines_of(family) if line.writes and not line.asks and line.path != (family, "stop")]
    found = {str(line): tried(family, waiting, line, tmp_path) for line in lines}
    assert [line for line, (_, moved) in found.items() if moved] == []
    asked = {line for line, (code, _) in found.items() if code == 8}
    for words in waiting.asked:
        line = Line((family, *words.split()[:1]), (family, *words.split()), writes=True)
        assert tried(family, waiting, line, tmp_path) == (8, False), words
        code, moved = tried(family, waiting, line, tmp_path, "--yes")
        assert code in (0, 7) and moved == waiting.goes, words
    assert asked <= {str(line) for line in lines if line.path[1] in {words.split()[0] for words in waiting.asked}}
