"""Registers and frames by number: read, write, raw. What the manual says about an address is still checked."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext

from handctl.devices.inspire import eb90
from handctl.devices.inspire.base import RegisterDevice
from handctl.devices.inspire.bus import PATIENCE, Bus
from handctl.devices.inspire.exo.device import check_command
from handctl.devices.inspire.map import EXO, Register
from handctl.devices.inspire.mishaps import hint_for, mishap, others_speak, shorten
from handctl.devices.inspire.spans import describe, element_at, stretches
from handctl.errors import CheckFailed, DeviceRefused, ProtocolError, UsageError
from handctl.model.frames import frames_in
from handctl.model.param import Element, ParamMap, Reading, Step
from handctl.model.result import Column, Row, Table, hex_bytes

FORCED = "Add --force-ambiguous to send it anyway."


def parse_hex(text: str) -> bytes:
    """``"EB 90 01"``, ``"eb9001"``, ``"EB:90:01"`` -> bytes. Raises UsageError."""
    try:
        data = bytes.fromhex(text.replace(":", " ").replace(",", " ").replace("0x", " "))
    except ValueError as exc:
        raise UsageError(
            f"{text!r}: these are not hexadecimal bytes", hint="give two digits for each byte, such as 2C 01"
        ) from exc
    if not data:
        raise UsageError("no bytes given", hint="give two hexadecimal digits for each byte, such as 2C 01")
    return data


def read(hand: RegisterDevice, address: int, count: int) -> Table:
    """Bytes from any address; whole documented elements are decoded, the rest stays raw."""
    data = hand.bus.read(address, count)
    return Table(rows=_rows(hand, address, data), columns=hand.columns)


def _rows(hand: RegisterDevice, address: int, data: bytes) -> list[Row]:
    rows: list[Row] = []
    position = 0
    while position < len(data):
        element = _element_at(hand.map, address + position)
        size = element[1].size if element is not None else 1
        if element is not None and position + size <= len(data):
            raw = data[position : position + size]
            rows.append(hand.row(Reading(Element(element[1], element[0]), element[1].decode(raw), raw)))
            position += size
            continue
        start = position
        label = _part_of(hand.map, address + start)
        position += 1
        while (
            position < len(data)
            and _element_at(hand.map, address + position) is None
            and _part_of(hand.map, address + position) == label
        ):
            position += 1
        rows.append(
            {
                "name": None,
                "finger": None,
                "address": (address + start) // hand.bus.per,
                "value": None,
                "unit": None,
                "raw": hex_bytes(data[start:position]),
                "label": label,
            }
        )
    return rows


def _part_of(params: ParamMap[Register], address: int) -> str:
    """What a byte is that begins no whole element in the span that was read."""
    for register in params:
        if register.readable and address in register.span:
            index = (address - register.address) // register.size
            return f"part of {Element(register, index).full_name}"
    return "undocumented"


def _element_at(params: ParamMap[Register], address: int) -> tuple[int, Register] | None:
    """The documented, readable element that begins at `address`: (index, register)."""
    found = element_at(params, address)
    return None if found is None or not found[0].readable else (found[1], found[0])


def plan_write(hand: RegisterDevice, address: int, data: bytes, undocumented: bool) -> Step:
    """Check a write against the map: within one documented group, whole elements, legal values. Raises UsageError."""
    eb90.check_span(address, len(data))
    touched = [register for register in hand.map if _overlap(register, address, len(data))]
    step = hand.bus.write_step(address, data, f"write {hex_bytes(data)} at {address // hand.bus.per}")
    if len(touched) == 1 and address in touched[0].span and address + len(data) <= touched[0].span.stop:
        said = f"{step.meaning}: {_checked(hand, touched[0], address, data)}"
        return step._replace(meaning=said, moves=touched[0].moves, strands=touched[0].strands)
    if touched:
        names = ", ".join(register.name for register in touched)
        raise UsageError(
            f"this write goes beyond one documented group: {names}",
            hint="split it: a write has to stay within one documented group (exo §2.3). Nothing was sent.",
        )
    if not undocumented:
        raise UsageError(
            f"{address} is not a documented register of this hand",
            hint="add --undocumented if you know what it does there. Nothing was sent.",
            code="undocumented",
        )
    return step._replace(meaning=f"{step.meaning}: UNDOCUMENTED", moves=True, strands=True)


def _overlap(register: Register, address: int, count: int) -> bool:
    return address < register.span.stop and register.address < address + count


def _checked(hand: RegisterDevice, register: Register, address: int, data: bytes) -> str:
    if register.trigger:
        raise UsageError(
            f"{address} is {register.name}: a write to it starts an action",
            hint=f"use `handctl {hand.kind} {register.verb}`. Nothing was sent.",
        )
    if "w" not in register.access:
        raise UsageError(
            f"{address} is {register.name}, which is read-only ({register.source})",
            hint=f"read it with `handctl {hand.kind} get {register.name}`. Nothing was sent.",
        )
    if register.name == "id":
        raise UsageError(
            f"{address} is the id",
            hint=f"use `handctl {hand.kind} id NEW`, which finds the hand again. Nothing was sent.",
        )
    if (address - register.address) % register.size or len(data) % register.size:
        raise UsageError(
            f"each element of {register.name} has {register.size} bytes: this write would cut one",
            hint="write whole elements. Nothing was sent.",
        )
    texts = []
    for offset in range(0, len(data), register.size):
        element = Element(register, (address + offset - register.address) // register.size)
        value = register.decode(data[offset : offset + register.size])
        register.check(value, element.full_name)
        texts.append(f"{element.full_name} = {value}")
    return ", ".join(texts)


def write(hand: RegisterDevice, address: int, data: bytes) -> Table:
    """Write once, read back; a read-back that differs is the table's failure. Raises Interrupted, after a stop."""
    moving = any(register.moves and _overlap(register, address, len(data)) for register in hand.map)
    with hand.stopped_by_ctrl_c(f"{hex_bytes(data)} at {address}", moving):
        return _write(hand, address, data)


