"""Who is there on a link that is open: by the rows of a scan, and where answers are destroyed, by whose they are.

Asks what a scan asks, and nothing else.
"""

from __future__ import annotations

from typing import NamedTuple

from handctl.errors import HandctlError
from handctl.families import SCANNED
from handctl.frame.run import Run
from handctl.link import ByteLink, Deadline, Link
from handctl.tools.machine_checks import Check
from handctl.tools.probes import has_speed, listened, wire_of
from handctl.tools.scan_look import Looking
from handctl.tools.scan_report import Search, Step, report

DESTROYED = ("bad-checksum", "cut-short", "wrong-id")
"""Codes of an answer that was one, of somebody who speaks this family's frames."""


LATE = 0.05


class Present(NamedTuple):
    """The family that answers, its id, and the row that says so; family "" = nobody that is known."""

    family: str
    id: int | None
    check: Check


def present(run: Run, link: Link, bound: Deadline) -> Present:
    """Look for a device of any family. Leaves the port at the speed at which it was found. Raises LinkError."""
    search, was = Search(link.name), getattr(link, "baud", None)
    Looking(run, link, search, [run.settings.id or 1], False, bound).at(wire_of(link.name), SCANNED)
    if isinstance(link, ByteLink):
        listened(link, link.deadline(LATE))  # answers that came too late are nobody's
    if search.rows:
        row = search.rows[0]
        speed = row.get("baud") if has_speed(link) else None
        _set(link, speed or was)
        where = "".join(
            (f" with id {row['id']}" if row["id"] is not None else "", f" at {speed} bit/s" if speed else "")
        )
        return Present(row["family"], row["id"], Check("device", "ok", f"{row['family']}{where}: {row['evidence']}"))
    if (damaged := _destroyed(search)) is not None:
        step, error = damaged
        _set(link, step.speed or was)
        text = f"something replies like {step.family}, but no reply is complete: {error.text}"
        return Present(step.family, None, Check("device", "warning", text, error.hint))
    _set(link, was)
    nobody = report([search], SCANNED, run.journal).failure
    assert nobody is not None
    return Present("", None, Check("device", "fail", nobody.text, nobody.hint))


def _destroyed(search: Search) -> tuple[Step, HandctlError] | None:
    """The first family whose answer came, and not whole."""
    return next(((step, error) for step, error in search.met.items() if error.code in DESTROYED), None)


def _set(link: Link, speed: int | None) -> None:
    if speed is not None and has_speed(link) and getattr(link, "baud", None) != speed:
        link.set_baud(speed)  # type: ignore[attr-defined]
