"""`handctl scan`: every family by name on its simulator, what is said when nothing answers, and what each probe sends.

On virtual time in this process; the served simulators are at the end, one each.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator, Sequence
from pathlib import Path
from unittest import mock

import pytest

from handctl.devices.inspire import modbus_frames as modbus
from handctl.errors import LinkError, NoAnswer, ProtocolError
from handctl.families import FAMILIES, SCAN_ORDER
from handctl.link import ByteLink, Deadline
from handctl.link.device_lock import hold
from handctl.model.result import Journal, Row
from handctl.sim.bus.wire_pair import resample
from handctl.tools import scan, scan_report
from handctl.tools.family_probe import probe_of
from handctl.tools.scan_link import asking_order
from handctl.tools.scan_report import Step
from tests.support import bus_file
from tests.support.cli import Result, Simulator, run, sent
from tests.support.each_row import each_row
from tests.support.machine import System


def looked(link: str, *args: str) -> Result:
    return run("scan", "-p", link, "--json", *args)


def found(answer: Result) -> list[tuple[object, ...]]:
    assert answer.code == 0, answer
    return [(row["family"], row["baud"], row["id"]) for row in answer.rows]


@each_row(
    ("link", "family", "baud", "device_id"),
    [
        ("fake://exo?", "exo", 115200, 1),
        ("fake://exo?baud=19200", "exo", 19200, 1),
        ("fake://wrist?", "wrist", 115200, 1),
        ("fake://wrist?bus=can", "wrist", None, 1),
        ("fake://barrett?", "barrett", 9600, None),
        ("fake://barrett?baud=38400", "barrett", 38400, None),
        ("fake://barrett?baud=600", "barrett", 600, None),
        ("fake://ekso?", "ekso", 115200, None),
        ("fake://aidin?", "aidin", None, None),
        ("fake://aidin?exchange=poll", "aidin", None, None),
    ],
)  # fmt: skip
def test_each_family_is_named(link: str, family: str, baud: int | None, device_id: int | None) -> None:
    link += "&clock=virtual"
    answer = looked(link)
    assert found(answer) == [(family, baud, device_id)]
    (row,) = answer.rows
    assert row["link"] == link
    assert row["evidence"]


def test_evidence_is_what_the_device_said() -> None:
    evidence = {kind: looked(f"fake://{kind}?clock=virtual").rows[0]["evidence"] for kind in FAMILIES}
    assert evidence["exo"] == "system_voltage reads 558, asked twice"
    assert evidence["wrist"] == "pitch_raw reads -345, asked twice"
    assert evidence["barrett"].startswith("prompt, serial number ")
    assert evidence["ekso"].endswith("CRC and msgID are correct")
    assert evidence["aidin"] == "streams current_state, joint_pos, motor_pos, sensor_state, task_space_pos"


def test_every_family_has_a_probe() -> None:
    for name in FAMILIES:
        assert probe_of(name).PING


# -- what is sent, and in which order -----------------------------------------------------------------------------

EKSO = "96 00 00 01"
INSPIRE = (
    *("EB 90 01 04 30 00 04 02 3B", "EB 90 01 04 30 02 04 02 3D"),
    *("EB 90 01 04 11 C0 05 02 DD", "EB 90 01 04 11 0A 06 02 28"),
)
"""The two questions to a wrist, and those to a hand: a firmware may lack a register."""
RTU = "01 03 06 0A 00 02 E4 81"
SILENT_SERIAL = [
    (115200, ("96", *INSPIRE)), (57600, tuple(f"00 00 {one}" for one in INSPIRE)),
    (9600, ("21 00 0D",)), (19200, tuple(f"00 {one}" for one in INSPIRE)),
    *((speed, ("21 00 0D",)) for speed in (38400, 19200, 4800, 2400, 1200, 600)),
]  # fmt: skip


def test_a_silent_port_gets_reads_only_in_the_documented_order(tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    answer = looked("fake://exo?fault=silent&clock=virtual", "--trace", str(trace))
    assert answer.code == 4
    seen: list[tuple[int, list[str]]] = [(115200, [])]
    for line in trace.read_text().splitlines()[1:]:
        _, mark, rest = line.split(" ", 2)
        if mark == "!" and rest.startswith("baud"):
            seen.append((int(rest.removeprefix("baud ")), []))
        elif mark == ">":
            text = "96" if rest.startswith("96 00 00") else rest
            if text not in seen[-1][1]:
                seen[-1][1].append(text)
    asked = [(speed, tuple(sends)) for speed, sends in seen if sends]
    merged: list[tuple[int, tuple[str, ...]]] = []
    for speed, sends in asked:
        if merged and merged[-1][0] == speed:
            merged[-1] = speed, tuple(dict.fromkeys((*merged[-1][1], *sends)))
        else:
            merged.append((speed, sends))
    assert merged[: len(SILENT_SERIAL)] == SILENT_SERIAL
    behind = [speed for speed, sends in merged[len(SILENT_SERIAL) :] if RTU in sends]
    assert set(behind) == {115200}  # 03 is ^C to a BarrettHand where the speed does not matter: one was asked before


def test_nothing_that_is_sent_writes_or_moves(tmp_path: Path) -> None:
    """Read flags and functions only, GetTime only, the marked empty line only, the empty object only."""
    trace = tmp_path / "trace"
    for link in ("fake://exo?fault=silent&clock=virtual", "fake://aidin?exchange=mute&clock=virtual"):
        looked(link, "--trace", str(trace))
        for data in sent(trace):
            assert (
                data in (b"!\0\r", b"{}\n")
                or (data.lstrip(b"\0")[:2] == b"\xeb\x90" and data[-5] in (0x11, 0x30) and len(data) <= 11)
                or (data[0] == 150 and len(data) == 6)
                or (data[1:2] == b"\x03" and len(data) == 8)  # Modbus RTU, function 03
            ), data


def bytes_at(trace: Path) -> list[tuple[int, bytes]]:
    """What was sent, and at which speed."""
    speed, found = 115200, []
    for line in trace.read_text().splitlines()[1:]:
        _, mark, rest = line.split(" ", 2)
        if mark == "!" and rest.startswith("baud"):
            speed = int(rest.removeprefix("baud "))
        elif mark == ">":
            found.append((speed, bytes.fromhex(rest)))
    return found


@each_row("command", ["scan", "exo scan", "wrist scan", "hand scan"])
@each_row("more", ["--all", "--baud 19200", "--baud 38400"])
def test_no_id_ends_a_movement_of_a_barrett_hand_unless_it_was_typed(command: str, more: str, tmp_path: Path) -> None:
    """3 is ^C and 13 is CR to a hand that listens at this speed: they are left out, and one note says what to type."""
    trace = tmp_path / "trace"
    silent = ("-p", "fake://exo?fault=silent&clock=virtual", "--trace", str(trace), "--json")
    answer = run(*command.split(), *silent, *more.split())
    slow = [data for speed, data in bytes_at(trace) if speed <= 38400 and b"\xeb\x90" in data]
    assert answer.code == 4 and len(slow) > 250, (answer, len(slow))
    assert not [data for data in slow if {0x03, 0x0D} & set(data)]
    (note,) = [
        message for message in answer.json["messages"] if message["code"] == "not-asked" and message["level"] == "info"
    ]
    assert "--ids 3,13" in note["hint"]
    typed = run(*command.split(), *silent, *more.split(), "--ids", "3,13")
    asked = {data[data.index(b"\x90") + 1] for speed, data in bytes_at(trace) if speed <= 38400 and b"\xeb\x90" in data}
    assert {3, 13} <= asked and not [
        message for message in typed.json["messages"] if message["code"] == "not-asked" and message["level"] == "info"
    ]


def test_an_id_that_was_left_out_is_found_where_it_was_typed() -> None:
    link = "fake://exo?id=13&baud=19200&clock=virtual"
    assert looked(link).code == 4
    assert found(looked(link, "--ids", "3,13")) == [("exo", 19200, 13)]
    assert found(looked("fake://exo?id=13&clock=virtual")) == [("exo", 115200, 13)], "no BarrettHand hears that"


def heard(data: bytes, sent_at: int, heard_at: int) -> bytes:
    """What an ideal UART at another speed makes of `data`: start on a falling edge, samples in mid-bit, 8N1."""
    levels = [level for byte in data for level in (0, *(byte >> i & 1 for i in range(8)), 1)]

    def at(moment: float) -> int:
        place = int(moment * sent_at)
        return levels[place] if place < len(levels) else 1

    bit, step, moment, before = 1 / heard_at, 1 / sent_at / 16, 0.0, 1
    got = []
    while moment * sent_at < len(levels):
        if before and not at(moment) and not at(moment + bit / 2):
            got.append(sum(at(moment + bit * (1.5 + i)) << i for i in range(8)))
            moment += bit * 9.5
        before = at(moment)
        moment += step
    return bytes(got)


def test_what_a_barrett_hand_hears_of_the_other_probes() -> None:
    """No CR, so nothing is carried out; no FF at the boot monitor's 9600."""
    assert heard(b"\r", 9600, 19200) == bytes.fromhex("E680")  # the dossier's own sample, section 13
    frames = [
        (115200, "96 00 00 01 75 E7"),
        *((speed, text) for speed in (115200, 57600, 19200) for text in INSPIRE),
        (115200, RTU),
    ]
    for speed, text in frames:
        for other in probe_of("barrett").SPEEDS:
            got = heard(bytes.fromhex(text), speed, other)
            assert b"\r" not in got, (text, speed, other)
            assert other != 9600 or b"\xff" not in got, (text, speed)


