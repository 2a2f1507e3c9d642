"""Troubleshooting as read-only checks (barrett §8, with the limits of `health_limits`), and the steps to do by hand.

Without an answer there are rows all the same: the speeds that were tried, and every other check skipped. A warning or a
fail is a finding. A check moves nothing and writes nothing; the trials at the end move the hand, when they are asked for.

A check gets the patient and returns findings; what it cannot read it raises. A trial is a check of the same chapter that moves
the hand, a little: it tells its command lines beforehand, so that a dry run shows the bytes. Ctrl-C stops the hand by ^C. After a
trial that the hand did not carry out the rest is skipped.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property, partial
from typing import NamedTuple

from handctl.devices.barrett import motion
from handctl.devices.barrett.device import BarrettHand, step_of
from handctl.devices.barrett.gcl.codec import MOTORS, motors_of
from handctl.devices.barrett.gcl.session_start import look_for_motion
from handctl.devices.barrett.gcl.status_codes import NOT_INITIALIZED
from handctl.devices.barrett.maintenance import health_limits, lubrication, strain_gauges
from handctl.devices.barrett.maintenance.health_limits import Finding, verdict
from handctl.devices.barrett.maintenance.symptoms import SYMPTOMS, Symptom, like
from handctl.devices.barrett.parameter_map import BARRETT, FINGERS, NO_GAUGE, OFF, gcl_name, standard, travel_seconds
from handctl.devices.barrett.status_and_parameter_views import CHECKED
from handctl.devices.barrett.stopper import CTRL_C_KEEPS_POWER
from handctl.errors import (
    CheckFailed,
    DeviceRefused,
    HandctlError,
    Hint,
    LinkError,
    NoAnswer,
    NotPresent,
    ProtocolError,
    UsageError,
)
from handctl.model.check_rows import FAIL, OK, SKIPPED, TONES, WARNING
from handctl.model.movement import ASTRAY, ENDED, REACHED
from handctl.model.param import Step
from handctl.model.prompts import Prompts
from handctl.model.result import Cell, Column, Grid, Row, Table
from handctl.model.stop_on_interrupt import ended_by_interrupt
from handctl.wording import plural, some

USUAL = ("firmware", "status", "can_move", "parameters", "over_temperature_limit", "temperature", "odometer", "strain")
"""The checks after `communication`, in the order of their rows."""
BY_HAND = "by_hand"
MOST_INVALID = 2
"""After so many checks without a valid answer the rest is skipped."""


DEFAULTS_MATTER = ("OT", "IVEL", "IOFF", "IHIT")


class Values(dict[tuple[str, str | None], int]):
    """Values by (mnemonic, motor); asking for one that could not be read raises why."""

    def __init__(self) -> None:
        self.errors: dict[str, HandctlError] = {}

    def __missing__(self, key: tuple[str, str | None]) -> int:
        raise self.errors[key[0]]


class ExaminedHand:
    """One hand under diagnosis: what was read of it, once."""

    def __init__(self, hand: BarrettHand, name: str = "") -> None:
        self.hand, self.name = hand, name

    @cached_property
    def values(self) -> Values:
        """Every parameter of §5.3 and §5.4, read at the first use."""
        return self.read()

    def greasing(self) -> list[Row]:
        """Strokes since the last greasing, a row a point and motor."""
        return lubrication.MaintenanceLog(self.hand, self.name).lubrication()

    def read(self, *names: str) -> Values:
        """Parameters of all motors, all of them without names."""
        found = Values()
        for reading in self.hand.read(BARRETT.elements(*(names or (param.mnemonic for param in standard())))):
            name = gcl_name(reading.element)
            if reading.error is not None:
                found.errors[name] = reading.error
            else:
                value = reading.value or 0
                self.hand.keep_facts(reading.element.param, value)
                found[name, reading.element.part] = int(value)
        return found


Check = Callable[[ExaminedHand], Iterable[Finding]]


# -- the usual checks ---------------------------------------------------------------------------------------------


def firmware(patient: ExaminedHand) -> list[Finding]:
    """VERS answers with a number."""
    text = patient.hand.version()
    if re.search(r"\d+\.\d+", text):
        return [Finding("firmware", OK, text, source="barrett §5.2.4")]
    return [doubtful("firmware", f"VERS reports {text!r}, which is not a version number")]


def command_line(error: HandctlError) -> str:
    """The reply of the hand, without the link and the command line."""
    return "ERR" + error.text.rpartition("ERR")[2] if error.code.startswith("err-") else error.text


def doubtful(check: str, evidence: str) -> Finding:
    """A sign of decayed RAM."""
    remedy = "load the firmware again with `handctl barrett firmware download FILE`: the RAM contents may be corrupt"
    return Finding(check, FAIL, evidence, remedy, "barrett §3.7, §8")


def status(patient: ExaminedHand) -> list[Finding]:
    """S of each motor, one row when all say the same; and whether it moves, which S does not say: P is read twice."""
    moving = [
        Finding("moving", WARNING, f"P changes: {motor}", Hint("{} stops it", "barrett stop"), "barrett §5.3.2, §6.1")
        for motor in look_for_motion(patient.hand.line)
    ]
    return [*_statuses(patient), *moving]


def _statuses(patient: ExaminedHand) -> list[Finding]:
    found = [health_limits.motor_status(motor, patient.values["S", motor]) for motor in MOTORS]
    if len({finding.evidence for finding in found}) == 1:
        one = found[0]._replace(check="status", evidence=f"all motors: {found[0].evidence}")
        if patient.values["S", MOTORS[0]] == NOT_INITIALIZED:  # as every hand is after power-on
            return [one._replace(status=OK, evidence=f"{one.evidence}, as after power-on")]
        return [one]
    return found


def can_move(patient: ExaminedHand) -> list[Finding]:
    """One forecast per motor from limits, gains, enables, targets, temperature and state; nothing is moved."""
    return health_limits.forecast(patient.values)


def parameters(patient: ExaminedHand) -> list[Finding]:
    """Every setting against range, recommended limit and factory value."""
    values = patient.values
    found = health_limits.settings(values)
    changed = [
        f"{name}{f'.{motor}' if motor else ''}"
        for (name, motor), value in values.items()
        if (param := BARRETT.by_mnemonic(name)).writable
        and value != param.default_of(MOTORS.index(motor) if motor else 0)
    ]
    shown = f"{plural(len(changed), 'setting')} changed from the factory values: {some(changed, 12)}"
    shown = shown if changed else "all settings have their factory values"
    absent = [name for name, error in values.errors.items() if isinstance(error, NotPresent)]
    if absent and values:
        shown += f". Not on this firmware: {', '.join(absent)}"
    failed = [
        Finding("parameters", FAIL, f"some settings could not be read: {text}", hint)
        for text, hint in {
            command_line(error): error.hint for name, error in values.errors.items() if name not in absent or not values
        }.items()
    ]
    return [*(failed or [Finding("parameters", OK, shown, source="barrett §5.3, §5.4")]), *found]


def over_temperature_limit(patient: ExaminedHand) -> list[Finding]:
    """OTEMP, which is in tenths of a degree."""
    return [health_limits.over_temperature_limit(patient.values["OTEMP", None])]


def temperature(patient: ExaminedHand) -> list[Finding]:
    """Now, and the highest of its life."""
    return [health_limits.temperature(patient.values["TEMP", None]), health_limits.peak(patient.values["PTEMP", None])]


def odometer(patient: ExaminedHand) -> Iterator[Finding]:
    """Strokes since the last greasing, against 5,000: one row per motor, its most urgent point."""
    rows = patient.greasing()
    for motor in MOTORS:
        worst = max((row for row in rows if row["motor"] == motor), key=lambda row: int(row["value"]))
        evidence = f"{worst['point']}: {worst['value']} strokes, {worst['label']}"
        remedy = "" if worst["status"] == OK else "grease, then `handctl barrett maintenance --greased POINT`"
        yield Finding(f"odometer.{motor}", str(worst["status"]), evidence, remedy, "barrett §7.3")


def strain_(patient: ExaminedHand) -> list[Finding]:
    """No-load readings against 100 to 140; skipped when the fingers are not open."""
    loaded = strain_gauges.loaded_fingers(patient.hand)
    found = strain_gauges.no_load(strain_gauges.measure(patient.hand, 5))
    if not loaded:
        return found
    remedy, why = (
        Hint("{} opens the fingers and measures", "barrett strain --open"),
        f"may be loaded: {', '.join(loaded)}",
    )
    return [
        one._replace(status=SKIPPED, evidence=f"{one.evidence}; {why}", remedy=remedy) if one.status == WARNING else one
        for one in found
    ]


# -- checks of single symptoms ------------------------------------------------------------------------------------


def repeatable(patient: ExaminedHand) -> list[Finding]:
    """Every setting read again: decayed RAM gives other values, or refuses."""
    settings = [param.mnemonic for param in standard() if param.writable]
    again = patient.read(*settings)
    differ = [
        f"{name}.{motor or 'whole hand'} {patient.values[name, motor]} then {value}"
        for (name, motor), value in again.items()
        if value != patient.values[name, motor]
    ]
    if differ:
        text = f"read twice, with different values in {plural(len(differ), 'setting')}: {', '.join(differ[:4])}"
        return [doubtful("repeatable", text)]
    return [Finding("repeatable", OK, f"{plural(len(again), 'setting')} read twice, all alike", source="barrett §8")]


def strain_limits(patient: ExaminedHand) -> Iterator[Finding]:
    """SG against HSG and LSG: a movement beyond a limit ends at once. SGFLIP is checked with the parameters."""
    for finger in FINGERS:
        sg, high, low = (patient.values[name, finger] for name in ("SG", "HSG", "LSG"))
        off = f"barrett set HSG.{finger}=256 LSG.{finger}=256"
        wrong, remedy = "", Hint("{}", off)
        if sg == NO_GAUGE and min(high, low) < OFF:
            wrong = f"no gauge, but limits {low} to {high} are set, so it never moves"
        elif (high < OFF and sg >= high) or (low < OFF and sg <= low):
            wrong = f"SG {sg} is outside LSG {low} to HSG {high}"
            remedy = Hint("zero the gauge (§7.4), or switch the limits off with {}", off)
        good = f"SG {sg}, HSG {high}, LSG {low} (255 and 256 are off)"
        yield verdict(f"strain_limits.{finger}", "barrett §8, §5.5", good, wrong, remedy, FAIL)


def velocities(patient: ExaminedHand) -> list[Finding]:
    """MOV and MCV of each motor: if they are too low, they have their own rows among the parameters."""
    slow = [
        f"{name}.{motor} {patient.values[name, motor]}"
        for name in ("MOV", "MCV")
        for motor in MOTORS
        if patient.values[name, motor] < health_limits.LEAST_VELOCITY
    ]
    remedy = Hint("{}, 60 for the spread, then {}", "barrett set MOV=100 MCV=100 --motors G", "barrett init")
    wrong = f"below 40: {', '.join(slow)}" if slow else ""
    return [verdict("velocities", "barrett §8", "MOV and MCV are 40 or more", wrong, remedy)]


def init_settings(patient: ExaminedHand) -> list[Finding]:
    """OT, IVEL, IOFF, IHIT set the force at which the clutch lets go."""
    changed = [
        f"{name}.{finger}={BARRETT.by_mnemonic(name).default_of(0)}"
        for name in DEFAULTS_MATTER
        for finger in FINGERS
        if patient.values[name, finger] != BARRETT.by_mnemonic(name).default_of(0)
    ]
    if changed:
        remedy = Hint("{}, then {}", f"barrett set {' '.join(changed)}", "barrett init")
        return [Finding("init_settings", WARNING, f"{len(changed)} of OT IVEL IOFF IHIT changed", remedy, "barrett §8")]
    return [Finding("init_settings", OK, "OT IVEL IOFF IHIT have their factory values", source="barrett §8, §9.3.1")]


def breakaway(patient: ExaminedHand) -> list[Finding]:
    """BD and BP, which firmware 4.34 and later has."""
    now = patient.read("BD", "BP")
    if any(error.code == "err-64" for error in now.errors.values()):
        text = "this firmware does not report it (4.34 and later do)"
        return [Finding("breakaway", SKIPPED, text, source="barrett §9.5")]
    gone = [f"{finger} at {now['BP', finger]}" for finger in FINGERS if now["BD", finger]]
    wrong, remedy = f"clutch broke away: {', '.join(gone)}" if gone else "", "open the finger, which resets its clutch"
    return [verdict("breakaway", "barrett §9.5", "no clutch has broken away", wrong, remedy)]


def equal_fingers(patient: ExaminedHand) -> list[Finding]:
    """Velocities and filters of the fingers should be the same."""
    names = ("MCV", "MOV", "FPG", "FDZ", "FIP", "SAMPLE", "ACCEL")
    uneven = {name: [patient.values[name, finger] for finger in FINGERS] for name in names}
    differ = [f"{name} {'/'.join(map(str, values))}" for name, values in uneven.items() if len(set(values)) > 1]
    good, wrong = f"{' '.join(names)} are the same for all fingers", f"fingers differ: {', '.join(differ)}"
    remedy = "set them to the same value, unless they compensate for friction"
    return [verdict("equal_fingers", "barrett §8", good, wrong if differ else "", remedy)]


def close_target(patient: ExaminedHand) -> Iterator[Finding]:
    """CT at or beyond the palm, which is about 17,000 counts (factory value)."""
    factory = BARRETT.by_mnemonic("CT").default_of(0) or 0
    for finger in FINGERS:
        good = f"CT {patient.values['CT', finger]}"
        wrong = f"{good} ends before the palm" if patient.values["CT", finger] < factory else ""
        remedy = Hint("{}", f"barrett set CT.{finger}={factory}")
        yield verdict(f"close_target.{finger}", "barrett §8", good, wrong, remedy)


def spread_greasing(patient: ExaminedHand) -> list[Finding]:
    """The palm's spur gears: the spread's row among the odometers, once more by name."""
    (row,) = [row for row in patient.greasing() if row["motor"] == "SPREAD"]
    remedy = "" if row["status"] == OK else Hint("{}", "barrett maintenance --steps lubrication")
    return [Finding("spread_greasing", str(row["status"]), f"{row['value']} strokes, {row['label']}", remedy, "barrett §7.3")]  # fmt: skip


def open_position(patient: ExaminedHand) -> list[Finding]:
    """The positions of the fingers when they should be open."""
    shown = ", ".join(f"{finger} {patient.values['P', finger]}" for finger in FINGERS)
    return [Finding("open_position", OK, f"{shown}. Compare the fingertips by eye", source="barrett §8")]


CHECKS: dict[str, Check] = {
    check.__name__.rstrip("_"): check
    for check in (
        firmware, status, can_move, parameters, over_temperature_limit, temperature, odometer, strain_, repeatable,
        strain_limits, velocities, init_settings, breakaway, equal_fingers, close_target, spread_greasing, open_position,
    )
}  # fmt: skip


# -- communication ------------------------------------------------------------------------------------------------


def communication(hand: BarrettHand, speed: int | None) -> Finding:
    """Check for a prompt at each baud rate; lists those tried and the data received. Raises LinkError if the port fails."""
    link, line = hand.link, hand.line
    if speed is not None:
        line.only = speed
    error: HandctlError | None = None
    try:
        line.connect()
    except (NoAnswer, ProtocolError, DeviceRefused) as exc:
        error = exc
    seen = []
    for baud, came in line.tried if error is not None else line.tried[:-1]:
        what = f"{plural(len(came), 'byte')} arrived: {came[:24].hex(' ').upper()}" if came else "silence"
        seen.append(f"{baud}: {what}" if baud else what)
    if error is None:
        where = f"prompt at {line.link.baud} bit/s" if line.link.can_set_baud else "prompt"
        before = f" (before: {', '.join(seen)})" if seen else ""
        return Finding("communication", OK, where + before, source="barrett §5.1.1")
    if line.over:
        seen.append("--deadline has passed")
    if isinstance(error, DeviceRefused):
        evidence = f"{error.text}. Tried {', '.join(seen)}" if seen else error.text
        return Finding("communication", FAIL, evidence, error.hint, "barrett §3.7")
    if speed is not None:
        seen.append("no other baud rate, because of --baud")
    evidence = f"{link.name}: no prompt ({', '.join(dict.fromkeys(seen))})"
    return Finding("communication", FAIL, evidence, error.hint, "barrett §8, §3.3")


def symptom_of(name: str) -> Symptom:
    """The entry of the book. Raises UsageError with near names."""
    if name not in SYMPTOMS:
        likely = like(name.lower())
        meant = f"did you mean {' or '.join(likely)}? " if likely else ""
        raise UsageError(
            f"{name!r} is not a symptom in the manual",
            hint=Hint(f"{meant}{{}} shows them all", "barrett diagnose --list"),
            code="unknown-name",
        )
    return SYMPTOMS[name]


# -- all together -------------------------------------------------------------------------------------------------


def examine(patient: ExaminedHand, names: Sequence[str], speed: int | None) -> tuple[list[Finding], LinkError | None]:
    """Check communication, then run the checks by name; all are skipped once the line is dead. Also returns the link's error."""
    try:
        found = [communication(patient.hand, speed)]
    except LinkError as exc:
        found = [Finding("communication", FAIL, exc.text, exc.hint, "barrett §3.3")]
        return [*found, *_skipped(names)], exc
    if found[0].status == FAIL:
        return [*found, *_skipped(names)], None
    invalid = 0
    for place, name in enumerate(names):
        rest = names[place + 1 :]
        try:
            found += list(CHECKS[name](patient))  # all of a check, or none
        except LinkError as exc:
            found[0] = Finding("communication", FAIL, exc.text, exc.hint, "barrett §3.3")
            return [*found, *_skipped(names[place:])], exc
        except NotPresent as exc:
            found.append(
                Finding(name, SKIPPED, f"not on this firmware: {command_line(exc)}", exc.hint, "barrett §5.1.3")
            )
        except (NoAnswer, ProtocolError) as exc:
            invalid += 1
            found.append(Finding(name, FAIL, exc.text, exc.hint, "barrett §8"))
            if isinstance(exc, NoAnswer) or invalid == MOST_INVALID:  # each has been repeated: waiting on is no use
                return [*found, *_skipped(rest)], None
        except HandctlError as exc:
            found.append(Finding(name, FAIL, command_line(exc), exc.hint, "barrett §5.1.3"))
    return found, None


