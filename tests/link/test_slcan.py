"""slcan adapters: who they say they are, what their lines mean, listening only; each against the served simulator or a
scripted port. python-can itself opens the same simulator beside it."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
import pytest

from handctl.errors import HandctlError, LinkError, UsageError
from handctl.link import CanFrame, open_link
from handctl.link.can import CanLink
from handctl.link.slcan import said_flags
from handctl.sim.engine.serve import send_control
from tests.support.cli import PATIENCE, Simulator, run
from tests.support.each_row import each_row
from tests.support.virtual import Answering, Clock, Loop, virtual_time

PROBE = CanFrame(0x10FF0001, b"\x02")
TCP = ("--slcan-tcp", "127.0.0.1:0")


@pytest.fixture
def time_jumps() -> Iterator[Clock]:
    """Nobody waits in earnest."""
    with virtual_time() as clock:
        yield clock


def opened(name: str) -> CanLink:
    link = open_link(name)
    assert isinstance(link, CanLink)
    return link


# -- who is there ---------------------------------------------------------------------------------------------------------


def probed(link: CanLink) -> str:
    """What comes back from the wrist."""
    link.send(PROBE, link.deadline(PATIENCE))
    return str(link.receive(link.deadline(PATIENCE)))


@each_row("place", [("--slcan-pty",), TCP])
def test_the_adapter_says_who_it_is(place: tuple[str, ...]) -> None:
    with Loop("wrist", *place) as loop:
        link = opened(loop.link)
        assert link.adapter == "hardware 1.0, firmware 1.3, serial number SIM1"
        assert probed(link) == "10FF0001 [2] A7 FE"
        trouble = link.trouble()
        assert trouble is not None and (trouble.code, link.error_frames, link.damaged) == ("", 0, 0)
        link.close()


def test_an_old_adapter_without_version_is_one_all_the_same() -> None:
    with Loop("wrist", *TCP, "--fault", "no-status") as loop:
        link = opened(loop.link)
        assert link.adapter == "" and probed(link) == "10FF0001 [2] A7 FE" and link.trouble() is None
        link.close()


@each_row("bare", [b"\r" * 4, b"\r" * 2])
def test_an_adapter_that_acknowledges_what_it_does_not_know_is_one(
    time_jumps: Clock, monkeypatch: pytest.MonkeyPatch, bare: bytes
) -> None:
    """A bare CR to V and N: it gets its commands, and says no name."""
    port = Answering(lambda data: bare if b"V" in data else b"\r\r\rF00\r" if b"S8" in data else b"")
    monkeypatch.setattr("serial.serial_for_url", lambda *_, **__: port)
    link = open_link("can:slcan:socket://192.0.2.7:1")
    assert isinstance(link, CanLink) and link.adapter == ""
    assert port.heard.startswith(b"\r\rV\rN\rC\rS8\rO\rF\r")
    link.close()


@each_row(
    ("answer", "words"),
    [
        (lambda _data: b"", "silent"),
        (lambda _data: b"\r", "silent"),
        (lambda _data: b"\r\r\r\r=> ", "0D 0D 0D 0D 3D 3E 20"),
        (lambda data: data, "only our own bytes"),
        (lambda _data: b"\x90\xeb\x01\x04\x30\xfc\x03\x00\xff", "90 EB 01 04"),
        (lambda _data: b"\r\n=> ", "0D 0A 3D 3E 20"),
        (lambda _data: b"ERROR\r\n", "45 52 52 4F 52"),
    ],
)
def test_a_port_that_is_no_adapter_is_named_and_gets_no_command(
    time_jumps: Clock, monkeypatch: pytest.MonkeyPatch, answer: Callable[[bytes], bytes], words: str
) -> None:
    """C would close a BarrettHand, and S, O are commands of others as well: only version and number are asked for."""
    port = Answering(answer)
    monkeypatch.setattr("serial.serial_for_url", lambda *_, **__: port)
    with pytest.raises(LinkError) as caught:
        open_link("can:slcan:socket://192.0.2.7:1")
    assert (caught.value.code, caught.value.exit_code) == ("not-slcan", 3)
    assert words in caught.value.text and "socket://192.0.2.7:1" in caught.value.text
    assert port.heard == b"\r\rV\rN\r"
    assert not port.is_open, "while the error is still at hand"


@pytest.mark.real
def test_a_terminal_that_is_no_adapter_is_locked_no_more() -> None:
    """And an adapter is found on a terminal and over TCP of the system."""
    with Simulator("--pty", kind="wrist") as port:
        for _ in range(2):
            with pytest.raises(LinkError, match="does not reply as an slcan adapter") as caught:
                open_link(f"can:slcan:{port.link}")
            assert caught.value.code == "not-slcan"  # the second time, too: not "busy"
            open_now = [os.path.realpath(f"/proc/self/fd/{one}") for one in os.listdir("/proc/self/fd")]
            assert port.link not in open_now
    for place in (("--slcan-pty",), TCP):
        with Simulator(*place, kind="wrist") as adapter:
            link = opened(adapter.link)
            assert probed(link) == "10FF0001 [2] A7 FE"
            if place != TCP:
                with pytest.raises(LinkError, match="in use"):
                    open_link(adapter.link)
            link.close()


def test_who_only_stops_asks_nothing() -> None:
    """Another handctl has the port open then, and gets the answers."""
    with Loop("wrist", *TCP, "--fault", "no-adapter", "--control", "control") as loop:
        open_link(loop.link, exclusive=False).close()
        assert b"V".hex() not in loop.tell("heard")


def test_a_bitrate_that_an_adapter_has_not() -> None:
    with Loop("wrist", *TCP) as loop, pytest.raises(UsageError, match="1000000"):
        open_link(loop.link + "?bitrate=12345")


# -- lines ------------------------------------------------------------------------------------------------------------------


def told(*lines: bytes) -> Any:
    """Our link after an adapter's lines."""
    link = CanLink("can:slcan:loop://", exclusive=False)
    wire = link._bus.serialPortOrig  # type: ignore[attr-defined]
    wire.reset_input_buffer()
    wire.write(b"".join(lines))
    return link


