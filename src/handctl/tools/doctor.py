"""`handctl doctor`: checks of this machine and of one link, each with evidence and remedy. Changes nothing.

Diagnosing is its job: a link that cannot be opened, or a device that is silent, is a row and exit code 7, not 3 or 4.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handctl.command.command_tree import Command
from handctl.command.family import Family
from handctl.command.options import reads_option
from handctl.command.run import Run
from handctl.errors import Interrupted, LinkError, UsageError
from handctl.families import FAMILIES, SCAN_ORDER, WIRES
from handctl.link import ByteLink, Deadline, Link
from handctl.model.check_rows import Check, table_of
from handctl.model.result import Journal, Table
from handctl.model.scan_task import LABEL_HINT
from handctl.system import advice
from handctl.tools import port_problems
from handctl.tools.doctor_link import LinkChecks, host_in, is_local, same_address, subnet
from handctl.tools.family_probe import family_of, has_speed, listened, probe_of, set_speed, usual_ports, wire_of
from handctl.tools.port_inventory import GRABBERS, Machine, Port, needed
from handctl.tools.scan_link import LinkScan
from handctl.tools.scan_report import Search, report

if TYPE_CHECKING:
    from handctl.model.command_settings import Settings


PYTHON = (3, 10)
ROOM_LITTLE, ROOM_NONE = 100_000_000, 5_000_000
"""Bytes: logs and traces need room."""
WIDTH = 80


# -- this computer: versions, permissions, interfering programs, disk space, clock ---------------------------------


def machine_checks(machine: Machine) -> list[Check]:
    """All of them, each in a fraction of a second."""
    found, installed = machine.ports(), 0.0
    with suppress(OSError):  # its files may not tell when they were made
        installed = os.stat(__file__).st_mtime
    return [
        python(),
        packages(),
        permissions(found),
        *port_grabbing_programs(machine, found),
        *adapters(machine),
        clock(time.time(), installed),
        locale(),
        terminal(),
        room(Path.cwd()),
        locks(machine),
    ]


def python() -> Check:
    """The interpreter."""
    found = ".".join(map(str, sys.version_info[:3]))
    if sys.version_info[:2] >= PYTHON:
        return Check("python", "ok", f"{found} ({sys.executable})")
    return Check("python", "fail", f"{found} is too old", f"install Python {'.'.join(map(str, PYTHON))} or newer")


def packages() -> Check:
    """Versions of what handctl needs."""
    from importlib import metadata

    wanted = needed()
    seen: list[str] = []
    missing: list[str] = []
    old: dict[str, str] = {}
    for name, oldest in wanted.items():
        try:
            version = metadata.version(name)
        except metadata.PackageNotFoundError:
            missing.append(name)
            continue
        seen.append(f"{name} {version}")
        if _numbers(version) < _numbers(oldest):
            old[name] = f"{name} {version} (needs {oldest})"
    evidence = ", ".join(seen) or "no package reports its version"
    if missing and not seen:
        return Check("packages", "skipped", "a single-file build does not report the versions of its parts")
    if missing or old:
        wrong = ", ".join([*(f"{name} is missing" for name in missing), *old.values()])
        lacking = " ".join(f"'{name}>={wanted[name]}'" for name in (*missing, *old))
        return Check(
            "packages", "fail", f"{wrong}. Installed: {evidence}", f"run `{sys.executable} -m pip install {lacking}`"
        )
    return Check("packages", "ok", evidence)


def _numbers(version: str) -> tuple[int, int, int]:
    """``8.10`` -> (8, 10, 0); what is no number counts as 0."""
    parts = ["".join(filter(str.isdigit, part)) for part in version.split(".")[:3]]
    major, minor, patch = (int(part or 0) for part in [*parts, "", "", ""][:3])
    return major, minor, patch


def permissions(found: list[Port]) -> Check:
    """Whether the serial ports that are plugged in may be opened."""
    if not found:
        return Check("permissions", "skipped", "no serial port is plugged in")
    closed = [port for port in found if not port.permitted]
    if closed:
        names = ", ".join(port.path for port in closed)
        return Check("permissions", "warning", f"cannot be opened: {names}", port_problems.permission_remedy(closed[0]))
    return Check("permissions", "ok", f"can be opened: {', '.join(port.path for port in found)}")


def port_grabbing_programs(machine: Machine, found: list[Port]) -> list[Check]:
    """ModemManager and brltty, of Linux: in the way only where there are serial ports."""
    if not machine.linux:
        return []
    running = {process.name: process for process in machine.port_grabbing_programs()}
    checks = []
    for name in GRABBERS:
        if name not in running:
            checks.append(Check(name.lower(), "ok", "not running"))
        elif not found and not machine.without_port():
            checks.append(Check(name.lower(), "ok", f"{running[name]} runs, but no serial port is plugged in"))
        else:
            checks.append(Check(name.lower(), "warning", *port_problems.grabber_problem(running[name], found)))
    return checks


def adapters(machine: Machine) -> list[Check]:
    """Adapters without a port, and CAN interfaces that reach no wrist."""
    checks = [Check("adapter", "warning", *port_problems.orphan(chip)) for chip in machine.without_port()]
    for interface in machine.can_interfaces():
        checks += [
            Check(problem.check, "warning", problem.text, problem.remedy)
            for problem in port_problems.can_problems(interface)
        ]
    return checks


def clock(now: float, installed: float) -> Check:
    """Logs carry the time of this computer: it cannot be earlier than the installation."""
    shown = time.strftime("%Y-%m-%d %H:%M:%S %z", time.localtime(now))
    if now + 86400 < installed:
        text = f"{shown} is before handctl was installed: logs and snapshots get wrong times"
        return Check("clock", "warning", text, advice.set_clock())
    return Check("clock", "ok", shown)


def locale() -> Check:
    """Units and bars need more than ASCII."""
    encoding = (getattr(sys.stdout, "encoding", None) or "").lower().replace("-", "")
    if encoding == "utf8":
        return Check("locale", "ok", "output is UTF-8")
    text = f"output is {encoding or 'of unknown encoding'}: °C comes out as deg C, other signs as \\xNN"
    return Check("locale", "warning", text, advice.set_encoding())


def terminal() -> Check:
    """Tables are made for 80 columns."""
    if not sys.stdout.isatty():
        return Check("terminal", "ok", "stdout is not a terminal")
    columns = shutil.get_terminal_size().columns
    if columns < WIDTH:
        text = f"{columns} columns: tables wrap"
        return Check("terminal", "warning", text, f"make the window {WIDTH} columns wide, or use --format plain")
    if not advice.terminal_is_named():
        return Check("terminal", "ok", f"{columns} columns")
    if os.environ.get("TERM", "") in ("", "dumb"):
        return Check(
            "terminal", "warning", "TERM is not set: no colours, no live view", "run `export TERM=xterm-256color`"
        )
    return Check("terminal", "ok", f"{os.environ['TERM']}, {columns} columns")


def room(folder: Path) -> Check:
    """Whether logs can be written here."""
    free = shutil.disk_usage(folder).free
    evidence = f"{folder}: {free / 1e6:.0f} MB free"
    if not os.access(folder, os.W_OK):
        return Check("disk", "warning", f"{folder} is not writable", "change to a folder of your own, or use -o FILE")
    if free < ROOM_LITTLE:
        remedy = "make room, or change to another disk: logs, traces and snapshots go here"
        return Check("disk", "fail" if free < ROOM_NONE else "warning", evidence, remedy)
    return Check("disk", "ok", evidence)


def locks(machine: Machine) -> Check:
    """Check for lock files of dead programs, which make other programs report the port as busy."""
    stale = machine.stale_locks()
    if not stale:
        return Check("locks", "ok", "no stale lock of a port")
    paths = " ".join(path for path, _ in stale)
    evidence = ", ".join(f"{path} of pid {pid}, which is gone" for path, pid in stale)
    return Check("locks", "warning", evidence, f"run `sudo rm {paths}`")


# -- a serial port before it is opened ---------------------------------------------------------------------------------


def port_checks(machine: Machine, link: str) -> list[Check]:
    """Permission, holder and latency timer of a serial port; skipped where the system knows none by that name."""
    port = machine.port(link)
    if port is None and link.startswith("usb:") and len(matching := machine.matching(link)) == 1:
        port = matching[0]
    if port is None:
        return []
    found = {problem.check: problem for problem in port_problems.port_problems(port)}

    def check(name: str, status: str, evidence: str) -> Check:
        problem = found.get(name)
        return Check(name, status, problem.text, problem.remedy) if problem else Check(name, "ok", evidence)

    return [
        check("permission", "fail", f"{port.path} may be read and written"),
        check("holder", "fail", "no other program has it open"),
        check(
            "latency_timer",
            "warning",
            f"{port.latency_ms} ms" if port.latency_ms is not None else "this adapter reports none",
        ),
    ]


# -- the command ---------------------------------------------------------------------------------------------------


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
            found.failure = Interrupted()
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
        yield Check("open", "fail", failure.text, failure.hint)
        yield Check("answer", "skipped", "the link is not open")
        yield from subnet(machine, host_in(name), reached=False)
        return
    speed = getattr(link, "baud", None)
    yield Check("open", "ok", f"{name} opens" + (f" at {speed} bit/s" if speed else ""))
    if kind is None:
        found, number, check = present(run, link, run.bound(link, FIND_SECONDS))
        if kind := found or None:
            run.family = family_of(kind)
            run.settings = run.settings._replace(id=run.settings.id or number)
        yield check
    bound = run.bound(link, LINK_SECONDS)
    family, probe = run.family, probe_of(kind) if kind is not None else None

    def device(on: Link, journal: Journal) -> Any:
        """On this connection, or on another one: what is left of the time is left for both."""
        timeout = run.settings.timeout or PING_TIMEOUT
        settings = run.settings._replace(retries=0, timeout=timeout, deadline=LINK_SECONDS)
        return family.open(on, run.in_time(link, settings), journal)

    looking = LinkChecks(link, probe, lambda on: device(on, run.journal), reads, bound, run.journal)
    run.prompts.progress(f"{name}: reading {reads} times")
    try:
        yield from looking.run()
        if probe is not None and looking.device is not None:
            yield from _on_network(machine, name, probe, looking.device, lambda on: device(on, Journal()))
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
    LinkScan(run, link, search, [run.settings.id or 1], False, bound).at(wire_of(link.name), SCAN_ORDER)
    if isinstance(link, ByteLink):
        listened(link, link.deadline(LATE).earlier(bound))  # answers that came too late are nobody's
    if search.rows:
        row = search.rows[0]
        speed = row.get("baud") if has_speed(link) else None
        set_speed(link, speed or was)
        where = "".join(
            (f" with id {row['id']}" if row["id"] is not None else "", f" at {speed} bit/s" if speed else "")
        )
        if row["family"] is None:
            return "", None, Check("device", "warning", f"an unknown device{where}: {row['evidence']}", LABEL_HINT)
        return row["family"], row["id"], Check("device", "ok", f"{row['family']}{where}: {row['evidence']}")
    for step, error in search.met.items():
        if error.code in DESTROYED:
            set_speed(link, step.speed or was)
            text = f"something replies like {step.family}, but no reply is complete: {error.text}"
            return step.family, None, Check("device", "warning", text, error.hint)
    set_speed(link, was)
    nobody = report([search], SCAN_ORDER, run.journal).failure
    assert nobody is not None
    return "", None, Check("device", "fail", nobody.text, nobody.hint)
