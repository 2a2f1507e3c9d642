"""Raw access to the wrist: registers, frames of both wires, and the real effect of the manual's misprinted examples.

The register space of the hand that carries the wrist is read and written raw, in as many frames as the wire needs.
"""

from __future__ import annotations

from itertools import pairwise

from handctl.devices.inspire import can_frames, eb90
from handctl.devices.inspire import raw as by_number
from handctl.devices.inspire.can_bus import CanBus, related
from handctl.devices.inspire.explain_bytes import CAN_MISPRINTS, MISPRINTS, InspireExplainer
from handctl.devices.inspire.hand import raw as hand_raw
from handctl.devices.inspire.hand.detect_generation import ModelGate
from handctl.devices.inspire.hand.device import Hand
from handctl.devices.inspire.raw import RAW_COLUMNS, changes_of, check_values, judge_read_back, nameless, refused
from handctl.devices.inspire.register_bus import RegisterBus
from handctl.devices.inspire.register_device import RegisterDevice
from handctl.devices.inspire.wrist.register_map import WRIST
from handctl.errors import DeviceRefused, UsageError
from handctl.link import CanFrame
from handctl.model.explainer import DEVICE, HOST
from handctl.model.param import Step
from handctl.model.result import Row, Table, hex_bytes

CAN_COLUMNS = tuple(column for column in RAW_COLUMNS if column.key not in ("flag", "raw"))
WRITE_SIZES = (2, 4, 6)
"""Bytes of a wrist write. Eight would be an exo force command (wrist §2.2.1, exo §2.2.1)."""
SHARED = range(1020, 1044)
"""Wrist registers; in the hand's space current limits and power-on speeds lie here (RH56 §2.4.7, §2.4.8)."""


def explained(step: Step) -> bool:
    """Whether a plan's meaning is the explanation of a misprint."""
    return step.meaning in MISPRINTS.values() or step.meaning in CAN_MISPRINTS.values()


def touches_shared(address: int, count: int) -> bool:
    return address < SHARED.stop and SHARED.start < address + count


def _refuse_illegal(address: int, data: bytes) -> None:
    """Refuse a raw write whose values the manual does not allow. Raises UsageError."""
    explained = next((f". {text}" for (_, known), text in CAN_MISPRINTS.items() if known == data), "")
    check_values(WRIST, address, data, explained)


def plan_write(wrist: RegisterDevice, address: int, data: bytes) -> Step:
    """Check a write: whole settable registers side by side, 2, 4 or 6 bytes, legal values. Raises UsageError."""
    if len(data) not in WRITE_SIZES:
        raise UsageError(
            f"a wrist write of {len(data)} byte{'s' * (len(data) != 1)} is never sent",
            hint="write 2, 4 or 6 bytes: with 8 it would be a force command of an exoskeleton hand. Nothing was sent.",
        )
    texts = []
    for offset in range(0, len(data), 2):
        register = next((one for one in WRIST if one.address == address + offset), None)
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


def write(wrist: RegisterDevice, address: int, data: bytes) -> Table:
    """Write whole registers by address, once, and read them back."""
    return wrist.table(wrist.write(changes_of(WRIST, address, data)))


# -- raw frames -----------------------------------------------------------------------------------------------------


