"""Checks of the troubleshooting chapter that move the hand (barrett §8): short movements and their results.

Every trial tells its command lines beforehand, so that a dry run shows the bytes. Ctrl-C stops the hand by ^C. After a
trial that the hand did not carry out the rest is skipped.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from handctl.devices.barrett import motion
from handctl.devices.barrett.gcl.codec import motors_of
from handctl.devices.barrett.maintenance import health
from handctl.devices.barrett.maintenance.diagnose import ExaminedHand
from handctl.devices.barrett.maintenance.health import Finding
from handctl.devices.barrett.map import NO_GAUGE, TRAVEL, sample_seconds
from handctl.errors import HandctlError
from handctl.model.checks import FAIL, OK, SKIPPED, WARNING
from handctl.model.movement import ANY, REACHED
from handctl.model.param import Step
from handctl.model.prompts import Prompts
from handctl.model.result import Row
from handctl.model.stop_sequence import ended_by_interrupt
from handctl.wording import plural

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
    run: Callable[[ExaminedHand, str, Prompts], list[Finding]]


def _moved(patient: ExaminedHand, digits: str, name: str, argument: int | None, prompts: Prompts) -> list[Row]:
    """Rows per motor after a movement, wherever it ended; what the hand refuses is raised."""
    return motion.moved(patient.hand, digits, name, argument, prompts, ANY).rows


def _timed(patient: ExaminedHand, text: str, prompts: Prompts) -> float:
    """Seconds from sending a movement to its prompt. Raises what the hand refuses, Interrupted after Ctrl-C."""
    link = patient.hand.link
    begin = link.now()
    with patient.hand.driven(prompts, powered=True, what=f"in {text}: "):
        patient.hand.do(text)
    return link.now() - begin


def initialize(patient: ExaminedHand, digits: str, prompts: Prompts) -> list[Finding]:
    """HI: every motor must be ready afterwards."""
    table = motion.move(patient.hand, digits, "HI", None, prompts)
    if table.failure is not None and all(row["status"] == 0 for row in table.rows):
        raise table.failure
    found = []
    for row in table.rows:
        check, code = f"initialize.{row['motor']}", row["status"]
        good = Finding(check, OK, f"ready at {row['value']}", source="barrett §5.2.1")
        bad = health.motor_status(row["motor"], code or 0)._replace(check=check, status=FAIL)
        found.append(good if code == 0 else bad)
    return found


def _to_target(check: str, name: str, blocked: str) -> Callable[[ExaminedHand, str, Prompts], list[Finding]]:
    def run(patient: ExaminedHand, digits: str, prompts: Prompts) -> list[Finding]:
        found = []
        for row in _moved(patient, digits, name, None, prompts):
            evidence = f"at {row['value']} of {row['target']}: {row['ended']}"
            good = Finding(f"{check}.{row['motor']}", OK, evidence, source="barrett §5.5")
            bad = good._replace(status=FAIL, remedy=blocked, source="barrett §8, §5.5")
            found.append(good if row["arrival"] == REACHED else bad)
        return found

    return run


def direction(patient: ExaminedHand, digits: str, prompts: Prompts) -> list[Finding]:
    """A small step to close, one to open: the position must grow, then fall. At a stop only one of them can move."""
    places = [patient.read("P")]
    for name in ("IC", "IO"):
        _moved(patient, digits, name, DIRECTION_COUNTS, prompts)
        places.append(patient.read("P"))
    found = []
    for motor in motors_of(digits):
        start, closed, opened = (place["P", motor] for place in places)
        check, source = f"direction.{motor}", "barrett §8"
        evidence = f"closing {closed - start:+d}, opening {opened - closed:+d} of {DIRECTION_COUNTS}"
        if closed < start or opened > closed:
            remedy = "`handctl barrett init` (encoder feedback). If it happens again, send the hand for service"
            found.append(Finding(check, FAIL, f"{evidence}: the wrong way", remedy, source))
        elif closed == start and opened == closed:
            still = f"{evidence}: it did not move"
            found.append(Finding(check, WARNING, still, "check that nothing is in its way", source))
        else:
            found.append(Finding(check, OK, evidence, source=source))
    return found


def strain_curve(patient: ExaminedHand, digits: str, prompts: Prompts) -> list[Finding]:
    """A slow close in free air: strain must stay near its no-load value all the way (§9.4)."""
    seen: dict[str, list[int]] = {motor: [] for motor in motors_of(digits)}
    _moved(patient, digits, "O", None, prompts)
    for _ in range(STEPS):
        for row in _moved(patient, digits, "IC", STEP_COUNTS, prompts):
            if row["strain"] is not None:
                seen[row["motor"]].append(row["strain"])
    _moved(patient, digits, "O", None, prompts)
    found = []
    width = health.NO_LOAD[1] - health.NO_LOAD[0]
    for motor, values in seen.items():
        check, source = f"strain_curve.{motor}", "barrett §8, §9.4"
        if not values or set(values) == {NO_GAUGE}:
            found.append(Finding(check, SKIPPED, "no strain gauge", source=source))
            continue
        evidence = f"{min(values)} to {max(values)} in {plural(len(values), 'step')} of {STEP_COUNTS} counts"
        wrong = f"{evidence}: more than {width} in free air" if max(values) - min(values) > width else ""
        remedy = "if nothing touched it, check the pretension (§7.1), the potentiometer (§7.4) and the idler pulley (Figure 18)"
        found.append(health.verdict(check, source, evidence, wrong, remedy))
    return found


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
    return [health.verdict("torque_speed", "barrett §8", evidence, wrong, remedy)]


def spread_time(patient: ExaminedHand, digits: str, prompts: Prompts) -> list[Finding]:
    """The spread over its whole way and back, fingers open, against the time its velocities ask for."""
    _moved(patient, "123", "O", None, prompts)
    _timed(patient, "4O", prompts)
    found = []
    for text, velocity in (("4C", "MCV"), ("4O", "MOV")):
        seconds = _timed(patient, text, prompts)
        samples = TRAVEL[1] * 16 / max(1, patient.values[velocity, "SPREAD"])  # 1/16 count a sample
        usual = samples * sample_seconds(patient.values["SAMPLE", "SPREAD"])
        evidence = f"{text}: {seconds:.2f} s, about {usual:.2f} s at {velocity} {patient.values[velocity, 'SPREAD']}"
        if seconds > 2 * usual + 0.4:
            found.append(Finding("spread_time", WARNING, evidence, "grease the spread's gears", "barrett §7.3, §8"))
        else:
            found.append(Finding("spread_time", OK, evidence, source="barrett §8"))
    return found


def _one(name: str) -> Callable[[str], list[str]]:
    return lambda digits: [f"{digits}{name}"]


TRIALS: dict[str, Trial] = {
    "initialize": Trial("initialize, fingers open fully", _one("HI"), initialize),
    "open": Trial(
        "open",
        _one("O"),
        _to_target("open", "O", "look for an object, another finger, a strain limit, or MOV below 40"),
    ),
    "close": Trial(
        "close",
        _one("C"),
        _to_target("close", "C", "look for an object, another finger, a strain limit, or MCV below 40"),
    ),
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
        Step(f"{name}: {TRIALS[name].title}", f"{text}\r".encode("ascii"), moves=True)
        for name in names
        for text in TRIALS[name].commands(digits)
    ]


def run_all(patient: ExaminedHand, names: Sequence[str], digits: str, prompts: Prompts) -> list[Finding]:
    """The trials one after the other; what the hand does not carry out ends them. Raises Interrupted."""
    found: list[Finding] = []
    for place, name in enumerate(names):
        try:
            found += TRIALS[name].run(patient, digits, prompts)
        except HandctlError as exc:
            if ended_by_interrupt(exc):
                raise
            found.append(Finding(name, FAIL, exc.text, exc.hint, "barrett §5.5"))
            return found + [Finding(rest, SKIPPED, f"{name} failed") for rest in names[place + 1 :]]
    return found


def not_run(names: Sequence[str], why: str) -> list[Finding]:
    """Rows of trials that were not made."""
    return [Finding(name, SKIPPED, why, TRIALS[name].title) for name in dict.fromkeys(names)]
