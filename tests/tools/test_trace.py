"""Recorded bytes in words: every family's frames with literal meanings, the transcripts of this folder, and garbage."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handctl.devices.ekso.explain_bytes import EksoExplainer
from handctl.errors import UsageError
from handctl.families import EXPLAIN_ORDER, FAMILIES
from handctl.link.transcript import Entry
from handctl.model.explainer import DEVICE, HOST, Cutter, ExplainedBytes
from handctl.model.result import Column
from handctl.screen.csv_output import csv_cell, csv_lines
from handctl.screen.render import dumps
from handctl.tools import trace, trace_reader
from handctl.tools.trace import Given, parse_given
from handctl.tools.trace_reader import TranscriptReader, TranscriptRow, chosen, explainer_of, family_in, lines_of
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.places import TRANSCRIPTS
from tests.support.screen import screen


def told(family: str, *lines: str) -> list[TranscriptRow]:
    """The rows of a transcript with these lines."""
    return list(TranscriptReader(family).tell(lines_of(io.StringIO("\n".join(lines)), "t")))


def meanings(family: str, *lines: str) -> list[str]:
    return [row.meaning for row in told(family, *lines)]


def hex_of(text: str) -> str:
    return text.encode().hex(" ").upper()


def decoded(family: str, text: str, side: str = "") -> ExplainedBytes:
    """The one piece of some bytes without a conversation."""
    (found,) = parse_given(text)
    (piece,) = explainer_of(family).decode(found.data, side, found.can_id)
    return piece


# -- single frames ----------------------------------------------------------------------------------------------------

FRAMES = [
    # family, bytes, direction, meaning
    ("exo", "EB 90 01 04 11 C0 05 02 DD", HOST, "read system_voltage: 2 bytes at 1472, id 1"),
    ("exo", "90 EB 01 05 11 C0 05 2E 02 0C", DEVICE, "system_voltage = 558 (raw, scale unknown), id 1"),
    ("exo", "90 EB 01 0F 11 0A 06 6E 00 DC 00 4A 01 B8 01 26 02 94 02 3D", DEVICE, "position_actual = 110 220 330 440 550 660, id 1"),
    ("exo", "90 EB 01 08 11 46 06 01 02 04 06 18 8B", DEVICE, "error = 1 2 4 6 24 (little locked_rotor, ring over_temperature, middle over_current, index over_temperature, over_current, thumb motor_abnormal, communication), id 1"),
    ("exo", "EB 90 01 0D 12 CE 05 F4 01 F4 01 FF FF 00 00 F4 01 D0", HOST, "write position_set = 500 500 -1 0 500 (middle not commanded), id 1"),
    ("exo", "90 EB 01 04 12 D4 05 00 F0", DEVICE, "not accepted (00): write at 1492 position_set.index, id 1"),
    ("exo", "EB 90 01 04 12 EE 03 01 09", HOST, "write factory_reset = 1, id 1"),
    ("exo", "EB 90 01 0B 31 64 00 9C FF 00 00 E8 03 18 FC 3B", HOST, "force command, little to thumb: 100 -100 0 1000 -1000, id 1"),
    ("exo", "90 EB 01 0B 32 F5 FF 0C 00 F3 FF 0E 00 F1 FF 2E", DEVICE, "position command taken: force_actual = -11 12 -13 14 -15, id 1"),
    ("exo", "EB 90 01 04 30 FC 03 02 36", HOST, "read unnamed registers: 2 bytes at 1020 of another register space, id 1"),
    ("wrist", "90 EB 01 07 30 00 04 6F 00 DE 00 89", DEVICE, "current_1024 = 111 mA (actuator #2 by the register table, #1 by the CAN example), current_1026 = 222 mA (actuator #1 by the register table, #2 by the CAN example), id 1"),
    ("wrist", "EB 90 01 07 31 0E 04 E8 03 18 FC 4A", HOST, "write yaw_set = 10.00 °, pitch_set = -10.00 °, id 1"),
    ("wrist", "90 EB 01 04 31 0E 04 01 49", DEVICE, "accepted: write at 1038 yaw_set, id 1"),
    ("wrist", "11000001 [1] 04", HOST, "read current_1024 to current_1026: 4 bytes at 1024, id 1"),
    ("wrist", "15038001#E80318FCE803", HOST, "write yaw_set = 10.00 °, pitch_set = -10.00 °, move_time = 1000 ms, id 1"),
    ("wrist", "can 15038001 [0]", DEVICE, "acknowledged: write at 1038 yaw_set, id 1"),
    ("wrist", "10FF0001 [2] A7 FE", DEVICE, "pitch_actual = -3.45 °, id 1"),
    ("wrist", "05738001 [8] F4 01 FF FF FF FF FF FF", HOST, "write F4 01 FF FF FF FF FF FF at 1486 of the hand's own registers, id 1"),
    ("barrett", hex_of("13M 1000\r"), HOST, "13M 1000: move to a position (default: DP), for F1 F3"),
    ("barrett", hex_of("SFSET DS 100 DP 1500\r"), HOST, "SFSET DS 100 DP 1500: set default_step = 100 cts, default_position = 1500 cts of SPREAD"),
    ("barrett", hex_of("14FGET SG P\n\r112 255\n\r0 0\n\r=> "), DEVICE, "strain 112 255 (no gauge), position 0 0 cts (F1 SPREAD)"),
    ("barrett", hex_of("PGET TEMP\r\n412\r\n=>"), DEVICE, "temperature 41.2 °C"),
    ("barrett", hex_of("GM 1000\n\rERR 4\n\r=> "), DEVICE, "ERR 4: Motor not initialized (4)"),
    ("barrett", hex_of("ERR 3\n\r1 No motor board found\n\r2 No motor found\n\r=> "), DEVICE, "ERR 3: 1 No motor board found | 2 No motor found"),
    ("barrett", "03", HOST, "^C: abort"),
    ("barrett", "43 10 0A 10 0A 10 0A F0 0A", HOST, "C: F1 velocity 16 gain 10, F2 velocity 16 gain 10, F3 velocity 16 gain 10, SPREAD velocity -16 gain 10, requests feedback"),
    ("barrett", "2A 01 78 21 34 0A 01 76 21 2A 09 01 7E 21 3E 0B FF FF 06 27 F6", DEVICE, "* F1 velocity 1 strain 120 position 8500 cts delta 10 cts, F2 velocity 1 strain 118 position 8490 cts delta 9 cts, F3 velocity 1 strain 126 position 8510 cts delta 11 cts, SPREAD velocity -1 strain 255 position 1575 cts delta -10 cts"),
    ("barrett", "FF 00 20 08 FF 11 22 33 44 55 66 FF 00", HOST, "download record: 8 bytes at 2000h"),
    ("ekso", "99 00 00 CB D9 0F", HOST, "request GetData"),
    ("ekso", "96 04 00 C8 0E 05 25 00 31 2A", DEVICE, "GetTime: 14:05:37"),
    ("ekso", "97 03 00 C9 1A 0B 14 F0 D6", DEVICE, "GetDate: 2026-11-20"),
    ("ekso", "9B 04 00 CD 00 CA 06 0E 5E FE", HOST, "SetValue: step_length = 15.50 in"),
    ("ekso", "9B 02 00 CD 20 01 35 F4", DEVICE, "SetValue: refused in the present state, state 0x20"),
    ("ekso", "9C 02 00 CF 01 00 B6 23", HOST, "CancelAction: command word 0100"),
    ("ekso", "9C 02 00 CF 00 00 85 12", DEVICE, "CancelAction: accepted"),
    ("ekso", "96 09 00 C8 0E 05 25 22 DF", DEVICE, "GetTime: 14:05:37"),
    ("ekso", "98 2C 00 CA 06 A4 06 40 06 0E 00 C8 00 5A 00 32 01 F4 01 2C FF B5 00 7D 00 02 00 01 00 03 00 00 00 0A 00 0C 00 02 00 03 00 04 00 07 00 01 00 02 72 E5", DEVICE,
     "GetSettings: upper_leg_length 17.00 in, lower_leg_length 16.00 in, step_length 15.50 in, step_height 2.00 in, swing_time 0.90 s, stand_time 0.50 s, knee_flexion 5.00 deg, hip_flexion 3.00 deg, forward_shift -0.75, lateral_shift 1.25, walk_mode ProStep, stand_mode Auto Lean, target_sounds Both, injury_mode Bilateral, left_swing_assist 50 %, right_swing_assist 60 %, left_stance_support High, right_stance_support Very High, swing_complete 0.5, pilot_id 7, sit_mode Normal Lean, lean_allowance Off"),
    ("aidin", '{"hand_mode":1}', HOST, "hand_mode 1: homing, held for 3 s"),
    ("aidin", '{"hand_mode":5,"maxtorque":800}', HOST, "hand_mode 5: maxtorque setup; maxtorque 80 %"),
    ("aidin", "7B 7D 0A", HOST, "the neutral object: no key, nothing commanded"),
    ("aidin", '{"current_state":[1,2,3,4,5,6,7,8,9,10,11,12,13,14,15]}', DEVICE, "current_state (m1 m2 m3): thumb 1 2 3, index 4 5 6, middle 7 8 9, ring 10 11 12, little 13 14 15"),
    ("aidin", '{"joint_pos":[0.174533,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,-0.1]}', DEVICE, "joint_pos (q1 q2 q3 q4) [deg]: thumb 10.0 0.0 0.0 0.0, index 0.0 0.0 0.0 0.0, middle 0.0 0.0 0.0 0.0, ring 0.0 0.0 0.0 0.0, little 0.0 0.0 0.0 -5.7"),
]  # fmt: skip


@each_row(("family", "text", "direction", "meaning"), FRAMES, ids=[f"{f[0]}-{f[1][:24]}" for f in FRAMES])
def test_a_frame_in_words(family: str, text: str, direction: str, meaning: str) -> None:
    piece = decoded(family, text)
    assert (piece.direction, piece.meaning, piece.frame) == (direction, meaning, True)


BROKEN = [
    ("exo", "90 EB 01 05 11 C0 05 2F 02 0C", "bad-checksum", "bad checksum 0C, should be 0D. It would say: system_voltage = 559 (raw, scale unknown), id 1"),
    ("wrist", "90 EB 01 05 30 FC 03 A7 FE DB", "bad-checksum", "bad checksum DB, should be DA. It would say: pitch_actual = -3.45 °, id 1"),
    ("exo", "90 EB 01 05 11 C0 05", "cut-short", "the beginning of a frame, cut off after 7 of 10 bytes"),
    ("exo", "F8 00 1C FE", "stray", "4 bytes of no frame"),
    ("exo", "90 EB", "cut-short", "the beginning of a frame, cut off after 2 bytes"),
    ("ekso", "96 04 00 C8 0E 04 25 00 31 2A", "bad-checksum", "bad CRC 312A, should be 061A. It would say: GetTime: 14:04:37"),
    ("ekso", "96 04 00 C8 0E", "cut-short", "the beginning of a frame, cut off after 5 bytes"),
    ("aidin", '{"motor_pos":[1,2', "cut-short", "an object cut off after 17 bytes"),
    ("barrett", hex_of("FGET P"), "cut-short", "a command without its CR: FGET P"),
]  # fmt: skip


@each_row(("family", "text", "problem", "meaning"), BROKEN)
def test_a_broken_frame_says_what_it_should_be(family: str, text: str, problem: str, meaning: str) -> None:
    piece = decoded(family, text)
    assert (piece.problem, piece.meaning, piece.frame) == (problem, meaning, False)


def test_every_field_is_named_and_no_byte_is_lost() -> None:
    piece = decoded("exo", "EB 90 01 05 12 D4 05 2C 01 1F")
    assert [(part.raw.hex(), part.name, part.meaning) for part in piece.parts] == [
        ("eb90", "header", "from the host"), ("01", "id", "1"), ("05", "length", "5 bytes from the flag to the data"),
        ("12", "flag", "write, hand"), ("d405", "address", "1492 position_set.index"), ("2c01", "position_set.index", "300"),
        ("1f", "checksum", "wrong, should be 1E"),
    ]  # fmt: skip
    for family, text, _, _ in FRAMES:
        piece = decoded(family, text)
        if family != "aidin" and piece.can_id is None and piece.parts:
            assert b"".join(part.raw for part in piece.parts) == piece.raw, text


def test_misprints_of_the_manual_are_explained_when_decoded_only() -> None:
    probe = "EB 90 01 04 30 FC 03 02 36"
    assert "wrist §2.2 prints these bytes" in decoded("wrist", probe).meaning
    assert "wrist §2.3.1 prints 28 bits" in decoded("wrist", "01100001 [1] 04").meaning
    assert meanings("wrist", f"> {probe}")[0] == "read pitch_actual: 2 bytes at 1020, id 1"


def test_values_carry_names_and_units() -> None:
    (first, *_, last) = decoded("exo", "90 EB 01 0D 11 3A 06 15 00 16 00 17 00 18 00 19 00 D2").values
    assert first == ("current.little", 21, "mA")
    assert last == ("current.thumb", 25, "mA")
    assert decoded("ekso", "9B 04 00 CE 00 D0 FF B5 8B 67").values == (("forward_shift", -0.75, None),)
    assert decoded("barrett", hex_of("PGET TEMP\n\r412\n\r=> ")).values == (("temperature", 412, "0.1 °C"),)


def test_the_sender_of_ambiguous_bytes_can_be_said() -> None:
    acknowledged = "98 00 00 CA BF 9A"
    assert decoded("ekso", acknowledged).meaning == "request GetSettings"
    assert decoded("ekso", acknowledged, DEVICE).meaning == "GetSettings: acknowledged, without a body"
    assert decoded("wrist", "11010001 [1] 01", DEVICE).values == (("error_1", 1, None),)


# -- conversations ----------------------------------------------------------------------------------------------------


def test_pieces_are_put_together_and_paired_with_their_time() -> None:
    rows = told(
        "exo", "0.000 > EB 90 01 04 11 C0 05 02 DD", "0.004 < 90 EB 01 05", "0.030 < 11 C0 05 2E 02 0C 90 EB 01 04 12 ED 03 01 08"
    )  # fmt: skip
    assert [(row.first.line, row.last.line, row.round_trip, row.problem) for row in rows] == [
        (1, 1, None, ""), (2, 3, 0.03, ""), (3, 3, None, "unasked"),
    ]  # fmt: skip
    assert rows[1].request is not None
    assert rows[1].request.line == 1


def test_late_frames_of_a_save_and_a_calibration() -> None:
    assert meanings("exo", "> EB 90 01 04 12 ED 03 01 08", "< 90 EB 01 04 12 ED 03 01 08", "< 90 EB 01 04 12 ED 03 FF 06")[1:] == [
        "accepted: write at 1005 save, id 1", "result of the save: not saved",
    ]  # fmt: skip
    rows = told("exo", "> EB 90 01 04 12 F1 03 01 0C", "< 90 EB 01 04 12 F1 03 01 0C", "< 90 EB 01 04 11 02 00 00 18")
    assert (rows[2].meaning, rows[2].problem) == ("end of the calibration, code 00", "")


def test_a_header_with_the_length_nought_holds_nothing_back() -> None:
    rows = told("exo", "< 90 EB", "< 00 00 90 EB 01 04 11 E8 03 01 02")
    assert [row.piece.raw.hex(" ") for row in rows if row.piece] == ["90 eb", "00 00", "90 eb 01 04 11 e8 03 01 02"]


def test_a_new_id_acknowledges_for_the_old_one() -> None:
    rows = told("exo", "> EB 90 01 04 12 E8 03 02 04", "< 90 EB 02 04 12 E8 03 01 04")
    assert [row.problem for row in rows] == ["", ""]
    assert rows[1].request is not None


def test_a_repeated_request_leaves_the_first_without_an_answer() -> None:
    ask, answer = "EB 90 01 04 11 C0 05 02 DD", "90 EB 01 05 11 C0 05 2E 02 0C"
    teller = TranscriptReader("exo")
    rows = list(teller.tell(lines_of(io.StringIO(f"0.0 > {ask}\n0.5 > {ask}\n0.502 < {answer}\n"), "t")))
    assert [row.problem for row in rows] == ["", "no-answer", "", ""]
    assert rows[1].meaning == "no reply to the request of line 1: read system_voltage: 2 bytes at 1472, id 1"
    statistics = teller.statistics.as_row()
    assert (statistics["requests"], statistics["answered"]) == (2, 1)
    assert statistics["frames"] == {"host": 2, "device": 1}
    assert statistics["bytes"] == {"host": 18, "device": 10}
    assert statistics["bytes_per_second"] == {"host": 35.9, "device": 19.9}
    assert statistics["round_trip"]["median_ms"] == 2.0
    assert statistics["problems"] == {"no-answer": 1}


def test_an_event_cuts_what_was_begun() -> None:
    rows = told("exo", "> EB 90 01 04 11 C0 05 02 DD", "< 90 EB 01", "1.0 ! power-cycle", "< 05 11")
    assert [(row.kind, row.problem) for row in rows] == [
        ("frame", ""), ("stray", "cut-short"), ("unanswered", "no-answer"), ("event", ""), ("stray", "stray"),
    ]  # fmt: skip


LOOP_SETUP = [
    *(line for command in (
        "12FSET LCV 1 LCVC 1 LCPG 0 LFV 0 LFS 1 LFAP 0 LFDP 1", "4FSET LCV 0 LCPG 0 LFV 0 LFS 0 LFAP 0 LFDP 1", "PSET LFT 1",
    ) for line in (f"> {hex_of(command)} 0D", f"< {hex_of(command)} 0A 0D 3D 3E 20")),
    f"> {hex_of('124LOOP')} 0D", f"< {hex_of('124LOOP')} 2A",
]  # fmt: skip


def test_realtime_blocks_by_the_flags_that_were_set() -> None:
    """The example of barrett §6.4: control 3 bytes, feedback 8, cut anywhere; the next block is sent ahead."""
    rows = told(
        "barrett", *LOOP_SETUP, "> 43 14 7F", "< 2A 78 14", "> 61", "< 78 7F 00 01 9C 2A", "> 41", "< 2A 78 00 78 00 00 FF C9",
        "> 03", "< 0A 0D 3D 3E 20", f"> {hex_of('FGET P')} 0D", f"< {hex_of('FGET P')} 0A 0D 30 20 30 20 30 20 30 0A 0D 3D 3E 20",
    )  # fmt: skip
    assert [row.problem for row in rows] == [""] * len(rows)
    assert [row.meaning for row in rows[7:]] == [
        "in RealTime: control 3 bytes, feedback 8 bytes",
        "C: F1 velocity 20, F2 velocity 127, requests feedback",
        "a: no control values, requests acknowledgement",
        "* F1 strain 120 delta 20 cts, F2 strain 120 delta 127 cts, SPREAD delta 0 cts, temperature 41.2 °C",
        "* acknowledgement",
        "A: no control values, requests feedback",
        "* F1 strain 120 delta 0 cts, F2 strain 120 delta 0 cts, SPREAD delta 0 cts, temperature -5.5 °C",
        "^C: leave RealTime",
        "RealTime has ended, prompt",
        "FGET P: read position of F1 F2 F3 SPREAD",
        "position 0 0 0 0 cts (F1 F2 F3 SPREAD)",
    ]


def test_a_wrong_header_ends_realtime() -> None:
    rows = told(
        "barrett", *LOOP_SETUP, "> 5A", "< 0A 0D 45 52 52 20 32 30 34 38 0A 0D 3D 3E 20", "> 0D", "< 0A 0D 3D 3E 20"
    )[8:]
    assert [(row.problem, row.meaning) for row in rows] == [
        ("bad-block", "Z: not the start of a block. The hand leaves RealTime with ERR 2048"),
        ("refused", "ERR 2048: Invalid RealTime control block header (2048). RealTime has ended, prompt"),
        ("", "an empty line: requests the prompt"), ("", "prompt"),
    ]  # fmt: skip


def download(wrong: str = "44") -> list[str]:
    """The vector of the dossier's section 11, byte by byte; `wrong` is the echo of 44."""
    lines = ["> 58", "< 3A", "> FF", "> FF"]
    for byte in ["00", "20", "08", "FF", "11", "22", "33", "44", "55", "66", "FF", "00"]:
        lines.append(f"> {byte}")
        if byte != "FF" or len(lines) > 20:
            lines.append(f"< {wrong if byte == '44' else byte}")
    return lines


