"""The source of the rows of a recording: what the recorder needs from a device.

Which columns a log has is decided by its source: `MapSource` of `command.log_command` for the values of a family's map, which knows
their units as a person reads them, or one of the family's own, such as `devices.ekso.recording_source`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from handctl.errors import HandctlError
from handctl.model.device_clock import Moment
from handctl.model.result import Row
from handctl.record.csv_columns import Layout
from handctl.record.timeline import Place


class Sample(NamedTuple):
    """One answer: when it was made by the link's clock and by the device's own, and what the layout makes a row of.

    rows    the same as rows of `get`, made where somebody compares them with a limit
    unread  the columns that could not be read, and why
    """

    moment: Moment
    values: Any
    device_ms: int | None = None
    rows: Callable[[], Sequence[Row]] = tuple
    unread: Mapping[str, HandctlError] = MappingProxyType({})


class Ended(Exception):
    """A stream that ends by itself has ended: raised by `Source.sample`."""


class Source(ABC):
    """A device that is recorded. Each method may raise NoAnswer, ProtocolError and LinkError.

    kind        family, which names the file format and the file
    layout      the columns of its rows
    period_ms   its usual period until the true one is known; None = nothing is known, and no interval is called a gap before that
    clock_name  what its own clock is called, "" = it has none
    looks       whether `look` asks anything
    paced       its samples come at their own rate, and it ends by itself
    """

    kind: str
    layout: Layout
    period_ms: float | None = None
    clock_name = ""
    looks = False
    paced = False

    @abstractmethod
    def sample(self) -> Sample:
        """Ask for one row."""

    def made(self, sample: Sample) -> Sample:
        """The same with what takes time to make of the answer: the next row is asked for before that."""
        return sample

    @abstractmethod
    def settings(self) -> Mapping[str, Mapping[str, Any]]:
        """Its settings by name, each with `value`, `unit` and the family's own keys."""

    def about(self) -> dict[str, Any]:
        """What the sidecar says of the device and its link."""
        return {}

    def is_next_look(self, *, due: bool) -> bool:
        """Whether to `look` before the next row; `due`: a second has passed. Where a transcript plays the device, it decides."""
        return due and self.looks

    def look(self, place: Place, row: int) -> bool:
        """Additional requests once a second; `place` is that of the last row, whose number is `row`.

        Returns whether the answer shows that the device has restarted since the look before.
        """
        return False

    def ask_ahead(self) -> None:  # noqa: B027 - most ask for a row in several requests
        """Ask for the next row already: the line works while this one is written. May raise LinkError."""

    def unanswered(self) -> None:  # noqa: B027 - most look at nothing
        """The last `look` had no answer."""

    def ended(self) -> None:  # noqa: B027 - most have nothing to end
        """No more rows are asked for, whatever the reason."""

    def reopen(self) -> bool:
        """Open a lost port again: False where there is no such way. Raises LinkError while it is not there."""
        return False

    def sidecar(self) -> dict[str, Any]:
        """Further keys of the sidecar."""
        return {}
