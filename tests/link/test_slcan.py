"""slcan adapters: who they say they are, what their lines mean, listening only; each against the served simulator or a
scripted port. python-can itself opens the same simulator beside it."""

from __future__ import annotations

import json
import os
import pty
import select
import subprocess
import sys
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import can
import pytest

from handctl.errors import HandctlError, LinkError, UsageError
from handctl.link import CanFrame, open_link
from handctl.link.can import CanLink
from handctl.link.slcan import said_flags
from tests.support.cli import PATIENCE, run

PROBE = CanFrame(0x10FF0001, b"\x02")
Serve = Callable[..., str]


@pytest.fixture
def serve() -> Iterator[Serve]:
    """A simulated wrist behind an slcan adapter; gives its LINK."""
    processes: list[subprocess.Popen[str]] = []

    def start(*options: str, place: str = "--slcan-pty") -> str:
        command = [sys.executable, "-m", "handctl", "sim", "wrist", *place.split(), *options]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        processes.append(process)
        assert process.stdout is not None
        return str(json.loads(process.stdout.readline())["link"])

    yield start
    for process in processes:
        process.terminate()
        process.wait()


def opened(name: str) -> CanLink:
    link = open_link(name)
    assert isinstance(link, CanLink)
    return link


# -- who is there ---------------------------------------------------------------------------------------------------------


@pytest.mark.real
@pytest.mark.parametrize("place", ["--slcan-pty", "--slcan-tcp 127.0.0.1:0"])
def test_the_adapter_says_who_it_is(serve: Serve, place: str) -> None:
    link = opened(serve(place=place))
    assert link.adapter == "hardware 1.0, firmware 1.3, serial number SIM1"
    link.send(PROBE, link.deadline(PATIENCE))
    assert str(link.receive(link.deadline(PATIENCE))) == "10FF0001 [2] A7 FE"
    trouble = link.trouble()
    assert trouble is not None and (trouble.code, link.error_frames, link.damaged) == ("", 0, 0)
    link.close()


@pytest.mark.real
def test_an_old_adapter_without_version_is_one_all_the_same(serve: Serve) -> None:
    link = opened(serve("--fault", "no-status"))
    assert link.adapter == ""
    link.send(PROBE, link.deadline(PATIENCE))
    assert str(link.receive(link.deadline(PATIENCE))) == "10FF0001 [2] A7 FE"
    assert link.trouble() is None
    link.close()


class Port:
    """A port with somebody behind it that is no adapter: what it answers to bytes, and what it heard."""

    def __init__(self, answer: Callable[[bytes], bytes]) -> None:
        self._far, near = pty.openpty()
        tty.setraw(near, termios.TCSANOW)
        self.name = os.ttyname(near)
        self._near = near
        self.heard = b""
        self._answer = answer
        self._end, self._ended = os.pipe()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        while self._end not in select.select([self._far, self._end], [], [])[0]:
            data = os.read(self._far, 1000)
            self.heard += data
            os.write(self._far, self._answer(data))

    def close(self) -> None:
        os.close(self._ended)
        self._thread.join(PATIENCE)  # before the number that it reads from is another file's
        for descriptor in (self._end, self._near, self._far):
            os.close(descriptor)


@pytest.mark.real
@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda data: b"", "silent"),
        (lambda data: data, "only our own bytes"),
        (lambda data: b"\x90\xeb\x01\x04\x30\xfc\x03\x00\xff", "90 EB 01 04"),
        (lambda data: b"\r\n=> ", "0D 0A 3D 3E 20"),
        (lambda data: b"ERROR\r\n", "45 52 52 4F 52"),
    ],
)
def test_a_port_that_is_no_adapter_is_named_and_gets_no_command(answer: Callable[[bytes], bytes], words: str) -> None:
    """C would close a BarrettHand, and S, O are commands of others as well: only version and number are asked for."""
    port = Port(answer)
    with pytest.raises(LinkError) as caught:
        open_link(f"can:slcan:{port.name}")
    time.sleep(0.05)
    assert (caught.value.code, caught.value.exit_code) == ("not-slcan", 3)
    assert words in caught.value.text
    assert port.name in caught.value.text
    assert port.heard == b"\r\rV\rN\r"
    open_now = [os.readlink(one) for one in Path("/proc/self/fd").iterdir() if one.is_symlink()]
    assert open_now.count(port.name) == 1, "it is ours alone, while the error is still at hand"
    with pytest.raises(LinkError, match="does not answer as an slcan adapter"):  # nobody has it locked
        open_link(f"can:slcan:{port.name}")
    port.close()


