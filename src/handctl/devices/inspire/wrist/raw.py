"""Raw access to the wrist: registers, frames of both wires, and the real effect of the manual's misprinted examples.

The register space of the hand that carries the wrist is read and written raw, in as many frames as the wire needs.
"""

from __future__ import annotations

from itertools import pairwise

from handctl.devices.inspire import can_frames, eb90
from handctl.devices.inspire.can_bus import CanBus, related
from handctl.devices.inspire.duplicate_id import identify_alone
from handctl.devices.inspire.exo.register_map import EXO
from handctl.devices.inspire.explain_bytes import CAN_MISPRINTS, MISPRINTS, InspireExplainer
from handctl.devices.inspire.raw import RAW_COLUMNS, changes_of, check_values, judge_read_back, nameless, refused
from handctl.devices.inspire.register_device import RegisterDevice
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.devices.inspire.wrist.register_map import WRIST
from handctl.errors import Aftermath, NoAnswer, ProtocolError, UsageError
from handctl.link import CanFrame
from handctl.model.explainer import DEVICE, HOST
from handctl.model.param import Step
from handctl.model.result import Row, Table, hex_bytes
from handctl.wording import plural

CAN_COLUMNS = tuple(column for column in RAW_COLUMNS if column.key not in ("flag", "raw"))
WRITE_SIZES = (2, 4, 6)
"""Bytes of a wrist write. Eight would be an exo force command (wrist §2.2.1, exo §2.2.1)."""
SHARED = range(1020, 1044)
"""Wrist registers; in the hand's space current limits and power-on speeds lie here (RH56 §2.4.7, §2.4.8)."""


def misprint(data: bytes) -> str | None:
    """What a frame that the manual prints wrongly really does; None for any other frame."""
    return MISPRINTS.get(data)


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
    explained = misprint(data)
    if explained is not None and only_explain:
        return Step(explained, data, moves=True)
    piece, *more = InspireExplainer(WRIST).decode(data, HOST)
    unknown = "this is not a complete read or write, so its effect on the device is unknown"
    if more or not piece.frame or not data.startswith(eb90.HOST):
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


def hand_bus(wrist: RegisterDevice) -> SerialBus | CanBus:
    """A bus to the hand's own registers, through flags 11/12 or CAN flags 0/1."""
    bus = wrist.bus.at("hand")
    assert isinstance(bus, SerialBus | CanBus)
    return bus


def hand_read(wrist: RegisterDevice, address: int, count: int) -> Table:
    """Bytes of the hand's own space, raw: its manual is another one."""
    return _hand_row(wrist, address, hand_bus(wrist).read(address, count), "hand space")


def _hand_row(wrist: RegisterDevice, address: int, data: bytes, label: str) -> Table:
    return Table(rows=[nameless(address, data, label)], columns=wrist.columns, plain=("raw",))


def plan_hand_write(wrist: RegisterDevice, address: int, data: bytes, force: bool) -> Step:
    """A write into the hand's space; refused where the wrist's own registers would lie. Raises UsageError."""
    if touches_shared(address, len(data)) and not force:
        raise UsageError(
            f"address {address} of the hand holds current limits and power-on speeds, not the wrist",
            hint=(
                "use `handctl wrist set` or `write` for the wrist. --force-ambiguous writes to the hand anyway. Nothing was sent."
            ),
            code="ambiguous",
        )
    if EXO["id"].address in range(address, address + len(data)):
        eb90.check_id(data[EXO["id"].address - address])
    step = hand_bus(wrist).write_step(
        address, data, f"write {hex_bytes(data)} at {address} of the hand, undocumented here"
    )
    return step._replace(moves=True, strands=True)


