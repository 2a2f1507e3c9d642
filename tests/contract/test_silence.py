"""A silent device is found silent by its first exchange, retries included, whatever is to be read; never by each block of registers.

Over each family, each of its wires and each command that only reads. What takes longer has its reason in the family's facts.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from handctl.families import FAMILIES
from tests.contract.commands import ELSEWHERE, commands, scratch_of
from tests.contract.facts import Silent, facts_of
from tests.support.cli import run, spying

SEARCHES = ("scan",)
"""What looks for a device everywhere it may be: how far, and how long, is its own test's (tests/tools/test_scan.py)."""
PLAIN = Silent()


def reading(family: str) -> Iterator[str]:
    """The commands of a family that ask a device, and write nothing to it."""
    for name, command in commands(family):
        if not (command.writes or command.offline or name in SEARCHES or (family, name) in ELSEWHERE):
            yield name


@pytest.mark.parametrize("family", FAMILIES)
def test_a_silent_device_is_found_silent_by_its_first_exchange(family: str, tmp_path: Path) -> None:
    facts, found = facts_of(family), {}
    names = list(reading(family))
    assert {"status", "dump", "get", "watch"} <= {*names}
    for wire in facts.silent:
        assert bool(wire.why) == (wire.seconds > PLAIN.seconds), wire
        link = f"fake://{family}?{'&'.join(filter(None, ('clock=virtual&fault=silent', wire.options)))}"
        for name in names:
            scratch_of(tmp_path)
            with spying() as spy:
                result = run(family, *name.split(), *facts.words(name, tmp_path), "-p", link, *wire.words)
            assert (result.code, result.said[-1]) == (4, "no-answer"), (name, result)
            found[wire.options, wire.words, name] = spy.now, wire.seconds
    assert {key: times for key, times in found.items() if times[0] > times[1]} == {}
