"""What the parts of the simulated BarrettHand see of the whole: options, states, faults, parameters, readings.

The parts are GCL, RealTime mode and the boot monitor; device.py puts them together and has the line.
"""

from __future__ import annotations

from handctl.sim.barrett.mechanics import NO_LOAD, TEMPERATURE, Hand
from handctl.sim.barrett.parameter_tables import BAUDS, NO_BOARD, NO_MOTOR, STATUS, Memory
from handctl.sim.engine.simulated_device import NOTHING, Model, Options, Random

TYPE_CHECKING = False  # a simulator loads without the typing module
if TYPE_CHECKING:
    from typing import Any

STATES = ("ready", "off", "boot", "monitor", "record", "loop", "loop-block", "loop-moving", "moving", "saving", "typed")
"""In which a client may find the hand: what somebody, or a program that died, has left behind; those of the dossier's connect."""
OBSTACLES = (9250.0, 9400.0, 9550.0)  # places of the fault "obstacle": P 9200, 9350, 9500 after HI
HOT = 702  # 0.1 °C

OPTIONS = {
    "firmware": (("4.33", "4.34", "4.4"), "4.33 (default), 4.34 (adds BD BP BS BDAT) or 4.4 (adds LCT LFBP LFAIN too)"),
    "baud": (("9600", tuple(str(100 * baud) for baud in BAUDS)), "saved baud rate at the first start: 600 1200 2400 4800 9600 (default) 19200 38400"),
    "max-baud": (("38400", tuple(str(100 * baud) for baud in BAUDS)), "highest speed that BAUD accepts (default 38400)"),
    "initialized": (False, "1: start as after HI (default 0: HI is needed)"),
    "texts": (("values", "names", "prose"), "layout of FLIST, FLISTV, ?, ERR, VERS, all invented: values (default), names, prose"),
    "prompt": (("space", "bare"), "space (default): '=> '. bare: '=>' as the manual prints it"),
    "position-sign": (("signed", "unsigned", "clamped"), "how a position below 0 is printed, on the stop side of the origin: signed (-50, default), unsigned (65486) or clamped (0)"),
    "line-end": (("lfcr", "crlf"), "lfcr (default) or crlf"),
    "line-limit": ((128, 16, 1000), "longest line, 16..1000 characters (default 128). A longer one is an unknown command"),
    "max-arguments": ((64, 1, 200), "most arguments of FGET, FSET, PGET, PSET, 1..200 (default 64). More are error 1024"),
    "boot": ((1.0, 60.0), "seconds from power on or RESET to the banner, with the window of the boot monitor (default 1)"),
    "found": (STATES, "state at the first start: ready (default), off, boot (just switched on), monitor (no firmware), loop, moving, saving. Also: record (a download was cut off), loop-block (in the middle of a control block), loop-moving, typed (half a line: C)"),
    "uart": (("mid", "sci"), "the hand's receiver at a wrong baud rate: mid (default, one sample a bit) or sci (16 samples a bit)"),
    "align": ((0.5, 60.0), "seconds that HI takes besides its movements (default 0.5)"),
    "write-time": ((0.01, 1.0), "seconds to program one byte of EEPROM, two bytes a value (default 0.01)"),
    "otemp-stops": (("all", "movements"), "what fails above OTEMP: all motor commands (default) or only movements"),
    "hctl-clock": (("2.00", "1.25"), "clock of the motor controllers in MHz: 2.00 (default) or 1.25"),
    "temperature": ((int(TEMPERATURE), -550, 1250), "temperature of the CPU board at the first start, -550..1250 in 0.1 °C (default 412)"),
    "no-load": (("112,119,126", 0, 255), "strain readings without load, N,N,N for F1,F2,F3 (default 112,119,126)"),
}  # fmt: skip
FAULTS = {
    "no-echo": "the echo is missing, the answer arrives",
    "hang": "the echo arrives, the answer does not, and the hand is deaf until a power cycle",
    "no-abort": "^C is ignored during a movement",
    "blocked": "no motor can move",
    "obstacle": "an object stops F1 at about 9200, F2 at 9350, F3 at 9500",
    "strain": "the strain reading of F2 is 221",
    "strain-offset": "the strain reading of F3 without load is 188",
    "no-gauges": "all strain readings are 255",
    "hot": "70.2 °C, which does not fall",
    "over-temperature": "hot, and OTEMP is 600 unless it is set",
    "not-homed": "no motor is initialized",
    "no-board": "F2 has no motor board (status 1)",
    "no-motor": "F3 has no motor (status 2)",
    "reversed": "F1 moves the wrong way",
    "breakaway": "the clutch of F3 lets go at 2000",
    "eeprom-worn": "saves are counted but not kept",
    "erratic": "decayed firmware: some commands are unknown, some values have a wrong bit",
    "unknown-codes": "the status of F3 has the unused codes 8 and 512",
}
OF_MOTORS = {  # fault -> motors, attribute, values while it lasts, value otherwise
    "blocked": ((0, 1, 2, 3), "jammed", (True,) * 4, False),
    "no-gauges": ((0, 1, 2, 3), "no_load", (255,) * 4, None),
    "obstacle": ((0, 1, 2), "obstacle", OBSTACLES, None),
    "no-board": ((1,), "fault", (NO_BOARD,), 0),
    "no-motor": ((2,), "fault", (NO_MOTOR,), 0),
    "strain": ((1,), "strain", (221,), None),
    "strain-offset": ((2,), "no_load", (188,), None),
    "reversed": ((0,), "reversed", (True,), False),
    "breakaway": ((2,), "clutch", (2050.0,), None),
}


