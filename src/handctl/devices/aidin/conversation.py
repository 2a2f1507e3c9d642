"""The connection to one AIDIN-hand: detect its exchange mode, request values, send one object per period.

The manual does not say who speaks first: listen, then ask with an empty object, never with a mode (dossier 6). Feedback is
merged key by key: `Feedback` holds the newest value of each, or why it was rejected.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from math import inf
from typing import Any

from handctl.devices.aidin import exchange_settings as table
from handctl.devices.aidin.exchange_settings import (
    ANSWER_SECONDS,
    FIND_OUT,
    FIRST_ANSWER_SECONDS,
    LISTEN,
    PERIOD,
    QUICK,
    SETTLE,
    SLOWEST,
    STREAM_SECONDS,
    ExchangeMode,
    ExchangeSettings,
)
from handctl.devices.aidin.feedback_guard import FeedbackGuard, Liveness
from handctl.devices.aidin.json_codec import RECORD_BYTES, Decoder, MalformedObject, WrongNumbers, numbers
from handctl.devices.aidin.parameter_map import FEEDBACK, AidinParam
from handctl.errors import Aftermath, HandctlError, LinkError, NoAnswer, ProtocolError, UsageError
from handctl.families import FAMILIES
from handctl.link import ByteLink, Deadline
from handctl.model.device import OTHER_FORM, Gate, Line
from handctl.model.device_clock import Moment
from handctl.model.frame_decoder import frames_in
from handctl.model.param import Element, Number
from handctl.model.result import Journal, hex_bytes

MISSING = "missing-key"
"""Code of a key that the hand does not send."""
Wire = tuple[int, ...] | tuple[float, ...]
ALL = tuple(param.key for param in FEEDBACK)


class KeyErrors:
    """How good each key is over a whole connection, counted into `keys`: key -> bad, missing, skipped.

    bad      it was there and had not the form that the manual says
    missing  all that comes in one round, in one object or several, came without it
    skipped  a good value that a newer one replaced before it was shown
    """

    def __init__(self) -> None:
        self.keys: dict[str, dict[str, int]] = {key: {"bad": 0, "missing": 0, "skipped": 0} for key in ALL}
        self._round: set[str] = set()

    def came(self, keys: Iterable[str]) -> None:
        """These keys, in this order. A round ends with the first key that comes again."""
        for key in keys:
            if key in self._round:
                for other in self.keys.keys() - self._round:
                    self.keys[other]["missing"] += 1
                self._round.clear()
            self._round.add(key)


class Feedback:
    """The newest value of every key, or why it was refused; how often it came, and how often running it was refused."""

    def __init__(self, quality: KeyErrors | None = None) -> None:
        self.quality = quality or KeyErrors()
        self.good: Counter[str] = Counter()
        self.wrong: Counter[str] = Counter()
        self.values: dict[str, Wire] = {}
        self.errors: dict[str, ProtocolError] = {}
        self.seen: Counter[str] = Counter()

    def merge(self, content: dict[str, object]) -> int:
        """Merge an object; number of known keys in it."""
        known = [param for param in FEEDBACK if param.key in content]
        self.quality.came([param.key for param in known])
        for param in known:
            key = param.key
            self.seen[key] += 1
            try:
                self.values[key] = numbers(
                    content[key], param.count, int_range=param.int_range, most=param.most_on_wire
                )
                self.good[key] += 1
                if key in self.errors:
                    del self.errors[key], self.wrong[key]
            except ProtocolError as exc:
                self.quality.keys[key]["bad"] += 1
                self.errors[key] = exc
                self.wrong[key] += 1
        return len(known)

    def replaced(self, keys: tuple[str, ...]) -> None:
        """Of these keys one value was shown; the other good ones that have come were not."""
        for key in keys:
            self.quality.keys[key]["skipped"] += max(0, self.good[key] - 1)

    def complete(self, keys: tuple[str, ...] = ()) -> bool:
        """Whether a good value of every key (or of these) has come."""
        return all(key in self.values and key not in self.errors for key in keys or ALL)

    def result(self, key: str) -> Wire | ProtocolError:
        """The newest value of a key, or why there is none."""
        if key in self.errors:
            return self.errors[key]
        return self.values[key] if key in self.values else ProtocolError("the hand does not send it", code=MISSING)


def keys_in(data: bytes) -> list[str]:
    """Keys of the manual in text that has none of them as it should be: in another spelling, or within something else."""
    letters = "".join(chr(byte) for byte in data if chr(byte).isalpha()).lower()
    return [key for key in ALL if key.replace("_", "") in letters] if data.isascii() else []


def values_of(param: AidinParam, wire: Wire) -> list[Number]:
    """A whole array in the parameter's unit."""
    return [param.from_wire(number) for number in wire]


