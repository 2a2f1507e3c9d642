"""What the motors do once RealTime is left by ^C alone: the one session that is left with a velocity on purpose (dossier 6.6, 16).

It is short and slow, the second process guards it like any other, a Ctrl-C ends it at once, and T follows whatever happens.
"""

from __future__ import annotations

import math

from handctl import interrupts
from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.parameter_map import BARRETT, TRAVEL
from handctl.devices.barrett.realtime.blocks import LoopError
from handctl.devices.barrett.realtime.control_values import Controls
from handctl.devices.barrett.realtime.enter_and_leave import Session
from handctl.devices.barrett.realtime.loop import RealtimeLoop
from handctl.devices.barrett.realtime.loop_flags import FlagRequest
from handctl.errors import Interrupted
from handctl.model.prompts import Prompts
from handctl.model.proofs import Observation

MOTOR = 0
VELOCITY = 2
"""1/8 count a sample: 2 units are 488 counts/s at the factory settings, four degrees of the inner link."""
DRIVEN, WATCHED = 0.2, 1.0
"""Seconds in the loop, and behind it until T."""
READS = 10
LEAST = 30
"""Counts that a motor gains at least that goes on: it would gain over 400."""


class _LeftRunning(Session):
    """Leaves by ^C without a velocity of 0, and reads where the motor is until T takes its power."""

    places: tuple[int, ...] = ()
    usual = False
    """It could not be left like that: velocity 0 first, as ever."""

    def stand(self, most: float = math.inf) -> bool:
        return super().stand(most) if self.usual else self._answered()

    def _answered(self) -> bool:
        """Whether the block before has been answered: only then is ^C a header. Raises ProtocolError."""
        link, decoder = self.hand.line.link, self.decoder
        while decoder.outstanding:
            if isinstance(answer := decoder.next(), LoopError):
                return False
            if answer is None and decoder.outstanding:
                if not (chunk := link.read(self.hand.link.deadline(self.patience))):
                    return False
                decoder.feed(chunk)
        return True

    def _go_out(self, moved: bool) -> bool:
        hand = self.hand
        if not (self.inside and self.last and self._answered() and hand.line.abort() is not None):
            self.usual = True
            return super()._go_out(moved)
        self.inside = False
        for _ in range(READS):
            if interrupts.was_interrupted():
                break
            self.places += tuple(hand.numbers(BARRETT.elements("P", motors=[MOTOR])))
            hand.link.sleep(WATCHED / READS)
        return False


def motors_after_loop(hand: BarrettHand, prompts: Prompts) -> Observation:
    """Drive F1 slowly away from the nearer end of its travel, leave by ^C, and watch it. Raises what the loop or its end raises."""
    hand.line.connect()
    if hand.line.risky:
        return Observation(None, "above 9600 bit/s a 00 is sent ahead of ^C, which ends RealTime by itself: use 9600")
    (place,) = hand.numbers(BARRETT.elements("P", motors=[MOTOR]))
    velocity = VELOCITY if place < TRAVEL[0] / 2 else -VELOCITY
    request = FlagRequest((MOTOR,), {MOTOR: ("position",)})
    loop = RealtimeLoop(
        hand, prompts, request, Controls({MOTOR: ("velocity",)}, {(MOTOR, "velocity"): velocity}), sequential=True
    )
    loop.session = session = _LeftRunning(hand, request, drives=True)
    for _ in loop.run(rate=0.0, count=None, duration=DRIVEN):
        pass
    if loop.failure is not None:
        raise loop.failure
    if interrupts.was_interrupted():
        raise Interrupted("interrupted: the motor's power is off")
    told = f"P behind ^C: {' '.join(map(str, session.places))}"
    if len(session.places) < READS:
        return Observation(None, f"{told}: the loop was not left by ^C alone")
    gained = (session.places[-1] - session.places[0]) * (1 if velocity > 0 else -1)
    return Observation("run on" if gained >= LEAST else "stop", f"{told}, at velocity {velocity}")
