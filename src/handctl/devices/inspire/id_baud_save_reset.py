"""Probe a hand, change its id and baud rate, save, reset to factory defaults. For the EH55BF1 and the RH56 hands.

Each writes once, then finds out by reading what became of it; none repeats a write. The order of steps and the waits
are those of the manual (cited); where that of the EH55BF1 is silent, those of the RH56. What is unknown on this hardware is said.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from handctl.devices.inspire import eb90
from handctl.devices.inspire.duplicate_id import identify_alone, naming_duplicate_id
from handctl.devices.inspire.register_bus import FLOOD, RegisterBus, Span
from handctl.devices.inspire.register_map import BAUD_RATES, OVER_TEMPERATURE, Register
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.errors import Aftermath, CheckFailed, DeviceRefused, HandctlError, Hint, LinkError, NoAnswer, ProtocolError
from handctl.link import ByteLink
from handctl.model.param import Element, Number, Reading, Step
from handctl.model.prompts import Prompts
from handctl.model.result import Column, Row, Table, hex_bytes
from handctl.model.stop_on_interrupt import on_early_end

if TYPE_CHECKING:
    from handctl.devices.inspire.register_device import RegisterDevice

PROBE_SECONDS = 0.1
PATIENCE_SECONDS = 2.5
"""Longest answer that is waited for where one may only be late."""
LATE_SECONDS = 0.7
"""How long to listen for an answer that came too late before looking at other speeds."""
POWER_CYCLE_SECONDS = 120.0


def probe(bus: RegisterBus, device_id: int, *, seconds: float | None = None) -> bool:
    """Whether a hand answers to `device_id`. Read-only. `seconds` per answer, default the bus timeout.

    The first question is asked twice, then the other one: a firmware may lack a register. A refusal is an answer, and so is one with fewer
    bytes. Only our own bytes coming back is silence: on a line with echo that is how a free id looks. So are the frames of others, which are
    told. Raises ProtocolError when something else comes.
    """
    there = bus.at(device_id=device_id)
    there.timeout = seconds if seconds is not None else bus.timeout
    return any(
        _replies(bus, there, span, retries=int(span == there.presence))
        for span in dict.fromkeys((there.presence, *there.first_questions))
        if span == there.presence or there.quiet(*span)
    )


def _replies(bus: RegisterBus, there: RegisterBus, span: Span, retries: int) -> bool:
    """Whether one question to the id of `there` is answered. Raises as `probe` does."""
    try:
        there.read(*span, retries=retries)
    except NoAnswer:
        return False
    except DeviceRefused:
        return True
    except ProtocolError as exc:
        if exc.code == there.fewer:
            return True
        if exc.code == "stale" and bus.journal.line.others:
            bus.journal.warn(
                "others",
                f"another program or device is using this line, and id {there.id} did not reply",
                hint="stop the other program or master to be sure that the id is free",
            )
        elif exc.code != "echo":
            raise
        return False
    except LinkError as exc:
        if exc.code != "replay-miss" or span == there.presence:
            raise
        return False  # an older recording
    finally:
        bus.round_trip = there.round_trip
    return True


def find_speed(bus: SerialBus) -> int | None:
    """The speed of the three documented ones at which the hand answers, or None. Leaves the port at that speed."""
    link, first = bus.link, bus.link.baud
    for rate in sorted(BAUD_RATES.values(), key=lambda rate: rate != first):
        link.set_baud(rate)
        try:
            if probe(bus, bus.id, seconds=PROBE_SECONDS) and any(bus.pace(LATE_SECONDS) is not None for _ in range(2)):
                return rate  # a younger question is answered: it was no late answer to one at another speed
        except ProtocolError:
            continue  # garbage at a wrong speed is as good as silence here
    if first is not None:
        link.set_baud(first)
    return None


def explain_silence(hand: RegisterDevice, error: HandctlError) -> HandctlError:
    """A better error for a hand that gave no valid answer at all: is it slow, or there at another speed? Read-only.

    Late answers are waited for first: one that arrives after the speed was changed would name a wrong speed.
    """
    bus = hand.bus
    if not isinstance(bus, SerialBus) or bus.link.replayed or len(error.came) > FLOOD:
        return error
    frame = bus.listen([eb90.DEVICE + bytes([bus.id])], max(LATE_SECONDS, bus.timeout))
    if frame is not None:
        return late(bus)
    if not bus.link.can_set_baud:
        return error
    was = bus.link.baud
    try:
        found = find_speed(bus)
    except LinkError:
        return error
    if found is None and bus.pace(PATIENCE_SECONDS) is not None:
        return late(bus)
    if found is None or found == was:
        return error
    return ProtocolError(
        f"id {bus.id} on {bus.link.name} does not reply at {was} bit/s but does at {found} bit/s",
        hint=f"run the command again with --baud {found}",
        code="wrong-speed",
    )


def late(bus: SerialBus) -> NoAnswer:
    """The error of a hand that answers, but too late."""
    longer = f"--timeout {max(1.0, 4 * bus.timeout):g}"
    written = any(message.code == "ack-lost" for message in bus.journal.messages)
    return NoAnswer(
        f"id {bus.id} on {bus.link.name} replies, but takes longer than {bus.timeout:g} s",
        hint=f"read the values with {longer} before you repeat the command: the write may have taken effect"
        if written
        else f"run the command again with {longer}",
        code="late",
    )


# -- id -----------------------------------------------------------------------------------------------------------


def change_id(hand: RegisterDevice, new: int, *, saved_next: bool = False) -> Table:
    """Give the hand another id (exo §2.3.1, rh56 §2.1). Acts at once; kept over power-off only by a later save.

    `saved_next`: the caller sees to that. The new id must be free on the line. Raises CheckFailed when it is not, or when the hand is not found afterwards.
    """
    bus, old = hand.bus, hand.bus.id
    if new == old:
        hand.identify()
        hand.journal.info("already", f"the hand already has id {new}")
        return _id_row(hand, old)
    new_taken = probe(bus, new)
    try:
        with naming_duplicate_id(hand):
            old_there = probe(bus, old)
    except ProtocolError as exc:  # perhaps a late answer of the new id
        if exc.code != "wrong-id" or not _slower(bus):
            raise
        old_there, new_taken = True, probe(bus, new)
    if (not old_there or (bus.round_trip or 0.0) > bus.timeout / 2) and _slower(bus):
        old_there, new_taken = True, probe(bus, new)
    if not old_there and new_taken:
        _identify_at(hand, new)
        hand.journal.info("already", f"no hand responds to id {old}, but one already responds to id {new}")
        if not saved_next:
            _tell_volatile(hand, new, ", unless it has been saved")
        return _id_row(hand)
    if not old_there:
        hand.identify()  # somebody else's answers name him
        bus.read(*bus.presence)  # says what comes instead: silence, or only our own bytes
    if new_taken:
        raise CheckFailed(
            f"{bus.link.name}: id {new} is taken by another device on this line",
            hint=Hint("choose a free id: {} lists those in use. Nothing was written.", f"{hand.kind} scan --all"),
            code="id-taken",
        )
    identify_alone(hand)
    with hand.bus.on_early_end(
        f"the hand may have id {new} already",
        Hint("find it with {}. A power-cycle brings back the saved id", f"{hand.kind} scan"),
    ):
        return _write_id(hand, new, saved_next)


def _identify_at(hand: RegisterDevice, new: int) -> None:
    """Look who responds to id `new`, and go on with that. Raises NotIdentified, and then the id stays as it was."""
    bus, old = hand.bus, hand.bus.id
    bus.id = new
    try:
        hand.identify()
    except BaseException:
        bus.id = old
        raise


def _tell_volatile(hand: RegisterDevice, new: int, unless: str = "") -> None:
    hand.journal.info(
        "volatile",
        f"id {new} lasts only until power-off{unless}",
        hint=Hint(f"keep it with {{}} ({hand.map['save'].source})", f"{hand.kind} save --id {new}"),
    )


def _slower(bus: RegisterBus) -> bool:
    """Whether the hand answers more slowly than the timeout has room for: then this is raised to fit."""
    took = bus.pace(PATIENCE_SECONDS)
    if took is None or 2 * took <= bus.timeout:
        return False
    bus.timeout = 2 * took + 0.1
    bus.journal.info("line", f"Slow line: {1000 * took:.0f} ms. handctl now waits {bus.timeout:.1f} s for each reply")
    return True


def _write_id(hand: RegisterDevice, new: int, saved_next: bool) -> Table:
    bus, old = hand.bus, hand.bus.id
    data, ids = hand.map["id"].encode(new), (new,)
    step = bus.write_step(hand.map["id"].address, data, f"id = {new}")
    # The acknowledgement comes from the new id on the sibling hand; the manual does not say (RH56 ch. 3 ex. 1).
    bus.try_write(hand.map["id"].address, data, "the id change", "handctl checks for the hand", acknowledged_by=ids)
    hand.journal.ledger.doubt(f"not seen to respond to id {new}", step)
    if not probe(bus, new):
        if probe(bus, old):
            raise _still_old(hand, new, step)
        try:
            bus.at(device_id=new).read(*bus.presence)
        except (NoAnswer, ProtocolError) as exc:
            raise exc.reworded(
                f"{bus.link.name}: no hand responds to id {new} or {old} after the id change: {exc.text}",
                hint=Hint("find the hand with {}. A power-cycle brings back the saved id", f"{hand.kind} scan"),
            ) from exc
    bus.id = new
    row = _id_row(hand, old)
    hand.journal.ledger.confirm(f"responds to id {new}", step)
    if not saved_next:
        _tell_volatile(hand, new)
    return row


def _still_old(hand: RegisterDevice, new: int, step: Step) -> CheckFailed:
    """The error of a hand that still replies to its old id. Its register tells whether the new one waits for a power-cycle."""
    bus, register = hand.bus, hand.map["id"]
    text = f"{bus.link.name}: the hand still responds to id {bus.id}, not to {new}"
    try:
        holds = register.decode(bus.read(register.address, register.size))
    except (NoAnswer, ProtocolError, DeviceRefused):
        hand.journal.ledger.doubt(f"still responds to id {bus.id}", step)
        unread = "its register could not be read, so it may have the new id after a power-cycle. Then run {}"
        return CheckFailed(text, hint=Hint(unread, f"{hand.kind} scan"), code="read-back")
    hand.journal.ledger.doubt(f"still responds to id {bus.id}, and register {register.place} reads {holds}", step)
    if holds == bus.id:
        safe = (
            f"register {register.place} reads {holds}: the id was not changed, so it is safe to run the command again"
        )
        return CheckFailed(text, hint=safe, code="read-back")
    waits = f"register {register.place} reads {holds} already, which may count after a power-cycle. Power-cycle the hand, then run {{}}"
    return CheckFailed(f"{text} yet", hint=Hint(waits, f"{hand.kind} scan"), code="id-waits")


def _id_row(hand: RegisterDevice, before: int | None = None) -> Table:
    """The id that the hand has now; `before` as far as it is known."""
    register = hand.map["id"]
    value = hand.bus.read(register.address, register.size)
    if value[0] != hand.bus.id:
        raise CheckFailed(
            f"{hand.bus.where}: register 1000 reads {value[0]}, but the hand responds to id {hand.bus.id}",
            hint=Hint("leave one hand on the line, then run {}", f"{hand.kind} scan"),
            code="read-back",
        )
    row = hand.row(Reading(Element(register, 0), value[0], value))
    if before is None:
        return Table(rows=[row], columns=hand.columns)
    return Table(rows=[{**row, "before": before}], columns=(*hand.columns, Column("before", "Before", right=True)))


# -- baud ---------------------------------------------------------------------------------------------------------


def change_baud(hand: RegisterDevice, rate: int) -> Table:
    """Write the speed of an EH55BF1 that counts after save and power cycle (exo §2.3.2), and read it back.

    The port stays as it is. The RH56 hands have their own way (`hand.baud_and_network`): their code lies elsewhere.
    """
    register, code = hand.map["baud_code"], hand.speed_code(rate)
    element = Element(register, 0)
    identify_alone(hand)
    before = hand.bus.read(register.address, register.size)[0]
    if before == code:
        hand.journal.info("already", f"baud_code is already {code} ({rate} bit/s)")
        readings = [Reading(element, before, bytes([before]))]
    else:
        at_once = Aftermath(
            hint=Hint(f"the hand may use {rate} bit/s already: try {{}}", f"{hand.kind} status --baud {rate}")
        )
        try:
            with on_early_end(at_once, since=hand.journal.counters, by=NoAnswer, interrupt=False):
                readings = hand.write([(element, code)])
        except CheckFailed as exc:
            exc.hint = (
                f"read both places of the speed code with `handctl {hand.kind} read 1001 2`. It lies at 1001 in this manual (exo §2.3), "
                "at 1002 on the RH56 hand: this may be another hand. Only 1001 was written"
            )
            raise
    return hand.table(readings)


def wait_for_speed(hand: RegisterDevice, rate: int, prompts: Prompts, *, seconds: float = POWER_CYCLE_SECONDS) -> bool:
    """Wait until the hand answers at `rate` after a power cycle. A simulator's power is switched here."""
    link = hand.bus.link
    assert isinstance(link, ByteLink)
    if link.power_cycle():
        prompts.say("simulated: the simulator's power was switched off and on")
    else:
        prompts.say(
            f"Switch the hand's power off and on now. handctl waits up to {seconds:.0f} s for it at {rate} bit/s."
        )
    link.set_baud(rate)
    end = link.deadline(seconds)
    while not end.expired:
        prompts.progress(f"waiting for id {hand.bus.id} at {rate} bit/s, {end.remaining:.0f} s left")
        try:
            allowed = max(PROBE_SECONDS, 2 * (hand.bus.round_trip or 0.0))
            if probe(hand.bus, hand.bus.id, seconds=allowed) and hand.bus.pace(allowed) is not None:
                prompts.done()
                return True
        except ProtocolError:
            pass  # bytes of a hand that starts, or still talks at the old speed
        hand.bus.out_of_time("the power-cycle", "the power-cycle")
        hand.bus.pause(0.2)
    prompts.done()
    return False


