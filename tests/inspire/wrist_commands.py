"""Every `handctl wrist` command once, on both wires: what it shows on a healthy wrist, what it sends, what it leaves.

Frames are literal for both wires; values are the simulated module's power-on values and the arguments given here;
nothing is computed by handctl.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handctl.command import snapshots
from tests.support.cli import Spy, s16
from tests.support.inputs import made_once

Truth = dict[str, float]
"""Values by name, degrees as degrees."""

WIRES = ("serial", "can")
ON = {"serial": "--serial", "can": "--can"}

# What the simulated wrist shows at power-on (dossier, simulator notes): name -> (address, value, its bytes, unit).
POWER_ON: dict[str, tuple[int, float, str, str | None]] = {
    "pitch_actual": (1020, -3.45, "A7 FE", "°"),
    "yaw_actual": (1022, 11.25, "65 04", "°"),
    "current_1024": (1024, 111, "6F 00", "mA"),
    "current_1026": (1026, 222, "DE 00", "mA"),
    "error_1": (1028, 0, "00", None),
    "error_2": (1030, 0, "00", None),
    "temperature_1": (1032, 31, "1F", "°C"),
    "temperature_2": (1033, 34, "22", "°C"),
    "yaw_set": (1038, 11.0, "4C 04", "°"),
    "pitch_set": (1040, -3.0, "D4 FE", "°"),
    "move_time": (1042, 700, "BC 02", "ms"),
}
SETTINGS = ("yaw_set", "pitch_set", "move_time")
LIVE = ("pitch_actual", "yaw_actual", "current_1024", "current_1026", "error_1", "error_2", "temperature_1",
        "temperature_2")  # fmt: skip
STORED: Truth = {"yaw_set": 12.34, "pitch_set": -3.0, "move_time": 1500}
"""What the snapshot file of these tests holds: yaw and time differ from a healthy wrist, pitch does not."""


def power_on_truth() -> Truth:
    """Every documented value at power-on."""
    return {name: value for name, (_, value, _, _) in POWER_ON.items()}


def names(*wanted: str) -> Callable[[Truth], Truth]:
    """The true values of these registers."""
    return lambda truth: {name: truth[name] for name in wanted}


def fixed(**values: float) -> Callable[[Truth], Truth]:
    """Values that do not depend on the wrist's state."""
    return lambda _truth: dict(values)


def nothing(_truth: Truth) -> Truth:
    """For commands that report no register values."""
    return {}


def reached(pitch: float | None = None, yaw: float | None = None) -> Callable[[Truth], Truth]:
    """Where the axes stand after a movement; None = where it stood before."""
    return lambda truth: {
        "pitch_actual": truth["pitch_actual"] if pitch is None else pitch,
        "yaw_actual": truth["yaw_actual"] if yaw is None else yaw,
    }


def restored(truth: Truth) -> Truth:
    """What a restore of `STORED` writes: only what differs."""
    return {name: value for name, value in STORED.items() if truth[name] != value}


@dataclass(frozen=True)
class Command:
    """One command line.

    kind      read, hand (reads the hand's space), stream, raw, write (set values, read back), move (waits), scan
    args      {dir} is a scratch directory of the test
    shows     the numbers it reports, by name, given the truth
    serial, can   the writing frames it sends, in order, on a healthy wrist
    effect    address and bytes in the module's memory after success, in `space`
    on_can    the arguments on CAN where they differ (raw frames)
    planned   what --dry-run prints where that differs from what is sent, by wire
    asks      whether a confirmation is needed
    steady    reads only what two devices with one id show alike
    """

    name: str
    kind: str
    args: tuple[str, ...]
    shows: Callable[[Truth], Truth] = nothing
    serial: tuple[str, ...] = ()
    can: tuple[str, ...] = ()
    effect: tuple[int, bytes] | None = None
    space: str = "wrist"
    on_can: tuple[str, ...] = ()
    planned: tuple[tuple[str, ...], tuple[str, ...]] = ((), ())
    asks: bool = False
    steady: bool = False

    def words(self, scratch: Path, wire: str = "serial") -> list[str]:
        """The words after `handctl wrist`, with scratch files in place."""
        args = self.on_can if wire == "can" and self.on_can else self.args
        return [word.replace("{dir}", str(scratch)) for word in args]

    def frames(self, wire: str) -> tuple[str, ...]:
        """The writing frames on a wire."""
        return self.can if wire == "can" else self.serial

    def plan(self, wire: str) -> tuple[str, ...]:
        """What --dry-run prints."""
        return self.planned[WIRES.index(wire)] or self.frames(wire)


MOVE = ("EB 90 01 09 31 0E 04 E8 03 18 FC E8 03 37", "15038001 [6] E8 03 18 FC E8 03")
"""Yaw 10.00, pitch -10.00, 1000 ms in one write (dossier, test vectors)."""
AXES = ("EB 90 01 07 31 0E 04 E8 03 18 FC 4A", "15038001 [4] E8 03 18 FC")
YAW_10 = ("EB 90 01 05 31 0E 04 E8 03 34", "15038001 [2] E8 03")
TIME_1000 = ("EB 90 01 05 31 12 04 E8 03 38", "15048001 [2] E8 03")
READ_CURRENTS = ("EB 90 01 04 30 00 04 04 3D", "11000001 [1] 04")