def test_a_download_record_by_record() -> None:
    assert meanings("barrett", *download(), "> 0D", "< 0A 0D 3D 3E 20") == [
        "X: requests a download from the boot monitor", "the boot monitor is ready for a download", "the first trigger of a download",
        "download record: 8 bytes at 2000h", "echo of the record at 2000h: 11 bytes, all correct",
        "an empty line: requests the prompt", "prompt",
    ]  # fmt: skip
    wrong = [(row.problem, row.meaning) for row in told("barrett", *download("7F")) if row.problem]
    assert ("wrong-echo", "wrong echo: sent 44, received 7F") in wrong


def test_an_abort_and_a_new_speed() -> None:
    assert meanings("barrett", "> 43 0D", "< 43", "> 03", "< 0A 0D 45 52 52 20 31 36 33 38 34 0A 0D 3D 3E 20") == [
        "C: close to CT (spread: F1 and F2 move next to F3), for F1 F2 F3 SPREAD", "^C: abort", "ERR 16384: Cntl-C abort command received (16384)",
    ]  # fmt: skip


def test_the_can_traffic_of_others_is_told_apart() -> None:
    rows = told(
        "wrist",
        "> can 10FF0001 [1] 02",
        "< can 10FF0002 [2] 01 00",
        "< can 10FF0001 [1] 02",
        "< can 10FF0001 [2] A7 FE",
    )
    assert [(row.problem, row.meaning) for row in rows[1:]] == [
        ("", "not asked for here: pitch_actual = 0.01 °, id 2"),
        ("echo", "our own frame came back: read pitch_actual: 2 bytes at 1020, id 1"), ("", "pitch_actual = -3.45 °, id 1"),
    ]  # fmt: skip


