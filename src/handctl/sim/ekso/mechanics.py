"""The body of the simulated EksoNR and its clocks: posture, joints, pressures, currents; BootTime and calendar.

Knows no message and reads no clock. Angles in degrees, lengths in inches, time in seconds, passed in. The postures, their durations,
the leg equations and BootTime's ticks of 2 ms are those of a field log; the walking pattern, its state value, the pressures' course
and the small motion at rest are invented.

BootTime need not run as other clocks do: it drifts as any crystal, and `Unrest` has it jump, or the device restart.
"""

from __future__ import annotations

from math import cos, floor, pi, radians, sin

from handctl.sim.engine.simulated_device import Random

LEAN_TIME, RISE_TIME = 7.8, 3.7  # s; trunk forward without current, then the joints driven
FOOT_X, FOOT_Y = 2.75, 4.0  # in, from the leg equations
POSTURES = ("sitting", "standing", "walking", "rising", "lowering", "held")
SITTING, STANDING, BETWEEN, WALKING = 4160, 8256, 12352, 17472  # 1040 2040 3040 hex; 4440 is invented
DRIVEN = 1024  # added while the joints are driven
RIGHT, LEFT = 0, 1
LEFT_HIP, KNEES = 0.9, (0.2, 1.4)  # deg: the legs never agree to the hundredth, so that swapped sides show


class Body:
    """Posture as a place on the way from sitting (0.0) over trunk forward (1.0) to standing (2.0), and a direction."""

    def __init__(self, sway: bool) -> None:
        self.place = 2.0
        self.direction = 0  # 1 rising, -1 lowering, 0 at rest
        self.walking = False
        self.stride = 0.0  # half steps since walking began, with fraction
        self.steps = 0  # since the last look, see take_steps
        self.upright = 0.0  # s, standing or walking
        self.walked = 0.0  # s
        self.clock = 0.0  # s of body time, for everything that swings
        self.fidgets = False
        self.sway = sway
        self.frozen: tuple[float, ...] | None = None  # pitch, roll, right hip, knee, left hip, knee instead of all this

    # -- posture ------------------------------------------------------------------------------------------------------

    @property
    def state(self) -> int:
        """The State word."""
        if self.walking:
            return WALKING
        if self.place == 0.0:
            return SITTING
        if self.place == 2.0:
            return STANDING
        return BETWEEN + (DRIVEN if self.direction and self.place >= 1.0 else 0)

    @property
    def posture(self) -> str:
        if self.direction:
            return "rising" if self.direction > 0 else "lowering"
        return {SITTING: "sitting", STANDING: "standing", WALKING: "walking"}.get(self.state, "held")

    def pose(self, name: str) -> None:
        """Is in this posture at once; rising starts from the chair, lowering from standing, held is half way."""
        self.place = {"sitting": 0.0, "rising": 0.0, "held": 1.5}.get(name, 2.0)
        self.direction = {"rising": 1, "lowering": -1}.get(name, 0)
        # A movement has left its end, and says so at once.
        self.place += self.direction * 1e-9
        self.walk(name == "walking")

    def walk(self, on: bool) -> None:
        self.walking = on
        self.stride = 0.0

    def move(self, direction: int) -> None:
        """Sets out to stand up (1) or to sit down (-1) from where it is; nothing when it is there."""
        self.walk(False)
        if 0.0 <= self.place + direction * 1e-9 <= 2.0:
            self.direction = direction
            self.place += direction * 1e-9

    def stop(self) -> None:
        """Ends any movement; between sitting and standing the joints stay where they are."""
        self.walk(False)
        self.direction = 0
        self.place = round(self.place, 6)

    # -- time ---------------------------------------------------------------------------------------------------------

    def advance(self, seconds: float, swing_time: float) -> None:
        """`swing_time` is that of the settings; a half step takes it and 0.4 s more."""
        self.clock += seconds
        if self.walking:
            before = floor(self.stride)
            self.stride += seconds / (max(swing_time, 0.1) + 0.4)
            self.steps += floor(self.stride) - before
            self.walked += seconds
        left = seconds
        while self.direction and left > 0.0:
            left = self._go(left)
        if self.place == 2.0:
            self.upright += left

    def _go(self, seconds: float) -> float:
        """Moves to the end of the present part of the way at most; returns the time that is left."""
        ahead = self.direction > 0
        leaning = self.place < 1.0 or (self.place == 1.0 and not ahead)
        target = (1.0 if ahead else 0.0) if leaning else (2.0 if ahead else 1.0)
        rate = 1.0 / (LEAN_TIME if leaning else RISE_TIME)
        needed = abs(target - self.place) / rate
        if needed > seconds:
            self.place += self.direction * rate * seconds
            return 0.0
        self.place = target
        if target in (0.0, 2.0):
            self.direction = 0
        return seconds - needed

    def take_steps(self) -> int:
        steps, self.steps = self.steps, 0
        return steps

    # -- readings -----------------------------------------------------------------------------------------------------

    def angles(self) -> tuple[float, ...]:
        """Torso pitch and roll, right hip and knee, left hip and knee."""
        if self.frozen is not None:
            return self.frozen
        pitch, hip, knee = _way(self.place)
        angles = [pitch, 0.8, hip, knee + KNEES[RIGHT], hip + LEFT_HIP, knee + KNEES[LEFT]]
        if self.walking:
            turn = pi * self.stride
            angles = [7.0 + sin(2.0 * turn), 2.5 * sin(turn)]
            for phase in (turn, turn + pi):
                angles += [8.0 + 20.0 * sin(phase), 8.0 + 45.0 * max(0.0, cos(phase)) ** 2]
            angles[4] += LEFT_HIP
            angles[5] += KNEES[LEFT]
        if self.sway:
            # Well below 1 deg/s: a wearer who keeps still.
            for number, (size, rate) in enumerate(
                ((0.12, 0.23), (0.1, 0.31), (0.06, 0.27), (0.04, 0.19), (0.05, 0.37), (0.03, 0.41))
            ):
                angles[number] += size * sin(2.0 * pi * rate * self.clock)
        if self.fidgets:
            # A quarter turn apart, so that one leg is fast at any time and over any window up to 1 s.
            turn = 1.4 * pi * self.clock
            angles[2] += 6.0 * sin(turn)
            angles[4] += 6.0 * cos(turn)
        return tuple(angles)

    def currents(self) -> tuple[float, ...]:
        """A: right hip and knee, left hip and knee. Exactly 0 without drive: sitting, and trunk forward."""
        if self.walking:
            turn = pi * self.stride
            return (3.9 * sin(turn), -2.1 - 1.6 * cos(turn), -3.6 * sin(turn), -2.4 + 1.7 * cos(turn))
        if self.place == 2.0:
            ripple = 0.05 * sin(2.0 * pi * 0.7 * self.clock) if self.sway else 0.0
            return (1.45 + ripple, -0.38, 2.35 - ripple, -0.72)
        if not self.state & DRIVEN:
            return (0.0, 0.0, 0.0, 0.0)
        done = self.place - 1.0
        wave = sin(2.0 * pi * done)
        hip, knee = (-6.0 if wave > 0.0 else -4.0) * wave, -7.9 * sin(pi * done)
        return (0.93 * hip, 0.47 * knee, hip, knee)

    def pressures(self) -> tuple[float, ...]:
        """Counts: right toe and heel, left toe and heel. The right sensors have twice the gain of the left ones."""
        rock = sin(2.0 * pi * 0.23 * self.clock) if self.sway else 0.0
        if self.walking:
            turn = pi * self.stride
            right, left = 0.5 - 0.5 * sin(turn), 0.5 + 0.5 * sin(turn)
            toe = 0.5 + 0.5 * cos(turn)
            return (2700.0 * right * toe, 990.0 * right * (1.0 - toe), 1430.0 * left * (1.0 - toe), 520.0 * left * toe)
        load = 0.06 + 0.94 * max(0.0, self.place - 1.0)
        return tuple(
            load * value
            for value in (260.0 + 30.0 * rock, 710.0 - 40.0 * rock, 130.0 + 15.0 * rock, 390.0 - 20.0 * rock)
        )

    def weight_shift(self) -> float:
        return 0.4 * sin(pi * self.stride) if self.walking else 1.0

    def buttons(self) -> int:
        """LCD Button State: values of the log; which button they are is unknown, 0010 hex comes with standing up."""
        if self.direction > 0 and self.place < 0.06:
            return 16
        return 21760 if self.walking else 16640 if self.place == 2.0 else 16384 if self.place > 0.0 else 0


