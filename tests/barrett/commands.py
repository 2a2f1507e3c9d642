"""Every `handctl barrett` command once: what it sends, what it shows on a healthy hand, what it leaves in its RAM.

Values are the manual's factory values (§5.3, §5.4), the simulated hand's readings and the arguments given here;
nothing is computed by handctl.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from handctl.command import snapshots
from tests.support.cli import Result, Spy
from tests.support.inputs import made_once

MOTORS = ("F1", "F2", "F3", "SPREAD")
Key = tuple[str, str | None]
"""(GCL mnemonic, motor); motor is None for a parameter of the whole hand."""
Truth = dict[Key, int]

# mnemonic -> name, unit, values of F1 F2 F3 SPREAD, or of the hand; settings in upper half, readings below
SETTINGS: dict[str, tuple[str, str | None, tuple[int, ...]]] = {
    "DP": ("default_position", "cts", (8500, 8500, 8500, 1575)),
    "DS": ("default_step", "cts", (1700, 1700, 1700, 315)),
    "HSG": ("strain_limit_high", None, (256, 256, 256, 256)),
    "LSG": ("strain_limit_low", None, (256, 256, 256, 256)),
    "MOV": ("max_open_velocity", "1/16 cts/sample", (100, 100, 100, 60)),
    "MCV": ("max_close_velocity", "1/16 cts/sample", (100, 100, 100, 60)),
    "MSG": ("strain_limit_high_alias", None, (256, 256, 256, 256)),
    "LCV": ("loop_control_velocity", None, (1, 1, 1, 1)),
    "LCVC": ("loop_control_velocity_coefficient", None, (1, 1, 1, 1)),
    "LCPG": ("loop_control_proportional_gain", None, (1, 1, 1, 1)),
    "LFV": ("loop_feedback_velocity", None, (1, 1, 1, 1)),
    "LFVC": ("loop_feedback_velocity_coefficient", None, (1, 1, 1, 1)),
    "LFS": ("loop_feedback_strain", None, (1, 1, 1, 1)),
    "LFAP": ("loop_feedback_absolute_position", None, (1, 1, 1, 1)),
    "LFDP": ("loop_feedback_delta_position", None, (1, 1, 1, 1)),
    "LFDPC": ("loop_feedback_delta_position_coefficient", None, (1, 1, 1, 1)),
    "ACCEL": ("acceleration", "1/256 cts/sample²", (4, 4, 4, 2)),
    "CT": ("close_target", "cts", (17000, 17000, 17000, 3150)),
    "EN": ("enabled", None, (1, 1, 1, 1)),
    "FDZ": ("filter_derivative_zero", None, (0, 0, 0, 0)),
    "FIP": ("filter_integral_pole", None, (0, 0, 0, 0)),
    "FPG": ("filter_proportional_gain", None, (10, 10, 10, 10)),
    "HOLD": ("hold", None, (0, 0, 0, 1)),
    "IHIT": ("init_hit_count", None, (2, 2, 2, 0)),
    "IOFF": ("init_offset", "cts", (50, 50, 50, 0)),
    "IVEL": ("init_velocity", "1/16 cts/sample", (300, 300, 300, 150)),
    "MPE": ("max_position_error", "cts", (50, 50, 50, 50)),
    "OT": ("open_target", "cts", (0, 0, 0, 0)),
    "SAMPLE": ("sample_time", None, (31, 31, 31, 31)),
    "SGFLIP": ("strain_flip", None, (0, 0, 0, 0)),
    "TSTOP": ("stop_time", "ms", (30, 30, 30, 30)),
    "BAUD": ("baud_rate", "100 bit/s", (96,)),
    "LFT": ("loop_feedback_temperature", None, (0,)),
    "OTEMP": ("over_temperature_limit", "0.1 °C", (0,)),
    "LFDPD": ("loop_feedback_delta_discard", None, (0,)),
}
READINGS: dict[str, tuple[str, str | None, tuple[int, ...]]] = {
    "OD": ("odometer", "1000 cts", (104233, 98712, 110003, 20117)),
    "P": ("position", "cts", (0, 0, 0, 0)),
    "S": ("status", None, (0, 0, 0, 0)),
    "SG": ("strain", None, (112, 119, 126, 255)),
    "TEMP": ("temperature", "0.1 °C", (412,)),
    "PTEMP": ("peak_temperature", "0.1 °C", (573,)),
    "UPSECS": ("uptime_seconds", "s", (7345678,)),
    "SN": ("serial_number", None, (1042,)),
}
POWER_ON = {**SETTINGS, **READINGS}
NAMES = {name: mnemonic for mnemonic, (name, _, _) in POWER_ON.items()}
STATUS = ("P", "SG", "S", "OD", "EN", "TEMP", "OTEMP", "PTEMP", "UPSECS", "SN", "BAUD")
STORED = {"default_position.F2": 4321, "loop_feedback_temperature": 1}
"""In which the file `stored.json` differs from a hand as it left the factory."""


def motors_of(mnemonic: str) -> tuple[str | None, ...]:
    """The motors that a parameter has a value for; (None,) when it is the hand's."""
    return MOTORS if len(POWER_ON[mnemonic][2]) == 4 else (None,)


