"""The conversation with one AIDIN-hand: find out who speaks first, ask for what is wanted, send one object a period.

The manual does not say who speaks first: listen, then ask with an empty object, never with a mode (dossier 6). What
comes is taken in reception.py.
"""

from __future__ import annotations

from handctl.devices.aidin import speaking as table
from handctl.devices.aidin import trouble
from handctl.devices.aidin.feedback import Feedback, Wire
from handctl.devices.aidin.map import FEEDBACK, AidinParam
from handctl.devices.aidin.reception import SILENCE, Reception
from handctl.devices.aidin.way import FIND_OUT, ExchangeMode, Way
from handctl.errors import ProtocolError, UsageError
from handctl.link import ByteLink, Deadline
from handctl.model.device import Gate
from handctl.model.result import Journal

LISTEN = 0.3
LISTEN_MORE = 1.0
"""Seconds for the next bytes, once anything at all has come."""
LISTEN_LONGEST = 4.0
QUICK = 0.1
"""An answer to an empty object is there by then; what comes later may be the next object of a slow stream."""
SLOWEST = 1.2
"""Seconds of listening, with nothing asked, in which a stream of 1 Hz shows itself."""
FIRST_POLL = 0.5
POLL = 0.2
PERIOD = 0.02
SETTLE = 0.03
"""Seconds after an answer in which the other keys may follow in objects of their own."""
CYCLES = 3
"""A key that is missing or wrong so many times running is given up."""


