"""A simulated AIDIN-hand: the TCP server's side of the JSON exchange, the modes, homing, the stream of feedback.

Written from the manual alone. It names keys, modes and ranges; who speaks first, how often, what a refused command
does and most else is silent, so what is done here is a guess that an option can turn into another one. Nothing seen
here is evidence about a real hand. There is no id, no check value and no serial speed: of the faults of the line
wrong-id, twin-id and garble change nothing, bad-checksum makes one byte of the feedback no UTF-8, and refuse means that
commands are not carried out (there is no error message). A power cut does not close the connection; it goes silent.
"""

from __future__ import annotations

from handctl.sim.aidin.json_text import RADIANS, TEXT_FAULTS, TEXT_OPTIONS, Reader, Writer
from handctl.sim.aidin.mechanics import HOMING, JOINTS, STARTS, STROKES, TIPS, Hand, Motor, from_joints, from_tips
from handctl.sim.engine.simulated_device import Model, Options, Random, Reply, Rows, soonest

TYPE_CHECKING = False  # a simulator loads without the typing module
if TYPE_CHECKING:
    from typing import Any

LONGEST = 10.0  # s for a whole stroke with a tenth of the torque
HOLD = 3.0  # s that mode 1 must be held (Homing mode)
GAP = 0.25  # s between two objects of mode 1 that still count as held (our guess)
FORGET = 1.0  # s of silence after which half an object is forgotten: its client is taken to have left (our guess)
UNSENT = 100  # feedback objects kept for a client that does not read; older ones are lost (our guess)
PIECE = 0.0002  # s between the writes of one object in pieces
STALL = 0.04  # s that Nagle's algorithm holds the second small write back, until the delayed acknowledge
EXACT = 1e-9  # rounding of a limit that was converted to radians
MODES = (1, 2, 3, 4, 5, 10, 22, 32, 41)

# Ranges on the wire (the manual's list at the end): counts, radians (none for q4), mm; currents are assumed.
COUNTS = [(0.0, float(stroke)) for row in STROKES for stroke in row]
RADIAN = [pair for row in JOINTS for pair in (*((low * RADIANS, high * RADIANS) for low, high in row), (-1e15, 1e15))]
PLACES = [(float(low), float(high)) for row in TIPS for low, high in row]
CURRENTS = [(-1000.0, 1000.0)] * 15
DATA = {  # mode -> key, ranges, whether the values must be whole
    10: ("hand_TP_cmd", COUNTS, True),
    22: ("hand_joint_cmd", RADIAN, False),
    32: ("hand_taskspace_cmd", PLACES, False),
    41: ("hand_TT_cmd", CURRENTS, True),
}

