"""Baud rate and network address of a hand: changed once, read back, saved.

Two sources place the speed code at 1001 and five at 1002 (rh56 §6 Q1): both are read first, and told.
"""

from __future__ import annotations

from collections.abc import Sequence
from ipaddress import IPv4Address
from typing import TYPE_CHECKING

from handctl.devices.inspire import id_baud_save_reset
from handctl.devices.inspire.hand.register_map import DF, IP_ADDRESS, MODELS, TP
from handctl.errors import CheckFailed, DeviceRefused, Hint, UsageError
from handctl.families import FAMILIES
from handctl.model.param import Element, Number
from handctl.model.prompts import Prompts
from handctl.model.result import Table, hex_bytes

if TYPE_CHECKING:
    from handctl.devices.inspire.hand.device import Hand

SYSTEM = (1000, 4)
"""Id, and the two places where the speed code may be."""
FACTORY = "192.168.11.210"
"""Both hands of a pair (rh56 §2.3)."""


def tell_places(hand: Hand) -> None:
    """Say what both places of the speed code hold."""
    register = hand.map["baud_code"]
    if register.per == 2:
        return
    held = hand.bus.read(*SYSTEM)
    hand.journal.info(
        "places",
        f"1001 reads {held[1]}, 1002 reads {held[2]}. handctl uses 1002 for the baud rate code",
        hint="some of the manufacturer's programs write 1001. Only a power-cycle shows which one a hand uses (rh56 §6)",
    )


def change_speed(hand: Hand, rate: int) -> Table:
    """Write the speed that counts after save and power cycle, and read it back. Raises CheckFailed."""
    hand.identify()
    code = hand.speed_code(rate)
    if code == 3 and hand.found().model == DF:
        raise DeviceRefused(
            f"{hand.bus.where}: an RH56DFX, DFQ or BFX does not support 921600 bit/s",
            hint="choose 115200, 57600 or 19200. Nothing was written.",
            code="no-speed",
        )
    tell_places(hand)
    register = hand.map["baud_code"]
    neighbour = hand.bus.read(*SYSTEM) if register.per == 1 else b""
    table = hand.table(hand.write([(Element(register, 0), code)]))
    after = hand.bus.read(*SYSTEM) if register.per == 1 else b""
    if neighbour[1:2] != after[1:2]:
        raise CheckFailed(
            f"{hand.bus.where}: writing 1002 also changed 1001, from {hex_bytes(neighbour[1:2])} to {hex_bytes(after[1:2])}",
            hint=f"do not save. Power-cycle the hand: without a save it returns to its old baud rate, not {rate} bit/s",
            code="neighbour-changed",
        )
    return table


# -- network --------------------------------------------------------------------------------------------------------


def octets_of(text: str) -> list[int]:
    """``192.168.11.211`` -> four numbers. Raises UsageError for what no hand can have."""
    try:
        address = IPv4Address(text)
    except ValueError as exc:
        raise UsageError(
            f"{text!r} is not an IPv4 address", hint=f"write four numbers, such as {FACTORY}. Nothing was sent."
        ) from exc
    octets = list(address.packed)
    elsewhere = address.is_multicast or address.is_loopback or (not address.is_global and not address.is_private)
    if elsewhere or octets[0] == 0 or octets[0] > 223 or octets[3] in (0, 255):
        raise UsageError(
            f"{text} is not the address of one device", hint=f"use one such as {FACTORY}. Nothing was sent."
        )
    return octets


def laptop_for(octets: Sequence[int]) -> str:
    """An address in the same network for the computer."""
    last = 10 if octets[3] != 10 else 11
    return ".".join(map(str, [*octets[:3], last]))


def next_to(octets: Sequence[int]) -> list[int]:
    """The address behind this one in the same network, for the other hand of a pair."""
    return [*octets[:3], octets[3] + 1 if octets[3] < 254 else octets[3] - 1]