def _skipped(names: Sequence[str]) -> list[Finding]:
    return [Finding(name, SKIPPED, "no communication") for name in names]


def by_hand(symptom: str) -> list[Finding]:
    """What is left of the manual's list for `symptom`: rows that no program can check."""
    return [
        Finding(f"{BY_HAND}.{number}", SKIPPED, "to be done by hand", text, f"barrett {source}")
        for number, (text, source) in enumerate(SYMPTOMS[symptom].steps, 1)
    ]


def table_of(hand: BarrettHand, findings: list[Finding], symptom: str | None, failure: LinkError | None) -> Table:
    """The rows; a warning or a fail is exit 7, a lost link its own 3."""
    rows = [finding.row() for finding in findings]
    if symptom is not None:
        rows += [finding.row() for finding in by_hand(symptom)]
    bad = [finding for finding in findings if finding.bad]
    table = Table(rows=rows, columns=CHECKED, view=view)
    if failure is not None:
        table.failure = failure
    elif bad:
        fails = sum(finding.status == FAIL for finding in bad)
        warnings = len(bad) - fails
        names = ", ".join(finding.check for finding in bad)
        table.failure = CheckFailed(
            f"{hand.link.name}: {fails} failed, {warnings} warning{'' if warnings == 1 else 's'}: {names}",
            hint=Hint("follow the remedy in each row. {} shows the symptoms", "barrett diagnose --list")
            if symptom is None
            else "follow the remedy in each row",
            code="findings",
        )
    return table


