"""The EH55BF1's procedures: id, baud, clear errors, save, factory reset, calibration, motion until arrival.

Each writes once, then finds out by reading what became of it; none repeats a write. The order of steps and the waits
are those of the manual (cited) and, where it is silent, of the sibling hand; what is unknown on this hardware is said.
"""

from __future__ import annotations

from handctl.devices.inspire import eb90
from handctl.devices.inspire.bus import Bus
from handctl.devices.inspire.exo import ExoHand
from handctl.devices.inspire.registers import BAUD_RATES, EXO, OVER_TEMPERATURE, Register
from handctl.errors import CheckFailed, DeviceRefused, HandctlError, Interrupted, LinkError, NoAnswer, ProtocolError
from handctl.guide import Guide
from handctl.param import Element, Reading, Step, elements_of
from handctl.result import Column, Row, Table, hex_bytes

PROBE_SECONDS = 0.1
LATE_SECONDS = 0.7
"""How long to listen for an answer that came too late before looking at other speeds."""
SAVE_RESULT_SECONDS = 2.5
CALIBRATION_SECONDS = 30.0
POWER_CYCLE_SECONDS = 120.0
PROBE_ADDRESS, PROBE_COUNT = 1472, 2
"""Two bytes of system_voltage: its reply is longer than the request, so an echo can never pass for it."""

STILL_SECONDS, STILL_SAMPLES = 0.5, 3
"""Fingers stand still when so many readings in a row, over so long a time, are equal."""

CALIBRATION_STEPS = (
    (1, "relax all fingers: no force on the hand"),
    (2, "the hand opens yours: adjust until all five fingers are naturally straight"),
    (2, "the hand closes four fingers: adjust until they are fully clenched"),
    (2, "four fingers straighten, the thumb bends: adjust until it lies inside the palm, fully bent"),
    (2, "thumb and index finger touch, the others bend alike"),
)
"""Seconds of the documented wait and what the wearer does (exo §2.3.6)."""


def trigger_step(hand: ExoHand, name: str, meaning: str) -> Step:
    """The frame that writes 1 to a trigger register."""
    register = EXO[name]
    request = eb90.write_request(hand.bus.id, register.address, b"\x01")
    return Step(f"{meaning} (write 1 to address {register.address})", request, register.moves, register.strands)


def command_step(hand: ExoHand, which: str, values: list[int]) -> Step:
    """The frame of a force or position command."""
    from handctl.devices.inspire.exo import COMMAND_FLAGS

    return Step(
        f"{which} command, little to thumb: {' '.join(map(str, values))}",
        eb90.command_request(hand.bus.id, COMMAND_FLAGS[which], values),
        moves=True,
    )


def probe(bus: Bus, device_id: int, *, seconds: float | None = None) -> bool:
    """Whether a hand answers to `device_id` (read-only, asked twice). `seconds` per answer, default the bus timeout.

    Only our own bytes coming back is silence too: on a line with echo that is how a free id looks. Raises
    ProtocolError when something else comes.
    """
    wanted, bus.timeout = bus.timeout, seconds if seconds is not None else bus.timeout
    try:
        bus.read(PROBE_ADDRESS, PROBE_COUNT, device_id=device_id, retries=1)
    except NoAnswer:
        return False
    except ProtocolError as exc:
        if exc.code != "echo":
            raise
        return False
    finally:
        bus.timeout = wanted
    return True


def find_speed(bus: Bus) -> int | None:
    """The speed of the three documented ones at which the hand answers, or None. Leaves the port at that speed."""
    link, first = bus.link, bus.link.baud
    for rate in sorted(BAUD_RATES.values(), key=lambda rate: rate != first):
        link.set_baud(rate)
        try:
            if probe(bus, bus.id, seconds=PROBE_SECONDS):
                return rate
        except ProtocolError:
            continue  # garbage at a wrong speed is as good as silence here
    if first is not None:
        link.set_baud(first)
    return None


