"""The states in which a command may meet Inspire's devices: exoskeleton hand, wrist module with and without hand, RH56."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from tests.harm.states import State, then
from tests.support.rh56_hand import GENERATIONS


def _frame(flag: int, body: str) -> bytes:
    data = bytes.fromhex(body)
    inner = bytes([1, len(data) + 1, flag]) + data
    return b"\xeb\x90" + inner + bytes([sum(inner) % 256])


def _exo_moves(line: Any) -> None:
    line.advance(0.5)
    for finger in line.device.hand.fingers:
        finger.speed = 4.0
    line.feed(_frame(0x32, "E8 03 E8 03 E8 03 E8 03 E8 03"))
    line.advance(1.0)


def _rh56_moves(line: Any) -> None:
    line.device.pace = 4.0
    line.feed(_frame(0x12, "CE 05 E8 03 E8 03 E8 03 E8 03 E8 03 E8 03"))
    line.advance(1.0)


FORCES = _frame(0x31, "9C FF 64 00 9C FF 64 00 9C FF")
WRIST_MOVES = _frame(0x31, "0E 04 E8 03 18 FC 60 EA")
"""Yaw 10, pitch -10 degrees within 60 s."""


def states() -> Iterator[State]:
    for wire in ("serial", "tcp"):
        yield State("exo", "at rest", "exo", "exo", wire=wire)
        yield State("exo", "fingers move", "exo", "exo", {}, _exo_moves, wire)
        yield State("wrist with hand", "at rest", "wrist", "wrist", wire=wire)
        yield State("wrist with hand", "moves", "wrist", "wrist", {}, then(0.5, WRIST_MOVES, 0.5), wire)
        yield State("hand without wrist", "at rest", "", "wrist", {"fault": "no-wrist"}, wire=wire)
    yield State("exo", "holds forces", "exo", "exo", {}, then(0.5, FORCES, 0.5))
    yield State("exo", "calibrates", "exo", "exo", {"calibration": "120"}, then(0.5, _frame(0x12, "F1 03 01"), 0.5))
    yield State("exo", "has errors", "exo", "exo", {"fault": "faults"})
    yield State("wrist with hand", "has errors", "wrist", "wrist", {"fault": "faults"})
    for speed in ("57600", "19200"):
        for device in ("exo", "wrist"):
            yield State(device, f"at {speed}", device, device, {"baud": speed})
    can = {"bus": "can"}
    yield State("wrist with hand", "at rest", "wrist", "wrist", can, wire="can")
    yield State("wrist with hand", "moves", "wrist", "wrist", can, _can_moves, "can")
    yield State("hand without wrist", "at rest", "", "wrist", {**can, "fault": "no-wrist"}, wire="can")
    for generation in GENERATIONS:
        yield State("RH56", f"{generation} at rest", "", "rh56")
    yield State("RH56", "df moves", "", "rh56", {}, _rh56_moves)


def _can_moves(line: Any) -> None:
    line.advance(0.5)
    line.feed_frame(0x15038001, bytes.fromhex("E8 03 18 FC 60 EA"))
    line.advance(1.0)
    line.take_frames()