def named(where: str, param: AidinParam, found: Wire | ProtocolError) -> Wire | ProtocolError:
    """The received value of a key; an error names the hand, the key and the elements as `get` accepts them."""
    return _named(where, param, found) if isinstance(found, ProtocolError) else found


def _named(where: str, param: AidinParam, found: ProtocolError) -> ProtocolError:
    if isinstance(found, WrongNumbers):
        texts = (f"{Element(param, place).full_name} {exc.text}" for place, exc in found.wrong.items())
        return _spelled(where, "; ".join(texts), found)
    return _spelled(where, f"{param.key}: {found.text}", found)


def number_of(where: str, element: Element, param: AidinParam, found: Wire | ProtocolError) -> Number | ProtocolError:
    """The number of one element; an error only where it concerns this one."""
    if isinstance(found, WrongNumbers):
        wrong, number = found.wrong.get(element.index), found.numbers[element.index]
        if wrong is None and number is not None:
            return number
        return _spelled(where, f"{element.full_name} {wrong.text if wrong else found.text}", wrong or found)
    found = named(where, param, found)
    return found if isinstance(found, ProtocolError) else found[element.index]


def _spelled(where: str, text: str, why: ProtocolError) -> ProtocolError:
    return ProtocolError(f"{where}: {text}", hint=RECORD_BYTES, code=why.code)


# -- feedback: the newest value of every key, or why it was rejected --------------------------------------------------


LISTEN_MORE = 1.0
"""Seconds for the next bytes, once anything at all has come."""
LISTEN_LONGEST = 4.0
CYCLES = 3
"""A key that is missing or wrong so many times running is given up."""


WATCHED = 1.2
"""Seconds in which feedback that has frozen shows itself (see `Liveness.frozen`)."""
WRITE_SECONDS = 1.0
BAD_IN_A_ROW = 3
MOST_UNKNOWN, LONGEST_NAME = 20, 40
READS_AT_ONCE = 256
KEPT, SHOWN = 1024, 64
"""Bytes that are no feedback: looked at for what they are, and shown."""


