"""The fingers of an AIDIN-hand in their place. It has no temperatures and no error bits."""

from handctl.devices.aidin.map import FINGERS
from handctl.model.outline import Measure, Outline, hand

OUTLINE = Outline(
    hand(FINGERS[:0:-1], FINGERS[:1]),
    {"force": Measure("sensor_state.{}.fz")},
    note="A right hand seen from its palm. The force is that along z of the fingertip.",
)
