"""A simulated BarrettHand BH8: the supervisory line, its echo and prompt, ^C, speed, power (barrett §3.6, §5.1, §5.2.4).

GCL is in gcl.py, RealTime mode in loop.py, the boot monitor in monitor.py; what they see of this is in board.py.

Written from the manual and from what is publicly known of the hand, by other means than the host. Where both are
silent the behaviour is invented and the comment says so; nothing seen here is evidence about a real hand.

    host   F G E T _ P CR                             each byte before CR is echoed as it arrives
    hand   F G E T _ P   LF CR 0 _ 0 _ 0 _ 0   LF CR = > _
"""

from __future__ import annotations

from handctl.sim.barrett import found, loop, monitor
from handctl.sim.barrett import options as barrett_options
from handctl.sim.barrett.answer import Answer
from handctl.sim.barrett.gcl import execute
from handctl.sim.barrett.hand import TEMPERATURE, Hand
from handctl.sim.barrett.memory import Memory
from handctl.sim.barrett.motor import NO_LOAD, STOPS
from handctl.sim.barrett.tables import BAUDS, STATUS, TOO_HOT
from handctl.sim.engine.model import NOTHING, Model, Options, Random, Reply

TYPE_CHECKING = False
if TYPE_CHECKING:
    pass

ABORT, RETURN = 3, 13  # ^C, CR
SPEEDS = tuple(str(100 * baud) for baud in BAUDS)


