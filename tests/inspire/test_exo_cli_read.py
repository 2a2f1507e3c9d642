"""Reading commands in detail: get, read, raw, status, scan, clear-errors, baud, and the closed-loop procedures."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.cli import FINGERS, fake, flash, memory, pairs, run, s16, sent, spying, writes
from tests.support.each_row import each_row


def test_get_reads_once_what_lies_together(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    names = ("temperature", "position_actual.index", "system_voltage", "error")
    result = run("exo", "get", *names, "-p", fake(), "--json", "--trace", trace)
    assert result.values == {
        **pairs(["temperature", "error"]),
        "position_actual.index": 440,
        "system_voltage": 558,
    }
    assert sent(trace) == [bytes.fromhex("EB 90 01 04 11 C0 05 97 72")]
    twice = run("exo", "get", "id", "id", "-p", fake(), "--json")
    assert twice.values == {"id": 1} and len(twice.rows) == 1


def test_dump_takes_two_transactions_and_falls_back_to_groups(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    fast = run("exo", "dump", "-p", fake(), "--json", "--trace", trace)
    assert sent(trace) == [
        bytes.fromhex("EB 90 01 04 11 E8 03 0A 0B"),
        bytes.fromhex("EB 90 01 04 11 C0 05 97 72"),
    ]
    slow = run("exo", "dump", "-p", fake(fault="block-silent"), "--json", "--trace", trace)
    assert slow.code == 0
    assert [(r["name"], r["finger"], r["value"]) for r in slow.rows] == [
        (r["name"], r["finger"], r["value"]) for r in fast.rows
    ]
    assert "block-silent" in slow.codes()
    asked = sent(trace)
    assert asked.count(asked[0]) == 2  # silent twice, then group by group
    assert bytes.fromhex("EB 90 01 04 11 0A 06 0C 32") in asked


def test_read_decodes_documented_bytes_and_shows_the_rest_raw() -> None:
    result = run("exo", "read", "1484", "6", "-p", fake(), "--json")
    assert [(row["name"], row["address"], row["value"], row["raw"]) for row in result.rows] == [
        (None, 1484, None, "00 00"),
        ("position_set", 1486, 151, "97 00"),
        ("position_set", 1488, 252, "FC 00"),
    ]
    odd = run("exo", "read", "1487", "2", "-p", fake(), "--json")  # halves of two elements are no value
    assert [row["value"] for row in odd.rows] == [None] * len(odd.rows)
    assert " ".join(row["raw"] for row in odd.rows) == "00 FC"
    beyond = run("exo", "read", "65535", "1", "-p", fake(), "--json")
    assert [row["raw"] for row in beyond.rows] == ["00"]


def test_write_then_read(tmp_path: Path) -> None:
    state = tmp_path / "state.json"
    result = run("exo", "write", "1498", "64:00,9C FF 00 00 E8 03 18 FC", "-y", "-p", fake(state=state), "--json")
    assert result.values == {f"force_set.{f}": v for f, v in zip(FINGERS, (100, -100, 0, 1000, -1000), strict=True)}
    assert memory(state, 1498, 10) == s16(100, -100, 0, 1000, -1000)
    gap = run("exo", "write", "1510", "AA", "--undocumented", "-y", "-p", fake(), "--json")
    assert (gap.code, gap.error["code"]) == (7, "read-back")  # the hand ignores it and acknowledges


def test_raw_shows_every_frame_of_the_answer() -> None:
    result = run("exo", "raw", "EB 90 01 04 11 C0 05 02 DD", "-p", fake(fault="duplicate"), "--json")
    assert [(r["direction"], r["id"], r["flag"], r["address"], r["data"]) for r in result.rows] == [
        ("device", 1, "11", 1472, "2E 02")
    ] * 2
    assert "558" in result.rows[0]["meaning"]
    echoed = run("exo", "raw", "EB 90 01 04 11 C0 05 02 DD", "-p", fake(fault="echo"), "--json")
    assert [row["direction"] for row in echoed.rows] == ["host", "device"]
    assert echoed.json["received"] == "EB 90 01 04 11 C0 05 02 DD 90 EB 01 05 11 C0 05 2E 02 0C"


def test_raw_with_a_wrong_sum_meets_silence() -> None:
    result = run("exo", "raw", "EB 90 01 04 11 C0 05 02 DE", "-y", "-p", fake(), "--json")
    assert (result.code, result.error["code"]) == (4, "no-answer")


def test_both_frames_of_a_save_can_be_seen_with_raw() -> None:
    result = run("exo", "raw", "EB 90 01 04 12 ED 03 01 08", "-y", "--wait", "1.5", "-p", fake(), "--json")
    assert [row["raw"] for row in result.rows] == ["90 EB 01 04 12 ED 03 01 08", "90 EB 01 04 11 ED 03 00 06"]


def test_clear_errors_clears_what_can_be_cleared(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    assert run("exo", "clear-errors", "-p", fake(fault="faults"), "--json").code == 8, (
        "fingers may go on to their targets"
    )
    result = run("exo", "clear-errors", "-p", fake(fault="faults"), "--json", "--trace", trace, "-y")
    assert result.code == 0
    assert [(row["before"], row["value"]) for row in result.rows] == [(1, 0), (2, 2), (4, 0), (6, 2), (24, 0)]
    assert writes(trace) == [bytes.fromhex("EB 90 01 04 12 EC 03 01 07")]
    warnings = [m["text"] for m in result.json["messages"] if m["code"] == "over-temperature"]
    assert len(warnings) == 2
    assert "ring" in warnings[0] and "78 °C" in warnings[0]
    left = run("exo", "clear-errors", "-p", fake(fault="unknown-bits"), "--json", "-y")
    assert (left.code, left.error["code"]) == (7, "errors-remain")
    assert "index" in left.error["text"]


def test_baud_is_effective_after_save_and_power_cycle(tmp_path: Path) -> None:
    state = tmp_path / "state.json"
    link = fake(state=state)
    result = run("exo", "baud", "57600", "-y", "-p", link, "--json")
    assert (result.code, result.values["baud_code"]) == (0, 1)
    assert "not-saved" in result.codes()
    assert flash(state) == {"id": 1, "speed_code": 0}
    assert run("exo", "baud", "-p", link, "--format", "plain").out == "1\n"  # still answers at 115200
    assert run("exo", "baud", "-p", link + "&power-cycle=1", "--format", "plain").out == "0\n"
    saved = run("exo", "baud", "57600", "--save", "-y", "-p", link, "--json")
    assert saved.code == 0
    assert any("power-cycle" in m["code"] and "--baud 57600" in m["hint"] for m in saved.json["messages"])
    assert flash(state) == {"id": 1, "speed_code": 1}
    lost = run("exo", "get", "id", "-p", link + "&power-cycle=1", "--json")
    assert (lost.code, lost.error["code"]) == (5, "wrong-speed")
    assert "--baud 57600" in lost.error["hint"]
    assert run("exo", "get", "id", "-p", link, "--baud", "57600", "--format", "plain").out == "1\n"


@pytest.mark.parametrize("rate", [115200, 57600, 19200])
def test_baud_with_verification(rate: int) -> None:
    for old in (115200, 57600, 19200):
        result = run(
            "exo", "baud", str(rate), "--save", "--verify", "-y", "--baud", str(old), "-p", fake(baud=old), "--json"
        )
        assert result.code == 0, result
        assert result.rows[-1]["value"] == rate


def test_position_until_it_arrives_or_is_held() -> None:
    moved = run("exo", "position", "1000", "0", "500", "440", "1", "--wait", "3", "-y", "-p", fake(), "--json")
    assert (moved.code, moved.values["position_actual.little"], moved.values["position_actual.thumb"]) == (0, 1000, 1)
    assert [row["target"] for row in moved.rows] == [1000, 0, 500, 440, 1, None]
    assert [row["arrival"] for row in moved.rows] == ["reached"] * 5 + [None]
    short = run("exo", "position", "1000", "0", "500", "440", "1", "--wait", "0.2", "-y", "-p", fake(), "--json")
    assert (short.code, short.error["code"]) == (7, "still-moving")
    assert [row["arrival"] for row in short.rows] == ["moving", "moving", "moving", "reached", "moving", None]
    assert 110 < short.values["position_actual.little"] < 1000
    held = run("exo", "position", "0", "0", "0", "0", "0", "--wait", "3", "-y", "-p", fake(fault="blocked"), "--json")
    assert (held.code, held.error["code"]) == (7, "blocked")
    assert held.values["position_actual.little"] == 110


def test_status_names_every_unhealthy_finger() -> None:
    result = run("exo", "status", "-p", fake(fault="hot"), "--json")
    assert result.code == 0
    texts = [m["text"] for m in result.json["messages"] if m["code"] == "unhealthy"]
    assert len(texts) == 5
    assert all("over_temperature" in text and "cools" in text for text in texts)
    assert "75 °C" in texts[4]
    foreign = run("exo", "status", "--check", "-p", fake(fault="foreign"), "--json")
    assert foreign.code == 7
    assert "system_voltage" in str(foreign.json["messages"]) and "3004" in str(foreign.json["messages"])


def test_a_taken_id_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    """Two hands on the line: a transcript plays both."""
    both = tmp_path / "both.txt"
    both.write_text(
        "> EB 90 02 04 11 C0 05 02 DE\n< 90 EB 02 05 11 C0 05 2E 02 0D\n"
        "> EB 90 01 04 11 C0 05 02 DD\n< 90 EB 01 05 11 C0 05 2E 02 0C\n"
    )
    trace = tmp_path / "t.txt"
    result = run("exo", "id", "2", "-y", "-p", f"replay:{both}", "--json", "--trace", trace)
    assert (result.code, result.error["code"]) == (7, "id-taken")
    assert writes(trace) == []


# -- scan -------------------------------------------------------------------------------------------------------------


@each_row(("number", "speed"), [(1, 115200), (1, 19200), (7, 57600), (100, 115200), (144, 19200),
                                                (235, 115200), (254, 19200)])  # fmt: skip
def test_scan_finds_the_hand(number: int, speed: int) -> None:
    link = fake(id=number, baud=speed, wire="auto")
    result = run("exo", "scan", "-p", link, "--json")
    assert result.code == 0
    assert [(r["family"], r["link"], r["baud"], r["id"]) for r in result.rows] == [("exo", link, speed, number)]
    assert "system_voltage reads 558" in result.rows[0]["evidence"]


@pytest.mark.parametrize("fault", ["noise", "echo", "split", "duplicate", "garble", "slow"])
def test_scan_finds_the_hand_on_a_bad_line(fault: str) -> None:
    for seed, number in enumerate((1, 17, 144, 235)):
        result = run("exo", "scan", "--all", "-p", fake(fault=fault, id=number, seed=seed), "--json")
        assert result.code == 0
        assert [(row["baud"], row["id"]) for row in result.rows] == [(115200, number)], result


def test_scan_of_a_silent_line_is_bounded_and_says_what_it_tried() -> None:
    for more, most in ((), 6.0), (("--all",), 40.0):  # --all: what a half-duplex line with a delay that varies hides
        with spying() as spy:
            result = run("exo", "scan", *more, "-p", fake(fault="deaf", wire="auto"), "--json")
        assert (result.code, result.error["code"], result.rows) == (4, "no-answer", [])
        assert spy.now < most
        assert result.error["code"] == "no-answer" and "1 to 254" in result.error["text"]
        for speed in ("115200", "57600", "19200"):
            assert speed in result.error["text"]


def test_scan_counts_a_hand_only_after_a_second_answer() -> None:
    result = run("exo", "scan", "--ids", "1-20", "-p", fake(id=5, fault="silent", after=1), "--json")
    assert (result.code, result.rows) in ((4, []), (5, []))
    assert "unconfirmed" in result.codes()


def test_scan_sends_reads_only(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    assert run("exo", "scan", "--all", "--ids", "1-20", "-p", fake(id=3), "--trace", trace).code == 0
    probes = [rest[:7] for rest in b"".join(sent(trace)).split(b"\xeb\x90")[1:]]
    for probe in (b"\xeb\x90" + rest for rest in probes):
        assert len(probe) == 9 and probe[3] == 4, probe.hex(" ")
        assert probe[4] in (0x11, 0x30), "reads of the hand's and the wrist's registers; who is there, is asked by both"
        assert probe[8] == sum(probe[2:8]) % 256
