"""Rows of the RealTime loop: positions, the results of the guards, and the reason for doubt, if any.

And of a loop that measures round trips, rate and the line's limits, as rows and as tables.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.gcl.line import SLOW_ADAPTER
from handctl.devices.barrett.parameter_map import BARRETT, NO_GAUGE, implausible
from handctl.devices.barrett.realtime.blocks import (
    FEEDBACK,
    UNITS,
    Feedback,
    Layout,
    Selection,
    Values,
    cycles,
    velocity_unit,
)
from handctl.devices.barrett.realtime.guards import Event, Guards
from handctl.devices.barrett.realtime.joint_angles import Angles
from handctl.devices.barrett.realtime.loop_flags import FlagRequest, Prepared
from handctl.devices.barrett.status_and_parameter_views import NAME, UNIT, VALUE, row_of
from handctl.errors import CheckFailed
from handctl.model.device_clock import Moment
from handctl.model.param import Number, scale_of
from handctl.model.prompts import CTRL_C
from handctl.model.result import Grid, RoundTrips, Row, Sample, Table
from handctl.model.sampling import started

if TYPE_CHECKING:
    from handctl.command.run import Run
    from handctl.devices.barrett.realtime.loop import RealtimeLoop


class Sent(NamedTuple):
    """A block that went out: when, with which values, and which guard made a motor's velocity 0."""

    at: float
    values: Values
    held: Mapping[int, str]


class Taken(NamedTuple):
    """One feedback block that has come: with which values it was asked for, and when.

    values     what was sent with it; held = which guard made a motor's velocity 0
    positions  motor index -> counts, from LFAP or the sum of LFDP
    saturated  motor index -> why a position that was added up is behind, "" when it is not
    """

    feedback: Feedback
    values: Values
    held: Mapping[int, str]
    positions: Mapping[int, int]
    saturated: Mapping[int, str]
    at: float
    sent: float = 0.0


class Positions:
    """Motor positions from the feedback: absolute, or summed up from `FGET P` (barrett §6.2.3)."""

    def __init__(self, layout: Layout, start: Mapping[int, int], *, discards: bool) -> None:
        self._layout, self._places, self._discards = layout, dict(start), discards
        self._lost: set[int] = set()
        self.saturated = 0
        """Deltas that a byte could not hold: the position lags then, or with LFDPD is wrong from there on."""

    def update(self, feedback: Feedback) -> tuple[dict[int, int], dict[int, str]]:
        """Positions after this block, and which of them cannot be believed, with the reason."""
        places: dict[int, int] = {}
        doubts: dict[int, str] = {}
        for index, found in feedback.motors.items():
            if "delta" in found:
                self._places[index] += self._layout.motors[index].scaled("delta", found["delta"])
                places[index] = self._places[index]
                if found["delta"] in (127, -128):
                    self.saturated += 1
                    doubts[index] = "saturated: the change did not fit into a byte, so the position lags"
                    if self._discards:
                        self._lost.add(index)
                elif index in self._lost:
                    doubts[index] = "an earlier change did not fit into a byte, and LFDPD dropped the rest"
            if "position" in found:
                places[index] = found["position"]
        return places, doubts


