"""The fingers of an RH56 in their place. Where the actuators of an RH5DG2 are is not known."""

from handctl.devices.inspire.hand.map import FINGERS, HOT
from handctl.model.outline import Measure, Outline, hand

OUTLINE = Outline(
    hand(FINGERS[:4], FINGERS[4:]),
    {"temperature": Measure("temperature.{}", HOT), "force": Measure("force_actual.{}"), "error": Measure("error.{}")},
    errors="error.{}",
    bend=("angle_actual.{}", 0, 1000),
    note="A right hand seen from its palm. A bar is as long as the finger is open.",
)
