"""What the manuals of the Inspire devices leave open alike, as experiments over any of their wires. See `model.proofs`.

A save and a calibration cannot be put back: flash has no other copy, and what is written there is not known before. Everything else is a read by the bus, which takes nothing but a whole reply with the right id, address, length and checksum.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from statistics import median
from typing import Any

from handctl.devices.inspire.duplicate_id import identify_alone
from handctl.devices.inspire.eb90 import MAX_COUNT, WRITE, write_ack_prefix, write_request
from handctl.devices.inspire.id_baud_save_reset import probe, save_failed, save_frames
from handctl.devices.inspire.register_bus import RegisterBus, Span
from handctl.devices.inspire.register_device import RegisterDevice
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.errors import CheckFailed, DeviceRefused, Hint, Interrupted, NoAnswer
from handctl.model.param import Step
from handctl.model.prompts import Prompts
from handctl.model.proofs import PERMANENT, WRITE_BACK, Disturbed, Observation, Proof, put_back
from handctl.model.result import Table

ANSWERED, SILENT, REFUSED = "answered", "silent", "refused"
SIZES = (MAX_COUNT, 200, 151, 100, 64, 32, 12)
"""Bytes of the reads that are tried, the longest first."""
CONFIRMED = (False, True, True, False, False, True)
"""What is asked behind a read that was silent: that read again, or the known one."""
TIMED = 9
SPARE_IDS = range(253, 240, -1)


COUNTS_WORDS = Observation(None, "the addresses of this generation count words, so these spans do not exist")


def once(bus: RegisterBus, span: Span) -> tuple[str, bytes]:
    """How one read ends, asked once, and its data. Raises ProtocolError where the reply is damaged."""
    try:
        return ANSWERED, bus.read(*span, retries=0)
    except NoAnswer as exc:
        if exc.code == "deadline":
            raise
        return SILENT, b""
    except DeviceRefused:
        return REFUSED, b""


def reply(bus: RegisterBus, span: Span, known: RegisterBus | None = None) -> tuple[str, bytes]:
    """The same; silence only where it is silent four times and a known read on `known` is answered in between, each time.

    The gaps between the four differ, so that no fault that meets every so many requests looks like it. Raises NoAnswer.
    """
    how, data = once(bus, span)
    if how != SILENT:
        return how, data
    there = known or bus
    for asked in CONFIRMED:
        if asked and once(bus, span)[0] != SILENT:
            raise Disturbed(f"{bus.where}: sometimes no reply to a read of {span[1]} bytes at {span[0]}")
        if not asked:
            there.read(*there.first_questions[-1], retries=0)
    return SILENT, b""


def _across(span: Span, device: RegisterDevice) -> Observation:
    if device.bus.per != 1:
        return COUNTS_WORDS
    if span[1] > device.bus.max_count:
        return Observation(None, f"this wire reads {device.bus.max_count} bytes at most")
    how, _ = reply(device.bus, span)
    return Observation(how, f"{span[1]} bytes at {span[0]}: {how}")


def _in_gap(spans: Iterable[Span], device: RegisterDevice) -> Observation:
    """What bytes read that are in no manual; silence is told for itself, where every one of them is silent."""
    if device.bus.per != 1:
        return COUNTS_WORDS
    found = [(span, *reply(device.bus, span)) for span in spans]
    kinds = {("zeros" if not any(data) else "other values") if how == ANSWERED else how for _, how, data in found}
    told = "; ".join(f"{span[1]} at {span[0]}: {data.hex(' ').upper() or how}" for span, how, data in found)
    return Observation(kinds.pop() if len(kinds) == 1 else "other values" if "other values" in kinds else None, told)


def _longest(start: int, device: RegisterDevice) -> Observation:
    bus = device.bus
    if bus.per != 1 or bus.wire != "eb90":
        return COUNTS_WORDS if bus.per != 1 else Observation(None, f"this wire reads {bus.max_count} bytes at most")
    for size in SIZES:
        if reply(bus, (start, size))[0] == ANSWERED:
            return Observation(size, f"{size} bytes at {start} in one reply")
    return Observation(None, f"no read at {start} was answered")


def _reply_time(device: RegisterDevice) -> Observation:
    """The time of an exchange, without that of its bits: the turnaround of the device, its adapter and the line."""
    bus, span, taken = device.bus, device.bus.first_questions[-1], list[float]()
    for _ in range(TIMED):
        started = device.link.now()
        bus.read(*span, retries=0)
        taken.append(device.link.now() - started)
    ms = 1000 * max(0.0, median(taken) - bus.wire_seconds(19 if bus.serial else 0))
    return Observation(
        round(ms), f"median of {TIMED} reads {ms:.1f} ms, longest {1000 * max(taken):.1f} ms with its bits"
    )


def _sign(names: tuple[str, ...], device: RegisterDevice) -> Observation:
    """Of words that the manual prints without a sign: one above 32767 is a negative number."""
    elements = [element for name in names for element in device.own_map()[name].each]
    values = [int(one.required) for one in device.read(elements)]
    told = f"{' '.join(names)}: {' '.join(map(str, values))}"
    return Observation(
        "signed" if min(values) < 0 else None, told if min(values) < 0 else f"{told}: none is below 0 now"
    )


def _speed_register(device: RegisterDevice) -> Observation:
    """Where the code of this link's speed is, if it is one that the other place does not hold as well."""
    link = device.link
    codes = {rate: code for code, rate in device.speeds().items()}
    speed = getattr(link, "baud", None) if getattr(link, "can_set_baud", False) else None
    code = codes.get(speed or 0, 0)
    if device.bus.per != 1:
        return COUNTS_WORDS
    data = device.bus.read(1000, 4, retries=0)
    places = [place for place in (1001, 1002) if data[place - 1000] == code]
    told = f"{speed} bit/s is code {code}; 1001 holds {data[1]}, 1002 holds {data[2]}"
    return Observation(places[0] if code and len(places) == 1 else None, told)


