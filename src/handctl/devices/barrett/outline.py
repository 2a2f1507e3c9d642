"""The motors of a BarrettHand in their place: F1 and F2 turn round the palm with the spread, F3 is fixed across from them."""

from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.maintenance.health import LIMIT_TENTHS
from handctl.devices.barrett.views import STROKE
from handctl.model.outline import Bar, Measure, Outline

_F1, _F2, _F3, _SPREAD = MOTORS

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
