"""The CAN bus between clients and a simulated device: frame times, arbitration, faults of the bus, acknowledgement.

Generic: knows frames and time, no protocol. A message reaches the device as its identifier in 4 bytes, high byte first,
followed by the data; replies have the same form. Nothing here sleeps: the driver calls `advance(now)`, then
`feed_frame` and `take_frames`, and asks `next_event` how long it may sleep.
"""

from __future__ import annotations

import struct

from handctl.sim.engine.line_and_faults import LINE_FAULTS, LINE_OPTIONS, Cable
from handctl.sim.engine.simulated_device import Model, Reply, Rows, soonest

CAN_OPTIONS = Rows({
    **LINE_OPTIONS,
    "wire": (("0", "1", "auto"), "1 or 'auto': frames take their time on the bus (67 bits and 8 a data byte, default 0: none)"),
    "turnaround": ((0.0, 60.0), "seconds from the end of a request to its answer (default 0)"),
    "traffic": ((0, 0, 1000), "frames a second that others send to each other, 0..1000 (default 0). They acknowledge as well"),
})  # fmt: skip
CAN_FAULTS: dict[str, str] = {
    **{name: LINE_FAULTS[name] for name in ("healthy", "silent", "deaf", "late", "slow", "duplicate", "stale")},
    "noise": "frames with other identifiers before and after each answer, also if the answer is lost",
    "truncate": "the answer has fewer data bytes",
    "wrong-id": LINE_FAULTS["wrong-id"],
    "twin-id": "a second device with the same id answers at the same time: different answers destroy each other",
    "echo": "the client receives its own frames",
    "loopback": "the client receives its own frames, there is no bus",
    "no-ack": "no one acknowledges a frame",
    "bus-off": "the client's controller gives up until it connects again",
    "disconnect": "the client's adapter goes away instead of receiving the answer",
    "refuse": LINE_FAULTS["refuse"],
}
BACKLOG = 1024  # frames of the client that wait for the bus; what comes beyond is lost
SOON = 0.000000001  # s, rounding


class Frame:
    """A frame that waits for the bus, not sent before `ready`."""

    def __init__(self, ready: float, identifier: int, data: bytes, extended: bool = True, remote: bool = False) -> None:
        self.ready = ready
        self.identifier = identifier
        self.data = data
        self.extended = extended
        self.remote = remote
        self.hang = False
        self.echo = False

    def bits(self) -> int:
        """With the gap behind it, without stuffing: 67 bits or 47, and 8 a data byte."""
        return (67 if self.extended else 47) + (0 if self.remote else 8 * len(self.data))

    def rank(self) -> int:
        """The lowest wins the arbitration: 11 bits of the identifier, a standard frame, the other 18, data."""
        high, low = (self.identifier >> 18, self.identifier % 262144) if self.extended else (self.identifier, 0)
        return ((high * 2 + self.extended) * 262144 + low) * 2 + self.remote


class Controller:
    """What a client's CAN controller knows of the bus."""

    client_bitrate: int | None = None  # None: taken for the right one
    acknowledged = True  # whether anybody acknowledged the last frame of the client
    unacknowledged = 0  # frames of the client that nobody acknowledged so far
    bus_errors = 0  # frames of others that came to grief on the bus, or at the client's bitrate
    bus_off = False
    taking_part = True  # whether it acknowledges what others send

    def feed_frame(self, can_id: int, data: bytes, extended: bool = True, remote: bool = False) -> None:
        """A frame that the client sends at the present time. ValueError: there is no such frame."""
        if not 0 <= can_id < (536870912 if extended else 2048) or len(data) > 8:
            raise ValueError(f"not a CAN frame: identifier {can_id}, {len(data)} data bytes")
        self.send(can_id, data, extended, remote)

    def send(self, can_id: int, data: bytes, extended: bool, remote: bool) -> None:
        """One that there is."""
        raise NotImplementedError