@pytest.mark.parametrize("receiver", ["mid", "sci"])
@pytest.mark.parametrize("speed", [115200, 57600])
def test_no_id_is_a_trigger_before_a_boot_monitor_was_excluded(speed: int, receiver: str) -> None:
    """At these speeds the probes of the other families go out before anybody was asked at 9600."""
    for text in (*INSPIRE, *([RTU] if speed == 115200 else [])):
        for device_id in range(1, 255):
            if text.startswith("EB"):
                frame = bytes([0xEB, 0x90, device_id]) + bytes.fromhex(text)[3:-1]
                frame += bytes([sum(frame[2:]) & 0xFF])
            else:
                frame = bytes([device_id]) + bytes.fromhex(text)[1:-2]
                frame += modbus.crc(frame)
            assert 0xFF not in resample(frame, speed, 9600, receiver), frame.hex(" ")


@pytest.mark.parametrize(("families", "latest"), [(("wrist", "exo", "barrett"), 3.01), ((), 3.5)])
def test_other_speeds_wait_for_a_hand_that_starts(families: tuple[str, ...], latest: float, tmp_path: Path) -> None:
    """After silence at 9600 the port is open for 3 s before anything but 115200, 57600 and 9600 is tried.

    The questions of three families fit in these; those of all take longer, and only a late answer is waited for behind them.
    """
    trace = tmp_path / "trace"
    only = [word for name in families for word in ("--family", name)]
    looked("fake://exo?fault=silent&clock=virtual", *only, "--trace", str(trace))
    speeds = [line.split() for line in trace.read_text().splitlines()[1:] if " baud " in line]
    first = next(float(words[0]) for words in speeds if words[3] not in ("115200", "57600", "9600"))
    assert 2.69 <= first <= latest  # of which 0.3 s of listening come before the first line


