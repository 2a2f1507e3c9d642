"""`listen` of every family: what it sends (nothing), what it says of bytes that come by themselves, and how it ends."""

from __future__ import annotations

import json
import os
import struct
import sys
from pathlib import Path
from typing import Any

import pytest

from handctl.families import FAMILIES
from handctl.link import fake
from handctl.system import serial_ports
from handctl.tools import listen as tool
from handctl.tools.family_probe import family_of
from tests.contract.facts import facts_of, passed
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.person import person, pressed_at
from tests.support.virtual import Loop

WIRES = [(family, wire) for family in FAMILIES for wire in family_of(family).wires or ("",)]
FAULTS = ("", "silent", "echo", "disconnect")
READ, REPLY = "EB 90 01 04 11 E8 03 01 02", "90 EB 01 04 11 E8 03 01 02"
PROMPT = b"\r\nBarrettHand\r\n=> ".hex(" ")


def recorded(folder: Path, *lines: str) -> str:
    """The LINK of a transcript in which the device speaks by itself."""
    (folder / "said.txt").write_text("".join(f"{line}\n" for line in lines))
    return f"replay:{folder / 'said.txt'}"


# -- it sends nothing -------------------------------------------------------------------------------------------------


@each_row("wire, fault", [(wire, fault) for wire in WIRES for fault in FAULTS])
def test_not_a_byte_leaves(wire: tuple[str, str], fault: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever the device does or does not do; the transcript of another one is looked at by other means."""

    def refused(*_: object) -> None:
        raise AssertionError("listen sends")

    for link in (fake.FakeLink, fake.FakeFrames):
        monkeypatch.setattr(link, "_say", refused)
    family, bus = wire
    trace = tmp_path / "trace"
    options = [f"bus={bus}"] if bus and bus != "serial" else []
    options += [f"fault={fault}"] if fault else []
    result = run(
        family,
        "listen",
        "--duration",
        "1",
        "--trace",
        trace,
        "--json",
        "-p",
        facts_of(family).link(family, "", *options),
    )
    assert not [one for one in passed(trace) if one.mark == ">"], result
    rows, end = result.stream
    assert result.code in ((0,) if rows else (3, 4)), result
    assert bool(rows) == (end["statistics"]["bytes"] > 0)
    assert end["counters"]["sent"] == 0


@each_row("family", [family for family in FAMILIES if family_of(family).baud is not None])
def test_looking_for_the_baud_rate_sends_nothing_either(family: str, tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    result = run(
        family, "listen", "--find-baud", "--duration", "30", "--trace", trace, "-p", facts_of(family).link(family)
    )
    assert (result.code, passed(trace)) == (4, [])


# -- what it says of what comes ---------------------------------------------------------------------------------------


SAID: list[tuple[str, str, str, str, str]] = [
    # family, a line of the transcript, direction, kind, what the meaning holds
    ("barrett", f"1.0 < {PROMPT}", "device", "frame", "prompt, after BarrettHand"),
    ("barrett", "1.0 < 3A", "device", "frame", "boot monitor"),
    ("barrett", f"1.0 < {b'Hello hand'.hex(' ')}", "device", "text", "Hello hand"),
    ("exo", f"1.0 < {REPLY}", "device", "frame", "id = 1"),
    ("exo", f"1.0 < {READ}", "host", "frame", "read id: 1 byte at 1000"),
    ("exo", "1.0 < 01 02 FE", "device", "stray", "3 bytes of no frame"),
    ("wrist", "1.0 < can 11000001 [1] 04", "device", "frame", "read current_1024"),
    ("hand", "1.0 < 01 03 03 E8 00 01 04 7A", "host", "frame", "read id: 1 register"),
    ("aidin", f"1.0 < {b'{}'.hex(' ')}", "device", "frame", "no key"),
    ("ekso", "1.0 < 96 04 00 01 0E 05 25 00 AA EE", "device", "frame", "GetTime: 14:05:37"),
]  # fmt: skip


@each_row("family, line, direction, kind, meaning", SAID)
def test_what_comes_is_explained(
    family: str, line: str, direction: str, kind: str, meaning: str, tmp_path: Path
) -> None:
    result = run(family, "listen", "--json", "-p", recorded(tmp_path, line))
    (row,), end = result.stream
    assert (row["t"], row["direction"], row["kind"]) == (1.0, direction, kind)
    assert meaning in row["meaning"]
    assert result.code == 0
    heard = end["statistics"]
    assert (heard["unknown_bytes"] > 0) == (kind == "stray")
    assert heard["longest_silence"] == 1.0 and heard["silence_from"] == 0.0


def test_what_another_program_asks_names_what_is_answered(tmp_path: Path) -> None:
    """A Modbus reply alone does not say which registers it holds."""
    link = recorded(tmp_path, "1.0 < 01 03 03 E8 00 01 04 7A", "1.01 < 01 03 02 00 01 79 84", "4.0 < FF")
    asked, answer, stray = run("hand", "listen", "--json", "-p", link).stream[0]
    assert (asked["direction"], answer["meaning"]) == ("host", "id = 1, id 1")
    assert (answer["gap"], stray["gap"]) == (0.01, 2.99)


def test_the_summary(tmp_path: Path) -> None:
    lines = [f"{at} < {REPLY}" for at in (1.0, 2.0, 3.0)]
    result = run("exo", "listen", "--json", "-p", recorded(tmp_path, *lines, "9.0 < 01 02"))
    heard = result.stream[1]["statistics"]
    assert {key: heard[key] for key in ("bytes", "frames", "unknown_bytes", "longest_silence", "silence_from")} == {
        "bytes": 29, "frames": 3, "unknown_bytes": 2, "longest_silence": 6.0, "silence_from": 3.0,
    }  # fmt: skip
    assert heard["kinds"] == {"id": 3}
    text = run("exo", "listen", "-p", recorded(tmp_path, *lines, "9.0 < 01 02")).out
    assert all(word in text for word in ("29 bytes", "3 x id", "unknown    2 bytes", "6.000 s at most")), text


def test_a_record_is_opened_again(tmp_path: Path) -> None:
    """By `trace show`, and as a device that says the same."""
    first = run(
        "exo",
        "listen",
        "--json",
        "--trace",
        tmp_path / "kept",
        "-p",
        recorded(tmp_path, f"1.5 < {READ}", f"2 < {REPLY}"),
    )
    again = run("exo", "listen", "--json", "-p", f"replay:{tmp_path / 'kept'}")
    assert again.stream[0] == first.stream[0]
    assert run("trace", "show", tmp_path / "kept", "--json").code == 0
    wrist = recorded(tmp_path, "1.0 < can 11000001 [1] 04")
    assert run("wrist", "listen", "--json", "--trace", tmp_path / "can", "-p", wrist).code == 0
    assert (
        run("wrist", "listen", "--json", "-p", f"replay:{tmp_path / 'can'}").stream[0][0]["bytes"]
        == "can 11000001 [1] 04"
    )


# -- how it ends ------------------------------------------------------------------------------------------------------


@each_row("more, rows", [(("--count", "3"), 3), (("--duration", "0.045"), 4), (("--deadline", "0.045"), 4)])
def test_it_ends_when_it_should(more: tuple[str, ...], rows: int) -> None:
    """An AIDIN-hand says something every 10 ms."""
    result = run("aidin", "listen", "--json", *more, "-p", "fake://aidin?clock=virtual")
    assert (result.code, len(result.stream[0])) == (0, rows)


def test_ctrl_c_ends_it_with_the_summary() -> None:
    with pressed_at(3.0):
        shown = person("exo", "listen", "-p", "fake://exo?clock=virtual")
    assert shown.code == 130
    assert "silence    3.000 s at most" in shown.data


def test_a_lost_link_ends_it(tmp_path: Path) -> None:
    result = run("exo", "listen", "--json", "-p", recorded(tmp_path, f"1 < {REPLY}", "2 ! disconnect"))
    rows, end = result.stream
    assert (result.code, len(rows), end["statistics"]["frames"]) == (3, 1, 1)


# -- the baud rate ----------------------------------------------------------------------------------------------------


def speaks_at(right: int) -> Any:
    """A device that says its prompt ten times a second, at this baud rate."""

    def received(link: Any, _deadline: object) -> tuple[bytes, None]:
        link.sleep(0.1)
        return (b"\r\n=> " if link.baud == right else bytes([0xF8, 0x80, 0xC7])), None

    return received


@each_row("right", [9600, 38400, 600])
def test_the_baud_rate_is_found(right: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """And then it stays there."""
    monkeypatch.setattr(tool, "received", speaks_at(right))
    result = run("barrett", "listen", "--find-baud", "--json", "--duration", "40", "-p", "fake://barrett?clock=virtual")
    rows, end = result.stream
    assert "baud-found" in result.said
    assert end["statistics"]["bauds"][-1]["baud"] == right
    assert [row["meaning"] for row in rows if row["kind"] == "event"][-1:] == (
        [f"baud {right}"] if right != 9600 else []
    )
    assert "garbage" not in result.said


def test_garbage_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tool, "received", speaks_at(38400))
    result = run("barrett", "listen", "--duration", "3", "-p", "fake://barrett?clock=virtual")
    assert (result.code, result.said) == (0, ["garbage"])
    assert "--find-baud" in result.err


def test_a_link_without_a_speed_has_none_to_find(tmp_path: Path) -> None:
    for family, line in (("exo", f"1.0 < {REPLY}"), ("wrist", "1.0 < can 11000001 [1] 04")):
        result = run(family, "listen", "--find-baud", "-p", recorded(tmp_path, line))
        assert result.code == 2


class Uart:
    """What a UART counts: a framing error for each byte that came at another baud rate than `right`."""

    def __init__(self, right: int) -> None:
        self.right, self.counted = right, 7  # before anybody listened

    def received(self, said: bytes) -> Any:
        def receive(link: Any, _deadline: object) -> tuple[bytes, None]:
            link.sleep(0.1)
            self.counted += 0 if link.baud == self.right else 2
            return (said if link.baud == self.right else bytes([0xF8, 0x80, 0xC7])), None

        return receive


def test_framing_errors_refuse_a_baud_rate_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Long before the dwell is over, and also where the bytes seem to make sense."""
    uart = Uart(19200)
    monkeypatch.setattr(tool, "received", uart.received(b"\r\n=> "))
    monkeypatch.setattr(fake.FakeLink, "framing_errors", lambda _: uart.counted)
    result = run("barrett", "listen", "--find-baud", "--json", "--count", "30", "-p", "fake://barrett?clock=virtual")
    rows, end = result.stream
    assert "baud-found" in result.said and "garbage" not in result.said
    moments = [row["t"] for row in rows if row["kind"] == "event"]
    assert [row["meaning"] for row in rows if row["kind"] == "event"] == ["baud 38400", "baud 19200"]
    assert moments[-1] < 1.0 < tool.DWELL
    found = {row["baud"]: row["framing_errors"] for row in end["statistics"]["bauds"]}
    assert found[19200] == 0 and found.get(38400, 2) > 0


def test_bytes_that_seem_to_make_sense_with_framing_errors_are_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    uart = Uart(0)
    monkeypatch.setattr(tool, "received", lambda link, _: (link.sleep(0.1), (b"\r\n=> ", None))[1])
    monkeypatch.setattr(fake.FakeLink, "framing_errors", lambda _: setattr(uart, "counted", uart.counted + 1) or uart.counted)  # fmt: skip
    result = run("barrett", "listen", "--find-baud", "--duration", "9", "-p", "fake://barrett?clock=virtual")
    assert "baud-found" not in result.said


def test_a_port_that_counts_no_framing_errors_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tool, "received", speaks_at(38400))
    words = ("barrett", "listen", "--find-baud", "--duration", "20", "-p", "fake://barrett?clock=virtual")
    assert [row["framing_errors"] for row in run(*words, "--json").stream[1]["statistics"]["bauds"]][-1:] == [None]
    assert "does not count framing errors" in run(*words).out


