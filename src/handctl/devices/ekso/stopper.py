"""The closest to a stop that the EksoNR's DataPort has: CancelAction (ekso §6). Its effect is not documented."""

from __future__ import annotations

from handctl.devices.ekso.frames import Command, Decoder, Frame, cancel_body, encode, status_text
from handctl.errors import DeviceRefused, NoAnswer, ProtocolError
from handctl.model.frame_decoder import frames_in
from handctl.model.param import Step
from handctl.model.stop_repetition import repeat_until_answered
from handctl.model.stop_sequence import Pieces, StopContext, Stopped, StopSequence

MSG_ID = 0xF000
"""Far from those that count up from 1: a late answer to somebody's read is not taken for ours. And no frame with it holds a
byte upon which another device acts (`families.FamilyRow.trigger`), whatever the length byte counts: a stop goes out to who is there."""
LIMIT = "The DataPort has no stop. CancelAction cancels a running action, but it is not documented which ones. The motors keep their power, and the wearer is not held"
HINT = "use the device's own controls, and stay with the wearer"


def stop_steps(context: StopContext) -> StopSequence:
    """Send CancelAction until it is answered. The device does not report what it cancelled, so nothing is checked afterwards."""
    mode = str(context.settings.own.get("length_mode", "body"))
    request = encode(Command.CANCEL_ACTION, MSG_ID, cancel_body(), "body" if mode == "auto" else mode)
    step = Step("CancelAction: cancel the running action", request, moves=True)
    heard = yield from repeat_until_answered(context, step, lambda came: _answer(request, came), final=_accepted)
    frame, pieces = heard.found, heard.came
    if frame is None:
        instead = "no valid reply arrived" if pieces else "the device did not reply"
        return Stopped(f"CancelAction was sent, but {instead}. {LIMIT}", HINT, ProtocolError if pieces else NoAnswer)
    if not _accepted(frame):
        return Stopped(f"CancelAction was not accepted: {status_text(frame.status)}. {LIMIT}", HINT, DeviceRefused)
    return Stopped(f"CancelAction was accepted. {LIMIT}", HINT)


def _accepted(frame: Frame) -> bool:
    return not frame.status & 0xFF


def _answer(request: bytes, pieces: Pieces) -> Frame | None:
    decoder = Decoder()
    decoder.expect(request)
    decoder.feed(b"".join(pieces))
    return next((frame for frame in reversed(list(frames_in(decoder))) if frame.answers(request)), None)
