"""What a BarrettHand's status codes and readings mean, and what to do. The codes are those of `gcl.status_codes.STATUS_CODES`."""

from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.gcl.status_codes import OVER_TEMPERATURE, STATUS_CODES
from handctl.devices.barrett.maintenance.health_limits import LIMIT, LIMIT_TENTHS, NO_SENSOR
from handctl.devices.barrett.parameter_map import STROKE
from handctl.errors import Hint
from handctl.model.device_picture import Bar, Measure, Outline, Remedy

_F1, _F2, _F3, _SPREAD = MOTORS

_URGENT = (OVER_TEMPERATURE, 1, 2, 16, 4)
"""The codes that come first."""
_COOL = Hint("let the hand cool, and free the spread with {}", "barrett stop --motors S")

REMEDIES = {
    "hot": Remedy(f"the board is hotter than {LIMIT}, which it must never be", _COOL, "barrett §2"),
    "over-limit": Remedy("the board is hotter than OTEMP: motor commands fail", _COOL, "barrett §5.4.1"),
    "no-temperature": Remedy("the temperature sensor of the board cannot be read", NO_SENSOR, "barrett §5.4.2"),
    **{
        f"{STATUS_CODES[code][0]} ({code})": Remedy(f"status code {code} of the motor", STATUS_CODES[code][1], "barrett §5.1.3, T3")
        for code in (*_URGENT, *(code for code in STATUS_CODES if code not in _URGENT))
    },
    "unknown": Remedy("the manual does not list this code", "ask the vendor", "barrett §5.1.3, T3"),
    "moving": Remedy("the hand is moving", Hint("wait, or run {}", "barrett stop"), "barrett §5.2.1"),
    "disabled": Remedy("the motor only moves if it is named (--motors)", Hint("run {}", "barrett set EN=1"), "barrett §5.3.4"),
    "was-hot": Remedy(f"the board has been hotter than {LIMIT}", f"set OTEMP={LIMIT_TENTHS}, so that the hand protects itself", "barrett §5.4.2"),
}  # fmt: skip

OUTLINE = Outline(
    (Bar(_F1, 0, 6), Bar(_F3, -2, -6), Bar(_F2, 0, 6), Bar(_SPREAD, 0, 2)),
    {
        "temperature": Measure("temperature", LIMIT_TENTHS / 10),
        "force": Measure("strain.{}"),
        "error": Measure("status.{}"),
    },
    errors="status.{}",
    bend=("position.{}", STROKE[0], 0),
    ends={_SPREAD: (STROKE[1], 0)},
    note="Seen from above. The temperature is the board's. A bar is as long as the finger is open.",
)
"""The motors of a BarrettHand in their place: F1 and F2 turn round the palm with the spread, F3 is fixed across from them."""

TRAINING_FAULTS = dict.fromkeys(("hot", "no-board", "no-motor", "unknown-codes", "silent", "noise"), "initialized=1")
"""Fault of the simulator that a trainee finds by reading alone (`handctl service --demo`) -> what else the simulator is told."""
