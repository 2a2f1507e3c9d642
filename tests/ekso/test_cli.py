"""`handctl ekso` on the simulator: rows, exit codes, the gates of `set` and `restore`, the exact frames on the wire."""

from __future__ import annotations

import json
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from handctl.command import terminal_prompts
from tests.support.cli import Result, run, sent
from tests.support.each_row import each_row

ME = ("--yes", "--operator", "me")
KEYS = ["name", "word", "id", "value", "raw", "unit", "label", "path"]
VECTORS = [1700, 1600, 1550, 200, 90, 50, 500, 300, -75, 125, 2, 1, 3, 0, 10, 12, 2, 3, 4, 7, 1, 2]
IDS = [*range(200, 210), 212, 210, 213, 215, 216, 218, 217, 219, None, None, 211, 214]


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The audit log goes to the test's own directory."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def unit(**options: object) -> str:
    """A simulated unit on virtual time; names may use _ for -."""
    said = {"clock": "virtual", "preset": "vectors", **options}
    return "fake://ekso?" + "&".join(f"{k.replace('_', '-')}={v}" for k, v in said.items())


def do(*args: str | Path, port: str | None = None, **more: Any) -> Result:
    return run("ekso", *args, "-p", port or unit(), "--json", **more)


def audit(folder: Path) -> list[dict[str, Any]]:
    path = folder / "handctl" / "ekso-audit.jsonl"
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []


def commands(trace: Path) -> list[int]:
    return [data[0] for data in sent(trace)]


# -- reading ----------------------------------------------------------------------------------------------------------


def test_settings_are_22_rows_in_the_order_of_the_words() -> None:
    result = do("settings")
    rows = result.rows
    assert result.code == 0
    assert [list(row) for row in rows] == [KEYS] * 22
    assert [row["raw"] for row in rows] == VECTORS
    assert [row["id"] for row in rows] == IDS
    assert [row["word"] for row in rows] == list(range(22))
    assert rows[8] == {
        "name": "forward_shift",
        "word": 8,
        "id": 208,
        "value": -0.75,
        "raw": -75,
        "unit": None,
        "label": None,
        "path": "forward_shift",
    }
    assert rows[14]["label"] == "50 %"
    assert result.json["device"] == {"kind": "ekso", "link": unit(), "fake": True, "id": None, "model": "EksoNR"}
    assert result.json["counters"] == {"sent": 1, "received": 1, "retries": 0, "bad_frames": 0, "stray_bytes": 0}


@pytest.mark.parametrize(("command", "count"), [("data", 27), ("feedback", 17), ("dump", 68), ("time", 1), ("date", 1)])
def test_how_many_rows(command: str, count: int) -> None:
    result = do(command)
    assert (result.code, len(result.rows)) == (0, count)
    assert all(list(row)[:7] == KEYS[:7] and row["path"] for row in result.rows)


def test_data_feedback_time_and_date_of_the_vectors() -> None:
    data = {row["name"]: row["value"] for row in do("data").rows}
    assert [data[name] for name in ("torso_pitch", "torso_roll", "right_heel_pressure", "right_hip_x", "left_hip_y")] == [
        4.5, -0.75, 610, -4.9, 36.22,
    ]  # fmt: skip
    feedback = [row["value"] for row in do("feedback").rows]
    assert feedback[:15] == [312, 1240, 655, 42.5, 30, 45, 31.5, 60, 70, 62, 71, 15.2, 15.6, 0.9, 0.9]
    for body in (3, 4):
        assert do("time", port=unit(time_body=body)).rows[0]["value"] == "14:05:37"
        assert do("date", port=unit(time_body=body)).rows[0]["value"] == "2026-11-20"
    assert run("ekso", "time", "-p", unit(), "--format", "plain").out == "14:05:37\n"


def test_get_by_name_alias_and_parameter_id() -> None:
    result = do("get", "Step Length", "217", "Right Hip X Position", "walk", "MinGain, left")
    assert [(row["name"], row["value"]) for row in result.rows] == [
        ("step_length", 15.5), ("left_stance_support", 2), ("right_hip_x", -4.9), ("walk_mode", 2),
        ("left_max_forward_assist", 42.5),
    ]  # fmt: skip
    assert run("ekso", "get", "forward_shift", "-p", unit(), "--format", "plain").out == "-0.75\n"
    assert do("get", "nonsense").code == 2
    assert do("get", "199").error["code"] == "unknown-name"


def test_tables_fit_80_columns() -> None:
    for command in ("settings", "data", "feedback", "dump", "status", "time", "date"):
        for posture in ("standing", "rising", "walking"):
            result = run("ekso", command, "-p", unit(preset="clinic", posture=posture))
            assert result.code == 0
            assert max(map(len, result.lines)) <= 80, command
            assert "(simulated)" in result.out
    assert "step_length           202  15.50  in" in run("ekso", "settings", "-p", unit()).out


