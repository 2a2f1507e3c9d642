"""Health limits of the manual as verdicts (barrett §2, §5.3, §5.4, §7.3, §7.4). Pure; sends nothing.

And whether a motor can move now, without moving it (§5.3, §5.4, §5.5). What a movement command needs: electronics,
initialization, a temperature below OTEMP, strain within its limits, a gain, an acceleration that the motor controller can
follow, a velocity above friction, and a way between OT and CT.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.gcl.status_codes import explain_status, hint_for
from handctl.devices.barrett.parameter_map import BARRETT, NO_GAUGE, OFF, SENSIBLE_LIMIT, GclParam, unmeasured
from handctl.errors import Hint, joined
from handctl.model.check_rows import FAIL, OK, WARNING
from handctl.model.result import Row, command_key

WARM_TENTHS, LIMIT_TENTHS = 600, 650
"""Normal up to 60 °C, never above 65 °C (§2)."""
WARM, LIMIT = f"{WARM_TENTHS / 10:g} °C", f"{LIMIT_TENTHS / 10:g} °C"
SET_LIMIT = f"barrett set OTEMP={LIMIT_TENTHS}"
LEAST_VELOCITY = 40
"""Below it a motor may not overcome its friction (§8)."""
NO_SENSOR = "power-cycle the hand. If it happens again, ask the vendor about the temperature sensor"
COOL = Hint("let it cool, and free the spread: {}", "barrett stop --motors S")
HARMS_BEYOND_LIMIT = ("IVEL", "IHIT", "IOFF", "TSTOP", "FIP", "SAMPLE", "SGFLIP")
"""Parameters whose value beyond the recommended limit harms: a fail (§5.3.4)."""
READ_BEFORE_MOVING = (*HARMS_BEYOND_LIMIT, "MOV", "HOLD")
"""What is read again before anything moves: HARMS_BEYOND_LIMIT, and what opens too fast or heats."""
NEEDED_TO_MOVE = tuple(name for name in READ_BEFORE_MOVING if name != "SGFLIP")
"""Of these none may be missing: later firmware may only do without SGFLIP (§5.3.4)."""


def limit_of(otemp: int) -> int:
    """The temperature in 0.1 °C above which no motor is driven: OTEMP, where it is lower than the hand's limit; 0 = off."""
    return otemp if 0 < otemp < LIMIT_TENTHS else LIMIT_TENTHS


def meant_in_degrees(otemp: int) -> str:
    """Which OTEMP the same number in whole °C is, unless that is above the limit of the hand (§2)."""
    return f". {otemp} °C is OTEMP={otemp * 10}" if otemp * 10 <= LIMIT_TENTHS else ""


class Finding(NamedTuple):
    """The outcome of one check: what was seen, and what to do with which section of the manual."""

    check: str
    status: str
    evidence: str
    remedy: str = ""
    source: str = ""

    @property
    def bad(self) -> bool:
        """Whether a technician must act: a warning or a fail."""
        return self.status in (WARNING, FAIL)

    def row(self) -> Row:
        """The row of this finding."""
        return {
            **self._asdict(),
            "remedy": self.remedy or None,
            "source": self.source or None,
            **command_key(self.remedy),
        }


def verdict(check: str, source: str, good: str, wrong: str = "", remedy: str = "", status: str = WARNING) -> Finding:
    """The result of a check: what is `wrong`, with its remedy, or what is `good`."""
    return Finding(check, status, wrong, remedy, source) if wrong else Finding(check, OK, good, source=source)


def temperature(tenths: int) -> Finding:
    """The CPU board's temperature now."""
    text, cool = f"{tenths / 10:.1f} °C", COOL
    if unmeasured(tenths):
        evidence = f"{text} is impossible, so overheating cannot be detected"
        return Finding("temperature", FAIL, evidence, NO_SENSOR, "barrett §5.4.2")
    if tenths > LIMIT_TENTHS:
        return Finding("temperature", FAIL, f"{text}: above {LIMIT}, the limit", cool, "barrett §2")
    if tenths > WARM_TENTHS:
        return Finding(
            "temperature", WARNING, f"{text}: normal is 40 to {WARM}, the limit is {LIMIT}", cool, "barrett §2"
        )
    return Finding("temperature", OK, f"{text}, limit {LIMIT}", source="barrett §2")


