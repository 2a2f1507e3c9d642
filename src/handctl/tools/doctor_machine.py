"""The checks of `handctl doctor` for this computer: versions, permissions, interfering programs, disk space, clock."""

from __future__ import annotations

import os
import shutil
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from handctl.model.checks import Check
from handctl.system import advice
from handctl.tools import ports as port_tool
from handctl.tools.port_inventory import Machine, Port, needed

PYTHON = (3, 10)
ROOM_LITTLE, ROOM_NONE = 100_000_000, 5_000_000
"""Bytes: logs and traces need room."""
WIDTH = 80


Verdict = tuple[str, str] | tuple[str, str, str] | tuple[str, str, str, tuple[tuple[str, Any], ...]]
"""What a check found: status, evidence, and where there are such a remedy and numbers."""


def machine_checks(machine: Machine) -> list[Check]:
    """All of them, each in a fraction of a second."""
    found, installed = machine.ports(), 0.0
    with suppress(OSError):  # its files may not tell when they were made
        installed = os.stat(__file__).st_mtime
    return [
        python(),
        packages(),
        permissions(found),
        *grabbers(machine, found),
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
        return Check("permissions", "warning", f"cannot be opened: {names}", port_tool.permission_remedy(closed[0]))
    return Check("permissions", "ok", f"can be opened: {', '.join(port.path for port in found)}")


def grabbers(machine: Machine, found: list[Port]) -> list[Check]:
    """ModemManager and brltty, of Linux: in the way only where there are serial ports."""
    if not machine.linux:
        return []
    running = {process.name: process for process in machine.grabbers()}
    checks = []
    for name in ("ModemManager", "brltty"):
        if name not in running:
            checks.append(Check(name.lower(), "ok", "not running"))
        elif not found and not machine.without_port():
            checks.append(Check(name.lower(), "ok", f"{running[name]} runs, but no serial port is plugged in"))
        else:
            checks.append(Check(name.lower(), "warning", *port_tool.grabber_problem(running[name], found)))
    return checks


def adapters(machine: Machine) -> list[Check]:
    """Adapters without a port, and CAN interfaces that reach no wrist."""
    checks = [Check("adapter", "warning", *port_tool.orphan(chip)) for chip in machine.without_port()]
    for interface in machine.can_interfaces():
        checks += [
            Check(problem.check, "warning", problem.text, problem.remedy)
            for problem in port_tool.can_problems(interface)
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
    found = {problem.check: problem for problem in port_tool.problems(port)}

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