# -- the transcripts of this folder -----------------------------------------------------------------------------------


RECORDED = [path for path in sorted(TRANSCRIPTS.glob("*.txt")) if path.name.partition("-")[0] in FAMILIES]
"""Those of the families: a simulator may be there before its command."""


def cases() -> Iterator[tuple[str, str, str, list[str]]]:
    """(family, "file: case", kind, lines) of every case."""
    for path in RECORDED:
        name, kind, lines = "", "", []
        for line in [*path.read_text(encoding="utf-8").splitlines(), "# case end: end"]:
            if line.startswith("# case "):
                if name:
                    yield path.name.partition("-")[0], f"{path.stem}: {name}", kind, lines
                name, _, kind = line.removeprefix("# case ").partition(": ")
                lines = []
            lines.append(line)


ALLOWED = {
    # kinds whose bytes are good: what may still be remarked
    "accept": {"refused", "unknown-command", "no-answer", "stray"}, "twin": {"refused"}, "sent": {"no-answer"},
}  # fmt: skip


CAN_FD = "hand-can: v34-"
"""Frames of an RH56F1, whose identifiers have another form: handctl does not speak CAN FD (rh56 §2.4)."""


def test_every_good_case_is_explained_without_a_rest() -> None:
    seen = 0
    for family, name, kind, lines in cases():
        if kind not in ALLOWED or name.startswith(CAN_FD):
            continue
        seen += 1
        for row in told(family, *lines):
            if row.comment:
                continue
            allowed = {"", *ALLOWED[kind], *({"bad-block"} if name == "barrett-realtime: unknown-header" else ())}
            assert row.problem in allowed, (name, row.problem, row.meaning)
            if row.problem == "stray":
                assert name == "ekso-dataport: stray-zero", (name, row.meaning)
            if row.problem == "no-answer":
                assert kind == "sent" or name.startswith("exo-procedures: id-"), (name, row.meaning)
    assert seen > 100


