"""`barrett realtime --log`: the rows of the loop on the recorder, and the motors stopped before anything else at its end."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest

import handctl
from handctl.link.fake import FakeLink
from tests.barrett.commands import fake
from tests.support.cli import Result, run, spying
from tests.support.each_row import each_row

HOLDS = ("--law", "velocity.F1 = clamp((9000 - P.F1)/20, -40, 40)", "--receive", "position")


@pytest.mark.parametrize("velocity", ["13", "10", "72"])
def test_a_control_block_is_no_command(velocity: str) -> None:
    """``43 0D`` is velocity 13 in RealTime, and would close the hand at the prompt."""
    link = "fake://barrett?clock=virtual&initialized=1"
    done = run("barrett", "realtime", "--motors", "1", "--velocity", velocity, "--count", "2", "--json", "-p", link)
    assert done.code == 0, done
    meanings = [step["meaning"] for step in done.stream[1]["writes"] if step["bytes"].startswith("43 ")]
    assert meanings == ["a control block of the RealTime loop"]


def do(path: Path, *args: str | Path, **options: Any) -> Result:
    port = fake(clock="virtual", initialized=1, wire="auto", **options)
    return run("barrett", "realtime", "--motors", "1", *args, "--log", path, "-p", port, "--json")


def kept(path: Path) -> tuple[list[dict[str, str]], dict[str, Any]]:
    rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
    return rows, json.loads(Path(f"{path}.json").read_text(encoding="utf-8"))


def sent(trace: Path) -> list[bytes]:
    lines = [line.split() for line in trace.read_text(encoding="utf-8").splitlines() if " > " in line]
    return [bytes.fromhex("".join(words[2:])) for words in lines]


def test_the_rows_of_a_loop_are_a_log(tmp_path: Path) -> None:
    path, trace = tmp_path / "a.csv", tmp_path / "t.txt"
    done = do(path, *HOLDS, "--duration", "3", "--mark", "begin", "--trace", trace)
    assert done.code == 0, done
    rows, about = kept(path)
    assert done.stream[0][0]["rows"] == len(rows) == about["rows"] > 200 and rows[0]["mark"] == "begin"
    assert (about["schema"], about["complete"], about["ended"], about["lost"], about["skipped"]) == (
        "handctl-barrett-log/1", True, "limit", 0, 0,
    )  # fmt: skip
    assert [column["name"] for column in about["columns"]] == ["velocity_command.F1", "position.F1"]
    assert about["settings_before"] == about["settings_after"] and about["settings_changed"] == []
    assert about["realtime"]["laws"] == [HOLDS[1]] and about["realtime"]["loop"]["guards"]
    assert abs(int(rows[-1]["position.F1_cts"]) - 9000) < 50
    moments = [float(row["host_mono_s"]) for row in rows]
    assert moments == sorted(moments) and about["duration_s"] == pytest.approx(moments[-1] - moments[0], abs=0.01)
    assert {row["rtt_ms"] for row in rows} == {rows[0]["rtt_ms"]} and float(rows[0]["rtt_ms"]) > 5
    blocks = [data for data in sent(trace) if data[:1] == b"C"]
    assert len(blocks) == len(rows)
    assert run("barrett", "log", "--check", path).code == 0
    assert run("barrett", "export", path, "--to", "c3d", "-o", tmp_path / "a.c3d").code == 0


def test_watching_and_a_rate(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    done = do(path, "--rate", "20", "--count", "10", "--until", "N > 6")
    rows, about = kept(path)
    assert (done.code, len(rows)) == (0, 7) and "until" in done.said
    assert about["asked"]["rate_hz"] == 20 and about["rate_hz"] == pytest.approx(20, abs=0.1)


def test_a_guard_is_in_the_rows_and_in_the_sidecar(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    assert do(path, "--velocity", "127", "--receive", "position", "--duration", "2").code == 0
    rows, about = kept(path)
    assert rows[-1]["error"] == "velocity_command.F1: window" and rows[0]["error"] == ""
    assert [event["guard"] for event in about["realtime"]["loop"]["guard_events"]] == ["window"]
    assert run("barrett", "log", "--check", path).code == 0


def test_ctrl_c_stops_the_motors_before_anything_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, trace, sleep = tmp_path / "a.csv", tmp_path / "t.txt", FakeLink.sleep
    done: list[int] = []

    def pressed(link: FakeLink, seconds: float) -> None:
        if path.exists() and path.read_bytes().count(b"\n") == 8 and not done:
            done.append(1)
            raise KeyboardInterrupt
        sleep(link, seconds)

    monkeypatch.setattr(FakeLink, "sleep", pressed)
    ended = do(path, "--velocity", "20", "--rate", "20", "--trace", trace)
    rows, about = kept(path)
    assert (ended.code, about["ended"], about["complete"]) == (130, "interrupted", True), ended
    data = sent(trace)
    last = max(number for number, piece in enumerate(data) if piece[:1] == b"C")
    assert data[last + 1 : last + 4] == [b"c\x00", b"\x03", b"1T\r"] and len(rows) >= 7


def test_a_caller_that_fails_between_two_rows_stops_the_motors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that is full: the file cannot take the row, and no request goes into the loop."""
    from handctl.errors import OutputError
    from handctl.record.csv_and_sidecar import Recording

    trace, add = tmp_path / "t.txt", Recording.add

    def full(recording: Recording, sample: Any, seq: int) -> bool:
        if seq > 3:
            raise OutputError("full", code="log-file")
        return add(recording, sample, seq)

    monkeypatch.setattr(Recording, "add", full)
    done = do(tmp_path / "a.csv", "--velocity", "20", "--duration", "3", "--trace", trace)
    assert done.code == 1, done
    data = sent(trace)
    last = max(number for number, piece in enumerate(data) if piece[:1] == b"C")
    assert data[last + 1 : last + 4] == [b"c\x00", b"\x03", b"1T\r"]


