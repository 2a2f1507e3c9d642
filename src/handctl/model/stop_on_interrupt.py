"""Ctrl-C or a lost link in the middle of a movement: stop the device, and report what is left behind. Knows no device."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

from handctl.errors import STOPPED, Aftermath, DeviceRefused, HandctlError, Interrupted, LinkError, NoAnswer, joined
from handctl.model.stop_sequence import Stopped

if TYPE_CHECKING:
    from handctl.model.prompts import Prompts


NOT_STOPPED = "not-stopped"
"""Code of the error of a command that was interrupted, and whose stop was not acknowledged."""


def ended_by_interrupt(error: HandctlError) -> bool:
    """Whether this is the end of a command that was interrupted, however its stop ended."""
    return error.exit_code == 130 or error.code == NOT_STOPPED


def interrupt_error(stopped: Stopped, what: str = "") -> HandctlError:
    """The end of a command that Ctrl-C has ended: exit code 130 only where the stop was acknowledged."""
    text = f"{what}{stopped.text}"
    if stopped.error is None:
        return Interrupted(left=Aftermath(text, stopped.hint))
    return stopped.error(
        f"interrupted, but the stop has not been confirmed: {text}", hint=stopped.hint, code=NOT_STOPPED
    )


STOPPED_IT = "handctl has stopped it"
STOPPED_EARLIER = "handctl has stopped what earlier commands had set in motion"
INTERRUPTED_AGAIN = Stopped(
    "interrupted again while stopping the device", "switch the power off if the device is still moving", NoAnswer
)


class WriteCounter(Protocol):
    """The counters of a journal."""

    writes: int


@contextmanager
def on_early_end(
    left: Aftermath,
    *,
    since: WriteCounter | None = None,
    by: type[HandctlError] = LinkError,
    interrupt: bool = True,
) -> Iterator[None]:
    """Around steps that are not undone when they end early: add what is `left` to errors of the kind `by` and to Ctrl-C.

    With `since`, the counters of the journal, only once a write was sent in here. Without `interrupt` somebody else
    answers to Ctrl-C. Raises Interrupted.
    """
    before = since.writes if since is not None else 0
    try:
        yield
    except KeyboardInterrupt as exc:
        if not interrupt or (since is not None and since.writes == before):
            raise
        told = left if left.text else Aftermath(left.hint)  # there is no other text to stand behind
        raise Interrupted(left=told) from exc
    except by as exc:
        if since is None or since.writes > before:
            exc.add_aftermath(left)
        raise


@contextmanager
def no_stop_ends_it(left: Aftermath, prompts: Prompts, since: WriteCounter) -> Iterator[None]:
    """Around what no command stops once it was written, such as a calibration: it is `left` behind when this ends early.

    Neither Ctrl-C nor a stop that another process asks for is a success meanwhile. Raises DeviceRefused for Ctrl-C.
    """
    before = since.writes
    prompts.goes_on = lambda: left if since.writes > before else None
    try:
        with on_early_end(left, since=since, interrupt=False):
            yield
    except KeyboardInterrupt as exc:
        if since.writes == before:
            raise
        raise DeviceRefused(f"interrupted, but {left.text}", hint=left.hint, code=NOT_STOPPED) from exc
    finally:
        del prompts.goes_on


@contextmanager
def stopped_by_ctrl_c(stop: Callable[[], Stopped], prompts: Prompts, what: str = "") -> Iterator[None]:
    """Around a movement: Ctrl-C stops it, without being interrupted, and reports the result. Raises Interrupted.

    Where the stop was not acknowledged, what speaks against it is raised instead.
    """
    try:
        yield
    except KeyboardInterrupt as exc:
        raise stop_without_interrupts(stop, prompts, what) from exc


@contextmanager
def stopped_by_error(
    stop: Callable[[], Stopped], prompts: Prompts, since: WriteCounter, who: str = "The device"
) -> Iterator[None]:
    """Around a movement that is watched: an error stops it as Ctrl-C does, for nobody watches it afterwards, and tells the result.

    A device that does not obey that, as one that moves on, is worse than the error, and raised in its place.

    Not where nothing was written in here, or the one write was refused: then nothing was set going.
    """
    before = since.writes
    try:
        yield
    except HandctlError as exc:
        set_going = since.writes - before - isinstance(exc, DeviceRefused)
        if set_going > 0 and not ended_by_interrupt(exc) and exc.code != STOPPED:
            with prompts.stopping():
                prompts.done()
                try:
                    stopped = stop()
                except KeyboardInterrupt:
                    stopped = INTERRUPTED_AGAIN
            if exc.left.moving:
                exc.left = Aftermath()
            if stopped.error is DeviceRefused:
                raise DeviceRefused(joined(exc.text, stopped.text), hint=stopped.hint, code=NOT_STOPPED) from exc
            said = f"{who} may still move, because the stop has not been confirmed" if stopped.error else STOPPED_IT
            if stopped.text not in exc.text:  # as where the link is still lost
                said = f"{said}: {stopped.text}"
            exc.add_aftermath(Aftermath(said, stopped.hint, moving=stopped.error is not None))
        raise


def stop_without_interrupts(stop: Callable[[], Stopped], prompts: Prompts, what: str = "") -> HandctlError:
    """Stop the movement without being interrupted; returns the error that ends the command."""
    with prompts.stopping():
        prompts.done()
        try:
            return interrupt_error(stop(), what)
        except KeyboardInterrupt:
            return interrupt_error(INTERRUPTED_AGAIN, what)
