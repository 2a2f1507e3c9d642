"""Every `handctl exo` command once, with what it must show on a healthy hand and what it must leave in its memory.

Values are the simulated hand's power-on values and the arguments given here; nothing is computed by handctl.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from handctl.command import snapshots
from tests.support.cli import FINGERS, POWER_ON, elements, s16
from tests.support.inputs import made_once

Truth = dict[str, int]
"""Values by full name, `error.index`."""

STORED = {
    **{f"position_set.{finger}": v for finger, v in zip(FINGERS, (151, 252, 353, 300, 555), strict=True)},
    **{f"force_set.{finger}": v for finger, v in zip(FINGERS, (1, -2, 3, -4, 5), strict=True)},
}
"""What the snapshot file of these tests holds beside id 1 and baud_code 0."""


def names(*registers: str) -> Callable[[Truth], Truth]:
    """The true values of whole registers."""
    wanted = [name + (f".{part}" if part else "") for name in registers for part in elements(name)]
    return lambda truth: {name: truth[name] for name in wanted}


def fixed(**values: int) -> Callable[[Truth], Truth]:
    """Values that do not depend on the hand's state; `__` stands for the dot."""
    return lambda _truth: {name.replace("__", "."): value for name, value in values.items()}


def nothing(_truth: Truth) -> Truth:
    """For commands that report no register values."""
    return {}


def cleared(truth: Truth) -> Truth:
    """Error bits after clear-errors: over-temperature (bit 1) and undefined bits stay (exo §2.3.3)."""
    return {f"error.{finger}": truth[f"error.{finger}"] & 0b11100010 for finger in FINGERS}


def moved(values: tuple[int, ...]) -> Callable[[Truth], Truth]:
    """Positions once the fingers have arrived; the rotation cannot be commanded."""
    return lambda truth: {
        **{f"position_actual.{finger}": value for finger, value in zip(FINGERS, values, strict=True)},
        "position_actual.thumb_rotation": truth["position_actual.thumb_rotation"],
    }


def calibrated(_truth: Truth) -> Truth:
    """The last pose of the course, and the present force as the new zero."""
    return {
        **{f"position_actual.{f}": v for f, v in zip(FINGERS, (500, 500, 500, 500, 400), strict=True)},
        "position_actual.thumb_rotation": 0,
        **{f"force_actual.{finger}": 0 for finger in FINGERS},
    }


def restored(truth: Truth) -> Truth:
    """What a restore of `STORED` writes: only what differs."""
    return {name: value for name, value in STORED.items() if truth[name] != value}


LIVE_REGISTERS = ("position_actual", "force_actual", "current", "error", "temperature")
STATUS = ("id", "baud_code", "system_voltage", "position_set", "force_set", *LIVE_REGISTERS)


@dataclass(frozen=True)
class Command:
    """One command line.

    kind     read, stream, raw, write (one acknowledged write), command (force, position: no acknowledgement), scan
    args     {dir} is a scratch directory of the test
    shows    the numbers it reports, by full name, given the truth
    effect   address and bytes in the hand's memory after success; "flash" looks at the saved id and speed code
    frames   the writing frames it sends, in order, on a healthy hand (dossier, test vectors)
    asks     whether a confirmation is needed
    """

    name: str
    kind: str
    args: tuple[str, ...]
    shows: Callable[[Truth], Truth] = nothing
    effect: tuple[int, bytes] | None = None
    flash: tuple[int, int] | None = None
    frames: tuple[str, ...] = ()
    asks: bool = False
    fixed_registers: bool = False

    def words(self, scratch: Path) -> list[str]:
        """The words after `handctl exo`, with scratch files in place."""
        return [word.replace("{dir}", str(scratch)) for word in self.args]


SET = "EB 90 01 05 12 D4 05 2C 01 1E"
SAVE = "EB 90 01 04 12 ED 03 01 08"
BAUD_57600 = "EB 90 01 04 12 E9 03 01 04"
POSITION = "EB 90 01 0B 32 F4 01 90 01 2C 01 C8 00 64 00 1D"
TARGETS = ("500", "400", "300", "200", "100")
# Positions little to index 500 400 300 200, thumb 100; forces 100 -100 0 1000 -1000: the dossier's vectors.

