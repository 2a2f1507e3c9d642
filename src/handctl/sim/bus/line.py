"""Simulated devices, clients and other masters on the wires of RS-232 or RS-485.

    two wires (half duplex)   everybody drives the same pair and hears everybody but himself
    otherwise                 clients and masters drive one pair, devices hear it; devices drive the other, clients hear it

Every device stands behind a `Line` of its own without wire time, with its options and faults; here its answers take their
place on the wire. Bytes always take their time. Nothing sleeps: `advance(now)` lets happen what happens until then.
"""

from __future__ import annotations

from handctl.sim.bus.client import Client
from handctl.sim.bus.file import Plan
from handctl.sim.bus.pair import EDGE, Ear, Pair
from handctl.sim.bus.rack import IDLE, Rack
from handctl.sim.engine.line import TICK, Line


class Station:
    """A device with its transceiver."""

    def __init__(self, line: Line, bus: Bus) -> None:
        self.line = line
        self.ear = Ear(bus.down, self, line.device.speed)
        self.bus = bus
        self.plug = bus.plugs[len(bus.stations)]
        self.pulled = False
        self.wake: float | None = None

    def heard(self, byte: int, now: float) -> None:
        self.line.advance(now)
        if not self.plug.out(now):
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
        if (out := self.plug.out(now)) and not self.pulled:
            self.bus.up.cut(self, now)
        self.pulled = out
        if data and not out:
            self.bus.up.put(self, now, speed, data)
        if line.hung_up:
            line.reconnect()  # its cable was pulled in the middle; the bus is still there
        self.ear.speed = line.device.speed
        wake = line.next_event()
        self.wake = wake if wake is None or wake > now else now + IDLE


class Bus(Rack[Line]):
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

    def join(self) -> Client:
        """One more client."""
        client = Client(self)
        self.clients.append(client)
        return client

    def reconnect(self) -> None:
        """The adapters are back: each client opens its own."""

    def leave(self, client: Client) -> None:
        if client in self.clients:
            self.clients.remove(client)

    # -- time -------------------------------------------------------------------------------------------------------------

    def advance(self, now: float) -> None:
        """Moves time on; the first call is the moment of power-on. A time before the last one is taken as the last."""
        if self.now is None:
            self.now = now
            self.begin(now)
        for master in self.masters:
            master.wait(now)
        while (event := self._first()) is not None and event <= now + EDGE:
            self.now = max(event, self.now)
            self._happen(self.now)
        self.now = max(now, self.now)
        for station in self.stations:
            station.act(self.now)
        for pair in (self.down, self.up):
            pair.forget(self.now)

    def next_event(self, client: Client) -> float | None:
        """When something may happen that this client notices; bytes on the wire in pieces of 2 ms."""
        times = [] if (arrival := client.arrival()) is None else [arrival]
        bytes_due = (byte for ear in self._ears() if (byte := ear.next()) is not None)
        times += [max(byte[0], min(byte[3], (self.now or 0.0) + TICK)) for byte in bytes_due]
        times += self._acts()
        return min(times, default=None)

    def _ears(self) -> list[Ear]:
        return [*(station.ear for station in self.stations), *(client.ear for client in self.clients)]

    def _acts(self) -> list[float]:
        """When devices, masters and what clients sent act next."""
        times = [master.due for master in self.masters]
        times += [station.wake for station in self.stations if station.wake is not None]
        times += [due for client in self.clients if (due := client.due()) is not None]
        return times + self.pulls()

    def _first(self) -> float | None:
        times = self._acts()
        times += [byte[0] for ear in self._ears() if (byte := ear.next()) is not None]
        return min(times, default=None)

    def _happen(self, now: float) -> None:
        """Everything that is due at this moment; what bytes end comes before what begins."""
        until = now + EDGE
        heard: list[tuple[Station | Client, int]] = []
        listeners: list[Station | Client] = [*self.stations, *self.clients]
        for owner in listeners:
            if (byte := owner.ear.next()) is not None and byte[0] <= until:
                owner.ear.take()
                heard.append((owner, byte[1]))
        for listener, value in heard:
            listener.heard(value, now)
        for client in self.clients:
            client.send(until)
        for master in self.masters:
            if master.due <= until:
                self.down.put(master, now, self.plan.baud, master.data)
                master.asked()
        for station in self.stations:
            if station.wake is not None and station.wake <= until:
                station.act(now)
        for client in self.clients:
            client.look()

    # -- power and control ----------------------------------------------------------------------------------------------

    def _switched(self, on: bool) -> None:
        for station in self.stations:
            if not on:
                self.up.cut(station, self._present())
                station.ear.silence(self._present())

    def _changed(self) -> None:
        for station in self.stations:
            station.speak(self._present())
