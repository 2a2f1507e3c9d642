"""The AIDIN-hand under the faults of its simulator; exit codes by the contract, by hand."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from tests.contract.facts.outcomes import RIGHT, Codes, Outcomes, Variant, Wire


class Row(NamedTuple):
    """One command line."""

    name: str
    kind: str
    args: tuple[str, ...]
    asks: bool = False


ROWS = (
    Row("status", "read", ("status",)),
    Row("get", "read", ("get", "joint_pos.index")),
    Row("watch", "stream", ("watch", "--count", "3", "motor_pos")),
    Row("home", "move", ("home",), asks=True),
    Row("initial", "move", ("initial",), asks=True),
    Row("stop", "command", ("stop",)),
    Row("bias", "command", ("bias",)),
    Row("max-torque", "command", ("max-torque", "800"), asks=True),
    Row("encoders", "move", ("encoders", "index.m3=85000")),
    Row("joints", "move", ("joints", "index.q3=130", "thumb.q1=10")),
    Row("currents", "move", ("currents", "index.m3=100"), asks=True),
)
NAMES = tuple(row.name for row in ROWS)
READING = ("status", "get", "watch", "stop", "max-torque")
MOVING = ("initial", "encoders", "joints", "currents")
NOT_DONE: dict[str, Codes] = {key: {7} for key in (*MOVING, "home", "bias")}


def every(code: int, **others: int) -> dict[str, Codes]:
    """One exit code for all commands but these."""
    named = {name.replace("_", "-"): {other} for name, other in others.items()}
    return {**{key: {code} for key in NAMES}, **named}


LINE: dict[str, Codes] = {
    **dict.fromkeys(("healthy", "noise", "split", "duplicate", "stale", "echo", "late", "dribble", "deaf", "refuse"), RIGHT),
    **dict.fromkeys(("garble", "slow", "twin-id", "wrong-id"), RIGHT),
    "silent": {4}, "disconnect": {3},
    **{key: {5} for key in ("truncate", "bad-checksum", "loopback")},
}  # fmt: skip
DEVICE: dict[str, dict[str, Codes]] = {
    "extra-key": {}, "no-homing": {}, "unclosed": {}, "touched": {}, "stiff": {}, "shaky-sensor": {},
    "not-json": every(5), "braces": every(5),
    "missing-key": every(0, stop=5, currents=5),
    # the motor positions are refused: nothing shows that the hand stands behind its stop
    "wrong-length": every(5, get=0, max_torque=0, currents=0),
    "nan": every(0, status=5, get=5, bias=5, joints=5),
    "wrong-type": every(5, get=0, max_torque=0, joints=5),
    "degrees": every(0, joints=7),
    # fingers that were not named went away from where they were: somebody else may be commanding it
    "swapped": every(0, encoders=6, joints=6, currents=7),
    "stuck": every(0, home=7, initial=7),
    "frozen": NOT_DONE,
    "blocked": every(0, home=7, initial=7, encoders=7, joints=7),
    "dead-motor": every(0, home=7, initial=7),
    "no-bias": every(0, bias=7),
    "weak": every(0, home=7, initial=7, joints=7),
    **dict.fromkeys(("held", "stall"), every(0, home=7)),
    "numb-sensor": every(0, bias=7),
    "one-way": every(0, home=7, initial=7),
    "creep": every(0, home=7, bias=7, stop=6),  # its encoder goes on: nothing tells it from a motor that does
}  # fmt: skip
MADE = (
    *("rate=10", "rate=500", "merge=5", "chunk=100", "between=none", "between=nul", "between=crlf", "layout=indented"),
    *("digits=17", "integers=1", "objects=separate", "reader=lines", "reader=naive", "homing=latched"),
    *("neutral=interrupts", "noise=1", "drift=10000", "q4=half", "q4=zero", "limits=obey"),
)
"""What the manual leaves open and must not matter (dossier 5)."""
OTHER_ANGLES = ("q4=half", "q4=zero", "digits=17")
MODES = {"home": {1}, "initial": {2}, "stop": {3}, "bias": {4}, "max-torque": {5}, "encoders": {10}, "joints": {22},
         "currents": {5, 41, 3}}  # fmt: skip
POLLED = (
    "healthy",
    "silent",
    "disconnect",
    "noise",
    "split",
    "echo",
    "loopback",
    "truncate",
    "late",
    "nan",
    "not-json",
)
"""Faults that an exchange of questions and answers meets differently."""


def also(cell: Any) -> None:
    """Whole objects with the modes of the command, and between those of homing nothing, not even the neutral one."""
    asked = [entry.data for entry in cell.passed if entry.mark == ">"]
    assert all(data.endswith(b"}\n") and len(data) <= 2047 for data in asked), cell
    objects = [json.loads(data) for data in asked]
    modes = {one["hand_mode"] for one in objects if one}
    assert modes <= MODES.get(cell.row.name, set()) | ({3} if cell.result.code else set()), (modes, cell)
    if cell.row.name == "home":
        places = [place for place, one in enumerate(objects) if one.get("hand_mode") == 1]
        assert not places or places == list(range(places[0], places[-1] + 1)), cell


OUTCOMES = Outcomes(
    rows=ROWS,
    wires={"tcp": Wire(LINE, DEVICE)},
    state="start=homed&rate=25",  # a slower stream costs less
    words=(),
    variants={
        **{option: Variant(option, {}, {"healthy"}, ("joints",)) for option in MADE},
        **{f"poll {option}": Variant(f"{option}&exchange=poll", {}, {"healthy"}, ("get",)) for option in MADE if option not in OTHER_ANGLES},
        "poll": Variant("exchange=poll", {**LINE, "nan": {5}, "not-json": {5}}, POLLED, ("status", "joints")),
        "mute": Variant("exchange=mute", {"healthy": {4}}, {"healthy"}),
        # nothing shows who is there: only the stop goes out
        "command": Variant("exchange=command", {"healthy": {4}}, {"healthy"}, [name for name in NAMES if name != "stop"]),
        "stop alone": Variant("exchange=command", {}, {"healthy"}, ("stop",)),
        "deadline": Variant("", {key: {0, 4, 5} for key in LINE}, ("healthy", "silent", "dribble", "noise", "truncate"),
                            ("status", "joints", "bias"), words=("--deadline", "0.4"), bound=0.601),  # and the stop that follows
    },
    exceptions={
        **{("", fault, name): codes for fault in ("deaf", "refuse") for name, codes in NOT_DONE.items()},
        # a whole object takes seconds: enough to read, too old to move by
        **{("", "dribble", name): {4, 5} for name in MOVING}, ("", "dribble", "stop"): {0, 5}, ("", "dribble", "bias"): {0, 7}, ("", "dribble", "home"): {0, 7},
    },
    lacks=frozenset({"missing-key"}),
    untold=frozenset({
        *((fault, "") for fault in ("degrees", "swapped", "stuck", "frozen", "creep", "nan", "wrong-type", "shaky-sensor")),
        *((fault, name) for fault in ("deaf", "refuse") for name in ("stop", "max-torque")),
        *(("", name) for name in ("home", "initial", "joints", "encoders", "currents")),
    }),
    changed={
        "numb-sensor": {"sensor_state.middle.fy": -0.01},
        "touched": {
            f"sensor_state.index.{axis}": value
            for axis, value in {"fx": 1.523, "fy": -2.512, "fz": 4.89, "tx": 0.01545, "ty": -0.02523, "tz": 0.03512}.items()
        }
    },
    again=frozenset(NAMES),
    also=also,
    seconds=30.0,
)  # fmt: skip
