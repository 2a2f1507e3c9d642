"""Troubleshooting as checks that only read (barrett §8, with the limits of `health`), and what is left for hands.

Without an answer there are rows all the same: the speeds that were tried, and every other check skipped. A warning or a
fail is a finding. Nothing here moves the hand or writes to it; `trials` does, when it is asked to.
"""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.barrett.care import health
from handctl.devices.barrett.care.checks import CHECKS, Patient, said
from handctl.devices.barrett.care.health import FAIL, OK, SKIPPED, Finding
from handctl.devices.barrett.care.symptoms import SYMPTOMS, Symptom, like
from handctl.devices.barrett.device import BarrettHand
from handctl.errors import CheckFailed, DeviceRefused, HandctlError, LinkError, NoAnswer, ProtocolError, UsageError
from handctl.model.result import Cell, Column, Grid, Row, Table
from handctl.sentence import plural

COLUMNS = (
    Column("check", "Check"),
    Column("status", "Status"),
    Column("evidence", "Evidence"),
    Column("remedy", "Remedy"),
    Column("source", "Section"),
)
USUAL = ("firmware", "status", "can_move", "parameters", "over_temperature_limit", "temperature", "odometer", "strain")
"""The checks after `communication`, in the order of their rows."""
BY_HAND = "by_hand"
MOST_INVALID = 2
"""After so many checks without a valid answer the rest is skipped."""


# -- communication ------------------------------------------------------------------------------------------------


def communication(hand: BarrettHand, speed: int | None) -> Finding:
    """A prompt at one of the speeds; each that was tried with what came. Raises LinkError when the port fails."""
    link, line = hand.link, hand.line
    if speed is not None:
        line.only = speed
    error: HandctlError | None = None
    try:
        line.connect()
    except (NoAnswer, ProtocolError, DeviceRefused) as exc:
        error = exc
    seen = []
    for baud, came in line.tried if error is not None else line.tried[:-1]:
        what = f"{plural(len(came), 'byte')} arrived: {came[:24].hex(' ').upper()}" if came else "silence"
        seen.append(f"{baud}: {what}" if baud else what)
    if error is None:
        where = f"prompt at {line.link.baud} bit/s" if line.link.can_set_baud else "prompt"
        before = f" (before: {', '.join(seen)})" if seen else ""
        return Finding("communication", OK, where + before, source="barrett §5.1.1")
    if line.over:
        seen.append("--deadline has passed")
    if isinstance(error, DeviceRefused):
        evidence = f"{error.text}. Tried {', '.join(seen)}" if seen else error.text
        return Finding("communication", FAIL, evidence, error.hint, "barrett §3.7")
    if speed is not None:
        seen.append("no other baud rate, because of --baud")
    evidence = f"{link.name}: no prompt ({', '.join(dict.fromkeys(seen))})"
    return Finding("communication", FAIL, evidence, error.hint, "barrett §8, §3.3")


def symptom_of(name: str) -> Symptom:
    """The entry of the book. Raises UsageError with near names."""
    if name not in SYMPTOMS:
        likely = like(name.lower())
        meant = f"did you mean {' or '.join(likely)}? " if likely else ""
        raise UsageError(
            f"{name!r} is not a symptom in the manual",
            hint=f"{meant}`handctl barrett diagnose --list` shows them all",
            code="unknown-name",
        )
    return SYMPTOMS[name]


# -- all together -------------------------------------------------------------------------------------------------


