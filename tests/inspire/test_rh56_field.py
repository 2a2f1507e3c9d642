"""The dossier's field complaints as checks of `doctor` (rh56 §7): each on a hand that shows it, and on one that does not."""

from __future__ import annotations

import pytest

from handctl.devices.inspire.hand import probe as field
from handctl.devices.inspire.hand.register_map import DF, DG2, F1, STATUS, TP
from handctl.devices.inspire.hand.remedies import REMEDIES
from handctl.link import ByteLink
from tests.inspire.rh56_support import CAN, EB90, RTU, TCP, hand_on
from tests.support.each_row import each_row

Rows = dict[str, tuple[str, str, str]]


def rows(model: str = DF, wire: str = EB90, *, answered: bool = True, do: str = "", **options: object) -> Rows:
    """The checks of a hand on virtual time: name -> (status, evidence, remedy). `do`: writes before them, ADDRESS HEX."""
    hand = hand_on(model, wire, **options)
    if isinstance(hand.link, ByteLink):
        hand.link.set_baud(115200)
    for one in filter(None, do.split(",")):
        address, data = one.split(":")
        hand.bus.write(int(address), bytes.fromhex(data))
    return {name: (status, evidence, remedy) for name, status, evidence, remedy in field.further(hand, answered)}


HEALTHY = ["protocol", "same_id", "fingers", "first_movement", "current_limit", "refresh"]


@pytest.mark.parametrize(
    ("model", "wire"), [(DF, EB90), (DF, RTU), (DF, CAN), (TP, EB90), (TP, TCP), (F1, EB90), (F1, RTU), (DG2, EB90)]
)
def test_a_healthy_hand_has_no_finding(model: str, wire: str) -> None:
    found = rows(model, wire)
    assert list(found) == [name for name in HEALTHY if wire != TCP or name != "same_id"]
    assert {status for status, _, _ in found.values()} <= {"ok", "skipped"}
    assert all(evidence for _, evidence, _ in found.values())
    assert found["current_limit"][0] == ("skipped" if model == TP else "ok")


# -- the line ---------------------------------------------------------------------------------------------------------


@each_row("wire", [EB90, RTU, CAN])
@each_row("answered", [True, False])
def test_two_hands_with_one_id_are_named(wire: str, answered: bool) -> None:
    status, evidence, remedy = rows(DF, wire, answered=answered, fault="twin-id")["same_id"]
    assert status == "fail"
    assert "8 of 8 readings are destroyed" in evidence
    assert "`handctl hand id 2`" in remedy and "`handctl hand pair`" in remedy


@pytest.mark.parametrize("fault", ["bad-checksum", "silent", "noise"])
def test_a_bad_line_is_no_second_hand(fault: str) -> None:
    found = rows(DF, EB90, answered=False, fault=fault)
    assert found.get("same_id", ("skipped", "", ""))[0] != "fail"


def test_a_hand_that_is_silent_to_eb90_and_answers_in_modbus() -> None:
    status, evidence, remedy = rows(DF, EB90, answered=False, speaks="modbus")["protocol"]
    assert (status, evidence) == ("fail", "the hand replies in Modbus RTU, but not in EB90")
    assert remedy == "add --protocol modbus"
    assert rows(DF, RTU, answered=False, speaks="eb90")["protocol"][2] == "add --protocol eb90"


def test_one_that_was_found_behind_eb90_is_told() -> None:
    hand = hand_on(DF, EB90, both=True, speaks="modbus")
    hand.dump()
    name, status, evidence, remedy = field.protocol(hand)
    assert (name, status, evidence) == ("protocol", "warning", "the hand replies in Modbus RTU, but not in EB90")
    assert remedy.startswith("add --protocol modbus.")
    assert rows(DF, RTU)["protocol"] == ("ok", "the hand replies in Modbus RTU", "")


def test_a_silent_line_names_the_network() -> None:
    found = rows(DF, EB90, answered=False, fault="silent")
    assert found["protocol"] == ("ok", "the hand replies neither in EB90 nor in Modbus RTU", "")
    assert found["network"][2] == "run `handctl hand doctor -p tcp://192.168.11.210`"


@pytest.mark.parametrize(("model", "wire"), [(TP, TCP), (DF, EB90)])
def test_the_refresh_of_the_hand_is_measured(model: str, wire: str) -> None:
    status, evidence, _ = rows(model, wire, jitter=1)["refresh"]
    assert status == "ok"
    assert evidence.startswith("the readings change every 3")
    assert rows(model, wire)["refresh"][1].startswith("the readings of the resting hand did not change.")


