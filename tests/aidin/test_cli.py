"""`handctl aidin` on the simulator: values, exit codes, confirmations, dry runs, links."""

from __future__ import annotations

import json
import socket
from collections import Counter
from pathlib import Path

import pytest

from handctl.link import tcp
from tests.support.cli import Result, Simulator, run, sent
from tests.support.each_row import each_row

FINGERS = ("thumb", "index", "middle", "ring", "little")
KEYS = {"motor_pos": 15, "joint_pos": 20, "task_space_pos": 15, "current_state": 15, "sensor_state": 30}
ROW = {"name", "key", "finger", "element", "value", "unit", "path"}
FIFTEEN = ["10", "5", "118", "-4", "5", "165", "0", "5", "165", "4", "5", "165", "8", "5", "165"]
JOINTS = (
    b'{"hand_mode":22,"hand_joint_cmd":[0.174533,0.087266,2.059489,2.059489,-0.069813,0.087266,2.879793,2.879793,'
    b"0.0,0.087266,2.879793,2.879793,0.069813,0.087266,2.879793,2.879793,0.139626,0.087266,2.879793,2.879793]}\n"
)


def fake(**options: object) -> str:
    return "fake://aidin?" + "&".join(["clock=virtual", *(f"{k.replace('_', '-')}={v}" for k, v in options.items())])


HOMED = fake(start="homed")


def aidin(*args: str | Path, link: str = HOMED) -> Result:
    return run("aidin", *args, "-p", link, "--json")


# -- reading ----------------------------------------------------------------------------------------------------------


