"""The exoskeleton hand under the faults of its simulator; exit codes by the contract, by hand."""

from __future__ import annotations

from typing import Any

from tests.contract.facts.outcomes import CLEARED, MOTOR_FAULTS, RIGHT, STOP, UNHEALTHY, Codes, Outcomes, Variant, Wire
from tests.inspire.exo_commands import COMMANDS, WRITING
from tests.support.cli import FINGERS

LINE: dict[str, Codes] = {
    # the reply is there, perhaps late, in pieces, twice or among other bytes
    **dict.fromkeys(("healthy", "noise", "garble", "dribble", "split", "duplicate", "stale", "late", "slow", "echo"), RIGHT),
    # nothing comes
    "silent": {4}, "deaf": {4},
    # bytes come, none of them a valid answer
    **{key: {5} for key in ("truncate", "bad-checksum", "wrong-id", "loopback", "twin-id")},
    "disconnect": {3},
    "refuse": RIGHT,
}  # fmt: skip
DEVICE: dict[str, dict[str, Codes]] = {
    "strict": {}, "block-silent": {}, "no-late-frames": {}, "blocked": {"move": {7}, "calibrate": {7}},
    "save-fails": {"save": {6}, "baud-save": {6}},
    "fresh": {"diff": {7}},
    "foreign": {key: {7} for key in ("status-check", "diff", "save", "baud-save", "factory-reset")},
    "baud-at-1002": {"baud-new": {7}, "baud-save": {7}},
    # an actuator that reports an error has not shown that it was calibrated
    "unknown-bits": {"status-check": {7}, "clear-errors": {7}, "calibrate": {7}},
    **{key: {**UNHEALTHY, "calibrate": {7}} for key in MOTOR_FAULTS},
}  # fmt: skip
ALONE = ("id-new", "baud-new", "baud-save", "save", "factory-reset")
FIXED = [command.name for command in COMMANDS if command.fixed_registers]


def rarer(wire: str, fault: str, row: Any) -> Codes:
    """A write may be hit whose fate the read-back then tells; an id that answered once and then not again is not counted."""
    if row.kind == "scan":
        return {4}
    if row.kind != "write" or fault in ("refuse", "disconnect"):
        return ()
    return {6, 7} if fault == "twin-id" and row.name in ALONE else {7}


OUTCOMES = Outcomes(
    rows=COMMANDS,
    wires={"serial": Wire(LINE, DEVICE)},
    variants={
        "after-1": Variant("after=1"),
        "every-2": Variant("every=2"),
        # a reply that is 0.6 s late may count as silence, and never as anything else
        "plain": Variant(words=(), more={"late": {4}}),
        "deadline": Variant(words=("--deadline", "0.25", "--timeout", "1"), bound=0.26, stop=STOP),
        **{f"two-{seed}": Variant(f"fault=echo,noise,split&seed={seed}", {}, {"healthy"}) for seed in range(6)},
    },
    exceptions={
        # every acknowledged write is refused; force and position commands have no acknowledgement (exo §2.2.1)
        **{("", "refuse", command.name): {6} for command in WRITING if command.kind in ("write", "raw")},
        # their effect is not seen, either
        ("", "refuse", "move"): {7},
        # two hands with one id: replies that do not jitter overlap to perfect frames (dossier 4.14)
        **{("", "twin-id", name): RIGHT for name in (*FIXED, "raw-write")},
        # ... and are named before what both would obey and neither would undo
        **{("", "twin-id", name): {6} for name in ALONE},
        # a scan may name the suspicion beside the hand, or find no valid answer
        ("", "twin-id", "scan"): {0, 5},
    },
    rarer=rarer,
    settles=CLEARED,
    changed={
        "fresh": {f"position_set.{finger}": -1 for finger in FINGERS},
        "foreign": {"system_voltage": 0, **{f"position_set.{f}": 3000 + n for n, f in enumerate(FINGERS)}},
        "faults": {
            **{f"error.{f}": bits for f, bits in zip(FINGERS, (1, 2, 4, 6, 24), strict=True)},
            "temperature.ring": 78, "temperature.index": 78,
        },
        "hot": {
            **{f"error.{f}": 2 for f in FINGERS}, **{f"temperature.{f}": 71 + n for n, f in enumerate(FINGERS)},
        },
        "locked-rotor": {"error.little": 1},
        "over-temperature": {"error.ring": 2, "temperature.ring": 78},
        "over-current": {"error.middle": 4},
        "motor-abnormal": {"error.thumb": 8},
        "communication": {"error.thumb": 16},
        "unknown-bits": {"error.index": 160},
    },
    untold=frozenset({
        ("blocked", "calibrate"), ("blocked", "move"), ("blocked", "clear-errors"),
        *(("refuse", name) for name in ("force", "position", "move")), ("twin-id", "scan"),
    }),
)  # fmt: skip
