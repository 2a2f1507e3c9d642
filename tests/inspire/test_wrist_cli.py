"""`handctl wrist` on both wires: values, exit codes, the exact bytes of every writing command."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.inspire.wrist_commands import (
    LIVE,
    ON,
    POWER_ON,
    READING,
    SETTINGS,
    WIRES,
    WRITING,
    Command,
    link,
    memory_of,
    power_on_truth,
    prepare,
    sent_frames,
    written_frames,
)
from tests.support.cli import ENVELOPE_KEYS, run, s16, spying
from tests.support.each_row import each_row

CLEAN = {"sent": 0, "received": 0, "retries": 0, "bad_frames": 0, "stray_bytes": 0}


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    prepare(tmp_path)
    return tmp_path


def ids(command: Command) -> str:
    return command.name


both = pytest.mark.parametrize("wire", WIRES)


# -- values -----------------------------------------------------------------------------------------------------------


@both
def test_dump_is_exactly_the_11_documented_values(wire: str) -> None:
    result = run("wrist", "dump", "--fake", ON[wire], "--json")
    envelope = result.json
    assert [key for key in envelope if key in ENVELOPE_KEYS] == ENVELOPE_KEYS
    assert (result.code, envelope["schema"], envelope["command"]) == (0, "handctl/1", "wrist dump")
    expected = [(name, None, *POWER_ON[name]) for name in POWER_ON]
    keys = ("name", "finger", "address", "value", "raw", "unit")
    assert [tuple(row[key] for key in keys) for row in result.rows] == expected
    name = "fake://wrist" if wire == "serial" else "fake://wrist?bus=can"
    assert envelope["device"] == {"kind": "wrist", "link": name, "fake": True, "id": 1, "model": "wrist module"}


def test_dump_is_one_serial_read_or_three_can_reads(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    serial = run("wrist", "dump", "-p", link("serial"), "--json", "--trace", trace).json
    assert sent_frames(trace) == ["EB 90 01 04 30 FC 03 18 4C"]
    assert serial["counters"] == {**CLEAN, "sent": 1, "received": 1}
    memory = "A7 FE 65 04 6F 00 DE 00 00 00 00 00 1F 22 00 00 00 00 4C 04 D4 FE BC 02"
    assert serial["blocks"] == [{"address": 1020, "raw": memory}]
    can = run("wrist", "dump", "-p", link("can"), "--json", "--trace", trace).json
    assert len(sent_frames(trace)) == 3
    assert all(int(text.split()[0], 16) >> 26 == 4 for text in sent_frames(trace))
    assert can["counters"] == {**CLEAN, "sent": 3, "received": 3, "foreign_frames": 0}
    read: dict[int, str] = {}
    for block in can["blocks"]:
        read |= dict(enumerate(block["raw"].split(), block["address"]))
    assert read.items() <= dict(enumerate(memory.split(), 1020)).items()
    assert len(read) >= 18  # the documented bytes; gaps may be left out


@pytest.mark.parametrize("command", READING, ids=ids)
def test_both_wires_show_the_same(scratch: Path, command: Command) -> None:
    """Values, addresses and raw bytes; only what the wire itself is differs."""
    shown = []
    for wire in WIRES:
        (scratch / "new.json").unlink(missing_ok=True)
        result = run("wrist", *command.words(scratch, wire), "-p", link(wire), "--json")
        rows = result.stream[0] if command.kind == "stream" else result.rows
        own = (
            ("t", "baud", "link", "protocol", "flag", "raw", "suspicion", "meaning")
            if command.kind in ("scan", "raw")
            else ("t",)
        )
        shown.append([{key: value for key, value in row.items() if key not in own} for row in rows])
    assert shown[0] == shown[1]
    assert shown[0] or command.name == "diff"


@both
def test_plain_csv_and_table(wire: str) -> None:
    plain = run("wrist", "get", "pitch_actual", "yaw_set", "move_time", "--format", "plain", "-p", link(wire))
    assert [float(line) for line in plain.lines] == [-3.45, 11.0, 700.0]
    csv = run("wrist", "dump", "--csv", "-p", link(wire))
    assert csv.lines[0].split(",")[:2] == ["name", "finger"]
    assert len(csv.lines) == 12
    table = run("wrist", "dump", "-p", link(wire)).out
    for word in ("-3.45", "11.25", "11.00", "-3.00", "111", "222", "simulated"):
        assert word in table.replace("(", " ").replace(")", " ").split(), (word, table)


@both
def test_what_the_manual_leaves_open_stands_beside_it(wire: str) -> None:
    """Which actuator a current belongs to (W6), bit names (W5), the unit of temperatures (W7)."""
    for verb in ("dump", "status"):
        rows = {row["name"]: row for row in run("wrist", verb, "-p", link(wire, fault="faults"), "--json").rows}
        assert rows["current_1024"]["label"] == "actuator #2 by the register table, #1 by the CAN example"
        assert rows["current_1026"]["label"] == "actuator #1 by the register table, #2 by the CAN example"
        assert rows["error_1"]["label"] == "locked_rotor (bit names assumed from the hand)"
        assert "assumed" in rows["temperature_1"]["label"]
        text = " ".join(run("wrist", verb, "-p", link(wire)).out.split())
        assert "current_1024" in text and "#2 by the register table, #1 by the CAN example" in text


@both
def test_status_check(wire: str) -> None:
    assert run("wrist", "status", "--check", "-p", link(wire)).code == 0
    result = run("wrist", "status", "--check", "--json", "-p", link(wire, fault="faults"))
    assert (result.code, result.error["code"], len(result.rows)) == (7, "unhealthy", 11)
    assert "locked_rotor" in result.error["text"] and "over_current" in result.error["text"]
    assert run("wrist", "status", "-p", link(wire, fault="faults")).code == 0


def test_describe_is_the_map_and_needs_no_device() -> None:
    result = run("wrist", "describe", "--json")
    rows = {row["name"]: row for row in result.rows}
    assert {name: row["address"] for name, row in rows.items()} == {name: row[0] for name, row in POWER_ON.items()}
    assert [name for name, row in rows.items() if row["access"] == "rw"] == list(SETTINGS)
    assert [name for name, row in rows.items() if row["moves"]] == ["yaw_set", "pitch_set"]
    for name, low, high in (("pitch_set", -22.66, 22.12), ("yaw_set", -25.5, 25.5), ("pitch_actual", -22.66, 22.12)):
        assert [float(text) for text in rows[name]["range"].split("..")] == [low, high]
        assert rows[name]["unit"] == "°"
        assert "wrist §1" in rows[name]["source"], name  # where the range stands
    assert {row["type"] for row in rows.values()} == {"s16", "u8", "u16"}
    assert result.json["device"] is None or result.json["device"]["link"] is None


@both
def test_hand_space_is_another_one(wire: str) -> None:
    """The hand's 1020 is a current limit, its 1546 a finger: flags 11 and CAN 0."""
    result = run("wrist", "hand-read", "1020", "4", "-p", link(wire), "--json")
    assert [row["raw"] for row in result.rows] == [s16(1501, 1502).hex(" ").upper()]
    assert (
        run("wrist", "hand-read", "1546", "12", "-p", link(wire), "--format", "plain").out.strip()
        == s16(921, 933, 945, 969, 957, 981).hex(" ").upper()
    )