@pytest.mark.real
def test_a_pty_counts_no_framing_errors() -> None:
    ours, theirs = os.openpty()
    try:
        assert serial_ports.framing_errors(theirs) is None and serial_ports.framing_errors(ours) is None
    finally:
        os.close(ours)
        os.close(theirs)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not count them")
def test_the_drivers_counts_are_read_in_their_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """cts dsr rng dcd rx tx frame overrun parity brk buf_overrun (linux/serial.h)."""
    import fcntl

    counts = struct.pack("20i", 1, 2, 3, 4, 500, 600, 70, 8, 9, 11, 12, *[0] * 9)
    monkeypatch.setattr(fcntl, "ioctl", lambda fd, request, room: counts if (fd, request, len(room)) == (5, 0x545D, 80) else b"")  # fmt: skip
    assert serial_ports.framing_errors(5) == 81


# -- the bitrate of a CAN bus -----------------------------------------------------------------------------------------


CAN = "fake://wrist?bus=can&clock=virtual"


@each_row("family, right", [("wrist", 1000000), ("wrist", 500000), ("hand", 500000)])
def test_the_bitrate_is_found_by_listening_only(family: str, right: int, tmp_path: Path) -> None:
    """And then it stays there. On the way nothing is acknowledged."""
    link = f"fake://{family}?bus=can&clock=virtual&bitrate={right}&traffic=20" + (
        "&model=tp" if family == "hand" else ""
    )
    trace = tmp_path / f"{family}{right}"
    result = run(family, "listen", "--find-baud", "--json", "--duration", "20", "--trace", trace, "-p", link)
    rows, end = result.stream
    assert (result.code, "baud-found" in result.said) == (0, True), result
    assert end["statistics"]["bitrate"] == right and end["counters"]["sent"] == 0
    turns = [row["meaning"] for row in rows if row["kind"] == "event"]
    assert turns == ([] if right == 1000000 else [f"bitrate {right}"])
    assert sum(row["kind"] != "event" for row in rows) > 200, "it goes on to listen there"
    assert ("! bitrate" in trace.read_text()) == bool(turns)
    assert run("trace", "show", trace, "--json").code == 0


