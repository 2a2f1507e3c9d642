"""Lines as they are met, by name: what `model = "NAME"` in a FILE stands for, and what tests are run over.

The figures are typical ones, not of one product: 16 ms is the timer that USB serial adapters come with, 62 bytes what one
of their USB packets holds; Bluetooth 4 carries 20 bytes a packet, and no serial speed.
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

Value = str | int | float | bool

MODELS: dict[str, dict[str, Value]] = {
    "clean": {"wire": "rs232"},
    "half-duplex": {"wire": "rs485", "half_duplex": True},
    "first-byte-lost": {"wire": "rs485", "half_duplex": True, "first_byte_lost": True},
    "usb-16ms": {"wire": "rs232", "coalesce_ms": 16, "packet": 62, "speed_ignored": False},
    "bluetooth": {
        "wire": "rs232", "latency_ms": 60, "spread_ms": 20, "packet": 20, "coalesce_ms": 4, "speed_ignored": True,
    },
    "serial-server": {"wire": "rs485", "half_duplex": True, "latency_ms": 4, "spread_ms": 4, "coalesce_ms": 50},
}  # fmt: skip

SAID: dict[str, str] = {
    "clean": "RS-232 without anything",
    "half-duplex": "RS-485 on two wires",
    "first-byte-lost": "the same with an adapter that switches to receiving too late",
    "usb-16ms": "RS-232 behind a USB adapter with its timer",
    "bluetooth": "a Bluetooth 4.0 link: slow, in packets, without a speed",
    "serial-server": "RS-485 behind a server in the network that gathers bytes",
}


def text(
    model: str,
    devices: Sequence[Mapping[str, Value]] = (),
    masters: Sequence[Mapping[str, Value]] = (),
    **line: Value,
) -> str:
    """A FILE with this line; further keys of [line] as keywords."""
    tables: list[tuple[str, Mapping[str, Value]]] = [("[line]", {"model": model, **line})]
    tables += [("[[device]]", device) for device in devices]
    tables += [("[[master]]", master) for master in masters]
    return "\n".join(
        "\n".join((head, *(f"{key} = {_toml(value)}" for key, value in rows.items()), "")) for head, rows in tables
    )


def _toml(value: Value) -> str:
    import json

    return json.dumps(value)
