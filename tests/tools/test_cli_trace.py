"""`handctl trace` on the command line: show, diff, decode; formats, exit codes, pipes and terminals; recorded traces."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handctl.model.explainer import DEVICE, HOST, ExplainedBytes
from handctl.tools.trace_reader import Stamp, TranscriptRow, row_text
from tests.support.cli import fake, run
from tests.support.each_row import each_row

ASK, REPLY = "EB 90 01 04 11 C0 05 02 DD", "90 EB 01 05 11 C0 05 2E 02 0C"
TRACE = f"""# handctl 0.1.0 exo get, /dev/ttyUSB0
0.000000 > {ASK}
0.004120 < {REPLY[:8]}
0.005120 < {REPLY[9:]}
1.000000 > {ASK}
1.004000 < 00 FF
"""
TOLD = [
    "# handctl 0.1.0 exo get, /dev/ttyUSB0",
    f"   0.000000 >              read system_voltage: 2 bytes at 1472, id 1  [{ASK}]",
    f"   0.004120 <   +5.120 ms  system_voltage = 558 (raw, scale unknown), id 1  [{REPLY}]",
    f"   1.000000 >              read system_voltage: 2 bytes at 1472, id 1  [{ASK}]",
    "   1.004000 <*             2 bytes of no frame  [00 FF]",
    "   1.000000  *             no reply to the request of line 5: read system_voltage: 2 bytes at 1472, id 1",
]


@pytest.fixture
def trace(tmp_path: Path) -> Path:
    path = tmp_path / "t.txt"
    path.write_text(TRACE, encoding="ascii")
    return path


# -- show -------------------------------------------------------------------------------------------------------------


def test_show_tells_every_frame_and_counts(trace: Path) -> None:
    result = run("trace", "show", trace)
    assert result.code == 0
    assert result.err == ""
    assert result.lines == [
        *TOLD, "", "device      exo", "host        2 frames, 18 bytes, 17.9 bytes/s",
        "device      1 frame, 12 bytes, 2 of them in no frame, 12 bytes/s", "requests    2, 1 answered",
        "problems    no-answer 1, stray 1", "round trip  min 5.12, median 5.12, max 5.12 ms",
        "       to 6 ms ############################## 1",
    ]  # fmt: skip


def test_show_from_a_pipe_is_the_same(trace: Path) -> None:
    assert run("trace", "show", "-", stdin=TRACE).out == run("trace", "show", trace).out


def test_only_errors_and_grep(trace: Path) -> None:
    assert run("trace", "show", trace, "--only", "errors").lines[:2] == TOLD[4:]
    assert run("trace", "show", trace, "--grep", "VOLTAGE = 55[0-9]").lines[0] == TOLD[2]
    assert run("trace", "show", trace, "--grep", "^00 FF$", "--format", "plain").lines == [
        "1.004\t6\tdevice\t\tstray\t00 FF\t2 bytes of no frame"
    ]
    assert run("trace", "show", trace, "--grep", "(").code == 2


def test_json_is_one_object_with_statistics(trace: Path) -> None:
    result = run("trace", "show", trace, "--json")
    assert [(row["t"], row["line"], row["direction"], row["kind"], row["problem"]) for row in result.rows] == [
        (0.0, 2, "host", "frame", None), (0.00412, 3, "device", "frame", None), (1.0, 5, "host", "frame", None),
        (1.004, 6, "device", "stray", "stray"), (1.0, 5, "host", "unanswered", "no-answer"),
    ]  # fmt: skip
    reply = result.rows[1]
    assert reply["bytes"] == REPLY
    assert (reply["id"], reply["flag"], reply["address"]) == (1, "11", 1472)
    assert reply["values"] == [{"name": "system_voltage", "value": 558, "unit": None}]
    assert (reply["request_line"], reply["round_trip_ms"]) == (2, 5.12)
    statistics = result.json["statistics"]
    assert (statistics["family"], statistics["requests"], statistics["answered"]) == ("exo", 2, 1)
    assert statistics["stray_bytes"] == {"host": 0, "device": 2}


def test_a_stream_of_rows_ends_with_the_envelope(trace: Path) -> None:
    rows, end = run("trace", "show", trace, "--format", "ndjson").stream
    assert [row["meaning"] for row in rows][:2] == [
        "read system_voltage: 2 bytes at 1472, id 1",
        "system_voltage = 558 (raw, scale unknown), id 1",
    ]
    assert end["statistics"]["problems"] == {"stray": 1, "no-answer": 1}
    assert run("trace", "show", trace, "--csv").lines[0] == "t_s,line,direction,round_trip_ms,problem,bytes,meaning"


def test_what_cannot_be_read_is_a_usage_error(tmp_path: Path, trace: Path) -> None:
    missing = run("trace", "show", tmp_path / "none.txt")
    assert missing.code == 2
    assert "no-file" in missing.said and "none.txt" in missing.err
    trace.write_text(TRACE + "2.0 < ZZ\n3.0 > EB\n", encoding="ascii")
    for form in ("table", "json", "ndjson", "csv", "plain"):
        damaged = run("trace", "show", trace, "--format", form)
        assert damaged.code == 2, form
        assert "t.txt, line 7: not hexadecimal" in damaged.err
        assert "system_voltage = 558" in damaged.out
    trace.write_bytes(bytes(range(256)) * 20)
    assert run("trace", "show", trace).code == 2
    trace.write_text("# nothing\n! start\n", encoding="ascii")
    unknown = run("trace", "show", trace)
    assert unknown.code == 2
    assert "--family exo|wrist|aidin|barrett|ekso" in unknown.err
    assert run("trace", "show", trace, "--family", "exo").lines[1] == "     line 2 !              start"


def test_the_family_can_be_told_by_the_bytes_or_said(trace: Path) -> None:
    trace.write_text(TRACE.partition("\n")[2], encoding="ascii")
    assert "t.txt: recognized as exo from its contents" in run("trace", "show", trace).err
    assert "the hand's own registers" in run("trace", "show", trace, "--family", "wrist").out


def test_a_terminal_gets_wrapped_lines_and_one_line_of_bytes() -> None:
    long = ExplainedBytes(direction=DEVICE, raw=bytes(200), meaning="word " * 40)
    for width in (40, 80, 200):
        lines = row_text(TranscriptRow(Stamp(1.5, 1), Stamp(1.5, 1), long, round_trip=0.004), width).splitlines()
        assert max(len(line) for line in lines) <= width, width
        assert lines[0].startswith("   1.500000 <   +4.000 ms")
        assert lines[-1].endswith("… (200 bytes)")
        assert sum(line.count("word") for line in lines) == 40
    can = ExplainedBytes(direction=HOST, raw=bytes(8), can_id=0x10FF0001, meaning="read")
    assert (
        row_text(TranscriptRow(Stamp(None, 3), Stamp(None, 3), can), 40).splitlines()[-1]
        == "    can 10FF0001 [8] 00 00 … (8 bytes)"
    )


def test_nothing_in_a_transcript_reaches_the_terminal_as_a_control() -> None:
    text = "# \x1b]0;title\x07\n! \x1b[2J\n> 1B 5B 32 4A 0D\n"
    assert "\x1b" not in run("trace", "show", "-", "--family", "barrett", stdin=text).out
    escaped = b'{"\\u001b[2J":1}'.hex(" ")
    assert "\x1b" not in run("trace", "show", "-", "--family", "aidin", stdin=f"> {escaped}\n").out


@pytest.mark.parametrize(
    ("words", "wire", "expected"),
    [
        (("exo", "dump"), "", "system_voltage = 558 (raw, scale unknown), position_set = 151 252 353 454 555"),
        (("exo", "save", "-y"), "", "result of the save: saved"),
        (("wrist", "status"), "bus=can", "pitch_actual = -3.45 °, yaw_actual = 11.25 °"),
        (("wrist", "move", "--pitch", "1", "--yaw", "2", "--time", "100"), "", "write yaw_set = 2.00 °, pitch_set = 1.00 °, move_time = 100 ms"),
        (("barrett", "status"), "", "temperature 41.2 °C"),
        (("barrett", "realtime", "--count", "5"), "initialized=1", "* F1 velocity 0 strain 112 position"),
        (("ekso", "settings"), "", "GetSettings: upper_leg_length"),
        (("aidin", "dump"), "", "joint_pos (q1 q2 q3 q4) [deg]: thumb"),
    ],
    ids=lambda part: "-".join(part) if isinstance(part, tuple) else "",
)  # fmt: skip
def test_what_a_command_recorded_is_told_without_a_rest(
    tmp_path: Path, words: tuple[str, ...], wire: str, expected: str
) -> None:
    """Nothing stray, nothing unasked, no request without its answer."""
    path = tmp_path / "f.txt"
    link = f"fake://{words[0]}?clock=virtual" + (f"&{wire}" if wire else "")
    assert run(*words, "-p", link, "--trace", path, "--format", "json").code == 0
    result = run("trace", "show", path, "--json")
    assert result.codes() == []
    assert expected in "\n".join(row["meaning"] for row in result.rows)
    statistics = result.json["statistics"]
    assert statistics["family"] == words[0]
    assert statistics["stray_bytes"] == {"host": 0, "device": 0}
    # 1FGET LCT of the loop is refused by firmware 4.3. Before a write no wrist answers on the exo's line, as it should be.
    silent = words[:2] == ("exo", "save")
    assert statistics["problems"] in (({"no-answer": 1},) if silent else ({}, {"refused": 1}))
    assert statistics["requests"] == statistics["answered"] + silent


def test_faults_of_the_line_are_told(tmp_path: Path) -> None:
    found = {}
    for fault in ("noise", "truncate", "bad-checksum", "echo", "duplicate", "silent", "wrong-id"):
        path = tmp_path / f"{fault}.txt"
        run("exo", "get", "system_voltage", "-p", fake(fault=fault), "--retries", "0", "--trace", path)
        found[fault] = set(run("trace", "show", path, "--json").json["statistics"]["problems"])
    assert found == {
        "noise": {"stray"}, "truncate": {"cut-short", "no-answer"}, "bad-checksum": {"bad-checksum", "no-answer"},
        "echo": {"echo"}, "duplicate": {"unasked"}, "silent": {"no-answer"}, "wrong-id": {"unasked", "no-answer"},
    }  # fmt: skip


# -- diff -------------------------------------------------------------------------------------------------------------


def test_diff_compares_meaning(trace: Path, tmp_path: Path) -> None:
    other = tmp_path / "o.txt"
    other.write_text(f"# handctl 0.1.0 exo get, x\n9.0 > {ASK}\n9.2 < {REPLY}\n9.3 > {ASK}\n", encoding="ascii")
    one = tmp_path / "one.txt"
    one.write_text(TRACE.rpartition("1.004")[0], encoding="ascii")
    same = run("trace", "diff", one, other)
    assert (same.code, same.out) == (0, "")
    assert "same" in same.said and "2 exchanges." in same.err
    other.write_text(other.read_text(encoding="ascii").replace("2E 02 0C", "2F 02 0D"), encoding="ascii")
    changed = run("trace", "diff", one, other, "--json")
    assert changed.code == 7
    (row,) = changed.rows
    assert (row["status"], row["line_a"], row["line_b"]) == ("changed", 2, 2)
    assert row["changes"] == [{"name": "system_voltage", "a": "558", "b": "559"}]
    assert changed.json["statistics"] == {"same": 1, "changed": 1, "only-a": 0, "only-b": 0}
    text = run("trace", "diff", one, other)
    assert text.lines[0] == "changed: line 2 of A, line 2 of B"
    assert text.lines[2] == "    system_voltage: 558 -> 559"
    assert "The transcripts differ: 1 same, 1 changed, 0 only in" in text.err
    assert run("trace", "diff", trace, one).lines[0] == "only-a: line 6 of A"
    assert run("trace", "diff", one, tmp_path / "none").code == 2
    assert run("trace", "diff", "-", "-").code == 2


# -- decode -----------------------------------------------------------------------------------------------------------


def test_decode_explains_every_field() -> None:
    result = run("trace", "decode", "exo", *REPLY.split())
    assert result.code == 0
    assert result.lines == [
        "from the device: system_voltage = 558 (raw, scale unknown), id 1",
        "Bytes  Field           Meaning",
        "90 EB  header          from the device",
        "01     id              1",
        "05     length          5 bytes from the flag to the data",
        "11     flag            read, hand",
        "C0 05  address         1472 system_voltage",
        "2E 02  system_voltage  558 (raw, scale unknown)",
        "0C     checksum        right",
    ]


def test_decode_says_the_right_checksum() -> None:
    result = run("trace", "decode", "ekso", "9B 04 00 CD 00 CA 06 0E 5E FF", "--json")
    assert (result.code, result.error["code"]) == (7, "no-frame")
    (row,) = result.rows
    assert row["problem"] == "bad-checksum"
    assert row["parts"][-1] == {"bytes": "5E FF", "field": "CRC", "meaning": "wrong, should be 5EFE"}


def test_decode_takes_several_frames_and_says_who_sent_them() -> None:
    rows = run("trace", "decode", "exo", ASK, REPLY, "FF", "--json").rows
    assert [(row["direction"], row["kind"]) for row in rows] == [
        ("host", "frame"),
        ("device", "frame"),
        ("device", "stray"),
    ]
    rows = run(
        "trace", "decode", "wrist", "-", "--json", stdin="> can 11000001 [1] 04\n< can 11000001 [4] 6F 00 DE 00\n"
    ).rows
    assert [row["bytes"] for row in rows] == ["can 11000001 [1] 04", "can 11000001 [4] 6F 00 DE 00"]
    assert run("trace", "decode", "ekso", "98 00 00 CA BF 9A", "--from", "device", "--format", "plain").lines == [
        "device\t98 00 00 CA BF 9A\tGetSettings: acknowledged, without a body"
    ]


@each_row(
    "words",
    [("exo", "EB 9Z"), ("exo", "11000001#04"), ("glove", "00"), ("exo",), ("exo", ""), ("wrist", "FFFFFFFF#00")],
)
def test_decode_refuses_what_is_no_bytes(words: tuple[str, ...]) -> None:
    result = run("trace", "decode", *words, "--json")
    assert result.code == 2
    assert json.loads(result.out)["exit_code"] == 2


def test_a_transcript_file_of_bytes_is_never_written(trace: Path) -> None:
    before = trace.read_bytes()
    run("trace", "show", trace)
    run("trace", "diff", trace, trace)
    assert trace.read_bytes() == before
    assert run("trace", "show", trace, "-n").code == 2
