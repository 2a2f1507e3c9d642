"""`handctl barrett` on the simulator: values, exit codes, movements, GCL, traces."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from handctl.devices.barrett.parameter_map import BARRETT
from handctl.link.fake import FakeLink
from handctl.link.transcript import parse
from tests.barrett.commands import (
    COMMANDS,
    MOTORS,
    OFFLINE,
    POWER_ON,
    READING,
    SETTINGS,
    Command,
    fake,
    key_of,
    motors_of,
    power_on,
    prepare,
    sent_lines,
    values_of,
    written_lines,
)
from tests.support.cli import ENVELOPE_KEYS, Result, check_schema, run
from tests.support.each_row import each_row

CLEAN = {"sent": 0, "received": 0, "retries": 0, "bad_frames": 0, "stray_bytes": 0}


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    prepare(tmp_path)
    return tmp_path


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The journal of saves goes to the test's own directory."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def ids(command: Command) -> str:
    return command.name


def do(*args: str | Path, port: str | None = None, **more: Any) -> Result:
    return run("barrett", *args, "-p", port or fake(), "--json", **more)


# -- reading ----------------------------------------------------------------------------------------------------------


def test_dump_is_every_parameter_by_motor_against_its_default() -> None:
    result = do("dump")
    envelope = result.json
    assert [key for key in envelope if key in ENVELOPE_KEYS] == ENVELOPE_KEYS
    assert (result.code, envelope["schema"], envelope["command"]) == (0, "handctl/1", "barrett dump")
    expected = {
        (m, motor): (name, value, unit, value if m in SETTINGS else None)
        for m, (name, unit, values) in POWER_ON.items()
        for motor, value in zip(motors_of(m), values, strict=True)
    }
    got = {
        (row["parameter"], row["motor"]): (row["name"], row["value"], row["unit"], row["default"])
        for row in result.rows
    }
    assert got == expected
    assert len(result.rows) == 35 * 4 + 8
    device = {"kind": "barrett", "link": fake(), "fake": True, "id": None, "model": "BH8"}
    assert envelope["device"] == device


def test_dump_is_four_round_trips(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    assert do("dump", "--trace", trace).json["counters"] == {**CLEAN, "sent": 5, "received": 5}
    *lines, last = sent_lines(trace)
    assert [line.split()[0] for line in lines] == ["FGET", "FGET", "FGET", "PGET"] and last == "VERS"
    assert all(len(line) <= 70 and len(line.split()) <= 19 for line in lines)  # dossier 1.4
    assert sorted(" ".join(lines).split()) == sorted(["FGET"] * 3 + ["PGET", *POWER_ON])


@pytest.mark.parametrize("command", READING, ids=ids)
def test_reading(scratch: Path, command: Command) -> None:
    trace = scratch / "t.txt"
    result = run("barrett", *command.words(scratch), "-p", fake(), "--json", "--trace", trace)
    assert (result.code, result.err) == (0, ""), result
    rows = result.stream[0] if command.kind == "stream" else result.rows
    assert {key: row["value"] for row in rows if (key := key_of(row))} == command.shows(power_on())
    assert written_lines(trace) == [] and sent_lines(trace)


@each_row("firmware", ["4.33", "4.34", "4.4"])
@each_row("more", [{}, {"prompt": "bare"}, {"line_end": "crlf"}, {"texts": "prose"}, {"baud": 1200}])
def test_every_kind_of_hand(firmware: str, more: dict[str, object]) -> None:
    port = fake(firmware=firmware, **more)
    got = values_of(do("dump", port=port))
    assert power_on()["UPSECS", None] <= got.pop(("UPSECS", None)) <= power_on()["UPSECS", None] + 10
    expected = {**power_on(), ("BAUD", None): int(str(more.get("baud", 9600))) // 100}
    assert got == {key: value for key, value in expected.items() if key[0] != "UPSECS"}
    version = do("version", port=port)
    assert firmware in version.rows[0]["value"]
    result = do("get", "BD", "BDAT", "P", port=port)
    if firmware == "4.33":  # ERR 64 of one name does not spoil the others
        assert result.code == 6
        assert [row["parameter"] for row in result.rows if "error" in row] == ["BD"] * 4 + ["BDAT"] * 4
        assert [row["value"] for row in result.rows if row["parameter"] == "P"] == [0] * 4
    else:
        assert result.code == 0
        assert [row["value"] for row in result.rows] == [0] * 4 + [1500] * 4 + [0] * 4


@pytest.mark.parametrize("name", ["P", "p", "position", "P.F2", "P.2", "p.f2", "SG.S", "SG.SPREAD", "SG.4"])
def test_names_in_any_spelling(name: str) -> None:
    result = do("get", name)
    assert result.code == 0
    parts = name.upper().partition(".")
    expected = MOTORS if not parts[1] else ("F2",) if parts[2] in ("F2", "2") else ("SPREAD",)
    assert tuple(row["motor"] for row in result.rows) == expected


def test_plain_and_csv() -> None:
    assert run("barrett", "get", "TEMP", "SG", "--fake", "--format", "plain").out == "412\n112\n119\n126\n255\n"
    lines = run("barrett", "get", "OTEMP", "P.F1", "-p", fake(), "--csv").lines
    assert lines[0].split(",")[:5] == ["name", "parameter", "motor", "value", "unit"]
    assert lines[1].startswith("over_temperature_limit,OTEMP,,0,0.1 °C")
    assert lines[2].startswith("position,P,F1,0,cts")


def test_status_of_a_hand_that_waits_for_init() -> None:
    """Nothing moves before HI: a check fails, and names the next step once for all motors."""
    result = do("status", "--check", port=fake(initialized=0))
    assert (result.code, result.error["code"]) == (7, "unhealthy")
    assert "handctl barrett init" in result.error["hint"]
    assert result.codes().count("unhealthy") == 2  # the warning, and the check that failed
    labels = [row["label"] for row in result.rows if row["parameter"] == "S"]
    assert labels == ["Motor not initialized (4)"] * 4
    assert {row["parameter"]: row["label"] for row in result.rows}["TEMP"] == "41.2 °C"
    firmware = [row["value"] for row in result.rows if row["parameter"] == "VERS"]
    assert firmware == ["4.33"]


@pytest.mark.parametrize(("ram_lines", "word"), [(["2FSET EN 0"], "F2"), (["PSET OTEMP 300"], "30.0")])
def test_status_check_names_what_makes_a_finger_seem_dead(tmp_path: Path, ram_lines: list[str], word: str) -> None:
    port = fake(state=tmp_path / "state.json")
    assert do("gcl", *ram_lines, port=port).code == 0
    if word == "30.0":  # FGET fails too above OTEMP (8192)
        assert do("status", "--check", port=port).code == 6
        return
    result = do("status", "--check", port=port)
    assert (result.code, result.error["code"]) == (7, "unhealthy")
    assert word in result.error["text"]


@pytest.mark.parametrize("command", OFFLINE, ids=ids)
def test_without_a_device(command: Command, tmp_path: Path) -> None:
    result = run("barrett", *command.args, "--json")
    assert result.code == 0 and result.rows
    assert result.json["counters"] == CLEAN


def test_describe_is_the_map() -> None:
    rows = {row["parameter"]: row for row in run("barrett", "describe", "--json").rows}
    assert set(rows) == set(POWER_ON) | {"VERS"} | {"BD", "BP", "BS", "BDAT"} | {"LCT", "LFBP", "LFAIN"}
    for mnemonic, (name, unit, values) in POWER_ON.items():
        row = rows[mnemonic]
        assert (row["name"], row["unit"]) == (name, unit)
        assert (row["access"] == "r") is (mnemonic not in SETTINGS)
        expected = (values[0], values[3] if len(values) == 4 else None) if mnemonic in SETTINGS else (None, None)
        assert (row["default_finger"], row["default_spread"]) == expected
        assert row["source"].startswith("barrett §5.")
    assert [m for m, row in rows.items() if row["advanced"]] == [
        "ACCEL", "CT", "EN", "FDZ", "FIP", "FPG", "HOLD", "IHIT", "IOFF", "IVEL", "MPE", "OT", "SAMPLE", "SGFLIP",
        "TSTOP", "LFDPD",
    ]  # fmt: skip
    assert rows["MCV"]["range"] == "16..4080"


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("20", {4: "Motor not initialized (4)", 16: "Couldn't reach position (16)"}),
        ("8196", {4: "Motor not initialized (4)", 8192: "Overtemperature fault tripped (8192)"}),
        ("8", {8: "(not used) (8)"}),
        ("32768", {32768: "unknown (32768)"}),
        ("0", {0: "ready"}),
    ],
)
def test_error_sums(code: str, expected: dict[int, str]) -> None:
    rows = run("barrett", "errors", code, "--json").rows
    assert {row["code"]: row["meaning"] for row in rows} == expected


def test_all_errors() -> None:
    rows = run("barrett", "errors", "--json").rows
    assert sum(row["code"] for row in rows) == 32247  # dossier 4
    assert all(row["next"] for row in rows)
    assert run("barrett", "errors", "-1").code == 2


def test_help_is_the_hands_own_beside_the_manuals() -> None:
    (row,) = do("help", "m").rows
    assert (row["command"], row["lines"]) == ("?M", ["M Move"])
    assert "[0..20000]" in row["manual"] and "§5.2.1" in row["manual"]
    (row,) = do("help").rows
    assert "HI Hand Initialize" in row["lines"] and "FSAVE" in row["manual"]
    assert do("help", "FOO").code == 2
    for name in ("IVEL", "ivel", "init_velocity"):  # what ?IVEL answers
        (row,) = do("help", name).rows
        assert row["command"] == "?IVEL" and "16..4080" in row["manual"]


# -- moving -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("args", [("open",), ("close",), ("move", "1"), ("home",), ("torque-open",), ("step-open",)])
def test_motion_before_init_says_what_to_run(args: tuple[str, ...]) -> None:
    result = do(*args, port=fake(initialized=0))
    assert (result.code, result.error["code"]) == (6, "err-4")
    assert result.error["code"] == "err-4"


@pytest.mark.parametrize("value", ["-1", "20001", "1.5", "x"])
@pytest.mark.parametrize("verb", ["move", "step-open", "step-close"])
def test_arguments_of_movements(tmp_path: Path, verb: str, value: str) -> None:
    trace = tmp_path / "t.txt"
    result = do(verb, "--trace", trace, "--", value)
    assert result.code == 2 and (not trace.exists() or sent_lines(trace) == [])


def test_how_movements_end(tmp_path: Path) -> None:
    """§5.5: reached, stalled on something (no error after C, 16 after M), strain limit, per motor."""
    assert [row["ended"] for row in do("close").rows] == ["reached"] * 4
    stalled = do("close", port=fake(fault="obstacle"))
    assert stalled.code == 7 and ["reached" in row["ended"] for row in stalled.rows] == [False] * 3 + [True]
    assert all("short" in row["ended"] for row in stalled.rows[:3])
    refused = do("move", "17000", "--motors", "1", port=fake(fault="obstacle"))
    assert do("close", "--expect", "contact", port=fake(fault="obstacle")).code == 0
    assert (refused.code, refused.error["code"]) == (7, "not-reached") and "short" in refused.rows[0]["ended"]
    port = fake(state=tmp_path / "state.json", fault="obstacle")
    assert do("set", "HSG.F1=150", port=port).code == 0
    strained = do("close", "--motors", "1", port=port)
    assert strained.code == 7 and "strain limit" in strained.rows[0]["ended"]
    assert strained.rows[0]["strain"] > 150
    keys = ("name", "parameter", "motor", "unit", "target")
    assert [strained.rows[0][key] for key in keys] == ["position", "P", "F1", "cts", 17000]


def test_stop_works_before_init_too() -> None:
    result = do("stop", port=fake(initialized=0))
    assert result.code == 0 and "4" in json.dumps(result.json["messages"])


# -- gcl --------------------------------------------------------------------------------------------------------------

EXAMPLE = ("HI", "12M 5000", "FGET P", "ERR 3", "FOO")


def test_gcl_as_arguments() -> None:
    result = do("gcl", *EXAMPLE, "VERS")
    assert (result.code, result.error["code"]) == (6, "err-32")
    assert "Unknown command (32)" in result.error["text"]
    assert [(row["command"], row["lines"], row["status"]) for row in result.rows] == [
        ("HI", [], 0), ("12M 5000", [], 0), ("FGET P", ["5000 5000 0 0"], 0),
        ("ERR 3", ["1 No motor board found", "2 No motor found"], 0), ("FOO", [], 32),
    ]  # fmt: skip
    text = run("barrett", "gcl", *EXAMPLE, "-p", fake())
    assert text.code == 6 and text.out.startswith("=> HI\n=> 12M 5000\n=> FGET P\n5000 5000 0 0\n=> ERR 3\n")
    assert "ERR 32: Unknown command (32)" in text.out


@pytest.mark.parametrize(
    ("args", "first"),
    [
        (("gcl", "FGET P", "VERS"), {"command": "FGET P", "text": "0 0 0 0", "status": "0"}),
        (("help", "HI"), {"command": "?HI", "text": "HI Hand Initialize", "status": "0"}),
        (("load", "-y"), {"command": "FLOAD", "text": "", "status": "0"}),
    ],
)
def test_passthrough_as_csv(args: tuple[str, ...], first: dict[str, str]) -> None:
    result = run("barrett", *args, "-p", fake(), "--csv")
    row = next(csv.DictReader(io.StringIO(result.out)))
    assert result.code == 0 and {key: row[key] for key in first} == first


def test_gcl_keeps_going() -> None:
    result = do("gcl", "FOO", "1PGET TEMP", "VERS", "--keep-going")
    assert (result.code, [row["status"] for row in result.rows]) == (6, [32, 4096, 0])
    assert "FOO" in result.error["text"]


def test_gcl_script_on_stdin() -> None:
    result = do("gcl", stdin="HI\n\n# half close\n12M 5000 # both\nFGET P S\n")
    assert result.code == 0
    assert [(row["command"], row["lines"]) for row in result.rows] == [
        ("HI", []), ("12M 5000", []), ("FGET P S", ["5000 5000 0 0", "0 0 0 0"]),
    ]  # fmt: skip
    stops = do("gcl", stdin="VERS\nFOO\nHI\n")
    assert (stops.code, [row["command"] for row in stops.rows]) == (6, ["VERS", "FOO"])
    assert do("gcl", stdin="\n# nothing\n").code == 2


def test_gcl_script_in_a_file(tmp_path: Path) -> None:
    """DELAY waits in handctl: the hand, which does not know it, gets the commands alone."""
    script, trace = tmp_path / "grip.gcl", tmp_path / "t.txt"
    script.write_bytes(b"\xef\xbb\xbfHI # first\r\n\r\ndelay 300\r\n12M 5000\r\nFGET P\r\n")
    result = do("gcl", "--file", script, "--trace", trace)
    assert (result.code, [(row["line"], row["command"]) for row in result.rows]) == (
        0, [(1, "HI"), (4, "12M 5000"), (5, "FGET P")],
    )  # fmt: skip
    assert result.rows[-1]["lines"] == ["5000 5000 0 0"]
    entries = [entry for entry in parse(trace.read_text(encoding="utf-8").splitlines()) if entry.mark == ">"]
    at = {bytes(entry.data): entry.time for entry in entries}
    assert at[b"12M 5000\r"] - at[b"HI\r"] >= 0.3
    assert not any(b"DELAY" in data.upper() for data in at)
    planned = do("gcl", "--file", script, "--dry-run")
    assert planned.code == 0 and len(planned.rows) == 3 and "delays" in [m["code"] for m in planned.json["messages"]]


def test_gcl_script_stops_at_the_refused_line(tmp_path: Path) -> None:
    script = tmp_path / "grip.gcl"
    script.write_text("VERS\n# none\nFOO\nHI\n", encoding="utf-8")
    result = do("gcl", "--file", script)
    assert (result.code, [row["line"] for row in result.rows]) == (6, [1, 3])
    assert result.error["code"] == "err-32" and result.error["text"].startswith("Line 3: ")


@pytest.mark.parametrize(
    "lines", ["VERS\nDELAY", "DELAY 600001\nVERS", "VERS\nDELAY -1", "VERS\nDELAY 1 2", "VERS\nLOOP", "DELAY 5", ""]
)
def test_gcl_script_is_checked_before_anything_is_sent(tmp_path: Path, lines: str) -> None:
    script, trace = tmp_path / "grip.gcl", tmp_path / "t.txt"
    script.write_text(lines, encoding="utf-8")
    assert do("gcl", "--file", script, "--trace", trace).code == 2
    assert not trace.exists() or ">" not in trace.read_text(encoding="utf-8")


def test_gcl_script_that_cannot_be(tmp_path: Path) -> None:
    script = tmp_path / "grip.gcl"
    script.write_text("VERS\nDELAY 2000\nVERS\n", encoding="utf-8")
    assert do("gcl", "VERS", "--file", script).code == 2
    assert do("gcl", "--file", script, "--deadline", "1").code == 2
    assert do("gcl", "--file", script, "--deadline", "9").code == 0
    script.write_text("VERS\nDELAY 2000\nFSAVE\n", encoding="utf-8")
    assert do("gcl", "--file", script).code == 8


def test_ctrl_c_in_a_delay_stops_the_hand(tmp_path: Path) -> None:
    script, trace = tmp_path / "grip.gcl", tmp_path / "t.txt"
    script.write_text("VERS\nDELAY 5000\n1M 500\n", encoding="utf-8")
    sleep = FakeLink.sleep

    def pressed(self: FakeLink, seconds: float) -> None:
        if seconds == 5:
            raise KeyboardInterrupt
        sleep(self, seconds)

    with mock.patch.object(FakeLink, "sleep", pressed):
        result = do("gcl", "--file", script, "--trace", trace)
    assert result.code == 130 and "DELAY 5000" in result.error["text"]
    sent = b"".join(e.data for e in parse(trace.read_text(encoding="utf-8").splitlines()) if e.mark == ">")
    assert b"\x03" in sent and b"1M" not in sent


@pytest.mark.parametrize("text", ["LOOP", "12LOOP", "loop", "RESET", "PSET BAUD 384", "pset lft 1 baud 384", "VERS\rHI",
                                  "VERS\x03", "é"])  # fmt: skip
def test_gcl_refuses_what_would_lose_the_line(tmp_path: Path, text: str) -> None:
    trace = tmp_path / "t.txt"
    result = do("gcl", "VERS", text, "--trace", trace)
    assert (result.code, result.json["counters"]) == (2, CLEAN), result
    assert not trace.exists() or sent_lines(trace) == []


@pytest.mark.parametrize("text", ["FSAVE", "1FSAVE", "psave", "12sFSAVE"])
def test_gcl_saves_need_a_confirmation(tmp_path: Path, text: str) -> None:
    trace = tmp_path / "t.txt"
    for args, stdin in ((("gcl", "VERS", text), ""), (("gcl",), f"VERS\n{text}\n")):
        result = do(*args, "--trace", trace, stdin=stdin)
        assert result.code == 8 and (not trace.exists() or sent_lines(trace) == [])
    assert do("gcl", text, "--yes", "--trace", trace).code == 0
    assert [line.upper() for line in written_lines(trace)] == [text.upper()]


# -- trace, replay, envelope ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["status", "dump", "set", "close", "gcl-read", "baud", "reset"])
def test_a_trace_replays(scratch: Path, name: str) -> None:
    (command,) = [command for command in COMMANDS if command.name == name]
    trace, yes = scratch / "t.txt", ["--yes"] if command.asks else []
    first = do(*command.words(scratch), *yes, "--trace", trace)
    again = do(*command.words(scratch), *yes, port=f"replay:{trace}")
    assert (first.code, again.code, again.rows) == (0, 0, first.rows)


@pytest.mark.parametrize(("fault", "form"), [("healthy", "json"), ("over-temperature", "json"), ("silent", "ndjson")])
def test_every_command_is_valid(scratch: Path, fault: str, form: str) -> None:
    """json: one object with rows; ndjson: rows, then the envelope without them. Success and failure alike."""
    for command in COMMANDS:
        (scratch / "new.json").unlink(missing_ok=True)
        (scratch / "handctl" / "barrett-saves.json").unlink(missing_ok=True)
        yes = ["-y"] if command.asks else []
        result = run("barrett", *command.words(scratch), *yes, "-p", fake(fault=fault), "--format", form)
        if form == "ndjson" or command.kind == "stream":
            rows, envelope = result.stream
        else:
            rows, envelope = result.rows, result.json
            assert [key for key in envelope if key in ENVELOPE_KEYS] == ENVELOPE_KEYS
        check_schema(envelope)
        assert envelope["command"] == f"barrett {command.args[0]}"
        assert envelope["device"]["fake"] is True
        assert envelope["ok"] is (result.code == 0)
        errors = [message for message in envelope["messages"] if message["level"] == "error"]
        assert len(errors) == (0 if result.code == 0 else 1)
        for row in rows:
            assert all(not (isinstance(v, str) and "<" in v and " object" in v) for v in row.values()), row


# -- over-temperature, named ------------------------------------------------------------------------------------------

HEAT = [
    ("open",), ("get", "P"), ("dump",), ("set", "DP=5"), ("gcl", "GC"), ("realtime", "--count", "2"), ("init",), ("torque-close",),
    ("realtime", "--count", "2", "--velocity", "5"),
]  # fmt: skip


@pytest.mark.parametrize("words", HEAT, ids=" ".join)
def test_8192_at_a_sensible_temperature_is_named_as_the_setting(words: tuple[str, ...], tmp_path: Path) -> None:
    """`PSET OTEMP 60`, the manual's own example (§5.2.3), is 6.0 °C: nothing has to cool."""
    port = fake(state=tmp_path / "s.json", initialized=1)
    assert run("barrett", "gcl", "PSET OTEMP 60", "--force", "-p", port).code == 0
    result = run("barrett", *words, "-p", port, "--json")
    last = result.stream[1]["messages"][-1] if "realtime" in words else result.error
    assert result.code in (6, 7) and ("6.0 °C" in last["hint"] or "6.0 °C" in last["text"]), last
    assert "cool" not in last["hint"] or "correct OTEMP" in last["hint"], last