@both
def test_an_error_byte_of_01_is_never_its_own_echo(wire: str, tmp_path: Path) -> None:
    """On CAN a one-byte read of 01 equals its request: two bytes at least (dossier 4.12)."""
    trace = tmp_path / "t.txt"
    args = ("wrist", "get", "error_1", "--json", "--trace", trace, "-p")
    assert run(*args, link(wire, fault="faults,echo")).values == {"error_1": 1}
    if wire == "can":
        assert all(text.split()[-1] != "01" for text in sent_frames(trace))
    assert run(*args, link(wire, fault="faults,loopback")).code == 5


@both
def test_watch_is_a_stream(wire: str) -> None:
    rows, end = run("wrist", "watch", "--count", "3", "--rate", "20", "--json", "-p", link(wire)).stream
    assert [row["name"] for row in rows] == list(LIVE) * 3
    assert [row["value"] for row in rows] == [power_on_truth()[name] for name in LIVE] * 3
    times = sorted({row["t"] for row in rows})
    assert times == pytest.approx([0.0, 0.05, 0.1], abs=0.002)
    assert (end["command"], end["stream"]["samples"], end["ok"]) == ("wrist watch", 3, True)
    csv = run("wrist", "watch", "yaw_actual", "--count", "2", "--rate", "0", "--csv", "-p", link(wire))
    assert len(csv.lines) == 3 and csv.lines[0].startswith("t_s,")


