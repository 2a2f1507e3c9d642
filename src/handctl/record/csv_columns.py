"""The columns of a recording: those that lead each row, those of the device, and how a row becomes a line of CSV."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

from handctl.model.result import Row, name_of
from handctl.record.timeline import Place

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
