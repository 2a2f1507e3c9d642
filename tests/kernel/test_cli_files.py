"""Files on the command line: snapshot, diff, restore, --output, --trace and replay:."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import pytest

import handctl
from handctl.sim.engine.serve import send_control
from tests.inspire.exo_commands import COMMANDS, STORED, Command, prepare
from tests.support.cli import Simulator, fake, memory, pairs, run, s16, sent, spying, writes
from tests.support.each_row import each_row
from tests.support.snapshots import signed, snapshot_of

SETTINGS = pairs(["id", "baud_code", "position_set", "force_set"])


# -- snapshot ---------------------------------------------------------------------------------------------------------


def test_snapshot_holds_every_setting_and_says_where_from(tmp_path: Path) -> None:
    path = tmp_path / "snap.json"
    result = run("exo", "snapshot", path, "-p", fake(id=3), "--id", "3", "--json")
    assert result.code == 0
    content = json.loads(path.read_text())
    assert content["values"] == {**SETTINGS, "id": 3}
    assert {row["name"]: row["value"] for row in result.rows} == {**SETTINGS, "id": 3}
    assert content["schema"] == "handctl-snapshot/1"
    assert content["kind"] == "exo"
    assert content["device"]["id"] == 3
    assert content["tool"] == {"name": "handctl", "version": handctl.__version__}
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00", content["time"])
    assert content["fake"] is True
    assert content == signed(content)


def test_snapshot_is_whole_or_not_there(tmp_path: Path) -> None:
    path = snapshot_of(tmp_path, force_set__index=-5)
    before = path.read_text()
    for fault in ("silent", "bad-checksum", "disconnect"):
        for after in (0, 1):
            assert run("exo", "snapshot", path, "-p", fake(fault=fault, after=after)).code in (3, 4, 5, 7)
            assert path.read_text() == before
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    result = run("exo", "snapshot", tmp_path / "no" / "such" / "dir.json", "--fake")
    assert result.code not in (0, 2)
    assert len(result.err.splitlines()) == 2  # the error and the next step


def test_a_snapshot_replaces_only_an_older_one_of_its_kind(tmp_path: Path) -> None:
    path = snapshot_of(tmp_path, force_set__index=-5)
    path.write_text(path.read_text().replace("sha256:", "sha256:0"))  # damaged, but ours: a new one mends it
    assert run("exo", "snapshot", path, "--fake").code == 0
    assert json.loads(path.read_text())["values"]["force_set.index"] != -5
    for name, text, words in (
        ("notes.txt", "what I measured in March\n", "is no snapshot"),
        ("other.json", '{"schema": "else"}', "is no snapshot"),
        ("wrist.json", path.read_text().replace('"kind": "exo"', '"kind": "wrist"'), "is a snapshot of wrist"),
        ("empty.json", "", "is no snapshot"),
    ):
        kept = tmp_path / name
        kept.write_text(text)
        result = run("exo", "snapshot", kept, "-p", "/dev/ttyNONE", "--json")  # before the port is opened
        assert (result.code, result.error["code"]) == (2, "exists") and words in result.error["text"], result
        assert "Nothing was sent" in result.error["hint"] and kept.read_text() == text


def test_where_no_snapshot_can_be_written_is_told_before_anything_is_sent(tmp_path: Path) -> None:
    for path in (tmp_path / "no" / "such.json", "/proc/1/such.json"):
        result = run("exo", "snapshot", path, "-p", fake(), "--json")
        assert (result.code, result.json["counters"]["sent"]) == (1, 0)


@pytest.mark.real
def test_a_snapshot_that_restore_will_refuse_says_so(tmp_path: Path) -> None:
    with Simulator("--pty", "--control", tmp_path / "panel") as simulator:
        assert send_control(str(tmp_path / "panel"), "set 1504 D0 07").startswith("ok")  # 2000, as another program may
        taken = run("exo", "snapshot", tmp_path / "snap.json", "-p", simulator.link, "--json")
        assert (taken.code, taken.codes()) == (0, ["out-of-range", "written"])
        (warning,) = [message for message in taken.json["messages"] if message["level"] == "warning"]
        assert "force_set.index = 2000" in warning["text"] and "force_set.index=" in warning["hint"]
        refused = run("exo", "restore", tmp_path / "snap.json", "-y", "-p", simulator.link, "--json")
        assert (refused.code, refused.json["counters"]["sent"]) == (2, 0)


# -- diff -------------------------------------------------------------------------------------------------------------


def test_diff_of_two_files_and_of_a_file_with_the_hand(tmp_path: Path) -> None:
    one = snapshot_of(tmp_path).rename(tmp_path / "one.json")
    two = snapshot_of(tmp_path, force_set__index=-5, position_set__thumb=-1)
    assert run("exo", "diff", one, one).code == 0
    result = run("exo", "diff", one, two, "--setpoints", "--json")
    assert result.code == 7
    assert [(row["name"], row["a"], row["b"]) for row in result.rows] == [
        ("position_set.thumb", 555, -1),
        ("force_set.index", 64, -5),
    ]
    live = run("exo", "diff", two, "--setpoints", "-p", fake(), "--json")
    assert (live.code, [(row["name"], row["a"], row["b"]) for row in live.rows]) == (
        7,
        [("position_set.thumb", -1, 555), ("force_set.index", -5, 64)],
    )
    same = run("exo", "diff", one, "--setpoints", "-p", fake(), "--json")
    assert (same.code, same.rows) == (0, [])


def test_diff_finds_the_hand_whose_id_the_restore_has_changed(tmp_path: Path) -> None:
    link = fake(state=tmp_path / "state.json")
    path = snapshot_of(tmp_path, id=7)
    assert run("exo", "restore", path, "--setpoints", "-y", "-p", link).code == 0
    result = run("exo", "diff", path, "-p", link, "--json")
    assert (result.code, result.rows, result.json["device"]["id"]) == (0, [], 7)


# -- restore ----------------------------------------------------------------------------------------------------------


def test_restore_writes_what_differs_reads_back_and_says_what_it_leaves_out(tmp_path: Path) -> None:
    state, trace = tmp_path / "state.json", tmp_path / "t.txt"
    path = snapshot_of(tmp_path, force_set__index=-5, position_set__thumb=-1)
    result = run("exo", "restore", path, "--setpoints", "-y", "-p", fake(state=state), "--json", "--trace", trace)
    assert result.code == 0
    assert {row["name"]: (row["before"], row["value"], row["moves"]) for row in result.rows} == {
        "position_set.thumb": (555, -1, True),
        "force_set.index": (64, -5, True),
    }
    assert memory(state, 1494, 2) + memory(state, 1504, 2) == s16(-1, -5)
    assert len(writes(trace)) == 2
    text = " ".join(message["text"] for message in result.json["messages"])
    for word in ("calibration", "flash", "clear_errors"):
        assert word in text
    again = run("exo", "restore", path, "--setpoints", "-y", "-p", fake(state=state), "--json", "--trace", trace)
    assert (again.code, again.rows, writes(trace)) == (0, [], [])
    with spying() as spy:
        unasked = run("exo", "restore", path, "--setpoints", "-p", fake(state=state))
    assert (unasked.code, spy.lines) == (8, [])  # whether anything differs, only reading could tell: nothing is sent


def test_restore_changes_the_id_last(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    path = snapshot_of(tmp_path, id=7, baud_code=1, force_set__index=-5)
    result = run("exo", "restore", path, "--setpoints", "-y", "-p", fake(), "--json", "--trace", trace)
    assert (result.code, result.json["device"]["id"]) == (0, 7)
    assert {row["name"]: row["value"] for row in result.rows} == {"force_set.index": -5, "baud_code": 1, "id": 7}
    assert [data[5] + 256 * data[6] for data in writes(trace)] == [1504, 1001, 1000]


@pytest.mark.parametrize(
    ("fault", "step"), [("disconnect", 1), ("silent", 3), ("deaf", 1), ("bad-checksum", 3), ("truncate", 3)]
)
def test_restore_interrupted_anywhere_can_be_run_again(tmp_path: Path, fault: str, step: int) -> None:
    """The same command line finishes the work, also when the id has changed already."""
    for requests in range(0, 24, step):
        state = tmp_path / f"state{requests}.json"
        path = snapshot_of(tmp_path, id=7, baud_code=2, **{k.replace(".", "__"): v for k, v in STORED.items()})
        wanted = (b"\x07\x02", s16(151, 252, 353, 300, 555), s16(1, -2, 3, -4, 5))
        first = run(
            "exo", "restore", path, "--setpoints", "-y", "-p", fake(state=state, fault=fault, after=requests), "--json"
        )
        assert first.code in (0, 3, 4, 5, 7), first
        assert first.json["ok"] is (first.code == 0)
        second = run("exo", "restore", path, "--setpoints", "-y", "-p", fake(state=state), "--json")
        assert second.code == 0, (first, second)
        assert (memory(state, 1000, 2), memory(state, 1486, 10), memory(state, 1498, 10)) == wanted
        third = run("exo", "restore", path, "--setpoints", "-y", "-p", fake(state=state), "--json")
        assert (third.code, third.rows, third.json["writes"]) == (0, [], [])


@each_row("requests", range(24))
def test_restore_reports_success_only_when_all_is_written(tmp_path: Path, requests: int) -> None:
    state = tmp_path / "state.json"
    path = snapshot_of(tmp_path, id=7, **{k.replace(".", "__"): v for k, v in STORED.items()})
    result = run(
        "exo",
        "restore",
        path,
        "--setpoints",
        "-y",
        "-p",
        fake(state=state, fault="deaf", after=requests, every=3),
        "--json",
    )
    if result.code == 0:
        assert (memory(state, 1000), memory(state, 1498, 10)) == (b"\x07", s16(1, -2, 3, -4, 5))
    else:
        assert result.code in (4, 5, 7), result


def spoil(path: Path, how: str) -> None:
    """Make a snapshot file one that must not be used."""
    text = path.read_text()
    content = json.loads(text)
    match how:
        case "value changed":
            path.write_text(text.replace("151", "152"))
        case "cut off":
            path.write_text(text[: len(text) // 2])
        case "empty":
            path.write_text("")
        case "not JSON":
            path.write_text("EB 90 01")
        case "binary":
            path.write_bytes(b"\xff\xfe\x00\x01")
        case "a list":
            path.write_text("[1, 2]")
        case "other JSON":
            path.write_text('{"schema": "handctl/1"}')
        case "no checksum":
            del content["checksum"]
            path.write_text(json.dumps(content))
        case "foreign":
            path.write_text(json.dumps(signed({**content, "kind": "wrist"})))
        case "newer":
            path.write_text(json.dumps(signed({**content, "schema": "handctl-snapshot/2"})))
        case "unknown quantity":
            path.write_text(json.dumps(signed({**content, "values": {**content["values"], "speed.index": 1}})))
        case "out of range":
            path.write_text(
                json.dumps(signed({**content, "values": {**content["values"], "position_set.index": 1001}}))
            )
        case "id 255":
            path.write_text(json.dumps(signed({**content, "values": {**content["values"], "id": 255}})))
        case "trigger":
            path.write_text(json.dumps(signed({**content, "values": {**content["values"], "save": 1}})))
        case "read-only":
            path.write_text(json.dumps(signed({**content, "values": {**content["values"], "system_voltage": 1}})))
        case "text as value":
            path.write_text(json.dumps(signed({**content, "values": {**content["values"], "id": "1"}})))
        case "fraction as value":
            path.write_text(json.dumps(signed({**content, "values": {**content["values"], "force_set.index": 1.5}})))
        case "huge value":
            path.write_text(json.dumps(signed({**content, "values": {**content["values"], "force_set.index": 10**30}})))
        case "values missing":
            path.write_text(json.dumps(signed({k: v for k, v in content.items() if k != "values"})))
        case "a directory":
            path.unlink()
            path.mkdir()
        case _:
            path.unlink()


SPOILED = ["value changed", "cut off", "empty", "not JSON", "binary", "a list", "other JSON", "no checksum", "foreign",
           "newer", "unknown quantity", "out of range", "id 255", "trigger", "read-only", "text as value",
           "fraction as value", "huge value", "values missing", "a directory", "missing"]  # fmt: skip


@each_row("how", SPOILED)
def test_a_spoiled_snapshot_is_refused_before_anything_is_sent(tmp_path: Path, how: str) -> None:
    path = snapshot_of(tmp_path)
    spoil(path, how)
    for verb in ("restore", "diff"):
        with spying() as spy:
            result = run(
                "exo", verb, path, "--setpoints", "-p", fake(), "--json", *(["-y"] if verb == "restore" else [])
            )
        if verb == "diff" and how in ("unknown quantity", "out of range", "id 255", "trigger", "read-only",
                                      "fraction as value", "huge value"):  # fmt: skip
            assert result.code in (2, 7), result
            continue
        assert result.code == 2, result
        assert str(path) in result.error["text"]
        assert spy.lines == [] or spy.requests == 0, result


# -- --output ---------------------------------------------------------------------------------------------------------


def _timeless(envelope: bytes) -> bytes:
    """Without the time at which it was made."""
    return re.sub(rb'"time": *"[^"]*"', b"", envelope)


@pytest.mark.parametrize("form", ["table", "plain", "json", "ndjson", "csv"])
def test_output_to_a_file_is_what_stdout_would_have_been(tmp_path: Path, form: str) -> None:
    path = tmp_path / "out.txt"
    link = fake()
    straight = run("exo", "dump", "-p", link, "--format", form)
    result = run("exo", "dump", "-p", link, "--format", form, "-o", path)
    assert (result.code, result.raw) == (0, b"")
    assert _timeless(path.read_bytes()) == _timeless(straight.raw)
    assert [entry.name for entry in tmp_path.iterdir()] == ["out.txt"]


def test_output_of_a_stream(tmp_path: Path) -> None:
    path = tmp_path / "out.ndjson"
    result = run("exo", "watch", "system_voltage", "--count", "3", "--json", "-p", fake(), "-o", path)
    assert (result.code, result.out) == (0, "")
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    assert [line.get("value") for line in lines] == [558, 558, 558, None]
    assert lines[-1]["end"]["stream"]["samples"] == 3


def test_a_failure_never_destroys_the_old_file(tmp_path: Path) -> None:
    """Without data there is nothing to write; JSON says what went wrong."""
    path = tmp_path / "out"
    for form in ("table", "plain", "csv"):
        path.write_text("the last good one")
        assert run("exo", "dump", "-p", fake(fault="silent"), "--format", form, "-o", path).code == 4
        assert path.read_text() == "the last good one", form
    assert run("exo", "dump", "-p", fake(fault="silent"), "--json", "-o", path).code == 4
    assert json.loads(path.read_text())["exit_code"] == 4
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


def test_output_that_cannot_be_written(tmp_path: Path) -> None:
    for target in (tmp_path / "no" / "dir" / "out.json", tmp_path):
        result = run("exo", "dump", "--fake", "--json", "-o", target)
        assert result.code not in (0, 130), target
        assert result.out == "" or result.json["ok"] is False
        assert len(result.err.splitlines()) == 2 and "  Next: " in result.err, result
        assert str(target) in result.err
    assert list(tmp_path.iterdir()) == []


# -- transcripts ------------------------------------------------------------------------------------------------------


def test_trace_is_the_transcript_format(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = run("exo", "get", "system_voltage", "-p", fake(turnaround=0.004), "--trace", trace, "-v")
    lines = trace.read_text().splitlines()
    assert lines[0].startswith("# handctl ")
    assert lines[1:3] == [
        "0.000000 > EB 90 01 04 11 C0 05 02 DD",
        "0.004000 < 90 EB 01 05 11 C0 05 2E 02 0C",
    ]
    assert [line for line in result.err.splitlines() if re.match(r"\d", line)] == lines[1:]


def replayable(command: Command) -> bool:
    return command.name not in ("watch", "scan", "snapshot", "raw-read", "raw-write", "factory-reset")


@each_row("command", [c for c in COMMANDS if replayable(c)], ids=lambda command: command.name)
def test_a_trace_plays_the_hand(tmp_path: Path, command: Command) -> None:
    """The same command on the recording shows the same rows, and is not called simulated."""
    prepare(tmp_path)
    trace = tmp_path / "t.txt"
    yes = ["-y"] if command.asks else []
    recorded = run("exo", *command.words(tmp_path), *yes, "-p", fake(jitter=1), "--trace", trace, "--json")
    played = run("exo", *command.words(tmp_path), *yes, "-p", f"replay:{trace}", "--json")
    assert (recorded.code, played.code) == (0, 0)
    timeless = [[{k: v for k, v in row.items() if k != "seconds"} for row in r.rows] for r in (recorded, played)]
    assert timeless[0] == timeless[1]
    assert played.json["device"]["link"] == f"replay:{trace}"
    for form in ("csv", "plain"):
        assert run("exo", *command.words(tmp_path), *yes, "-p", f"replay:{trace}", "--format", form).code == 0


def test_a_faulty_session_plays_back_too(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    for seed in range(5):
        recorded = run("exo", "dump", "-p", fake(fault="noise,split", seed=seed), "--trace", trace, "--json")
        assert run("exo", "dump", "-p", f"replay:{trace}", "--json").rows == recorded.rows
    assert recorded.code == 0


def test_a_request_that_was_never_recorded_is_a_clear_error(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    assert run("exo", "get", "id", "-p", fake(), "--trace", trace).code == 0
    result = run("exo", "get", "error", "-p", f"replay:{trace}", "--json")
    assert result.code == 3
    assert "EB 90 01 04 11 46 06 05 67" in result.error["text"]
    assert result.error["code"] == "replay-miss"


@each_row("text", ["", "# only a comment\n", "hello\n", "0.0 > EB 9\n", "0.0 > GG\n", "x > EB\n"])
def test_a_damaged_transcript_is_a_usage_error(tmp_path: Path, text: str) -> None:
    path = tmp_path / "t.txt"
    path.write_text(text)
    result = run("exo", "dump", "-p", f"replay:{path}", "--json")
    assert result.code == 2
    assert str(path) in result.error["text"]


def test_an_earlier_trace_stays_until_something_passes(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    earlier = "# earlier\n" + "0.000000 > 00\n" * 1000
    trace.write_text(earlier)
    for words in (
        ("get", "id", "-p", tmp_path / "none"),
        ("get", "nothing", "-p", fake()),
        ("set", "id=2", "--dry-run", "-p", fake()),
    ):
        run("exo", *words, "--trace", trace)
        assert trace.read_text() == earlier, words
    assert run("scan", "-p", tmp_path / "none", "--trace", trace).code and trace.read_text() == earlier
    assert run("exo", "get", "id", "-p", fake(fault="silent"), "--trace", trace).code == 4
    lines = trace.read_text().splitlines()
    assert lines[0].startswith("# handctl") and "> EB 90" in lines[1] and "# earlier" not in lines


def test_trace_that_cannot_be_written_is_told_before_anything_is_sent(tmp_path: Path) -> None:
    with spying() as spy:
        result = run("exo", "dump", "-p", fake(), "--trace", tmp_path / "no" / "t.txt")
    assert result.code == 1
    assert spy.lines == []
    assert os.listdir(tmp_path) == []


def test_the_backup_before_a_factory_reset(tmp_path: Path) -> None:
    backup = tmp_path / "b.json"
    args = ("exo", "factory-reset", "--undocumented-address", "--backup", backup, "-y", "--json")
    trace = tmp_path / "t.txt"
    assert run(*args, "-p", fake(), "--trace", trace).code == 0
    assert json.loads(backup.read_text())["values"] == SETTINGS
    assert [data[4] for data in sent(trace)[-2:]] == [0x12, 0x11]  # the reset, then a look who answers
    with spying() as spy:
        again = run(*args, "-p", fake())
    assert again.code == 2
    assert "exists" in again.error["text"]
    assert spy.lines == []