_OPTIONS = {
    "start": (STARTS, "used (default: on for a while, moved by hand, not homed), homed (the same, homed), open (homed, at the origin, sensors alike), cold (just switched on: encoders 0, not homed)"),
    "exchange": (("stream", "poll", "command", "mute"), "who speaks first: stream (default, the hand), poll (an answer to each object), command (an answer to those with hand_mode), mute"),
    "rate": ((100, 1, 1000), "feedback objects a second in the stream, 1..1000 (default 100)"),
    "merge": ((1, 1, 10), "stream: this many objects in one write, 1..10 (default 1)"),
    "chunk": ((0, 0, 65536), "bytes of feedback per write (default 0: all in one)"),
    "nagle": (False, "1: with chunk, all but the first write are held back for 40 ms"),
    "limits": (("ignore", "clamp", "obey"), "values out of range: ignore (default, the whole object), clamp, obey"),
    "unhomed": (("ignore", "obey"), "position modes before homing: ignore (default) or obey (false origin)"),
    "homing": (("repeat", "latched"), "mode 1 is held by repeating it within 0.25 s (repeat, default) or until another mode comes (latched)"),
    "neutral": (("ignored", "interrupts"), "an object without hand_mode during homing: ignored (default) or interrupts"),
    "current-maxtorque": (("before", "with"), "mode 41 needs maxtorque 1000 set before (default), or takes it from the same object (with)"),
    "q4": (("same", "half", "zero"), "q4 as fed back: same (default, equals q3), half (90° + q3/2), zero"),
    "load": (True, "1 (default): holding a position costs current. 0: it costs none"),
    "noise": (False, "1: sensors and currents are never quite still"),
    "motor": ((-1, 0, 14), "0..14: the motor of the faults held, stall, creep, stiff and one-way (default: by the seed)"),
    "give": ((450, 0, 440000), "held: counts that the motor gives, 0..440000 (default 450)"),
    "stall-at": ((60, 0, 100), "stall: share of its way to open, 0..100 percent (default 60)"),
    "creep": ((2000, 1, 100000), "creep: counts a second, 1..100000 (default 2000)"),
    "drift": ((0, 0, 10000), "drift of the force channels, thousandths of a unit a minute, 0..10000 (default 0)"),
    **TEXT_OPTIONS,
}  # fmt: skip
_FAULTS = {
    **TEXT_FAULTS,
    "blocked": "no motor can move",
    "dead-motor": "motor 3 of the ring finger has no power",
    "no-homing": "homing opens the fingers but does not set the origin",
    "no-bias": "the sensor bias mode does nothing",
    "weak": "maxtorque is 100 at power-on",
    "held": "one motor gives a little when it homes and is then held (give)",
    "stall": "one motor stalls on its way to open when it homes (stall-at)",
    "creep": "the encoder of one motor loses counts all the time (creep)",
    "stiff": "one motor needs four times the current to move",
    "one-way": "one motor closes and does not open",
    "shaky-sensor": "one force channel (Fz of the ring finger) is far noisier than the others",
    "numb-sensor": "one force channel (Fy of the middle finger) always reads the same",
    "touched": "an object presses on the fingertip of the index finger",
}
ODD = frozenset({"held", "stall", "creep", "stiff", "one-way"})
SHAKY, NUMB = frozenset({20}), frozenset({13})  # places of these channels in sensor_state
STIFF = 4.0
TOUCH = (1.5, -2.5, 4.5, 0.015, -0.025, 0.035)  # Fx Fy Fz Tx Ty Tz of the fault "touched"