class Intake:
    """Takes the answers of one loop: times, positions, guards, samples.

    prepared  how the loop is, once that is known
    start     of the blocks, `started` the same as a time of day; rate = blocks a second that were asked for, 0 = as many as go; late = blocks behind it
    cycle     s that pass from one chance to act to the next, as seen lately
    end       why a guard ends the loop
    angles    what makes joint angles of the positions, None = they were not asked for
    moment    when the block of the last sample was sent, and when its feedback had come
    """

    def __init__(self, hand: BarrettHand, flag_request: FlagRequest, *, measuring: bool) -> None:
        self._hand, self._wish, self._measuring = hand, flag_request, measuring
        self.prepared = Prepared(Layout({}), {}, False, {}, 0, False)
        self.guards: Guards | None = None
        self.angles: Angles | None = None
        self.end: CheckFailed | None = None
        self.moment = Moment(0.0, 0.0)
        self.velocity_points: dict[int, list[tuple[float, int, int]]] = {index: [] for index in flag_request.motors}
        self.start = self.rate = 0.0
        self.started: float | None = None
        self._positions = Positions(self.prepared.layout, {}, discards=False)
        self._in_force: Values = {}
        self._told = 0
        self.forget()

    def begin(self, positions: Mapping[int, int]) -> None:
        """Set the positions before LOOP."""
        prepared = self.prepared
        self._positions = Positions(prepared.layout, positions, discards=prepared.discards)
        if prepared.limits:
            now = self._hand.link.now()
            self.guards = Guards(prepared.limits, positions, self._wish.guards, prepared.heat, now)

    def forget(self) -> None:
        """Reset times and counts; keep positions and guards."""
        self.trips = RoundTrips()
        self.answers = self.samples = self.late = 0
        self._first = self._last = self.cycle = 0.0

    def accept(self, feedback: Feedback, sent: Sent) -> Taken:
        """A block has come: its time, its positions, what the guards make of it."""
        now = self._hand.link.now()
        self.trips.add(now - sent.at)
        self.answers += 1
        self.cycle = max(now - (self._last if self.answers > 1 else sent.at), 0.8 * self.cycle)
        self._first, self._last = (now if self.answers == 1 else self._first), now
        places, saturated = self._positions.update(feedback)
        if self.guards is not None:
            for index, names in self._in_force.items():
                strain = feedback.motors.get(index, {}).get("strain")
                self.guards.see(index, places.get(index), strain, names.get("velocity", 0), sent.at, now)
            if feedback.temperature is not None:
                self.guards.heat(feedback.temperature)
            self._tell(self.guards.events)
        self._in_force = sent.values
        if self.angles is not None:
            self.angles.driven(sent.values)
        return Taken(feedback, sent.values, sent.held, places, saturated, now, sent.at)

    def outline(self, values: Values) -> Sample:
        """A sample as they will be, all its numbers 0."""
        layout = self.prepared.layout
        motors = {index: dict.fromkeys(motor.feedback, 0) for index, motor in layout.motors.items()}
        blank = Taken(Feedback(motors, 0), values, {}, dict.fromkeys(motors, 0), {}, 0.0)
        return Sample(0.0, self._rows(blank))

    def _rows(self, taken: Taken, doubt: str = "") -> tuple[Row, ...]:
        rows = list(rows_of(taken, self.prepared, doubt))
        if self.angles is not None:
            doubts = {index: doubt or _doubt(taken, index) for index in taken.positions}
            rows += self.angles.rows(taken.positions, doubts)
        return tuple(rows)

    def _tell(self, events: list[Event]) -> None:
        """What the guards did since the last time."""
        while self._told < len(events):
            event = events[self._told]
            self._told += 1
            where = f"{MOTORS[event.motor]}: " if event.motor is not None else ""
            text = f"{where}{event.text} (guard {event.guard}, {event.at - self.start:.3f} s)"
            if event.ends:
                self.end = CheckFailed(
                    f"{self._hand.link.name}: {text}. The loop has ended",
                    hint=f"use --no-guard {event.guard} to continue anyway",
                    code=f"guard-{event.guard}",
                )
            else:
                self._hand.journal.warn(f"guard-{event.guard}", text)

    def sample(self, taken: Taken, doubt: str = "") -> Sample:
        """The rows of a block; `doubt` speaks against all of them."""
        self.moment = Moment(taken.sent, taken.at)
        self.samples += 1
        if self._measuring:
            for index, found in taken.feedback.motors.items():
                if "velocity" in found and "position" in found:
                    velocity = self.prepared.layout.motors[index].scaled("velocity", found["velocity"])
                    self.velocity_points[index].append((taken.at, found["position"], velocity))
        if any(taken.saturated.values()):
            self._hand.journal.warn(
                "saturated",
                "a delta did not fit into its byte, so the position that is summed from deltas lags (its rows say so)",
                hint="use more counts in --delta-unit, position in --receive, or a higher --rate (barrett §6.2.3)",
            )
        t = taken.at - self.start
        return Sample(t, self._rows(taken, doubt), None if self.started is None else self.started + t)

    def summary(self, *, drives: bool, overlapped: bool) -> dict[str, Any]:
        """Rate, latencies, floors and what the guards did."""
        seconds = self._last - self._first
        rate = (self.answers - 1) / seconds if self.answers > 1 and seconds > 0 else None
        baud, layout = self._hand.line.link.baud, self.prepared.layout
        size = (layout.control_size if drives else 1, layout.feedback_size)
        floors = {name: round(1 / cycle, 1) for name, cycle in cycles(*size, baud).items()} if baud else None
        return {
            **started(self.started),
            "stream": {
                "samples": self.samples,
                "failed": 0,
                "late": self.late,
                "seconds": round(seconds, 3),
                "rate_hz": round(rate, 2) if rate is not None else None,
                "asked_hz": self.rate or None,
            },
            "loop": {
                "control_bytes": size[0],
                "feedback_bytes": size[1],
                "latency": self.trips.as_row(),
                "line_limit_hz": floors,
                "overlapped": overlapped,
                "saturated_deltas": self._positions.saturated,
                "guards": sorted(self._wish.guards) if self.guards is not None else [],
                "guard_events": [self._event_row(event) for event in (self.guards.events if self.guards else ())],
            },
        }

    def _event_row(self, event: Event) -> dict[str, Any]:
        return {
            "guard": event.guard,
            "motor": MOTORS[event.motor] if event.motor is not None else None,
            "t": round(event.at - self.start, 4),
            "value": event.value,
            "limit": event.limit,
            "after_ms": round(event.after * 1000, 1),
        }


