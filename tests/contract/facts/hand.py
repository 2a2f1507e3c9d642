"""The RH56 hands, for the contract."""

from __future__ import annotations

from typing import Any

from tests.contract.facts import Facts, Faulty, Passed, Silent, Waiting
from tests.contract.facts.inspire import ERRORS, inspire, put
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
OPEN = b"\xe8\x03" * 6


def _write(place: int, data: bytes) -> bytes:
    inner = bytes([1, len(data) + 3, 0x12]) + place.to_bytes(2, "little") + data
    return b"\xeb\x90" + inner + bytes([sum(inner) % 256])


def _told(*steps: bytes | float) -> Any:
    """Frames that somebody sent, and seconds that passed."""

    def play(line: Any) -> None:
        now = 0.5
        line.advance(now)
        for step in steps:
            if isinstance(step, bytes):
                line.feed(step)
                now += 0.05
            else:
                now += step
            line.advance(now)

    return play


def _angles(line: Any) -> list[float]:
    return [finger.angle for finger in line.device.hand.body.fingers]


STOPPED = _told(_write(1522, bytes(12)), _write(1486, OPEN), 1.0)
GRIPS = _told(_write(1522, b"\x14\x00" * 6), _write(1498, b"\x64\x00" * 6), _write(1486, bytes(12)), 60.0)
WAITING = (
    Waiting(
        "told to open at speed 0", ("speed_set",),
        ("speed 300 300 300 300 300 300", "speed index=300", "set speed_set.index=300"), STOPPED, _angles,
    ),
    Waiting(
        "grips something up to its force limit", ("force_limit",),
        ("force 900 900 900 900 900 900", "force index=900", "set force_limit.index=900", "speed index=300"), GRIPS, _angles, {"object": "100"}, goes=False,
    ),
    Waiting(
        "has an error on its way", ("clear_errors",), ("clear-errors", "speed index=300", "set speed_set.index=300"), _told(_write(1486, OPEN), 1.0), _angles,
        {"fault": "faults"}, 1000.0, goes=False,
    ),
)  # fmt: skip


def _put(line: Any, bits: int) -> None:
    put(line.device.hand.body.fingers[3], bits)
    line.device.hand.publish()


FAULTY = tuple(
    Faulty(
        f"angle {target} --wait 5 -y{words}", f"error.{target.partition('=')[0]}", ERRORS, lambda line: line.device.hand.body.fingers[3].angle,
        float(target.partition("=")[2]), _put, options, refused=True,
    )
    for options, target, words in (
        ("", "index=900", ""), ("", "index=900", " --protocol modbus"), ("bus=modbus-tcp", "index=900", ""),
        ("bus=can", "index=900", ""), ("model=tp", "index=900", ""), ("model=f1", "index=1400", " --model f1"),
        ("model=f1", "index=1400", " --model f1 --protocol modbus"), ("model=dg2", "m4=1500", " --model dg2"),
        ("model=dg2", "m4=1500", " --model dg2 --protocol modbus"),
    )
)  # fmt: skip
FACTS = Facts(
    faulty=FAULTY,
    silent=(
        Silent(
            seconds=11.3,
            why="EB90 and Modbus RTU, in each of them bytes, the words of F1 and those of DG2, then the search for late replies and for another baud rate: 4.5 s",
        ),
        Silent(words=("--protocol", "modbus"), seconds=3.5, why="bytes, the words of F1 and those of DG2"),
        Silent(
            "bus=modbus-tcp",
            seconds=2.6,
            why="0.5 s for each reply, and two questions more, since a firmware may lack one register",
        ),
        Silent("bus=can"),
    ),
    places=_angles,
    waiting=WAITING,
    writes={
        "set": "speed_set.index=0 force_limit.little=200",
        "restore": "{hand}",
        "write": "1528 2C01",
        "raw": "EB 90 01 05 12 D4 05 2C 01 1E",
        "terminal": "EB§90§01§05§12§D4§05§2C§01§1E",
        "id": "7",
        "baud": "57600 --save",
        "network": "192.168.11.211",
        "clear-errors": "",
        "save": "",
        "factory-reset": "--backup {dir}/b.json",
        "calibrate": "",
        "force": "200 -1 -1 300 -1 -1",
        "speed": "0 -1 -1 0 -1 -1",
        "angle": "500 600 700 800 900 400 --wait 5",
        "position": "-1 -1 -1 500 -1 -1 --wait 5",
        "stop": "",
    },
    rule=lambda command: rh56,
    goods=EB90_GOODS,
    likely=EB90_LIKELY,
    reads={
        "listen": "--duration 1",
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