# -- what is kept -----------------------------------------------------------------------------------------------------

SAVE_RESULT_SECONDS = 2.5
"""The result comes about a second after the acknowledgement (RH56 ch. 3 ex. 4)."""


def power_cycle(hand: RegisterDevice) -> str:
    """What to do after a reset."""
    return f"power-cycle the hand, then run `handctl {hand.kind} scan`: its id may be 1 and its baud rate 115200 bit/s again."


def clear_errors(hand: RegisterDevice) -> Table:
    """Clear the clearable actuator errors and look what is left (exo §2.3.3, rh56 §6).

    A remaining over_temperature is not a failure: it clears by cooling. Anything else that remains is.
    """
    hand.identify()  # before anything is read: a stranger is named, not called silent
    names = ("error", "temperature")
    elements = [element for name in names for element in hand.map[name].each]
    before = {reading.element.full_name: reading.value for reading in hand.read(elements)}
    hand.bus.try_write(
        hand.map["clear_errors"].address,
        hand.map["clear_errors"].encode(1),
        "the clearing",
        "handctl checks which errors remain",
    )
    after = hand.read(elements)
    warm = {reading.element.part: reading.value for reading in after if reading.element.param.name == "temperature"}
    rows: list[Row] = []
    left = []
    for reading in after:
        if reading.element.param.name != "error":
            continue
        rows.append({**hand.row(reading), "before": before.get(reading.element.full_name)})
        if reading.error is not None or reading.value is None:
            left.append(f"{reading.element.part}: not readable")
            continue
        bits = int(reading.value)
        if bits & OVER_TEMPERATURE:
            hand.journal.warn(
                "over-temperature",
                f"{reading.element.part}: over_temperature cannot be cleared. It goes away as the actuator cools, "
                f"now {warm.get(reading.element.part)} °C ({hand.map['clear_errors'].source})",
            )
        if bits & ~OVER_TEMPERATURE:
            left.append(f"{reading.element.part}: {hand.map['error'].label(bits & ~OVER_TEMPERATURE)}")
    table = Table(rows=rows, columns=(*hand.columns, Column("before", "Before", right=True)))
    if left:
        table.failure = CheckFailed(
            f"{hand.bus.where}: errors remain after clearing: {'; '.join(left)}",
            hint=f"free the finger, check the supply ({hand.supply}), then clear the errors again: the cause is still there",
            code="errors-remain",
        )
    return table


