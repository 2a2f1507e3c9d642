"""The line to an EksoNR: one request, one answer, a deadline on everything; reads are repeated, writes never (ekso §6).

`DataPort` speaks in frames and words; what the words mean is not known here. What is not the answer is dropped and
counted. For recordings: `samples` yields GetData as fast as the device answers, `settings_raw` the 22 settings.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from handctl.devices.ekso.attempt import HINTS, Attempt, key_of, shorten
from handctl.devices.ekso.frames import ANSWER_SIZES, OVERHEAD, Command, Decoder, Frame, encode, name_of
from handctl.devices.ekso.map import SETTINGS
from handctl.errors import HandctlError, ProtocolError
from handctl.link import ByteLink, Deadline
from handctl.model.clocks import Moment
from handctl.model.device import Gate, Line
from handctl.model.foreign import harmless
from handctl.model.frames import frames_in
from handctl.model.result import Journal, hex_bytes

DEFAULT_TIMEOUT = 0.5
"""Seconds for the whole answer; the manual names none."""
QUIET = 0.02
"""Seconds of silence that end a resynchronisation: an answer to somebody else's request has passed then."""
AFTER_BROKEN = 3 * QUIET
"""How much longer an answer is waited for behind a broken one."""


WRITING = (Command.SET_VALUE, Command.CANCEL_ACTION)


@dataclass(slots=True)
class Counts:
    """What went wrong on the line, by kind."""

    answered: int = 0
    timeouts: int = 0
    crc_errors: int = 0
    length_errors: int = 0
    late: int = 0
    duplicates: int = 0
    unsolicited: int = 0

    def as_dict(self) -> dict[str, int]:
        """By name, for sidecars and reports."""
        return {name: getattr(self, name) for name in self.__slots__}


