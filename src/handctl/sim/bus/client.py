"""A client of a simulated bus, behind its adapter: what it writes reaches the wire later, what it reads comes later.

    client -> half of the latency -> wire                 in packets; speed changes take the same way, in order
    wire -> first byte swallowed, timer, packets -> half of the latency -> client

Towards a server, and the in-process link, it behaves as a `Line`.
"""

from __future__ import annotations

from collections import deque

from handctl.sim.bus.pair import EDGE, Ear, Pair

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Protocol

    from handctl.sim.bus.file import Plan
    from handctl.sim.engine.model import Random

    class Bus(Protocol):
        """The bus that it is a client of."""

        plan: Plan
        random: Random
        now: float | None
        down: Pair
        up: Pair

        @property
        def away(self) -> bool: ...

        def advance(self, now: float) -> None: ...

        def next_event(self, client: Client) -> float | None: ...

        def leave(self, client: Client) -> None: ...

        def command(self, text: str) -> str: ...

        def power_cycle(self) -> None: ...

        def close(self) -> None: ...


PAUSE = 0.005  # s; what comes without such a pause between shares one random delay
BACKLOG = 65536  # bytes on their way to the wire that are kept


class Client:
    """One end of the bus that takes and gives bytes."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.hung_up = self.pulled = False  # its adapter was unplugged, and nobody has opened it since
        self._baud: int | None = None
        self._speed: int | None = None  # at which its adapter sends; None: that of whoever listens
        self.ear = Ear(bus.up, self, None, bus.plan.echo)
        self._forth: deque[tuple[float, bytes | None, int | None]] = deque()  # when it is at the wire, bytes or speed
        self._back: deque[tuple[float, bytes]] = deque()  # when it is at the client
        self._used = False
        self._swallow = False
        self._chunk = bytearray()  # what the adapter holds back for the client
        self._chunk_due = 0.0
        self._heard_last = -1.0e300
        self._delay = 0.0

    @property
    def _now(self) -> float:
        return self.bus.now or 0.0

    # -- as a line ------------------------------------------------------------------------------------------------

    @property
    def client_baud(self) -> int | None:
        """The speed that the client has set; None: it has none, as on TCP."""
        return self._baud

    @client_baud.setter
    def client_baud(self, baud: int | None) -> None:
        if baud == self._baud:
            return
        self._baud = baud
        speed = None if self.bus.plan.speed_ignored else baud
        if self._used:
            self._forth.append((self._way(self._forth), None, speed))
            self.send(self._now)
        else:
            self._speed = self.ear.speed = speed

    @property
    def away(self) -> bool:
        """Whether its adapter is unplugged."""
        return self.bus.away

    def look(self) -> None:
        """With the adapter goes what was on its way."""
        if self.away and not self.pulled:
            self.reconnect()
            self.hung_up = self.pulled = True

    def advance(self, now: float) -> None:
        self.bus.advance(now)
        self.look()

    def feed(self, data: bytes) -> None:
        """Bytes that the client writes at the present time."""
        if self.bus.now is None:
            self.bus.advance(0.0)
        if self.pulled:
            return
        self._used = True
        size = self.bus.plan.packet or len(data)
        if sum(len(part or b"") for _, part, _ in self._forth) + len(data) <= BACKLOG:
            for place in range(0, len(data), size):
                self._forth.append((self._way(self._forth), bytes(data[place : place + size]), None))
        self.send(self._now + EDGE)

    def take(self) -> bytes:
        """What the client may read by now."""
        self._flush(self._now)
        out = bytearray()
        while self._back and self._back[0][0] <= self._now + EDGE:
            out += self._back.popleft()[1]
        return bytes(out)

    def next_event(self) -> float | None:
        return self.bus.next_event(self)

    def reconnect(self) -> None:
        """A new client: what was on its way is lost, the devices go on."""
        self._forth.clear()
        self._back.clear()
        self._chunk.clear()
        self._used = self._swallow = self.hung_up = self.pulled = False

    def power_cycle(self) -> None:
        self.bus.power_cycle()

    def command(self, text: str) -> str:
        return self.bus.command(text)

    def close(self) -> None:
        self.bus.close()

    # -- towards the bus ---------------------------------------------------------------------------------------------

    def due(self) -> float | None:
        """When something that it sent reaches the wire."""
        return self._forth[0][0] if self._forth else None

    def arrival(self) -> float | None:
        """When something reaches the client."""
        if self._back:
            return self._back[0][0]
        return self._chunk_due if self._chunk else None

    def send(self, until: float) -> None:
        """Puts on the wire what has reached it."""
        while self._forth and self._forth[0][0] <= until:
            when, data, speed = self._forth.popleft()
            if data is None:
                self._speed = self.ear.speed = speed
            elif self._speed is None or self._speed > 0:
                baud = self._speed or self.bus.plan.baud
                self.bus.down.put(self, max(when, self._now), baud, data, self._speed is None)
                self._swallow = self.bus.plan.first_byte_lost

    def heard(self, byte: int, now: float) -> None:
        """One byte from the wire."""
        if self.pulled:
            return
        plan = self.bus.plan
        if now - self._heard_last > PAUSE:
            self._delay = self._half()
        self._heard_last = now
        if self._swallow:
            self._swallow = False
            return
        self._flush(now)
        if not self._chunk:
            self._chunk_due = now + plan.coalesce
        self._chunk.append(byte)
        if len(self._chunk) == plan.packet:
            self._chunk_due = now
        self._flush(now)

    # -- inside -----------------------------------------------------------------------------------------------------

    def _half(self) -> float:
        """Seconds of one way: half of the latency, and of its spread by chance."""
        plan = self.bus.plan
        if not plan.spread:
            return plan.latency / 2
        return plan.latency / 2 + plan.spread / 2 * self.bus.random.between(0, 1000) / 1000

    def _way(self, queue: deque[tuple[float, bytes | None, int | None]]) -> float:
        """When something that starts now is at the wire; nothing overtakes."""
        return max(self._now + self._half(), queue[-1][0] if queue else 0.0)

    def _flush(self, now: float) -> None:
        """Gives what was held back long enough to the way to the client."""
        if self._chunk and self._chunk_due <= now + EDGE:
            when = self._chunk_due + self._delay
            self._back.append((max(when, self._back[-1][0] if self._back else when), bytes(self._chunk)))
            self._chunk.clear()