def link_of(link: str, octets: Sequence[int]) -> str:
    """The LINK of the same kind to another address; of a simulator in this process another one, which has that address."""
    text = ".".join(map(str, octets))
    if link.startswith("fake://"):
        return f"{link}&ip={text}"
    _, colon, port = link.removeprefix("tcp://").partition(":")
    return f"tcp://{text}{colon}{port}"


def over_network(hand: Hand) -> bool:
    """Whether the hand is reached at its IP address."""
    return hand.bus.wire == "tcp"


def show_network(hand: Hand) -> Table:
    """The IP address of the hand, and what the computer must have. Raises DeviceRefused where it has none."""
    address = held(hand)
    table = hand.table(hand.read(hand.map[IP_ADDRESS].each))
    hand.journal.info(
        "network",
        f"the hand has {'.'.join(map(str, address))}, port {FAMILIES['hand'].tcp_port} (Modbus TCP)",
        hint=f"give this computer an address such as {laptop_for(address)}, mask 255.255.255.0",
    )
    return table


def held(hand: Hand) -> list[int]:
    """The four numbers that the hand holds as its address. Raises DeviceRefused where it has none."""
    hand.know()
    if hand.found().model != TP:
        raise DeviceRefused(
            f"{hand.bus.where}: {hand.found().words} has no network address",
            hint="only a tactile hand (RH56DFTP, RH56E2) has one. Nothing was written.",
            code="not-on-model",
        )
    return [int(reading.value or 0) for reading in hand.read(hand.map[IP_ADDRESS].each)]


def address_plan(hand: Hand, octets: Sequence[int]) -> list[tuple[Element, Number]]:
    """What writes an address. Raises UsageError where the generation that was typed has none."""
    register = hand.map.get(IP_ADDRESS)
    if register is None:
        raise UsageError(
            f"{MODELS[hand.typed] if hand.typed is not None else 'this hand'} has no network address",
            hint="only a tactile hand (RH56DFTP, RH56E2) has one. Nothing was sent.",
            code="not-on-model",
        )
    return list(zip(register.each, octets, strict=True))


def change_network(hand: Hand, octets: Sequence[int], prompts: Prompts, *, cycled_next: bool = False) -> Table:
    """Write the address, read it back, save it (rh56 §6, §9). `cycled_next`: the caller sees to the power-cycle. Raises CheckFailed where a condition does not hold."""
    hand.identify()
    before = held(hand)
    bus = hand.bus
    connected = bus.link.name.removeprefix("tcp://").partition(":")[0]
    if bus.wire == "tcp" and not bus.link.fake and ".".join(map(str, before)) != connected:
        raise CheckFailed(
            f"{bus.where}: the hand reports the address {'.'.join(map(str, before))}, but you connected to {connected}",
            hint="leave only that hand switched on, and connect to the address it reports. Nothing was written.",
            code="other-address",
        )
    errors = [reading for reading in hand.read(hand.map["error"].each) if reading.value]
    if errors:
        raise CheckFailed(
            f"{bus.where}: the hand reports errors: {', '.join(str(one.element.part) for one in errors)}",
            hint=Hint("run {} first. Nothing was written.", "hand clear-errors"),
            code="not-fit",
        )
    if before == list(octets):
        hand.journal.info("already", f"the hand already has the address {'.'.join(map(str, before))}. Saving it again")
        return id_baud_save_reset.save(hand, prompts)
    new, old = ".".join(map(str, octets)), ".".join(map(str, before))
    plan = address_plan(hand, octets)
    table = hand.table(hand.write(plan))
    table.rows += id_baud_save_reset.save(hand, prompts, plan).rows
    if cycled_next:
        return table
    hand.journal.warn(
        "power-cycle",
        f"the hand replies at {old} until you power-cycle it, then only at {new}",
        hint=Hint(
            f"give this computer {laptop_for(octets)}, power-cycle the hand, then run {{}}. "
            "If it is not found: `handctl hand network -p PORT` reads the address over RS-485",
            f"hand status -p tcp://{new}",
        ),
    )
    return table