class DataPort(Line):
    """One EksoNR on a byte link.

    timeout  seconds for the whole answer
    mode     what the length byte of our requests counts; answers may count as they like
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
        mode: str = "body",
        first_id: int = 1,
    ) -> None:
        super().__init__(link, journal, retries=retries, bound=bound)
        self.timeout = timeout if timeout is not None else DEFAULT_TIMEOUT
        self.mode = mode
        self.counts = Counts()
        self.gate: Gate | None = None
        self.sent_at = self.answered_at = 0.0
        self._next_id = first_id
        self._decoder = Decoder()
        self._settled = False
        self._met = False
        """Whether an answer of an EksoNR came since the port was opened."""
        self._last: tuple[int, int] | None = None
        self._given_up: tuple[tuple[int, int], Deadline] | None = None  # a request that Ctrl-C left without its answer
        self._ahead: tuple[bytes, Deadline, int] | None = None  # request, deadline, msgID

    # -- reading -------------------------------------------------------------------------------------------------

    def read(self, command: Command) -> Frame:
        """The answer to a read, repeated with a new msgID when none comes. Raises NoAnswer, ProtocolError, LinkError."""
        return self.repeated(lambda: self.exchange(command))

    def settings_raw(self) -> tuple[int, ...]:
        """The 22 words of GetSettings as raw integers, each in its field's own sign."""
        words = self.read(Command.GET_SETTINGS).words
        return tuple(param.raw_of(word) for param, word in zip(SETTINGS, words, strict=True))

    def samples(self, deadline: Deadline | None = None) -> Iterator[tuple[float, tuple[int, ...]]]:
        """(host moment, 27 signed words of GetData), as fast as the device answers, until `deadline`.

        The moment is on the link's monotonic clock, in the middle between request and answer. Raises as `read`.
        """
        while deadline is None or not deadline.expired:
            words = self.read(Command.GET_DATA).words
            yield self.moment.middle, words

    @property
    def moment(self) -> Moment:
        """When the last answer was made."""
        return Moment(self.sent_at, self.answered_at)

    @property
    def answer_mode(self) -> str | None:
        """What the length byte of the last answer counted, None before the first."""
        return self._decoder.mode

    # -- one exchange --------------------------------------------------------------------------------------------

    def exchange(self, command: Command, body: bytes = b"") -> Frame:
        """Send one request, wait for its answer; one attempt. Raises NoAnswer, ProtocolError, LinkError.

        A bare acknowledgement and our own bytes coming back are no answer.
        """
        ahead, self._ahead = self._ahead, None
        fresh = ahead is not None and not ahead[1].expired  # what has lain there for longer is no present value
        if ahead is not None and fresh and ahead[0] == encode(command, ahead[2], body, self.mode):
            request, deadline = ahead[0], ahead[1]
        else:
            if ahead is not None:
                self._given_up = key_of(ahead[0]), ahead[1]
            request, deadline = self._send(command, body)
        try:
            return self._wait(request, deadline)
        except KeyboardInterrupt:
            self._given_up = key_of(request), deadline
            raise

    def identify(self) -> None:
        """Before a first write: an answer with a good CRC and our msgID, whichever command it answered, is an EksoNR's.

        Only where nothing was asked yet, the time is read. Raises NotIdentified, Interrupted.
        """
        if self.gate is not None and not self._met:
            self.gate.check(self.link, self.journal, lambda: self.read(Command.GET_TIME))

    def send_ahead(self, command: Command) -> None:
        """Send a read whose answer the next `read` of the same command takes: the line works while this side does.

        Anything else that is asked next lets that answer pass first.
        """
        if self._settled and not self.over:
            msg_id = self._next_id
            self._ahead = (*self._send(command, b""), msg_id)

    def _send(self, command: Command, body: bytes) -> tuple[bytes, Deadline]:
        """One request on the line; its bytes and the deadline of its answer."""
        if command in WRITING:
            self.identify()
        if not self._settled:
            self.resynchronise()
        self._take_waiting()
        self.check_bound(name_of(command))
        if command not in WRITING and not self._met and not self.link.replayed:
            # A stranger on this line must not act upon what is asked, and the msgID is free.
            while not harmless(self.request(command, body), self.link.baud if self.link.can_set_baud else None):
                self._next_id = (self._next_id + 1) & 0xFFFF
        request = self.request(command, body)
        self._next_id = (self._next_id + 1) & 0xFFFF
        seconds = self.wire_seconds(len(request) + max(ANSWER_SIZES[command]) + OVERHEAD) + self.timeout
        deadline = self.deadline(seconds)
        self._decoder.expect(request)
        self._settled = False
        self.sent_at = self.link.now()
        self.link.write(request, deadline)
        self.journal.counters.sent += 1
        return request, deadline

    def request(self, command: Command, body: bytes = b"") -> bytes:
        """The bytes that `exchange` would send next."""
        return encode(command, self._next_id, body, self.mode)

    def _wait(self, request: bytes, deadline: Deadline) -> Frame:
        attempt = Attempt(request, self.journal.counters.sent - 1)
        over = False
        while True:
            try:
                frame = self._decoder.next()
            except ProtocolError as exc:
                self._count_broken(exc)
                attempt.broken = exc
                deadline = self.link.deadline(AFTER_BROKEN).earlier(deadline)
                continue
            if frame is None and over:
                answer = next((f for f in self._decoder.finish() if self._judge(f, attempt)), None)
                if answer is None:
                    raise self._failure(attempt)
                return self._accept(answer)
            if frame is None:
                chunk = self.link.read(deadline)
                over = not chunk or deadline.expired
                attempt.received += chunk
                self._decoder.feed(chunk)
            elif self._judge(frame, attempt):
                return self._accept(frame)

    def _judge(self, frame: Frame, attempt: Attempt) -> bool:
        """Whether `frame` is the answer; what is none is counted."""
        if (frame.command, frame.msg_id) != attempt.key:
            attempt.foreign = frame
            self._count_foreign(frame)
            return False
        if frame.data == attempt.request or not frame.body:
            attempt.empty = frame
            return False
        if attempt.empty is not None and attempt.empty.data == attempt.request:
            self.journal.info(
                "echo", f"{self.link.name}: our own bytes come back before the replies. They were discarded"
            )
        return True

    def _accept(self, frame: Frame) -> Frame:
        self.answered_at = self.link.now()
        self._settled = self._met = True
        self._last = (frame.command, frame.msg_id)
        self.counts.answered += 1
        self.journal.counters.received += 1
        self._count_stray()
        if frame.mode != "body":
            self.journal.warn(
                "length-convention",
                f"{self.link.name}: the length byte in its replies counts more than the body: convention {frame.mode}",
            )
        return frame

    # -- what is not the answer ----------------------------------------------------------------------------------

    def resynchronise(self) -> None:
        """Discard input until the line has been quiet for 20 ms, or for the time of one answer at the most.

        The answer to a request that was given up is waited for as long as it may take: one request at a time (ekso §6).
        """
        last = self.deadline(self.timeout)
        while not last.expired:
            quiet = self.link.deadline(QUIET)
            if self._given_up is not None and self._given_up[1].at > quiet.at:
                quiet = self._given_up[1]
            chunk = self.link.read(quiet.earlier(last))
            if not chunk:
                break
            self._decoder.feed(chunk)
            self._drop_frames()
        self._decoder.clear()
        self._count_stray()
        self._settled = True

    def reopened(self) -> None:
        """The port was opened again: what was under way is lost, and it may lead to a stranger."""
        self._decoder.clear()
        self._given_up = self._ahead = None
        self._settled = self._met = False

    def _take_waiting(self) -> None:
        """What lies in the input before a request answers nothing any more; it is looked at only to be counted."""
        self._decoder.feed(self.link.read(self.link.deadline(0)))
        self._drop_frames()

    def _drop_frames(self) -> None:
        for frame in frames_in(self._decoder, self._count_broken):
            self._count_foreign(frame)

    def _count_foreign(self, frame: Frame) -> None:
        if self._given_up is not None and (frame.command, frame.msg_id) == self._given_up[0]:
            self._given_up = None  # nobody waits for it any more: no fault of the line
            return
        known = frame.command in tuple(Command)
        if not known:
            self.counts.unsolicited += 1
            self.journal.info(
                "unsolicited", f"{self.link.name}: frames arrived that handctl did not request. They were discarded"
            )
        elif (frame.command, frame.msg_id) == self._last:
            self.counts.duplicates += 1
            self.journal.info("duplicate", f"{self.link.name}: replies arrived twice. The second one was discarded")
        else:
            self.counts.late += 1
            self.journal.info(
                "late", f"{self.link.name}: replies with another msgID or command arrived. They were discarded as late"
            )
        counters = self.journal.counters
        counters.foreign_frames = (counters.foreign_frames or 0) + 1

    def _count_broken(self, error: ProtocolError) -> None:
        self.journal.counters.bad_frames += 1
        if error.code == "bad-length":
            self.counts.length_errors += 1
        else:
            self.counts.crc_errors += 1

    def _count_stray(self) -> None:
        self.journal.counters.stray_bytes += self._decoder.skipped
        self._decoder.skipped = 0

    # -- errors --------------------------------------------------------------------------------------------------

    @property
    def where(self) -> str:
        """Link and speed for messages."""
        return f"EksoNR on {self.link.name}{self.at_speed}"

    def _failure(self, attempt: Attempt) -> HandctlError:
        self.counts.timeouts += 1
        self._count_stray()
        name = name_of(attempt.request[0])
        sent = f"sent {hex_bytes(attempt.request)}"
        if not attempt.received and attempt.foreign is None:
            request = f"{name} ({hex_bytes(attempt.request)})"
            return self.unanswered(request, self.timeout, self.sent_at, HINTS["silence"])
        code, text = attempt.mishap()
        came = bytes(attempt.received)
        text = f"{self.where}: {text}. {sent}, received {shorten(came)}"
        return ProtocolError(text, hint=HINTS[code], code=code, came=came)
