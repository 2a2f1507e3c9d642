"""Probing, id and baud, and that no procedure repeats a write under any fault (exo §2.3.1, §2.3.2)."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from handctl.devices.inspire import id_baud_save_reset, proofs
from handctl.devices.inspire.exo import calibration
from handctl.devices.inspire.exo import device as motion
from handctl.devices.inspire.exo.device import ExoHand
from handctl.errors import CheckFailed, DeviceRefused, HandctlError, NoAnswer, ProtocolError, UsageError
from handctl.model.prompts import Prompts
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.refused import refused
from tests.support.scripted import (
    NotedGuide,
    RecordedLink,
    Reply,
    ScriptedLink,
    changing,
    codes,
    fake_hand,
    hand_on,
    hexed,
    message,
    observed_hand,
    reply_to,
    script,
    unhex,
    values,
)

ID_2 = "EB 90 01 04 12 E8 03 02 04"
PROBE_1, PROBE_2 = "EB 90 01 04 11 C0 05 02 DD", "EB 90 02 04 11 C0 05 02 DE"
OTHER_2, OTHER_HERE_2 = "EB 90 02 04 11 0A 06 02 29", "90 EB 02 05 11 0A 06 2E 02 58"
HERE_1, HERE_2 = "90 EB 01 05 11 C0 05 2E 02 0C", "90 EB 02 05 11 C0 05 2E 02 0D"
READ_ID_2, ID_IS_2 = "EB 90 02 04 11 E8 03 01 03", "90 EB 02 04 11 E8 03 02 04"
BAUD_1 = "EB 90 01 04 12 E9 03 01 04"

RELEASE = "EB 90 01 0B 31 00 00 00 00 00 00 00 00 00 00 3D"


# -- probing ----------------------------------------------------------------------------------------------------------


def test_probe_reads_two_bytes_and_keeps_the_timeout() -> None:
    hand = hand_on(link := ScriptedLink(script((PROBE_1, [HERE_1]))), timeout=0.7)
    assert id_baud_save_reset.probe(hand.bus, 1) is True
    assert hand.bus.timeout == 0.7
    assert len(link.sent) == 1


def test_probe_of_nobody_asks_two_questions() -> None:
    hand = hand_on(link := ScriptedLink(baud=None), timeout=0.2)
    assert id_baud_save_reset.probe(hand.bus, 2) is False
    assert [hexed(request) for request in link.sent] == [PROBE_2, PROBE_2, OTHER_2]
    assert hand.bus.timeout == 0.2
    assert link.now() == pytest.approx(0.6)


def test_probe_keeps_the_timeout_after_garbage_too() -> None:
    hand = hand_on(ScriptedLink(lambda request: [(0.0, b"\x55")]), timeout=0.7)
    with pytest.raises(ProtocolError):
        id_baud_save_reset.probe(hand.bus, 2)
    assert hand.bus.timeout == 0.7


def test_speed_is_found_and_the_port_left_there() -> None:
    hand, link = fake_hand("baud=19200")
    assert id_baud_save_reset.find_speed(hand.bus) == 19200
    assert link.baud == 19200
    assert changing(link.sent) == []


def test_speed_not_found_leaves_the_port_as_it_was() -> None:
    hand, link = fake_hand("fault=deaf")
    assert id_baud_save_reset.find_speed(hand.bus) is None
    assert link.baud == 115200


@each_row("fault", ["", "&fault=noise", "&fault=garble"])
def test_silence_at_a_wrong_speed_is_explained(fault: str) -> None:
    hand, link = fake_hand(f"baud=57600{fault}")
    better = id_baud_save_reset.explain_silence(hand, NoAnswer("silent"))
    assert (better.exit_code, better.code) == (5, "wrong-speed")
    assert "57600" in better.text
    assert "--baud 57600" in better.hint
    assert changing(link.sent) == []


def test_silence_at_every_speed_stays_silence() -> None:
    hand, _ = fake_hand("fault=deaf")
    error = NoAnswer("silent")
    assert id_baud_save_reset.explain_silence(hand, error) is error


# -- id ---------------------------------------------------------------------------------------------------------------


@each_row("ack", ["new", "old"])
def test_id_change_follows_the_hand(ack: str) -> None:
    hand, link = fake_hand(f"ack-id={ack}")
    table = id_baud_save_reset.change_id(hand, 2)
    assert values(table) == [2]
    assert table.rows[0]["before"] == 1
    assert hand.bus.id == 2
    assert changing(link.sent) == [ID_2]
    assert codes(hand) == ["volatile"]
    assert "save --id 2" in message(hand, "volatile")


def test_new_id_is_probed_before_anything_is_written() -> None:
    hand, link = fake_hand()
    id_baud_save_reset.change_id(hand, 2)
    sent = [hexed(request) for request in link.sent]
    assert PROBE_2 in sent[: sent.index(ID_2)]


@each_row(("question", "answer"), [(PROBE_2, HERE_2), (OTHER_2, OTHER_HERE_2)])
def test_taken_id_is_refused_before_writing(question: str, answer: str) -> None:
    """Whichever of the two questions the other hand answers: a firmware may lack a register."""
    link = ScriptedLink(script((PROBE_1, [HERE_1]), (question, [answer]), free=True))
    hand = hand_on(link)
    with pytest.raises(CheckFailed) as caught:
        id_baud_save_reset.change_id(hand, 2)
    assert (caught.value.exit_code, caught.value.code) == (7, "id-taken")
    assert changing(link.sent) == []
    assert hand.bus.id == 1


def test_same_id_writes_nothing() -> None:
    hand, link = fake_hand()
    assert values(id_baud_save_reset.change_id(hand, 1)) == [1]
    assert changing(link.sent) == []
    assert codes(hand) == ["already"]


def test_hand_that_already_has_the_id_is_found() -> None:
    """Which id it had before is not known, and neither is whether this one was saved."""
    hand, link = fake_hand("id=2")
    table = id_baud_save_reset.change_id(hand, 2)
    assert values(table) == [2] and "before" not in table.rows[0]
    assert hand.bus.id == 2
    assert changing(link.sent) == []
    assert codes(hand) == ["already", "volatile"]
    assert "save --id 2" in message(hand, "volatile")


@each_row(
    ("family", "there", "typed", "code"),
    [
        ("exo", "hand", ("5",), "other-device"),
        ("exo", "hand", ("5", "--id", "5"), "other-device"),
        ("hand", "exo", ("5",), "other-device"),
        ("hand", "exo", ("5", "--id", "5"), "other-device"),
        ("exo", "exo", ("5",), ""),
        ("hand", "hand", ("5",), ""),
        ("exo", "exo", ("5", "--id", "5"), ""),
    ],
)
def test_who_responds_to_the_new_id_is_of_the_family(
    family: str, there: str, typed: tuple[str, ...], code: str
) -> None:
    result = run(family, "id", *typed, "--yes", "-p", f"fake://{there}?clock=virtual&id=5", "--json")
    assert result.code == (6 if code else 0), result
    assert not code or (code in result.said and not result.rows), result
    assert code or result.rows[0]["value"] == 5
    assert code or ("before" in result.rows[0]) == (len(typed) > 1)
    assert ("already" in result.codes()) == (not code)


def test_nobody_there_writes_nothing() -> None:
    hand, link = fake_hand("fault=deaf")
    with pytest.raises(NoAnswer):
        id_baud_save_reset.change_id(hand, 2)
    assert changing(link.sent) == []


def test_lost_ack_of_an_id_change_is_cleared_up_by_probing() -> None:
    """The write is request 5 (after the probes of the free new id, which the hand does not see, and the old id)."""
    state = {"id": 1}

    def answer(request: bytes) -> list[Reply]:
        text = hexed(request)
        if text == ID_2:
            state["id"] = 2
            return []
        known = {PROBE_1: (1, HERE_1), PROBE_2: (2, HERE_2), READ_ID_2: (2, ID_IS_2)}
        wanted, reply = known.get(text, (None, ""))
        return [(0.0, unhex(reply))] if wanted == state["id"] else []

    hand = hand_on(link := ScriptedLink(answer))
    assert values(id_baud_save_reset.change_id(hand, 2)) == [2]
    assert changing(link.sent) == [ID_2]
    assert codes(hand) == ["ack-lost", "volatile"]


def test_lost_id_change_is_told_and_not_repeated() -> None:
    link = ScriptedLink(script((PROBE_1, [HERE_1]), free=True))
    hand = hand_on(link)
    with pytest.raises(CheckFailed) as caught:
        id_baud_save_reset.change_id(hand, 2)
    assert caught.value.code == "read-back"
    assert "still responds to id 1" in caught.value.text
    assert changing(link.sent) == [ID_2]
    assert hand.bus.id == 1


@each_row(("reads", "code", "safe"), [(1, "read-back", True), (2, "id-waits", False), (None, "read-back", False)])
def test_an_id_that_may_wait_for_a_power_cycle_is_not_called_unchanged(
    reads: int | None, code: str, safe: bool
) -> None:
    """Register 1000 is read before anything is claimed: the new id may count later."""
    asked = "EB 90 01 04 11 E8 03 01 02"
    answers = [] if reads is None else [(asked, [f"90 EB 01 04 11 E8 03 {reads:02X} {reads + 1:02X}"])]
    hand = hand_on(ScriptedLink(script((PROBE_1, [HERE_1]), *answers, free=True)))
    with pytest.raises(CheckFailed) as caught:
        id_baud_save_reset.change_id(hand, 2)
    assert caught.value.code == code
    assert ("safe" in caught.value.hint) == safe and ("power-cycle" in caught.value.hint.lower()) != safe


@each_row(("takes", "left"), [(2, 1), (1, 253)])
def test_a_proof_takes_back_an_id_that_waits_for_a_power_cycle(takes: int, left: int) -> None:
    """The hand goes on to answer to its old id, while register 1000 has the new one: the next save would keep that."""
    register, written = [1], list[int]()

    def answer(request: bytes) -> list[Reply]:
        number, flag = request[2], request[4]
        if number != 1:
            return []
        if flag == 0x12:
            written.append(request[7])
            register[0] = request[7] if len(written) <= takes else register[0]
            body = request[4:7] + b"\x01"
        else:
            memory = bytes(register) if request[5:7] == b"\xe8\x03" else bytes(range(1, 200))
            body = request[4:7] + memory[: request[7]].ljust(request[7], b"\0")
        whole = bytes([1, len(body)]) + body
        return [(0.001, b"\x90\xeb" + whole + bytes([sum(whole) % 256]))]

    hand = hand_on(ScriptedLink(answer))
    if left == 1:
        assert proofs._acknowledged(hand).value == "old"
    else:
        with refused(CheckFailed, "read-back", "253"):
            proofs._acknowledged(hand)
    assert written == [253, 1] and register == [left]


def test_hand_gone_after_the_id_change() -> None:
    def answer(request: bytes) -> list[Reply]:
        return [(0.0, unhex(HERE_1))] if hexed(request) == PROBE_1 and ID_2 not in changing(link.sent) else []

    link = ScriptedLink(answer)
    with pytest.raises(NoAnswer) as caught:
        id_baud_save_reset.change_id(hand_on(link), 2)
    assert "scan" in caught.value.hint
    assert changing(link.sent) == [ID_2]


@each_row(
    ("replies", "state"),
    [
        ({}, "sent"),  # it is gone
        ({PROBE_2: HERE_1}, "sent"),  # it answers with the old id
        ({PROBE_2: HERE_2, READ_ID_2: "90 EB 02 04 11 E8 03 07 09"}, "sent"),
        ({PROBE_2: HERE_2, READ_ID_2: ID_IS_2}, "confirmed"),
    ],
)
def test_an_acknowledged_id_change_is_confirmed_only_by_the_new_id(replies: dict[str, str], state: str) -> None:
    def answer(request: bytes) -> list[Reply]:
        text = hexed(request)
        known = {**replies, ID_2: "90 EB 01 04 12 E8 03 01 03"} if ID_2 in changing(link.sent) else {PROBE_1: HERE_1}
        return [(0.0, unhex(known[text]))] if text in known else []

    hand = observed_hand(link := ScriptedLink(answer))
    with suppress(HandctlError):
        id_baud_save_reset.change_id(hand, 2)
    (write,) = hand.journal.ledger.rows()
    assert (write["state"], bool(write["next"])) == (state, state == "sent"), write


def test_an_interrupted_id_change_names_the_id_the_hand_may_have() -> None:
    hand, link = fake_hand("turnaround=0.1")
    link.interrupt_at = 1.05  # the new id was asked three times, the old one once
    with pytest.raises(HandctlError) as caught:
        id_baud_save_reset.change_id(hand, 9)
    assert caught.value.exit_code == 130
    assert "9" in caught.value.text
    assert "scan" in caught.value.hint
    assert len(changing(link.sent)) == 1


def test_refused_id_change_is_a_refusal() -> None:
    hand, link = fake_hand("fault=refuse")
    with pytest.raises(DeviceRefused):
        id_baud_save_reset.change_id(hand, 2)
    assert changing(link.sent) == [ID_2]
    assert hand.bus.id == 1


def test_register_that_contradicts_the_id_is_told() -> None:
    replies = {PROBE_2: HERE_2, READ_ID_2: "90 EB 02 04 11 E8 03 07 09"}
    hand = hand_on(ScriptedLink(lambda request: [(0.0, unhex(replies[hexed(request)]))] if request[2] == 2 else []))
    with pytest.raises(CheckFailed) as caught:
        id_baud_save_reset.change_id(hand, 2)
    assert "register 1000 reads 7" in caught.value.text


def test_id_change_on_a_line_with_echo() -> None:
    """An echo is not a device (dossier 4.11): a free id stays free."""
    hand, link = fake_hand("fault=echo")
    assert values(id_baud_save_reset.change_id(hand, 2)) == [2]
    assert changing(link.sent) == [ID_2]


@each_row("new", [144, 180, 235, 254])
@each_row("fault", ["", "fault=echo", "fault=noise", "fault=dribble"])
def test_awkward_ids(new: int, fault: str) -> None:
    hand, _ = fake_hand(fault)
    assert values(id_baud_save_reset.change_id(hand, new)) == [new]


# -- baud -------------------------------------------------------------------------------------------------------------


def test_baud_is_written_read_back_and_the_port_stays() -> None:
    hand, link = fake_hand()
    assert values(id_baud_save_reset.change_baud(hand, 57600)) == [1]
    assert link.baud == 115200
    assert changing(link.sent) == [BAUD_1]


def test_same_baud_writes_nothing() -> None:
    hand, link = fake_hand()
    assert values(id_baud_save_reset.change_baud(hand, 115200)) == [0]
    assert changing(link.sent) == []


@each_row(("rate", "code"), [(115200, 0), (57600, 1), (19200, 2), (9600, None), (921600, None), (0, None)])
def test_codes_of_the_speeds(rate: int, code: int | None) -> None:
    """exo §2.3.2."""
    hand, _ = fake_hand()
    if code is not None:
        assert hand.speed_code(rate) == code
        return
    with pytest.raises(UsageError):
        hand.speed_code(rate)


def test_baud_that_did_not_take_names_both_addresses() -> None:
    """exo §2.3 has 1001, the RH56 has 1002: only 1001 is written, both are named."""
    hand, link = fake_hand("fault=baud-at-1002")
    with pytest.raises(CheckFailed) as caught:
        id_baud_save_reset.change_baud(hand, 57600)
    assert caught.value.exit_code == 7
    assert "1001" in caught.value.hint
    assert "1002" in caught.value.hint
    assert changing(link.sent) == [BAUD_1]


@each_row("acknowledged", [True, False])
def test_a_hand_that_is_gone_behind_a_baud_change_may_be_at_the_new_speed(acknowledged: bool) -> None:
    """The manual does not say when it acts (exo §2.3.2): the usual hint names the old speed alone."""
    hand, link = fake_hand()
    plain = link.read

    def read(*given: Any, **more: Any) -> bytes:
        came = plain(*given, **more)
        return came if BAUD_1 not in changing(link.sent) or (acknowledged and hexed(link.sent[-1]) == BAUD_1) else b""

    link.read = read  # type: ignore[method-assign]
    with pytest.raises(NoAnswer) as caught:
        id_baud_save_reset.change_baud(hand, 57600)
    assert "--baud 57600" in caught.value.hint
    assert changing(link.sent) == [BAUD_1]


def test_lost_ack_of_a_baud_change_is_read_back() -> None:
    hand, link = fake_hand("fault=silent&every=2")
    assert values(id_baud_save_reset.change_baud(hand, 57600)) == [1]
    assert codes(hand) == ["ack-lost"]
    assert changing(link.sent) == [BAUD_1]


def test_speed_acts_after_save_and_power_cycle() -> None:
    hand, link = fake_hand()
    id_baud_save_reset.change_baud(hand, 57600)
    id_baud_save_reset.save(hand, Prompts())
    prompts = NotedGuide()
    assert id_baud_save_reset.wait_for_speed(hand, 57600, prompts) is True
    assert link.baud == 57600
    assert prompts.said == ["simulated: the simulator's power was switched off and on"]
    assert hexed(hand.bus.read(1001, 1)) == "01"


def test_unsaved_speed_is_gone_after_the_power_cycle() -> None:
    hand, link = fake_hand()
    id_baud_save_reset.change_baud(hand, 57600)
    assert id_baud_save_reset.wait_for_speed(hand, 57600, Prompts(), seconds=5.0) is False
    assert link.now() < 10.0
    assert id_baud_save_reset.find_speed(hand.bus) == 115200


def test_waiting_for_a_real_power_cycle_asks_for_it_and_is_bounded() -> None:
    prompts = NotedGuide()
    hand = hand_on(link := ScriptedLink(baud=115200))
    assert id_baud_save_reset.wait_for_speed(hand, 57600, prompts) is False
    assert 120.0 <= link.now() < 125.0
    assert link.bauds == [57600]
    assert "power off and on now" in prompts.said[0]


def test_hand_that_comes_back_late_is_found() -> None:
    def answer(request: bytes) -> list[Reply]:
        request = request.lstrip(b"\0")
        return [(0.0, reply_to(request, bytes(request[7])))] if link.now() > 20.0 else [(0.0, b"\xf8\x00")]

    link = ScriptedLink(answer, baud=115200)
    assert id_baud_save_reset.wait_for_speed(hand_on(link), 57600, Prompts()) is True
    assert 20.0 < link.now() < 22.0


# -- every fault ------------------------------------------------------------------------------------------------------

PROCEDURES: dict[str, Callable[[ExoHand], object]] = {
    "id": lambda hand: id_baud_save_reset.change_id(hand, 2),
    "baud": lambda hand: id_baud_save_reset.change_baud(hand, 57600),
    "clear-errors": id_baud_save_reset.clear_errors,
    "save": lambda hand: id_baud_save_reset.save(hand, Prompts()),
    "factory-reset": id_baud_save_reset.factory_reset,
    "calibrate": lambda hand: calibration.calibrate(hand, Prompts()),
    "position": lambda hand: motion.move(hand, dict(enumerate((500, 400, 300, 200, 100))), Prompts(), wait=3.0),
    "force": lambda hand: hand.command("force", [0] * 5),
}
FAULTS = [
    "silent",
    "deaf",
    "noise",
    "truncate",
    "dribble",
    "split",
    "bad-checksum",
    "wrong-id",
    "twin-id",
    "echo",
    "loopback",
    "duplicate",
    "stale",
    "late",
    "slow",
    "disconnect",
    "refuse",
    "strict",
    "no-late-frames",
    "block-silent",
]


@each_row("fault", FAULTS)
@each_row("name", PROCEDURES)
def test_no_procedure_repeats_a_write_or_hangs(name: str, fault: str) -> None:
    for after in range(3):
        hand, link = fake_hand(f"fault={fault}&after={after}&seed={after}", retries=2)
        try:
            PROCEDURES[name](hand)
        except HandctlError as exc:
            assert exc.exit_code in (3, 4, 5, 6, 7)
        written = changing(link.sent)
        if name == "position":  # behind an error come the steps of its stop, which hold and release what moves
            assert written[1:] == [] or written[1] == RELEASE, after
            written = [one for one in written[:1] if one != RELEASE]
        assert len(written) <= 1, after
        assert link.now() < 120.0, after


def test_recorded_link_counts_what_it_should() -> None:
    """The counter of writes sees them all."""
    hand, link = fake_hand()
    assert isinstance(link, RecordedLink)
    hand.bus.write(1492, unhex("2C 01"))
    hand.bus.read(1472, 2)
    hand.bus.command(0x31, [0] * 5)
    assert [text[12:14] for text in changing(link.sent)] == ["12", "31"]