def test_status_and_check() -> None:
    assert do("status", "--check").code == 0
    for fault in ("hip-offset", "frozen-clock", "clock-jump"):
        result = do("status", "--check", port=unit(fault=fault))
        assert (result.code, result.error["code"]) == (7, "unhealthy")
        assert do("status", port=unit(fault=fault)).code == 0
    walking = do("status", port=unit(posture="walking"))
    assert next(row for row in walking.rows if row["name"] == "state")["label"] == "unknown (0x4440)"
    unlisted = do("settings", port=unit(fault="unlisted-codes"))
    assert unlisted.code == 0
    assert all(row["label"].startswith("unknown (") for row in unlisted.rows[10:19])


def test_the_clock_is_compared_with_the_link_s() -> None:
    """So a replay tells what was so then, and two runs in virtual time tell the same."""
    here = datetime.fromisoformat("2026-11-20T14:05:37") - timedelta(seconds=90)
    port = unit(clock=f"virtual@{here.timestamp():.0f}")
    assert do("status", port=port).values["clock_offset"] in (89, 90)  # what was asked before took a little time
    assert do("status", port=port).values == do("status", port=port).values


def test_watch() -> None:
    rows, end = do("watch", "torso_pitch", "step_length", "--count", "3").stream
    assert [row["name"] for row in rows] == ["torso_pitch", "step_length"] * 3
    assert end["stream"]["samples"] == 3
    rows, _ = do("watch", "--count", "1").stream
    assert len(rows) == 15


def test_describe_needs_no_device() -> None:
    result = run("ekso", "describe", "--json")
    assert (result.code, len(result.rows)) == (0, 66)
    rows = {row["name"]: row for row in result.rows}
    assert (rows["step_length"]["id"], rows["step_length"]["type"], rows["step_length"]["range"]) == (
        202,
        "u16/100",
        "0..655.35",
    )
    assert rows["upper_leg_length"]["policy"] == "0.50 in at once, only while sitting"
    assert rows["injury_mode"]["policy"] == "only while sitting, 2Free asked twice"
    assert rows["left_swing_assist"]["policy"] == "10 % at once, Adapt and Max asked twice"
    assert rows["swing_complete"]["access"] == "r"
    assert rows["forward_shift"]["access"] == "rw"


# -- set --------------------------------------------------------------------------------------------------------------