class Device(Model):
    """The hand without its cable."""

    KIND = "aidin"
    CONTROL = "handctl.sim.aidin.control_commands"
    HEADER = b'}]",:0-e\r\n'  # no opening brace: noise beside an object leaves the object whole
    OPTIONS = Rows(_OPTIONS)
    FAULTS = _FAULTS

    def __init__(self, options: Options, random: Random) -> None:
        super().__init__(options, random)
        given = self.given
        self._period = 1.0 / given["rate"]
        self.hand = Hand(given, random)
        wire = options.integer("wire", -1, 50, 20000000) if options.text("wire") != "auto" else -1
        self._wire = 10.0 / wire if wire > 0 else 0.0
        self._odd: Motor | None = None  # the motor of the faults in ODD
        self.reader = Reader(given)
        self.writer = Writer(given)
        self.mode = 0  # the last one carried out; 0: none since power-on
        self.ignored = 0  # objects that were JSON and yet not carried out
        self._heard = 0.0
        self._streamed = 0
        self._next_feedback = 0.0
        self._unwritten = b""
        self._merged = 0
        self._cold = False
        self._end_homing()

    # -- power, time, faults -------------------------------------------------------------------------------------------

    def boot(self, now: float) -> None:
        super().boot(now)
        self.hand.now = now
        self._next_feedback = now + self._period

    def elapse(self, seconds: float) -> None:
        """Nobody hears the feedback of that time."""
        self.hand.advance(self.hand.now + max(seconds, LONGEST))

    def reconnected(self) -> None:
        """Half an object of the last client is no part of what the next one sends."""
        self.reader.forget()

    def power(self, on: bool) -> None:
        """Off: the origin, the bias, maxtorque and all commands are gone; the fingers stay where they are."""
        super().power(on)
        self.reader.forget()
        self.writer.restart()
        self._unwritten, self._merged = b"", 0
        self.mode = 0
        self._end_homing()
        if not on:
            self._cold = True
            self.hand.release()
        elif self._cold:
            self.hand.power_on()
            self._next_feedback = self.now + self._period
        if on and "weak" in self.faults:
            self.hand.torque = 100
        self.dirty = True

    def set_faults(self, faults: frozenset[str]) -> None:
        before, self.faults = self.faults, faults
        motors = self.hand.motors
        if "blocked" in faults | before:
            for motor in motors:
                motor.jammed = "blocked" in faults
        motors[11].dead = "dead-motor" in faults
        if self._odd is None and faults & ODD:
            self._odd = motors[chosen if (chosen := self.given["motor"]) >= 0 else self.random.between(0, 14)]
        if self._odd is not None:
            self._odd.slip = float(self.given["creep"]) if "creep" in faults else 0.0
            self._odd.friction = STIFF if "stiff" in faults else 1.0
            self._odd.one_way = "one-way" in faults
            self._odd.floor = self._odd.floor if faults & {"held", "stall"} else 0.0
        self.hand.shaky = SHAKY if "shaky-sensor" in faults else frozenset()
        self.hand.numb = NUMB if "numb-sensor" in faults else frozenset()
        if "touched" in faults | before:
            self.hand.touch[6:12] = TOUCH if "touched" in faults else [0.0] * 6

    def advance(self, now: float) -> None:
        while True:
            when = self.next_event()
            if when is None or when > now:
                break
            self._pass(when)
            if self._homing_event() == when:
                self._judge_homing()
            else:
                self._stream(now)
        self._pass(now)
        if self.reader.waiting and now - self._heard > FORGET:
            self.reader.forget()

    def _pass(self, now: float) -> None:
        self.now = max(self.now, now)
        self.hand.advance(self.now)

    def next_event(self) -> float | None:
        if not self.powered:
            return None
        streams = self.given["exchange"] == "stream" and "loopback" not in self.faults
        return soonest(self._homing_event(), self._next_feedback if streams else None)

    # -- feedback ------------------------------------------------------------------------------------------------------

    def _stream(self, now: float) -> None:
        """One object of the stream. After a long pause only the last objects are made: nobody can have read more."""
        due = self._next_feedback
        late = int((now - due) / self._period) - UNSENT
        if late > 0:
            self._next_feedback = due + late * self._period
            return
        self._streamed += 1
        hits = self.hits_of(self._streamed)  # the stream has no requests: its objects are counted on their own
        self._unwritten += self.writer.feedback(self.hand, hits)
        self._merged += 1
        self._next_feedback = due + self._period
        if self._merged >= self.given["merge"]:
            busy = self._write(due, self._unwritten, hits)
            # A server that waits for its socket sends no faster than the line carries.
            self._next_feedback = max(self._next_feedback, due + busy)
            self._unwritten, self._merged = b"", 0

    def _write(self, due: float, data: bytes, hits: frozenset[str]) -> float:
        """Hands feedback to the line; returns the seconds that the line is busy with it, about."""
        chunk = self.given["chunk"]
        if not chunk or len(data) <= chunk or hits:  # a fault befalls an object, not a piece of it
            self.replies.append(Reply(due, data, hits))
            if not hits:
                return self._wire * len(data)
            slow = {"dribble": 0.003 * len(data), "split": 0.3, "unclosed": 0.1, "noise": 12 * self._wire}
            copies = 2 if hits & {"duplicate", "stale"} else 1
            return copies * (max([0.0, *(slow[name] for name in hits & slow.keys())]) + self._wire * len(data))
        gap = STALL if self.given["nagle"] else PIECE
        self.replies.append(Reply(due, data[:chunk], hits))
        rest, size = data[chunk:], len(data) if self.given["nagle"] else chunk
        for number, at in enumerate(range(0, len(rest), size)):
            self.replies.append(Reply(due + (number + 1) * gap, rest[at : at + size], hits))
        return gap * (1 + (len(rest) - 1) // size) + self._wire * len(data)

    # -- objects in ----------------------------------------------------------------------------------------------------

    def due(self, pending: bytes) -> int | None:
        return len(pending) or None  # what was written at once is read at once

    def feed(self, data: bytes) -> None:
        self._heard = self.now
        for message in self.reader.feed(data):
            hits = self.judge()
            if "deaf" in hits:
                continue
            if "refuse" in hits:
                self.ignored += 1
            else:
                self._obey(message)
            if self.given["exchange"] == "poll" or (self.given["exchange"] == "command" and "hand_mode" in message):
                self._write(self.now, self.writer.feedback(self.hand, hits), hits)

    def _obey(self, message: dict[str, Any]) -> None:
        """One object. A mode that is not listed, or whose data are missing or wrong, changes nothing (our guess)."""
        if "hand_mode" not in message:
            if self.given["neutral"] == "interrupts":
                self._end_homing()
            return
        number = _finite(message["hand_mode"])
        if number == 1:
            self._hold_homing()
            return
        self._interrupt_homing()
        if number in MODES and self._execute(int(number or 0), message):
            self.mode = int(number or 0)
            self.dirty = True
        else:
            self.ignored += 1

    def _execute(self, mode: int, message: dict[str, Any]) -> bool:
        """Whether the mode was carried out."""
        if mode == 2:
            return self._go([0.0] * 15)
        if mode == 3:
            self.hand.release()
        elif mode == 4:
            if "no-bias" not in self.faults:
                self.hand.set_bias()
        elif mode == 5:
            values = self._values([message.get("maxtorque")], [(0.0, 1000.0)], True)
            if values is None:
                return False
            self.hand.torque = min(65535, abs(int(values[0])))
        else:
            key, ranges, whole = DATA[mode]
            values = self._values(message.get(key), ranges, whole)
            if values is None:
                return False
            if mode == 41:
                return self._push(values, message)
            if mode == 22:
                values = from_joints([angle / RADIANS for angle in values])
            elif mode == 32:
                values = from_tips(values)
            return self._go(values)
        return True

    def _go(self, counts: list[float]) -> bool:
        if self.given["unhomed"] == "ignore" and not self.hand.homed:
            return False
        self.hand.go(counts)
        return True

    def _push(self, currents: list[float], message: dict[str, Any]) -> bool:
        """Mode 41 needs maxtorque 1000."""
        if self.given["current-maxtorque"] == "with" and _finite(message.get("maxtorque")) == 1000.0:
            self.hand.torque = 1000
        if self.hand.torque != 1000:
            return False
        self.hand.push(currents)
        return True

    def _values(self, given: object, ranges: list[tuple[float, float]], whole: bool) -> list[float] | None:
        """The data of a mode, None if the length, a type, or (limits=ignore) a value does not fit."""
        if not isinstance(given, list) or len(given) != len(ranges):
            return None
        values: list[float] = []
        for item, (low, high) in zip(given, ranges, strict=True):
            value = _finite(item)
            if value is None or (whole and value != int(value)):
                return None
            if not low - EXACT <= value <= high + EXACT and self.given["limits"] != "obey":
                if self.given["limits"] == "ignore":
                    return None
                value = min(max(value, low), high)
            values.append(value)
        return values

    # -- homing --------------------------------------------------------------------------------------------------------

    def _end_homing(self) -> None:
        self._homing_since: float | None = None
        self._held = 0.0
        self._homing_done = False

    def _interrupt_homing(self) -> None:
        """The old origin stays; the motors lose their power (our guess)."""
        if self._homing_since is not None and not self._homing_done:
            self.hand.release()
        self._end_homing()

    def _hold_homing(self) -> None:
        """Mode 1: opens under current control; once the origin is set, holding it longer changes nothing."""
        if self._homing_since is None:
            self._homing_since = self.now
            if self._odd is not None and self.faults & {"held", "stall"}:
                self._odd.obstruct(
                    self.given["give"] if "held" in self.faults else self.given["stall-at"] / 100.0 * self._odd.place
                )
            self.hand.push([HOMING] * 15)
        self._held = self.now
        self.mode = 1
        self.dirty = True

    def _homing_event(self) -> float | None:
        """When homing is complete, or given up because it was not held."""
        if self._homing_since is None:
            return None
        end = self._homing_since + HOLD
        if self.given["homing"] == "latched":
            return None if self._homing_done else end
        lapse = self._held + GAP
        return lapse if self._homing_done else min(end, lapse)

    def _judge_homing(self) -> None:
        start = self._homing_since
        if start is None:
            return
        if not self._homing_done and self.now >= start + HOLD:
            if "no-homing" in self.faults:
                self.hand.release()
            else:
                self.hand.zero()
            self._homing_done = True
            self.dirty = True
        else:
            self._interrupt_homing()

    # -- faults that know the text -------------------------------------------------------------------------------------

    def spoil(self, data: bytes) -> bytes:
        """There is no check value: one byte is no UTF-8 instead."""
        place = len(data) // 2
        return data[:place] + bytes([data[place] | 128]) + data[place + 1 :]


def _finite(value: Any) -> float | None:
    """A number of ordinary size; JSON's true and Python's NaN are none."""
    return float(value) if type(value) in (int, float) and -1e15 < value < 1e15 else None