def view(rows: list[Row]) -> list[Grid]:
    """Check, status and evidence; below them what to do about the findings, then the steps by hand."""
    checks = [row for row in rows if not row["check"].startswith(BY_HAND)]
    lines = tuple((row["check"], Cell(row["status"], TONES[row["status"]]), row["evidence"]) for row in checks)
    todo: dict[str, list[str]] = {}
    for row in checks:
        if row["remedy"] and row["status"] != OK:
            todo.setdefault(f"{row['remedy']}{_section(row)}", []).append(row["check"])
    remedies = [f"  {', '.join(dict.fromkeys(names))}: {text}" for text, names in todo.items()]
    steps = [
        f"  {number}. {row['remedy']}{_section(row)}"
        for number, row in enumerate((row for row in rows if row["check"].startswith(BY_HAND)), 1)
    ]
    notes = [*(["To do:"] if remedies else []), *remedies, *(["Then, by hand:"] if steps else []), *steps]
    return [Grid(("Check", "Status", "Evidence"), lines, notes=tuple(notes))]


def _section(row: Row) -> str:
    return f" ({row['source']})" if row["source"] else ""


def list_table() -> Table:
    """All symptoms of the book; needs no hand."""
    rows: list[Row] = [
        {
            "symptom": name,
            "title": entry.title,
            "checks": list(entry.checks),
            "moves": bool(entry.trials),
            "steps": len(entry.steps),
        }
        for name, entry in SYMPTOMS.items()
    ]
    columns = (Column("symptom", "Symptom"), Column("title", "Description"), Column("moves", "Has --move"))
    return Table(rows=rows, columns=columns)


