"""What moves an EH55BF1 over a time: calibration, and a position command until the fingers stand still.

Someone may be wearing the hand: what cannot be stopped is said before and after.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from handctl.devices.inspire.base import Movement
from handctl.devices.inspire.exo.device import NEAR
from handctl.devices.inspire.map import EXO, FINGERS, pushes
from handctl.devices.inspire.procedures import outcome, wait_for_calibration
from handctl.devices.inspire.registers import may_still_move
from handctl.model.guide import Guide
from handctl.model.leaving import stopped_by_ctrl_c
from handctl.model.moving import REACHED, Goal, Seen, Stillness
from handctl.model.param import elements_of
from handctl.model.result import Table

if TYPE_CHECKING:
    from handctl.devices.inspire.exo.device import ExoHand

CALIBRATION_SECONDS = 30.0
"""How long to listen for the end frame; the documented waits add up to 9 s, movements come on top (exo §2.3.6)."""
STILL = Stillness(samples=3, seconds=0.5, refresh=0.05)
POWER_OFF = "Ctrl-C does not stop the hand. To stop it, switch its power off."
"""Safety words of a calibration: no command stops one (exo §2.3.6)."""

CALIBRATION_STEPS = (
    (1, "relax all fingers: no force on the hand"),
    (2, "the hand opens your fingers: adjust until all five are naturally straight"),
    (2, "the hand closes four fingers: adjust until they are fully clenched"),
    (2, "four fingers straighten, the thumb bends: adjust until it lies inside the palm, fully bent"),
    (2, "thumb and index finger touch, the others bend alike"),
)
"""Seconds of the documented wait and what the wearer does (exo §2.3.6)."""


def calibrate(hand: ExoHand, guide: Guide) -> Table:
    """Start the calibration of the worn hand and stay silent until it reports, at most 30 s (exo §2.3.6).

    Nothing is sent meanwhile. The end frame (address field 0002) is known from the sibling only; without it the
    result says so. Raises Interrupted on Ctrl-C: no command stops a calibration.
    """
    bus = hand.bus
    begun = hand.journal.ledger.mark
    with hand.bus.leaving(
        "the hand is still calibrating",
        f"{POWER_OFF} No documented command stops a calibration",
    ):
        lost = bus.try_write(EXO["calibrate"].address, b"\x01", "the start", "handctl still waits for the end")
        started = bus.link.now()
        guide.say(
            f"{POWER_OFF} The calibration is running. The hand goes through the steps above in this order. "
            "Nothing is sent meanwhile."
        )
        least = sum(seconds for seconds, _ in CALIBRATION_STEPS)
        more = f" (waits {least} s, the rest is movement)"
        frame = wait_for_calibration(bus, guide, CALIBRATION_SECONDS, more, POWER_OFF)
    seconds = bus.link.now() - started
    if frame is None:
        bus.out_of_time("the end of the calibration. The calibration is still running")
    if frame is None and lost is not None:
        raise lost.retold(
            f"the calibration may have started. Its start was not acknowledged, its end was not reported: {lost.text}",
            hint=f"{POWER_OFF} Keep wearing the hand until it has stopped moving, then check with `handctl exo status`",
        )
    if frame is None:
        hand.journal.warn(
            "no-completion",
            f"the hand did not report the end within {CALIBRATION_SECONDS:.0f} s (the report is not documented for this hand)",
            hint="check the positions with `handctl exo status`",
        )
    else:
        guide.say(f"The hand reported the end after {seconds:.1f} s.")
        hand.journal.ledger.confirm("its end was reported", since=begun)
    hand.journal.info("volatile", "the manual does not say whether a calibration survives power-off without a save")
    table = hand.read([e for name in ("position_actual", "force_actual") for e in elements_of(EXO[name])])
    ended = outcome(
        hand, EXO["calibrate"], "completed" if frame is not None else "not reported", frame.data if frame else None
    )
    ended.rows[0]["seconds"] = round(seconds, 1)
    return Table(rows=[*ended.rows, *(hand.row(reading) for reading in table)], columns=hand.columns)


def command(hand: ExoHand, which: str, values: Mapping[int, int], guide: Guide) -> Table:
    """Send a force or position command and show its reply. Raises Interrupted on Ctrl-C, after the hand was stopped."""
    with stopped_by_ctrl_c(hand.stop, guide), may_still_move("the fingers"):
        return hand.command_some(which, values)


def move(hand: ExoHand, values: Mapping[int, int], guide: Guide, *, wait: float, expect: str = REACHED) -> Table:
    """Send a position command, then watch until the fingers stand still or `wait` seconds have passed.

    `values` by index of the finger; others are left alone. Ctrl-C stops the hand. Rows have the target and what became of
    it; what was not as expected is the table's failure.
    """
    this = Movement(
        [Goal(FINGERS[index], value, NEAR) for index, value in values.items()],
        STILL,
        elements_of(EXO["position_actual"]),
        lambda readings: {reading.element.part or "": Seen(reading.value) for reading in readings},
        lambda seen, _: _evidence(hand) if seen.short else None,
    )
    return hand.moved(this, lambda: hand.command_some("position", values), guide, wait=wait, expect=expect)[0]


def _evidence(hand: ExoHand) -> dict[str, Seen]:
    """Why fingers stand off their targets: error bits, or a current that only something in their way draws."""
    readings = hand.read([element for name in ("error", "current") for element in elements_of(EXO[name])])
    at = {reading.element.full_name: int(reading.value or 0) for reading in readings}
    return {
        finger: Seen(
            None,
            blocked=EXO["error"].label(bits) or "" if (bits := at[f"error.{finger}"]) else "",
            contact=pushes(at[f"current.{finger}"]),
        )
        for finger in FINGERS
    }
