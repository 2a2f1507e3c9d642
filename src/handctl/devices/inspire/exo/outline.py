"""The fingers of an EH55BF1 in their place."""

from handctl.devices.inspire.map import FINGERS
from handctl.model.outline import Measure, Outline, hand

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
"""The ends of temperature and force are those of their ranges (exo §2.3.10, §2.3.13)."""
