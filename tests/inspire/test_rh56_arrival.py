"""How movements of an RH56 hand end, what is expected of them, and what waits where they did not (rh56 §6)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import handctl
from handctl.devices.inspire.eb90 import pack_s16
from handctl.errors import NotConfirmed
from handctl.sim.hand.registers import Hand
from tests.support.cli import Result, run
from tests.support.each_row import each_row
from tests.support.odd_devices import odd_registers
from tests.support.swap import swapped

ALL = ("little", "ring", "middle", "index", "thumb_bend", "thumb_rotation")


def hand(*words: str, at: str = "", yes: bool = True) -> Result:
    link = f"fake://hand?clock=virtual{at}"
    return run("hand", *words, "-p", link, "--json", *(["-y"] if yes else []))


def stopped(state: Path, target: str = "angle_set=1000,1000,1000,1000,1000,1000") -> str:
    """A hand with speed 0 that was told to go somewhere: as after a stop."""
    at = f"&state={state}"
    assert hand("speed", *["0"] * 6, at=at).code == 0
    assert hand("set", target, at=at).code == 0
    return at


# -- how it ends ------------------------------------------------------------------------------------------------------


@each_row(
    ("at", "words", "code", "arrival"),
    [
        ("", ("angle", "index=900", "--wait", "3"), None, "reached"),
        ("", ("position", "index=900", "--wait", "3"), None, "reached"),
        ("", ("angle", "index=900", "--wait", "0.2"), "still-moving", "moving"),
        ("", ("angle", "index=900", "--wait", "0.2", "--expect", "any"), "still-moving", "moving"),
        ("&object=300", ("angle", "index=0", "--wait", "3"), "not-reached", "contact"),
        ("&object=300", ("angle", "index=0", "--wait", "3", "--expect", "contact"), None, "contact"),
        ("&object=300", ("angle", "index=0", "--wait", "3", "--expect", "any"), None, "contact"),
        ("", ("angle", "index=900", "--wait", "3", "--expect", "contact"), "no-contact", "reached"),
        ("&fault=blocked", ("angle", "index=0", "--wait", "3", "--expect", "any"), "blocked", "blocked"),
        ("&fault=stops-short", ("angle", "ring=0", "--wait", "3"), "not-reached", "short"),
        ("&fault=stops-short", ("angle", "ring=0", "--wait", "3", "--expect", "contact"), "not-reached", "short"),
        ("&fault=stops-short", ("angle", "ring=0", "--wait", "3", "--expect", "any"), None, "short"),
    ],
)
def test_the_end_of_a_movement(at: str, words: tuple[str, ...], code: str | None, arrival: str) -> None:
    ended = hand(*words, at=at)
    assert (ended.code, ended.error["code"] if ended.code else None) == (7 if code else 0, code), ended
    assert {row["arrival"] for row in ended.rows} == {arrival}


@each_row(
    ("address", "byte", "why"),
    [
        (1606, bits, label)
        for bits, label in ((1, "locked_rotor"), (4, "over_current"), (8, "motor"), (16, "communication"))
    ]
    + [(1612, 255, "it has restarted")],
)
def test_a_fault_during_a_movement_is_its_end_whatever_the_angle_says(address: int, byte: int, why: str) -> None:
    """The status code may go on as before: the error bits, and a status as behind a power-on, speak against the movement too."""
    write, holds = Hand.write, dict[int, bytes]()

    def wrote(self: Hand, place: int, *more: Any) -> bool | None:
        holds[address] = bytes([byte] * 6)
        return write(self, place, *more)

    for expect in ("reached", "any"):
        holds.clear()
        with odd_registers(holds=holds), swapped((Hand, "write", wrote)):
            ended = hand("angle", "index=900", "--wait", "3", "--expect", expect)
        assert ended.code == 7, ended
        assert ended.error["code"] == "blocked"
        assert why in ended.error["text"]
        assert {row["arrival"] for row in ended.rows} == {"blocked"}


@pytest.mark.parametrize("expect", ["reached", "contact", "any"])
def test_at_speed_0_nothing_arrives_and_nothing_is_said_to_move(tmp_path: Path, expect: str) -> None:
    at = stopped(tmp_path / "hand.json")
    ended = hand("angle", *["900"] * 6, "--wait", "3", "--expect", expect, at=at)
    assert (ended.code, ended.error["code"]) == (7, "no-speed")
    assert {row["arrival"] for row in ended.rows} == {"no-speed"}
    assert "no-speed" in hand("angle", *["900"] * 6, at=at).codes()


def test_a_slow_finger_is_not_taken_for_one_that_stands() -> None:
    """At speed 1 its angle changes every 0.8 s, which is longer than the others need to count as standing."""
    at = "&refresh=0"
    assert hand("angle", "index=462", "--wait", "40", at=at).code == 0
    with handctl.simulate("hand") as slow:
        slow.speed(1, 1, 1, 1, 1, 1, confirm=True)
        (place, _) = slow.angle("index=470", wait=60.0, confirm=True)
        assert (place["value"], place["arrival"]) == (470, "reached")


def test_a_status_of_the_movement_before_is_no_contact() -> None:
    """A hand that ignores a command still reports what ended the one before it."""
    still = {1546: (440).to_bytes(2, "little") * 6, 1612: bytes([3] * 6)}
    with odd_registers(holds=still):
        ended = hand("angle", "index=0", "--wait", "3", "--expect", "contact")
    assert (ended.code, ended.error["code"]) == (7, "not-reached")
    assert {row["arrival"] for row in ended.rows} == {"unmoved"}


def test_expectations_need_a_wait() -> None:
    assert hand("angle", "index=900", "--expect", "any").code == 2


# -- what waits -------------------------------------------------------------------------------------------------------


@each_row(
    "words",
    [
        ("speed", *["300"] * 6),
        ("speed", "index=300"),
        ("set", "speed_set.index=300"),
        ("set", "speed_set.index=300", "force_limit.index=900"),
    ],
)
def test_a_speed_that_lets_a_finger_go_on_is_asked_for(tmp_path: Path, words: tuple[str, ...]) -> None:
    at = stopped(tmp_path / "hand.json")
    asked = hand(*words, at=at, yes=False)
    assert (asked.code, asked.json["writes"][0]["state"]) == (8, "not-sent")
    assert "index (angle_set) 440 to 1000" in asked.error["text"]
    assert hand(*words, at=at).code == 0


def test_what_lets_nothing_go_is_not_asked_for(tmp_path: Path) -> None:
    at = f"&state={tmp_path / 'hand.json'}"
    assert hand("speed", *["0"] * 6, at=at, yes=False).code == 0, "this stops"
    assert hand("set", "stroke_set=211,322,433,544,655,766", at=at).code == 0
    assert hand("speed", *["300"] * 6, at=at, yes=False).code == 0, "every finger is where it was sent"
    assert hand("speed", *["500"] * 6, at=at, yes=False).code == 0, "and it still is"


def test_a_finger_that_has_a_speed_may_still_be_off_its_target(tmp_path: Path) -> None:
    """Its targets are read whatever speed it has (contract §7)."""
    at = f"&state={tmp_path / 'hand.json'}"
    assert hand("set", "stroke_set=211,322,433,544,655,766", at=at).code == 0
    assert hand("speed", *["20"] * 6, at=at, yes=False).code == 0
    assert hand("angle", "index=1000", at=at).code == 0
    for words in (("speed", "index=500"), ("set", "speed_set.index=500")):
        asked = hand(*words, at=at, yes=False)
        assert asked.code == 8
        assert "index (angle_set)" in asked.error["text"] and " to 1000" in asked.error["text"]
    assert hand("speed", "ring=500", at=at, yes=False).code == 0


def test_a_limit_that_lets_a_closing_finger_go_on_is_asked_for(tmp_path: Path) -> None:
    at = f"&object=300&state={tmp_path / 'hand.json'}"
    assert hand("set", "speed_set.index=20", at=at).code == 0
    assert hand("angle", "index=0", "--wait", "30", "--expect", "contact", at=at).code == 0
    assert hand("force", "index=100", at=at, yes=False).code == 0, "a lower one holds it"
    assert hand("force", "index=900", at=at, yes=False).code == 8
    assert hand("force", "ring=900", at=at, yes=False).code == 0


def test_a_movement_names_the_others_that_it_lets_go(tmp_path: Path) -> None:
    at = stopped(tmp_path / "hand.json")
    asked = hand("set", "speed_set=300,300,300,300,300,300", "angle_set.index=500", at=at, yes=False)
    assert asked.code == 8


def test_the_library_asks_too() -> None:
    with handctl.simulate("hand") as one:
        one.speed(0, 0, 0, 0, 0, 0)
        one.angle("index=1000", confirm=True)
        with pytest.raises(NotConfirmed):
            one.speed("index=300")
        said: list[str] = []
        one.speed(
            "index=300",
            confirm=lambda question, steps: bool(said.append(question)) or all(step["moves"] for step in steps),
        )
        assert "index (angle_set) 440 to 1000" in said[0]


@each_row(("force", "position_set", "asked"), [
    ((500, 0, 0, 0, 0), (110, 220, 330, 440, 550), ("little (force_set) to 500",)),
    ((0, 0, -20, 0, 0), (110, 220, 330, 440, 550), ()),  # the middle finger has no error
    ((0, 0, 0, 0, 0), (110, 220, 330, 440, 550), ()),
    ((500, 0, 0, 0, 0), (900, 220, 330, 440, 550), ("little (position_set) 110 to 900", "little (force_set) to 500")),
])  # fmt: skip
def test_clearing_an_error_asks_where_a_force_is_commanded(
    force: tuple[int, ...], position_set: tuple[int, ...], asked: tuple[str, ...]
) -> None:
    """The finger pushes its wearer with that force once the error is gone (contract §7)."""
    holds = {1606: b"\x01\0\0\0\0", 1498: pack_s16(force), 1486: pack_s16(position_set)}
    with odd_registers(holds=holds):
        result = run("exo", "clear-errors", "-p", "fake://exo?clock=virtual", "--json")
    assert (result.code == 8) == bool(asked), result
    for words in asked:
        assert words in result.error["text"]


@each_row("family", ["exo", "hand"])
def test_clearing_an_error_that_holds_a_finger_is_asked_for(tmp_path: Path, family: str) -> None:
    for fault, code in (("locked-rotor", 8), ("", 0)):
        link = f"fake://{family}?clock=virtual{f'&fault={fault}' if fault else ''}"
        asked = run(family, "clear-errors", "-p", link, "--json")
        assert asked.code == code, asked