READING = (
    Command("status", "read", ("status",), names(*STATUS)),
    Command("status-check", "read", ("status", "--check"), names(*STATUS)),
    Command("dump", "read", ("dump",), names(*POWER_ON)),
    Command("get", "read", ("get", "system_voltage", "error.index"), lambda t: {
        "system_voltage": t["system_voltage"], "error.index": t["error.index"],
    }),
    Command("read", "read", ("read", "1546", "12"), names("position_actual")),
    Command("id", "read", ("id",), names("id"), fixed_registers=True),
    Command("baud", "read", ("baud",), names("baud_code"), fixed_registers=True),
    Command("snapshot", "read", ("snapshot", "{dir}/new.json"),
            names("id", "baud_code", "position_set", "force_set"), fixed_registers=True),
    Command("diff", "read", ("diff", "{dir}/power-on.json", "--setpoints"), fixed_registers=True),
    Command("watch", "stream", ("watch", "position_actual", "--count", "3", "--rate", "0"), names("position_actual")),
    Command("raw-read", "raw", ("raw", "EB 90 01 04 11 C0 05 02 DD", "--wait", "1")),
    Command("scan", "scan", ("scan", "--ids", "1-8")),
)  # fmt: skip
WRITING = (
    Command("set", "write", ("set", "position_set.index=300"), fixed(position_set__index=300),
            effect=(1492, s16(300)), frames=(SET,), asks=True, fixed_registers=True),
    Command("set-force", "write", ("set", "force_set=10,-20,30,-40,50"),
            lambda _t: {f"force_set.{f}": v for f, v in zip(FINGERS, (10, -20, 30, -40, 50), strict=True)},
            effect=(1498, s16(10, -20, 30, -40, 50)),
            frames=("EB 90 01 0D 12 DA 05 0A 00 EC FF 1E 00 D8 FF 32 00 1B",), asks=True, fixed_registers=True),
    Command("write", "write", ("write", "1492", "2C01"), fixed(position_set__index=300),
            effect=(1492, s16(300)), frames=(SET,), asks=True, fixed_registers=True),
    Command("id-new", "write", ("id", "2"), fixed(id=2),
            effect=(1000, b"\x02"), frames=("EB 90 01 04 12 E8 03 02 04",), asks=True),
    Command("baud-new", "write", ("baud", "57600"), fixed(baud_code=1),
            effect=(1001, b"\x01"), frames=(BAUD_57600,), asks=True, fixed_registers=True),
    Command("baud-save", "write", ("baud", "57600", "--save"), fixed(baud_code=1),
            effect=(1001, b"\x01"), flash=(1, 1), frames=(BAUD_57600, SAVE), asks=True),
    Command("clear-errors", "write", ("clear-errors",), cleared, frames=("EB 90 01 04 12 EC 03 01 07",), fixed_registers=True),
    Command("save", "write", ("save",), flash=(1, 0), frames=(SAVE,), asks=True),
    Command("factory-reset", "write", ("factory-reset", "--undocumented-address", "--backup", "{dir}/backup.json"),
            frames=("EB 90 01 04 12 EE 03 01 09",), asks=True),
    Command("calibrate", "write", ("calibrate",), calibrated, effect=(1546, s16(500, 500, 500, 500, 400, 0)),
            frames=("EB 90 01 04 12 F1 03 01 0C",), asks=True),
    Command("restore", "write", ("restore", "{dir}/stored.json", "--setpoints"), restored, effect=(1498, s16(1, -2, 3, -4, 5)),
            frames=(SET, "EB 90 01 0D 12 DA 05 01 00 FE FF 03 00 FC FF 05 00 00"), asks=True, fixed_registers=True),
    Command("force", "command", ("force", "100", "-100", "0", "1000", "-1000"), names("position_actual"),
            effect=(1498, s16(100, -100, 0, 1000, -1000)),
            frames=("EB 90 01 0B 31 64 00 9C FF 00 00 E8 03 18 FC 3B",), asks=True),
    Command("position", "command", ("position", *TARGETS), names("force_actual"),
            effect=(1486, s16(500, 400, 300, 200, 100)), frames=(POSITION,), asks=True),
    Command("move", "command", ("position", *TARGETS, "--wait", "3"), moved((500, 400, 300, 200, 100)),
            effect=(1546, s16(500, 400, 300, 200, 100, 660)), frames=(POSITION,), asks=True),
    Command("raw-write", "raw", ("raw", SET, "--wait", "1"), effect=(1492, s16(300)), frames=(SET,), asks=True),
)  # fmt: skip
COMMANDS = (*READING, *WRITING)


def power_on_truth() -> Truth:
    """Every readable documented value at power-on."""
    return {
        name + (f".{part}" if part else ""): value
        for name, (_, _, values) in POWER_ON.items()
        for part, value in zip(elements(name), values, strict=True)
    }


@made_once
def prepare(scratch: Path) -> None:
    """The input files of the commands: `power-on.json` equals a healthy hand, `stored.json` differs from it."""
    truth = power_on_truth()
    held = {k: v for k, v in truth.items() if k.split(".")[0] in ("id", "baud_code", "position_set", "force_set")}
    for name, values in (("power-on.json", held), ("stored.json", {**held, **STORED})):
        content = snapshots.make("exo", {"kind": "exo", "id": 1}, dict(values), link="fake://exo", fake=True)
        snapshots.write(str(scratch / name), content)