def plan_hand_writes(wrist: RegisterDevice, address: int, data: bytes, force: bool) -> list[Step]:
    """The same in as many frames as the wire needs: 8 bytes each on CAN (wrist §2.3.2). Raises UsageError.

    What spans frames must not change the id, nor start anything: the frames behind it would meet another state.
    """
    pieces = _in_frames(hand_bus(wrist), address, data)
    alone = {register.address for register in EXO if register.trigger} | {EXO["id"].address}
    if len(pieces) > 1 and (found := sorted(alone & set(range(address, address + len(data))))):
        raise UsageError(
            f"address {found[0]} of the hand is its id or starts an action. On CAN, handctl does not write it as part of {plural(len(data), 'byte')}",
            hint="write it with a command of its own. Nothing was sent.",
        )
    return [plan_hand_write(wrist, place, part, force) for place, part in pieces]


def _in_frames(bus: SerialBus | CanBus, address: int, data: bytes) -> list[tuple[int, bytes]]:
    """The pieces of a write, each one frame; they meet at even addresses, so that no register of 2 bytes is cut."""
    if not isinstance(bus, CanBus) or len(data) <= can_frames.MAX_COUNT:
        return [(address, data)]
    can_frames.check_span(bus.id, address, len(data))
    first = can_frames.MAX_COUNT - address % 2
    starts = [0, *range(first, len(data), can_frames.MAX_COUNT), len(data)]
    return [(address + start, data[start:end]) for start, end in pairwise(starts)]


def hand_write(wrist: RegisterDevice, address: int, data: bytes) -> Table:
    """Write into the hand's space once, and read back; what starts something there is not read back (RH56 §2.4).

    Each frame is acknowledged and read back before the next is sent. A new id is looked for under that id.
    Raises Interrupted on Ctrl-C, which takes nothing back.
    """
    bus = hand_bus(wrist)
    with wrist.bus.on_early_end(
        f"{hex_bytes(data)} may be written at {address} of the hand", "`handctl wrist hand-read` shows it"
    ):
        now: list[str] = []
        for place, part in _in_frames(bus, address, data):
            table = _hand_write(wrist, bus, place, part)
            now.append(table.rows[0]["raw"])
            if table.failure is not None:
                if rest := address + len(data) - place - len(part):
                    table.failure.text += f". The {rest} bytes behind it were not sent"
                break
        table.rows[0] |= {"address": address, "raw": " ".join(now)}
        return table


def _hand_write(wrist: RegisterDevice, bus: SerialBus | CanBus, address: int, data: bytes) -> Table:
    bytes_at = dict(enumerate(data, address))
    starts = [register.name for register in EXO if register.trigger and bytes_at.get(register.address) == 1]
    new = bytes_at.get(EXO["id"].address, bus.id)
    if starts or new != bus.id:
        identify_alone(wrist)
    then = "handctl does not read it back, because it starts an action" if starts else "handctl reads it back"
    lost = bus.try_write(address, data, "the write", then, acknowledged_by=(new,))
    if lost is not None and starts:
        lost.add_aftermath(Aftermath(hint=f"it may still have started {', '.join(starts)}", joint=". "))
        raise lost
    if starts:
        bus.journal.info(
            "not-read-back", f"accepted, but not read back: on the RH56 hand, this write starts {', '.join(starts)}"
        )
        return _hand_row(wrist, address, data, "written")
    now = bus.read_back(lambda: _read_with_either_id(bus, address, len(data), new), data.__eq__)
    table = _hand_row(wrist, address, now, "hand space")
    again = f"wrist hand-read {address} {len(data)}"
    judge_read_back(bus, table, bus.write_step(address, data, ""), f"{address} of the hand", data, now, again)
    if now == data and bus.id != wrist.bus.id:
        bus.journal.warn(
            "new-id",
            f"the hand and its wrist now respond to id {bus.id} until power-off",
            hint=f"use --id {bus.id}",
        )
    return table


def _read_with_either_id(bus: SerialBus | CanBus, address: int, count: int, new: int) -> bytes:
    """What stands there now, read through the id `new`, or through the old one when nobody has that."""
    old, bus.id = bus.id, new
    try:
        return bus.read(address, count)
    except (NoAnswer, ProtocolError):
        if new == old:
            raise
        bus.id = old
        return bus.read(address, count)
