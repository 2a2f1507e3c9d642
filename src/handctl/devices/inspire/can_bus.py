"""Register access over CAN: requests and replies carry the same identifier, eight bytes at most.

Foreign traffic is passed over and counted. A read asks for two bytes at least: a one-byte read of the value 01 would
equal its own request (wrist §2.3.1). Writes are never padded and never repeated.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from handctl.devices.inspire import can_frames
from handctl.devices.inspire.register_bus import RegisterBus
from handctl.errors import DeviceRefused, HandctlError, Hint, LinkError, NoAnswer, ProtocolError
from handctl.link import CanFrame, Deadline, FrameLink, Trouble
from handctl.model.param import Step
from handctl.model.result import Journal
from handctl.model.write_ledger import ACKNOWLEDGED
from handctl.wording import plural


class CanBus(RegisterBus):
    """The CAN bus to one hand id. Flags 4/5 for a wrist, 0/1 for a hand."""

    link: FrameLink
    max_count = can_frames.MAX_COUNT
    wire = "can"
    fewer = "cut-short"
    spaces: ClassVar = {
        "hand": (can_frames.READ_HAND, can_frames.WRITE_HAND),
        "wrist": (can_frames.READ_WRIST, can_frames.WRITE_WRIST),
    }

    usual = "wrist"
    check_id = staticmethod(can_frames.check_id)

    def __init__(self, link: FrameLink, device_id: int, journal: Journal, **more: Any) -> None:
        super().__init__(link, device_id, journal, **more)
        journal.counters.foreign_frames = journal.counters.foreign_frames or 0

    def read(self, address: int, count: int, *, retries: int | None = None) -> bytes:
        """`count` bytes from `address`; more than eight are several reads (wrist §2.3.1)."""
        can_frames.check_span(self.id, address, count)
        if count == 1:
            even = address & ~1
            return self.read(even, 2, retries=retries)[address - even : address - even + 1]
        if count > can_frames.MAX_COUNT:
            first = self.read(address, can_frames.MAX_COUNT, retries=retries)
            return first + self.read(address + can_frames.MAX_COUNT, count - can_frames.MAX_COUNT, retries=retries)
        request = CanFrame(*can_frames.read_request(self.id, address, count, self.read_flag))
        return self.repeated(retries, self._exchange, request, count)

    def write(self, address: int, data: bytes, *, acknowledged_by: Sequence[int] = ()) -> None:
        """Write 1..8 bytes once (wrist §2.3.2). The reply has no data, or the number of bytes written.

        The acknowledgement of a written 01 equals the request. It proves something only where an exchange before has shown
        whether our own frames come back.
        """
        echo, ledger = self.journal.line.echo, self.journal.ledger
        mark = ledger.mark
        reply = self.acknowledgement(address, data)
        if reply == data and echo is not None:
            ledger.confirm(ACKNOWLEDGED, since=mark)
        if (refusal := self.refusal(address, data, reply)) is not None:
            raise refusal

    def acknowledgement(self, address: int, data: bytes) -> bytes:
        """The data of the reply to this write, sent once. Raises NoAnswer, ProtocolError."""
        return self._exchange(CanFrame(*can_frames.write_request(self.id, address, data, self.write_flag)), None)

    def refusal(self, address: int, data: bytes, reply: bytes) -> HandctlError | None:
        """The error of an acknowledgement that has another number than that of the bytes written. Of some bytes it is no refusal: a part
        may have set an axis in motion."""
        if not reply or reply[0] == len(data):
            return None
        text = f"{self.where}: the device acknowledged {reply[0]} of {len(data)} bytes written at {address}"
        hint = "read the value before you write again: the device took none or only part of it"
        return ProtocolError(text, hint=hint) if reply[0] else DeviceRefused(text, hint=hint)

    def write_step(self, address: int, data: bytes, meaning: str) -> Step:
        """The exact frame of that write."""
        identifier, payload = can_frames.write_request(self.id, address, data, self.write_flag)
        return Step(meaning, payload, can_id=identifier)

    def drain(self) -> None:
        """Discard waiting input: late replies and traffic of others."""
        replied: CanFrame | None = self._last.reply  # unless others asked the same meanwhile
        self._last.reply = None
        for _ in range(4096):
            frame = self.receive(self.link.at_once)
            if frame is None:
                return
            if replied is not None and frame.can_id == replied.can_id:
                if len(frame.data) == len(replied.data) and frame != replied:
                    self.two_replies(replied, frame)
                replied = None
            self.pass_over(frame)

    def _exchange(self, request: CanFrame, count: int | None) -> bytes:
        """Send once; the data of the reply. `count` bytes are expected, None = an acknowledgement (0 or 1 byte)."""
        self.pass_gate(request)
        self.check_bound(str(request))
        self.drain()
        errors, damaged, started = self.link.error_frames, self.link.damaged, self.link.now()
        deadline = self.deadline(self.timeout)
        self.send(request, deadline)
        odd: list[CanFrame] = []
        while True:
            frame = self.receive(deadline)
            if frame is None:
                raise self._failure(request, odd, errors, self.link.damaged - damaged, started)
            returned = count is None and frame == request and self.journal.line.echo and request not in odd
            if frame.can_id == request.can_id and answers(frame, request, count) and not returned:
                self.journal.counters.received += 1
                self.round_trip = self.link.now() - started
                self.learn(self.round_trip, echo=request in odd)
                self._last.reply = frame if count is not None and not odd else None
                return frame.data
            self.pass_over(frame)
            if related(frame, request):
                odd.append(frame)
            if deadline.expired:
                raise self._failure(request, odd, errors, self.link.damaged - damaged, started)

    def learn(self, seconds: float, *, echo: bool) -> None:
        """What a good exchange shows of the bus: how long it took, whether our own frames come back, who else speaks."""
        line = self.journal.line
        line.trips.add(seconds)
        line.echo = line.echo or echo
        line.others = bool(self.journal.counters.foreign_frames)

    def receive(self, deadline: Deadline) -> CanFrame | None:
        """The next frame of anybody; what the adapter hands out damaged is counted."""
        before = self.link.damaged
        try:
            return self.link.receive(deadline)
        finally:
            self.journal.counters.bad_frames += self.link.damaged - before

    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        """Put one frame on the bus."""
        self.pass_gate(frame)
        self.count(frame)
        self.link.send(frame, deadline)

    def only_reads(self, request: bytes | CanFrame) -> bool:
        return isinstance(request, CanFrame) and can_frames.only_reads(request.can_id, request.data)

    def addressee(self, request: bytes | CanFrame) -> int:
        named = can_frames.parse_identifier(request.can_id).hand_id if isinstance(request, CanFrame) else self.id
        return self.id if named == can_frames.ANY_ID else named

    def pass_over(self, frame: CanFrame) -> None:
        """Count a frame that answers nothing of ours."""
        access = can_frames.parse_identifier(frame.can_id)
        if access.hand_id == self.id:
            self.journal.counters.stray_bytes += len(frame.data)
        else:
            self.journal.counters.foreign_frames = (self.journal.counters.foreign_frames or 0) + 1

    def _failure(self, request: CanFrame, odd: list[CanFrame], errors: int, damaged: int, since: float) -> HandctlError:
        if odd:
            return self.bad_reply(request, odd)
        if damaged:
            text = f"{self.where}: no reply to {request}, but {said_damaged(damaged, self.link.damage)}"
            return ProtocolError(text, hint=HINTS["damaged"], code="damaged")
        hint = Hint(
            f"look for the id of the device with {{}}. If it finds none, {NO_ACK_HINT}", f"scan -p {self.link.name}"
        )
        return self.silence(request, errors, self.timeout, since, hint)

    def bad_reply(self, request: CanFrame, odd: Sequence[CanFrame]) -> ProtocolError:
        """The error for a frame with the same flag and address that is not a reply."""
        ids = [can_frames.parse_identifier(frame.can_id).hand_id for frame in odd]
        others = [
            frame
            for _, frame in sorted(zip(ids, odd, strict=True), key=lambda one: one[0] != self.id)
            if frame != request
        ]
        if not others:
            code, text = "echo", f"only our own frame came back: {request}"
        elif (other := can_frames.parse_identifier(others[0].can_id).hand_id) != self.id:
            code, text = "wrong-id", f"id {other} replied instead: {others[0]} (sent {request})"
        else:
            size = plural(len(others[0].data), "byte")
            code, text = "cut-short", f"the reply has {size}, not the number asked for: {others[0]} (sent {request})"
        return ProtocolError(f"{self.where}: {text}", hint=Hint(HINTS[code], f"scan -p {self.link.name}"), code=code)

    def silence(self, request: CanFrame, before: int, allowed: float, since: float, hint: str) -> HandctlError:
        """The error of silence after a frame: what the controller reports about it, where it does.

        `before` is what the link's `error_frames` was; the others as for `unanswered`.
        """
        trouble = self.link.trouble(before)
        if trouble is not None and trouble.code:
            return bus_failure(self.where, str(request), trouble)
        silence = self.unanswered(str(request), allowed, since, hint)
        if trouble is not None:
            silence.text += ". The adapter reports no bus error, so a device acknowledged the frame"
        return silence


NO_ACK_HINT = Hint(
    "check power, termination (120 ohm), CAN high and low, and the bitrate: {} listens for it. The manual says 1000000 bit/s, "
    "but some hands of this maker use 500000 (add ?bitrate=500000 to the LINK)",
    "doctor",
)
TROUBLES: dict[str, tuple[type[HandctlError], str, str]] = {
    "no-ack": (NoAnswer, "no device acknowledged {what}", NO_ACK_HINT),
    "bus-off": (
        LinkError,
        "the CAN controller has left the bus (bus off) after too many errors",
        "check CAN high, CAN low and the bitrate, then run the command again. Opening the link starts the controller again",
    ),
    "refused": (
        LinkError,
        "the adapter refused {what} with BEL",
        Hint("unplug the adapter and plug it in again. {} shows which program uses it", "ports"),
    ),
    "bel": (NoAnswer, "the adapter replied to {what} with BEL", NO_ACK_HINT),
    "bus-errors": (
        NoAnswer,
        "the bus destroyed frames after {what}",
        "if two hands have the same id, disconnect one of them. If there is only one hand, check the termination (120 ohm at both ends)",
    ),
}


def bus_failure(where: str, what: str, trouble: Trouble) -> HandctlError:
    """What the controller reports as the error of an exchange."""
    kind, text, hint = TROUBLES[trouble.code]
    return kind(f"{where}: {text.format(what=what)}. {trouble.evidence}", hint=hint, code=trouble.code)


HINTS = {
    "wrong-id": "use --id with the id shown, or find the device with {}",
    "cut-short": "check the bus: this is another kind of device, or there is a second master",
    "echo": "check the adapter: it may be in loopback mode, or return the frames that it sends. No device replies",
    "damaged": "check the adapter's cable and hub, and that no other program reads its port",
}


def said_damaged(count: int, last: str) -> str:
    """``the adapter sent 2 corrupted lines (the last one: b'T0100' (string index out of range))``."""
    return f"the adapter sent {count} corrupted line{'s' * (count > 1)} (the last one: {last})"


def answers(frame: CanFrame, request: CanFrame, count: int | None) -> bool:
    """Whether a frame with our identifier is the answer: as many bytes as asked, or an acknowledgement."""
    return can_frames.acknowledges(frame.data, request.data) if count is None else len(frame.data) == count


def related(frame: CanFrame, request: CanFrame) -> bool:
    """Whether a frame looks like an answer to the same question: same flag and address."""
    return frame.can_id >> 14 == request.can_id >> 14
