"""The checks of `handctl doctor` that concern a device on a network: our own address towards it, and who answers there.

What an answer means is not known here: a family's probe tells two devices apart by its `fingerprint`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from ipaddress import IPv4Address, ip_network
from typing import Any

from handctl.errors import HandctlError, LinkError
from handctl.sentence import plural
from handctl.tools.machine import Machine
from handctl.tools.machine_checks import Check

MASK = 24
"""Bits of a network: that of the devices here, where nothing else is known."""
CONNECTIONS = 4
"""So many, one behind the other: two devices with one address take turns, or one of them answers all."""
APART = 2
"""Counts by which readings of one resting device may differ."""


def host_in(link: str) -> str:
    """The host of a LINK over TCP, "" = it is none."""
    from urllib.parse import urlsplit

    return urlsplit(link).hostname or "" if link.startswith("tcp://") else ""


def subnet(machine: Machine, address: str, *, reached: bool | None) -> Iterator[Check]:
    """Whether this computer is in the network of an address.

    reached  the device answers there, whatever the way; None = nobody asked there, the device was read over another wire
    """
    there = _ipv4(address)
    if there is None or there.is_loopback:
        return
    ours = machine.source(address)
    network = ip_network(f"{address}/{MASK}", strict=False)
    mine = _ipv4(ours)
    if mine is not None and mine in network:
        yield Check("subnet", "ok", f"this computer has {ours}, in the network of {address}")
        return
    free = next(str(one) for one in network.hosts() if one != there)
    text = f"this computer has {ours} towards {address}" if ours else f"this computer has no way to {address}"
    text += f", and no address in its network {network.network_address}"
    if reached:
        yield Check("subnet", "ok", f"{text}. A router leads there")
        return
    remedy = f"give this computer an address such as {free}, mask 255.255.255.0"
    yield Check("subnet", "skipped" if reached is None else "fail", text, remedy)


def is_local(host: str) -> bool:
    """Whether a host is this computer: a simulator, or a tunnel."""
    there = _ipv4(host)
    return host == "localhost" or (there is not None and there.is_loopback)


def _ipv4(text: str) -> IPv4Address | None:
    with suppress(ValueError):
        return IPv4Address(text)
    return None


def same_address(
    link: str, device: Any, make: Callable[[Any], Any], fingerprint: Callable[[Any], list[int]]
) -> Iterator[Check]:
    """Whether one device answers all connections. The first connection, that of `device`, may not survive the others."""
    from handctl.link import open_link

    seen: list[list[int]] = []
    try:
        seen += _prints(device, fingerprint)
        for _ in range(CONNECTIONS - 1):
            with closing(open_link(link)) as opened:
                seen += _prints(make(opened), fingerprint)
    except HandctlError as exc:
        yield Check("same_address", "skipped", f"not every connection could be read: {exc.text}")
        return
    pairs = list(zip(seen[0::2], seen[1::2], strict=True))
    if any(_apart(*pair) for pair in pairs):
        yield Check("same_address", "skipped", "the readings change: let the device rest, then run this again")
    elif any(_apart(pairs[0][0], one) for one, _ in pairs):
        others = {tuple(one) for one, _ in pairs}
        text = f"{plural(len(others), 'device')} answer at {host_in(link)}: connections read {' and '.join(map(_short, sorted(others)))}"
        remedy = "leave one of them powered and give it another address: `handctl hand network` or `handctl hand pair`"
        yield Check("same_address", "fail", text, remedy)
    else:
        yield Check(
            "same_address", "ok", f"{plural(len(pairs), 'connection')} read the same: one device has this address"
        )
    yield from _second_client(device, fingerprint)


def _second_client(device: Any, fingerprint: Callable[[Any], list[int]]) -> Iterator[Check]:
    """Whether the first connection lived through the others."""
    try:
        fingerprint(device)
    except LinkError:
        remedy = "let one program at a time use this device: end the others before you run handctl"
        yield Check("clients", "warning", "another connection ended the first one", remedy)
    except HandctlError as exc:
        yield Check("clients", "warning", exc.text, exc.hint)
    else:
        yield Check("clients", "ok", "other connections leave the first one alone")


def _prints(device: Any, fingerprint: Callable[[Any], list[int]]) -> list[list[int]]:
    return [fingerprint(device) for _ in range(2)]


def _apart(one: list[int], other: list[int]) -> bool:
    return len(one) != len(other) or any(abs(a - b) > APART for a, b in zip(one, other, strict=False))


def _short(values: tuple[int, ...]) -> str:
    return " ".join(map(str, values[:6]))
