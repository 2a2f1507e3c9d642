"""Bounds that a person sets for readings: `temperature=60`, `force_actual.index=-200..500`. Knows rows, and no device."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from handctl.errors import CheckFailed, UsageError
from handctl.model.param import Bound, ParamMap
from handctl.model.result import Journal, Row, Sample, Table

NEXT = "write NAME=HIGHEST or NAME=LOWEST..HIGHEST, such as `temperature=60`"


def shown_value(row: Row) -> float | None:
    """The number of a row in the unit that is shown; None where there is none."""
    value = row.get("scaled", row.get("value"))
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def bounds_in(texts: Sequence[str], params: ParamMap[Any], option: str) -> list[Bound]:
    """What `option` was given. Raises UsageError."""
    return [_bound_in(text, params, option) for text in texts]


def _bound_in(text: str, params: ParamMap[Any], option: str) -> Bound:
    name, sign, given = text.partition("=")
    low, dots, high = given.strip().partition("..")
    if not sign or not given.strip(" ."):
        raise UsageError(f"{option} {text}: expected NAME=VALUE", hint=NEXT)
    param, elements = params.find(name.strip())
    if not param.readable:
        raise UsageError(f"{option} {text}: {param.name} can only be written ({param.source})", hint=NEXT)
    ends = [_number(end, text, option) for end in ((low, high) if dots else ("", low))]
    if None not in ends and ends[0] > ends[1]:  # type: ignore[operator]
        raise UsageError(f"{option} {text}: no value lies between", hint="put the lower end first")
    return Bound(name.strip(), frozenset(element.path for element in elements), *ends)


def _number(text: str, whole: str, option: str) -> float | None:
    if not text.strip():
        return None
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if value != value or abs(value) == float("inf"):
        raise UsageError(f"{option} {whole}: {text.strip()!r} is not a number", hint=NEXT)
    return value


class Watchdog:
    """Compares rows with bounds. Remembers of each element how far it went, and when it first did."""

    def __init__(self, bounds: Sequence[Bound]) -> None:
        self.bounds = bounds
        self._worst: dict[tuple[int, str], tuple[float, Row, float | None]] = {}
        self._compared: set[int] = set()
        self._looked = False

    def look(self, rows: Iterable[Row], t: float | None = None) -> bool:
        """Take the rows of a moment, which is `t` seconds from the first; whether one of them is out of bounds."""
        out, self._looked = False, True
        for row in rows:
            value, path = shown_value(row), str(row.get("path"))
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
                hint=f"name it, as in `watch {blind[0]}`",
                code="limit-unchecked",
            )
        return None


def name_of(row: Row) -> str:
    """Which element a row is of."""
    part = row.get("finger") or row.get("motor") or row.get("element")
    return f"{row['name']}.{part}" if part else str(row["name"])


def unit_of(row: Row) -> str:
    """The unit that is shown, after a blank; "" = none."""
    unit = row.get("scaled_unit") or row.get("unit")
    return f" {unit}" if unit else ""


def within(table: Table, limits: Sequence[Bound], until: Sequence[Bound], where: str, journal: Journal) -> Table:
    """The table, or the stream, with an end where a bound of `until` is passed, and exit 7 where one of `limits` is."""
    if not (limits or until):
        return table
    dog = Watchdog(limits)
    if table.samples is None:
        dog.look(table.rows)
        table.failure = table.failure or dog.failure(where)
        return table
    end = Watchdog(until)
    samples = table.samples

    def looked() -> Iterator[Sample]:
        try:
            for sample in samples:
                dog.look(sample.rows, sample.t)
                yield sample
                if end.look(sample.rows, sample.t):
                    journal.info("until", f"ended by --until: {'; '.join(end.findings())}")
                    break
        finally:
            if close := getattr(samples, "close", None):
                close()  # so that a device is left
            table.failure = table.failure or dog.failure(where)

    table.samples = looked()
    table.bounds = tuple(limits)
    return table
