"""Stop sequences: the steps that stop a device, one generator per family, and the code that runs them. Knows no device.

A family's `stopper` is a module with one function:

    stop_steps(context) -> StopSequence    yields `StopStep`s, receives the bytes that came back, returns `Stopped`

It does no I/O, so the owner of the link runs it with `run_stop`: the command `stop`, a command that another process asks
to stop, Ctrl-C inside a command, and the child process of a command that was killed.

Every sequence follows these rules: a step is repeated until it is acknowledged (`stop_repetition`); steps that need no
position come first; a position is read immediately before each command to hold it; and a device that has acknowledged is
checked again after a silence, because another program may be commanding it.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import nullcontext, suppress
from itertools import groupby
from typing import TYPE_CHECKING

from handctl.errors import DeviceRefused, HandctlError, LinkError, NoAnswer, joined
from handctl.families import FAMILIES
from handctl.fast_classes import NamedTuple
from handctl.link import ByteLink, CanFrame, Deadline, FrameLink, Link
from handctl.model.command_settings import Settings
from handctl.model.param import Step

if TYPE_CHECKING:
    from handctl.model.write_ledger import Addressee, Ledger

WRITE_SECONDS = 1.0
RECONNECT_SECONDS = 1.0
"""How long a link that was lost is looked for, and a connection opened again, for a stop."""
SILENCE = 0.3
"""Seconds without sending before a stopped device is checked again, and between two readings of its position.

