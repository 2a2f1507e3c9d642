"""The exoskeleton hand, for the contract."""

from __future__ import annotations

from typing import Any

from tests.contract.facts import Facts, Faulty, Silent, Waiting
from tests.contract.facts.inspire import ERRORS, inspire, put
from tests.fuzz.decoders import EB90_GOODS, EB90_LIKELY

HOLD = bytes.fromhex("EB 90 01 0B 32")
"""A position command (exo §2.2.2)."""


def _places(line: Any) -> list[float]:
    return [finger.position for finger in line.device.hand.fingers]


# fmt: off
FAULTY = (
    Faulty(
        "position ring=900 --wait 5 -y", "error.ring", ERRORS, lambda line: line.device.hand.fingers[1].position, 900,
        lambda line, bits: put(line.device.hand.fingers[1], bits),
    ),
)
# fmt: on
WAITING = Waiting(
    "has errors on its way",
    ("clear_errors",),
    ("clear-errors",),
    lambda line: line.advance(1.0),
    _places,
    {"fault": "faults"},
    goes=False,
)
FACTS = Facts(
    silent=(Silent(seconds=5.8, why="then the search for late replies and for another baud rate: 4.5 s"),),
    places=_places,
    waiting=(WAITING,),
    faulty=FAULTY,
    writes={
        "set": "position_set.index=300 force_set.thumb=-20",
        "restore": "{exo} --setpoints",
        "write": "1492 2C01",
        "raw": "EB 90 01 05 12 D4 05 2C 01 1E",
        "terminal": "EB§90§01§05§12§D4§05§2C§01§1E",
        "id": "7",
        "baud": "57600 --save",
        "clear-errors": "",
        "save": "",
        "factory-reset": "--undocumented-address --backup {dir}/b.json",
        "calibrate": "",
        "force": "10 20 30 -40 50",
        "position": "100 200 300 400 500 --wait 2",
        "stop": "",
    },
    rule=lambda command: inspire,
    goods=EB90_GOODS,
    likely=EB90_LIKELY,
    reads={
        "listen": "--duration 1",
        "get": "system_voltage error.index",
        "read": "1546 12",
        "snapshot": "{dir}/new.json",
        "diff": "{exo} --setpoints",
        "watch": "--count 2 --rate 0",
        "scan": "--ids 1-3",
        "report": "{dir}/report.html --watch 0 --force",
        "log": "{dir}/log.csv --count 2 --force",
    },
    snapshot={"position_set.index": 300, "position_set.ring": 250, "force_set.little": 5},
    halts={"position": HOLD},
    unwatched={
        "position 100 200 300 400 500": HOLD,
        "force 101 102 103 104 105": HOLD,
        "set position_set.index=100": HOLD,
        "write 1486 6400C800": HOLD,
        "restore {dir}/exo.json --setpoints": HOLD,
    },
    plans=frozenset(["baud", "restore", "set"]),
    lines=(
        ("report", "{dir}/report.html"),
        ("log", "{dir}/log.csv", "--count", "2", "--force"),
        ("describe",),
        ("raw", "EB 90 01 04 11 C0 05 02 DD"),
        ("stop",),
    ),
    looking=frozenset({("raw", "EB 90 01 04 11 C0 05 02 DD")}),
    rows_in="tests.inspire.exo_commands",
    states_in="tests.inspire.states",
)