@pytest.mark.real
def test_who_only_stops_asks_nothing(serve: Serve) -> None:
    """Another handctl has the port open then, and gets the answers."""
    link = open_link(serve("--fault", "no-adapter"), exclusive=False)
    link.close()


@pytest.mark.real
def test_a_bitrate_that_an_adapter_has_not(serve: Serve) -> None:
    with pytest.raises(UsageError) as caught:
        open_link(serve() + "?bitrate=12345")
    assert "1000000" in caught.value.text


# -- lines ------------------------------------------------------------------------------------------------------------------


def told(*lines: bytes) -> Any:
    """Our link after an adapter's lines."""
    link = CanLink("can:slcan:loop://", exclusive=False)
    wire = link._bus.serialPortOrig  # type: ignore[attr-defined]
    wire.reset_input_buffer()
    wire.write(b"".join(lines))
    return link


@pytest.mark.real
@pytest.mark.parametrize(
    ("line", "damaged", "errors"),
    [
        (b"\r", 0, 0), (b"z\r", 0, 0), (b"Z\r", 0, 0), (b"F24\r", 0, 0), (b"\x07", 0, 1),
        (b"t1230\r", 0, 0), (b"R10FF00012\r", 0, 0), (b"\nZ\r", 0, 0),
        (b"e1a\r", 0, 1), (b"sp000128\r", 0, 1), (b"sb000256\r", 0, 1), (b"sa057033\r", 0, 0),
        (b"T10FF00\r", 1, 0), (b"T10FF00012A7\r", 1, 0), (b"T30FF00012A7FE\r", 1, 0), (b"T10FF00019\r", 1, 0),
        (b"T10FF0001 2A7FE\r", 1, 0), (b"T10FF00012A7F\xff\r", 1, 0), (b"XYZ\r", 1, 0), (b"sb\r", 1, 0), (b"FXX\r", 1, 0),
    ],
)  # fmt: skip
def test_what_a_line_means(line: bytes, damaged: int, errors: int) -> None:
    link = told(line, b"T10FF00012A7FE\r")
    assert str(link.receive(link.deadline(0.1))) == "10FF0001 [2] A7 FE"
    assert (link.damaged, link.error_frames) == (damaged, errors)


@pytest.mark.real
def test_a_frame_with_a_time_stamp() -> None:
    link = told(b"T10FF00012A7FE1234\r")
    assert str(link.receive(link.deadline(0.1))) == "10FF0001 [2] A7 FE"


@pytest.mark.real
def test_a_line_without_end_is_bounded() -> None:
    link = told(b"\rT10FF00012A7FE\r")
    link._bus._buffer.extend(b"T" * 6000)
    assert str(link.receive(link.deadline(0.1))) == "10FF0001 [2] A7 FE"
    assert link.damaged >= 1


@pytest.mark.parametrize(
    ("flags", "text"),
    [(0, "00: no error"), (0xA4, "A4: error warning, error passive, bus error"), (2, "02: transmit queue full")],
)
def test_flags_in_words(flags: int, text: str) -> None:
    assert said_flags(flags) == text


# -- what the controller reports -----------------------------------------------------------------------------------------


