"""CAN links: LINK texts, python-can's `virtual` interface, the simulated bus, and transcripts of frames."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can as python_can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handctl.errors import LinkError, UsageError
from handctl.link import CanFrame, FrameLink, NoFrames, is_can, open_link
from handctl.link.can import CanLink, split_link
from handctl.link.fake import FakeFrames
from handctl.link.transcript import TraceWriter, observed, parse
from tests.inspire.wrist_support import ScriptedFrames, can, frames, wrist_on
from tests.support.cli import PATIENCE
from tests.support.each_row import each_row

CHANNEL = "handctl-tests"
LINK = f"can:virtual:{CHANNEL}"

# -- LINK texts -------------------------------------------------------------------------------------------------------


@each_row(
    ("link", "interface", "channel", "options"),
    [
        ("can:socketcan:can0", "socketcan", "can0", {"bitrate": 1000000}),
        ("can:slcan:/dev/ttyACM0?bitrate=500000", "slcan", "/dev/ttyACM0", {"bitrate": 500000}),
        ("can:slcan:socket://127.0.0.1:4000", "slcan", "socket://127.0.0.1:4000", {"bitrate": 1000000}),
        ("can:pcan:PCAN_USBBUS1", "pcan", "PCAN_USBBUS1", {"bitrate": 1000000}),
        (
            "can:slcan:/dev/ttyACM0?sleep_after_open=0.5&poll_interval=1&x=y&",
            "slcan",
            "/dev/ttyACM0",
            {"bitrate": 1000000, "sleep_after_open": 0.5, "poll_interval": 1, "x": "y"},
        ),
        ("can:gs_usb:0?host=10.0.0.1", "gs_usb", "0", {"bitrate": 1000000, "host": "10.0.0.1"}),
    ],
)
def test_link_texts(link: str, interface: str, channel: str, options: dict[str, object]) -> None:
    """1 Mbit/s unless the LINK says otherwise (wrist §2.3)."""
    found = split_link(link)
    assert found == (interface, channel, options)
    assert [type(value) for value in found[2].values()] == [type(value) for value in options.values()]


@each_row(
    "link",
    [
        "can:",
        "can:socketcan",
        "can:socketcan:",
        "can::can0",
        "can:virtual:x?bitrate",
        "can:virtual:x?bitrate=fast",
        "can:virtual:x?bitrate=0",
        "can:virtual:x?bitrate=1.5",
    ],
)
def test_link_texts_that_say_nothing(link: str) -> None:
    with pytest.raises(UsageError) as caught:
        split_link(link)
    assert caught.value.exit_code == 2
    assert link in caught.value.text


def test_an_unknown_interface_is_named_with_the_known_ones() -> None:
    with pytest.raises(UsageError) as caught:
        open_link("can:nonsense:can0")
    assert "nonsense" in caught.value.text
    for known in ("socketcan", "slcan", "pcan"):
        assert known in caught.value.hint


@each_row("error", [ValueError("Invalid bitrate"), TypeError("unexpected keyword argument 'x'")])
def test_options_that_python_can_refuses(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def refuse(**options: object) -> None:
        raise error

    monkeypatch.setattr("handctl.link.can.can.Bus", refuse)
    with pytest.raises(UsageError) as caught:
        open_link(f"{LINK}?bitrate=12345")
    assert str(error) in caught.value.text


def test_an_option_cannot_change_the_channel() -> None:
    with pytest.raises(UsageError):
        open_link(f"{LINK}?channel=other")


@each_row("link", ["can:socketcan:nocan9", "can:slcan:/dev/nothing9"])
def test_a_bus_that_cannot_be_opened(link: str) -> None:
    with pytest.raises(LinkError) as caught:
        open_link(link)
    assert (caught.value.code, caught.value.exit_code) == ("cannot-open", 3)
    assert link in caught.value.text


@each_row(
    ("link", "carries"),
    [
        ("can:socketcan:can0", True), ("fake://wrist?bus=can", True), ("fake://wrist?seed=1&bus=can&wire=1", True),
        ("fake://wrist", False), ("fake://wrist?bus=serial", False), ("fake://wrist?state=bus=canned", False),
        ("/dev/ttyUSB0", False), ("tcp://can:1", False), ("replay:/nothing/here", False), ("", False),
    ],
)  # fmt: skip
def test_which_links_carry_frames(link: str, carries: bool) -> None:
    assert is_can(link) is carries


def test_a_dry_run_has_no_bus() -> None:
    link = NoFrames()
    for act in (
        lambda: link.send(can("10FF0001 [1] 02"), link.deadline(PATIENCE)),
        lambda: link.receive(link.deadline(PATIENCE)),
    ):
        with pytest.raises(LinkError):
            act()
    link.close()


@each_row(
    ("text", "frame"),
    [
        ("15038001 [4] E8 03 18 FC", CanFrame(0x15038001, b"\xe8\x03\x18\xfc")),
        ("15038001 [0]", CanFrame(0x15038001, b"")),
        ("00000000 [1] 00", CanFrame(0, b"\0")),
    ],
)
def test_text_of_a_frame(text: str, frame: CanFrame) -> None:
    assert str(frame) == text
    assert can(text) == frame


# -- python-can -------------------------------------------------------------------------------------------------------


@pytest.fixture
def wire() -> Iterator[tuple[CanLink, Any]]:
    """Our link, and another node on the same virtual bus."""
    other = python_can.Bus(interface="virtual", channel=CHANNEL)
    link = open_link(LINK)
    assert isinstance(link, CanLink)
    yield link, other
    link.close()
    other.shutdown()


def message(identifier: int, data: bytes = b"", **more: Any) -> python_can.Message:
    return python_can.Message(arbitration_id=identifier, data=data, **{"is_extended_id": True, **more})


def test_a_frame_goes_out_as_extended_data_frame(wire: tuple[CanLink, Any]) -> None:
    link, other = wire
    link.send(can("15038001 [4] E8 03 18 FC"), link.deadline(PATIENCE))
    sent = other.recv(PATIENCE)
    assert (sent.arbitration_id, bytes(sent.data), sent.dlc) == (0x15038001, b"\xe8\x03\x18\xfc", 4)
    assert (sent.is_extended_id, sent.is_remote_frame, sent.is_error_frame, sent.is_fd) == (True, False, False, False)


def test_a_time_of_day_that_is_set_back_prolongs_no_wait(
    wire: tuple[CanLink, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """python-can measures a wait by it: a minute back is a minute more."""
    link, _ = wire
    moments = itertools.count(1e9, -2 * PATIENCE)
    monkeypatch.setattr(python_can.bus, "time", lambda: next(moments))
    began = time.monotonic()
    assert link.receive(link.deadline(0.05)) is None
    assert time.monotonic() - began < PATIENCE


def test_an_identifier_that_fits_eleven_bits_stays_extended(wire: tuple[CanLink, Any]) -> None:
    link, other = wire
    link.send(CanFrame(1, b"\x01"), link.deadline(PATIENCE))
    assert other.recv(PATIENCE).is_extended_id is True


def test_only_extended_data_frames_come_in(wire: tuple[CanLink, Any]) -> None:
    """wrist §2.3: no standard identifiers, no remote frames."""
    link, other = wire
    other.send(message(0x123, b"\x01", is_extended_id=False))
    other.send(message(0x10FF0001, is_remote_frame=True, dlc=2))
    other.send(message(0x10FF0001, is_error_frame=True))
    other.send(message(0x10FF0001, b"\xa7\xfe"))
    other.send(message(0x15038001))
    assert str(link.receive(link.deadline(PATIENCE))) == "10FF0001 [2] A7 FE"
    assert str(link.receive(link.deadline(PATIENCE))) == "15038001 [0]"
    assert link.receive(link.deadline(0)) is None
    assert link.error_frames == 1


def test_own_frames_do_not_come_back(wire: tuple[CanLink, Any]) -> None:
    """A 1-byte read of the value 01 would equal its request (dossier 4.12)."""
    link, _ = wire
    link.send(can("11010001 [1] 01"), link.deadline(PATIENCE))
    assert link.receive(link.deadline(0.01)) is None


def test_silence_ends_at_the_deadline(wire: tuple[CanLink, Any]) -> None:
    link, _ = wire
    started = link.now()
    assert link.receive(link.deadline(0.08)) is None
    assert 0.08 <= link.now() - started < 1.0


def test_a_babbling_bus_of_others_ends_at_the_deadline(
    wire: tuple[CanLink, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    link, _ = wire
    monkeypatch.setattr(link._bus, "_recv_internal", lambda timeout: (message(0x123, is_extended_id=False), False))
    started = link.now()
    assert link.receive(link.deadline(0.05)) is None
    assert link.now() - started < 1.0


def test_early_returns_without_a_frame_are_waited_out(
    wire: tuple[CanLink, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """slcan hands the adapter's `z` and CR out as empty reads (dossier §7)."""
    link, _ = wire
    replies = iter([None, None, message(0x10FF0001, b"\x01\x02")])
    monkeypatch.setattr(link._bus, "_recv_internal", lambda timeout: (next(replies), False))
    assert str(link.receive(link.deadline(PATIENCE))) == "10FF0001 [2] 01 02"


