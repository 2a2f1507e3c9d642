"""Commands that drive a device while they live, how each is killed, and what must reach the device then.

What reached the device, and when, is told by the simulator with its own clock.
"""

from __future__ import annotations

import json
import re
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from handctl.families import FAMILIES
from handctl.sim.engine.serve import send_control
from tests.contract.facts import facts_of
from tests.support.cli import Result, Simulator, frame, run


class Bench:
    """A served simulator, and what has reached it."""

    def __init__(self, folder: Path, family: str, *args: str) -> None:
        self.family, self.panel = family, folder / "panel"
        self._heard: list[tuple[float, bytes]] = []
        self.simulator = Simulator(*args, "--control", self.panel, kind=family)

    def words(self, command: str) -> list[str]:
        return [self.family, *command.split(), "-p", self.simulator.link]

    def do(self, command: str) -> Result:
        done = run(*self.words(command), "--json")
        assert done.code == 0, (command, done)
        return done

    def ask(self, question: str) -> str:
        """What the device says on its panel."""
        answer = send_control(str(self.panel), question)
        assert answer.startswith("ok "), answer
        return answer.removeprefix("ok ")

    def heard(self) -> list[tuple[float, bytes]]:
        """What has reached the device, with its clock."""
        self._heard += [(moment, bytes.fromhex(digits)) for moment, digits in json.loads(self.ask("heard"))]
        return self._heard

    def bytes_since(self, place: int) -> bytes:
        return b"".join(data for _, data in self.heard()[place:])


@dataclass(frozen=True)
class Drive:
    """A command that drives a device while it lives.

    command   on which it is killed
    driving   bytes that show that it drives: so many times they must have reached the device
    stop      what the device must get then, and not before: a pattern
    stands    whether the device does as the stop says
    before    commands that bring the device somewhere else first
    place     a question whose answer must not change any more
    """

    bench: str
    command: str
    driving: bytes
    stop: bytes
    stands: Callable[[Bench], bool]
    place: str
    before: tuple[str, ...] = ()
    times: int = 5


BENCHES = {
    "aidin": ("aidin", "--tcp", "127.0.0.1:0", "--set", "start=homed"),
    "barrett": ("barrett", "--pty", "--wire", "auto", "--set", "initialized=1"),
    "exo": ("exo", "--pty", "--wire", "auto"),
    "hand": ("hand", "--pty", "--wire", "auto"),
    "hand-rtu": ("hand", "--modbus-pty", "--wire", "auto"),
    "hand-tcp": ("hand", "--modbus-tcp", "127.0.0.1:0"),
    "hand-can": ("hand", "--slcan-pty"),
    "wrist": ("wrist", "--pty", "--wire", "auto"),
    "wrist-can": ("wrist", "--slcan-pty"),
}
"""Name -> family, and how it is served."""
RELEASE = frame("EB 90 01 0B 31 00 00 00 00 00 00 00 00 00 00 3D")
AIDIN_STOP = b'{"hand_mode":3}\n'


def power_off(bench: Bench) -> bool:
    """Stop mode, and no current beyond what an idle motor shows (2 % of 1000)."""
    currents = [abs(float(word)) for word in bench.ask("get current_state").split()]
    return bench.ask("state").startswith("mode 3") and max(currents) <= 20


def motors_off(bench: Bench) -> bool:
    return "power on" not in bench.ask("motors") and "moving" not in bench.ask("motors")


def at_prompt(bench: Bench) -> bool:
    """The movement has ended; the motors keep their power."""
    return "moving" not in bench.ask("motors")


def held(bench: Bench) -> bool:
    """The fingers are where they are told to be, and that is not the target."""
    told = bench.ask("get 1486 10")
    return told == bench.ask("get 1546 10") and set(told.split()) != {"00"}


def at_rest(target: tuple[int, int]) -> Callable[[Bench], bool]:
    """The same of a wrist: yaw_set and pitch_set against pitch_actual and yaw_actual, and the target (pitch, yaw)."""

    def holds(bench: Bench) -> bool:
        yaw, pitch = struct.unpack("<hh", bytes.fromhex(bench.ask("get 1038 4")))
        return (pitch, yaw) == struct.unpack("<hh", bytes.fromhex(bench.ask("get 1020 4"))) != target

    return holds


FACTS = {family: facts_of(family) for family in FAMILIES}


def by_facts(family: str, command: str, driving: bytes, stop: bytes) -> Drive:
    """A family that has no bench of its own here; the panel shows all it has."""
    state = [word for item in FACTS[family].state.split("&") if item for word in ("--set", item)]
    BENCHES[family] = (family, "--pty", *state)
    return Drive(family, command, driving, re.escape(stop), lambda bench: True, "values", times=2)


