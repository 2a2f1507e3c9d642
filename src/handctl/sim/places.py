"""Serves one simulated device at the places that a command line names: a pty, a TCP port, an slcan adapter, Modbus TCP.

What is wrong with its options is a ValueError before anything is served. What is served is a function of how long, and where
its control socket is; it raises ServeError, or OSError for a state file.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from handctl.sim import create

Serve = Callable[[float | None, str | None], None]


@dataclass(frozen=True)
class Places:
    """Where to serve. With `sockets` a TCP port that carries bytes is a socket://, because tcp:// is Modbus TCP."""

    pty: bool
    tcp: tuple[str, int] | None
    slcan_pty: bool
    slcan_tcp: tuple[str, int] | None
    modbus_tcp: tuple[str, int] | None
    name: str | None  # of the link to the pty
    sockets: bool

    @property
    def bus(self) -> str:
        """The wire that is served there beside Modbus TCP, "" = none."""
        return "can" if self.slcan_pty or self.slcan_tcp else "serial" if self.pty or self.tcp else ""

    def link(self, link: str) -> str:
        """What a client passes to --port."""
        from handctl.sim.engine import slcan

        if self.bus == "can":
            return slcan.link(link)
        return link.replace("tcp://", "socket://") if self.sockets else link


def one(kind: str, raw: dict[str, str], places: Places) -> Serve:
    """One wire of the device."""
    from handctl.sim.engine import slcan
    from handctl.sim.engine.can import Hub
    from handctl.sim.engine.ports import PtyPort, TcpDoor
    from handctl.sim.engine.serve import Alone, Server

    on_can = places.bus == "can"
    adapter = _adapter(raw) if on_can else []
    line: Any = create(kind, raw)  # a Line or a CanLine
    place = places.slcan_tcp if on_can else places.tcp

    def run(duration: float | None, control: str | None) -> None:
        if place is None:
            whole: Any = Alone(slcan.Adapter(line, adapter) if on_can else line)
            server = Server(whole).at(PtyPort(None if on_can else line.device.speed, places.name), places.link)
        else:
            whole = slcan.Adapters(Hub(line), adapter) if on_can else Alone(line)
            server = Server(whole).behind(TcpDoor(*place), places.link)
        server.run(duration, control)

    return run


def wires(kind: str, raw: dict[str, str], places: Places) -> Serve:
    """Modbus TCP for any number of clients, and beside it at most one other wire of the same device."""
    from handctl.sim.engine import slcan
    from handctl.sim.engine.can import Hub
    from handctl.sim.engine.ports import PtyPort, TcpDoor
    from handctl.sim.engine.serve import Alone, Server
    from handctl.sim.engine.wires import Each, Wires

    adapter = _adapter(raw) if places.bus == "can" else []
    whole = Wires(kind, raw, ["modbus-tcp", *([places.bus] if places.bus else [])])
    line: Any = whole.lines[-1]

    def run(duration: float | None, control: str | None) -> None:
        server = Server(whole)
        if places.modbus_tcp is not None:
            door = TcpDoor(*places.modbus_tcp)
            server.behind(door, place=Each(whole, "modbus-tcp"))
            whole.door = door if door.host == whole.lines[0].device.host else None
        place: Any = slcan.Adapters(Hub(line), adapter) if places.bus == "can" else Alone(line)
        if places.pty or places.slcan_pty:
            server.at(PtyPort(line.device.speed if places.pty else None, places.name), places.link, place)
        elif (where := places.tcp or places.slcan_tcp) is not None:
            server.behind(TcpDoor(*where), places.link, place)
        server.run(duration, control)

    return run


def _adapter(raw: dict[str, str]) -> list[str]:
    """Takes the faults of an slcan adapter out of the options."""
    from handctl.sim.engine import slcan

    if "fault" not in raw:
        return []
    adapter, raw["fault"] = slcan.split_faults(raw["fault"])
    if not raw["fault"]:
        del raw["fault"]
    return adapter
