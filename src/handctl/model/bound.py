"""Bounds that a person sets for readings: `temperature=60`, `force_actual.index=-200..500`. Knows rows, and no device."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence

from handctl.errors import CheckFailed, UsageError
from handctl.model.param import Bound
from handctl.model.result import Journal, Row, Sample, Table
from handctl.number_parsing import real_in

Named = Callable[[str], Collection[str]]
"""A name as it is typed -> the paths of the elements that it means. Raises UsageError."""
NEXT = "write NAME=HIGHEST or NAME=LOWEST..HIGHEST, such as `temperature=60`"


def shown_value(row: Row) -> float | None:
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
        self._worst: dict[tuple[int, str], tuple[float, Row, float | None]] = {}
        self._compared: set[int] = set()
        self._looked = False

    def look(self, rows: Iterable[Row], t: float | None = None) -> bool:
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


def name_of(row: Row) -> str:
    """Which element a row is of."""
    part = row.get("finger") or row.get("motor") or row.get("element")
    return f"{row['name']}.{part}" if part else str(row["name"])


def unit_of(row: Row) -> str:
    """The unit that is shown, after a blank; "" = none."""
    unit = row.get("scaled_unit") or row.get("unit")
    return f" {unit}" if unit else ""


class Bounds:
    """What a person set for one command: `limits` decide the exit code, and `until` where it ends."""

    def __init__(self, limits: Sequence[Bound], until: Sequence[Bound], where: str, journal: Journal) -> None:
        self.limits = tuple(limits)
        self._dog, self._end = Watchdog(limits), Watchdog(until)
        self._where, self._journal = where, journal

    def over(self, rows: Iterable[Row], t: float | None = None) -> bool:
        """Take the rows of a moment, as in `Watchdog.look`; whether they are the last ones."""
        rows = list(rows)
        self._dog.look(rows, t)
        if over := self._end.look(rows, t):
            self._journal.info("until", f"ended by --until: {'; '.join(self._end.findings())}")
        return over

    def failure(self) -> CheckFailed | None:
        """See `Watchdog`."""
        return self._dog.failure(self._where)

    def kept(self, table: Table) -> Table:
        """The table, or the stream, with an end where `until` is passed, and exit 7 where one of `limits` is."""
        if table.samples is None:
            self.over(table.rows)
            table.failure = table.failure or self.failure()
            return table
        samples = table.samples

        def looked() -> Iterator[Sample]:
            try:
                for sample in samples:
                    over = self.over(sample.rows, sample.t)
                    yield sample
                    if over:
                        break
            finally:
                if close := getattr(samples, "close", None):
                    close()  # so that a device is left
                table.failure = table.failure or self.failure()

        table.samples = looked()
        table.bounds = self.limits
        return table
