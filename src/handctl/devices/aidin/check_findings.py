"""What `aidin check` makes of what it saw: a row for each sensor and each motor. Pure; the limits are ours, the manual has none.

A value is compared with the same element of the other fingers, because the units of currents and forces are not documented.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, sqrt
from statistics import fmean, median, pstdev

from handctl.devices.aidin.feedback import Wire
from handctl.devices.aidin.map import AIDIN, ENCODERS, FINGERS, some
from handctl.devices.aidin.procedures import STILL, stroke
from handctl.model.checks import FAIL, OK, SKIPPED, WARNING, Check
from handctl.wording import plural

MOTORS, CURRENT, JOINTS, SENSORS = (AIDIN[name] for name in ("motor_pos", "current_state", "joint_pos", "sensor_state"))
AMOUNT = 0.04
"""Share of the stroke that each motor goes: more than three times what counts as arrived."""
FOLLOWS = 0.25
"""Share of its way from which on a motor has moved at all."""
PUSHING = 200
"""Per mille of the rated current that a motor does not draw when it moves freely. Ours, as in `motion`."""
FLOWS = 20
"""The same that is no jitter of the current sensor (2 % of 1000, as for `stop`)."""
UNEVEN = 2.0
"""A motor that needs so many times the current of its neighbours, or so many times less."""
TURNED = 0.3
"""Degrees that a joint turns when its motor moves."""
SAMPLES = 12
"""Fewer values at rest say nothing about noise."""
NOISY = 5.0
"""A sensor so many times as noisy as its neighbours."""
DRIFTS = {"f": 0.1, "t": 0.005}
"""Change in a minute that counts as drift, of forces and of torques, in the unit of the wire."""
SURE = 5.0
"""A drift must be so many times what noise alone explains."""
Numbers = tuple[tuple[str, object], ...]
UNSEEN = "this check saw no movement, so it cannot judge this motor"


def pushes(current: float) -> bool:
    """Whether a motor with this current pushes something."""
    return abs(current) >= PUSHING


class Rest:
    """The hand at rest: encoders as they were last, and every value of the sensors with its time."""

    def __init__(self) -> None:
        self.encoders: Wire = ()
        self.times: list[float] = []
        self.sensors: list[Wire] = []

    def note(self, at: float, encoders: Wire, currents: Wire, sensors: Wire) -> None:
        """The feedback of one moment."""
        self.encoders = encoders
        self.times.append(at)
        self.sensors.append(sensors)


class Trip:
    """One motor there and back. Encoders in counts, currents per mille, joints in radians as on the wire.

    way          counts that it was to go
    turned_back  it pushed without moving, so that it was sent back before
    """

    def __init__(self, index: int, way: int, encoders: Wire, currents: Wire, joints: Wire) -> None:
        self.index, self.way, self.turned_back = index, way, False
        self.start = self.far = self.back = encoders
        self._idle, self._joints, self.turned = currents[index], joints, 0.0
        self._currents: list[float] = []

    def note(self, currents: Wire) -> None:
        """Currents on the way out."""
        self._currents.append(abs(currents[self.index] - self._idle))

    def arrived(self, encoders: Wire, _currents: Wire, joints: Wire) -> None:
        """Where everything is at the far end."""
        self.far = encoders
        finger = self.index // 3
        self.turned = max(abs(degrees(joints[at] - self._joints[at])) for at in range(4 * finger, 4 * finger + 4))

    def returned(self, encoders: Wire) -> None:
        """Where everything is after the way back."""
        self.back = encoders

    def reached(self, there: Sequence[float]) -> list[float]:
        """Where a ramp back begins: at the target, or where the motor was when it was sent back."""
        return [
            float(self.far[at]) if self.turned_back and at == self.index else value for at, value in enumerate(there)
        ]

    @property
    def name(self) -> str:
        return MOTORS.elements[self.index]

    @property
    def went(self) -> int:
        """Counts towards closed."""
        return round(self.far[self.index] - self.start[self.index])

    def moved(self, index: int) -> bool:
        """Whether a motor moved by a good part of the way, in any direction."""
        return abs(self.far[index] - self.start[index]) > FOLLOWS * AMOUNT * stroke(index)

    @property
    def others(self) -> list[int]:
        """The other motors that moved."""
        return [index for index in range(MOTORS.count) if index != self.index and self.moved(index)]

    @property
    def current(self) -> float:
        """The most that flowed on the way, above what flows at rest: the mean of the upper half, so that jitter is none."""
        upper = sorted(self._currents)[len(self._currents) // 2 :]
        return fmean(upper) if upper else 0.0

    @property
    def effort(self) -> float:
        """Current for a hundredth of the stroke."""
        return self.current / max(abs(self.went) / stroke(self.index) * 100, 0.01)

    @property
    def off(self) -> int:
        """Counts that it is away from where it was."""
        return round(self.back[self.index] - self.start[self.index])


def findings(rest: Rest, trips: Sequence[Trip | None]) -> list[Check]:
    """All rows: sensors by finger, then motors; one row for the hand where none of its motors moved."""
    return [*sensors(rest), *motors(trips)]


def in_words(finger: str) -> str:
    """``index finger``, and ``thumb``."""
    return finger if finger == FINGERS[0] else f"{finger} finger"


# -- motors ----------------------------------------------------------------------------------------------------------


FINDINGS: dict[str, tuple[str, str]] = {
    "no-movement": (FAIL, "run `handctl aidin home`, because a hand that is not homed may ignore positions. If it is homed, check its motor power, and set `handctl aidin max-torque` to 700 or more"),
    "swapped": (FAIL, "check the order of the channels: the wiring of motors and encoders in the hand, or its configuration"),
    "encoder-stuck": (FAIL, "check the encoder and its cable, and do not move the {finger} until it counts"),
    "blocked": (FAIL, "free the {finger}. If nothing is in its way, its gear or encoder is stuck"),
    "not-following": (FAIL, "free the fingers with `handctl aidin stop` and check whether the {finger} moves easily, then check its gear and encoder"),
    "no-current": (FAIL, "check the motor and its cable"),
    "reversed": (FAIL, "check the polarity of the motor and its encoder, and do not move the {finger} until then"),
    "short": (FAIL, "check for an obstacle, and set `handctl aidin max-torque` to 700 or more"),
    "coupled": (WARNING, "check the channels and the mechanics: one command should move one motor"),
    "not-back": (WARNING, "check whether the {finger} opens freely, then home the hand"),
    "current-high": (WARNING, "check for friction, and for an object at the {finger}"),
    "current-low": (WARNING, "check the gear of this motor, and its current sensor"),
    "sensor-still": (FAIL, "check the sensor and its cable"),
    "sensor-noisy": (WARNING, "check the cable and shield of the sensor, and that nothing touches the fingertip"),
    "sensor-drift": (WARNING, "let the hand warm up with nothing at its fingertips, then run `handctl aidin bias`"),
    "left-alone": (SKIPPED, ""),
    "unseen": (SKIPPED, ""),
}  # fmt: skip
"""Key `finding` of a row -> its status and what to do."""


def _row(name: str, finding: str | None, evidence: str, finger: str = "", numbers: Numbers = ()) -> Check:
    status, remedy = (OK, "") if finding is None else FINDINGS[finding]
    words = (("finger", finger),) if finger else ()
    return Check(
        name, status, evidence, remedy.format(finger=in_words(finger)), (("finding", finding), *words, *numbers)
    )


def motors(trips: Sequence[Trip | None]) -> list[Check]:
    """A row for each motor."""
    made = [trip for trip in trips if trip is not None]
    if not any(trip.others or trip.moved(trip.index) or trip.turned > TURNED or trip.current >= FLOWS for trip in made):
        rows = [_motor_row(trip.index, "unseen", UNSEEN, trip) for trip in made]
        return [_row("motors", "no-movement", "the feedback shows no movement and no current of any motor"), *rows]
    found = {trip.index: motor(trip) for trip in made}
    sound = [trip for trip in made if found[trip.index][0] is None]
    for trip in sound:
        found[trip.index] = compared(trip, sound) or found[trip.index]
    rows = []
    for index, one in enumerate(trips):
        finger = in_words(MOTORS.finger_of(index))
        left = ("left-alone", f"another motor of the {finger} is blocked, so this one was left alone")
        rows.append(_motor_row(index, *found.get(index, left), one))
    return rows


def _motor_row(index: int, finding: str | None, evidence: str, trip: Trip | None) -> Check:
    numbers: Numbers = (("element", MOTORS.label_of(index)),)
    if trip is not None:
        numbers += (
            ("commanded", trip.way),
            ("moved", trip.went),
            ("current", round(trip.current, 1)),
            ("off", trip.off),
            ("others", [MOTORS.elements[at] for at in trip.others]),
        )
    return _row(f"motor.{MOTORS.elements[index]}", finding, evidence, MOTORS.finger_of(index), numbers)


def motor(trip: Trip) -> tuple[str | None, str]:
    """The finding of one motor by its own way, the worst first, and its evidence."""
    near, others = ENCODERS.near(trip.index), some([MOTORS.elements[at] for at in trip.others])
    seen = f"{trip.went} of {trip.way} counts, current {trip.current:.0f}"
    if not trip.moved(trip.index):
        if others:
            return "swapped", f"its command moved {others} instead"
        if trip.turned > TURNED and abs(trip.went) <= STILL * stroke(trip.index):
            joints = f"although joints of its finger turned by {trip.turned:.1f} deg"
            return "encoder-stuck", f"its encoder stays at {trip.start[trip.index]}, {joints}"
        if trip.turned_back:
            return "blocked", f"blocked: {seen}"
        return "not-following" if trip.current >= FLOWS else "no-current", f"does not follow: {seen}"
    if trip.went < 0:
        return "reversed", f"moves the wrong way: {seen}"
    if trip.turned_back:
        return "blocked", f"blocked: {seen}"
    if trip.went < trip.way - near:
        return "short", f"stopped short: {seen}"
    if others:
        return "coupled", f"{seen}. {others} moved as well"
    if abs(trip.off) > near:
        return "not-back", f"{seen}. It came back {trip.off:+d} counts away from where it was"
    return None, f"{seen}, back within {abs(trip.off)}"


def compared(trip: Trip, sound: Sequence[Trip]) -> tuple[str, str] | None:
    """The finding of a motor whose current differs from that of its neighbours: the same motor of the other fingers."""
    same = [one.effort for one in sound if one.index % 3 == trip.index % 3 and one is not trip]
    usual = median(same) if len(same) > 1 else 0.0
    if usual * AMOUNT * 100 < FLOWS:  # jitter would be compared with jitter
        return None
    if 1 / UNEVEN <= trip.effort / usual <= UNEVEN:
        return None
    evidence = f"current {trip.current:.0f}, {trip.effort / usual:.1f} times that of its neighbours for the same way"
    return "current-high" if trip.effort > usual else "current-low", evidence


# -- sensors at rest -------------------------------------------------------------------------------------------------


class Channel:
    """One channel at rest: its noise (standard deviation about its course), and its drift in a minute."""

    def __init__(self, times: Sequence[float], values: Sequence[float]) -> None:
        self.mean = fmean(values)
        middle = fmean(times)
        spread = max(sum((at - middle) ** 2 for at in times), 1e-9)
        slope = sum((at - middle) * (value - self.mean) for at, value in zip(times, values, strict=True)) / spread
        self.noise = pstdev([value - slope * (at - middle) for at, value in zip(times, values, strict=True)])
        self.drift = slope * 60.0
        self.doubt = 60.0 * self.noise / sqrt(spread)
        """What the noise alone may make of the drift."""
        self.still = len(set(values)) == 1


def sensors(rest: Rest) -> list[Check]:
    """A row for each fingertip sensor."""
    if len(rest.sensors) < SAMPLES:
        evidence = f"only {plural(len(rest.sensors), 'sample')} at rest, and {SAMPLES} are needed"
        return [_row("sensors", "unseen", evidence)]
    channels = [Channel(rest.times, [values[at] for values in rest.sensors]) for at in range(SENSORS.count)]
    if all(channel.still for channel in channels):
        evidence = "no channel of any sensor changes at this resolution, so noise and drift are not seen"
        return [_row("sensors", "unseen", evidence)]
    return [_sensor(channels, finger) for finger in FINGERS]


def _own(finger: str) -> range:
    """The places of a finger's six channels."""
    begin = 6 * FINGERS.index(finger)
    return range(begin, begin + 6)


