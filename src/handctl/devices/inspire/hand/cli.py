"""`handctl hand …`: how an RH56 hand is opened, and what every device has. The rest is added by the other modules named cli.

Each body checks its arguments, asks a device, returns a Table.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from handctl.devices.inspire.hand.device import Hand
from handctl.devices.inspire.hand.generation import ModelGate
from handctl.devices.inspire.hand.map import BYTE_MAP, SPEEDS
from handctl.devices.inspire.hand.motion_cli import add_movements, write_asked
from handctl.devices.inspire.hand.network_cli import add_network
from handctl.devices.inspire.hand.pairing_cli import add_pairing
from handctl.devices.inspire.hand.service_cli import add_service
from handctl.devices.inspire.hand.settings_cli import add_settings
from handctl.devices.inspire.hand.tactile_cli import add_tactile
from handctl.devices.inspire.hand.typed import (
    PORT,
    asks_rtu,
    check,
    map_of,
    other_maps,
    over_tcp,
    protocol_of,
    simulated,
    typed_model,
)
from handctl.errors import HandctlError
from handctl.frame.clikit import Group
from handctl.frame.family import Family
from handctl.frame.mapverbs import add_map_verbs
from handctl.frame.run import Run
from handctl.link import FrameLink
from handctl.model.device import limits_of
from handctl.model.result import Table

if TYPE_CHECKING:
    from handctl.devices.inspire.registers import RegisterBus
    from handctl.frame.options import Settings
    from handctl.link import ByteLink
    from handctl.model.result import Journal


def open_hand(link: ByteLink | FrameLink, settings: Settings, journal: Journal) -> Hand:
    """An RH56 hand behind `link`, on the wire that LINK and --protocol name."""
    gate = ModelGate(typed_model(settings), settings.assume_identity)
    bus, *others = _wires(link, settings, journal)
    for one in (bus, *others):
        one.gate = gate  # type: ignore[assignment]
    return Hand(bus, gate, *others, side=settings.own.get("side") or "")


def _wires(link: ByteLink | FrameLink, settings: Settings, journal: Journal) -> list[RegisterBus]:
    """The wire, and behind EB90 the one that is asked where it is silent."""
    number, limits = settings.id if settings.id is not None else 1, limits_of(settings, link)
    if isinstance(link, FrameLink):
        from handctl.devices.inspire import canreg
        from handctl.devices.inspire.canbus import CanBus

        return [CanBus(link, number, journal, read_flag=canreg.READ_HAND, write_flag=canreg.WRITE_HAND, **limits)]
    from handctl.devices.inspire.modbusbus import ModbusBus

    protocol = protocol_of(settings)
    modbus = ModbusBus(link, number, journal, tcp=over_tcp(settings), **limits)
    if modbus.tcp or protocol == "modbus":
        return [modbus]
    from handctl.devices.inspire.bus import Bus

    line = Bus(link, number, journal, family="hand", **limits)
    return [line, modbus] if protocol == "auto" and asks_rtu(link) else [line]


def explain_silence(device: Hand, error: HandctlError) -> HandctlError:
    """Whether the silent hand is there at another speed."""
    from handctl.devices.inspire import procedures

    return procedures.explain_silence(device, error)


cli = Group(
    "hand",
    family=Family(
        "hand",
        open_hand,
        115200,
        explain_silence,
        wires=("serial", "can", "modbus-tcp"),
        tcp_port=PORT,
        ids=True,
        check=check,
        map_of=map_of,
        other_maps=other_maps,
        simulated=simulated,
        speeds=tuple(SPEEDS.values()),
    ),
    first=("angle", "position", "speed", "force", "clear-errors", "calibrate", "scan"),
    help="Inspire RH56 dexterous hands, over RS-232, RS-485, CAN or Modbus. For Modbus TCP use -p tcp://HOST. "
    "A hand closes in less than a second. Commands that move it or change it permanently ask first.",
)

add_map_verbs(
    cli,
    BYTE_MAP,
    part="FINGER",
    example="angle_actual.index temperature",
    without=("set",),
)


@cli.verb("set", "Settings", writes=True)
@click.argument("assignments", nargs=-1, required=True, metavar="NAME[.FINGER]=VALUE...")
def set_(run: Run, assignments: tuple[str, ...]) -> Table:
    """Write quantities by name and read them back.

    For example `speed_set.index=300 force_limit.index=500`."""
    return write_asked(run, map_of(run.settings).assignments(assignments))


add_movements(cli)
add_settings(cli)
add_service(cli)
add_network(cli)
add_pairing(cli)
add_tactile(cli)
