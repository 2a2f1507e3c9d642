"""What a device is to the kernel, and what every family's device and line would otherwise repeat.

For who writes a family: its `Line` says how one question is asked and answered. Knows no family and does no I/O of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, TypedDict, TypeVar

from handctl.errors import NoAnswer, ProtocolError

if TYPE_CHECKING:
    from handctl.link import Deadline, Link
    from handctl.model.result import Journal

RETRIES = 2
"""Repetitions of a read that got no valid answer, unless --retries says otherwise."""

T = TypeVar("T")


class Limits(TypedDict):
    """What the user's options allow one exchange, and the whole command; None = what the family thinks right."""

    timeout: float | None
    retries: int | None
    bound: Deadline | None


class Allowed(Protocol):
    """The options that limit: `options.Settings`."""

    @property
    def timeout(self) -> float | None: ...
    @property
    def retries(self) -> int | None: ...
    @property
    def deadline(self) -> float | None: ...


def limits_of(settings: Allowed, link: Link) -> Limits:
    """--timeout, --retries and --deadline, this one from now on by the clock of the link."""
    end = link.deadline(settings.deadline) if settings.deadline is not None else None
    return {"timeout": settings.timeout, "retries": settings.retries, "bound": end}


class Line:
    """What a device is reached through: its link, the journal, and the limits of what is asked there.

    retries  repetitions of a read that got no valid answer; what writes is never repeated
    bound    deadline of the whole command, None = none
    """

    def __init__(
        self, link: Link, journal: Journal, *, retries: int | None = None, bound: Deadline | None = None
    ) -> None:
        self.link = link
        self.journal = journal
        self.retries = RETRIES if retries is None else retries
        self.bound = bound

    @property
    def where(self) -> str:
        """Device and link for messages."""
        return self.link.name

    @property
    def over(self) -> bool:
        """Whether --deadline is over."""
        return self.bound is not None and self.bound.expired

    def deadline(self, seconds: float) -> Deadline:
        """The deadline `seconds` from now, or the command's own where that is earlier."""
        return self.link.deadline(seconds).earlier(self.bound)

    def check_bound(self, unsent: str = "") -> None:
        """Raise NoAnswer when --deadline is over; nothing is sent then, `unsent` neither: the device may be worn."""
        if self.over:
            told = f"; {unsent} was not sent" if unsent else ""
            raise NoAnswer(f"{self.where}: --deadline is over{told}", hint="a longer --deadline", code="deadline")

    def repeated(self, ask: Callable[[], T], retries: int | None = None) -> T:
        """What `ask` returns, asked again where no valid answer came; for reads only. Raises what `ask` raised last."""
        for attempt in range(1 + (self.retries if retries is None else retries)):
            if attempt:
                self.journal.counters.retries += 1
            try:
                return ask()
            except (NoAnswer, ProtocolError) as exc:
                error = self.journal.blame(exc)
            if self.over:
                break
        raise error

    def unanswered(self, request: str, allowed: float, since: float, hint: str) -> NoAnswer:
        """The error of silence: `request` was sent at the moment `since`, and `allowed` seconds were to be waited.

        Where --deadline has cut that short it tells so, and the seconds that were really waited.
        """
        waited = f"within {allowed:g} s"
        if self.over and (seconds := self.link.now() - since) < allowed:
            waited = f"before --deadline was over, after {round(seconds, 2):g} s"
        return NoAnswer(f"{self.where}: no answer to {request} {waited}", hint=hint)