# -- movements that test a symptom ------------------------------------------------------------------------------------


STEP_COUNTS, STEPS = 850, 20
"""The slow close of the strain curve: 20 steps of a twentieth of 17,000 counts."""
DIRECTION_COUNTS = 200
UNEVEN = 1.25
"""Fastest against slowest finger under torque control; ours, the manual gives none."""


class Trial(NamedTuple):
    """One movement check.

    commands   digits of the fingers -> the GCL lines that it sends
    run        (patient, digits, guide) -> what came of it
    """

    title: str
    commands: Callable[[str], list[str]]
    run: Callable[[ExaminedHand, str, Prompts], Iterable[Finding]]


def _moved(patient: ExaminedHand, digits: str, name: str, argument: int | None, prompts: Prompts) -> list[Row]:
    """Rows per motor after a movement, wherever it ended, also on the wrong side; what the hand refuses is raised."""
    table = motion.move(patient.hand, digits, name, argument, prompts, expect=ENDED)
    if table.failure is not None and table.failure.code != ASTRAY:
        raise table.failure
    return table.rows


def _timed(patient: ExaminedHand, text: str, prompts: Prompts) -> float:
    """Seconds from sending a movement to its prompt. Raises what the hand refuses, Interrupted after Ctrl-C."""
    link = patient.hand.link
    begin = link.now()
    with patient.hand.driven(prompts, powered=CTRL_C_KEEPS_POWER, what=f"in {text}: "):
        patient.hand.do(text)
        took = link.now() - begin
        patient.hand.line.check_ended(text)
    return took


