"""Can it move now? One forecast per motor from what was read, without moving (barrett §5.3, §5.4, §5.5). Pure.

What a movement command needs: electronics, initialization, a temperature below OTEMP, strain within its limits, a gain,
an acceleration that the motor controller can follow, a velocity above friction, and a way between OT and CT.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from handctl.devices.barrett.care.health import FAIL, LEAST_VELOCITY, NO_GAUGE, OK, WARNING, Finding
from handctl.devices.barrett.gcl.language import MOTORS
from handctl.devices.barrett.map import BARRETT

At = Mapping[tuple[str, str | None], int]
OFF = 255
"""From here on a strain limit is off (§5.3.1)."""
SOURCE = "barrett §5.3, §5.5"


class Reason(NamedTuple):
    """Why a motor does not move, or not as it should: what is seen, the setting that mends it, whether it stands."""

    text: str
    remedy: str
    stands: bool = True


def can_move(motor: str, at: At) -> Finding:
    """The forecast of one motor: ok with what it still needs, a warning for half of it, a fail where it will stand."""
    reasons = [*_state(motor, at), *_heat(at), *_strain(motor, at), *_drive(motor, at), *_way(motor, at)]
    check = f"can_move.{motor}"
    if not reasons:
        return Finding(check, OK, "yes, after HI" if at["S", motor] & 4 else "yes", source=SOURCE)
    stands = any(reason.stands for reason in reasons)
    text = "; ".join(reason.text for reason in reasons)
    remedy = "; ".join(dict.fromkeys(reason.remedy for reason in reasons))
    return Finding(check, FAIL if stands else WARNING, f"{'no' if stands else 'in part'}: {text}", remedy, SOURCE)


def forecast(at: At) -> list[Finding]:
    """All motors; one row when all of them can."""
    found = [can_move(motor, at) for motor in MOTORS]
    if len({finding.evidence for finding in found}) == 1 and found[0].status == OK:
        return [found[0]._replace(check="can_move", evidence=f"all motors: {found[0].evidence}")]
    return found


def _back(motor: str | None, *names: str) -> str:
    """The command that puts settings back to the factory's."""
    index = MOTORS.index(motor) if motor else 0
    words = [f"{name}{f'.{motor}' if motor else ''}={BARRETT.by_mnemonic(name).default_of(index)}" for name in names]
    return f"`handctl barrett set {' '.join(words)}`"


def _state(motor: str, at: At) -> list[Reason]:
    status = at["S", motor]
    found = []
    if status & 3:
        what = "motor board" if status & 1 else "motor"
        found.append(Reason(f"no {what} found (S {status})", "power-cycle the hand, then ask the vendor"))
    if at["EN", motor] == 0:
        text = "EN 0: it moves only if it is named (--motors)"
        found.append(Reason(text, _back(motor, "EN"), stands=False))
    return found


def _heat(at: At) -> list[Reason]:
    limit, now = at["OTEMP", None], at["TEMP", None]
    if not 0 < limit < now:
        return []
    if limit < 300:
        meant = f", {limit}.0 °C is OTEMP={limit * 10}" if limit * 10 <= 650 else ""
        return [Reason(f"OTEMP {limit / 10:.1f} °C and the temperature {now / 10:.1f} °C: the setting is wrong, not the temperature{meant}", "`handctl barrett set OTEMP=650`")]  # fmt: skip
    return [Reason(f"{now / 10:.1f} °C is above OTEMP {limit / 10:.1f} °C", "let it cool, and free the spread: `handctl barrett stop --motors S`")]  # fmt: skip


def _strain(motor: str, at: At) -> list[Reason]:
    now, low, high = at["SG", motor], at["LSG", motor], at["HSG", motor]
    if min(low, high) >= OFF:
        return []
    if now == NO_GAUGE:
        return [Reason(f"no strain gauge, but limits LSG {low} and HSG {high}", _back(motor, "HSG", "LSG"))]
    if (high < OFF and now >= high) or (low < OFF and now <= low):
        limits = f"LSG {low if low < OFF else 'off'}, HSG {high if high < OFF else 'off'}"
        return [Reason(f"SG {now} is beyond {limits}: a movement ends at once", _back(motor, "HSG", "LSG"))]
    return []


def _drive(motor: str, at: At) -> list[Reason]:
    found = []
    slowest = min(at["MOV", motor], at["MCV", motor])
    if at["FPG", motor] == 0:
        found.append(Reason("FPG 0: no gain, so no torque", _back(motor, "FPG")))
    if at["ACCEL", motor] == 0:
        found.append(Reason("ACCEL 0: it never accelerates", _back(motor, "ACCEL")))
    elif at["ACCEL", motor] >= 16 * slowest:  # 1/256 and 1/16 count: a ramp that is shorter than one sample
        text = f"ACCEL {at['ACCEL', motor]} reaches full speed within one sample, which the motor cannot follow"
        found.append(Reason(text, _back(motor, "ACCEL")))
    if slowest < LEAST_VELOCITY:
        name = "MOV" if at["MOV", motor] == slowest else "MCV"
        text = f"{name} {slowest}: below {LEAST_VELOCITY} it may not overcome its friction"
        found.append(Reason(text, _back(motor, name), stands=False))
    if at["TSTOP", motor] == 0:
        found.append(Reason("TSTOP 0: it counts as stalled immediately", _back(motor, "TSTOP"), stands=False))
    return found


def _way(motor: str, at: At) -> list[Reason]:
    opened, closed, near = at["OT", motor], at["CT", motor], at["MPE", motor]
    if opened >= closed:
        return [Reason(f"OT {opened} is not below CT {closed}: O closes, C opens", _back(motor, "OT", "CT"))]
    if closed - opened <= near:
        text = f"OT {opened} and CT {closed} are within MPE {near}, so it has nowhere to go"
        return [Reason(text, _back(motor, "OT", "CT", "MPE"))]
    return []
