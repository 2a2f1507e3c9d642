"""What keeps a serial port or a CAN interface from being used well, and the remedy of each: permission, holder, latency timer,
bitrate, programs that grab ports, adapters without a port. Opens none of them.
"""

from __future__ import annotations

from typing import NamedTuple

from handctl.link.link_interface import BITRATE
from handctl.link.port_users import Process, group_remedy
from handctl.system import advice
from handctl.tools.port_inventory import CanInterface, Chip, Port

LATENCY_MS = 1
"""Of the latency timer: more holds back the end of every reply."""


class Problem(NamedTuple):
    """What is wrong with a port, and the exact remedy."""

    check: str
    text: str
    remedy: str


def port_problems(port: Port) -> list[Problem]:
    """What keeps `port` from being used well."""
    found = []
    if not port.permitted:
        found.append(Problem("permission", f"{port.path}: no permission to read and write", permission_remedy(port)))
    if port.held:
        who = ", ".join(map(str, port.held))
        found.append(Problem("holder", f"{port.path} is in use by {who}", "close that program"))
    if port.latency_ms is not None and port.latency_ms > LATENCY_MS:
        text = f"the adapter holds the end of every reply back for up to {port.latency_ms} ms (latency timer)"
        found.append(Problem("latency_timer", text, latency_remedy(port)))
    return found


def can_problems(interface: CanInterface) -> list[Problem]:
    """What keeps a CAN interface from reaching a wrist."""
    name = interface.name
    up = f"sudo ip link set {name} up type can bitrate {BITRATE}"
    if name.startswith("vcan"):
        return []
    if interface.state == "down":
        return [Problem("can", f"{name} is down", f"run `{up}`")]
    if interface.bitrate not in (None, BITRATE):
        text = f"{name} runs at {interface.bitrate} bit/s, a wrist at {BITRATE} (some at 500000)"
        return [Problem("can", text, f"run `sudo ip link set {name} down; {up}`")]
    return []


def permission_remedy(port: Port) -> str:
    """The group to join, or a udev rule where there is no group that would help."""
    found = _matches(port.usb, 'MODE="0660", TAG+="uaccess"') if port.usb else ""
    rule = _install(f'SUBSYSTEM=="tty", {found}') if found else ""
    remedy = group_remedy(port.group, port.path, member=port.member)
    if port.group in ("", "root"):
        return rule or remedy
    return remedy + (f". For this adapter only: {rule}" if rule and not port.member else "")


def latency_remedy(port: Port) -> str:
    """How to set the timer to 1 ms now and for good. handctl asks for it while it has the port open."""
    if way := advice.set_latency(port.path, LATENCY_MS):
        return way
    name = port.path.rpartition("/")[2]
    now = f"echo {LATENCY_MS} | sudo tee /sys/bus/usb-serial/devices/{name}/latency_timer"
    rule = f'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{{latency_timer}}="{LATENCY_MS}"'
    return f"run `{now}` for all programs. For good: {_install(rule)}. handctl asks for 1 ms while it has the port open"


def grabber_problem(process: Process, ports: list[Port]) -> tuple[str, str]:
    """(text, remedy) for ModemManager and brltty, which open ports by themselves."""
    usb = list(dict.fromkeys(port.usb for port in ports if port.usb))
    if process.name == "brltty":
        claimed = [port.usb for port in ports if port.chip is not None and port.chip.braille]
        text = f"{process} takes adapters for braille displays" + (f" ({', '.join(claimed)})" if claimed else "")
        return text, (
            "if you do not use a braille display, run `sudo apt remove brltty`. Otherwise run "
            "`sudo systemctl mask brltty.path brltty-udev.service`. Then plug the adapter in again"
        )
    ignored = [_matches(name, 'ENV{ID_MM_DEVICE_IGNORE}="1"') for name in usb]
    rules = r"\n".join(ignored)
    remedy = "run `sudo systemctl stop ModemManager`" + (
        f". To keep it from these adapters for good: {_install(rules)}" if rules else ""
    )
    return f"{process} writes AT commands to serial ports that are plugged in", remedy


def orphan(chip: Chip) -> tuple[str, str]:
    """(text, remedy) for an adapter that is plugged in but has no port."""
    remedy = advice.find_driver(chip.name) or (
        "run `sudo apt remove brltty` if brltty is installed: it takes this adapter away. Then plug the adapter in again"
        if chip.braille
        else "look at `sudo dmesg | tail`: the driver is missing or failed"
    )
    return f"{chip.name} ({chip.usb}) is plugged in but has no serial port", remedy


def _matches(usb: str, action: str) -> str:
    vendor, product = usb.split(":")[:2]
    return f'ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}", {action}'


def _install(rule: str) -> str:
    """The shell line that puts a rule in force."""
    return (
        f"`printf '{rule}\\n' | sudo tee -a /etc/udev/rules.d/70-handctl.rules; "
        "sudo udevadm control --reload`, then plug the adapter in again"
    )