def initialize(patient: ExaminedHand, digits: str, prompts: Prompts) -> Iterator[Finding]:
    """HI: every motor must be ready afterwards."""
    table = motion.move(patient.hand, digits, "HI", None, prompts)
    if table.failure is not None and all(row["status"] == 0 for row in table.rows):
        raise table.failure
    for row in table.rows:
        check, code = f"initialize.{row['motor']}", row["status"]
        good = Finding(check, OK, f"ready at {row['value']}", source="barrett §5.2.1")
        bad = health_limits.motor_status(row["motor"], code or 0)._replace(check=check, status=FAIL)
        yield good if code == 0 else bad


def _to_target(
    check: str, name: str, velocity: str, patient: ExaminedHand, digits: str, prompts: Prompts
) -> Iterator[Finding]:
    """O or C: every motor must get to its target."""
    blocked = f"look for an object, another finger, a strain limit, or {velocity} below 40"
    for row in _moved(patient, digits, name, None, prompts):
        evidence = f"at {row['value']} of {row['target']}: {row['ended']}"
        good = Finding(f"{check}.{row['motor']}", OK, evidence, source="barrett §5.5")
        bad = good._replace(status=FAIL, remedy=blocked, source="barrett §8, §5.5")
        yield good if row["arrival"] == REACHED else bad