def no_speed(bench: Bench) -> bool:
    """Speed 0 for every finger, and not at the target."""
    return set(bench.ask("get 1522 12").split()) == {"00"} and bench.ask("get 1546 12") != bench.ask("get 1486 12")


def rh56(command: str, bench: str, reads: bytes, stop: bytes, times: int = 3) -> Drive:
    """All speeds 0; first the hand is opened again, and made slow."""
    more = " --protocol modbus" if bench == "hand-rtu" else ""
    before = (
        "speed 1000 1000 1000 1000 1000 1000 -y",
        "angle 900 900 900 900 900 900 -y --wait 5",
        "speed 100 100 100 100 100 100 -y",
    )
    drive = f"{command} -y --wait 30{more}"
    return Drive(bench, drive, reads, stop, no_speed, "get 1546 12", tuple(f"{one}{more}" for one in before), times)


ZEROS = bytes(12)
RH56_STOP = re.escape(frame("EB 90 01 0F 12 F2 05") + ZEROS + b"\x19")
RTU_STOP = re.escape(frame("01 10 05 F2 00 06 0C") + ZEROS + frame("DC A3"))
TCP_STOP = re.escape(frame("00 01 00 00 00 13 FF 10 05 F2 00 06 0C") + ZEROS)
CAN_STOP = b"T057C80018" + b"00" * 8 + b".*T057E80014" + b"00" * 4
"""speed_set of six fingers (rh56 §2.1 to §2.4)."""
CLOSE = "angle 0 0 0 0 0 -1"
OFF = b"\x031T\r"
STAY = re.escape(frame("EB 90 01 07 31 0E 04"))
"""yaw_set with pitch_set behind it: where the wrist is just then."""
DRIVEN = {
    "aidin currents": Drive(
        "aidin", "currents index.m1=200 -y --duration 30", b'"hand_mode":41', re.escape(AIDIN_STOP), power_off, "get motor_pos", times=40
    ),
    "barrett realtime": Drive(
        "barrett", "realtime --motors 1 --velocity 30 --gain 40 --receive position --timeout 20 --json", b"\x43\x1e\x28",
        re.escape(b"\x63\x00\x28" + OFF), motors_off, "motors",
    ),
    "barrett close": Drive("barrett", "close --motors 1", b"1C\r", b"1C\r\x03", at_prompt, "motors", ("set MCV.F1=16 --force",), 1),
    "barrett gcl": Drive("barrett", "gcl 1C", b"1C\r", b"1C\r\x03", at_prompt, "motors", ("set MCV.F1=16 --force", "open --motors 1"), 1),
    "exo position": Drive(
        "exo", "position 0 0 0 0 0 -y --wait 30", frame("EB 90 01 04 11 0A 06"), re.escape(RELEASE) + b".*" + re.escape(frame("EB 90 01 0B 32")), held,
        "get 1546 10", ("position 1000 1000 1000 1000 1000 -y --wait 3",), 3,
    ),
    "hand angle": rh56(CLOSE, "hand", frame("EB 90 01 04 11 0A 06"), RH56_STOP),
    "wrist move": Drive(
        "wrist", "move --pitch 20 --yaw -20 --time 1500", frame("EB 90 01 04 30 FC 03"), STAY, at_rest((2000, -2000)),
        "get 1020 4", ("center --time 100",), 3,
    ),
    **{f"{family} {facts.drives[0].split()[0]}": by_facts(family, *facts.drives) for family, facts in FACTS.items() if facts.drives},
}  # fmt: skip
FURTHER = {
    "hand angle over Modbus RTU": rh56(CLOSE, "hand-rtu", frame("01 03 06 0A"), RTU_STOP),
    "hand angle over Modbus TCP": rh56(CLOSE, "hand-tcp", frame("FF 03 06 0A"), TCP_STOP),
    "hand angle on CAN": rh56(CLOSE, "hand-can", b"T01828001", CAN_STOP, 5),  # two are read before it moves
    "wrist move on CAN": Drive(
        "wrist-can", "move --pitch 20 --yaw -20 --time 1500", b"T10FF0001", rb"T10FF0001\w+\s+T15038001",
        at_rest((2000, -2000)), "get 1020 4", ("center --time 100",), 3,
    ),
}  # fmt: skip
"""The same command on another wire."""


def standing(bench: Bench, place: str) -> bool:
    """Whether it is where it was a while ago: none of the movements here has an end within the patience of a test."""
    before = bench.ask(place)
    time.sleep(0.05)
    return bench.ask(place) == before


def first_of(drive: Drive, heard: list[tuple[float, bytes]]) -> float | None:
    """The moment of the first byte of the stop; None where it has not come."""
    moments = [moment for moment, data in heard for _ in data]
    told = b"".join(data for _, data in heard)
    if (found := re.search(drive.stop, told, re.DOTALL)) is None:
        return None
    return moments[found.start()]
