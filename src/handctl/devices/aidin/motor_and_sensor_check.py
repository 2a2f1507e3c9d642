"""`aidin check`: a look at the hand at rest, then each motor a little way towards closed and back, alone (aidin, Ranges).

The way is a small share of the documented stroke from the open position. A motor that pushes without moving is sent back at
once, and its finger is left alone. A hand that goes where no way leads is stopped.

`findings` makes of what was seen a row for each sensor and each motor. The limits are ours, the manual has none. A value is compared with the same element of the other fingers, because the units of currents and forces are not documented.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import count
from math import degrees, inf, sqrt
from operator import sub
from statistics import fmean, median, pstdev

from handctl.devices.aidin import motion
from handctl.devices.aidin.conversation import Wire, values_of
from handctl.devices.aidin.device import AidinHand, step_of, stopped_if_cut_short, stopped_on_error
from handctl.devices.aidin.exchange_settings import PERIOD, ExchangeMode
from handctl.devices.aidin.homing_and_bias import AT_STOP, check_homed, named
from handctl.devices.aidin.motion import PUSHING, Goal, ramp
from handctl.devices.aidin.parameter_map import AIDIN, ENCODERS, FINGERS, LARGEST_RADIAN, STILL, moving, stroke
from handctl.errors import CheckFailed, Hint, reworded
from handctl.model.check_rows import FAIL, OK, SKIPPED, WARNING, Check, table_of
from handctl.model.param import Number, Step
from handctl.model.prompts import CTRL_C, Prompts
from handctl.model.result import Table
from handctl.wording import plural, some

MOTORS, CURRENT, JOINTS, SENSORS = (AIDIN[name] for name in ("motor_pos", "current_state", "joint_pos", "sensor_state"))
AMOUNT = 0.04
"""Share of the stroke that each motor goes: more than three times what counts as arrived."""
BEYOND = 0.02
"""Share of the stroke by which a motor may pass the end of its way, or go against its direction: overshoot and jitter."""
TURN = 3 * AMOUNT
"""Share of its range by which no joint turns while its motor goes that way: one that does is driven by something else."""
FOLLOWS = 0.25
"""Share of its way from which on a motor has moved at all."""
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
    turned_back  it pushed without moving, or turned unseen, so that it was sent back before
    """

    def __init__(self, index: int, way: int, encoders: Wire, currents: Wire, joints: Wire) -> None:
        self.index, self.way, self.turned_back = index, way, False
        self.start = self.far = self.back = encoders
        self._idle, self._joints, self.turned = currents[index], joints, 0.0
        self._currents: list[float] = []
        self._stray = [0.0] * len(encoders)  # the most that each was seen away from its start

    def note(self, currents: Wire) -> None:
        """Currents on the way out."""
        self._currents.append(abs(currents[self.index] - self._idle))

    def look(self, encoders: Wire) -> None:
        """Encoders on the way out or back: a motor that was away and has come back moved, too."""
        away = map(abs, map(sub, encoders, self.start))
        self._stray = [*map(max, self._stray, away)]

    def arrived(self, encoders: Wire, _currents: Wire, joints: Wire) -> None:
        """Where everything is at the far end."""
        self.far, self.turned = encoders, self._turn(joints)

    def _turn(self, joints: Wire) -> float:
        """Degrees by which the joint of its finger that turned most did."""
        finger = self.index // 3
        return max(abs(degrees(joints[at] - self._joints[at])) for at in range(4 * finger, 4 * finger + 4))

    def turns_unseen(self, encoders: Wire, joints: Wire) -> bool:
        """Whether its finger turns although its encoder stands: nobody knows how far it would go."""
        stands = abs(encoders[self.index] - self.start[self.index]) <= STILL * stroke(self.index)
        return stands and self._turn(joints) > 2 * TURNED

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
        """The other motors that moved, if only for a moment."""
        return [
            index
            for index, most in enumerate(self._stray)
            if index != self.index and (self.moved(index) or most > FOLLOWS * AMOUNT * stroke(index))
        ]

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
    "no-movement": (FAIL, Hint("run {}, because a hand that is not homed may ignore positions. If it is homed, check its motor power, and set `handctl aidin max-torque` to 700 or more", "aidin home")),
    "swapped": (FAIL, "check the order of the channels: the wiring of motors and encoders in the hand, or its configuration"),
    "encoder-stuck": (FAIL, "check the encoder and its cable, and do not move the {finger} until it counts"),
    "blocked": (FAIL, "free the {finger}. If nothing is in its way, its gear or encoder is stuck"),
    "not-following": (FAIL, Hint("free the fingers with {} and check whether the {finger} moves easily, then check its gear and encoder", "aidin stop")),
    "no-current": (FAIL, "check the motor and its cable"),
    "reversed": (FAIL, "check the polarity of the motor and its encoder, and do not move the {finger} until then"),
    "short": (FAIL, "check for an obstacle, and set `handctl aidin max-torque` to 700 or more"),
    "coupled": (WARNING, "check the channels and the mechanics: one command should move one motor"),
    "not-back": (WARNING, "check whether the {finger} opens freely, then home the hand"),
    "current-high": (WARNING, "check for friction, and for an object at the {finger}"),
    "current-low": (WARNING, "check the gear of this motor, and its current sensor"),
    "sensor-still": (FAIL, "check the sensor and its cable"),
    "sensor-noisy": (WARNING, "check the cable and shield of the sensor, and that nothing touches the fingertip"),
    "sensor-drift": (WARNING, Hint("let the hand warm up with nothing at its fingertips, then run {}", "aidin bias")),
    "left-alone": (SKIPPED, ""),
    "unseen": (SKIPPED, ""),
}  # fmt: skip
"""Key `finding` of a row -> its status and what to do."""


