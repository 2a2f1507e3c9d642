"""The calibration of an RH56 hand's force sensors: it moves the whole hand for about six seconds (rh56 §6 Q8, Q9).

Over EB90 a frame tells the end. On the other wires the forces are compared after the time that it takes. Nothing is sent
meanwhile, and nothing stops it but the power.
"""

from __future__ import annotations

from handctl.devices.inspire.calibration import calibration_result, run_calibration
from handctl.devices.inspire.hand.device import Hand
from handctl.devices.inspire.register_bus import POWER_OFF
from handctl.errors import Hint
from handctl.model.prompts import Prompts
from handctl.model.result import Table

COUNTDOWN = 10
"""Seconds to take the hands away (rh56 §9)."""
LISTEN, WAIT = 20.0, 8.0
"""Seconds for the frame that tells the end, and for a calibration whose end nobody tells (rh56 §6 Q9)."""
RESTING = 50
"""Grams within which an unloaded hand rests (rh56 §6 Q5)."""


def calibrate(hand: Hand, prompts: Prompts) -> Table:
    """Start it after a countdown, wait for its end, show the forces then. Raises DeviceRefused on Ctrl-C once it runs."""
    hand.identify()
    bus, register = hand.bus, hand.map["calibrate_force"]
    before = hand.read(hand.map["force_actual"].each)
    for left in range(COUNTDOWN, 0, -1):
        prompts.progress(f"the hand moves in {left} s: keep it open and empty, and do not touch it", "Ctrl-C cancels.")
        bus.pause(1.0)
        bus.check_bound("the calibration")
    prompts.done()
    said, seconds = "handctl sends nothing until it ends.", LISTEN if bus.reports else WAIT
    lost, frame, _ = run_calibration(hand, register, prompts, said, seconds)
    if lost is not None and frame is None:
        raise lost.reworded(
            f"the calibration may have started. Its start was not acknowledged: {lost.text}",
            hint=Hint(f"{POWER_OFF} Wait until the hand has stopped moving, then check with {{}}", "hand status"),
        )
    if frame is None:
        bus.out_of_time("the end of the calibration, which is still running", "its end")
        hand.journal.warn(
            "no-completion",
            f"the hand did not report that the calibration ended within {LISTEN:.0f} s"
            if bus.reports
            else "this connection has no frame that reports the end of a calibration, so handctl checks the forces instead",
            hint="check force_actual: an unloaded hand reads about 0 g",
        )
    after = hand.read([one for name in ("force_actual", "error") for one in hand.map[name].each])
    table = calibration_result(hand, register, frame, after)
    was = {reading.element.part: reading.value for reading in before}
    for row in table.rows:
        if row["name"] == "force_actual":
            row["before"] = was.get(row["finger"])
    forces = [reading for reading in after if reading.element.param.name == "force_actual"]
    off = [reading.element.part for reading in forces if reading.value is None or abs(reading.value) > RESTING]
    if off:
        hand.journal.warn(
            "loaded",
            f"more than {RESTING} g at rest: {', '.join(map(str, off))}",
            hint="make sure nothing touches the fingers, then calibrate again",
        )
    hand.journal.info("volatile", "no manual says whether a calibration survives power-off without a save")
    return table
