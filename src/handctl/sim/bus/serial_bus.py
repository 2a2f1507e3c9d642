"""Simulated devices, clients and other masters on the wires of RS-232 or RS-485.

    two wires (half duplex)   everybody drives the same pair and hears everybody but himself
    otherwise                 clients and masters drive one pair, devices hear it; devices drive the other, clients hear it

Every device stands behind a `Line` of its own without wire time, with its options and faults; here its answers take their
place on the wire. Bytes always take their time. Nothing sleeps: `advance(now)` lets happen what happens until then.
"""

from __future__ import annotations

from collections import deque
from typing import Any

from handctl.sim.bus.bus_file import Plan
from handctl.sim.bus.simulated_bus import IDLE, SimulatedBus
from handctl.sim.bus.wire_pair import EDGE, Pair, Receiver
from handctl.sim.engine.line_and_faults import TICK, Line
from handctl.sim.engine.simulated_device import soonest

PAUSE = 0.005  # s; what comes without such a pause between shares one random delay
BACKLOG = 65536  # bytes on their way to the wire that are kept


class Client:
    """One end of the bus that takes and gives bytes, behind its adapter. Towards a server, and the in-process link, a `Line`.

    client -> half of the latency -> wire                 in packets; speed changes take the same way, in order
    wire -> first byte swallowed, timer, packets -> half of the latency -> client
    """

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.hung_up = self.pulled = False  # its adapter was unplugged, and nobody has opened it since
        self._baud: int | None = None
        self._speed: int | None = None  # at which its adapter sends; None: that of whoever listens
        self.receiver = Receiver(bus.up, self, None, bus.plan.echo)
        self.forth: deque[tuple[float, bytes | None, int | None]] = deque()  # when it is at the wire, bytes or speed
        self._back: deque[tuple[float, bytes]] = deque()  # when it is at the client
        self._used = False
        self._swallow = False
        self._chunk = bytearray()  # what the adapter holds back for the client
        self._chunk_due = 0.0
        self._heard_last = -1.0e300
        self._delay = 0.0

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
            self.forth.append((self._way(self.forth), None, speed))
            self.send(self.bus.now)
        else:
            self._tune(speed)

    def look(self) -> None:
        """With the adapter goes what was on its way."""
        if self.bus.away and not self.pulled:
            self.reconnect()
            self.hung_up = self.pulled = True

    def advance(self, now: float) -> None:
        self.bus.advance(now)
        if self.bus.adapters.used:
            self.look()

    def feed(self, data: bytes) -> None:
        """Bytes that the client writes at the present time."""
        if not self.bus.begun:
            self.bus.advance(0.0)
        if self.pulled:
            return
        self._used = True
        size = self.bus.plan.packet or len(data)
        if sum(len(part or b"") for _, part, _ in self.forth) + len(data) <= BACKLOG:
            for place in range(0, len(data), size):
                self.forth.append((self._way(self.forth), bytes(data[place : place + size]), None))
        self.send(self.bus.now + EDGE)

    def take(self) -> bytes:
        """What the client may read by now."""
        self._flush(self.bus.now)
        out = bytearray()
        while self._back and self._back[0][0] <= self.bus.now + EDGE:
            out += self._back.popleft()[1]
        return bytes(out)

    def next_event(self) -> float | None:
        return self.bus.next_event(self)

    def reconnect(self) -> None:
        """A new client: what was on its way is lost, the devices go on."""
        self.forth.clear()
        self._back.clear()
        self._chunk.clear()
        self._used = self._swallow = self.hung_up = self.pulled = False

    def __getattr__(self, name: str) -> Any:
        """What concerns the bus itself."""
        return getattr(self.bus, name)

    # -- towards the bus ---------------------------------------------------------------------------------------------

    def arrival(self) -> float | None:
        """When something reaches the client."""
        if self._back:
            return self._back[0][0]
        return self._chunk_due if self._chunk else None

    def send(self, until: float) -> None:
        """Puts on the wire what has reached it."""
        while self.forth and self.forth[0][0] <= until:
            when, data, speed = self.forth.popleft()
            if data is None:
                self._tune(speed)
            elif self._speed is None or self._speed > 0:
                baud = self._speed or self.bus.plan.baud
                self.bus.down.put(self, max(when, self.bus.now), baud, data, self._speed is None)
                self._swallow = self.bus.plan.first_byte_lost

    def heard(self, byte: int, now: float) -> None:
        """One byte from the wire."""
        if self.pulled:
            return
        plan = self.bus.plan
        if now - self._heard_last > PAUSE:
            self._delay = self.bus.half()
        self._heard_last = now
        if self._swallow:
            self._swallow = False
            return
        if self._chunk:
            self._flush(now)
        if not self._chunk:
            self._chunk_due = now + plan.coalesce
        self._chunk.append(byte)
        if len(self._chunk) == plan.packet:
            self._chunk_due = now
        self._flush(now)

    # -- inside -----------------------------------------------------------------------------------------------------

    def _tune(self, speed: int | None) -> None:
        self._speed = speed
        if self.receiver.speed != speed:
            self.receiver.tune(speed)

    def _way(self, queue: deque[tuple[float, bytes | None, int | None]]) -> float:
        """When something that starts now is at the wire; nothing overtakes."""
        return max(self.bus.now + self.bus.half(), queue[-1][0] if queue else 0.0)

    def _flush(self, now: float) -> None:
        """Gives what was held back long enough to the way to the client."""
        if self._chunk and self._chunk_due <= now + EDGE:
            when = self._chunk_due + self._delay
            self._back.append((max(when, self._back[-1][0] if self._back else when), bytes(self._chunk)))
            self._chunk.clear()