def peak(tenths: int) -> Finding:
    """The highest temperature of its life."""
    check, text = "peak_temperature", f"{tenths / 10:.1f} °C"
    if tenths < LIMIT_TENTHS:
        return Finding(check, OK, f"{text}, limit {LIMIT}", source="barrett §5.4.2")
    remedy = f"set OTEMP between {WARM_TENTHS} and {LIMIT_TENTHS} and TSTOP to at most 30, and let the spread idle"
    return Finding(check, WARNING, f"{text} was reached once, and the limit is {LIMIT}", remedy, "barrett §2")


def over_temperature_limit(tenths: int) -> Finding:
    """OTEMP: tenths of a degree, 0 = off, which is the factory's value."""
    check, source = "over_temperature_limit", "barrett §5.4.1"
    if tenths == 0:
        remedy = Hint(f"{{}} stops movements at {LIMIT}", SET_LIMIT)
        return Finding(check, OK, "OTEMP is 0, the factory value, so the hand does not protect itself", remedy, source)
    if tenths < SENSIBLE_LIMIT:
        evidence = f"OTEMP {tenths} is {tenths / 10:.1f} °C: movements fail{meant_in_degrees(tenths)}"
        return Finding(check, FAIL, evidence, Hint("{}: the unit is 0.1 °C", SET_LIMIT), source)
    if tenths > LIMIT_TENTHS:
        evidence = f"OTEMP {tenths / 10:.1f} °C is above the hand's limit of {LIMIT}"
        return Finding(check, WARNING, evidence, Hint("{}", SET_LIMIT), source)
    return Finding(check, OK, f"OTEMP {tenths / 10:.1f} °C", source=source)


def motor_status(motor: str, code: int) -> Finding:
    """The status of one motor: 4 is usual after power-on."""
    check, source = f"status.{motor}", "barrett §5.1.3"
    if code == 0:
        return Finding(check, OK, "ready", source=source)
    worst = code & ~(4 | 16 | 16384)
    return Finding(check, FAIL if worst else WARNING, explain_status(code), hint_for(worst or code), source)


def settings(values: Mapping[tuple[str, str | None], int]) -> Iterator[Finding]:
    """All settings by (mnemonic, motor): ranges, recommended limits, velocities, switches. One finding per objection."""
    for (name, motor), value in values.items():
        param = BARRETT.by_mnemonic(name)
        if not param.writable or name == "OTEMP":
            continue
        index = MOTORS.index(motor) if motor else 0
        finding = _setting(param, motor, index, value)
        if finding is not None:
            yield finding
    for motor in MOTORS:
        high, alias = values.get(("HSG", motor)), values.get(("MSG", motor))
        if high is not None and alias is not None and high != alias:
            evidence = f"HSG {high} and MSG {alias} differ although they are the same value, so the RAM contents may be corrupt"
            yield Finding(f"HSG.{motor}", FAIL, evidence, "reload the firmware", "barrett §5.3.1, §3.7")


def _setting(param: GclParam, motor: str | None, index: int, value: int) -> Finding | None:
    allowed, objection = param.allowed(value), param.objection(index, value)
    advice = _advice(param.mnemonic, motor, value, param.default_of(index))
    if allowed and objection is None and advice is None:
        return None
    name = f"{param.mnemonic}.{motor}" if motor else param.mnemonic
    back = _back(motor, param.mnemonic)
    if param.mnemonic == "BAUD":
        back = Hint("{}, with --save when it was saved", "barrett baud 9600")
    source = param.source
    if not allowed:
        evidence = f"{name} = {value} is outside its range {param.range_text}, so the RAM contents may be corrupt"
        return Finding(name, FAIL, evidence, joined(back, "if it happens again, reload the firmware (§3.7)"), source)
    if objection is not None:
        harms = param.mnemonic in HARMS_BEYOND_LIMIT or (param.mnemonic == "MOV" and value > LEAST_VELOCITY)
        return Finding(name, FAIL if harms else WARNING, objection, back, source)
    return Finding(name, WARNING, advice or "", back, source)