def test_a_hand_that_starts_meanwhile_is_found() -> None:
    answer = looked("fake://barrett?found=boot&boot=2.5&clock=virtual")
    assert (answer.code, answer.json["rows"][0]["baud"]) == (0, 9600)


@pytest.mark.parametrize("state", ["record", "monitor&monitor-echo=1"])
def test_behind_a_boot_monitor_nothing_else_is_sent(state: str, tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    answer = looked(f"fake://barrett?found={state}&clock=virtual", "--trace", str(trace))
    assert (answer.code, answer.error["code"]) == (5, "boot-monitor")
    speeds = [line.split()[3] for line in trace.read_text().splitlines()[1:] if " baud " in line]
    assert set(speeds) <= {"57600", "9600", "115200"}


def test_order_on_tcp_and_can() -> None:
    every = list(SCAN_ORDER)
    assert [step.family for step in asking_order("tcp", every, speeds=False)] == [
        "aidin",
        "ekso",
        "wrist",
        "exo",
        "barrett",
        "hand",
    ]
    assert asking_order("tcp", every, speeds=False, port=6000)[0] == Step("hand", None)
    assert asking_order("can", every, speeds=False) == [Step("wrist", None), Step("hand", None)]
    assert asking_order("serial", ["barrett"], speeds=True)[:2] == [Step("barrett", 9600), Step("barrett", 38400)]
    assert asking_order("serial", ["aidin"], speeds=True) == []


@pytest.mark.real
def test_modbus_tcp_on_another_port_is_the_next_step_not_garbage() -> None:
    """Bytes for it might reach a serial line there, so all families together pass it over; by itself it is found."""
    with Simulator("--modbus-tcp", "127.0.0.1:0", "--set", "model=tp", kind="hand") as loop:
        answer = looked(loop.link)
        assert (answer.code, answer.error["code"], answer.rows) == (4, NoAnswer.default_code, [])
        alone = f"hand scan --protocol modbus -p {loop.link}"
        assert alone in answer.error["hint"] and "not-asked" in {one["came"] for one in answer.json["scan"]["tried"]}
        doctor = {row["check"]: row for row in run("doctor", "--json", "-p", loop.link).json["rows"]}
        assert doctor["device"]["status"] == "fail" and alone in doctor["device"]["remedy"]
        (row,) = run(*alone.split(), "--json").rows
        assert (row["family"], row["id"], row["protocol"]) == ("hand", 1, "modbus-tcp")


def test_one_family_only(tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    answer = looked("fake://exo?clock=virtual", "--family", "ekso", "--trace", str(trace))
    assert answer.code == 4
    assert {data[0] for data in sent(trace)} == {150}
    assert [row["family"] for row in answer.json["scan"]["tried"]] == ["ekso"]


def test_a_given_speed_is_the_only_one(tmp_path: Path) -> None:
    answer = looked("fake://exo?baud=57600&clock=virtual", "--baud", "57600")
    assert found(answer) == [("exo", 57600, 1)]
    answer = looked("fake://exo?baud=57600&clock=virtual", "--baud", "19200")
    assert {row["baud"] for row in answer.json["scan"]["tried"]} == {None}
    assert answer.code == 4


def test_a_hand_with_a_wrist_is_a_wrist() -> None:
    """It answers the question for the exo's voltage as well."""
    answer = looked("fake://wrist?clock=virtual", "--all")
    assert [row["family"] for row in answer.rows] == ["wrist"]


@each_row(
    ("words", "link", "code", "behind"),
    [
        (("hand", "scan"), "fake://exo", 6, ("ids 2 to 254 at 115200", "at 921600")),
        (("exo", "scan"), "fake://hand", 6, ("ids 2 to 254 at 115200",)),
        (("exo", "scan"), "fake://exo?id=7", 0, ("ids 8 to 254 at 115200", "ids 2 to 254 at 57600")),
        (("hand", "scan", "--protocol", "modbus"), "fake://hand", 0, ("ids 2 to 254",)),
        (("wrist", "scan"), "fake://wrist?bus=can", 0, ("ids 2 to 254",)),
        (("scan",), "fake://exo", 0, ("ids other than 1", "hand")),
        (("scan",), "fake://barrett", 0, ("ids other than 1",)),
        (("exo", "scan", "--all"), "fake://exo", 0, ()),
        (("exo", "scan", "--ids", "1", "--baud", "115200"), "fake://exo", 0, ()),
        (("scan", "--id", "1", "--family", "exo"), "fake://exo?baud=19200", 0, ()),
    ],
)  # fmt: skip
def test_a_scan_that_ends_at_a_device_says_what_it_did_not_try(
    words: tuple[str, ...], link: str, code: int, behind: tuple[str, ...]
) -> None:
    """In JSON and to people; and the next step names the family that was detected."""
    link = f"{link}{'&' if '?' in link else '?'}clock=virtual"
    answer = run(*words, "-p", link, "--json")
    assert answer.code == code, answer
    left = [text for text in answer.json["scan"]["left"] if text.endswith("--all tries these")]
    assert len(left) == bool(behind) and ("first" in answer.codes()) == bool(behind), answer.json["scan"]
    assert all(text in left[0] for text in behind), left
    assert not code or f"`handctl {answer.rows[0]['family']}`" in answer.error["hint"]


def test_what_was_tried_is_what_was_asked(tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    answer = run("hand", "scan", "-p", "fake://exo?clock=virtual", "--trace", str(trace), "--json")
    (told,) = [message["text"] for message in answer.json["messages"] if message["code"] == "scanned"]
    assert {data[2] for data in sent(trace) if data[:2] == b"\xeb\x90"} == {1}
    assert "id 1 at 115200" in told and "254" not in told


# -- ids ----------------------------------------------------------------------------------------------------------


def test_other_ids_are_looked_for_when_asked() -> None:
    assert found(looked("fake://exo?id=77&clock=virtual")) == [("exo", 115200, 77)]
    assert looked("fake://exo?id=77&clock=virtual", "--ids", "1-20").code == 4
    assert found(looked("fake://exo?id=77&clock=virtual", "--ids", "1-254", "--family", "exo")) == [("exo", 115200, 77)]
    assert found(looked("fake://exo?id=77&clock=virtual", "--id", "77")) == [("exo", 115200, 77)]


@each_row("text", ["0", "255", "1-", "x", "", ",", "5-1000"])
def test_ids_that_are_none(text: str) -> None:
    answer = run("scan", "-p", "fake://exo?clock=virtual", "--ids", text, "--json")
    assert answer.code == 2


# -- when nothing answers -----------------------------------------------------------------------------------------


def test_silence_says_what_was_tried() -> None:
    answer = looked("fake://exo?fault=silent&clock=virtual")
    assert (answer.code, answer.error["code"]) == (4, "no-answer")
    text = answer.error["text"]
    assert "complete silence. Tried ekso at 115200: silence; wrist at 115200, 57600, 19200: silence" in text
    assert "barrett at 9600, 38400, 19200, 4800, 2400, 1200, 600: silence" in text
    assert "--all" in answer.error["hint"]
    assert len(answer.json["scan"]["tried"]) == 17
    assert "Modbus RTU at 921600, 57600, 19200 bit/s" in " ".join(answer.json["scan"]["left"])


class Line(ByteLink):
    """A line that answers as the test says, on a clock that only its waits move."""

    name = "line"
    can_set_baud = True

    def __init__(self, answers: Iterator[bytes] | None = None, *, echo: bool = False, first: bytes = b"") -> None:
        self.baud = 115200
        self.time = 0.0
        self.waiting = first
        self.echo = echo
        self.answers = answers
        self.sent: list[bytes] = []

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self.time += seconds

    def write(self, data: bytes, deadline: Deadline) -> None:
        self.sent.append(data)
        self.waiting += data if self.echo else next(self.answers, b"") if self.answers is not None else b""

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        data, self.waiting = self.waiting[:size], self.waiting[size:]
        if not data:
            self.time = max(self.time, deadline.at)
        return data

    def set_baud(self, baud: int) -> None:
        self.baud = baud

    def close(self) -> None:
        pass


def on(line: Line, *args: str) -> Result:
    with mock.patch.object(scan, "open_link", lambda *_a, **_k: line):
        return looked("line", *args)


def test_an_echo_is_no_device() -> None:
    answer = on(Line(echo=True))
    assert (answer.code, answer.error["code"]) == (5, "echo")
    assert "only our own bytes come back" in answer.error["text"]


def test_garbage_is_no_device() -> None:
    def noise() -> Iterator[bytes]:
        while True:
            yield b"\x81\x42\xf0\x17\x00"

    answer = on(Line(noise()))
    assert (answer.code, answer.error["code"]) == (5, "garbage")
    assert "slcan" in answer.error["hint"]


def test_what_talks_by_itself_is_left_alone() -> None:
    line = Line(first=b"$GPGGA,123519,4807.038,N,01131.000,E\r\n")
    answer = on(line)
    assert (answer.code, answer.error["code"]) == (5, "talks")
    assert line.sent == []


@each_row(("kind", "ask"), [
    ("exo", "EB 90 03 04 11 E8 03 01 04"), ("wrist", "EB 90 03 04 30 FC 03 02 38"),
])  # fmt: skip
def test_another_master_of_a_family_is_named(kind: str, ask: str, tmp_path: Path) -> None:
    path = tmp_path / "bus.toml"
    path.write_text(bus_file.text("half-duplex", [{"kind": kind}], [{"ask": ask, "every_ms": 50}]))
    answer = looked(f"fake://bus?file={path}&clock=virtual")
    assert (answer.code, answer.error["code"], answer.json["counters"]["sent"]) == (5, "talks", 0)
    assert f"with {kind} id 3 on this line" in answer.error["text"]
    assert f"handctl {kind} scan --all" in answer.error["hint"]


def test_a_modbus_line_is_named() -> None:
    """Requests and answers of a Modbus master on the same pair, with their CRC-16."""
    frames = bytes.fromhex("010303E80001047A" + "01030200017984" + "010303E80001047A")
    line = Line(first=frames)
    answer = on(line)
    assert (answer.code, answer.error["code"]) == (5, "modbus")
    assert line.sent == []


@each_row(
    ("text", "modbus"),
    [
        ("010303E80001047A", True), ("FF010303E80001047A", True), ("010303E80001047B", False), ("", False),
        ("00000000", False), ("24475047474131323335", False),
    ],
)  # fmt: skip
def test_modbus_frames(text: str, modbus: bool) -> None:
    assert scan_report.is_modbus(bytes.fromhex(text)) is modbus


def test_another_prompt_is_no_barrett_hand() -> None:
    """A boot loader's prompt looks alike; it does not know PGET."""

    def loader() -> Iterator[bytes]:
        while True:
            yield b"\n\r=> "

    line = Line(loader())
    line.baud = 9600
    with pytest.raises(ProtocolError) as caught:
        probe_of("barrett").probe(line, Journal(), line.deadline(10))
    assert caught.value.code == "garbage"
    assert line.sent[:2] == [b"!\0\r", b"PGET SN\r"]


def test_a_boot_monitor_gets_nothing() -> None:
    """FF would be a trigger there, and a byte at another speed may become one."""
    line = Line(first=b":")
    with pytest.raises(ProtocolError) as caught:
        probe_of("barrett").probe(line, Journal(), line.deadline(10))
    assert (caught.value.code, line.sent) == ("boot-monitor", [])


@each_row(
    ("link", "family", "wire"), [("fake://wrist?bus=can", "exo", "CAN"), ("fake://exo?", "aidin", "a serial line")]
)
def test_a_family_that_cannot_be_there(link: str, family: str, wire: str) -> None:
    answer = looked(f"{link}&clock=virtual", "--family", family)
    assert (answer.code, answer.json["scan"]["tried"]) == (2, [])
    assert f"{family} cannot be on {wire}" in answer.error["text"]


def test_the_deadline_may_end_the_last_probe() -> None:
    answer = looked(
        "fake://exo?fault=silent&clock=virtual",
        "--ids",
        "1-254",
        "--family",
        "exo",
        "--deadline",
        "1",
        "--baud",
        "115200",
    )
    assert (answer.code, answer.error["code"]) == (4, "deadline")


def test_the_deadline_ends_the_search() -> None:
    answer = looked("fake://exo?fault=silent&clock=virtual", "--deadline", "1")
    assert (answer.code, answer.error["code"]) == (4, "deadline")
    assert 0 < len(answer.json["scan"]["tried"]) < 14


def test_the_deadline_is_one_for_all_links() -> None:
    """Where it is over, the next port is not opened any more."""
    silent = [f"fake://exo?fault=silent&clock=virtual&seed={number}" for number in range(3)]
    answer = run("scan", "--json", *(word for link in silent for word in ("-p", link)), "--deadline", "30")
    assert answer.code == 4
    asked = {row["link"] for row in answer.json["scan"]["tried"]}
    assert asked == set(silent[:2])
    ended = [row["text"] for row in answer.json["messages"] if row["code"] == "deadline"]
    assert len(ended) == 2


def test_all_ids_of_a_silent_line_are_asked_to_the_end() -> None:
    answer = looked("fake://exo?fault=silent&clock=virtual&wire=auto", "--ids", "1-254", "--family", "exo")
    assert (answer.code, answer.error["code"]) == (4, "no-answer")


# -- slow lines ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "seconds"), [
    ("exo", 0.3), ("exo", 0.5), ("wrist", 0.5), ("wrist&bus=can", 0.5), ("ekso", 0.5), ("barrett", 0.5), ("aidin", 0.5),
])  # fmt: skip
def test_a_slow_line_is_asked_again_with_patience(kind: str, seconds: float) -> None:
    family, _, more = kind.partition("&")
    answer = looked(f"fake://{family}?clock=virtual&fault=late&late={seconds}&{more}")
    assert [row[0] for row in found(answer)] == [family]


@pytest.mark.parametrize(("wire", "baud"), [("bluetooth", None), ("clean", 19200), ("half-duplex", 57600)])
def test_the_row_has_the_speed_of_the_device_on_a_slow_line(wire: str, baud: int | None, tmp_path: Path) -> None:
    path = tmp_path / "bus.toml"
    path.write_text(bus_file.text(wire, [{"kind": "exo"}], baud=baud or 115200, latency_ms=300, spread_ms=60))
    answer = looked(f"fake://bus?file={path}&clock=virtual")
    assert found(answer) == [("exo", baud, 1)]
    assert 300 <= answer.json["line"]["round_trip_ms"] <= 400
    assert answer.json["line"]["speed_matters"] is (baud is not None)
    assert "line" in answer.codes()


# -- which ports --------------------------------------------------------------------------------------------------


def scanned(system: System) -> tuple[list[str], Journal]:
    journal = Journal()
    return scan.free_ports(system.machine(), journal), journal


def test_held_and_closed_ports_are_left_out(tmp_path: Path) -> None:
    system = System(tmp_path)
    for number in range(3):
        system.tty(f"ttyUSB{number}", usb=("0403", "6001"), bus=f"1-{number}")
    system.process(4711, "screen", opened="/dev/ttyUSB0")
    system.denied.add("/dev/ttyUSB1")
    names, journal = scanned(system)
    assert names == ["/dev/ttyUSB2"]
    assert [message.text for message in journal.messages] == [
        "/dev/ttyUSB0 is in use by screen (pid 4711), so it was skipped",
        "/dev/ttyUSB1 is not permitted, so it was skipped",
    ]


def test_no_free_port_is_a_link_error(tmp_path: Path) -> None:
    with pytest.raises(LinkError) as caught:
        scanned(System(tmp_path))
    assert caught.value.code == "no-port"


@pytest.mark.real
def test_several_links() -> None:
    links: Sequence[str] = ("fake://exo?clock=virtual", "fake://ekso?clock=virtual", "tcp://127.0.0.1:1")
    answer = run("scan", "--json", *(word for link in links for word in ("-p", link)))
    assert found(answer) == [("exo", 115200, 1), ("ekso", 115200, None)]
    assert answer.codes() == ["first", "first", "refused"], "each scan that ended at a device says so"
    assert answer.json["scan"]["links"] == list(links)


@pytest.mark.real
def test_several_links_without_any_device() -> None:
    answer = run("scan", "--json", "-p", "tcp://127.0.0.1:1", "-p", "fake://exo?fault=silent&clock=virtual")
    assert answer.code == 4
    assert answer.error["text"].startswith("No device on 2 links")


@pytest.mark.real
def test_all_simulators_at_once() -> None:
    answer = run("scan", "--fake", "--family", "ekso", "--family", "aidin", "--json")
    assert found(answer) == [("ekso", 115200, None), ("aidin", None, None)]


def test_the_port_may_stand_before_the_verb_or_in_the_environment() -> None:
    assert run("-p", "fake://ekso?clock=virtual", "scan", "--format", "plain").out.startswith("ekso\t")
    env = {"HANDCTL_PORT": "fake://ekso?clock=virtual"}
    assert run("scan", "--format", "plain", env=env).out.startswith("ekso\t")


# -- served, as in the field ------------------------------------------------------------------------------------------


@pytest.mark.real
@pytest.mark.parametrize(
    ("kind", "place", "baud"),
    [
        ("barrett", ("--pty",), 9600), ("wrist", ("--slcan-tcp", "127.0.0.1:0"), None),
    ],
)  # fmt: skip
def test_served_simulators_are_named(kind: str, place: tuple[str, ...], baud: int | None) -> None:
    with Simulator(*place, kind=kind) as simulator:
        answer = looked(simulator.link)
    assert [(family, speed) for family, speed, _ in found(answer)] == [(kind, baud)]
    assert answer.rows[0]["link"] == simulator.link


# -- beside others, and ended early -------------------------------------------------------------------------------


@each_row("link", ["tcp://127.0.0.1:{}", "socket://127.0.0.1:{}"])
def test_a_device_in_use_is_left_alone(link: str) -> None:
    """Another handctl holds it: nothing is sent, not even a connection is made."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.2)
        place = link.format(server.getsockname()[1])
        lock = hold(place, "handctl barrett close")
        assert lock is not None
        try:
            answer = looked(place, "--deadline", "2")
        finally:
            lock.release()
        assert (answer.code, answer.error["code"]) == (3, "busy")
        assert "`handctl barrett close`" in answer.error["text"]
        with pytest.raises(TimeoutError):
            server.accept()


def test_a_ctrl_c_keeps_what_was_found(monkeypatch: pytest.MonkeyPatch) -> None:
    probe = probe_of("wrist")

    def ended(*_args: object) -> list[Row]:
        raise KeyboardInterrupt

    links = ("fake://ekso?clock=virtual", "fake://wrist?clock=virtual", "fake://exo?clock=virtual")
    monkeypatch.setattr(probe, "probe", ended)
    answer = run("scan", "--json", *(word for link in links for word in ("-p", link)))
    assert (answer.code, answer.error["code"]) == (130, "interrupted")
    assert [row["family"] for row in answer.rows] == ["ekso"]
    assert answer.json["scan"]["links"] == list(links[:2])
    assert answer.codes() == ["first", "interrupted"]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
def test_a_trace_that_cannot_be_written_ends_nothing() -> None:
    answer = looked("fake://ekso?clock=virtual", "--trace", "/dev/full")
    assert (answer.code, answer.error["code"]) == (1, "output")


def test_the_default_port_is_that_of_the_families_that_have_one() -> None:
    answer = looked("tcp://127.0.0.1", "--family", "exo", "--deadline", "1")
    assert answer.code == 2
    assert "expected tcp://HOST:PORT" in answer.error["text"]


def test_a_trace_of_a_scan_is_told_family_by_family(tmp_path: Path) -> None:
    """Each request is decoded as the family that asked it."""
    trace = tmp_path / "trace"
    assert found(looked("fake://exo?clock=virtual", "--trace", str(trace))) == [("exo", 115200, 1)]
    told = run("trace", "show", trace, "--json")
    assert (told.code, told.json["statistics"]["family"]) == (0, "ekso, wrist, exo")
    meanings = [row["meaning"] for row in told.rows if row["direction"] == "host" and row["kind"] == "frame"]
    assert meanings[0] == "request GetTime"
    assert "read current_1024: 2 bytes at 1024, id 1" in meanings
    assert "read system_voltage: 2 bytes at 1472, id 1" in meanings
    assert set(told.json["statistics"]["problems"]) == {"no-answer"}
    assert told.json["messages"] == []
    other = tmp_path / "other"
    looked("fake://exo?clock=virtual&seed=1", "--trace", str(other))
    assert run("trace", "diff", trace, other).code == 0  # the same, on another link


@pytest.mark.parametrize(("kind", "more"), [
    ("exo", ()), ("wrist", ()), ("wrist", ("bus=can",)), ("barrett", ()), ("ekso", ()), ("aidin", ("exchange=poll",)),
])  # fmt: skip
def test_a_slow_line_is_waited_for_as_long_as_timeout_says(kind: str, more: tuple[str, ...]) -> None:
    """Bluetooth, a serial server far away: every answer 1.2 s late."""
    link = f"fake://{kind}?" + "&".join(("clock=virtual", "fault=late", "late=1.2", *more))
    words = ("scan", "-p", link, "--family", kind, "--format", "plain")
    assert run(*words).code in (0, 4, 5)
    found = run(*words, "--timeout", "2.5", "--deadline", "60")
    assert found.code == 0 and found.out.startswith(kind), found
