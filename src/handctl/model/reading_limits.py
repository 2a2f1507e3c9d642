"""The limits of a reading: those a person sets, such as `temperature=60`, and how near to one it is. Knows rows, no device."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any

from handctl.errors import CheckFailed, UsageError
from handctl.fast_classes import NamedTuple
from handctl.number_parsing import real_in

Named = Callable[[str], Collection[str]]
"""A name as it is typed -> the paths of the elements that it means. Raises UsageError."""
NEXT = "write NAME=HIGHEST or NAME=LOWEST..HIGHEST, such as `temperature=60`"


class Bound(NamedTuple):
    """The lowest and highest value that some elements may have, in the unit that is shown; None = any.

    paths  of the elements, as `path` in their rows
    """

    name: str
    paths: frozenset[str]
    low: float | None
    high: float | None

    def beyond(self, value: float) -> float:
        """How far outside the value lies; 0 = inside. The ends belong to it."""
        below = self.low - value if self.low is not None else 0.0
        above = value - self.high if self.high is not None else 0.0
        return max(0.0, below, above)

    @property
    def words(self) -> str:
        """The bound as a person would say it."""
        if self.low is None:
            return f"at most {self.high:g}"
        return f"at least {self.low:g}" if self.high is None else f"{self.low:g} to {self.high:g}"


NEAR = 0.9
"""From this share of a highest value on, a reading is near it."""


def severity(
    value: float, bounds: Sequence[Bound] = (), highest: float | None = None, usual: tuple[float, float] | None = None
) -> int:
    """2 = past a bound or the documented `highest` value, 1 = near one or outside the `usual` range, 0 = neither: the colour."""
    if any(bound.beyond(value) for bound in bounds):
        return 2
    highs = [bound.high for bound in bounds if bound.high is not None and bound.high > 0]
    if highest is not None and not highs:
        if value >= highest:
            return 2
        highs = [highest]
    low, high = usual or (value, value)
    return int(any(value >= NEAR * end for end in highs) or not low <= value <= high)


def shown_value(row: Mapping[str, Any]) -> float | None:
    """The number of a row in the unit that is shown; None where there is none."""
    value = row.get("scaled", row.get("value"))
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def bound_in(text: str, named: Named, option: str) -> Bound:
    """What `option` was given. Raises UsageError."""
    name, sign, given = text.partition("=")
    low, dots, high = given.strip().partition("..")
    if not sign or not given.strip(" ."):
        raise UsageError(f"{option} {text}: expected NAME=VALUE", hint=NEXT)
    paths = frozenset(named(name.strip()))
    ends = [_number(end, text, option) for end in ((low, high) if dots else ("", low))]
    if None not in ends and ends[0] > ends[1]:  # type: ignore[operator]
        raise UsageError(f"{option} {text}: no value can be in this range", hint="put the lower end first")
    return Bound(name.strip(), paths, *ends)


def _number(text: str, whole: str, option: str) -> float | None:
    if not text.strip():
        return None
    value = real_in(text)
    if value != value or abs(value) == float("inf"):
        raise UsageError(f"{option} {whole}: {text.strip()!r} is not a number", hint=NEXT)
    return value


class Watchdog:
    """Compares rows with bounds. Remembers of each element how far it went, and when it first did."""

    def __init__(self, bounds: Sequence[Bound]) -> None:
        self.bounds = bounds
        self._worst: dict[tuple[int, str], tuple[float, Mapping[str, Any], float | None]] = {}
        self._compared: set[int] = set()
        self._looked = False

    def look(self, rows: Iterable[Mapping[str, Any]], t: float | None = None) -> bool:
        """Take the rows of a moment, which is `t` seconds from the first; whether one of them is out of bounds."""
        out, self._looked = False, True
        for row in rows:
            value, path = shown_value(row), str(row.get("path") or (name_of(row) if "name" in row else ""))
            for number, bound in enumerate(self.bounds):
                if value is None or path not in bound.paths:
                    continue
                self._compared.add(number)
                if far := bound.beyond(value):
                    out = True
                    worst, _, first = self._worst.get((number, path), (0.0, row, t))
                    if far > worst:
                        self._worst[number, path] = far, row, first
        return out

    def findings(self) -> list[str]:
        """What went out of bounds, a sentence for each element: the farthest value, and when it began."""
        return [
            f"{name_of(row)} {shown_value(row):g}{unit_of(row)} (limit: {self.bounds[number].words}{unit_of(row)})"
            + (f", first after {began:.1f} s" if began is not None else "")
            for (number, _), (_, row, began) in self._worst.items()
        ]

    def failure(self, where: str) -> CheckFailed | None:
        """Exit 7 where something went out of bounds, or where a bound had nothing to be compared with."""
        if found := self.findings():
            return CheckFailed(f"{where}: past the limit: {'; '.join(found)}", code="limit")
        blind = [bound.name for number, bound in enumerate(self.bounds) if number not in self._compared]
        if blind and self._looked:
            return CheckFailed(
                f"{where}: {', '.join(blind)} was not read, so the limit was not checked",
                hint=f"limits only apply to values that are read. `watch {blind[0]}` reads this one",
                code="limit-unchecked",
            )
        return None


def name_of(row: Mapping[str, Any]) -> str:
    """Which element a row is of."""
    part = row.get("finger") or row.get("motor") or row.get("element")
    return f"{row['name']}.{part}" if part else str(row["name"])


def unit_of(row: Mapping[str, Any]) -> str:
    """The unit that is shown, after a blank; "" = none."""
    unit = row.get("scaled_unit") or row.get("unit")
    return f" {unit}" if unit else ""
