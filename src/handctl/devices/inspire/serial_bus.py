"""Register access over the serial wire: one request, one reply, a deadline, retries for reads only.

`read(address, n)` and `write(address, data)`; what the bytes mean is not known here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import ClassVar

from handctl.devices.inspire import eb90
from handctl.devices.inspire.eb90 import Decoder, Frame
from handctl.devices.inspire.register_bus import (
    AHEAD,
    FEWER,
    FRESH,
    FRESH_SHORT,
    PATIENCE,
    ByteBus,
    LastReply,
    question,
)
from handctl.errors import JUDGED, DeviceRefused, HandctlError, Hint, ProtocolError
from handctl.link import CanFrame, Deadline
from handctl.model.device import harmless_to_others
from handctl.model.frame_decoder import frames_in
from handctl.model.param import Step
from handctl.model.result import Journal, hex_bytes, hex_shown
from handctl.wording import plural

SILENCE_HINT = (
    "check these in order: --id 1 at 115200 bit/s, {}, power (7 to 9 V), TX/RX and RS-232 wiring. "
    "A wrong id, a wrong baud rate, no power and no cable all look the same: the device never replies. Unplug power and data, and plug them in again"
)
WIRING_HINT = (
    "Check the hand's power, the wire (RS-232 against RS-485, A/B, TX/RX) and that this hand carries a wrist. "
    "A wrong id, a wrong baud rate (115200 bit/s in the manual), no power and no cable all look the same: the device never replies. "
    "For CAN give -p can:INTERFACE:CHANNEL"
)
SILENCE_HINTS = {
    "exo": SILENCE_HINT,
    "wrist": f"run {{}}. {WIRING_HINT}",
    "hand": "check these in order: --id 1 at 115200 bit/s, {}, power (24 V), A and B of RS-485. "
    "An RH56DFTP may reply only on its network: `handctl hand status -p tcp://192.168.11.210`. "
    "At baud rates other than 115200 bit/s handctl tries Modbus RTU only with --protocol modbus",
}
"""Of families that are not as the EH55BF1 is (rh56 §1, §2.5). {} is the family's scan, here and below."""
SLOW = "slow"
HINTS = {
    "echo": "check the wiring: an echo or a TX-RX short returns our own bytes, and no device replies",
    "wrong-id": "use --id with the id shown, or find the hand with {}: a different id replies",
    "bad-checksum": "check the cable, the ground and the baud rate, and that only one device has this id: bytes were corrupted on the line",
    "cut-short": "check the cable and the adapter, and that no other program reads the port: the reply was cut off",
    "stale": "check for another program or a second master on this line: the frame is valid, but is a reply to a different request",
    SLOW: "run the command again with --timeout 2: this line or its adapter passes the bytes on slowly",
    FEWER: "read fewer bytes at once, or a register by itself: this device may not have all of them",
    "first-byte-lost": "use another RS-485 adapter, or make this one switch its direction sooner: it swallows the first byte of each reply",
    "garbage": "try --baud 115200, 57600 and 19200: the baud rate is probably wrong, or this is another kind of device",
}


HAND_HINTS = {
    "garbage": "try --baud 115200, 921600, 57600 and 19200: the baud rate is probably wrong, or this is another kind of device",
    "bad-checksum": "check the cable, the ground and the baud rate. Two hands with the same id also cause this: `handctl hand doctor -p LINK` detects that",
}
"""Code -> the next step with a hand where it is another one."""


def hint_for(code: str, family: str) -> str:
    """The next step for a code of `bad_reply`, with this family's own command names."""
    hints = {**HINTS, **HAND_HINTS} if family == "hand" else HINTS
    return Hint(hints[code], *([f"{family} scan"] if "{}" in hints[code] else []))


