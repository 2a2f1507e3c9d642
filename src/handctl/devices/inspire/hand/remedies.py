"""What an RH56's error bits, status codes and readings mean, and what to do (rh56 §3.1, §9)."""

from handctl.devices.inspire.hand.register_map import FINGERS, RESTARTED, STATUS, TOO_HOT_TO_MOVE
from handctl.errors import Hint
from handctl.model.device_picture import UNKNOWN, Measure, Outline, Remedy, hand

_CLEAR = "hand clear-errors"
_AGAIN = Hint("run {}. If it comes back, power-cycle the hand, then contact the vendor", _CLEAR)
_UNLOAD = Hint("take the load off the finger, then run {}", _CLEAR)
_FREE = Hint("free the finger, then run {}", _CLEAR)

REMEDIES = {
    "over_temperature": Remedy("the actuator is too hot. It clears by itself as it cools", "let the finger rest and cool: no command clears over_temperature", "rh56 §3.1"),
    "hot": Remedy(f"{TOO_HOT_TO_MOVE} °C or more: handctl does not move the hand", "let the finger rest and cool", "rh56 §9"),
    STATUS[8]: Remedy("the emergency stop is active", "release the emergency stop with the program that set it (register 1131)", "rh56 §3.2"),
    "locked_rotor": Remedy("the actuator was driven and did not turn", _FREE, "rh56 §3.1"),
    STATUS[6]: Remedy("the actuator was driven and did not turn", _FREE, "rh56 §3.1"),
    "over_current": Remedy("the actuator drew too much current", _UNLOAD, "rh56 §3.1"),
    STATUS[5]: Remedy("the actuator reached its current limit and protects itself", Hint("take the load off the finger, then run {}. If it comes back, compare {}", _CLEAR, "hand get current_limit current"), "rh56 §3.1"),
    "motor": Remedy("the motor does not run as it should", _AGAIN, "rh56 §3.1"),
    STATUS[7]: Remedy("the actuator has a fault", _AGAIN, "rh56 §3.1"),
    "communication": Remedy("the hand and its actuator do not communicate", _AGAIN, "rh56 §3.1"),
    RESTARTED: Remedy("the hand has forgotten its targets and speeds", "check its supply (24 V) and the plug, then read its status before you move it again", "rh56 §6"),
    UNKNOWN: Remedy("the manual does not have this bit", "run `handctl hand report FILE`, and send it to the vendor", "rh56 §3.1"),
    "range": Remedy("a reading is outside the documented range", Hint("run {}, and check --model", "hand doctor"), "rh56 §3.1"),
}  # fmt: skip

OUTLINE = Outline(
    hand(FINGERS[:4], FINGERS[4:]),
    {
        "temperature": Measure("temperature.{}", TOO_HOT_TO_MOVE),
        "force": Measure("force_actual.{}"),
        "error": Measure("error.{}"),
    },
    errors="error.{}",
    bend=("angle_actual.{}", 0, 1000),
    note="A right hand seen from its palm. A bar is as long as the finger is open.",
)
"""The fingers of an RH56 in their place. Where the actuators of an RH5DG2 are is not known."""

TRAINING_FAULTS = dict.fromkeys(("over-temperature", "locked-rotor", "over-current", "motor-abnormal", "communication", "unknown-bits"), "")  # fmt: skip
"""Fault of the simulator that a trainee finds by reading alone (`handctl service --demo`) -> what else the simulator is told."""