def test_set_writes_once_reads_back_and_logs(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = do("set", "step_length=16", *ME, "--trace", trace)
    assert result.code == 0
    (row,) = result.rows
    assert row == {
        "name": "step_length", "word": 2, "id": 202, "value": 16.0, "raw": 1600, "unit": "in", "label": None,
        "path": "step_length", "before": 15.5, "before_label": None, "changed": True,
    }  # fmt: skip
    assert commands(trace) == [152, 153, 153, 152, 153, 153, 155, 152]
    assert sent(trace)[6][4:8] == bytes.fromhex("00 CA 06 40")
    assert "Set step_length 15.50 in -> 16.00 in" in result.err
    intent, done = audit(tmp_path)
    assert (intent["event"], intent["operator"], intent["frame"]) == ("intent", "me", sent(trace)[6].hex(" ").upper())
    assert (done["event"], done["verdict"], done["simulated"]) == ("result", "applied", True)


@pytest.mark.parametrize(
    ("setting", "typed", "code"),
    [
        ("step_length=16", "16.00\n", 0), ("step_length=16", "16\n", 0), ("step_length=16", "16.0\n", 0),
        ("step_length=16", "17\n", 8), ("step_length=16", "1600\n", 8), ("step_length=16", "16.01\n", 8), ("step_length=16", "y\n", 8), ("step_length=16", "", 8),
        ("right_stance_support=Full", "Full\nyes\n", 0), ("right_stance_support=Full", "Full\nno\n", 8),
        ("right_stance_support=High", "High\n", 0),
    ],
)  # fmt: skip
def test_a_person_types_the_new_value(
    setting: str, typed: str, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(terminal_prompts, "is_terminal", lambda _stream: True)
    trace = tmp_path / "t.txt"
    assert do("set", setting, "--trace", trace, stdin=typed).code == code
    assert commands(trace).count(155) == (code == 0)
    assert [entry["operator"] for entry in audit(tmp_path)] == [None, None] * (code == 0)


def test_set_in_words_on_screen() -> None:
    result = run("ekso", "set", "left_swing_assist=60 %", *ME, "-p", unit())
    assert result.code == 0
    assert result.lines[1].split() == ["left_swing_assist", "216", "50", "%", "60", "%"]


def test_what_is_there_already_is_not_written(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = do("set", "step_length=15.50", *ME, "--trace", trace)
    assert (result.code, result.codes(), commands(trace)) == (0, ["equal"], [152])
    assert audit(tmp_path) == []


@each_row(
    ("args", "code", "word"),
    [
        (("swing_complete=1", *ME), 2, "read-only"), (("pilot_id=1", *ME), 2, "read-only"), (("state=1", *ME), 2, "read-only"),
        (("swing_time=0.295", *ME), 2, "not-exact"), (("forward_shift=327.68", *ME), 2, "out-of-range"),
        (("216=50", *ME), 2, "ambiguous"), (("220=1", *ME), 2, "unknown-name"), (("step_length=16", "--yes"), 2, "no-operator"),
        (("step_length=16", "step_height=2.1", *ME), 2, "one-by-one"), (("step_length=17", *ME), 2, "step-limit"),
        (("upper_leg_length=18", "--override-step-limit", *ME), 2, "step-limit"), (("step_length=16",), 8, "not-confirmed"),
        (("walk_mode=First Step", *ME), 7, "not-still"), (("step_length=16", "--audit", "/dev/full", *ME), 1, "audit"),
    ],
)  # fmt: skip
def test_what_set_refuses(args: tuple[str, ...], code: int, word: str, tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = do("set", *args, "--trace", trace)
    assert (result.code, result.error["code"]) == (code, word)
    assert not trace.exists() or 155 not in commands(trace)


@pytest.mark.parametrize("posture", ["walking", "rising", "lowering"])
def test_a_moving_wearer_is_refused(posture: str, tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = do("set", "step_length=16", *ME, "--trace", trace, port=unit(posture=posture))
    assert (result.code, result.error["code"]) == (7, "not-still")
    assert 155 not in commands(trace)


FAULTS = {  # fault -> (exit code, code of the error, how many SetValue went out)
    "fidget&preset=clinic": (7, "not-still", 0), "unknown-state": (7, "not-still", 0), "frozen-clock": (7, "not-still", 0),
    "pendant": (7, "changed-meanwhile", 0), "stands-up": (6, "status-1", 1), "refuse": (6, "status-1", 1),
    "refuse&refuse-status=2": (6, "status-2", 1), "refuse&refuse-status=77": (6, "status-77", 1),
    "not-taken": (7, "read-back", 1), "neighbour": (7, "read-back", 1), "silent": (4, "no-answer", 0),
    "bad-checksum": (5, "bad-checksum", 0), "wrong-id": (5, "wrong-id", 0), "loopback": (5, "echo", 0),
    "truncate": (5, "cut-short", 0), "late": (5, "late", 0), "disconnect": (3, "lost", 0), "short-body": (5, "bad-length", 0),
    "wrong-command": (5, "wrong-command", 0), "acknowledge": (5, "echo", 0),
    "echo": (0, "", 1), "duplicate": (0, "", 1), "stale": (0, "", 1), "noise": (0, "", 1), "dribble": (0, "", 1),
    "unsolicited": (0, "", 1), "stray-zero": (0, "", 1), "slow": (0, "", 1), "set-unanswered": (0, "", 1),
    "acknowledge-set": (0, "", 1),
}  # fmt: skip


@each_row("fault", FAULTS)
def test_set_under_every_fault_sends_at_most_one(fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    trace = tmp_path / "t.txt"
    code, word, count = FAULTS[fault]
    wanted = "step_length=14" if "clinic" in fault else "step_length=16"
    name, _, preset = fault.partition("&preset=")
    port = unit(fault=name, preset=preset or "vectors")
    result = do("set", wanted, *ME, "--trace", trace, port=port)
    assert result.code == code
    assert word in result.codes() or not word
    assert commands(trace).count(155) == count
    assert [entry["event"] for entry in audit(tmp_path)] == ["intent", "result"] * count
    if fault in ("set-unanswered", "acknowledge-set"):
        assert "answer-lost" in result.codes()


@pytest.mark.parametrize(("baud", "code"), [(9600, 5), (115200, 0)])
def test_a_wrong_speed_is_named(baud: int, code: int) -> None:
    result = do("data", "--baud", str(baud), port=unit(fault="garble"))
    assert result.code == code
    if code:
        assert result.error["code"] == "garbage"
        assert "heck the baud rate" in result.error["hint"]


def test_dry_runs_print_the_exact_frame_and_open_nothing() -> None:
    result = run("ekso", "set", "forward_shift=-0.75", "-n", "--json")
    assert (result.code, result.rows[0]["bytes"], result.json["counters"]["sent"]) == (
        0,
        "9B 04 00 01 00 D0 FF B5 DD 26",
        0,
    )
    assert run("ekso", "set", "swing_time=0.29", "-n", "--format", "plain").out == "9B 04 00 01 00 CC 00 1D DC 39\n"
    assert run("ekso", "cancel", "-n", "--format", "plain").out == "9C 02 00 01 01 00 8B D5\n"
    for args in (("cancel",), ("set", "swing_time=0.29")):
        unsure = run("ekso", *args, "-n", "--length-mode", "auto", "--json")
        assert (unsure.code, len(unsure.rows)) == (0, 1)
        assert "length-mode" in unsure.codes()
    assert run("ekso", "set", "swing_time=0.295", "-n").code == 2
    assert run("ekso", "data", "-n", "--fake").code == 2


@pytest.mark.parametrize("mode", ["n-4", "n-2", "frame"])
def test_length_conventions(mode: str) -> None:
    port = unit(length=mode)
    assert do("time", port=port, env={"HANDCTL_RETRIES": "0"}).code == 4
    for args in (("--length-mode", mode), ("--length-mode", "auto")):
        result = do("set", "step_length=16", *ME, *args, port=port)
        assert result.code == 0
        assert "length-convention" in result.codes()
    assert do("time", port=port, env={"HANDCTL_LENGTH_MODE": mode}).code == 0
    assert do("time", "--length-mode", "n-3").code == 2
    assert do("data", port=unit(answer_length=mode)).code == 0


def test_cancel(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = do("cancel", "--trace", trace)
    # GetTime first: nothing else was read of the device, and who is there is not known
    assert (result.code, result.rows[0]["label"], commands(trace)) == (0, "accepted", [150, 156])
    assert [entry["event"] for entry in audit(tmp_path)] == ["cancel", "cancel-result"]
    assert do("cancel", "--word", "0").code == 2
    for word in ("1", "0x0001", "0X1"):
        assert run("ekso", "cancel", "-n", "--word", word, "--format", "plain").out == "9C 02 00 01 00 01 A8 C5\n"
    for word in ("0x0", "0x10000", "0xyz", "65536", "-1"):
        assert do("cancel", "--word", word).code == 2
    assert "heck with `handctl ekso status`" in do("cancel", port=unit(fault="refuse")).error["hint"]
    assert do("cancel", "--audit", "/dev/full").codes() == ["audit"], "stopping does not depend on a disk"


# -- files ------------------------------------------------------------------------------------------------------------


def test_snapshot_diff_and_restore(tmp_path: Path) -> None:
    state, file, trace = tmp_path / "state", tmp_path / "s.json", tmp_path / "t.txt"
    port = unit(posture="sitting", state=state)
    assert do("snapshot", file, port=port).code == 0
    values = json.loads(file.read_text(encoding="utf-8"))["values"]
    assert len(values) == 20
    assert "pilot_id" not in values
    assert do("diff", file, port=port).code == 0
    for text in ("step_length=16.5", "walk_mode=ProStep+", "forward_shift=-1.25"):
        assert do("set", text, *ME, port=port).code == 0
    differing = do("diff", file, port=port)
    assert (differing.code, [row["name"] for row in differing.rows]) == (
        7,
        ["step_length", "forward_shift", "walk_mode"],
    )
    assert do("restore", file, port=port).code == 8
    assert do("restore", file, "--yes", port=port).error["code"] == "no-operator"
    stopped = do("restore", file, *ME, port=port + "&fault=neighbour&after=10")
    assert stopped.code == 7
    result = do("restore", file, *ME, "--trace", trace, port=port)
    assert result.code == 0
    assert commands(trace).count(155) == len(result.rows)
    assert do("diff", file, port=port).code == 0
    assert do("restore", file, *ME, port=port).codes().count("equal") == 1


def test_restore_keeps_to_the_policy(tmp_path: Path) -> None:
    state, file = tmp_path / "state", tmp_path / "s.json"
    port = unit(state=state)
    assert do("snapshot", file, port=port).code == 0
    assert do("set", "step_length=17.25", *ME, "--override-step-limit", port=port).code == 0
    assert do("restore", file, *ME, "--override-step-limit", port=port).code == 0
    moving = do("set", "target_sounds=Lateral", *ME, port=port)
    assert moving.code == 0
    assert do("restore", file, *ME, port=port + "&fault=frozen-clock").error["code"] == "not-still"
    plan = run("ekso", "restore", file, "-n", "--json")
    assert (plan.code, len(plan.rows)) == (0, 20)


def test_a_snapshot_with_a_code_that_nobody_knows_can_be_restored_around_it(tmp_path: Path) -> None:
    state, file = tmp_path / "state", tmp_path / "s.json"
    odd = unit(state=state, fault="unlisted-codes")
    assert do("snapshot", file, port=odd).code == 0
    assert do("restore", file, *ME, port=odd).codes().count("equal") == 1
    refused = do("restore", file, *ME, port=unit(state=state))
    assert (refused.code, refused.error["code"]) == (2, "unlisted")