def test_a_slow_refresh_is_a_finding() -> None:
    status, evidence, remedy = rows(TP, TCP, jitter=1, refresh=0.09)["refresh"]
    assert (status, evidence.partition(" ms")[0]) == ("warning", "the readings change every 90")
    assert remedy


# -- the hand ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fault", "part", "words", "key"),
    [
        ("locked-rotor", "little", "error 0x01", "locked_rotor"),
        ("over-temperature", "ring", "error 0x02", "over_temperature"),
        ("over-current", "middle", "error 0x04", "over_current"),
        ("communication", "thumb_bend", "error 0x10", "communication"),
    ],
)
def test_an_error_bit_names_its_finger(fault: str, part: str, words: str, key: str) -> None:
    status, evidence, told = rows(DF, EB90, fault=fault)["fingers"]
    assert status == "fail"
    assert f"{part}: " in evidence and words in evidence
    assert told == REMEDIES[key].hint, "that of the table, which status shows too"
    assert rows(DF, EB90)["fingers"][0] == "ok"


@each_row("code", [5, 6, 7, 8])
def test_status_codes_have_a_remedy_each(code: int) -> None:
    status = dict.fromkeys(("little", "ring", "middle", "index", "thumb_bend", "thumb_rotation"), 2)
    held = {"status": {**status, "index": code}, "error": dict.fromkeys(status, 0)}
    verdict = field.fingers(held)
    assert verdict[1] == "fail"
    assert verdict[2].startswith(f"index: status {code}, ")
    assert verdict[3] == REMEDIES[STATUS[code]].hint
    for healthy in (0, 1, 2, 3, 255):
        assert field.fingers({**held, "status": {**status, "index": healthy}})[1] == "ok"


def test_other_programs_may_show_a_fault_on_the_neighbour() -> None:
    """14 public programs swap the bytes of an error word (rh56 §2.2)."""
    over_modbus, over_eb90 = (rows(TP, wire, fault="locked-rotor")["fingers"][1] for wire in (TCP, EB90))
    assert over_modbus.endswith("A program that swaps the two bytes of a word would show this on ring")
    assert "swaps" not in over_eb90


def test_heat_is_a_finding() -> None:
    status, evidence, remedy = rows(DF, EB90, fault="hot")["fingers"]
    assert status == "fail" and " °C" in evidence and "cool" in remedy


@pytest.mark.parametrize("model", [DF, TP])
def test_a_forgotten_speed_is_told_before_the_first_movement(model: str) -> None:
    assert rows(model)["first_movement"] == ("ok", "the next movement has speed 601 to 606", "")
    status, evidence, remedy = rows(model, speed=1000)["first_movement"]
    assert (status, remedy) == ("warning", field.SLOWLY)
    assert evidence.startswith("speed 1000 was set by an earlier program: little, ring, ")
    assert evidence.endswith("After power-up it is 701")
    status, evidence, remedy = rows(model, speed=0)["first_movement"]
    assert (status, remedy) == ("warning", field.SLOWLY)
    assert evidence.startswith("speed 0: little, ring, ")


@pytest.mark.parametrize(("milliamperes", "status"), [(0, "warning"), (199, "warning"), (200, "ok"), (1500, "ok")])
def test_current_limits(milliamperes: int, status: str) -> None:
    """1026 is the limit of the index finger of a DF; the others stay as they are."""
    found = rows(DF, EB90, do=f"1026:{milliamperes.to_bytes(2, 'little').hex()}")["current_limit"]
    assert found[0] == status
    if status == "warning":
        assert found[1].startswith(f"index {milliamperes} mA: a movement without a load draws up to 194 mA")
        assert "`handctl hand set current_limit.FINGER=MA`" in found[2]


def test_limits_outside_the_documented_range() -> None:
    assert field.current_limit({"current_limit": {"index": 1501}})[1] == "warning"


# -- the network -------------------------------------------------------------------------------------------------------


def test_the_address_is_read_on_every_wire_of_a_tactile_hand() -> None:
    for wire in (EB90, RTU, TCP, CAN):
        assert field.address_of(hand_on(TP, wire)) == "192.168.11.210"
    assert field.address_of(hand_on(DF)) == ""
    assert field.address_of(hand_on(TP, fault="silent")) == ""