def _write(hand: RegisterDevice, address: int, data: bytes) -> Table:
    step = hand.bus.write_step(address, data, "")
    hand.bus.try_write(address, data, "the write", "handctl reads it back")
    now = hand.bus.read(address, len(data))
    table = Table(rows=_rows(hand, address, now), columns=hand.columns)
    if now == data:
        hand.journal.ledger.confirm("read back", step)
    else:
        hand.journal.ledger.doubt(f"reads {hex_bytes(now)}", step)
        table.failure = CheckFailed(
            f"{hand.bus.where}: {address} reads {hex_bytes(now)} after {hex_bytes(data)} was written",
            hint=f"read it again before you write: `handctl {hand.kind} read {address} {len(data)}`",
            code="read-back",
        )
    return table


def plan_raw(data: bytes, force_ambiguous: bool) -> Step:
    """What these bytes would do, as far as they form a frame. Reads are harmless; anything else is not."""
    decoder = eb90.Decoder([eb90.HOST])
    decoder.feed(data)
    frames = [frame for frame in _frames(decoder) if not frame.from_device]
    if not frames and not _may_go_on(data):
        return _without_frame(data, force_ambiguous)
    if len(frames) != 1 or frames[0].encode() != data:
        return Step(
            "this is not a complete frame, so its effect on the hand is unknown", data, moves=True, strands=True
        )
    frame = frames[0]
    if frame.flag == eb90.READ and len(frame.payload) == 3:
        return Step(f"read {frame.payload[2]} bytes at {frame.address} from id {frame.id}", data)
    if frame.flag in (eb90.WRITE, eb90.FORCE_COMMAND, eb90.POSITION_COMMAND) and not force_ambiguous:
        _refuse_id(frame.id)
    if frame.flag == eb90.WRITE and frame.address is not None:
        if not force_ambiguous:
            _refuse_values(frame.address, frame.data)
        meaning = f"write {hex_bytes(frame.data)} at {frame.address} to id {frame.id}"
        return Step(f"{meaning}: {describe(EXO, frame.address, frame.data)}", data, moves=True, strands=True)
    if frame.flag in (eb90.FORCE_COMMAND, eb90.POSITION_COMMAND) and len(frame.payload) == 10:
        return _raw_command(frame, data, force_ambiguous)
    return Step(f"flag {frame.flag:02X}, which this hand's manual does not have", data, moves=True)