def power_on() -> Truth:
    """All values of a healthy hand after HI."""
    return {(m, motor): v for m, row in POWER_ON.items() for motor, v in zip(motors_of(m), row[2], strict=True)}


def names(*mnemonics: str) -> Callable[[Truth], Truth]:
    """The true values of whole parameters."""
    return lambda truth: {key: value for key, value in truth.items() if key[0] in mnemonics}


def fixed(mnemonic: str, *values: int, motors: tuple[str | None, ...] = MOTORS) -> Callable[[Truth], Truth]:
    """Values that do not depend on the hand's state."""
    return lambda _truth: {(mnemonic, motor): value for motor, value in zip(motors, values, strict=True)}


def both(*parts: Callable[[Truth], Truth]) -> Callable[[Truth], Truth]:
    """Several of them."""
    return lambda truth: {key: value for part in parts for key, value in part(truth).items()}


def nothing(_truth: Truth) -> Truth:
    """For commands that report no parameters."""
    return {}


@dataclass(frozen=True)
class Command:
    """One command line.

    kind    read, stream, none (needs no device), write (set and read back), move, gcl (the hand's own text), baud, reset
    args    {dir} is a scratch directory of the test
    lines   the GCL lines that write or move, in the order sent; also what --dry-run prints
    shows   the values it reports, given the truth
    ram     settings in the hand afterwards that are not the factory's
    asks    whether a confirmation is needed
    """

    name: str
    kind: str
    args: tuple[str, ...]
    lines: tuple[str, ...] = ()
    shows: Callable[[Truth], Truth] = nothing
    ram: tuple[tuple[str, tuple[int, ...]], ...] = ()
    asks: bool = False

    def words(self, scratch: Path) -> list[str]:
        """The words after `handctl barrett`, with scratch files in place."""
        return [word.replace("{dir}", str(scratch)) for word in self.args]


