"""A simulated BarrettHand BH8: the supervisory line, its echo and prompt, ^C, speed, power (barrett §3.6, §5.1, §5.2.4).

GCL is in gcl.py, RealTime mode in realtime_loop.py, the boot monitor in boot_monitor.py; what they see of this is in shared_state.py.

Written from the manual and from what is publicly known of the hand, by other means than the host. Where both are
silent the behaviour is invented and the comment says so; nothing seen here is evidence about a real hand.

    host   F G E T _ P CR                             each byte before CR is echoed as it arrives
    hand   F G E T _ P   LF CR 0 _ 0 _ 0 _ 0   LF CR = > _
"""

from __future__ import annotations

from handctl.sim.barrett import boot_monitor, realtime_loop, shared_state
from handctl.sim.barrett.gcl import Answer, execute
from handctl.sim.barrett.mechanics import OFFSETS
from handctl.sim.barrett.parameter_tables import TOO_HOT
from handctl.sim.barrett.shared_state import Board
from handctl.sim.engine.simulated_device import NOTHING, Options, Random, Reply, Rows, soonest

TYPE_CHECKING = False  # a simulator loads without the typing module
if TYPE_CHECKING:
    from typing import Any

ABORT, RETURN = 3, 13  # ^C, CR
_OPTIONS = {**shared_state.OPTIONS, **realtime_loop.OPTIONS, **boot_monitor.OPTIONS}
_FAULTS = {**shared_state.FAULTS, **realtime_loop.FAULTS, **boot_monitor.FAULTS}


