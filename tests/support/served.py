"""Served simulators for the fault matrix: one process per device and wire, faults switched by its control socket.

A `Served` looks to the matrices of the families like a spied simulator in this process: what they read from its memory
is asked for over the control socket. `Served.heal` brings it back to its power-on state without a restart.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from handctl.sim.engine.serve import ServeError, send_control
from tests.ekso.commands import PLACES as SETTINGS
from tests.ekso.commands import POWER_ON as EKSO_POWER_ON
from tests.support.cli import PATIENCE, Simulator, run

LATE = 0.08
"""Seconds of the fault `late`, within TIMEOUT."""
TIMEOUTS = {"aidin": 1.0}
TIMEOUT = 0.2
"""--timeout: silence allowed per reply; a stream of big objects needs more than an answer to a question."""
DRIBBLE_TIMEOUT = 1.0
"""For answers of which each byte takes 3 ms."""
DEADLINES = {"aidin": 6.0, "barrett": 6.0, "hand": 6.0}
DEADLINE = 2.5
"""--deadline of every command; the AIDIN-hand's damaged feedback is waited for 4 s before it is taken for damaged,
the BarrettHand's prompt is searched for, and a hand on CAN is looked at in some thirty questions."""
WIRES: dict[str, tuple[str, ...]] = {
    "pty": ("--pty",),
    "tcp": ("--tcp", "127.0.0.1:0"),
    "slcan-pty": ("--slcan-pty",),
    "slcan-tcp": ("--slcan-tcp", "127.0.0.1:0"),
    "modbus-pty": ("--modbus-pty",),
    "modbus-tcp": ("--modbus-tcp", "127.0.0.1:0"),
}
MADE: dict[str, tuple[str, ...]] = {
    "exo": (),
    "wrist": (),
    "barrett": ("initialized=1",),
    "ekso": ("sway=0", "startup=0.1"),
    "aidin": ("start=homed", "rate=40"),
    "hand": (),
}
BAUD = {"exo": "115200", "wrist": "115200", "barrett": "9600", "hand": "115200"}
"""A speed that is given is not searched for: silence stays one wait per try."""
HEALING: dict[str, tuple[str, ...]] = {
    # RAM is that of power-on again; places, heat and latched errors are poked to what they were
    "exo": ("power-cycle", "set 1546 6E 00 DC 00 4A 01 B8 01 26 02 94 02", "set 1606 00 00 00 00 00",
            "set 1618 1F 20 21 22 23"),
    "wrist": ("power-cycle", "set 1020 A7 FE 65 04", "set 1028 00", "set 1030 00", "set 1032 1F 22"),
    "barrett": ("release all", "position all 0"),
    "ekso": ("live", "posture standing"),
    "hand": ("power-cycle", "set 1546 6E 00 DC 00 4A 01 B8 01 26 02 94 02", "set 1606 00 00 00 00 00 00",
             "set 1618 1F 20 21 22 23 24"),
    "aidin": ("release thumb", "release index", "release middle", "release ring", "release little"),
}  # fmt: skip
LEFT_OVER: dict[str, tuple[str, ...]] = {
    "ekso": tuple(f"set {name} {raw}" for name, raw in EKSO_POWER_ON.items() if name in SETTINGS),
}
"""Settings that a fault or a command may have changed, put back one by one."""
PRESENT = {
    "exo": ("get", "system_voltage"), "wrist": ("get", "yaw_set"), "barrett": ("get", "LFT"), "ekso": ("time",),
    "hand": ("get", "id"),
}  # fmt: skip
"""A request that no command of the matrix begins with."""
NEVER_THE_SAME = {"barrett": {"not-homed", "hot", "over-temperature", "hang", "reversed", "erratic"}}
"""Faults whose traces no control command wipes out: a new process comes after them."""