def _sensor(channels: Sequence[Channel], finger: str) -> Check:
    still, noisy, drifting = [], [], []
    for at in _own(finger):
        one, label = channels[at], SENSORS.label_of(at)
        usual = median(other.noise for place, other in enumerate(channels) if place % 6 == at % 6 and place != at)
        if one.still and usual > 0:
            still.append(label)
        elif one.noise > NOISY * usual and usual > 0:
            noisy.append(f"{label} {one.noise / usual:.0f} times")
        if abs(one.drift) > max(DRIFTS[label[0]], SURE * one.doubt):
            drifting.append(f"{label} {one.drift:+.3f}")
    worst = max(channels[at].noise for at in _own(finger))
    most = max((channels[at].drift for at in _own(finger)), key=abs)
    finding, evidence = None, f"noise {worst:.2g}, drift {most:+.2g} a minute"
    if still:
        finding, evidence = (
            "sensor-still",
            f"{', '.join(still)} never changes, while the same of the other fingers does",
        )
    elif noisy:
        finding, evidence = "sensor-noisy", f"noise: {', '.join(noisy)} that of the other fingers"
    elif drifting:
        finding, evidence = "sensor-drift", f"drift in a minute: {', '.join(drifting)}"
    numbers = (
        ("noise", [round(channels[at].noise, 6) for at in _own(finger)]),
        ("drift", [round(channels[at].drift, 4) for at in _own(finger)]),
    )
    return _row(f"sensor.{finger}", finding, evidence, finger, numbers)