def test_a_silent_bus_has_no_bitrate_to_find() -> None:
    result = run("wrist", "listen", "--find-baud", "--json", "--duration", "30", "-p", f"{CAN}&bitrate=500000")
    assert result.code == 4 and "nothing-heard" in result.said


def test_errors_at_every_bitrate_are_no_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    """A device that nobody acknowledges, or a bus without termination: nothing whole ever comes."""
    monkeypatch.setattr(fake.FakeFrames, "bus_errors", lambda _: True)
    result = run("wrist", "listen", "--find-baud", "--json", "--duration", "30", "-p", CAN)
    assert result.code == 5 and "bus-errors" in result.said
    assert "125000" in result.out and "?bitrate=" in result.out


def test_an_adapter_only_listens_from_its_first_moment() -> None:
    """Opened with L, not with O: at a wrong bitrate a controller that takes part destroys the frames of others."""
    options = ("--slcan-tcp", "127.0.0.1:0", "--set", "bitrate=500000", "--set", "traffic=50", "--control", "control")
    with Loop("wrist", *options) as loop:
        result = run("wrist", "listen", "--find-baud", "--json", "--count", "20", "-p", loop.link)
        assert (result.code, result.stream[1]["statistics"]["bitrate"]) == (0, 500000), result
        heard = b"".join(bytes.fromhex(text) for _, text in json.loads(loop.tell("heard").removeprefix("ok ")))
    opened = heard.split(b"C\r")[1:]
    assert [part[:5] for part in opened[:3] if part] == [b"S8\rL\r", b"S8\rL\r", b"S6\rL\r"]
    assert b"O\r" not in heard and b"T" not in heard