def save(hand: RegisterDevice, prompts: Prompts, written: Sequence[tuple[Element, Number]] = ()) -> Table:
    """Write the present parameters to flash and wait for the result that comes about a second later (exo §2.3.4, rh56 §2.1).

    Two frames answer: the acknowledgement (01 = accepted) and the result (00 = saved, FF = failed; the sense is
    inverted, RH56 ch. 3 ex. 4). Nothing is sent for 2.5 s, and a result that contradicts the first one counts. What was `written`
    is read back then. Raises DeviceRefused for FF or a refused acknowledgement, CheckFailed for what is not as it was written.
    """
    identify_alone(hand, refusal=True)
    with hand.bus.on_early_end(
        "the save was sent, but its result is not known",
        f"save again, or power-cycle the hand and check with `handctl {hand.kind} get id baud_code`",
    ):
        table = _save(hand, prompts)
    if written:
        hand.verify(written)
    return table


def save_frames(hand: RegisterDevice, prompts: Prompts) -> tuple[HandctlError | None, eb90.Frame | None]:
    """Send the save and wait for its result: why it was not acknowledged, None = it was, and the frame of its result, if one came."""
    bus, register = hand.bus, hand.map["save"]
    place = register.place
    results = [eb90.write_ack_prefix(bus.id, place), eb90.read_reply_prefix(bus.id, place, 1)]
    lost = bus.try_write(register.address, register.encode(1), "the save", "handctl only waits for its result")
    if not bus.reports:
        return lost, None
    prompts.progress("saving to flash")
    end, frame = bus.link.deadline(SAVE_RESULT_SECONDS), None
    while (came := bus.listen(results, end.remaining)) is not None:
        if came.flag == eb90.WRITE and came.data == b"\x01":
            lost = None  # late, or twice
        elif frame is None or came.data != b"\0":
            frame = came  # of two results the one that says something else than saved
    prompts.done()
    return lost, frame


