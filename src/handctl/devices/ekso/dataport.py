"""The line to an EksoNR: one request, one reply, a deadline for each; reads are retried, writes never (ekso §6).

`DataPort` speaks in frames and words; what the words mean is not known here. What is not the answer is dropped and
counted.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from handctl.devices.ekso.frames import (
    BODY_BYTES,
    EXCHANGES,
    OVERHEAD,
    Command,
    Decoder,
    Frame,
    differences,
    encode,
    id_after,
    key_of,
    name_of,
    status_text,
    unpack,
)
from handctl.devices.ekso.parameter_map import SIGNS
from handctl.errors import HandctlError, NoAnswer, ProtocolError
from handctl.link import ByteLink, Deadline
from handctl.model.device import Gate, Line, harmless_to_others
from handctl.model.device_clock import Moment
from handctl.model.frame_decoder import frames_in
from handctl.model.result import Journal, hex_bytes, hex_shown
from handctl.wording import plural

DEFAULT_TIMEOUT = 0.5
"""Seconds for the whole answer; the manual names none."""
QUIET = 0.02
"""Seconds of silence that end a resynchronisation: an answer to somebody else's request has passed then."""
AFTER_BROKEN = 3 * QUIET
"""How much longer an answer is waited for behind a broken one."""
TRIED = ("body", "frame", "n-2", "n-4")
"""Length conventions in the order in which they are tried."""
REST = 0.5
"""Seconds of quiet behind an attempt that failed: a device that expects more bytes would swallow the next request."""


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


@dataclass(slots=True)
class Attempt:
    """Data received while waiting for one reply; `sent_before` requests of ours were sent before it."""

    request: bytes
    key: tuple[int, int]
    sent_before: int
    received: bytes = b""
    broken: ProtocolError | None = None
    foreign: Frame | None = None
    empty: Frame | None = None

    def bad_reply(self) -> tuple[str, str]:
        """(code, text) of why there is no answer; the codes are keys of HINTS."""
        name, msg_id = name_of(self.request[0]), self.key[1]
        if self.broken is not None:
            return self.broken.code, f"the reply to {name} is damaged: {self.broken.text}"
        if self.empty is not None and self.empty.data == self.request:
            reads = len(self.request) == OVERHEAD
            text = "acknowledged without data (or the line echoes)" if reads else "only our own bytes came back"
            return "echo", f"{name}: {text}"
        if self.empty is not None:
            return "acknowledged", f"{name}: acknowledged without data"
        if self.foreign is not None:
            frame = self.foreign
            behind = (msg_id - frame.msg_id) & 0xFFFF
            code = "wrong-command" if behind == 0 else "late" if behind <= self.sent_before else "wrong-id"
            text = f"{name_of(frame.command)} with msgID {frame.msg_id} arrived instead of {name} with msgID {msg_id}"
            return code if frame.command in tuple(Command) else "unsolicited", text
        for found in re.finditer(b"(?=..%s)" % re.escape(self.request[2:4]), self.received, re.DOTALL):
            command = self.received[found.start()]
            if command == self.request[0]:
                return "cut-short", f"the reply to {name} was cut off after {plural(len(self.received), 'byte')}"
            if command in tuple(Command):
                return "wrong-command", f"a reply to {name_of(command)} arrived instead of {name}"
        return "garbage", f"received {plural(len(self.received), 'byte')} instead of a valid frame"


HINTS = {
    "silence": "check that the device is on, that the USB cable is connected, and that no other program uses the port. If it is on, it may need another --length-mode (auto tries them with GetTime)",
    "echo": "check the cable for a loop, or whether this is another kind of device. If the device replies to other requests, it acknowledged this one without data: report this",
    "acknowledged": "read the value back: an acknowledgement without a status does not mean success",
    "bad-checksum": "check the cable and the hub, and that no other program reads the port: bytes were corrupted on the line",
    "bad-length": "record the bytes with --trace FILE, and ask Ekso's service: this may be another protocol version, or they may be corrupted",
    "wrong-id": "check whether a second program uses this port: this is the reply to another request",
    "late": "use a longer --timeout: replies take longer than allowed",
    "unsolicited": "try again. The device sent something without a request and did not reply",
    "wrong-command": "check whether a second program uses this port. If none does, record the bytes with --trace FILE, and ask Ekso's service: this may be another protocol version",
    "cut-short": "check the cable, and that no other program reads the port: the reply was cut off",
    "garbage": "check the baud rate (usually 115200 bit/s), and whether this is another kind of device: the data contains no valid frame",
}


