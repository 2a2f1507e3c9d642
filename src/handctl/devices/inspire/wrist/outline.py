"""The two actuators of the wrist module, side by side. Which is on which side is not in the manual."""

from handctl.model.outline import Bar, Measure, Outline

OUTLINE = Outline(
    (Bar("1", 0, -4), Bar("2", 0, -4)),
    {"temperature": Measure("temperature_{}"), "error": Measure("error_{}")},
    errors="error_{}",
    palm=0,
)