def direction(patient: ExaminedHand, digits: str, prompts: Prompts) -> Iterator[Finding]:
    """A small step to close, one to open: the position must grow, then fall. At a stop only one of them can move."""
    places = [patient.read("P")]
    for name in ("IC", "IO"):
        _moved(patient, digits, name, DIRECTION_COUNTS, prompts)
        places.append(patient.read("P"))
    for motor in motors_of(digits):
        start, closed, opened = (place["P", motor] for place in places)
        check, source = f"direction.{motor}", "barrett §8"
        evidence = f"closing {closed - start:+d}, opening {opened - closed:+d} of {DIRECTION_COUNTS}"
        if closed < start or opened > closed:
            remedy = Hint("{} (encoder feedback). If it happens again, send the hand for service", "barrett init")
            yield Finding(check, FAIL, f"{evidence}: the wrong way", remedy, source)
        elif closed == start and opened == closed:
            still = f"{evidence}: it did not move"
            yield Finding(check, WARNING, still, "check that nothing is in its way", source)
        else:
            yield Finding(check, OK, evidence, source=source)


def strain_curve(patient: ExaminedHand, digits: str, prompts: Prompts) -> Iterator[Finding]:
    """A slow close in free air: strain must stay near its no-load value all the way (§9.4)."""
    seen: dict[str, list[int]] = {motor: [] for motor in motors_of(digits)}
    _moved(patient, digits, "O", None, prompts)
    for _ in range(STEPS):
        for row in _moved(patient, digits, "IC", STEP_COUNTS, prompts):
            if row["strain"] is not None:
                seen[row["motor"]].append(row["strain"])
    _moved(patient, digits, "O", None, prompts)
    width = strain_gauges.NO_LOAD[1] - strain_gauges.NO_LOAD[0]
    for motor, values in seen.items():
        check, source = f"strain_curve.{motor}", "barrett §8, §9.4"
        if not values or set(values) == {NO_GAUGE}:
            yield Finding(check, SKIPPED, "no strain gauge", source=source)
            continue
        evidence = f"{min(values)} to {max(values)} in {plural(len(values), 'step')} of {STEP_COUNTS} counts"
        wrong = f"{evidence}: more than {width} in free air" if max(values) - min(values) > width else ""
        remedy = "if nothing touched it, check the pretension (§7.1), the potentiometer (§7.4) and the idler pulley (Figure 18)"
        yield verdict(check, source, evidence, wrong, remedy)


