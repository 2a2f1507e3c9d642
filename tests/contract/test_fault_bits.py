"""Error bits that come while a movement is waited for: however it ends, it is not called reached, and the bit is named.

Of every family, on each of its wires, each bit that its manual has, and one that it has not; on the way, and at the target.
"""

from __future__ import annotations

from itertools import product
from types import MethodType
from typing import Any

import pytest

from handctl.docgen.read_command_tree import map_of
from handctl.families import FAMILIES
from tests.contract.facts import Faulty, facts_of
from tests.support.cli import Result, run, spying
from tests.support.each_row import each_row
from tests.support.odd_devices import odd_registers

MOMENTS = (ON_THE_WAY, AT_THE_TARGET) = (0.5, 1.0)
"""How much of the way it has behind it when the bits are set."""


def moved(family: str, one: Faulty, bits: int, share: float, *more: str, before: int = 0) -> Result:
    """Run the movement with a device that gets `bits` once it has `share` of the way behind it, and has those of `before` from the start."""
    facts = facts_of(family)
    link = f"fake://{family}?" + "&".join(filter(None, ("clock=virtual", facts.state, one.options)))
    with spying(lambda line: watched(line, one, bits, share, before)):
        return run(family, *one.words.split(), *more, "-p", link, "--json")


def watched(line: Any, one: Faulty, bits: int, share: float, before: int) -> None:
    """Let its device get them."""
    device, begun = line.device, one.place(line)
    advance, given = device.advance, []
    whole = abs(one.target - begun)
    if before:
        one.put(line, before)

    def advanced(_device: Any, now: float) -> None:
        advance(now)
        if not given and abs(one.place(line) - begun) >= share * whole - 0.5:
            given.append(now)
            one.put(line, bits)

    device.advance = MethodType(advanced, device)


@each_row("family", sorted(FAMILIES))
def test_a_family_has_error_bits_or_says_why_not(family: str) -> None:
    facts, asked = facts_of(family), dict[str, set[int]]()
    assert bool(facts.faulty) != bool(facts.reports_nothing)
    for one in facts.faulty:
        asked.setdefault(one.element.partition(".")[0], set()).update(one.bits)
    for param in map_of(family) or ():
        if param.bits:
            every = {1 << bit for bit in range(len(param.bits))}
            assert every < asked.get(param.name, set()), (param.name, "and one that is not documented")


WITH_BITS = [family for family in FAMILIES if facts_of(family).faulty]


@pytest.mark.parametrize("family", WITH_BITS)
def test_a_fault_during_a_movement_is_its_end(family: str) -> None:
    missed = []
    for one in facts_of(family).faulty:
        assert moved(family, one, 0, ON_THE_WAY).code == 0
        for share, (bit, word), expect in product(MOMENTS, one.bits.items(), ("reached", "any")):
            ended = moved(family, one, bit, share, "--expect", expect)
            arrivals = {row["arrival"] for row in ended.rows if row.get("arrival")}
            error = ended.error if ended.code else {"code": "", "text": ""}
            told = (ended.code, error["code"], word in error["text"], "reached" in arrivals)
            right = (7, "not-reached" if bit in one.stops else "blocked", True, False)
            if expect == "any" and bit in one.stops:
                right = (0, "", False, False)
            if told != right:
                missed.append((one.options, one.words, bit, share, expect, told, error["text"]))
    assert missed == []


@pytest.mark.parametrize("family", WITH_BITS)
def test_a_fault_from_before_the_movement_is_told_apart(family: str) -> None:
    """A target that is reached is, and what is new is told. A hand that refuses to move with one does not come so far."""
    for one in facts_of(family).faulty:
        old, new = [bit for bit in one.bits if bit not in one.lasting | one.stops][:2]
        again = moved(family, one, 0, ON_THE_WAY, before=old)
        if one.refused:
            assert (again.code, again.error["code"]) == (7, "not-fit"), again
            continue
        assert (again.code, {row["arrival"] for row in again.rows} - {None}) == (0, {"reached"}), again
        for share in MOMENTS:
            ended = moved(family, one, new, share, before=old)
            assert (ended.code, ended.error["code"]) == (7, "blocked"), ended
            assert (one.bits[new] in ended.error["text"], one.bits[old] in ended.error["text"]) == (True, False), ended
        for bit in one.lasting:
            lasts = moved(family, one, 0, ON_THE_WAY, before=bit)
            assert lasts.code in (6, 7) and "reached" not in {row.get("arrival") for row in lasts.rows}, lasts


@each_row(("family", "options", "words", "span"), [
    ("exo", "", "position ring=900 --wait 5 -y", (1606, 5)), ("wrist", "", "move --pitch 5 --time 300", (1028, 3)),
    ("wrist", "bus=can", "move --pitch 5 --time 300", (1028, 3)),
])  # fmt: skip
def test_error_bits_that_no_look_shows_are_read_twice(
    family: str, options: str, words: str, span: tuple[int, int]
) -> None:
    """Before the movement, on a serial line with what is read there anyway, and at its end. A device that has none is told of."""
    link, found = f"fake://{family}?clock=virtual&{options}", []

    def noted(line: Any) -> None:
        read = line.device.read

        def reading(*where: Any) -> bytes | None:
            if where[-2] <= span[0] < where[-2] + where[-1]:
                found.append(where[-2:])
            data: bytes | None = read(*where)
            return data

        line.device.read = reading

    with spying(noted):
        assert run(family, *words.split(), "-p", link, "--json").code == 0
    first, last = found[-2:]
    assert last == span, found
    assert (first == span) == (options == "bus=can"), found
    assert len(found) <= 3, found  # once more to find out who is there, but not in each look
    with odd_registers(without=[span]):
        lacks = run(family, *words.split(), "-p", link, "--json")
    assert (
        lacks.code,
        "errors-unread" in lacks.codes(),
        "errors-unread" in run(family, *words.split(), "-p", link, "--json").codes(),
    ) == (0, True, False)
