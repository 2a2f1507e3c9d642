"""`pair`: two simulated RH56 hands with one id on one line, on two links, and with one IP address."""

from __future__ import annotations

from pathlib import Path

import pytest

import handctl.sim.hand
from handctl.devices.inspire.hand.pairing import Paired, pair
from handctl.errors import CheckFailed, DeviceRefused, HandctlError, Interrupted, NoAnswer, NotConfirmed
from handctl.model.prompts import Prompts
from tests.inspire.pairing_bench import Desk, OneLine, Person, fake_hand, simulated

TWO_IDS = ({"model": "df"}, {"model": "df", "id": 2})
ONE_ID = ({"model": "df"}, {"model": "df"})
OLD, NEW = "tcp://192.168.11.210", "tcp://192.168.11.211"


@pytest.fixture(autouse=True)
def _listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(handctl.sim.hand, "LISTED", True, raising=False)


def person(desk: Desk) -> Person:
    assert isinstance(desk.prompts, Person)
    return desk.prompts


def told(paired: list[Paired]) -> list[tuple[str, int, str]]:
    return [(one.link, one.hand.bus.id, one.side) for one in paired]


def codes(desk: Desk) -> list[str]:
    return [message.code for message in desk.journal.messages]


# -- one line -----------------------------------------------------------------------------------------------------------


def test_two_ids_on_one_line_are_told_apart_by_a_movement(tmp_path: Path) -> None:
    line, names = OneLine(tmp_path, *TWO_IDS), ("right", "left")
    desk = line.desk(names)
    assert told(pair(desk, line.name, None)) == [(line.name, 1, names[0]), (line.name, 2, names[1])]
    for hand in line.hands:
        assert (hand.acts["move"], hand.acts["id"], hand.acts["save"]) == (2, 0, 0)
        assert hand.values("speed-set") == (601, 602, 603, 604, 605, 606), "the speed is put back"
        assert hand.values("angle-set")[:3] == (-1, -1, -1), "the other fingers are left alone"
    (question, _) = desk.confirmed[0]
    assert "index finger of id 1" in question and "from 440 to 520 and back at speed 100" in question
    assert [step.moves for step in desk.steps] == 2 * [False, True, True, False]


def test_one_id_twice_on_one_line_is_changed_in_safe_steps(tmp_path: Path) -> None:
    """Changed while the other one is unplugged, saved only when both have answered."""
    line = OneLine(tmp_path, *ONE_ID)
    saves: list[int] = []

    def plug_in() -> None:
        saves.append(line.hands[1].acts["save"])
        line.plug(1, out=False)()

    desk = line.desk(("left", "right"), line.plug(1, out=True), plug_in)
    assert told(pair(desk, line.name, None)) == [(line.name, 2, "right"), (line.name, 1, "left")]
    assert [hand.number for hand in line.hands] == [1, 2]
    assert saves == [0] and line.hands[1].flash_number == 2
    assert [hand.acts["id"] for hand in line.hands] == [0, 1]
    assert "volatile" not in codes(desk)
    line.bus.power_cycle()
    assert [hand.number for hand in line.hands] == [1, 2]


def test_hands_that_speak_modbus_only_are_told_apart_too(tmp_path: Path) -> None:
    """EB90 is silent, and the answers of one id twice are no answers: that id is found in Modbus all the same (rh56 §2.5)."""
    line = OneLine(tmp_path, *({**one, "speaks": "modbus"} for one in ONE_ID))
    desk = line.desk(("left", "right"), line.plug(1, out=True), line.plug(1, out=False))
    assert told(pair(desk, line.name, None)) == [(line.name, 2, "right"), (line.name, 1, "left")]
    assert [hand.flash_number for hand in line.hands] == [1, 2]


def test_run_again_it_goes_on_where_it_ended(tmp_path: Path) -> None:
    """Ids were changed, then nobody looked which hand moved: the second run finds two ids and only moves."""
    line = OneLine(tmp_path, *ONE_ID)
    blind = line.desk(("?", "!"), line.plug(1, out=True), line.plug(1, out=False))
    with pytest.raises(NotConfirmed) as caught:
        pair(blind, line.name, None)
    assert caught.value.code == "not-seen"
    desk = line.desk(("left", "right"))
    assert told(pair(desk, line.name, None)) == [(line.name, 1, "left"), (line.name, 2, "right")]
    assert line.hands[1].acts["id"] == 1