def _row(name: str, finding: str | None, evidence: str, finger: str = "", numbers: Numbers = ()) -> Check:
    status, remedy = (OK, "") if finding is None else FINDINGS[finding]
    words = (("finger", finger),) if finger else ()
    return Check(
        name,
        status,
        evidence,
        reworded(remedy, remedy.format(finger=in_words(finger))),
        (("finding", finding), *words, *numbers),
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
    evidence = f"current {trip.current:.0f}, {trip.effort / usual:.1f} times its neighbours' over the same distance"
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


# -- what is made of what was seen: a row for each sensor and each motor ----------------------------------------------


REST = 2.0
"""Seconds of looking at a hand that is not driven."""
HOLD = 0.2
"""Seconds at the present position before the first motor moves: its current without a movement is known then."""
ARRIVE = 0.5
"""Seconds after the end of a ramp in which a motor may still arrive."""
STANDS = 3
"""Looks in a row at which a motor that has arrived stands."""
ALMOST = STILL / 10
"""Share of a stroke that it may change meanwhile from one look to the next: it no longer comes nearer."""
LATE = 2
"""Looks after the end of a ramp: of a hand that speaks seldom, too, the end is seen."""
PUSHES = 2
"""Looks in a row at which a motor pushes without moving, or turns a joint while its encoder stands, until it is sent back."""
LEFT = "nothing more is sent, and the hand probably holds its position"
QUESTION = (
    f"Each motor will close its finger by {AMOUNT:.0%} of the stroke and open it again, one after the other. "
    "Keep hands and objects away from the fingers"
)


def goal_of(start: list[Number], index: int | None = None) -> Goal:
    """All motors where they are, but `index`, which is `AMOUNT` of its stroke further closed."""
    return Goal(ENCODERS, {} if index is None else {index: round(max(start[index], 0) + AMOUNT * stroke(index))})


def plan(device: Callable[[], AidinHand], end: bytes) -> list[Step]:
    """The far end of each motor's way and the way back, for --dry-run, from the position that the hand tells unasked."""
    hand = device()
    hand.conversation.connect(silent=True)
    start = motion.measured(hand, ENCODERS)
    steps = []
    for index, name in enumerate(MOTORS.elements):
        goal = goal_of(start, index)
        meaning = f"{name} closes by {AMOUNT:.0%} of its stroke, the last object of a ramp"
        steps.append(step_of(meaning, motion.target_object(goal, goal.complete(start)), end))
    return [*steps, _home(start, end)]


def _home(start: list[Number], end: bytes) -> Step:
    """All motors back where they were, which ends each way and the check."""
    goal = goal_of(start)
    return step_of(
        "all motors where they were, the last object of each way back",
        motion.target_object(goal, goal.complete(start)),
        end,
    )


def check(hand: AidinHand, prompts: Prompts) -> Table:
    """Look at the hand at rest, move each motor and bring it back, and judge what was seen; a finding is the table's failure.

    Raises CheckFailed before anything is sent where the hand is not homed, not open, moves or pushes; NoAnswer where it is silent.
    """
    check_homed(hand, assume=None)
    rest = _rest(hand, prompts)
    start = values_of(MOTORS, rest.encoders)
    ledger = hand.journal.ledger
    begun = ledger.mark
    ledger.plan([_home(start, hand.conversation.way.end)])
    with stopped_if_cut_short(hand, prompts), stopped_on_error(hand, prompts):  # after one nobody sees the fingers
        mover = _Mover(hand, prompts, start)
        trips = mover.all()
        hand.conversation.check_answered()  # what came before the last object proves nothing of it
        back = mover.back
    table = table_of(findings(rest, trips), causes=("motors",))
    if back and any(trip.moved(trip.index) for trip in trips if trip is not None):
        ledger.confirm("motors moved there and back, according to the feedback", since=begun)
    hand.journal.info("left", LEFT, hint=Hint("{} frees the fingers", "aidin stop"))
    return table


# -- at rest ---------------------------------------------------------------------------------------------------------


def _rest(hand: AidinHand, prompts: Prompts) -> Rest:
    """Feedback of `REST` seconds in which nothing is sent. Raises CheckFailed where the hand is not open, moves or pushes."""
    rest, conversation = Rest(), hand.conversation
    end = conversation.deadline(REST)
    first: Wire | None = None
    while first is None or not end.expired:
        encoders, currents, sensors, _ = conversation.need(MOTORS, CURRENT, SENSORS, JOINTS)
        rest.note(hand.link.now(), encoders, currents, sensors)
        if first is None:
            first = encoders
            _check_open(hand, encoders)
        if restless := moving(first, encoders):
            raise CheckFailed(
                f"{hand.link.name}: {named(MOTORS, restless, encoders)}: moving, although nothing was commanded",
                hint=Hint(
                    "wait until the hand is still, and do not touch the fingers. If a motor is still moving, its encoder loses counts: run {}. Nothing was sent.",
                    "aidin watch motor_pos",
                ),
                code="moving",
            )
        if pushing := [index for index, current in enumerate(currents) if pushes(current)]:
            raise CheckFailed(
                f"{hand.link.name}: {named(CURRENT, pushing, currents)}: the hand holds or pushes something",
                hint=Hint("take the object out, then run {}. Nothing was sent.", "aidin initial"),
                code="loaded",
            )
        prompts.progress("Reading the sensors at rest.", CTRL_C)
        if conversation.exchange is not ExchangeMode.STREAM:
            conversation.pause(PERIOD)
    conversation.check_bound()
    return rest


def _check_open(hand: AidinHand, encoders: Wire) -> None:
    if closed := [index for index, value in enumerate(encoders) if value > AT_STOP * stroke(index)]:
        raise CheckFailed(
            f"{hand.link.name}: the hand is not open: {named(MOTORS, closed, encoders)}",
            hint=Hint(
                "this check needs an open, empty hand. Run {}, or {} if the hand has not been homed since power-on. Nothing was sent.",
                "aidin initial",
                "aidin home",
            ),
            code="not-open",
        )


def _reach(index: int) -> float:
    """Counts that a motor may be away from where it was: its way, and what it may pass it by."""
    return (AMOUNT + BEYOND) * stroke(index)


def _turn(index: int) -> float:
    """Degrees that a joint may be away from where it was; q4 has no range, so nothing is known of it."""
    limit = JOINTS.limit(index)
    return inf if limit is None else TURN * (limit[1] - limit[0])


# -- there and back --------------------------------------------------------------------------------------------------


class _Mover:
    """Moves one motor after the other from `start` and back, and keeps what the feedback says meanwhile."""

    def __init__(self, hand: AidinHand, prompts: Prompts, start: list[Number]) -> None:
        self._hand, self._prompts, self._start = hand, prompts, start
        self._said = ""
        self._joints: Wire = ()
        self._judged = 0  # encoders that `_check_course` has looked at
        self._bounds = [(place - _reach(index), max(place, 0) + _reach(index)) for index, place in enumerate(start)]
        self._turns = [_turn(index) for index in range(JOINTS.count)]

    @property
    def back(self) -> bool:
        """Whether the hand was last seen where it was."""
        home = goal_of(self._start).complete(self._start)
        places = zip(self._told()[0], home, strict=True)
        return all(abs(at - value) <= ENCODERS.near(index) for index, (at, value) in enumerate(places))

    def all(self) -> list[Trip | None]:
        """A trip of each motor; None where its finger was blocked before, so that it was left alone."""
        self._said = "Holding the position."
        self._joints = self._told()[2]
        self._send(goal_of(self._start).complete(self._start), HOLD)
        trips: list[Trip | None] = []
        blocked = ""
        for index in range(MOTORS.count):
            finger = MOTORS.finger_of(index)
            if finger == blocked:
                trips.append(None)
                continue
            trip = self._trip(index)
            blocked = finger if trip.turned_back else ""
            trips.append(trip)
        return trips

    def _trip(self, index: int) -> Trip:
        self._said = f"Moving {MOTORS.elements[index]} and back ({index + 1} of {MOTORS.count})."
        told = self._told()
        goal = goal_of(self._start, index)
        trip = Trip(index, round(goal.named[index] - max(self._start[index], 0)), *told)
        home, there = goal_of(self._start).complete(self._start), goal.complete(self._start)
        self._go(trip, ramp(goal, home, there, PERIOD), index)
        trip.arrived(*self._told())
        self._go(trip, ramp(goal, trip.reached(there), home, PERIOD), index, back=True)
        trip.returned(self._told()[0])
        return trip

    def _go(self, trip: Trip, way: list[tuple[float, ...]], index: int, *, back: bool = False) -> None:
        """Follow the ramp and wait until the motor stands at its end; the way out ends where the motor pushes and stands."""
        pushing = standing = late = 0
        seen, (encoders, _, _) = self._heard, self._told()
        begin = before = best = encoders[index]
        arrive, there = round(ARRIVE / PERIOD), ENCODERS.near(index)
        for number in count():
            values = way[min(number, len(way) - 1)]
            self._send(list(values), PERIOD)
            if self._heard != seen:  # nothing is judged twice
                seen, (encoders, currents, joints) = self._heard, self._told()
                at, off = encoders[index], abs(encoders[index] - values[index])
                change, before = abs(at - before) / stroke(index), at
                best = min(best, at) if back else max(best, at)
                if min(abs(at - best), abs(best - begin)) > BEYOND * stroke(index):
                    raise self._astray(named(MOTORS, [index], encoders), "moved opposite to the commanded direction")
                trip.look(encoders)
                late += number >= len(way)
                near = off <= there
                standing = standing + 1 if near and change <= ALMOST else 0
                if not back:
                    trip.note(currents)
                    pushed = pushes(currents[index]) and not near and change <= STILL
                    pushing = pushing + 1 if pushed or trip.turns_unseen(encoders, joints) else 0
                    if pushing >= PUSHES:
                        trip.turned_back = True
                        return
            if late >= LATE and (standing >= STANDS or number >= len(way) + arrive):
                return

    def _send(self, values: list[float], seconds: float) -> None:
        """The target every period for so long."""
        goal = Goal(ENCODERS, dict(enumerate(values)))
        for _ in range(max(1, round(seconds / PERIOD))):
            self._hand.conversation.tick(motion.target_object(goal, values), by=MOTORS)
            for param in (CURRENT, JOINTS):
                self._hand.conversation.check_sight(param)
            self._check_course()
            self._prompts.progress(self._said, CTRL_C)

    def _check_course(self) -> None:
        """Raise CheckFailed where a motor or a joint is where no way of this check leads: the hand is driven by something else."""
        if self._heard == self._judged:
            return
        self._judged = self._heard
        encoders, _, joints = self._told()
        for index, (at, (low, high)) in enumerate(zip(encoders, self._bounds, strict=True)):
            if not low <= at <= high:
                raise self._astray(
                    named(MOTORS, [index], encoders), "is further from its start than this check moves it"
                )
        if max(map(abs, (*joints, *self._joints))) > LARGEST_RADIAN:
            return  # no angles in radians, so nothing is known of them
        for index, (one, other, most) in enumerate(zip(joints, self._joints, self._turns, strict=True)):
            if one != other and abs(degrees(one - other)) > most:
                angles = [degrees(joint) for joint in joints]
                raise self._astray(named(JOINTS, [index], angles), "turned further than this check moves it")

    def _astray(self, what: str, how: str) -> CheckFailed:
        return CheckFailed(
            f"{self._hand.link.name}: {what} {how}",
            hint="either an encoder lost counts, or another client or a person moves the fingers, or channels are swapped. Home the hand, then run the check again",
            code="astray",
        )

    @property
    def _heard(self) -> int:
        """How often encoders have come."""
        return self._hand.conversation.feedback.good[MOTORS.key]

    def _told(self) -> tuple[Wire, Wire, Wire]:
        """Encoders, currents and joint angles as the hand told them last."""
        conversation = self._hand.conversation
        one, two, three = (
            conversation.usable(param, conversation.feedback.result(param.key)) for param in (MOTORS, CURRENT, JOINTS)
        )
        return one, two, three
