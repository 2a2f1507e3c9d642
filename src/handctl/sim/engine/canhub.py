"""Several CAN controllers of clients on one simulated bus: each hears the devices and all the others.

A `Seat` behaves as a `CanLine` towards an adapter. Behind the hub is a `CanLine`, or the CAN bus of a file, that knows of one
client only.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Protocol

    class Frames(Protocol):
        """The bus behind a hub."""

        client_bitrate: int | None
        acknowledged: bool
        bus_errors: int
        bus_off: bool

        @property
        def hung_up(self) -> bool: ...

        @property
        def device(self) -> Speed: ...

        @property
        def deafened(self) -> bool: ...

        def advance(self, now: float) -> None: ...

        def feed_frame(self, can_id: int, data: bytes, extended: bool = True, remote: bool = False) -> None: ...

        def take_frames(self) -> list[tuple[int, bytes]]: ...

        def next_event(self) -> float | None: ...

        def reconnect(self) -> None: ...

        def power_cycle(self) -> None: ...

        def command(self, text: str) -> str: ...

        def close(self) -> None: ...

    class Speed(Protocol):
        @property
        def speed(self) -> int | None: ...


class Hub:
    """The bus with the seats of its clients."""

    def __init__(self, line: Frames) -> None:
        self.line = line
        self.seats: list[Seat] = []
        self.asked: Seat | None = None  # who sent last

    def join(self) -> Seat:
        self.seats.append(Seat(self))
        return self.seats[-1]

    def leave(self, seat: Seat) -> None:
        if seat in self.seats:
            self.seats.remove(seat)

    def advance(self, now: float) -> None:
        self.line.advance(now)
        self.collect()

    def next_event(self) -> float | None:
        return self.line.next_event()

    @property
    def away(self) -> bool:
        """Whether all adapters are unplugged, as those of a bus of a file can be."""
        return bool(getattr(self.line, "away", False))

    def reconnect(self) -> None:
        """The adapters are back."""
        self.line.reconnect()

    def power_cycle(self) -> None:
        self.line.power_cycle()

    def command(self, text: str) -> str:
        return self.line.command(text)

    def close(self) -> None:
        self.line.close()

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
        if line.hung_up and not self.away:  # the adapter of who asked goes away
            line.reconnect()
            if self.asked is not None:
                self.asked.hung_up = True


class Seat:
    """One client's controller on the bus."""

    def __init__(self, hub: Hub) -> None:
        self.hub = hub
        self.client_bitrate: int | None = None  # None: taken for the right one
        self.acknowledged = True
        self.bus_errors = 0
        self.bus_off = False
        self.hung_up = False
        self.taking_part = False  # whether it acknowledges what others send
        self.arrived: list[tuple[int, bytes]] = []

    @property
    def device(self) -> Speed:
        return self.hub.line.device

    def hears(self) -> bool:
        return not self.bus_off and self.client_bitrate in (None, self.device.speed)

    def advance(self, now: float) -> None:
        self.hub.advance(now)

    def feed_frame(self, can_id: int, data: bytes, extended: bool = True, remote: bool = False) -> None:
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

    def power_cycle(self) -> None:
        self.hub.power_cycle()

    def command(self, text: str) -> str:
        return self.hub.command(text)

    def close(self) -> None:
        self.hub.close()