By then another master has sent something, and what still moves has gone farther than a reading changes at rest."""
ONE_TRY = 0.1
"""Seconds without an answer after which another device on the link has its turn."""
LOOKS = 3
"""Times that a stop looks, over `SILENCE` each: what brakes must stand still in one of them."""
MOST = 65536
"""Most bytes that are read for one reply: a line full of noise must not delay the next step. A silence has its full time."""

Pieces = list[bytes]
"""What came back: chunks of a byte stream, or the data of CAN frames that have the identifier of the request."""


class StopContext(NamedTuple):
    """What a stopper knows about the device: the options given, and the wire.

    can     the link carries CAN frames
    speed   the speed of the port in bit/s, None where the link has none that is ours
    fixed   the baud rate of the port stays: it cannot be changed, or the device is known to use it
    proven  this program has identified the device: its family and its address
    powered keep the motor power on if the movement ends without switching it off
    within  seconds for which a step is repeated, 0 for the usual time
    going   family and id of each device on its line that is to be stopped in its place, () = it is the one
    """

    settings: Settings
    can: bool = False
    speed: int | None = None
    fixed: bool = False
    proven: bool = False
    powered: bool = False
    within: float = 0.0
    going: tuple[Addressee, ...] = ()

    def of(self, own: Addressee, device: Addressee) -> StopContext:
        """The context of this device on the line of the `own` one."""
        if device == own:
            return self._replace(going=())
        return self._replace(settings=self.settings._replace(id=device[1]), proven=False, going=())

    @property
    def number(self) -> int:
        """The id of the device; 1 is that of all as shipped."""
        return self.settings.id if self.settings.id is not None else 1


class StopStep(NamedTuple):
    """One write of a stop, and how long to wait for the reply.

    step     the exact bytes and what they do in words
    seconds  how long to listen at most, beyond the time of the wire
    enough   whether the pieces that came answer it
    reads    it changes nothing: it asks for the device's identity or position
    size     bytes of a reply: their time on the wire is added to the wait
    ahead    bytes sent before the step, so that no other device on the line acts on it
    baud     the baud rate to send it at, None = unchanged. If the port does not support it, nothing is sent
    sends    it goes out; without, its reply is awaited for longer
    """

    step: Step
    seconds: float
    enough: Callable[[Pieces], object] = bool
    reads: bool = False
    baud: int | None = None
    size: int = 32
    ahead: bytes = b""
    sends: bool = True


class Stopped(NamedTuple):
    """The result of a stop, from the replies.

    error     None where nothing speaks against it
    evidence  what shows that the device did it, where that is more than the acknowledgement of each frame; "" = nothing
    stranger  a device of another family has replied, and was not stopped
    heard     the device has acknowledged the stop, but was not seen again
    goes_on   it has acknowledged the stop, and was seen to move, or to be commanded, behind it
    """

    text: str
    hint: str = ""
    error: type[HandctlError] | None = None
    evidence: str = ""
    stranger: bool = False
    heard: bool = False
    goes_on: bool = False


StopSequence = Generator[StopStep, Pieces, Stopped]
Read = Generator[StopStep, Pieces, "list[int] | None"]
"""Positions; None where they could not be read."""


class TooLate(Exception):
    """Thrown into a sequence whose time is over: one that has seen something returns that."""


TOO_LATE = "the deadline passed before handctl could confirm that the device has stopped"
OUT_OF_TIME = Stopped(TOO_LATE, "switch the power off if the device is still moving", NoAnswer)
QUIET = Step("listen", b"")
"""Nothing is sent."""


def silence(seconds: float = SILENCE) -> Generator[StopStep, Pieces, Pieces]:
    """Send nothing for a while and return what arrives."""
    return (yield StopStep(QUIET, seconds, lambda _pieces: False, reads=True, size=0, sends=False))


def did_not_last(stopped: Stopped, what: str) -> Stopped:
    """The result of a stop that was acknowledged but did not last."""
    text = f"{stopped.text}. {SILENCE:g} s later {what}: it does not obey, or another program is commanding it"
    return Stopped(text, FIND_WHO, DeviceRefused, goes_on=True)


AGAIN = "The stop was sent once more"
FIND_WHO = (
    "end the other program. `handctl ports` shows the programs that use the ports of this computer. On a network or a bus, "
    "check the other computers too. If the device must not move, switch its power off"
)


def not_seen_again(stopped: Stopped) -> Stopped:
    """The result of a stop that was acknowledged by a device that does not reply any more."""
    text = f"{stopped.text}. {SILENCE:g} s later it did not reply, so it is not known whether it is still moving"
    return Stopped(text, "switch the power off if the device is still moving", NoAnswer, heard=True)


class Sent(NamedTuple):
    """One write that was made, and the bytes that came back."""

    step: Step
    reads: bool
    came: bytes


def stop_sequence_of(kind: str, context: StopContext) -> StopSequence:
    """The stop of a device of family `kind`, or of those that are `going` on its line."""
    if context.going:
        return _one_by_one((kind, context.number), context)
    return once_more(importlib.import_module(FAMILIES[kind].module("stopper")).stop_steps, context)


def once_more(steps: Callable[[StopContext], StopSequence], context: StopContext) -> StopSequence:
    """The stop of a family, and the same once more where the device goes on: then nothing is left `powered`."""
    stopped = yield from steps(context)
    if not stopped.goes_on:
        return stopped
    try:
        again = yield from steps(context._replace(powered=False))
    except TooLate:  # perhaps not one byte of it has gone out
        return stopped._replace(text=joined(stopped.text, TOO_LATE))
    return sent_again(stopped, again)


def sent_again(stopped: Stopped, again: Stopped) -> Stopped:
    """The result of a stop behind which the device went on, and of the second one. It stays an error: who knows what it does next."""
    if again.goes_on:
        return again._replace(text=f"{AGAIN}: {again.text}")
    # a result with a hint already says what was seen
    stands = ", and now it stands still" if again.error is None and not again.hint else ""
    return stopped._replace(text=joined(stopped.text, f"{AGAIN}{stands}: {again.text}"), goes_on=False)


def _one_by_one(own: Addressee, context: StopContext) -> StopSequence:
    """The stop of each device that is `going`."""
    ended = []
    for device in context.going:
        try:
            stopped = yield from stop_sequence_of(device[0], context.of(own, device))
        except TooLate:
            stopped = OUT_OF_TIME
        ended.append(stopped._replace(text=f"{device[0]} id {device[1]}: {stopped.text}"))
        if stopped is OUT_OF_TIME:
            break
    return joined_stops(ended)


def joined_stops(ended: Sequence[Stopped]) -> Stopped:
    """The result of several stops: what speaks against one of them speaks against all."""
    worst = next((one for one in ended if one.error is not None), ended[-1])
    return worst._replace(text=joined(*(one.text for one in ended)))


QUIET_FOR = 0.5
"""Seconds without a single byte after which a device that was expected is perhaps not the one that is there."""


class TwoParts:
    """A stop that pauses where nothing replies, so that its sender can see which device is there; `rest` goes on with it.

    paused   something is left of it
    """

    def __init__(self, sequence: Callable[[StopContext], StopSequence]) -> None:
        self.paused = False
        self._sequence = sequence
        self._rest: StopSequence | None = None

    def __call__(self, context: StopContext) -> StopSequence:
        if self._rest is not None:  # at another id
            return self._sequence(context)
        self._rest = rest = self._sequence(context)
        return self._steps(rest, lambda: next(rest), 0.0)

    def rest(self, context: StopContext) -> StopSequence:
        """What is left of it, once; then all of it, at another id."""
        if self._rest is None or not self.paused:
            return self._sequence(context)
        self.paused, rest = False, self._rest
        return self._steps(rest, lambda: rest.send([]), None)  # behind a step that nothing replied to

    def _steps(self, rest: StopSequence, first: Callable[[], StopStep], quiet: float | None) -> StopSequence:
        """Its steps from the `first` on. It pauses when nothing has come for long enough, until the first byte; `quiet` None = it does not."""
        try:
            action = first()
            while True:
                try:
                    pieces = yield action
                except TooLate as late:
                    rest.throw(late)
                    raise
                quiet = None if quiet is None or pieces else quiet + action.seconds
                if quiet is not None and quiet >= QUIET_FOR:
                    self.paused = True
                    return Stopped(f"no reply within {QUIET_FOR:g} s", error=NoAnswer)
                action = rest.send(pieces)
        except StopIteration as end:
            stopped: Stopped = end.value
            return stopped


class StopPlan:
    """A stop of one device for a process that outlives this one, or for later: it can be called, and pickled.

    device   family and id: which device of its link it stops
    context  all that it needs to know
    """

    def __init__(
        self, kind: str, context: StopContext, sequence: Callable[[StopContext], StopSequence] | None = None
    ) -> None:
        """`sequence` replaces the family's."""
        self.device, self.context = (kind, context.number), context
        self._given = sequence
        self.sequence()  # imports the family's stopper now: later there may be no time, or no disk

    def sequence(self, link: Link | None = None) -> StopSequence:
        """Its steps over this link: who is there is asked anew where that was opened again since."""
        context = self.context if link is None or not link.elsewhere else self.context._replace(proven=False)
        return stop_sequence_of(self.device[0], context) if self._given is None else self._given(context)

    def begun(self, link: Link) -> StopExchange:
        """Its steps; what is left of it is still to be finished. Raises LinkError."""
        exchange = StopExchange(link, self.sequence(link), [])
        exchange.begin()
        return exchange

    def __call__(self, link: Link) -> Stopped:
        return exchange_steps(link, self.sequence(link), [])

    def __reduce__(self) -> tuple[object, ...]:
        return StopPlan, (self.device[0], self.context, self._given)


