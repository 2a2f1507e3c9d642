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


def words(options: tuple[Option, ...]) -> str:
    """The names of options, for a shell whose tables are words."""
    return " ".join(name for option in options for name in option.names)


def takes(options: tuple[Option, ...]) -> str:
    """Which of them take a value, and what can complete it: `--opt=token`."""
    return " ".join(f"{name}={option.value.token}" for option in options if option.value for name in option.names)


def parts(node: Node, shared: tuple[Option, ...]) -> dict[str, str]:
    """What a shell whose tables are words knows of a command, by the names of its variables; no empty ones."""
    options, lacks = own(node, shared)
    found = {
        "cmds": " ".join(child.path[-1] for child in node.children),
        "opts": words(options),
        "takes": takes(options),
        "args": " ".join(argument.value.token + ("*" if argument.repeats else "") for argument in node.arguments),
        "lacks": lacks,
    }
    return {key: text for key, text in found.items() if text}


def plain(text: str) -> str:
    """A help text as one line without markup."""
    return " ".join(text.replace("`", "").split())


def fill(template: str, places: Mapping[str, str]) -> str:
    """The template with each @PLACE@ put in."""
    for place, content in places.items():
        template = template.replace(place, content)
    return template
