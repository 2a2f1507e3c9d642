"""A simulated slcan adapter: the ASCII protocol of Lawicel between a client's byte link and a `CanLine` or a seat.

    command CR          answer CR, or BEL when it cannot be done
    tiiildd.. riiil     standard frame, remote frame         z CR when it was acknowledged on the bus
    Tiiiiiiiildd.. Riiiiiiiil    the same, extended          Z CR
    O L C  Sn sxxyy  Zn  Mxxxxxxxx mxxxxxxxx  V v N F        channel, bitrate, timestamps, filter, versions, status

    Fxx CR              status: 01 receive queue full, 02 transmit queue full, 04 error warning, 08 overrun,
                        20 error passive, 40 arbitration lost, 80 bus error; reading clears it

Behaves as a `Line` towards a server: advance, feed, take, next_event. A frame that nobody acknowledged (wrong bitrate,
no power, bus off) is answered with BEL and shows in the status flags; adapters that only queue a frame say Z all the
same (fault `queue`), and go on with it until the channel is closed: each status shows a new bus error. After bus off
nothing happens on the bus: the queue stays full, and no error is added.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from handctl.sim.engine.can_line import Controller

OK, ERROR = b"\r", b"\x07"
BITRATES = (10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000, 1000000, 83300)  # S0 to S8; S9 of some
CLOCK = 8000000  # Hz, of the bit timing registers
VERSION, FIRMWARE, SERIAL_NUMBER = b"V1013", b"v0100", b"NSIM1"
QUEUE_FULL, WARNING, PASSIVE, BUS_ERROR = 2, 4, 32, 128  # status flags
ADAPTER_FAULTS: dict[str, str] = {
    "bel": "the adapter refuses every frame with BEL: its transmit queue is full",
    "queue": "the adapter says Z before a frame is on the bus. Only the status flags show its end",
    "reports": "the adapter reports bus errors and its state unasked: e1a, sp000128, sb000256",
    "no-status": "the adapter does not know V, v, N and F",
    "damaged-lines": "one character is missing in the line of each received frame",
    "no-adapter": "the port does not belong to an adapter: it answers nothing",
}
LONGEST = 64  # bytes of a command that are kept; no command is longer than 27


class Adapter:
    """The adapter with the bus and the device behind it; the client's serial speed does not matter to it."""

    def __init__(self, line: Any, faults: Iterable[str] = ()) -> None:
        """`line` is a `CanLine`, or a seat of a hub."""
        self.line = line
        self.faults = frozenset(faults)
        self.device = line.device
        self.client_baud: int | None = None
        self._command = bytearray()
        self._out = bytearray()
        self._now = 0.0
        self._started: float | None = None
        self._reset()

    def _reset(self) -> None:
        self._command.clear()
        self._out.clear()
        self._open = self._listening = self._stamped = False
        # A client that opens without a bitrate gets that of the manual (wrist §2.3); a real adapter may refuse.
        self._bitrate = 1000000
        self._code, self._mask = 0, 4294967295
        self._flags = 0
        self._stuck = False  # a frame waits in the controller and cannot leave
        self._state = b"a"  # error active; p passive, b bus off

    # -- as a line ------------------------------------------------------------------------------------------------

    @property
    def hung_up(self) -> bool:
        return bool(self.line.hung_up)

    def advance(self, now: float) -> None:
        self._now = max(now, self._now)
        if self._started is None:
            self._started = now
        self.line.advance(now)
        self._collect()

    def feed(self, data: bytes) -> None:
        """Bytes that the client writes at the present time."""
        for byte in b"" if self.hung_up or "no-adapter" in self.faults else data:
            if byte == 13:
                self._out += self._do(bytes(self._command))
                self._command.clear()
                self._collect()
            elif byte != 10 and len(self._command) < LONGEST:  # a line feed behind the CR is forgiven
                self._command.append(byte)

    def take(self) -> bytes:
        """What the client may read by now."""
        self._collect()
        out = bytes(self._out)
        self._out.clear()
        return out

    def next_event(self) -> float | None:
        return self._now if self._out else self.line.next_event()

    def reconnect(self) -> None:
        """A new client finds the channel closed."""
        self.line.reconnect()
        self._reset()

    def power_cycle(self) -> None:
        self.line.power_cycle()

    def command(self, text: str) -> str:
        name, _, rest = text.strip().partition(" ")
        if name != "fault" or not rest:
            return str(self.line.command(text))
        mine, others = split_faults(rest)
        answer = self.line.command(f"fault {others or 'none'}")
        self.faults = frozenset(mine)
        return f"fault {rest.strip()}" if mine else answer

    def close(self) -> None:
        self.line.close()

    # -- frames to the client ---------------------------------------------------------------------------------------

    def _collect(self) -> None:
        """Turns the frames that have arrived into text; without an open channel they are lost."""
        for identifier, data in self.line.take_frames():
            if not self._open or not self._passes(identifier):
                continue
            text = b"T%08X%d" % (identifier, len(data)) + data.hex().upper().encode()
            if self._stamped:
                text += b"%04X" % (int((self._now - (self._started or 0.0)) * 1000 + 0.001) % 60000)
            if "damaged-lines" in self.faults:
                text = text[: len(text) // 2] + text[len(text) // 2 + 1 :]
            self._out += text + OK

    def _passes(self, identifier: int) -> bool:
        """The acceptance filter: two filters over the upper 16 of 29 bits, a 1 in the mask means any."""
        upper = identifier >> 13
        # AC0 AC1 first, then AC2 AC3
        return any(not (upper ^ (self._code >> shift)) & ~(self._mask >> shift) & 65535 for shift in (16, 0))

    # -- commands -----------------------------------------------------------------------------------------------------

    def _do(self, command: bytes) -> bytes:
        """The answer to one command, without its CR."""
        name, rest = command[:1], command[1:]
        if not command:
            return OK
        if name in b"tTrR":
            return self._send(name, rest)
        if name in b"VvNF" and "no-status" in self.faults:
            return ERROR
        if not rest:
            match name:
                case b"O" | b"L":
                    return self._open_channel(listening=name == b"L")
                case b"C":
                    return self._close_channel()
                case b"V":
                    return VERSION + OK
                case b"v":
                    return FIRMWARE + OK
                case b"N":
                    return SERIAL_NUMBER + OK
                case b"F" if self._open:
                    return self._status()
            return ERROR
        return OK if not self._open and self._set_up(name, rest) else ERROR

    def _open_channel(self, listening: bool) -> bytes:
        if self._open:
            return ERROR
        self._open, self._listening = True, listening
        self._flags = self.line.bus_errors = 0
        self._stuck, self._state = False, b"a"
        self.line.reconnect()  # the controller starts anew: bus off is over
        self.line.client_bitrate = self._bitrate
        self.line.taking_part = not listening
        return OK

    def _close_channel(self) -> bytes:
        if not self._open:
            return ERROR
        self._open = self.line.taking_part = False
        return OK

    def _status(self) -> bytes:
        """Two hex digits; reading clears the flags."""
        flags, self._flags = self._flags, 0
        if self._stuck:
            self._flags = QUEUE_FULL if self.line.bus_off else PASSIVE + BUS_ERROR
        if self.line.bus_errors:
            flags |= BUS_ERROR
            self.line.bus_errors = 0
        return b"F%02X" % flags + OK

    def _set_up(self, name: bytes, rest: bytes) -> bool:
        """A setting, possible only while the channel is closed; whether it is a good one."""
        match name:
            case b"S" if rest in (b"0", b"1", b"2", b"3", b"4", b"5", b"6", b"7", b"8", b"9"):
                self._bitrate = BITRATES[int(rest)]
            case b"s" if (timing := _hex(rest, 4)) is not None:
                # BTR0: jump width, prescaler; BTR1: samples, segment 2, segment 1; one bit has 1 + segments quanta.
                quanta = 3 + timing % 16 + timing // 16 % 8
                self._bitrate = CLOCK // ((1 + timing // 256 % 64) * quanta)
            case b"Z" if rest in (b"0", b"1"):
                self._stamped = rest == b"1"
            case b"M" if (code := _hex(rest, 8)) is not None:
                self._code = code
            case b"m" if (mask := _hex(rest, 8)) is not None:
                self._mask = mask
            case _:
                return False
        return True

    def _send(self, name: bytes, rest: bytes) -> bytes:
        """t, T, r, R: one frame on the bus."""
        extended, remote = name in b"TR", name in b"rR"
        digits = 8 if extended else 3
        identifier, count, body = _hex(rest[:digits], digits), rest[digits : digits + 1], rest[digits + 1 :]
        if identifier is None or identifier >= (536870912 if extended else 2048) or count not in _COUNTS:
            return ERROR
        size = 0 if remote else int(count)
        if len(body) != 2 * size or (size and _hex(body, 2 * size) is None) or not self._open or self._listening:
            return ERROR
        if "bel" in self.faults:
            self._flags |= QUEUE_FULL
            return ERROR
        self.line.feed_frame(identifier, bytes.fromhex(body.decode("ascii")), extended, remote)
        queued = (b"Z" if extended else b"z") + OK
        if self.line.acknowledged:
            self._stuck = False
            return queued
        if not (self._stuck and self.line.bus_off):
            self._flags |= WARNING + PASSIVE + BUS_ERROR
        self._stuck = "queue" in self.faults or self.line.bus_off
        return (queued if "queue" in self.faults else ERROR) + self._report()

    def _report(self) -> bytes:
        """What such an adapter tells unasked: the kind of error, and its state with both error counters once it changes."""
        state = b"b" if self.line.bus_off else b"p"
        if "reports" not in self.faults or state == self._state == b"b":
            return b""
        changed, self._state = state != self._state, state
        told = b"" if state == b"b" else b"e1a\r"
        return told + (b"s%s000%03d\r" % (state, 256 if state == b"b" else 128) if changed else b"")


class Hub:
    """A bus of which each client has an adapter of its own, all with the same faults: each hears the devices and all others.

    Behind it is a `CanLine`, or the CAN bus of a file, that knows of one client only.
    """

    def __init__(self, line: Any, faults: Iterable[str] = ()) -> None:
        self.line = line
        self.adapters: list[Adapter] = []
        self.seats: list[Seat] = []
        self.asked: Seat | None = None  # who sent last
        self._front = Adapter(Seat(self), faults)  # at no bus: it takes the commands for all

    def __getattr__(self, name: str) -> Any:
        """What concerns the bus itself."""
        return getattr(self.line, name)

    def join(self) -> Adapter:
        self.seats.append(Seat(self))
        self.adapters.append(Adapter(self.seats[-1], self._front.faults))
        return self.adapters[-1]

    def leave(self, adapter: Adapter) -> None:
        self.adapters.remove(adapter)
        self.seats.remove(adapter.line)

    def command(self, text: str) -> str:
        answer = self._front.command(text)
        for adapter in self.adapters:
            adapter.faults = self._front.faults
        return answer

    def advance(self, now: float) -> None:
        self.line.advance(now)
        self.collect()

    def send(self, seat: Seat, can_id: int, data: bytes, extended: bool, remote: bool) -> None:
        """A frame of this seat, for the bus and for all other seats."""
        line, others = self.line, [other for other in self.seats if other is not seat and other.hears()]
        self.asked = seat
        deafened = line.deafened
        line.client_bitrate, line.bus_off = seat.client_bitrate, seat.bus_off
        line.feed_frame(can_id, data, extended, remote)
        seat.acknowledged, seat.bus_off = line.acknowledged, line.bus_off
        line.client_bitrate, line.bus_off = None, False
        if not seat.acknowledged and not deafened and seat.hears():
            seat.acknowledged = any(other.taking_part for other in others)
        if seat.acknowledged and extended and not remote:
            for other in others:
                other.arrived.append((can_id, data))
        self.collect()

    def collect(self) -> None:
        """Gives what has come to every seat that hears it."""
        line = self.line
        frames = line.take_frames()
        errors, line.bus_errors = line.bus_errors, 0
        for seat in self.seats:
            seat.bus_errors += errors
            if seat.hears():
                seat.arrived += frames
        if line.hung_up and not getattr(line, "away", False):  # the adapter of who asked goes away
            line.reconnect()
            if self.asked is not None:
                self.asked.hung_up = True


class Seat(Controller):
    """One client's controller on the bus."""

    def __init__(self, hub: Hub) -> None:
        self.hub = hub
        self.hung_up = False
        self.taking_part = False
        self.arrived: list[tuple[int, bytes]] = []

    def hears(self) -> bool:
        return not self.bus_off and self.client_bitrate in (None, self.hub.line.device.speed)

    def advance(self, now: float) -> None:
        self.hub.advance(now)

    def send(self, can_id: int, data: bytes, extended: bool, remote: bool) -> None:
        if not self.hung_up:
            self.hub.send(self, can_id, data, extended, remote)

    def take_frames(self) -> list[tuple[int, bytes]]:
        self.hub.collect()
        frames, self.arrived = self.arrived, []
        return frames

    def next_event(self) -> float | None:
        return 0.0 if self.arrived else self.hub.next_event()

    def reconnect(self) -> None:
        self.arrived.clear()
        self.bus_off = self.hung_up = False

    def __getattr__(self, name: str) -> Any:
        """The device, and what concerns the bus itself."""
        return getattr(self.hub.line, name)


_COUNTS = frozenset(b"%d" % count for count in range(9))


def _hex(text: bytes, digits: int) -> int | None:
    """Exactly so many hex digits, or None."""
    if len(text) != digits or not all(byte in b"0123456789abcdefABCDEF" for byte in text):
        return None
    return int(text, 16)


def split_faults(text: str) -> tuple[list[str], str]:
    """Those of NAME,NAME that are the adapter's, and the others."""
    names = [name.strip() for name in text.split(",")]
    return [name for name in names if name in ADAPTER_FAULTS], ",".join(n for n in names if n not in ADAPTER_FAULTS)


def link(address: str) -> str:
    """The LINK of a server at /dev/pts/7 or tcp://127.0.0.1:41234, for --port."""
    return "can:slcan:" + address.replace("tcp://", "socket://", 1)
