"""`handctl doctor`: checks of this machine and of one link, each with evidence and remedy. Changes nothing.

Diagnosing is its job: a link that cannot be opened, or a device that is silent, is a row and exit code 7, not 3 or 4.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from handctl.command.command_tree import Command, reads_option
from handctl.command.family import Family
from handctl.command.run import Run
from handctl.errors import Interrupted, LinkError, UsageError
from handctl.families import FAMILIES, SCANNED, WIRES
from handctl.link import ByteLink, Deadline, Link
from handctl.model.checks import Check, table_of
from handctl.model.result import Journal, Table
from handctl.tools.doctor_link import LinkChecks, failed_open, host_in, is_local, same_address, subnet
from handctl.tools.doctor_machine import machine_checks, port_checks
from handctl.tools.port_inventory import Machine
from handctl.tools.probes import family_of, has_speed, listened, probe_of, usual_ports, wire_of
from handctl.tools.scan_order import LinkScan
from handctl.tools.scan_report import Search, report

if TYPE_CHECKING:
    from handctl.model.settings import Settings


LINK_SECONDS = 8.0
FIND_SECONDS = 45.0
"""For a scan of this link, where the family is not given."""
PING_TIMEOUT = 0.5
CAUSES = ("speed", "same_id", "same_address", "protocol", "subnet")
"""Checks that say why others fail."""


@click.command("doctor", cls=Command)
@click.option(
    "--family",
    type=click.Choice(list(FAMILIES)),
    help="The family of the device on the link. Without it, and without -d NAME, handctl detects the device.",
)
@reads_option
def cli(run: Run, family: str | None, count: int) -> Table:
    """Check this computer and, with -p LINK, the link and its device.

    Checks permissions, other programs, delays, baud rate, echo and error rate. Each row shows the evidence and a remedy.
    Without --family it detects the device first, as `handctl scan` does. Read-only.
    Exit code 7 means a warning or a failure.
    """
    return checked(run, family, count)


def checked(run: Run, family: str | None, count: int) -> Table:
    """All checks, of a device of this `family`; None = of the one that is found."""
    machine = Machine()
    checks = machine_checks(machine)
    kind = family or run.settings.kind
    if run.settings.port or run.settings.fake:
        try:
            checks.extend(examine(run, machine, kind, count))
        except KeyboardInterrupt:  # what was found until then is told
            found = table_of(checks, CAUSES)
            found.failure = Interrupted("interrupted")
            return found
    elif kind is not None:
        raise UsageError(f"no {kind} device given", hint="give -p LINK, -d NAME or --fake", code="no-link")
    return table_of(checks, CAUSES)


def examine(run: Run, machine: Machine, kind: str | None, reads: int) -> Iterator[Check]:
    """The checks of the link that the user named, each as soon as it is known."""
    if kind is None and run.settings.fake:
        raise UsageError("no simulator given", hint=f"add --family with one of {', '.join(FAMILIES)}", code="no-family")
    if kind is not None:
        families = [family_of(kind)]
    else:  # a tcp:// without a port leads to the usual port of each family that has one, the first that opens
        families = [
            Family("unknown", _no_device, 115200, wires=WIRES, ids=True, tcp_port=port) for port in usual_ports()
        ]
    run.family = families[0]
    if run.family.check is not None:
        run.family.check(run.settings)
    name = run.link_name()
    yield from port_checks(machine, name)
    run.prompts.progress(f"{name}: opening")
    link, failure = None, None
    for run.family in families if name.startswith("tcp://") else families[:1]:
        try:
            link = run.open_link()
            break
        except LinkError as exc:
            failure = exc
    if link is None:
        assert failure is not None
        yield from failed_open(failure)
        yield from subnet(machine, host_in(name), reached=False)
        return
    speed = getattr(link, "baud", None)
    yield Check("open", "ok", f"{name} opens" + (f" at {speed} bit/s" if speed else ""))
    if kind is None:
        found, number, check = present(run, link, link.deadline(run.settings.deadline or FIND_SECONDS))
        if kind := found or None:
            run.family = family_of(kind)
            run.settings = run.settings._replace(id=run.settings.id or number)
        yield check
    seconds = run.settings.deadline or LINK_SECONDS
    settings = run.settings._replace(retries=0, timeout=run.settings.timeout or PING_TIMEOUT, deadline=seconds)
    family, probe = run.family, probe_of(kind) if kind is not None else None

    def device(on: Link) -> Any:
        return family.open(on, settings, run.journal)

    looking = LinkChecks(link, probe, device, reads, link.deadline(seconds), run.journal)
    run.prompts.progress(f"{name}: reading {reads} times")
    try:
        yield from looking.run()
        if probe is not None and looking.device is not None:
            # the same device on a connection of its own
            yield from _on_network(
                machine, name, probe, looking.device, lambda on: family.open(on, settings, Journal())
            )
    except LinkError as exc:
        yield Check("connection", "fail", exc.text, exc.hint)
    finally:
        run.prompts.done()


def _on_network(machine: Machine, name: str, probe: Any, device: Any, make: Any) -> Iterator[Check]:
    """For a network device, replying or silent: compare our address with its own, and check who has that."""
    host = host_in(name)
    held = probe.address_of(device) if hasattr(probe, "address_of") else ""
    if held and host and held != host and not is_local(host):
        text = f"the device was reached at {host}, but its address register contains {held}"
        remedy = "power-cycle it to use the new address. Another device may have this address too"
        yield Check("address", "warning", text, remedy)
    yield from subnet(machine, host or held, reached=True if host else None)
    if host and hasattr(probe, "fingerprint"):
        yield from same_address(name, device, make, probe.fingerprint)


def _no_device(link: Any, settings: Settings, journal: Journal) -> Any:
    raise UsageError("no device was found", hint="name its family with --family")


# -- who is there on a link that is open: by the rows of a scan, and by whose the destroyed answers are ----------------


DESTROYED = ("bad-checksum", "cut-short", "wrong-id")
"""Codes of an answer that was one, of somebody who speaks this family's frames."""
LATE = 0.05


def present(run: Run, link: Link, bound: Deadline) -> tuple[str, int | None, Check]:
    """Search for a device of any family. Returns the family ("" = none known), its id and the row of the check.

    Leaves the port at the speed at which it was found. Raises LinkError.
    """
    search, was = Search(link.name), getattr(link, "baud", None)
    LinkScan(run, link, search, [run.settings.id or 1], False, bound).at(wire_of(link.name), SCANNED)
    if isinstance(link, ByteLink):
        listened(link, link.deadline(LATE))  # answers that came too late are nobody's
    if search.rows:
        row = search.rows[0]
        speed = row.get("baud") if has_speed(link) else None
        _set(link, speed or was)
        where = "".join(
            (f" with id {row['id']}" if row["id"] is not None else "", f" at {speed} bit/s" if speed else "")
        )
        return row["family"], row["id"], Check("device", "ok", f"{row['family']}{where}: {row['evidence']}")
    for step, error in search.met.items():
        if error.code in DESTROYED:
            _set(link, step.speed or was)
            text = f"something replies like {step.family}, but no reply is complete: {error.text}"
            return step.family, None, Check("device", "warning", text, error.hint)
    _set(link, was)
    nobody = report([search], SCANNED, run.journal).failure
    assert nobody is not None
    return "", None, Check("device", "fail", nobody.text, nobody.hint)


def _set(link: Link, speed: int | None) -> None:
    if speed is not None and has_speed(link) and getattr(link, "baud", None) != speed:
        link.set_baud(speed)  # type: ignore[attr-defined]