# -- dry run ----------------------------------------------------------------------------------------------------------


@both
@each_row("command", [*WRITING, *(c for c in READING if c.name == "raw-read")], ids=ids)
@each_row("source", [(), ("--fake",)], ids=["no-device", "fake"])
def test_dry_run_prints_the_exact_bytes_and_sends_nothing(
    scratch: Path, command: Command, wire: str, source: tuple[str, ...]
) -> None:
    before = sorted(path.name for path in scratch.iterdir())
    words = ("wrist", *command.words(scratch, wire), ON[wire])
    expected = list(command.plan(wire))
    with spying() as spy:
        result = run(*words, "--dry-run", *source, "--json")
        plain = run(*words, "-n", *source, "--format", "plain")
        table = run("-n", *words, *source)
    assert (result.code, plain.code, table.code) == (0, 0, 0)
    assert [row["bytes"] for row in result.rows] == expected == plain.lines
    assert all(text in table.out for text in expected)
    assert result.json["counters"]["sent"] == 0
    assert spy.lines == []
    assert sorted(path.name for path in scratch.iterdir()) == before


def test_serial_is_the_default_wire_of_a_plan() -> None:
    args = ("wrist", "move", "--pitch", "-10", "--yaw", "10", "--time", "1000", "-n", "--format", "plain")
    assert run(*args).out == "EB 90 01 09 31 0E 04 E8 03 18 FC E8 03 37\n"
    assert run(*args, "--id", "7").out == "EB 90 07 09 31 0E 04 E8 03 18 FC E8 03 3D\n"
    assert run(*args, "--can", "--id", "16382").out == "1503BFFE [6] E8 03 18 FC E8 03\n"
    for port in ("can:slcan:/dev/ttyACM0", "fake://wrist?bus=can", "can:socketcan:can0"):
        assert run(*args, "-p", port).out == "15038001 [6] E8 03 18 FC E8 03\n"
    text = run(*args[:-2]).out
    assert "pitch_set = -10.00" in text and "yaw_set = 10.00" in text  # both axes are named


def test_reading_commands_have_no_dry_run() -> None:
    for verb in (("dump",), ("get", "yaw_set"), ("scan",), ("hand-read", "1472", "2")):
        result = run("wrist", *verb, "-n", "--fake", "--json")
        assert (result.code, result.rows) == (2, [])


# -- misprints --------------------------------------------------------------------------------------------------------

MISPRINTED = [
    ("serial", "EB 90 01 04 30 FC 03 02 36", ("pitch_actual", "1020", "EB 90 01 04 30 00 04 04 3D")),
    ("serial", "EB 90 01 07 31 0E 04 18 FC EB 03 4D", ("yaw -10.00", "+10.03", "EB 90 01 07 31 0E 04 E8 03 18 FC 4A")),
    ("serial", "90 EB 01 05 30 FC 03 00 00 00 00 35", ("reply", "sum")),
    ("can", "15038001#FC1803EB", ("+63.96", "-53.73", "15038001 [4] E8 03 18 FC")),
    # identifiers printed with 28 of their 29 bits (dossier W9)
    ("can", "1100001#04", ("11000001 [1] 04",)),
    ("can", "0184001#00000000", ("11000001",)),
]


@each_row(("wire", "text", "words"), MISPRINTED)
def test_misprinted_examples_are_explained(wire: str, text: str, words: tuple[str, ...]) -> None:
    result = run("wrist", "raw", text, "-n", ON[wire], "--json")
    assert result.code == 0
    (row,) = result.rows
    assert "wrist §2" in row["meaning"]
    for word in words:
        assert word in row["meaning"], (word, row)
    assert bytes.fromhex(row["bytes"].partition("] ")[2] or row["bytes"]) == bytes.fromhex(text.rpartition("#")[2])


