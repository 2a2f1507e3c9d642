"""The section of a report about this computer: system, Python, packages, the port. No user, no host name, no folder."""

from __future__ import annotations

import platform
from importlib import metadata

from handctl.link.base import path_in
from handctl.system.processes import system_name

Facts = list[tuple[str, str]]
"""(what, text) in the order of the page."""


def environment() -> Facts:
    """System, Python and the versions of the packages that handctl uses."""
    from handctl.tools.port_inventory import needed

    facts = [
        ("system", system_name()),
        ("Python", f"{platform.python_implementation()} {platform.python_version()}"),
    ]
    return facts + [(name, _version(name)) for name in needed()]


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed as a package"


def port(link: str) -> Facts:
    """What the system reports about the serial port or CAN interface of `link`; nothing for other links."""
    from handctl.tools.port_inventory import Machine

    machine = Machine()
    if link.startswith("can:socketcan:"):
        name = link.removeprefix("can:socketcan:").partition("?")[0]
        return [fact for found in machine.can_interfaces() if found.name == name for fact in (
            ("CAN interface", name), ("state", found.state), ("driver", found.driver or "unknown"),
            ("bitrate", f"{found.bitrate} bit/s" if found.bitrate else "not reported"),
        )]  # fmt: skip
    path = path_in(link)  # the device file of a serial LINK; a COM name stays as it is
    path = path if path.startswith("/dev/") or path.upper().startswith("COM") else ""
    if link.startswith("usb:"):
        found = next(iter(machine.matching(link)), None)
    else:
        found = machine.port(path) if path else None
    if found is None:
        return [("port", f"{path or 'none'}: not known to the system")] if path or link.startswith("usb:") else []
    return [fact for fact in (
        ("port", found.path), ("adapter", found.chip.name if found.chip is not None else ""),
        ("USB", ":".join(found.usb.split(":")[:2])), ("driver", found.driver), ("product", found.product),
        ("state", found.state), ("held by", ", ".join(map(str, found.held))), ("group", found.group),
        ("latency timer", f"{found.latency_ms} ms" if found.latency_ms is not None else ""),
    ) if fact[1]]  # fmt: skip
