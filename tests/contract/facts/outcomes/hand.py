"""The RH56 hands under the faults of their simulator, on each wire; exit codes by the contract, by hand."""

from __future__ import annotations

from typing import Any

from tests.contract.facts.outcomes import CLEARED, MOTOR_FAULTS, RIGHT, STOP, Codes, Outcomes, Variant, Wire
from tests.inspire.hand_commands import COMMANDS

NAMES = ("status", "status-check", "dump", "get", "read", "watch", "set", "speed", "angle-wait", "clear-errors", "save")
ROWS = [command for command in COMMANDS if command.name in NAMES]
WRITES = ("set", "speed", "angle-wait", "clear-errors", "save")
WIDE = ("status", "status-check", "dump")
SERIAL: dict[str, Codes] = {
    **dict.fromkeys(("healthy", "noise", "garble", "dribble", "split", "duplicate", "stale", "late", "slow", "echo"), RIGHT),
    **{key: {4} for key in ("silent", "deaf")},
    **{key: {5} for key in ("truncate", "bad-checksum", "wrong-id", "loopback", "twin-id")},
    "disconnect": {3}, "refuse": RIGHT,
}  # fmt: skip
CAN: dict[str, Codes] = {
    **dict.fromkeys(("healthy", "noise", "duplicate", "stale", "late", "slow", "echo", "refuse"), RIGHT),
    **{key: {4} for key in ("silent", "deaf", "twin-id", "no-ack")},
    **{key: {5} for key in ("truncate", "wrong-id", "loopback")},
    "disconnect": {3}, "bus-off": {3},
}  # fmt: skip
UNFIT: dict[str, Codes] = {"status-check": {7}, "angle-wait": {7}}
DEVICE: dict[str, dict[str, Codes]] = {
    **{name: {} for name in ("strict", "fresh", "force-deaf", "stops-short", "tactile-dead", "tactile-saturated")},
    **dict.fromkeys(MOTOR_FAULTS, UNFIT),
    "unknown-bits": {**UNFIT, "clear-errors": {7}},
    "blocked": {"angle-wait": {7}},
    "foreign": {"status-check": {7}, **{key: {6} for key in WRITES}},
    "block-silent": {}, "save-fails": {},
}  # fmt: skip
# a register of Modbus is two bytes, of which the second may be undocumented: what cannot be read is not on this firmware
HALF: dict[str, dict[str, Codes]] = {"block-silent": {}, "high-half": {}}
OLD: dict[str, dict[str, Codes]] = {"rtu-unpacked": {}, "no-late-frames": {}}


def rarer(wire: str, fault: str, row: Any) -> Codes:
    """A write may be hit whose fate the read-back tells, or the look at who is there, which then is not certain."""
    return {6, 7} if row.name in WRITES and fault not in ("refuse", "disconnect") else ()


FINGERS = ("little", "ring", "middle", "index", "thumb_bend", "thumb_rotation")
SPEEDS = {
    f"{name}.{finger}": 500
    for name in ("default_speed", "default_force", "force_limit", "speed_set")
    for finger in FINGERS
}
FORCE_REACHED = 3
CHANGED: dict[str, dict[str, float]] = {
    "fresh": {
        **SPEEDS, "default_force.thumb_rotation": 259, "force_limit.thumb_rotation": 259,
        **{f"stroke_set.{finger}": -1 for finger in FINGERS}, **{f"status.{finger}": 255 for finger in FINGERS},
    },
    "foreign": {f"angle_actual.{finger}": 3000 + n for n, finger in enumerate(FINGERS)},
    "faults": {
        "error.little": 1, "error.ring": 2, "error.middle": 4, "error.index": 6, "error.thumb_bend": 24,
        "status.little": 6, "status.ring": 7, "status.middle": 5, "status.index": 5, "status.thumb_bend": 7,
        "temperature.ring": 78, "temperature.index": 78,
    },
    "hot": {
        **{f"error.{finger}": 2 for finger in FINGERS}, **{f"status.{finger}": 7 for finger in FINGERS},
        **{f"temperature.{finger}": 71 + n for n, finger in enumerate(FINGERS)},
    },
    "locked-rotor": {"error.little": 1, "status.little": 6},
    "over-temperature": {"error.ring": 2, "status.ring": 7, "temperature.ring": 78},
    "over-current": {"error.middle": 4, "status.middle": 5},
    "motor-abnormal": {"error.thumb_bend": 8, "status.thumb_bend": 7},
    "communication": {"error.thumb_bend": 16, "status.thumb_bend": 7},
    "unknown-bits": {"error.index": 160},
}  # fmt: skip
OUTCOMES = Outcomes(
    rows=ROWS,
    wires={
        "eb90": Wire(SERIAL, {**DEVICE, **OLD, "save-fails": {"save": {6}}}, words=("--protocol", "eb90")),
        "rtu": Wire(SERIAL, {**DEVICE, **HALF, **OLD}, words=("--protocol", "modbus")),
        # no check sum and no id: a number that is wrong is warned of, junk hides where an answer begins
        "tcp": Wire(
            {**SERIAL, "wrong-id": RIGHT, "twin-id": RIGHT, "noise": {5}},
            {**DEVICE, **HALF, "txid-off": {}, "twin-ip": {}, "two-clients-drop": {}},
            "bus=modbus-tcp",
        ),
        "can": Wire(CAN, {**DEVICE, "block-silent": {key: {4} for key in WIDE}}, "bus=can"),
    },
    state="model=tp",
    variants={
        "after-1": Variant("after=1"),
        "after-3": Variant("after=3"),
        "every-2": Variant("every=2"),
        "deadline": Variant(
            words=("--deadline", "0.25", "--timeout", "1"),
            bound=0.27,
            stop=STOP,
            commands=("dump", "watch", "set", "angle-wait", "save"),
        ),
    },
    exceptions={
        **{("", "refuse", name): {6} for name in WRITES},
        # two hands with one id are named before what both would obey
        **{(wire, "twin-id", name): {6} for wire in ("eb90", "rtu") for name in ("save", "clear-errors")},
        # on CAN a collision destroys frames: what a look does not see is not written to
        **{("can", "twin-id", name): {4, 6} for name in WRITES},
        # the answer to function 06 is its question again: an echo that comes and goes cannot be known
        ("rtu", "echo", "save"): {0, 5},
        # the acknowledgement on CAN is the frame of the question again, too
        ("can", "echo", "save"): {0, 5},
        # an answer to the question before fits on this wire: the look at who is there may not be certain then
        **{("rtu", "stale", name): {0, 6} for name in WRITES},
    },
    rarer=rarer,
    # a finger that had met its force limit reports that it closes on its last counts, and then that it has arrived
    settles={**CLEARED, "angle-wait": lambda status: 1 if status == FORCE_REACHED else status},
    changed=CHANGED,
    # An RTU answer names no address, and answers that overlap may form a whole one: no frame shows that. Nor does a
    # connection show which of two hands with one IP address has taken it: `doctor` asks on two.
    # On CAN the answer to a write of 01 is the frame of the write: of what cannot be read back no echo is told.
    lacks=frozenset({"block-silent"}),
    untold=frozenset(
        {
            ("high-half", ""),
            ("twin-id", ""),
            ("twin-ip", ""),
            ("foreign", "dump"),
            ("blocked", "angle-wait"),
            ("wrong-id", "angle-wait"),  # how it moves on is a matter of 10 ms
            ("loopback", "save"),
        }
    ),
)
