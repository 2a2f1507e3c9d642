"""The stop of a BarrettHand: ^C ends a movement or the RealTime loop, T takes the power from the motors (barrett §5.5, §5.2.1).

It begins at the speed of the port: the one in use, the one that was given, or the one at which the hand was found last.
A hand that does not answer there may have another one: the others are tried, as far as nothing that is sent could be the
trigger of a boot monitor at 9600 (dossier 1.5; the bytes of each speed are held against that in the tests). A control
block that was cut off may still swallow up to eight bytes: without a prompt ^C is repeated, before any other speed is
tried, since at a wrong speed the rest of that block would be made up.
"""

from __future__ import annotations

import re
from collections.abc import Generator, Sequence
from contextlib import suppress
from functools import partial
from itertools import product
from typing import NamedTuple

from handctl.devices.barrett.gcl.codec import BANNER, MOTORS, PROMPT, Answer, Decoder, encode, has_prompt, values
from handctl.devices.barrett.gcl.connect_table import RESTARTED_TEXT, SAFE_ABORT, abort_at
from handctl.devices.barrett.gcl.status_codes import ABORTED, explain_status
from handctl.devices.barrett.parameter_map import SPEEDS, with_sign
from handctl.errors import DeviceRefused, NoAnswer, ProtocolError
from handctl.model.param import Step
from handctl.model.stop_check import check_standing
from handctl.model.stop_sequence import (
    Pieces,
    Read,
    StopContext,
    Stopped,
    StopSequence,
    StopStep,
    once_more,
    sent_again,
    silence,
)

FIRST, BETWEEN, LAST = 0.15, 0.02, 0.5
"""Seconds for the prompt behind the first ^C, behind the next ones, and behind the last: a movement needs time to end."""
SWALLOWED = 8
POWER_OFF, BRIEF, TRIES = 1.0, 0.3, 3
"""Seconds for the answer to T: at the end, and before the other speeds are tried."""
HARMLESS = 1 | 4 | ABORTED
"""Statuses with which T works: a motor was never initialized (printed as 1 in §5.2.1), ^C was received."""
CTRL_C_KEEPS_POWER = True
"""Ctrl-C in a movement sends ^C and no T: the motors that HOLD keeps powered hold what the hand has gripped (barrett §5.5)."""
NOISE = 5
"""Counts between two readings at rest. The slowest velocity, 1/16 count per sample, goes 70 in the time between them."""
OFF = "switch the power supply off if the hand is still moving"


class StopAttempt(NamedTuple):
    """The attempt at one baud rate (None if the link has none), and its reply."""

    speed: int | None
    answer: Answer | None
    ended: bool
    seen: bytes
    sent: str


def power_off(context: StopContext, prefix: str = "") -> StopSequence:
    """The stop of the motors of `prefix` ("" = all), sent once more where the hand goes on behind it."""
    return once_more(partial(stop_steps, prefix=prefix), context)


def stop_steps(context: StopContext, prefix: str = "") -> StopSequence:
    """^C, which stops all motors, then T for the motors of `prefix` ("" = all); data after a silence shows another program.

    Where the motors are to stay `powered`, T goes out only when ^C brings no prompt, or a motor is not seen standing
    still after it.
    """
    stopped, turns = yield from _power_off(context, prefix)
    if stopped.error is not None:
        return stopped
    look = _Look([turn.speed for turn in reversed(turns)], context)
    looked, places = yield from look.standing(stopped)
    if looked.error is not None:
        if not context.powered:
            return looked
        off = yield from stop_steps(context._replace(powered=False), prefix)
        return sent_again(looked, off) if looked.goes_on else off._replace(text=f"{looked.text}. {off.text}")
    powered = turns[-1].answer is None
    if powered and BANNER in turns[0].seen.upper():
        text = RESTARTED_TEXT
    else:
        text = f"{_ended_by(turns[0].seen)}. {look.held}" if powered else stopped.text
    at = ", ".join(f"{motor} {place}" for motor, place in zip(MOTORS, places, strict=True))
    return stopped._replace(text=f"{text}. Positions: {at}")


def stands(context: StopContext, stopped: Stopped) -> StopSequence:
    """`stopped`, once the hand, at its prompt, was seen to stand still: whoever has ended a movement in another way than by `stop_steps`."""
    looked, _ = yield from _Look([context.speed], context).standing(stopped)
    return looked


