"""The joints of an EksoNR in their place: hips below the trunk, knees below the hips."""

from handctl.model.outline import Bar, Measure, Outline

OUTLINE = Outline(
    (Bar("left_knee", -4, -4), Bar("left_hip", 0, -4), Bar("right_hip", 0, -4), Bar("right_knee", -4, -4)),
    {"current": Measure("{}_current"), "angle": Measure("{}_angle")},
    palm=0,
    note="Seen from behind the wearer.",
)