def rows_of(taken: Taken, prepared: Prepared, doubt: str) -> Iterator[Row]:
    """Rows of one moment: for each motor the values sent and received, of the feedback only those that are shown.

    `doubt` is what speaks against the whole block, "" when nothing does.
    """
    for index, motor in prepared.layout.motors.items():
        yield from _motor_rows(taken, motor, index, prepared.shown[index], doubt)
    if prepared.temperature and taken.feedback.temperature is not None:
        yield _row("temperature", "LFT", None, taken.feedback.temperature / 10, "°C", doubt)


def _motor_rows(taken: Taken, motor: Selection, index: int, shown: tuple[str, ...], doubt: str) -> Iterator[Row]:
    name = MOTORS[index]
    for control, value in taken.values.get(index, {}).items():
        if control == "velocity":
            # In the unit of MOV and MCV: 1/16 count a sample (dossier 6.3).
            row = _row("velocity_command", "LCV", name, value * motor.velocity_factor, "1/16 cts/sample")
            yield {**row, "guard": taken.held.get(index)}
        else:
            yield _row("gain_command", "LCPG", name, value, None)
    found = taken.feedback.motors.get(index, {})
    saturated = taken.saturated.get(index, "")
    for key, value in found.items():
        if key not in shown:
            continue
        why = doubt or (saturated if key == "delta" and value in (127, -128) else "")
        if key == "position" and implausible(index, value):
            why = why or "beyond the joint's travel"
        row = _row(key, FEEDBACK[key], name, motor.scaled(key, value), UNITS.get(key), why)
        yield {**row, "label": "no gauge"} if key == "strain" and value == NO_GAUGE else row
    if "delta" in found and "delta" in shown and "position" not in found:
        why = doubt or _doubt(taken, index)
        yield _row("position", "LFDP", name, taken.positions[index], "cts", why)


