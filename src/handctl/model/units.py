"""Numbers of a map as texts, and its units: which are a factor of a person's. Knows no quantity.

A manual prints some units with a factor: ``0.1 °C``, ``1/16 cts/sample``, ``1000 cts``. The factor is read from the
text, so that no second list of such units is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple


class Scale(NamedTuple):
    """A unit of the wire is `times`/`over` of the `unit` that a person uses: ``0.1 °C`` is 1/10 of a °C."""

    times: int
    over: int
    unit: str

    def of(self, value: int | float) -> int | float:
        """The same in a person's unit, without the error of a factor that is no binary fraction."""
        return value * self.times if self.over == 1 else value * self.times / self.over


@cache
def scale_of(unit: str) -> Scale | None:
    """``0.1 °C`` -> Scale(1, 10, "°C"); None for a unit that a person uses, and for none."""
    factor, _, rest = unit.partition(" ")
    if not rest or not factor[0].isdecimal():
        return None
    times, _, over = factor.partition("/")
    whole, _, decimals = times.partition(".")
    return Scale(int(whole + decimals), int(over or 1) * 10 ** len(decimals), rest)


def bit_names(value: int, names: Sequence[str]) -> str:
    """``0x06`` -> ``over_temperature, over_current``; undefined bits are named as such; 0 -> ``ok``."""
    found = [
        names[bit] if bit < len(names) else f"unknown_bit_{bit}"
        for bit in range(max(8, value.bit_length()))
        if value >> bit & 1
    ]
    return ", ".join(found) or "ok"


def exact_decimal(text: str, decimals: int) -> float:
    """Parse a decimal number that must not need more than `decimals` decimals. Raises ValueError."""
    from decimal import Decimal, InvalidOperation

    try:
        value = Decimal(text)
    except InvalidOperation as exc:
        raise ValueError(text) from exc
    if not value.is_finite() or abs(value) > 10**9 or value != round(value, decimals):
        raise ValueError(text)
    return float(value)


BASES = {
    "°C": Scale(1, 1, "celsius"),
    "°": Scale(1, 1, "degrees"),
    "deg": Scale(1, 1, "degrees"),
    "s": Scale(1, 1, "seconds"),
    "ms": Scale(1, 1000, "seconds"),
    "A": Scale(1, 1, "amperes"),
    "mA": Scale(1, 1000, "amperes"),
    "V": Scale(1, 1, "volts"),
    "mV": Scale(1, 1000, "volts"),
    "m": Scale(1, 1, "meters"),
    "mm": Scale(1, 1000, "meters"),
    "in": Scale(254, 10000, "meters"),
    "g": Scale(1, 1, "grams"),
    "N": Scale(1, 1, "newtons"),
    "%": Scale(1, 100, "ratio"),
    "bit/s": Scale(1, 1, "bits_per_second"),
    "cts": Scale(1, 1, "counts"),
    "raw counts": Scale(1, 1, "counts"),
    "cts/sample": Scale(1, 1, "counts_per_sample"),
    "cts/sample²": Scale(1, 1, "counts_per_sample_squared"),
    "steps": Scale(1, 1, "steps"),
}
"""A person's units as a monitoring system has them: base units, but degrees for angles, as all manuals have."""