@each_row(
    ("line", "damaged", "errors"),
    [
        (b"\r", 0, 0), (b"z\r", 0, 0), (b"Z\r", 0, 0), (b"F24\r", 0, 0), (b"\x07", 0, 1),
        (b"t1230\r", 0, 0), (b"R10FF00012\r", 0, 0), (b"\nZ\r", 0, 0),
        (b"e1a\r", 0, 1), (b"sp000128\r", 0, 1), (b"sb000256\r", 0, 1), (b"sa057033\r", 0, 0),
        (b"T10FF00\r", 1, 0), (b"T10FF00012A7\r", 1, 0), (b"T30FF00012A7FE\r", 1, 0), (b"T10FF00019\r", 1, 0),
        (b"T10FF0001 2A7FE\r", 1, 0), (b"T10FF00012A7FE12\r", 1, 0), (b"T10FF00012A7F\xff\r", 1, 0), (b"XYZ\r", 1, 0), (b"sb\r", 1, 0), (b"FXX\r", 1, 0),
    ],
)  # fmt: skip
def test_what_a_line_means(time_jumps: Clock, line: bytes, damaged: int, errors: int) -> None:
    link = told(line, b"T10FF00012A7FE\r")
    assert str(link.receive(link.deadline(0.1))) == "10FF0001 [2] A7 FE"
    assert (link.damaged, link.error_frames) == (damaged, errors)


def test_a_frame_with_a_time_stamp(time_jumps: Clock) -> None:
    link = told(b"T10FF00012A7FE1234\r")
    assert str(link.receive(link.deadline(0.1))) == "10FF0001 [2] A7 FE"


def test_a_line_without_end_is_bounded(time_jumps: Clock) -> None:
    link = told(b"\rT10FF00012A7FE\r")
    link._bus._buffer.extend(b"T" * 6000)
    assert str(link.receive(link.deadline(0.1))) == "10FF0001 [2] A7 FE"
    assert link.damaged >= 1


@each_row("came", [b"T10FF00012A7FE\r", b"x"])
def test_what_never_pauses_holds_up_no_end(time_jumps: Clock, monkeypatch: pytest.MonkeyPatch, came: bytes) -> None:
    """A bus that is full of others, or a port that is no adapter: what waits for one line ends all the same."""
    bus: Any = told()._bus

    def filled(_end: float) -> bool:
        time_jumps.sleep(0.001)
        bus._buffer.extend(came)
        return True

    monkeypatch.setattr(bus, "_fill", filled)
    for ask in (bus.flags, lambda: bus.recv(0.1) and None):
        began = time_jumps.now()
        assert ask() is None and time_jumps.now() - began < 1.0, ask


@each_row(
    ("flags", "text"),
    [(0, "00: no error"), (0xA4, "A4: error warning, error passive, bus error"), (2, "02: transmit queue full")],
)
def test_flags_in_words(flags: int, text: str) -> None:
    assert said_flags(flags) == text


# -- what the controller reports -----------------------------------------------------------------------------------------


@each_row(
    ("fault", "code"),
    [
        ("no-ack", "no-ack"), ("no-ack,queue", "no-ack"), ("no-ack,no-status", "bel"), ("no-ack,reports,no-status", "no-ack"),
        ("bus-off", "bus-off"), ("bus-off,queue", "bus-off"), ("bus-off,reports,no-status", "bus-off"), ("bel", "refused"),
        ("twin-id", "bus-errors"), ("silent", ""),
    ],
)  # fmt: skip
def test_conditions_of_the_bus(fault: str, code: str) -> None:
    with Loop("wrist", *TCP, "--fault", fault) as loop:
        link = opened(loop.link)
        link.send(PROBE, link.deadline(PATIENCE))
        assert link.receive(link.deadline(0.1)) is None
        trouble = link.trouble()
        assert trouble is not None and trouble.code == code
        link.close()


