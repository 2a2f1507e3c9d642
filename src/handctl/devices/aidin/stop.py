"""Commands as bytes, and the way to stop: mode 3, motor power off (aidin, Modes: stop).

Mode and data always travel in one object. Ctrl-C during anything that moves sends the stop mode.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager

from handctl.devices.aidin.device import AidinHand
from handctl.devices.aidin.map import Mode
from handctl.devices.aidin.messages import Out, encode
from handctl.errors import HandctlError, Left, LinkError
from handctl.model.guide import Guide
from handctl.model.param import Step
from handctl.model.stopping import Stopped, interrupted, leaving

AGAIN = 1.0
"""Seconds in which a connection that was lost is opened again, all tries together."""
TRY = 0.05
"""Seconds from one try to the next."""
UNTOLD = "the connection is lost, so stop cannot be sent. Switch the hand's power off if it still moves"
MENDS = "the connection was lost. This command is reconnecting and will send the stop itself"
MENDED = "the connection was lost. handctl reconnected"


def object_of(mode: Mode, **data: Out) -> bytes:
    """The object of one command, without its terminator."""
    return encode({"hand_mode": int(mode), **data})


def step_of(meaning: str, data: bytes, end: bytes) -> Step:
    """A command for --dry-run: what it does with the object in words, and its bytes with their terminator."""
    return Step(f"{meaning}: {data.decode()}", data + end, moves=True)


def stop_after(hand: AidinHand, exc: HandctlError) -> None:
    """What was driving the fingers has failed: the hand is stopped, and the error tells what became of it.

    Of a link that is lost `stopped_if_cut_short` tells.
    """
    if not isinstance(exc, LinkError):
        stopped = hand.stop()
        exc.leaves(Left(behind=_told(stopped), moving=stopped.error is LinkError))


def _told(stopped: Stopped) -> str:
    return f"{stopped.text}: {stopped.hint}" if stopped.error is not None and stopped.hint else stopped.text


def in_force(what: str, *, moving: bool = True) -> AbstractContextManager[None]:
    """Around objects that stay in force: an error in between says `what` the hand has got.

    Ctrl-C does so where nothing is `moving`, so that nothing is stopped.
    """
    return leaving(Left(hint=what), by=HandctlError, interrupt=not moving)


@contextmanager
def stopped_if_cut_short(hand: AidinHand, guide: Guide, what: str = "", *, beat: float = 0.0) -> Iterator[None]:
    """Around whatever moves: Ctrl-C, and anything that nobody expected, stops the hand before a word is said.

    The death of this process stops it, too. Where the link was lost it is opened again for that, whatever was to be kept
    up: nobody sees the hand any more.
    """
    driven = False
    try:
        with hand.driven(guide, beat=beat, what=what):
            hand.journal.moves(hand.stop)
            driven = True
            try:
                yield
            except HandctlError:
                raise  # who raised it has decided what becomes of the fingers
            except Exception:
                with guide.undisturbed():
                    hand.stop()
                raise
    except HandctlError as exc:  # the child that guarded the old connection has gone, and with it the last to hold that
        lost, pressed = isinstance(exc, LinkError), isinstance(exc.__cause__, KeyboardInterrupt)
        if not driven or not (lost or exc.left.moving):
            raise
        stopped, told = _stop_again(hand, guide, presses=0 if pressed else 1)
        if stopped is None:
            exc.hint = "; ".join(filter(None, (exc.hint, UNTOLD if lost else "", told)))
        elif pressed:  # what was said before it was stopped is no longer so
            raise interrupted(stopped._replace(text=f"{MENDED}: {stopped.text}"), what) from exc
        else:
            exc.hint = f"{MENDED}: {_told(stopped)}"
        raise


def _stop_again(hand: AidinHand, guide: Guide, presses: int) -> tuple[Stopped | None, str]:
    """Open a lost connection again and stop the hand: what came of it, or None and why it could not be opened.

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
                        return None, ""
                except LinkError as exc:
                    told = f"tried to reconnect for {AGAIN:g} s ({exc.text})"
                else:
                    stopped = hand.stop()
                    if stopped.error is not LinkError:
                        return stopped, ""
                    told = f"tried to reconnect for {AGAIN:g} s ({stopped.text})"
                if end.expired:
                    return None, told
                hand.link.sleep(min(TRY, end.remaining))
    except KeyboardInterrupt:
        return None, "interrupted while reconnecting to send the stop"
    finally:
        guide.unstoppable = before