def test_8192_of_a_hot_hand_says_so(tmp_path: Path) -> None:
    result = do("open", port=fake(fault="over-temperature"))
    assert result.code == 6 and "70.2 °C" in result.error["hint"] and "cool" in result.error["hint"]


# -- later firmware -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("firmware", "further"), [
    ("4.33", set()), ("4.34", {"breakaway_stop", "breakaway_acceleration_threshold"}),
    ("4.4", {"breakaway_stop", "breakaway_acceleration_threshold", "loop_control_torque", "loop_feedback_breakaway_position", "loop_feedback_analog_input"}),
])  # fmt: skip
def test_a_snapshot_holds_what_this_firmware_has(firmware: str, further: set[str], tmp_path: Path) -> None:
    """BS BDAT LCT LFBP LFAIN were missing without a word: a difference in them was called equal."""
    port, file = fake(state=tmp_path / "s.json", firmware=firmware), tmp_path / "f.json"
    assert run("barrett", "snapshot", file, "-p", port).code == 0
    held = json.loads(file.read_text(encoding="utf-8"))["values"]
    later = {name.partition(".")[0] for name in held if BARRETT[name.partition(".")[0]].since}
    assert later == further and len(held) == 4 * (31 + len(further)) + 4
    assert run("barrett", "diff", file, "-p", port).code == 0
    if further:
        assert run("barrett", "set", "BDAT.F2=99", "-p", port).code == 0
        rows = run("barrett", "diff", file, "-p", port, "--json").rows
        assert [(row["name"], row["b"]) for row in rows] == [("breakaway_acceleration_threshold.F2", 99)]
        assert run("barrett", "restore", file, "--yes", "-p", port).code == 0
        assert run("barrett", "diff", file, "-p", port).code == 0
        old = fake(state=tmp_path / "old.json")
        assert run("barrett", "restore", file, "--yes", "-p", old).code == 6  # a hand that does not have them
