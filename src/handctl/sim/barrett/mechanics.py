"""The body of the simulated BarrettHand: four motors that move together, heat, uptime (barrett §5.2.1, §5.4, §5.5, §9).

Knows parameters, encoder counts and seconds, no bytes. Everything is computed in closed form: at the start of a drive, or when
something gets in its way, `predict` says when and where it will end. Counts run from the hard stop of the fully open joint
("place"); the hand shows them from an origin that `HI` sets. Stiffness, play and the shape of an obstacle are invented, and so
is heating; the sample time is that of the motor controller (§5.3.4 SAMPLE). One movement is under way at a time; it is over when
every motor has ended (§5.5).
"""

from __future__ import annotations

import math

from handctl.sim.barrett.parameter_tables import ABORTED, MOVES, NOT_INITIALIZED, NOT_REACHED, TOO_HOT, Memory

NAMES = ("F1", "F2", "F3", "S")
TRAVEL = (17841.0, 17862.0, 17883.0, 3158.0)  # place of the closed stop; fingers differ by tens (§5.3.2)
PLACES = (1071.0, 2092.0, 3113.0, 404.0)  # where the joints are at the first start
# Place of the origin at the first start: the default IOFF, counted from the open stop (§5.3.4).
OFFSETS = (50.0, 50.0, 50.0, 0.0)
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
        self.origin = OFFSETS[number]
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
        """The encoder count from the origin. Below 0 between the origin and the open stop, IOFF counts apart (§5.3.4)."""
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
        ends = [(TRAVEL[self.number] - begin if sign > 0 else begin, STALL)]
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


TEMPERATURE, PEAK = 412.0, 573.0  # 0.1 °C, at the first start
UPTIME, SERIAL = 7345678.0, 1042  # s; number
SETTLING = 60.0  # s, time constant of heat
MOVING, HOLDING = 12.0, 6.0  # 0.1 °C above rest for each motor, once settled; more with TSTOP above 30 (§5.3.4)