def writes_without_replies(sequence: StopSequence, *, reads: bool = False) -> list[Step]:
    """The writes of a stop without any reply, each once: for a link that cannot receive.

    Reads are left out unless `reads`: a stop that needs their replies, such as a wrist's, is [] then.
    """
    steps: list[Step] = []
    try:
        action = next(sequence)
        while True:
            if (reads or not action.reads) and action.step not in steps:
                steps.append(action.step)
            action = sequence.send([])
    except StopIteration:
        return steps


def run_stop(link: Link, sequence: StopSequence, ledger: Ledger | None = None) -> Stopped:
    """Run a stop over an open link. Never raises: a lost link is one of its results."""
    return RunningStop(link, sequence, None, ledger).finish()


class RunningStop:
    """A stop over an open link, see `run_stop`. Of several devices each is begun before the first one is finished.

    sent   what went out, and what came
    """

    def __init__(
        self,
        link: Link,
        sequence: StopSequence,
        sent: list[Sent] | None = None,
        ledger: Ledger | None = None,
        until: Deadline | None = None,
    ) -> None:
        self.sent: list[Sent] = [] if sent is None else sent
        self._ledger = ledger

        def plan(step: Step) -> None:
            if ledger is not None:
                ledger.plan([step])

        self._exchange = StopExchange(link, sequence, self.sent, plan, until)
        self._lost: Stopped | None = None

    def begin(self) -> None:
        """Send its steps, see `StopExchange.begin`. Never raises."""
        self._done(self._exchange.begin)

    def finish(self) -> Stopped:
        """Send what is left of it, and check the device. Never raises."""
        stopped = self._lost or self._done(self._exchange.finish)
        if self._lost is not None:
            return self._lost
        assert stopped is not None
        if self._ledger is not None and stopped.error is None:
            self._ledger.stopped()
        if self._ledger is not None and stopped.evidence:
            self._ledger.confirm(stopped.evidence, *(one.step for one in self.sent if not one.reads))
        return stopped

    def _done(self, part: Callable[[], Stopped | None]) -> Stopped | None:
        try:
            with self._ledger.stopping() if self._ledger is not None else nullcontext():
                return part()
        except HandctlError as exc:
            hint = joined("switch the power off if the device is still moving", exc.hint)
            self._lost = Stopped(exc.text, hint, type(exc))
            return None


