"""`handctl wrist`: impossible requests, wires and links, scan, snapshot and transcript files, JSON of every command."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest

from tests.inspire.wrist_commands import (
    COMMANDS,
    ON,
    SETTINGS,
    STORED,
    WIRES,
    Command,
    link,
    prepare,
    sent_frames,
    written_frames,
)
from tests.support.cli import check_schema, run, spying
from tests.support.each_row import each_row


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    prepare(tmp_path)
    return tmp_path


def ids(command: Command) -> str:
    return command.name


both = pytest.mark.parametrize("wire", WIRES)


# -- impossible requests ----------------------------------------------------------------------------------------------

REFUSED = [
    "move --pitch 22.13", "move --pitch -22.67", "move --pitch 30", "move --yaw 25.51", "move --yaw -25.51",
    "move --pitch 10.005", "move --yaw nan", "move --yaw inf", "move --pitch x", "move", "move --time 1000",
    "move --pitch 1 --time 0", "move --pitch 1 --time 32768", "move --pitch 1 --time 1.5", "move --pitch 1 --wait 0",
    "center --time 0", "set yaw_set=25.51", "set pitch_set=22.13", "set move_time=0", "set yaw_set=10.001",
    "set pitch_actual=1", "set current_1024=1", "set error_1=0", "set nosuch=1", "set yaw_set", "set yaw_set=",
    "set yaw_set=1 yaw_set=2", "set yaw_set=1 pitch_set=99",
    "write 1038 E8", "write 1038 E803E8", "write 1038 E80318FCE8030000", "write 1036 0000E803", "write 1020 E803",
    "write 1034 0000", "write 1039 E803", "write 1042 0000", "write 1042 0080", "write 1038 F709",
    "write 1040 E803E803E803", "write 1044 E803", "write 70000 E803", "write 1038 zz", "write 1038 ''",
    "hand-write 1020 E803", "hand-write 1043 01", "hand-write 1019 0102", "hand-write 1032 18FC", "hand-write 1486 ''",
    "hand-read 1472 0", "read 1020 0", "read -1 2", "raw ''", "scan --ids 5-x", "scan --ids 9-3", "scan --ids ''",
    "get nosuch", "get", "watch --count 0", "watch --rate -1",
]  # fmt: skip
REFUSED_ON = {
    "serial": [
        "get yaw_set --id 0", "get yaw_set --id 255", "read 1020 253", "hand-read 1472 253", "read 65535 2",
        "scan --ids 0-5", "scan --ids 1-255", "raw zz", "raw EB9",
        "raw EB90010B310C0400000000000000004D",  # an exo's force command
        "raw EB900105120E0418FC3E",  # power-on speed of a hand's finger
        "raw EB90010512FB03010219",  # 1019 and 1020 of the hand
    ],
    "can": [
        "get yaw_set --id -1", "get yaw_set --id 16384", "move --pitch 1 --id 16383", "read 4096 1", "read 4090 10",
        "hand-read 4090 10", "hand-write 4096 00", "hand-write 4090 F401F401F401F401F4",
        "hand-write 1000 0102030405060708090A", "hand-write 1486 F401F401F401F401F4 --id 16383",
        "scan --ids 1-5000", "scan --ids 16384", "raw xyz", "raw 20000000#04", "raw 11000001#000000000000000000",
        "raw 05038001#E803",  # 1038 of the hand
        "raw 04FEC001#0102",  # 1019 and 1020 of the hand
        "raw 1503BFFF#E803",  # id 0x3FFF may mean every hand
    ],
}  # fmt: skip


@each_row(("wire", "text"), [(wire, text) for wire in WIRES for text in REFUSED + REFUSED_ON[wire]])
def test_impossible_requests_are_refused_before_anything_is_sent(wire: str, text: str, tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    with spying() as spy:
        result = run("wrist", *shlex.split(text), "-p", link(wire), "--yes", "--trace", trace, "--format", "plain")
    assert (result.code, result.out) == (2, ""), result
    assert spy.lines == [] or (spy.requests == 0 and sent_frames(trace) == []), result
    assert "Traceback" not in result.err
    assert result.err.startswith("handctl: error: ")


@both
def test_out_of_range_names_value_range_and_section(wire: str) -> None:
    for args, value, limits in (
        (("move", "--pitch", "30"), "30", ("-22.66", "22.12")), (("set", "yaw_set=-25.51"), "-25.51", ("-25.5", "25.5")),
        (("write", "1040", "F401F401F401"), "1044", ()), (("write", "1038", "F709"), "25.51", ("-25.5", "25.5")),
    ):  # fmt: skip
        result = run("wrist", *args, "-p", link(wire), "--json")
        assert result.code == 2
        assert value in result.error["text"], result
        for text in limits:
            assert text in result.error["hint"]
            assert "wrist §1" in result.error["hint"], "the ranges stand in §1 of the manual"


@both
def test_documented_limits_are_accepted(wire: str) -> None:
    for text in (
        "yaw_set=-25.5",
        "yaw_set=25.50",
        "pitch_set=-22.66",
        "pitch_set=22.12",
        "move_time=1",
        "move_time=32767",
    ):
        result = run("wrist", "set", text, "--json", "-p", link(wire))
        assert (result.code, list(result.values.values())) == (0, [float(text.partition("=")[2])]), result


def test_hand_write_where_wrist_registers_would_lie_needs_force() -> None:
    for wire, expected in (("serial", "EB 90 01 05 12 0E 04 18 FC 3E"), ("can", "05038001 [2] 18 FC")):
        args = ("wrist", "hand-write", "1038", "18FC", "-p", link(wire), "-n", "--format", "plain")
        assert run(*args).code == 2
        assert run(*args, "--force-ambiguous").out == f"{expected}\n"


# -- wires ------------------------------------------------------------------------------------------------------------


def device_of(*args: str, **env: str) -> str | None:
    """The link that a command really used."""
    return str(run("wrist", "get", "yaw_set", "--json", *args, env=env).json["device"]["link"])


def test_the_wire_of_a_simulated_wrist() -> None:
    assert device_of("--fake") == device_of("--fake", "--serial") == "fake://wrist"
    assert device_of("--fake", "--can") == "fake://wrist?bus=can"
    result = run("wrist", "--can", "get", "yaw_set", "--fake", "--serial", "--json")
    assert (result.code, result.json["device"]["link"]) == (0, "fake://wrist")  # the one nearest the verb


def test_the_wire_from_the_environment() -> None:
    assert device_of("--fake", HANDCTL_CAN="1") == "fake://wrist?bus=can"
    assert device_of("--fake", "--serial", HANDCTL_CAN="1") == "fake://wrist"
    assert device_of(HANDCTL_CAN="1", HANDCTL_FAKE="1") == "fake://wrist?bus=can"


@each_row(("port", "wire"), [
    ("can:slcan:/dev/nosuch", "serial"), ("fake://wrist?bus=can", "serial"), ("/dev/nosuch", "can"),
    ("tcp://127.0.0.1:1", "can"), ("usb:1A86:7523", "can"),
])  # fmt: skip
def test_a_wire_that_does_not_fit_the_link(port: str, wire: str) -> None:
    result = run("wrist", "get", "yaw_set", "-p", port, ON[wire], "--json")
    assert (result.code, result.rows) == (2, [])
    assert ON[wire] in result.error["text"] and port in result.error["text"]


@each_row("port", ["can:nosuch:x", "can:slcan", "can:", "can:slcan:", "can:virtual:x?bitrate",
                                  "fake://wrist?bus=foo", "fake://wrist?nosuch=1"])  # fmt: skip
def test_links_that_cannot_be_understood(port: str) -> None:
    result = run("wrist", "get", "yaw_set", "-p", port, "--json")
    assert result.code == 2, result
    assert port.split("?")[0] in result.error["text"]


def test_an_adapter_that_is_not_there_is_a_link_error() -> None:
    result = run("wrist", "get", "yaw_set", "-p", "can:slcan:/dev/nosuch", "--json")
    assert (result.code, len(result.err.splitlines())) == (3, 2)
    assert "/dev/nosuch" in result.error["text"]


def test_an_empty_bus_is_no_answer() -> None:
    """Nobody else is on python-can's virtual bus. A hand without a wrist is asked as well."""
    result = run("wrist", "get", "yaw_set", "-p", "can:virtual:empty", "--timeout", "0.05", "--retries", "0", "--json")
    assert (result.code, result.json["counters"]["sent"]) == (4, 2)
    assert "11038001 [1] 02" in result.error["text"]


