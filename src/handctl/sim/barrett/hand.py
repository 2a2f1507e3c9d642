"""The body of the simulated BarrettHand: four motors that move together, heat, uptime (barrett §5.2.1, §5.4, §5.5).

Knows parameters, counts and seconds, no bytes. One movement is under way at a time; it is over when every motor has
ended (§5.5). Heating is invented; the sample time is that of the motor controller (§5.3.4 SAMPLE).
"""

from __future__ import annotations

import math

from handctl.sim.barrett.memory import Memory
from handctl.sim.barrett.motor import ABORT, BOUNCE, FRICTION, PRESS, Drive, Motor
from handctl.sim.barrett.tables import ABORTED, MOVES, NOT_INITIALIZED, NOT_REACHED, TOO_HOT

TEMPERATURE, PEAK = 412.0, 573.0  # 0.1 °C, at the first start
UPTIME, SERIAL = 7345678.0, 1042  # s; number
SETTLING = 60.0  # s, time constant of heat
MOVING, HOLDING = 12.0, 6.0  # 0.1 °C above rest for each motor, once settled; more with TSTOP above 30 (§5.3.4)


class Movement:
    """The movement command under way."""

    __slots__ = ("code", "end", "kind", "running")

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
        while (event := self.next_event()) is not None and event <= now:
            self._elapse(event)
            self._end_motors()
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

    def start(self, kind: str, motors: tuple[int, ...], argument: int | None) -> Movement:
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
        return movement

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
        self.put(number, position)
        return True

    def put(self, number: int, position: int) -> None:
        """Puts the joint at a position past all rules."""
        self.motors[number].jump(self.now, position)

    def power(self, on: bool) -> None:
        self.powered = on
        self.movement = None
        for motor in self.motors:
            motor.place = motor.now_at(self.now)
            motor.power_on()