def explain_silence(hand: ExoHand, error: HandctlError) -> HandctlError:
    """A better error for a hand that gave no valid answer at all: is it slow, or there at another speed? Read-only.

    Late answers are waited for first: one that arrives after the speed was changed would name a wrong speed.
    """
    bus = hand.bus
    if bus.link.replayed:
        return error
    frame = bus.listen([eb90.DEVICE + bytes([bus.id])], max(LATE_SECONDS, bus.timeout))
    if frame is not None:
        return NoAnswer(
            f"id {bus.id} on {bus.link.name} answers, but later than {bus.timeout:g} s",
            hint=f"run the command again with --timeout {max(1.0, 4 * bus.timeout):g}",
            code="late",
        )
    if not bus.link.can_set_baud:
        return error
    was = bus.link.baud
    try:
        found = find_speed(bus)
    except LinkError:
        return error
    if found is None or found == was:
        return error
    return ProtocolError(
        f"id {bus.id} on {bus.link.name} does not answer at {was} baud but does at {found}",
        hint=f"run the command again with --baud {found}",
        code="wrong-speed",
    )


# -- id -----------------------------------------------------------------------------------------------------------


def change_id(hand: ExoHand, new: int) -> Table:
    """Give the hand another id (exo §2.3.1). Acts at once; kept over power-off only by a later save.

    The new id must be free on the line. Raises CheckFailed when it is not, or when the hand is not found afterwards.
    """
    bus, old = hand.bus, hand.bus.id
    if new == old:
        hand.journal.info("already", f"the hand already has id {new}")
        return _id_row(hand, old)
    new_taken = probe(bus, new)
    old_there = probe(bus, old)
    if not old_there and new_taken:
        bus.id = new
        hand.journal.info("already", f"nobody answers to id {old}; a hand already answers to id {new}")
        return _id_row(hand, old)
    if not old_there:
        bus.read(PROBE_ADDRESS, PROBE_COUNT)  # says what comes instead: silence, or only our own bytes
    if new_taken:
        raise CheckFailed(
            f"{bus.link.name}: id {new} is taken by another hand on this line",
            hint="choose a free id: `handctl exo scan --all` lists those in use. Nothing was written.",
            code="id-taken",
        )
    try:
        # The acknowledgement comes from the new id on the sibling hand; the manual does not say (RH56 ch. 3 ex. 1).
        bus.write(EXO["id"].address, bytes([new]), acknowledged_by=(new,))
    except (NoAnswer, ProtocolError) as exc:
        hand.journal.warn("ack-lost", f"the id change was not acknowledged ({exc.text}); looking for the hand")
    if probe(bus, new):
        bus.id = new
        row = _id_row(hand, old)
        hand.journal.info(
            "volatile",
            f"id {new} lasts until power-off",
            hint=f"keep it with `handctl exo save --id {new}` (exo §2.3.4)",
        )
        return row
    if probe(bus, old):
        raise CheckFailed(
            f"{bus.link.name}: the hand still answers to id {old}, not to {new}",
            hint="the id was not changed; it is safe to run the command again",
            code="read-back",
        )
    try:
        bus.read(PROBE_ADDRESS, PROBE_COUNT, device_id=new)
    except (NoAnswer, ProtocolError) as exc:
        raise type(exc)(
            f"{bus.link.name}: after the id change nobody answers to {new} or {old}; {exc.text}",
            hint="`handctl exo scan` looks through all ids; a power cycle brings back the saved id",
            code=exc.code,
        ) from exc
    bus.id = new
    return _id_row(hand, old)


def _id_row(hand: ExoHand, before: int) -> Table:
    register = EXO["id"]
    value = hand.bus.read(register.address, 1)
    if value[0] != hand.bus.id:
        raise CheckFailed(
            f"{hand.bus.where}: register 1000 reads {value[0]}, but the hand answers to id {hand.bus.id}",
            code="read-back",
        )
    row = hand.row(Reading(Element(register, 0), value[0], value))
    return Table(rows=[{**row, "before": before}], columns=(*hand.columns, Column("before", "Before", right=True)))


# -- baud ---------------------------------------------------------------------------------------------------------


def code_of(rate: int) -> int | None:
    """The register code of a speed in bit/s (exo §2.3.2), None if the manual has none."""
    return next((code for code, value in BAUD_RATES.items() if value == rate), None)


