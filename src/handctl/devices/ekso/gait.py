"""Strides in a log: foot pressures say when a foot is on the ground, knee angles are the second witness. Needs no device.

Every threshold comes from the recording: the offset, the gain and the noise of each sensor, followed over time, since they
drift and the two feet differ (dossier ekso §3). A step that is not counted is kept with its reason. Nothing here is a
diagnosis, and the State word is not used: its codes for walking were never recorded.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, MutableSequence, Sequence
from dataclasses import dataclass, field, replace
from itertools import accumulate, chain, pairwise, zip_longest
from math import sqrt
from operator import sub
from typing import NamedTuple

from handctl.devices.ekso.log_reader import LogFile
from handctl.devices.ekso.parameter_map import DATA
from handctl.devices.ekso.recording_source import column_of
from handctl.record.clock_survey import Surveyor
from handctl.record.log_reader import as_written

LEFT, RIGHT = "left", "right"
SIDES = (LEFT, RIGHT)
SENSORS = ("toe", "heel")
BLOCK = 3.0
"""Seconds for which a sensor's offset and gain are taken to be the same."""
AROUND = 5
"""Blocks before and after that help to tell them."""
ENDS = 3
"""Blocks at each end that tell a drift: in one alone a slow walker may not have lifted the foot."""
RISE = 0.10
"""Part of its gain above its offset at which a sensor is loaded, if its noise allows it; NOISES times that noise else."""
NOISES = 6.0
FALL = 0.6
"""Part of that threshold below which it is no longer loaded."""
FLAT = 0.25
"""Part of its usual gain: with less in a stretch the wearer stands, or sits."""
STEEP = 0.7
"""Part of what a sensor bears in a step up to which it takes its load evenly."""
DEAD = 8.0
"""Counts: a sensor that never changes by more is dead."""
ONLY_DRIFTS, WITHIN = 0.02, 0.5
"""Part of the course of the liveliest sensor: one that leaves its slope by less within so many seconds is dead as well."""
TELLING = 5
"""Steps of another sensor during which one stays at full: it is dead from there on."""
FEWEST = 3
"""Rows in which there may be a contact."""
BRIEF = 0.08
"""Seconds: a shorter contact or lift is a bounce."""
LONG, SHORT = 1.8, 0.5
"""A stride that takes more or less than so many usual ones is none of the walk."""
STILL_KNEE = 0.4
"""Part of the usual range of the knee: with less of it, pressure and knee disagree."""
DRIFTED = 0.15
"""Part of its gain by which the offset of a sensor has moved to be told."""

TAKEN = ""
NO_END = "end of the recording"
NO_BEGIN = "began before the recording"
HOLE = "samples are missing"
STANDING = "standing"
TOO_LONG, TOO_SHORT = "longer than the others", "shorter than the others"
ALONE = "no step of the other foot in between"
KNEE = "the knee hardly bends"
ONE_SENSOR = "one sensor only, so neither contact nor stance is certain"


class Stretch(NamedTuple):
    """One segment of a log: seconds, and for each signal, such as "left_toe", a value a row; the rows (from 0) before which some are missing."""

    number: int
    t: MutableSequence[float]
    signals: Mapping[str, MutableSequence[float]]
    gaps: Sequence[int] = ()

    def at(self, moment: float) -> int:
        """The first row that is not before the moment."""
        return bisect_left(self.t, moment)


@dataclass(frozen=True)
class Step:
    """One stride of one foot: from this contact to its next one.

    refused  why it is not counted, "" = it is
    doubt    what speaks against it although it is counted
    """

    segment: int
    side: str
    contact: float
    off: float
    end: float
    stance: float = 0.0
    peak_toe: float | None = None
    peak_heel: float | None = None
    knee: float = 0.0
    refused: str = TAKEN
    doubt: str = ""

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.end - self.contact


class Figure(NamedTuple):
    """A figure of a walk: mean, deviation and number of strides.

    fine    what one sample more or less changes: no mean of many strides is more certain than that
    shared  so many strides lie over each other, as those of two feet do: together they say no more than one
    """

    name: str
    side: str
    mean: float
    deviation: float
    strides: int
    unit: str
    fine: float = 0.0
    shared: int = 1

    @property
    def free(self) -> float:
        """Degrees of freedom of the deviation: of a single stride nobody knows how much the next one differs."""
        return self.strides / self.shared - 1

    @property
    def error(self) -> float:
        """Standard error of the mean."""
        return self.deviation * sqrt(self.shared / self.strides)