def hips(pitch: float, hip: float, knee: float, upper: float, lower: float) -> tuple[float, float]:
    """Place of a hip over its foot, forward and up, from angles in degrees and leg lengths."""
    thigh = radians(hip - pitch)
    shank = thigh - radians(knee)
    return FOOT_X - upper * sin(thigh) - lower * sin(shank), FOOT_Y + upper * cos(thigh) + lower * cos(shank)


def _way(place: float) -> tuple[float, float, float]:
    """Pitch, hip and knee angle on the way from sitting (0) to standing (2)."""
    if place <= 1.0:
        return -10.0 + 20.0 * place, 78.0 + 26.0 * place, 103.0 + 6.0 * place
    done = place - 1.0
    # Speeds up for a quarter of the time and slows down for a quarter: at most 40 deg/s at the knee.
    if done < 0.25:
        part = done * done * 8.0 / 3.0
    elif done <= 0.75:
        part = (done - 0.125) * 4.0 / 3.0
    else:
        part = 1.0 - (1.0 - done) * (1.0 - done) * 8.0 / 3.0
    return 10.0 - 4.0 * part + 12.0 * sin(pi * done), 104.0 - 105.0 * part, 109.0 - 109.0 * part


# -- the clock --------------------------------------------------------------------------------------------------------


TICK_MS = 2
WRAP = 4294967296  # ms; BootTime is two words
FIRST_BOOT_MS = 1  # after a restart; every value of the log was odd