def plan_raw(data: bytes, force: bool, *, only_explain: bool = False) -> Step:
    """What a serial frame would do; an explanation where the manual prints it for something else.

    With `only_explain` (a dry run) a misprint is explained also where it would be refused.
    """
    explained = MISPRINTS.get(data)
    if explained is not None and only_explain:
        return Step(explained, data, moves=True)
    pieces = InspireExplainer(WRIST).decode(data, HOST)
    piece, *more = pieces
    unknown = "this is not a complete read or write, so its effect on the device is unknown"
    if more and explained is None:
        return by_number.several(data, pieces, lambda frame: plan_raw(frame, force))
    if not piece.frame or not data.startswith(eb90.HOST):
        return Step(explained or unknown, data, moves=True, strands=True)
    frame, said = eb90.Frame(data[:2], data[2], data[4], data[5:-1]), explained or piece.meaning
    flag, address, values = frame.flag, frame.address, frame.data
    if flag in (eb90.WRIST_READ, eb90.READ) and len(frame.payload) == 3:
        return Step(said, data)
    if flag == eb90.WRIST_WRITE and len(frame.payload) == 10 and not force:
        hint = "write 2, 4 or 6 bytes to a wrist."
        raise refused("8 bytes with flag 31 are a force command of an exoskeleton hand", hint)
    if flag == eb90.WRIST_WRITE:
        if address is not None and explained is None and not force:
            _refuse_illegal(address, values)
        return Step(said, data, moves=True, strands=address is None)
    if flag == eb90.WRITE and touches_shared(address or 0, len(values)) and not force:
        text = f"flag 12 at {address} writes current limits or power-on speeds of the hand, not the wrist"
        raise refused(text, "use flag 31 for the wrist.")
    if flag == eb90.WRITE and address is not None and not force:
        hand_raw.refuse_write(frame.id, address, values)
    return Step(said if flag == eb90.WRITE else explained or unknown, data, moves=True, strands=True)


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
    access = can_frames.parse_identifier(frame.can_id)
    explained = CAN_MISPRINTS.get((frame.can_id, frame.data))
    if explained is not None and only_explain:
        return Step(explained, frame.data, moves=True, can_id=frame.can_id)
    if access.writes and access.hand_id == can_frames.ANY_ID and not force:
        raise refused("id 16383 may mean every hand on the bus", "write to one hand.", UsageError.default_code)
    if access.flag == can_frames.WRITE_WRIST and not force:
        _refuse_illegal(access.address, frame.data)
    if access.flag == can_frames.WRITE_HAND and touches_shared(access.address, len(frame.data)) and not force:
        text = f"this writes address {access.address} of the hand: current limits or power-on speeds, not the wrist"
        raise refused(text, "use flag 5 for the wrist.")
    if access.flag == can_frames.WRITE_HAND and not force:
        hand_raw.refuse_write(None, access.address, frame.data)
    reads = can_frames.only_reads(frame.can_id, frame.data)
    (piece,) = InspireExplainer(WRIST).sent(frame.data, frame.can_id)
    strands = not reads and access.flag != can_frames.WRITE_WRIST
    return Step(explained or piece.meaning, frame.data, moves=not reads, strands=strands, can_id=frame.can_id)


def exchange_can(wrist: RegisterDevice, frame: CanFrame, wait: float) -> Table:
    """Send one frame and listen for `wait` seconds: frames with the same identifier are replies, the others are traffic."""
    bus, explainer = wrist.bus, InspireExplainer(WRIST)
    assert isinstance(bus, CanBus)
    bus.pass_gate(frame)
    bus.check_bound(str(frame))
    bus.drain()
    errors, since, deadline = bus.link.error_frames, bus.link.now(), bus.deadline(wait)
    bus.send(frame, deadline)
    explainer.sent(frame.data, frame.can_id)
    came: list[CanFrame] = []
    while len(came) < 1000 and (one := bus.receive(deadline)) is not None:
        came.append(one)
    odd = [one for one in came if related(one, frame)]
    mine = [one for one in odd if one.can_id == frame.can_id and one != frame]
    bus.journal.counters.received += len(mine)
    if not odd:
        raise bus.silence(frame, errors, wait, since, "listen longer with --wait S")
    rows: list[Row] = []
    for one in came:
        access, (piece,) = can_frames.parse_identifier(one.can_id), explainer.feed(DEVICE, one.data, one.can_id)
        row = {
            "direction": "device" if one in mine else "own" if one == frame else "other",
            "id": access.hand_id,
            "address": access.address,
            "data": hex_bytes(one.data),
            "meaning": piece.meaning,
            "raw": str(one),
        }
        rows.append(row)
    table = Table(rows=rows, columns=CAN_COLUMNS)
    asked = can_frames.parse_identifier(frame.can_id)
    if not mine or not (asked.writes or [len(mine[0].data)] == list(frame.data)):
        table.failure = bus.bad_reply(frame, odd)
    elif asked.writes and len(mine[0].data) == 1:
        table.failure = bus.refusal(asked.address, frame.data, mine[0].data)
    return table


# -- the hand that carries it -----------------------------------------------------------------------------------------


