"""The states in which a command may meet an AIDIN-hand."""

from __future__ import annotations

import json
from collections.abc import Iterator

from tests.harm.states import Before, State, then


def _object(**content: object) -> bytes:
    return json.dumps(content).encode() + b"\n"


CLOSE = _object(hand_mode=10, hand_TP_cmd=[200000] * 15)
PUSH = _object(hand_mode=41, hand_TT_cmd=[1] * 15)
HOME = _object(hand_mode=1)
AIDIN: tuple[tuple[str, dict[str, str], Before], ...] = (
    ("not homed", {}, then(1.0)),
    ("at rest", {"start": "homed"}, then(1.0)),
    ("moves", {"start": "open"}, then(_object(hand_mode=5, maxtorque=5), 0.1, CLOSE, 0.4)),
    ("current mode", {"start": "homed"}, then(_object(hand_mode=5, maxtorque=1000), 0.1, PUSH, 0.4)),
    ("homing", {"homing": "latched"}, then(HOME, 0.4)),
)


RATE = {"rate": "20"}
"""Objects a second in the stream: enough for the host, and few enough for thousands of cells."""


def states() -> Iterator[State]:
    for how in ("stream", "poll", "command", "mute"):
        for name, options, before in AIDIN:
            if how in ("stream", "poll") or name in ("at rest", "homing"):
                yield State(
                    "AIDIN-hand",
                    f"{name}, {how}",
                    "aidin",
                    "aidin",
                    {**options, "exchange": how, **RATE},
                    before,
                    "tcp",
                )
    options = {"homing": "latched", "neutral": "interrupts", **RATE}
    yield State("AIDIN-hand", "homing, any object ends it", "aidin", "aidin", options, then(HOME, 0.4), "tcp")
