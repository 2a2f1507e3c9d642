"""Simulated devices and other masters on one CAN bus.

Every device stands behind a `CanLine` of its own without bus time, with its options and faults; here frames take turns by
their rank. Who sends the same identifier at the same time with the same data sends one frame; with other data both are
destroyed. A device at another bitrate hears and acknowledges nothing. For a client it behaves as a `CanLine`.
"""

from __future__ import annotations

from handctl.sim.bus.bus_file import BUS_FAULTS, Plan
from handctl.sim.bus.simulated_bus import IDLE, SOON, Master, SimulatedBus
from handctl.sim.engine.can_line import BACKLOG, CanLine, Controller, Frame
from handctl.sim.engine.simulated_device import soonest

Sender = CanLine | Master | None  # None: the client


class CanBus(Controller, SimulatedBus[CanLine]):
    """The bus as a client's CAN controller sees it: takes and gives frames."""

    deafened = False

    def __init__(self, plan: Plan) -> None:
        """Raises ValueError for options that a device does not know."""
        super().__init__(plan, CanLine)
        self.faults = plan.faults
        self.hung_up = self.pulled = False  # the adapter was unplugged, and nobody has opened it since
        self.speed = plan.baud
        self._waiting: list[tuple[Frame, Sender]] = []
        self._flying: list[tuple[Frame, Sender]] = []  # who sends now; several when they cannot tell each other
        self._end = 0.0  # of what flies
        self._free = 0.0  # when the bus is or was free
        self._arrived: list[tuple[float, int, bytes]] = []
        self._wakes: dict[CanLine, float] = {}

    @property
    def device(self) -> CanBus:
        """For an adapter, which asks for the speed of what is behind it."""
        return self

    # -- time and frames ------------------------------------------------------------------------------------------

    def _settle(self, now: float) -> None:
        for line in self.lines:
            self._act(line, now)
        self._look()

    def send(self, can_id: int, data: bytes, extended: bool, remote: bool) -> None:
        if not self.begun:
            self.advance(0.0)
        if self.pulled:
            return
        self.bus_off = self.bus_off or "bus-off" in self.faults
        heard = self.client_bitrate in (None, self.speed) and not self.bus_off and "no-ack" not in self.faults
        parts = [line for line in self.lines if not self._out(line) and line.device.powered and not line.deafened]
        self.acknowledged = heard and (any(line.device.speed == self.speed for line in parts) or bool(self.masters))
        if not self.acknowledged:
            self.unacknowledged += 1
        elif sum(sender is None for _, sender in self._waiting) < BACKLOG:
            frame = Frame(self.now + self.half(), can_id, bytes(data), extended, remote)
            frame.echo = self.plan.echo and extended and not remote
            self._waiting.append((frame, None))

    def take_frames(self) -> list[tuple[int, bytes]]:
        """(identifier, data) of the frames that have fully arrived at the client by now."""
        count = sum(when <= self.now + SOON for when, _, _ in self._arrived)
        frames = [(identifier, data) for _, identifier, data in self._arrived[:count]]
        del self._arrived[:count]
        return frames

    def next_event(self) -> float | None:
        """The earliest time at which `take_frames` may return something or something happens; None: nothing is due."""
        return soonest(self._next(), *(when for when, _, _ in self._arrived[:1]))

    def reconnect(self) -> None:
        """A new client: what was on its way is lost, the devices go on."""
        self._arrived.clear()
        self._waiting = [(frame, sender) for frame, sender in self._waiting if sender is not None]
        self.bus_off = self.hung_up = self.pulled = False

    def command(self, text: str) -> str:
        answer = super().command(text)
        self._look()
        return answer

    def fault(self, names: str) -> str:
        """Those of the bus are its own, the others those of all devices."""
        given = [name.strip() for name in names.split(",")]
        answer = super().fault(",".join(name for name in given if name not in BUS_FAULTS) or "none")
        self.faults = frozenset(given).intersection(BUS_FAULTS)
        return names if self.faults else answer

    # -- inside -----------------------------------------------------------------------------------------------------

    def _look(self) -> None:
        """With the adapter goes what was on its way."""
        if self.away and not self.pulled:
            self.reconnect()
            self.hung_up = self.pulled = True

    def _out(self, line: CanLine) -> bool:
        """Whether the device is not on the bus."""
        return self.plugs[self.lines.index(line)].out(self.now)

    def _next(self) -> float | None:
        turn = self._end if self._flying else None
        if not self._flying and self._waiting:
            turn = max(self._free, min(frame.ready for frame, _ in self._waiting))
        return soonest(turn, *(master.due for master in self.masters), *self._wakes.values(), self.pulls())

    def _happen(self, now: float) -> None:
        """What is due at this moment: a frame ends, questions and answers come, the next frame begins."""
        if self._flying and self._end <= now + SOON:
            self._finish(now)
        for master in self.masters:
            if master.due <= now + SOON:
                self._waiting.append((Frame(master.due, master.identifier, master.data), master))
                master.asked()
        for line in [line for line, wake in self._wakes.items() if wake <= now + SOON]:
            self._act(line, now)
        if not self._flying:
            self._begin(now)
        self._look()

    def _act(self, line: CanLine, now: float) -> None:
        """Lets the device do what it does by itself; its frames wait for the bus."""
        line.advance(now)
        for identifier, data in line.take_frames():
            if line.device.speed == self.speed and not self._out(line):
                self._waiting.append((Frame(now, identifier, data), line))
        if line.hung_up:
            line.reconnect()
        wake = line.next_event()
        self._wakes.pop(line, None)
        if wake is not None:
            self._wakes[line] = wake if wake > now else now + IDLE

    def _begin(self, now: float) -> None:
        """The lowest identifier wins the bus, of each sender its first frame."""
        heads: dict[Sender, Frame] = {}
        for frame, sender in self._waiting:
            if frame.ready <= now + SOON:
                heads.setdefault(sender, frame)
        if not heads or self._free > now + SOON:
            return
        best = min(frame.rank() for frame in heads.values())
        self._flying = [(frame, sender) for sender, frame in heads.items() if frame.rank() == best]
        self._waiting = [pair for pair in self._waiting if pair not in self._flying]
        self._end = self._free = now + max(frame.bits() for frame, _ in self._flying) / self.speed

    def _finish(self, now: float) -> None:
        """A frame is over: everybody else has it, unless others sent another one with the same identifier."""
        flown, self._flying = self._flying, []
        frame, senders = flown[0][0], [sender for _, sender in flown]
        destroyed = "bus-errors" in self.faults and None not in senders
        if destroyed or any(other.data != frame.data for other, _ in flown):
            self.bus_errors += 1
            return
        hears = self.client_bitrate in (None, self.speed) and not self.bus_off
        if hears and (None not in senders or frame.echo) and frame.extended and not frame.remote:
            when = now + self.half()
            self._arrived.append(
                (max(when, self._arrived[-1][0] if self._arrived else when), frame.identifier, frame.data)
            )
        for line in self.lines:
            if line not in senders and line.device.speed == self.speed and not self._out(line):
                line.advance(now)
                line.feed_frame(frame.identifier, frame.data, frame.extended, frame.remote)
                self._act(line, now)

    def _switched(self, on: bool) -> None:
        if not on:
            self._waiting = [pair for pair in self._waiting if pair[1] not in self.lines]

    def _changed(self) -> None:
        for line in self.lines:
            self._act(line, self.now)