@dataclass
class Walk:
    """What a log shows of a walk. `remarks` are what was found about the sensors and the recording."""

    steps: list[Step] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    stretches: list[Stretch] = field(default_factory=list)

    @property
    def taken(self) -> list[Step]:
        """The steps that count."""
        return [step for step in self.steps if not step.refused]

    @property
    def verdicts(self) -> list[tuple[str, str, int]]:
        """What became of its strides, why, "" = nothing is wrong with them, and how many there are of each."""
        refused = Counter(step.refused for step in self.steps if step.refused)
        doubts = Counter(step.doubt for step in self.taken if step.doubt)
        found = [("counted", "", len(self.taken)), *(("not counted", why, number) for why, number in refused.items())]
        return [*found, *(("doubtful", why, number) for why, number in doubts.items())]


SIGNALS = tuple(f"{side}_{name}" for side in SIDES for name in (*SENSORS, "knee", "hip"))
COLUMNS = {
    name: f"{name}_pressure_raw" if name.endswith(SENSORS) else f"{name}_angle_deg" for name in SIGNALS
}  # fmt: skip


def stretches(log: LogFile) -> list[Stretch]:
    """The segments of a log. Raises UsageError with the line of a row that is none."""
    quantities = {name: next(q for q in DATA if column_of(q) == column) for name, column in COLUMNS.items()}
    found: dict[int, Stretch] = {}
    reading = Surveyor(log, log.fits)
    for block in log.blocks(as_written):
        parts = {number: block.of(number) for number in sorted(set(block.segments))}
        reading.take(parts)
        for number, part in parts.items():
            one = found.setdefault(number, Stretch(number, array("d"), {name: array("d") for name in quantities}))
            one.t.extend([t_ms / 1000 for t_ms in part.t_ms])
            for name, quantity in quantities.items():
                scale = 10**quantity.decimals
                one.signals[name].extend([n / scale for n in log.numbers(quantity).of(part.columns[COLUMNS[name]])])
    made = []
    for one in found.values():
        first = reading.found.segments[one.number].first_row
        rows = range(first, first + len(one.t))
        made.append(one._replace(gaps=[row - first for row in reading.found.gap_rows if row in rows]))
    return made


def walk_of(log: LogFile) -> Walk:
    """What a log shows. Raises UsageError when it cannot be read."""
    return walk_in(stretches(log))


def walk_in(found: Sequence[Stretch]) -> Walk:
    """What these segments show."""
    walk = Walk(stretches=list(found))
    period = _period(found)
    dead = _dead(found, period, walk.remarks)
    for side in SIDES:
        if all(f"{side}_{name}" in dead for name in SENSORS):
            walk.remarks.append(f"the {side} foot has no working sensor, so its steps are not known")
    contacts: dict[str, list[Step]] = {side: [] for side in SIDES}
    gaps: dict[int, list[tuple[float, float]]] = {}
    for stretch in found:
        if len(stretch.t) < FEWEST:
            continue
        gaps[stretch.number] = _gaps(stretch)
        working = [f"{side}_{name}" for side in SIDES for name in SENSORS if f"{side}_{name}" not in dead]
        alive = {sensor: _alive(stretch, sensor, working, found) for sensor in working}
        for sensor, rows in alive.items():
            if rows < len(stretch.t):
                since = f"never changes from {stretch.t[rows]:.1f} s on"
                walk.remarks.append(f"{sensor}_pressure {since}: it is dead, or not connected")
        for side in SIDES:
            sensors = {name: rows for name, rows in alive.items() if name.startswith(side) and rows >= FEWEST}
            contacts[side] += _contacts(stretch, side, sensors, walk.remarks)
    walk.steps = sorted(_judged(contacts, gaps, found), key=lambda step: (step.segment, step.contact, step.side))
    walk.figures = list(_figures(walk.taken, period))
    return walk


# -- sensors ------------------------------------------------------------------------------------------------------


