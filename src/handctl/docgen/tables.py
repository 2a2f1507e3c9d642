"""What the four completion scripts have in common: which names a map offers, and how the tables are cut.

Knows no shell's syntax.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from handctl.docgen.tree import Node, Option
from handctl.model.param import Param

MARK = "completion of handctl, generated from its command tree"
"""Stands in the first lines of every script: how an installed one is recognised as ours."""

PREFIXES = ("tcp://", "usb:", "can:socketcan:", "can:slcan:", "can:pcan:", "socket://", "replay:")
"""How a LINK may begin, beside a path and the simulators."""

PORTS = ("/dev/serial/by-id/*", "/dev/ttyUSB*", "/dev/ttyACM*", "/dev/rfcomm*", "/dev/cu.usb*")
INTERFACES = ("/sys/class/net/can*", "/sys/class/net/vcan*", "/sys/class/net/slcan*")
SLCAN = ("/dev/ttyACM*", "/dev/ttyUSB*")


class Names(NamedTuple):
    """The words of one family's map: for reading, for setting, all; elements of vectors, values of enumerations."""

    read: tuple[str, ...]
    set: tuple[str, ...]
    name: tuple[str, ...]
    elements: dict[str, tuple[str, ...]]
    values: dict[str, tuple[str, ...]]


def names_of(params: tuple[Param, ...]) -> Names:
    """The words that the verbs of a map take. A mnemonic is a second name."""

    def spelled(chosen: list[Param]) -> tuple[str, ...]:
        return (*(param.name for param in chosen), *filter(None, map(mnemonic, chosen)))

    def table(pairs: list[tuple[Param, tuple[str, ...]]]) -> dict[str, tuple[str, ...]]:
        return {name: words for param, words in pairs if words for name in filter(None, (param.name, mnemonic(param)))}

    writable = [param for param in params if param.writable]
    return Names(
        read=spelled([param for param in params if param.readable]),
        set=spelled(writable),
        name=spelled(list(params)),
        elements=table([(param, param.elements) for param in params]),
        values=table([(param, tuple(map(str, param.choices))) for param in writable]),
    )


def mnemonic(param: Param) -> str:
    """The device's own short name of a quantity where it has one, e.g. ``HSG``."""
    return str(getattr(param, "mnemonic", ""))


def common(tree: Node) -> tuple[Option, ...]:
    """The options that every command of every device has: the root's. A wire belongs to one family."""
    return tuple(option for option in tree.options if option.shared)


def own(node: Node, shared: tuple[Option, ...]) -> tuple[tuple[Option, ...], str]:
    """The options of a command without the `shared` ones, and the names of those that it does not offer."""
    lacks = (name for option in shared if option not in node.options for name in option.names)
    return tuple(option for option in node.options if option not in shared), " ".join(lacks)


def plain(text: str) -> str:
    """A help text as one line without markup."""
    return " ".join(text.replace("`", "").split())


def fill(template: str, places: Mapping[str, str]) -> str:
    """The template with each @PLACE@ put in."""
    for place, content in places.items():
        template = template.replace(place, content)
    return template
