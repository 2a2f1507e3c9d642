"""The stop of a wrist module: both axes are commanded to stay where they are, since its manual has no stop command.

That needs their angles, and so they are read anew for every hold. On a serial line that nobody has met a wrist on, a question
goes before that no other device acts upon. Whatever else may answer, only a wrist's own bytes go out.
"""

from __future__ import annotations

from collections.abc import Generator

from handctl.devices.inspire import canreg, eb90
from handctl.devices.inspire.stopping import READS, Read, answer, asks, instead, lead, seen_since
from handctl.errors import CheckFailed, DeviceRefused, NoAnswer, ProtocolError
from handctl.model.param import Step
from handctl.model.stopping import Aim, Heard, Pieces, Say, Stopped, Talk, insist, settled, silence, taken_over

ANGLES, ANGLES_SET = 1020, 1038
"""pitch_actual with yaw_actual behind it; yaw_set with pitch_set behind it (wrist §2.1)."""
PITCH, YAW = (-2266, 2212), (-2550, 2550)
"""0.01 degrees (wrist §1)."""
STILL = 20
"""0.01 degrees: what stands is read alike within so many."""
POWER = "switch the power off if it still moves"


def stop_talk(aim: Aim) -> Talk:
    """Where is it, stay there: until it is acknowledged; then a second look."""
    if not (aim.can or aim.proven):
        step, prefix = asks(aim.number, eb90.WRIST_READ)
        heard = yield from insist(aim, step, lambda pieces: answer(pieces, prefix), reads=True, ahead=lead(aim))
        if heard.found is None:
            return _unanswered(heard.came)
    meaning = ""
    for _ in range(aim.tries):
        told = yield from _asked(aim, ANGLES)
        if told.found is None:
            return _unanswered(told.came)
        pitch, yaw = told.found
        at = f"pitch {pitch / 100:.2f}°, yaw {yaw / 100:.2f}°"
        if not (PITCH[0] <= pitch <= PITCH[1] and YAW[0] <= yaw <= YAW[1]):
            text = f"the angles ({at}) are outside the documented range, so nothing was commanded"
            return Stopped(text, POWER, CheckFailed)
        meaning = f"stay at {at}"
        taken = yield from _hold(aim, meaning, [yaw, pitch], max(aim.each, told.seconds))
        if taken is False:
            return Stopped(f"the wrist rejected the command to {meaning}", POWER, DeviceRefused)
        if taken:
            done = f"the wrist was commanded to {meaning} and acknowledged it. The manual has no stop command"
            against = yield from seen_since(
                lambda: _read(aim, ANGLES), lambda: _read(aim, ANGLES_SET), [yaw, pitch], STILL, told.found
            )
            return taken_over(Stopped(done), against) if against else Stopped(done)
        if told.seconds > aim.each:
            yield from silence(told.seconds)  # answers to repetitions tell where it was
    return Stopped(f"the wrist was commanded to {meaning} but did not acknowledge it", POWER, NoAnswer)


def _unanswered(heard: Pieces) -> Stopped:
    came = instead(heard)
    return Stopped(
        f"{f'no wrist answered: {came}' if came else 'the wrist did not answer'}. Without its present angles, no stop could be "
        "commanded. If it moves, it goes on to its target",
        f"{POWER}. Check the id, the wiring and the power with `handctl wrist scan`",
        ProtocolError if came else NoAnswer,
    )


def _read(aim: Aim, address: int) -> Read:
    return (yield from settled(aim, (yield from _asked(aim, address))))


def _asked(aim: Aim, address: int) -> Generator[Say, Pieces, Heard[list[int]]]:
    """Two angles in 0.01 degrees."""
    if aim.can:
        identifier, data = canreg.read_request(aim.number, address, 4)
        step = Step(READS, data, can_id=identifier)
    else:
        step = Step(READS, eb90.read_request(aim.number, address, 4, eb90.WRIST_READ))

    def found(pieces: Pieces) -> list[int] | None:
        if aim.can:
            data = next((one for one in reversed(pieces) if len(one) == 4), None)
        else:
            frame = answer(pieces, eb90.read_reply_prefix(aim.number, address, 4, eb90.WRIST_READ))
            data = frame.data if frame is not None else None
        return eb90.unpack_s16(data) if data is not None else None

    return (yield from insist(aim, step, found, reads=True))


def _hold(aim: Aim, meaning: str, angles: list[int], seconds: float) -> Generator[Say, Pieces, bool | None]:
    """Command both axes to where they are; whether the wrist took it, None without an answer."""
    data = eb90.pack_s16(angles)
    if aim.can:
        identifier, payload = canreg.write_request(aim.number, ANGLES_SET, data)
        pieces = yield Say(Step(meaning, payload, moves=True, can_id=identifier), seconds, _short)
        return None if not (short := _short(pieces)) else short[0] in (b"", bytes([len(data)]))
    prefix = eb90.write_ack_prefix(aim.number, ANGLES_SET, eb90.WRIST_WRITE)
    step = Step(meaning, eb90.write_request(aim.number, ANGLES_SET, data, eb90.WRIST_WRITE), moves=True)
    pieces = yield Say(step, seconds, lambda came: answer(came, prefix))
    frame = answer(pieces, prefix)
    return None if frame is None else frame.data == bytes([eb90.ACCEPTED])


def _short(pieces: Pieces) -> list[bytes]:
    """What can be an acknowledgement: empty, or a number; longer is a late answer to a read."""
    return [piece for piece in pieces if len(piece) < 2]
