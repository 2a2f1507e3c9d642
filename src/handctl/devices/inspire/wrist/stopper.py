"""The stop of a wrist module: both axes are commanded to hold their position, because its manual has no stop command.

That needs their angles, and so they are read anew for every hold. An axis whose reading is no angle of it is left alone, and
the other one is held by its own register. On a serial line that nobody has met a wrist on, a question
goes before that no other device acts upon. Whatever else may answer, only a wrist's own bytes go out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from handctl.devices.inspire import eb90
from handctl.devices.inspire.stop_requests import (
    CAN,
    EB90,
    REFUSED,
    TAKEN,
    Axes,
    Wire,
    answer,
    asks,
    check_again,
    hold_target,
    instead,
    lead,
)
from handctl.devices.inspire.wrist.register_map import NEAR, NOISE, PITCH_RANGE, WRIST, YAW_RANGE
from handctl.errors import CheckFailed, DeviceRefused, NoAnswer, ProtocolError
from handctl.model.stop_repetition import HoldTries, StepResult, after_late_replies, behind, repeat_until_answered
from handctl.model.stop_sequence import Pieces, StopContext, Stopped, StopSequence, StopStep

ANGLES, ANGLES_SET = WRIST["pitch_actual"].address, WRIST["yaw_set"].address
"""With yaw_actual behind it; with pitch_set behind it (wrist §2.1)."""
AXES = ("pitch", "yaw")
"""In the order of the actual angles; the set angles lie the other way round (wrist §2.1)."""
POWER = "switch the power off if it is still moving"


def stop_steps(context: StopContext) -> StopSequence:
    """Where is it, stay there: until it is acknowledged; then a second look."""
    told: StepResult[Any] | None = None
    if not (context.can or context.proven):
        step, prefix = asks(context.number, eb90.WRIST_READ)
        told = yield from repeat_until_answered(
            context, step, lambda pieces: answer(pieces, prefix), reads=True, ahead=lead(context)
        )
        if told.found is None:
            return _unanswered(told.came)
    answers: Pieces = []
    meaning, taken, wire = "", None, Wire(context, CAN if context.can else EB90, wrist=True)
    asked, found = wire.asking(ANGLES, 4)
    tries = HoldTries(context)
    while tries.another():
        told = yield from repeat_until_answered(context, asked, found, after=told, reads=True)
        if told.found is None:
            return _unanswered(told.came)
        here = eb90.unpack_s16(told.found)
        axes = Axes(AXES, here, _targets(here), lambda reading: f"{reading / 100:.2f}°")
        held = [(name, target) for name, target in zip(AXES, axes.targets, strict=True) if target is not None]
        if not held:
            text = f"no angle is in the documented range ({axes.left}), so nothing was commanded"
            return Stopped(text, POWER, CheckFailed)
        meaning = f"stay at {', '.join(f'{name} {target / 100:.2f}°' for name, target in held)}"
        first = WRIST[f"{held[-1][0]}_set"].address
        step, verdict = wire.writing(first, eb90.pack_s16([target for _, target in reversed(held)]), meaning)
        action = StopStep(step, 0.0, lambda came, verdict=verdict: verdict(came) == TAKEN)  # type: ignore[misc]
        tries.sent(told)
        answers = yield from behind(context, told, action)
        taken = verdict(answers)
        if taken == TAKEN:
            done = (
                f"the wrist was commanded to {meaning}{axes.at_end} and acknowledged it. The manual documents no stop"
            )
            stopped, last = yield from check_again(
                Stopped(done),
                lambda: wire.values(ANGLES, 2),
                lambda: wire.values(ANGLES_SET, 2),
                axes.targets[::-1],
                NOISE,
                axes.targets,
            )
            return axes.judge(stopped, _targets(last), POWER)
        yield from after_late_replies(context, told)  # they tell where it was
    if taken == REFUSED:
        return Stopped(f"the wrist rejected the command to {meaning}", POWER, DeviceRefused)
    text, seen = f"the wrist was commanded to {meaning} but did not acknowledge it", instead(answers)
    return Stopped(f"{text}: {seen}" if seen else text, POWER, ProtocolError if seen else NoAnswer)


def _targets(angles: Sequence[int]) -> list[int | None]:
    """Where to hold the axes that read these angles, both in 0.01 degrees."""
    ranges = [(round(low * 100), round(high * 100)) for low, high in (PITCH_RANGE, YAW_RANGE)]
    return [hold_target(angle, *limits, NEAR) for angle, limits in zip(angles, ranges, strict=False)]


def _unanswered(heard: Pieces) -> Stopped:
    came = instead(heard)
    return Stopped(
        f"{f'no wrist replied: {came}' if came else 'the wrist did not reply'}. Without its present angles, no stop could be "
        "commanded. If it moves, it continues to its target",
        f"{POWER}. Check the id, the wiring and the power with `handctl wrist scan`",
        ProtocolError if came else NoAnswer,
    )