def save_failed(bus: RegisterBus, frame: eb90.Frame) -> HandctlError:
    """The error of a result that is not 00: a refusal where it is FF; nothing explains another one."""
    result = f"result {hex_bytes(frame.data)} (00 = saved, FF = failed)"
    if frame.data == b"\xff":
        hint = "check the supply, then save again: the values are still in RAM"
        return DeviceRefused(f"{bus.where}: the save failed: {result}", hint=hint, code="save-failed")
    return CheckFailed(
        f"{bus.where}: nothing shows that the save succeeded: {result}",
        hint="save again, or power-cycle the hand and read the values to be sure: the manual does not explain this result",
        code="save-unknown",
    )


def _save(hand: RegisterDevice, prompts: Prompts) -> Table:
    bus, register = hand.bus, hand.map["save"]
    lost, frame = save_frames(hand, prompts)
    to_be_sure = "power-cycle the hand, then read the values to be sure"
    if not bus.reports:
        if lost is not None:
            raise lost
        said = "the save was sent. This connection has no frame that reports the result"
        hand.journal.warn("no-result", said, to_be_sure)
        bus.pause(SAVE_RESULT_SECONDS)  # nothing is written meanwhile (rh56 §9)
        return outcome(hand, register, "sent", None)
    if frame is None:
        bus.out_of_time("the result of the save arrived", "the result")
        if lost is not None:
            raise lost.reworded(
                lost.text,
                hint=Hint(
                    "power-cycle the hand and check with {}: the result is not known", f"{hand.kind} get id baud_code"
                ),
            )
        said = f"the hand accepted the save but did not report its result ({hand.save_result})"
        hand.journal.warn("no-result", said, to_be_sure)
        return outcome(hand, register, "accepted", None)
    if frame.data != b"\x00":
        hand.journal.ledger.doubt(f"result {hex_bytes(frame.data)}", hand.trigger_step("save", ""))
        raise save_failed(bus, frame)
    # Behind a lost acknowledgement a result with flag 12 looks like one that refuses.
    hand.journal.ledger.confirm("result 00", hand.trigger_step("save", ""))
    return outcome(hand, register, "saved", frame.data)