class Carrier(Hand):
    """The hand that carries a wrist. That the wrist replies shows who it is; its generation decides where its registers are."""

    def know(self) -> None:
        """`identify` has found out, as far as the hand shows its generation; `handctl wrist` has no --model."""

    def identify(self) -> None:
        """As every hand, on a wrist only. Raises DeviceRefused for a generation that counts words: its registers are elsewhere (rh56 §3.2)."""
        self.bus.identify()
        super().identify()
        if self.bus.per != 1:
            raise DeviceRefused(
                f"{self.bus.where}: {self.found().words} has its registers at other addresses",
                hint=f"use `handctl hand write --model {self.about['model']}`, which knows them. Nothing was written.",
                code="other-model",
            )


def carrier(wrist: RegisterDevice) -> Carrier:
    """The hand's own registers, through flags 11/12 or CAN flags 0/1."""
    bus, assumed = wrist.bus.at("hand"), wrist.bus.gate is not None and wrist.bus.gate.assumed
    gate = ModelGate(None, assumed)
    gate.assumed = assumed
    return Carrier(bus, gate)


def hand_read(wrist: RegisterDevice, address: int, count: int) -> Table:
    """Bytes of the hand's own space, raw: its manual is another one."""
    return _hand_row(wrist, address, wrist.bus.at("hand").read(address, count))


def _hand_row(device: RegisterDevice, address: int, data: bytes) -> Table:
    return Table(rows=[nameless(address, data, "hand space")], columns=device.columns, plain=("raw",))


def plan_hand_writes(hand: Hand, address: int, data: bytes, *, force: bool, undocumented: bool) -> list[Step]:
    """A write into the hand's space, in as many frames as the wire needs: 8 bytes each on CAN (wrist §2.3.2).

    What `handctl hand write` refuses is refused, and so is what lies where the wrist has its own registers. Raises UsageError.
    """
    if touches_shared(address, len(data)) and not force:
        raise UsageError(
            f"address {address} of the hand holds current limits and power-on speeds, not the wrist",
            hint="use `handctl wrist set` or `write` for the wrist. --force-ambiguous writes to the hand anyway. Nothing was sent.",
            code="ambiguous",
        )
    return [_planned(hand, place, part, force, undocumented) for place, part in _in_frames(hand.bus, address, data)]


def _planned(hand: Hand, address: int, data: bytes, force: bool, undocumented: bool) -> Step:
    try:
        return hand_raw.plan_write(hand, address, data, undocumented)
    except UsageError as exc:
        if not (force and exc.code == "out-of-range" and touches_shared(address, len(data))):
            raise
        meaning = f"write {hex_bytes(data)} at {address} of the hand, although {exc.text}"
        return hand.bus.write_step(address, data, meaning)._replace(strands=True)


def _in_frames(bus: RegisterBus, address: int, data: bytes) -> list[tuple[int, bytes]]:
    """The pieces of a write, each one frame; they meet at even addresses, so that no register of 2 bytes is cut."""
    if not isinstance(bus, CanBus) or len(data) <= can_frames.MAX_COUNT:
        return [(address, data)]
    can_frames.check_span(bus.id, address, len(data))
    first = can_frames.MAX_COUNT - address % 2
    starts = [0, *range(first, len(data), can_frames.MAX_COUNT), len(data)]
    return [(address + start, data[start:end]) for start, end in pairwise(starts)]


def hand_write(hand: Hand, address: int, data: bytes) -> Table:
    """Write into the hand's space once, and read back, each frame before the next. Raises Interrupted, after a stop."""
    with by_number.stopped_by_ctrl_c(hand, address, data):
        now: list[str] = []
        for place, part in _in_frames(hand.bus, address, data):
            table = _hand_write(hand, place, part)
            now.append(table.rows[0]["raw"])
            if table.failure is not None:
                if rest := address + len(data) - place - len(part):
                    table.failure.text += f". The {rest} bytes behind it were not sent"
                break
        table.rows[0] |= {"address": address, "raw": " ".join(now)}
        return table


def _hand_write(hand: Hand, address: int, data: bytes) -> Table:
    bus = hand.bus
    bus.try_write(address, data, "the write", "handctl reads it back")
    now = bus.read_back(lambda: bus.read(address, len(data)), data.__eq__)
    table = _hand_row(hand, address, now)
    again = f"wrist hand-read {address} {len(data)}"
    judge_read_back(hand, table, bus.write_step(address, data, ""), f"{address} of the hand", data, now, again)
    return table
