"""Registers and frames by number: read, write, raw. What the manual says about an address is still checked."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from itertools import groupby

from handctl.devices.inspire import eb90
from handctl.devices.inspire.explain_bytes import InspireExplainer, stretches
from handctl.devices.inspire.register_bus import PATIENCE
from handctl.devices.inspire.register_device import RegisterDevice
from handctl.devices.inspire.register_map import Register
from handctl.devices.inspire.serial_bus import SerialBus, bad_reply, hint_for, others_speak
from handctl.errors import CheckFailed, DeviceRefused, HandctlError, Hint, NoAnswer, ProtocolError, UsageError
from handctl.model.explainer import DEVICE, ExplainedBytes
from handctl.model.param import Element, Number, ParamMap, Reading, Step
from handctl.model.result import Column, Row, Table, hex_bytes, hex_shown

FORCED = "`raw --force-ambiguous` sends it anyway."
HAND = "This may move or change the hand"
DEVICE_ITSELF = "This may move or change the device"


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
    try:
        data = hand.bus.read(address, count)
    except (NoAnswer, ProtocolError) as exc:
        if hand.bus.gate is not None:
            hand.bus.gate.unheard(hand.bus, exc)
        raise
    return Table(rows=_rows(hand, address, data), columns=hand.columns)


def _rows(hand: RegisterDevice, address: int, data: bytes) -> list[Row]:
    """A row for each whole element, and for what stands together of none."""
    rows: list[Row] = []
    for register, at, raw in stretches(hand.map, address, data):
        if register is not None and register.readable:
            rows.append(hand.row(Reading(Element(register, at), register.decode(raw), raw)))
            continue
        start = at if register is None else register.address_of(at)
        for label, group in groupby(range(start, start + len(raw)), partial(_part_of, hand.map)):
            places = list(group)
            part = raw[places[0] - start : places[-1] + 1 - start]
            rows.append(nameless(places[0] // hand.bus.per, part, label))
    return rows


def nameless(address: int, data: bytes, label: str) -> Row:
    """The row of bytes that have no name."""
    row: Row = {"name": None, "finger": None, "address": address, "value": None, "unit": None, "raw": hex_bytes(data)}
    return {**row, "label": label}


def _part_of(params: ParamMap[Register], address: int) -> str:
    """What a byte is that begins no whole element in the span that was read."""
    for register in params:
        if register.readable and address in register.span:
            return f"part of {Element(register, (address - register.address) // register.size).full_name}"
    return "undocumented"


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
    """What a write within one group sets, in words. Raises UsageError for what it must not."""
    name, kind, size = register.name, hand.kind, register.size
    hint: str
    if register.trigger:
        text, hint = f"{address} is {name}: a write to it starts an action", Hint("use {}.", f"{kind} {register.verb}")
    elif "w" not in register.access:
        text = f"{address} is {name}, which is read-only ({register.source})"
        hint = Hint("read it with {}.", f"{kind} get {name}")
    elif name == "id":
        text, hint = f"{address} is the id", f"use `handctl {kind} id NEW`, which finds the hand again."
    elif (address - register.address) % size or len(data) % size:
        text, hint = f"each element of {name} has {size} bytes: this write would cut one", "write whole elements."
    else:
        changes = changes_of(hand.map, address, data)
        for element, value in changes:
            register.check(value, element.full_name)
        return ", ".join(f"{element.full_name} = {value}" for element, value in changes)
    raise UsageError(text, hint=f"{hint} Nothing was sent.")


def write(hand: RegisterDevice, address: int, data: bytes) -> Table:
    """Write once, read back; a read-back that differs is the table's failure. Raises Interrupted, after a stop."""
    with stopped_by_ctrl_c(hand, address, data):
        return _write(hand, address, data)


def stopped_by_ctrl_c(hand: RegisterDevice, address: int, data: bytes) -> AbstractContextManager[None]:
    """Around a write by number: Ctrl-C stops what it may have set going. Raises Interrupted."""
    moving = any(register.moves and _overlap(register, address, len(data)) for register in hand.map)
    return hand.stopped_by_ctrl_c(f"{hex_bytes(data)} at {address}", moving)


def _write(hand: RegisterDevice, address: int, data: bytes) -> Table:
    step = hand.bus.write_step(address, data, "")
    hand.bus.try_write(address, data, "the write", "handctl reads it back")
    now = hand.bus.read_back(lambda: hand.bus.read(address, len(data)), data.__eq__)
    table = Table(rows=_rows(hand, address, now), columns=hand.columns)
    judge_read_back(hand, table, step, str(address), data, now, f"{hand.kind} read {address} {len(data)}")
    return table


def judge_read_back(
    hand: RegisterDevice, table: Table, step: Step, where: str, data: bytes, now: bytes, again: str
) -> None:
    """Enter what a write reads as `now`; where that differs it is the table's failure."""
    if now == data:
        hand.journal.ledger.confirm("read back", step)
        return
    hand.journal.ledger.doubt(f"reads {hex_bytes(now)}", step)
    table.failure = CheckFailed(
        f"{hand.bus.where}: {where} reads {hex_bytes(now)} after {hex_bytes(data)} was written",
        hint=Hint("read it again before you write: {}", f"{again}"),
        code="read-back",
    )
    hand.tell_moving(table.failure)