class Device(Board):
    """The hand without its wire."""

    HEADER = b"=> \n\r*:0E"
    OPTIONS = Rows(_OPTIONS)
    FAULTS = _FAULTS

    def __init__(self, options: Options, random: Random) -> None:
        super().__init__(options, random)
        self._prompt = b"=> " if self.given["prompt"] == "space" else b"=>"
        self._end = b"\n\r" if self.given["line-end"] == "lfcr" else b"\r\n"
        self._switches = switches(options)  # moments at which the switch is turned
        self.monitor = boot_monitor.Monitor(self)
        self.loop: realtime_loop.Loop | None = None
        self._paced = options.text("reply-times") is not None  # each byte of an echo takes a time of its own
        self._hear = self._hear_line  # what takes the next byte: one method for each state of the firmware
        self._line = bytearray()
        self._open = False  # a line has begun
        self._noisy_echo = False  # the noise of this line befalls its echo
        self._until: float | None = None  # end of the restart or of the save under way
        self._waiting: Answer | None = None  # what the save will answer
        self._previous = b""
        self._cold = False
        self._speaking = False  # the banner is out, its prompt is not
        self.speed = int(self.given["baud"])

    # -- power and time ------------------------------------------------------------------------------------------------

    def boot(self, now: float) -> None:
        super().boot(now)
        self.hand.now = self.off_since = now
        self._switches = [now + seconds for seconds in self._switches]
        if self.monitor.until is not None:
            self.monitor.boot(now)
        if self.given["found"] != "ready":
            control: Any = self._control()
            control.find(self, self.given["found"])

    def power(self, on: bool) -> None:
        self.powered = on
        self._switch(on)

    def _switch(self, on: bool) -> None:
        """Off: RAM values, initialization and half a line are gone; EEPROM, odometer, uptime and peak stay (§5.4.2)."""
        self.replies.clear()
        self.hand.power(on)
        self.hits = NOTHING
        self._until = self._waiting = self.monitor.until = self.loop = None
        if not on:
            self._cold = True
            self.monitor.power_off()
            self.off_since = self.now
            self._hear = self._hear_nothing
        elif self._cold:
            self.monitor.age(self.now - self.off_since)
            self._enter_monitor()
        else:  # the first start of the simulator: the hand has been on for a while, its banner is long gone
            for motor in self.hand.motors:
                motor.initialized = self.given["initialized"]
                motor.origin = OFFSETS[motor.number]
                motor.place = motor.origin if motor.initialized else motor.place
            self.settle()
        self.dirty = True

    def settle(self) -> None:
        self.speed = self.memory.speed
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
        if self.given["reset-monitor"]:
            self.hand.power(True)
            self._until = self._waiting = None
            self._enter_monitor()
        else:
            self.restart(self.now)

    def restart(self, began: float) -> None:
        self.hand.power(True)
        self.memory.load()
        self.speed = self.memory.speed
        self._line.clear()
        self._open = self._noisy_echo = False
        self.loop = self._waiting = None
        self._until = max(self.now, began + self.given["boot"])
        self._hear = self._hear_nothing
        self._speaking = False
        self.dirty = True

    def hang(self) -> None:
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
        if self.hand.movement is not None:
            self._check_movement()
        self.now = now

    def _wake(self) -> None:
        """The restart, or the save, is over."""
        self._hear = self._hear_line
        if self._waiting is None and not self._speaking:  # banner (our guess, apart from its first words)
            banner = self._end + b"BarrettHand Firmware" + self._end + b"Version " + self.version.encode()
            held, self.monitor.held = self.monitor.held, b""
            if self.given["banner-gap"]:
                self.replies.append(Reply(self.now, held + banner, self.hits))
                self._speaking, self._hear, self._until = True, self._hear_nothing, self.now + self.given["banner-gap"]
            else:
                self.replies.append(Reply(self.now, held + banner + self._end + self._prompt, self.hits))
        elif self._waiting is None:
            self._speaking = False
            self._reply([], 0)
        else:
            self._finish(self._waiting)
            self._waiting = None

    def _timer(self) -> float | None:
        if self._until is None and self.monitor.until is None and not self._switches:
            return None
        return soonest(self._until, self.monitor.until, *self._switches[:1])

    def next_event(self) -> float | None:
        timer = self._timer()
        return timer if self.hand.movement is None else soonest(timer, self.hand.next_event())

    def _check_movement(self) -> None:
        movement = self.hand.movement
        if movement is not None and not movement.running:
            self.now = max(self.now, movement.end)
            self.hand.movement = None
            self.dirty = True
            self._hear = self._hear_line
            self._finish(Answer(movement.code))

    # -- bytes in --------------------------------------------------------------------------------------------------------

    def together(self, pending: bytes) -> int:
        if self._hear != self._hear_line:
            return 1
        ends = [place for place in map(pending.find, (ABORT, RETURN)) if place >= 0]
        return max(
            1, min(ends, default=len(pending))
        )  # it does nothing until then, and the echo has the speed of before

    def feed(self, data: bytes) -> None:
        if len(data) > 1 and self._hear == self._hear_line and not {ABORT, RETURN} & {*data} and not self._paced:
            self._hear_line(data[0])
            if not self.hits:
                self.replies[-1].data = data
                self._line += data[1 : self.given["line-limit"] + 2 - len(self._line)]
                return
            data = data[1:]
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
                self.replies.append(Reply(self.now, bytes([byte]), befall | (self.hits & {"silent"})))
            if len(self._line) <= self.given["line-limit"]:
                self._line.append(byte)

    def _run(self) -> None:
        text = self._line.decode("latin-1")
        self._line.clear()
        if "hang" in self.hits and text:
            self.hang()
            return
        answer = execute(self, text if len(text) <= self.given["line-limit"] else "(too long)")
        self.speed = self.memory.speed  # BAUD acts at once: the rest of the answer has the new speed
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
        self.replies.append(Reply(self.now, self._previous, hits - {"noise"} if self._noisy_echo else hits))

    def _post_stale(self) -> None:
        if "stale" in self.hits and self._previous:
            self.replies.append(Reply(self.now, self._previous, self.hits & {"silent"}))

    def post(self, data: bytes) -> None:
        hits = self.hits - {"stale"} - ({"noise"} if self._noisy_echo else NOTHING)
        self._post_stale()
        pieces = (data,) if hits else (data[:1], data[1:])
        self.replies += [Reply(self.now, piece, hits) for piece in pieces if piece]
        self._previous = data

    # -- RealTime mode ---------------------------------------------------------------------------------------------------

    def enter_loop(self, motors: tuple[int, ...]) -> None:
        self.loop = realtime_loop.Loop(self, motors)
        self._hear = self.loop.hear
        self.hits -= {"stale"}  # that answer came before the echo
        self.post(b"*")
        self._noisy_echo = False
        for motor, counts in zip(self.hand.motors, self.given["loop-jump"], strict=True):
            if counts:
                motor.jump(self.now, motor.position(self.now) + counts)

    def leave_loop(self, code: int) -> None:
        for motor in self.loop.motors if self.loop is not None else ():
            if self.given["loop-exit"] == "stop" or code == TOO_HOT:
                motor.cruise(self.now, 0.0)
                motor.powered = code != TOO_HOT and bool(self.memory.motor.get("HOLD", motor.number))
        self.loop = None
        self._hear = self._hear_line
        self._post_stale()
        self._finish(Answer(code))
        self.dirty = True

    # -- faults ----------------------------------------------------------------------------------------------------------

    def spoil(self, data: bytes) -> bytes:
        """There is no check value: one bit of the answer is wrong instead."""
        place = len(data) // 2
        return data[:place] + bytes([data[place] ^ 128]) + data[place + 1 :]

    def mishear(self, data: bytes, sent: int, heard: int) -> bytes | None:
        from handctl.sim.bus.wire_pair import resample

        return resample(data, sent, heard, self.given["uart"])


def switches(options: Options) -> list[float]:
    """The option switch: moments in ascending order, off and on by turns, on at last."""
    text = options.text("switch")
    if text is None:
        return []
    times = [Options(options.kind, {"switch": t}, ["switch"]).seconds("switch", 0.0, 1e9) for t in text.split(",")]
    if len(times) % 2 or times != sorted(times):
        raise ValueError(f"option switch={text}: use ascending seconds, alternating off and on, such as 2,8")
    return times
