"""The flags that shape RealTime blocks (barrett §5.3.3, §6.3): read them, set what the user asked, freeze the structure."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil
from typing import NamedTuple

from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.maintenance.health_limits import LIMIT_TENTHS, NO_SENSOR, limit_of
from handctl.devices.barrett.parameter_map import (
    BARRETT,
    OFF,
    TRAVEL,
    gcl_name,
    quickest_opening,
    sample_seconds,
    unmeasured,
)
from handctl.devices.barrett.realtime.blocks import CONTROL, FEEDBACK, Layout, Selection
from handctl.devices.barrett.realtime.control_values import Controls
from handctl.devices.barrett.realtime.guards import GUARDS, Limits, check_opening
from handctl.errors import CheckFailed, DeviceRefused, Hint, UsageError
from handctl.model.param import Element, Number

COEFFICIENTS = ("LCVC", "LFVC", "LFDPC")
LIMITING = ("TSTOP", "CT", "HSG", "LSG", "IVEL", "SAMPLE")
"""What the guards go by."""
Flags = Mapping[tuple[str, int], int]
"""(mnemonic, motor index) -> value; 0 for those of the whole hand."""
Values = list[tuple[Element, Number]]
LATER = {"breakaway_position", "analog"}
"""Feedback of firmware 4.4 (dossier 6.5)."""


class FlagRequest(NamedTuple):
    """What the user asked for.

    motors       indices, ascending
    receive      motor index -> names of FEEDBACK; None = as the hand's flags are
    temperature  whether feedback carries it; None = as the hand's flag is
    hold         leave the motors powered
    guards       names of GUARDS that are on
    delta_unit   LFDPC as the user wants it; None = as velocity and rate need it
    watched      the motors are stopped where the command that drives them stands still
    needs        (motor index, name) of feedback that is taken in, and not shown
    angles       the joint angles are shown
    """

    motors: tuple[int, ...]
    receive: Mapping[int, tuple[str, ...]] | None = None
    temperature: bool | None = None
    hold: bool = False
    guards: frozenset[str] = frozenset(GUARDS)
    delta_unit: int | None = None
    watched: bool = True
    needs: frozenset[tuple[int, str]] = frozenset()
    angles: bool = False

    @property
    def prefix(self) -> str:
        """The GCL prefix of the motors."""
        return "".join(str(index + 1) for index in self.motors)


def asked_flags(flag_request: FlagRequest, controls: Controls | None) -> dict[tuple[str, int], int]:
    """Flags by (mnemonic, motor) as the user wants them; what was not asked for is left out."""
    wanted: dict[tuple[str, int], int] = {}
    for index in flag_request.motors:
        if controls is not None:
            carried = controls.carries.get(index, ())
            wanted.update({(flag, index): int(name in carried) for name, flag in CONTROL.items()})
        if flag_request.receive is not None:
            names = flag_request.receive.get(index, ())
            wanted.update({(flag, index): int(name in names) for name, flag in FEEDBACK.items()})
    if flag_request.temperature is not None:
        wanted[("LFT", 0)] = int(flag_request.temperature)
    return wanted


class Prepared(NamedTuple):
    """How the loop will be.

    shown        motor index -> feedback that was asked for; guards may have added to the blocks
    temperature  whether it was asked for
    limits       of the motors that are driven
    heat         0.1 °C above which the loop ends
    discards     LFDPD is 1
    """

    layout: Layout
    shown: dict[int, tuple[str, ...]]
    temperature: bool
    limits: dict[int, Limits]
    heat: int
    discards: bool


def prepare(
    hand: BarrettHand, flag_request: FlagRequest, controls: Controls | None, undo: Values, cycle: float
) -> Prepared:
    """Read the flags, set what was asked and differs, and say how the blocks look then.

    `undo` is filled with the values before, ahead of the first write. `cycle` is the longest time of a block in s.
    Raises DeviceRefused, CheckFailed, NoAnswer; UsageError for too fast an opening.
    """
    later = _is_later(hand, flag_request.motors[0])
    driven = [
        index for index in flag_request.motors if controls is not None and "velocity" in controls.carries.get(index, ())
    ]
    now = _read(hand, flag_request.motors, later, driving=bool(driven))
    fitted = _fitted(hand, flag_request, controls, later)
    wanted = fitted | now | fitted  # what was asked for goes first
    shown = {index: _selection(wanted, index).feedback for index in flag_request.motors}
    temperature = bool(wanted["LFT", 0])
    for index, name in flag_request.needs:
        if name != "position" or "delta" not in shown[index]:  # which gives positions, too
            wanted["LFT" if name == "temperature" else FEEDBACK[name], index] = 1
    _refuse_zero(wanted, flag_request.motors, sends=controls is not None)
    for index in driven:
        wanted.update(_for_guards(flag_request, wanted, index))
        if wanted["LFDP", index]:
            wanted["LFDPC", index] = _delta_unit(hand, flag_request, controls, wanted, index, cycle)
    limits = {index: _limits(wanted, index) for index in driven}
    if controls is not None and "opening" in flag_request.guards and not controls.live:
        for index in driven:
            check_opening(index, controls.extremes(index)[0], limits[index])
    heat = _heat(hand, flag_request, now) if driven else LIMIT_TENTHS
    _write(hand, now, wanted, undo)
    size = 0 if not wanted["LFT", 0] else 1 if later else 2
    layout = Layout({index: _selection(wanted, index) for index in flag_request.motors}, size)
    discards = bool(wanted["LFDPD", 0])
    if discards and any("delta" in motor.feedback for motor in layout.motors.values()):
        hand.journal.warn(
            "discard", "LFDPD is 1: a change too large for a byte is dropped, and positions from deltas may be wrong"
        )
    return Prepared(layout, shown, temperature, limits, heat, discards)


def _write(hand: BarrettHand, now: Flags, wanted: Flags, undo: Values) -> None:
    changes: Values = [
        (Element(BARRETT.by_mnemonic(name), index), value)
        for (name, index), value in wanted.items()
        if now[(name, index)] != value
    ]
    if changes:
        undo += [(element, now[(gcl_name(element), element.index)]) for element, _ in changes]
        hand.write(changes)


# -- what the guards need -------------------------------------------------------------------------------------------


def _for_guards(flag_request: FlagRequest, wanted: Flags, index: int) -> dict[tuple[str, int], int]:
    """Feedback without which a guard of a driven motor would see nothing: it is taken in, and not shown."""
    more: dict[tuple[str, int], int] = {}
    if flag_request.guards & {"stall", "window"} and not (wanted["LFAP", index] or wanted["LFDP", index]):
        more["LFAP", index] = 1
    if "strain" in flag_request.guards and min(wanted["HSG", index], wanted["LSG", index]) < OFF:
        more["LFS", index] = 1
    if "heat" in flag_request.guards:
        more["LFT", 0] = 1
    return more


def _limits(now: Flags, index: int) -> Limits:
    factor, divisor = now["LCVC", index], now["LFDPC", index]
    return Limits(
        speed=factor / 16 / sample_seconds(now["SAMPLE", index]),
        factor=factor,
        stall=now["TSTOP", index] / 1000,
        window=(0, min(now["CT", index], TRAVEL[index == 3])),
        strain=(now["LSG", index], now["HSG", index]),
        opening=quickest_opening(index, now["IVEL", index]),
        quantum=1 if now["LFAP", index] else divisor,
    )


def _delta_unit(
    hand: BarrettHand, flag_request: FlagRequest, controls: Controls | None, now: Flags, index: int, cycle: float
) -> int:
    """LFDPC: what was asked for; else as much as keeps the fastest command within a byte, twice over (§6.2.3)."""
    if flag_request.delta_unit is not None or controls is None:
        return flag_request.delta_unit or now["LFDPC", index]
    fastest = max(map(abs, controls.extremes(index))) * _limits(now, index).speed * cycle
    needed = ceil(2 * fastest / 127)
    if needed > 255:
        hand.journal.warn(
            "delta-too-small",
            f"{MOTORS[index]}: {fastest:.0f} counts per block do not fit into a delta, even with LFDPC 255",
            hint="add position to --receive, or use a higher --rate",
        )
    return max(now["LFDPC", index], min(needed, 255))


def _heat(hand: BarrettHand, flag_request: FlagRequest, now: Flags) -> int:
    """The limit in 0.1 °C. Raises CheckFailed when the board is above it before anything moves."""
    limit = limit_of(now["OTEMP", 0])
    if "heat" in flag_request.guards and unmeasured(now["TEMP", 0]):
        raise CheckFailed(
            f"{hand.link.name}: TEMP reads {now['TEMP', 0] / 10:.1f} °C, which is impossible: without the temperature of the board nothing is driven (guard heat)",
            hint=NO_SENSOR,
            code="guard-heat",
        )
    if "heat" in flag_request.guards and now["TEMP", 0] > limit:
        raise CheckFailed(
            f"{hand.link.name}: the board is at {now['TEMP', 0] / 10:.1f} °C, and above {limit / 10:.1f} °C nothing is driven (guard heat)",
            hint=Hint("{} shows TEMP and OTEMP. Let the hand cool, or correct OTEMP", "barrett status"),
            code="guard-heat",
        )
    return limit


def refuse_disabled(hand: BarrettHand) -> None:
    """Refuse disabled motors that were not named (barrett §5.3.4 EN). Raises UsageError."""
    enabled = hand.numbers(BARRETT.elements("EN"))
    off = [motor for motor, on in zip(MOTORS, enabled, strict=True) if not on]
    if off:
        others = "".join(str(number) for number, on in enumerate(enabled, 1) if on)
        raise UsageError(
            f"disabled (EN 0): {', '.join(off)}. handctl does not guess whether a disabled motor may move",
            hint=f"use --motors 1234 for all{f', or --motors {others} for the enabled ones' if others else ''}. Nothing moved.",
            code="disabled",
        )


def _is_later(hand: BarrettHand, motor: int) -> bool:
    """Whether the firmware is 4.4: it knows LCT (dossier 6.5)."""
    (reading,) = hand.read(BARRETT.elements("LCT", motors=(motor,)))
    if reading.error is not None and not isinstance(reading.error, DeviceRefused):
        raise reading.error
    return reading.error is None


def _read(hand: BarrettHand, motors: tuple[int, ...], later: bool, *, driving: bool) -> dict[tuple[str, int], int]:
    names = [
        *CONTROL.values(),
        *(flag for name, flag in FEEDBACK.items() if later or name not in LATER),
        *COEFFICIENTS,
        *(["LCT"] if later else []),
        *(LIMITING if driving else ()),
    ]
    common = ("LFT", "LFDPD", *(("OTEMP", "TEMP") if driving else ()))
    elements = BARRETT.elements(*names, *common, motors=motors)
    return {(gcl_name(one), one.index): value for one, value in zip(elements, hand.numbers(elements), strict=True)}


def _fitted(
    hand: BarrettHand, flag_request: FlagRequest, controls: Controls | None, later: bool
) -> dict[tuple[str, int], int]:
    """What was asked for, fitted to the firmware."""
    wanted = asked_flags(flag_request, controls)
    if later:
        if controls is not None:
            wanted.update({("LCT", index): 0 for index in flag_request.motors})  # excludes velocity and gain
        return wanted
    for name in LATER:
        flag = FEEDBACK[name]
        asked = [wanted.pop((flag, index), 0) for index in flag_request.motors]
        if any(asked):
            raise DeviceRefused(
                f"{hand.link.name}: this firmware has no {flag}",
                hint=f"leave {name} out: it needs firmware 4.4",
                code="no-flag",
            )
    return wanted


def _selection(now: Flags, index: int) -> Selection:
    return Selection(
        tuple(name for name, flag in CONTROL.items() if now[(flag, index)]),
        tuple(name for name, flag in FEEDBACK.items() if now.get((flag, index))),
        *(now[(name, index)] for name in COEFFICIENTS),
    )


def _refuse_zero(now: Flags, motors: tuple[int, ...], *, sends: bool) -> None:
    """A coefficient of 0 divides by zero or always stops the motor (dossier 3.1)."""
    for index in motors:
        for name, used in (
            ("LCVC", sends and now["LCV", index]),
            ("LFVC", now["LFV", index]),
            ("LFDPC", now["LFDP", index]),
        ):
            if used and not now[name, index]:
                does = "stop the motor" if name == "LCVC" else "divide by zero"
                raise CheckFailed(
                    f"{name} of {MOTORS[index]} is 0, which would {does}",
                    hint=Hint("{}", f"barrett set {name}.{MOTORS[index]}=1"),
                    code="coefficient",
                )