def test_every_bad_case_is_remarked_and_the_good_frame_behind_is_found() -> None:
    for family, name, kind, lines in cases():
        if kind not in ("reject", "resync") or family == "barrett":
            continue
        rows = [row for row in told(family, *lines) if not row.comment]
        foreign = any(row.meaning.startswith("not asked for here") for row in rows)
        told_later = name.startswith(("exo-procedures", "aidin"))
        assert foreign or told_later or any(row.problem for row in rows), name
        if kind == "resync" and family != "aidin":
            assert any(row.round_trip is not None or row.request is not None for row in rows), name


def test_no_byte_is_lost() -> None:
    """All pieces of a direction joined are all its bytes."""
    for path in RECORDED:
        family = path.name.partition("-")[0]
        with path.open(encoding="utf-8") as file:
            lines = list(lines_of(file, path.name))
        rows = list(TranscriptReader(family).tell(lines))
        for mark, direction in ((">", HOST), ("<", DEVICE)):
            sent = b"".join(line.data for line in lines if isinstance(line, Entry) and line.mark == mark)
            pieces = b"".join(
                row.piece.raw for row in rows if row.piece is not None and row.piece.direction == direction
            )
            assert pieces == sent, (path.name, direction)


ALIKE = {"hand-can.txt": "wrist", "hand-eb90.txt": "exo", "hand-words.txt": "exo"}
"""Frames that an older family has as well: only a recorded command line, or --family, says that they are another's."""


