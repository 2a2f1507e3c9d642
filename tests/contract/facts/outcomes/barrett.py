"""The BarrettHand under the faults of its simulator; exit codes by the contract, by hand."""

from __future__ import annotations

from typing import Any

from tests.barrett.commands import COMMANDS, MOTORS, MOVING, SETTING
from tests.contract.facts.outcomes import RIGHT, Codes, Outcomes, Variant, Wire

LINE: dict[str, Codes] = {
    # the answer is there, perhaps late, in pieces or behind an older one; GCL has no ids
    **dict.fromkeys(("healthy", "garble", "dribble", "split", "stale", "late", "slow", "wrong-id", "twin-id", "refuse"), RIGHT),
    "silent": {4}, "deaf": {4},
    "bad-checksum": {5}, "loopback": {5},
    "truncate": {0, 5},  # an answer that lost no more than the space of its prompt is whole; by luck at the third time
    "disconnect": {3},
    # Junk bytes, every character twice: the echo differs (5), or is there all the same. Bytes that a line sends back
    # before the hand does look like its echo, and the hand's own echo like an answer.
    **{key: {0, 5} for key in ("noise", "duplicate", "echo")},
}  # fmt: skip
NAMES = [command.name for command in COMMANDS]
STALLS: dict[str, Codes] = {"gcl-move": {6}, **{key: {7} for key in ("close", "move", "move-default", "step-close")}}
"""M, HOME, IC and IO report 16 when they do not arrive (§5.5); O, C, TC and TO never do: where they are tells."""
MOVES = [command.name for command in MOVING if command.name != "stop"]
NO_MOTOR_COMMAND = ("get-hand", "version", "help", "baud-show", "set-hand", "baud", "baud-save", "reset")
"""All others begin with a motor command; FGET and FSET are motor commands too (§5.4.1, sim notes)."""
CHECK: dict[str, Codes] = {"status-check": {7}}
DEVICE: dict[str, dict[str, Codes]] = {
    "no-echo": {key: {5} for key in NAMES},  # who does not echo has not shown that it is a BarrettHand: nothing is written
    **{name: {} for name in ("no-abort", "strain", "strain-offset", "no-gauges", "breakaway", "eeprom-worn")},
    "obstacle": {"close": {7}},
    "blocked": STALLS, "reversed": STALLS,
    "hot": CHECK, "unknown-codes": CHECK,
    "over-temperature": {key: {6} for key in [name for name in NAMES if name not in NO_MOTOR_COMMAND]},
    "not-homed": {**CHECK, **{key: {6} for key in [name for name in MOVES if name != "init"]}},
    "no-board": {**CHECK, **{key: {6} for key in [n for n in MOVES if n not in ("home", "torque-open", "gcl-move")]}},
    "no-motor": {**CHECK, **{key: {6} for key in [n for n in MOVES if n not in ("home", "torque-open", "gcl-move", "move")]}},
    "hang": {key: {4, 5} for key in NAMES},  # the echo came and then nothing ever again
    # commands that are unknown now and then; values with a wrong bit, some of them out of any range
    "erratic": {key: {0, 2, 5, 6, 7} for key in NAMES},
}  # fmt: skip
ALIKE = ("status", "status-check", "get", "get-hand", "baud-show", "baud-save", "version", "set-all", "defaults", "diff",
         "step-open", "step-close", "home", "torque-open", "open", "move-default", "gcl-move", "gcl-save")  # fmt: skip
"""Commands that exchange what another one does: faults that befall only some requests are not tried again."""
SOME = [name for name in NAMES if name not in ALIKE]
HARMFUL = [name for name, codes in LINE.items() if codes != RIGHT or name in ("stale", "late", "refuse")]


def rarer(wire: str, fault: str, row: Any) -> Codes:
    """Which of a command's exchanges is hit decides: its echo, its prompt, or one after which it finds the hand again."""
    lost = {4, 5} if fault in ("silent", "deaf", "truncate", "bad-checksum") else set()
    return {*lost, *({7} if row.kind in ("write", "baud", "move") else ())}


def each(name: str, *values: float) -> dict[str, float]:
    """A value for each motor."""
    return {f"{name}.{motor}": value for motor, value in zip(MOTORS, values, strict=True)}


OUTCOMES = Outcomes(
    rows=COMMANDS,
    wires={"serial": Wire(LINE, DEVICE)},
    state="initialized=1",
    variants={
        "after-2": Variant("after=2", faults=HARMFUL, commands=SOME),
        "every-3": Variant("every=3", faults=HARMFUL, commands=SOME),
        "deadline": Variant(
            words=("--deadline", "0.4", "--timeout", "1"), bound=0.4 + 1.6,  # and the ^C that stops what moves, to its prompt
            commands=("dump", "status", "watch", "restore", "close", "baud", "reset", "gcl-read"),
        ),
    },
    exceptions={
        **{("", "refuse", one.name): {6} for one in SETTING if one.name not in ("reset", "baud", "baud-save")},
        # PSET BAUD answers after the switch-over: what became of it is told by the speed and the read-back
        **{("", "refuse", name): {3, 6, 7} for name in ("baud", "baud-save")},
        ("", "no-echo", "gcl-save"): {4, 5},  # nothing at all comes within the second that an echo may take (dossier 1.3)
        ("", "over-temperature", "baud-save"): {0, 6},  # to keep the count of saves the motors' settings are read
    },
    rarer=rarer,
    changed={
        "strain": {"strain.F2": 221},
        "strain-offset": {"strain.F3": 188},
        "no-gauges": each("strain", 255, 255, 255, 255),
        "hot": {"temperature": 702, "peak_temperature": 702},
        "over-temperature": {"temperature": 702, "peak_temperature": 702, "over_temperature_limit": 600},
        "not-homed": each("status", 4, 4, 4, 4),
        "no-board": {"status.F2": 1},
        "no-motor": {"status.F3": 2},
        "unknown-codes": {"status.F3": 520},
    },
    # What P counts after a movement is not the manual's to say: of a motor that slips, is missing, pressed or turns wrongly.
    untold=frozenset({
        *((fault, name) for fault in ("breakaway", "reversed", "no-board", "no-motor", "not-homed", "obstacle", "blocked") for name in MOVES),
        ("erratic", ""),
    }),
    timed=("uptime",),
    erratic=frozenset({"erratic", "stale"}),
    again=frozenset({"stop"}),  # T takes power away, however often it comes
    seconds=150.0,
)  # fmt: skip
