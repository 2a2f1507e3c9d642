"""The stop of an EH55BF1: all forces to 0, then every finger is commanded to stay where it is. The manual has no stop command.

The answer to the force command tells where the fingers are (exo §2.2.1), and that a hand is there at all. The same bytes
would be a write to a wrist, so one quick read tells which of the two is there; without an answer the forces are released
all the same, and that is all.
"""

from __future__ import annotations

from handctl.devices.inspire.exo import release
from handctl.devices.inspire.wrist import stay
from handctl.stop.talk import Aim, Pieces, Talk

LISTEN_ON = 0.3
"""Seconds more for a wrist that is late, once the stop of a hand has gone out and nothing has answered it."""


def stop_talk(aim: Aim) -> Talk:
    """The stop of what answers: the hand, or a wrist that was taken for one."""
    number = aim.settings.id if aim.settings.id is not None else 1
    heard: Pieces = []
    if (yield from stay.answers(number, stay.QUICK, heard)):  # fmt: skip
        stopped = yield from stay.stay(number, False, aim.settings.timeout)
        return stopped._replace(text=f"a wrist answers here, not an exoskeleton hand: {stopped.text}")
    stopped = yield from release.release(number, aim.settings.timeout, heard)
    late = stay.told_of(number, heard)
    if not late and stopped.error is not None:
        released = stay.answer(heard, release.reply_prefix(number))
        late = yield from stay.answers(number, LISTEN_ON, heard, b"" if released else release.reply_prefix(number))
        told = stay.answer(heard, release.reply_prefix(number))
        if told is not None and not released and not late:
            return (yield from release.keep(number, told, stay.LATE, heard))
        if told is None and not late:
            stopped = release.unanswered(heard)
    if not late:
        return stopped
    held = yield from stay.stay(number, False, aim.settings.timeout, late=True)
    text = f"all forces were commanded to 0, then a wrist answered, later than {stay.QUICK:g} s"
    return held._replace(text=f"{text}: {held.text}")