def _set_points(name: str, device: RegisterDevice) -> Observation:
    readings = device.read(device.own_map()[name].each)
    values = [one.value for one in readings]
    told = f"{name}: {' '.join(map(str, values))}"
    return Observation(
        -1 if set(values) == {-1} else None,
        told
        if set(values) == {-1}
        else f"{told}: either it was commanded after power-on, or it shows something other than -1. Power-cycle it and repeat this proof before any command",
    )


def _acknowledged(device: RegisterDevice) -> Observation:
    """Which id acknowledges a change of the id. The id of before is given back, and read back there."""
    bus, old = device.bus, device.bus.id
    if not isinstance(bus, SerialBus):
        return Observation(None, "only on a serial line in EB90")
    identify_alone(device)
    new = next((one for one in SPARE_IDS if one != old and not probe(bus, one)), None)
    if new is None:
        return Observation(None, "no spare id from 241 to 253 is free")
    with bus.on_early_end(
        f"the hand may still have id {new}",
        f"find it with `handctl {device.kind} scan`. A power-cycle brings back the saved id",
    ):
        number = _there_and_back(device, bus, new)
    return Observation(
        "new" if number == new else "old", f"id {old} was changed to {new} and back: acknowledged by id {number}"
    )


def _there_and_back(device: RegisterDevice, bus: SerialBus, new: int) -> int:
    """The id that acknowledges the change. Raises what kept it from being confirmed that the old one is back."""
    address, back = device.map["id"].address, bus.at(device_id=new)
    prefixes = [write_ack_prefix(one, address // bus.per, WRITE) for one in (bus.id, new)]
    home = False

    def go_home() -> None:
        nonlocal home
        _back_home(device, bus, back)
        home = True

    try:
        try:
            frame = bus.exchange(write_request(bus.id, address // bus.per, bytes([new]), WRITE), prefixes, reply_size=9)
            step = bus.write_step(address, bytes([new]), f"id = {new}")
            device.journal.ledger.confirm(f"acknowledged by id {frame.id}", step)
        finally:
            put_back(go_home)
    except KeyboardInterrupt as exc:
        if not home:
            raise
        raise Interrupted(f"interrupted. The hand has id {bus.id} again") from exc
    return frame.id


def _back_home(device: RegisterDevice, bus: SerialBus, back: SerialBus) -> None:
    """Give it the id of `bus` again, unless it has that, and read it back. Raises CheckFailed, NoAnswer, ProtocolError.

    It may answer to that all the time: the other id would count after a power-cycle then, and stay with the next save.
    """
    register, old = device.map["id"], bytes([bus.id])
    there = back if probe(bus, back.id) or not probe(bus, bus.id) else bus
    if there is back or bus.read(register.address, 1) != old:
        there.try_write(
            register.address,
            old,
            f"the change back to id {bus.id}",
            "handctl checks for the hand",
            acknowledged_by=(bus.id,),
        )
    if not probe(bus, bus.id):
        raise _not_home(device, f"the hand does not respond to id {bus.id} again")
    if (now := bus.read(register.address, 1)) != old:
        raise _not_home(device, f"the hand responds to id {bus.id}, but register 1000 reads {now[0]}")
    device.journal.ledger.confirm(
        f"responds to id {bus.id} again", there.write_step(register.address, old, f"id = {bus.id}")
    )


def _not_home(device: RegisterDevice, what: str) -> CheckFailed:
    hint = Hint("find it with {}. A power-cycle brings back the saved id", f"{device.kind} scan")
    return CheckFailed(f"{device.bus.link.name}: {what}", hint=hint, code="read-back")


def _write_reply(name: str, device: RegisterDevice) -> Observation:
    """What acknowledges a write on CAN: a setting gets the value that it has, and is read back."""
    from handctl.devices.inspire.can_bus import CanBus

    bus, register = device.bus, device.own_map()[name]
    if not isinstance(bus, CanBus):
        return Observation(None, "only on CAN")
    span = (register.place, register.size)
    data = bus.read(*span, retries=0)
    reply = bus.acknowledgement(span[0], data)
    if bus.read(*span) != data:
        raise CheckFailed(
            f"{bus.where}: {name} is no longer {data.hex(' ').upper()}",
            hint=Hint("check with {}", f"{device.kind} get {name}"),
            code="read-back",
        )
    device.journal.ledger.confirm("read back", bus.write_step(span[0], data, f"{name} as it is"))
    how = {b"": "empty", bytes([len(data)]): "count"}.get(reply)
    return Observation(how, f"{name} was written with the value it has: {reply.hex(' ').upper() or 'no data'}")


def _save_frames(device: RegisterDevice, prompts: Prompts) -> Observation:
    """How a save is answered: at once, about a second later, both, and with which flag and data the result comes."""
    bus = device.bus
    identify_alone(device, refusal=True)
    if not bus.reports:
        return Observation(None, "this connection has no frame that reports the result")
    with bus.on_early_end(
        "the save was sent, but its result is not known", f"check with `handctl {device.kind} get id baud_code`"
    ):
        lost, frame = save_frames(device, prompts)
    if lost is not None and frame is None:
        raise lost
    first = "" if lost is not None else "acknowledged"
    second = "" if frame is None else f"result {frame.data.hex(' ').upper()} with flag {frame.flag:02X}"
    if frame is not None and frame.data != b"\0":
        raise save_failed(bus, frame)
    if frame is not None:
        device.journal.ledger.confirm("its result was 00: saved")
    return Observation(
        ", ".join(filter(None, (first, second))), f"save: {first or 'no acknowledgement'}, {second or 'no result'}"
    )


def _supply(name: str, meter: float | None, device: RegisterDevice) -> Observation:
    """Counts of the supply register to a volt, by a voltmeter."""
    if meter is None:
        return Observation(None, "needs the reading of a voltmeter at the supply: --meter V")
    if name not in device.own_map():
        return Observation(None, f"this device has no {name}")
    (reading,) = device.read(device.own_map()[name].each)
    if reading.error is not None or reading.value is None:
        raise reading.error or Disturbed(f"{name} was not read")
    return Observation(round(reading.value / meter, 2), f"{name} {reading.value} at {meter:g} V")


def _trigger_steps(name: str) -> Callable[[RegisterDevice], list[Step]]:
    return lambda device: [device.trigger_step(name, name)]


def _id_steps(device: RegisterDevice) -> list[Step]:
    bus, address = device.bus, device.map["id"].address
    new = next(one for one in SPARE_IDS if one != bus.id)
    return [
        bus.write_step(address, bytes([new]), f"id = {new}, or the next lower free one"),
        bus.at(device_id=new).write_step(address, bytes([bus.id]), f"id = {bus.id} again"),
    ]


def across(span: Span, source: str) -> Proof:
    """Whether a read over undocumented bytes is answered."""
    return Proof("reads-across-gaps", f"not documented; taken for granted to save reads ({source})", ANSWERED, f"one read of {span[1]} bytes at {span[0]}", partial(_across, span))  # fmt: skip


def in_gap(*spans: Span, source: str) -> Proof:
    """What undocumented bytes read."""
    return Proof("gap-bytes", f"not documented ({source})", "zeros", f"reads at {', '.join(str(span[0]) for span in spans)}, which no manual has", partial(_in_gap, spans))  # fmt: skip


def longest(start: int, source: str, assumed: int = MAX_COUNT) -> Proof:
    """The longest single read."""
    return Proof("longest-read", f"the length byte allows 252; longer than 151 was never seen ({source})", assumed, f"reads of 252 bytes and fewer at {start}: the longest that is answered", partial(_longest, start), limit="least")  # fmt: skip


def reply_time(source: str) -> Proof:
    """How long the device takes for a reply."""
    return Proof("reply-time", f"not documented; 4 ms in the field ({source})", 20, f"{TIMED} reads of two bytes: their time without that of their bits, in ms", _reply_time, limit="most", measured=True)  # fmt: skip


def signed(*names: str, says: str) -> Proof:
    """Whether a current has a sign."""
    return Proof("current-sign", says, "signed", f"{', '.join(names)}: is one below 0?", partial(_sign, names))


def speed_register(assumed: int, source: str) -> Proof:
    """Where the speed code is."""
    return Proof("speed-register", f"1001 and 1002 are both in print ({source})", assumed, "1000 to 1003, where the link is not at 115200 bit/s: which one holds the code of its speed", _speed_register)  # fmt: skip


def set_points(name: str, source: str) -> Proof:
    """What a device shows that nobody has commanded yet."""
    return Proof("set-points-at-power-on", f"not documented; -1 in the field ({source})", -1, f"{name} before the first command", partial(_set_points, name))  # fmt: skip


def write_reply(name: str, source: str) -> Proof:
    """How a write is acknowledged on CAN."""
    return Proof(
        "write-acknowledgement", f"no data in print, the number of bytes in captures ({source})", ("empty", "count"),
        f"on CAN, {name} gets the value that it has: the data of the reply", partial(_write_reply, name), WRITE_BACK,
        question=f"{name} will be written with its present value",
    )  # fmt: skip


ID_ACK = Proof(
    "id-acknowledged-by", "not documented (exo §2.3.1); by the new id on the RH56 (chapter 3, example 1)", "new",
    "give it a free id and the one of before again: who acknowledges the first write", _acknowledged, WRITE_BACK,
    steps=_id_steps, question="The hand gets another id for a moment, and its own again. It stays volatile",
)  # fmt: skip
SAVE_FRAMES = Proof(
    "save-frames", "one acknowledgement in print (exo §2.2.4), two frames on the RH56, and its result flag is printed both ways (dossier 5, E12)",
    ("acknowledged, result 00 with flag 11", "acknowledged, result 00 with flag 12"), "save, then listen for 2.5 s: which frames come", _save_frames, PERMANENT,
    steps=_trigger_steps("save"), question="This saves the present settings to flash. It cannot be put back, and counts against the life of the flash",
)  # fmt: skip


def supply(name: str, source: str) -> Proof:
    """What a count of the supply register is worth."""
    return Proof(
        "supply-scale", f"no unit is documented ({source}); handctl shows the raw number", (), f"{name} against the voltmeter: counts to a volt", partial(_supply, name),
        typed="What does a voltmeter show at the supply of the device, in V?",
    )  # fmt: skip


def calibration_frames(trigger: str, run: Callable[[Any, Prompts], Table], says: str, question: str) -> Proof:
    """Whether the end of a calibration is reported."""

    def ask(device: RegisterDevice, prompts: Prompts) -> Observation:
        (row,) = [row for row in run(device, prompts).rows if row["value"] in ("completed", "not reported")]
        return Observation("reported" if row["value"] == "completed" else "not reported", f"calibration: {row['value']}, data {row['raw'] or 'none'}")  # fmt: skip

    return Proof("calibration-frames", says, "reported", "calibrate, then listen for the frame that reports the end", ask, PERMANENT, steps=_trigger_steps(trigger), question=question)  # fmt: skip
