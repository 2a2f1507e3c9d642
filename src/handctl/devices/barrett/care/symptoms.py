"""The book of symptoms: the manual's troubleshooting (barrett §8) as checks, movements to try, and steps by hand.

Data only. `checks` and `trials` are names of functions in `diagnose` and `trials`; a test says that they all exist.
Steps are what no program can do, each with its section, in the manual's order.
"""

from __future__ import annotations

from typing import NamedTuple

from handctl.sentence import near

Steps = tuple[tuple[str, str], ...]


class Symptom(NamedTuple):
    """One row of the book.

    checks   read-only checks beside the usual ones
    trials   checks that move the hand
    steps    (what to do, section)
    """

    title: str
    checks: tuple[str, ...] = ()
    trials: tuple[str, ...] = ()
    steps: Steps = ()


_VENDOR = ("if the problem persists, contact the vendor", "§8")
_RELOAD = ("load the firmware again: `handctl barrett firmware download FILE`", "§3.7")
_PRETENSION = ("adjust the cable's pretension: `handctl barrett maintenance --steps pretension`", "§7.1")
_ZERO = ("adjust the balancing potentiometer: `handctl barrett strain --live`", "§7.4")
_PULLEY = ("check that the cable runs over both the top and the bottom of the idler pulley", "§8, Figure 18")
_FREE = ("check that no object or other finger is in its way", "§8")
_CABLE = (
    "take the shroud off (Figure 16) and check the finger's cable. If it is broken, contact the vendor",
    "§8, Figure 16",
)

SYMPTOMS: dict[str, Symptom] = {
    "erratic": Symptom(
        "erratic: obeys some commands, disobeys others", ("repeatable",),
        steps=(("after more than a day or two without power, especially in humid weather, its RAM contents may be damaged", "§8, §3.7"), _RELOAD),
    ),
    "no-communication": Symptom(
        "the host computer will not communicate",
        steps=(
            ("switch the supply off, then check that every plug is seated (supply, hand, computer) and the serial cable is straight-through", "§8, §3.3, §2"),
            ("check that the supply is switched on", "§8"),
            _RELOAD,
            ("switch the supply off and on: the hand starts at its saved speed", "§8"),
            ("check that no other program uses the port", "§8"),
            _VENDOR,
        ),
    ),
    "strain-range": Symptom(
        "strain gauge values out of range at the start", ("strain_limits",), steps=(_ZERO, _PULLEY, _VENDOR)
    ),
    "strain-curve": Symptom(
        "strain does not follow the expected curves", ("strain_limits",), ("strain_curve",),
        (_PRETENSION, _ZERO, _PULLEY, ("check that the idler pulley turns freely and its shoulder screw is not tight against it", "§8, Figure 18"), _VENDOR),
    ),
    "early-breakaway": Symptom(
        "only the fingertip closes", ("breakaway", "init_settings"), ("initialize",),
        (("check that no object blocks the inner link", "§8"), _VENDOR),
    ),
    "sticks-closed": Symptom(
        "a finger sticks fully closed", ("strain_limits", "velocities"), ("open", "initialize"),
        (_FREE, ("the pretension may be too high: `handctl barrett maintenance --steps pretension`", "§7.1"), _RELOAD, _VENDOR),
    ),
    "sticks-open": Symptom(
        "a finger sticks open", ("strain_limits", "velocities"), ("close", "initialize"), (_FREE, _RELOAD, _VENDOR)
    ),
    "wrong-direction": Symptom(
        "a finger moves against the command", trials=("direction", "initialize", "direction"),
        steps=(_RELOAD, ("encoder feedback: if it happens again after `handctl barrett init`, send the hand to the vendor for service", "§8")),
    ),
    "no-breakaway": Symptom(
        "the TorqueSwitch does not break away", ("breakaway", "velocities", "init_settings"), ("initialize",),
        (
            ("by hand: put a 2-mm hex key in the left drive hole and turn it anticlockwise until the finger is fully open", "§8, Figures 19, 20"),
            ("hold the inner link firmly, leave the outer link free, and turn clockwise until the tip breaks away", "§8, Figure 19"),
            ("take the key out, then run `handctl barrett init`", "§8"),
            _VENDOR,
        ),
    ),
    "uneven-torque": Symptom(
        "GTO or GTC move the fingers at different speeds", ("equal_fingers",), ("torque_speed",),
        (("some difference is normal: grease the stiff fingers", "§7.3"), ("or compensate with a different velocity or gain for each finger", "§8"), _VENDOR),
    ),
    "incomplete-close": Symptom(
        "fingers do not close completely", ("close_target", "strain_limits", "breakaway"), ("close",),
        (_FREE, ("if the finger was taken off recently, check its angle and set it again", "§7.3 steps 6 to 9"), _VENDOR),
    ),
    "spread-friction": Symptom(
        "the spread has much friction", ("spread_greasing",), ("spread_time",),
        (("grease the spread's gears: `handctl barrett maintenance --steps lubrication`", "§7.3"), ("if the palm screws were removed, tighten them all with the same torque, not too much", "§8"), _VENDOR),
    ),
    "locking-ring": Symptom(
        "the locking ring does not fit the base",
        steps=(("if the ring is damaged or warped, order a replacement from the vendor", "§8"), ("if the threads of the base are damaged, send it to the vendor for service", "§8")),
    ),
    "tip-flops": Symptom("the fingertip flops back after an impact", steps=(_CABLE,)),
    "tip-backlash": Symptom(
        "the fingertip has much backlash",
        steps=(("the pretension is too low: `handctl barrett maintenance --steps pretension`", "§7.1"), _CABLE, _VENDOR),
    ),
    "tip-hyperextended": Symptom(
        "the fingertip stands beyond the open stop, but is not loose", ("open_position",), ("initialize",),
        (
            ("the spur gears may not have engaged when the finger was put back: check that it is seated fully and square, with its screw in and tight", "§8, §7.3"),
            ("set the fingertip's angle again, reseat the finger and test it", "§7.3 steps 6 to 9"),
            ("if the problem persists, send the hand to the vendor for service", "§8"),
        ),
    ),
    "spread-uneven": Symptom(
        "F1 and F2 stand at different spread angles",
        steps=(("one motor and one encoder serve both, so handctl cannot see this. A spread gear is damaged: contact the vendor", "§8"),),
    ),
}  # fmt: skip


def like(name: str) -> list[str]:
    """Symptoms whose name or title is like `name`."""
    found = near(name, SYMPTOMS)
    return found + [key for key, entry in SYMPTOMS.items() if name in entry.title and key not in found]