def factory_reset(hand: RegisterDevice) -> Table:
    """Write 1 to the sibling's reset address 1006; this manual names none (exo §2.3.5). Then look who answers."""
    with hand.bus.on_early_end(
        "the reset was sent, but the hand's present id is unknown",
        f"{power_cycle(hand)} Nothing was saved automatically.",
    ):
        return _factory_reset(hand)


def _factory_reset(hand: RegisterDevice) -> Table:
    bus, old = hand.bus, hand.bus.id
    register = hand.map["factory_reset"]
    lost = bus.try_write(
        register.address, register.encode(1), "the reset", "handctl checks which id replies", acknowledged_by=(1,)
    )
    if lost is not None:
        lost.text = f"the reset was not acknowledged but may have happened: {lost.text}"
    bus.pause(1.0)
    ids = list(dict.fromkeys((1, old)))
    there = [device_id for device_id in ids if probe(bus, device_id)]
    hand.journal.warn(
        "power-cycle",
        f"replying now: id {', '.join(map(str, there))}" if there else "id 1 and the old id do not reply now",
        hint=f"{power_cycle(hand)} Nothing was saved automatically.",
    )
    table = outcome(hand, register, "accepted" if lost is None else "not acknowledged", None)
    table.failure = lost
    if there:
        bus.id = there[0]
    elif lost is None:
        hand.journal.ledger.doubt("no hand responds after it", hand.trigger_step("factory_reset", ""))
        text = f"{bus.link.name}: the reset was acknowledged, but no hand responds to id {' or '.join(map(str, ids))} after it"
        table.failure = NoAnswer(text, hint=power_cycle(hand), code="gone")
    return table


def outcome(hand: RegisterDevice, register: Register, label: str, raw: bytes | None) -> Table:
    told = hex_bytes(raw) if raw is not None else None
    return Table(
        rows=[{**hand.element_keys(Element(register, 0)), "value": label, "unit": None, "raw": told}],
        columns=(Column("name", "Name"), Column("address", "Address", right=True), Column("value", "Result")),
    )
