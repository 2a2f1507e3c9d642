"""A simulated BarrettHand BH8: the supervisory line, its echo and prompt, ^C, speed, power (barrett §3.6, §5.1, §5.2.4).

Written from the manual and from what is publicly known of the hand, by other means than the host. Where both are
silent the behaviour is invented and the comment says so; nothing seen here is evidence about a real hand.

    host   F G E T _ P CR                             each byte before CR is echoed as it arrives
    hand   F G E T _ P   LF CR 0 _ 0 _ 0 _ 0   LF CR = > _
"""

from __future__ import annotations

from handctl.sim.barrett_gcl import Answer, execute
from handctl.sim.barrett_hand import TEMPERATURE, Hand
from handctl.sim.barrett_memory import Memory
from handctl.sim.barrett_motor import NO_LOAD, STOPS
from handctl.sim.barrett_tables import BAUDS, NO_BOARD, NO_MOTOR, STATUS
from handctl.sim.model import NOTHING, Model, Options, Random, Reply

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

ABORT, RETURN = 3, 13  # ^C, CR
OBSTACLES = (9250.0, 9400.0, 9550.0)  # places of the fault "obstacle": P 9200, 9350, 9500 after HI
HOT = 702  # 0.1 °C

_OPTIONS = {
    "firmware": "4.33 (default), 4.34 (adds BD BP BS BDAT) or 4.4 (adds LCT LFBP LFAIN too)",
    "baud": "saved speed at the first start: 600 1200 2400 4800 9600 (default) 19200 38400",
    "max-baud": "highest speed that BAUD accepts (default 38400)",
    "initialized": "1: start as after HI (default 0: HI is needed)",
    "texts": "layout of FLIST, FLISTV, ?, ERR, VERS, all invented: values (default), names, prose",
    "prompt": "space (default): '=> '; bare: '=>' as the manual prints it",
    "line-end": "lfcr (default) or crlf",
    "line-limit": "longest line, 16..1000 characters (default 128); a longer one is an unknown command",
    "max-arguments": "most arguments of FGET, FSET, PGET, PSET, 1..200 (default 64); more are error 1024",
    "boot": "seconds from power on or RESET to the banner (default 1)",
    "align": "seconds that HI takes beside its movements (default 0.5)",
    "write-time": "seconds to program one byte of EEPROM, two bytes a value (default 0.01)",
    "otemp-stops": "what fails above OTEMP: all motor commands (default) or only movements",
    "hctl-clock": "clock of the motor controllers in MHz: 2.00 (default) or 1.25",
}
_FAULTS = {
    "no-echo": "the echo is missing, the answer comes",
    "hang": "the echo comes, the answer never; deaf until a power cycle",
    "no-abort": "^C is ignored during a movement",
    "blocked": "no motor can move",
    "obstacle": "an object stops F1 at about 9200, F2 at 9350, F3 at 9500",
    "strain": "the strain reading of F2 is 221",
    "strain-offset": "the strain reading of F3 without load is 188",
    "no-gauges": "all strain readings are 255",
    "hot": "70.2 °C for good",
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
SPEEDS = tuple(str(100 * baud) for baud in BAUDS)


class Device(Model):
    """The hand without its wire."""

    KIND = "barrett"
    HEADER = b"=> \n\r*:0E"
    OPTIONS = _OPTIONS
    FAULTS = _FAULTS

    def __init__(self, options: Options, random: Random) -> None:
        super().__init__(options, random)
        self.firmware = options.choice("firmware", "4.33", ("4.33", "4.34", "4.4"))
        baud = int(options.choice("baud", "9600", SPEEDS))
        self.fastest = int(options.choice("max-baud", "38400", SPEEDS)) // 100
        self.texts = options.choice("texts", "values", ("values", "names", "prose"))
        self._prompt = b"=> " if options.choice("prompt", "space", ("space", "bare")) == "space" else b"=>"
        self._end = b"\n\r" if options.choice("line-end", "lfcr", ("lfcr", "crlf")) == "lfcr" else b"\r\n"
        self._longest = options.whole("line-limit", 128, 16, 1000)
        self.most_arguments = options.whole("max-arguments", 64, 1, 200)
        self._boot_time = options.seconds("boot", 1.0, 60.0)
        self.write_time = options.seconds("write-time", 0.01, 1.0)
        self.heat_stops_all = options.choice("otemp-stops", "all", ("all", "movements")) == "all"
        clock = 2000000.0 if options.choice("hctl-clock", "2.00", ("2.00", "1.25")) == "2.00" else 1250000.0
        self._initialized = options.choice("initialized", "0", ("0", "1")) == "1"
        self.memory = Memory({"4.33": 433, "4.34": 434, "4.4": 440}[self.firmware], baud // 100)
        self.hand = Hand(self.memory, clock, options.seconds("align", 0.5, 60.0))
        self.hits = NOTHING  # faults that befall the present line
        self._hear = self._hear_line  # what takes the next byte: one method for each state of the firmware
        self._line = bytearray()
        self._open = False  # a line has begun
        self._noisy_echo = False  # the noise of this line befalls its echo
        self._until: float | None = None  # end of the restart or of the save under way
        self._waiting: Answer | None = None  # what the save will answer
        self._previous = b""
        self._cold = False
        self.speed = baud

    # -- power and time ------------------------------------------------------------------------------------------------

    def boot(self, now: float) -> None:
        super().boot(now)
        self.hand.now = now
        if self._until is not None:
            self._until = now + self._boot_time

    def power(self, on: bool) -> None:
        """Off: RAM values, initialization and half a line are gone; EEPROM, odometer, uptime and peak stay (§5.4.2)."""
        self.powered = on
        self._replies.clear()
        self.hand.power(on)
        self.hits = NOTHING
        if not on:
            self._cold = True
            self._until = self._waiting = None
        elif self._cold:
            self.restart()
        else:  # the first start of the simulator: the hand has been on for a while, its banner is long gone
            for motor in self.hand.motors:
                motor.initialized = self._initialized
                motor.origin = STOPS[motor.number]
                motor.place = motor.origin if self._initialized else motor.place
            self.dirty = True

    def restart(self) -> None:
        """Power on, and RESET, which is the same (§5.2.4): parameters from EEPROM, motors off, banner."""
        self.hand.power(self.powered)
        self.memory.load((0, 1, 2, 3))
        self.memory.load_common()
        self.speed = 100 * self.memory.common["BAUD"]
        self._line.clear()
        self._open = False
        self._waiting = None
        self._until = self.now + self._boot_time
        self._hear = self._hear_nothing
        self.dirty = True

    def advance(self, now: float) -> None:
        while self._until is not None and self._until <= now:
            self.now, self._until = self._until, None
            self._hear = self._hear_line
            if self._waiting is None:  # banner (our guess, apart from its first words)
                self._reply([b"BarrettHand Firmware", b"Version " + self.firmware.encode()], 0)
            else:
                self._finish(self._waiting)
                self._waiting = None
        self.hand.advance(now)
        self._check_movement()
        self.now = now

    def next_event(self) -> float | None:
        times = [when for when in (self._until, self.hand.next_event()) if when is not None]
        return min(times) if times else None

    def _check_movement(self) -> None:
        movement = self.hand.movement
        if movement is not None and not movement.running:
            self.now = max(self.now, movement.end)
            self.hand.movement = None
            self.dirty = True
            self._hear = self._hear_line
            self._finish(Answer(movement.code))

    # -- bytes in --------------------------------------------------------------------------------------------------------

    def due(self, pending: bytes) -> int | None:
        return 1 if pending else None  # each byte is echoed as it arrives

    def feed(self, data: bytes) -> None:
        for byte in data:
            self._hear(byte)

    def _hear_nothing(self, byte: int) -> None:
        """While it starts, saves, or hangs: bytes are lost (our guess)."""

    def _hear_movement(self, byte: int) -> None:
        """Only ^C is heard (§5.5 case 4); other bytes are lost (our guess)."""
        if byte == ABORT and "no-abort" not in self.hits:
            self.hand.stop()
            self._check_movement()

    def _hear_line(self, byte: int) -> None:
        """A line is typed (§5.1.1): no editing keys, LF is a character like any other (our guess)."""
        if not self._open:
            self._open = True
            self.hits = self.judge()
            if "stale" in self.hits and self._previous:
                self._replies.append(Reply(self.now, self._previous, self.hits & {"silent"}))
            self._noisy_echo = "noise" in self.hits and byte != RETURN and self.random.between(0, 1) == 1
        if "deaf" in self.hits:
            self._open = byte not in (ABORT, RETURN)
        elif byte == ABORT:  # a fresh prompt, as publicly known drivers expect; what was typed is forgotten
            self._line.clear()
            self._finish(Answer())
        elif byte == RETURN:
            self._run()
        else:
            if "no-echo" not in self.hits:
                befall = self.hits & {"silent", "noise"} if self._noisy_echo and not self._line else NOTHING
                self._replies.append(Reply(self.now, bytes([byte]), befall | (self.hits & {"silent"})))
            if len(self._line) <= self._longest:
                self._line.append(byte)

    def _run(self) -> None:
        text = self._line.decode("latin-1")
        self._line.clear()
        if "hang" in self.hits and text:
            self._hear = self._hear_nothing
            return
        answer = execute(self, text if len(text) <= self._longest else "(too long)")
        self.speed = 100 * self.memory.common["BAUD"]  # BAUD acts at once: the rest of the answer has the new speed
        if answer is None:
            if self.hand.movement is not None:
                self._hear = self._hear_movement
                self._check_movement()
        elif answer.seconds > 0.0:
            self._waiting, self._until = answer, self.now + answer.seconds
            self._hear = self._hear_nothing
        else:
            self._finish(answer)

    # -- answers ---------------------------------------------------------------------------------------------------------

    def _finish(self, answer: Answer) -> None:
        self._reply([line.encode("ascii") for line in answer.lines], answer.code)
        self._open = False

    def _reply(self, lines: list[bytes], code: int) -> None:
        """Each line, the status, and the prompt come after a line end of their own (§5.1.3)."""
        if code:
            lines = [*lines, b"ERR %d" % code]
        self._previous = b"".join(self._end + line for line in [*lines, self._prompt])
        hits = self.hits - {"stale"}  # that answer came before the echo
        self._replies.append(Reply(self.now, self._previous, hits - {"noise"} if self._noisy_echo else hits))

    # -- readings --------------------------------------------------------------------------------------------------------

    def read(self, name: str, number: int) -> int:
        """A motor parameter (§5.3)."""
        if self.memory.motor_rows[name][5] != STATUS:
            return self.memory.get(name, number)
        motor = self.hand.motors[number]
        motor.flipped = bool(self.memory.get("SGFLIP", number))
        if name == "S":
            return motor.status() | (520 if number == 2 and "unknown-codes" in self.faults else 0)
        if name == "OD":
            return motor.odometer(self.now)
        if name == "P":
            return motor.position(self.now)
        if name == "SG":
            return motor.gauge(self.now)
        return int(motor.broke) if name == "BD" else motor.broke_at

    def read_common(self, name: str) -> int:
        """A global parameter (§5.4)."""
        if name == "TEMP":
            return self.hand.tenths()
        if name == "PTEMP":
            return max(0, round(self.hand.peak))
        if name == "UPSECS":
            return int(self.hand.uptime + 0.000001) % 4294967296
        return self.hand.serial if name == "SN" else self.memory.common[name]

    # -- faults ----------------------------------------------------------------------------------------------------------

    @property
    def worn(self) -> bool:
        return "eeprom-worn" in self.faults

    def set_faults(self, faults: frozenset[str]) -> None:
        """Puts the states of the body in, and takes those away that are no longer wanted."""
        before, self.faults = self.faults, faults
        motors = self.hand.motors

        def change(name: str) -> bool | None:
            return True if name in faults else False if name in before else None

        for motor in motors:
            if (on := change("blocked")) is not None:
                motor.jammed = on
            if (on := change("no-gauges")) is not None:
                motor.no_load = 255 if on else NO_LOAD[motor.number]
            if (on := change("obstacle")) is not None and motor.number < 3:
                motor.obstacle = OBSTACLES[motor.number] if on else None
            if "not-homed" in faults:
                motor.initialized = False
        for name, number, code in (("no-board", 1, NO_BOARD), ("no-motor", 2, NO_MOTOR)):
            if (on := change(name)) is not None:
                motors[number].fault = code if on else 0
        if (on := change("strain")) is not None:
            motors[1].strain = 221 if on else None
        if (on := change("strain-offset")) is not None:
            motors[2].no_load = 188 if on else NO_LOAD[2]
        if (on := change("reversed")) is not None:
            motors[0].reversed = on
        if (on := change("breakaway")) is not None:
            motors[2].clutch = 2050.0 if on else None
        if {"hot", "over-temperature"} & (faults | before):
            self.hand.set_temperature(HOT if {"hot", "over-temperature"} & faults else int(TEMPERATURE))
        if "over-temperature" in faults and not self.memory.common["OTEMP"]:
            self.memory.common["OTEMP"] = self.memory.saved_common["OTEMP"] = 600
        self.hand.disturbed()

    def spoil(self, data: bytes) -> bytes:
        """There is no check value: one bit of the answer is wrong instead."""
        place = len(data) // 2
        return data[:place] + bytes([data[place] ^ 128]) + data[place + 1 :]

    def mishear(self, data: bytes, sent: int, heard: int) -> bytes | None:
        from handctl.sim import barrett_uart

        return barrett_uart.resample(data, sent, heard)

    # -- control and state, loaded on use ----------------------------------------------------------------------------

    def command(self, words: list[str]) -> str:
        from handctl.sim import barrett_control

        return barrett_control.command(self, words)

    def snapshot(self) -> dict[str, Any]:
        from handctl.sim import barrett_control

        return barrett_control.snapshot(self)

    def restore(self, state: dict[str, Any]) -> None:
        from handctl.sim import barrett_control

        barrett_control.restore(self, state)