def torque_speed(patient: ExaminedHand, digits: str, prompts: Prompts) -> list[Finding]:
    """Counts per second of each finger alone under torque control."""
    speeds = {}
    for digit, motor in zip(digits, motors_of(digits), strict=True):
        _moved(patient, digit, "O", None, prompts)
        before = patient.read("P")["P", motor]
        seconds = _timed(patient, f"{digit}TC", prompts)
        speeds[motor] = abs(patient.read("P")["P", motor] - before) / seconds
        _moved(patient, digit, "O", None, prompts)
    evidence = ", ".join(f"{motor} {speed:.0f}" for motor, speed in speeds.items()) + " counts a second"
    wrong = evidence if max(speeds.values()) > UNEVEN * min(speeds.values()) else ""
    remedy = "grease the slow finger (§7.3), or compensate with MCV or FPG"
    return [verdict("torque_speed", "barrett §8", evidence, wrong, remedy)]


def spread_time(patient: ExaminedHand, digits: str, prompts: Prompts) -> Iterator[Finding]:
    """The spread over its whole way and back, fingers open, against the time its velocities ask for."""
    _moved(patient, "123", "O", None, prompts)
    _timed(patient, "4O", prompts)
    for text, velocity in (("4C", "MCV"), ("4O", "MOV")):
        seconds = _timed(patient, text, prompts)
        usual = travel_seconds(3, patient.values[velocity, "SPREAD"], patient.values["SAMPLE", "SPREAD"])
        evidence = f"{text}: {seconds:.2f} s, about {usual:.2f} s at {velocity} {patient.values[velocity, 'SPREAD']}"
        if seconds > slowest(usual):
            yield Finding("spread_time", WARNING, evidence, "grease the spread's gears", "barrett §7.3, §8")
        else:
            yield Finding("spread_time", OK, evidence, source="barrett §8")


