"""The guided calibration of a worn EH55BF1 (exo §2.3.6): its steps, the question before it, and its end.

It moves all fingers, and nothing but the power stops it: both are said before and after.
"""

from __future__ import annotations

from handctl.devices.inspire.calibration import calibrating, calibration_result, wait_for_calibration
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
    bus = hand.bus
    begun = hand.journal.ledger.mark
    with calibrating(hand, prompts):
        lost = bus.try_write(EXO["calibrate"].address, b"\x01", "the start", "handctl still waits for the end")
        started = bus.link.now()
        prompts.say(
            f"{POWER_OFF} The calibration is running. The hand goes through the steps above in this order. "
            "Nothing is sent meanwhile."
        )
        least = sum(seconds for seconds, _ in STEPS)
        more = f" (waits {least} s, the rest is movement)"
        frame = wait_for_calibration(bus, prompts, LISTEN_SECONDS, more, least=least)
    seconds = bus.link.now() - started
    if frame is not None:
        if seconds < LISTEN_SECONDS:
            prompts.say(f"The hand reported the end after {seconds:.1f} s.")
        if frame.data == b"\0":
            hand.journal.ledger.confirm("its end was reported", since=begun)
    else:
        bus.out_of_time("the end of the calibration, which is still running", "its end")
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
    hand.journal.info("volatile", "the manual does not say whether a calibration survives power-off without a save")
    after = hand.read([e for name in ("position_actual", "force_actual", "error") for e in EXO[name].each])
    table = calibration_result(hand, EXO["calibrate"], frame, after)
    table.rows[0]["seconds"] = round(seconds, 1)
    return table