@dataclass
class Served:
    """`handctl sim DEVICE` on one wire."""

    device: str
    wire: str
    directory: Path

    def __post_init__(self) -> None:
        self.panel = self.directory / "panel"
        self.fault = self.ended = "none"
        self.simulator: Simulator | None = None
        self.start()

    # -- the process --------------------------------------------------------------------------------------------------

    def start(self) -> None:
        """A new process in place of the old one."""
        self.stop()
        settings = [word for text in (f"late={LATE}", *MADE[self.device]) for word in ("--set", text)]
        self.simulator = Simulator(
            *WIRES[self.wire], "--seed", "1", "--control", self.panel, *settings, kind=self.device
        )
        self.fault = self.ended = "none"
        self.baseline = self.ask("motors") if self.device == "barrett" else ""

    def stop(self) -> None:
        """End it in order; a line that hung up ends by itself."""
        simulator, self.simulator = self.simulator, None
        if simulator is not None:
            if not self.panel.exists():
                simulator.process.wait(PATIENCE)
            code, out, err = simulator.stop()
            assert (code, out) == (0, "") and "Traceback" not in err, (self, code, out, err)

    @property
    def link(self) -> str:
        """What a client passes to --port."""
        assert self.simulator is not None
        return self.simulator.link

    @property
    def options(self) -> tuple[str, ...]:
        """The connection of a command line."""
        baud = ("--baud", BAUD[self.device]) if self.wire in ("pty", "tcp") and self.device in BAUD else ()
        timeout = DRIBBLE_TIMEOUT if self.fault == "dribble" else TIMEOUTS.get(self.device, TIMEOUT)
        return ("-p", self.link, "--timeout", str(timeout), "--deadline", str(self.deadline), "--retries", "1", *baud)

    @property
    def patient(self) -> tuple[str, ...]:
        """The same for a command that must succeed, as often as it may ask: a busy machine answers late."""
        baud = ("--baud", BAUD[self.device]) if self.wire in ("pty", "tcp") and self.device in BAUD else ()
        return ("-p", self.link, "--timeout", "2", "--deadline", str(PATIENCE), "--retries", "1", *baud)

    @property
    def deadline(self) -> float:
        """Seconds that a command may take by its --deadline."""
        return DEADLINES.get(self.device, DEADLINE)

    def ask(self, command: str) -> str:
        """One control command; its answer without the "ok"."""
        status, _, text = send_control(str(self.panel), command).partition(" ")
        assert status == "ok", (command, text)
        return text

    def befall(self, fault: str) -> None:
        """Switch to this fault; a device state that is there from power-on on is put in force by one."""
        self.heal()
        if fault == "stale" and self.device != "aidin":
            # Frames have no numbers: the answer to an equal request of another day cannot be told. This is today's.
            assert run(self.device, *PRESENT[self.device], *self.options, "--json").code == 0
        self.ask(f"fault {fault}")
        if self.device in ("exo", "wrist", "hand") and fault in ("fresh", "foreign", "hot"):
            self.ask("power-cycle")
        self.fault = fault

    def calm(self) -> None:
        """The fault ends, nothing else: what a client meets next is a sound line with the past still in it."""
        try:
            self.ask("fault none")
        except ServeError:  # a pty that hung up: its process is gone
            self.start()
        self.ended, self.fault = self.fault, "none"

    def heal(self) -> None:
        """As at power-on: by control commands, or by a new process where they do not reach."""
        try:
            self.ask("fault none")
            if {self.fault, self.ended} & NEVER_THE_SAME.get(self.device, set()):
                raise ServeError("worn")
            for command in (*HEALING[self.device], *LEFT_OVER.get(self.device, ())):
                self.ask(command)
            if self.device == "barrett":
                self._reset_ram()
        except ServeError:
            self.start()
        self.fault = self.ended = "none"

    def _reset_ram(self) -> None:
        """The factory's default positions again, by the hand's own commands; a new process where something else differs."""
        if self.ask("ram DP") != "8500 8500 8500 1575":
            words = ("gcl", "123FSET DP 8500", "4FSET DP 1575")
            assert run("barrett", *words, "-p", self.link, "--json").code == 0
        if self.ask("motors") != self.baseline:
            raise ServeError("moved")

    # -- as the matrices of the families see a simulator ------------------------------------------------------------

    now = 0.0
    """Served simulators live in real time, which the cells bound themselves."""

    @property
    def lines(self) -> list[Any]:
        """The one device."""
        return [SimpleNamespace(device=self)]

    @property
    def memory(self) -> bytes:
        """All that an RH56 hand holds, before its first tactile zone."""
        return self.byte_at(0, 3000)

    def byte_at(self, address: int, count: int = 1) -> bytes:
        """Memory of an exo or a hand."""
        return bytes.fromhex(self.ask(f"get {address} {count}"))

    def publish(self) -> None:
        """Control commands answer with the present anyway."""

    def command(self, words: list[str]) -> str:
        """A control command of the barrett."""
        return self.ask(" ".join(words))

    @property
    def hand(self) -> SimpleNamespace:
        """The hand's space behind the wrist."""
        return SimpleNamespace(memory=_Memory(self, "hand-get"))

    @property
    def wrist(self) -> SimpleNamespace:
        """The wrist's own space."""
        return SimpleNamespace(memory=_Memory(self, "get"))

    @property
    def settings(self) -> dict[int, int]:
        """Raw settings of the ekso by their place."""
        return {place: int(self.ask(f"get {name}")) for name, place in SETTINGS.items()}


@dataclass
class _Memory:
    served: Served
    verb: str

    def __getitem__(self, place: slice) -> bytes:
        return bytes.fromhex(self.served.ask(f"{self.verb} {place.start} {place.stop - place.start}"))
