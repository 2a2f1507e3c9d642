"""The stop of a BarrettHand: ^C ends a movement or the RealTime loop, T takes the power from the motors (barrett §5.5, §5.2.1).

A control block that was cut off may still swallow up to eight bytes (dossier 1.5): without a prompt ^C is repeated.
"""

from __future__ import annotations

from functools import partial

from handctl.devices.barrett.language import ABORT, Answer, Decoder, encode, explain_status, has_prompt
from handctl.errors import DeviceRefused, NoAnswer, ProtocolError
from handctl.param import Step
from handctl.stopping import Aim, Pieces, Say, Stopped, Talk

FIRST, BETWEEN, LAST = 0.15, 0.02, 0.5
"""Seconds for the prompt behind the first ^C, behind the next ones, and behind the last: a movement needs time to end."""
SWALLOWED = 8
POWER_OFF = 1.0
HARMLESS = 1 | 4 | 16384
"""Statuses with which T works: a motor was never initialized (printed as 1 in §5.2.1), ^C was received."""


def stopping(aim: Aim) -> Talk:
    """^C, then T for all motors."""
    return power_off(aim)


def power_off(aim: Aim, prefix: str = "") -> Talk:
    """^C, which stops all motors, then T for the motors of `prefix` ("" = all)."""
    settings = aim.settings
    abort = Step("^C: end the movement or the RealTime loop", ABORT, moves=True)
    came: Pieces = []
    for count in range(1 + SWALLOWED):
        seconds = LAST if count == SWALLOWED else BETWEEN if count else max(FIRST, settings.timeout or 0.0)
        came += yield Say(abort, seconds, partial(_prompt_in, tuple(came)))
        if has_prompt(b"".join(came)):
            break
    command = f"{prefix}T"
    step = Step(f"{command}: motor power off", encode(command), moves=True)
    pieces = yield Say(step, settings.timeout or POWER_OFF, lambda pieces: _answer(command, pieces))
    answer = _answer(command, pieces)
    if answer is None:
        return _unanswered(command, came, pieces)
    ended = "^C was answered with a prompt" if has_prompt(b"".join(came)) else "^C was not answered"
    if answer.lines or answer.status & ~HARMLESS:
        told = f"{answer.status} ({explain_status(answer.status)})" if answer.status else repr(answer.lines[0])
        text = f"{ended}; {command} was answered with {told}: the motors may still have power"
        refused = DeviceRefused if answer.status else ProtocolError
        return Stopped(text, "if they must not, switch the supply off", refused)
    status = f" (status {answer.status}: {explain_status(answer.status)})" if answer.status else ""
    return Stopped(
        f"{ended}; {command} was acknowledged{status}: motor power is off", evidence=f"{command} was answered{status}"
    )


def _prompt_in(before: tuple[bytes, ...], pieces: Pieces) -> bool:
    return has_prompt(b"".join([*before, *pieces]))


def _unanswered(command: str, came: Pieces, pieces: Pieces) -> Stopped:
    hint = "switch the supply off if it still moves; --baud N when the hand's speed is another"
    seen = b"".join([*came, *pieces])
    if not seen:
        return Stopped(f"^C and {command} were sent; nothing answered", hint, NoAnswer)
    shown = seen[-24:].hex(" ").upper()
    return Stopped(f"^C and {command} were sent; no prompt came, but {shown}", hint, ProtocolError)


def _answer(command: str, pieces: Pieces) -> Answer | None:
    decoder = Decoder(command)
    decoder.feed(b"".join(pieces))
    try:
        return decoder.next()
    except ProtocolError:
        return None
