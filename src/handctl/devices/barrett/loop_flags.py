"""The flags that shape RealTime blocks (barrett §5.3.3, §6.3): read them, set what the user asked, freeze the structure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from handctl.devices.barrett.hand import BarrettHand
from handctl.devices.barrett.language import MOTORS
from handctl.devices.barrett.parameters import BARRETT, GclParam
from handctl.devices.barrett.realtime import CONTROL, FEEDBACK, Layout, Selection
from handctl.devices.barrett.schedule import Source
from handctl.errors import CheckFailed, DeviceRefused, UsageError
from handctl.param import Element, Number

COEFFICIENTS = ("LCVC", "LFVC", "LFDPC")
LATER = {"breakaway_position", "analog"}
"""Feedback of firmware 4.4 (dossier 6.5)."""


class Wish(NamedTuple):
    """What the user asked for.

    motors       indices, ascending
    receive      motor index -> names of FEEDBACK; None = as the hand's flags are
    temperature  whether feedback carries it; None = as the hand's flag is
    hold         leave the motors powered
    """

    motors: tuple[int, ...]
    receive: Mapping[int, tuple[str, ...]] | None = None
    temperature: bool | None = None
    hold: bool = False

    @property
    def prefix(self) -> str:
        """The GCL prefix of the motors."""
        return "".join(str(index + 1) for index in self.motors)


def asked_flags(wish: Wish, source: Source | None) -> dict[tuple[str, int], int]:
    """Flags by (mnemonic, motor) as the user wants them; what was not asked for is left out."""
    wanted: dict[tuple[str, int], int] = {}
    for index in wish.motors:
        if source is not None:
            carried = source.carries.get(index, ())
            wanted.update({(flag, index): int(name in carried) for name, flag in CONTROL.items()})
        if wish.receive is not None:
            names = wish.receive.get(index, ())
            wanted.update({(flag, index): int(name in names) for name, flag in FEEDBACK.items()})
    if wish.temperature is not None:
        wanted[("LFT", 0)] = int(wish.temperature)
    return wanted


def prepare(hand: BarrettHand, wish: Wish, source: Source | None, undo: list[tuple[Element, Number]]) -> Layout:
    """Read the flags, set what was asked and differs, and say how the blocks look then.

    `undo` is filled with the values before, ahead of the first write. Raises DeviceRefused, CheckFailed, NoAnswer.
    """
    later = _is_later(hand, wish.motors[0])
    now = _read(hand, wish.motors, later)
    changes = [
        (Element(BARRETT.by_mnemonic(name), index), value)
        for (name, index), value in _fitted(hand, wish, source, later).items()
        if now[(name, index)] != value
    ]
    if changes:
        undo += [(element, now[(mnemonic(element), element.index)]) for element, _ in changes]
        hand.write(changes)
        now.update({(mnemonic(element), element.index): int(value) for element, value in changes})
    temperature = 0 if not now[("LFT", 0)] else 1 if later else 2
    layout = Layout({index: _selection(now, index) for index in wish.motors}, temperature)
    _refuse_zero(layout, sends=source is not None)
    if now[("LFDPD", 0)] and any("delta" in motor.feedback for motor in layout.motors.values()):
        hand.journal.warn(
            "discard", "LFDPD is 1: a change too large for a byte is dropped, positions from deltas may be wrong"
        )
    return layout


def refuse_disabled(hand: BarrettHand) -> None:
    """Motors that nobody named are not to move when they are disabled (barrett §5.3.4 EN). Raises UsageError."""
    readings = hand.read([Element(BARRETT.by_mnemonic("EN"), index) for index in range(len(MOTORS))])
    for reading in readings:
        if reading.error is not None:
            raise reading.error
    off = [MOTORS[reading.element.index] for reading in readings if reading.value == 0]
    if off:
        others = "".join(str(reading.element.index + 1) for reading in readings if reading.value)
        raise UsageError(
            f"{', '.join(off)} disabled (EN 0): whether to move without being named is not guessed",
            hint=f"--motors 1234 takes all{f', --motors {others} the enabled ones' if others else ''}. Nothing moved.",
            code="disabled",
        )


def _is_later(hand: BarrettHand, motor: int) -> bool:
    """Whether the firmware is 4.4: it knows LCT (dossier 6.5)."""
    (reading,) = hand.read([Element(BARRETT.by_mnemonic("LCT"), motor)])
    if reading.error is not None and not isinstance(reading.error, DeviceRefused):
        raise reading.error
    return reading.error is None


def _read(hand: BarrettHand, motors: tuple[int, ...], later: bool) -> dict[tuple[str, int], int]:
    names = [
        *CONTROL.values(),
        *(flag for name, flag in FEEDBACK.items() if later or name not in LATER),
        *COEFFICIENTS,
        *(["LCT"] if later else []),
    ]
    elements = [Element(BARRETT.by_mnemonic(name), index) for name in names for index in motors]
    elements += [Element(BARRETT.by_mnemonic(name), 0) for name in ("LFT", "LFDPD")]
    now: dict[tuple[str, int], int] = {}
    for reading in hand.read(elements):
        if reading.error is not None:
            raise reading.error
        now[(mnemonic(reading.element), reading.element.index)] = int(reading.value or 0)
    return now


def _fitted(hand: BarrettHand, wish: Wish, source: Source | None, later: bool) -> dict[tuple[str, int], int]:
    """What was asked for, fitted to the firmware."""
    wanted = asked_flags(wish, source)
    if later:
        if source is not None:
            wanted.update({("LCT", index): 0 for index in wish.motors})  # excludes velocity and gain
        return wanted
    for name in LATER:
        flag = FEEDBACK[name]
        asked = [wanted.pop((flag, index), 0) for index in wish.motors]
        if any(asked):
            raise DeviceRefused(
                f"{hand.link.name}: this firmware has no {flag}",
                hint=f"leave {name} out: it came with 4.4",
                code="no-flag",
            )
    return wanted


def _selection(now: Mapping[tuple[str, int], int], index: int) -> Selection:
    return Selection(
        tuple(name for name, flag in CONTROL.items() if now[(flag, index)]),
        tuple(name for name, flag in FEEDBACK.items() if now.get((flag, index))),
        *(now[(name, index)] for name in COEFFICIENTS),
    )


def _refuse_zero(layout: Layout, *, sends: bool) -> None:
    """A coefficient of 0 divides by zero or always stops the motor (dossier 3.1)."""
    for index, motor in layout.motors.items():
        for name, used, value in (
            ("LCVC", sends and "velocity" in motor.control, motor.velocity_factor),
            ("LFVC", "velocity" in motor.feedback, motor.velocity_divisor),
            ("LFDPC", "delta" in motor.feedback, motor.delta_divisor),
        ):
            if used and not value:
                does = "stop the motor" if name == "LCVC" else "divide by zero"
                raise CheckFailed(
                    f"{name} of {MOTORS[index]} is 0: that would {does}",
                    hint=f"handctl barrett set {name}.{MOTORS[index]}=1",
                    code="coefficient",
                )


def mnemonic(element: Element) -> str:
    """The GCL name of an element's parameter."""
    assert isinstance(element.param, GclParam)
    return element.param.mnemonic
