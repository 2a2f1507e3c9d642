"""What an EH55BF1 keeps: clearing errors, saving to flash, factory reset.

Each writes once, then finds out by reading or listening what became of it. Where the manual is silent the sibling
hand's order is followed, and what is unknown on this hardware is said.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from handctl.devices.inspire import eb90
from handctl.devices.inspire.exo.procedures import probe
from handctl.devices.inspire.map import EXO, OVER_TEMPERATURE, Register
from handctl.errors import CheckFailed, DeviceRefused, NoAnswer
from handctl.model.guide import Guide
from handctl.model.param import elements_of
from handctl.model.result import Column, Row, Table, hex_bytes

if TYPE_CHECKING:
    from handctl.devices.inspire.exo.device import ExoHand

POWER_CYCLE = "power-cycle the hand, then run `handctl exo scan`: id and speed may be 1 and 115200 bit/s again."
SAVE_RESULT_SECONDS = 2.5
"""The result comes about a second after the acknowledgement (RH56 ch. 3 ex. 4)."""


def clear_errors(hand: ExoHand) -> Table:
    """Clear the clearable actuator errors and look what is left (exo §2.3.3).

    A remaining over_temperature is not a failure: it clears by cooling. Anything else that remains is.
    """
    hand.bus.identify()  # before anything is read: a stranger is named, not called silent
    names = ("error", "temperature")
    elements = [element for name in names for element in elements_of(EXO[name])]
    before = {reading.element.full_name: reading.value for reading in hand.read(elements)}
    hand.bus.try_write(EXO["clear_errors"].address, b"\x01", "the clearing", "handctl reads which errors remain")
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
                f"{reading.element.part}: over_temperature cannot be cleared. It ends by cooling, "
                f"now {warm.get(reading.element.part)} °C (exo §2.3.3)",
            )
        if bits & ~OVER_TEMPERATURE:
            left.append(f"{reading.element.part}: {EXO['error'].label(bits & ~OVER_TEMPERATURE)}")
    table = Table(rows=rows, columns=(*hand.columns, Column("before", "Before", right=True)))
    if left:
        table.failure = CheckFailed(
            f"{hand.bus.where}: errors remain after clearing: {'; '.join(left)}",
            hint="free the finger, check the supply (7 to 9 V, 5 A peak), then clear again: the cause is still present",
            code="errors-remain",
        )
    return table


def save(hand: ExoHand, guide: Guide) -> Table:
    """Write the present parameters to flash and wait for the result that comes about a second later (exo §2.3.4).

    Two frames answer: the acknowledgement (01 = accepted) and the result (00 = saved, FF = failed; the sense is
    inverted, RH56 ch. 3 ex. 4). Nothing is sent in between. Raises DeviceRefused for FF or a refused acknowledgement.
    """
    with hand.bus.leaving(
        "the save was sent, but its result is not known",
        "save again, or power-cycle the hand and check with `handctl exo get id baud_code`",
    ):
        return _save(hand, guide)


def _save(hand: ExoHand, guide: Guide) -> Table:
    bus, register = hand.bus, EXO["save"]
    results = [eb90.write_ack_prefix(bus.id, register.address), eb90.read_reply_prefix(bus.id, register.address, 1)]
    lost = bus.try_write(register.address, b"\x01", "the save", "handctl waits for its result only")
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
            hint="power-cycle the hand and check with `handctl exo get id baud_code`: the result is not known",
        )
    if frame is None:
        hand.journal.warn(
            "no-result",
            "the hand accepted the save but did not report its result (the result is not documented for this hand)",
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


def factory_reset(hand: ExoHand) -> Table:
    """Write 1 to the sibling's reset address 1006; this manual names none (exo §2.3.5). Then look who answers."""
    with hand.bus.leaving(
        "the reset was sent, but it is not known which id answers now",
        f"{POWER_CYCLE} Nothing was saved automatically.",
    ):
        return _factory_reset(hand)


def _factory_reset(hand: ExoHand) -> Table:
    bus, old = hand.bus, hand.bus.id
    register = EXO["factory_reset"]
    lost = bus.try_write(register.address, b"\x01", "the reset", "handctl looks which id answers", acknowledged_by=(1,))
    if lost is not None:
        lost.text = f"the reset was not acknowledged but may have happened: {lost.text}"
    bus.pause(1.0)
    ids = list(dict.fromkeys((1, old)))
    there = [device_id for device_id in ids if probe(bus, device_id)]
    hand.journal.warn(
        "power-cycle",
        f"answering now: id {', '.join(map(str, there))}" if there else "id 1 and the old id do not answer now",
        hint=f"{POWER_CYCLE} Nothing was saved automatically.",
    )
    table = outcome(hand, register, "accepted" if lost is None else "not acknowledged", None)
    table.failure = lost
    if there:
        bus.id = there[0]
    elif lost is None:
        text = f"{bus.link.name}: the reset was acknowledged, but no hand answers to id {' or '.join(map(str, ids))} after it"
        table.failure = NoAnswer(text, hint=POWER_CYCLE, code="gone")
    return table


def outcome(hand: ExoHand, register: Register, label: str, raw: bytes | None) -> Table:
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