def examine(patient: Patient, names: Sequence[str], speed: int | None) -> tuple[list[Finding], LinkError | None]:
    """Communication, then the checks by name; all skipped once the line is dead. The link's own failure beside them."""
    try:
        found = [communication(patient.hand, speed)]
    except LinkError as exc:
        found = [Finding("communication", FAIL, exc.text, exc.hint, "barrett §3.3")]
        return [*found, *_skipped(names)], exc
    if found[0].status == FAIL:
        return [*found, *_skipped(names)], None
    invalid = 0
    for place, name in enumerate(names):
        rest = names[place + 1 :]
        try:
            found += CHECKS[name](patient)
        except LinkError as exc:
            found[0] = Finding("communication", FAIL, exc.text, exc.hint, "barrett §3.3")
            return [*found, *_skipped(names[place:])], exc
        except (NoAnswer, ProtocolError) as exc:
            invalid += 1
            found.append(Finding(name, FAIL, exc.text, exc.hint, "barrett §8"))
            if isinstance(exc, NoAnswer) or invalid == MOST_INVALID:  # each has been repeated: waiting on is no use
                return [*found, *_skipped(rest)], None
        except HandctlError as exc:
            found.append(Finding(name, FAIL, said(exc), exc.hint, "barrett §5.1.3"))
    return found, None


def _skipped(names: Sequence[str]) -> list[Finding]:
    return [Finding(name, SKIPPED, "no communication") for name in names]


def by_hand(symptom: str) -> list[Finding]:
    """What is left of the manual's list for `symptom`: rows that no program can check."""
    return [
        Finding(f"{BY_HAND}.{number}", SKIPPED, "to be done by hand", text, f"barrett {source}")
        for number, (text, source) in enumerate(SYMPTOMS[symptom].steps, 1)
    ]


def table_of(hand: BarrettHand, findings: list[Finding], symptom: str | None, failure: LinkError | None) -> Table:
    """The rows; a warning or a fail is exit 7, a lost link its own 3."""
    rows = [finding.row() for finding in findings]
    if symptom is not None:
        rows += [finding.row() for finding in by_hand(symptom)]
    bad = [finding for finding in findings if finding.bad]
    table = Table(rows=rows, columns=COLUMNS, view=view)
    if failure is not None:
        table.failure = failure
    elif bad:
        fails = sum(finding.status == FAIL for finding in bad)
        warnings = len(bad) - fails
        names = ", ".join(finding.check for finding in bad)
        table.failure = CheckFailed(
            f"{hand.link.name}: {fails} failed, {warnings} warning{'' if warnings == 1 else 's'}: {names}",
            hint=f"follow the remedy in each row{'. `handctl barrett diagnose --list` shows the symptoms' if symptom is None else ''}",
            code="findings",
        )
    return table


def view(rows: list[Row]) -> list[Grid]:
    """Check, status and evidence; below them what to do about the findings, then the steps by hand."""
    checks = [row for row in rows if not row["check"].startswith(BY_HAND)]
    lines = tuple(
        (row["check"], Cell(row["status"], health.TONES[row["status"]]), row["evidence"]) for row in checks
    )  # fmt: skip
    todo: dict[str, list[str]] = {}
    for row in checks:
        if row["remedy"] and row["status"] != OK:
            todo.setdefault(f"{row['remedy']}{_section(row)}", []).append(row["check"])
    remedies = [f"  {', '.join(dict.fromkeys(names))}: {text}" for text, names in todo.items()]
    steps = [
        f"  {number}. {row['remedy']}{_section(row)}"
        for number, row in enumerate((row for row in rows if row["check"].startswith(BY_HAND)), 1)
    ]
    notes = [*(["To do:"] if remedies else []), *remedies, *(["Then, by hand:"] if steps else []), *steps]
    return [Grid(("Check", "Status", "Evidence"), lines, notes=tuple(notes))]


def _section(row: Row) -> str:
    return f" ({row['source']})" if row["source"] else ""


def list_table() -> Table:
    """All symptoms of the book; needs no hand."""
    rows: list[Row] = [
        {
            "symptom": name,
            "title": entry.title,
            "checks": list(entry.checks),
            "moves": bool(entry.trials),
            "steps": len(entry.steps),
        }
        for name, entry in SYMPTOMS.items()
    ]
    columns = (Column("symptom", "Symptom"), Column("title", "Description"), Column("moves", "Has --move"))
    return Table(rows=rows, columns=columns)
