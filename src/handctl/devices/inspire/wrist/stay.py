"""What a stop says to a wrist module: is it there, where is it, and that both axes are to stay there (wrist §2.1, §2.2).

The stop of an exoskeleton hand says it too, where a wrist answers in its place.
"""

from __future__ import annotations

from collections.abc import Generator

from handctl.devices.inspire import canreg, eb90
from handctl.devices.inspire.quiet import question
from handctl.errors import CheckFailed, DeviceRefused, NoAnswer
from handctl.model.param import Step
from handctl.stop.talk import Pieces, Say, Stopped, Talk

READ, WRITE = 0x30, 0x31
ANGLES, ANGLES_SET = 1020, 1038
"""pitch_actual with yaw_actual behind it; yaw_set with pitch_set behind it (wrist §2.1)."""
PITCH, YAW = (-2266, 2212), (-2550, 2550)
"""0.01 degrees (wrist §1)."""
QUICK = 0.05
"""Seconds for the answer that tells a wrist from an exoskeleton hand: it must not hold up a stop."""
PATIENCE = 0.3
LATE = 0.7
"""Seconds for the acknowledgement of a wrist that was late before."""
ASKS = 3
SHOWN = 16
"""Bytes of what came instead of an answer that a sentence holds."""
POWER = "switch the power off if it still moves"


def answers(number: int, seconds: float, heard: Pieces, until: bytes = b"") -> Generator[Say, Pieces, bool]:
    """Whether a wrist answers on a serial line, asked for what no BarrettHand takes for ^C, as it would the angles' FC 03.

    Everything that came is added to `heard`; a frame that begins with `until` ends the wait, too.
    """
    step = Step("ask whether a wrist is there", eb90.read_request(number, *question(number, READ), READ))

    def enough(pieces: Pieces) -> bool:
        return told_of(number, pieces) or (bool(until) and answer(pieces, until) is not None)

    pieces = yield Say(step, seconds, enough, reads=True)
    heard += pieces
    return told_of(number, pieces)


def instead(heard: Pieces) -> str:
    """What came where no answer did, in words: our own frames, which an echo brings back, or others; "" for silence."""
    came = b"".join(heard)
    if not came:
        return ""
    rest = came
    while rest.startswith(eb90.HOST) and len(rest) >= eb90.OVERHEAD:
        rest = rest[rest[3] + eb90.OVERHEAD :]  # byte 3 is the length
    return f"{came[:SHOWN].hex(' ').upper()} arrived instead" if rest else "only our own bytes came back"


def told_of(number: int, pieces: Pieces) -> bool:
    """Whether a wrist's answer is in what came, perhaps late, to a question before."""
    return answer(pieces, eb90.read_reply_prefix(number, *question(number, READ), READ)) is not None


def stay(number: int, can: bool, timeout: float | None, *, late: bool = False) -> Talk:
    """Ask for the angles, up to three times, and command both axes to stay there. One that was late is waited for."""
    for count in range(ASKS):
        angles = yield from where(number, can, timeout or PATIENCE if late or count else QUICK)
        if angles is not None:
            return (yield from hold(number, can, *angles, seconds=LATE if late or count else PATIENCE))
    return Stopped(
        "the wrist did not report its angles, so nothing could be commanded. If it moves, it goes on to its target",
        f"{POWER}. Check id, wire and power with `handctl wrist scan`",
        NoAnswer,
    )


def where(number: int, can: bool, seconds: float) -> Generator[Say, Pieces, tuple[int, int] | None]:
    """Ask for the angles; (pitch, yaw) in 0.01 degrees, None without an answer."""
    meaning = "read the angles"
    if can:
        identifier, data = canreg.read_request(number, ANGLES, 4)
        step = Step(meaning, data, can_id=identifier)
        pieces = yield Say(step, seconds, lambda pieces: len(pieces[-1]) == 4, reads=True)
        found = next((piece for piece in pieces if len(piece) == 4), None)
    else:
        step = Step(meaning, eb90.read_request(number, ANGLES, 4, READ))
        prefix = eb90.read_reply_prefix(number, ANGLES, 4, READ)
        pieces = yield Say(step, seconds, lambda pieces: answer(pieces, prefix), reads=True)
        frame = answer(pieces, prefix)
        found = frame.data if frame is not None else None
    if found is None:
        return None
    pitch, yaw = eb90.unpack_s16(found)
    return pitch, yaw


def hold(number: int, can: bool, pitch: int, yaw: int, seconds: float) -> Talk:
    """Command both axes to where they are; the acknowledgement is waited for that long."""
    at = f"pitch {pitch / 100:.2f}°, yaw {yaw / 100:.2f}°"
    if not (PITCH[0] <= pitch <= PITCH[1] and YAW[0] <= yaw <= YAW[1]):
        text = f"the angles ({at}) are outside the documented range, so nothing was commanded"
        return Stopped(text, POWER, CheckFailed)
    data = eb90.pack_s16([yaw, pitch])
    meaning = f"stay at {at}"
    if can:
        identifier, payload = canreg.write_request(number, ANGLES_SET, data)
        pieces = yield Say(Step(meaning, payload, moves=True, can_id=identifier), seconds)
        refused = bool(pieces) and pieces[0] not in (b"", bytes([len(data)]))
    else:
        prefix = eb90.write_ack_prefix(number, ANGLES_SET, WRITE)
        step = Step(meaning, eb90.write_request(number, ANGLES_SET, data, WRITE), moves=True)
        pieces = yield Say(step, seconds, lambda pieces: answer(pieces, prefix))
        frame = answer(pieces, prefix)
        pieces = [frame.data] if frame is not None else []
        refused = frame is not None and frame.data != bytes([eb90.ACCEPTED])
    if refused:
        return Stopped(f"the wrist did not take the command to {meaning}", POWER, DeviceRefused)
    if not pieces:
        return Stopped(f"the wrist was commanded to {meaning} but did not acknowledge it", POWER, NoAnswer)
    return Stopped(f"the wrist was commanded to {meaning} and acknowledged it. The manual has no stop command")


def answer(pieces: Pieces, prefix: bytes) -> eb90.Frame | None:
    """The frame that begins with `prefix`, if it came whole and undamaged."""
    decoder = eb90.Decoder([prefix])
    decoder.feed(b"".join(pieces))
    return next(iter(decoder.finish()), None)
