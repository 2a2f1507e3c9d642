"""Two replies to one read that contradict each other: told where they are seen without waiting for the second.

A second device with the same id, another program that reads the same, or a stale reply and the right one. What has arrived
when the next request goes out is looked at, whatever came in between; the last reply of a command has no next request.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from handctl.devices.ekso.dataport import DataPort
from handctl.devices.ekso.frames import Command
from handctl.devices.inspire import modbus_frames
from handctl.devices.inspire.can_bus import CanBus
from handctl.devices.inspire.modbus_bus import ModbusBus
from handctl.devices.inspire.register_bus import RegisterBus
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.errors import DeviceRefused, HandctlError
from handctl.link import CanFrame
from handctl.model.device import Line
from handctl.model.result import Journal
from tests.barrett.support import gcl, hand_on
from tests.ekso.support import frame, pack
from tests.inspire.wrist_support import ScriptedFrames
from tests.support.bus_file import text
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.scripted import Reply, ScriptedLink, reply_to

Two = tuple[Line, Callable[[], object], Any]
"""A line, what asks it once, and its link."""


def _answered(reply: Callable[[bytes, int], bytes], apart: float, other: int) -> ScriptedLink:
    """Each read is answered with 100, and with `other` so much later; apart 0 = in one piece."""

    def answer(request: bytes) -> list[Reply]:
        first, second = reply(request, 100), reply(request, other)
        return [(0.001, first + second)] if not apart else [(0.001, first), (0.001 + apart, second)]

    return ScriptedLink(answer)


def serial(apart: float, other: int) -> Two:
    link = _answered(lambda request, value: reply_to(request.lstrip(b"\0"), struct.pack("<h", value)), apart, other)
    line = SerialBus(link, 1, Journal())
    return line, lambda: line.read(1472, 2), link


@each_row("echo", [True, False])
def test_equal_requests_on_a_line_with_echo_have_one_reply_each(echo: bool) -> None:
    """A value that changes from one to the next is no second reply: the echo goes ahead of the next one's own."""
    values = iter(range(100, 200))

    def answer(request: bytes) -> list[Reply]:
        reply = reply_to(request.lstrip(b"\0"), struct.pack("<h", next(values)))
        return [(0.001, (request if echo else b"") + reply)]

    line = SerialBus(ScriptedLink(answer), 1, Journal())
    assert [int.from_bytes(line.read(1472, 2), "little") for _ in range(4)] == [100, 101, 102, 103]
    assert not line.journal.messages


def modbus(tcp: bool, apart: float, other: int) -> Two:
    def reply(request: bytes, value: int) -> bytes:
        pdu = b"\x03\x02" + value.to_bytes(2, "big")
        if tcp:
            return modbus_frames.tcp(int.from_bytes(request[:2], "big"), pdu)
        return modbus_frames.rtu(1, pdu)

    line = ModbusBus(link := _answered(reply, apart, other), 1, Journal(), tcp=tcp)
    return line, lambda: line.read(1472, 2), link


def can(apart: float, other: int) -> Two:
    def answer(request: CanFrame) -> list[tuple[float, CanFrame]]:
        replies = [CanFrame(request.can_id, struct.pack("<h", value)) for value in (100, other)]
        return [(0.001, replies[0]), (0.001 + apart, replies[1])]

    line = CanBus(link := ScriptedFrames(answer), 1, Journal())
    return line, lambda: line.read(1020, 2), link


def barrett(apart: float, other: int) -> Two:
    def reply(request: bytes, value: int) -> bytes:
        if request.startswith(b"!"):
            return gcl("!\0", "ERR 32") if value == 100 else b""
        return gcl(request[:-1].decode(), f"{value} 0 0 0")

    hand = hand_on(link := _answered(reply, apart, other))
    return hand.line, lambda: hand.line.read("FGET P"), link