def bad_reply(request: bytes, received: bytes, more: int = 0) -> tuple[str, str]:
    """Name what came instead of the answer, and `more` bytes behind it: (code, text). Codes are the keys of HINTS."""
    rest = received
    if request in rest:
        rest = rest.replace(request, b"", 1)
        if not rest:
            return "echo", "only our own bytes came back"
    wanted_id = request[2] if len(request) > 2 else None
    if any(frame.id == wanted_id for frame in headless(rest)):
        return "first-byte-lost", "the reply arrived without its first byte"
    if others_speak(request, rest) and not _damaged(rest, wanted_id):
        return (
            "stale",
            "received a valid frame, but it is not a reply to this request: another program or device is using this line",
        )
    sniffer = Decoder()
    sniffer.feed(rest)
    bad_sums: list[ProtocolError] = []
    frames = list(frames_in(sniffer, bad_sums.append))
    pending = sniffer.pending
    frames += sniffer.finish()
    replies = [frame for frame in frames if frame.from_device]
    for frame in replies:
        if frame.id != wanted_id:
            return "wrong-id", f"id {frame.id} replied instead"
    if bad_sums:
        return "bad-checksum", "the reply's checksum is wrong"
    asked = bytes([request[4]]) + request[5:7] if request[3:4] == b"\x04" else None
    for frame in replies:
        if bytes([frame.flag]) + frame.payload[:2] == asked and len(frame.data) < request[7]:
            return FEWER, f"the reply has {plural(len(frame.data), 'byte')}, not the {request[7]} that were asked for"
    if frames:
        return "stale", "received a valid frame, but it is not a reply to this request"
    # At a wrong speed 90 EB may come by chance: with the id behind it, or nothing, it is the beginning of an answer.
    if pending >= 2 and (rest.endswith(eb90.DEVICE) or eb90.DEVICE + request[2:3] in rest):
        return "cut-short", f"the reply was cut off after {plural(len(rest) + more, 'byte')}"
    return "garbage", f"received {plural(len(rest) + more, 'byte')} instead of a valid frame"