@each_row("path", RECORDED, ids=lambda path: path.name)
def test_the_family_is_known_by_the_bytes(path: Path) -> None:
    own = path.name.partition("-")[0]
    with path.open(encoding="utf-8") as file:
        family, by_bytes, lines = chosen(lines_of(file, path.name), "", path.name)
        assert (family, by_bytes) == (ALIKE.get(path.name, own), True)
        assert next(lines).line == 1
    text = f"# handctl 0.1.0 {own} status, /dev/ttyUSB0\n{path.read_text(encoding='utf-8')}"
    assert chosen(lines_of(io.StringIO(text), path.name), "", path.name)[:2] == (own, False)


# -- reading ----------------------------------------------------------------------------------------------------------


@each_row(
    ("comment", "family"),
    [
        ("# handctl 0.1.0 exo dump, fake://exo", "exo"), ("# handctl 0.1.0 wrist status, can:socketcan:can0", "wrist"),
        ("# handctl 0.1.0 doctor, fake://ekso?seed=1", "ekso"), ("# handctl 0.1.0 scan, /dev/ttyUSB0", ""), ("# exo", ""),
    ],
)  # fmt: skip
def test_the_family_of_a_recorded_trace(comment: str, family: str) -> None:
    assert family_in(comment) == family


@each_row(
    ("text", "line"),
    [
        ("> EB\n> GG\n", 2),
        ("# c\n\n0.1 x EB\n", 3),
        ("> EB\n0.1 >\n", 2),
        ("> can 1FFFFFFFF [0]\n", 1),
        ("> EB 9\n", 1),
    ],
)
def test_a_damaged_line_is_named(text: str, line: int) -> None:
    with pytest.raises(UsageError, match=rf"f\.txt, line {line}: "):
        list(lines_of(io.StringIO(text), "f.txt"))