def changes_of(params: ParamMap[Register], address: int, data: bytes) -> list[tuple[Element, Number]]:
    """What a checked write at a byte address changes."""
    return [
        (Element(register, index), register.decode(raw))
        for register, index, raw in stretches(params, address, data)
        if register is not None
    ]


UNKNOWN = "this is not a complete frame, so its effect is unknown"


def several(data: bytes, pieces: Sequence[ExplainedBytes], plan: Callable[[bytes], Step]) -> Step:
    """What bytes do that are not one frame: each frame among them is planned, and named, by itself. Raises what `plan` raises."""
    whole = [
        piece for piece in pieces if len(piece.raw) < len(data) and (piece.frame or piece.problem == "bad-checksum")
    ]
    said = [plan(piece.raw).meaning for piece in whole]
    if len(whole) < len(pieces):
        said.append("the rest is not a complete frame, so its effect is unknown" if said else UNKNOWN)
    return Step("; ".join(said), data, moves=True, strands=True)


def asked(step: Step, question: str) -> tuple[Step, str]:
    """The step, and the question before it; "" where it only reads."""
    return step, question if step.moves or step.strands else ""


def refused(text: str, hint: str = "", code: str = "ambiguous") -> UsageError:
    """The error of bytes that are not sent unless --force-ambiguous is given."""
    return UsageError(text, hint=f"{hint} {FORCED} Nothing was sent.".lstrip(), code=code)


@contextmanager
def forceable(more: str = "", code: str = "") -> Iterator[None]:
    """Around checks of bytes that are sent as they are typed: the hint names the option that skips them."""
    try:
        yield
    except UsageError as exc:
        exc.text += more
        exc.hint, exc.code = f"{exc.hint} {FORCED}", code or exc.code
        raise


def check_values(params: ParamMap[Register], address: int, data: bytes, more: str = "") -> None:
    """Refuse a raw write of values that the manual does not allow, in words with `more` behind. Raises UsageError."""
    for register, index, raw in stretches(params, address, data):
        if register is not None and "w" in register.access:
            with forceable(more):
                register.check(register.decode(raw), Element(register, index).full_name)


def goes_on(hand: RegisterDevice, step: Step) -> AbstractContextManager[None]:
    """Ctrl-C while the answer to raw bytes is awaited: they are not taken back, which is told."""
    if not (step.moves or step.strands):
        return nullcontext()
    return hand.bus.on_early_end(
        f"the bytes were sent and cannot be taken back: {step.meaning}", f"check with `handctl {hand.kind} status`"
    )


def exchange(hand: RegisterDevice, data: bytes, wait: float) -> Table:
    """Send bytes once, listen for `wait` seconds after the last byte came, show every frame in the answer.

    Where others go on speaking there is no last byte: then for a few times as long.
    """
    bus = hand.bus
    assert isinstance(bus, SerialBus)
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
    explainer = InspireExplainer(hand.map)
    asks = {piece.asks for piece in explainer.sent(data)} - {""}
    pieces = [piece for piece in (*explainer.feed(DEVICE, received), *explainer.flush()) if piece.frame]
    bus.journal.counters.received += len(pieces)
    bus.journal.counters.stray_bytes += len(received) - sum(len(piece.raw) for piece in pieces)
    extra = {"received": hex_bytes(received)}
    table = Table(rows=[_frame_row(piece) for piece in pieces], columns=RAW_COLUMNS, extra=extra)
    table.failure = failure_of_replies(hand, data, received, pieces, asks)
    return table


def failure_of_replies(
    hand: RegisterDevice, data: bytes, received: bytes, pieces: Sequence[ExplainedBytes], asks: Collection[str]
) -> HandctlError | None:
    """What speaks against the bytes that came behind a typed request in EB90: none replies to it, or one refuses it."""
    bus = hand.bus
    replies = [piece for piece in pieces if piece.raw.startswith(eb90.DEVICE)]
    if not any(piece.answers in asks or piece.raw[2:3] == data[2:3] for piece in replies):
        code, text = bad_reply(data, received)
        text = f"{bus.where}: {text}: {hex_shown(received)}"
        return ProtocolError(text, hint=hint_for(code, bus.family), code=code)
    refused = [one for one in replies if one.problem == "refused" and (one.answers in asks or not one.answers)]
    if not refused:
        return None
    text = "the save failed: result FF (00 = saved, FF = failed)"
    if refused[0].answers:
        text = f"the device replied {hex_bytes(refused[0].raw[7:-1])} instead of 01"
    hint = Hint("check with {} before you send it again", f"{hand.kind} status")
    return DeviceRefused(f"{bus.where}: {text}", hint=hint)


RAW_COLUMNS = (
    Column("direction", "From"),
    Column("id", "Id", right=True),
    Column("flag", "Flag"),
    Column("address", "Address", right=True),
    Column("data", "Data"),
    Column("meaning", "Meaning"),
    Column("raw", "Frame"),
)


def _frame_row(piece: ExplainedBytes) -> Row:
    frame = eb90.Frame(piece.raw[:2], piece.raw[2], piece.raw[4], piece.raw[5:-1])
    return {
        "direction": "device" if frame.from_device else "host",
        "id": frame.id,
        "flag": f"{frame.flag:02X}",
        "address": frame.address,
        "data": hex_bytes(frame.data if frame.address is not None else frame.payload),
        "meaning": piece.meaning,
        "raw": hex_bytes(piece.raw),
    }