F = MOTORS[:3]
READING = (
    Command("status", "read", ("status",), shows=names(*STATUS)),
    Command("status-check", "read", ("status", "--check"), shows=names(*STATUS)),
    Command("dump", "read", ("dump",), shows=names(*POWER_ON)),
    Command("get", "read", ("get", "P", "SG.F1", "temperature"), shows=both(
        names("P", "TEMP"), lambda truth: {("SG", "F1"): truth["SG", "F1"]})),
    Command("get-hand", "read", ("get", "OTEMP"), shows=names("OTEMP")),
    Command("snapshot", "read", ("snapshot", "{dir}/new.json")),
    Command("diff", "read", ("diff", "{dir}/factory.json")),
    Command("watch", "stream", ("watch", "P", "--count", "3", "--rate", "0"), shows=names("P")),
    Command("version", "read", ("version",)),
    Command("help", "gcl", ("help", "M")),
    Command("baud-show", "read", ("baud",), shows=names("BAUD")),
    Command("gcl-read", "gcl", ("gcl", "FGET P S", "PGET SN", "ERR 3")),
)  # fmt: skip
OFFLINE = (
    Command("describe", "none", ("describe",)),
    Command("errors", "none", ("errors", "20")),
)
SETTING = (
    Command("set", "write", ("set", "MCV=80", "HSG.F1=150", "--motors", "12"), ("1FSET HSG 150", "12FSET MCV 80"),
            both(fixed("MCV", 80, 80, motors=F[:2]), fixed("HSG", 150, motors=F[:1])),
            (("MCV", (80, 80, 100, 60)), ("HSG", (150, 256, 256, 256)), ("MSG", (150, 256, 256, 256)))),  # one value
    Command("set-all", "write", ("set", "default_position=3000"), ("FSET DP 3000",), fixed("DP", *(3000,) * 4),
            (("DP", (3000,) * 4),)),
    Command("set-hand", "write", ("set", "OTEMP=650", "LFT=1"), ("PSET LFT 1 OTEMP 650",),
            both(fixed("OTEMP", 650, motors=(None,)), fixed("LFT", 1, motors=(None,))),
            (("OTEMP", (650,)), ("LFT", (1,)))),
    Command("restore", "write", ("restore", "{dir}/stored.json"), ("PSET LFT 1", "2FSET DP 4321"),
            ram=(("DP", (8500, 4321, 8500, 1575)), ("LFT", (1,))), asks=True),
    Command("load", "gcl", ("load",), ("FLOAD", "PLOAD"), asks=True),
    Command("defaults", "gcl", ("defaults",), ("FDEF", "PDEF"), asks=True),
    Command("save", "write", ("save",), ("FSAVE", "PSAVE"), asks=True),
    Command("baud", "baud", ("baud", "38400"), ("PSET BAUD 384",), fixed("BAUD", 384, motors=(None,)),
            (("BAUD", (384,)),), asks=True),
    Command("baud-save", "baud", ("baud", "19200", "--save"), ("PSET BAUD 192", "PSAVE"),
            fixed("BAUD", 192, motors=(None,)), (("BAUD", (192,)),), asks=True),
    Command("reset", "reset", ("reset",), ("RESET",), asks=True),
    Command("gcl-set", "gcl", ("gcl", "2FSET DP 77", "2FGET DP"), ("2FSET DP 77",),
            ram=(("DP", (8500, 77, 8500, 1575)),)),
    Command("gcl-save", "gcl", ("gcl", "FSAVE"), ("FSAVE",), asks=True),
)  # fmt: skip
MOVING = (
    Command("init", "move", ("init",), ("HI",), fixed("P", 0, 0, 0, 0)),
    Command("open", "move", ("open",), ("O",), fixed("P", 0, 0, 0, 0)),
    Command("close", "move", ("close", "--motors", "G"), ("123C",), fixed("P", 17000, 17000, 17000, motors=F)),
    Command("move", "move", ("move", "3000", "--motors", "12S"), ("124M 3000",),
            fixed("P", 3000, 3000, 3000, motors=("F1", "F2", "SPREAD"))),
    Command("move-default", "move", ("move",), ("M",), fixed("P", 8500, 8500, 8500, 1575)),
    Command("step-close", "move", ("step-close", "100"), ("IC 100",), fixed("P", 100, 100, 100, 100)),
    Command("step-open", "move", ("step-open", "--motors", "G", "0"), ("123IO 0",), fixed("P", 0, 0, 0, motors=F)),
    Command("home", "move", ("home", "--motors", "S"), ("4HOME",), fixed("P", 0, motors=("SPREAD",))),
    # to the joint stops: about 17,800 and 3150 (§5.3.2); fingers differ by tens
    Command("torque-close", "move", ("torque-close",), ("TC",), fixed("P", 17791, 17812, 17833, 3158)),
    Command("torque-open", "move", ("torque-open", "--motors", "S"), ("4TO",), fixed("P", 0, motors=("SPREAD",))),
    Command("stop", "stop", ("stop", "--motors", "12"), ("12T",)),
    Command("gcl-move", "gcl", ("gcl", "1M 500", "FGET P"), ("1M 500",)),
)  # fmt: skip
WRITING = (*SETTING, *MOVING)
COMMANDS = (*READING, *WRITING)
FIRMWARE = "S1132C40000102030405060708090A0B0C0D0E0F08\nS9032C4090\n"
"""A small S-record file: 16 bytes at 2C40, and the end record."""
QUERIES = ("FGET", "PGET", "VERS", "?", "A?", "ERR", "FLIST", "PLIST")