class Device(Model):
    """The hand without its wire."""

    KIND = "barrett"
    USE = "handctl.sim.barrett.use"
    CONTROL = "handctl.sim.barrett.control"
    HEADER = b"=> \n\r*:0E"
    OPTIONS = barrett_options.OPTIONS
    FAULTS = barrett_options.FAULTS

    def __init__(self, options: Options, random: Random) -> None:
        super().__init__(options, random)
        self.firmware = options.choice("firmware", "4.33", ("4.33", "4.34", "4.4"))
        baud = int(options.choice("baud", "9600", SPEEDS))
        self.fastest = int(options.choice("max-baud", "38400", SPEEDS)) // 100
        self.texts = options.choice("texts", "values", ("values", "names", "prose"))
        self._prompt = b"=> " if options.choice("prompt", "space", ("space", "bare")) == "space" else b"=>"
        self._end = b"\n\r" if options.choice("line-end", "lfcr", ("lfcr", "crlf")) == "lfcr" else b"\r\n"
        self._longest = options.integer("line-limit", 128, 16, 1000)
        self.most_arguments = options.integer("max-arguments", 64, 1, 200)
        self._boot_time = options.seconds("boot", 1.0, 60.0)
        self._receiver = options.choice("uart", "mid", ("mid", "sci"))
        self._found = options.choice("found", "ready", found.STATES)
        self.reset_monitor = options.choice("reset-monitor", "0", ("0", "1")) == "1"
        self.loop_stops = options.choice("loop-exit", "run", ("run", "stop")) == "stop"
        self._loop_jump = barrett_options.numbers(options, "loop-jump", "0,0,0,0", -20000, 20000)
        self.loop_after = options.integer("loop-after", 0, 0, 1000000000)
        self.loop_code = options.integer("loop-code", 1, 1, 32767)
        self.lfv_per_10_ms = options.choice("lfv-unit", "sample", ("sample", "10ms")) == "10ms"
        self._switches = barrett_options.switches(options)  # moments at which the switch is turned
        self.write_time = options.seconds("write-time", 0.01, 1.0)
        self.heat_stops_all = options.choice("otemp-stops", "all", ("all", "movements")) == "all"
        clock = 2000000.0 if options.choice("hctl-clock", "2.00", ("2.00", "1.25")) == "2.00" else 1250000.0
        self._initialized = options.choice("initialized", "0", ("0", "1")) == "1"
        self.memory = Memory({"4.33": 433, "4.34": 434, "4.4": 440}[self.firmware], baud // 100)
        self.hand = Hand(self.memory, clock, options.seconds("align", 0.5, 60.0))
        self.usual_temperature = options.integer("temperature", int(TEMPERATURE), -550, 1250)
        self.hand.set_temperature(self.usual_temperature)
        self.no_load = (*barrett_options.numbers(options, "no-load", "112,119,126", 0, 255), NO_LOAD[3])
        for motor in self.hand.motors:
            motor.no_load = self.no_load[motor.number]
        self.monitor = monitor.Monitor(self, options, self._boot_time)
        self.off_since = 0.0  # s, when the power went; earlier if somebody has let time pass
        self.loop: loop.Loop | None = None
        self.hits = NOTHING  # faults that befall the present line
        self._hear = self._hear_line  # what takes the next byte: one method for each state of the firmware
        self._line = bytearray()
        self._open = False  # a line has begun
        self._noisy_echo = False  # the noise of this line befalls its echo
        self._until: float | None = None  # end of the restart or of the save under way
        self._waiting: Answer | None = None  # what the save will answer
        self._previous = b""
        self._cold = False
        self._speaking = False  # the banner is out, its prompt is not
        self.banner_gap = options.seconds("banner-gap", 0.0, 60.0)
        self.speed = baud

    # -- power and time ------------------------------------------------------------------------------------------------

    @property
    def version(self) -> str:
        """What the hand says of itself; the commands stay those of the option firmware."""
        return self.monitor.image.version or self.firmware

    def boot(self, now: float) -> None:
        super().boot(now)
        self.hand.now = self.off_since = now
        self._switches = [now + seconds for seconds in self._switches]
        if self.monitor.until is not None:
            self.monitor.boot(now)
        if self._found != "ready":
            found.put(self, self._found)

    def power(self, on: bool) -> None:
        self.powered = on
        self._switch(on)

    def _switch(self, on: bool) -> None:
        """Off: RAM values, initialization and half a line are gone; EEPROM, odometer, uptime and peak stay (§5.4.2)."""
        self._replies.clear()
        self.hand.power(on)
        self.hits = NOTHING
        self._until = self._waiting = self.monitor.until = self.loop = None
        if not on:
            self._cold = True
            self.off_since = self.now
            self._hear = self._hear_nothing
        elif self._cold:
            self.monitor.age(self.now - self.off_since)
            self._enter_monitor()
        else:  # the first start of the simulator: the hand has been on for a while, its banner is long gone
            for motor in self.hand.motors:
                motor.initialized = self._initialized
                motor.origin = STOPS[motor.number]
                motor.place = motor.origin if self._initialized else motor.place
            self.settle()
        self.dirty = True

    def settle(self) -> None:
        """The hand has been on for a while: at its prompt, or in the boot monitor for want of a firmware."""
        self.speed = 100 * self.memory.common["BAUD"]
        self._hear = self._hear_line
        if not self.monitor.image.valid:
            self.monitor.sit()
            self._hear = self.monitor.hear

    def _enter_monitor(self) -> None:
        self._line.clear()
        self._open = self._noisy_echo = False
        self._hear = self.monitor.hear
        self.monitor.start()

    def reset(self) -> None:
        """RESET is the same as power on (§5.2.4); whether it passes the boot monitor is not known."""
        if self.reset_monitor:
            self.hand.power(True)
            self._until = self._waiting = None
            self._enter_monitor()
        else:
            self.restart(self.now)

    def restart(self, began: float) -> None:
        """The firmware starts: parameters from EEPROM, motors off, and the banner some time after `began`."""
        self.hand.power(True)
        self.memory.load((0, 1, 2, 3))
        self.memory.load_common()
        self.speed = 100 * self.memory.common["BAUD"]
        self._line.clear()
        self._open = self._noisy_echo = False
        self.loop = self._waiting = None
        self._until = max(self.now, began + self._boot_time)
        self._hear = self._hear_nothing
        self._speaking = False
        self.dirty = True

    def hang(self) -> None:
        """Deaf until a power cycle."""
        self._hear = self._hear_nothing

    def advance(self, now: float) -> None:
        while (event := self._timer()) is not None and event <= now:
            self.now = max(self.now, event)
            if self._switches and event == self._switches[0]:
                del self._switches[0]
                self._switch(len(self._switches) % 2 == 0)
            elif event == self._until:
                self._until = None
                self._wake()
            else:
                self.monitor.expire()
        self.hand.advance(now)
        self._check_movement()
        self.now = now

    def _wake(self) -> None:
        """The restart, or the save, is over."""
        self._hear = self._hear_line
        if self._waiting is None and not self._speaking:  # banner (our guess, apart from its first words)
            banner = self._end + b"BarrettHand Firmware" + self._end + b"Version " + self.version.encode()
            held, self.monitor.held = self.monitor.held, b""
            if self.banner_gap:
                self._replies.append(Reply(self.now, held + banner, self.hits))
                self._speaking, self._hear, self._until = True, self._hear_nothing, self.now + self.banner_gap
            else:
                self._replies.append(Reply(self.now, held + banner + self._end + self._prompt, self.hits))
        elif self._waiting is None:
            self._speaking = False
            self._reply([], 0)
        else:
            self._finish(self._waiting)
            self._waiting = None

    def _timer(self) -> float | None:
        times = [when for when in (self._until, self.monitor.until, *self._switches[:1]) if when is not None]
        return min(times) if times else None

    def next_event(self) -> float | None:
        times = [when for when in (self._timer(), self.hand.next_event()) if when is not None]
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
            if self.monitor.image.decayed:
                self.hits |= {"erratic"}
            self._post_stale()
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
            self.hang()
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

    def _post_stale(self) -> None:
        if "stale" in self.hits and self._previous:
            self._replies.append(Reply(self.now, self._previous, self.hits & {"silent"}))

    def post(self, data: bytes) -> None:
        """Bytes of RealTime mode or of the boot monitor, with the faults of the present request.

        The first byte of a sound answer goes by itself: a client may act on it before the rest has come.
        """
        hits = self.hits - {"stale"} - ({"noise"} if self._noisy_echo else NOTHING)
        self._post_stale()
        pieces = (data,) if hits else (data[:1], data[1:])
        self._replies += [Reply(self.now, piece, hits) for piece in pieces if piece]
        self._previous = data

    # -- RealTime mode ---------------------------------------------------------------------------------------------------

    def enter_loop(self, motors: tuple[int, ...]) -> None:
        self.loop = loop.Loop(self, motors)
        self._hear = self.loop.hear
        self.hits -= {"stale"}  # that answer came before the echo
        self.post(b"*")
        self._noisy_echo = False
        for motor, counts in zip(self.hand.motors, self._loop_jump, strict=True):
            if counts:
                motor.jump(self.now, motor.position(self.now) + counts)

    def leave_loop(self, code: int) -> None:
        """Back to the prompt, with a status if it is not 0 (§6.1). What the motors do then is not known."""
        for motor in self.loop.motors if self.loop is not None else ():
            if self.loop_stops or code == TOO_HOT:
                motor.cruise(self.now, 0.0)
                motor.powered = code != TOO_HOT and bool(self.memory.get("HOLD", motor.number))
        self.loop = None
        self._hear = self._hear_line
        self._post_stale()
        self._finish(Answer(code))
        self.dirty = True

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
        before, self.faults = self.faults, faults
        barrett_options.apply_faults(self, before)

    def spoil(self, data: bytes) -> bytes:
        """There is no check value: one bit of the answer is wrong instead."""
        place = len(data) // 2
        return data[:place] + bytes([data[place] ^ 128]) + data[place + 1 :]

    def mishear(self, data: bytes, sent: int, heard: int) -> bytes | None:
        from handctl.sim.barrett import uart

        return uart.resample(data, sent, heard, self._receiver)
