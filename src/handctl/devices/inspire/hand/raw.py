"""Raw access: write at an address, and send typed frames in EB 90 or Modbus (rh56 §2, §9).

What no command sends is refused here too: what starts a stored movement, and what lies beside the triggers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from handctl.devices.inspire import can_frames, eb90, modbus_frames
from handctl.devices.inspire import raw as by_number
from handctl.devices.inspire.explain_bytes import InspireExplainer
from handctl.devices.inspire.hand.register_map import BYTE_MAP, OF_BYTES, is_never_written
from handctl.devices.inspire.modbus_bus import TCP_HINTS
from handctl.devices.inspire.modbus_frames import RTU, TCP, mode_of, only_reads, pdu_of
from handctl.errors import UsageError
from handctl.link import ByteLink, CanFrame
from handctl.model.explainer import DEVICE, HOST
from handctl.model.param import Step
from handctl.model.result import Column, Row, Table, hex_bytes
from handctl.model.write_ledger import ACKNOWLEDGED

if TYPE_CHECKING:
    from handctl.command.run import Run
    from handctl.devices.inspire.hand.device import Hand

COLUMNS = (Column("direction", "From"), Column("meaning", "Meaning"), Column("raw", "Frame"))


def plan_write(hand: Hand, address: int, data: bytes, undocumented: bool) -> Step:
    """Check a write at a byte address against the map. Raises UsageError."""
    if any(is_never_written(hand.has, hand.bus.per, place) for place in range(address, address + len(data))):
        raise UsageError(
            f"{address // hand.bus.per} is among triggers, gestures or sequences, which start movements or resets on some generations",
            hint="handctl never writes there (rh56 §9). Nothing was sent.",
            code="never",
        )
    return by_number.plan_write(hand, address, data, undocumented)


# -- frames -----------------------------------------------------------------------------------------------------------


def choose_wire(run: Run, data: bytes) -> None:
    """A frame says by itself in which protocol it is: the hand is looked at in the same one."""
    mode = mode_of(data)
    if mode != TCP and run.settings.own.get("protocol") in (None, "auto"):
        own = {**run.settings.own, "protocol": "modbus" if mode == RTU else "eb90"}
        run.settings = run.settings._replace(own=own)


def plan(hand: Hand, data: bytes, force: bool) -> Step:
    """What these bytes would do. A read is harmless; anything else asks. Raises UsageError for what needs `force`."""
    bus = hand.bus
    if bus.wire == "can":
        raise UsageError(
            "`raw` does not support CAN frames here", hint=("use `handctl hand read` and `write` over CAN")
        )
    mode = mode_of(data)
    tcp = bus.wire == "tcp"
    if mode and (mode == TCP) != tcp:
        other = "Modbus TCP" if mode == TCP else "a serial line"
        raise UsageError(f"this is a frame for {other}, but this LINK is not", hint="choose another LINK with -p")
    pieces = InspireExplainer(hand.map).decode(data, HOST)
    words = "; ".join(piece.meaning for piece in pieces)
    if only_reads(pdu_of(data, mode)) if mode else eb90.only_reads(data):
        return Step(words, data)
    if not force:
        frames = [repaired(raw) for raw in (data, *(piece.raw for piece in pieces[1:]))]
        for frame in frames:
            if len(frames) == 1 or not eb90.only_reads(frame):
                _refuse(hand, frame)
    return Step(words, data, moves=True, strands=True)


def plan_can(hand: Hand, frame: CanFrame) -> Step:
    """The same of a frame on CAN, which only `terminal` sends."""
    access = can_frames.parse_identifier(frame.can_id)
    (piece,) = InspireExplainer(hand.map).sent(frame.data, frame.can_id)
    if can_frames.only_reads(frame.can_id, frame.data):
        return Step(piece.meaning, frame.data, can_id=frame.can_id)
    if access.writes:
        refuse_write(access.hand_id, access.address, frame.data, hand)
    return Step(piece.meaning, frame.data, moves=True, strands=True, can_id=frame.can_id)


def repaired(data: bytes) -> bytes:
    """The bytes with the checksum that fits: an error of the line may put it right, and a device may be lenient."""
    start = data.find(eb90.HOST)
    if start >= 0:
        whole = data[start : start + data[start + 3] + eb90.OVERHEAD] if len(data) > start + 3 else b""
        return whole[:-1] + bytes([eb90.checksum(whole[2:-1])]) if len(whole) > 7 else data
    if mode_of(data) or len(data) < 8:
        return data
    return data[:-2] + modbus_frames.crc(data[:-2])


def _refuse(hand: Hand, frame: bytes) -> None:
    """Refuse a write that resets, starts a stored movement, or holds a value out of range. Raises UsageError."""
    mode, unit = mode_of(frame), hand.bus.per
    if mode:
        number, pdu = (frame[0] if mode == RTU else 1), pdu_of(frame, mode)
        address = int.from_bytes(pdu[1:3], "big")
        data = modbus_frames.to_memory(pdu[3:5] if pdu[0] == modbus_frames.WRITE_ONE else pdu[6:])
        count = 1 if unit == 1 and len(data) == 2 and data[1] == 0 else len(data)
        data = data[:count] if any(address == register.address for register in hand.has if register.size == 1) else data
    elif frame[:2] == eb90.HOST and len(frame) > 8 and frame[4] == eb90.WRITE:
        number, address, data = frame[2], int.from_bytes(frame[5:7], "little"), frame[7:-1]
    elif frame[:2] == eb90.HOST and len(frame) > 4:
        raise by_number.refused(f"flag {frame[4]:02X} is not a flag of these hands")
    else:
        return
    refuse_write(number, address, data, hand)


def refuse_write(number: int | None, address: int, data: bytes, hand: Hand | None = None) -> None:
    """Refuse a write that resets, starts a stored movement, or holds a value out of range. Raises UsageError.

    number  the id that it is for, None where the wire has other ones
    hand    the hand that decides where its registers are; None = one of the generations that count bytes
    """
    params, unit, has = (hand.map, hand.bus.per, hand.has) if hand is not None else (BYTE_MAP, 1, OF_BYTES)
    if number is not None and not 1 <= number <= 254:
        raise by_number.refused(f"id {number} is not an id of a hand", code="out-of-range")
    for place in range(address * unit, address * unit + len(data)):
        if place in params["factory_reset"].span or is_never_written(has, unit, place):
            text = f"{place // unit} resets the hand or starts a stored movement on some generations"
            raise by_number.refused(text, code="never")
    by_number.check_values(params, address * unit, data)


def exchange(hand: Hand, data: bytes, wait: float) -> Table:
    """Send the bytes once, listen until `wait` seconds have brought nothing more, show every frame that came."""
    bus, link = hand.bus, hand.bus.link
    assert isinstance(link, ByteLink)  # `plan` refuses CAN
    if not (mode_of(data) and only_reads(pdu_of(data, mode_of(data)))):
        names_id = mode_of(data) == RTU and 1 <= data[0] <= 254
        (bus.at(device_id=data[0]) if names_id else bus).pass_gate(data)
    bus.check_bound(hex_bytes(data))
    since, received = link.now(), b""
    bus.count(data)
    link.write(data, bus.deadline(1.0))
    while chunk := link.read(bus.deadline(wait)):
        received += chunk
        if len(received) > 65536 or bus.over:
            break
    if not received:
        raise bus.unanswered(hex_bytes(data), wait, since, "listen longer with --wait S")
    echo = bus.journal.line.echo
    if mode_of(data) == RTU and echo is not None and received[len(data) * echo :].startswith(data):
        bus.journal.ledger.confirm(ACKNOWLEDGED)  # the reply to function 06 looks as its request does
    explainer: InspireExplainer = InspireExplainer(hand.map if hand.typed is not None else BYTE_MAP)
    asks = {piece.asks for piece in explainer.feed(HOST, data)} - {""}
    pieces = [*explainer.feed(DEVICE, received), *explainer.flush()]
    rows: list[Row] = [
        {"direction": "device", "meaning": piece.meaning, "problem": piece.problem or None, "raw": hex_bytes(piece.raw)}
        for piece in pieces
        if piece.direction == DEVICE
    ]
    bus.journal.counters.received += len(rows)
    table = Table(rows=rows, columns=COLUMNS, extra={"received": hex_bytes(received)})
    if not mode_of(data):
        table.failure = failure = by_number.failure_of_replies(hand, data, received, pieces, asks)
        if failure is not None and bus.wire == "tcp":
            failure.hint = TCP_HINTS.get(failure.code, failure.hint)
    return table