def test_a_misprinted_write_asks_and_warns() -> None:
    # the serial one is legal and asks; the CAN one is out of range, so it is not sent at all
    for (wire, text, _), code in ((MISPRINTED[1], 8), (MISPRINTED[3], 2)):
        with spying() as spy:
            result = run("wrist", "raw", text, "-p", link(wire), "--json")
        assert (result.code, spy.lines) == (code, [])
    result = run("wrist", "raw", MISPRINTED[0][1], "-p", link("serial"), "--json")
    assert (result.code, result.rows[0]["raw"]) == (0, "90 EB 01 05 30 FC 03 A7 FE DA")
    assert "misprint" in result.codes()


# -- confirmation -----------------------------------------------------------------------------------------------------


@both
@each_row("command", WRITING, ids=ids)
def test_moves_ask_nothing_the_rest_asks(scratch: Path, command: Command, wire: str) -> None:
    """A wrist moves on its own bench; the hand behind it, a restore and raw frames do not go without --yes."""
    trace = scratch / "t.txt"
    with spying() as spy:
        result = run("wrist", *command.words(scratch, wire), "-p", link(wire), "--json", "--trace", trace, stdin="y\n")
    if not command.asks:
        assert (result.code, written_frames(trace)) == (0, list(command.frames(wire)))
        return
    assert (result.code, result.error["code"], result.rows) == (8, "not-confirmed", [])
    assert "--yes" in result.error["hint"]
    assert spy.lines == []  # nobody could answer: not even read


@both
@each_row("command", WRITING, ids=ids)
def test_the_frames_on_the_wire_are_those_of_the_plan(scratch: Path, command: Command, wire: str) -> None:
    trace = scratch / "t.txt"
    with spying() as spy:
        result = run("wrist", *command.words(scratch, wire), "-y", "-p", link(wire), "--json", "--trace", trace)
    assert result.code == 0
    assert written_frames(trace) == list(command.frames(wire))
    assert command.effect is not None
    assert memory_of(spy, command.space, command.effect[0], len(command.effect[1])) == command.effect[1]


# -- movement ---------------------------------------------------------------------------------------------------------


@both
def test_move_arrives_and_says_so(wire: str) -> None:
    args = ("wrist", "move", "--pitch", "-10", "--yaw", "10", "--time", "1000", "-p", link(wire))
    with spying() as spy:
        result = run(*args, "--json")
    assert 1.0 <= spy.now < 1.5
    shown = [(row["name"], row["value"], row["target"], row["unit"]) for row in result.rows]
    assert shown == [("pitch_actual", -10.0, -10.0, "°"), ("yaw_actual", 10.0, 10.0, "°")]
    assert "arrived" in result.codes()
    table = run(*args)
    assert "arrived" in table.said
    for line, text in zip(table.lines[1:3], ("-10.00", "10.00"), strict=True):
        assert line.split().count(text) == 2, table  # reached and target, two decimals


@both
def test_move_uses_the_time_the_wrist_holds(wire: str) -> None:
    with spying() as spy:
        assert run("wrist", "move", "--yaw", "-25.50", "-p", link(wire)).code == 0
    assert 0.7 <= spy.now < 1.2
    assert memory_of(spy, "wrist", 1038, 6) == s16(-2550, -300, 700)


@both
def test_a_blocked_axis_is_not_arrived(wire: str) -> None:
    with spying() as spy:
        result = run("wrist", "move", "--pitch", "10", "--time", "200", "-p", link(wire, fault="blocked"), "--json")
    assert (result.code, result.error["code"]) == (7, "blocked")
    assert "-3.45" in result.error["text"] and "10.00" in result.error["text"]
    assert result.values["pitch_actual"] == -3.45
    assert spy.now < 3
    with spying() as spy:
        run("wrist", "move", "--pitch", "10", "--time", "20000", "--wait", "0.5", "-p", link(wire))
    assert spy.now < 0.6


@both
def test_an_unusual_time_is_remarked(wire: str) -> None:
    for time, remarked in ((99, True), (100, False), (5000, False), (5001, True)):
        result = run("wrist", "set", f"move_time={time}", "--json", "-p", link(wire))
        assert (result.code, "move-time" in result.codes()) == (0, remarked), time