def _unasked(heard: Pieces) -> str:
    """What the hand said by itself; late prompts are answers to what was sent here."""
    said = b"".join(heard).strip(b"=> \r\n")
    return f"the hand sent {said[:24].hex(' ').upper()}, which this command did not request" if said else ""


class _Look:
    """Reads the positions of a hand that is at its prompt, and with `hold` which motors HOLD keeps powered."""

    def __init__(self, speeds: Sequence[int | None], context: StopContext) -> None:
        self._speeds = tuple(dict.fromkeys(speeds))
        self._slow = context.settings.timeout or POWER_OFF
        self._sign = context.settings.own.get("position_sign", "")
        self._names = ("P HOLD", "P") if context.powered else ("P", "P")
        self._hold: list[int] = []
        self._came = b""

    def places(self) -> Read:
        """One reading, in two attempts; an acknowledgement that was late came from the baud rate that was tried before."""
        self._came = b""
        for speed, names in product(self._speeds, self._names):
            command = f"FGET {names}"
            step = Step("read the positions", encode(command))
            enough = partial(_read, command)
            came = yield StopStep(step, self._slow, enough, reads=True, baud=speed, size=64)
            self._came += b"".join(came)
            answer = _read(command, came)
            with suppress(ProtocolError):
                if answer is not None and not answer.status:
                    places, *more = values(answer, len(names.split()), len(MOTORS))
                    self._hold = more[0] if more else []
                    self._speeds = (speed,)
                    return [with_sign(index, place, self._sign) for index, place in enumerate(places)]
        return None

    def standing(self, stopped: Stopped) -> Generator[StopStep, Pieces, tuple[Stopped, list[int]]]:
        """See `check_standing`; a hand that did reply, and not as it should, is no silent one."""
        looked, places = yield from check_standing(stopped, self.places, NOISE, strange=_unasked)
        if looked.error is NoAnswer and self._came:
            text = f"{stopped.text}. Its positions could not be read ({_shown(self._came)}), so it is not known whether it is still moving"
            looked = looked._replace(text=text, error=ProtocolError)
        return looked, places

    @property
    def held(self) -> str:
        """Which motors have power after ^C, by the manual (barrett §5.5 case 4)."""
        on = [motor for motor, hold in zip(MOTORS, self._hold, strict=False) if hold]
        off = [motor for motor in MOTORS if motor not in on]
        if not self._hold:
            return "Motors whose HOLD is 1 keep their power (barrett §5.5)"
        kept = f"HOLD keeps {', '.join(on)} powered" if on else "HOLD keeps no motor powered"
        return f"{kept}, and {', '.join(off)} should be off (barrett §5.5)" if off and on else f"{kept} (barrett §5.5)"


def _shown(came: bytes) -> str:
    return came[-24:].hex(" ").upper()


def _power_off(context: StopContext, prefix: str) -> Generator[StopStep, Pieces, tuple[Stopped, list[StopAttempt]]]:
    command = f"{prefix}T"
    slow = context.settings.timeout or 0.0
    others = (
        [speed for speed in SPEEDS if speed != context.speed] if context.speed is not None and not context.fixed else []
    )
    last, brief = (BETWEEN, BRIEF) if others else (LAST, POWER_OFF)
    waits = (FIRST, *[BETWEEN] * (SWALLOWED - 1), last)
    turns = [(yield from _at(context.speed, prefix, waits, brief, slow, powered=context.powered))]
    if context.powered and turns[0].ended:
        return Stopped("^C was acknowledged"), turns
    for speed in others:
        if turns[-1].answer is None:
            turns.append((yield from _at(speed, prefix, (FIRST,), BRIEF, slow)))
    there = others or context.proven or turns[-1].seen
    if there and turns[-1].answer is None:  # a slow line, or what took long to end: a movement, a save
        turns.append((yield from _at(context.speed, prefix, (BETWEEN, LAST), POWER_OFF, slow)))
    return _ending(command, turns), turns