class Board(Model):
    """The hand without its line. `loop` is RealTime mode while the hand is in it."""

    KIND = "barrett"
    CONTROL = "handctl.sim.barrett.control_commands"
    monitor: Any
    loop: Any

    def __init__(self, options: Options, random: Random) -> None:
        super().__init__(options, random)
        given = self.given
        firmware = {"4.33": 433, "4.34": 434, "4.4": 440}[given["firmware"]]
        self.memory = Memory(firmware, int(given["baud"]) // 100, int(given["max-baud"]) // 100)
        self.hand = Hand(self.memory, 1000000.0 * float(given["hctl-clock"]), given["align"])
        self.hand.set_temperature(given["temperature"])
        self.no_load = (*given["no-load"], NO_LOAD[3])
        for motor in self.hand.motors:
            motor.no_load = self.no_load[motor.number]
        self.off_since = 0.0  # s, when the power went; earlier if somebody has let time pass
        self.hits = NOTHING  # faults that befall the present line

    @property
    def version(self) -> str:
        """What the hand says of itself; the commands stay those of the option firmware."""
        return str(self.monitor.image.version or self.given["firmware"])

    # -- what the parts ask of the line -----------------------------------------------------------------------------------

    def settle(self) -> None:
        """The hand has been on for a while: at its prompt, or in the boot monitor for want of a firmware."""

    def reset(self) -> None:
        """RESET is the same as power on (§5.2.4); whether it passes the boot monitor is not known."""

    def restart(self, began: float) -> None:
        """The firmware starts: parameters from EEPROM, motors off, and the banner some time after `began`."""

    def hang(self) -> None:
        """Deaf until a power cycle."""

    def post(self, data: bytes) -> None:
        """Bytes of RealTime mode or of the boot monitor, with the faults of the present request.

        The first byte of a sound answer goes by itself: a client may act on it before the rest has come.
        """

    def enter_loop(self, motors: tuple[int, ...]) -> None:
        """RealTime mode of these motors begins."""

    def leave_loop(self, code: int) -> None:
        """Back to the prompt, with a status if it is not 0 (§6.1). What the motors do then is not known."""

    # -- readings --------------------------------------------------------------------------------------------------------

    def read(self, name: str, number: int) -> int:
        """A motor parameter (§5.3)."""
        if self.memory.motor.rows[name][5] != STATUS:
            return self.memory.motor.get(name, number)
        motor = self.hand.motors[number]
        motor.flipped = bool(self.memory.motor.get("SGFLIP", number))
        if name == "S":
            return motor.status() | (520 if number == 2 and "unknown-codes" in self.faults else 0)
        if name == "OD":
            return motor.odometer(self.now)
        if name == "P":
            return self.shown(motor.position(self.now))
        if name == "SG":
            return motor.gauge(self.now)
        return int(motor.broke) if name == "BD" else self.shown(motor.broke_at)

    def placed(self, position: int) -> int:
        """A position as the firmware counts it: whether below 0 at all, the manual does not say (§5.3.2, option position-sign)."""
        return max(0, position) if self.given["position-sign"] == "clamped" else position

    def shown(self, position: int) -> int:
        """The number that is printed for it."""
        return position & 65535 if self.given["position-sign"] == "unsigned" else self.placed(position)

    def read_common(self, name: str) -> int:
        """A global parameter (§5.4)."""
        if name == "TEMP":
            return self.hand.tenths()
        if name == "PTEMP":
            return max(0, round(self.hand.peak))
        if name == "UPSECS":
            return int(self.hand.uptime + 0.000001) % 4294967296
        return self.hand.serial if name == "SN" else self.memory.common.get(name)

    # -- faults ----------------------------------------------------------------------------------------------------------

    def set_faults(self, faults: frozenset[str]) -> None:
        """Puts the states of the body in, and takes away those that are no longer wanted."""
        before, self.faults = self.faults, faults
        if "blank-firmware" in faults:
            self.monitor.erase()
            self.settle()
        for name, (numbers, attribute, wrong, right) in OF_MOTORS.items():
            for number, value in zip(numbers, wrong, strict=True) if name in faults | before else ():
                usual = self.no_load[number] if attribute == "no_load" else right
                setattr(self.hand.motors[number], attribute, value if name in faults else usual)
        for motor in self.hand.motors if "not-homed" in faults else ():
            motor.initialized = False
        hot = {"hot", "over-temperature"}
        if hot & (faults | before):
            self.hand.set_temperature(HOT if hot & faults else self.given["temperature"])
        if "over-temperature" in faults and not self.memory.common.get("OTEMP"):
            self.memory.common.values["OTEMP"] = [600]
            self.memory.common.saved["OTEMP"] = [600]
        self.hand.disturbed()