def _without_frame(data: bytes, force_ambiguous: bool) -> Step:
    """Bytes without a frame. What only lacks the right checksum is planned, refused and asked as the frame it almost is: an
    error of the line may put it right, and a device may be lenient.
    """
    start = data.find(eb90.HOST)
    whole = data[start : start + data[start + 3] + eb90.OVERHEAD] if start >= 0 else b""
    if not whole:
        return Step("no valid frame in it, so the hand should not reply", data)
    step = plan_raw(whole[:-1] + bytes([eb90.checksum(whole[2:-1])]), force_ambiguous)
    meaning = f"{step.meaning}. ITS CHECKSUM IS WRONG, so the hand should not reply"
    if whole != data:
        return Step(f"{meaning}. There are other bytes around it", data, moves=True, strands=True)
    return step._replace(meaning=meaning, data=data)


def _refuse_id(device_id: int) -> None:
    """Refuse to write to an id that no hand has: what the hands on the line make of it is unknown."""
    try:
        eb90.check_id(device_id)
    except UsageError as exc:
        raise UsageError(exc.text, hint=f"{exc.hint} {FORCED}", code="out-of-range") from exc


def _refuse_values(address: int, data: bytes) -> None:
    """Refuse a raw write of values that the manual does not allow. Raises UsageError."""
    for register, index, raw in stretches(EXO, address, data):
        if register is not None and register.writable:
            try:
                register.check(register.decode(raw), Element(register, index).full_name)
            except UsageError as exc:
                raise UsageError(exc.text, hint=f"{exc.hint} {FORCED}", code=exc.code) from exc


def _may_go_on(data: bytes) -> bool:
    """Whether these bytes end in the beginning of a frame, which bytes sent later would complete."""
    start = data.find(eb90.HOST[:1])
    while start >= 0:
        rest = data[start:]
        if eb90.HOST.startswith(rest[:2]) and (len(rest) < 4 or len(rest) < rest[3] + eb90.OVERHEAD):
            return True
        start = data.find(eb90.HOST[:1], start + 1)
    return False


def _raw_command(frame: eb90.Frame, data: bytes, force_ambiguous: bool) -> Step:
    name = "force" if frame.flag == eb90.FORCE_COMMAND else "position"
    values = eb90.unpack_s16(frame.payload)
    if name == "force" and 1020 <= values[0] <= 1043 and not force_ambiguous:
        raise UsageError(
            f"a wrist module takes this frame for a write of 8 bytes at {values[0]}, this hand for a force command",
            hint=f"{FORCED} Nothing was sent.",
            code="ambiguous",
        )
    if not force_ambiguous:
        try:
            check_command(name, values)
        except UsageError as exc:
            raise UsageError(exc.text, hint=f"{exc.hint} {FORCED}", code=exc.code) from exc
    return Step(f"{name} command, little to thumb: {' '.join(map(str, values))}, to id {frame.id}", data, moves=True)


def goes_on(hand: RegisterDevice, step: Step) -> AbstractContextManager[None]:
    """Ctrl-C while the answer to raw bytes is awaited: they are not taken back, which is told."""
    if not (step.moves or step.strands):
        return nullcontext()
    return hand.bus.leaving(
        f"the bytes were sent and cannot be taken back: {step.meaning}", f"check with `handctl {hand.kind} status`"
    )


def exchange(hand: RegisterDevice, data: bytes, wait: float) -> Table:
    """Send bytes once, listen for `wait` seconds after the last byte came, show every frame in the answer.

    Where others go on speaking there is no last byte: then for a few times as long.
    """
    bus = hand.bus
    assert isinstance(bus, Bus)
    bus.pass_gate(data)
    bus.check_bound(hex_bytes(data))
    bus.drain()
    since = bus.link.now()
    bus.send(data)
    received, last = b"", bus.deadline(PATIENCE * wait + bus.wire_seconds(len(data) + eb90.MAX_COUNT))
    while chunk := bus.link.read(bus.deadline(wait + bus.wire_seconds(len(data))).earlier(last)):
        received += chunk
        if len(received) > 65536 or last.expired or bus.over:
            break
    if last.expired and others_speak(data, received):
        bus.journal.line.others = True
    if not received:
        raise bus.unanswered(hex_bytes(data), wait, since, "listen longer with --wait S")
    decoder = eb90.Decoder()
    decoder.feed(received)
    frames = _frames(decoder)
    rows = [
        _frame_row(hand.map, frame, "our own bytes" if frame.encode() == data else result)
        for frame, result in zip(frames, _results(data, frames), strict=True)
    ]
    bus.journal.counters.received += len(rows)
    bus.journal.counters.stray_bytes += decoder.skipped
    table = Table(rows=rows, columns=RAW_COLUMNS, extra={"received": hex_bytes(received)})
    replies = [frame for frame in frames if frame.from_device]
    refusal = _refusal(data, replies)
    if not any(frame.id == data[2] for frame in replies if len(data) > 2) and not _changes_id(data):
        code, text = mishap(data, received)
        table.failure = ProtocolError(
            f"{bus.where}: {text}: {shorten(received)}", hint=hint_for(code, bus.family), code=code
        )
    elif refusal:
        table.failure = DeviceRefused(
            f"{bus.where}: {refusal}", hint=f"check with `handctl {hand.kind} status` before you send it again"
        )
    return table