def _at(
    speed: int | None, prefix: str, waits: Sequence[float], power: float, slow: float, *, powered: bool = False
) -> Generator[StopStep, Pieces, StopAttempt]:
    """One speed: ^C once for each of `waits`, the seconds for its prompt, then T. `slow` is what a slow line needs.

    Where ^C went out once and nothing came, T goes out neither: nobody is there.
    """
    where = f" at {speed} bit/s" if speed is not None else ""
    data = abort_at(speed)
    abort = Step(f"^C{where}: end the movement or the RealTime loop", data, moves=True)
    came: Pieces = []
    for count, seconds in enumerate(waits):
        size = 8 if seconds == BETWEEN else 32  # a prompt alone, or the rest of an answer before it
        wait = max(seconds, slow) if count == 0 else seconds
        came += yield StopStep(abort, wait, partial(_prompt_in, tuple(came)), baud=speed, size=size)
        if has_prompt(b"".join(came)):
            break
    ended = has_prompt(b"".join(came))
    command = f"{prefix}T"
    risky = bool(prefix) and data == SAFE_ABORT  # three digits before T may be the trigger to a boot monitor
    nobody = not ended and (risky or (len(waits) == 1 and not came))
    if nobody or (ended and powered):
        return StopAttempt(speed, None, ended, b"".join(came), f"^C{where}")
    step = Step(f"{command}{where}: motor power off", encode(command), moves=True)
    tries = TRIES if ended else 1  # it is there: T goes out again until it is answered
    seconds = slow or (POWER_OFF if ended else power) / tries
    pieces: Pieces = []
    answer: Answer | None = None
    count = 0
    while count < (tries if answer is None else TRIES):
        if answer is not None:  # it is there, and refused: it may obey a moment later
            came, pieces = [*came, *pieces], list((yield from silence()))
        pieces += yield StopStep(step, seconds, partial(_answer, command, tuple(pieces)), baud=speed)
        count += 1
        if (now := _answer(command, (), pieces)) is not None:
            answer = now
            if not _refusal(now):
                break
    return StopAttempt(speed, answer, ended, b"".join([*came, *pieces]), f"^C and {command}{where}")


def _ending(command: str, turns: list[StopAttempt]) -> Stopped:
    """What the turns say together; only the last one can have been answered."""
    last = turns[-1]
    answer = last.answer
    if answer is None:
        return _unanswered(command, turns)
    at = f" at {last.speed} bit/s" if last.speed is not None else ""
    before = f"no reply at {turns[0].speed} bit/s. " if last.speed != turns[0].speed else ""
    ended = f"{before}^C{at} brought a prompt" if last.ended else f"{before}^C{at} had no reply"
    if _refusal(answer):
        told = f"{answer.status} ({explain_status(answer.status)})" if answer.status else repr(answer.lines[0])
        text = f"{ended}. The reply to {command} was {told}, so the motors may still have power"
        refused = DeviceRefused if answer.status else ProtocolError
        return Stopped(text, "to be sure, switch the power supply off", refused)
    status = f" (status {answer.status}: {explain_status(answer.status)})" if answer.status else ""
    text = f"{ended}. {command} was acknowledged{status}: motor power is off"
    return Stopped(text, evidence=f"{command} was acknowledged{at}{status}" if len(turns) == 1 or status else "")


def _refusal(answer: Answer) -> bool:
    return bool(answer.lines or answer.status & ~HARMLESS)


def _unanswered(command: str, turns: list[StopAttempt]) -> Stopped:
    sent = ", ".join(dict.fromkeys(turn.sent for turn in turns))
    seen = next((turn.seen for turn in turns if turn.seen), b"")
    if not seen:
        return Stopped(f"{sent} was sent, but nothing replied", OFF, NoAnswer)
    came = f"came, but no valid reply to {command}" if PROMPT in seen else "did not come"
    return Stopped(f"{sent} was sent. A prompt {came}, received {_shown(seen)}", OFF, ProtocolError)


def _ended_by(seen: bytes) -> str:
    """How what ran has ended at ^C, in words: it may have ended before, or have been no movement."""
    status = next((int(number) for number in re.findall(rb"ERR (\d{1,5})", seen)), 0)
    told = f"(status {status}: {explain_status(status)})"
    return f"^C stopped the hand {told}" if status & ABORTED else f"the hand is at its prompt again after ^C {told}"


def _prompt_in(before: tuple[bytes, ...], pieces: Pieces) -> bool:
    return has_prompt(b"".join([*before, *pieces]))


def _answer(command: str, before: tuple[bytes, ...], pieces: Pieces) -> Answer | None:
    decoder = Decoder(command)
    decoder.feed(b"".join([*before, *pieces]))
    return decoder.next()


def _read(command: str, pieces: Pieces) -> Answer | None:
    """The answer to a query: a prompt right behind its echo is a late one, of a ^C before it."""
    decoder = Decoder(command)
    decoder.feed(b"".join(pieces))
    while (answer := decoder.next()) is not None and not (answer.lines or answer.status):
        decoder.drop_prompt()
    return answer