def _dead(found: Sequence[Stretch], period: float, remarks: list[str]) -> set[str]:
    """The sensors that never change, or that only drift."""
    lag = max(1, round(WITHIN / (period or WITHIN)))
    ranges, bends = {}, {}
    for sensor in (f"{side}_{name}" for side in SIDES for name in SENSORS):
        every = [stretch.signals[sensor] for stretch in found]
        if not (values := Ordered(chain(*every))):
            continue
        ranges[sensor] = _upper(values) - values[len(values) // 100]
        triples = chain(*(zip(one[::5], one[lag::5], one[2 * lag :: 5], strict=False) for one in every))
        bends[sensor] = _upper(Ordered([abs(a - 2 * b + c) for a, b, c in triples]))
    dead = set()
    for sensor, bend in bends.items():
        if ranges[sensor] < DEAD or bend < ONLY_DRIFTS * max(bends.values()):
            dead.add(sensor)
            what = "never changes" if ranges[sensor] < DEAD else "only drifts"
            remarks.append(f"{sensor}_pressure {what}: it is dead, or not connected")
    return dead


class Ordered:
    """Values in order, each kept once with its count: hours repeat few."""

    def __init__(self, values: Iterable[float]) -> None:
        counts = Counter(values)
        self._values = sorted(counts)
        self._ends = list(accumulate(map(counts.__getitem__, self._values)))

    def __len__(self) -> int:
        return self._ends[-1] if self._ends else 0

    def __getitem__(self, rank: int) -> float:
        return self._values[bisect_right(self._ends, rank)]


def _alive(stretch: Stretch, sensor: str, working: Sequence[str], found: Sequence[Stretch]) -> int:
    """How many rows there are until a sensor stays at full while another one takes steps: none of the load that it shows then is one.

    One that stays at its offset is not told from a foot that does not load it.
    """
    values = stretch.signals[sensor]
    low = high = values[-1]
    rows = len(values)
    for value in reversed(values):
        low, high = min(low, value), max(high, value)
        if high - low >= DEAD:
            break
        rows -= 1
    bottom = min(min(one.signals[sensor]) for one in found)
    top = max(max(one.signals[sensor]) for one in found)
    if values[-1] < bottom + STEEP * (top - bottom):
        return len(values)
    for other in working:
        if other != sensor:
            level = (min(stretch.signals[other]) + max(stretch.signals[other])) / 2
            rises = sum(a < level <= b for a, b in pairwise(stretch.signals[other][rows:]))
            if rises >= TELLING:
                return rows
    return len(values)


def _upper(ordered: Ordered) -> float:
    """The greatest of these without the last hundredth."""
    return ordered[len(ordered) - 1 - len(ordered) // 100] if ordered else 0.0


class Blocks(NamedTuple):
    """Offset and gain of a sensor for each BLOCK seconds from the first row of a segment, where each begins and ends, its noise."""

    offset: list[float]
    gain: list[float]
    rows: list[tuple[int, int]]
    noise: float


def _blocks(t: Sequence[float], values: Sequence[float], most: int) -> Blocks:
    """Those of the first `most` rows."""
    count = int((t[most - 1] - t[0]) / BLOCK) + 1
    starts = [bisect_left(t, place, 0, most, key=lambda moment: int((moment - t[0]) / BLOCK)) for place in range(count)]
    rows = list(pairwise([*starts, most]))
    low, high = {}, {}
    for place, (begin, end) in enumerate(rows):
        if piece := sorted(values[begin:end]):
            low[place], high[place] = piece[len(piece) // 20], piece[-1 - len(piece) // 20]
    offset: list[float] = []
    gain: list[float] = []
    for place in range(count):
        near = [one for one in range(place - AROUND, place + AROUND + 1) if one in low]
        around = max(high[one] - low[one] for one in near) if near else 0.0
        walked = place in low and high[place] - low[place] >= around / 2  # both on the ground and in the air
        offset.append(
            low[place] if walked else min(low[one] for one in near) if near else offset[-1] if offset else 0.0
        )
        gain.append(max(around, max((high[one] for one in near), default=0.0) - offset[-1] if not walked else 0.0))
    usual = sorted(gain)[count // 2] if gain else 0.0
    usual = max(usual, max(gain, default=0.0) * FLAT)
    walks = [place for place in range(count) if gain[place] >= FLAT * usual]
    for place in range(count) if walks else ():
        if gain[place] < FLAT * usual:
            nearest = min(walks, key=lambda one: abs(one - place))
            offset[place], gain[place] = offset[nearest], gain[nearest]
    pieces = zip((pairwise(values[begin : min(end + 1, most)]) for begin, end in rows), offset, strict=True)
    steps = Ordered([abs(b - a) for piece, bare in pieces for a, b in piece if a < bare + 0.1 * usual])
    return Blocks(offset, gain, rows, 1.05 * steps[len(steps) // 2] if steps else 0.0)


def _loaded(values: Sequence[float], blocks: Blocks) -> bytearray:
    """For each row 2 = the sensor is loaded, 1 = it is if it was, 0 = it is not."""
    states = bytearray()
    for offset, gain, (begin, end) in zip(blocks.offset, blocks.gain, blocks.rows, strict=True):
        rise = max(RISE * gain, NOISES * blocks.noise)
        high, low = offset + rise, offset + FALL * rise
        states += bytes([2 if value >= high else 1 if value >= low else 0 for value in values[begin:end]])
    return states


def _contacts(stretch: Stretch, side: str, sensors: Mapping[str, int], remarks: list[str]) -> list[Step]:
    """The contacts of a foot, each up to the next one; `end` of the last is NaN. `sensors`: how many rows each works for."""
    if not sensors:
        return []
    states = []
    for sensor, rows in sensors.items():
        values = stretch.signals[sensor]
        blocks = _blocks(stretch.t, values, rows)
        moved, gain = min(blocks.offset[-ENDS:]) - min(blocks.offset[:ENDS]), max(blocks.gain)
        if gain and abs(moved) > DRIFTED * gain:
            remarks.append(f"{sensor}_pressure has drifted by {moved:+.0f} counts, {abs(moved) / gain:.0%} of its gain")
        states.append(_loaded(values, blocks).ljust(len(stretch.t), b"\0"))
    down, edges = False, []
    for row, now in enumerate(map(max, *states) if len(states) > 1 else states[0]):
        wanted = now > (0 if down else 1)
        if wanted != down:
            edges.append(row)
            down = wanted
    began = bool(edges) and edges[0] == 0
    edges = _without_bounces(stretch.t, edges, down_first=began)
    ons, offs = edges[0::2], edges[1::2]
    pairs = [(stretch.signals[sensor], s) for sensor, s in zip(sensors, states, strict=True)]
    # Of the sensors that are loaded then, the one that bears most is the surest; noise may hide it for the last row.
    contact = [max(_bare(stretch, v, row, 1) for v, s in pairs if s[row])[1] for row in ons]
    lift = [max(_bare(stretch, v, row - 1, -1) for v, s in pairs if any(s[max(0, row - 2) : row]))[1] for row in offs]
    lone = len(states) < len(SENSORS)
    every = [all(2 in s[on:off] for s in states) for on, off in zip(ons, offs, strict=False)]
    nan = float("nan")
    steps = []
    for place, (on, off, end) in enumerate(zip_longest(contact, lift, contact[1:], fillvalue=nan)):
        refused = NO_BEGIN if place == 0 and began else NO_END if end != end else TAKEN
        doubt = ONE_SENSOR if lone or not all(every[place : place + 2]) else ""
        steps.append(Step(stretch.number, side, on, off, end, refused=refused, doubt=doubt))
    return steps


def _bare(stretch: Stretch, values: Sequence[float], row: int, way: int) -> tuple[float, float]:
    """What a sensor bears, and when it bore nothing: before the row if that is the first loaded one (way 1), or behind
    it if it is the last (-1).

    It is where the line through the rows between RISE and STEEP of the load meets the offset: where a threshold is
    crossed depends on the gain, on how fast the load comes, and on the rate.
    """
    begin, end = stretch.at(stretch.t[row] - BRIEF), stretch.at(stretch.t[row] + BRIEF)
    t, found = stretch.t[begin:end][::way], values[begin:end][::way]  # in each case unloaded first
    place = row - begin if way > 0 else end - 1 - row
    offset = _median(found[:place])
    gain = max(found[place:]) - offset
    if not place or gain <= 0:
        return 0.0, stretch.t[row]
    low, high = offset + RISE * gain, offset + STEEP * gain
    first = place
    while found[first] < low:
        first += 1
    while first and found[first - 1] > low:
        first -= 1
    if first and found[first] >= high:  # all of it between two rows
        return gain, (t[first - 1] + t[first]) / 2
    last = first + 2
    while last < len(t) and found[last] < high:
        last += 1
    x, y = t[first:last], found[first:last]
    x_mean, y_mean = sum(x) / len(x), sum(y) / len(y)
    rise = sum((one - y_mean) * (moment - x_mean) for moment, one in zip(x, y, strict=True))
    if rise * way <= 0:
        return gain, stretch.t[row]
    moment = x_mean - (y_mean - offset) * sum((one - x_mean) ** 2 for one in x) / rise
    earliest = max(0, first - 1) if len(x) == 2 else 0  # with so few rows the second may be beyond the slope
    return gain, sorted((t[earliest], moment, t[-1]))[1]


def _without_bounces(t: Sequence[float], edges: Sequence[int], *, down_first: bool) -> list[int]:
    """The rows without those of a contact or a lift that is too brief to be one."""
    kept: list[int] = []
    for edge in edges:
        if kept and t[edge] - t[kept[-1]] < BRIEF and not (down_first and len(kept) == 1):
            kept.pop()
        else:
            kept.append(edge)
    return kept


def _period(found: Sequence[Stretch]) -> float:
    """Seconds between two samples. A row that only repeats the one before is none: it was asked for before the device had measured again."""
    steps: list[Iterator[float]] = []
    for one in found:
        rows = pairwise(zip(*one.signals.values(), strict=True))
        times = array("d", (t for t, (a, b) in zip(one.t[1:], rows, strict=False) if a != b))
        steps.append(map(sub, times[1:], times))
    ordered = Ordered(chain(*steps))
    return ordered[len(ordered) // 2] if ordered else 0.0


def _gaps(stretch: Stretch) -> list[tuple[float, float]]:
    """The moments between which samples are missing, as the recorder found them."""
    return [(stretch.t[at - 1], stretch.t[at]) for at in stretch.gaps]


# -- steps --------------------------------------------------------------------------------------------------------


def _judged(
    contacts: dict[str, list[Step]], gaps: dict[int, list[tuple[float, float]]], found: Sequence[Stretch]
) -> Iterator[Step]:
    by_number = {stretch.number: stretch for stretch in found}
    measured = {side: [_measured(step, by_number[step.segment]) for step in contacts[side]] for side in SIDES}
    knee = max(_median(step.knee for step in measured[side] if not step.refused) for side in SIDES)
    for side, other in ((LEFT, RIGHT), (RIGHT, LEFT)):
        whole = [step for step in contacts[side] if not step.refused]
        usual, stance = _median(step.duration for step in whole), _median(step.off - step.contact for step in whole)
        others = {number: [s.contact for s in contacts[other] if s.segment == number] for number in by_number}
        for step in measured[side]:
            refused = step.refused or _refusal(step, usual, stance, gaps[step.segment], others[step.segment])
            stiff = KNEE if not refused and step.knee < STILL_KNEE * knee else ""
            yield replace(step, refused=refused, doubt=step.doubt or stiff)


def _refusal(
    step: Step, usual: float, stance: float, gaps: Sequence[tuple[float, float]], others: Sequence[float]
) -> str:
    if any(step.contact <= until and begin < step.end for begin, until in gaps):
        return HOLE
    if step.off - step.contact > LONG * stance:
        return STANDING
    if step.duration > LONG * usual:
        return TOO_LONG
    if step.duration < SHORT * usual:
        return TOO_SHORT
    between = bisect_right(others, step.contact)
    if others and not (between < len(others) and others[between] < step.end):
        return ALONE
    return TAKEN


def _measured(step: Step, stretch: Stretch) -> Step:
    if step.end != step.end:
        return step
    first, last = stretch.at(step.contact), stretch.at(step.end)
    knee = stretch.signals[f"{step.side}_knee"][first:last] or [0.0]
    toe, heel = (stretch.signals[f"{step.side}_{name}"][first:last] or [0.0] for name in SENSORS)
    share = (step.off - step.contact) / step.duration
    return replace(step, stance=share, peak_toe=max(toe), peak_heel=max(heel), knee=max(knee) - min(knee))


def _median(values: Iterable[float]) -> float:
    found = sorted(value for value in values if value == value)
    return found[len(found) // 2] if found else 0.0


# -- figures ------------------------------------------------------------------------------------------------------


def figure(name: str, side: str, values: Sequence[float], unit: str) -> Figure:
    """Mean and deviation of values."""
    mean = sum(values) / len(values)
    spread = sqrt(sum((value - mean) ** 2 for value in values) / (len(values) - 1)) if len(values) > 1 else 0.0
    return Figure(name, side, mean, spread, len(values), unit)


def _figures(taken: Sequence[Step], period: float) -> Iterator[Figure]:
    both: dict[str, list[Figure]] = {}
    for side in SIDES:
        own = [step for step in taken if step.side == side]
        if not own:
            continue
        share = 200 * period / _median(step.duration for step in own)
        stances = [100 * step.stance for step in own if step.doubt != ONE_SENSOR]
        for name, unit, fine, values in (
            ("stride_time", "s", period, [step.duration for step in own]),
            ("stance_share", "%", share, stances),
            ("swing_share", "%", share, [100 - stance for stance in stances]),
            ("peak_toe_pressure", "raw counts", 1.0, [step.peak_toe or 0.0 for step in own]),
            ("peak_heel_pressure", "raw counts", 1.0, [step.peak_heel or 0.0 for step in own]),
            ("knee_range", "deg", 0.01, [step.knee for step in own]),
        ):
            if not values:
                continue
            one = figure(name, side, values, unit)._replace(fine=fine)
            both.setdefault(name, []).append(one)
            yield one
    strides = [step.duration for step in taken]
    if strides:
        whole = figure("stride_time", "both", strides, "s")
        part = period / whole.mean
        cadence = figure("cadence", "both", [120 / stride for stride in strides], "steps/min")
        shared, varies = len({step.side for step in taken}), 100 * whole.deviation / whole.mean
        yield cadence._replace(fine=part * cadence.mean, shared=shared)
        # A deviation is known from n values to 1 / sqrt(2 n) of itself.
        yield Figure("stride_variability", "both", varies, varies / sqrt(2), whole.strides, "%", 100 * part, shared)
    for name in ("stride_time", "stance_share", "knee_range"):
        if len(pair := both.get(name, [])) == 2 and (total := pair[0].mean + pair[1].mean):
            left, right = pair
            error = 400 * sqrt((right.mean * left.error) ** 2 + (left.mean * right.error) ** 2) / total**2
            count = min(left.strides, right.strides)
            value, fine = 200 * (left.mean - right.mean) / total, 400 * left.fine / total
            yield Figure(f"{name}_asymmetry", "both", value, error * sqrt(count), count, "%", fine)


class Difference(NamedTuple):
    """A figure of two walks. `error` is the half width of the 95 % interval of their difference, None = too few strides to know one."""

    before: Figure
    after: Figure
    change: float
    error: float | None

    @property
    def clear(self) -> bool:
        """Whether the interval leaves out 0."""
        return self.error is not None and abs(self.change) > self.error


def compared(before: Walk, after: Walk) -> list[Difference]:
    """The figures that both walks have."""
    later = {(one.name, one.side): one for one in after.figures}
    return [
        Difference(one, two, two.mean - one.mean, _interval(one, two))
        for one in before.figures
        if (two := later.get((one.name, one.side))) is not None
    ]


def _interval(one: Figure, two: Figure) -> float | None:
    """Half the 95 % interval of their difference, by Student's t: of few strides the deviation itself is uncertain."""
    if (free := min(one.free, two.free)) < 1:
        return None
    student = (
        12.71 if free < 2 else 1.96 + 2.37 / free + 2.82 / free**2 + 2.56 / free**3
    )  # Cornish-Fisher; 3 % low at 2
    return student * sqrt(one.error**2 + two.error**2) + max(one.fine, two.fine)


def curve(walk: Walk, side: str, signal: str, points: int = 101) -> list[tuple[float, float]]:
    """Mean and deviation of a signal over the cycle, from contact (0 %) to the next one (100 %); [] without steps."""
    by_number = {stretch.number: stretch for stretch in walk.stretches}
    sums, squares, count = [0.0] * points, [0.0] * points, 0
    for step in walk.taken:
        if step.side != side:
            continue
        stretch = by_number[step.segment]
        values, t = stretch.signals[f"{side}_{signal}"], stretch.t
        count += 1
        for point in range(points):
            moment = step.contact + step.duration * point / (points - 1)
            after = min(stretch.at(moment), len(t) - 1)
            span = t[after] - t[after - 1] if after else 0.0
            part = (moment - t[after - 1]) / span if span else 1.0
            value = values[after - 1] + (values[after] - values[after - 1]) * part if after else values[0]
            sums[point] += value
            squares[point] += value * value
    if not count:
        return []
    means = [total / count for total in sums]
    return [(mean, sqrt(max(0.0, square / count - mean * mean))) for mean, square in zip(means, squares, strict=True)]