@pytest.mark.real
@pytest.mark.parametrize(
    ("fault", "code"),
    [
        ("no-ack", "no-ack"), ("no-ack,queue", "no-ack"), ("no-ack,no-status", "bel"), ("no-ack,reports,no-status", "no-ack"),
        ("bus-off", "bus-off"), ("bus-off,queue", "bus-off"), ("bus-off,reports,no-status", "bus-off"), ("bel", "refused"),
        ("twin-id", "bus-errors"), ("silent", ""),
    ],
)  # fmt: skip
def test_conditions_of_the_bus(serve: Serve, fault: str, code: str) -> None:
    name, found = serve("--fault", fault), list[str | None]()
    while code not in found and len(found) < 10:  # on a busy machine the adapter may say it too late
        link = opened(name)
        link.send(PROBE, link.deadline(PATIENCE))
        assert link.receive(link.deadline(0.1)) is None
        trouble = link.trouble()
        found.append(None if trouble is None else trouble.code)
        link.close()
    assert code in found, found


@pytest.mark.real
def test_bus_off_ends_with_the_next_opening(serve: Serve) -> None:
    link = serve("--fault", "bus-off", "--every", "2")
    codes = [run("wrist", "get", "yaw_actual", "-p", link, "--json").code for _ in range(3)]
    assert codes == [0, 3, 0]


@pytest.mark.parametrize(("number", "code", "exit_code"), [(105, "no-ack", 4), (100, "down", 3), (5, "cannot-send", 3)])
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


@pytest.mark.real
def test_the_bitrate_is_heard_without_sending(serve: Serve, tmp_path: Path) -> None:
    control = tmp_path / "control"
    link = serve("--set", "bitrate=500000", "--set", "traffic=200", "--control", str(control))
    result = run("doctor", "--family", "wrist", "-p", link, "--json", "--count", "2")
    rows = {row["check"]: row for row in result.json["rows"]}
    assert result.code == 7
    assert rows["adapter"]["status"] == "ok"
    assert rows["bitrate"]["status"] == "fail"
    assert "500000" in rows["bitrate"]["evidence"] and "?bitrate=500000" in rows["bitrate"]["remedy"]
    heard = run("sim", "control", control, "heard").out.strip()
    sent = b"".join(bytes.fromhex(text) for _, text in json.loads(heard))
    opening, *listening = sent.split(b"C\r")[1:]
    assert opening.startswith(b"S8\rO\r")
    assert [part[:5] for part in listening[:2]] == [b"S8\rL\r", b"S6\rL\r"]
    assert not any(b"T" in part for part in listening)
    found = run("doctor", "--family", "wrist", "-p", link + "?bitrate=500000", "--json", "--count", "2")
    assert {row["check"]: row["status"] for row in found.json["rows"]}["bus"] == "ok"


@pytest.mark.real
def test_a_quiet_bus_has_no_bitrate_to_hear(serve: Serve) -> None:
    result = run("doctor", "--family", "wrist", "-p", serve("--fault", "no-ack"), "--json", "--count", "2")
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
@pytest.mark.parametrize(("fault", "flags"), [("silent", b"F00\r"), ("no-ack", b"FA4\r"), ("no-ack,queue", b"FA4\r")])
def test_python_can_finds_the_same_adapter(serve: Serve, fault: str, flags: bytes) -> None:
    channel = serve("--fault", fault).removeprefix("can:slcan:")
    with can.Bus(interface="slcan", channel=channel, bitrate=1000000, sleep_after_open=0) as bus:
        assert bus.get_version(PATIENCE) == (10, 13)  # type: ignore[attr-defined]
        assert bus.get_serial_number(PATIENCE) == "SIM1"  # type: ignore[attr-defined]
        bus.send(can.Message(arbitration_id=0x10FF0001, data=[2]))
        while bus.recv(0.05):
            pass
        port = bus.serialPortOrig  # type: ignore[attr-defined]
        port.timeout = PATIENCE
        port.reset_input_buffer()
        port.write(b"F\r")
        assert port.read(4) == flags