def test_a_line_without_end_is_refused_before_it_is_read_whole() -> None:
    with pytest.raises(UsageError, match="line 1: longer than 1048576 characters"):
        list(lines_of(io.StringIO("> " + "EB " * 2_000_000), "f.txt"))


@each_row(
    "text",
    [
        "EB 90 01 04", "eb900104", "0xEB, 0x90, 0x01, 0x4", r"\xeb\x90\x01\x04", "EB:90:01:04", "{0xEB,0x90,0x01,0x04}",
        "EBh 90h 01h 04h", "EB-90-01-04", "00000000: eb90 0104                                ....",
        "00000000  eb 90 01 04                                       |....|\n00000004\n"[:-10], "[EB 90]\n[01 04]",
    ],
)  # fmt: skip
def test_any_usual_notation(text: str) -> None:
    assert parse_given(text) == [Given(b"\xeb\x90\x01\x04")]


def test_lines_of_a_transcript_say_who_sent_them() -> None:
    assert parse_given("0.1 > EB 90\n0.2 < 90 EB\n> can 11000001 [1] 04") == [
        Given(b"\xeb\x90", HOST), Given(b"\x90\xeb", DEVICE), Given(b"\x04", HOST, 0x11000001),
    ]  # fmt: skip


@each_row("text", ["", "EB 9G", "EB901", "hello", "11000001 [2] 04", "FFFFFFFF#00", "11000001#000102030405060708"])
def test_what_is_no_bytes_is_refused(text: str) -> None:
    with pytest.raises(UsageError):
        parse_given(text)


# -- comparing --------------------------------------------------------------------------------------------------------


def compared(family: str, a: list[str], b: list[str]) -> list[tuple[str, str, str]]:
    steps = trace.compare(*(trace.exchanges(told(family, *lines)) for lines in (a, b)))
    return [(step.status, step.a.text if step.a else "", step.b.text if step.b else "") for step in steps]


READ, REPLY, OTHER = "> EB 90 01 04 11 C0 05 02 DD", "90 EB 01 05 11 C0 05 2E 02 0C", "90 EB 01 05 11 C0 05 2F 02 0D"
READ_ID = ["> EB 90 01 04 11 E8 03 01 02", "< 90 EB 01 04 11 E8 03 01 02"]