class DataPort(Line):
    """One EksoNR on a byte link.

    timeout  seconds for the whole answer
    mode     what the length byte of our requests counts; answers may count as they like
    """

    link: ByteLink
    timeout: float
    usual_timeout = DEFAULT_TIMEOUT

    def __init__(
        self, link: ByteLink, journal: Journal, *, mode: str = "body", first_id: int = 1, **limits: Any
    ) -> None:
        super().__init__(link, journal, **limits)
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
        self._replied: Frame | None = None
        """The answer to the last request, if that was a read."""
        self._written: Frame | None = None
        """The answer to the last request that writes."""
        self.contradiction: Frame | None = None
        """A second answer to it, with another status: neither of them shows what the device did."""
        self._differs: list[str] = []
        """How what came last in place of an answer differs from one."""
        self._given_up: tuple[bytes, Deadline] | None = None  # a request that Ctrl-C left without its answer
        self._ahead: tuple[bytes, Deadline] | None = None

    # -- reading -------------------------------------------------------------------------------------------------

    def read(self, command: Command) -> Frame:
        """The answer to a read, repeated with a new msgID when none comes. Raises NoAnswer, ProtocolError, LinkError."""
        try:
            return self.repeated(None, self.exchange, command)
        except ProtocolError as exc:
            if exc.code == "bad-length":
                raise  # it has come whole, and says what it is
            raise self.other_form(exc, lambda _: self._differs, lambda: self._again(command)) from exc

    def _again(self, command: Command) -> Sequence[str]:
        """How the reply to another question differs from one."""
        self._differs = []
        try:
            self.exchange(Command.GET_DATE if command is Command.GET_TIME else Command.GET_TIME)
        except (NoAnswer, ProtocolError):
            return self._differs
        return ()

    def lacks(self, command: Command) -> bool:
        """Whether this read alone is not answered: what was answered last, or the clock, is before and behind it, twice."""
        last = EXCHANGES[self._last[0]] if self._last is not None else None
        known = Command.GET_DATE if command is Command.GET_TIME else Command.GET_TIME
        if last is not None and not last.writes and last.command != command:
            known = Command(last.command)
        for _ in range(2):
            for asked in (known, command):
                try:
                    self.exchange(asked)
                except (NoAnswer, ProtocolError):
                    if asked is not command or self.over:
                        return False
                else:
                    if asked is command:
                        return False
        return True

    def settings_raw(self) -> tuple[int, ...]:
        """The 22 words of GetSettings as raw integers, each in its field's own sign."""
        return unpack(self.read(Command.GET_SETTINGS).body, SIGNS["settings"])

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
        if ahead is not None and (
            ahead[1].expired  # what has lain there for longer is no present value
            or ahead[0] != encode(command, key_of(ahead[0])[1], body, self.mode)
        ):
            self._given_up, ahead = ahead, None
        sent = ahead or self._send(command, body)
        try:
            return self._wait(*sent)
        except KeyboardInterrupt:
            self._given_up = sent
            raise

    def identify(self) -> None:
        """Before a first write: an answer with a good CRC and our msgID, whichever command it answered, is an EksoNR's.

        Only where nothing was asked yet, the time is read. Raises NotIdentified, Interrupted.
        """
        if self.gate is not None and not self._met:
            self.gate.check(self.link, self.journal, lambda: self.read(Command.GET_TIME))

    def detect_length_mode(self) -> str:
        """Try GetTime, a read, with every length convention until one is answered; the port keeps that one.

        The manual does not say what the length byte counts (ekso §6). Raises NoAnswer, ProtocolError of the first attempt when
        none is answered, or none before the port's bound.
        """
        failure: HandctlError | None = None
        for self.mode in TRIED:
            try:
                self.exchange(Command.GET_TIME)
                return self.mode
            except (NoAnswer, ProtocolError) as exc:
                failure = failure or exc
            if self.over:
                break
            self.link.sleep(self.deadline(REST).remaining)
        self.mode = "body"
        assert failure is not None
        raise failure

    def send_ahead(self, command: Command) -> None:
        """Send a read whose answer the next `read` of the same command takes: the line works while this side does.

        Anything else that is asked next lets that answer pass first.
        """
        if self._settled and not self.over:
            self._ahead = self._send(command, b"", ahead=True)

    def _send(self, command: Command, body: bytes, *, ahead: bool = False) -> tuple[bytes, Deadline]:
        """One request on the line; its bytes and the deadline of its answer.

        What came late answers nothing any more: it is looked at to be counted, and where this is sent `ahead`, when its answer is read.
        """
        row = EXCHANGES[command]
        if row.writes:
            self.identify()
            self._written = self.contradiction = None
        if not self._settled:
            self.resynchronise()
        if not ahead:
            self._decoder.feed(self.link.read(self.link.at_once))
        if self._decoder.pending:
            self._drop_frames()
        self.check_bound(row.name)
        if not row.writes and not self._met and not self.link.replayed:
            # A stranger on this line must not act upon what is asked, and the msgID is free.
            while not harmless_to_others(
                self.request(command, body), self.link.baud if self.link.can_set_baud else None
            ):
                self._next_id = id_after(self._next_id)
        request = self.request(command, body)
        self._next_id = id_after(self._next_id)
        seconds = self.wire_seconds(len(request) + max(row.answers) + OVERHEAD) + self.timeout
        deadline = self.deadline(seconds)
        self._settled = False
        self.sent_at = self.link.now()
        self.link.write(request, deadline)
        self._decoder.expect(request)
        self.journal.counters.sent += 1
        if not row.writes:
            self.request(command, body)  # most likely the next one: made while the line works, and remembered
        return request, deadline

    def request(self, command: Command, body: bytes = b"") -> bytes:
        """The bytes that `exchange` would send next."""
        return encode(command, self._next_id, body, self.mode)

    def _wait(self, request: bytes, deadline: Deadline) -> Frame:
        attempt = Attempt(request, key_of(request), self.journal.counters.sent - 1)
        chunk: bytes | None = None
        while True:
            try:
                frame = self._decoder.next()
            except ProtocolError as exc:
                self._count_broken(exc)
                attempt.broken = exc
                deadline = self.link.deadline(AFTER_BROKEN).earlier(deadline)
                continue
            if frame is None and chunk is not None and (not chunk or deadline.expired):
                answer = next((f for f in self._decoder.finish() if self._judge(f, attempt)), None)
                if answer is None:
                    raise self._failure(attempt)
                return self._accept(answer)
            if frame is None:
                chunk = self.link.read(deadline)
                attempt.received += chunk
                self._decoder.feed(chunk)
            elif self._judge(frame, attempt):
                return self._accept(frame)

    def _judge(self, frame: Frame, attempt: Attempt) -> bool:
        """Whether `frame` is the answer; what is none is counted."""
        if frame.key != attempt.key:
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
        self._last = frame.key
        self._replied = frame
        if EXCHANGES[frame.command].writes:
            self._written, self._replied = frame, None
        self.counts.answered += 1
        self.journal.counters.received += 1
        if self._decoder.skipped:
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

    def _drop_frames(self) -> None:
        for frame in frames_in(self._decoder, self._count_broken):
            self._count_foreign(frame)

    def _count_foreign(self, frame: Frame) -> None:
        if self._given_up is not None and frame.key == key_of(self._given_up[0]):
            self._given_up = None  # nobody waits for it any more: no fault of the line
            return
        if EXCHANGES[frame.command].asks is None:
            self.counts.unsolicited += 1
            self.journal.info(
                "unsolicited", f"{self.link.name}: frames arrived that handctl did not request. They were discarded"
            )
        elif self._contradicts(frame):
            self.counts.duplicates += 1
            self.contradiction = frame
            self.journal.warn(
                "contradiction", f"{self.link.name}: {name_of(frame.command)} was answered twice: {self.statuses}"
            )
        elif frame.key == self._last:
            self.counts.duplicates += 1
            if (
                self._replied is not None
                and len(frame.body) == len(self._replied.body)
                and frame.body != self._replied.body
            ):
                self.two_replies(hex_bytes(self._replied.data), hex_bytes(frame.data))
            self.journal.info("duplicate", f"{self.link.name}: replies arrived twice. The second one was discarded")
        else:
            self.counts.late += 1
            self.journal.info(
                "late", f"{self.link.name}: replies with another msgID or command arrived. They were discarded as late"
            )
        counters = self.journal.counters
        counters.foreign_frames = (counters.foreign_frames or 0) + 1

    def _contradicts(self, frame: Frame) -> bool:
        written = self._written
        if written is None or frame.key != written.key or len(frame.body) != len(written.body):
            return False
        return frame.status & 0xFF != written.status & 0xFF

    @property
    def statuses(self) -> str:
        """What the last request that writes was answered with: ``accepted, then refused …``."""
        frames = (self._written, self.contradiction)
        return ", then ".join(f"{status_text(one.status)} (status 0x{one.status:04X})" for one in frames if one)

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
        sent, came = hex_bytes(attempt.request), attempt.received
        if not came and attempt.foreign is None:
            request = f"{name_of(attempt.request[0])} ({sent})"
            return self.unanswered(request, self.timeout, self.sent_at, HINTS["silence"])
        code, text = attempt.bad_reply()
        self._differs = differences(attempt.request, came)
        if len(self._differs) == 1 and BODY_BYTES in self._differs[0]:
            code, text = (
                "bad-length",
                f"the reply to {name_of(attempt.request[0])} has {self._differs[0]}, with a good CRC",
            )
        text = f"{self.where}: {text}. Sent {sent}, received {hex_shown(came)}"
        return ProtocolError(text, hint=HINTS[code], code=code, came=came)