def change_baud(hand: ExoHand, rate: int) -> Table:
    """Write the speed that counts after save and power cycle (exo §2.3.2), and read it back. The port stays as it is."""
    register, code = EXO["baud_code"], code_of(rate)
    assert code is not None
    element = Element(register, 0)
    before = hand.bus.read(register.address, 1)[0]
    if before == code:
        hand.journal.info("already", f"baud_code is already {code} ({rate} baud)")
        readings = [Reading(element, before, bytes([before]))]
    else:
        try:
            readings = hand.write([(element, code)])
        except CheckFailed as exc:
            exc.hint = (
                "the speed code lies at 1001 in this manual (exo §2.3), at 1002 on the RH56 hand: this may be another "
                "hand. Only 1001 was written; `handctl exo read 1001 2` shows both"
            )
            raise
    return hand.table(readings)


def wait_for_speed(hand: ExoHand, rate: int, guide: Guide, *, seconds: float = POWER_CYCLE_SECONDS) -> bool:
    """Wait until the hand answers at `rate` after a power cycle. A simulator's power is switched here."""
    link = hand.bus.link
    if link.power_cycle():
        guide.say("simulated: the simulator's power was switched off and on")
    else:
        guide.say(f"Switch the hand's power off and on now; waiting up to {seconds:.0f} s for it at {rate} baud.")
    link.set_baud(rate)
    end = link.deadline(seconds)
    while not end.expired:
        guide.progress(f"waiting for id {hand.bus.id} at {rate} baud, {end.remaining:.0f} s left")
        try:
            if probe(hand.bus, hand.bus.id, seconds=PROBE_SECONDS):
                guide.done()
                return True
        except ProtocolError:
            pass  # bytes of a hand that starts, or still talks at the old speed
        hand.bus.out_of_time("the power cycle")
        hand.bus.pause(0.2)
    guide.done()
    return False


# -- errors, flash ------------------------------------------------------------------------------------------------


def clear_errors(hand: ExoHand) -> Table:
    """Clear the clearable actuator errors and look what is left (exo §2.3.3).

    A remaining over_temperature is not a failure: it clears by cooling. Anything else that remains is.
    """
    names = ("error", "temperature")
    elements = [element for name in names for element in elements_of(EXO[name])]
    before = {reading.element.full_name: reading.value for reading in hand.read(elements)}
    try:
        hand.bus.write(EXO["clear_errors"].address, b"\x01")
    except (NoAnswer, ProtocolError) as exc:
        hand.journal.warn("ack-lost", f"the clearing was not acknowledged ({exc.text}); reading what is left")
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
                f"{reading.element.part}: over_temperature cannot be cleared, it goes away by cooling; "
                f"now {warm.get(reading.element.part)} °C (exo §2.3.3)",
            )
        if bits & ~OVER_TEMPERATURE:
            left.append(f"{reading.element.part}: {EXO['error'].label(bits & ~OVER_TEMPERATURE)}")
    table = Table(rows=rows, columns=(*hand.columns, Column("before", "Before", right=True)))
    if left:
        table.failure = CheckFailed(
            f"{hand.bus.where}: errors remain after clearing: {'; '.join(left)}",
            hint="the cause is still present: free the finger, check the supply (7..9 V, 5 A peak), then clear again",
            code="errors-remain",
        )
    return table


def save(hand: ExoHand, guide: Guide) -> Table:
    """Write the present parameters to flash and wait for the result that comes about a second later (exo §2.3.4).

    Two frames answer: the acknowledgement (01 = accepted) and the result (00 = saved, FF = failed; the sense is
    inverted, RH56 ch. 3 ex. 4). Nothing is sent in between. Raises DeviceRefused for FF or a refused acknowledgement.
    """
    bus, register = hand.bus, EXO["save"]
    results = [eb90.write_ack_prefix(bus.id, register.address), eb90.read_reply_prefix(bus.id, register.address, 1)]
    acknowledged = True
    try:
        bus.write(register.address, b"\x01")
    except (NoAnswer, ProtocolError) as exc:
        acknowledged = False
        lost = exc
        hand.journal.warn("ack-lost", f"the save was not acknowledged ({exc.text}); waiting for its result only")
    guide.progress("saving to flash")
    end = bus.link.deadline(SAVE_RESULT_SECONDS)
    frame = bus.listen(results, end.remaining)
    while frame is not None and frame.flag == eb90.WRITE and frame.data == b"\x01":
        acknowledged = True  # late, or twice
        frame = bus.listen(results, end.remaining)
    guide.done()
    if frame is None:
        bus.out_of_time("the result of the save")
    if frame is None and not acknowledged:
        raise type(lost)(
            lost.text,
            hint="whether it saved is unknown: power-cycle and look with `handctl exo get id baud_code`",
            code=lost.code,
        )
    if frame is None:
        hand.journal.warn(
            "no-result",
            "the save was accepted, its result was not reported (the result frame is undocumented on this device)",
            hint="power-cycle and read the values to be sure",
        )
        return _outcome(hand, register, "accepted", None)
    if frame.data != b"\x00":
        raise DeviceRefused(
            f"{bus.where}: the save failed: result {hex_bytes(frame.data)} (00 = saved, FF = failed)",
            hint="the values are still in RAM: check the supply, then save again",
            code="save-failed",
        )
    return _outcome(hand, register, "saved", frame.data)


