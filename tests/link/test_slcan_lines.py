"""What the lines of an slcan adapter mean, without an adapter: the wrong length drops a frame, and bus off stays."""

from __future__ import annotations

from handctl.link.slcan import SlcanBus


def adapter() -> SlcanBus:
    bus = SlcanBus.__new__(SlcanBus)
    bus.refused = bus.errors = bus.damaged = 0
    bus.left, bus.damage = False, ""
    return bus


def test_a_frame_has_exactly_the_bytes_that_it_announces() -> None:
    bus = adapter()
    message = bus._message(b"T10FF00012A7FE\r")
    assert message is not None and (message.arbitration_id, bytes(message.data)) == (0x10FF0001, b"\xa7\xfe")
    stamped = bus._message(b"T10FF00012A7FE1234\r")  # Z1: a time of 16 bits stands behind
    assert stamped is not None and bytes(stamped.data) == b"\xa7\xfe"
    for line in (b"T10FF00012A7\r", b"T10FF00012A7FE12\r", b"T10FF00012A7FE123456\r", b"T30FF00012A7FE\r"):
        assert bus._message(line) is None, line
    assert bus.damaged == 4


def test_bus_off_stays_until_the_adapter_says_another_state() -> None:
    bus = adapter()
    seen = []
    for line in (b"sa057033\r", b"sb000256\r", b"e1a\r", b"sa057033\r"):
        assert bus._message(line) is None
        seen.append(bus.left)
    assert seen == [False, True, True, False]
    assert bus.errors == 2
