"""The guards of the RealTime loop, for limits that the hand does not apply there (barrett §6; dossier 6.6). Sans I/O, no clock.

TSTOP, CT, HSG and LSG act in movement commands only (§5.5); in the loop a motor is driven as long as the host says so.
A guard that trips has velocity 0 sent for its motor from the next block on, until the command is 0 or turns around;
`heat` and an impossible position end the loop.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.parameter_map import OFF, TRAVEL, implausible, unmeasured
from handctl.errors import UsageError
from handctl.fast_classes import NamedTuple

if TYPE_CHECKING:
    from handctl.devices.barrett.realtime.blocks import Values

GUARDS = {
    "stall": "velocity 0 for a motor that has not moved for TSTOP",
    "window": "velocity 0 for a motor that would leave the range 0 to CT. An impossible position ends the loop",
    "strain": "velocity 0 above HSG and below LSG",
    "opening": "no opening faster than IVEL allows",
    "heat": "the loop ends above 65 °C, or OTEMP",
}
"""Name -> what it does; all are on unless switched off by name."""
LEAST_SHARE = 8
"""A motor that gains less than this part of the commanded way stands still."""
WORSE = 2
"""Strain units by which an opening motor may exceed what it began to open with."""


class Limits(NamedTuple):
    """What one driven motor may do.

    speed    counts/s of one unit of the velocity byte: LCVC / 16 counts a sample
    factor   LCVC
    stall    s that it may stand still: TSTOP
    window   lowest and highest position, counts
    strain   (LSG, HSG); 255 and 256 are off
    opening  fastest opening, 1/16 counts a sample: IVEL, and never above its factory value (§5.3.4)
    quantum  counts of the smallest step that the feedback shows: 1, or LFDPC
    """

    speed: float
    factor: int
    stall: float
    window: tuple[int, int]
    strain: tuple[int, int] = (256, 256)
    opening: int = 300
    quantum: int = 1


class Event(NamedTuple):
    """A guard that tripped: when, which, for which motor (None = all), at what value, `after` how many seconds of the cause."""

    at: float
    guard: str
    motor: int | None
    value: float
    limit: float
    after: float
    text: str
    ends: bool = False


class _Watch:
    """What is known of one motor."""

    def __init__(self, limits: Limits, position: int, now: float) -> None:
        self.limits = limits
        self.position = position
        self.taken = now  # when that position was
        self.held = 0  # the direction in which a guard forbids to go on
        self.guard = ""
        self.direction = 0  # of the command that was in force last
        self.mark = (0.0, 0)  # since when, and from where, it is to gain ground
        self.strain_at_turn: int | None = None


class Guards:
    """All guards of one loop. `see` takes the feedback, `allow` decides what may be sent next.

    limits     motor index -> Limits, of the motors that are driven
    positions  where they stand at the start, counts
    on         names of GUARDS
    heat       0.1 °C above which the loop ends
    """

    def __init__(
        self, limits: dict[int, Limits], positions: Mapping[int, int], on: Collection[str], heat: int, now: float
    ) -> None:
        self.events: list[Event] = []
        self._on = frozenset(on)
        self._heat = heat
        self._now = now
        self._watched = {index: _Watch(each, positions.get(index, 0), now) for index, each in limits.items()}

    # -- before a block --------------------------------------------------------------------------------------------

    def allow(self, values: Values, now: float, cycle: float) -> tuple[Values, dict[int, str]]:
        """What may be sent of `values`, and which guard holds which motor. Raises UsageError for too fast an opening.

        `cycle` seconds pass until another block can act: a motor is stopped when it would leave its window by then.
        """
        held: dict[int, str] = {}
        self._now = now
        for index, watch in self._watched.items():
            velocity = values[index].get("velocity", 0) if index in values else 0
            direction = (velocity > 0) - (velocity < 0)
            if direction != watch.held:
                watch.held = 0
            if not direction:
                continue
            if "opening" in self._on:
                check_opening(index, velocity, watch.limits)
            if not watch.held and "window" in self._on:
                self._window(index, watch, velocity, now, cycle)
            if watch.held:
                held[index] = watch.guard
        if not held:
            return values, held
        still = {
            index: {name: 0 if index in held and name == "velocity" else value for name, value in names.items()}
            for index, names in values.items()
        }
        return still, held

    def _window(self, index: int, watch: _Watch, velocity: int, now: float, cycle: float) -> None:
        low, high = watch.limits.window
        reach = watch.position + velocity * watch.limits.speed * (now - watch.taken + cycle)
        limit = high if velocity > 0 else low
        if (reach - limit) * velocity > 0:
            text = f"at {watch.position} counts, and its window ends at {limit}"
            self._trip("window", index, watch, velocity, watch.position, limit, 0.0, text)

    # -- behind a block --------------------------------------------------------------------------------------------

    def see(
        self, index: int, position: int | None, strain: int | None, velocity: int, taken: float, now: float
    ) -> None:
        """One motor's feedback: `velocity` was in force when it was taken, which was at `taken`."""
        self._now = now
        watch = self._watched.get(index)
        if watch is None:
            return
        direction = (velocity > 0) - (velocity < 0)
        turned = direction != watch.direction
        watch.direction = direction
        if strain is not None and "strain" in self._on and direction:
            self._strain(index, watch, strain, velocity, turned)
        if position is None:
            return
        if "window" in self._on and implausible(index, position):
            most = TRAVEL[index == 3]
            text = f"position {position} is impossible, because the travel ends at about {most}"
            self.events.append(Event(now, "window", index, position, most, 0.0, text, ends=True))
        if turned or not direction:
            watch.mark = (now, position)
        elif "stall" in self._on:
            self._stall(index, watch, position, velocity, now)
        watch.position, watch.taken = position, taken

    def heat(self, tenths: int) -> None:
        lost = unmeasured(tenths)
        if "heat" in self._on and (lost or tenths > self._heat):
            limit = "which is impossible" if lost else f"and the limit is {self._heat / 10:.1f} °C"
            text = f"{tenths / 10:.1f} °C, {limit}"
            self.events.append(Event(self._now, "heat", None, tenths / 10, self._heat / 10, 0.0, text, ends=True))

    def _strain(self, index: int, watch: _Watch, strain: int, velocity: int, turned: bool) -> None:
        low, high = watch.limits.strain
        if turned:
            watch.strain_at_turn = strain if velocity < 0 else None
        over, under = high < OFF and strain > high, low < OFF and strain < low
        begun = watch.strain_at_turn
        if begun is not None:  # opening relieves it
            over, under = over and strain > begun + WORSE, under and strain < begun - WORSE
        if over or under:
            limit = high if over else low
            text = f"strain {strain}, and its limit is {limit}"
            self._trip("strain", index, watch, velocity, strain, limit, 0.0, text)

    def _stall(self, index: int, watch: _Watch, position: int, velocity: int, now: float) -> None:
        limits = watch.limits
        since, place = watch.mark
        speed = abs(velocity) * limits.speed
        gained = (position - place) * watch.direction
        if gained >= limits.quantum and gained >= speed * (now - since) / LEAST_SHARE:
            watch.mark = (now, position)
        elif now - since > max(
            limits.stall, LEAST_SHARE * limits.quantum / speed
        ):  # a slow motor needs long for a count
            text = f"has not advanced for {(now - since) * 1000:.0f} ms (at {position} counts), TSTOP is {limits.stall * 1000:.0f}"
            self._trip("stall", index, watch, velocity, position, limits.stall, now - since, text)

    def _trip(
        self, guard: str, index: int, watch: _Watch, velocity: int, value: float, limit: float, after: float, text: str
    ) -> None:
        if watch.held:
            return
        watch.held, watch.guard = (1 if velocity > 0 else -1), guard
        self.events.append(Event(self._now, guard, index, value, limit, after, f"{text}: velocity 0"))


def check_opening(index: int, velocity: int, limits: Limits) -> None:
    """Raise UsageError when a velocity opens faster than HI may (§5.3.4 IVEL: it deforms the washers for good)."""
    fast = -velocity * limits.factor
    if fast > limits.opening:
        raise UsageError(
            f"{MOTORS[index]}: velocity {velocity} x LCVC {limits.factor} opens at {fast / 16:.1f} counts per sample, but "
            f"IVEL allows {limits.opening / 16:.2f}",
            hint="use a smaller velocity or LCVC. --force opens that fast anyway, which may deform the clutch's washers permanently (barrett §5.3.4 IVEL)",
            code="opening-speed",
        )
