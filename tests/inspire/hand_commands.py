"""Every `handctl hand` command once, with the frames that it writes on a healthy simulated RH56DFTP in EB90.

Frames are the dossier's, or literal; nothing is computed by handctl.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from handctl.command import snapshots
from handctl.sim.hand import MODELS
from tests.support.inputs import made_once

FINGERS = ("little", "ring", "middle", "index", "thumb_bend", "thumb_rotation")
STORED = {f"default_speed.{finger}": 300 + number for number, finger in enumerate(FINGERS)}
"""What the snapshot file of these tests holds beside the forces of a healthy hand."""


@dataclass(frozen=True)
class Command:
    """One command line.

    kind     read, stream, raw, write, scan
    args     {dir} is a scratch directory of the test
    frames   the writing frames it sends, in order
    asks     whether a confirmation is needed
    """

    name: str
    kind: str
    args: tuple[str, ...]
    frames: tuple[str, ...] = ()
    asks: bool = False

    def words(self, scratch: Path) -> list[str]:
        """The words after `handctl hand`, with scratch files in place."""
        return [word.replace("{dir}", str(scratch)) for word in self.args]


SAVE = "EB 90 01 04 12 ED 03 01 08"
INDEX_300 = "EB 90 01 05 12 D4 05 2C 01 1E"
"""Dossier V9, V19."""
SPEED_300 = "EB 90 01 05 12 F8 05 2C 01 42"
READ_ANGLES = "EB 90 01 04 11 0A 06 0C 32"

READING = (
    Command("status", "read", ("status",)),
    Command("status-check", "read", ("status", "--check")),
    Command("dump", "read", ("dump",)),
    Command("get", "read", ("get", "angle_actual", "error.index")),
    Command("read", "read", ("read", "1546", "12")),
    Command("id", "read", ("id",)),
    Command("baud", "read", ("baud",)),
    Command("snapshot", "read", ("snapshot", "{dir}/new.json")),
    Command("diff", "read", ("diff", "{dir}/stored.json")),
    Command("watch", "stream", ("watch", "angle_actual", "--count", "3", "--rate", "0")),
    Command("raw-read", "raw", ("raw", READ_ANGLES, "--wait", "1")),
    Command("scan", "scan", ("scan", "--ids", "1-8")),
    Command("network", "read", ("network",)),
    Command("tactile", "read", ("tactile", "index_tip")),
    Command("pair", "read", ("pair",)),  # no person sees a hand move: nothing is sent
)
WRITING = (
    Command("set", "write", ("set", "speed_set.index=300"), (SPEED_300,), asks=True),
    Command("set-angle", "write", ("set", "angle_set.index=300"), (INDEX_300,), asks=True),
    Command("write", "write", ("write", "1528", "2C01"), (SPEED_300,), asks=True),
    Command("angle", "write", ("angle", "-1", "-1", "-1", "300", "-1", "-1"), (INDEX_300,), asks=True),
    Command(
        "angle-wait", "write", ("angle", "-1", "-1", "-1", "300", "-1", "-1", "--wait", "3"), (INDEX_300,), asks=True
    ),
    Command(
        "position",
        "write",
        ("position", "-1", "-1", "-1", "500", "-1", "-1"),
        ("EB 90 01 05 12 C8 05 F4 01 DA",),
        asks=True,
    ),
    Command("force", "write", ("force", "-1", "-1", "-1", "300", "-1", "-1"), ("EB 90 01 05 12 E0 05 2C 01 2A",)),
    Command("speed", "write", ("speed", "-1", "-1", "-1", "300", "-1", "-1"), (SPEED_300,)),
    Command("id-new", "write", ("id", "2"), ("EB 90 01 04 12 E8 03 02 04",), asks=True),
    Command("baud-new", "write", ("baud", "57600"), ("EB 90 01 04 12 EA 03 01 05",), asks=True),
    Command("baud-save", "write", ("baud", "57600", "--save"), ("EB 90 01 04 12 EA 03 01 05", SAVE), asks=True),
    Command(
        "network-new",
        "write",
        ("network", "192.168.11.211"),
        ("EB 90 01 07 12 A4 06 C0 A8 0B D3 0A", SAVE),
        asks=True,
    ),
    Command("clear-errors", "write", ("clear-errors",), ("EB 90 01 04 12 EC 03 01 07",)),
    Command("save", "write", ("save",), (SAVE,), asks=True),
    Command(
        "factory-reset",
        "write",
        ("factory-reset", "--backup", "{dir}/backup.json"),
        ("EB 90 01 04 12 EE 03 01 09",),
        asks=True,
    ),
    Command("calibrate", "write", ("calibrate",), ("EB 90 01 04 12 F1 03 01 0C",), asks=True),
    Command(
        "restore",
        "write",
        ("restore", "{dir}/stored.json"),
        ("EB 90 01 0F 12 08 04 2C 01 2D 01 2E 01 2F 01 30 01 31 01 4B",),
        asks=True,
    ),
    Command("raw-write", "raw", ("raw", INDEX_300, "--wait", "1"), (INDEX_300,), asks=True),
    *(
        Command(f"{name}-{model}", "write", (name, "--model", model), (frame,), asks=name != "clear-errors")
        for model in MODELS[:2]
        for name, frame in (("save", SAVE), ("clear-errors", "EB 90 01 04 12 EC 03 01 07"))
    ),
    Command(
        "raw-rtu", "raw", ("raw", "01 06 05 D4 01 2C C9 73", "--wait", "1"), ("01 06 05 D4 01 2C C9 73",), asks=True
    ),
)
COMMANDS = (*READING, *WRITING)


@made_once
def prepare(scratch: Path) -> None:
    """The input file of the commands: `stored.json` differs from a healthy hand in its default speeds."""
    values = {**STORED, **{f"default_force.{finger}": 501 + number for number, finger in enumerate(FINGERS)}}
    content = snapshots.make(
        "hand", {"kind": "hand", "id": 1, "model": "tp"}, dict(values), link="fake://hand", fake=True
    )
    snapshots.write(str(scratch / "stored.json"), content)