def exchange_steps(link: Link, sequence: StopSequence, sent: list[Sent]) -> Stopped:
    """Exchange the steps over an open link. Sent steps are appended to `sent`, also when LinkError ends it."""
    return StopExchange(link, sequence, sent).finish()


class StopExchange:
    """The same in two parts. Both raise LinkError."""

    def __init__(
        self,
        link: Link,
        sequence: StopSequence,
        sent: list[Sent],
        before: Callable[[Step], object] = lambda _step: None,
        until: Deadline | None = None,
    ) -> None:
        self._link, self._sequence, self._sent, self._before, self._until = link, sequence, sent, before, until
        self._action: StopStep | None = None
        self._stopped: Stopped | None = None

    def begin(self) -> None:
        """Until its check begins, or the device has not answered one try: another one on the link has its turn then."""
        self._next(None)
        waited, wrote = 0.0, False
        while (action := self._action) is not None and waited < ONE_TRY and not (wrote and action.reads):
            pieces = self._exchanged(action)
            waited += 0.0 if action.enough(pieces) else action.seconds
            wrote = wrote or not action.reads
            self._next(pieces)

    def finish(self) -> Stopped:
        """The rest, or all of it."""
        if self._action is None and self._stopped is None:
            self._next(None)
        while self._action is not None:
            self._next(self._exchanged(self._action))
        assert self._stopped is not None
        return self._stopped

    def _next(self, pieces: Pieces | None) -> None:
        """The next step, or the result."""
        self._action = None
        if self._stopped is not None:
            return
        try:
            self._action = next(self._sequence) if pieces is None else self._sequence.send(pieces)
        except StopIteration as end:
            self._stopped = end.value

    def _cut_off(self) -> Stopped:
        """The result of a sequence that is not finished."""
        try:
            for _ in range(256):  # of several devices each in turn
                self._sequence.throw(TooLate())
        except StopIteration as end:
            stopped: Stopped = end.value
            return stopped
        except TooLate:
            pass
        self._sequence.close()
        return OUT_OF_TIME

    def _exchanged(self, action: StopStep) -> Pieces:
        """What came. Past `until` nothing more goes out that is not the first write, and the result says so."""
        pieces: Pieces = []
        sent, place, until = self._sent, len(self._sent), self._until
        if until is not None:
            if until.expired and (action.reads or not all(one.reads for one in sent)):
                self._stopped = self._cut_off()
                return pieces
            action = action._replace(seconds=min(action.seconds, until.remaining))
        if not action.reads:
            self._before(action.step)
        exchange = _frames if isinstance(self._link, FrameLink) else _bytes
        try:
            exchange(self._link, action, pieces, lambda: sent.append(Sent(action.step, action.reads, b"")))  # type: ignore[arg-type]
        finally:
            if len(sent) > place:
                sent[place] = sent[place]._replace(came=b"".join(pieces))
        return pieces


