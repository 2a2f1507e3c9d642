"""The stop of an AIDIN-hand: mode 3, motor power off, in poll as in stream (aidin, Modes: stop).

There is no acknowledge: only currents that are near 0 afterwards show anything (dossier 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from handctl.devices.aidin.exchange_settings import PERIOD
from handctl.devices.aidin.json_codec import TERMINATORS, Decoder, encode, numbers
from handctl.devices.aidin.parameter_map import AIDIN, Mode
from handctl.errors import CheckFailed, NoAnswer, ProtocolError
from handctl.model.frame_decoder import frames_in
from handctl.model.param import Step
from handctl.model.stop_sequence import Pieces, StopContext, Stopped, StopSequence, StopStep, did_not_last, silence

TIMES = 3
CONFIRM = 60
"""Periods in which the currents may vanish, 1.2 s: also a slow stream has spoken by then."""
NO_CURRENT = 20
"""2 % of 1000."""
FLOWED = "flowed"
"""Key of the context: the feedback before the stop showed a current."""
HINT = "watch the hand, and switch its power off if it still moves"


def stop_steps(context: StopContext) -> StopSequence:
    """Send the stop mode three times, then until the hand reports that no current flows; then check again after a silence.

    What it tells between two of our own objects shows nothing: somebody else may command currents 50 times a second.
    """
    end = TERMINATORS[context.settings.own.get("tx_terminator") or "newline"]
    data = encode({"hand_mode": Mode.STOP})
    action = StopStep(Step(f"motor power off: {data.decode()}", data + end, moves=True), PERIOD, lambda _pieces: False)
    told: tuple[int, ...] | None = None
    flowed, heard, spoke = bool(context.settings.own.get(FLOWED)), False, False
    decoder = Decoder()
    for count in range(TIMES + CONFIRM):
        pieces = yield action
        heard = heard or bool(pieces)
        for currents in _currents(decoder, pieces):
            told = currents
            flowed = flowed or flow(currents)
        if count == TIMES - 1:
            spoke, heard, told = told is not None, False, None  # what it said until now may be older than the stop
        elif count >= TIMES and told is not None and not flow(told):
            break
    falls = "the fingers move freely, and a held object falls"
    if told is None:
        text = "stop was sent repeatedly but is not confirmed: "
        since = (
            ("the feedback since then", "the hand has sent nothing since")
            if spoke
            else ("the feedback", "the hand sends nothing")
        )
        text += f"{since[0]} has no currents" if heard else since[1]
        return Stopped(text, HINT, ProtocolError if heard else NoAnswer)
    if flow(told):
        return Stopped(f"stop was sent, but currents up to {max(map(abs, told))} still flow", HINT, CheckFailed)
    since_then = _currents(decoder, (yield from silence())) or _currents(decoder, (yield action))
    if any(map(flow, since_then)):
        peak = max(max(map(abs, one)) for one in since_then)
        return did_not_last(Stopped("stop was sent, and the currents stopped"), f"currents up to {peak} flow again")
    if not flowed:
        text = "stop was sent, and no current flows. It was not seen whether any was flowing before, so the feedback "
        return Stopped(f"{text}does not show that the motors are off", "if in doubt, switch the hand's power off")
    if not since_then:
        return Stopped(f"stop was sent, and the currents stopped: {falls}. The hand has sent nothing since", HINT)
    return Stopped(f"stop was sent, and the currents stopped: {falls}", evidence="the currents stopped")


def flow(currents: Sequence[float]) -> bool:
    """Whether these currents are more than jitter."""
    return max(map(abs, currents)) > NO_CURRENT


def _currents(decoder: Decoder, pieces: Pieces) -> list[tuple[int, ...]]:
    """The motor currents in the received data, in 0.1 %; damaged data is skipped."""
    decoder.feed(b"".join(pieces))
    found: list[tuple[int, ...]] = []
    for content in frames_in(decoder):
        if "current_state" in content:
            with suppress(ProtocolError):
                found.append(tuple(int(one) for one in numbers(content["current_state"], AIDIN["current_state"].count)))
    return found
