"""The checks of `handctl doctor` that concern a serial port before it is opened: permission, holder, latency timer."""

from __future__ import annotations

from handctl.tools import ports as port_tool
from handctl.tools.machine import Machine, Port
from handctl.tools.machine_checks import Check


def port_checks(machine: Machine, link: str) -> list[Check]:
    """Permission, holder and latency timer of a serial port; skipped where the system knows none by that name."""
    port = machine.port(link)
    if port is None and link.startswith("usb:"):
        wanted = link.lower().removeprefix("usb:")
        matching = [each for each in machine.ports() if each.usb.lower().startswith(wanted)]
        port = matching[0] if len(matching) == 1 else None
    if port is None:
        return []
    found = {problem.check: problem for problem in port_tool.problems(port)}

    def check(name: str, status: str, evidence: str) -> Check:
        problem = found.get(name)
        return Check(name, status, problem.text, problem.remedy) if problem else Check(name, "ok", evidence)

    return [
        check("permission", "fail", f"{port.path} may be read and written"),
        check("holder", "fail", "no other program has it open"),
        check("latency_timer", "warning", _timer(port)),
    ]


def _timer(port: Port) -> str:
    return f"{port.latency_ms} ms" if port.latency_ms is not None else "this adapter reports none"
