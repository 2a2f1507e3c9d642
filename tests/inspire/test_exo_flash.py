"""Clear errors, save, factory reset: one write each, then waiting or reading (exo §2.3.3 to §2.3.5)."""

from __future__ import annotations

import pytest

from handctl.devices.inspire import id_baud_save_reset
from handctl.devices.inspire.exo.device import ExoHand
from handctl.devices.inspire.exo.explain_bytes import words
from handctl.errors import DeviceRefused, HandctlError, LinkError, NoAnswer
from handctl.model.prompts import Prompts
from handctl.model.result import Table
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.scripted import (
    Reply,
    ScriptedLink,
    changing,
    codes,
    fake_hand,
    hand_on,
    hexed,
    message,
    observed_hand,
    unhex,
    values,
    zeros_to_reads,
)

SAVE, SAVE_ACK, SAVED = "EB 90 01 04 12 ED 03 01 08", "90 EB 01 04 12 ED 03 01 08", "90 EB 01 04 11 ED 03 00 06"
SAVE_FAILED = "90 EB 01 04 11 ED 03 FF 05"
CLEAR = "EB 90 01 04 12 EC 03 01 07"
RESET = "EB 90 01 04 12 EE 03 01 09"


# -- errors -----------------------------------------------------------------------------------------------------------


def test_clearable_errors_go_and_heat_stays() -> None:
    hand, link = fake_hand("fault=faults")
    table = id_baud_save_reset.clear_errors(hand)
    assert values(table) == [0, 2, 0, 2, 0]
    assert [row["before"] for row in table.rows] == [1, 2, 4, 6, 24]
    assert table.failure is None
    assert changing(link.sent) == [CLEAR]
    texts = [entry.text for entry in hand.journal.messages]
    assert [text.split(":")[0] for text in texts] == ["ring", "index"]
    assert all("now 78 °C" in text and "cools" in text for text in texts)


def errors_after(byte: int) -> ScriptedLink:
    """A hand whose index finger shows 05 before and `byte` after the clearing."""
    state = {"error": 5}

    def answer(request: bytes) -> list[Reply]:
        if hexed(request) == CLEAR:
            state["error"] = byte
            return [(0.0, unhex("90 EB 01 04 12 EC 03 01 07"))]
        (((_, reply),)) = zeros_to_reads(request)
        body = bytearray(reply[2:-1])
        body[5 + 3] = state["error"]
        return [(0.0, reply[:2] + bytes(body) + bytes([sum(body) % 256]))]

    return ScriptedLink(answer)


@each_row("byte", [0x01, 0x04, 0x08, 0x10, 0x03, 0x1F, 0x20, 0x80])
def test_errors_that_remain_are_a_failed_check(byte: int) -> None:
    table = id_baud_save_reset.clear_errors(hand_on(errors_after(byte)))
    assert values(table) == [0, 0, 0, byte, 0]
    assert table.failure is not None
    assert (table.failure.exit_code, table.failure.code) == (7, "errors-remain")
    assert "index" in table.failure.text
    assert "over_temperature" not in table.failure.text


@each_row("byte", [0x00, 0x02])
def test_heat_alone_is_no_failure(byte: int) -> None:
    hand = hand_on(errors_after(byte))
    assert id_baud_save_reset.clear_errors(hand).failure is None
    assert codes(hand) == ["over-temperature"] * bool(byte)


def test_lost_ack_of_clear_errors_is_cleared_up_by_reading() -> None:
    hand, link = fake_hand("fault=faults,silent&every=2")
    assert values(id_baud_save_reset.clear_errors(hand)) == [0, 2, 0, 2, 0]
    assert "ack-lost" in codes(hand)
    assert changing(link.sent) == [CLEAR]


def test_refused_clear_errors() -> None:
    hand, link = fake_hand("fault=refuse")
    with pytest.raises(DeviceRefused):
        id_baud_save_reset.clear_errors(hand)
    assert changing(link.sent) == [CLEAR]


# -- save -------------------------------------------------------------------------------------------------------------


@each_row("flag", [17, 18])
def test_saved(flag: int) -> None:
    hand, link = fake_hand(f"result-flag={flag}")
    table = id_baud_save_reset.save(hand, Prompts())
    assert values(table) == ["saved"]
    assert link.now() == pytest.approx(2.5, abs=0.1), "another result may contradict the first"
    assert [hexed(request) for request in link.sent] == [SAVE]


@each_row("flag", [17, 18])
def test_save_that_failed(flag: int) -> None:
    """00 is saved and FF is failed: the sense is inverted (RH56 ch. 3 ex. 4)."""
    hand, link = fake_hand(f"result-flag={flag}&fault=save-fails")
    with pytest.raises(DeviceRefused) as caught:
        id_baud_save_reset.save(hand, Prompts())
    assert (caught.value.exit_code, caught.value.code) == (6, "save-failed")
    assert "FF" in caught.value.text
    assert [hexed(request) for request in link.sent] == [SAVE]


