"""What one AIDIN-hand says: bytes in, feedback out, and a word for what came instead of it.

Feedback is merged key by key; a key that is wrong is refused by itself. When to ask is not known here (exchange.py).
"""

from __future__ import annotations

from handctl.devices.aidin import trouble
from handctl.devices.aidin.feedback import ALL, Feedback, Quality
from handctl.devices.aidin.messages import Decoder, MalformedObject
from handctl.devices.aidin.way import ExchangeMode, Way
from handctl.errors import HandctlError, LinkError, ProtocolError
from handctl.link import ByteLink, Deadline
from handctl.model.device import Line
from handctl.model.result import Journal, hex_bytes

SILENCE = 1.0
WRITE_SECONDS = 1.0
BAD_IN_A_ROW = 3
MOST_UNKNOWN, LONGEST_NAME = 20, 40
READS_AT_ONCE = 256


class Reception(Line):
    """What has come over one connection, merged.

    timeout   seconds of silence allowed; None = 1 s of a stream, 0.2 s for the answer to a poll
    way       what is said about how the hand speaks; `exchange` is what is known of it by now
    """

    link: ByteLink

    def __init__(
        self,
        link: ByteLink,
        journal: Journal,
        *,
        timeout: float | None,
        retries: int | None,
        bound: Deadline | None,
        way: Way,
    ) -> None:
        super().__init__(link, journal, retries=retries, bound=bound)
        self.timeout = timeout
        self.way = way
        self.exchange = ExchangeMode.UNKNOWN
        self.quality = Quality()
        journal.counters.keys = self.quality.keys
        self.feedback = Feedback(self.quality)
        self._strange = b""  # the first object that is neither feedback nor ours
        self._since = b""  # what has come since the last feedback and is none
        self._decoder = Decoder()
        self._bad_in_a_row = 0
        self._junk = b""
        self._why = ""  # what is wrong with the first object that was damaged
        self._echoes = 0
        self._heard = 0.0  # when anything came last
        self._last = 0.0  # when feedback came last
        self._good: dict[str, float] = {}  # when a key came last as it should
        self._unanswered = 0
        self._unknown: set[str] = set()

    # -- time ----------------------------------------------------------------------------------------------------

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
        try:
            data = self.link.read(deadline)
        except LinkError as exc:
            raise self._closed(exc) from exc
        if not data:
            return False
        self._heard = self.link.now()
        self._decoder.feed(data)
        found = False
        while True:
            try:
                content = self._decoder.next()
            except MalformedObject as exc:
                self._note_bad(exc)
                continue
            if content is None:
                return found
            found = self._take(content) or found

    def _take(self, content: dict[str, object]) -> bool:
        if not self.feedback.merge(content):
            ours = not content or "hand_mode" in content or self._decoder.taken == self.way.poll.strip()
            if ours and self.journal.counters.sent:  # before anything was sent it cannot have come back
                self._echoes += 1
            else:
                self._strange = self._strange or self._decoder.taken[:64]
                self._since = (self._since + self._decoder.taken)[:64]
                self._note_unknown(content)
            return False
        self.journal.counters.received += 1
        self._bad_in_a_row = self._unanswered = 0
        self._since = b""
        self._last = self.link.now()
        self._good.update({key: self._last for key in content if key in ALL and key not in self.feedback.errors})
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

    def _note_bad(self, exc: MalformedObject) -> None:
        counters = self.journal.counters
        self._junk = (self._junk + exc.data)[:64]
        self._since = (self._since + exc.data)[:64]
        if exc.stray:
            counters.stray_bytes += len(exc.data)
            return
        counters.bad_frames += 1
        self._why = self._why or exc.text.partition(": b")[0]  # its bytes are told beside it
        self._bad_in_a_row += 1
        if self._bad_in_a_row >= BAD_IN_A_ROW:
            raise ProtocolError(
                f"{self.link.name}: {BAD_IN_A_ROW} damaged objects in a row, the last one: {exc.text}; "
                f"its bytes begin {hex_bytes(exc.data[:16])}",
                hint="check the connection with --trace FILE",
                code="bad-json",
            )

    def drain(self) -> None:
        """Take everything that has already arrived."""
        now = self.link.deadline(0)
        for _ in range(READS_AT_ONCE):
            before = self._bytes_seen
            if not self._receive(now) and self._bytes_seen == before:
                return

    @property
    def _bytes_seen(self) -> int:
        return sum(self.feedback.seen.values()) + len(self._junk + self._strange) + len(self._decoder.pending)

    # -- what went wrong -------------------------------------------------------------------------------------------

    def nothing_came(self) -> HandctlError:
        """The error of a hand that has sent no feedback: silence, or what came instead."""
        return (
            self._no_feedback()
            if self._junk or self._strange or self._decoder.pending or self._echoes
            else self._silent()
        )

    def _silent(self, *, asked: bool = True, moving: bool = False, since: float | None = None) -> HandctlError:
        patience = self.timeout or SILENCE
        if since is not None:  # --deadline may have cut it short
            patience = min(patience, round(self.link.now() - since, 2))
        known = moving or self.exchange is not ExchangeMode.UNKNOWN
        stopped = bool(self.journal.counters.received) and known
        instead = self._since or self._decoder.pending[:64]
        if stopped and instead:
            return trouble.no_feedback(self.link.name, instead, whole=False, more="more ")
        return trouble.silent(self.link.name, self.way, patience, asked=asked, stopped=stopped)

    def _closed(self, exc: LinkError) -> HandctlError:
        """A connection that ended before any feedback came: junk tells who it was, silence that the hand is taken."""
        if self.journal.counters.received:
            return exc
        if self._junk:
            return self._no_feedback()
        hint = "check the address and the port: it may be another server, or another client may be connected to the hand, which serves only one"
        return LinkError(exc.text, hint=hint, code=exc.code)

    def _no_feedback(self) -> HandctlError:
        strange = b"" if self._junk else self._strange
        seen = self._junk or strange or self._decoder.pending[:64]
        return trouble.no_feedback(self.link.name, seen, whole=bool(strange), why=self._why if self._junk else "")