def factory_reset(hand: ExoHand) -> Table:
    """Write 1 to the sibling's reset address 1006; this manual names none (exo §2.3.5). Then look who answers."""
    bus, old = hand.bus, hand.bus.id
    register = EXO["factory_reset"]
    lost: HandctlError | None = None
    try:
        bus.write(register.address, b"\x01", acknowledged_by=(1,))
    except (NoAnswer, ProtocolError) as exc:
        hand.journal.warn("ack-lost", f"the reset was not acknowledged ({exc.text}); looking who answers")
        lost = type(exc)(
            f"the reset was not acknowledged, it may have happened: {exc.text}", hint=exc.hint, code=exc.code
        )
    bus.pause(1.0)
    there = [device_id for device_id in dict.fromkeys((1, old)) if probe(bus, device_id)]
    hand.journal.warn(
        "power-cycle",
        f"answering now: id {', '.join(map(str, there))}" if there else "nobody answers to id 1 or the old id now",
        hint="switch the power off and on, then `handctl exo scan`: id and speed may be back to 1 and 115200. "
        "Nothing was saved automatically.",
    )
    if there:
        bus.id = there[0]
    table = _outcome(hand, register, "accepted" if lost is None else "not acknowledged", None)
    table.failure = lost
    return table


def _outcome(hand: ExoHand, register: Register, label: str, raw: bytes | None) -> Table:
    row: Row = {
        "name": register.name,
        "finger": None,
        "address": register.address,
        "value": label,
        "unit": None,
        "raw": hex_bytes(raw) if raw is not None else None,
    }
    return Table(
        rows=[row],
        columns=(Column("name", "Name"), Column("address", "Address", right=True), Column("value", "Result")),
    )


# -- motion -------------------------------------------------------------------------------------------------------


def calibrate(hand: ExoHand, guide: Guide) -> Table:
    """Start the calibration of the worn hand and stay silent until it reports, at most 30 s (exo §2.3.6).

    Nothing is sent meanwhile. The end frame (address field 0002) is known from the sibling only; without it the
    result says so. Raises Interrupted on Ctrl-C: no command stops a calibration.
    """
    bus = hand.bus
    done = [eb90.read_reply_prefix(bus.id, 2, 1)]
    lost: HandctlError | None = None
    try:
        try:
            bus.write(EXO["calibrate"].address, b"\x01")
        except (NoAnswer, ProtocolError) as exc:
            lost = exc
            hand.journal.warn(
                "ack-lost", f"the start was not acknowledged ({exc.text}); waiting for the end all the same"
            )
        started = bus.link.now()
        guide.say("Calibration runs. The hand leads through the steps above in this order; nothing is sent meanwhile.")
        frame = _wait_with_clock(bus, done, guide, started)
    except KeyboardInterrupt as exc:
        guide.done()
        raise Interrupted(
            "interrupted: the hand goes on calibrating",
            hint="no documented command stops a calibration: let it finish, or switch the power off",
        ) from exc
    seconds = bus.link.now() - started
    if frame is None:
        bus.out_of_time("the end of the calibration, which goes on")
    if frame is None and lost is not None:
        raise type(lost)(
            f"the calibration may have started: its start was not acknowledged and no end was reported; {lost.text}",
            hint="keep the hand worn until it stands still, then check with `handctl exo status`",
            code=lost.code,
        )
    if frame is None:
        hand.journal.warn(
            "no-completion",
            f"no completion report within {CALIBRATION_SECONDS:.0f} s (undocumented on this device)",
            hint="check the positions with `handctl exo status`",
        )
    else:
        guide.say(f"The hand reported the end after {seconds:.1f} s.")
    hand.journal.info("volatile", "whether a calibration survives power-off without save is not documented")
    table = hand.read([e for name in ("position_actual", "force_actual") for e in elements_of(EXO[name])])
    outcome = _outcome(
        hand, EXO["calibrate"], "completed" if frame is not None else "not reported", frame.data if frame else None
    )
    outcome.rows[0]["seconds"] = round(seconds, 1)
    return Table(rows=[*outcome.rows, *(hand.row(reading) for reading in table)], columns=hand.columns)


