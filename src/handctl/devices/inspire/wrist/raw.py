"""The wrist by number: registers, frames of either wire, and what the manual's misprinted examples really do."""

from __future__ import annotations

from handctl.devices.inspire import canreg, eb90
from handctl.devices.inspire.canbus import CanBus, describe_frame
from handctl.devices.inspire.map import WRIST, Register
from handctl.devices.inspire.spans import describe
from handctl.devices.inspire.wrist.device import Wrist
from handctl.errors import DeviceRefused, HandctlError, ProtocolError, UsageError
from handctl.link import CanFrame
from handctl.model.param import Element, Step
from handctl.model.result import Column, Row, Table, hex_bytes

WRITE_SIZES = (2, 4, 6)
"""Bytes of a wrist write. Eight would be an exo force command (wrist §2.2.1, exo §2.2.1)."""
SHARED = range(1020, 1044)
"""Wrist registers; in the hand's space current limits and power-on speeds lie here (RH56 §2.4.7, §2.4.8)."""

MISPRINTS: dict[bytes, str] = {
    bytes.fromhex("EB90010430FC030236"): (
        "wrist §2.2 prints these bytes for reading both currents, but 03FC is 1020: this reads pitch_actual. "
        "The currents: EB 90 01 04 30 00 04 04 3D"
    ),
    bytes.fromhex("EB900107310E0418FCEB034D"): (
        "wrist §2.2.1 prints these bytes for pitch -10.00, yaw +10.00, but 1038 is yaw and 03EB is 1003: this sets yaw "
        "-10.00 and pitch +10.03. As the text says: EB 90 01 07 31 0E 04 E8 03 18 FC 4A"
    ),
    bytes.fromhex("90EB010530FC030000000035"): (
        "wrist §2.2 prints this answer, but length 05 means two data bytes. The byte in the place of the sum does not fit, "
        "so a decoder rejects it"
    ),
}
CAN_MISPRINTS: dict[tuple[int, bytes], str] = {
    (0x01100001, b"\x04"): (
        "wrist §2.3.1 prints 28 bits for an identifier of 29: as they stand they read address 1088 of the hand. "
        "Both currents: 11000001 [1] 04"
    ),
    (0x00184001, bytes(4)): (
        "wrist §2.3.1 prints this identifier for the answer with 28 bits of 29. With the zeros it lost it would be a hand "
        "read of 1552. An answer has the request's identifier: 11000001 [4]"
    ),
    (0x15750001, bytes.fromhex("E80318FC")): (
        "wrist §2.3.2 says 1492 beside the binary 1038: this writes address 1492. Yaw and pitch: 15038001 [4] E8 03 18 FC"
    ),
    (0x15038001, bytes.fromhex("FC1803EB")): (
        "wrist §2.3.2 prints these data bytes high byte first. The device reads low byte first: yaw +63.96, pitch -53.73, "
        "out of range. As the text says: 15038001 [4] E8 03 18 FC"
    ),
}


def misprint(data: bytes) -> str | None:
    """What a frame that the manual prints wrongly really does; None for any other frame."""
    return MISPRINTS.get(data)


def explained(step: Step) -> bool:
    """Whether a plan's meaning is the explanation of a misprint."""
    return step.meaning in MISPRINTS.values() or step.meaning in CAN_MISPRINTS.values()


def register_at(address: int) -> Register | None:
    """The register that begins at `address`."""
    return next((register for register in WRIST if register.address == address), None)


def touches_shared(address: int, count: int) -> bool:
    return address < SHARED.stop and SHARED.start < address + count


def _refuse_illegal(address: int, data: bytes) -> None:
    """Refuse a raw write whose values the manual does not allow. Raises UsageError."""
    explained_as = next((text for (_, known), text in CAN_MISPRINTS.items() if known == data), "")
    for offset in range(0, len(data) - 1, 2):
        register = register_at(address + offset)
        if register is not None and register.writable:
            try:
                register.check(register.decode(data[offset : offset + 2]), register.name)
            except UsageError as exc:
                raise UsageError(
                    f"{exc.text}{f'. {explained_as}' if explained_as else ''}",
                    hint=f"{exc.hint} Add --force-ambiguous to send it anyway.",
                    code=exc.code,
                ) from exc