def found_again(link: Link) -> bool:
    """Whether a link that was lost could be opened again for a stop; who is there is asked anew then. Never raises."""
    guard, found = link.guard, False
    if guard is not None:
        guard.disarm()  # it keeps the lost port open: an adapter that is plugged in again gets another name then
    with suppress(HandctlError):
        found = link.reconnect(RECONNECT_SECONDS)
    link.elsewhere = link.elsewhere or found
    if guard is not None:
        with suppress(LinkError):
            if (raw_access := link.raw_access()) is not None:
                raw_access.elsewhere = link.elsewhere
            guard.follow(raw_access)
    return found


def context_for_link(link: Link, settings: Settings) -> StopContext:
    """The stop context of the device on an open link."""
    can = isinstance(link, FrameLink)
    return StopContext(settings, can, None if can or not link.can_set_baud else link.baud)  # type: ignore[attr-defined]


def _bytes(link: ByteLink, action: StopStep, pieces: Pieces, went: Callable[[], None]) -> None:
    if action.baud is not None and action.baud != link.baud:
        try:
            link.set_baud(action.baud)
        except LinkError:
            return
    if action.sends:
        link.write(action.ahead + action.step.data, link.deadline(WRITE_SECONDS))
        went()
    wire = 10 / link.baud if link.baud else 0.0  # seconds of a byte, 10 bits
    deadline = link.deadline(action.seconds + wire * (len(action.step.data) + action.size))
    while not deadline.expired and (action.step is QUIET or sum(map(len, pieces)) < MOST):
        chunk = link.read(deadline)
        if not chunk:
            return
        pieces.append(chunk)
        if action.enough(pieces):
            return


def _frames(link: FrameLink, action: StopStep, pieces: Pieces, went: Callable[[], None]) -> None:
    if action.step.can_id is None and not action.sends:
        deadline = link.deadline(action.seconds)
        while not deadline.expired and (heard := link.receive(deadline)) is not None:
            pieces.append(heard.data)
        return
    if action.step.can_id is None:
        raise LinkError(
            f"{link.name}: bytes for a serial line cannot be sent on CAN",
            hint="give a LINK of the kind that the device has",
        )
    request = CanFrame(action.step.can_id, action.step.data)
    if action.sends:
        link.send(request, link.deadline(WRITE_SECONDS))
        went()
    deadline = link.deadline(action.seconds)
    while not deadline.expired:
        frame = link.receive(deadline)
        if frame is None:
            return
        if frame.can_id == request.can_id and frame != request:
            pieces.append(frame.data)
            if action.enough(pieces):
                return


def with_repeat_counts(sent: Iterable[Sent]) -> Iterator[tuple[Sent, int]]:
    """The steps, each with how often it went out running; of its answers the last."""
    for _, group in groupby(sent, key=lambda one: one.step):
        alike = list(group)
        yield alike[0]._replace(came=next((one.came for one in reversed(alike) if one.came), b"")), len(alike)


def shown(sent: Sequence[Sent]) -> str:
    """What went out, without what only asked: ``03, 54 0D``; the same step several times running is counted."""
    found = with_repeat_counts(one for one in sent if not one.reads)
    return ", ".join(one.step.wire + (f" ({times} times)" if times > 1 else "") for one, times in found)