def _refusal(data: bytes, replies: list[eb90.Frame]) -> str:
    """In words, that what came refuses the write `data`; the result of a save has the inverse sense of its ack."""
    answers = [frame.data for frame in replies if frame.flag in WRITES and frame.address is not None]
    if data[4:5] not in (bytes([flag]) for flag in WRITES):
        return ""
    if answers and answers[0] != b"\x01":
        return f"the device answered {hex_bytes(answers[0])} instead of 01"
    failed = any(frame.address == EXO["save"].address and frame.data == b"\xff" for frame in replies)
    return "the save failed: result FF (00 = saved, FF = failed)" if _saves(data) and failed else ""


def _saves(data: bytes) -> bool:
    """Whether it writes 1 to the save register, which is answered twice (RH56 ch. 3 ex. 4)."""
    return data[4:8] == bytes([eb90.WRITE]) + EXO["save"].address.to_bytes(2, "little") + b"\x01"


def _results(data: bytes, frames: list[eb90.Frame]) -> list[str]:
    """For each frame what it tells about a save that was accepted before it, or nothing."""
    accepted, results = False, []
    for frame in frames:
        mine = frame.from_device and frame.address == EXO["save"].address and _saves(data)
        results.append({b"\x00": "saved", b"\xff": "save failed"}.get(frame.data, "") if accepted and mine else "")
        accepted = accepted or (mine and frame.flag == eb90.WRITE and frame.data == b"\x01")
    return results


def _changes_id(data: bytes) -> bool:
    """A write to register 1000 may be acknowledged from the new id."""
    return data[4:7] == bytes([eb90.WRITE]) + EXO["id"].address.to_bytes(2, "little")


WRITES = (eb90.WRITE, eb90.FORCE_COMMAND)
"""11/12 registers; a wrist writes with 31, which is the exo's force command in a longer frame."""
RAW_COLUMNS = (
    Column("direction", "From"),
    Column("id", "Id", right=True),
    Column("flag", "Flag"),
    Column("address", "Address", right=True),
    Column("data", "Data"),
    Column("meaning", "Meaning"),
    Column("raw", "Frame"),
)


def _frames(decoder: eb90.Decoder) -> list[eb90.Frame]:
    return [*frames_in(decoder), *decoder.finish()]


def _frame_row(params: ParamMap[Register], frame: eb90.Frame, meaning: str) -> Row:
    return {
        "direction": "device" if frame.from_device else "host",
        "id": frame.id,
        "flag": f"{frame.flag:02X}",
        "address": frame.address,
        "data": hex_bytes(frame.data if frame.address is not None else frame.payload),
        "meaning": meaning or _meaning(params, frame),
        "raw": hex_bytes(frame.encode()),
    }


def _meaning(params: ParamMap[Register], frame: eb90.Frame) -> str:
    """What a frame says, by the map of the device: the wrist's registers answer with 30 and 31, a hand's with 11 and 12."""
    other_space = (frame.flag in (eb90.READ, eb90.WRITE)) == (params.kind == "wrist")
    if other_space and frame.address is not None and frame.flag in (eb90.READ, eb90.WRIST_READ):
        return "another register space"
    if frame.address is None:
        return f"values {' '.join(map(str, eb90.unpack_s16(frame.payload)))}"
    if frame.flag in (eb90.WRITE, eb90.FORCE_COMMAND) and len(frame.data) == 1:
        return "accepted" if frame.data == b"\x01" else "not accepted"
    parts = []
    offset = 0
    while offset < len(frame.data):
        found = _element_at(params, frame.address + offset)
        if found is not None and offset + found[1].size <= len(frame.data):
            raw = frame.data[offset : offset + found[1].size]
            parts.append(f"{Element(found[1], found[0]).full_name} = {found[1].decode(raw)}")
        offset += found[1].size if found is not None else 1
    return ", ".join(parts) or "undocumented"
