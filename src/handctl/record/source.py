"""What a recording takes its rows from: a device, as far as the recorder has to know it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from handctl.model.clocks import Moment

if TYPE_CHECKING:
    from handctl.record.layout import Layout
    from handctl.record.timeline import Place


class Sample(NamedTuple):
    """One answer: when it was made by the link's clock and by the device's own, and what the layout makes a row of."""

    moment: Moment
    values: Any
    device_ms: int | None = None


class Source(ABC):
    """A device that is recorded. Each method may raise NoAnswer, ProtocolError and LinkError.

    kind        family, which names the file format and the file
    layout      the columns of its rows
    period_ms   its usual period until the true one is known; None = nothing is known, and no interval is called a gap before that
    clock_name  what its own clock is called, "" = it has none
    looks       whether `look` asks anything
    """

    kind: str
    layout: Layout
    period_ms: float | None = None
    clock_name = ""
    looks = False

    @abstractmethod
    def sample(self) -> Sample:
        """Ask for one row."""

    @abstractmethod
    def settings(self) -> Mapping[str, Mapping[str, Any]]:
        """Its settings by name, each with `value`, `unit` and what else the family tells."""

    def about(self) -> dict[str, Any]:
        """What the sidecar says of the device and its link."""
        return {}

    def look(self, place: Place, row: int) -> bool:
        """What is asked once a second beside the rows; `place` is that of the last row, whose number is `row`.

        Returns whether the answer shows that the device has restarted since the look before.
        """
        return False

    def unanswered(self) -> None:  # noqa: B027 - most look at nothing
        """The last `look` had no answer."""

    def reopen(self) -> bool:
        """Open a lost port again: False where there is no such way. Raises LinkError while it is not there."""
        return False

    def sidecar(self) -> dict[str, Any]:
        """Further keys of the sidecar."""
        return {}