def plan_write(wrist: Wrist, address: int, data: bytes) -> Step:
    """Check a write: whole settable registers side by side, 2, 4 or 6 bytes, legal values. Raises UsageError."""
    if len(data) not in WRITE_SIZES:
        raise UsageError(
            f"a wrist write of {len(data)} byte{'s' * (len(data) != 1)} is never sent",
            hint="write 2, 4 or 6 bytes: with 8 it would be a force command of an exoskeleton hand. Nothing was sent.",
        )
    texts = []
    for offset in range(0, len(data), 2):
        register = register_at(address + offset)
        if register is None or not register.writable:
            what = f"{register.name}, which is read-only" if register is not None else "not a documented register"
            raise UsageError(
                f"{address + offset} is {what}",
                hint="write to 1038 yaw_set, 1040 pitch_set or 1042 move_time (wrist §2.1). Nothing was sent.",
            )
        value = register.decode(data[offset : offset + 2])
        register.check(value, register.name)
        texts.append(f"{register.name} = {register.text(value)}")
    return wrist.bus.write_step(address, data, f"write {', '.join(texts)} (address {address})")._replace(moves=True)


def write(wrist: Wrist, address: int, data: bytes) -> Table:
    """Write whole registers by address, once, and read them back."""
    changes = []
    for offset in range(0, len(data), 2):
        register = register_at(address + offset)
        assert register is not None
        changes.append((Element(register, 0), register.decode(data[offset : offset + 2])))
    return wrist.table(wrist.write(changes))


# -- raw frames -----------------------------------------------------------------------------------------------------


def plan_raw(data: bytes, force: bool, *, only_explain: bool = False) -> Step:
    """What a serial frame would do; an explanation where the manual prints it for something else.

    With `only_explain` (a dry run) a misprint is explained also where it would be refused.
    """
    explained = misprint(data)
    if explained is not None and only_explain:
        return Step(explained, data, moves=True)
    decoder = eb90.Decoder([eb90.HOST])
    decoder.feed(data)
    frames = [frame for frame in decoder.finish() if not frame.from_device]
    if len(frames) == 1 and frames[0].encode() == data:
        frame = frames[0]
        if frame.flag in (eb90.WRIST_READ, eb90.READ) and len(frame.payload) == 3:
            space = "wrist" if frame.flag == eb90.WRIST_READ else "hand"
            return Step(
                explained or f"read {frame.payload[2]} bytes at {frame.address} of the {space}, id {frame.id}", data
            )
        if frame.flag == eb90.WRIST_WRITE and len(frame.payload) == 10 and not force:
            raise UsageError(
                "8 bytes with flag 31 are a force command of an exoskeleton hand",
                hint="write 2, 4 or 6 bytes to a wrist. Add --force-ambiguous to send it anyway. Nothing was sent.",
                code="ambiguous",
            )
        if frame.flag == eb90.WRITE and not touches_shared(frame.address or 0, len(frame.data)):
            return Step(f"write {hex_bytes(frame.data)} at {frame.address} of the hand", data, moves=True, strands=True)
        if frame.flag == eb90.WRIST_WRITE and frame.address is None:
            address = int.from_bytes(frame.payload[:2], "little")
            return Step(
                f"write {hex_bytes(frame.payload[2:])} at {address}, or an exo force command",
                data,
                moves=True,
                strands=True,
            )
        if frame.flag == eb90.WRIST_WRITE:
            if explained is None and not force:
                _refuse_illegal(frame.address or 0, frame.data)
            return Step(explained or f"write {hex_bytes(frame.data)} at {frame.address} of the wrist", data, moves=True)
        if frame.flag == eb90.WRITE and touches_shared(frame.address or 0, len(frame.data)) and not force:
            raise UsageError(
                f"flag 12 at {frame.address} writes current limits or power-on speeds of the hand, not the wrist",
                hint="use flag 31 for the wrist. Add --force-ambiguous to send it anyway. Nothing was sent.",
                code="ambiguous",
            )
    return Step(
        explained or "this is not a complete read or write, so its effect on the device is unknown",
        data,
        moves=True,
        strands=True,
    )


def parse_can(text: str) -> CanFrame:
    """``15038001#E80318FC`` or ``15038001 [4] E8 03 18 FC`` -> a frame. Raises UsageError."""
    head, _, tail = text.strip().replace("#", " ", 1).partition(" ")
    words = tail.split()
    announced = words.pop(0).strip("[]") if words and words[0].startswith("[") else None
    try:
        identifier, data = int.from_bytes(bytes.fromhex(head.zfill(8)), "big"), bytes.fromhex("".join(words))
        if not head or len(head) > 8 or (announced is not None and int(announced) != len(data)):
            raise ValueError(text)
    except ValueError as exc:
        raise UsageError(
            f"{text!r} is not a CAN frame", hint="give IDENTIFIER#DATA, such as 11000001#04, or 11000001 [1] 04"
        ) from exc
    if not 0 <= identifier < 1 << 29 or len(data) > 8:
        raise UsageError(
            f"{text!r}: an identifier has 29 bits and a frame 8 bytes at most", hint="give a frame such as 11000001#04"
        )
    return CanFrame(identifier, data)


