"""How often and for how long a step of a stop is sent again without an acknowledgement. Knows no device; sans I/O."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Generic, TypeVar

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


@fast_dataclass(frozen=True)
class StepResult(Generic[T]):
    """The result of a repeated step: the reply found, or None; all bytes received; and the longest time it can have taken, in s."""

    found: T | None
    came: Pieces
    seconds: float


def repeat_until_answered(
    context: StopContext, step: Step, found: Callable[[Pieces], T | None], *, reads: bool = False, ahead: bytes = b""
) -> Generator[StopStep, Pieces, StepResult[T]]:
    """Send the step again until something is `found` in all that came since, or its time is over."""
    came: Pieces = []
    for count in range(attempts(context)):
        before = tuple(came)
        enough = lambda pieces, before=before: found([*before, *pieces]) is not None  # noqa: E731
        came += yield StopStep(step, interval(context), enough, reads, ahead=ahead)
        if (what := found(came)) is not None:
            return StepResult(what, came, (count + 1) * interval(context))
    return StepResult(None, came, context.within or REPEAT_FOR)


def after_late_replies(context: StopContext, heard: StepResult[T]) -> Generator[StopStep, Pieces, T | None]:
    """Return what was found, after waiting for the replies to the repetitions: on a slow line the next request would get them."""
    if heard.found is not None and heard.seconds > interval(context):
        yield from silence(heard.seconds)
    return heard.found


def single_write_stop(step: Step, answer: bytes, done: str, context: StopContext) -> StopSequence:
    """A stop that is one write, which is acknowledged by `answer`; what the device has `done` once that came."""
    heard = yield from repeat_until_answered(context, step, lambda pieces: answer in b"".join(pieces) or None)
    if heard.found:
        return Stopped(f"{done}, and acknowledged it")
    error = ProtocolError if heard.came else NoAnswer
    return Stopped(
        f"{step.meaning} was sent and not acknowledged", "switch the power off if the device still moves", error
    )
