"""What a wrist module's error bits and readings mean, and what to do. Its bits are assumed to be those of the hand."""

from handctl.errors import Hint
from handctl.model.device_picture import UNKNOWN, Bar, Measure, Outline, Remedy

_CYCLE = "then power-cycle the wrist: the manual has no command to clear its errors"

REMEDIES = {
    "over_temperature": Remedy("the actuator is too hot", f"let the wrist cool, {_CYCLE}", "wrist §2.1"),
    "locked_rotor": Remedy("the actuator was driven and did not turn", f"free the axis, {_CYCLE}", "wrist §2.1"),
    "over_current": Remedy("the actuator drew too much current", f"take the load off the axis, {_CYCLE}", "wrist §2.1"),
    "motor_abnormal": Remedy("the motor does not run as it should", "power-cycle the wrist. If it comes back, contact the vendor", "wrist §2.1"),
    "communication": Remedy("the module and its actuator do not communicate", "power-cycle the wrist. If it comes back, contact the vendor", "wrist §2.1"),
    UNKNOWN: Remedy("the manual does not have this bit", "run `handctl wrist report FILE`, and send it to the vendor", "wrist §2.1"),
    "range": Remedy("an angle is outside the range of the module", Hint("check that it is a wrist module: {}", "wrist doctor"), "wrist §1"),
}  # fmt: skip

OUTLINE = Outline(
    (Bar("1", 0, -4), Bar("2", 0, -4)),
    {"temperature": Measure("temperature_{}"), "error": Measure("error_{}")},
    errors="error_{}",
    palm=0,
)
"""The two actuators of the wrist module, side by side. Which is on which side is not in the manual."""

TRAINING_FAULTS = dict.fromkeys(("over-temperature", "locked-rotor", "over-current", "motor-abnormal", "communication", "unknown-bits"), "")  # fmt: skip
"""Fault of the simulator that a trainee finds by reading alone (`handctl service --demo`) -> what else the simulator is told."""
