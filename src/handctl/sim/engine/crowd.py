"""Many clients at once on one simulated line: a place in front of each, one server loop for all.

A `Crowd` is to the server what a line and a port are: it passes the bytes of each client on by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Generic, Protocol, TypeVar

from handctl.sim.engine.can import Hub, Seat
from handctl.sim.engine.ports import Port, TcpDoor
from handctl.sim.engine.serve import UNREAD, Served, tell_hung_up
from handctl.sim.engine.slcan import Adapter

RETRY = 0.005  # s until a client that does not read is tried again

Client = TypeVar("Client", bound=Served)


class Place(Protocol[Client]):
    """Where clients of one sort come in."""

    def join(self) -> Client: ...

    def leave(self, client: Client, /) -> None: ...


class Whole(Place[Client], Protocol[Client]):
    """What the clients share."""

    @property
    def away(self) -> bool:
        """Whether the adapters of all clients are unplugged."""

    def reconnect(self) -> None:
        """They are back."""

    def advance(self, now: float) -> None: ...

    def power_cycle(self) -> None: ...

    def command(self, text: str) -> str: ...

    def close(self) -> None: ...


class Guest(Generic[Client]):
    """One client: what is served to it, and where it is."""

    def __init__(self, place: Place[Client], port: Port) -> None:
        self.place = place
        self.served = place.join()
        self.port = port
        self.unsent = bytearray()

    def give(self) -> bool:
        """Passes on what has come; False when it has gone."""
        taken = self.served.take()
        if len(self.unsent) + len(taken) <= UNREAD or not self.unsent:
            self.unsent += taken
        if self.unsent:
            del self.unsent[: self.port.write(bytes(self.unsent))]
        if not self.served.hung_up:
            return True
        self.port.hang_up()
        return False


class Crowd(Generic[Client]):
    """All clients of one line, as one line at one port."""

    def __init__(self, whole: Whole[Client]) -> None:
        self._whole = whole
        self._doors: list[tuple[TcpDoor, Place[Client]]] = []
        self._guests: list[Guest[Client]] = []
        self._now = 0.0
        self._away = False
        self.links: list[str] = []

    def at(self, port: Port, link: Callable[[str], str] = str, place: Place[Client] | None = None) -> None:
        """One more place, for one client; of what all share, or of one part of it."""
        self._guests.append(Guest(place or self._whole, port))
        self.links.append(link(port.link))

    def behind(self, door: TcpDoor, link: Callable[[str], str] = str, place: Place[Client] | None = None) -> None:
        """One more place, for any number of clients."""
        self._doors.append((door, place or self._whole))
        self.links.append(link(door.link))

    # -- as a line ------------------------------------------------------------------------------------------------

    @property
    def hung_up(self) -> bool:
        """Nobody is there, and nobody can come any more."""
        return not self._guests and not self._doors

    @property
    def client_baud(self) -> int | None:
        return None

    @client_baud.setter
    def client_baud(self, baud: int | None) -> None:
        """Each client has its own."""

    def advance(self, now: float) -> None:
        self._now = now
        self._whole.advance(now)
        for guest in self._guests:
            guest.served.advance(now)

    def feed(self, data: bytes) -> None:
        """It was fed when it was read."""

    def take(self) -> bytes:
        """Each client gets its own."""
        if self._whole.away != self._away:
            self.plug(self._away)
        if self._away:
            return b""
        gone = [guest for guest in self._guests if not guest.give()]
        if gone and len(gone) < len(self._guests) + len(self._doors):
            tell_hung_up()  # otherwise the server says so, and ends
        self._part(gone)
        return b""

    def next_event(self) -> float | None:
        times = [event for guest in self._guests if (event := guest.served.next_event()) is not None]
        if any(guest.unsent for guest in self._guests):
            times.append(self._now + RETRY)
        return min(times, default=None)

    def reconnect(self) -> None:
        """Each client that comes gets a line of its own."""

    def power_cycle(self) -> None:
        self._whole.power_cycle()

    def command(self, text: str) -> str:
        return self._whole.command(text)

    # -- as a port ------------------------------------------------------------------------------------------------

    @property
    def link(self) -> str:
        return self.links[0]

    def readers(self) -> list[int]:
        seated = [number for guest in self._guests for number in guest.port.readers()]
        doors = [number for door, _ in self._doors if (number := door.fileno()) >= 0 and not self._away]
        return [*doors, *seated]

    def read(self, ready: list[int]) -> bytes:
        """What came in, which is passed on already."""
        heard, gone = b"", []
        for guest in self._guests:
            places = guest.port.readers()
            data = guest.port.read([number for number in ready if number in places])
            if data is None:
                gone.append(guest)
            elif data:
                heard += data
                guest.served.feed(data)
        self._part(gone)
        for door, place in self._doors:
            if door.fileno() in ready and not self._away and (port := door.accept()) is not None:
                guest = Guest(place, port)
                guest.served.reconnect()
                guest.served.advance(self._now)
                self._guests.append(guest)
        return heard

    def write(self, data: bytes) -> int:
        return len(data)

    def writer(self) -> int | None:
        return None

    def baud(self) -> None:
        """Tells each client's line the speed of its port."""
        for guest in self._guests if not self._away else ():
            guest.served.client_baud = guest.port.baud()

    def plug(self, present: bool) -> None:
        """The adapters come, or go with all that is on its way; a TCP client has to connect again."""
        self._away = not present
        self._whole.reconnect()
        for guest in self._guests:
            guest.port.plug(present)
            guest.served.reconnect()
            guest.unsent.clear()

    def hang_up(self) -> bool:
        return True

    def close(self) -> None:
        for guest in self._guests:
            guest.port.close()
        for door, _ in self._doors:
            door.close()
        self._whole.close()

    def _part(self, gone: list[Guest[Client]]) -> None:
        """Forgets clients that have left; a pseudo terminal that hung up is gone for good."""
        for guest in gone:
            guest.port.close()
            guest.place.leave(guest.served)
            self._guests.remove(guest)


class Adapters:
    """A bus of which each client has an slcan adapter of its own, all with the same faults."""

    def __init__(self, hub: Hub, faults: Iterable[str] = ()) -> None:
        self.hub = hub
        self._front = Adapter(Seat(hub), faults)  # at no bus: it takes the commands for all
        self._seats: dict[Adapter, Seat] = {}

    def join(self) -> Adapter:
        seat = self.hub.join()
        adapter = Adapter(seat, self._front.faults)
        self._seats[adapter] = seat
        return adapter

    def leave(self, adapter: Adapter) -> None:
        self.hub.leave(self._seats.pop(adapter))

    @property
    def away(self) -> bool:
        return self.hub.away

    def reconnect(self) -> None:
        self.hub.reconnect()

    def advance(self, now: float) -> None:
        self.hub.advance(now)

    def power_cycle(self) -> None:
        self.hub.power_cycle()

    def command(self, text: str) -> str:
        answer = self._front.command(text)
        for adapter in self._seats:
            adapter.faults = self._front.faults
        return answer

    def close(self) -> None:
        self.hub.close()
