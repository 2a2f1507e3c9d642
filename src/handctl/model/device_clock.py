"""The clock of a device beside ours: the time between two of its replies by both, and how far they may be apart.

    ours      request 1 |....| answer 1        request 2 |..............| answer 2
    device               ^ its clock was read              ^ somewhere in between

A device reads its clock at some moment between request and answer. So ours allows a span of time between two of its
readings, and only a reading outside that span contradicts it: a late answer does not.
"""

from __future__ import annotations

from typing import NamedTuple

WITHIN_MS = 50
"""The two clocks may be so far apart; more is a contradiction."""


class Moment(NamedTuple):
    """When an answer was made, in seconds of the link's clock: not before `sent`, not after `answered`."""

    sent: float
    answered: float

    @property
    def middle(self) -> float:
        """The likeliest moment."""
        return (self.sent + self.answered) / 2

    def since(self, earlier: Moment) -> Span:
        """What may have passed since an earlier moment."""
        return Span((self.sent - earlier.answered) * 1000, (self.answered - earlier.sent) * 1000)


class Span(NamedTuple):
    """Milliseconds that passed between two readings of a device's clock, by ours."""

    least: float
    most: float

    def off(self, ms: float) -> float:
        """How far a device that says `ms` is outside: 0 within, above 0 ahead of our clock, below 0 behind it."""
        return min(0.0, ms - self.least) + max(0.0, ms - self.most)

    def fits(self, ms: float) -> bool:
        """Whether both clocks agree."""
        return abs(self.off(ms)) <= WITHIN_MS

    def __str__(self) -> str:
        least, most = f"{self.least:.0f}", f"{self.most:.0f}"
        return f"{most} ms" if least == most else f"{least} to {most} ms"