class Conversation(Reception):
    """One connection.

    retries   polls repeated without an answer
    """

    link: ByteLink

    def __init__(
        self,
        link: ByteLink,
        journal: Journal,
        *,
        timeout: float | None = None,
        retries: int | None = None,
        bound: Deadline | None = None,
        way: Way = FIND_OUT,
    ) -> None:
        super().__init__(link, journal, timeout=timeout, retries=retries, bound=bound, way=way)
        self.gate: Gate | None = None
        self._shown: tuple[str, ...] = ()  # the keys of which `feedback` was shown
        self._fresh = False  # what `connect` heard has not lain in the input
        self._silence = timeout or SILENCE  # of a stream, longer for a slow one

    # -- connect -------------------------------------------------------------------------------------------------

    def connect(self, *, silent: bool = False) -> None:
        """Find out who speaks first: listen, then poll. With `silent` only listen.

        Raises NoAnswer when nothing comes, ProtocolError when what comes is no feedback, UsageError for a hand that is
        said to answer commands only.
        """
        if self.way.exchange is ExchangeMode.COMMAND:
            raise UsageError(
                "with --exchange command the hand only replies to commands, so handctl cannot read it",
                hint="`home`, `stop`, `max-torque`, `initial --assume-homed` and `currents` with all 15 values show its replies. Other commands need its position. Nothing was sent.",
                code="commands-only",
            )
        if self.exchange is not ExchangeMode.UNKNOWN:
            return
        began = self.link.now()
        asks = self.way.exchange is not ExchangeMode.STREAM and not silent
        state = table.ASKED if self.way.exchange is ExchangeMode.POLL and asks else table.LISTENED
        while state not in table.ENDS:
            seen = self._seen_in(state)
            state = table.RULES[state, seen]
            if (not asks and state == table.ASKED) or (not self.retries and state == table.AGAIN):
                state = table.UNASKED[seen]
        if state == table.STRANGER:
            raise self._no_feedback()
        if state == table.SILENT:
            raise self._silent(asked=asks, since=began)
        self.exchange = ExchangeMode.STREAM if state == table.STREAMS else ExchangeMode.POLL

    def _seen_in(self, state: str) -> str:
        """Do what the state of `speaking` says; what is seen then."""
        if state == table.LISTENED:
            self._listen(LISTEN if self.way.exchange is ExchangeMode.UNKNOWN else self.timeout or SILENCE)
            if self.feedback.seen:
                return table.FEEDBACK
            if self._junk or self._decoder.pending:
                return table.DAMAGED
        elif state == table.DOUBTED:
            return table.FEEDBACK if self.look_again() else table.NOTHING
        else:
            self._fresh = self.way.exchange is ExchangeMode.UNKNOWN  # else nobody has looked into the input before
            asked = self.link.now()
            self.send(self.way.poll)
            if self._answer(self.timeout or FIRST_POLL):
                self.exchange = ExchangeMode.POLL
                late = self.way.exchange is ExchangeMode.UNKNOWN and self._last - asked > QUICK + SETTLE
                return table.LATE if late else table.FEEDBACK
            if self._junk:
                return table.DAMAGED
        return table.OTHER if self._strange or self._echoes or self._decoder.pending else table.NOTHING

    def look_again(self) -> bool:
        """Whether the hand streams, slowly, although an empty object seemed to be answered: something comes unasked."""
        if self.exchange is not ExchangeMode.POLL or self.way.exchange is not ExchangeMode.UNKNOWN:
            return False
        before, end = self._last, self.deadline(SLOWEST)
        while self._last == before and not end.expired:
            self._receive(end)
        if self._last == before:
            return False
        self.exchange = ExchangeMode.STREAM
        self._silence = max(self._silence, min(2.5 * (self._last - before), LISTEN_LONGEST))
        return True

    def _listen(self, seconds: float) -> None:
        """Take what the hand says unasked. Once it has begun it may finish: an object may come in small pieces.

        A key that came three times says that the hand streams, whatever is wrong with another.
        """
        end, last = self.deadline(seconds), self.deadline(LISTEN_LONGEST)
        while not self.feedback.complete() and not end.expired and not last.expired:
            if max(self.feedback.seen.values(), default=0) >= CYCLES:
                return
            before = self._bytes_seen
            self._receive(end.earlier(last))
            if self._bytes_seen != before:
                end = self.deadline(LISTEN_MORE)

    # -- feedback ------------------------------------------------------------------------------------------------

    def refresh(self, params: tuple[AidinParam, ...] = FEEDBACK) -> dict[str, Wire | ProtocolError]:
        """Values that come from now on, by key; of a key that stays away or is wrong, why.

        Raises NoAnswer when no feedback comes at all, ProtocolError when nothing of it can be used.
        """
        first = self.exchange is ExchangeMode.UNKNOWN
        self.connect()
        keys = tuple(param.key for param in params)
        if first and self._fresh and self.feedback.complete(keys):
            self._shown = keys
            return {key: self.feedback.result(key) for key in keys}
        self.drain()
        self.feedback.replaced(self._shown)
        self._shown = keys
        feedback = self.feedback = Feedback(self.quality)
        attempts = 1 + self.retries if self.exchange is ExchangeMode.POLL else 1
        for attempt in range(attempts):
            self.check_bound()
            if attempt and not feedback.seen:
                self.journal.counters.retries += 1
            if self.exchange is ExchangeMode.POLL:
                self.send(self.way.poll)
                if self._answer(self.poll_seconds, keys) and self.feedback.complete(keys):
                    break
            else:
                self._follow(keys)
        if not feedback.seen and self.look_again() and not feedback.complete(keys):
            self._follow(keys)
        if not feedback.seen:
            error = self.journal.blame(self.nothing_came())
            self.check_bound()
            raise error
        return {key: self.feedback.result(key) for key in keys}

    def need(self, *params: AidinParam) -> list[Wire]:
        """The values of all these, from now on. Raises as `refresh` does, and ProtocolError for one that is wrong."""
        found = self.refresh(params)
        return [self.usable(param, found[param.key]) for param in params]

    def usable(self, param: AidinParam, found: Wire | ProtocolError) -> Wire:
        """The array, or raise what is wrong with it."""
        found = trouble.named(self.link.name, param, found)
        if isinstance(found, ProtocolError):
            raise found
        return found

    def _follow(self, keys: tuple[str, ...]) -> None:
        """Read a stream until all `keys` are good, or another one has come three times since."""
        end, last = self.deadline(self._silence), self.deadline(LISTEN_LONGEST)
        while not end.expired and not last.expired:
            before = self._bytes_seen
            if self._receive(end) and (self.feedback.complete(keys) or max(self.feedback.seen.values()) >= CYCLES):
                return
            if self._bytes_seen != before:
                end = self.deadline(self._silence)

    def _answer(self, seconds: float, keys: tuple[str, ...] = ()) -> bool:
        """Wait for the answer to an object; the rest of its keys may follow at once. False on silence."""
        end, last = self.deadline(seconds), self.deadline(LISTEN_LONGEST)
        answered = False
        while not end.expired and not last.expired and not (answered and self.feedback.complete(keys)):
            before = self._bytes_seen
            answered = self._receive(end) or answered
            if self._bytes_seen != before:
                end = self.deadline(SETTLE if answered else seconds)
        return answered

    @property
    def poll_seconds(self) -> float:
        """How long the answer to a poll may take."""
        return self.timeout or POLL

    # -- who is there ----------------------------------------------------------------------------------------------

    def identify(self) -> None:
        """Before a first command: feedback was seen, which nobody else sends. Raises NotIdentified, Interrupted.

        A hand that is said to answer commands only cannot be asked: what it says unasked must not speak against it.
        """
        if self.gate is not None and self.exchange in (ExchangeMode.UNKNOWN, ExchangeMode.COMMAND):
            self.gate.check(self.link, self.journal, self._look)

    def _look(self) -> None:
        if self.way.exchange is not ExchangeMode.COMMAND:
            self.connect()
            return
        self.drain()
        if self._junk or self._decoder.pending:
            raise self._no_feedback()
        self.journal.info(
            "not-asked",
            "with --exchange command handctl cannot check that this is an AIDIN-hand, and trusts what you typed",
        )

    # -- one object a period --------------------------------------------------------------------------------------

    def tick(self, data: bytes, *, blind: bool = False, by: AidinParam | None = None) -> None:
        """Send one object and take feedback until its period is over; a hand that answers is waited for.

        Raises NoAnswer when feedback stays away (1 s of a stream, three unanswered objects) unless `blind`, and
        ProtocolError when what the command goes `by` is wrong three times running, or missing for 1 s.
        """
        self.identify()
        self.check_bound()
        if self.exchange is ExchangeMode.STREAM:
            self.drain()
        start, end = self.link.now(), self.deadline(PERIOD)
        self.send(data)
        waits = self.exchange in (ExchangeMode.POLL, ExchangeMode.COMMAND)
        answer = self.deadline(min(POLL, self.poll_seconds)) if waits else end
        answered = False
        while not (answered and waits) and not answer.expired:
            answered = self._receive(answer) or answered
        while not end.expired:
            answered = self._receive(end) or answered
        if answered and self.exchange is ExchangeMode.UNKNOWN:
            self.exchange = ExchangeMode.COMMAND
        self._unanswered = 0 if answered else self._unanswered + 1
        silent = self._unanswered > self.retries if waits else start - self._last > (self.timeout or SILENCE)
        if silent and not blind:
            self.check_bound()
            raise self._silent(moving=True)
        if by is not None:
            self._check_sight(by)

    def check_alive(self) -> None:
        """Raise NoAnswer when not one byte has come for 1 s: where feedback may be as slow as it likes."""
        if self.link.now() - self._heard > (self.timeout or SILENCE):
            raise self._silent(moving=True)

    def _check_sight(self, param: AidinParam) -> None:
        """Nothing is driven on by a quantity that the hand no longer tells."""
        key = param.key
        missing = self._last - self._good.get(key, self._last) > (self.timeout or SILENCE)  # other keys still came
        if missing or self.feedback.wrong.get(key, 0) >= CYCLES:
            wrong = self.feedback.errors.get(key)
            self.usable(param, wrong or ProtocolError("the hand no longer sends it", code="missing-key"))

    def check_answered(self) -> None:
        """Look again where the last object was not answered within its period. Raises as `refresh` does."""
        if self._unanswered:
            self.refresh()