def fake(**options: object) -> str:
    """A simulated hand in this process, after HI, on virtual time; names may use _ for -."""
    said = {"clock": "virtual", "initialized": 1, **options}
    return "fake://barrett?" + "&".join(f"{k.replace('_', '-')}={v}" for k, v in said.items())


def factory() -> dict[str, int | float]:
    """Every setting as a snapshot holds it."""
    return {
        name + (f".{motor}" if motor else ""): value
        for mnemonic, (name, _, values) in SETTINGS.items()
        for motor, value in zip(motors_of(mnemonic), values, strict=True)
    }


@made_once
def prepare(scratch: Path) -> None:
    """The input files of the commands: `factory.json` equals a healthy hand, `stored.json` differs from it; firmware."""
    (scratch / "image.s19").write_text(FIRMWARE, encoding="ascii")
    for name, values in (("factory.json", factory()), ("stored.json", {**factory(), **STORED})):
        content = snapshots.make("barrett", {"kind": "barrett", "serial_number": 1042}, values, link="fake://barrett",
                                fake=True)  # fmt: skip
        snapshots.write(str(scratch / name), content)


def sent_lines(trace: Path) -> list[str]:
    """The GCL lines that a transcript says the host sent: without ^C and empty lines."""
    lines = [line.split() for line in trace.read_text(encoding="utf-8").splitlines() if line[0] != "#"]
    data = b"".join(bytes.fromhex("".join(words[2:])) for words in lines if words[1] == ">")
    assert b"\n" not in data, "LF is never sent (§5.1.1)"
    return [
        line
        for line in data.replace(b"\x03", b"").replace(b"\0", b"").replace(b"\x7f", b"").decode("ascii").split("\r")
        if line not in ("", "!")
    ]


def writes(line: str) -> bool:
    """Whether a GCL line writes or moves."""
    return not line.lstrip("1234GS").split()[0].startswith(QUERIES)


def written_lines(trace: Path) -> list[str]:
    """Those that write or move."""
    return [line for line in sent_lines(trace) if writes(line)]


def key_of(row: dict[str, Any]) -> Key | None:
    """Which parameter a row is about; None when it is about something else."""
    return (row["parameter"], row["motor"]) if row.get("parameter") in POWER_ON else None


def values_of(result: Result) -> dict[Key, Any]:
    """Value, or None where there is an error, by mnemonic and motor; firmware and other texts left out."""
    return {key: row.get("value") for row in result.rows if (key := key_of(row)) is not None}


def ram(spy: Spy, mnemonic: str) -> tuple[int, ...]:
    """A setting in the RAM of the last simulated hand."""
    return tuple(map(int, spy.lines[-1].device.command(["ram", mnemonic]).split()))


def eeprom(spy: Spy, mnemonic: str) -> tuple[int, ...]:
    """A setting in the EEPROM of the last simulated hand."""
    return tuple(map(int, spy.lines[-1].device.command(["eeprom", mnemonic]).split()))


def saves(spy: Spy) -> tuple[int, ...]:
    """How often FSAVE and PSAVE were carried out by the last simulated hand."""
    return tuple(map(int, spy.lines[-1].device.command(["saves"]).split()[1:]))
