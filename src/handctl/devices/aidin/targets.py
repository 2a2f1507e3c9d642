"""Typed targets to a complete vector for the wire, checked for each finger (aidin, Ranges).

Values are in the manual's units: counts, degrees, mm. Out of range is refused, never clamped. Knows no link.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, isfinite, radians

from handctl.devices.aidin.map import CURRENTS, AidinParam, Target, both_ranges, some
from handctl.errors import CheckFailed, UsageError
from handctl.model import movement
from handctl.model.param import Number, given

SLACK = 0.01
"""Share of a range by which a measured value that is kept may be outside: it is held at the limit then."""
RADIAN_STEP = 1e-6
COUPLED = "q4"
SHOWN = 4


@dataclass(frozen=True, slots=True)
class Goal:
    """Targets by index, in the command's unit; what is not in `named` keeps its place."""

    target: Target
    named: dict[int, float]

    @property
    def names_all(self) -> bool:
        """Whether nothing needs to be known of the hand."""
        return len(self.named) == self.target.command.count

    def complete(self, measured: Sequence[Number] | None) -> list[float]:
        """The whole vector: named elements, the others as measured (same order and unit).

        Raises UsageError without `measured` where it is needed; CheckFailed when what is kept is out of its range.
        """
        param = self.target.command
        if measured is None and not self.names_all:
            raise UsageError(
                "the elements that you did not give keep their position, which is unknown", hint="give all values"
            )
        values = []
        for index in range(param.count):
            if index in self.named:
                values.append(self.named[index])
            else:
                assert measured is not None
                values.append(_kept(param, index, float(measured[index])))
        return values

    def wire(self, values: Sequence[float]) -> tuple[int, ...] | tuple[float, ...]:
        """The numbers of the command's array."""
        param = self.target.command
        numbers = [
            param.to_wire(index, round(value) if param.int_range else value) for index, value in enumerate(values)
        ]
        return tuple(int(n) for n in numbers) if param.int_range is not None else tuple(float(n) for n in numbers)


def _kept(param: AidinParam, index: int, value: float) -> float:
    limit = param.limit(index)
    if limit is None:
        return value
    slack = (limit[1] - limit[0]) * SLACK
    if not limit[0] - slack <= value <= limit[1] + slack:
        raise CheckFailed(
            f"{param.elements[index]} would be kept at {value:g}, which is outside {limit[0]:g}..{limit[1]:g}",
            hint="give a value for it as well, or run `handctl aidin home` if the hand has not been homed since power-on. Nothing was sent.",
            code="kept-out-of-range",
        )
    return min(max(value, limit[0]), limit[1])


def parse(target: Target, texts: Sequence[str], *, rad: bool = False, cap: float | None = None) -> Goal:
    """``10 5 118 …`` (all in order; joints also without q4) or ``index.q3=160 thumb.q1=10``. Raises UsageError."""
    param = target.command
    driven = [index for index in range(param.count) if param.label_of(index) != COUPLED]
    named = given(
        texts,
        param.elements,
        what=param.key,
        noun="element",
        orders=[range(param.count)] if len(driven) == param.count else [range(param.count), driven],
        more=f". An element is FINGER.{'|'.join(param.labels)}",
    )
    if "=" in texts[0] and (coupled := [index for index in named if index not in driven]):
        raise UsageError(
            f"{param.elements[coupled[0]]}: q4 is coupled to q3 and cannot be commanded",
            hint="give q3 (aidin, Command keys)",
            code="coupled",
        )
    values = {index: _number(param, index, text) for index, text in named.items()}
    if rad:
        values = {index: _from_radians(param, index, value) for index, value in values.items()}
    elif param.angles and len(values) >= 15 and not any(values.values()):
        raise UsageError(
            "all zeros: q3 = 0 is out of range for every finger",
            hint=f"q3 is the angle between two links, 180 is straight. Allowed, in degrees: q3 {both_ranges(param.limits['q3'])} "
            "(aidin, Ranges). Nothing was sent.",
            code="out-of-range",
        )
    _check(param, values, rad=rad)
    if cap is not None:
        _check_cap(param, values, cap)
    if param.angles:
        _couple(param, values)
    return Goal(target, dict(sorted(values.items())))


