"""The devices of the matrix and the states in which a command may meet them. Written from manuals and dossiers.

A state is made anew for every cell: a simulated device at the end of its cable, brought there by what a person or another
program did before. Motions are slow, so that they still go on when a command has looked at every speed first.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from handctl.families import FAMILIES
from handctl.sim import create
from handctl.sim.engine.canline import CanLine
from handctl.sim.engine.line import Line
from tests.contract.facts import facts_of
from tests.support.rh56_hand import GENERATIONS, rh56_line

Wire = str
"""serial: bytes at a speed, heard wrongly at another one; tcp: bytes as they are; can: frames."""
Before = Callable[[Any], None]


@dataclass(frozen=True)
class State:
    """One device in one state.

    device   which device it is, for people
    name     in which state
    owner    the family whose device it is; "" when it is of none
    kind     of its simulator
    before   what happened to it before the command comes
    """

    device: str
    name: str
    owner: str
    kind: str
    options: dict[str, str] = field(default_factory=dict)
    before: Before = lambda line: line.advance(1.0)
    wire: Wire = "serial"

    @property
    def looping(self) -> bool:
        """Whether a BarrettHand is in RealTime mode."""
        return self.name.startswith("in LOOP")

    @property
    def in_block(self) -> bool:
        """Whether it waits for the rest of a control block."""
        return self.name.endswith("in a block")

    def __str__(self) -> str:
        return f"{self.device}, {self.name}" + ("" if self.wire == "serial" else f", {self.wire}")

    def make(self) -> Line | CanLine:
        """The device, in its state, with the line quiet."""
        line = rh56_line(self.name.split()[0]) if self.kind == "rh56" else create(self.kind, dict(self.options))
        line.advance(0.0)
        self.before(line)
        if not isinstance(line, CanLine):
            line.take()
        return line


def _then(*steps: str | bytes | float) -> Before:
    """Bytes sent, seconds passed, control commands of the simulator, in order."""

    def play(line: Any) -> None:
        now = 0.0
        for step in steps:
            if isinstance(step, bytes):
                line.feed(step)
            elif isinstance(step, str):
                line.command(step)
            else:
                now += step
            line.advance(now)

    return play


# -- BarrettHand (barrett 5, 6, 8) ------------------------------------------------------------------------------------

SLOW = b"FSET MCV 16 MOV 16 SAMPLE 255\r"
"""One count in each of the longest samples: to close takes half a minute."""
CRAWL = bytes([2, 20] * 4)
"""Velocity and gain of four motors (§6.1)."""
BARRETT: tuple[tuple[str, dict[str, str], Before], ...] = (
    ("at rest", {"initialized": "1"}, _then(1.0)),
    ("not initialized", {}, _then(1.0)),
    ("closing", {"initialized": "1"}, _then(SLOW, 0.3, b"C\r", 0.5)),
    ("a line half typed", {"initialized": "1"}, _then(SLOW, 0.3, b"C", 0.5)),
    ("in LOOP", {"initialized": "1"}, _then(b"LOOP\r", 0.5)),
    ("in LOOP, moving", {"initialized": "1"}, _then(b"LOOP\r", 0.5, b"C" + CRAWL, 0.5)),
    ("in LOOP, in a block", {"initialized": "1"}, _then(b"LOOP\r", 0.5, b"C" + CRAWL, 0.5, b"C" + CRAWL[:3], 0.2)),
    ("saving", {"initialized": "1", "write-time": "0.5"}, _then(b"FSAVE\r", 0.5)),
    ("initializing", {"align": "60"}, _then(b"HI\r", 0.5)),
    ("booting", {"window": "30", "boot": "30"}, _then(1.0, "power-cycle", 0.5)),
    ("starting", {"window": "0.1", "boot": "30"}, _then(1.0, "power-cycle", 0.5)),
    ("blank", {"image": "blank"}, _then(1.0)),
    ("blank, just switched on", {"image": "blank", "window": "30", "boot": "30"}, _then(1.0, "power-cycle", 0.5)),
)
AT_EVERY_SPEED = ("at rest", "closing")
SPEEDS = ("600", "1200", "2400", "4800", "19200", "38400")


def _barrett() -> Iterator[State]:
    for name, options, before in BARRETT:
        yield State("BarrettHand", name, "barrett", "barrett", options, before)
        if name in ("at rest", "closing", "in LOOP", "blank"):
            yield State("BarrettHand", name, "barrett", "barrett", options, before, "tcp")
        for speed in SPEEDS if name in AT_EVERY_SPEED else ():
            yield State("BarrettHand", f"{name}, {speed}", "barrett", "barrett", {**options, "baud": speed}, before)


# -- Inspire (exo 2, wrist 2, rh56) -----------------------------------------------------------------------------------


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


def _inspire() -> Iterator[State]:
    for wire in ("serial", "tcp"):
        yield State("exo", "at rest", "exo", "exo", wire=wire)
        yield State("exo", "fingers move", "exo", "exo", {}, _exo_moves, wire)
        yield State("wrist with hand", "at rest", "wrist", "wrist", wire=wire)
        yield State("wrist with hand", "moves", "wrist", "wrist", {}, _then(0.5, WRIST_MOVES, 0.5), wire)
        yield State("hand without wrist", "at rest", "", "wrist", {"fault": "no-wrist"}, wire=wire)
    yield State("exo", "holds forces", "exo", "exo", {}, _then(0.5, FORCES, 0.5))
    yield State("exo", "calibrates", "exo", "exo", {"calibration": "120"}, _then(0.5, _frame(0x12, "F1 03 01"), 0.5))
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


# -- EksoNR (ekso) ----------------------------------------------------------------------------------------------------


def _ekso() -> Iterator[State]:
    for posture in ("sitting", "standing", "walking", "held"):
        yield State("EksoNR", posture, "ekso", "ekso", {"posture": posture, "sway": "0"})
    for posture in ("standing", "walking"):
        yield State("EksoNR", f"{posture}, USB", "ekso", "ekso", {"posture": posture, "sway": "0", "usb": "1"})
        yield State("EksoNR", posture, "ekso", "ekso", {"posture": posture, "sway": "0"}, wire="tcp")
    yield State("EksoNR", "standing, 9600", "ekso", "ekso", {"posture": "standing", "sway": "0", "baud": "9600"})


# -- AIDIN-hand (aidin) -----------------------------------------------------------------------------------------------


def _object(**content: object) -> bytes:
    return json.dumps(content).encode() + b"\n"


CLOSE = _object(hand_mode=10, hand_TP_cmd=[200000] * 15)
PUSH = _object(hand_mode=41, hand_TT_cmd=[1] * 15)
HOME = _object(hand_mode=1)
AIDIN: tuple[tuple[str, dict[str, str], Before], ...] = (
    ("not homed", {}, _then(1.0)),
    ("at rest", {"start": "homed"}, _then(1.0)),
    ("moves", {"start": "open"}, _then(_object(hand_mode=5, maxtorque=5), 0.1, CLOSE, 0.4)),
    ("current mode", {"start": "homed"}, _then(_object(hand_mode=5, maxtorque=1000), 0.1, PUSH, 0.4)),
    ("homing", {"homing": "latched"}, _then(HOME, 0.4)),
)


RATE = {"rate": "20"}
"""Objects a second in the stream: enough for the host, and few enough for thousands of cells."""


def _aidin() -> Iterator[State]:
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
    yield State("AIDIN-hand", "homing, any object ends it", "aidin", "aidin", options, _then(HOME, 0.4), "tcp")


MAKERS: dict[str, Callable[[], Iterator[State]]] = {
    "barrett": _barrett, "exo": _inspire, "wrist": _inspire, "ekso": _ekso, "aidin": _aidin,
}  # fmt: skip
"""Kind of simulator -> what makes its states. One that is not here is at rest, and moves."""


def _plain(family: str) -> Iterator[State]:
    """The states of a family that has no list of its own, as its facts have them."""
    facts = facts_of(family)
    options = dict(item.split("=", 1) for item in facts.state.split("&") if item)
    for wire in ("serial", "tcp"):
        yield State(family, "at rest", family, family, options, wire=wire)
        if facts.moving:
            yield State(family, "moves", family, family, options, _then(0.5, facts.moving, 0.2), wire)


def states() -> list[State]:
    """All of them; every kind of simulator has some."""
    plain = [partial(_plain, family) for family in FAMILIES if family not in MAKERS]
    return [state for make in (*dict.fromkeys(MAKERS.values()), *plain) for state in make()]