def test_time_and_pieces_do_not_count() -> None:
    a = ["0.0 " + READ, f"0.1 < {REPLY}"]
    b = ["5.0 " + READ, f"5.1 < {REPLY[:8]}", f"5.3 < {REPLY[9:]}"]
    assert [step[0] for step in compared("exo", a, b)] == ["same"]


def test_changed_and_missing_exchanges() -> None:
    """Both begin elsewhere; they meet again at the nearest place, here the reading of the voltage."""
    a = [READ, f"< {REPLY}", *READ_ID]
    b = [*READ_ID, READ, f"< {OTHER}"]
    assert [step[0] for step in compared("exo", a, b)] == ["only-b", "changed", "only-a"]
    (changed,) = compared("exo", [READ, f"< {REPLY}"], [READ, f"< {OTHER}"])
    assert changed == (
        "changed",
        "read system_voltage: 2 bytes at 1472, id 1 -> system_voltage = 558 (raw, scale unknown), id 1",
        "read system_voltage: 2 bytes at 1472, id 1 -> system_voltage = 559 (raw, scale unknown), id 1",
    )
    one, other = (next(trace.exchanges(told("exo", READ, f"< {reply}"))) for reply in (REPLY, OTHER))
    assert trace.changes(one, other) == [("system_voltage", "558", "559")]
    assert compared("exo", [READ], [READ, f"< {REPLY}"])[0][1].endswith("-> no reply")


def test_message_numbers_do_not_count() -> None:
    a = ["> 96 00 00 C8 3D 82", "< 96 03 00 C8 0E 05 25 A4 DD"]
    b = ["> 96 00 00 00 65 C6", "< 96 04 00 00 17 3B 3B 00 16 B7"]
    assert compared("ekso", a, b) == [
        ("changed", "request GetTime -> GetTime: 14:05:37", "request GetTime -> GetTime: 23:59:59")
    ]
    assert compared("ekso", a[:1], b[:1]) == [("same", "request GetTime -> no reply", "request GetTime -> no reply")]


def test_a_long_way_apart_is_walked_in_windows() -> None:
    a = [line for _ in range(500) for line in READ_ID]
    assert [step[0] for step in compared("exo", a, [*a, READ])] == ["same"] * 500 + ["only-b"]
    assert [step[0] for step in compared("exo", [READ], a)].count("only-b") == 500


# -- garbage ----------------------------------------------------------------------------------------------------------

CHUNK = st.one_of(
    st.binary(min_size=1, max_size=24),
    st.sampled_from([bytes.fromhex(READ[2:]), bytes.fromhex(REPLY), b"FGET P\r", b"FGET P\n\r1 2 3 4\n\r=> ", b"1LOOP\r", b"1LOOP*",
                     b"X", b":", b"\xff", b"C\x10\x0a", b"*", b"\x03", b'{"hand_mode":1}\n', b'{"motor_pos":[1', bytes.fromhex("960000C83D82"),
                     bytes.fromhex("960300C80E0525A4DD"), b"\xeb\x90\x01\xff", b"\x99\x36\x00"]),
)  # fmt: skip


@pytest.mark.parametrize("family", EXPLAIN_ORDER)
@given(chunks=st.lists(st.tuples(st.booleans(), CHUNK), max_size=24))
def test_garbage_is_told_and_nothing_is_lost(family: str, chunks: list[tuple[bool, bytes]]) -> None:
    lines = [f"{'>' if host else '<'} {data.hex(' ')}" for host, data in chunks]
    rows = told(family, *lines)
    for direction, side in ((HOST, True), (DEVICE, False)):
        sent = b"".join(data for host, data in chunks if host is side)
        assert (
            b"".join(row.piece.raw for row in rows if row.piece is not None and row.piece.direction == direction)
            == sent
        )
    for row in rows:
        assert row.meaning.isprintable()
        row.as_row()


@pytest.mark.parametrize("family", EXPLAIN_ORDER)
@given(data=st.binary(min_size=1, max_size=80))
def test_any_bytes_decode(family: str, data: bytes) -> None:
    assert b"".join(piece.raw for piece in explainer_of(family).decode(data)) == data


@given(can_id=st.integers(0, (1 << 29) - 1), data=st.binary(max_size=8), host=st.booleans())
def test_any_can_frame_decodes(can_id: int, data: bytes, host: bool) -> None:
    line = f"{'>' if host else '<'} can {can_id:08X} [{len(data)}] {data.hex(' ')}".rstrip()
    rows = told("wrist", line, line.replace(">", "<"))
    assert [row.piece.raw for row in rows if row.piece is not None] == [data, data]


def test_families_and_explainers_are_the_same() -> None:
    assert set(EXPLAIN_ORDER) == set(FAMILIES)
    with pytest.raises(UsageError, match="not a device family"):
        explainer_of("glove")