@each_row("verb", ["status", "dump"])
@each_row("exchange", ["stream", "poll"])
def test_everything_by_finger(verb: str, exchange: str) -> None:
    result = aidin(verb, link=fake(start="homed", exchange=exchange))
    assert result.code == 0
    assert Counter(row["key"] for row in result.rows) == KEYS
    for key, count in KEYS.items():
        assert Counter(row["finger"] for row in result.rows if row["key"] == key) == dict.fromkeys(FINGERS, count // 5)
    assert all(set(row) - {"rad"} == ROW for row in result.rows)
    assert result.json["device"] == {"kind": "aidin", "link": fake(start="homed", exchange=exchange), "fake": True, "id": None, "model": "AIDIN-hand"}  # fmt: skip
    assert result.json["counters"]["sent"] == (0 if exchange == "stream" else 1)


def test_get_and_its_parts() -> None:
    assert [(row["finger"], row["element"]) for row in aidin("get", "joint_pos.index").rows] == [("index", f"q{n}") for n in (1, 2, 3, 4)]  # fmt: skip
    plain = run("aidin", "get", "motor_pos.ring.m2", "-p", HOMED, "--format", "plain")
    assert (plain.code, plain.out.strip().isdecimal()) == (0, True)
    assert aidin("get", "joint").code == 2
    assert aidin("get", "hand_mode").error["code"] == "write-only"


def test_what_get_prints_can_be_given_back() -> None:
    values = run("aidin", "get", "joint_pos", "-p", HOMED, "--format", "plain").lines
    assert len(values) == 20
    result = aidin("joints", *values)
    assert result.code == 0, result


def test_table_fits_80_columns() -> None:
    lines = run("aidin", "status", "-p", HOMED).lines
    assert max(map(len, lines)) <= 80
    assert len(lines) <= 22
    assert lines[0].split() == ["Thumb", "Index", "Middle", "Ring", "Little", "Unit"]
    assert [line.split()[0] for line in lines[1:11]] == ["m1", "m2", "m3", "q1", "q2", "q3", "q4", "x", "y", "z"]


def test_csv() -> None:
    header, *lines = run("aidin", "dump", "-p", HOMED, "--csv").out.split("\r\n")
    assert header == "name,finger,element,value,unit"
    assert len(lines) == 96


def test_status_check() -> None:
    assert aidin("status", "--check").code == 0
    result = aidin("status", "--check", link=fake(start="homed", fault="degrees"))
    assert (result.code, result.error["code"]) == (7, "unhealthy")


def test_describe_needs_no_device() -> None:
    result = run("aidin", "describe", "--json")
    assert result.code == 0
    names = [row["name"] for row in result.rows]
    assert names[:5] == list(KEYS) and len(names) == 11
    assert "82..154 (thumb), 115..175 (others)" in run("aidin", "describe", "joint_pos", "--json").rows[0]["range"]


def test_watch() -> None:
    rows, end = aidin("watch", "--count", "5", "--rate", "50").stream
    assert end["stream"]["samples"] == 5 and end["stream"]["rate_hz"] == pytest.approx(50, rel=0.05)
    assert Counter(row["key"] for row in rows) == {k: 5 * n for k, n in KEYS.items() if k != "task_space_pos"}
    assert {row["t"] for row in rows} == {row["t"] for row in rows if row["key"] == "joint_pos"}


# -- moving -----------------------------------------------------------------------------------------------------------


def test_home_then_joints_then_the_rest(tmp_path: Path) -> None:
    link = f"{fake(start='used', rate=20)}&state={tmp_path / 'hand'}"
    assert aidin("joints", "index.q3=160", "thumb.q1=20", link=link).error["code"] == "not-reached"
    home = aidin("home", "--yes", link=link)
    assert (home.error["code"], [row["value"] for row in home.rows]) == ("homing-unproven", [0] * 15)
    moved = aidin("joints", "index.q3=160", "thumb.q1=10", link=link)
    assert moved.code == 0, moved
    at = {f"{row['finger']}.{row['element']}": row for row in moved.rows}
    assert (at["index.q3"]["target"], at["thumb.q1"]["target"]) == (160, 10)
    assert abs(at["index.q3"]["value"] - 160) < 2 and abs(at["thumb.q1"]["value"] - 10) < 2
    assert abs(at["ring.q3"]["value"] - 175) < 2
    assert aidin("encoders", "little.m3=50000", link=link).code == 0
    assert aidin("fingertips", "middle.z=120", "thumb.y=60", link=link).code == 0
    assert aidin("bias", link=link).code == 0
    assert aidin("initial", "--yes", link=link).code == 0
    assert aidin("stop", link=link).code == 0


@each_row("args", [("home",), ("initial",), ("max-torque", "0"), ("max-torque", "800"), ("currents", "index.m1=50")])
def test_what_asks(args: tuple[str, ...], tmp_path: Path) -> None:
    result = aidin(*args, "--trace", tmp_path / "t.txt")
    assert (result.code, result.error["code"]) == (8, "not-confirmed")
    assert not (tmp_path / "t.txt").exists()


@pytest.mark.parametrize("args", [("stop",), ("bias",), ("joints", "index.q3=160"), ("encoders", "index.m3=50000"), ("fingertips", "index.z=120")])  # fmt: skip
def test_what_does_not_ask(args: tuple[str, ...]) -> None:
    assert aidin(*args).code == 0


def test_currents() -> None:
    result = aidin("currents", *["0"] * 5, "100", *["0"] * 9, "--yes", "--duration", "0.5")
    assert result.code == 0, result
    assert [row["target"] for row in result.rows if row["target"]] == [100]
    assert aidin("currents", "index.m3=301", "--yes").code == 2
    assert aidin("currents", "index.m3=301", "--cap", "400", "-n").code == 0
    assert aidin("currents", *["0"] * 15, "--yes").code == 2


def test_max_torque_below_the_recommended_range_warns() -> None:
    assert "low-torque" in aidin("max-torque", "699").codes()
    assert "low-torque" not in aidin("max-torque", "700").codes()
    for wrong in ("1001", "-1", "5.5", "x"):
        assert aidin("max-torque", wrong).code == 2


# -- refusals: nothing is sent -----------------------------------------------------------------------------------------

REFUSED = [
    (["joints", *["0"] * 20], "115..175"), (["joints", "0", "0", "0"], "q3=VALUE"),
    (["joints", "index.q3=60"], "115..175"), (["joints", *FIFTEEN, "--rad"], "leave --rad out"),
    (["joints", "thumb.q3=60", "--rad"], "82..154"), (["joints", "-20", *FIFTEEN[1:]], "-13..45"),
    (["joints", *FIFTEEN[:-1], "--rda"], "Nothing was sent."), (["encoders", *["-1"] * 15], "0..280000"),
    (["fingertips", *["0"] * 15], "45.5..115.7"), (["joints", "pinky.q3=160"], "index"),
]  # fmt: skip


@each_row(("args", "hint"), REFUSED)
def test_refused_with_the_range(args: list[str], hint: str, tmp_path: Path) -> None:
    result = aidin(*args, "--trace", tmp_path / "t.txt")
    assert result.code == 2, result
    assert hint in result.error["hint"], result.error
    assert not (tmp_path / "t.txt").exists()


def test_out_of_range_on_the_terminal_too() -> None:
    result = run("aidin", "joints", *["0"] * 20, "--fake")
    assert result.code == 2
    assert result.out == ""
    assert "q3 82..154 (thumb), 115..175 (others)" in result.err


@each_row("verb", ["set", "snapshot", "diff", "restore"])
def test_the_device_has_nothing_to_store(verb: str) -> None:
    assert run("aidin", verb, "x", "--fake").code == 2


# -- dry runs ---------------------------------------------------------------------------------------------------------

DRY = [
    (["home"], [b'{"hand_mode":1}\n']), (["initial"], [b'{"hand_mode":2}\n']), (["stop"], [b'{"hand_mode":3}\n']),
    (["bias"], [b'{"hand_mode":4}\n']), (["max-torque", "800"], [b'{"hand_mode":5,"maxtorque":800}\n']),
    (["joints", *FIFTEEN], [JOINTS]),
    (["currents", *["100", "-100", "50"] * 5], [
        b'{"hand_mode":5,"maxtorque":1000}\n',
        b'{"hand_mode":41,"hand_TT_cmd":[100,-100,50,100,-100,50,100,-100,50,100,-100,50,100,-100,50]}\n',
        b'{"hand_mode":3}\n']),
]  # fmt: skip


@each_row(("args", "data"), DRY, ids=lambda value: value[0] if isinstance(value[0], str) else "")
def test_a_dry_run_shows_the_bytes_and_needs_no_link(args: list[str], data: list[bytes]) -> None:
    result = run("aidin", *args, "--dry-run", "--json")
    assert result.code == 0, result
    assert [bytes.fromhex(row["bytes"]) for row in result.rows] == data


def test_a_dry_run_of_pairs_only_listens(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = aidin("joints", "index.q3=160", "-n", "--trace", trace)
    (row,) = result.rows
    angles = json.loads(bytes.fromhex(row["bytes"]))["hand_joint_cmd"]
    assert angles[6] == angles[7] == 2.792527 and len(angles) == 20
    assert sent(trace) == []
    silent = aidin("joints", "index.q3=160", "-n", "--trace", trace, link=fake(exchange="poll"))
    assert (silent.code, sent(trace)) == (4, [])


def test_what_is_sent_is_what_the_dry_run_showed(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    assert aidin("joints", *FIFTEEN, "--trace", trace).code == 0
    assert sent(trace)[-1] == JOINTS


# -- links ------------------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_a_refused_connection() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        result = aidin("status", link=f"tcp://127.0.0.1:{free.getsockname()[1]}")
    assert (result.code, result.error["code"]) == (3, "refused")


@pytest.mark.real
def test_a_silent_server() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        result = aidin("status", "--timeout", "0.1", link=f"tcp://127.0.0.1:{server.getsockname()[1]}")
    assert (result.code, result.error["code"]) == (4, "no-answer")
    assert "empty object" in result.error["text"]


def test_the_port_is_8000_when_none_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def refuse(_socket: socket.socket, address: tuple[str, int], _seconds: float) -> None:
        asked.append(address)
        raise ConnectionRefusedError

    monkeypatch.setattr(tcp, "connect", refuse)
    assert aidin("status", link="tcp://192.0.2.7").code == 3
    assert aidin("status", link="tcp://192.0.2.7:8001").code == 3
    assert asked == [("192.0.2.7", 8000), ("192.0.2.7", 8001)]


@pytest.mark.real
def test_served() -> None:
    with Simulator("--tcp", "127.0.0.1:0", "--set", "start=open", kind="aidin") as simulator:
        status = aidin("status", link=simulator.link)
        assert (status.code, len(status.rows), status.json["device"]["fake"]) == (0, 95, False)
        assert aidin("joints", "index.q3=171", link=simulator.link).code == 0
        rows, end = aidin("watch", "--count", "5", "--rate", "0", link=simulator.link).stream
        assert end["stream"]["samples"] == 5 and len(rows) == 5 * 80


# -- tables for people ------------------------------------------------------------------------------------------------


def lines_of(*args: str, link: str) -> dict[str, list[str]]:
    """The lines of a table by their first word."""
    out = run("aidin", *args, "-p", link).out
    return {line.split()[0]: line.split()[1:] for line in out.splitlines() if line.strip()}


def test_a_target_that_was_missed_stands_beside_the_value() -> None:
    result = run("aidin", "joints", "index.q3=130", "-p", fake(start="homed", fault="blocked"))
    assert result.code == 7 and "≠ 130.0" in result.out, result
    assert "≠ target not reached" in result.out


def test_what_could_not_be_read_is_a_question_mark_with_its_reason() -> None:
    lines = lines_of("get", "motor_pos", "current_state", link=fake(fault="missing-key"))
    assert lines["current"] == ["m3", "?", "?", "?", "?", "?", "raw"]
    result = run("aidin", "get", "motor_pos", "current_state", "-p", fake(fault="missing-key"))
    assert result.code == 5 and "current_state: the hand does not send it" in result.out


def test_a_key_that_the_hand_does_not_send_is_left_out_of_status() -> None:
    result = run("aidin", "status", "-p", fake(fault="missing-key"), "--json")
    assert result.code == 0 and "not-on-this-firmware" in result.said, result
    assert {row["name"] for row in result.rows} == {"motor_pos", "joint_pos", "task_space_pos", "sensor_state"}


def test_what_is_out_of_range_has_a_star() -> None:
    lines = lines_of("status", link=fake(fault="degrees"))
    assert all(value.endswith("*") for value in lines["q3"][:5]) and not lines["m1"][0].endswith("*")
    assert lines["*"] == ["out", "of", "its", "documented", "range"]


CURRENTS_ON = '{"hand_mode":41,"hand_TT_cmd":[100,0,0,0,0,0,0,0,0,0,0,0,0,0,0]}'


@each_row(
    "name, lines, level",
    lambda: [
        ("currents", [CURRENTS_ON], "warning"),
        ("currents, and a request", [CURRENTS_ON, "{}"], "warning"),
        ("a target, then the maximum torque", ['{"hand_mode":2}', '{"hand_mode":5,"maxtorque":700}'], "info"),
        ("currents, then a stop", [CURRENTS_ON, '{"hand_mode":3}'], None),
        ("a mode that is none", ['{"hand_mode":[1]}'], None),
        ("a request", ["{}"], None),
    ],
)
def test_a_terminal_tells_what_goes_on_behind_its_end(name: str, lines: list[str], level: str | None) -> None:
    result = aidin("terminal", *lines, "--yes", link=fake(start="homed", rate=20))
    found = [message for message in result.json["messages"] if message["code"] == "left"]
    assert [message["level"] for message in found] == ([level] if level else []), name
    assert all(message["hint"] for message in found)