def _wait_with_clock(bus: Bus, prefixes: list[bytes], guide: Guide, started: float) -> eb90.Frame | None:
    least = sum(seconds for seconds, _ in CALIBRATION_STEPS)
    end = started + CALIBRATION_SECONDS
    while bus.link.now() < end and not (bus.bound is not None and bus.bound.expired):
        elapsed = bus.link.now() - started
        guide.progress(
            f"calibrating {elapsed:4.1f} s (documented waits {least} s, movements come on top; at most {end - started:.0f} s)"
        )
        frame = bus.listen(prefixes, min(0.25, end - bus.link.now()))
        if frame is not None:
            guide.done()
            return frame
    guide.done()
    return None


def move(hand: ExoHand, values: list[int], guide: Guide, *, wait: float) -> Table:
    """Send a position command, then watch until the fingers stand still or `wait` seconds have passed.

    Ctrl-C commands the fingers to the positions they have just then, where these are legal (the manual has no stop
    command). Returns targets against reached positions; no verdict, since a worn finger may be held back.
    """
    try:
        hand.command("position", values)
        reached = _settle(hand, values, guide, wait)
    except KeyboardInterrupt as exc:
        guide.done()
        raise Interrupted(f"interrupted: {_hold(hand)}") from exc
    rows = []
    for reading in reached:
        target = values[reading.element.index] if reading.element.index < len(values) else None
        rows.append({**hand.row(reading), "target": target})
    return Table(rows=rows, columns=(*hand.columns[:4], Column("target", "Target", right=True), *hand.columns[4:]))


def _settle(hand: ExoHand, values: list[int], guide: Guide, wait: float) -> list[Reading]:
    """Read positions until they are the targets, or are equal over STILL_SECONDS, or `wait` is over."""
    elements = elements_of(EXO["position_actual"])
    bus = hand.bus
    end = bus.link.deadline(wait)
    last = hand.read(elements)
    still_since, equal = bus.link.now(), 1
    while True:
        here = [reading.value for reading in last]
        guide.progress(f"positions {' '.join(str(value) for value in here)}, targets {' '.join(map(str, values))}")
        still = bus.link.now() - still_since
        if here[: len(values)] == values:
            break
        if still >= STILL_SECONDS and equal >= STILL_SAMPLES:
            hand.journal.warn(
                "short",
                "the fingers stand still short of the target",
                hint="something holds them: see error and current",
            )
            break
        if end.expired:
            hand.journal.warn("moving", f"not there after {wait:g} s")
            break
        bus.out_of_time("the arrival; the fingers may still move")
        bus.pause(0.05)
        last = hand.read(elements)
        if [reading.value for reading in last] != here:
            still_since, equal = bus.link.now(), 0
        equal += 1
    guide.done()
    return last


def _hold(hand: ExoHand) -> str:
    try:
        readings = hand.read(elements_of(EXO["position_actual"]))[:5]
        values = [int(reading.value) for reading in readings if reading.value is not None]
        if len(values) == 5 and all(0 <= value <= 1000 for value in values):
            hand.bus.command(eb90.POSITION_COMMAND, values)
            return f"the fingers were commanded to hold at {' '.join(map(str, values))}"
    except HandctlError as exc:
        return f"the fingers could NOT be stopped ({exc.text}): switch the power off if they still move"
    return "the positions are outside 0..1000, nothing was commanded: switch the power off if the fingers still move"
