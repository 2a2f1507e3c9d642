"""`handctl ports`: serial ports and CAN interfaces, the programs that have them open, problems and remedies.

Opens no port and writes to none: all of it is what the system already knows.
"""

from __future__ import annotations

import click

from handctl.command.command_tree import Command
from handctl.command.run import Run
from handctl.model.result import Cell, Column, Grid, Journal, Row, Table
from handctl.tools.family_probe import on_can
from handctl.tools.port_inventory import CanInterface, Machine, Port
from handctl.tools.port_problems import Problem, can_problems, grabber_problem, orphan, port_problems

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
        **_told(port_problems(port)),
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
