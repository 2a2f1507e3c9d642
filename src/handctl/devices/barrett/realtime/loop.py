"""The RealTime loop of one hand (barrett §6): enter, exchange blocks with guards, return verified rows, leave.

Watching, the next block goes out as soon as the acknowledgement of the last one is seen, as §6.1 allows; never earlier.
While anything is driven the whole feedback is awaited first, unless overlapping was asked for: the only practice known
on hardware, and its data are half as old. A block has no checksum: its place is proved by the `*` behind it, or by
silence, and only then is it handed out.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Any

from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.codec import DISTURBED, Answer
from handctl.devices.barrett.gcl.line import COLON_ALONE, restarted_in
from handctl.devices.barrett.parameter_map import BARRETT
from handctl.devices.barrett.realtime.blocks import (
    FEEDBACK_ONLY,
    NEITHER,
    Decoder,
    Feedback,
    LoopError,
    Values,
    as_sent,
    still,
)
from handctl.devices.barrett.realtime.control_laws import Rules
from handctl.devices.barrett.realtime.control_values import Controls
from handctl.devices.barrett.realtime.enter_and_leave import Session
from handctl.devices.barrett.realtime.guards import Guards
from handctl.devices.barrett.realtime.joint_angles import clutches
from handctl.devices.barrett.realtime.loop_flags import FlagRequest, prepare
from handctl.devices.barrett.realtime.loop_rows import Intake, Sent, Taken
from handctl.devices.barrett.stopper import power_off
from handctl.errors import (
    Aftermath,
    CheckFailed,
    DeviceRefused,
    HandctlError,
    LinkError,
    NoAnswer,
    OutputError,
    ProtocolError,
    UsageError,
    joined,
)
from handctl.model.prompts import Prompts
from handctl.model.result import Sample
from handctl.model.stop_on_interrupt import NOT_STOPPED, STOPPED_IT

READER_SECONDS = 0.3
"""Less than the child waits: this command tells best why nothing went out."""
PROOF_SECONDS = 0.025
"""Silence behind a block that proves its end where no other block follows: an adapter hands bytes over within 16 ms."""
SELF_TEST_BLOCKS = 16
UNPROVED = "no reply followed it, so its position in the stream is not confirmed"


class RealtimeLoop:
    """One run of the loop. `controls` gives the control values; None sends none: the hand is only watched.

    `measuring` keeps what the unit of velocity is fitted to; a loop of hours keeps nothing. `rules` may end the loop.
    """

    def __init__(
        self, hand: BarrettHand, prompts: Prompts, flag_request: FlagRequest, controls: Controls | None, *, sequential: bool,
        measuring: bool = False, rules: Rules | None = None,
    ) -> None:  # fmt: skip
        self.hand = hand
        self.flag_request = flag_request
        self.controls = controls
        self.session = Session(hand, flag_request, drives=controls is not None)
        self._guide = prompts
        self._sequential = sequential
        self._rules = rules
        self._stepping = self._told_other = False
        self.intake = Intake(hand, flag_request, measuring=measuring)

    # -- the whole run -------------------------------------------------------------------------------------------

    def summary(self) -> dict[str, Any]:
        """Rate, latencies, floors and what the guards did, for the closing envelope."""
        return self.intake.summary(drives=self.controls is not None, overlapped=not self._sequential)

    def steer(self, values: Mapping[str, Any]) -> None:
        """Send these values in the next block; from now on each sample is given out before another block goes out. Raises UsageError."""
        if type(self.controls) is not Controls:
            raise UsageError(
                "step needs control values that nothing else gives",
                hint="give --send velocity, and no --control or --law",
            )
        self.controls.steer(values)
        self._stepping = self._sequential = True

    @property
    def failure(self) -> HandctlError | None:
        """What went wrong while leaving."""
        return self.session.failure

    def run(self, *, rate: float, count: int | None, duration: float | None, outline: bool = False) -> Iterator[Sample]:
        """Samples, one a block, until `count`, `duration`, the end of the controls or Ctrl-C; always leaves the loop.

        With `outline`, a sample without values comes before LOOP is sent.
        """
        session = self.session
        if self.controls is None:
            yield from self._run(rate, count, duration, outline=outline)
            return
        self.hand.line.connect()  # the last bytes depend on the speed of the port
        session.cycle = 1 / rate if rate else 0.0
        with self.hand.guarded(sequence=partial(power_off, prefix=self.flag_request.prefix)) as session.dead_man:
            yield from self._run(rate, count, duration, outline=outline)

    def _run(self, rate: float, count: int | None, duration: float | None, *, outline: bool) -> Iterator[Sample]:
        session = self.session
        try:
            self._prepare(rate)
            if self.flag_request.angles:
                self.intake.angles = clutches(self.hand, self.flag_request.motors)
            if outline:
                yield self.intake.outline(self.controls.first if self.controls is not None else {})
            self._enter()
            if self.controls is not None and self.controls.follows:
                self._first_feedback()
            if self.controls is not None and not self._sequential:
                self._self_test()
            for sample in self._exchange(self.controls, rate, count, duration):
                if self.controls is None:
                    yield sample
                    continue
                with self._guide.stop_if_slow(READER_SECONDS, self._stop_for_reader):
                    yield sample
        except DeviceRefused as exc:
            self._leave()
            self._raise_if_it_moves(exc)
            if self.failure is None:
                self.hand.name_heat(exc)
            raise
        except LinkError as exc:
            if session.inside and self.controls is not None:
                with self._guide.without_interrupts():
                    stopped = self.hand.stop()
                off = "switch the hand's power off now, because the motors keep their last velocity"
                said = "" if stopped.error else f"{STOPPED_IT}: {stopped.text}"
                exc.add_aftermath(
                    Aftermath(said, off if stopped.error else stopped.hint, moving=stopped.error is not None)
                )
            session.give_up()
            if exc.code == "lost":  # no T can reach the hand either
                session.last = {}
            raise
        except (HandctlError, KeyboardInterrupt) as exc:
            self._leave()
            self._raise_if_it_moves(exc)
            raise
        finally:
            self._leave()

    def _raise_if_it_moves(self, exc: HandctlError | KeyboardInterrupt) -> None:
        """Raise what is worse than `exc`: a hand that moves on, and after Ctrl-C anything that went wrong with the stop."""
        if isinstance(exc, HandctlError) and self.session.moves is not None:
            raise self.session.moves.reworded(joined(exc.text, self.session.moves.text)) from exc
        if isinstance(exc, KeyboardInterrupt) and self.failure is not None:
            text = f"interrupted, but the stop has not been confirmed: {self.failure.text}"
            raise self.failure.reworded(text, code=NOT_STOPPED) from exc

    def _leave(self) -> None:
        with self._guide.without_interrupts():
            self.session.leave()

    def _prepare(self, rate: float) -> None:
        """Flags and guards. A block takes as long as its bytes, or as the rate says."""
        line = self.hand.line
        longest = max(1 / rate if rate else 0.0, line.wire_seconds(9 + 23) or 0.035)
        prepared = prepare(self.hand, self.flag_request, self.controls, self.session.undo, longest)
        self.session.layout = prepared.layout
        self.intake.prepared = prepared
        self.session.decoder = Decoder(self.session.layout)

    def _stop_for_reader(self) -> HandctlError:
        """Stop the motors if no reader takes the rows: without blocks they would keep their last velocity."""
        self._leave()
        stopped = "the motors were stopped" if self.failure is None else f"stopping failed: {self.failure.text}"
        return OutputError(
            f"the program that reads the output took no rows for {READER_SECONDS:g} s, so no further block could be sent: {stopped}",
            hint="read the output faster, or use a lower --rate or -o FILE",
            code="reader",
        )

    # -- in and out ----------------------------------------------------------------------------------------------

    def _enter(self) -> None:
        """`FGET P` (the reference of the deltas, and where the guards begin), then LOOP and its acknowledgement."""
        hand, session = self.hand, self.session
        prepared = self.intake.prepared
        start: dict[int, int] = {}
        if prepared.limits or any("delta" in motor.feedback for motor in session.layout.motors.values()):
            places = hand.numbers(BARRETT.elements("P", motors=self.flag_request.motors))
            start = dict(zip(self.flag_request.motors, places, strict=True))
        self.intake.begin(start)
        session.enter()

    def _first_feedback(self) -> None:
        """What the first values are made of: one block that carries none."""
        for _ in self._exchange(None, 0.0, 1, None):
            pass
        self.intake.forget()

    def _self_test(self) -> None:
        """Overlapped blocks that drive nothing: a hand that does not keep up with them must not be driven so."""
        assert self.controls is not None
        values = self.controls.first
        idle = Controls(
            self.controls.carries, {(i, n): v for i, names in still(values).items() for n, v in names.items()}
        )
        try:
            for _ in self._exchange(idle, 0.0, SELF_TEST_BLOCKS, None):
                pass
        except (NoAnswer, ProtocolError) as exc:
            exc.text = f"{exc.text} (self-test of overlapped blocks, nothing moved)"
            exc.hint = f"leave --overlapped out. {exc.hint}"
            raise
        self.intake.forget()
        self.session.stood = False

    # -- blocks --------------------------------------------------------------------------------------------------

    def _exchange(
        self, controls: Controls | None, rate: float, count: int | None, duration: float | None
    ) -> Iterator[Sample]:
        link, bound, decoder, intake = self.hand.link, self.hand.line.bound, self.session.decoder, self.intake
        sent: deque[Sent] = deque()
        proved: deque[Taken] = deque()
        last: Taken | None = None  # has come, but nothing behind it yet
        intake.start = due = link.now()
        intake.started = link.wall()
        intake.rate = rate
        asked = 0
        going = True
        try:
            while going or sent or proved or last is not None:
                if self._stepping and last is not None:
                    self._answer(deque([self._send(None, {}, link.now(), feedback=False)]))
                    taken, last = last, None
                    yield intake.sample(taken)
                while going and (not sent or (len(sent) == 1 and decoder.acknowledged and not self._sequential)):
                    now = link.now()
                    if rate and now < due:
                        if sent:
                            break
                        if last is not None and due - now > PROOF_SECONDS:
                            self._prove_by_silence()
                            proved.append(last)
                            last = None
                            break
                        link.sleep(due - now)
                        now = link.now()
                    if self._rules is not None:
                        self._rules.known.number, self._rules.known.seconds = asked, now - intake.start
                    values = self._values(controls, now - intake.start)
                    over = (count is not None and asked >= count) or (
                        duration is not None and now - intake.start >= duration
                    )
                    over = over or (asked > 0 and controls is self.controls and self._met())
                    if values is None or over or (bound is not None and bound.expired):
                        going = False
                        break
                    if rate:
                        intake.late += now > due + 1 / rate
                        due = max(due + 1 / rate, now)
                    sent.append(self._send(controls, values, now))
                    asked += 1
                if not sent and not going and last is not None:
                    self._prove_last()
                    proved.append(last)
                    last = None
                while proved:
                    yield intake.sample(proved.popleft())
                if not sent:
                    continue
                answer = self._answer(sent)
                if last is not None:
                    proved.append(last)
                    last = None
                if answer is not None:
                    last = intake.accept(answer, sent.popleft())
                    if self._rules is not None:
                        self._rules.known.see(last.feedback, last.positions, last.values, self.session.layout)
                    if intake.end is not None:
                        self._prove_last()  # what a lost byte has shifted is no reason that could be told
                        raise intake.end
        except (NoAnswer, ProtocolError, DeviceRefused, CheckFailed) as exc:
            if last is not None:
                self._leave()  # before anything else: the motors
                text = exc.text if isinstance(exc, ProtocolError) else UNPROVED if isinstance(exc, NoAnswer) else ""
                yield intake.sample(last, text)
            raise
        if bound is not None and bound.expired:
            raise NoAnswer(f"{link.name}: --deadline has passed", hint="use a longer --deadline", code="deadline")

    def _prove_by_silence(self) -> None:
        """Nothing more comes where nothing was asked for: the block ended where it should. Raises ProtocolError."""
        decoder, line = self.session.decoder, self.hand.line
        decoder.feed(line.link.read(self.hand.link.deadline(PROOF_SECONDS)))
        self._refuse_unasked()

    def _refuse_unasked(self) -> None:
        """Raise what bytes say that came although nothing was asked for: the hand has left its loop, or they cannot be told from an answer.

        Nothing more may be sent then: at the prompt a block would be text.
        """
        decoder, line = self.session.decoder, self.hand.line
        while decoder.received:
            self._next_answer()
            if not (chunk := line.link.read(line.link.deadline(self.session.patience))):
                raise self._silence()
            decoder.feed(chunk)

    def _prove_last(self) -> None:
        """The last block: driving, velocity 0 is sent at once and its acknowledgement proves it. Raises ProtocolError."""
        if not self.session.drives or not self.session.last:
            self._prove_by_silence()
            return
        with self._guide.without_interrupts():
            stands = self.session.stand()
        if not stands:
            self.hand.journal.counters.bad_frames += 1
            raise ProtocolError(
                f"{self.hand.link.name}: velocity 0 was not acknowledged at the end",
                hint=f"switch the hand's power off if anything moves, then {DISTURBED}",
                code="bad-block",
            )

    def _met(self) -> bool:
        """Whether the end that a person gave has come. Raises CheckFailed."""
        if self._rules is None or not (met := self._rules.met()):
            return False
        self.hand.journal.info("until", f"ended by {met}")
        return True

    def _values(self, controls: Controls | None, seconds: float) -> Values | None:
        """What to send now; None when they are over. Raises CheckFailed for a line that came bad while motors ran."""
        if controls is None:
            return {}
        try:
            return controls.at(seconds)
        except UsageError as exc:
            raise CheckFailed(f"{exc.text}. The loop has ended", hint=exc.hint, code="control") from exc

    def _send(self, controls: Controls | None, values: Values, now: float, *, feedback: bool = True) -> Sent:
        """One block, as the guards allow. Without `feedback` only its acknowledgement comes, which proves the block before. A Ctrl-C meanwhile waits until it is sent: leaving must know what is on the wire."""
        session = self.session
        feedback = feedback and session.layout.feedback_size > 1
        if not session.decoder.outstanding:
            session.decoder.feed(self.hand.line.link.read(self.hand.link.at_once))
            self._refuse_unasked()
        held: dict[int, str] = {}
        if controls is None:
            block = FEEDBACK_ONLY if feedback else NEITHER
        else:
            if self.intake.guards is not None:
                values, held = self._allowed(self.intake.guards, values, now)
            values = self._as_sent(values)
            block = session.layout.control(values, feedback=feedback)
        with self._guide.count_interrupts() as presses:
            if controls is not None:
                session.last, session.stood = values, False
                session.tell_dead_man()
            session.decoder.expect(feedback)
            deadline = self.hand.link.deadline(1.0 + self.hand.line.wire_seconds(len(block)))
            self.hand.line.link.write(block, deadline)
            self.hand.journal.counters.sent += 1
        if presses.count:
            raise KeyboardInterrupt
        return Sent(now, values, held)

    def _as_sent(self, values: Values) -> Values:
        """The values as a block carries them; that one differs is told once."""
        sent = {index: {name: as_sent(value) for name, value in names.items()} for index, names in values.items()}
        if not self._told_other and sent != values:
            self._told_other = True
            self.hand.journal.info(
                "sent-as-12",
                "12 was sent in place of 13: the byte of 13 ends a line of text, so a block with it could move a hand that has left RealTime",
            )
        return sent

    def _allowed(self, guards: Guards, values: Values, now: float) -> tuple[Values, dict[int, str]]:
        try:
            return guards.allow(values, now, self.intake.cycle)
        except UsageError as exc:
            raise CheckFailed(f"{exc.text}. The loop has ended", hint=exc.hint, code=exc.code) from exc

    def _answer(self, sent: deque[Sent]) -> Feedback | None:
        """The answer to the oldest block; None once when its acknowledgement has come."""
        decoder, line = self.session.decoder, self.hand.line
        deadline = line.link.deadline(max(0.0, sent[0].at + self.session.patience - line.link.now()))
        while True:
            if (answer := self._next_answer()) is not None:
                self.hand.journal.counters.received += 1
                return answer if isinstance(answer, Feedback) else Feedback({}, None)
            had = decoder.acknowledged
            chunk = line.link.read(deadline)
            if not chunk:
                raise self._silence()
            decoder.feed(chunk)
            if decoder.acknowledged and not had and len(sent) == 1 and not decoder.complete:
                return None

    def _next_answer(self) -> Feedback | bool | None:
        """Raises DeviceRefused where the hand has left its loop."""
        try:
            answer = self.session.decoder.next()
        except ProtocolError as exc:
            self._look_for_restart()
            self.hand.journal.counters.bad_frames += 1
            hint = exc.hint or DISTURBED
            raise ProtocolError(f"{self.hand.link.name}: {exc.text}", hint=hint, code=exc.code) from exc
        if isinstance(answer, LoopError):
            raise self._refused(answer)
        return answer

    def _look_for_restart(self) -> None:
        """Raise Restarted at the boot monitor's ':' in place of '*', or at a banner: the motors have no power then."""
        line, came = self.hand.line, self.session.decoder.received
        if came.startswith(b":"):
            came += line.until_prompt(COLON_ALONE)
        if came.strip(b"\r\n ") == b":" or restarted_in(came, "LOOP"):
            self.session.give_up()
            self.session.last = {}
            raise line.restarted(came, "RealTime has ended, and no motor has power")

    def _silence(self) -> HandctlError:
        self._look_for_restart()
        name = self.hand.link.name
        decoder = self.session.decoder
        if decoder.received:
            self.hand.journal.counters.bad_frames += 1
            return ProtocolError(
                f"{name}: a feedback block of {self.session.layout.feedback_size} bytes stopped after "
                f"{decoder.received.hex(' ').upper()}",
                hint="check the cable and run the command again: bytes were lost on the line, or the flags changed",
                code="cut-short",
            )
        return NoAnswer(
            f"{name}: block {self.intake.answers + 1} was not acknowledged",
            hint="check the cable and the hand's power. --timeout allows a slow link more time",
        )

    def _refused(self, error: LoopError) -> HandctlError:
        self.session.inside, self.session.thrown_out = False, True
        answer = Answer(f"RealTime block {self.intake.answers + 1}", (), error.status, b"")
        if error.status:
            return self.hand.refusal(answer)
        return DeviceRefused(
            f"{self.hand.link.name}: {answer.command}: the hand left RealTime unexpectedly",
            hint="run it again",
            code="left",
        )
