"""The register space of the hand that carries the wrist: raw reads and writes, in as many frames as the wire needs."""

from __future__ import annotations

from itertools import pairwise

from handctl.devices.inspire import canreg, eb90, twins
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.canbus import CanBus
from handctl.devices.inspire.map import EXO
from handctl.devices.inspire.wrist.device import Wrist
from handctl.devices.inspire.wrist.raw import touches_shared
from handctl.errors import CheckFailed, Left, NoAnswer, ProtocolError, UsageError
from handctl.model.param import Step
from handctl.model.result import Row, Table, hex_bytes
from handctl.sentence import plural


def hand_bus(wrist: Wrist) -> Bus | CanBus:
    """A bus to the hand's own registers, through flags 11/12 or CAN flags 0/1."""
    bus = wrist.bus.at("hand")
    assert isinstance(bus, Bus | CanBus)
    return bus


def hand_read(wrist: Wrist, address: int, count: int) -> Table:
    """Bytes of the hand's own space, raw: its manual is another one."""
    return _hand_row(wrist, address, hand_bus(wrist).read(address, count), "hand space")


def _hand_row(wrist: Wrist, address: int, data: bytes, label: str) -> Table:
    row: Row = {"name": None, "finger": None, "address": address, "value": None, "unit": None, "raw": hex_bytes(data)}
    return Table(rows=[{**row, "label": label}], columns=wrist.columns, plain=("raw",))


def plan_hand_write(wrist: Wrist, address: int, data: bytes, force: bool) -> Step:
    """A write into the hand's space; refused where the wrist's own registers would lie. Raises UsageError."""
    if touches_shared(address, len(data)) and not force:
        raise UsageError(
            f"address {address} of the hand holds current limits and power-on speeds, not the wrist",
            hint="use `handctl wrist set` or `write` for the wrist. --force-ambiguous writes to the hand anyway. "
            "Nothing was sent.",
            code="ambiguous",
        )
    if EXO["id"].address in range(address, address + len(data)):
        eb90.check_id(data[EXO["id"].address - address])
    step = hand_bus(wrist).write_step(
        address, data, f"write {hex_bytes(data)} at {address} of the hand, undocumented here"
    )
    return step._replace(moves=True, strands=True)


def plan_hand_writes(wrist: Wrist, address: int, data: bytes, force: bool) -> list[Step]:
    """The same in as many frames as the wire needs: 8 bytes each on CAN (wrist §2.3.2). Raises UsageError.

    What spans frames must not change the id, nor start anything: the frames behind it would meet another state.
    """
    pieces = _in_frames(hand_bus(wrist), address, data)
    alone = {register.address for register in EXO if register.trigger} | {EXO["id"].address}
    if len(pieces) > 1 and (found := sorted(alone & set(range(address, address + len(data))))):
        raise UsageError(
            f"{found[0]} of the hand is its id or starts something. On CAN it is not written within {plural(len(data), 'byte')}",
            hint="write it with a command of its own. Nothing was sent.",
        )
    return [plan_hand_write(wrist, place, part, force) for place, part in pieces]


def _in_frames(bus: Bus | CanBus, address: int, data: bytes) -> list[tuple[int, bytes]]:
    """The pieces of a write, each one frame; they meet at even addresses, so that no register of 2 bytes is cut."""
    if not isinstance(bus, CanBus) or len(data) <= canreg.MAX_COUNT:
        return [(address, data)]
    canreg.check_span(bus.id, address, len(data))
    first = canreg.MAX_COUNT - address % 2
    starts = [0, *range(first, len(data), canreg.MAX_COUNT), len(data)]
    return [(address + start, data[start:end]) for start, end in pairwise(starts)]


def hand_write(wrist: Wrist, address: int, data: bytes) -> Table:
    """Write into the hand's space once, and read back; what starts something there is not read back (RH56 §2.4).

    Each frame is acknowledged and read back before the next is sent. A new id is looked for under that id.
    Raises Interrupted on Ctrl-C, which takes nothing back.
    """
    bus = hand_bus(wrist)
    with wrist.bus.leaving(
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


def _hand_write(wrist: Wrist, bus: Bus | CanBus, address: int, data: bytes) -> Table:
    bytes_at = dict(enumerate(data, address))
    starts = [register.name for register in EXO if register.trigger and bytes_at.get(register.address) == 1]
    new = bytes_at.get(EXO["id"].address, bus.id)
    if starts or new != bus.id:
        twins.identify(wrist)
    more = {"acknowledged_by": (new,)} if isinstance(bus, Bus) else {}
    then = "handctl does not read it back, because it starts an action" if starts else "handctl reads it back"
    lost = bus.try_write(address, data, "the write", then, **more)
    if lost is not None and starts:
        lost.leaves(Left(hint=f"it may still have started {', '.join(starts)}", joint=". "))
        raise lost
    if starts:
        bus.journal.info(
            "not-read-back", f"accepted, but not read back: it starts {', '.join(starts)} on the RH56 hand"
        )
        return _hand_row(wrist, address, data, "written")
    now = _read_back(bus, address, len(data), new)
    table = _hand_row(wrist, address, now, "hand space")
    step = bus.write_step(address, data, "")
    if now == data:
        bus.journal.ledger.confirm("read back", step)
    else:
        bus.journal.ledger.doubt(f"reads {hex_bytes(now)}", step)
        table.failure = CheckFailed(
            f"{bus.where}: {address} of the hand reads {hex_bytes(now)} after {hex_bytes(data)} was written",
            hint=f"read it again before you write: `handctl wrist hand-read {address} {len(data)}`",
            code="read-back",
        )
    if now == data and bus.id != wrist.bus.id:
        bus.journal.warn(
            "new-id",
            f"the hand and its wrist now answer to id {bus.id} until power-off",
            hint=f"use --id {bus.id}",
        )
    return table


def _read_back(bus: Bus | CanBus, address: int, count: int, new: int) -> bytes:
    """What stands there now, read through the id `new`, or through the old one when nobody has that."""
    old, bus.id = bus.id, new
    if new == old:
        return bus.read(address, count)
    try:
        return bus.read(address, count)
    except (NoAnswer, ProtocolError):
        bus.id = old
        return bus.read(address, count)
