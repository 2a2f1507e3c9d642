"""The guided calibration of a worn EH55BF1 (exo §2.3.6): its steps, the question before it, and its end.

It moves all fingers, and nothing but the power stops it: both are said before and after.
"""

from __future__ import annotations

from handctl.devices.inspire.calibration import calibration_result, run_calibration
from handctl.devices.inspire.exo.device import ExoHand
from handctl.devices.inspire.exo.register_map import EXO
from handctl.devices.inspire.register_bus import POWER_OFF
from handctl.errors import Hint
from handctl.model.prompts import Prompts
from handctl.model.result import Table

LISTEN_SECONDS = 30.0
"""How long to listen for the end frame; the documented waits add up to 9 s, movements come on top (exo §2.3.6)."""

STEPS = (
    (1, "relax all fingers: no force on the hand"),
    (2, "the hand opens your fingers: adjust until all five are naturally straight"),
    (2, "the hand closes four fingers: adjust until they are fully clenched"),
    (2, "four fingers straighten, the thumb bends: adjust until it lies inside the palm, fully bent"),
    (2, "thumb and index finger touch, the others bend alike"),
)
"""Seconds of the documented wait and what the wearer does (exo §2.3.6)."""
QUESTION = f"{POWER_OFF} Someone has to wear the hand, and it moves all fingers through the steps above"


def say_steps(prompts: Prompts) -> None:
    """Tell the wearer what is going to happen."""
    for number, (seconds, text) in enumerate(STEPS, 1):
        prompts.say(f"  step {number}: {text} (waits {seconds} s)")


def calibrate(hand: ExoHand, prompts: Prompts) -> Table:
    """Start the calibration of the worn hand and stay silent until it reports, at most 30 s (exo §2.3.6).

    Nothing is sent meanwhile. The end frame (address field 0002) is known from the sibling only; without it the
    result says so. Raises DeviceRefused on Ctrl-C: no command stops a calibration.
    """
    register, waits = EXO["calibrate"], sum(seconds for seconds, _ in STEPS)
    said = "The hand goes through the steps above in this order. Nothing is sent meanwhile."
    lost, frame, seconds = run_calibration(hand, register, prompts, said, LISTEN_SECONDS, waits)
    if frame is None:
        hand.bus.out_of_time("the end of the calibration, which is still running", "its end")
        if lost is not None:
            raise lost.reworded(
                f"the calibration may have started. Its start was not acknowledged, its end was not reported: {lost.text}",
                hint=Hint(
                    f"{POWER_OFF} Keep wearing the hand until it has stopped moving, then check with {{}}", "exo status"
                ),
            )
        hand.journal.warn(
            "no-completion",
            f"the hand did not report that the calibration ended within {LISTEN_SECONDS:.0f} s (the report is not documented for this hand)",
            hint=Hint("check the positions with {}", "exo status"),
        )
    elif seconds < LISTEN_SECONDS:
        prompts.say(f"The hand reported the end after {seconds:.1f} s.")
    hand.journal.info("volatile", "the manual does not say whether a calibration survives power-off without a save")
    after = hand.read([e for name in ("position_actual", "force_actual", "error") for e in EXO[name].each])
    table = calibration_result(hand, register, frame, after)
    table.rows[0]["seconds"] = round(seconds, 1)
    return table
