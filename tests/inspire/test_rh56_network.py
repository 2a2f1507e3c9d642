"""`handctl hand network`: the IP address of a tactile hand, shown and changed."""

from __future__ import annotations

import pytest

from tests.support.cli import run, spying
from tests.support.each_row import each_row
from tests.support.person import person

TP, DF = "fake://hand?model=tp&clock=virtual", "fake://hand?model=df&clock=virtual"
OVER = {"eb90": (TP, "--protocol", "eb90"), "rtu": (TP, "--protocol", "modbus"), "tcp": (f"{TP}&bus=modbus-tcp",), "can": (f"{TP}&bus=can",)}  # fmt: skip
wires = pytest.mark.parametrize("wire", OVER)


@wires
def test_the_address_is_shown_with_what_the_computer_needs(wire: str) -> None:
    result = run("hand", "network", "-p", *OVER[wire], "--json")
    assert result.code == 0, result
    assert [(row["finger"], row["value"]) for row in result.rows] == [("a", 192), ("b", 168), ("c", 11), ("d", 210)]
    (note,) = [message for message in result.json["messages"] if message["code"] == "network"]
    assert "192.168.11.210, port 6000" in note["text"]
    assert "192.168.11.10, mask 255.255.255.0" in note["hint"]
    assert result.json["counters"]["sent"] > 0 and result.json.get("writes", []) == []


@wires
def test_a_new_address_is_written_read_back_and_saved(wire: str) -> None:
    with spying() as spy:
        result = run("hand", "network", "192.168.123.211", "-p", *OVER[wire], "--yes", "--json")
    assert result.code == 0, result
    hand = spy.lines[-1].device.hand
    assert (hand.flash_address, hand.acts["ip"], hand.acts["save"]) == ((192, 168, 123, 211), 4, 1)
    assert hand.address == (192, 168, 11, 210), "it acts after a power-cycle"
    assert hand.acts["factory-reset"] == hand.acts["reserved"] == 0
    told = next(message for message in result.json["messages"] if message["code"] == "power-cycle")
    assert "192.168.11.210 until you power-cycle it, then only at 192.168.123.211" in told["text"]
    for step in ("192.168.123.10", "handctl hand status -p tcp://192.168.123.211", "over RS-485"):
        assert step in told["hint"], told["hint"]
    states = [write["state"] for write in result.json["writes"]]
    assert states[0] == "confirmed" and len(states) == 2, states


def test_the_new_address_is_typed_to_confirm_it() -> None:
    for answer, code in (("192.168.11.211", 0), ("y", 8)):
        shown = person("hand", "network", "192.168.11.211", "-p", TP, columns=120, answers=[answer])
        assert shown.code == code, shown.text
        asked, _, _ = " ".join(shown.text.split()).partition("to go on:")
        for said in ("from 192.168.11.210 to 192.168.11.211", "192.168.11.10", "handctl hand network 192.168.11.210"):
            assert said in asked, shown.text


def test_without_an_answer_nothing_is_written() -> None:
    with spying() as spy:
        result = run("hand", "network", "192.168.11.211", "-p", TP, "--json")
    assert (result.code, result.json["counters"]["sent"]) == (8, 0)
    assert all(line.device.hand.acts["ip"] == 0 for line in spy.lines)


@each_row("address", ["127.0.0.1", "0.0.0.1", "224.0.0.1", "192.168.11.255", "192.168.11.0", "hand.local", "192.168.11", "255.255.255.255"])  # fmt: skip
def test_what_no_hand_can_have_is_refused(address: str) -> None:
    result = run("hand", "network", address, "-p", TP, "--yes", "--json")
    assert (result.code, result.json["counters"]["sent"]) == (2, 0)


def test_a_dry_run_shows_the_bytes_of_the_wire() -> None:
    result = run("hand", "network", "192.168.11.211", "-p", f"{TP}&bus=modbus-tcp", "-n", "--json")
    assert [row["bytes"][18:] for row in result.rows] == ["FF 10 06 A4 00 02 04 A8 C0 D3 0B", "FF 06 03 ED 00 01"]
    assert run("hand", "network", "-p", TP, "-n").code == 2


@each_row("model", ["df", "f1", "dg2"])
@each_row("words", [(), ("192.168.11.211", "--yes")])
def test_a_hand_without_a_network_has_no_address(model: str, words: tuple[str, ...]) -> None:
    with spying() as spy:
        result = run("hand", "network", *words, "-p", f"fake://hand?model={model}&clock=virtual", "--json")
    assert result.code == 6, result
    acts = spy.lines[-1].device.hand.acts
    assert not any(acts.values()), acts


def test_the_same_address_again_is_only_saved() -> None:
    """It may be one that was written and not saved."""
    with spying() as spy:
        result = run("hand", "network", "192.168.11.210", "-p", TP, "--yes", "--json")
    assert result.code == 0, result
    assert "already" in result.codes() and "power-cycle" not in result.codes()
    acts = spy.lines[-1].device.hand.acts
    assert (acts["ip"], acts["save"]) == (0, 1)


def test_errors_and_a_failed_save_are_said() -> None:
    result = run("hand", "network", "192.168.11.211", "-p", f"{TP}&fault=locked-rotor", "--yes", "--json")
    assert (result.code, result.error["code"]) == (7, "not-fit")
    result = run(
        "hand", "network", "192.168.11.211", "-p", f"{TP}&fault=save-fails", "--yes", "--json", "--protocol", "eb90"
    )
    assert (result.code, result.error["code"]) == (6, "save-failed")
