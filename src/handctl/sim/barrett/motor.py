"""One motor of the simulated BarrettHand: trapezoidal profile, stops, obstacles, strain, breakaway (barrett §5.5, §9).

Knows encoder counts and seconds, no commands and no bytes. Everything is computed in closed form: at the start of a
drive, or when something gets in its way, `predict` says when and where it will end.

Counts run from the hard stop of the fully open joint ("place"); the hand shows them from an origin that `HI` sets.
Stiffness, play and the shape of an obstacle are invented.
"""

from __future__ import annotations

import math

NAMES = ("F1", "F2", "F3", "S")
TRAVEL = (17841.0, 17862.0, 17883.0, 3158.0)  # place of the closed stop; fingers differ by tens (§5.3.2)
PLACES = (1071.0, 2092.0, 3113.0, 404.0)  # where the joints are at the first start
STOPS = (50.0, 50.0, 50.0, 0.0)  # place of the open stop outside HI: the washers give way by the default IOFF
NO_LOAD = (112, 119, 126, 255)  # strain readings; the spread has no gauge (§5.3.2), 100 to 140 (§9.4)
FRICTION = (0.97, 1.0, 1.03, 1.0)  # TC and TO do not hold their speed exactly (§8)
ODOMETERS = (104233000.0, 98712000.0, 110003000.0, 20117000.0)  # counts
STIFFNESS = 0.2  # strain per count into an obstacle
PRESS = 60.0  # strain at which a motor stalls against an obstacle, at the default speed and gain (§9.3.1)
FAR = 60000.0  # no joint gets beyond this place, whatever control commands say
BOUNCE = 200.0  # counts that HI backs off for each further hit

GOAL, STALL, STRAIN, BREAK, ABORT = "goal", "stall", "strain", "breakaway", "abort"


class Drive:
    """A motion under way. Speed in counts/s, accel in counts/s² (0: at full speed at once), way in counts.

    `way` None: no goal, until the motor stalls. `stop` is TSTOP in s, `after` what HI adds to it; `low` and `high` are
    the strain limits in force, `press` the strain at which the motor stalls.
    """

    __slots__ = ("accel", "after", "begin", "goal", "high", "hits", "low", "offset", "press", "sign", "speed",
                 "start", "stop", "stop_at_breakaway", "way")  # fmt: skip

    def __init__(self, start: float, begin: float, sign: int, way: float | None, speed: float, accel: float) -> None:
        self.start = start
        self.begin = begin
        self.sign = sign
        self.way = way
        self.speed = speed
        self.accel = accel
        self.goal: int | None = None  # P that a position command must reach
        self.stop = 0.0
        self.after = 0.0
        self.offset: int | None = None  # IOFF; this drive is part of HI
        self.hits = 0  # IHIT
        self.low, self.high = 256, 256
        self.press = PRESS
        self.stop_at_breakaway = False

    def _ramps(self, way: float) -> tuple[float, float, float]:
        """Ramp time, ramp distance and top speed of the trapezoid, or triangle, of this length (§9.2.1)."""
        top = min(self.speed, math.sqrt(self.accel * way))
        return top / self.accel, top * top / self.accel / 2.0, top

    def gone(self, now: float) -> float:
        """Counts covered by the profile so far."""
        seconds = max(0.0, now - self.start)
        if self.way is None:
            return self.speed * seconds
        if self.way <= 0.0 or self.accel <= 0.0:
            return 0.0
        ramp, ramp_way, top = self._ramps(self.way)
        total = 2.0 * ramp + (self.way - 2.0 * ramp_way) / top
        if seconds >= total:
            return self.way
        if seconds < ramp:
            return self.accel * seconds * seconds / 2.0
        if seconds <= total - ramp:
            return ramp_way + top * (seconds - ramp)
        return self.way - self.accel * (total - seconds) ** 2 / 2.0

    def reach(self, way: float) -> float:
        """The time at which so many counts are covered; at most the length of the drive."""
        if self.way is None:
            return self.start + way / self.speed
        if self.way <= 0.0 or self.accel <= 0.0:
            return self.start
        ramp, ramp_way, top = self._ramps(self.way)
        if way < ramp_way:
            return self.start + math.sqrt(2.0 * way / self.accel)
        total = 2.0 * ramp + (self.way - 2.0 * ramp_way) / top
        if way <= self.way - ramp_way:
            return self.start + ramp + (way - ramp_way) / top
        return self.start + total - math.sqrt(2.0 * max(0.0, self.way - way) / self.accel)