def ekso(apart: float, other: int) -> Two:
    def reply(request: bytes, value: int) -> bytes:
        return frame(request[0], int.from_bytes(request[2:4], "big"), pack([value] * 27))

    port = DataPort(link := _answered(reply, apart, other), Journal())
    return port, lambda: port.read(Command.GET_DATA), link


WIRES: dict[str, Callable[[float, int], Two]] = {
    "serial": serial,
    "rtu": lambda apart, other: modbus(False, apart, other),
    "tcp": lambda apart, other: modbus(True, apart, other),
    "can": can,
    "barrett": barrett,
    "ekso": ekso,
}


def told(journal: Journal) -> int:
    return sum(message.code == "two-replies" for message in journal.messages)


@each_row("wire", WIRES)
@each_row("apart", [0.0, 0.004])
def test_two_different_replies_are_told_once(wire: str, apart: float) -> None:
    """Whether the second comes in the same piece or before the next request."""
    line, ask, link = WIRES[wire](apart, 300)
    for _ in range(3):
        ask()
        link.sleep(0.05)
    assert told(line.journal) == 1


@each_row("wire", WIRES)
def test_the_same_reply_twice_is_no_contradiction(wire: str) -> None:
    line, ask, link = WIRES[wire](0.004, 100)
    for _ in range(3):
        ask()
        link.sleep(0.05)
    assert told(line.journal) == 0


@each_row("wire", WIRES)
def test_a_late_reply_to_a_request_that_was_given_up_is_no_contradiction(wire: str) -> None:
    line, ask, link = WIRES[wire](0.004, 300)
    line.gave_up = True
    for _ in range(3):
        ask()
        link.sleep(0.05)
    assert told(line.journal) == 0


KINDS = {"exo": {"kind": "exo"}, "hand": {"kind": "hand", "model": "df"}}


@each_row("kind", list(KINDS))
@each_row("words", [("get", "{0}"), ("dump",), ("status",), ("set", "{1}", "-y")])
def test_every_verb_says_so(kind: str, words: tuple[str, ...], tmp_path: Path) -> None:
    """Over a serial server that hands on what came in 50 ms in one piece."""
    names = {"exo": ("position_actual", "force_set.ring=100"), "hand": ("angle_actual", "speed_set.ring=500")}[kind]
    (path := tmp_path / "bus.toml").write_text(
        text("serial-server", [{**KINDS[kind], "id": 1}, {**KINDS[kind], "id": 1, "turnaround": 0.03}]),
        encoding="utf-8",
    )
    link = f"fake://bus?clock=virtual&file={path}"
    result = run(kind, *(word.format(*names) for word in words), "-p", link, "--json")
    codes = [message["code"] for message in result.json["messages"]]
    # The set points of both are alike, and an EH55BF1 is identified by what both hold alike.
    seen = (kind, words[0]) != ("exo", "set")
    assert (result.code, codes.count("two-replies")) == (6 if seen and words[0] == "set" else 0, seen), result


@each_row("wire", ["serial", "rtu", "tcp", "can"])
@each_row("apart", [0.0, 0.004])
def test_a_write_that_two_would_obey_is_neither_asked_about_nor_sent(wire: str, apart: float) -> None:
    """Once the command has written, what follows may be what ends that."""
    for other, written, refused in ((300, 0, True), (300, 1, False), (100, 0, False)):
        line, ask, link = WIRES[wire](apart, other)
        assert isinstance(line, RegisterBus)
        ask()
        link.sleep(0.05)
        sent = len(link.sent)
        line.journal.counters.writes = written
        for attempt in (line.ready_to_ask, partial(line.write, 1040, b"\0\0")):
            try:
                attempt()
            except DeviceRefused as exc:
                assert refused and exc.code == "twin-id"
            except HandctlError:
                assert not refused and attempt != line.ready_to_ask  # this device acknowledges nothing
            else:
                assert not refused and attempt == line.ready_to_ask
        assert (len(link.sent) == sent) == refused
