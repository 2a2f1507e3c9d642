"""The calibration of the force sensors: the whole hand moves for about six seconds (rh56 §6 Q8, Q9).

Over EB90 a frame tells the end. On the other wires the forces are compared after the time that it takes. Nothing is sent
meanwhile, and nothing stops it but the power.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from handctl.devices.inspire import eb90
from handctl.devices.inspire.flash import outcome
from handctl.model.guide import Guide
from handctl.model.param import elements_of
from handctl.model.result import Table

if TYPE_CHECKING:
    from handctl.devices.inspire.hand.device import Hand

POWER_OFF = "Ctrl-C does not stop the hand. To stop it, switch its power off."
COUNTDOWN = 10
"""Seconds to take the hands away (rh56 §9)."""
LISTEN, WAIT = 20.0, 8.0
"""Seconds for the frame that tells the end, and for a calibration whose end nobody tells (rh56 §6 Q9)."""
END_ADDRESS = 2
NEAR = 50
"""Grams within which an unloaded hand rests (rh56 §6 Q5)."""


def calibrate(hand: Hand, guide: Guide) -> Table:
    """Start it after a countdown, wait for its end, show the forces then. Raises Interrupted on Ctrl-C."""
    hand.identify()
    bus, register = hand.bus, hand.map["calibrate_force"]
    before = hand.read(elements_of(hand.map["force_actual"]))
    for left in range(COUNTDOWN, 0, -1):
        guide.progress(f"the hand moves in {left} s: keep it open and empty, and do not touch it", "Ctrl-C cancels.")
        bus.pause(1.0)
        bus.check_bound("the calibration")
    guide.done()
    begun = hand.journal.ledger.mark
    with bus.leaving("the hand is still calibrating", POWER_OFF):
        lost = bus.try_write(register.address, register.encode(1), "the start", "handctl still waits for the end")
        guide.say(f"{POWER_OFF} The calibration is running. handctl sends nothing until it ends.")
        reported = _wait(hand, guide)
    if lost is not None and not reported:
        raise lost.retold(
            f"the calibration may have started. Its start was not acknowledged: {lost.text}",
            hint=f"{POWER_OFF} Wait until the hand has stopped moving, then check with `handctl hand status`",
        )
    if reported:
        hand.journal.ledger.confirm("its end was reported", since=begun)
    else:
        bus.out_of_time("the end of the calibration. The calibration is still running")
        hand.journal.warn(
            "no-completion",
            f"the hand did not report the end within {LISTEN:.0f} s"
            if bus.reports
            else "this connection has no frame that reports the end, so handctl checks the forces instead",
            hint="check force_actual: an unloaded hand reads about 0 g",
        )
    after = hand.read(elements_of(hand.map["force_actual"]))
    ended = outcome(hand, register, "completed" if reported else "not reported", None)
    was = {reading.element.part: reading.value for reading in before}
    rows = [{**hand.row(reading), "before": was.get(reading.element.part)} for reading in after]
    off = [reading.element.part for reading in after if reading.value is None or abs(reading.value) > NEAR]
    if off:
        hand.journal.warn(
            "loaded",
            f"more than {NEAR} g at rest: {', '.join(map(str, off))}",
            hint="make sure nothing touches the fingers, then calibrate again",
        )
    hand.journal.info("volatile", "no manual says whether a calibration survives power-off without a save")
    return Table(rows=[*ended.rows, *rows], columns=hand.columns)


def _wait(hand: Hand, guide: Guide) -> bool:
    """Whether the end was reported."""
    bus = hand.bus
    prefixes = [eb90.read_reply_prefix(bus.id, END_ADDRESS, 1)]
    started = bus.link.now()
    end = started + (LISTEN if bus.reports else WAIT)
    try:
        while bus.link.now() < end and not bus.over:
            guide.progress(f"calibrating {bus.link.now() - started:4.1f} s of at most {end - started:.0f} s", POWER_OFF)
            if bus.reports:
                if bus.listen(prefixes, min(0.25, end - bus.link.now())) is not None:
                    return True
            else:
                bus.pause(min(0.25, end - bus.link.now()))
    finally:
        guide.done()
    return False
