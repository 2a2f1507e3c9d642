"""What a command has learned of the line it used: round trip, echo, direction, others. Knows no device, does no I/O."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any

from handctl.model.latency import RoundTrips

SLOW = 0.045
"""Seconds: no cable with an adapter takes so long for a short question; Bluetooth and networks do."""
LEAST = 8
"""Bytes: smaller pieces are those of a line as the computer happens to read it."""


class Profile:
    """Facts of one line, each None until it was measured.

    trips          seconds from a short question to its answer, bytes included
    speed_matters  whether the device is only reached at its own speed; not over Bluetooth, USB CDC or a network
    half_duplex    whether an answer is lost while something is sent
    echo           whether our own bytes come back
    others         whether frames were heard that answer nothing that was asked
    longest        bytes of the last long answer, whose pieces were looked at
    met            who has shown on this line that it is of the family that reads it; not of its row
    """

    def __init__(self) -> None:
        self.trips = RoundTrips()
        self.speed_matters: bool | None = None
        self.half_duplex: bool | None = None
        self.echo: bool | None = None
        self.others: bool | None = None
        self.longest: int | None = None
        self.met: set[Hashable] = set()
        self._size = self._alike = 0  # of the pieces of the last long answers, and how many in a row had it

    @property
    def round_trip(self) -> float | None:
        """The median in seconds."""
        return self.trips.quantile(0.5) if len(self.trips) else None

    @property
    def worst(self) -> float:
        """The longest in seconds, 0 where none was measured."""
        return self.trips.quantile(1.0) if len(self.trips) else 0.0

    @property
    def spread(self) -> float | None:
        """From the shortest to the longest, in seconds; None for less than two."""
        return self.worst - self.trips.quantile(0.0) if len(self.trips) > 1 else None

    @property
    def slow(self) -> bool:
        """Whether answers take as long as over Bluetooth or a network."""
        return (self.round_trip or 0.0) > SLOW

    def pieces(self, sizes: Sequence[int]) -> None:
        """Learn from the pieces in which a long answer came: a packet's size shows as that of all but the last, twice."""
        first, self.longest = sizes[0], sum(sizes)
        if first < LEAST or sizes[-1] > first or any(size != first for size in sizes[:-1]):
            first = 0
        self._alike = self._alike + 1 if first == self._size else 1
        self._size = first

    @property
    def packet(self) -> int | None:
        """Bytes of the packets in which long answers come, all of it where something on the way gathers them; None where
        none show. A cable has none: its pieces are those in which this computer reads."""
        told = self._size and self._alike > 1 and (self.slow or self.speed_matters is False)
        return self._size if told else None

    def as_row(self) -> dict[str, Any]:
        """`line` of the JSON envelope: null for what was not measured."""
        return {
            "round_trip_ms": _ms(self.round_trip),
            "spread_ms": _ms(self.spread),
            "speed_matters": self.speed_matters,
            "half_duplex": self.half_duplex,
            "echo": self.echo,
            "others": self.others,
        }

    def words(self) -> str:
        """One line for people, "" for a line about which there is nothing to say."""
        took = f"{1000 * (self.round_trip or 0.0):.0f} ms"
        if self.speed_matters is False:
            kind = "Bluetooth-like" if (self.round_trip or 0.0) > 0.02 else "USB or network"
            text = f"{kind}: {took}, speed ignored"
        elif self.slow:
            text = f"Slow line: {took}"
        elif self.half_duplex:
            text = f"Half duplex: {took}"
        else:
            return "Other programs use this line" if self.others else ""
        return f"{text}, half duplex" if self.half_duplex and "duplex" not in text.lower() else text


def _ms(seconds: float | None) -> float | None:
    return None if seconds is None else round(1000 * seconds, 1)