def test_bus_off_ends_with_the_next_opening() -> None:
    with Loop("wrist", *TCP, "--fault", "bus-off", "--every", "2") as loop:
        codes = [run("wrist", "get", "yaw_actual", "-p", loop.link, "--json").code for _ in range(3)]
    assert codes == [0, 3, 0]


@each_row(("number", "code", "exit_code"), [(105, "no-ack", 4), (100, "down", 3), (5, "cannot-send", 3)])
def test_what_linux_says_of_a_frame_that_does_not_go_out(
    monkeypatch: pytest.MonkeyPatch, number: int, code: str, exit_code: int
) -> None:
    link = opened("can:virtual:handctl-slcan")

    def refuse(*args: object, **more: object) -> None:
        raise can.CanOperationError("Failed to transmit", number)

    monkeypatch.setattr(link._bus, "send", refuse)
    with pytest.raises(HandctlError) as caught:
        link.send(PROBE, link.deadline(PATIENCE))
    assert (caught.value.code, caught.value.exit_code) == (code, exit_code)
    link.close()


def test_bus_off_in_error_frames_of_linux(monkeypatch: pytest.MonkeyPatch) -> None:
    link = opened("can:virtual:handctl-slcan")
    link._interface = "socketcan"
    came: list[int] = []

    def error_frame(_seconds: float) -> tuple[can.Message | None, bool]:
        frame = can.Message(arbitration_id=came.pop(0), is_error_frame=True, dlc=8, data=bytes(8)) if came else None
        return frame, False

    monkeypatch.setattr(link._bus, "_recv_internal", error_frame)
    for classes, code in ((0x20, "no-ack"), (0x40, "bus-off"), (0x04, "bus-off"), (0x100, "no-ack")):
        came.append(classes)
        assert link.receive(link.deadline(0)) is None
        trouble = link.trouble()
        assert trouble is not None and trouble.code == code
    link.close()


# -- bitrates, listening only ------------------------------------------------------------------------------------------------


def test_the_bitrate_is_heard_without_sending() -> None:
    words = ("doctor", "--family", "wrist", "--json", "--count", "2", "-p")
    options = ("--set", "bitrate=500000", "--set", "traffic=200", "--control", "control")
    with Loop("wrist", *TCP, *options) as loop:
        result = run(*words, loop.link)
        rows = {row["check"]: row for row in result.json["rows"]}
        assert result.code == 7
        assert rows["adapter"]["status"] == "ok"
        assert rows["bitrate"]["status"] == "fail"
        assert "500000" in rows["bitrate"]["evidence"] and "?bitrate=500000" in rows["bitrate"]["remedy"]
        sent = b"".join(bytes.fromhex(text) for _, text in json.loads(loop.tell("heard").removeprefix("ok ")))
        opening, *listening = sent.split(b"C\r")[1:]
        assert opening.startswith(b"S8\rO\r")
        assert [part[:5] for part in listening[:2]] == [b"S8\rL\r", b"S6\rL\r"]
        assert not any(b"T" in part for part in listening)
        found = run(*words, loop.link + "?bitrate=500000")
        assert {row["check"]: row["status"] for row in found.json["rows"]}["bus"] == "ok"


def test_a_quiet_bus_has_no_bitrate_to_hear() -> None:
    with Loop("wrist", *TCP, "--fault", "no-ack") as loop:
        result = run("doctor", "--family", "wrist", "-p", loop.link, "--json", "--count", "2")
    rows = {row["check"]: row for row in result.json["rows"]}
    assert (rows["bus"]["status"], rows["bitrate"]["status"]) == ("fail", "skipped")
    assert "acknowledge" in rows["bus"]["evidence"]


def test_other_interfaces_cannot_be_asked() -> None:
    link = opened("can:virtual:handctl-slcan")
    assert (link.adapter, link.listen(1000000, 0.0), link.trouble()) == (None, None, None)
    link.resume()
    link.close()


# -- python-can on the same simulator -----------------------------------------------------------------------------------------


@pytest.mark.real
def test_python_can_finds_the_same_adapter(tmp_path: Path) -> None:
    control = str(tmp_path / "control")
    with Simulator("--slcan-pty", "--control", control, kind="wrist") as server:
        for fault, flags in (("silent", b"F00\r"), ("no-ack", b"FA4\r"), ("no-ack,queue", b"FA4\r")):
            assert send_control(control, f"fault {fault}") == f"ok fault {fault}"
            channel = server.link.removeprefix("can:slcan:")
            with can.Bus(interface="slcan", channel=channel, bitrate=1000000, sleep_after_open=0) as bus:
                assert bus.get_version(PATIENCE) == (10, 13)  # type: ignore[attr-defined]
                assert bus.get_serial_number(PATIENCE) == "SIM1"  # type: ignore[attr-defined]
                bus.send(can.Message(arbitration_id=0x10FF0001, data=[2]))
                port = bus.serialPortOrig  # type: ignore[attr-defined]
                port.timeout = PATIENCE
                port.read(1 if fault == "no-ack" else 2)  # BEL, or Z: it has taken the frame
                port.write(b"F\r")
                assert port.read(4) == flags, fault
