"""The wrist module under the faults of its simulator, on both wires; exit codes by the contract, by hand."""

from __future__ import annotations

from typing import Any

from tests.contract.facts.outcomes import MOTOR_FAULTS, RIGHT, STOP, UNHEALTHY, Codes, Outcomes, Variant, Wire
from tests.inspire.wrist_commands import COMMANDS, READING, WRITING

SERIAL: dict[str, Codes] = {
    # the reply is there, perhaps late, in pieces, twice or among other bytes
    **dict.fromkeys(("healthy", "noise", "garble", "dribble", "split", "duplicate", "stale", "late", "slow", "echo"), RIGHT),
    # nothing comes
    "silent": {4}, "deaf": {4},
    # bytes come, none of them a valid answer
    **{key: {5} for key in ("truncate", "bad-checksum", "wrong-id", "loopback", "twin-id")},
    "disconnect": {3},
    "refuse": RIGHT,
}  # fmt: skip
CAN: dict[str, Codes] = {
    # the reply is there, perhaps late, twice, or among frames of others
    **dict.fromkeys(("healthy", "noise", "duplicate", "stale", "late", "slow", "echo"), RIGHT),
    # no frame comes: lost, destroyed on the bus, or never acknowledged
    **{key: {4} for key in ("silent", "deaf", "twin-id", "no-ack")},
    # frames come, none of them a valid answer
    **{key: {5} for key in ("truncate", "wrong-id", "loopback")},
    # the link is gone: its adapter, or the controller of it
    "disconnect": {3}, "bus-off": {3},
    "refuse": RIGHT,
}  # fmt: skip
MOVES: dict[str, Codes] = {command.name: {7} for command in WRITING if command.kind == "move"}
DEVICE: dict[str, dict[str, Codes]] = {
    "strict": {}, "block-silent": {"read": {4}}, "save-fails": {},
    "blocked": MOVES,
    "foreign": {**UNHEALTHY, **MOVES},
    # a hand without a wrist is read in its own space only, and is named by all that asks for its wrist
    "no-wrist": {
        # ... but by raw: that sends what was typed and nothing else, and here nobody replies to it
        **{command.name: {0} if command.kind == "hand" else {4} if command.kind in ("scan", "raw") else {6} for command in READING},
        **{command.name: {6} for command in WRITING},
    },
    **{key: dict(UNHEALTHY) for key in ("unknown-bits", *MOTOR_FAULTS)},
}  # fmt: skip


def rarer(wire: str, fault: str, row: Any) -> Codes:
    """A write may be hit whose fate the read-back then tells; an id that answered once and then not again is not counted."""
    if row.kind == "scan":
        return {4, 5}
    if (wire, fault, row.kind) == ("can", "refuse", "move"):
        return {7}  # the stop is obeyed where only the write was not
    return {7} if row in WRITING and row.kind != "raw" and fault not in ("refuse", "disconnect") else ()


OUTCOMES = Outcomes(
    rows=COMMANDS,
    wires={"serial": Wire(SERIAL, {**DEVICE, "no-late-frames": {}}), "can": Wire(CAN, DEVICE, "bus=can")},
    variants={
        "after-1": Variant("after=1"),
        "every-2": Variant("every=2"),
        "deadline": Variant(words=("--deadline", "0.25", "--timeout", "1"), bound=0.26, stop=STOP),
        "two": Variant("fault=echo,noise,split", {}, {"healthy"}, wires={"serial"}),
        # frames of others, many of them with the same flag and address, beside every answer, and 500 a second besides
        "busy": Variant("fault=noise,echo&traffic=500", {}, {"healthy"}, wires={"can"}),
        # seen on the sibling: DLC 1, the number of bytes written; 0 bytes is a refusal (dossier W11)
        "counted": Variant("ack-dlc=1", {"refuse": {6}}, {"healthy", "refuse"}, [one.name for one in WRITING], {"can"}),
    },
    exceptions={
        # the serial acknowledgement tells a refusal; CAN's is empty (wrist §2.3.2), so that only the read-back tells it
        **{("serial", "refuse", command.name): {6} for command in WRITING},
        **{("can", "refuse", command.name): {7} for command in WRITING},
        # ... and of what moves the stop as well, which is then not obeyed
        **{("can", "refuse", name): {6} for name in MOVES},
        ("can", "refuse", "raw-write"): RIGHT,  # shows the acknowledgement and reads nothing back
        # the yaw, which is not named, is off its set angle and might go there: that is asked first
        ("", "foreign", "move-pitch"): {8},
        # two devices with one id: replies that do not jitter overlap to perfect ones (dossier 4.14); before a write the
        # pitch is read, which jitters
        **{("", "twin-id", command.name): RIGHT for command in READING if command.steady},
        # on CAN the collision destroys the wrist's frames, while its hand's, which do not jitter, come whole: a hand alone
        **{("can", "twin-id", command.name): {6} for command in WRITING},
        **{("can", "twin-id", name): {6} for name in ("status", "status-check", "dump", "get", "read", "watch")},
        # ... and on serial the readings of its hand tell two, before what both would obey
        ("serial", "twin-id", "hand-write"): {6},
        # a scan may name the suspicion beside the wrist, or find no valid answer
        ("serial", "twin-id", "scan"): {0, 5},
        # undocumented bytes are asked for by number, or with an error byte: on CAN a read has two bytes (dossier 4.12)
        **{("can", "block-silent", name): {0, 4} for name in ("status", "status-check", "dump", "get")},
    },
    rarer=rarer,
    changed={
        "foreign": {"pitch_actual": 30.0, "yaw_actual": 30.01},
        "faults": {"error_1": 1, "error_2": 4},
        "hot": {"error_1": 2, "error_2": 2, "temperature_1": 71, "temperature_2": 72},
        "locked-rotor": {"error_1": 1},
        "over-temperature": {"error_2": 2, "temperature_2": 78},
        "over-current": {"error_1": 4},
        "motor-abnormal": {"error_2": 8},
        "communication": {"error_1": 16},
        "unknown-bits": {"error_2": 160},
    },
    untold=frozenset({("refuse", "raw-write"), ("twin-id", "")}),
    seconds=60.0,
)
