"""The wrist module, for the contract."""

from __future__ import annotations

from tests.contract.facts import Facts, Faulty, Silent
from tests.contract.facts.inspire import ERRORS, inspire, put
from tests.fuzz.decoders import EB90_GOODS, EB90_LIKELY

STAY = bytes.fromhex("EB 90 01 07 31 0E 04")
"""A write to both angles (wrist §2.1)."""
FAULTY = tuple(
    Faulty(
        f"move --{axis} 5 --time 300",
        f"error_{number}",
        ERRORS,
        lambda line, at=at: line.device.body.angles[at],
        500,
        lambda line, bits, at=number - 1: put(line.device.body.actuators[at], bits),
        wire,
    )
    for wire in ("", "bus=can")
    for at, axis in enumerate(("pitch", "yaw"))
    for number in (1, 2)  # which of them moves which axis is not documented
)
FACTS = Facts(
    faulty=FAULTY,
    silent=(Silent(), Silent("bus=can")),
    places=lambda line: list(line.device.body.angles),
    nothing_waits="its set-points act when they are written: it has no speed, no limit and no command that clears errors (wrist §2.1)",
    writes={
        "set": "pitch_set=5 yaw_set=3 move_time=500",
        "restore": "{wrist} --setpoints",
        "move": "--pitch 5 --yaw -5 --time 300",
        "center": "",
        "write": "1038 0500",
        "hand-write": "1486 2C01",
        "raw": "EB 90 01 05 31 0E 04 05 00 4E",
        "terminal": "EB§90§01§05§31§0E§04§05§00§4E",
        "stop": "",
    },
    rule=lambda command: inspire,
    goods=EB90_GOODS,
    likely=EB90_LIKELY,
    reads={
        "listen": "--duration 1",
        "get": "pitch_actual",
        "read": "1018 2",
        "hand-read": "1000 1",
        "snapshot": "{dir}/new.json",
        "diff": "{wrist} --setpoints",
        "watch": "--count 2 --rate 0",
        "scan": "--ids 1-3",
        "report": "{dir}/report.html --watch 0 --force",
        "log": "{dir}/log.csv --count 2 --force",
    },
    snapshot={"pitch_set": 5.0, "yaw_set": 3.0, "move_time": 400},
    halts=dict.fromkeys(("move", "center"), STAY),
    unwatched=dict.fromkeys(("set yaw_set=20", "write 1038 D007", "restore {dir}/wrist.json --setpoints"), STAY),
    plans=frozenset(["restore", "set"]),
    lines=(
        ("report", "{dir}/report.html"),
        ("log", "{dir}/log.csv", "--count", "2", "--force"),
        ("describe",),
        ("stop",),
    ),
    rows_in="tests.inspire.wrist_commands",
    states_in="tests.inspire.states",
)
