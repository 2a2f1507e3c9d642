"""`handctl ports`: serial ports and CAN interfaces, the programs that have them open, problems and remedies.

Opens no port and writes to none: all of it is what the system already knows.
"""

from __future__ import annotations

from typing import NamedTuple

import click

from handctl.command.command_tree import Command
from handctl.command.run import Run
from handctl.link.port_users import Process, group_remedy
from handctl.model.result import Cell, Column, Grid, Journal, Row, Table
from handctl.system import advice
from handctl.tools.family_probe import on_can
from handctl.tools.port_inventory import CanInterface, Chip, Machine, Port

BITRATE = 1_000_000
"""wrist §2.3."""
LATENCY_MS = 1
COLUMNS = (
    Column("kind", "Kind"),
    Column("link", "Link"),
    Column("by_id", "By id"),
    Column("usb", "USB"),
    Column("chip", "Adapter"),
    Column("driver", "Driver"),
    Column("product", "Product"),
    Column("state", "State"),
    Column("holder", "Held by"),
    Column("permitted", "Permitted"),
    Column("latency", "Latency timer", right=True, unit="ms"),
    Column("bitrate", "Bitrate", right=True),
    Column("may_be", "May be"),
    Column("problem", "Problem"),
    Column("remedy", "Remedy"),
)


NOTHING: Row = dict.fromkeys(column.key for column in COLUMNS)
"""A row with all its keys."""


class Problem(NamedTuple):
    """What is wrong with a port, and the exact remedy."""

    check: str
    text: str
    remedy: str


@click.command("ports", cls=Command, offline=True)
def cli(run: Run) -> Table:
    """List serial ports and CAN interfaces.

    Shows which program uses each one, and how to fix problems. Opens none of them.
    """
    return table(Machine(), run.journal)


def table(machine: Machine, journal: Journal) -> Table:
    """Everything `machine` has, one row per port; programs that grab ports are warnings."""
    ports = machine.ports()
    interfaces = machine.can_interfaces()
    for process in machine.port_grabbing_programs() if ports else ():
        text, remedy = grabber_problem(process, ports)
        journal.warn(process.name.lower(), text, hint=remedy)
    for chip in machine.without_port():
        journal.warn("no-driver", *orphan(chip))
    if not ports and not interfaces:
        journal.info("none", "no serial port and no CAN interface is plugged in", hint="`--fake` needs none")
    rows = [serial_row(port) for port in ports] + [can_row(interface) for interface in interfaces]
    return Table(rows=rows, columns=COLUMNS, view=_view, plain=("link",))


# -- rows ---------------------------------------------------------------------------------------------------------


def serial_row(port: Port) -> Row:
    """One serial port, flat."""
    return {
        **NOTHING,
        "kind": "serial",
        "link": port.path,
        "by_id": port.by_id or None,
        "usb": port.usb or None,
        "chip": port.chip.name if port.chip is not None else None,
        "driver": port.driver or None,
        "product": port.product or None,
        "state": port.state,
        "holder": ", ".join(map(str, port.held)) or None,
        "permitted": port.permitted,
        "latency": port.latency_ms,
        "may_be": port.chip.behind if port.chip is not None else None,
        **_told(problems(port)),
    }


def can_row(interface: CanInterface) -> Row:
    """One CAN interface, with the same keys."""
    return {
        **NOTHING,
        "kind": "can",
        "link": f"can:socketcan:{interface.name}",
        "driver": interface.driver or None,
        "state": interface.state,
        "permitted": True,
        "bitrate": interface.bitrate,
        "may_be": " or ".join(on_can()),
        **_told(can_problems(interface)),
    }


def _told(found: list[Problem]) -> Row:
    return {
        "problem": "; ".join(problem.text for problem in found) or None,
        "remedy": "; ".join(problem.remedy for problem in found) or None,
    }


# -- what is wrong, and what to do ----------------------------------------------------------------------------------


def problems(port: Port) -> list[Problem]:
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
    rule = udev_remedy(port, 'MODE="0660", TAG+="uaccess"')
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


def udev_remedy(port: Port, action: str) -> str:
    """A udev rule for this very adapter; empty for a port that is none."""
    return _install(_matches(port.usb, action, subsystem='SUBSYSTEM=="tty", ')) if port.usb else ""


def _matches(usb: str, action: str, subsystem: str = "") -> str:
    vendor, product = usb.split(":")[:2]
    return f'{subsystem}ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}", {action}'


def _install(rule: str) -> str:
    """The shell line that puts a rule in force."""
    return (
        f"`printf '{rule}\\n' | sudo tee -a /etc/udev/rules.d/70-handctl.rules; "
        "sudo udevadm control --reload`, then plug the adapter in again"
    )


# -- how people see it ----------------------------------------------------------------------------------------------


def _view(rows: list[Row]) -> list[Grid]:
    """Five narrow columns; whatever does not fit into 80 characters is listed below, port by port."""
    lines = []
    notes = []
    for row in rows:
        good = row["state"] in ("free", "up") and row["problem"] is None
        tone = "good" if good else "bad" if row["state"] in ("not permitted", "in use", "down") else "warn"
        kind = row["chip"] or row["product"] or ("CAN" if row["kind"] == "can" else "")
        state = row["state"] if row["bitrate"] is None else f"{row['state']} {row['bitrate']} bit/s"
        lines.append((row["link"], kind, row["usb"] or "", row["driver"] or "", Cell(state, tone)))
        name = row["link"].rpartition("/")[2]
        notes += [f"{name}: {row['by_id']}"] if row["by_id"] else []
        notes += [f"{name}: {row['product']}"] if row["product"] and row["product"] != kind else []
        notes += [f"{name}: may be {row['may_be']}"] if row["may_be"] else []
        notes += [f"{name}: {row['problem']}", f"  Next: {row['remedy']}"] if row["problem"] else []
    return [Grid(("Link", "Adapter", "USB", "Driver", "State"), tuple(lines), notes=tuple(notes))]
