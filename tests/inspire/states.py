"""The states in which a command may meet Inspire's devices: exoskeleton hand, wrist module with and without hand, RH56."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from handctl.sim.hand import MODELS
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


OWNERS = {"df": "hand", "tp": "hand", "f1": "", "dg2": ""}
"""Generation -> the family whose commands may write to it without a word more."""
CARRIED = ("hand",)
"""A wrist module sits on an RH56 hand, which has registers and commands of its own."""
FORCES = _frame(0x31, "9C FF 64 00 9C FF 64 00 9C FF")
WRIST_MOVES = _frame(0x31, "0E 04 E8 03 18 FC 60 EA")
"""Yaw 10, pitch -10 degrees within 60 s."""


def states() -> Iterator[State]:
    for wire in ("serial", "tcp"):
        yield State("exo", "at rest", "exo", "exo", wire=wire)
        yield State("exo", "fingers move", "exo", "exo", {}, _exo_moves, wire)
        yield State("wrist with hand", "at rest", "wrist", "wrist", wire=wire, also=CARRIED)
        yield State("wrist with hand", "moves", "wrist", "wrist", {}, then(0.5, WRIST_MOVES, 0.5), wire, also=CARRIED)
        yield State("hand without wrist", "at rest", "hand", "wrist", {"fault": "no-wrist"}, wire=wire)
    yield State("exo", "holds forces", "exo", "exo", {}, then(0.5, FORCES, 0.5))
    yield State("exo", "calibrates", "exo", "exo", {"calibration": "120"}, then(0.5, _frame(0x12, "F1 03 01"), 0.5))
    yield State("exo", "has errors", "exo", "exo", {"fault": "faults"})
    yield State("wrist with hand", "has errors", "wrist", "wrist", {"fault": "faults"}, also=CARRIED)
    for speed in ("57600", "19200"):
        for device in ("exo", "wrist"):
            yield State(
                device, f"at {speed}", device, device, {"baud": speed}, also=CARRIED if device == "wrist" else ()
            )
    can = {"bus": "can"}
    yield State("wrist with hand", "at rest", "wrist", "wrist", can, wire="can", also=CARRIED)
    yield State("wrist with hand", "moves", "wrist", "wrist", can, _can_moves, "can", also=CARRIED)
    yield State("hand without wrist", "at rest", "hand", "wrist", {**can, "fault": "no-wrist"}, wire="can")
    for generation in GENERATIONS:
        yield State("RH56", f"{generation} at rest", OWNERS[generation], "rh56")
    yield State("RH56", "df moves", OWNERS["df"], "rh56", {}, _rh56_moves)
    yield from _simulated()


def _simulated() -> Iterator[State]:
    """The simulated RH56 hands on each of their wires. One whose generation must be typed is of no family before that."""
    for model in MODELS:
        yield State(f"RH56 {model}", "at rest", OWNERS[model], "hand", {"model": model})
        yield State(f"RH56 {model}", "Modbus only", OWNERS[model], "hand", {"model": model, "speaks": "modbus"})
    for model, goal in (("df", "CE 05"), ("f1", "10 04"), ("dg2", "38 04")):
        count = 13 if model == "dg2" else 6
        body = f"{goal} {'84 03 ' * count}"
        slow = {"model": model, "speed": "20"}
        yield State(f"RH56 {model}", "moves", OWNERS[model], "hand", slow, then(0.5, _frame(0x12, body), 1.0))
    yield State("RH56 df", "has errors", "hand", "hand", {"model": "df", "fault": "faults"})
    yield State("RH56 tp", "at rest", "hand", "hand", {"model": "tp", "bus": "modbus-tcp"}, wire="tcp")
    for model in ("df", "tp"):
        yield State(f"RH56 {model}", "at rest", "hand", "hand", {"model": model, "bus": "can"}, wire="can")


def _can_moves(line: Any) -> None:
    line.advance(0.5)
    line.feed_frame(0x15038001, bytes.fromhex("E8 03 18 FC 60 EA"))
    line.advance(1.0)
    line.take_frames()