def plan_can(frame: CanFrame, force: bool, *, only_explain: bool = False) -> Step:
    """What a CAN frame would do; an explanation where the manual prints it for something else."""
    access = canreg.parse_identifier(frame.can_id)
    explained = CAN_MISPRINTS.get((frame.can_id, frame.data))
    if explained is not None and only_explain:
        return Step(explained, frame.data, moves=True, can_id=frame.can_id)
    if access.writes and access.hand_id == canreg.ANY_ID and not force:
        raise UsageError(
            "id 16383 may mean every hand on the bus",
            hint="write to one hand. Add --force-ambiguous to send it anyway. Nothing was sent.",
        )
    if access.flag == canreg.WRITE_WRIST and not force:
        _refuse_illegal(access.address, frame.data)
    if access.flag == canreg.WRITE_HAND and touches_shared(access.address, len(frame.data)) and not force:
        raise UsageError(
            f"this writes address {access.address} of the hand: current limits or power-on speeds, not the wrist",
            hint="use flag 5 for the wrist. Add --force-ambiguous to send it anyway. Nothing was sent.",
            code="ambiguous",
        )
    reads = access.flag in (canreg.READ_HAND, canreg.READ_WRIST) and len(frame.data) == 1
    return Step(
        explained or describe_frame(frame), frame.data, moves=not reads, strands=not reads and access.flag != canreg.WRITE_WRIST,
        can_id=frame.can_id,
    )  # fmt: skip


def exchange_can(wrist: Wrist, frame: CanFrame, wait: float) -> Table:
    """Send one frame, listen for `wait` seconds, show what came: the same identifier is the answer, the rest is traffic."""
    bus = wrist.bus
    assert isinstance(bus, CanBus)
    bus.pass_gate(frame)
    bus.check_bound(str(frame))
    bus.drain()
    errors, since, deadline = bus.link.error_frames, bus.link.now(), bus.deadline(wait)
    bus.send(frame, deadline)
    rows: list[Row] = []
    while len(rows) < 1000:
        came = bus.receive(deadline)
        if came is None:
            break
        answer = came.can_id == frame.can_id and came != frame
        bus.journal.counters.received += answer
        access = canreg.parse_identifier(came.can_id)
        rows.append(
            {
                "direction": "device" if answer else ("own" if came == frame else "other"),
                "id": access.hand_id,
                "address": access.address,
                "data": hex_bytes(came.data),
                "meaning": describe_frame(came) + (_values(access, came.data) if answer else ""),
                "raw": str(came),
            }
        )
    if not any(
        row["direction"] != "other" or row["address"] == canreg.parse_identifier(frame.can_id).address for row in rows
    ):
        raise bus.silence(frame, errors, wait, since, "listen longer with --wait S")
    columns = (
        Column("direction", "From"),
        Column("id", "Id", right=True),
        Column("address", "Address", right=True),
        Column("data", "Data"),
        Column("meaning", "Meaning"),
    )
    return Table(rows=rows, columns=columns, failure=_judge(bus, frame, rows))


def _values(access: canreg.Access, data: bytes) -> str:
    """The documented values in the answer to a read of the wrist."""
    return f": {describe(WRIST, access.address, data)}" if access.flag == canreg.READ_WRIST and data else ""


def _judge(bus: CanBus, sent: CanFrame, rows: list[Row]) -> HandctlError | None:
    """Whether the answer is one: as the bus judges it for the named commands."""
    asked = canreg.parse_identifier(sent.can_id)
    answers = [row for row in rows if row["direction"] == "device"]
    if not answers:
        others = [row for row in rows if row["direction"] == "other" and row["address"] == asked.address]
        if others:
            return ProtocolError(
                f"{bus.where}: id {others[0]['id']} answered instead: {others[0]['raw']}",
                hint="use the --id it shows, or find the wrist with `handctl wrist scan`",
                code="wrong-id",
            )
        return ProtocolError(
            f"{bus.where}: only our own frame came back: {sent}",
            hint="check the adapter and the wire: no device answers",
            code="echo",
        )
    size = len(answers[0]["data"].split())
    if not asked.writes and len(sent.data) == 1 and size != sent.data[0]:
        return ProtocolError(
            f"{bus.where}: {sent.data[0]} bytes asked, {size} came: {answers[0]['raw']}",
            hint="check the bus: this may be another kind of device, or a second master is polling it",
            code="cut-short",
        )
    if asked.writes and size == 1 and int(answers[0]["data"], 16) != len(sent.data):
        return DeviceRefused(
            f"{bus.where}: {int(answers[0]['data'], 16)} of {len(sent.data)} bytes acknowledged",
            hint="read the value before you write again",
        )
    return None
