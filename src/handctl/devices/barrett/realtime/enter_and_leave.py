"""One session in the RealTime loop, the way in, and the way out of it: velocity 0, ^C, prompt, T, flags as before (barrett §6.1; dossier 6.6).

No watchdog is documented, so whatever ends the loop goes this way, and one step that fails keeps no other from stopping
the motors.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.codec import CR, DISTURBED, Answer, encode, has_prompt, status_in
from handctl.devices.barrett.gcl.connect_table import abort_at, ends_alone
from handctl.devices.barrett.gcl.status_codes import NOT_INITIALIZED
from handctl.devices.barrett.parameter_map import BARRETT
from handctl.devices.barrett.realtime.blocks import ACKNOWLEDGE, Decoder, Layout, LoopError, Selection, Values, still
from handctl.devices.barrett.realtime.control_values import Controls
from handctl.devices.barrett.realtime.loop_flags import FlagRequest, asked_flags
from handctl.devices.barrett.stopper import power_off, stands, stop_steps
from handctl.errors import DeviceRefused, HandctlError, NoAnswer, ProtocolError
from handctl.link.deadman import EarlyWrite, Guard
from handctl.model.param import Element, Number, Step
from handctl.model.stop_on_interrupt import NOT_STOPPED
from handctl.model.stop_sequence import Stopped, run_stop, sent_again
from handctl.system.deadman_process import HEARTBEAT_TIMEOUT

ENTER_SECONDS = 1.5
BLOCK_SECONDS = 0.1
WATCH_SECONDS = 0.5
"""The same where no control is sent: a machine or an adapter that stumbles is then no reason to end."""
ANSWER_SECONDS = 0.01
"""What the hand needs to answer, beside the time on the wire, where nobody can wait for the answer."""
LEAVING_SECONDS = 3.0
"""How long this command may be silent while it leaves: ^C and T take their time at a slow speed."""
LATE_SECONDS = 0.5
"""For an answer that is still due when the motors are to be stopped: ^C waits no longer for it, whatever --timeout says."""


class Session:
    """The state of one loop and how to leave it.

    drives      control values are sent
    layout      of the blocks, and the decoder of their answers
    inside      the hand may be in the loop: every byte counts as a header
    thrown_out  the hand has left it by itself
    asked       LOOP was sent
    stood       a block of velocity 0 was acknowledged, and none was sent since
    last        the control values sent last
    undo        flags as they were
    mark        where the loop begins in the ledger of writes
    failure     what went wrong while leaving
    moves       the same, where the hand was seen to move behind it, None = it was not
    dead_man    stops the hand when this process dies
    cycle       seconds from one block to the next as they were asked for, 0 = as soon as it may be
    """

    def __init__(self, hand: BarrettHand, flag_request: FlagRequest, *, drives: bool) -> None:
        self.hand, self.flag_request, self.drives = hand, flag_request, drives
        self.layout = Layout({})
        self.decoder = Decoder(self.layout)
        self.inside = self.thrown_out = self.asked = self.stood = False
        self.last: Values = {}
        self.undo: list[tuple[Element, Number]] = []
        self.failure: HandctlError | None = None
        self.moves: HandctlError | None = None
        self.dead_man: Guard | None = None
        self.cycle = 0.0
        self.mark = 0
        self._still = b""

    def enter(self) -> None:
        """Send LOOP and wait for its acknowledgement, its echo and `*` (barrett §6.1); the hand is inside then, or may be.

        Raises DeviceRefused with the hand's status, NoAnswer, ProtocolError.
        """
        hand, link, line = self.hand, self.hand.link, self.hand.line
        command = f"{self.flag_request.prefix}LOOP"
        sent = command.encode("ascii")
        deadline = line.deadline(ENTER_SECONDS + 2 * line.wire_seconds(len(sent) + 2))
        line.drain()
        # From here on it may be in the loop, where every byte counts as a header: it is left by ^C and nothing else.
        self.inside = self.asked = True
        self.mark = hand.journal.ledger.mark
        line.link.write(sent + CR, deadline)
        hand.journal.counters.sent += 1
        came, begun = b"", link.now()
        while not deadline.expired:
            if len(came) > len(sent) and came[len(sent)] == ACKNOWLEDGE and came[: len(sent)].upper() == sent:
                hand.journal.counters.received += 1
                self.decoder.feed(came[len(sent) + 1 :])
                return
            if has_prompt(came):
                if status := status_in(came):
                    self.inside = self.asked = False
                    raise hand.refusal(Answer(command, (), status, came))
                break
            chunk = line.link.read(deadline)
            if not chunk:
                break
            came = (came + chunk).lstrip(b" ")  # the space behind the prompt before may come late
        line.check_bound()
        if not came:
            raise line.unanswered(
                command, ENTER_SECONDS, begun, "check that the hand replies with `handctl barrett status`"
            )
        raise ProtocolError(
            f"{link.name}: expected {command} and *, or ERR, received {came[:48].hex(' ').upper()}",
            hint=DISTURBED,
            code="echo-differs",
        )

    @property
    def patience(self) -> float:
        """Seconds that the answer to a block may take."""
        line = self.hand.line
        size = self.layout.control_size + self.layout.feedback_size
        least = BLOCK_SECONDS if self.drives else WATCH_SECONDS
        return line.timeout if line.timeout is not None else max(least, 10 * line.wire_seconds(size))

    def give_up(self) -> None:
        """The link is lost: no byte can reach the hand, nothing is to be put back."""
        self.inside = self.drives = False
        self.undo.clear()

    def leave(self) -> None:
        """Never raises: a failure is reported and sets `failure`."""
        self._tell_first((), LEAVING_SECONDS)  # at the prompt a control block would be text, perhaps a command
        self.hand.line.bound = None  # stopping has deadlines of its own
        moved = bool(self.last) or (self.asked and self.drives)
        stood = False
        switch_off = "switch the hand's power off if anything moves"
        with self._blamed(switch_off if moved else "power-cycle the hand"):
            stood = self._go_out(moved)
        with self._blamed(switch_off):
            if moved:
                self._stand(hold=self.flag_request.hold and stood)
        if self.failure is None and self.undo:
            flags = ", ".join(f"{element.full_name}={value}" for element, value in self.undo)
            with self._blamed(f"power-cycle the hand to restore the saved flags. Before, they were {flags}"):
                self.hand.write(self.undo)
        self.last, self.undo = {}, []
        self.thrown_out = self.asked = self.stood = False  # once is enough

    def _stand(self, *, hold: bool) -> None:
        """Motor power off, or not with `hold`; then the hand is looked at as `stop` does. Raises what speaks against its standing still."""
        hand, prefix = self.hand, self.flag_request.prefix
        code, told = "held", "velocity 0 was sent. The motors stay powered (--hold)"
        if not hold:
            answer = hand.line.ask(f"{prefix}T")
            if answer.status & ~NOT_INITIALIZED:
                raise hand.refusal(answer)
            why = ". --hold was ignored, because velocity 0 was not acknowledged" if self.flag_request.hold else ""
            code, told = "stopped", f"{prefix}T was acknowledged: the motors are switched off{why}"
        context = hand.stop_context()
        looked = run_stop(hand.link, stands(context, Stopped(told)))
        if looked.goes_on or (looked.error is not None and hold):
            stop = power_off if hold else stop_steps  # T itself goes out twice, whatever went before
            off, code = run_stop(hand.link, stop(context, prefix), ledger=hand.journal.ledger), "stopped"
            more = looked._replace(text=f"{looked.text}. {off.text}", error=off.error)
            looked = sent_again(looked, off) if looked.goes_on else more
        hand.line.link.read(
            hand.line.link.deadline(0.005 + hand.line.wire_seconds(2)), 1
        )  # the space behind the last prompt
        if looked.error is not None:
            error = looked.error(f"{hand.link.name}: {looked.text}", hint=looked.hint, code=NOT_STOPPED)
            self.moves = error if looked.error is DeviceRefused else None
            raise error
        hand.journal.info(code, looked.text)

    def _go_out(self, moved: bool) -> bool:
        """Back to the prompt; whether the hand acknowledged velocity 0 on the way. Raises NoAnswer."""
        line = self.hand.line
        stood = False
        if self.inside:
            self.inside = False
            stood = self.stand(LATE_SECONDS)
            if stood:
                self.hand.journal.ledger.confirm("each block was acknowledged", since=self.mark)
            left = self.thrown_out and moved
            if not left and not (stood and line.abort() is not None) and line.leave_loop() is not None:
                raise NoAnswer(
                    "no prompt after ^C, so the hand may still be in its loop",
                    hint="switch the hand's power off if anything moves",
                    code="loop",
                )
        if self.thrown_out and moved:
            # The rest of the refused block stands at the prompt as if typed, and may even be a command: ^C, CR,
            # and ^C again for what that CR may have begun.
            line.resynchronise(stop=True)
            line.abort()
        return stood

    def stand(self, most: float = math.inf) -> bool:
        """Whether the hand took a last block of velocity 0 (or needs none) and now awaits a header.

        An answer is waited for as long as --timeout allows, and no longer than `most` seconds.
        """
        if self.stood:
            return True
        line, decoder = self.hand.line, self.decoder
        try:
            for block in (None, self._zero()):
                if block is not None:
                    decoder.feed(line.link.read(self.hand.link.at_once))
                    if decoder.received[:1] in (b"\n", b"\r"):  # an error or a prompt: the block would be text
                        self.thrown_out = True
                        return False
                    decoder.expect(False)
                    line.link.write(block, self.hand.link.deadline(1.0 + line.wire_seconds(len(block))))
                while decoder.outstanding:
                    if isinstance(decoder.next(), LoopError):
                        self.thrown_out = True
                        return False
                    if decoder.outstanding:
                        chunk = line.link.read(self.hand.link.deadline(min(self.patience, most)))
                        if not chunk:
                            return False
                        decoder.feed(chunk)
        except ProtocolError:
            return False
        self.stood = True
        return True

    def _zero(self) -> bytes | None:
        if not self.drives or not self.last:
            return None
        return self.layout.control(still(self.last), feedback=False)

    def tell_dead_man(self) -> None:
        """Let a sudden death stop the motors as `leave` does, block for block: the gains are kept."""
        zero = self._zero()
        if zero is None or zero == self._still:
            return
        self._still = zero
        line = self.hand.line
        wire = line.wire_seconds
        zero = zero.replace(b"\xff", b"\xfe")  # a gain of 255: as it is, it is a boot monitor's trigger
        if line.risky and ends_alone(len(zero), line.link.baud):
            zero += line.abort_bytes
        answered = ANSWER_SECONDS + wire(self.layout.control_size + self.layout.feedback_size)  # of the block before
        heartbeat = max(HEARTBEAT_TIMEOUT, 3 * self.cycle, 2 * self.patience)
        self._tell_first([EarlyWrite(b"", answered), EarlyWrite(zero, ANSWER_SECONDS + wire(len(zero) + 1))], heartbeat)

    def _tell_first(self, shots: Sequence[EarlyWrite], heartbeat: float) -> None:
        """The child's, for as long as this loop drives: before and behind it, an answer may take its time."""
        if self.dead_man is not None:
            self.dead_man.update(shots, heartbeat if self.flag_request.watched else 0.0)

    @contextmanager
    def _blamed(self, hint: str) -> Iterator[None]:
        """A step of leaving: one that fails is told, and must not keep the next from stopping the motors."""
        try:
            yield
        except Exception as exc:  # noqa: BLE001
            text = f"while leaving the loop: {exc.text if isinstance(exc, HandctlError) else repr(exc)}"
            self.hand.journal.note("error", "leaving", text, hint)
            kind: Any = type(exc) if isinstance(exc, HandctlError) else HandctlError
            code = exc.code if isinstance(exc, HandctlError) else "internal"
            self.failure = self.failure or kind(text, hint=hint, code=code)


