"""What a hand keeps: clearing errors, saving to flash, factory reset. For the EH55BF1 and the RH56 hands.

Each writes once, then finds out by reading or listening what became of it. Where the manual of the EH55BF1 is silent the
order of the RH56 is followed, and what is unknown on this hardware is said.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from handctl.devices.inspire import eb90, twins
from handctl.devices.inspire.map import OVER_TEMPERATURE, Register
from handctl.devices.inspire.procedures import probe
from handctl.errors import CheckFailed, DeviceRefused, NoAnswer
from handctl.model.guide import Guide
from handctl.model.param import elements_of
from handctl.model.result import Column, Row, Table, hex_bytes

if TYPE_CHECKING:
    from handctl.devices.inspire.base import RegisterDevice

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
    elements = [element for name in names for element in elements_of(hand.map[name])]
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


def save(hand: RegisterDevice, guide: Guide) -> Table:
    """Write the present parameters to flash and wait for the result that comes about a second later (exo §2.3.4, rh56 §2.1).

    Two frames answer: the acknowledgement (01 = accepted) and the result (00 = saved, FF = failed; the sense is
    inverted, RH56 ch. 3 ex. 4). Nothing is sent in between. Raises DeviceRefused for FF or a refused acknowledgement.
    """
    twins.identify(hand)
    with hand.bus.leaving(
        "the save was sent, but its result is not known",
        f"save again, or power-cycle the hand and check with `handctl {hand.kind} get id baud_code`",
    ):
        return _save(hand, guide)


def _save(hand: RegisterDevice, guide: Guide) -> Table:
    bus, register = hand.bus, hand.map["save"]
    place = register.place_of(0)
    results = [eb90.write_ack_prefix(bus.id, place), eb90.read_reply_prefix(bus.id, place, 1)]
    lost = bus.try_write(register.address, register.encode(1), "the save", "handctl only waits for its result")
    if not bus.reports:
        if lost is not None:
            raise lost
        hand.journal.warn(
            "no-result",
            "the save was sent. This connection has no frame that reports the result",
            hint="power-cycle the hand, then read the values to be sure",
        )
        bus.pause(SAVE_RESULT_SECONDS)  # nothing is written meanwhile (rh56 §9)
        return outcome(hand, register, "sent", None)
    guide.progress("saving to flash")
    end = bus.link.deadline(SAVE_RESULT_SECONDS)
    frame = bus.listen(results, end.remaining)
    while frame is not None and frame.flag == eb90.WRITE and frame.data == b"\x01":
        lost = None  # late, or twice
        frame = bus.listen(results, end.remaining)
    guide.done()
    if frame is None:
        bus.out_of_time("the result of the save")
    if frame is None and lost is not None:
        raise lost.retold(
            lost.text,
            hint=f"power-cycle the hand and check with `handctl {hand.kind} get id baud_code`: the result is not known",
        )
    if frame is None:
        hand.journal.warn(
            "no-result",
            f"the hand accepted the save but did not report its result ({hand.save_result})",
            hint="power-cycle the hand, then read the values to be sure",
        )
        return outcome(hand, register, "accepted", None)
    if frame.data != b"\x00":
        raise DeviceRefused(
            f"{bus.where}: the save failed: result {hex_bytes(frame.data)} (00 = saved, FF = failed)",
            hint="check the supply, then save again: the values are still in RAM",
            code="save-failed",
        )
    return outcome(hand, register, "saved", frame.data)


def factory_reset(hand: RegisterDevice) -> Table:
    """Write 1 to the sibling's reset address 1006; this manual names none (exo §2.3.5). Then look who answers."""
    with hand.bus.leaving(
        "the reset was sent, but the hand's present id is unknown",
        f"{power_cycle(hand)} Nothing was saved automatically.",
    ):
        return _factory_reset(hand)


def _factory_reset(hand: RegisterDevice) -> Table:
    bus, old = hand.bus, hand.bus.id
    register = hand.map["factory_reset"]
    lost = bus.try_write(
        register.address, register.encode(1), "the reset", "handctl checks which id answers", acknowledged_by=(1,)
    )
    if lost is not None:
        lost.text = f"the reset was not acknowledged but may have happened: {lost.text}"
    bus.pause(1.0)
    ids = list(dict.fromkeys((1, old)))
    there = [device_id for device_id in ids if probe(bus, device_id)]
    hand.journal.warn(
        "power-cycle",
        f"answering now: id {', '.join(map(str, there))}" if there else "id 1 and the old id do not answer now",
        hint=f"{power_cycle(hand)} Nothing was saved automatically.",
    )
    table = outcome(hand, register, "accepted" if lost is None else "not acknowledged", None)
    table.failure = lost
    if there:
        bus.id = there[0]
    elif lost is None:
        text = f"{bus.link.name}: the reset was acknowledged, but no hand answers to id {' or '.join(map(str, ids))} after it"
        table.failure = NoAnswer(text, hint=power_cycle(hand), code="gone")
    return table


def outcome(hand: RegisterDevice, register: Register, label: str, raw: bytes | None) -> Table:
    row: Row = {
        "name": register.name,
        "finger": None,
        "address": register.place_of(0),
        "value": label,
        "unit": None,
        "raw": hex_bytes(raw) if raw is not None else None,
    }
    return Table(
        rows=[row],
        columns=(Column("name", "Name"), Column("address", "Address", right=True), Column("value", "Result")),
    )
