"""What handctl finds in the data of an EksoNR, and what to do. The device itself reports no errors; the limits are handctl's."""

from __future__ import annotations

from handctl.errors import Hint
from handctl.model.device_picture import Bar, Measure, Outline, Remedy

_SERVICE = "run `handctl ekso report FILE`, and have the sensor checked by Ekso's service"

REMEDIES = {
    "boot-still": Remedy("the device sends old values", Hint("help the wearer out of the device, power-cycle it, then run {}", "ekso doctor"), "ekso §6, GetData"),
    "boot-back": Remedy("the device has restarted, or its words are swapped", Hint("run the command again. If it stays, run {}", "ekso doctor"), "ekso §6, GetData"),
    "boot-off": Remedy("the device's clock and this computer's do not agree", Hint("run the command again. If it stays, run {}", "ekso doctor"), "ekso §6, GetData"),
    "angle": Remedy("an angle that no wearer can have", _SERVICE, "ekso §6, GetData"),
    "leg-length": Remedy("a leg length that no wearer can have", Hint("check the leg lengths with {}", "ekso settings"), "ekso §6, GetSettings"),
    "hips": Remedy("the leg lengths do not match the wearer's settings, or the foot offset is different", Hint("check the leg lengths with {}", "ekso settings"), "ekso §6, GetSettings"),
    "hip": Remedy("the sensor on that side may be wrong", _SERVICE, "ekso §6, GetData"),
    "clock": Remedy("date and time cannot be read", Hint("run {} again", "ekso time"), "ekso §6, GetTime"),
}  # fmt: skip

OUTLINE = Outline(
    (Bar("left_knee", -4, -4), Bar("left_hip", 0, -4), Bar("right_hip", 0, -4), Bar("right_knee", -4, -4)),
    {"current": Measure("{}_current"), "angle": Measure("{}_angle")},
    palm=0,
    note="Seen from behind the wearer.",
)
"""The joints of an EksoNR in their place: hips below the trunk, knees below the hips."""

TRAINING_FAULTS = dict.fromkeys(("hip-offset", "frozen-clock", "clock-jump", "bad-checksum", "short-body", "wrong-command", "silent", "noise", "echo"), "")  # fmt: skip
"""Fault of the simulator that a trainee finds by reading alone (`handctl service --demo`) -> what else the simulator is told."""