def test_frames_of_another_kind_show_the_bitrate_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Standard frames are passed over, but a whole frame is a whole frame."""
    monkeypatch.setattr(fake.FakeFrames, "passed_over", 3)
    result = run("wrist", "listen", "--find-baud", "--json", "--duration", "5", "-p", CAN)
    assert "baud-found" in result.said and result.code == 0


def test_other_interfaces_are_set_from_outside() -> None:
    result = run("wrist", "listen", "--find-baud", "--json", "-p", "can:virtual:handctl-listen")
    assert result.code == 2 and "no-listen-only" in result.said


def test_a_bitrate_that_the_adapter_lacks_is_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    plain, tried = fake.FakeFrames.only_listen, []

    def only_listen(link: fake.FakeFrames, bitrate: int) -> bool | None:
        tried.append(bitrate)
        return bitrate not in (500000, 250000) and plain(link, bitrate)

    monkeypatch.setattr(fake.FakeFrames, "only_listen", only_listen)
    result = run("wrist", "listen", "--find-baud", "--json", "--duration", "30", "-p", CAN)
    assert result.code == 4 and "nothing-heard" in result.said, result
    assert {500000, 250000, 125000} < set(tried)
    turns = [row["meaning"] for row in result.stream[0] if row["kind"] == "event"]
    assert "bitrate 125000" in turns and "bitrate 250000" not in turns