def differences(request: bytes, received: bytes) -> list[str]:
    """How one frame in place of the reply to a read differs from that, in ways that a firmware may have; [] = it is none."""
    data, count = received.removeprefix(request), request[7] if len(request) == 9 else 0
    size, address = len(data) - count - REPLY_SIZE, request[5:7]
    if not count or abs(size) > 2 or data[:2] not in (eb90.DEVICE, eb90.HOST) or len(data) < 7:
        return []
    total = sum(data[2:-1]) & 0xFF
    sums = {
        (sum(eb90.DEVICE) + total) & 0xFF: "a checksum with the header",
        -total & 0xFF: "a checksum of which the sum is 0",
        total ^ 0xFF: "an inverted checksum",
    }
    places = {
        address[::-1]: "the address with its high byte first",
        (int.from_bytes(address, "little") // 2).to_bytes(2, "little"): "the address in words",
    }
    found = []
    if data[:2] == eb90.HOST:
        found.append("the header of a request")
    if data[2] != request[2]:
        found.append(f"id {data[2]}")
    if data[4] != request[4]:
        found.append("" if data[4] in (eb90.READ, eb90.WRIST_READ) else f"flag {data[4]:02X}")
    if data[5:7] != address:
        found.append("no address" if size == -2 else places.get(data[5:7], ""))
    if data[-1] != total:
        found.append("no checksum" if size == -1 and data[5:7] == address else sums.get(data[-1], ""))
    if data[3] != count + 3 and "no address" not in found:
        found.append(f"a length byte that is {data[3] - count - 3:+d}" if data[3] else "length byte 0")
    elif size and not found:
        found.append(f"{size:+d} data bytes")
    return [] if "" in found or data[2] not in (request[2], 0, 255) else found


def others_speak(request: bytes, received: bytes) -> bool:
    """Whether there is a request in it that is not ours, or an answer of another id to something else than ours."""

    def aside(frame: Frame) -> bool:
        if not frame.from_device:
            return True
        same = bytes([frame.flag]) + frame.payload[:2] == request[4:7]
        if same and frame.flag in (eb90.READ, eb90.WRIST_READ):
            same = len(frame.data) == request[7]
        return frame.id != request[2] and not same

    return any(map(aside, frames_of_others(received, request, lambda frame: False)))


def _damaged(received: bytes, device_id: int | None) -> bool:
    """Whether a frame with this id and a wrong sum is in it."""
    sniffer, named = Decoder([eb90.DEVICE]), list[int]()
    sniffer.feed(received)
    list(frames_in(sniffer, lambda _error: named.append(sniffer.rejected[2])))
    return device_id in named


REPLY_SIZE = 8
"""Bytes of the reply to a read beside its data."""


def headless(data: bytes) -> list[Frame]:
    """Answers to reads in `data` that are whole but for their first byte."""
    found = []
    place = data.find(eb90.DEVICE[1:])
    while place >= 0:
        one = eb90.DEVICE[:1] + data[place:]
        whole = Decoder([eb90.DEVICE])
        whole.feed(one[: one[3] + eb90.OVERHEAD] if len(one) > 3 else b"")
        if data[:place][-1:] != eb90.DEVICE[:1]:
            found += [frame for frame in frames_in(whole) if frame.flag in (eb90.READ, eb90.WRIST_READ)]
        place = data.find(eb90.DEVICE[1:], place + 1)
    return found


def frames_of_others(data: bytes, sent: bytes, ours: Callable[[Frame], bool]) -> list[Frame]:
    """Whole frames in `data` that were not `sent` by us, and answer nothing of `ours`: the conversation of others."""
    sniffer = Decoder()
    sniffer.feed(data)
    frames = [*frames_in(sniffer), *sniffer.finish()]
    return [frame for frame in frames if frame.encode() not in sent and not (frame.from_device and ours(frame))]


# -- the wire ---------------------------------------------------------------------------------------------------------

SHORT = 32
"""Bytes of an answer whose time is that of the line, not of its bytes."""
ARRIVING = 0.5
"""Part of a timeout: an answer whose last byte is younger when the wait ends has not ended."""
PAUSE_SECONDS, SPEAKS_SECONDS = 0.005, 0.05
"""Who makes such a pause has said what he had to say; nobody is waited for longer."""


class SerialBus(ByteBus):
    """The serial wire: flags 11/12 for exo and hands, 30/31 for the wrist."""

    max_count = eb90.MAX_COUNT
    reports = True
    spaces: ClassVar = {"hand": (eb90.READ, eb90.WRITE), "wrist": (eb90.WRIST_READ, eb90.WRIST_WRITE)}

    usual = "exo"
    only_reads = staticmethod(eb90.only_reads)
    _fresh = 0
    _short = False
    """Whether the next question of `pace` is a short one."""
    _disturbed = False
    """A request of somebody else came instead of an answer: perhaps it goes on."""
    _last_byte = float("-inf")
    _slow = False
    """The wait for an answer ended while it was arriving: what comes next is perhaps its rest."""

    # -- registers -----------------------------------------------------------------------------------------------

    def again(self, journal: Journal) -> bool:
        self.journal, self._rest, self._empty = journal, b"", not self.link.replayed
        self._last = LastReply()
        self._met.clear()
        return not (self._disturbed or self._slow)

    def read(self, address: int, count: int, *, device_id: int | None = None, retries: int | None = None) -> bytes:
        """`count` bytes (1..252) from `address` (exo §2.2.3). Raises UsageError, NoAnswer, ProtocolError, LinkError."""
        target = self.id if device_id is None else device_id
        address //= self.per
        request = eb90.read_request(target, address, count, self.read_flag)
        prefix = eb90.read_reply_prefix(target, address, count, self.read_flag)
        if not self._met and not self.is_quiet(request):
            self._ask_quietly(target, retries)
        try:
            answer = self.repeated(retries, self.exchange, request, [prefix], reply_size=count + 8)
        except ProtocolError as exc:
            if exc.code == FEWER:
                raise  # it has come whole, and says what it is
            raise self.other_form(exc, lambda came: differences(request, came), lambda: self._again(request)) from exc
        self._met.add(target)
        return answer.data

    def _again(self, request: bytes) -> Sequence[str]:
        """How the reply to another question differs from one."""
        asked = int.from_bytes(request[5:7], "little")
        address, count = next(span for span in self.first_questions if span[0] // self.per != asked)
        if not self.quiet(address, count):
            return ()
        other = request[2], address // self.per, count, self.read_flag
        again, prefixes = eb90.read_request(*other), [eb90.read_reply_prefix(*other)]
        return self.differs_again(
            lambda: self.exchange(again, prefixes, reply_size=count + 8), lambda came: differences(again, came)
        )

    def quiet(self, address: int, count: int) -> bool:
        request = eb90.read_request(self.id, address // self.per, count, self.read_flag)
        if self.link.replayed:
            return self.link.is_next_recorded(request)
        return bool(self._met) or self.is_quiet(request)

    def is_quiet(self, request: bytes) -> bool:
        """Whether no other device on this line would act on it. A recording has no other devices."""
        link = self.link
        return link.replayed or harmless_to_others(request, link.baud if link.can_set_baud else None)

    def _ask_quietly(self, device_id: int, retries: int | None) -> None:
        """Before a request that another device could act on, send one that none acts on. Raises as `read` does."""
        span = question(device_id, self.read_flag)
        if self.is_quiet(eb90.read_request(device_id, *span, self.read_flag)):
            self.read(*span, device_id=device_id, retries=retries)

    def write(self, address: int, data: bytes, *, acknowledged_by: Sequence[int] = ()) -> None:
        """Write `data` once (exo §2.2.4). Never repeated.

        `acknowledged_by` lists further ids whose acknowledgement counts (an id change answers from the new one).
        Raises DeviceRefused when the acknowledgement byte is not 01; NoAnswer, ProtocolError when it is unknown
        whether the write arrived.
        """
        address //= self.per
        request = eb90.write_request(self.id, address, data, self.write_flag)
        targets = dict.fromkeys((self.id, *acknowledged_by))
        prefixes = [eb90.write_ack_prefix(target, address, self.write_flag) for target in targets]
        ack = self.exchange(request, prefixes, reply_size=9)
        if ack.data != bytes([eb90.ACCEPTED]):
            raise DeviceRefused(
                f"{self.where}: the device replied {hex_bytes(ack.data)} instead of 01 to the write at {address}",
                hint="read the value before you write again: the manual does not explain any other reply",
            )

    def write_step(self, address: int, data: bytes, meaning: str) -> Step:
        """The exact bytes of that write."""
        return Step(meaning, eb90.write_request(self.id, address // self.per, data, self.write_flag))

    def command(self, flag: int, values: Sequence[int]) -> list[int]:
        """Send a force (0x31) or position (0x32) command once; the values of its reply (exo §2.2.1, §2.2.2)."""
        request = eb90.command_request(self.id, flag, values)
        prefix = eb90.command_reply_prefix(self.id, flag)
        return eb90.unpack_s16(self.exchange(request, [prefix], reply_size=prefix[3] + eb90.OVERHEAD).payload)

    # -- the wire ------------------------------------------------------------------------------------------------

    def exchange(self, request: bytes, prefixes: Sequence[bytes], *, reply_size: int) -> Frame:
        """Send one request, wait for one frame that begins with one of `prefixes`. One attempt."""
        self.pass_gate(request)
        if self.bound is not None:
            self.check_bound(hex_bytes(request))
        replied = self._last.reply
        if ((stale := self.drain()) and _begins_request(stale)) or self._disturbed:
            self._let_speak()
        started = self.link.now()
        deadline = self.deadline(self.wire_seconds(len(request) + reply_size) + self.timeout)
        first = self._ahead(request)
        self.count(request)
        self.link.write(first + request, deadline)
        decoder = Decoder(prefixes)
        frame, received, pieces = self._heard(decoder, deadline, (PATIENCE - 1) * self.timeout)
        came = received.removeprefix(first)
        if frame is None:
            self.journal.counters.stray_bytes += decoder.pending
            self._disturbed = _begins_request(came[:JUDGED].removeprefix(request))
            raise self._failure(request, came, started)
        self._rest, self._disturbed, self._slow = decoder.rest(), False, False
        if decoder.skipped and replied is not None:
            self._look_for_second(replied, came[: len(came) - len(self._rest) - len(frame.encode())])
        if request[4] == self.read_flag:
            self._last.reply = (prefixes[0], frame)
            if self._rest:
                self._look_for_second(self._last.reply, self._rest)
        self.round_trip = self._last_byte - started
        # What a good exchange shows of the line.
        line, size = self.journal.line, len(came)
        if size < SHORT + len(request):
            line.trips.add(self.round_trip)
        if size >= SHORT and not decoder.skipped:
            line.pieces(pieces)
        if line.echo is None:
            line.echo = came.startswith(request)
        if decoder.skipped and others_speak(request, came):
            line.others = True
        return frame

    def _look_for_second(self, replied: tuple[bytes, Frame], data: bytes) -> None:
        """See ByteBus. `replied`: how the reply begins, and it."""
        prefix, frame = replied
        decoder = Decoder([prefix])
        decoder.feed(data[:JUDGED])
        if second := next((one for one in frames_in(decoder) if one.data != frame.data), None):
            self.two_replies(hex_bytes(frame.data), hex_bytes(second.data))

    def _heard(
        self, decoder: Decoder, deadline: Deadline, patience: float = 0.0
    ) -> tuple[Frame | None, bytes, list[int]]:
        """The first frame that comes, None for none until the `deadline`; all that came, and the sizes of its pieces.

        Part of an answer, with no more junk ahead of it, may go on coming for `patience` seconds after the deadline.
        """
        received = bytearray()
        pieces: list[int] = []
        last, trickles, junk = deadline.at + patience, False, 0
        while True:
            try:
                frame = decoder.next()
            except ProtocolError:
                self.journal.counters.bad_frames += 1
                continue
            if frame is not None:
                break
            if trickles and deadline.remaining < self.timeout:
                deadline = self.deadline(min(self.timeout, last - self.link.now()))
            if (received and deadline.expired) or not (chunk := self.link.read(deadline)):
                break
            received += chunk
            self._last_byte = self.link.now()
            pieces.append(len(chunk))
            trickles, junk = decoder.skipped == junk, decoder.skipped
            decoder.feed(chunk)
        self.journal.counters.received += frame is not None
        self.journal.counters.stray_bytes += decoder.skipped
        return frame, bytes(received), pieces

    def _let_speak(self) -> None:
        """Wait until the line is idle: on two wires, a request sent into another frame destroys both."""
        end = self.deadline(SPEAKS_SECONDS)
        while not end.expired and (stray := self.link.read(self.link.deadline(PAUSE_SECONDS).earlier(end))):
            self.journal.counters.stray_bytes += len(stray)

    def send(self, request: bytes, deadline: Deadline | None = None) -> None:
        """Write one or more request frames, or whatever bytes."""
        self.pass_gate(request)
        self.count(request)
        data = self._ahead(request) + request
        self.link.write(data, deadline or self.deadline(self.wire_seconds(len(data)) + self.timeout))

    def _ahead(self, request: bytes) -> bytes:
        """Bytes sent before a request until a device has replied: another device may hear it at a different baud rate."""
        link = self.link
        if self._met or not link.can_set_baud or not eb90.only_reads(request):
            return b""
        first = AHEAD.get(link.baud, b"")
        return first if not link.replayed or link.is_next_recorded(first + request) else b""

    def pace(self, seconds: float) -> float | None:
        """Seconds until the answer to a question that was not asked lately: no late answer to another one passes for it.

        For an id that has answered, or that no stranger's place is. None when no answer came within `seconds`: then the next
        question is for another register, and short.
        """
        spans = (FRESH_SHORT if self._short else FRESH)[self.read_flag]
        self._fresh += 1
        span = spans[self._fresh % len(spans)]
        self.check_bound()
        self.drain()
        started = self.link.now()
        self.send(eb90.read_request(self.id, *span, self.read_flag))
        frame = self.listen([eb90.read_reply_prefix(self.id, *span, self.read_flag)], seconds)
        if frame is None:
            self._short = not self._short
            return None
        self.round_trip = self.link.now() - started
        self.journal.line.trips.add(self.round_trip)
        return self.round_trip

    def listen(self, prefixes: Sequence[bytes], seconds: float) -> Frame | None:
        """Wait for a frame that the device sends later by itself; None when it does not come. Sends nothing.

        May be called again: the part of a frame that has come is kept.
        """
        deadline, decoder = self.deadline(seconds), Decoder(prefixes)
        decoder.feed(self._rest)
        frame, _, _ = self._heard(decoder, deadline)
        self._rest = decoder.rest()
        return frame

    def behind(self, address: int, count: int, seconds: float) -> bytes | None:
        frame = self.listen([eb90.read_reply_prefix(self.id, address // self.per, count, self.read_flag)], seconds)
        return frame.data if frame is not None else None

    def addressee(self, request: bytes | CanFrame) -> int:
        named = request[2] if isinstance(request, bytes) and request[:2] == eb90.HOST and len(request) > 2 else 0
        return named if named in eb90.IDS else self.id

    def reopened(self) -> None:
        self._met.clear()
        self._rest, self._disturbed = b"", False

    @property
    def where(self) -> str:
        """Device, id and link for messages."""
        return f"id {self.id} on {self.link.name}{self.at_speed}"

    def _failure(self, request: bytes, received: bytes, since: float) -> HandctlError:
        if not received:
            return self.unanswered(
                hex_bytes(request), self.timeout, since, Hint(SILENCE_HINTS[self.family], f"{self.family} scan")
            )
        seen = received[:JUDGED]
        code, text = bad_reply(request, seen, len(received) - len(seen))
        arriving = not self.over and self.link.now() - self._last_byte < ARRIVING * self.timeout
        self._slow = arriving and (code == "cut-short" or (code == "garbage" and self._slow))
        if self._slow:
            code, text = (
                SLOW,
                f"the reply was still arriving when the wait ended, with {plural(len(received), 'byte')} so far",
            )
        if code == "stale" and others_speak(request, seen):
            self.journal.line.others = True
        return ProtocolError(
            f"{self.where}: {text} (sent {hex_bytes(request)}, received {hex_shown(received)})",
            hint=hint_for(code, self.family),
            code=code,
            came=received,
        )


def _begins_request(stray: bytes) -> bool:
    """Whether these bytes contain the beginning of another program's request."""
    return eb90.HOST in stray or stray[-1:] == eb90.HOST[:1]