@pytest.mark.parametrize(
    "error", [python_can.CanOperationError("gone"), OSError(19, "No such device"), ValueError("bad frame")]
)
def test_errors_of_the_bus_are_translated(
    wire: tuple[CanLink, Any], monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    link, _ = wire

    def broken(*args: object, **more: object) -> None:
        raise error

    monkeypatch.setattr(link._bus, "_recv_internal", broken)
    monkeypatch.setattr(link._bus, "send", broken)
    with pytest.raises(LinkError) as caught:
        link.receive(link.deadline(PATIENCE))
    assert (caught.value.code, caught.value.exit_code) == ("lost", 3)
    assert LINK in caught.value.text
    with pytest.raises(LinkError) as caught:
        link.send(can("10FF0001 [1] 02"), link.deadline(PATIENCE))
    assert (caught.value.code, caught.value.exit_code) == ("cannot-send", 3)
    assert "120 ohm" in caught.value.hint


def test_closing_twice_and_after_the_adapter_went(monkeypatch: pytest.MonkeyPatch) -> None:
    link = open_link(LINK)
    assert isinstance(link, CanLink)
    shut = []

    def gone() -> None:
        shut.append(1)
        raise OSError(19, "No such device")

    really = link._bus.shutdown
    monkeypatch.setattr(link._bus, "shutdown", gone)
    link.close()
    link.close()
    assert shut == [1]
    really()


def test_slcan_does_not_wait_two_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[dict[str, Any]] = []

    class Noted:
        adapter = ""

        def __init__(self, **options: Any) -> None:
            asked.append(options)

    def bus(**options: Any) -> Any:
        asked.append(options)
        return object()

    monkeypatch.setattr("handctl.link.can.can.Bus", bus)
    monkeypatch.setattr("handctl.link.can.SlcanBus", Noted)
    for channel, wait in (("socket://h:1", 0.0), ("/dev/pts/99999", 0.0), ("/dev/ttyACM0", 0.1)):
        CanLink(f"can:slcan:{channel}")
        assert asked[-1]["sleep_after_open"] == wait
        assert asked[-1]["receive_own_messages"] is False
    CanLink("can:slcan:/dev/ttyACM0?sleep_after_open=2.0")
    assert asked[-1]["sleep_after_open"] == 2.0
    CanLink("can:socketcan:can0")
    assert "sleep_after_open" not in asked[-1]


def test_a_wrist_on_python_can(wire: tuple[CanLink, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """The whole way: request out, foreign frames passed over, answer in."""
    link, other = wire
    send = link.send

    def answered(frame: CanFrame, deadline: Any) -> None:
        send(frame, deadline)
        assert str(CanFrame((got := other.recv(PATIENCE)).arbitration_id, bytes(got.data))) == "10FF0001 [1] 02"
        other.send(message(0x10FF0002, b"\x01\x00"))
        other.send(message(0x10FF0001, b"\xa7\xfe"))

    monkeypatch.setattr(link, "send", answered)
    wrist = wrist_on(link)
    assert wrist.bus.read(1020, 2) == b"\xa7\xfe"
    assert wrist.journal.counters.foreign_frames == 1


# -- the simulated bus ------------------------------------------------------------------------------------------------


def open_fake(query: str = "") -> FakeFrames:
    link = open_link(f"fake://wrist?bus=can&clock=virtual{query}")
    assert isinstance(link, FakeFrames)
    return link


def test_the_simulated_bus_answers_in_virtual_time() -> None:
    link = open_fake("&turnaround=0.25")
    assert (link.fake, link.name) == (True, "fake://wrist?bus=can&clock=virtual&turnaround=0.25")
    link.send(can("10FF0001 [1] 08"), link.deadline(1))
    assert link.receive(link.deadline(0.1)) is None
    assert str(link.receive(link.deadline(1))) == "10FF0001 [8] A7 FE 65 04 6F 00 DE 00"
    assert link.now() == pytest.approx(0.25)
    assert link.receive(link.deadline(2)) is None
    assert link.now() == pytest.approx(2.25)
    link.close()
    link.close()


def test_nobody_acknowledging_is_an_error_frame() -> None:
    link = open_fake("&fault=no-ack")
    link.send(can("10FF0001 [1] 02"), link.deadline(1))
    assert link.error_frames == 1
    link = open_fake()
    link.send(can("10FF0001 [1] 02"), link.deadline(1))
    assert link.error_frames == 0


def test_the_adapter_that_goes_away() -> None:
    link = open_fake("&fault=disconnect")
    link.send(can("10FF0001 [1] 02"), link.deadline(1))
    with pytest.raises(LinkError) as caught:
        link.receive(link.deadline(1))
    assert caught.value.exit_code == 3


@each_row("link", ["fake://exo?bus=can", "fake://wrist?bus=can&fault=bad-checksum", "fake://wrist?bus=lin"])
def test_what_has_no_such_bus(link: str) -> None:
    with pytest.raises(UsageError):
        open_link(link)


def test_power_cycle_of_the_simulated_bus() -> None:
    link = open_fake()
    link.send(can("15048001 [2] F4 01"), link.deadline(1))
    assert link.power_cycle() is True
    link.send(can("11048001 [1] 02"), link.deadline(1))
    assert str(link.receive(link.deadline(1))) == "11048001 [2] BC 02"


# -- transcripts ------------------------------------------------------------------------------------------------------


def test_a_tap_writes_frames_and_keeps_the_error_count() -> None:
    lines: list[str] = []
    inner = ScriptedFrames(frames(("10FF0001 [1] 02", [(0.25, "10FF0001 [2] A7 FE"), (0.3, "15038001 [0]")])))
    link = observed(inner, TraceWriter(lines.append))
    assert link.observers
    inner.acknowledges = False
    link.send(can("10FF0001 [1] 02"), link.deadline(1))
    assert link.error_frames == 1
    assert str(link.receive(link.deadline(1))) == "10FF0001 [2] A7 FE"
    assert str(link.receive(link.deadline(1))) == "15038001 [0]"
    assert link.receive(link.deadline(1)) is None
    assert lines == [
        "0.000000 > can 10FF0001 [1] 02\n",
        "0.250000 < can 10FF0001 [2] A7 FE\n",
        "0.300000 < can 15038001 [0]\n",
    ]
    assert link.error_frames == 1
    assert (link.name, link.fake) == ("scripted", False)


@given(st.lists(st.tuples(st.integers(0, 2**29 - 1), st.binary(max_size=8)), max_size=10))
def test_frames_survive_tap_and_parser(traffic: list[tuple[int, bytes]]) -> None:
    lines: list[str] = []
    link = observed(ScriptedFrames(), TraceWriter(lines.append))
    assert isinstance(link, FrameLink)
    for item in traffic:
        link.send(CanFrame(*item), link.deadline(1))
    assert [(entry.can_id, entry.data, entry.mark) for entry in parse(lines)] == [(*item, ">") for item in traffic]


def test_a_recorded_bus_can_be_replayed(tmp_path: Path) -> None:
    file = tmp_path / "trace.txt"
    lines: list[str] = []
    recorded = observed(open_link("fake://wrist?bus=can&clock=virtual"), TraceWriter(lines.append))
    assert isinstance(recorded, FrameLink)
    first = wrist_on(recorded).dump()
    file.write_text("".join(lines), encoding="utf-8")
    assert is_can(f"replay:{file}")
    replayed = open_link(f"replay:{file}")
    assert isinstance(replayed, FrameLink)
    assert (replayed.replayed, replayed.fake) == (True, False)
    for _ in range(2):
        assert wrist_on(replayed).dump().rows == first.rows
    with pytest.raises(LinkError) as caught:
        replayed.send(can("10FF0002 [1] 08"), replayed.deadline(1))
    assert (caught.value.code, caught.value.exit_code) == ("replay-miss", 3)
    assert "10FF0002 [1] 08" in caught.value.text
    replayed.close()
    assert replayed.receive(replayed.deadline(5)) is None


def test_recorded_silence_costs_no_time(tmp_path: Path) -> None:
    file = tmp_path / "trace.txt"
    file.write_text("> can 10FF0001 [1] 02\n", encoding="utf-8")
    link = open_link(f"replay:{file}")
    assert isinstance(link, FrameLink)
    link.send(can("10FF0001 [1] 02"), link.deadline(1))
    assert link.receive(link.deadline(30)) is None
    assert link.now() == 30.0