def _doubt(taken: Taken, index: int) -> str:
    """What speaks against the position of a motor, "" = nothing."""
    beyond = "beyond the joint's travel" if implausible(index, taken.positions[index]) else ""
    return taken.saturated.get(index, "") or beyond


def _row(name: str, parameter: str, motor: str | None, value: Number, unit: str | None, doubt: str = "") -> Row:
    row = row_of(name, parameter, motor, value, unit)
    if (scale := scale_of(unit or "")) is not None:
        row |= {"scaled": scale.of(value), "scaled_unit": scale.unit}
    path = {"path": f"{name}.{motor}" if motor else name} if name in BARRETT else {}  # of what `get` tells as well
    return {**row, "doubt": doubt or None, **path}


# -- --measure ---------------------------------------------------------------------------------------------------------


def measured(run: Run, loop: RealtimeLoop, blocks: int, rate: float) -> Table:
    """Round trips, rate and the line's limits: what the vendor's "test delays" run is for."""
    for number, _ in enumerate(loop.run(rate=rate, count=blocks, duration=None), 1):
        if number % 20 == 0:
            run.prompts.progress(f"{number} of {blocks} blocks.", CTRL_C)
    run.prompts.done()
    found = loop.summary()
    latency = found["loop"]["latency"]
    rows: list[Row] = [
        {"name": "rate", "value": found["stream"]["rate_hz"], "unit": "Hz"},
        *({"name": f"limit_{name}", "value": hertz, "unit": "Hz"} for name, hertz in (found["loop"]["line_limit_hz"] or {}).items()),
        {"name": "control_block", "value": found["loop"]["control_bytes"], "unit": "bytes"},
        {"name": "feedback_block", "value": found["loop"]["feedback_bytes"], "unit": "bytes"},
        *({"name": key.removesuffix("_ms"), "value": value, "unit": "ms"} for key, value in latency.items() if key.endswith("_ms")),
        {"name": "late", "value": latency["late"], "unit": None},
        *_fits(loop),
    ]  # fmt: skip
    if not rate:
        _advise(run, found)
    table = Table(rows=rows, columns=(NAME, VALUE, UNIT), extra=found, failure=loop.failure)
    table.view = lambda rows: [_rows_grid(rows), _histogram_grid(latency["histogram"])]
    return table


def _fits(loop: RealtimeLoop) -> Iterable[Row]:
    for index, points in loop.intake.velocity_points.items():
        unit = velocity_unit(points)
        if unit is not None:
            yield {"name": f"velocity_unit.{MOTORS[index]}", "value": round(unit, 2), "unit": "cts/s"}


def _advise(run: Run, found: dict[str, Any]) -> None:
    """Warn about a link that is much slower than its bytes: pipelined blocks queue, so the rate shows it, not the round trip."""
    limits, rate = found["loop"]["line_limit_hz"], found["stream"]["rate_hz"]
    if limits is None or not rate:
        return
    cycle_ms, wire_ms = 1000 / rate, 1000 / limits["sequential"]
    if cycle_ms > wire_ms + 8:
        run.journal.warn(
            "slow-adapter",
            f"a block takes {cycle_ms:.1f} ms, its bytes {wire_ms:.1f} ms: the adapter delays them",
            hint=SLOW_ADAPTER,
        )


def _rows_grid(rows: list[Row]) -> Grid:
    lines = tuple(
        (str(row["name"]), "?" if row["value"] is None else f"{row['value']:g}", str(row["unit"] or "")) for row in rows
    )
    return Grid(("Name", "Value", "Unit"), lines, right=frozenset({1}))


def _histogram_grid(histogram: list[list[Any]]) -> Grid:
    most = max(count for _, count in histogram)
    lines = tuple(
        (
            f"<= {edge:g} ms" if edge is not None else "above",
            str(count),
            "█" * max(1, round(20 * count / most)) if count else "",
        )
        for edge, count in histogram
    )
    return Grid(("Round trip", "Blocks", ""), lines, right=frozenset({0, 1}))
