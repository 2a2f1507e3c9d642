"""The RH56 hands, for the contract."""

from __future__ import annotations

from tests.contract.facts import Facts, Passed
from tests.contract.facts.inspire import inspire
from tests.fuzz.decoders import EB90_GOODS, EB90_LIKELY


def rh56(entry: Passed) -> bool:
    """Whether one of the frames in it is no read: of Modbus all but function 03, by RTU or TCP (rh56 §2.2, §2.3)."""
    data = entry.data
    if entry.can_id is None and len(data) == 8 and 1 <= data[0] <= 254 and data[1] == 3:
        return False
    if entry.can_id is None and data[2:6] == b"\0\0\0\x06" and data[7:8] == b"\x03":
        return False
    return inspire(entry)


SPEED = bytes.fromhex("EB 90 01 0F 12 F2 05")
"""A write to the six speeds (rh56 §6)."""
FACTS = Facts(
    writes={
        "set": "speed_set.index=300 force_limit.little=200",
        "restore": "{hand}",
        "write": "1528 2C01",
        "raw": "EB 90 01 05 12 D4 05 2C 01 1E",
        "id": "7",
        "baud": "57600 --save",
        "network": "192.168.11.211",
        "clear-errors": "",
        "save": "",
        "factory-reset": "--backup {dir}/b.json",
        "calibrate": "",
        "force": "200 -1 -1 300 -1 -1",
        "speed": "100 -1 -1 300 -1 -1",
        "angle": "500 600 700 800 900 400 --wait 5",
        "position": "-1 -1 -1 500 -1 -1 --wait 5",
        "stop": "",
    },
    rule=lambda command: rh56,
    goods=EB90_GOODS,
    likely=EB90_LIKELY,
    reads={
        "get": "angle_actual error.index",
        "read": "1546 12",
        "snapshot": "{dir}/new.json",
        "diff": "{hand}",
        "watch": "--count 2 --rate 0",
        "scan": "--ids 1-3",
        "tactile": "index_tip",
        "report": "{dir}/report.html --watch 0 --force",
        "log": "{dir}/log.csv --count 2 --force",
    },
    snapshot={"default_speed.index": 300, "default_speed.ring": 250, "default_force.little": 400},
    halts=dict.fromkeys(("angle", "position"), SPEED),
    unwatched=dict.fromkeys(("angle 500 600 700 800 900 400", "set angle_set.index=500", "write 1486 6400C800"), SPEED),
    plans=frozenset({"baud", "restore", "set", "force", "speed", "angle"}),
    lines=(
        ("report", "{dir}/report.html"),
        ("log", "{dir}/log.csv", "--count", "2", "--force"),
        ("describe",),
        ("raw", "EB 90 01 04 11 0A 06 0C 32"),
        ("stop",),
    ),
    looking=frozenset({("raw", "EB 90 01 04 11 0A 06 0C 32")}),
    rows_in="tests.inspire.hand_commands",
    states_in="tests.inspire.states",
)
