"""Recordings of the BarrettHand in words: what an event in the middle of a conversation must not tear apart."""

from __future__ import annotations

from handctl.devices.barrett.explain_bytes import BarrettExplainer, BarrettWriteRules
from handctl.model.explainer import DEVICE, HOST


def test_a_download_is_recognised_behind_the_power_switch() -> None:
    """Between X and `:` the power is switched, and a recording says so: an event, which ends what was spoken before."""
    explainer = BarrettExplainer()
    assert explainer.feed(HOST, b"X") == []
    (offer,) = explainer.flush()
    assert (offer.meaning, offer.problem) == ("X: requests a download from the boot monitor", "")
    (ready,) = explainer.feed(DEVICE, b":")
    assert (ready.meaning, ready.problem) == ("the boot monitor is ready for a download", "")
    pieces = []
    for byte in bytes.fromhex("FF FF 00 20 08 FF 11 22 33 44 55 66 FF 00"):
        pieces += explainer.feed(HOST, bytes([byte]))
    pieces += explainer.feed(DEVICE, bytes.fromhex("00 20 08 11 22 33 44 55 66 FF 00"))
    assert [piece.meaning for piece in pieces] == [
        "the first trigger of a download",
        "download record: 8 bytes at 2000h",
        "echo of the record at 2000h: 11 bytes, all correct",
    ]


def test_a_colon_behind_something_else_is_no_monitor() -> None:
    explainer = BarrettExplainer()
    explainer.feed(HOST, b"X")
    explainer.flush()
    explainer.feed(HOST, b"VERS\r")
    (answer,) = explainer.feed(DEVICE, b"VERS\n\r4.33\n\r=> ")
    assert answer.meaning == "VERS: 4.33"
    assert explainer.feed(DEVICE, b":") == []


def test_a_change_of_speed_is_no_lost_answer() -> None:
    """Only the echo comes at the old speed (dossier 1.2); the port's own event stands behind it."""
    explainer = BarrettExplainer()
    (asked,) = explainer.feed(HOST, b"PSET BAUD 384\r")
    explainer.feed(DEVICE, b"PSET BAUD 384")
    (echo,) = explainer.flush()
    assert (echo.answers, echo.problem, "new baud rate" in echo.meaning) == (asked.asks, "", True)
    explainer.feed(HOST, b"PSET LFT 1\r")
    explainer.feed(DEVICE, b"PSET LFT 1")
    (cut,) = explainer.flush()
    assert cut.problem == "cut-short"


def test_the_question_of_a_connect_is_no_mistake() -> None:
    """ERR 32 to it is how a hand says that it is there; ERR 2048 says that it was in RealTime."""
    for status, meaning, problem in (
        (32, "prompt: the hand is connected", ""),
        (2048, "ERR 2048: Invalid RealTime control block header (2048)", "refused"),
    ):
        explainer = BarrettExplainer()
        (asked,) = explainer.feed(HOST, b"!\0\r")
        assert (asked.meaning, asked.problem) == ("!: requests the prompt, and is not a command", "")
        (answer,) = explainer.feed(DEVICE, b"!\0\n\rERR %d\n\r=> " % status)
        assert (answer.meaning, answer.problem, answer.answers) == (meaning, problem, asked.asks)


def test_the_blank_of_a_prompt_may_come_behind_the_next_command() -> None:
    """A USB adapter that waits 16 ms hands it on so; it is no damage, and LOOP is acknowledged all the same."""
    explainer, rules = BarrettExplainer(), BarrettWriteRules()
    explainer.feed(HOST, b"FGET P\r")
    pieces = explainer.feed(DEVICE, b"FGET P\n\r0 0 0 0\n\r=>")
    explainer.feed(HOST, b"1LOOP\r")
    pieces += explainer.feed(DEVICE, b" 1LOOP*")
    assert [(piece.raw, piece.problem) for piece in pieces] == [
        (b"FGET P\n\r0 0 0 0\n\r=>", ""),
        (b" ", ""),
        (b"1LOOP*", ""),
    ]
    (loop,) = rules.sent(b"1LOOP\r", None)
    assert list(rules.came(b" ", None)) == []
    assert list(rules.came(b"1LOOP*", None)) == [(loop.key, True)]