SIZES = {
    # ppm of drift, ms of a jump, ms that a restart takes: least and most of each; None: it does not restart
    "little": ((5, 100), (2, 20), None),
    "middling": ((300, 3000), (80, 900), (100, 900)),
    "much": ((20000, 60000), (5000, 700000), (300, 3000)),
}
FIRST_EVENT_MS, BETWEEN_MS = 2000, (1500, 2500)
SOON_MS = (200, 700)  # from the end of a restart to the next one: BootTime is small both times


class BootTime:
    """Milliseconds since power-on, always odd."""

    def __init__(self, start: int, drift: int = 0) -> None:
        self.start = start | 1
        self.since = 0.0
        self._per_second = 500.0 * (1.0 + drift / 1000000.0)  # ticks

    def restart(self, start: int, now: float) -> None:
        self.start = start | 1
        self.since = now

    def read(self, now: float) -> int:
        # A millionth of a tick of rounding is forgiven.
        return (self.start + TICK_MS * int((now - self.since) * self._per_second + 0.000001)) % WRAP


class Unrest:
    """How a device's clock and others disagree: `drift` in ppm, `events` of seconds from the start, what happens, and how much.

    jump MS: BootTime goes ahead or back; restart MS: the device is off for so long, and BootTime begins again.
    """

    def __init__(self, drift: int, events: tuple[tuple[float, str, int], ...] = ()) -> None:
        self.drift = drift
        self.events = events
        self._next = 0

    @classmethod
    def drawn(cls, size: str, random: Random) -> Unrest:
        """One of SIZES at random: two jumps and, unless it is little, two restarts, in any order."""
        drift, jump, restart = SIZES[size]
        kinds = ["jump", "jump", *(["restart", "restart"] if restart is not None else [])]
        order = [kinds.pop(random.between(0, len(kinds) - 1)) for _ in range(len(kinds))]
        at, events = FIRST_EVENT_MS, []
        for kind, following in zip(order, [*order[1:], ""], strict=True):
            low, high = restart if kind == "restart" and restart is not None else jump
            amount = 2 * (random.between(low, high) // 2)
            sign = 1 if kind == "restart" or random.between(0, 1) else -1
            events.append((at / 1000.0, kind, sign * amount))
            at += random.between(*(SOON_MS if kind == following == "restart" else BETWEEN_MS))
            at += amount if kind == "restart" else 0
        return cls(random.between(*drift) * (1 if random.between(0, 1) else -1), tuple(events))

    def due(self, seconds: float) -> list[tuple[float, str, int]]:
        """The events that have come since the last call."""
        first = self._next
        while self._next < len(self.events) and self.events[self._next][0] <= seconds:
            self._next += 1
        return list(self.events[first : self._next])

    def following(self) -> float | None:
        """When the next one comes."""
        return self.events[self._next][0] if self._next < len(self.events) else None


class Calendar:
    """Date and time of day to the second; it runs on through a power cycle (a guess)."""

    def __init__(self, text: str) -> None:
        self.since = 0.0
        self.set(text, 0.0)

    def set(self, text: str, now: float) -> None:
        """`text` is YYYY-MM-DDTHH:MM:SS, years 2000 to 2099; ValueError for anything else."""
        digits = text[:4] + text[5:7] + text[8:10] + text[11:13] + text[14:16] + text[17:]
        marks = (text[4:5], text[7:8], text[10:11], text[13:14], text[16:17])
        if marks != ("-", "-", "T", ":", ":") or len(digits) != 14 or not (digits.isascii() and digits.isdigit()):
            raise ValueError(f"{text!r} is not YYYY-MM-DDTHH:MM:SS")
        year, month, day = int(digits[:4]), int(digits[4:6]), int(digits[6:8])
        hour, minute, second = int(digits[8:10]), int(digits[10:12]), int(digits[12:])
        if not (2000 <= year <= 2099 and 1 <= month <= 12 and 1 <= day <= _days(year, month)):
            raise ValueError(f"{text!r}: there is no such day in 2000 to 2099")
        if hour > 23 or minute > 59 or second > 59:
            raise ValueError(f"{text!r}: there is no such time of day")
        self.date, self.second, self.since = (year, month, day), hour * 3600 + minute * 60 + second, now

    def read(self, now: float) -> tuple[int, int, int, int, int, int]:
        """Year, month, day, hour, minute, second; after 2099 comes 2000."""
        days, second = divmod(self.second + int(now - self.since + 0.000001), 86400)
        year, month, day = self.date
        while days:
            days -= 1
            day += 1
            if day > _days(year, month):
                day, month = 1, month + 1
            if month > 12:
                month, year = 1, 2000 + (year - 1999) % 100
        return year, month, day, second // 3600, second // 60 % 60, second % 60

    def text(self, now: float) -> str:
        return "{:04}-{:02}-{:02}T{:02}:{:02}:{:02}".format(*self.read(now))


def _days(year: int, month: int) -> int:
    if month == 2:
        return 29 if year % 4 == 0 else 28
    return 30 if month in (4, 6, 9, 11) else 31
