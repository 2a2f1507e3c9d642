"""Several simulated devices, clients and other masters on one line, from a FILE: RS-232, RS-485 or a CAN bus.

    bus_file.py   the FILE (TOML): what may stand in it, one clear complaint for what may not; lines as they are met, by name
    wire_pair.py  a pair of wires: who drives it when, and what a UART makes of that at its own speed
    serial_bus.py the devices and masters on their wires; a client behind its adapter: latency, packets, a timer, the first byte
    can_bus.py    the same for frames on a CAN bus
    simulated_bus.py  what both have in common: devices, masters, power, control

No protocol is known here, and no device: those are the other folders beside this one.
"""

from __future__ import annotations

from typing import Any


def create(options: dict[str, str]) -> Any:
    """The client's end of the bus in the file of the option `file`: bytes, or frames where the wire is "can".

    Raises ValueError with one line of text for a missing option, a file that cannot be read, and whatever it says wrongly.
    """
    from handctl.sim.bus.bus_file import read

    for name in options:
        if name not in ("file", "seed", "bus"):
            raise ValueError(f"unknown option {name!r} of the simulated bus. Known: file, seed")
    if not options.get("file"):
        raise ValueError("option file: name the file that describes the bus (fake://bus?file=PATH)")
    plan = read(options["file"], options.get("seed"))
    if plan.adapter_faults:
        name = min(plan.adapter_faults)
        raise ValueError(
            f"{plan.path}: [line] fault = {name!r} belongs to an adapter: serve it with `handctl sim bus --slcan-pty`"
        )
    return client_of(plan)


def whole_of(plan: Any) -> Any:
    """The bus itself."""
    if plan.wire == "can":
        from handctl.sim.bus.can_bus import CanBus

        return CanBus(plan)
    from handctl.sim.bus.serial_bus import Bus

    return Bus(plan)


def client_of(plan: Any) -> Any:
    """The end of one client of this bus."""
    return whole_of(plan) if plan.wire == "can" else whole_of(plan).join()
