"""The source of the rows of a recording: what the recorder needs from a device."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from handctl.model.device_clock import Moment
from handctl.model.result import Row, name_of
from handctl.record.timeline import Place


class Sample(NamedTuple):
    """One answer: when it was made by the link's clock and by the device's own, and what the layout makes a row of.

    rows  the same as rows of `get`, made where somebody compares them with a limit
    """

    moment: Moment
    values: Any
    device_ms: int | None = None
    rows: Callable[[], Sequence[Row]] = tuple


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

    @abstractmethod
    def settings(self) -> Mapping[str, Mapping[str, Any]]:
        """Its settings by name, each with `value`, `unit` and the family's own keys."""

    def about(self) -> dict[str, Any]:
        """What the sidecar says of the device and its link."""
        return {}

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


HOST_COLUMNS = (("host_utc_s", 6), ("host_mono_s", 6))
ROW_COLUMNS = (("t_s", 3), ("segment", 0), ("seq", 0), ("rtt_ms", 3))
MARK = "mark"


def lead(clock: str) -> tuple[tuple[str, int], ...]:
    """Names and decimals of the leading columns; `clock` is that of the device's clock in ms, "" where it has none."""
    return (*HOST_COLUMNS, *([(clock, 0)] if clock else []), *ROW_COLUMNS)


class Stamp(NamedTuple):
    """When a row was taken.

    utc_s   host clock of the day, the middle between request and answer, seconds since 1970
    place   the other clocks, and the segment, which is counted from 1
    seq     number of the request; a request without an answer leaves a hole
    """

    utc_s: float
    place: Place
    seq: int

    def texts(self) -> list[str]:
        """The texts of the leading columns."""
        place = self.place
        return [
            f"{self.utc_s:.6f}",
            f"{place.mono_s:.6f}",
            *([] if place.boot_ms is None else [str(place.boot_ms)]),
            f"{place.t_ms / 1000:.3f}",
            str(place.segment),
            str(self.seq),
            f"{place.rtt_ms:.3f}",
        ]


class Layout(ABC):
    """The columns of one file."""

    names: tuple[str, ...]

    @property
    def header(self) -> str:
        return ",".join(map(quoted, self.names)) + "\r\n"

    @abstractmethod
    def as_rows(self) -> list[dict[str, Any]]:
        """The device's columns as the sidecar explains them."""

    @abstractmethod
    def line(self, stamp: Stamp, values: Any, mark: str) -> str:
        """One row."""


class RowsLayout(Layout):
    """The values of a map: a column each, named as in `watch -o FILE.csv`, then what could not be read, and the mark."""

    def __init__(self, columns: Sequence[tuple[str, Row]]) -> None:
        self._columns = columns
        self.names = (*(name for name, _ in lead("")), *(name for name, _ in columns), "error", MARK)

    def as_rows(self) -> list[dict[str, Any]]:
        return [{"column": column, "name": name_of(row), "unit": row.get("unit")} for column, row in self._columns]

    def line(self, stamp: Stamp, values: tuple[Sequence[str], str], mark: str) -> str:
        """`values` are the texts of the columns, and of what could not be read."""
        texts, error = values
        fields = [*texts, error, mark]
        line = ",".join(fields)
        if line.count(",") >= len(fields) or any(c in line for c in '"\r\n'):
            line = ",".join(map(quoted, fields))
        return f"{','.join(stamp.texts())},{line}\r\n"


def quoted(text: str) -> str:
    """A text as a CSV field (RFC 4180)."""
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\r\n') else text


def clean(text: str) -> str:
    """A mark as one line: control characters, line ends of any kind among them, become spaces."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
