"""What a stop says to an EH55BF1: is it there, all forces to 0, and that every finger is to stay where it is then.

The stop of a wrist module says it too, where the hand that carries it answers alone.
"""

from __future__ import annotations

from collections.abc import Generator

from handctl.devices.inspire import eb90
from handctl.devices.inspire.wrist.stay import QUICK, answer, instead
from handctl.errors import NoAnswer, ProtocolError
from handctl.model.param import Step
from handctl.stop.talk import Pieces, Say, Stopped, Talk

POSITION_SET, POSITION_ACTUAL = 1486, 1546
"""exo §2.3.7, §2.3.9."""
FINGERS, MEASURED = 5, 6
STAY = -1
"""In `position_set`: this finger is not moved (exo §2.3.7)."""
PATIENCE = 0.3
POWER = "switch the power off if the hand still pushes or moves"


def answers(number: int, heard: Pieces) -> Generator[Say, Pieces, bool]:
    """Whether the positions of a hand can be read here (flag 11). Everything that came is added to `heard`."""
    prefix = eb90.read_reply_prefix(number, POSITION_ACTUAL, 2 * MEASURED)
    step = Step("ask whether an exoskeleton hand is there", eb90.read_request(number, POSITION_ACTUAL, 2 * MEASURED))
    pieces = yield Say(step, QUICK, lambda pieces: answer(pieces, prefix), reads=True)
    heard += pieces
    return answer(pieces, prefix) is not None


def release(number: int, timeout: float | None, heard: Pieces) -> Talk:
    """Forces to 0, then hold at the positions that came back. Everything that came is added to `heard`.

    Where nothing came back, nothing more is sent: the frame that holds every finger where it is has FF in it, and that is
    the trigger of a BarrettHand's boot monitor, if one should be there instead.
    """
    seconds = timeout or PATIENCE
    prefix = reply_prefix(number)
    step = Step("all forces to 0", eb90.command_request(number, eb90.FORCE_COMMAND, [0] * FINGERS), moves=True)
    pieces = yield Say(step, seconds, lambda pieces: answer(pieces, prefix))
    heard += pieces
    told = answer(pieces, prefix)
    if told is not None:
        return (yield from keep(number, told, seconds, heard))
    return unanswered(heard)


def unanswered(heard: Pieces) -> Stopped:
    """Forces to 0 went out, and no hand answered."""
    came = instead(heard)
    seen = f"no valid answer arrived: {came}" if came else "no answer arrived"
    text = f"all forces were commanded to 0, but {seen}. A wrist, if one is here, was not stopped"
    hint = f"{POWER}. `handctl exo scan` looks for id and speed"
    return Stopped(text, hint, ProtocolError if came else NoAnswer)


def reply_prefix(number: int) -> bytes:
    """How the answer to the force command begins."""
    return eb90.command_reply_prefix(number, eb90.FORCE_COMMAND)


def keep(number: int, told: eb90.Frame, seconds: float, heard: Pieces) -> Talk:
    """Hold every finger at the positions that the force command was answered with. What came is added to `heard`."""
    places = eb90.unpack_s16(told.payload)[:FINGERS]
    known = len(places) == FINGERS and all(0 <= place <= 1000 for place in places)
    if known:
        prefix = eb90.command_reply_prefix(number, eb90.POSITION_COMMAND)
        meaning = f"hold at {' '.join(map(str, places))}"
        step = Step(meaning, eb90.command_request(number, eb90.POSITION_COMMAND, places), moves=True)
    else:
        prefix = eb90.write_ack_prefix(number, POSITION_SET)
        meaning = f"move no finger (position_set {STAY})"
        step = Step(meaning, eb90.write_request(number, POSITION_SET, eb90.pack_s16([STAY] * FINGERS)), moves=True)
    pieces = yield Say(step, seconds, lambda pieces: answer(pieces, prefix))
    heard += pieces
    held = answer(pieces, prefix)
    if held is None:
        return Stopped(
            f"the hand answered the command of all forces to 0, but not the next one: {meaning}", POWER, NoAnswer
        )
    return Stopped(f"the hand answered two commands: all forces to 0, then {meaning}. The manual has no stop command")