def _advice(mnemonic: str, motor: str | None, value: int, default: int | None) -> str | None:
    """What is allowed and harmless, but explains a complaint."""
    match mnemonic:
        case "EN" if value == 0:
            return "disabled: it moves only if it is named (--motors)"
        case "HOLD" if value == 1 and motor != "SPREAD":
            return "HOLD 1: a finger cannot be backdriven, so holding only heats it"
        case "FDZ" if value != 0:
            return f"FDZ {value}: any value other than 0 is noisy"
        case "BAUD" if value != 96:
            return f"{value * 100} bit/s is not the factory baud rate: programs that expect 9600 do not find the hand"
        case "IVEL" | "IHIT" | "IOFF" | "TSTOP" if value != default:
            return f"{mnemonic} {value}: within its limit, but changed from {default}"
    return None


# -- can it move now? -------------------------------------------------------------------------------------------------


At = Mapping[tuple[str, str | None], int]
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
    remedy = joined(*dict.fromkeys(reason.remedy for reason in reasons), joint="; ")
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
    return Hint("{}", f"barrett set {' '.join(words)}")


def _state(motor: str, at: At) -> Iterator[Reason]:
    status = at["S", motor]
    if status & 3:
        what = "motor board" if status & 1 else "motor"
        yield Reason(f"no {what} found (S {status})", "power-cycle the hand, then ask the vendor")
    if at["EN", motor] == 0:
        yield Reason("EN 0: it moves only if it is named (--motors)", _back(motor, "EN"), stands=False)


def _heat(at: At) -> Iterator[Reason]:
    limit, now = at["OTEMP", None], at["TEMP", None]
    if 0 < limit < min(now, SENSIBLE_LIMIT):
        yield Reason(f"OTEMP {limit / 10:.1f} °C and the temperature {now / 10:.1f} °C: the setting is wrong, not the temperature{meant_in_degrees(limit)}", Hint("{}", SET_LIMIT))  # fmt: skip
    elif 0 < limit < now:
        yield Reason(f"{now / 10:.1f} °C is above OTEMP {limit / 10:.1f} °C", COOL)


def _strain(motor: str, at: At) -> Iterator[Reason]:
    now, low, high = at["SG", motor], at["LSG", motor], at["HSG", motor]
    if min(low, high) >= OFF:
        return
    if now == NO_GAUGE:
        yield Reason(f"no strain gauge, but limits LSG {low} and HSG {high}", _back(motor, "HSG", "LSG"))
    elif (high < OFF and now >= high) or (low < OFF and now <= low):
        limits = f"LSG {low if low < OFF else 'off'}, HSG {high if high < OFF else 'off'}"
        yield Reason(f"SG {now} is beyond {limits}: a movement ends at once", _back(motor, "HSG", "LSG"))


def _drive(motor: str, at: At) -> Iterator[Reason]:
    slowest = min(at["MOV", motor], at["MCV", motor])
    if at["FPG", motor] == 0:
        yield Reason("FPG 0: no gain, so no torque", _back(motor, "FPG"))
    if at["ACCEL", motor] == 0:
        yield Reason("ACCEL 0: it never accelerates", _back(motor, "ACCEL"))
    elif at["ACCEL", motor] >= 16 * slowest:  # 1/256 and 1/16 count: a ramp that is shorter than one sample
        text = f"ACCEL {at['ACCEL', motor]} reaches full speed within one sample, which the motor cannot follow"
        yield Reason(text, _back(motor, "ACCEL"))
    if slowest < LEAST_VELOCITY:
        name = "MOV" if at["MOV", motor] == slowest else "MCV"
        text = f"{name} {slowest}: below {LEAST_VELOCITY} it may not overcome its friction"
        yield Reason(text, _back(motor, name), stands=False)
    if at["TSTOP", motor] == 0:
        yield Reason("TSTOP 0: it counts as stalled immediately", _back(motor, "TSTOP"), stands=False)


def _way(motor: str, at: At) -> Iterator[Reason]:
    opened, closed, near = at["OT", motor], at["CT", motor], at["MPE", motor]
    if opened >= closed:
        yield Reason(f"OT {opened} is not below CT {closed}: O closes, C opens", _back(motor, "OT", "CT"))
    elif closed - opened <= near:
        text = f"OT {opened} and CT {closed} are within MPE {near}, so it has nowhere to go"
        yield Reason(text, _back(motor, "OT", "CT", "MPE"))