def test_no_id_is_changed_while_two_hands_obey_it(tmp_path: Path) -> None:
    line = OneLine(tmp_path, *ONE_ID)
    desk = line.desk(("left", "right"), lambda: None)
    with pytest.raises(DeviceRefused) as caught:
        pair(desk, line.name, None)
    assert caught.value.code == "twin-id"
    assert caught.value.hint.startswith("unplug one of them")
    assert [hand.acts["id"] + hand.acts["move"] for hand in line.hands] == [0, 0]


def test_hands_that_follow_one_id_are_not_saved(tmp_path: Path) -> None:
    """Alike in every answer, both took the new id: the old one is silent then, and a power-cycle brings it back."""
    line = OneLine(tmp_path, *ONE_ID)
    for each in line.bus.lines:
        each.second = False
    desk = line.desk(("left", "right"), lambda: None, lambda: None)
    with pytest.raises(CheckFailed) as caught:
        pair(desk, line.name, None)
    assert caught.value.code == "gone" and "id 1" in caught.value.text
    assert "power-cycle" in caught.value.hint
    line.bus.power_cycle()
    assert [hand.number for hand in line.hands] == [1, 1]


def test_the_other_hand_must_be_plugged_in_again(tmp_path: Path) -> None:
    line = OneLine(tmp_path, *ONE_ID)
    desk = line.desk(("left", "right"), line.plug(1, out=True), lambda: None)
    with pytest.raises(CheckFailed) as caught:
        pair(desk, line.name, None)
    assert caught.value.code == "gone"
    assert "id 2 until the next power-cycle" in caught.value.text
    assert line.hands[1].acts["save"] == 0


def test_three_hands_and_none_are_refused(tmp_path: Path) -> None:
    line = OneLine(tmp_path, *TWO_IDS, {"model": "df", "id": 9})
    with pytest.raises(CheckFailed) as caught:
        pair(line.desk(("left", "right", "spare")), line.name, None)
    assert "ids 1, 2, 9" in caught.value.text
    empty = OneLine(tmp_path, {"model": "df", "fault": "silent"})
    with pytest.raises(NoAnswer):
        pair(empty.desk(("left",)), empty.name, None)


def test_two_hands_on_one_can_bus(tmp_path: Path) -> None:
    file = tmp_path / "can.toml"
    rows = "".join(f'[[device]]\nkind = "hand"\nmodel = "tp"\nid = {number}\n' for number in (1, 2))
    file.write_text(f'[line]\nwire = "can"\n{rows}', encoding="utf-8")
    from handctl.link import open_link

    name = f"fake://bus?clock=virtual&file={file}"
    link = open_link(name)
    hands = [line.device.hand for line in link._line.lines]  # type: ignore[attr-defined]
    desk = Desk(name, Person(dict(zip(("right", "left"), hands, strict=True))))
    desk.network[name] = link
    assert told(pair(desk, name, None)) == [(name, 1, "right"), (name, 2, "left")]


# -- two links ----------------------------------------------------------------------------------------------------------


def two_links() -> Desk:
    one, two = fake_hand(model="df"), fake_hand(model="tp")
    desk = Desk("one", Person({"right": simulated(one), "left": simulated(two)}))
    desk.network = {"one": one, "two": two}
    return desk


def test_two_links_keep_their_ids() -> None:
    desk = two_links()
    assert told(pair(desk, "one", "two")) == [("one", 1, "right"), ("two", 1, "left")]
    assert all(hand.acts["id"] == hand.acts["save"] == 0 for hand in person(desk).hands.values())


def test_two_links_to_one_hand_are_seen() -> None:
    desk = two_links()
    desk.network["two"] = desk.network["one"]
    with pytest.raises(CheckFailed) as caught:
        pair(desk, "one", "two")
    assert caught.value.code == "same-hand"


def test_two_links_that_read_the_same_name_no_hand() -> None:
    """A side that is said moves nothing: then only what differs between two units shows that there are two."""
    desk = two_links()
    desk.network["two"] = desk.network["one"]
    with pytest.raises(CheckFailed) as caught:
        pair(desk, "one", "two", first="left")
    assert caught.value.code == "same-hand"


def test_a_side_that_is_said_moves_nothing() -> None:
    desk = two_links()
    assert told(pair(desk, "one", "two", first="left")) == [("one", 1, "left"), ("two", 1, "right")]
    assert person(desk).asked == [] and desk.confirmed == []
    assert all(hand.acts["move"] == 0 for hand in person(desk).hands.values())


def test_nobody_there_means_nothing_is_sent() -> None:
    desk = two_links()
    desk.prompts = Prompts()
    with pytest.raises(NotConfirmed):
        pair(desk, "one", "two")
    assert desk.journal.counters.sent == 0


