"""Commands as bytes, and the way to stop: mode 3, motor power off (aidin, Modes: stop).

Mode and data always travel in one object. Ctrl-C during anything that moves sends the stop mode.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, suppress

from handctl.devices.aidin.device import AidinHand
from handctl.devices.aidin.exchange import PERIOD
from handctl.devices.aidin.feedback import Feedback, Wire
from handctl.devices.aidin.map import AIDIN, Mode
from handctl.devices.aidin.messages import Out, encode
from handctl.devices.aidin.stopper import TIMES as STOPS
from handctl.devices.aidin.stopper import flow
from handctl.errors import HandctlError, Interrupted, Left, LinkError
from handctl.link.deadman import Shot, guarding
from handctl.model.guide import Guide
from handctl.model.leaving import leaving, stopped_by_ctrl_c
from handctl.model.param import Step

AGAIN = 1.0
"""Seconds in which a connection that was lost is opened again, all tries together."""
TRY = 0.05
"""Seconds from one try to the next."""
UNTOLD = "the connection is lost, stop cannot be sent: switch the hand's power off if it still moves"
MENDS = "the connection was lost. This command is opening it again and sends the stop itself"
MENDED = f"the connection was lost. Connected again and sent the stop mode {STOPS} times"
CURRENT_STATE = AIDIN["current_state"]


def object_of(mode: Mode, **data: Out) -> bytes:
    """The object of one command, without its terminator."""
    return encode({"hand_mode": int(mode), **data})


def step_of(meaning: str, data: bytes, end: bytes) -> Step:
    """A command for --dry-run: what it does with the object in words, and its bytes with their terminator."""
    return Step(f"{meaning}: {data.decode()}", data + end, moves=True)


def told_currents(feedback: Feedback) -> Wire | None:
    """The currents that were told, None where they were not, or wrong."""
    return None if CURRENT_STATE.key in feedback.errors else feedback.values.get(CURRENT_STATE.key)


def send_stop(hand: AidinHand) -> None:
    """The stop mode, three times, whatever the hand says meanwhile; what it said is in `talk.feedback`. Raises LinkError."""
    hand.talk.feedback = Feedback()
    for _ in range(STOPS):
        hand.talk.send(object_of(Mode.STOP))
        hand.link.sleep(PERIOD)
    with suppress(HandctlError):
        hand.talk.drain()


def halt(hand: AidinHand) -> Left:
    """The stop mode, now; what is known of it, and no more."""
    try:
        send_stop(hand)
    except HandctlError as exc:
        return Left(f"stop could not be sent ({exc.text}): switch the hand's power off if it still moves", moving=True)
    except KeyboardInterrupt:
        return Left("interrupted again while stop was sent: switch the hand's power off if it still moves")
    return Left(_seen(hand, f"stop was sent {STOPS} times"))


def _seen(hand: AidinHand, sent: str) -> str:
    """What was sent, and what the hand has told since."""
    told = told_currents(hand.talk.feedback)
    if told is None:
        seen = "the hand did not confirm it: watch it"
    elif flow(told):
        seen = f"currents up to {max(map(abs, told))} still flowed: watch it"
    else:
        seen = "no current flows"
    return f"{sent}, {seen}. Without power the fingers move freely and a held object falls"


def stop_after(hand: AidinHand, exc: HandctlError) -> None:
    """What was driving the fingers has failed: stop is sent, and the error tells what became of them.

    Of a link that is lost `stopped_if_cut_short` tells.
    """
    if not isinstance(exc, LinkError):
        left = halt(hand)
        exc.leaves(Left(behind=left.text, moving=left.moving))


def in_force(what: str, *, moving: bool = True) -> AbstractContextManager[None]:
    """Around objects that stay in force: an error in between says `what` the hand has got.

    Ctrl-C does so where nothing is `moving`, so that nothing is stopped.
    """
    return leaving(Left(hint=what), by=HandctlError, interrupt=not moving)


@contextmanager
def stopped_if_cut_short(hand: AidinHand, guide: Guide, what: str = "") -> Iterator[None]:
    """Around whatever moves: Ctrl-C, and anything that nobody expected, stops the hand before a word is said.

    The death of this process stops it, too. An object that was half sent is completed first. Where the link was lost it
    is opened again for that, whatever was to be kept up: nobody sees the hand any more.
    """
    shot, driven = Shot(object_of(Mode.STOP) + hand.talk.way.end, PERIOD), False
    try:
        with guarding(hand.link, [shot] * STOPS, hand.journal.warn), _halting(hand, guide, what):
            driven = True
            yield
    except HandctlError as exc:  # the child that guarded the old connection has gone, and with it the last to hold that
        lost = isinstance(exc, LinkError)
        if not driven or not (lost or exc.left.moving):
            raise
        done, told = _stop_again(hand, guide, presses=0 if isinstance(exc, Interrupted) else 1)
        if not done:
            exc.hint = "; ".join(filter(None, (exc.hint, UNTOLD if lost else "", told)))
        elif isinstance(exc, Interrupted):  # what was said before it was stopped is no longer so
            exc.left = Left(what + told)
        else:
            exc.hint = told
        raise


def _stop_again(hand: AidinHand, guide: Guide, presses: int) -> tuple[bool, str]:
    """Open a lost connection again and send the stop: whether it went out, and what is known of it.

    So many `presses` of Ctrl-C are passed over, for they ask for what is being done; one more ends it.
    """
    end, before = hand.link.deadline(AGAIN), guide.unstoppable
    guide.unstoppable = MENDS
    try:
        with guide.counting() as counted:
            counted.most = presses
            while True:
                try:
                    if not hand.talk.reconnect(end.remaining):
                        return False, ""
                    send_stop(hand)
                    return True, _seen(hand, MENDED)
                except LinkError as exc:
                    if end.expired:
                        return False, f"tried to connect again for {AGAIN:g} s ({exc.text})"
                    hand.link.sleep(min(TRY, end.remaining))
    except KeyboardInterrupt:
        return False, "interrupted while it was connecting again to send the stop"
    finally:
        guide.unstoppable = before


@contextmanager
def _halting(hand: AidinHand, guide: Guide, what: str) -> Iterator[None]:
    def stop() -> Left:
        left = halt(hand)
        return Left(what + left.text, moving=left.moving)

    hand.journal.moves(stop)
    try:
        with stopped_by_ctrl_c(stop, guide):
            yield
    except HandctlError:
        raise  # who raised it has decided what becomes of the fingers
    except Exception:
        with guide.undisturbed():
            halt(hand)
        raise
