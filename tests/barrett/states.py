"""The states in which a command may meet a BarrettHand (manual §5, §6, §8)."""

from __future__ import annotations

from collections.abc import Iterator

from tests.harm.states import Before, State, then

SLOW = b"FSET MCV 16 MOV 16 SAMPLE 255\r"
"""One count in each of the longest samples: to close takes half a minute."""
CRAWL = bytes([2, 20] * 4)
"""Velocity and gain of four motors (§6.1)."""
BARRETT: tuple[tuple[str, dict[str, str], Before], ...] = (
    ("at rest", {"initialized": "1"}, then(1.0)),
    ("not initialized", {}, then(1.0)),
    ("closing", {"initialized": "1"}, then(SLOW, 0.3, b"C\r", 0.5)),
    ("a line half typed", {"initialized": "1"}, then(SLOW, 0.3, b"C", 0.5)),
    ("in LOOP", {"initialized": "1"}, then(b"LOOP\r", 0.5)),
    ("in LOOP, moving", {"initialized": "1"}, then(b"LOOP\r", 0.5, b"C" + CRAWL, 0.5)),
    ("in LOOP, in a block", {"initialized": "1"}, then(b"LOOP\r", 0.5, b"C" + CRAWL, 0.5, b"C" + CRAWL[:3], 0.2)),
    ("saving", {"initialized": "1", "write-time": "0.5"}, then(b"FSAVE\r", 0.5)),
    ("initializing", {"align": "60"}, then(b"HI\r", 0.5)),
    ("booting", {"window": "30", "boot": "30"}, then(1.0, "power-cycle", 0.5)),
    ("starting", {"window": "0.1", "boot": "30"}, then(1.0, "power-cycle", 0.5)),
    ("blank", {"image": "blank"}, then(1.0)),
    ("blank, just switched on", {"image": "blank", "window": "30", "boot": "30"}, then(1.0, "power-cycle", 0.5)),
)
AT_EVERY_SPEED = ("at rest", "closing")
SPEEDS = ("600", "1200", "2400", "4800", "19200", "38400")


def states() -> Iterator[State]:
    for name, options, before in BARRETT:
        yield State("BarrettHand", name, "barrett", "barrett", options, before)
        if name in ("at rest", "closing", "in LOOP", "blank"):
            yield State("BarrettHand", name, "barrett", "barrett", options, before, "tcp")
        for speed in SPEEDS if name in AT_EVERY_SPEED else ():
            yield State("BarrettHand", f"{name}, {speed}", "barrett", "barrett", {**options, "baud": speed}, before)