@each_row("kind", FAMILIES)
def test_the_quick_json_of_a_row_is_that_of_the_row(kind: str, tmp_path: Path) -> None:
    """It is written without an encoder: every key, and 1 and 1.0, as an encoder has them."""
    trace = tmp_path / "t.txt"
    run(kind, "dump", "-p", f"fake://{kind}?clock=virtual", "--trace", trace)
    with trace_reader.opened(str(trace)) as source:
        lines = [*trace_reader.lines_of(source, "t")]
    rows = [
        row for row in trace_reader.TranscriptReader(kind).tell(lines * 2) if not row.comment
    ]  # the second time kept
    assert len(rows) > 2
    assert [row.as_json() for row in rows] == [dumps(row.as_row()) for row in rows]
    columns = tuple(map(Column, ("t", "line", "direction", "round_trip_ms", "problem", "bytes", "meaning")))
    quick = "".join(row.as_line(",", csv_cell) + "\r\n" for row in rows)
    assert quick == csv_lines(columns, [row.as_row() for row in rows], str, header=False, with_errors=False)


def test_a_csv_file_of_a_transcript_is_written_from_a_terminal_too(tmp_path: Path) -> None:
    """Nothing is drawn meanwhile: there is no device that a live view could name."""
    trace, out = tmp_path / "t.txt", tmp_path / "out.csv"
    trace.write_text("0.5 > EB 90 01 04 11 0A 06 4D 73\n")
    done = screen("trace", "show", str(trace), "--family", "exo", "--csv", "-o", str(out))
    assert (done.code, done.data, len(out.read_text().splitlines())) == (0, "", 3)  # header, request, no reply


@each_row("name", ["ndjson", "csv", "plain"])
def test_every_row_before_a_damaged_line_is_there_in_its_order(name: str, tmp_path: Path) -> None:
    """More rows than are handed on together."""
    trace = tmp_path / "t.txt"
    trace.write_text("".join(f"{n}.0 > EB 90 01 04 11 0A 06 4D 73\n" for n in range(250)) + "bad\n")
    done = run("trace", "show", trace, "--family", "exo", "--format", name)
    seen = [line for line in done.lines if "EB 90 01 04" in line and '"end"' not in line]
    assert (done.code, len(seen)) == (2, 250), done.lines[-1]
    assert [line.find(f"{n}.0") >= 0 for n, line in enumerate(seen)] == [True] * 250


@each_row(("key", "value"), [
    (key, value)
    for key in ("maxtorque", "hand_mode", "k\\n\\u001b")
    for value in ("1e400", "-1e400", "NaN", "Infinity", '"a\\nb\\u0007"', "true", "null", "[1e400]")
])  # fmt: skip
def test_no_value_of_a_hand_makes_its_rows_invalid(tmp_path: Path, key: str, value: str) -> None:
    """JSON has numbers that no machine has, and texts with control characters."""
    trace = tmp_path / "odd.txt"
    trace.write_text("0.1 < " + f'{{"{key}":{value}}}\n'.encode().hex(" ").upper() + "\n")
    for how in ("json", "ndjson", "csv"):
        done = run("trace", "show", trace, "--family", "aidin", "--format", how)
        assert done.code == 0
        assert how == "csv" or all(map(json.loads, done.out.splitlines() if how == "ndjson" else [done.out]))


IN_USE = {"barrett": "&initialized=1", "exo": "&jitter=1", "wrist": "&jitter=1", "hand": "&jitter=1", "ekso": ""}


@each_row("family", IN_USE)
def test_an_answer_like_an_earlier_one_is_told_as_if_it_were_the_first(family: str, tmp_path: Path) -> None:
    """What comes whole may be told from memory; what comes in two reads is not, or must be the same without it."""
    recorded = tmp_path / "t.txt"
    link = f"fake://{family}?clock=virtual&use=on{IN_USE[family]}"
    assert run(family, "watch", "--rate", "5", "--count", "60", "-p", link, "--trace", str(recorded)).code == 0
    whole, split = [], []
    for number, line in enumerate(recorded.read_text(encoding="utf-8").splitlines()[1:]):
        moment, mark, *data = line.split()
        if mark == "<" and number % 7 == 0:
            data[-1] = f"{int(data[-1], 16) ^ 0x11:02X}"  # a wrong checksum, CRC or prompt
        whole.append(f"{moment} {mark} {' '.join(data)}")
        parts = (data[:3], data[3:]) if mark == "<" else (data,)
        split += [f"{moment} {mark} {' '.join(part)}" for part in parts]

    def pieces(lines: list[str]) -> list[dict[str, object]]:
        found = [row.piece for row in told(family, *lines) if row.piece is not None]
        return [
            {
                key: tuple(got) if key in ("values", "parts") else got
                for key in ExplainedBytes.__match_args__
                if key != "kept"
                for got in (getattr(piece, key),)
            }
            for piece in found
        ]

    with patch.object(EksoExplainer, "feed", Cutter.feed):
        anew = pieces(split)
    assert pieces(whole) == pieces(split) == anew
    assert len({str(piece["values"]) for piece in pieces(whole)}) > 20
    assert any(piece["problem"] for piece in pieces(whole))