def test_save_without_a_result_is_a_note() -> None:
    hand, link = fake_hand("fault=no-late-frames")
    assert values(id_baud_save_reset.save(hand, Prompts())) == ["accepted"]
    assert codes(hand) == ["no-result"]
    assert link.now() >= 2.5
    assert [hexed(request) for request in link.sent] == [SAVE]


@each_row(
    ("replies", "result"),
    [
        pytest.param([(0.0, SAVE_ACK), (1.0, SAVED)], "saved", id="as documented"),
        pytest.param([(1.0, SAVED)], "saved", id="lost ack, result came"),
        pytest.param([(1.0, "90 EB 01 04 12 ED 03 00 07")], "saved", id="lost ack, result with flag 12"),
        pytest.param([(0.0, "90 EB 01 04 12 ED 03 01 09"), (1.0, SAVED)], "saved", id="spoiled ack, result came"),
        pytest.param([(0.6, SAVE_ACK), (1.6, SAVED)], "saved", id="both late"),
        pytest.param([(0.8, f"{SAVE_ACK} {SAVED}")], "saved", id="both late, in one piece"),
        pytest.param([(0.1, f"{SAVE_ACK} {SAVED}")], "saved", id="both in one piece"),
        pytest.param([(0.0, SAVE_ACK), (0.1, SAVE_ACK), (1.0, SAVED)], "saved", id="ack twice"),
        pytest.param([(0.0, SAVE_ACK), (1.0, "00 90 EB 90"), (1.1, SAVED)], "saved", id="noise before the result"),
        pytest.param([(0.0, SAVE_ACK), (2.4, SAVED)], "saved", id="slow flash"),
        pytest.param([(0.0, SAVE_ACK), (1.0, SAVED[:14]), (1.2, SAVED[14:])], "saved", id="result in two pieces"),
        pytest.param([(0.0, SAVE_ACK), (1.0, SAVE_FAILED)], "save-failed", id="failed"),
        pytest.param([(1.0, SAVE_FAILED)], "save-failed", id="lost ack, failed"),
        pytest.param([(0.0, SAVE_ACK), (0.8, SAVED), (1.2, SAVE_FAILED)], "save-failed", id="saved, then failed"),
        pytest.param([(0.0, SAVE_ACK), (0.8, SAVE_FAILED), (1.2, SAVED)], "save-failed", id="failed, then saved"),
        pytest.param(
            [(0.0, SAVE_ACK), (1.0, "90 EB 01 04 11 ED 03 5A 60")], "save-unknown", id="a result of no meaning"
        ),
        pytest.param([(0.0, "90 EB 01 04 12 ED 03 00 07")], "refused", id="refused"),
        pytest.param([(0.0, SAVE_ACK), (1.0, "90 EB 01 04 11 ED 03 00 07")], "accepted", id="spoiled result"),
        pytest.param([], "no-answer", id="silence"),
        pytest.param([(0.0, "90 EB 02 04 12 ED 03 01 09")], "wrong-id", id="another hand"),
        pytest.param([(0.0, SAVE)], "echo", id="echo only"),
    ],
)
def test_answers_to_a_save(replies: list[tuple[float, str]], result: str) -> None:
    """Nothing is sent while it waits; 1005 is never read afterwards (its reply would look like the result)."""
    link = ScriptedLink(lambda request: [(delay, unhex(data)) for delay, data in replies])
    hand = observed_hand(link, retries=3)
    if result in ("saved", "accepted"):
        assert values(id_baud_save_reset.save(hand, Prompts())) == [result]
    else:
        with pytest.raises(HandctlError) as caught:
            id_baud_save_reset.save(hand, Prompts())
        assert caught.value.code == result
        assert result != "save-unknown" or caught.value.exit_code == 7, "nothing says that it failed"
    (write,) = hand.journal.ledger.rows()
    assert (write["state"] == "confirmed") == (result == "saved"), write
    assert [hexed(request) for request in link.sent] == [SAVE]
    assert link.now() < 6.0


def test_a_setting_that_is_gone_after_the_save_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    saved = id_baud_save_reset._save

    def reverts(hand: ExoHand, prompts: Prompts) -> Table:
        table = saved(hand, prompts)
        hand.bus.write(1001, b"\0")
        return table

    monkeypatch.setattr(id_baud_save_reset, "_save", reverts)
    result = run("exo", "baud", "57600", "--save", "-y", "--json", "-p", "fake://exo?clock=virtual")
    assert (result.code, result.error["code"], result.json["writes"][0]["state"]) == (7, "read-back", "sent"), result