@pytest.mark.parametrize("fault", ["blocked", "locked-rotor", "hot"])
def test_a_hand_that_is_not_fit_is_not_moved_and_neither_is_the_other(fault: str) -> None:
    desk = two_links()
    desk.network["two"] = fake_hand(model="df", fault=fault)
    hand = simulated(desk.network["two"])
    person(desk).hands["left"] = hand
    if fault == "blocked":
        assert told(pair(desk, "one", "two")) == [("one", 1, "right"), ("two", 1, "left")]
        return
    with pytest.raises(CheckFailed) as caught:
        pair(desk, "one", "two")
    assert caught.value.code == "not-fit"
    assert all(hand.acts["move"] == 0 for hand in person(desk).hands.values())


@pytest.mark.parametrize("lines", [0, 1, 5, 20, 40])
def test_ctrl_c_names_nobody_and_both_hands_stand_still(lines: int) -> None:
    """The speed stays 0 behind it: put back, the finger would go on to where it was sent."""
    desk = two_links()
    person(desk).interrupts = lines
    with pytest.raises(Interrupted) as caught:
        pair(desk, "one", "two")
    assert "no hand is named" in caught.value.text.casefold()
    for link in (desk.network["one"], desk.network["two"]):
        hand = simulated(link)
        link.sleep(1.0)
        link._line.advance(link.now())  # type: ignore[attr-defined]
        here = hand.values("angle")
        link.sleep(2.0)
        link._line.advance(link.now())  # type: ignore[attr-defined]
        assert hand.values("angle") == here


# -- one IP address -----------------------------------------------------------------------------------------------------


class Shelf:
    """Two tactile hands with one address, of which one is on. The address that a hand holds in flash is its own after power-on."""

    def __init__(self) -> None:
        self.links = [fake_hand(bus="modbus-tcp"), fake_hand(bus="modbus-tcp")]
        self.hands = [simulated(link) for link in self.links]
        self.desk = Desk(OLD, Person(dict(zip(("left", "right"), self.hands, strict=True))))
        self.on(0, 1)

    def on(self, *numbers: int) -> None:
        """Only these are on; of two with one address the first answers."""
        self.desk.network.clear()
        for number in numbers:
            self.links[number].power_cycle()
            link = self.links[number]._line.device  # type: ignore[attr-defined]
            link.reconnected()
            name = "tcp://" + ".".join(map(str, self.hands[number].address))
            self.desk.network.setdefault(name, self.links[number])


def test_two_hands_with_one_address_get_two(tmp_path: Path) -> None:
    shelf = Shelf()
    person(shelf.desk).acts = [lambda: shelf.on(1), lambda: shelf.on(1), lambda: shelf.on(0, 1)]
    assert told(pair(shelf.desk, OLD, None)) == [(NEW, 1, "right"), (OLD, 1, "left")]
    assert [hand.address for hand in shelf.hands] == [(192, 168, 11, 210), (192, 168, 11, 211)]
    assert ("192.168.11.211" in {word for _, word in shelf.desk.confirmed}) is True
    assert [hand.acts["ip"] for hand in shelf.hands] == [0, 4]
    assert "power-cycle" not in codes(shelf.desk), "that is done, and nobody is asked for it once more"


def test_the_address_may_be_chosen() -> None:
    shelf = Shelf()
    person(shelf.desk).acts = [lambda: shelf.on(1), lambda: shelf.on(1), lambda: shelf.on(0, 1)]
    paired = pair(shelf.desk, OLD, None, address="192.168.123.42")
    assert told(paired) == [("tcp://192.168.123.42", 1, "right"), (OLD, 1, "left")]


def test_a_hand_that_does_not_come_back_is_waited_for_and_told() -> None:
    shelf = Shelf()
    person(shelf.desk).acts = [lambda: shelf.on(1), shelf.desk.network.clear]
    with pytest.raises(HandctlError) as caught:
        pair(shelf.desk, OLD, None)
    assert caught.value.exit_code == 3
    assert "no hand at 192.168.11.211" in caught.value.text
    assert "no hand is named" in caught.value.text.casefold()


def test_the_hand_that_stayed_must_hold_the_old_address() -> None:
    """Both were on when the address was changed: one answers at both places."""
    shelf = Shelf()

    def confused() -> None:
        shelf.on(1)
        shelf.desk.network[OLD] = shelf.links[1]

    person(shelf.desk).acts = [lambda: shelf.on(1), lambda: shelf.on(1), confused]
    with pytest.raises(CheckFailed) as caught:
        pair(shelf.desk, OLD, None)
    assert caught.value.code == "other-address"
