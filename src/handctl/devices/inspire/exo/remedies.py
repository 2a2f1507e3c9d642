"""What an EH55BF1's error bits and readings mean, and what to do. The bits: exo §2.3.12; what clears them: exo §2.3.3."""

from handctl.devices.inspire.exo.register_map import FINGERS
from handctl.errors import Hint
from handctl.model.device_picture import UNKNOWN, Measure, Outline, Remedy, hand

_CLEAR = "exo clear-errors"
_AGAIN = Hint("run {}. If it comes back, power-cycle the hand, then contact the vendor", _CLEAR)

REMEDIES = {
    "over_temperature": Remedy("the actuator is too hot. It clears by itself as it cools", "release the finger and let it cool: no command clears over_temperature", "exo §2.3.3"),
    "locked_rotor": Remedy("the actuator was driven and did not turn", Hint("free the finger, then run {}", _CLEAR), "exo §2.3.3"),
    "over_current": Remedy("the actuator drew too much current", Hint("take the load off the finger, then run {}", _CLEAR), "exo §2.3.3"),
    "motor_abnormal": Remedy("the motor does not run as it should", _AGAIN, "exo §2.3.3"),
    "communication": Remedy("the hand and its actuator do not communicate", _AGAIN, "exo §2.3.3"),
    UNKNOWN: Remedy("the manual does not have this bit", "run `handctl exo report FILE`, and send it to the vendor", "exo §2.3.12"),
    "supply": Remedy("the hand measures no supply voltage", "check the power supply and its plug", "exo §2.3"),
    "range": Remedy("a reading is outside the documented range", Hint("run {}: the sensor, or the type of the hand, may be wrong", "exo doctor"), "exo §2.3"),
}  # fmt: skip

OUTLINE = Outline(
    hand(FINGERS[:4], ("thumb", "thumb_rotation")),
    {
        "temperature": Measure("temperature.{}", 100),
        "force": Measure("force_actual.{}", 1000),
        "error": Measure("error.{}"),
    },
    errors="error.{}",
    bend=("position_actual.{}", 0, 1000),
    note="A right hand seen from its palm. A bar is as long as the finger is open.",
)
"""The fingers of an EH55BF1 in their place. The ends of temperature and force are those of their ranges (exo §2.3.10, §2.3.13)."""

TRAINING_FAULTS = dict.fromkeys(("over-temperature", "locked-rotor", "over-current", "motor-abnormal", "communication", "unknown-bits"), "")  # fmt: skip
"""Fault of the simulator that a trainee finds by reading alone (`handctl service --demo`) -> what else the simulator is told."""
