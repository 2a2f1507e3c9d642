"""The manual's maintenance procedures as short steps, each with its section (barrett §3.7, §7). Data; knows no hand."""

from __future__ import annotations

from typing import NamedTuple


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