class CanLine(Controller, Cable):
    """A simulated device as a client's CAN controller sees it: takes and gives frames."""

    def __init__(self, model: type[Model], raw: dict[str, str]) -> None:
        super().__init__(model, raw, CAN_OPTIONS, CAN_FAULTS)
        self._traffic = self.given["traffic"]
        self._traffic_due = 0.0  # when the next of these frames is sent
        self._traffic_near = 0  # an identifier of the client, which they avoid
        self._timed = self.given["wire"] != "0"
        self._sent = 0
        self._host: list[Frame] = []
        self._device: list[Frame] = []  # in order of time
        self._flying: tuple[Frame, float, bool] | None = None  # the frame on the bus, its end, whether a client's
        self._free = 0.0  # when the bus is or was free
        self._arrived: list[Frame] = []
        self._previous: tuple[int, bytes] | None = None

    # -- time and frames ------------------------------------------------------------------------------------------

    def _begin(self, now: float) -> None:
        super()._begin(now)
        self._traffic_due = now

    def _pass(self, now: float) -> None:
        self.now = max(now, self.now)
        self._run(self.now)
        self.device.advance(self.now)
        self._collect()
        self._run(self.now)
        if self._plug.used:
            self._look()

    def send(self, can_id: int, data: bytes, extended: bool, remote: bool) -> None:
        if not self._begun:
            self.advance(0.0)
        if self.hung_up:
            return
        self._sent += 1
        self._traffic_near = can_id
        faults = self._hits(self._sent)  # of the bus: counted by frames, the device may never see one
        alone = "loopback" in faults
        self.bus_off = self.bus_off or "bus-off" in faults
        others = self.device.powered or self._traffic > 0
        self.acknowledged = not self.bus_off and (alone or (self._hears() and others and "no-ack" not in faults))
        if not self.acknowledged:
            self.unacknowledged += 1
            return
        now = self.now
        frame = Frame(now, can_id, bytes(data), extended, remote)
        heard = extended and not remote  # there is no way to hand over any other
        if alone and heard:
            self._arrived.append(frame)
        if not alone and len(self._host) < BACKLOG:
            frame.echo = heard and "echo" in faults
            self._host.append(frame)
            self._run(now)

    def take_frames(self) -> list[tuple[int, bytes]]:
        """(identifier, data) of the frames that have fully arrived at the client by now."""
        frames = []
        while self._arrived and not self.hung_up:
            frame = self._arrived.pop(0)
            if frame.hang:
                self.hung_up = True
                self._drop()
            else:
                frames.append((frame.identifier, frame.data))
        return frames

    def next_event(self) -> float | None:
        """The earliest time at which `take_frames` may return something or the device acts; None: nothing is due."""
        bus = None if self._flying is None else self._flying[1]
        if bus is None and (self._host or self._device):
            winner, bus, _ = self._winner()
            bus += self._duration(winner)
        return soonest(
            self.now if self._arrived else None,
            bus,
            self._traffic_due if self._traffic else None,
            self.device.next_event() if self.device.powered else None,
            self._plug.next_event(self.now) if self._plug.used else None,
        )

    def reconnect(self) -> None:
        super().reconnect()
        self.bus_off = False

    @property
    def deafened(self) -> bool:
        """Whether by its faults it acknowledges nothing just now."""
        return not self._hits(self._sent + 1).isdisjoint(("no-ack", "bus-off", "loopback"))

    # -- inside -----------------------------------------------------------------------------------------------------

    def _hears(self) -> bool:
        """Whether the client takes part in the bus: it has not given up and has the same bitrate."""
        return not self.bus_off and self.client_bitrate in (None, self.device.speed)

    def _send_traffic(self, now: float) -> None:
        """Frames of others that are due; after a long time that nobody looked only the last ones."""
        if not self._traffic:
            return
        self._traffic_due = max(self._traffic_due, now - BACKLOG / self._traffic)
        while self._traffic_due <= now + SOON:
            self._device.append(Frame(self._traffic_due, *self._foreign(self._traffic_near)))
            self._traffic_due += 1.0 / self._traffic
        self._device.sort(key=lambda frame: frame.ready)

    def _duration(self, frame: Frame) -> float:
        return frame.bits() / self.device.speed if self._timed and self.device.speed else 0.0

    def _winner(self) -> tuple[Frame, float, bool]:
        """The frame that gets the bus next, when, and whether it is the client's."""
        heads = [(queue[0], queue is self._host) for queue in (self._host, self._device) if queue]
        start = max(self._free, min(frame.ready for frame, _ in heads))
        frame, of_client = min(
            (head for head in heads if head[0].ready <= start + SOON), key=lambda head: head[0].rank()
        )
        return frame, start, of_client

    def _run(self, now: float) -> None:
        """Lets the frames of both sides take turns on the bus up to now."""
        self._send_traffic(now)
        while self._flying is not None or self._host or self._device:
            if self._flying is None:
                frame, start, of_client = self._winner()
                if start > now + SOON:
                    return
                del (self._host if of_client else self._device)[0]
                self._flying = frame, start + self._duration(frame), of_client
            frame, end, of_client = self._flying
            if end > now + SOON:
                return
            self._flying, self._free = None, end
            if frame.echo or (not of_client and self._hears()):
                self._arrived.append(frame)
            elif not of_client and not self.bus_off:
                self.bus_errors += 1  # at another bitrate a frame is a violation of bit stuffing
            # The device knows no other frames (wrist §2.3).
            if of_client and frame.extended and not frame.remote and self.device.powered:
                self.device.advance(max(self.device.now, end))
                self.device.feed(struct.pack(">I", frame.identifier) + frame.data)
                self._collect()

    def _collect(self) -> None:
        """Takes the replies of the device and lets them wait for the bus."""
        for reply in sorted(self.device.take(), key=lambda reply: reply.due):
            self._transmit(reply)
        self._persist()

    def _transmit(self, reply: Reply) -> None:
        """Applies the faults of the bus to one reply."""
        hits, message = reply.hits, self.device.twin(reply.data) if self.second else reply.data
        previous, self._previous = self._previous, _split(message)
        lost = "silent" in hits
        if "twin-id" in hits and self.device.twin(message) != message:
            self.bus_errors += 1
            lost = True
        if "wrong-id" in hits:
            message = self.device.readdress(message)
        identifier, data = _split(message)
        if "truncate" in hits and data:
            data = data[: self._random.between(0, len(data) - 1)]
        frames = [] if lost else [(identifier, data)] * (2 if "duplicate" in hits else 1)
        if "stale" in hits and previous is not None and not lost:
            frames.insert(0, previous)
        if "noise" in hits:
            frames = [*self._foreigners(identifier), *frames, *self._foreigners(identifier)]
        due = self._due(reply)
        queue = [Frame(due, *frame) for frame in frames]
        if "disconnect" in hits:
            queue = [Frame(due, identifier, b"")]
            queue[0].hang = True
        self._device += queue
        self._device.sort(key=lambda frame: frame.ready)

    def _foreigners(self, identifier: int) -> list[tuple[int, bytes]]:
        return [self._foreign(identifier) for _ in range(self._random.between(1, 3))]

    def _foreign(self, identifier: int) -> tuple[int, bytes]:
        """A frame of somebody else: the low bits differ from this identifier, the rest is the same in about half."""
        other = identifier ^ self._random.between(1, 16383)
        if self._random.between(0, 1):
            other ^= self._random.between(1, 32767) << 14
        return other, self._random.junk(self._random.between(0, 8), b"")

    def _drop(self) -> None:
        self._host.clear()
        self._device.clear()
        self._arrived.clear()
        self._flying = None
        self._free = 0.0


def _split(message: bytes) -> tuple[int, bytes]:
    identifier: int = struct.unpack_from(">I", message)[0]
    return identifier, message[4:]
