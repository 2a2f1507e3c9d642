"""What is left behind when something ends in the middle is told by whatever ended it: one way for every family."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from handctl.errors import HandctlError, Interrupted, Left, LinkError, NoAnswer
from handctl.model.stopping import Stopped, interrupted

if TYPE_CHECKING:
    from handctl.model.guide import Guide
    from handctl.model.result import Counters


AGAIN = Stopped(
    "interrupted again while stopping the device", "switch the power off if the device still moves", NoAnswer
)


@contextmanager
def leaving(
    left: Left,
    *,
    since: Counters | None = None,
    by: type[HandctlError] = LinkError,
    interrupt: bool = True,
) -> Iterator[None]:
    """Around what is not undone when it ends early: errors of the kind `by` tell what is `left`, and so does Ctrl-C.

    With `since`, the counters of the journal, only once a write was sent in here. Without `interrupt` somebody else
    answers to Ctrl-C. Raises Interrupted.
    """
    before = since.writes if since is not None else 0
    try:
        yield
    except KeyboardInterrupt as exc:
        if not interrupt or (since is not None and since.writes == before):
            raise
        told = left if left.text else Left(left.hint)  # there is no other text to stand behind
        raise Interrupted("interrupted", left=told) from exc
    except by as exc:
        if since is None or since.writes > before:
            exc.leaves(left)
        raise


@contextmanager
def stopped_by_ctrl_c(stop: Callable[[], Stopped], guide: Guide, what: str = "") -> Iterator[None]:
    """Around what moves: Ctrl-C stops it, undisturbed, and then tells `what` became of it. Raises Interrupted.

    Where the stop was not acknowledged, what speaks against it is raised instead.
    """
    try:
        yield
    except KeyboardInterrupt as exc:
        raise stopped(stop, guide, what) from exc


def stopped(stop: Callable[[], Stopped], guide: Guide, what: str = "") -> HandctlError:
    """Stop what moves, undisturbed; the end of the command, with what became of it."""
    with guide.undisturbed():
        guide.done()
        try:
            return interrupted(stop(), what)
        except KeyboardInterrupt:
            return interrupted(AGAIN, what)
