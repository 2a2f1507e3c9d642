"""What a write would let go: targets that a device holds without having gone there. Knows no device.

A set-point that was written while the speed was 0, or that an error or a force limit has kept from being reached, waits. The
write of a speed, a limit or a clearing is a movement then, and is asked for as one. A family gives two short tables:
which set-point leads where (`Course`), and which write lets an axis go (`Release`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from handctl.model.param import Element, Number, elements_of

if TYPE_CHECKING:
    from handctl.model.device import Device


class Course(NamedTuple):
    """Names of a set-point and of what shows where the axis is; `near` counts as there.

    closing  1 or -1: whether the axis closes as the number grows or falls; 0 = not known
    """

    target: str
    actual: str
    near: Number
    closing: int = 0

    def closes(self, here: Number, target: Number) -> bool:
        """Whether going from here to there closes, as far as that is known."""
        return self.closing == 0 or (target - here) * self.closing > 0


class Release(NamedTuple):
    """Writing the quantity `by` may let an axis go.

    held   what shows whether it is held by that now
    frees  (the number it holds now, the number that is written) -> whether it is let go
    closing  only axes that would close are held by it
    """

    by: str
    held: str
    frees: Callable[[Number, Number], bool]
    closing: bool = False


class Pending(NamedTuple):
    """An axis that would move."""

    part: str
    target: str
    here: Number
    there: Number

    def __str__(self) -> str:
        return f"{self.part} from {self.here} to {self.there} ({self.target})"


def released(device: Device, changes: Sequence[tuple[Element, Number]]) -> list[Pending]:
    """The axes that these writes would let go, from what the device tells now. Raises what kept it from being read."""
    freed: dict[tuple[str, bool], None] = {}
    for release in device.releases:
        written = {element.part: value for element, value in changes if element.param.name == release.by}
        if not written:
            continue
        whole = None in written  # a trigger concerns all axes
        parts = [one for one in elements_of(device.map[release.held]) if whole or one.part in written]
        for element, old in zip(parts, _values(device, parts), strict=True):
            if release.frees(old, written[None if whole else element.part]):
                freed[element.part or "", release.closing] = None
    if not freed:
        return []
    found: dict[Pending, None] = {}
    for course in device.courses:
        wanted = {part for part, _ in freed}
        targets = [one for one in elements_of(device.map[course.target]) if one.part in wanted]
        places = [one for one in elements_of(device.map[course.actual]) if one.part in wanted]
        values = _values(device, [*targets, *places])
        at = dict(zip((one.full_name for one in (*targets, *places)), values, strict=True))
        for element in targets:
            part = element.part or ""
            there, here = at[element.full_name], at.get(f"{course.actual}.{part}")
            if here is None or there in element.param.special or abs(there - here) <= course.near:
                continue
            if (part, False) in freed or course.closes(here, there):
                found[Pending(part, course.target, here, there)] = None
    return list(found)


def _values(device: Device, elements: Sequence[Element]) -> list[Number]:
    values = []
    for reading in device.read(elements):
        if reading.error is not None:
            raise reading.error
        assert reading.value is not None
        values.append(reading.value)
    return values


def question(waiting: Sequence[Pending]) -> str:
    """What is asked before such a write."""
    text = f"This moves {', '.join(map(str, waiting))}: targets that are set and were not reached"
    twice = len({one.part for one in waiting}) < len(waiting)
    return f"{text}. Of two targets of a finger, the one that was set last counts" if twice else text
