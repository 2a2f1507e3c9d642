"""The stop of an AIDIN-hand: mode 3, motor power off, in poll as in stream (aidin, Modes: stop).

There is no acknowledge, and the feedback has no mode: only motors that stand and currents that are near 0 afterwards show
anything (dossier 3). Feedback that has frozen shows nothing at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from handctl.devices.aidin.exchange_settings import PERIOD
from handctl.devices.aidin.feedback_guard import NO_NOISE, OLD, Liveness
from handctl.devices.aidin.json_codec import TERMINATORS, Decoder, encode, numbers
from handctl.devices.aidin.parameter_map import CURRENTS, FEEDBACK, MOTOR_POS, Mode, moving
from handctl.errors import CheckFailed, NoAnswer, ProtocolError
from handctl.model.frame_decoder import frames_in
from handctl.model.param import Step
from handctl.model.stop_check import Looks
from handctl.model.stop_sequence import (
    LOOKS,
    Pieces,
    StopContext,
    Stopped,
    StopSequence,
    StopStep,
    did_not_last,
    not_seen_again,
    silence,
)
from handctl.wording import some

Counts = tuple[int, ...]

TIMES = 3
CONFIRM = 60
"""Periods in which the currents may vanish, 1.2 s: also a slow stream has spoken by then."""
NO_CURRENT = 20
"""2 % of 1000."""
FLOWED, ENDS, PAUSE = "flowed", "ends", "pause"
"""Keys of the context: the feedback before the stop showed a current, and it ends without a stop, as that of a movement to a
place does, so that its end shows nothing; what was seen of the noise of the sensors (see `Liveness.pause`)."""
UNCONFIRMED = "stop was sent repeatedly but is not confirmed"
HINT = "watch the hand, and switch its power off if it is still moving"


def stop_steps(context: StopContext) -> StopSequence:
    """Send the stop mode three times, then until the hand reports that no current flows; then check again after a silence.

    What it tells between two of our own objects shows nothing: somebody else may command currents 50 times a second. A motor
    that turns is not stopped, however low its current; and of a hand that repeats its last object nobody knows.
    """
    own = context.settings.own
    end = TERMINATORS[own.get("tx_terminator") or "newline"]
    data = encode({"hand_mode": Mode.STOP})
    action = StopStep(Step(f"motor power off: {data.decode()}", data + end, moves=True), PERIOD, lambda _pieces: False)
    told: Counts | None = None
    flowed, heard, spoke = bool(own.get(FLOWED)), False, False
    feedback, places = _Feedback(own.get(PAUSE)), list[Counts]()
    for count in range(TIMES + CONFIRM):
        pieces = yield action
        heard = heard or bool(pieces)
        currents, seen = feedback.take(pieces)
        places = seen or places
        for told in currents:
            flowed = flowed or flow(told)
        if count == TIMES - 1:
            spoke, heard, told = told is not None, False, None  # what it said until now may be older than the stop
        elif count >= TIMES and told is not None and not flow(told):
            break
    if not heard:
        since = "the hand has sent nothing since" if spoke else "the hand sends nothing"
        return Stopped(f"{UNCONFIRMED}: {since}", HINT, NoAnswer)
    looks: Looks | None = None
    stands: bool | None = None
    count = 0
    while stands is None or (feedback.live.silent and count < LOOKS):
        if count:
            places = feedback.take((yield action))[1] or places
        count += 1
        since_then, seen = feedback.take((yield from silence()))
        if not since_then and not seen:
            since_then, seen = feedback.take((yield action))
        places = [*places[-1:], *seen]
        if len(places) > 1:
            looks = looks or Looks(places[0], lambda before, now: not moving(before, now))
            stands = looks.judge(places[-1])
        elif not feedback.live.silent:
            break
    if feedback.live.silent:
        return Stopped(f"{UNCONFIRMED}: the feedback has frozen: {OLD}, so it is old", HINT, NoAnswer)
    going = moving(*looks.moved) if looks is not None and looks.moved is not None and stands is False else []
    return _judged(
        told, since_then, going, flowed and not own.get(ENDS), spoke, len(places) > 1, bool(feedback.live.changes)
    )


def _judged(
    told: Counts | None,
    since_then: list[Counts],
    going: list[int],
    flowed: bool,
    spoke: bool,
    stands: bool,
    lives: bool,
) -> Stopped:
    """The result, from the currents `told` behind the last stop and `since_then`, and the motors that are still `going`.

    flowed  a current that had nothing but the stop to end it
    spoke   the hand told its currents before
    stands  the positions were told as well
    lives   any value has changed since the stop was sent
    """
    if going:
        names = some([MOTOR_POS.elements[index] for index in going])
        stopped = did_not_last(Stopped("stop was sent"), f"{names} still {'moves' if len(going) == 1 else 'move'}")
        return stopped._replace(hint=f"{stopped.hint}. Without power a finger can also fall, or be moved by hand")
    if told is None:
        since = "the feedback since then" if spoke else "the feedback"
        text = f"{UNCONFIRMED}: {since} has no currents"
        return Stopped(text, HINT, ProtocolError)
    if flow(told):
        if not since_then or flow(since_then[-1]):
            return Stopped(f"stop was sent, but currents up to {_peak(told)} still flow", HINT, CheckFailed)
    elif any(map(flow, since_then)):
        peak = max(map(_peak, since_then))
        return did_not_last(Stopped("stop was sent, and the currents stopped"), f"currents up to {peak} flow again")
    if not since_then:
        return not_seen_again(Stopped("stop was sent, and the currents stopped"))
    if not stands:
        text = "stop was sent, and the currents stopped, but the feedback has no motor positions"
        return Stopped(f"{text}, so it is not known whether the hand is still moving", HINT, ProtocolError)
    if flowed:
        text = "stop was sent, and the currents stopped: the fingers move freely, and a held object falls"
        return Stopped(text, evidence="the currents stopped")
    none, doubt = f"no current is above {NO_CURRENT}", "if in doubt, switch the hand's power off"
    if not lives:
        text = f"stop was sent, and {none}. But since then {OLD}: {NO_NOISE}"
        return Stopped(
            f"{text}. So the feedback does not show that the motors are off, nor even that they stand", doubt
        )
    text = f"stop was sent, the motors are not moving, and {none}. It was not seen that the stop ended one"
    return Stopped(f"{text}, so the feedback does not show that the motors are off", doubt)


def flow(currents: Sequence[float]) -> bool:
    """Whether these currents are more than jitter."""
    return _peak(currents) > NO_CURRENT


def _peak(currents: Sequence[float]) -> float:
    return max(map(abs, currents))


class _Feedback:
    """What comes back during a stop."""

    def __init__(self, pause: int | None) -> None:
        self.live = Liveness(pause)
        self._decoder = Decoder()

    def take(self, pieces: Pieces) -> tuple[list[Counts], list[Counts]]:
        """The motor currents in the received data, in 0.1 %, and the encoders; damaged data is skipped."""
        self._decoder.feed(b"".join(pieces))
        found = list[Counts](), list[Counts]()
        for content in frames_in(self._decoder):
            told = {param.key: value for param in FEEDBACK if isinstance(value := content.get(param.key), list)}
            self.live.note(0.0, told)  # a stop has no clock: it counts objects
            for param, values in zip((CURRENTS.feedback, MOTOR_POS), found, strict=True):
                if param.key in content:
                    with suppress(ProtocolError):
                        values.append(tuple(int(one) for one in numbers(content[param.key], param.count)))
        return found