@each_row("port", ["can:slcan:/dev/ttyACM0", "can:socketcan:can0", "fake://exo?bus=can"])
def test_an_exo_has_no_can(port: str) -> None:
    result = run("exo", "get", "id", "-p", port, "--json")
    assert (result.code, result.rows) == (2, [])
    assert "CAN" in result.error["text"]
    assert run("exo", "get", "id", "--fake", "--can").code == 2


def test_scan_says_what_it_does() -> None:
    for wire, last in (("serial", 254), ("can", 300)):
        with spying() as spy:
            result = run("wrist", "scan", "--all", "--ids", f"1-{last}", "-p", link(wire, id=200), "--json")
        (row,) = result.rows
        assert (row["family"], row["id"], row["baud"]) == ("wrist", 200, 115200 if wire == "serial" else None)
        facts = result.json["scan"]
        assert last <= facts["probes"] <= (3 if wire == "serial" else 1) * last + 10
        assert facts["seconds"] == pytest.approx(spy.now, abs=0.1)
        text = " ".join(message["text"] for message in result.json["messages"])
        assert "ids 1 to " in text and str(last) in text and "probes" in text
    nobody = run("wrist", "scan", "-p", link("can", id=16000), "--json")
    assert (nobody.code, nobody.rows) == (4, [])
    assert run("wrist", "scan", "--ids", "15990-16010", "-p", link("can", id=16000), "--json").rows[0]["id"] == 16000


