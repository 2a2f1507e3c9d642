"""The stop of a wrist module: both axes are commanded to stay where they are, since its manual has no stop command.

That needs their angles, so they are asked for first, on a serial line once its answer to flag 30 has told that it is a
wrist (wrist §2.2).
"""

from __future__ import annotations

from handctl.devices.inspire.exo import release
from handctl.devices.inspire.wrist.stay import ASKS, PATIENCE, POWER, QUICK, answers, instead, stay, told_of
from handctl.errors import NoAnswer, ProtocolError
from handctl.stop.talk import Aim, Pieces, Stopped, Talk


def stop_talk(aim: Aim) -> Talk:
    """The stop of what answers: a wrist, or the exoskeleton hand that was taken for one.

    A force frame is a write to a wrist, and the hand that carries one answers as an exoskeleton hand does: that is asked
    for only when the wrist has been silent for long enough.
    """
    settings, can = aim.settings, aim.can
    number = settings.id if settings.id is not None else 1
    heard: Pieces = []
    for count in range(ASKS):
        if can or (yield from answers(number, QUICK if count == 0 else settings.timeout or PATIENCE / 2, heard)):
            return (yield from stay(number, can, settings.timeout, late=count > 0))
    if (yield from release.answers(number, heard)):  # fmt: skip
        stopped = yield from release.release(number, settings.timeout, heard)
        return stopped._replace(text=f"an exoskeleton hand answers here, not a wrist: {stopped.text}")
    if told_of(number, heard) or (yield from answers(number, PATIENCE, heard)):
        return (yield from stay(number, can, settings.timeout, late=True))
    came = instead(heard)
    return Stopped(
        f"{f'no wrist answered: {came}' if came else 'the wrist did not answer'}. Without its angles nothing could be "
        "commanded. If it moves, it goes on to its target",
        f"{POWER}. Check id, wire and power with `handctl wrist scan`",
        ProtocolError if came else NoAnswer,
    )
