"""The RealTime loop of one hand (barrett §6): set its flags, enter, exchange blocks, leave it standing, put flags back.

The next block goes out as soon as the acknowledgement of the last one is seen, as §6.1 allows; never earlier. No watchdog
is documented: whatever ends the loop, the motors are told velocity 0, the hand gets its ^C, then T (dossier 6.6).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any

from handctl.devices.barrett.hand import BarrettHand
from handctl.devices.barrett.language import ABORT, CR, MOTORS, Answer, encode, has_prompt
from handctl.devices.barrett.line import DISTURBED
from handctl.devices.barrett.loop_flags import Wish, prepare
from handctl.devices.barrett.parameters import BARRETT
from handctl.devices.barrett.realtime import (
    ACKNOWLEDGE,
    FEEDBACK,
    FEEDBACK_ONLY,
    NEITHER,
    Decoder,
    DeltaPosition,
    Feedback,
    Layout,
    LoopError,
    cycles,
)
from handctl.devices.barrett.schedule import Source, Values
from handctl.errors import (
    CheckFailed,
    DeviceRefused,
    HandctlError,
    LinkError,
    NoAnswer,
    OutputError,
    ProtocolError,
    UsageError,
)
from handctl.guide import Guide
from handctl.latency import RoundTrips
from handctl.link import Deadline
from handctl.link.deadman import Guard, Shot, guarding
from handctl.param import Element, Number
from handctl.result import Row, Sample

BLOCK_SECONDS = 0.1
WATCH_SECONDS = 0.5
"""The same where no control is sent: a machine or an adapter that stumbles is then no reason to end."""
ENTER_SECONDS = 1.5
READER_SECONDS = 0.5
ANSWER_SECONDS = 0.01
"""What the hand needs to answer, beside the time on the wire, where nobody can wait for the answer."""
NOT_INITIALIZED = 4
"""T says so of such a motor and cuts its power all the same (barrett §5.2.1)."""
UNITS = {
    "strain": None,
    "position": "cts",
    "delta": "cts",
    "velocity": None,
    "breakaway_position": "cts",
    "analog": None,
}


class RealtimeLoop:
    """One run of the loop. `source` gives the control values; None sends none: the hand is only watched.

    `measuring` keeps what the unit of velocity is fitted to; a loop of hours keeps nothing.
    """

    def __init__(
        self, hand: BarrettHand, guide: Guide, wish: Wish, source: Source | None, *, sequential: bool,
        measuring: bool = False,
    ) -> None:  # fmt: skip
        self.hand = hand
        self.wish = wish
        self.source = source
        self.trips = RoundTrips()
        self.blocks = 0
        self.failure: HandctlError | None = None
        self.layout = Layout({})
        self._guide = guide
        self._sequential = sequential
        self._decoder = Decoder(self.layout)
        self._inside = self._thrown_out = self._asked = False
        self._undo: list[tuple[Element, Number]] = []
        self._last: Values = {}
        self._deltas: dict[int, DeltaPosition] = {}
        self._guard = Guard(None)
        self._still = b""
        self._first = self._last_at = 0.0  # answers
        self._measuring = measuring
        self._rate, self._late = 0.0, 0
        self.velocity_points: dict[int, list[tuple[float, int, int]]] = {index: [] for index in wish.motors}

    # -- the whole run -------------------------------------------------------------------------------------------

    def run(self, *, rate: float, count: int | None, duration: float | None) -> Iterator[Sample]:
        """Samples, one a block, until `count`, `duration`, the end of the source or Ctrl-C; always leaves the loop."""
        if self.source is None:
            yield from self._run(rate, count, duration)
            return
        with guarding(self.hand.link, self._power_off_shots(), self.hand.journal.warn) as self._guard:
            yield from self._run(rate, count, duration)

    def _run(self, rate: float, count: int | None, duration: float | None) -> Iterator[Sample]:
        try:
            self.layout = prepare(self.hand, self.wish, self.source, self._undo)
            self._decoder = Decoder(self.layout)
            self._enter()
            for sample in self._exchange(rate, count, duration):
                if self.source is None:
                    yield sample
                    continue
                with self._guide.impatient(READER_SECONDS, self._stop_for_reader):
                    yield sample
        except LinkError as exc:
            if self._inside and self.source is not None:
                exc.hint = f"the motors keep their last velocity: switch the hand's power off now; {exc.hint}"
            self._inside = False
            self._undo.clear()
            self.source = None
            if exc.code == "lost":  # no T can reach the hand either
                self._last = {}
            raise
        finally:
            with self._guide.undisturbed():
                self._leave()

    def _stop_for_reader(self) -> HandctlError:
        """Nobody takes the rows, so no block would go out and the motors would keep their last velocity."""
        with self._guide.undisturbed():
            self._leave()
        return OutputError(
            f"the rows were not taken for {READER_SECONDS:g} s: no further block could be sent, the motors were stopped",
            hint="a reader that keeps up, a lower --rate, or -o FILE",
            code="reader",
        )

    # -- in and out ----------------------------------------------------------------------------------------------

    def _enter(self) -> None:
        """`FGET P` (the reference of the deltas), then LOOP and its acknowledgement."""
        hand, link = self.hand, self.hand.link
        line = hand.line
        if any("delta" in motor.feedback for motor in self.layout.motors.values()):
            for reading in hand.read([Element(BARRETT.by_mnemonic("P"), index) for index in self.wish.motors]):
                if reading.error is not None:
                    raise reading.error
                index = reading.element.index
                self._deltas[index] = DeltaPosition(int(reading.value or 0), self.layout.motors[index].delta_divisor)
        command = f"{self.wish.prefix}LOOP"
        sent = command.encode("ascii")
        deadline = link.deadline(ENTER_SECONDS + 2 * line.wire_seconds(len(sent) + 2)).earlier(line.bound)
        line.drain()
        # From here on it may be in the loop, where every byte counts as a header: it is left by ^C and nothing else.
        self._inside = self._asked = True
        line.link.write(sent + CR, deadline)
        hand.journal.counters.sent += 1
        came = b""
        while not deadline.expired:
            if len(came) > len(sent) and came[len(sent)] == ACKNOWLEDGE and came[: len(sent)].upper() == sent:
                hand.journal.counters.received += 1
                self._decoder.feed(came[len(sent) + 1 :])
                return
            if has_prompt(came):
                if status := _status(came):
                    self._inside = self._asked = False
                    raise hand.refusal(Answer(command, (), status, came))
                break
            chunk = line.link.read(deadline)
            if not chunk:
                break
            came += chunk
        if line.bound is not None and line.bound.expired:
            raise NoAnswer(f"{link.name}: --deadline is over", hint="a longer --deadline", code="deadline")
        if not came:
            raise NoAnswer(
                f"{link.name}: no answer to {command}", hint="`handctl barrett status` tells whether it is there"
            )
        raise ProtocolError(
            f"{link.name}: expected {command} and *, or ERR, got {came[:48].hex(' ').upper()}",
            hint=DISTURBED,
            code="echo-differs",
        )

    def _exchange(self, rate: float, count: int | None, duration: float | None) -> Iterator[Sample]:
        link, decoder, bound = self.hand.link, self._decoder, self.hand.line.bound
        sent: deque[tuple[float, Values]] = deque()
        start = due = link.now()
        asked = 0
        going = True
        self._rate = rate
        while going or sent:
            while going and (not sent or (len(sent) == 1 and decoder.acknowledged and not self._sequential)):
                now = link.now()
                if rate and now < due:
                    if sent:
                        break
                    link.sleep(due - now)
                    now = link.now()
                values = self._values(now - start)
                over = (count is not None and asked >= count) or (duration is not None and now - start >= duration)
                if values is None or over or (bound is not None and bound.expired):
                    going = False
                    break
                if rate:
                    self._late += now > due + 1 / rate
                    due = max(due + 1 / rate, now)
                self._send(values)
                asked += 1
                sent.append((now, {index: dict(names) for index, names in values.items()}))
            if sent and (answer := self._answer(sent)) is not None:
                yield self._sample(answer, sent, start)
        if bound is not None and bound.expired:
            raise NoAnswer(f"{link.name}: --deadline is over", hint="a longer --deadline", code="deadline")

    def _values(self, seconds: float) -> Values | None:
        """What to send now; None when the source is over. Raises CheckFailed for a line that came bad while motors ran."""
        if self.source is None:
            return {}
        try:
            return self.source.at(seconds)
        except UsageError as exc:
            raise CheckFailed(f"{exc.text}; the loop was left", hint=exc.hint, code="control") from exc

    def _send(self, values: Values) -> None:
        """One block. A Ctrl-C meanwhile waits until it is sent and expected: leaving must know what is on the wire."""
        link = self.hand.link
        feedback = self.layout.feedback_size > 1
        if self.source is None:
            block = FEEDBACK_ONLY if feedback else NEITHER
        else:
            block = self.layout.control(values, feedback=feedback)
        with self._guide.counting() as presses:
            if self.source is not None:
                self._last = values
                self._tell_guard()
            self._decoder.expect(feedback)
            deadline = link.deadline(1.0 + self.hand.line.wire_seconds(len(block)))
            self.hand.line.link.write(block, deadline)
            self.hand.journal.counters.sent += 1
        if presses.count:
            raise KeyboardInterrupt

    def _answer(self, sent: deque[tuple[float, Values]]) -> Feedback | None:
        """The answer to the oldest block; None once when its acknowledgement has come: the next block may go out."""
        decoder, line = self._decoder, self.hand.line
        deadline = self._block_deadline(sent[0][0])
        while True:
            try:
                answer = decoder.next()
            except ProtocolError as exc:
                self.hand.journal.counters.bad_frames += 1
                hint = exc.hint or DISTURBED
                raise ProtocolError(f"{self.hand.link.name}: {exc.text}", hint=hint, code=exc.code) from exc
            if isinstance(answer, LoopError):
                self._inside, self._thrown_out = False, True
                raise self._refused(answer)
            if answer is not None:
                self.hand.journal.counters.received += 1
                return answer if isinstance(answer, Feedback) else Feedback({}, None)
            had = decoder.acknowledged
            chunk = line.link.read(deadline)
            if not chunk:
                raise self._silence()
            decoder.feed(chunk)
            if decoder.acknowledged and not had and len(sent) == 1 and not self._sequential:
                return None

    def _block_deadline(self, sent_at: float) -> Deadline:
        line = self.hand.line
        size = self.layout.control_size + self.layout.feedback_size
        patience = BLOCK_SECONDS if self.source is not None else WATCH_SECONDS
        seconds = line.timeout if line.timeout is not None else max(patience, 10 * line.wire_seconds(size))
        return self.hand.link.deadline(max(0.0, sent_at + seconds - self.hand.link.now()))

    def _silence(self) -> HandctlError:
        name = self.hand.link.name
        if self._decoder.received:
            self.hand.journal.counters.bad_frames += 1
            return ProtocolError(
                f"{name}: a feedback block of {self.layout.feedback_size} bytes stopped after "
                f"{self._decoder.received.hex(' ').upper()}",
                hint="bytes were lost on the line, or the flags changed: check the cable, run it again",
                code="cut-short",
            )
        return NoAnswer(
            f"{name}: block {self.blocks + 1} was not acknowledged",
            hint="the cable, or the hand's power; --timeout allows a slow link more time",
        )

    def _refused(self, error: LoopError) -> HandctlError:
        answer = Answer(f"RealTime block {self.blocks + 1}", (), error.status, b"")
        if error.status:
            return self.hand.refusal(answer)
        return DeviceRefused(
            f"{self.hand.link.name}: {answer.command}: the hand left RealTime by itself",
            hint="run it again",
            code="left",
        )

    # -- what comes back -----------------------------------------------------------------------------------------

    def _sample(self, feedback: Feedback, sent: deque[tuple[float, Values]], start: float) -> Sample:
        now = self.hand.link.now()
        sent_at, values = sent.popleft()
        self.trips.add(now - sent_at)
        self.blocks += 1
        self._first, self._last_at = (now if self.blocks == 1 else self._first), now
        rows = [row for index in self.wish.motors for row in self._rows(index, feedback, values, now)]
        if feedback.temperature is not None:
            rows.append(_row("temperature", "LFT", None, feedback.temperature / 10, "°C"))
        return Sample(now - start, tuple(rows))

    def _rows(self, index: int, feedback: Feedback, values: Values, now: float) -> Iterator[Row]:
        motor = self.layout.motors[index]
        name = MOTORS[index]
        for control, value in values.get(index, {}).items():
            if control == "velocity":
                # In the unit of MOV and MCV: 1/16 count a sample (dossier 6.3).
                yield _row("velocity_command", "LCV", name, value * motor.velocity_factor, "1/16 cts/sample")
            else:
                yield _row("gain_command", "LCPG", name, value, None)
        found = feedback.motors.get(index, {})
        for key, value in found.items():
            scaled = value * {"velocity": motor.velocity_divisor, "delta": motor.delta_divisor}.get(key, 1)
            yield _row(key, FEEDBACK[key], name, scaled, UNITS[key])
        if "delta" in found:
            position = self._deltas[index].add(found["delta"])
            if "position" not in found:
                yield _row("position", "LFDP", name, position, "cts")
        if self._measuring and "velocity" in found and "position" in found:
            self.velocity_points[index].append((now, found["position"], found["velocity"] * motor.velocity_divisor))

    def summary(self) -> dict[str, Any]:
        """Rate, latencies and floors for the closing envelope."""
        seconds = self._last_at - self._first
        rate = (self.blocks - 1) / seconds if self.blocks > 1 and seconds > 0 else None
        baud = self.hand.line.link.baud
        size = (self.layout.control_size if self.source is not None else 1, self.layout.feedback_size)
        floors = {name: round(1 / cycle, 1) for name, cycle in cycles(*size, baud).items()} if baud else None
        return {
            "stream": {
                "samples": self.blocks,
                "failed": 0,
                "late": self._late,
                "seconds": round(seconds, 3),
                "rate_hz": round(rate, 2) if rate is not None else None,
                "asked_hz": self._rate or None,
            },
            "loop": {
                "control_bytes": size[0],
                "feedback_bytes": size[1],
                "latency": self.trips.as_row(),
                "line_limit_hz": floors,
                "saturated_deltas": sum(delta.saturated for delta in self._deltas.values()),
            },
        }

    # -- leaving -------------------------------------------------------------------------------------------------

    def _leave(self) -> None:
        """Zero velocity, ^C, prompt, T, flags as before. Never raises: what fails is told and sets `failure`."""
        line = self.hand.line
        self._guard.update(self._power_off_shots())  # at the prompt a control block would be text, perhaps a command
        line.bound = None  # stopping has deadlines of its own
        moved = bool(self._last) or (self._asked and self.source is not None)
        stands = False
        try:
            stands = self._go_out(moved)
        except Exception as exc:  # noqa: BLE001 - one step that fails must not keep the next from stopping the motors
            self._blame(exc, "switch the hand's power off if anything moves" if moved else "power-cycle the hand")
        try:
            if moved and self.wish.hold and stands:
                self.hand.journal.info("held", "velocity 0 was commanded; the motors stay powered (--hold)")
            elif moved:
                self._power_off()
        except Exception as exc:  # noqa: BLE001 - the same
            self._blame(exc, "switch the hand's power off if anything moves")
        if self.failure is not None:
            self._undo = []
        try:
            if self._undo:
                self.hand.write(self._undo)
        except Exception as exc:  # noqa: BLE001 - the same
            flags = ", ".join(f"{element.full_name}={value}" for element, value in self._undo)
            self._blame(exc, f"the flags before were {flags}; a power cycle brings the saved ones back")
        self._last, self._undo = {}, []
        self._thrown_out = self._asked = False  # once is enough

    def _power_off(self) -> None:
        answer = self.hand.line.ask(f"{self.wish.prefix}T")
        if answer.status & ~NOT_INITIALIZED:
            raise self.hand.refusal(answer)
        why = "; --hold is not kept: velocity 0 was not acknowledged" if self.wish.hold else ""
        self.hand.journal.info("stopped", f"the motors were stopped and switched off (T){why}")

    def _go_out(self, moved: bool) -> bool:
        """Back to the prompt; whether the hand acknowledged velocity 0 on the way. Raises NoAnswer."""
        line = self.hand.line
        stands = False
        if self._inside:
            self._inside = False
            stands = self._stand()
            if not (stands and line.abort() is not None) and line.leave_loop() is not None:
                raise NoAnswer("no prompt after ^C: the hand may still be in its loop", code="loop")
        elif self._thrown_out and moved:
            # The rest of the refused block stands at the prompt as if typed, and may even be a command: ^C, CR,
            # and ^C again for what that CR may have begun.
            line.resynchronise()
            line.abort()
        return stands

    def _stand(self) -> bool:
        """Whether the hand took a last block of velocity 0 (or needs none) and now awaits a header."""
        line, decoder = self.hand.line, self._decoder
        try:
            for block in (None, self._zero()):
                if block is not None:
                    decoder.expect(False)
                    line.link.write(block, self.hand.link.deadline(1.0 + line.wire_seconds(len(block))))
                while decoder.outstanding:
                    if isinstance(decoder.next(), LoopError):
                        return False
                    if decoder.outstanding:
                        chunk = line.link.read(self._block_deadline(self.hand.link.now()))
                        if not chunk:
                            return False
                        decoder.feed(chunk)
        except ProtocolError:
            return False
        return True

    def _zero(self) -> bytes | None:
        if self.source is None or not self._last:
            return None
        still = {
            index: {**names, "velocity": 0} if "velocity" in names else names for index, names in self._last.items()
        }
        return self.layout.control(still, feedback=False)

    def _tell_guard(self) -> None:
        """Let a sudden death stop the motors as `_leave` does, block for block: the gains are kept."""
        zero = self._zero()
        if zero is None or zero == self._still:
            return
        self._still = zero
        wire = self.hand.line.wire_seconds
        answered = ANSWER_SECONDS + wire(self.layout.control_size + self.layout.feedback_size)  # of the block before
        stand = [Shot(b"", answered), Shot(zero, ANSWER_SECONDS + wire(len(zero) + 1))]
        self._guard.update([*stand, *self._power_off_shots()])

    def _power_off_shots(self) -> list[Shot]:
        """^C and T, three times: if a block was cut off, the first ^C may be data (dossier 1.2)."""
        pause = ANSWER_SECONDS + self.hand.line.wire_seconds(16)
        return [Shot(ABORT, pause), Shot(encode(f"{self.wish.prefix}T"), pause)] * 3

    def _blame(self, exc: Exception, hint: str) -> None:
        text = f"while leaving the loop: {exc.text if isinstance(exc, HandctlError) else repr(exc)}"
        self.hand.journal.note("error", "leaving", text, hint)
        kind = type(exc) if isinstance(exc, HandctlError) else HandctlError
        self.failure = self.failure or kind(
            text, hint=hint, code=exc.code if isinstance(exc, HandctlError) else "internal"
        )


def _row(name: str, parameter: str, motor: str | None, value: Number, unit: str | None) -> Row:
    return {"name": name, "parameter": parameter, "motor": motor, "value": value, "unit": unit}


def _status(came: bytes) -> int:
    words = came.split()
    place = words.index(b"ERR") if b"ERR" in words else -1
    number = words[place + 1] if 0 <= place < len(words) - 1 else b"0"
    return int(number) if number.isdigit() and len(number) <= 10 else 0