def test_silence_after_a_save_says_that_nothing_is_known() -> None:
    with pytest.raises(NoAnswer) as caught:
        id_baud_save_reset.save(hand_on(ScriptedLink()), Prompts())
    assert "not known" in caught.value.hint
    assert "power-cycle" in caught.value.hint


def test_acks_without_end_do_not_hold_the_save() -> None:
    link = ScriptedLink(lambda request: [(0.1 * number, unhex(SAVE_ACK)) for number in range(2000)])
    assert values(id_baud_save_reset.save(hand_on(link), Prompts())) == ["accepted"]
    assert link.now() < 20.0


@each_row("moment", [0.01, 0.1, 0.8])
def test_an_interrupted_save_says_that_it_was_sent(moment: float) -> None:
    link = ScriptedLink(lambda request: [(0.05, unhex(SAVE_ACK)), (1.0, unhex("90 EB 01 04 11 ED 03 00 06"))])
    link.interrupt_at = moment
    with pytest.raises(HandctlError) as caught:
        id_baud_save_reset.save(hand_on(link), Prompts())
    assert caught.value.exit_code == 130
    assert "save was sent" in caught.value.text
    assert changing(link.sent) == [SAVE]


# -- factory reset ----------------------------------------------------------------------------------------------------


def test_reset_writes_once_and_looks_who_answers() -> None:
    hand, link = fake_hand("id=7", 7)
    table = id_baud_save_reset.factory_reset(hand)
    assert values(table) == ["accepted"]
    assert changing(link.sent) == ["EB 90 07 04 12 EE 03 01 0F"]
    assert hand.bus.id == 1
    assert "replying now: id 1" in message(hand, "power-cycle")
    assert "scan" in message(hand, "power-cycle")


def test_lost_ack_of_a_reset_is_a_note() -> None:
    hand = hand_on(link := ScriptedLink())
    id_baud_save_reset.factory_reset(hand)
    assert changing(link.sent) == [RESET]
    assert "ack-lost" in codes(hand)
    assert "do not reply now" in message(hand, "power-cycle")


def test_reset_that_nobody_acknowledged_is_not_called_accepted() -> None:
    hand = hand_on(ScriptedLink())
    assert values(id_baud_save_reset.factory_reset(hand)) != ["accepted"]


def test_reset_on_a_line_with_echo() -> None:
    hand, link = fake_hand("id=7&fault=echo", 7)
    id_baud_save_reset.factory_reset(hand)
    assert hand.bus.id == 1
    assert len(changing(link.sent)) == 1


def test_an_interrupted_reset_says_that_it_was_sent() -> None:
    hand, link = fake_hand()
    link.interrupt_at = 0.5
    with pytest.raises(HandctlError) as caught:
        id_baud_save_reset.factory_reset(hand)
    assert caught.value.exit_code == 130
    assert "reset was sent" in caught.value.text
    assert "scan" in caught.value.hint


def test_a_link_lost_during_a_save_or_a_reset_is_told() -> None:
    hand, _ = fake_hand("fault=disconnect")
    with pytest.raises(LinkError) as caught:
        id_baud_save_reset.save(hand, Prompts())
    assert "its result is not known" in caught.value.text
    hand, _ = fake_hand("fault=disconnect")
    with pytest.raises(LinkError) as caught:
        id_baud_save_reset.factory_reset(hand)
    assert "reset was sent" in caught.value.text


def test_a_reset_that_nobody_answers_after_is_no_success() -> None:
    """It was acknowledged, then the hand is gone: no evidence that it came back, so it is exit 4."""
    ack = [(0.0, unhex("90 EB 01 04 12 EE 03 01 09"))]
    link = ScriptedLink(lambda request: ack if hexed(request) == RESET else [])
    table = id_baud_save_reset.factory_reset(hand_on(link))
    assert values(table) == ["accepted"]
    assert table.failure is not None
    assert (table.failure.exit_code, table.failure.code) == (4, "gone")
    assert table.failure.code == "gone" and "id 1" in table.failure.text


def test_the_ledger_takes_neither_an_echo_nor_the_acknowledgement_of_a_save_for_its_result() -> None:
    """dossier 4.3: two frames answer, and the second says whether it is saved."""
    for result, saved in (("00 06", True), ("FF 05", False)):
        ledger = words()
        (frame,) = ledger.sent(unhex("EB 90 01 04 12 ED 03 01 08"), None)
        assert list(ledger.came(unhex("EB 90 01 04 12 ED 03 01 08"), None)) == []
        assert list(ledger.came(unhex("90 EB 01 04 12 ED 03 01 08"), None)) == []
        assert list(ledger.came(unhex(f"90 EB 01 04 11 ED 03 {result}"), None)) == [(frame.key, saved)]
