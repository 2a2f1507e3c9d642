"""The symptoms of the manual's troubleshooting chapter (barrett §8): checks, movements to try, and steps to do by hand.

And its maintenance procedures (§3.7, §7). Data only. `checks` and `trials` are names of functions in `diagnose` and `trials`; a test says that they all exist.
Steps are what no program can do, each with its section, in the manual's order.
"""

from __future__ import annotations

from typing import NamedTuple

from handctl.misspellings import near

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
        steps=(("after more than a day or two without power, especially in humid weather, its RAM contents may be corrupt", "§8, §3.7"), _RELOAD),
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


# -- maintenance -------------------------------------------------------------------------------------------------------


class Procedure(NamedTuple):
    """A piece of work: its steps with the step's own section where it is not the procedure's."""

    title: str
    source: str
    steps: tuple[tuple[str, str], ...]


PROCEDURES = {
    "lubrication": Procedure("lubricate the gears", "barrett §7.3", (
        ("put Mobil 1 synthetic grease on all exposed gear teeth: worm gears and palm spur gears", "§7.3, Figure 11"),
        ("for the spur gears take one finger off at a time. First open all fingers: `handctl barrett open`", "§7.3 step 1"),
        ("switch the power supply off, then unplug the hand's cable. Never unplug it with the power on", "§7.3 step 2, §2"),
        ("remove the finger's shoulder screw", "§7.3 step 3, Figure 12"),
        ("tilt the finger slightly forward and lift its teeth out. Mind the gold pins of the strain option", "§7.3 step 4"),
        ("pull it straight off the motor's face, neither twisted nor rocked", "§7.3 step 5, Figure 13"),
        ("if a link or spur gear has moved: turn the joint 3 drive 5 1/2 turns (2-mm hex) from both links in line and horizontal", "§7.3 step 6, Figure 14"),
        ("put a thick bead of grease around the motor pinion, so that all teeth are covered", "§7.3 step 7"),
        ("put the finger back square, with its teeth fully seated and no force on the gold pins", "§7.3 step 8, Figure 15"),
        ("tighten the shoulder screw, leaving no gap at the motor housing", "§7.3 step 9"),
        ("plug the cable in, switch the power supply on, run `handctl barrett init`, then record the work: `handctl barrett maintenance --greased POINT`", "§3.6, §5.2.1"),
    )),
    "fasteners": Procedure("check the fasteners", "barrett §7.2", (
        ("under heavy use, check monthly that every external screw is in place and tight", "§7.2, Figure 10"),
        ("order a lost screw from the vendor. Its length matters: never use a different one", "§7.2"),
    )),
    "pretension": Procedure("adjust the pretension of a finger's cable", "barrett §7.1", (
        ("loosen the spline set screw at the end of the joint 3 cable", "§7.1 step 1, Figure 8"),
        ("turn the tensioner screw behind joint 3 clockwise with 15 oz-in (2-mm torque wrench), only until the slack is gone. Too much snaps the tendon", "§7.1 step 2, Figure 9"),
        ("tighten the set screw snug against the tensioner screw. Under heavy use put Loctite 222 on its thread", "§7.1 step 3"),
    )),
    "strain": Procedure("zero the strain gauges", "barrett §7.4", (
        ("initialize, free the spread, open the fingers: `handctl barrett strain --open`", "§7.4 steps 1 and 2, §9.4"),
        ("remove the shroud cover screws (some models have four) and take the shroud off the link", "§7.4 step 3, Figure 16"),
        ("watch the reading: `handctl barrett strain --live`", "§7.4 step 4"),
        ("turn the finger's balancing potentiometer in very small steps, with hardly any pressure, until the reading is 100 to 140", "§7.4 step 5, Figure 17"),
        ("end the live view, and put the shroud and the screws back. Do not touch the gauge or its wires", "§7.4 step 6"),
    )),
    "firmware": Procedure("load the firmware again", "barrett §3.7", (
        ("check the file first: `handctl barrett firmware check FILE`", "§3.7"),
        ("`handctl barrett firmware download FILE`: it says when to switch the power supply off for 5 seconds, and on again", "§3.7 steps 5 to 8"),
        ("`handctl barrett init`", "§5.2.1"),
    )),
}  # fmt: skip


def lines(name: str) -> list[str]:
    """A procedure for people: its title, then numbered steps with sections."""
    found = PROCEDURES[name]
    return [
        f"To {found.title} ({found.source}):",
        *(f"  {number}. {text} ({source})" for number, (text, source) in enumerate(found.steps, 1)),
    ]