# -- files ------------------------------------------------------------------------------------------------------------


@both
def test_snapshot_diff_restore(scratch: Path, wire: str) -> None:
    snap, port = scratch / "snap.json", link(wire, state=scratch / "state.json")
    assert run("wrist", "snapshot", snap, "-p", port).code == 0
    assert json.loads(snap.read_text())["values"] == {"yaw_set": 11.0, "pitch_set": -3.0, "move_time": 700}
    assert run("wrist", "diff", snap, "--setpoints", "-p", port).code == 0
    differs = run("wrist", "diff", scratch / "stored.json", "--setpoints", "-p", port, "--json")
    assert (differs.code, {row["name"]: (row["a"], row["b"]) for row in differs.rows}) == (
        7, {"yaw_set": (12.34, 11.0), "move_time": (1500, 700)},
    )  # fmt: skip
    restored = run("wrist", "restore", scratch / "stored.json", "-y", "--setpoints", "-p", port, "--json")
    assert {row["name"]: (row["before"], row["value"], row["moves"]) for row in restored.rows} == {
        "yaw_set": (11.0, 12.34, True), "move_time": (700, 1500, False),
    }  # fmt: skip
    assert "not-covered" in restored.codes()
    trace = scratch / "t.txt"
    again = run(
        "wrist", "restore", scratch / "stored.json", "-y", "--setpoints", "-p", port, "--json", "--trace", trace
    )
    assert (again.code, again.rows, written_frames(trace)) == (0, [], [])
    assert run("wrist", "get", *SETTINGS, "-p", port, "--json").values == STORED


def test_a_snapshot_of_another_kind_or_out_of_range_is_refused(scratch: Path) -> None:
    assert run("exo", "snapshot", scratch / "exo.json", "--fake").code == 0
    for args in (("restore", scratch / "exo.json"), ("diff", scratch / "exo.json"), ("restore", scratch / "none.json")):
        with spying() as spy:
            assert run("wrist", *args, "-y", "-p", link("serial")).code == 2
        assert spy.lines == []


@both
@each_row("command", COMMANDS, ids=ids)
def test_a_trace_plays_the_wrist(scratch: Path, command: Command, wire: str) -> None:
    """The same command on the recording shows the same rows on the recorded wire, and is not called simulated."""
    trace = scratch / "t.txt"
    words = ("wrist", *command.words(scratch, wire), "-y", "--json")
    recorded = run(*words, "-p", link(wire, jitter=1), "--trace", trace)
    played = run(*words, "-p", f"replay:{trace}")
    assert (recorded.code, played.code) == (0, 0), played
    if command.kind == "stream":
        assert [r["value"] for r in recorded.stream[0]] == [r["value"] for r in played.stream[0]]
        return
    own = {"link": f"replay:{trace}"} if command.kind == "scan" else {}
    assert played.rows == [{**row, **own} for row in recorded.rows]
    assert played.json["device"]["link"] == f"replay:{trace}"
    assert played.json["device"]["fake"] is False
    counters = dict(recorded.json["counters"])
    if command.kind == "scan" and wire == "serial":  # whether the speed matters is not measured on a recording
        counters = {**counters, "sent": counters["sent"] - 3, "received": counters["received"] - 1}
    assert played.json["counters"] == counters


@both
def test_a_request_that_was_never_recorded_is_a_clear_error(tmp_path: Path, wire: str) -> None:
    trace = tmp_path / "t.txt"
    assert run("wrist", "get", "yaw_set", "-p", link(wire), "--trace", trace).code == 0
    result = run("wrist", "get", "error_1", "-p", f"replay:{trace}", "--json")
    assert (result.code, result.error["code"]) == (3, "replay-miss")
    assert ("EB 90 01 04 30 04 04 01 3E" if wire == "serial" else "11010001 [1] 02") in result.error["text"]


# -- JSON -------------------------------------------------------------------------------------------------------------


@both
@pytest.mark.parametrize(("fault", "form"), [("healthy", "json"), ("refuse", "json"), ("truncate", "ndjson")])
def test_every_command_is_valid(scratch: Path, wire: str, fault: str, form: str) -> None:
    """json: one object with rows; ndjson: rows, then the envelope without them. Success and failure alike."""
    for command in COMMANDS:
        words = ("wrist", *command.words(scratch, wire), "-y", "--format", form)
        result = run(*words, "-p", link(wire, fault=fault))
        streamed = form == "ndjson" or command.kind == "stream"
        envelope = result.stream[1] if streamed else result.json
        check_schema(envelope)
        assert envelope["command"] == f"wrist {command.args[0]}"
        assert (envelope["device"]["kind"], envelope["device"]["fake"]) == ("wrist", True)
        errors = [message for message in envelope["messages"] if message["level"] == "error"]
        assert (len(errors), envelope["ok"]) == ((0, True) if result.code == 0 else (1, False))
