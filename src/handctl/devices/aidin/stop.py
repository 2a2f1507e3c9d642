"""Commands as bytes, and the way to stop: mode 3, motor power off (aidin, Modes: stop).

Mode and data always travel in one object. Ctrl-C during anything that moves sends the stop mode.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from handctl.devices.aidin.exchange import PERIOD
from handctl.devices.aidin.feedback import Feedback, Wire
from handctl.devices.aidin.fields import AIDIN, Mode
from handctl.devices.aidin.hand import AidinHand, reading
from handctl.devices.aidin.messages import Out, encode
from handctl.errors import CheckFailed, HandctlError, Interrupted, LinkError
from handctl.guide import Guide
from handctl.link.deadman import Shot, guarding
from handctl.param import Step, elements_of
from handctl.result import Table

STOPS = 3
CONFIRM = 1.2
"""Seconds for the currents to vanish; also a slow stream has spoken by then."""
NO_CURRENT = 20
"""2 % of 1000."""
CURRENT_STATE = AIDIN["current_state"]


def object_of(mode: Mode, **data: Out) -> bytes:
    """The object of one command, without its terminator."""
    return encode({"hand_mode": int(mode), **data})


def step_of(meaning: str, data: bytes, end: bytes) -> Step:
    """A command for --dry-run: what it does with the object in words, and its bytes with their terminator."""
    return Step(f"{meaning}: {data.decode()}", data + end, moves=True)


def stop(hand: AidinHand, guide: Guide) -> Table:
    """Motor power off, at once: sent before anything else, repeated until the currents are near 0.

    Where no current was seen to vanish, a message says that feedback proves nothing.
    Raises NoAnswer when the hand says nothing, CheckFailed when currents stay. Damaged feedback, --deadline and Ctrl-C do
    not keep it from being sent.
    """
    with _halting(hand, guide, ""):
        try:
            told, flowed = _until_still(hand)
        except HandctlError as exc:
            raise stopped(hand, exc) from exc
    if told is None or _flow(told):
        raise _not_confirmed(hand, told)
    if not flowed:
        hand.journal.info(
            "idle",
            "stop was sent; no current was seen to vanish, because none flowed when the hand was heard first: "
            "feedback does not show that the motors are off",
            "if in doubt, switch the power off",
        )
    return hand.table([reading(element, told) for element in elements_of(CURRENT_STATE)])


def _until_still(hand: AidinHand) -> tuple[Wire | None, bool]:
    """Repeat the stop mode until no current flows, 1.2 s at most; the currents told last, and whether any was seen before."""
    talk, data, flowed = hand.talk, object_of(Mode.STOP), False
    for _ in range(STOPS):
        talk.tick(data, blind=True)
        flowed = flowed or _flow(_currents(talk.feedback))
    talk.feedback = Feedback()
    end = hand.link.deadline(CONFIRM)
    while (told := _currents(talk.feedback)) is None or _flow(told):
        flowed = flowed or _flow(told)
        if end.expired:
            break
        talk.tick(data, blind=True)
    return told, flowed


def _flow(told: Wire | None) -> bool:
    return told is not None and max(map(abs, told)) > NO_CURRENT


def _currents(feedback: Feedback) -> Wire | None:
    return None if CURRENT_STATE.key in feedback.errors else feedback.values.get(CURRENT_STATE.key)


def _not_confirmed(hand: AidinHand, told: Wire | None) -> HandctlError:
    hint = "watch the hand; switch its power off if it still moves"
    name, talk = hand.link.name, hand.talk
    if told is not None:
        text = f"{name}: stop was sent, but currents up to {max(map(abs, told))} flow"
        return CheckFailed(text, hint=hint, code="not-stopped")
    found = (
        talk.named(CURRENT_STATE, talk.feedback.result(CURRENT_STATE.key))
        if talk.feedback.seen
        else talk.nothing_came()
    )
    error = found if isinstance(found, HandctlError) else talk.nothing_came()
    text = f"stop was sent again and again for {CONFIRM:g} s and is not confirmed"
    return type(error)(f"{error.text}; {text}", hint=hint, code=error.code)


def send_stop(hand: AidinHand) -> None:
    """The stop mode, three times, whatever the hand says meanwhile; what it said is in `talk.feedback`. Raises LinkError."""
    hand.talk.feedback = Feedback()
    for _ in range(STOPS):
        hand.talk.send(object_of(Mode.STOP))
        hand.link.sleep(PERIOD)
    with suppress(HandctlError):
        hand.talk.drain()


def halt(hand: AidinHand) -> str:
    """The stop mode, now; what is known of it, and no more."""
    try:
        send_stop(hand)
    except HandctlError as exc:
        return f"stop could not be sent ({exc.text}): switch the hand's power off if it still moves"
    except KeyboardInterrupt:
        return "interrupted again while stop was sent: switch the hand's power off if it still moves"
    told = _currents(hand.talk.feedback)
    if told is None:
        seen = "the hand did not confirm it: watch it"
    elif _flow(told):
        seen = f"currents up to {max(map(abs, told))} still flowed: watch it"
    else:
        seen = "no current flows"
    return f"stop was sent {STOPS} times, {seen}; without power the fingers move freely and a held object falls"


def stopped(hand: AidinHand, exc: HandctlError) -> HandctlError:
    """The error of something that was driving the fingers, with what became of them: stop is sent."""
    lost = "the connection is lost, stop cannot be sent: switch the hand's power off if it still moves"
    told = lost if isinstance(exc, LinkError) else halt(hand)
    return type(exc)(exc.text, hint="; ".join(filter(None, (exc.hint, told))), code=exc.code)


@contextmanager
def telling(what: str) -> Iterator[None]:
    """Around objects that stay in force: an error in between says what the hand has got."""
    try:
        yield
    except HandctlError as exc:
        exc.hint = "; ".join(filter(None, (what, exc.hint)))
        raise


@contextmanager
def announced(what: str) -> Iterator[None]:
    """The same where nothing moves, so that nothing is stopped: after Ctrl-C, too."""
    try:
        with telling(what):
            yield
    except KeyboardInterrupt as exc:
        raise Interrupted(f"interrupted: {what}") from exc


@contextmanager
def stopping(hand: AidinHand, guide: Guide, what: str = "") -> Iterator[None]:
    """Around whatever moves: Ctrl-C, and anything that nobody expected, stops the hand before a word is said.

    The death of this process stops it, too. An object that was half sent is completed first.
    """
    shot = Shot(object_of(Mode.STOP) + hand.talk.way.end, PERIOD)
    with guarding(hand.link, [shot] * STOPS, hand.journal.warn), _halting(hand, guide, what):
        yield


@contextmanager
def _halting(hand: AidinHand, guide: Guide, what: str) -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt as exc:
        with guide.undisturbed():
            told = halt(hand)
        raise Interrupted(f"interrupted: {what}{told}") from exc
    except HandctlError:
        raise  # who raised it has decided what becomes of the fingers
    except Exception:
        with guide.undisturbed():
            halt(hand)
        raise
