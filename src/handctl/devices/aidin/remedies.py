"""What the readings of an AIDIN-hand mean, and what to do. It has no error bits."""

from __future__ import annotations

from handctl.devices.aidin.json_codec import RECORD_BYTES
from handctl.devices.aidin.parameter_map import FINGERS
from handctl.errors import Hint
from handctl.model.device_picture import Measure, Outline, Remedy, hand

REMEDIES = {
    "no-angle": Remedy("joint angles are no radians (possibly degrees)", f"{RECORD_BYTES}. Until then, move only with `encoders`", "aidin, Feedback keys"),
    "frozen": Remedy("the hand repeats old feedback, so its state is unknown", "check the hand and the network, and switch the hand's power off if it moves", "handctl"),
    "range": Remedy("the origin of the encoders is not set", Hint("set it with {}: all fingers open for 3 s", "aidin home"), "aidin, Modes"),
    "all-zero": Remedy("the hand has either just been homed, or just been switched on with the fingers anywhere", Hint("run {}, unless the hand has been homed since power-on", "aidin home"), "aidin, Modes"),
}  # fmt: skip
ALL_ZERO = f"all encoders are exactly 0: {REMEDIES['all-zero'].meaning}"

OUTLINE = Outline(
    hand(FINGERS[:0:-1], FINGERS[:1]),
    {"force": Measure("sensor_state.{}.fz")},
    note="A right hand seen from its palm. The force is that along z of the fingertip.",
)
"""The fingers of an AIDIN-hand in their place. It has no temperatures and no error bits."""

TRAINING_FAULTS = dict.fromkeys(("degrees", "missing-key", "not-json", "nan", "wrong-length", "wrong-type", "silent", "unclosed", "disconnect"), "")  # fmt: skip
"""Fault of the simulator that a trainee finds by reading alone (`handctl service --demo`) -> what else the simulator is told."""
