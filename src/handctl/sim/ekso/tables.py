"""Tables of the simulated EksoNR: settings with their places, limits and power-on values, presets (manual §6).

A transcription of its own, raw numbers throughout. Limits are invented; the codes are those that field clients know.
"""

from __future__ import annotations

from handctl.number_parsing import number_in

# Per word of GetSettings: (name, ParameterID or None, values that SetValue takes, power-on value). The order of the
# words is not that of the IDs. A range is a limit in hundredths (status 2 beyond it), a set is a list of codes (status
# 3 for others). The power-on codes differ as far as their short lists allow, and from their neighbours in either table.
SETTINGS: tuple[tuple[str, int | None, range | frozenset[int], int], ...] = (
    ("upper_leg_length", 200, range(1000, 2501), 1680),
    ("lower_leg_length", 201, range(1000, 2501), 1640),
    ("step_length", 202, range(400, 2401), 1475),
    ("step_height", 203, range(601), 175),
    ("swing_time", 204, range(40, 251), 110),
    ("stand_time", 205, range(501), 65),
    ("knee_flexion", 206, range(4001), 1250),
    ("hip_flexion", 207, range(4001), 820),
    ("forward_shift", 208, range(-500, 501), -150),
    ("lateral_shift", 209, range(-500, 501), 85),
    ("walk_mode", 212, frozenset(range(4)), 3),
    ("stand_mode", 210, frozenset(range(2)), 1),
    ("target_sounds", 213, frozenset(range(4)), 0),
    ("injury_mode", 215, frozenset(range(4)), 2),
    ("left_swing_assist", 216, frozenset(range(28)), 8),
    ("right_swing_assist", 218, frozenset(range(28)), 14),
    ("left_stance_support", 217, frozenset(range(6)), 4),
    ("right_stance_support", 219, frozenset(range(6)), 5),
    ("swing_complete", None, frozenset(), 6),
    ("pilot_id", None, frozenset(), 4711),
    ("sit_mode", 211, frozenset(range(2)), 0),
    ("lean_allowance", 214, frozenset(range(3)), 2),
)
PLACE = {row[1]: place for place, row in enumerate(SETTINGS) if row[1] is not None}
NAMES = tuple(row[0] for row in SETTINGS)
SETTING_COUNT, DATA_COUNT, FEEDBACK_COUNT = 22, 27, 17  # words
POWER_ON = tuple(row[3] % 65536 for row in SETTINGS)

# GetFeedback up to the two words of BootTime: steps, s upright, s walked, then what scales by 10.
FEEDBACK = (214, 1530, 417, 385, 270, 405, 295, 550, 640, 575, 665, 142, 147, 11, 13)

# Values of the synthetic transcripts.
VECTOR_SETTINGS = (1700, 1600, 1550, 200, 90, 50, 500, 300, 65461, 125, 2, 1, 3, 0, 10, 12, 2, 3, 4, 7, 1, 2)
VECTOR_FEEDBACK = (312, 1240, 655, 425, 300, 450, 315, 600, 700, 620, 710, 152, 156, 9, 9)
VECTOR_DATA = {2: 95, 3: 610, 4: 120, 5: 480, 10: 65351, 12: 65496, 14: 210, 16: 65481, 18: 8256, 21: 0, 22: 125}
VECTOR_ANGLES = (4.5, -0.75, 22.1, 8.4, -6.35, 3.2)
VECTOR_BOOT = 5000001

PRESETS = ("clinic", "vectors", "order", "sign")
LADDERS = {"order": (384, 257), "sign": (61440, 17)}  # words that all differ: the first, and the step to the next


def place_of(word: str) -> int:
    """The word of a setting by its name or its ParameterID; ValueError when there is none."""
    if word in NAMES:
        return NAMES.index(word)
    if (number := number_in(word)) in PLACE:
        return PLACE[number]
    raise ValueError(f"unknown setting {word!r}. Known: {', '.join(NAMES)}, or a ParameterID, 200 to 219")


def judge_value(place: int, raw: int) -> int:
    """Status code for a value, 0..65535: 0 good, 2 out of range, 3 not a listed code."""
    allowed = SETTINGS[place][2]
    if raw in allowed or (raw >= 32768 and raw - 65536 in allowed):  # only the shifts go below 0
        return 0
    return 2 if isinstance(allowed, range) else 3