class Movement:
    """The movement command under way."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.running: list[Motor] = []
        self.code = 0  # sum of the status codes so far (§5.1.3)
        self.end = 0.0  # of the last motor that ended


class Hand:
    def __init__(self, memory: Memory, clock: float, align: float) -> None:
        """`clock` of the motor controllers in Hz, `align` seconds that HI takes beside its movements."""
        self.memory = memory
        self.motors = [Motor(number) for number in range(4)]
        self.clock = clock
        self.align = align
        self.now = 0.0
        self.powered = False
        self.temperature = self.ambient = TEMPERATURE
        self.peak = PEAK
        self.uptime = UPTIME
        self.serial = SERIAL
        self.movement: Movement | None = None

    # -- time --------------------------------------------------------------------------------------------------------

    def advance(self, now: float) -> None:
        while self.movement is not None and (event := self.next_event()) is not None and event <= now:
            self._elapse(event)
            self._end_motors()
        if now > self.now:
            self._elapse(now)

    def next_event(self) -> float | None:
        """When the next motor ends, or the over-temperature trip comes."""
        if self.movement is None or not self.movement.running:
            return None
        return max(self.now, min([motor.end for motor in self.movement.running] + self._trip()))

    def _elapse(self, now: float) -> None:
        seconds = now - self.now
        if seconds > 0.0:
            settled = self._settled()
            self.temperature = settled + (self.temperature - settled) * math.exp(-seconds / SETTLING)
            self.peak = max(self.peak, self.temperature)
            if self.powered:
                self.uptime += seconds
            self.now = now

    def _settled(self) -> float:
        load = 0.0
        for motor in self.motors:
            if motor.powered:
                hot = max(1.0, min(10.0, self.memory.motor.get("TSTOP", motor.number) / 30.0))
                load += MOVING * hot if motor.drive is not None else HOLDING
        return min(1250.0, self.ambient + load)

    def _trip(self) -> list[float]:
        """The moment at which the temperature passes OTEMP, if it will under the present load."""
        limit, settled = self.memory.common.get("OTEMP") + 0.501, self._settled()  # a little more than half: see tenths
        if limit < 1.0 or settled <= limit:
            return []
        if self.temperature > limit:
            return [self.now]
        return [self.now + SETTLING * math.log((settled - self.temperature) / (settled - limit))]

    def too_hot(self) -> bool:
        """OTEMP is set and exceeded (§5.4.1); compared as TEMP shows it."""
        return 0 < self.memory.common.get("OTEMP") < self.tenths()

    def tenths(self) -> int:
        """TEMP, 0.1 °C."""
        return max(-550, min(1250, math.floor(self.temperature + 0.5)))

    def set_temperature(self, tenths: int) -> None:
        """At once and for good; load heats further."""
        self.temperature = self.ambient = float(tenths)
        self.peak = max(self.peak, self.temperature)

    # -- movements -----------------------------------------------------------------------------------------------------

    def start(self, kind: str, motors: tuple[int, ...], argument: int | None) -> None:
        """Starts a movement command (§5.2.1); motors that are not initialized, or missing, give their code."""
        assert kind in MOVES
        movement = Movement(kind)
        movement.end = self.now
        for number in motors:
            motor = self.motors[number]
            motor.flipped = bool(self.memory.motor.get("SGFLIP", number))
            if motor.fault or (kind != "HI" and not motor.initialized):
                movement.code |= self.unready((number,))
                continue
            motor.cruise(self.now, 0.0)
            if kind in ("O", "TO", "HI"):
                motor.broke, motor.broke_at = False, 0  # 4.34
            if kind == "HI":
                motor.initialized = False
            motor.begin(self._plan(kind, motor, argument))
            movement.running.append(motor)
        self.movement = movement
        self._end_motors()

    def sample(self, motor: Motor) -> float:
        """Sample time of the motor's controller in s (§5.3.4 SAMPLE)."""
        return 16.0 * (self.memory.motor.get("SAMPLE", motor.number) + 1) / self.clock

    def _plan(self, kind: str, motor: Motor, argument: int | None) -> Drive:
        """The drive of one motor: profile from its own parameters (§9.2)."""

        def value(name: str) -> int:
            return self.memory.motor.get(name, motor.number)

        sample = self.sample(motor)
        here = motor.position(self.now)
        goal: int | None = None
        if kind == "M":
            goal = value("DP") if argument is None else argument
        elif kind in ("IC", "IO"):
            step = value("DS") if argument is None else argument
            goal = here + (step if kind == "IC" else -step)
        elif kind == "HOME":
            goal = 0
        elif kind in ("C", "O"):
            goal = value("CT" if kind == "C" else "OT")
        closing = kind == "TC" if goal is None else goal >= here
        name = "IVEL" if kind == "HI" else "MCV" if closing else "MOV"
        speed = value(name) / 16.0 / sample
        sign = 1 if closing else -1
        if motor.reversed and kind != "HI":
            sign = -sign
        if goal is None:
            drive = Drive(self.now, motor.place, sign, None, speed, 0.0)
        else:
            way = abs(goal - here)
            drive = Drive(self.now, motor.place, sign, float(way), speed, value("ACCEL") / 256.0 / sample / sample)
        drive.stop = value("TSTOP") / 1000.0
        if kind == "HI":
            drive.offset, drive.hits = value("IOFF"), value("IHIT")
            drive.after = self.align + drive.hits * (2.0 * BOUNCE / speed + drive.stop) + drive.offset / speed
            return drive
        drive.high, drive.low = value("HSG"), value("LSG")
        drive.goal = None if kind in ("C", "O") else goal
        if kind in ("TC", "TO"):
            drive.speed *= FRICTION[motor.number]
            drive.press = min(120.0, PRESS * value(name) / 100.0 * value("FPG") / 10.0)
        drive.stop_at_breakaway = "BS" in self.memory.motor.values and bool(value("BS"))
        return drive

    def _end_motors(self) -> None:
        movement = self.movement
        if movement is None or not movement.running:
            return
        if self.too_hot():  # a trip during a movement ends it, our guess
            self.stop(TOO_HOT)
            return
        for motor in [motor for motor in movement.running if motor.end <= self.now]:
            self._end(movement, motor, motor.cause, 0)

    def _end(self, movement: Movement, motor: Motor, cause: str, code: int) -> None:
        drive = motor.drive
        assert drive is not None
        error = code
        if not code and drive.goal is not None:
            short = abs(drive.goal - motor.position(self.now))
            if short > self.memory.motor.get("MPE", motor.number):
                error = NOT_REACHED
        motor.finish(self.now, cause, bool(self.memory.motor.get("HOLD", motor.number)), error)
        movement.running.remove(motor)
        movement.code |= error
        movement.end = self.now

    def stop(self, code: int = ABORTED) -> None:
        """Ends all motors where they are: ^C (§5.5 case 4), or the over-temperature trip."""
        if self.movement is not None:
            for motor in list(self.movement.running):
                self._end(self.movement, motor, ABORT, code)
            self.movement.code |= code

    def unready(self, motors: tuple[int, ...]) -> int:
        """The codes of motors that are not initialized or missing."""
        code = 0
        for motor in [self.motors[number] for number in motors]:
            code |= motor.fault or (0 if motor.initialized else NOT_INITIALIZED)
        return code

    def terminate(self, motors: tuple[int, ...]) -> int:
        """T: power off; the codes of motors that are not ready (§5.2.1)."""
        for number in motors:
            self.motors[number].cruise(self.now, 0.0)
            self.motors[number].powered = False
        return self.unready(motors)

    def disturbed(self) -> None:
        """Something in the way of the motors has changed."""
        for motor in self.motors:
            motor.predict(self.now)

    def push(self, number: int, position: int) -> bool:
        """A person moves a joint to this position; only a spread without power yields (§9.3.2)."""
        motor = self.motors[number]
        if number != 3 or motor.powered or motor.drive is not None:
            return False
        motor.counts += abs(position - motor.position(self.now))
        motor.jump(self.now, position)
        return True

    def power(self, on: bool) -> None:
        self.powered = on
        self.movement = None
        for motor in self.motors:
            motor.place = motor.now_at(self.now)
            motor.power_on()