def steps_of(hand: BarrettHand, flag_request: FlagRequest, controls: Controls | None, baud: int | None) -> list[Step]:
    """The exact bytes as far as they do not depend on what the hand holds."""
    changes = [
        (Element(BARRETT.by_mnemonic(name), index), value)
        for (name, index), value in asked_flags(flag_request, controls).items()
        if value or not BARRETT.by_mnemonic(name).since  # a hand that does not know the flag has it off
    ]
    steps = [Step(f"{step.meaning}  (only flags that differ are written)", step.data) for step in hand.plan(changes)]
    entry = f"{flag_request.prefix}LOOP"
    steps.append(Step(f"{entry}: enter RealTime", encode(entry)))
    if controls is None:
        steps.append(Step("request feedback, repeatedly", b"A"))
    else:
        layout = Layout({index: Selection(controls.carries[index], ()) for index in flag_request.motors})
        made = ", its values made by the laws" if controls.follows else ""
        steps.append(Step(f"first control block{made}", layout.control(controls.first), moves=True))
        last = layout.control(still(controls.first), feedback=False)
        steps.append(Step("last control block: velocity 0", last))
    steps.append(Step("leave RealTime", abort_at(baud)))
    if controls is not None and not flag_request.hold:
        steps.append(Step(f"{flag_request.prefix}T: motor power off", encode(f"{flag_request.prefix}T")))
    return steps
