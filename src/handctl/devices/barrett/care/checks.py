"""The checks of the troubleshooting that only read, one function each (barrett §8, with the limits of `health`).

A check gets the patient and returns findings; what it cannot read it raises. Who calls them stands in `diagnose`.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from handctl.devices.barrett.care import health, strain, upkeep
from handctl.devices.barrett.care.health import FAIL, OK, SKIPPED, WARNING, Finding
from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.language import MOTORS
from handctl.devices.barrett.gcl.meet import look_for_motion
from handctl.devices.barrett.map import BARRETT, FINGERS, NO_GAUGE, OFF, standard
from handctl.errors import HandctlError
from handctl.sentence import plural

DEFAULTS_MATTER = ("OT", "IVEL", "IOFF", "IHIT")


class Values(dict[tuple[str, str | None], int]):
    """Values by (mnemonic, motor); asking for one that could not be read raises why."""

    def __init__(self) -> None:
        self.errors: dict[str, HandctlError] = {}

    def __missing__(self, key: tuple[str, str | None]) -> int:
        raise self.errors[key[0]]


class Patient:
    """One hand under diagnosis: what was read of it, once."""

    def __init__(self, hand: BarrettHand, *, simulated: Callable[[], bool], name: str = "") -> None:
        self.hand, self.simulated, self.name = hand, simulated, name
        self._values: Values | None = None

    @property
    def values(self) -> Values:
        """Every parameter of §5.3 and §5.4, read at the first use."""
        if self._values is None:
            self._values = self.read()
        return self._values

    def read(self, *names: str) -> Values:
        """Parameters of all motors, all of them without names."""
        found = Values()
        for reading in self.hand.read(BARRETT.elements(*(names or (param.mnemonic for param in standard())))):
            name = str(self.hand.row(reading)["parameter"])
            if reading.error is not None:
                found.errors[name] = reading.error
            else:
                found[name, reading.element.part] = int(reading.value or 0)
        return found


Check = Callable[[Patient], list[Finding]]


# -- the usual checks ---------------------------------------------------------------------------------------------


def firmware(patient: Patient) -> list[Finding]:
    """VERS answers with a number."""
    text = patient.hand.version()
    if re.search(r"\d+\.\d+", text):
        return [Finding("firmware", OK, text, source="barrett §5.2.4")]
    return [doubtful("firmware", f"VERS reports {text!r}, which is not a version number")]


def said(error: HandctlError) -> str:
    """What the hand said, without the link and the command line that it said it to."""
    return "ERR" + error.text.rpartition("ERR")[2] if error.code.startswith("err-") else error.text


def doubtful(check: str, evidence: str) -> Finding:
    """A sign of decayed RAM."""
    remedy = "load the firmware again with `handctl barrett firmware download FILE`: the RAM contents may be damaged"
    return Finding(check, FAIL, evidence, remedy, "barrett §3.7, §8")


def status(patient: Patient) -> list[Finding]:
    """S of each motor, one row when all say the same; and whether it moves, which S does not say: P is read twice."""
    moving = [
        Finding("moving", WARNING, f"P changes: {motor}", "`handctl barrett stop` ends it", "barrett §5.3.2, §6.1")
        for motor in look_for_motion(patient.hand.line)
    ]
    return [*_statuses(patient), *moving]


def _statuses(patient: Patient) -> list[Finding]:
    found = [health.motor_status(motor, patient.values["S", motor]) for motor in MOTORS]
    if len({finding.evidence for finding in found}) == 1:
        one = found[0]._replace(check="status", evidence=f"all motors: {found[0].evidence}")
        if patient.values["S", MOTORS[0]] == health.NOT_INITIALIZED:  # as every hand is after power-on
            return [one._replace(status=OK, evidence=f"{one.evidence}, as after power-on")]
        return [one]
    return found


def can_move(patient: Patient) -> list[Finding]:
    """One forecast per motor from limits, gains, enables, targets, temperature and state; nothing is moved."""
    return health.forecast(patient.values)


def parameters(patient: Patient) -> list[Finding]:
    """Every setting against range, recommended limit and factory value."""
    values = patient.values
    found = health.settings(values)
    changed = [
        f"{name}{f'.{motor}' if motor else ''}"
        for (name, motor), value in values.items()
        if (param := BARRETT.by_mnemonic(name)).writable
        and value != param.default_of(MOTORS.index(motor) if motor else 0)
    ]
    more = f" and {len(changed) - 12} more" if len(changed) > 12 else ""
    shown = f"{plural(len(changed), 'setting')} changed from the factory values: {', '.join(changed[:12])}{more}"
    usual = [
        Finding(
            "parameters",
            OK,
            shown if changed else "all settings have their factory values",
            source="barrett §5.3, §5.4",
        )
    ]
    unread = {said(error): error.hint for error in values.errors.values()}
    failed = [
        Finding("parameters", FAIL, f"some settings could not be read: {text}", hint) for text, hint in unread.items()
    ]
    return [*(failed or usual), *found]


def over_temperature_limit(patient: Patient) -> list[Finding]:
    """OTEMP, which is in tenths of a degree."""
    return [health.over_temperature_limit(patient.values["OTEMP", None])]


def temperature(patient: Patient) -> list[Finding]:
    """Now, and the highest of its life."""
    return [health.temperature(patient.values["TEMP", None]), health.peak(patient.values["PTEMP", None])]


def odometer(patient: Patient) -> list[Finding]:
    """Strokes since the last greasing, against 5,000: one row per motor, its most urgent point."""
    care = upkeep.Care(patient.hand, simulated=patient.simulated(), name=patient.name)
    rows = care.lubrication()
    found = []
    for motor in MOTORS:
        worst = max((row for row in rows if row["motor"] == motor), key=lambda row: int(row["value"]))
        evidence = f"{worst['value']} strokes: {worst['point']} {worst['label']}"
        remedy = "" if worst["status"] == OK else "grease, then `handctl barrett maintenance --greased POINT`"
        found.append(Finding(f"odometer.{motor}", str(worst["status"]), evidence, remedy, "barrett §7.3"))
    return found


def strain_(patient: Patient) -> list[Finding]:
    """No-load readings against 100 to 140; skipped when the fingers are not open."""
    loaded = strain.loaded_fingers(patient.hand)
    found = health.no_load(strain.measure(patient.hand, 5))
    if not loaded:
        return found
    remedy = "`handctl barrett strain --open` opens the fingers and measures"
    return [
        finding._replace(
            status=SKIPPED, evidence=f"{finding.evidence}; may be loaded: {', '.join(loaded)}", remedy=remedy
        )
        if finding.status == WARNING
        else finding
        for finding in found
    ]


# -- checks of single symptoms ------------------------------------------------------------------------------------


def repeatable(patient: Patient) -> list[Finding]:
    """Every setting read again: decayed RAM gives other values, or refuses."""
    settings = [param.mnemonic for param in standard() if param.writable]
    again = patient.read(*settings)
    differ = [
        f"{name}.{motor or 'whole hand'} {patient.values[name, motor]} then {value}"
        for (name, motor), value in again.items()
        if value != patient.values[name, motor]
    ]
    if differ:
        return [
            doubtful(
                "repeatable",
                f"read twice, with different values in {plural(len(differ), 'setting')}: {', '.join(differ[:4])}",
            )
        ]
    return [Finding("repeatable", OK, f"{plural(len(again), 'setting')} read twice, all alike", source="barrett §8")]


def strain_limits(patient: Patient) -> list[Finding]:
    """SG against HSG and LSG: a movement beyond a limit ends at once. SGFLIP stands among the parameters."""
    found = []
    for finger in FINGERS:
        sg, high, low = (patient.values[name, finger] for name in ("SG", "HSG", "LSG"))
        check, source = f"strain_limits.{finger}", "barrett §8, §5.5"
        off = f"`handctl barrett set HSG.{finger}=256 LSG.{finger}=256`"
        if sg == NO_GAUGE and min(high, low) < OFF:
            found.append(
                Finding(check, FAIL, f"no gauge, but limits {low} to {high} are set, so it never moves", off, source)
            )
        elif (high < OFF and sg >= high) or (low < OFF and sg <= low):
            remedy = f"zero the gauge (§7.4), or switch the limits off with {off}"
            found.append(Finding(check, FAIL, f"SG {sg} is outside LSG {low} to HSG {high}", remedy, source))
        else:
            found.append(Finding(check, OK, f"SG {sg}, HSG {high}, LSG {low} (255 and 256 are off)", source=source))
    return found


def velocities(patient: Patient) -> list[Finding]:
    """MOV and MCV of each motor: their own rows stand among the parameters when they are too low."""
    slow = [
        f"{name}.{motor} {patient.values[name, motor]}"
        for name in ("MOV", "MCV")
        for motor in MOTORS
        if patient.values[name, motor] < health.LEAST_VELOCITY
    ]
    if slow:
        remedy = "`handctl barrett set MOV=100 MCV=100 --motors G`, 60 for the spread, then `handctl barrett init`"
        return [Finding("velocities", WARNING, f"below 40: {', '.join(slow)}", remedy, "barrett §8")]
    return [Finding("velocities", OK, "MOV and MCV are 40 or more", source="barrett §8")]


def init_settings(patient: Patient) -> list[Finding]:
    """OT, IVEL, IOFF, IHIT set the force at which the clutch lets go."""
    changed = [
        f"{name}.{finger}={BARRETT.by_mnemonic(name).default_of(0)}"
        for name in DEFAULTS_MATTER
        for finger in FINGERS
        if patient.values[name, finger] != BARRETT.by_mnemonic(name).default_of(0)
    ]
    if changed:
        remedy = f"`handctl barrett set {' '.join(changed)}`, then `handctl barrett init`"
        return [Finding("init_settings", WARNING, f"{len(changed)} of OT IVEL IOFF IHIT changed", remedy, "barrett §8")]
    return [Finding("init_settings", OK, "OT IVEL IOFF IHIT have their factory values", source="barrett §8, §9.3.1")]


def breakaway(patient: Patient) -> list[Finding]:
    """BD and BP, which firmware 4.34 and later has."""
    now = patient.read("BD", "BP")
    if any(error.code == "err-64" for error in now.errors.values()):
        return [
            Finding("breakaway", SKIPPED, "this firmware does not report it (4.34 and later do)", source="barrett §9.5")
        ]
    gone = [f"{finger} at {now['BP', finger]}" for finger in FINGERS if now["BD", finger]]
    if gone:
        remedy = "open the finger, which resets its clutch"
        return [Finding("breakaway", WARNING, f"clutch broke away: {', '.join(gone)}", remedy, "barrett §9.5")]
    return [Finding("breakaway", OK, "no clutch has broken away", source="barrett §9.5")]


def equal_fingers(patient: Patient) -> list[Finding]:
    """Velocities and filters of the fingers should be the same."""
    names = ("MCV", "MOV", "FPG", "FDZ", "FIP", "SAMPLE", "ACCEL")
    uneven = {name: [patient.values[name, finger] for finger in FINGERS] for name in names}
    differ = [f"{name} {'/'.join(map(str, values))}" for name, values in uneven.items() if len(set(values)) > 1]
    if differ:
        remedy = "set them to the same value, unless they compensate for friction"
        return [Finding("equal_fingers", WARNING, f"fingers differ: {', '.join(differ)}", remedy, "barrett §8")]
    return [Finding("equal_fingers", OK, f"{' '.join(names)} are the same for all fingers", source="barrett §8")]


def close_target(patient: Patient) -> list[Finding]:
    """CT at or beyond the palm, which is about 17,000 counts (factory value)."""
    found = []
    for finger in FINGERS:
        target = patient.values["CT", finger]
        factory = BARRETT.by_mnemonic("CT").default_of(0) or 0
        check = f"close_target.{finger}"
        if target < factory:
            remedy = f"`handctl barrett set CT.{finger}={factory}`"
            found.append(Finding(check, WARNING, f"CT {target} ends before the palm", remedy, "barrett §8"))
        else:
            found.append(Finding(check, OK, f"CT {target}", source="barrett §8"))
    return found


def spread_greasing(patient: Patient) -> list[Finding]:
    """The palm's spur gears: the spread's row among the odometers, once more by name."""
    care = upkeep.Care(patient.hand, simulated=patient.simulated(), name=patient.name)
    (row,) = [row for row in care.lubrication() if row["motor"] == "SPREAD"]
    remedy = "" if row["status"] == OK else "`handctl barrett maintenance --steps lubrication`"
    return [Finding("spread_greasing", str(row["status"]), f"{row['value']} strokes: {row['label']}", remedy, "barrett §7.3")]  # fmt: skip


def open_position(patient: Patient) -> list[Finding]:
    """Where the fingers stand when they should be open."""
    shown = ", ".join(f"{finger} {patient.values['P', finger]}" for finger in FINGERS)
    return [Finding("open_position", OK, f"{shown}. Compare the fingertips by eye", source="barrett §8")]


CHECKS: dict[str, Check] = {
    "firmware": firmware,
    "status": status,
    "can_move": can_move,
    "parameters": parameters,
    "over_temperature_limit": over_temperature_limit,
    "temperature": temperature,
    "odometer": odometer,
    "strain": strain_,
    "repeatable": repeatable,
    "strain_limits": strain_limits,
    "velocities": velocities,
    "init_settings": init_settings,
    "breakaway": breakaway,
    "equal_fingers": equal_fingers,
    "close_target": close_target,
    "spread_greasing": spread_greasing,
    "open_position": open_position,
}
