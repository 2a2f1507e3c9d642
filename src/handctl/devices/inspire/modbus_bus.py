"""Register access over Modbus, RTU on a serial line and TCP: one request, one reply, retries for reads only.

Above it a register is what it is on the other wires: bytes in the order of their addresses. On byte maps the word at
address a is the bytes a and a+1, so a block of n bytes is a read of n/2 registers (rh56 §2.2). What the bytes mean is
not known here.

An answer to a read names no address: on a serial line only its size tells which question it belongs to, and over TCP a number
that some hands count wrongly (rh56 §2.3). A hand answers in order. So an answer of a size that no open question has settles all
that was asked before it; where the size is one of theirs, another question goes first (`Owed.between`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

from handctl.devices.inspire import modbus_frames
from handctl.devices.inspire.modbus_frames import RTU, TCP, Answer, RtuDecoder, TcpDecoder, framed, pdu_of
from handctl.devices.inspire.register_bus import FEWER, MOST, PATIENCE, ByteBus
from handctl.errors import DeviceRefused, HandctlError, Hint, LinkError, NoAnswer, ProtocolError, UsageError
from handctl.families import FAMILIES
from handctl.link import ByteLink, CanFrame, Deadline
from handctl.model.frame_decoder import frames_in
from handctl.model.param import Step
from handctl.model.result import Journal, hex_bytes, hex_shown
from handctl.model.write_ledger import ACKNOWLEDGED
from handctl.wording import plural

SYSTEM = 1000
"""Documented on every generation from here on (rh56 §3)."""
SIZES = range(1, 6)
"""Registers of the question between."""


class Owed:
    """The questions of one unit that were given up, in their order: (number on TCP, PDU)."""

    def __init__(self) -> None:
        self._open: list[tuple[int, bytes]] = []

    def __bool__(self) -> bool:
        return bool(self._open)

    @property
    def alone(self) -> bool:
        """Whether one question is open: what comes can answer no other."""
        return len(self._open) == 1

    def given_up(self, number: int, pdu: bytes) -> None:
        """The answer may still come."""
        self._open.append((number, pdu))

    def answered(self, number: int, pdu: bytes) -> None:
        """An answer that fits `pdu` came. It may belong to the same question, asked before: then the last one stays open."""
        same = [place for place, (_, open_pdu) in enumerate(self._open) if open_pdu == pdu]
        self._open = [*self._open[same[0] + 1 :], (number, pdu)] if same else []

    def settled(self) -> None:
        """The answer to the last question came, for sure."""
        self._open.clear()

    def between(self, pdu: bytes) -> bytes | None:
        """The read that must be answered before `pdu` is asked; None where no late answer can pass for that to `pdu`."""
        if not self._mistakable(pdu):
            return None
        asked = [modbus_frames.read_request(SYSTEM, words) for words in SIZES]
        return next((one for one in asked if not self._mistakable(one)), asked[0])

    def _mistakable(self, pdu: bytes) -> bool:
        return pdu[0] == modbus_frames.READ and any(
            one != pdu and one[0] == pdu[0] and modbus_frames.reply_size(one) == modbus_frames.reply_size(pdu)
            for _, one in self._open
        )


# -- the wire ---------------------------------------------------------------------------------------------------------

QUIET_SECONDS = 0.00175
"""Silence before each RTU frame at 19200 bit/s and more (rh56 §5)."""
TCP_TIMEOUT = 0.5
"""Seconds allowed for an answer over TCP (rh56 §5)."""
BEHIND = 0.05
"""Seconds for the right answer behind one that names another question, until a hand is known to count wrongly."""
SETTLING = 8
"""Questions between, at the most, until every late answer has come."""
TRIGGERS = range(1004, 1010)
"""One register each, and its neighbour is another trigger: never written together, never above 00FF (rh56 §2.2)."""
BYTE_GROUPS = ((1606, 6), (1612, 6), (1618, 6))
"""Groups of one byte a finger: error, status, temperature (rh56 §3.1). Some hands give one register to each (rh56 §2.2)."""
TEMPERATURES = BYTE_GROUPS[2]
SILENCE_HINT = (
    "check these in order: the id (unit), the baud rate, power (24 V), A and B of RS-485. A hand that only supports EB90 does not reply "
    "to Modbus: try --protocol eb90"
)


class _State:
    """What is known of one wire, shared by every view of it (`RegisterBus.at`).

    unpacked  the hand gives one register to each byte of a byte group (seen on RTU only); None = not known yet
    counts    answers over TCP name the transaction of their question; None = not known yet
    """

    def __init__(self, unpacked: bool | None) -> None:
        self.unpacked = unpacked
        self.transaction = 0
        self.counts: bool | None = None
        self.owed: dict[int, Owed] = {}
        """Unit -> its questions that were given up."""


class ModbusBus(ByteBus):
    """The Modbus wire to one hand: RTU on a serial line, TCP where `tcp`."""

    max_count = 2 * modbus_frames.MAX_WORDS
    spaces: ClassVar = {"hand": (modbus_frames.READ, modbus_frames.WRITE_MANY)}

    usual = "hand"

    def __init__(self, link: ByteLink, device_id: int, journal: Journal, *, tcp: bool, **more: Any) -> None:
        super().__init__(link, device_id, journal, **more)
        if more.get("timeout") is None and tcp:
            self.timeout = TCP_TIMEOUT
        self.tcp = tcp
        self.wire = TCP if tcp else RTU
        self._state = _State(False if tcp else None)

    def _count_damaged(self, _error: ProtocolError) -> None:
        """A frame came whose sum is wrong."""
        self.journal.counters.bad_frames += 1

    # -- registers -----------------------------------------------------------------------------------------------

    def read(self, address: int, count: int, *, retries: int | None = None) -> bytes:
        """`count` bytes (1..250) from `address` on. Raises UsageError, NoAnswer, ProtocolError, LinkError, DeviceRefused."""
        data = self._words(address, count, retries)
        if self.per == 2 or self._state.unpacked is False:
            return data
        touched = [group for group in BYTE_GROUPS if address < group[0] + group[1] and group[0] < address + count]
        if touched and self._is_unpacked(retries):
            data = self._overlaid(address, data, touched, retries)
        return data

    def _words(self, address: int, count: int, retries: int | None) -> bytes:
        words = -(-count // 2)
        request = modbus_frames.read_request(address // self.per, words)
        try:
            answer = self.repeated(retries, self.exchange, request)
        except ProtocolError as exc:
            raise self.other_form(
                exc, lambda came: self._differences(request, came), lambda: self._again(request)
            ) from exc
        return modbus_frames.to_memory(answer.data)[:count]

    def _again(self, pdu: bytes) -> Sequence[str]:
        """How the reply to another question differs from one."""
        spans = [modbus_frames.read_request(span[0] // self.per, 1) for span in self.first_questions]
        other = next((span for span in spans if span != pdu), spans[0])
        return self.differs_again(lambda: self.exchange(other), lambda came: self._differences(other, came))

    def _differences(self, pdu: bytes, received: bytes) -> list[str]:
        """How one frame in place of the reply to a read differs from that, in ways that a firmware may have; [] = it is none."""
        data, size = received.removeprefix(framed(self.wire, self.id, 0, pdu)), modbus_frames.reply_size(pdu)
        if self.tcp or len(data) != size + 3:
            return []
        found = [f"unit {data[0]}"] if data[0] in (0, 255) else [] if data[0] == self.id else [""]
        if data[1] != pdu[0]:
            found.append(f"function {data[1]:02X}" if data[1] == modbus_frames.READ + 1 else "")
        if data[2] != size - 2:
            found.append("a count of words" if 2 * data[2] == size - 2 else "")
        if (crc := modbus_frames.crc(data[:-2])) != data[-2:]:
            found.append("the CRC with its high byte first" if crc[::-1] == data[-2:] else "")
        return [] if "" in found else found

    def _is_unpacked(self, retries: int | None) -> bool:
        """Whether the bytes of a byte group come one to a register: the six temperatures tell (rh56 §2.2).

        They are never 0 in a room: packed are three registers with two each, and what follows them, or zeros.
        """
        if self._state.unpacked is None:
            try:
                words = self._words(TEMPERATURES[0], 2 * TEMPERATURES[1], retries)
            except DeviceRefused:
                words = b""  # six registers are more than it has there
                self._state.unpacked = False
            high, tail = words[1::2], words[6:12]
            if any(words):
                self._state.unpacked = not any(high) and any(tail)
        return bool(self._state.unpacked)

    def _overlaid(self, address: int, data: bytes, groups: Sequence[tuple[int, int]], retries: int | None) -> bytes:
        """`data` from `address` on, with what the byte groups in it hold one to a register."""
        memory = bytearray(data)
        for start, size in groups:
            single = self._words(start, 2 * size, retries)[0::2]
            for place, byte in enumerate(single, start - address):
                if 0 <= place < len(memory):
                    memory[place] = byte
        return bytes(memory)

    def write(self, address: int, data: bytes, *, acknowledged_by: Sequence[int] = ()) -> None:
        """Write `data` once: one register by function 06, more by 16. Never repeated.

        Raises DeviceRefused for an exception; NoAnswer, ProtocolError when it is unknown whether the write arrived.
        """
        echo, ledger = self.journal.line.echo, self.journal.ledger
        mark = ledger.mark
        self.exchange(self.write_pdu(address, data))
        if self.tcp or echo is not None:  # else the answer to function 06 may be our own bytes that come back
            ledger.confirm(ACKNOWLEDGED, since=mark)

    def write_pdu(self, address: int, data: bytes) -> bytes:
        """The PDU of a write of bytes in the order of their addresses.

        A single byte is the low half of its register; the high half, which is the next address, becomes 0. Raises
        UsageError for what a register next to a trigger would set off (rh56 §2.2, §9).
        """
        if len(data) == 1:
            data += b"\0"
        touched = range(address, address + len(data))
        if self.per == 1 and (
            (len(data) > 2 and any(place in touched for place in range(1000, 1010)))
            or (address in TRIGGERS and data[1:2] != b"\0")
            or address in (1003, 1007)
            or (address != 1006 and 1006 in touched and data[1006 - address])
        ):
            raise UsageError(
                f"{hex_bytes(data)} at {address} would trigger the neighbouring register",
                hint="write one register, with a value up to 255 (rh56 §2.2). Nothing was sent.",
                code="trigger",
            )
        return modbus_frames.write_request(address // self.per, modbus_frames.to_memory(data))

    def write_step(self, address: int, data: bytes, meaning: str) -> Step:
        """The exact bytes of that write, as the first question of a connection."""
        return Step(meaning, framed(self.wire, self.id, 1, self.write_pdu(address, data)))

    # -- the wire ------------------------------------------------------------------------------------------------

    def exchange(self, pdu: bytes) -> Answer:
        """Send one request, wait for its answer. One attempt.

        Where a late answer to another question could pass for it, a read of another size is answered first.
        """
        for _ in range(SETTLING):
            first = None if self._state.counts else self._owed.between(pdu)
            if first is None:
                return self._exchange(pdu)
            self._exchange(first)
        raise NoAnswer(
            f"{self.where}: replies arrive too late to be matched to their requests",
            hint="run the command again with --timeout 2",
            code="late",
        )

    @property
    def _owed(self) -> Owed:
        return self._state.owed.setdefault(0 if self.tcp else self.id, Owed())

    def _exchange(self, pdu: bytes) -> Answer:
        transaction = self._state.transaction = self._state.transaction % 0xFFFF + 1  # on TCP, 1 to 65535
        request = framed(self.wire, self.id, transaction, pdu)
        self.pass_gate(request)
        self.check_bound(hex_bytes(request))
        self.drain()
        self._keep_quiet()
        started = self.link.now()
        size = modbus_frames.reply_size(pdu) + (modbus_frames.MBAP if self.tcp else 3)
        wire = 0.0 if self.tcp else self.wire_seconds(len(request) + size)
        deadline = self.deadline(wire + self.timeout)
        last = self.deadline(wire + PATIENCE * self.timeout)
        self.count(request)
        try:
            self.link.write(request, deadline)
            answer, received, odd = self._heard(pdu, request, deadline, last)
        except BaseException:
            self._owed.given_up(transaction, pdu)
            raise
        self.link.answered = self.link.now()
        if answer is None:
            self._owed.given_up(transaction, pdu)
            raise self._failure(request, received, odd, started)
        self._learn(answer, request, started, received)
        if answer.exception is not None:
            raise self._refusal(answer.exception, request)
        self._last.reply = (pdu, answer) if pdu[0] == modbus_frames.READ else None
        return answer

    def _look_for_second(self, replied: tuple[bytes, Answer], data: bytes) -> None:
        """See ByteBus. `replied`: what was asked, and the reply."""
        pdu, answer = replied
        decoder = TcpDecoder() if self.tcp else RtuDecoder(self.id, pdu)
        decoder.feed(data)
        for second in frames_in(decoder):
            if modbus_frames.answers(second.pdu, pdu) and second.transaction == answer.transaction:
                self._compare(answer, second)

    def _compare(self, answer: Answer, second: Answer) -> None:
        if second.pdu != answer.pdu and not self._owed:
            self.two_replies(hex_bytes(answer.data), hex_bytes(second.data))

    def _heard(
        self, pdu: bytes, request: bytes, deadline: Deadline, last: Deadline
    ) -> tuple[Answer | None, bytes, list[Answer]]:
        """The answer to `request`, None where none came; all bytes that came; answers to something else."""
        decoder = TcpDecoder() if self.tcp else RtuDecoder(self.id, pdu)
        received, odd = bytearray(), list[Answer]()
        kept: Answer | None = None  # fits, but names another question: the right one may be right behind it
        # On a line with echo our own bytes come first: the answer to function 06 equals its question.
        echo = len(request) if self.journal.line.echo and not self.tcp else 0
        while True:
            taken: Answer | None = None
            for answer in frames_in(decoder, self._count_damaged):
                fits = modbus_frames.answers(answer.pdu, pdu)
                if fits and (answer.has_transaction(self._state.transaction) or self._state.counts is False):
                    if taken is not None and pdu[0] == modbus_frames.READ:
                        self._compare(taken, answer)
                    taken = answer  # of two that have come the later one: the first may belong to the question before
                elif fits and not self._owed:
                    deadline = self.deadline(BEHIND) if kept is None else deadline  # a short probe waits so long, too
                    kept = answer
                else:
                    odd.append(answer)
            if taken is not None:
                return taken, bytes(received), odd
            over = (received and deadline.expired) or len(received) > MOST
            chunk = b"" if over else self.link.read(deadline)
            if not chunk:
                self.journal.counters.stray_bytes += decoder.skipped + decoder.pending
                return kept, bytes(received), odd
            before = len(received)
            received += chunk
            if echo and not request.startswith(received[:echo]):
                decoder.feed(bytes(received[:before]))  # no echo this time: nothing is passed over
                echo = 0
            decoder.feed(chunk[max(0, echo - before) :])
            if decoder.pending and deadline.remaining < self.timeout and kept is None:
                deadline = self.link.deadline(self.timeout).earlier(last)

    def behind(self, address: int, count: int, seconds: float) -> bytes | None:
        if self.tcp:
            return None
        decoder = RtuDecoder(self.id, modbus_frames.read_request(address // self.per, -(-count // 2)))
        deadline = self.deadline(seconds)
        while chunk := self.link.read(deadline):
            decoder.feed(chunk)
            if answer := next(frames_in(decoder, self._count_damaged), None):
                return modbus_frames.to_memory(answer.data)[:count]
        return None

    def _learn(self, answer: Answer, request: bytes, started: float, received: bytes) -> None:
        """What an answer shows: of the line, and of how the hand counts."""
        self._met.add(self.id)
        self.round_trip = self.link.answered - started
        self.journal.counters.received += 1
        if len(received) < 40:
            self.journal.line.trips.add(self.round_trip)
        number = self._state.transaction
        if answer.transaction is None:
            if answer.function != modbus_frames.WRITE_ONE:  # its answer looks as the echo does
                self.journal.line.echo = bool(self.journal.line.echo) or received.startswith(request)
            self._owed.answered(number, pdu_of(request, self.wire))
        elif answer.transaction == number:
            self._state.counts = self._state.counts is not False
            self._owed.settled()
        else:
            # One question is open, so the order tells whose answer it is (rh56 §2.3).
            self._state.counts = False
            self._owed.answered(number, pdu_of(request, self.wire))
            self.journal.count(
                "transaction-id",
                f"{self.where}: a reply has another transaction id than its request",
                hint="handctl accepted the reply, because only one request was pending. Some hands count wrongly",
            )

    def _refusal(self, code: int, request: bytes) -> HandctlError:
        """The error of an exception: of the hand, or of a gateway before it."""
        name, sent = f"exception {code:02X} ({modbus_frames.EXCEPTIONS.get(code, 'unknown')})", hex_bytes(request)
        if code == modbus_frames.NO_PATH:
            hint = "check the gateway's serial port and its table of units"
            text = f"{self.where}: the gateway cannot reach this unit: {name}, sent {sent}"
            return LinkError(text, hint=hint, code="gateway")
        if code == modbus_frames.NO_TARGET:
            hint = "behind the gateway, check the power (24 V), the id, and the RS-485 wires A and B"
            return NoAnswer(f"{self.where}: the gateway got no reply to {sent}: {name}", hint=hint, code="gateway")
        if code in modbus_frames.UNSURE and not self.only_reads(request):
            text = f"{self.where}: the hand replied to {sent} with {name}, so it may carry it out all the same"
            return NoAnswer(text, hint="read the values before you write again", code=f"modbus-{code}")
        hint = Hint("check the address against {}", "hand describe")
        if not self.only_reads(request):
            hint = "read the value before you write again: the hand reports that it did not accept it"
        if code in modbus_frames.AT_WORK:
            hint = "wait for one second, read the values, then run the command again"
        return DeviceRefused(f"{self.where}: the hand refused {sent} with {name}", hint=hint, code=f"modbus-{code}")

    def _keep_quiet(self) -> None:
        """The silence that begins a frame of RTU."""
        if not self.tcp and not self.link.replayed:
            self.link.sleep(self.link.answered + QUIET_SECONDS - self.link.now())

    def only_reads(self, request: bytes | CanFrame) -> bool:
        return isinstance(request, bytes) and modbus_frames.only_reads(pdu_of(request, self.wire))

    def addressee(self, request: bytes | CanFrame) -> int:
        return self.id

    @property
    def where(self) -> str:
        """Device, id and link for messages; over TCP the unit is ignored."""
        return self.link.name if self.tcp else f"id {self.id} on {self.link.name}{self.at_speed}"

    def _failure(self, request: bytes, received: bytes, odd: Sequence[Answer], since: float) -> HandctlError:
        if not received:
            hint = TCP_HINTS["silence"] if self.tcp else SILENCE_HINT
            return self.unanswered(hex_bytes(request), self.timeout, since, hint)
        came = f"(sent {hex_bytes(request)}, received {hex_shown(received)})"
        code, text = "garbage", f"received {plural(len(received), 'byte')} instead of a valid Modbus reply"
        if received == request:
            code, text = "echo", "only our own bytes came back"
        elif (size := self._fewer(request, received, odd)) is not None:
            self._owed.settled()  # it was answered, as far as it goes
            code, text = FEWER, f"the reply has {plural(size, 'byte')}, fewer than were asked for"
        elif odd:
            code, text = "stale", "received a valid reply, but to a different request"
        elif self._cut_short(request, received):
            code, text = "cut-short", "the reply is corrupted or cut off"
        elif not self.tcp and _whole(received) and received[0] != self.id:
            code, text = "wrong-id", f"id {received[0]} replied instead"
        hint = TCP_HINTS.get(code, HINTS[code]) if self.tcp else HINTS[code]
        return ProtocolError(f"{self.where}: {text} {came}", hint=hint, code=code, came=received)

    def _fewer(self, request: bytes, received: bytes, odd: Sequence[Answer]) -> int | None:
        """Bytes of an answer to this read that has fewer than were asked for; None where it may answer something else."""
        pdu = (
            odd[0].pdu if odd else b"" if self.tcp or not _whole(received) or received[0] != self.id else received[1:-2]
        )
        asked = modbus_frames.reply_size(pdu_of(request, self.wire)) - 2
        reads = self.only_reads(request) and self._owed.alone and pdu[:1] == bytes([modbus_frames.READ])
        mine = len(odd) < 2 and (not odd or odd[0].has_transaction(self._state.transaction))
        return len(pdu) - 2 if reads and mine and pdu[1] == len(pdu) - 2 < asked else None

    def _cut_short(self, request: bytes, received: bytes) -> bool:
        """Whether this begins as the answer does."""
        if self.tcp:
            function = received[modbus_frames.MBAP : modbus_frames.MBAP + 1]
            return received[2:4] == b"\0\0" and function in (b"", request[modbus_frames.MBAP : modbus_frames.MBAP + 1])
        return received[0] == self.id and received[1:2] != b"" and received[1] & 0x7F == request[1]


def _whole(frame: bytes) -> bool:
    return len(frame) > 4 and modbus_frames.crc(frame[:-2]) == frame[-2:]


HINTS = {
    FEWER: "read fewer registers at once: this hand may not have all of them",
    "garbage": Hint(
        "check the baud rate (115200 or 921600) and the kind of device: try --protocol eb90, or {}", "scan"
    ),
    "echo": "check the wiring: an echo or a short returns our own bytes, and no device replies",
    "stale": "check for another program or a second master on this line",
    "cut-short": "check the cable, the ground and the baud rate, and that only one hand has this id",
    "wrong-id": "use --id with the id shown",
}
TCP_HINTS = {
    "silence": "check the power (24 V) and the network cable, and that no other program is connected to the hand",
    "garbage": f"check the address and the port: another service may reply there. The hand's port is {FAMILIES['hand'].tcp_port}",
    "stale": "it may be a late reply to an earlier request: run the command again with --timeout 2",
    "cut-short": "check the network cable, and the address and the port: another service may reply there",
}
"""What a connection has in place of a serial line: no speed, no id, no second master."""
