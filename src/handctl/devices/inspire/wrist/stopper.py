"""The stop of a wrist module: both axes are commanded to hold their position, because its manual has no stop command.

That needs their angles, and so they are read anew for every hold. On a serial line that nobody has met a wrist on, a question
goes before that no other device acts upon. Whatever else may answer, only a wrist's own bytes go out.
"""

from __future__ import annotations

from handctl.devices.inspire import eb90
from handctl.devices.inspire.stop_requests import (
    CAN,
    EB90,
    REFUSED,
    TAKEN,
    Wire,
    answer,
    asks,
    instead,
    lead,
    seen_since,
)
from handctl.devices.inspire.wrist.register_map import WRIST
from handctl.errors import CheckFailed, DeviceRefused, NoAnswer, ProtocolError
from handctl.model.stop_repetition import attempts, interval, repeat_until_answered
from handctl.model.stop_sequence import Pieces, StopContext, Stopped, StopSequence, StopStep, did_not_last, silence

ANGLES, ANGLES_SET = WRIST["pitch_actual"].address, WRIST["yaw_set"].address
"""With yaw_actual behind it; with pitch_set behind it (wrist §2.1)."""
STILL = 20
"""0.01 degrees: what stands is read alike within so many."""
POWER = "switch the power off if it still moves"


def stop_steps(context: StopContext) -> StopSequence:
    """Where is it, stay there: until it is acknowledged; then a second look."""
    if not (context.can or context.proven):
        step, prefix = asks(context.number, eb90.WRIST_READ)
        heard = yield from repeat_until_answered(
            context, step, lambda pieces: answer(pieces, prefix), reads=True, ahead=lead(context)
        )
        if heard.found is None:
            return _unanswered(heard.came)
    meaning, wire = "", Wire(context, CAN if context.can else EB90, wrist=True)
    asked, found = wire.asking(ANGLES, 4)
    for _ in range(attempts(context)):
        told = yield from repeat_until_answered(context, asked, found, reads=True)
        if told.found is None:
            return _unanswered(told.came)
        here = pitch, yaw = eb90.unpack_s16(told.found)
        at = f"pitch {pitch / 100:.2f}°, yaw {yaw / 100:.2f}°"
        if not (WRIST["pitch_set"].allowed(pitch / 100) and WRIST["yaw_set"].allowed(yaw / 100)):
            text = f"the angles ({at}) are outside the documented range, so nothing was commanded"
            return Stopped(text, POWER, CheckFailed)
        meaning = f"stay at {at}"
        step, verdict = wire.writing(ANGLES_SET, eb90.pack_s16([yaw, pitch]), meaning)
        pieces = yield StopStep(
            step,
            max(interval(context), told.seconds),
            lambda came, verdict=verdict: verdict(came) is not None,  # type: ignore[misc]
        )
        taken = verdict(pieces)
        if taken == REFUSED:
            return Stopped(f"the wrist rejected the command to {meaning}", POWER, DeviceRefused)
        if taken == TAKEN:
            done = f"the wrist was commanded to {meaning} and acknowledged it. The manual documents no stop"
            against = yield from seen_since(
                lambda: wire.values(ANGLES, 2), lambda: wire.values(ANGLES_SET, 2), [yaw, pitch], STILL, here
            )
            return did_not_last(Stopped(done), against) if against else Stopped(done)
        if told.seconds > interval(context):
            yield from silence(told.seconds)  # answers to repetitions tell where it was
    return Stopped(f"the wrist was commanded to {meaning} but did not acknowledge it", POWER, NoAnswer)


def _unanswered(heard: Pieces) -> Stopped:
    came = instead(heard)
    return Stopped(
        f"{f'no wrist replied: {came}' if came else 'the wrist did not reply'}. Without its present angles, no stop could be "
        "commanded. If it moves, it continues to its target",
        f"{POWER}. Check the id, the wiring and the power with `handctl wrist scan`",
        ProtocolError if came else NoAnswer,
    )