READING = (
    Command("status", "read", ("status",), names(*POWER_ON)),
    Command("status-check", "read", ("status", "--check"), names(*POWER_ON)),
    Command("dump", "read", ("dump",), names(*POWER_ON)),
    Command("get", "read", ("get", "pitch_actual", "error_2"), names("pitch_actual", "error_2")),
    Command("get-set", "read", ("get", "move_time"), names("move_time"), steady=True),
    Command("read", "read", ("read", "1020", "24"), names(*POWER_ON)),
    Command("snapshot", "read", ("snapshot", "{dir}/new.json"), names(*SETTINGS), steady=True),
    Command("diff", "read", ("diff", "{dir}/power-on.json", "--setpoints"), steady=True),
    Command("hand-read", "hand", ("hand-read", "1472", "2")),
    Command("watch", "stream", ("watch", "pitch_actual", "yaw_actual", "--count", "3", "--rate", "0"),
            names("pitch_actual", "yaw_actual")),
    Command("raw-read", "raw", ("raw", READ_CURRENTS[0], "--wait", "1"), on_can=("raw", "11000001#04", "--wait", "1"),
            planned=((READ_CURRENTS[0],), (READ_CURRENTS[1],))),
    Command("scan", "scan", ("scan", "--ids", "1-8")),
)  # fmt: skip
WRITING = (
    Command("set", "write", ("set", "yaw_set=10", "pitch_set=-10", "move_time=1000"),
            fixed(yaw_set=10.0, pitch_set=-10.0, move_time=1000), MOVE[:1], MOVE[1:],
            effect=(1038, s16(1000, -1000, 1000)), steady=True),
    Command("set-one", "write", ("set", "yaw_set=10.00"), fixed(yaw_set=10.0), YAW_10[:1], YAW_10[1:],
            effect=(1038, s16(1000, -300, 700)), steady=True),
    Command("set-apart", "write", ("set", "yaw_set=10", "move_time=1000"), fixed(yaw_set=10.0, move_time=1000),
            (TIME_1000[0], YAW_10[0]), (TIME_1000[1], YAW_10[1]),  # the time before the angle
            effect=(1038, s16(1000, -300, 1000)), steady=True),
    Command("write", "write", ("write", "1038", "E80318FC"), fixed(yaw_set=10.0, pitch_set=-10.0), AXES[:1], AXES[1:],
            effect=(1038, s16(1000, -1000, 700)), steady=True),
    Command("hand-write", "hand", ("hand-write", "1486", "F401"), nothing,
            ("EB 90 01 05 12 CE 05 F4 01 E0",), ("05738001 [2] F4 01",), effect=(1486, s16(500, 262)), space="hand",
            asks=True, steady=True),
    Command("restore", "write", ("restore", "{dir}/stored.json", "--setpoints"), restored,
            ("EB 90 01 05 31 12 04 DC 05 2E", "EB 90 01 05 31 0E 04 D2 04 1F"),
            ("15048001 [2] DC 05", "15038001 [2] D2 04"), effect=(1038, s16(1234, -300, 1500)),
            planned=(("EB 90 01 09 31 0E 04 D2 04 D4 FE DC 05 D6",), ("15038001 [6] D2 04 D4 FE DC 05",)),
            asks=True, steady=True),
    Command("move", "move", ("move", "--pitch", "-10", "--yaw", "10", "--time", "1000"), reached(-10.0, 10.0),
            MOVE[:1], MOVE[1:], effect=(1020, s16(-1000, 1000))),
    Command("move-pitch", "move", ("move", "--pitch", "5"), reached(5.0),
            ("EB 90 01 05 31 10 04 F4 01 40",), ("15040001 [2] F4 01",), effect=(1020, s16(500, 1125))),
    Command("center", "move", ("center", "--time", "500"), reached(0.0, 0.0),
            ("EB 90 01 09 31 0E 04 00 00 00 00 F4 01 42",), ("15038001 [6] 00 00 00 00 F4 01",),
            effect=(1020, s16(0, 0))),
    Command("raw-write", "raw", ("raw", AXES[0], "--wait", "1"), nothing, AXES[:1], AXES[1:],
            effect=(1038, s16(1000, -1000, 700)), on_can=("raw", "15038001#E80318FC", "--wait", "1"), asks=True,
            steady=True),
)  # fmt: skip
COMMANDS = (*READING, *WRITING)


def link(wire: str, **options: object) -> str:
    """A simulated wrist in this process on virtual time; names may use _ for -."""
    bus = ["bus=can"] if wire == "can" else []
    return "fake://wrist?" + "&".join(
        ["clock=virtual", *bus, *(f"{k.replace('_', '-')}={v}" for k, v in options.items())]
    )


@made_once
def prepare(scratch: Path) -> None:
    """The input files of the commands: `power-on.json` equals a healthy wrist, `stored.json` differs from it."""
    held = names(*SETTINGS)(power_on_truth())
    for name, values in (("power-on.json", held), ("stored.json", STORED)):
        content = snapshots.make("wrist", {"kind": "wrist", "id": 1}, dict(values), link="fake://wrist", fake=True)
        snapshots.write(str(scratch / name), content)


def sent_frames(trace: Path) -> list[str]:
    """What a transcript says the host sent, one frame a line, as the field writes it, without `can`."""
    lines = [line.split(maxsplit=2) for line in trace.read_text(encoding="utf-8").splitlines() if line[0] != "#"]
    return [text.removeprefix("can ") for _, mark, text in lines if mark == ">"]


def written_frames(trace: Path) -> list[str]:
    """Those that write: serial flags 12, 31, 32, CAN flags 1 and 5."""
    return [text for text in sent_frames(trace) if writes(text)]


def writes(text: str) -> bool:
    """Whether a frame as `sent_frames` spells it writes or moves."""
    words = text.split()
    if len(words[0]) == 8:
        return int(words[0], 16) >> 26 in (1, 5)
    return words[4] in ("12", "31", "32")


def memory_of(spy: Spy, space: str, address: int, count: int) -> bytes:
    """Memory of the last simulated module."""
    device: Any = spy.lines[-1].device
    device.publish()
    return bytes(getattr(device, space).memory[address : address + count])
