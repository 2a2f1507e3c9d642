"""The ledger of writes, alone: what it makes of frames, acknowledgements, evidence and plans."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence

import pytest

from handctl.command.family import load
from handctl.devices.barrett.explain_bytes import words
from handctl.devices.inspire import modbus_frames
from handctl.link import open_link
from handctl.link.transcript import observed
from handctl.model.command_settings import Settings
from handctl.model.param import Step
from handctl.model.stop_sequence import StopContext, run_stop, stop_sequence_of
from handctl.model.write_ledger import Frame, Ledger, WriteRules
from handctl.wording import honest
from tests.support.each_row import each_row


class Words(WriteRules):
    """A protocol of the tests: W writes, G writes in a group, R reads; A acknowledges, N refuses the frame it names."""

    def sent(self, data: bytes, can_id: int | None) -> Sequence[Frame]:
        if data[:1] == b"R":
            return ()
        group = "movement" if data[:1] == b"G" else ""
        return (Frame(data, data[1:], data, group, can_id, unasked=data[:1] == b"^"),)

    def came(self, data: bytes, can_id: int | None) -> Iterable[tuple[Hashable, bool]]:
        return ((data[1:], data[:1] == b"A"),) if data[:1] in b"AN" else ()

    def planned(self, data: bytes, can_id: int | None) -> Hashable:
        return data

    def addressed(self, data: bytes, can_id: int | None) -> Sequence[tuple[str, int]]:
        return ()

    def next(self, data: bytes, can_id: int | None) -> str:
        return "read it"


def ledger(*plan: bytes) -> Ledger:
    made = Ledger()
    made.words = Words()
    made.plan([Step(f"step {data.decode()}", data) for data in plan])
    return made


def pass_all(found: Ledger, *passed: str) -> None:
    for text in passed:
        found.passed(0.0, text[0], text[1:].encode(), None)


def states(found: Ledger) -> list[tuple[str, str]]:
    return [(bytes.fromhex(row["bytes"]).decode(), row["state"]) for row in found.rows()]


@each_row(
    ("passed", "said"), [((">G1", ">G1"), ", 2 times: 47 31"), ((">G1", ">G2"), ", in 2 parts, the first: 47 31")]
)
def test_frames_of_one_group_are_no_repetition_of_the_first(passed: tuple[str, ...], said: str) -> None:
    found = ledger()
    pass_all(found, *passed)
    assert found.text()[1].endswith(said), found.text()


def test_a_plan_that_never_went_out_is_not_sent() -> None:
    found = ledger(b"W1", b"W2")
    pass_all(found, ">R1", "<A1")
    assert states(found) == [("W1", "not-sent"), ("W2", "not-sent")]
    assert not found.began
    assert found.text() == ["writes: none of 2 steps was sent"]


def test_what_went_out_is_sent_until_something_confirms_it() -> None:
    found = ledger(b"W1", b"W2", b"W3")
    pass_all(found, ">W1", "<A1", ">W2", "<A9")
    assert states(found) == [("W1", "confirmed"), ("W2", "sent"), ("W3", "not-sent")]
    assert [row["next"] for row in found.rows()] == ["", "read it", ""]
    assert [row["meaning"] for row in found.rows()] == ["step W1", "step W2", "step W3"]
    assert found.text()[0] == "writes: 1 not sent, 1 sent, unconfirmed, 1 confirmed"


def test_refused_is_not_confirmed() -> None:
    found = ledger(b"W1")
    pass_all(found, ">W1", "<N1")
    assert states(found) == [("W1", "refused")]
    assert not found.unconfirmed


def test_a_refusal_that_comes_later_counts() -> None:
    found = ledger()
    pass_all(found, ">W1", "<A1", "<N1")
    assert states(found) == [("W1", "refused")]


def test_what_no_plan_has_is_there_too() -> None:
    found = ledger(b"W1")
    found.explain = lambda data, can_id: f"the bytes {data.decode()}"
    pass_all(found, ">W7", "<A7")
    assert [(row["meaning"], row["state"]) for row in found.rows()] == [
        ("the bytes W7", "confirmed"),
        ("step W1", "not-sent"),
    ]


def test_a_group_is_one_step_with_its_count_and_its_ends() -> None:
    found = ledger(b"G3")
    pass_all(found, ">G1", ">G2", ">R5", ">G3")
    (row,) = found.rows()
    assert (row["bytes"], row["last"], row["count"], row["meaning"]) == ("47 31", "47 33", 3, "step G3")


@each_row(
    ("passed", "state"),
    [
        ((">G1", "<A1", ">G2", "<A2"), "confirmed"),
        ((">G1", ">G2", "<A2"), "sent"),  # the first one was never acknowledged
        ((">G1", "<A1", ">G2"), "sent"),
        ((">G1", "<A1", ">G2", "<N2"), "refused"),
    ],
)
def test_a_group_is_confirmed_when_each_of_it_is(passed: tuple[str, ...], state: str) -> None:
    found = ledger()
    pass_all(found, *passed)
    assert [row["state"] for row in found.rows()] == [state]


def test_a_group_of_an_hour_takes_no_more_room_than_one_of_a_second() -> None:
    found = ledger()
    for number in range(20000):
        pass_all(found, f">G{number % 7}", f"<A{number % 7}")
    assert [row["count"] for row in found.rows()] == [20000]
    assert len(found._waiting) == 7
    assert found.rows()[0]["state"] == "confirmed"


def test_what_counts_only_where_it_was_planned() -> None:
    found = ledger()
    pass_all(found, ">^C")
    assert not found.began
    found = ledger(b"^C")
    pass_all(found, ">^C")
    assert states(found) == [("^C", "sent")]


def test_evidence_of_a_device_confirms_and_speaks_against() -> None:
    found = ledger(b"W1", b"W2", b"W3")
    pass_all(found, ">W1", "<A1", ">W2", ">W3", "<N3")
    found.doubt("reads 5", Step("", b"W1"))
    found.confirm("read back", Step("", b"W2"))
    assert states(found) == [("W1", "sent"), ("W2", "confirmed"), ("W3", "refused")]
    assert [row["evidence"] for row in found.rows()] == ["reads 5", "read back", "refused by the device"]


def test_evidence_without_steps_confirms_what_was_sent_since_a_mark_and_nothing_before() -> None:
    found = ledger()
    pass_all(found, ">W1")
    mark = found.mark
    pass_all(found, ">W2")
    found.confirm("seen", since=mark)
    assert states(found) == [("W1", "sent"), ("W2", "confirmed")]


def test_the_rest_of_a_movement_is_never_to_be_sent_on_its_own() -> None:
    """The last object of a ramp would make a hand jump: after an abort the whole command is run again."""
    setting, movement = ledger(b"W1", b"W2"), ledger(b"W1")
    movement.plan([Step("the end of a ramp", b"W2", moves=True)])
    for found, last in ((setting, "then send the remaining steps (step 2)"), (movement, "then run the command again")):
        pass_all(found, ">W1")
        assert last in found.text()[-1]
    assert "then send" not in "".join(movement.text())


def test_the_steps_of_a_stop_are_no_remaining_steps() -> None:
    """One that could not be sent is told, and not as part of the movement; one that was interrupted was not needed."""
    found = ledger(b"W1", b"W2")
    pass_all(found, ">W1")
    with found.stopping():
        found.plan([Step("stop", b"WS", moves=True)])
    assert states(found)[1:] == [("W2", "not-sent"), ("WS", "not-sent")]
    assert "(step 2)" in found.text()[-1], found.text()
    alone = ledger(b"W1")
    pass_all(alone, ">W1")
    with pytest.raises(KeyboardInterrupt), alone.stopping():
        alone.plan([Step("stop", b"WS", moves=True)])
        raise KeyboardInterrupt
    assert states(alone) == [("W1", "sent")]


def test_a_second_stop_is_planned_on_no_link_that_sends_nothing_more() -> None:
    """The device was stopped at the request of another command, whose steps are all there."""
    link = open_link("fake://barrett?initialized=1&clock=virtual", baud=9600)
    found = Ledger()
    found.words = words()
    observed(link, found)
    context = StopContext(Settings(), speed=9600)
    run_stop(link, stop_sequence_of("barrett", context), ledger=found)
    before = found.rows()
    link.block_sending()
    with pytest.raises(KeyboardInterrupt):
        run_stop(link, stop_sequence_of("barrett", context), ledger=found)
    assert found.rows() == before and [row["state"] for row in before] == ["confirmed"] * 2


def test_the_same_write_to_another_device_is_another_step() -> None:
    """In one stop; sent again to the same one it is counted, whatever running number it has on Modbus TCP."""
    pdu = modbus_frames.write_request(1522, bytes(12))
    for first, second, steps in (
        (modbus_frames.rtu(1, pdu), modbus_frames.rtu(2, pdu), 2),
        (modbus_frames.rtu(2, pdu), modbus_frames.rtu(2, pdu), 1),
        (modbus_frames.tcp(1, pdu), modbus_frames.tcp(2, pdu), 1),
    ):
        found = Ledger()
        found.words = load("hand", "write_rules").words()
        with found.stopping():
            found.passed(0.0, ">", first, None)
            found.passed(0.0, ">", second, None)
        assert [row["bytes"] for row in found.rows()] == [first.hex(" ").upper(), second.hex(" ").upper()][:steps]


def test_a_plan_told_twice_is_one_plan() -> None:
    found = ledger(b"W1", b"W1")
    found.plan([Step("again", b"W1"), Step("more", b"W2")])
    assert states(found) == [("W1", "not-sent"), ("W1", "not-sent"), ("W2", "not-sent")]


@each_row(
    ("text", "left"),
    [
        ("a longer --deadline. Nothing was sent.", "a longer --deadline."),
        ("nothing was sent", ""),
        ("settings changed meanwhile, nothing was written: a b", "settings changed meanwhile: a b"),
        ("nothing was sent; name another place", "name another place"),
        ("Nothing was sent to the device.", ""),
        ("nothing else is known", "nothing else is known"),
    ],
)
def test_a_claim_that_nothing_was_sent_is_taken_out_of_a_text(text: str, left: str) -> None:
    assert honest(text).rstrip(".") == left.rstrip(".")


def test_the_abort_of_a_stop_counts_in_the_bytes_of_every_speed() -> None:
    found = Ledger()
    found.words = words()
    pass_all(found, ">\3")  # of a connection: nothing was to be stopped
    found.plan([Step("^C", b"\3", moves=True)])
    pass_all(found, ">\3", ">\0\3", ">\3")
    assert [(row["bytes"], row["count"], row["last"]) for row in found.rows()] == [("03", 3, "03")]
    assert found.going == [None]


def test_the_abort_behind_one_that_ended_a_movement_counts_too() -> None:
    found = Ledger()
    found.words = words()
    pass_all(
        found, ">1C\r", "<1C\n\r", ">\3", "<\n\r=> ", ">!\0\r", "<!\0\n\rERR 32\n\r=> ", ">\3", "<\n\r=> ", ">1T\r"
    )
    assert [(row["bytes"], row.get("count", 1)) for row in found.rows()] == [
        ("31 43 0D", 1),
        ("03", 2),
        ("31 54 0D", 1),
    ]