def slowest(usual: float) -> float:
    """The longest time that a movement may take which its settings let take `usual` seconds; ours, the manual gives none."""
    return 2 * usual + 0.4


def _one(name: str) -> Callable[[str], list[str]]:
    return lambda digits: [f"{digits}{name}"]


TRIALS: dict[str, Trial] = {
    "initialize": Trial("initialize, fingers open fully", _one("HI"), initialize),
    "open": Trial("open", _one("O"), partial(_to_target, "open", "O", "MOV")),
    "close": Trial("close", _one("C"), partial(_to_target, "close", "C", "MCV")),
    "direction": Trial(
        "close and open a little",
        lambda digits: [f"{digits}{name} {DIRECTION_COUNTS}" for name in ("IC", "IO")],
        direction,
    ),
    "strain_curve": Trial(
        "open, close in small steps, open",
        lambda digits: [f"{digits}O", *[f"{digits}IC {STEP_COUNTS}"] * STEPS, f"{digits}O"],
        strain_curve,
    ),
    "torque_speed": Trial(
        "open, close and open each finger",
        lambda digits: [f"{digit}{name}" for digit in digits for name in ("O", "TC", "O")],
        torque_speed,
    ),
    "spread_time": Trial(
        "open, then move the spread back and forth", lambda _: ["123O", "4O", "4C", "4O"], spread_time
    ),
}


def steps(names: Sequence[str], digits: str) -> list[Step]:
    """The exact bytes of several trials."""
    return [
        step_of(text)._replace(meaning=f"{name}: {TRIALS[name].title}")
        for name in names
        for text in TRIALS[name].commands(digits)
    ]


def run_all(patient: ExaminedHand, names: Sequence[str], digits: str, prompts: Prompts) -> list[Finding]:
    """The trials one after the other; what the hand does not carry out ends them. Raises Interrupted."""
    found: list[Finding] = []
    for place, name in enumerate(names):
        try:
            found += list(TRIALS[name].run(patient, digits, prompts))
        except HandctlError as exc:
            if ended_by_interrupt(exc):
                raise
            found.append(Finding(name, FAIL, exc.text, exc.hint, "barrett §5.5"))
            return found + [Finding(rest, SKIPPED, f"{name} failed") for rest in names[place + 1 :]]
    return found


def not_run(names: Sequence[str], why: str) -> list[Finding]:
    """Rows of trials that were not made."""
    return [Finding(name, SKIPPED, why, TRIALS[name].title) for name in dict.fromkeys(names)]
