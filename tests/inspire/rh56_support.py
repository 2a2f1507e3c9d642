"""A simulated RH56 hand behind the host's own bus, on virtual time."""

from __future__ import annotations

from handctl.devices.inspire.can_bus import CanBus
from handctl.devices.inspire.hand.detect_generation import ModelGate
from handctl.devices.inspire.hand.device import Hand
from handctl.devices.inspire.modbus_bus import ModbusBus
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.link import FrameLink, open_link
from handctl.model.result import Journal

EB90, RTU, TCP, CAN = "eb90", "rtu", "tcp", "can"


def hand_on(model: str, wire: str = EB90, *, typed: str | None = None, both: bool = False, **options: object) -> Hand:
    """A hand of this generation on this wire; with `both` a serial line is asked in EB90, then in Modbus RTU."""
    bus = {TCP: "modbus-tcp", CAN: "can"}.get(wire)
    words = {"model": model, "clock": "virtual", **({"bus": bus} if bus else {}), **options}
    link = open_link("fake://hand?" + "&".join(f"{name}={value}" for name, value in words.items()))
    journal = Journal()
    line: SerialBus | CanBus | ModbusBus
    if isinstance(link, FrameLink):
        line = CanBus(link, 1, journal, family="hand")
    elif wire == EB90:
        line = SerialBus(link, 1, journal)
    else:
        line = ModbusBus(link, 1, journal, tcp=wire == TCP)
    other = ModbusBus(link, 1, journal, tcp=False) if both else None
    gate = ModelGate(typed, False)
    for one in (line, other):
        if one is not None:
            one.gate = gate
    return Hand(line, gate, other)
