"""What every fault of the simulator must give with every aidin command: exit codes."""

from __future__ import annotations

COMMANDS: dict[str, tuple[str, ...]] = {
    "status": ("status",), "get": ("get", "joint_pos.index"), "watch": ("watch", "--count", "3", "motor_pos"),
    "home": ("home", "--yes"), "initial": ("initial", "--yes"), "stop": ("stop",), "bias": ("bias",),
    "max-torque": ("max-torque", "800"), "encoders": ("encoders", "index.m3=85000"),
    "joints": ("joints", "index.q3=130", "thumb.q1=10"), "currents": ("currents", "index.m3=100", "--yes"),
}  # fmt: skip
READING = ("status", "get", "watch", "stop", "max-torque")
MOVING = ("initial", "encoders", "joints", "currents")
NOT_CARRIED_OUT = {**dict.fromkeys((*MOVING, "home", "bias"), 7), **dict.fromkeys(READING, 0)}
Allowed = dict[str, int | set[int]]


def every(code: int | set[int], **others: int | set[int]) -> Allowed:
    return {**dict.fromkeys(COMMANDS, code), **{name.replace("_", "-"): code for name, code in others.items()}}


FAULTS: dict[str, Allowed] = {
    "healthy": every(0), "noise": every(0), "split": every(0), "duplicate": every(0), "stale": every(0), "echo": every(0),
    "late": every(0), "extra-key": every(0), "unclosed": every(0),
    "silent": every(4), "disconnect": every(3),
    "deaf": {**NOT_CARRIED_OUT}, "refuse": {**NOT_CARRIED_OUT},
    "truncate": every(5), "bad-checksum": every(5), "not-json": every(5), "braces": every(5), "loopback": every(5),
    # a whole object takes seconds: enough to read, too old to move by
    "dribble": {**every(0), **{name: {4, 5} for name in MOVING}, "stop": {0, 5}, "bias": {0, 7}},
    "missing-key": every(0, status=5, stop=5, currents=5),
    "wrong-length": every(5, get=0, stop=0, max_torque=0, currents=0),
    "nan": every(0, status=5, get=5, bias=5, joints=5),
    "wrong-type": every(5, get=0, max_torque=0, joints=5),
    "degrees": every(0, joints=7),
    "swapped": every(0, encoders=7, joints=7, currents=7),
    "stuck": every(0, home=7, initial=7),
    "frozen": {**NOT_CARRIED_OUT},
    "blocked": every(0, home=7, initial=7, encoders=7, joints=7),
    "dead-motor": every(0, home=7, initial=7),
    "no-bias": every(0, bias=7),
    "weak": every(0, initial=7, joints=7),
    "touched": every(0),
}  # fmt: skip
