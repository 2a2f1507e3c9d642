"""How often and for how long a step of a stop is sent again without an acknowledgement. Knows no device; sans I/O."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any, Generic, TypeVar

from handctl.errors import NoAnswer, ProtocolError
from handctl.fast_classes import fast_dataclass
from handctl.model.param import Step
from handctl.model.stop_sequence import Pieces, StopContext, Stopped, StopSequence, StopStep, silence

REPEAT_AFTER = 0.15
"""Seconds without an acknowledgement after which a step is sent again, unless --timeout says otherwise."""
REPEAT_FOR = 1.0
"""Seconds for which it is repeated."""

T = TypeVar("T")


def interval(context: StopContext) -> float:
    """Seconds after which a step without an acknowledgement is sent again."""
    return context.settings.timeout or REPEAT_AFTER


def attempts(context: StopContext) -> int:
    """How often a step is sent at most."""
    return max(2, round((context.within or REPEAT_FOR) / interval(context)))


class HoldTries:
    """How often a position is read anew and held: the hold is repeated for its second, and at least twice.

    On a slow line each hold waits longer for its reply (`behind`), so there are fewer: as many as on a quick one would take
    longer than whoever asked for the stop waits.
    """

    def __init__(self, context: StopContext) -> None:
        self._context = context
        self._count, self._left = 0, context.within or REPEAT_FOR

    def another(self) -> bool:
        """Whether there is one more."""
        self._count += 1
        return self._count <= 2 or (self._left > 0 and self._count <= attempts(self._context))

    def sent(self, before: StepResult[Any] | None) -> None:
        """A hold went out behind this step, or behind none that was repeated."""
        self._left -= patience(self._context, before)


@fast_dataclass(frozen=True)
class StepResult(Generic[T]):
    """The result of a repeated step.

    found    the reply, None = none
    came     all bytes received
    seconds  the longest time that the reply can have taken
    pending  how many repetitions have had no reply: on a slow line theirs are still to come, one after the other
    """

    found: T | None
    came: Pieces
    seconds: float
    pending: int = 0


def repeat_until_answered(
    context: StopContext,
    step: Step,
    found: Callable[[Pieces], T | None],
    *,
    final: Callable[[T], object] = lambda _: True,
    after: StepResult[Any] | None = None,
    reads: bool = False,
    ahead: bytes = b"",
) -> Generator[StopStep, Pieces, StepResult[T]]:
    """Send the step again until what is `found` in all that came since is `final`, or its time is over.

    A reply that is not final is a refusal, which may pass: a device that is busy obeys a moment later. The last one is the
    result then. `after` is the result of the step before.
    """
    came: Pieces = []
    what: T | None = None
    count = refused = 0
    while count < attempts(context if what is None else context._replace(within=REPEAT_FOR)):
        before, count = tuple(came), count + 1

        def enough(pieces: Pieces, before: Pieces = before) -> bool:  # type: ignore[assignment]
            told = found([*before, *pieces])
            return told is not None and bool(final(told))

        action = StopStep(step, interval(context), enough, reads, ahead=ahead)
        pieces = yield from behind(context, after if count == 1 else None, action)
        came += pieces
        what = found(came)
        if what is not None and final(what):
            break
        refused += found(pieces) is not None
    return StepResult(what, came, count * interval(context), max(0, count - 1 - refused))


def patience(context: StopContext, before: StepResult[Any] | None) -> float:
    """Seconds to wait for one reply behind this step: as late as that to a repetition."""
    return interval(context) + (before.seconds if before is not None and before.pending else 0.0)


def behind(
    context: StopContext, before: StepResult[Any] | None, action: StopStep
) -> Generator[StopStep, Pieces, Pieces]:
    """Send a step once, behind a repeated one; returns what came. Replies to the repetitions may come first, each as late as the first was."""
    late = patience(context, before)
    if before is None or not before.pending:
        return (yield action._replace(seconds=late))
    came = list((yield action._replace(seconds=late)))
    fresh: Pieces = came
    for _ in range(before.pending):
        if not fresh or action.enough(came):
            break
        enough = lambda pieces, came=tuple(came): action.enough([*came, *pieces])  # noqa: E731
        fresh = yield action._replace(seconds=late, enough=enough, reads=True, sends=False)
        came += fresh
    return came


def after_late_replies(context: StopContext, heard: StepResult[T]) -> Generator[StopStep, Pieces, T | None]:
    """Return what was found, after waiting for the replies to the repetitions: on a slow line the next request would get them."""
    for _ in range(heard.pending if heard.found is not None else 0):
        if not (yield from silence(heard.seconds)):
            break
    return heard.found


def single_write_stop(step: Step, answer: bytes, done: str, context: StopContext) -> StopSequence:
    """A stop that is one write, which is acknowledged by `answer`; what the device has `done` once that came."""
    heard = yield from repeat_until_answered(context, step, lambda pieces: answer in b"".join(pieces) or None)
    if heard.found:
        return Stopped(f"{done}, and acknowledged it")
    error = ProtocolError if heard.came else NoAnswer
    return Stopped(
        f"{step.meaning} was sent and not acknowledged", "switch the power off if the device is still moving", error
    )