def test_a_loop_that_breaks_off_keeps_its_rows(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    done = do(path, "--velocity", "10", "--receive", "position", "--duration", "3", fault="loop-drop", loop_after=6)
    rows, about = kept(path)
    assert done.code == 5 and len(rows) >= 4 and about["closed"] and not about["complete"], done


def test_a_stop_that_failed_is_the_result(tmp_path: Path) -> None:
    """Also where all rows are in the file."""
    trace = tmp_path / "t.txt"
    words = ("--velocity", "10", "--receive", "position", "--count", "3")
    assert do(tmp_path / "a.csv", *words, "--trace", trace).code == 0
    lines = sum(piece.endswith(b"\r") for piece in sent(trace)[: sent(trace).index(b"1T\r") + 1])
    runs = [do(tmp_path / f"{n}.csv", *words, fault="refuse", after=n) for n in range(lines - 2, lines + 4)]
    codes = [done.code for done in runs if "leaving" in done.said]
    assert codes and set(codes) == {6}


@each_row(
    ("words", "words_of"),
    [
        (("--mark", "x"), "--log"),
        (("--mark-udp", "5005"), "--log"),
        (("--measure", "5", "--log", "{new}"), "--measure"),
        (("--control", "-", "--mark-stdin", "--log", "{new}"), "--mark-stdin"),
        (("--log", "{old}"), "exists"),
        (("--log", "{old}", "--init"), "exists"),
    ],
)
def test_what_is_refused_before_the_first_byte(words: tuple[str, ...], words_of: str, tmp_path: Path) -> None:
    (old := tmp_path / "old.csv").write_text("mine\n")
    given = [word.format(old=old, new=tmp_path / "new.csv") for word in words]
    with spying() as spy:
        result = run("barrett", "realtime", *given, "-p", fake(clock="virtual", initialized=1), "--json")
    assert result.code == 2 and spy.lines == [] and words_of in result.err and "--force" not in result.err, result
    assert old.read_text() == "mine\n" and not (tmp_path / "new.csv").exists()


def test_trials_and_the_library(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    for number in (1, 2):
        done = do(path, "--count", "3", "--append")
        assert (done.code, done.stream[0][0]["trial"]) == (0, number)
    with handctl.simulate("barrett", initialized=1) as hand:
        (rows,) = hand.realtime(log=str(tmp_path / "b.csv"), count=4, receive="position")
    assert rows[0]["rows"] == 4 == len(kept(tmp_path / "b.csv")[0])