def _number(param: AidinParam, index: int, text: str) -> float:
    name = param.elements[index]
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not isfinite(value) or "_" in text:
        raise UsageError(f"{name} = {text!r} is not a number", hint="nothing was sent", code="not-a-number")
    if param.int_range is not None and value != int(value):
        raise UsageError(f"{name} = {text} is not a whole number", hint="nothing was sent", code="not-a-number")
    return value


def _from_radians(param: AidinParam, index: int, value: float) -> float:
    """Degrees; the wire's rounding of a limit counts as the limit (-13 deg is -0.226893 rad to 6 decimals)."""
    limit = param.limit(index)
    for end in limit or ():
        if abs(value - radians(end)) <= RADIAN_STEP:
            return end
    return degrees(value)


def _check(param: AidinParam, values: dict[int, float], *, rad: bool) -> None:
    wrong = []
    for index, value in values.items():
        limit = param.limit(index) or ((-180.0, 180.0) if param.angles else None)
        if limit is not None and not limit[0] <= value <= limit[1]:
            wrong.append((index, value, limit))
    if not wrong:
        return
    unit = f" {param.unit}" if param.unit else ""
    named = [f"{param.elements[index]} = {value:g}{unit}" for index, value, _ in wrong]
    ranges = [f"{param.elements[index]} {limit[0]:g}..{limit[1]:g}{unit}" for index, _, limit in wrong[:SHOWN]]
    ours = param is CURRENTS.command or any(param.limit(index) is None for index, _, _ in wrong[:SHOWN])
    source = "handctl's own limits, because the manual gives no range" if ours else "aidin, Ranges"
    hint = f"allowed: {', '.join(ranges)} ({source}). Nothing was sent."
    if param.angles and _fits(param, values, rad=rad):
        hint = f"as {'degrees: leave --rad out' if rad else 'radians they would be in range: add --rad'}. {hint}"
    raise UsageError(
        f"{some(named, SHOWN)} {'is' if len(named) == 1 else 'are'} out of range",
        hint=hint,
        code="out-of-range",
    )


def _fits(param: AidinParam, values: dict[int, float], *, rad: bool) -> bool:
    """Whether the same numbers fit in the other unit."""
    for index, value in values.items():
        limit = param.limit(index)
        other = radians(value) if rad else degrees(value)
        if limit is not None and not limit[0] <= other <= limit[1]:
            return False
    return True


def _check_cap(param: AidinParam, values: dict[int, float], cap: float) -> None:
    for index, value in values.items():
        if abs(value) > cap:
            raise UsageError(
                f"{param.elements[index]} = {value:g} is beyond the cap of {cap:g}",
                hint="use --cap N to allow more, up to 1000. Nothing was sent.",
                code="beyond-cap",
            )


def _couple(param: AidinParam, values: dict[int, float]) -> None:
    """The slot of q4 goes with a q3 that is given: only q3 counts, but the two should not contradict each other."""
    for index in [index for index in values if param.label_of(index) == "q3"]:
        values.setdefault(index + 1, values[index])


def axes_of(goal: Goal, values: Sequence[float]) -> list[movement.Goal]:
    """What is watched, and how near is there: 1 % of stroke, 2 deg, 2 mm; currents 20 and a tenth of the target."""
    target, param = goal.target, goal.target.command
    unit = f" {param.unit}" if param.unit else ""
    axes = []
    for index, wanted in enumerate(values):
        if param.label_of(index) != COUPLED:
            near = target.near(index) + (abs(wanted) * 0.1 if target is CURRENTS else 0.0)
            axes.append(
                movement.Goal(
                    param.elements[index], wanted, near, jitter=near, decimals=target.feedback.places, unit=unit
                )
            )
    return axes