class Conversation(Line):
    """What is said over one connection, and what has come, merged.

    timeout   seconds of silence allowed; None = STREAM_SECONDS, or ANSWER_SECONDS for the answer to a poll
    retries   polls repeated without an answer
    way       what is said about how the hand speaks; `exchange` is what is known of it by now
    """

    link: ByteLink

    def __init__(self, link: ByteLink, journal: Journal, *, way: ExchangeSettings = FIND_OUT, **limits: Any) -> None:
        super().__init__(link, journal, **limits)
        self.way = way
        self.gate: Gate | None = None
        self.exchange = ExchangeMode.UNKNOWN
        self.each = False
        """Whether each object of a stream is a reading of its own, so that none is passed over."""
        self.came = Moment(0.0, 0.0)
        """Within which time the last bytes came."""
        self._drained = False
        self.quality = KeyErrors()
        journal.counters.keys = self.quality.keys
        self.feedback = Feedback(self.quality)
        self.live = Liveness()
        self.guard: FeedbackGuard | None = None
        """What watches the feedback while the hand is driven."""
        self._shown: tuple[str, ...] = ()  # the keys of which `feedback` was shown
        self._fresh = False  # what `connect` heard has not lain in the input
        self._patience = self.timeout or STREAM_SECONDS
        self._silence = self._patience  # of a stream, longer for a slow one
        self._strange = b""  # the first object that is neither feedback nor ours
        self._since = b""  # what has come since the last feedback and is none
        self._decoder = Decoder()
        self._bad_in_a_row = 0
        self._junk = b""
        self._cut = False  # one of them had no end: the line does that, no firmware
        self._why = ""  # what is wrong with the first object that was damaged
        self._echoes = 0
        self._heard = 0.0  # when anything came last
        self.feedback_at = 0.0
        """When feedback came last."""
        self._good: dict[str, float] = {}  # when a key came last as it should
        self._unanswered = 0
        self._unknown: set[str] = set()

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
            state = table.NEXT[state][seen]
            if (not asks and state == table.ASKED) or (not self.retries and state == table.AGAIN):
                state = table.UNASKED[seen]
        if state == table.STRANGER:
            raise self._no_feedback()
        if state == table.SILENT:
            raise self._silent(asked=asks, since=began)
        self.exchange = ExchangeMode.STREAM if state == table.STREAMS else ExchangeMode.POLL

    def _seen_in(self, state: str) -> str:
        """Do what the state of the table says; what is seen then."""
        if state == table.LISTENED:
            self._listen(LISTEN if self.way.exchange is ExchangeMode.UNKNOWN else self._patience)
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
            if self._answer(self.timeout or FIRST_ANSWER_SECONDS):
                self.exchange = ExchangeMode.POLL
                late = self.way.exchange is ExchangeMode.UNKNOWN and self.feedback_at - asked > QUICK
                return table.LATE if late else table.FEEDBACK
            if self._junk:
                return table.DAMAGED
        return table.OTHER if self._strange or self._echoes or self._decoder.pending else table.NOTHING

    def look_again(self) -> bool:
        """Whether the hand streams, slowly, although an empty object seemed to be answered: something comes unasked."""
        if self.exchange is not ExchangeMode.POLL or self.way.exchange is not ExchangeMode.UNKNOWN:
            return False
        before, end = self.feedback_at, self.deadline(SLOWEST)
        while self.feedback_at == before and not end.expired:
            self._receive(end)
        if self.feedback_at == before:
            return False
        self.exchange = ExchangeMode.STREAM
        self._silence = max(self._silence, min(2.5 * (self.feedback_at - before), LISTEN_LONGEST))
        return True

    def _listen(self, seconds: float) -> None:
        """Take what the hand says unasked. Once it has begun it may finish: an object may come in small pieces.

        A key that came three times says that the hand streams, whatever is wrong with another.
        """
        self._until(lambda _: self.feedback.complete() or self._again, seconds, LISTEN_MORE)

    @property
    def _again(self) -> bool:
        """Whether a key has come so often that others need not be waited for."""
        return max(self.feedback.seen.values(), default=0) >= CYCLES

    def _until(self, done: Callable[[bool], bool], seconds: float, more: float, settle: float | None = None) -> bool:
        """Take what comes until `done`, or silence for `seconds`, then `more`; once feedback came, for `settle`. Whether it did."""
        end, last = self.deadline(seconds), self.deadline(LISTEN_LONGEST)
        answered = False
        while not done(answered) and not end.expired and not last.expired:
            before = self._bytes_seen
            answered = self._receive(end) or answered
            if self._bytes_seen != before:
                end = self.deadline(settle if answered and settle is not None else more)
        return answered

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
        follows = self.each and self.exchange is ExchangeMode.STREAM
        if not (follows and self._drained):
            self.drain()  # what has lain there is old
        self._drained = follows
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
            elif follows:
                self._next_round(keys)
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
        if isinstance(found, ProtocolError):
            raise _named(self.link.name, param, found)
        return found

    def _follow(self, keys: tuple[str, ...]) -> None:
        """Read a stream until all `keys` are good, or another one has come three times since."""
        self._until(lambda _: self.feedback.complete(keys) or self._again, self._silence, self._silence)

    def _next_round(self, keys: tuple[str, ...]) -> None:
        """The same, object by object: what comes after them is left for the next reading."""
        end, last = self.deadline(self._silence), self.deadline(LISTEN_LONGEST)
        while not self.feedback.complete(keys) and not self._again and not last.expired:
            content = next(frames_in(self._decoder, self._note_bad), None)
            if content is not None:
                self._take(content)
            elif self._fill(end):
                end = self.deadline(self._silence)
            elif end.expired:
                break

    def _answer(self, seconds: float, keys: tuple[str, ...] = ()) -> bool:
        """Wait for the answer to an object; the rest of its keys may follow at once. False on silence."""
        return self._until(lambda answered: answered and self.feedback.complete(keys), seconds, seconds, SETTLE)

    @property
    def poll_seconds(self) -> float:
        """How long the answer to a poll may take."""
        return self.timeout or ANSWER_SECONDS

    # -- who is there ----------------------------------------------------------------------------------------------

    def identify(self) -> None:
        """Before the first command: check that feedback arrived, which no other device sends. Raises NotIdentified, Interrupted.

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

    @contextmanager
    def guarded(self, *, leaps: bool = True) -> Iterator[None]:
        """Around a movement: `tick` raises ImplausibleFeedback when the encoders leap or the feedback has frozen.

        Raises it before the movement where the feedback has frozen already: a hand that is not driven yet is not stopped.
        Without `leaps` the hand drives no motor, so the encoders may leap.
        """
        self.guard = FeedbackGuard(self.live, self.feedback_at, self._good_of(ALL))
        self.guard.sets_origin = inf if leaps else -inf
        try:
            self.guard.check_frozen(self.link.name, self.feedback_at)
            if self.guard.fault is not None:
                self.guard.fault.add_aftermath(Aftermath(behind="Nothing was commanded."))
            self.check_plausible()
            yield
        finally:
            self.guard = None

    def _good_of(self, keys: Iterable[str]) -> dict[str, Wire]:
        values, errors = self.feedback.values, self.feedback.errors
        return {key: values[key] for key in keys if key in values and key not in errors}

    def check_plausible(self) -> None:
        """Raise ImplausibleFeedback where the hand is `guarded` and the feedback cannot be that of a hand that is driven."""
        if self.guard is not None and self.guard.fault is not None:
            raise self.guard.fault

    def tick(self, data: bytes, *, blind: bool = False, by: AidinParam | None = None) -> None:
        """Send one object and take feedback until its period is over; a hand that answers is waited for.

        Raises NoAnswer when feedback stays away (1 s of a stream, three unanswered objects) unless `blind`, ImplausibleFeedback
        where the hand is `guarded`, and ProtocolError when what the command goes `by` is wrong three times running, or missing for 1 s.
        """
        self.identify()
        self.check_bound()
        if self.exchange is ExchangeMode.STREAM:
            self.drain()
        self.check_plausible()
        start, end = self.link.now(), self.deadline(PERIOD)
        self.journal.counters.writes += 1
        self.send(data)
        waits = self.exchange in (ExchangeMode.POLL, ExchangeMode.COMMAND)
        answer = self.deadline(min(ANSWER_SECONDS, self.poll_seconds)) if waits else end
        answered = False
        while not (answered and waits) and not answer.expired:
            answered = self._receive(answer) or answered
        while not end.expired:
            answered = self._receive(end) or answered
        if answered and self.exchange is ExchangeMode.UNKNOWN:
            self.exchange = ExchangeMode.COMMAND
        self._unanswered = 0 if answered else self._unanswered + 1
        self.check_plausible()
        silent = self._unanswered > self.retries if waits else start - self.feedback_at > (self._patience)
        if silent and not blind:
            self.check_bound()
            raise self._silent(moving=True)
        if by is not None:
            self.check_sight(by)

    def check_alive(self) -> None:
        """Raise NoAnswer when not one byte has come for 1 s: where feedback may be as slow as it likes."""
        if self.link.now() - self._heard > (self._patience):
            raise self._silent(moving=True)

    def check_sight(self, param: AidinParam) -> None:
        """Stop driving if the hand no longer reports a quantity that is needed."""
        key = param.key
        missing = self.feedback_at - self._good.get(key, self.feedback_at) > (self._patience)  # other keys still came
        if missing or self.feedback.wrong[key] >= CYCLES:
            wrong = self.feedback.errors.get(key)
            self.usable(param, wrong or ProtocolError("the hand no longer sends it", code="missing-key"))

    def watch(self) -> bool:
        """Take feedback until a value changes, for as long as it takes to see that it has frozen. Whether one did; raises as `refresh` does."""
        before, end = self.live.changes, self.deadline(WATCHED)
        shown, self.feedback = self.feedback, Feedback()  # these are no readings, of which some are passed over
        try:
            while self.live.changes == before and not end.expired:
                if self.exchange is ExchangeMode.STREAM:
                    self._receive(end)
                else:
                    self.send(self.way.poll)
                    self._answer(self.poll_seconds)
                    self.pause(PERIOD)
        finally:
            self.feedback = shown
        return self.live.changes > before

    def check_answered(self) -> None:
        """Look again where the last object was not answered within its period. Raises as `refresh` does."""
        if self._unanswered:
            self.refresh()

    def reconnect(self, seconds: float) -> bool:
        """See Link: what the old connection left half said is no part of the new one. Raises LinkError."""
        done = self.link.reconnect(seconds)
        if done:
            self._decoder = Decoder()
        return done

    # -- bytes ---------------------------------------------------------------------------------------------------

    def send(self, data: bytes) -> None:
        """One object, ended by the terminator, in one write. Raises LinkError."""
        self.link.write(data + self.way.end, self.link.deadline(WRITE_SECONDS))
        self.journal.counters.sent += 1

    def _receive(self, deadline: Deadline) -> bool:
        """Take what arrives before `deadline`; whether feedback was in it. Raises LinkError, ProtocolError."""
        if not self._fill(deadline):
            return False
        found = False
        for content in frames_in(self._decoder, self._note_bad):
            found = self._take(content) or found
        return found

    def _fill(self, deadline: Deadline) -> bool:
        """Give the decoder what arrives before `deadline`; whether anything did. Raises LinkError."""
        asked = self.link.now()
        try:
            data = self.link.read(deadline)
        except LinkError as exc:
            raise self._closed(exc) from exc
        if not data:
            return False
        self._heard = self.link.now()
        self.came = Moment(asked, self._heard)
        self._decoder.feed(data)
        return True

    def _take(self, content: dict[str, object]) -> bool:
        if not self.feedback.merge(content):
            ours = not content or "hand_mode" in content or self._decoder.taken == self.way.poll.strip()
            if ours and self.journal.counters.sent:  # before anything was sent it cannot have come back
                self._echoes += 1
            else:
                self._strange = self._strange or self._decoder.taken[:KEPT]
                self._since = (self._since + self._decoder.taken)[:64]
                self._note_unknown(content)
            return False
        self.journal.counters.received += 1
        self._bad_in_a_row = self._unanswered = 0
        self._since = b""
        self.feedback_at = self.link.now()
        good = self._good_of(content)
        self._good.update(dict.fromkeys(good, self.feedback_at))
        if self.guard is not None:
            self.guard.note(self.link.name, self.feedback_at, good)
        else:
            self.live.note(self.feedback_at, good)
        self._note_unknown(content)
        return True

    def _note_unknown(self, content: dict[str, object]) -> None:
        """Name keys that the manual does not have, each once and not more than a person reads."""
        new = [key for key in content if key not in ALL and key not in self._unknown][
            : MOST_UNKNOWN - len(self._unknown)
        ]
        if new:
            self._unknown.update(new)
            names = ", ".join(key[:LONGEST_NAME] for key in new)
            self.journal.info("unknown-keys", f"keys that are not in the manual: {names}")

    def _note_bad(self, exc: ProtocolError) -> None:
        assert isinstance(exc, MalformedObject)
        counters = self.journal.counters
        self._junk = (self._junk + exc.data)[:KEPT]
        self._since = (self._since + exc.data)[:64]
        if exc.stray:
            counters.stray_bytes += len(exc.data)
            return
        counters.bad_frames += 1
        self._cut = self._cut or exc.cut
        self._why = self._why or exc.text.partition(": b")[0]  # its bytes are told beside it
        self._bad_in_a_row += 1
        if self._bad_in_a_row >= BAD_IN_A_ROW:
            if len(keys_in(exc.data)) > 1 and not (counters.received or self._cut):
                raise self._told(exc.data, why=self._why)
            raise ProtocolError(
                f"{self.link.name}: {BAD_IN_A_ROW} corrupted objects in a row, the last one: {exc.text}; "
                f"its bytes begin {hex_bytes(exc.data[:16])}",
                hint=RECORD_BYTES,
                code="bad-json",
            )

    def drain(self) -> None:
        """Take everything that has already arrived."""
        for _ in range(READS_AT_ONCE):
            before = self._bytes_seen
            if not self._receive(self.link.at_once) and self._bytes_seen == before:
                return

    @property
    def _bytes_seen(self) -> int:
        return sum(self.feedback.seen.values()) + len(self._junk + self._strange) + len(self._decoder.pending)

    # -- what went wrong -------------------------------------------------------------------------------------------

    def nothing_came(self) -> HandctlError:
        """The error of a hand that has sent no feedback: silence, or other data."""
        instead = self._junk or self._strange or self._decoder.pending or self._echoes
        return self._no_feedback() if instead else self._silent()

    def _silent(self, *, asked: bool = True, moving: bool = False, since: float | None = None) -> HandctlError:
        """Nothing has come for a while, although the hand was `asked`; `since` a moment, or while it was `moving`."""
        patience = self._patience
        if since is not None:  # --deadline may have cut it short
            patience = min(patience, round(self.link.now() - since, 2))
        known = moving or self.exchange is not ExchangeMode.UNKNOWN
        name, unasked = self.link.name, "sends nothing without a request"
        if self.journal.counters.received and known:
            if instead := self._since or self._decoder.pending[:64]:
                return self._told(instead, more="more ")
            return NoAnswer(
                f"{name}: the hand has stopped sending feedback",
                hint="check the hand with `status`, and check the network. A hand that sends less than once a second needs --exchange stream --timeout S",
            )
        if self.way.exchange is ExchangeMode.STREAM:
            text = (
                f"connected, but the hand has sent nothing for {patience:g} s, and --exchange stream sends no request"
            )
            hint = "leave --exchange out, so that handctl sends an empty object as a request"
            return NoAnswer(f"{name}: {text}", hint=hint)
        if not asked:
            return NoAnswer(
                f"{name}: connected, but the hand {unasked}, and a dry run sends none",
                hint="give all values, so that the current position is not needed",
            )
        poll = "an empty object" if self.way.poll == FIND_OUT.poll else self.way.poll.decode("ascii")[:60]
        silent = f"{unasked} and does not reply" if self.way.exchange is ExchangeMode.UNKNOWN else "does not reply"
        return NoAnswer(
            f"{name}: connected, but the hand {silent} {poll}",
            hint=f"check the port ({FAMILIES['aidin'].tcp_port}), and that no other client is connected. If the hand works differently, try --exchange stream|poll, --poll-json TEXT or --tx-terminator nul|none. If it only replies to commands, use --exchange command. `stop` is always sent",
        )

    def _closed(self, exc: LinkError) -> HandctlError:
        """The error of a connection that was closed before any feedback: other data shows what it was, silence that the hand is in use."""
        if self.journal.counters.received:
            return exc
        if self._junk:
            return self._no_feedback()
        hint = "check the address and the port: it may be another server, or another client may be connected to the hand, which serves only one"
        return LinkError(exc.text, hint=hint, code=exc.code)

    def _no_feedback(self) -> HandctlError:
        strange = b"" if self._junk else self._strange
        seen = self._junk or strange or self._decoder.pending[:64]
        return self._told(seen, whole=bool(strange), why=self._why if self._junk else "")

    def _told(self, seen: bytes, *, whole: bool = False, more: str = "", why: str = "") -> HandctlError:
        """What came, `seen`, is no feedback; b"": only our own object came back. `whole`: it is an object with other keys.

        `more`: "more " where feedback had come before; `why`: what is wrong with an object that was damaged.
        """
        name = self.link.name
        if not seen:
            echo = "check the address and the port: this is an echo server, not the hand"
            return ProtocolError(f"{name}: only our own object came back, and no feedback", hint=echo, code="echo")
        keys, seen = keys_in(seen), seen[:SHOWN]
        shown = "".join(chr(byte) if 32 <= byte < 127 else "." for byte in seen)
        if len(keys) > 1 and not more and not self._cut:
            return ProtocolError(
                f"{name}: the hand sends feedback, but not as the manual describes{f' ({why})' if why else ''}: {shown} …",
                hint="record the bytes with --trace FILE, and ask the vendor: it may have another firmware. handctl reads no values from such feedback",
                code=OTHER_FORM,
                came=seen,
            )
        hint = f"check the address and the port: this may be another server or another kind of hand. The AIDIN-hand sends JSON on TCP port {FAMILIES['aidin'].tcp_port}"
        if whole:
            hint = f"this JSON object has no key from the manual: it may be a report from the hand itself. Otherwise {hint}"
        text = f"{name}: no {more}feedback from the hand, but {hex_bytes(seen)} ({shown}){f': {why}' if why else ''}"
        return ProtocolError(text, hint=hint, code="garbage", came=seen)