class Motor:
    """A motor with its joint, its gauge, and what is in its way."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.place = PLACES[number]
        self.origin = STOPS[number]
        self.counts = ODOMETERS[number]  # travelled in its life (§5.3.2)
        self.no_load = NO_LOAD[number]
        self.flipped = False  # SGFLIP
        self.jammed = False
        self.reversed = False
        self.obstacle: float | None = None  # place of an object on the closing side
        self.clutch: float | None = (
            None  # place at which the inner link meets something and the clutch lets go (§9.3.1)
        )
        self.strain: int | None = None  # reading forced from outside
        self.fault = 0  # status code of missing electronics
        self.initialized = False
        self.powered = False
        self.code = 0  # status code of the last movement
        self.broke = False  # BD
        self.broke_at = 0  # BP
        self.reported = 0  # the position that FGET P or LFDP last told (§6.2.3)
        self.drive: Drive | None = None
        self.end = 0.0  # of the drive, if nothing changes
        self.end_place = 0.0
        self.cause = GOAL

    def power_on(self) -> None:
        """The encoder is incremental: counting starts at 0 wherever the joint is; HI is needed (§5.2.1)."""
        self.drive = None
        self.powered = self.initialized = self.broke = False
        self.code = self.broke_at = self.reported = 0
        self.place = float(round(self.place))
        self.origin = self.place

    # -- readings ----------------------------------------------------------------------------------------------------

    def now_at(self, now: float) -> float:
        """The place at this moment."""
        if self.drive is None:
            return self.place
        at = self.drive.begin + self.drive.sign * self.drive.gone(now)
        return min(at, self.end_place) if self.drive.sign > 0 else max(at, self.end_place)

    def position(self, now: float) -> int:
        """P."""
        return 0 if self.fault else round(self.now_at(now) - self.origin)

    def status(self) -> int:
        """S: the sum of what is wrong (§5.3.2)."""
        return self.fault or (self.code if self.initialized else self.code | 4)

    def velocity(self, now: float) -> float:
        """Counts/s in RealTime mode, 0 once it has stalled."""
        if self.drive is None or self.now_at(now) == self.end_place:
            return 0.0
        return self.drive.sign * self.drive.speed

    def odometer(self, now: float) -> int:
        """OD, in 1000 counts."""
        return int((self.counts + abs(self.now_at(now) - self.place)) / 1000.0 + 0.000001)

    def gauge(self, now: float) -> int:
        """SG: 0 to 255, 255 without a gauge (§5.3.2)."""
        at = self.now_at(now)
        base, slope = self._law()
        touch = at if self.obstacle is None else self.obstacle
        return max(0, min(255, int(base + slope * max(0.0, at - touch) + 0.000001)))

    def _law(self) -> tuple[float, float]:
        """Reading without load and its slope per count into the obstacle."""
        if self.strain is not None or self.no_load == 255:
            return (float(self.no_load if self.strain is None else self.strain), 0.0)
        return (255.0 - self.no_load, -STIFFNESS) if self.flipped else (float(self.no_load), STIFFNESS)

    # -- driving -----------------------------------------------------------------------------------------------------

    def begin(self, drive: Drive) -> None:
        self.drive = drive
        self.powered = True
        self.code = 0
        self.predict(drive.start)

    def cruise(self, now: float, velocity: float, press: float = PRESS) -> None:
        """RealTime mode: this velocity (counts/s, reached at once) from now on, until another one or a stall.

        Neither TSTOP nor the strain limits are said to act there (§6); friction is as in TC. 0 stands still.
        """
        velocity *= FRICTION[self.number] * (-1.0 if self.reversed else 1.0)
        old = self.drive
        if old is not None:
            if old.sign * old.speed == velocity and old.press == press:
                return
            at = self.now_at(now)
            self._pass(old, at)
            self.place = at if velocity else float(round(at))
            self.drive = None
        if velocity:
            self._run(now, velocity, press)

    def _run(self, now: float, velocity: float, press: float) -> None:
        self.drive = Drive(now, self.place, 1 if velocity > 0.0 else -1, None, abs(velocity), 0.0)
        self.drive.press = press
        self.predict(now)

    def jump(self, now: float, position: int) -> None:
        """The joint is at this position all of a sudden; its drive goes on from there."""
        self.place = max(-FAR, min(FAR, self.origin + position))
        if self.drive is not None:
            self._run(now, self.drive.sign * self.drive.speed, self.drive.press)

    def _pass(self, drive: Drive, at: float) -> None:
        """The drive has come to this place: travel, and the clutch that it went past."""
        if self.clutch is not None and drive.sign > 0 and drive.begin <= self.clutch <= at and not self.broke:
            self.broke, self.broke_at = True, round(self.clutch - self.origin)
        self.counts += abs(at - drive.begin)

    def predict(self, now: float) -> None:
        """Where, when and why the drive ends (§5.5), from the present moment on."""
        drive = self.drive
        if drive is None:
            return
        gone = min(drive.gone(now), abs(self.end_place - drive.begin)) if now > drive.start else 0.0
        if drive.way is None and drive.gone(now) > gone:
            drive.start = now - gone / drive.speed  # it has stood still for a while
        ends = self._obstructions(drive, gone)
        if drive.way is not None and (drive.accel > 0.0 or drive.way == 0.0):
            ends.append((drive.way, GOAL))
        elif drive.way is not None:
            ends.append((0.0, STALL))  # without acceleration it never moves
        way, self.cause = min(ends, key=lambda end: (end[0], end[1] == STALL))
        way = max(way, gone)
        self.end_place = drive.begin + drive.sign * way
        self.end = max(now, drive.reach(way))
        if self.cause == STALL:
            self.end += drive.stop + drive.after

    def _obstructions(self, drive: Drive, gone: float) -> list[tuple[float, str]]:
        """(counts from the begin, cause) of everything but the goal that can end the drive."""
        begin, sign = drive.begin, drive.sign
        opened = 0.0 if drive.offset is not None else min(STOPS[self.number], begin)
        ends = [(TRAVEL[self.number] - begin if sign > 0 else begin - opened, STALL)]
        if self.jammed:
            ends.append((gone, STALL))
        base, slope = self._law()
        touch = TRAVEL[self.number] + 1.0 if self.obstacle is None else self.obstacle
        if sign > 0 and self.obstacle is not None:
            ends.append((touch - begin + drive.press / STIFFNESS, STALL))
        reading = int(base + slope * max(0.0, begin + sign * gone - touch) + 0.000001)
        # A limit of 255 or 256 means no check (§5.3.1); `first` is the first reading that is past the limit
        # at a whole count.
        for limit, first, past in (
            (drive.high, drive.high + 1.0, reading > drive.high),
            (drive.low, drive.low - STIFFNESS - 0.01, reading < drive.low),
        ):
            if limit < 255 and past:
                ends.append((gone, STRAIN))
            elif limit < 255 and slope:
                depth = (first - base) / slope
                way = sign * (touch + depth - begin)
                if depth > 0.0 and way > gone:
                    ends.append((way, STRAIN))
        if drive.stop_at_breakaway and self.clutch is not None and sign > 0 and self.clutch >= begin:
            ends.append((self.clutch - begin, BREAK))
        return ends

    def finish(self, now: float, cause: str, hold: bool, error: int) -> None:
        """Ends the drive here and now; `error` is the code for a goal that was not reached within MPE."""
        drive = self.drive
        assert drive is not None
        at = self.now_at(now)
        self._pass(drive, at)
        self.place = float(round(at))
        self.drive = None
        self.powered = hold
        if drive.offset is not None and cause == STALL:
            # The offset moves the joint back from the stop, and this is the origin. A jam is taken for the stop.
            self.counts += 2.0 * BOUNCE * drive.hits
            if not self.jammed:
                self.place += drive.offset
                self.counts += drive.offset
            self.origin, self.initialized = self.place, True
        self.code = error