class Station:
    """A device with its transceiver."""

    def __init__(self, line: Line, bus: Bus) -> None:
        self.line = line
        self.receiver = Receiver(bus.down, self, line.device.speed)
        self.bus = bus
        self.plug = bus.plugs[len(bus.stations)]
        self.pulled = False
        self.wake: float | None = None

    def heard(self, byte: int, now: float) -> None:
        self.line.advance(now)
        if not (self.plug.used and self.plug.out(now)):
            self.line.feed(bytes((byte,)))
        self.speak(now)

    def act(self, now: float) -> None:
        self.line.advance(now)
        self.speak(now)

    def speak(self, now: float) -> None:
        """Puts what it has to say on the wire, and looks when it acts by itself next."""
        line = self.line
        speed = line.device.speed or self.bus.plan.baud
        data = line.take()
        if self.plug.used:
            if (out := self.plug.out(now)) and not self.pulled:
                self.bus.up.cut(self, now)
            self.pulled = out
        if data and not self.pulled:
            self.bus.up.put(self, now, speed, data)
        if line.hung_up:
            line.reconnect()  # its cable was pulled in the middle; the bus is still there
        if self.receiver.speed != line.device.speed:
            self.receiver.tune(line.device.speed)
        wake = line.next_event()
        self.wake = wake if wake is None or wake > now else now + IDLE


class Bus(SimulatedBus[Line]):
    """The wires with all that is on them. Clients join and leave."""

    def __init__(self, plan: Plan) -> None:
        """Raises ValueError for options that a device does not know."""
        super().__init__(plan, Line)
        self.down = Pair()
        self.up = self.down if plan.half_duplex else Pair()
        self.clients: list[Client] = []
        self.stations: list[Station] = []
        for line in self.lines:
            self.stations.append(Station(line, self))
        self._ears: list[Station | Client] = [*self.stations]  # and the clients
        self._coming: list[tuple[Station | Client, tuple[float, int, float, float]]] = []  # the next byte of each

    def join(self) -> Client:
        """One more client."""
        client = Client(self)
        self.clients.append(client)
        self._ears.append(client)
        return client

    def reconnect(self) -> None:
        """The adapters are back: each client opens its own."""

    def leave(self, client: Client) -> None:
        if client in self.clients:
            self.clients.remove(client)
            self._ears.remove(client)

    # -- time -------------------------------------------------------------------------------------------------------------

    def _settle(self, now: float) -> None:
        for station in self.stations:
            station.act(now)
        for pair in (self.down, self.up):
            pair.forget(now)

    def next_event(self, client: Client) -> float | None:
        """When something may happen that this client notices; bytes on the wire in pieces of 2 ms."""
        bytes_due = [byte for ear in self._ears if (byte := ear.receiver.next()) is not None]
        pieces = [max(byte[0], min(byte[3], self.now + TICK)) for byte in bytes_due]
        return soonest(client.arrival(), self._acts(), *pieces)

    def _acts(self) -> float | None:
        """When devices, masters and what clients sent act next."""
        first = self.pulls()
        for station in self.stations:
            if (wake := station.wake) is not None and (first is None or wake < first):
                first = wake
        for master in self.masters:
            if first is None or master.due < first:
                first = master.due
        for client in self.clients:
            if client.forth and (first is None or client.forth[0][0] < first):
                first = client.forth[0][0]
        return first

    def _next(self) -> float | None:
        first = self._acts()
        self._coming.clear()
        for ear in self._ears:
            if (byte := ear.receiver.next()) is not None:
                self._coming.append((ear, byte))
                if first is None or byte[0] < first:
                    first = byte[0]
        return first

    def _happen(self, now: float) -> None:
        """What bytes end comes before what begins."""
        until = now + EDGE
        heard = [(ear, byte[1]) for ear, byte in self._coming if byte[0] <= until]
        for ear, _ in heard:
            ear.receiver.take()
        for ear, value in heard:
            ear.heard(value, now)
        for client in self.clients:
            if client.forth:
                client.send(until)
        for master in self.masters:
            if master.due <= until:
                self.down.put(master, now, self.plan.baud, master.data)
                master.asked()
        for station in self.stations:
            if station.wake is not None and station.wake <= until:
                station.act(now)
        if self.adapters.used:
            for client in self.clients:
                client.look()

    # -- power and control ----------------------------------------------------------------------------------------------

    def _switched(self, on: bool) -> None:
        for station in self.stations:
            if not on:
                self.up.cut(station, self.now)
                station.receiver.silence(self.now)

    def _changed(self) -> None:
        for station in self.stations:
            station.speak(self.now)
