"""What the audit logs remember: the policy holds for any EksoNR that was written to, not for one run, port or log.

An EksoNR reports nothing that tells it from another, and a port's name or number leads to another one after it was plugged in
again. So each write of the last seconds counts, but those to simulators, which are what their LINK says. How old an entry is at least, the monotonic clock proves: it never goes
back, and since a restart of this machine at least its uptime has passed. The wall clock, which is set, decides only over entries
of another machine, and one from the future is refused. Knows nothing of the device.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from datetime import datetime, timezone
from typing import Any, NamedTuple

from handctl.devices.ekso import gates
from handctl.devices.ekso.audit import AuditLog

WINDOW = 10.0
"""Seconds: a step is measured against each value of so long."""
NOT_SENT = "not sent"
"""How the verdict on a write begins that never went out."""


class Past(NamedTuple):
    """A write of the last seconds: when at the earliest on the link's clock, which setting, its raw values."""

    at: float
    name: str
    old: int
    new: int


def recent(audit: AuditLog, now: float) -> list[Past]:
    """The writes to any EksoNR within the last WINDOW seconds, the newest first; `now` is the link's clock.

    A write whose result nobody noted counts. Raises CheckFailed where a log does not tell: nothing may be written then.
    """
    found = [past for log in audit.every for past in _recent(log, now)]
    return sorted(found, key=lambda past: past.at, reverse=True)


def _recent(audit: AuditLog, now: float) -> list[Past]:
    found: list[Past] = []
    ended: dict[str, tuple[float, bool]] = {}
    for entry in _entries(audit):
        if not _counts(entry, audit.always):
            continue
        age = _age(entry, now, audit)
        name = str(entry["name"])
        if entry["event"] == "result":
            ended[name] = age, str(entry.get("verdict", "")).startswith(NOT_SENT)
            continue
        age, unsent = ended.pop(name, (age, False))
        if age > WINDOW:
            break
        if not unsent:
            found.append(Past(now - age, name, entry["old"]["raw"], entry["new"]["raw"]))
    return found


def _entries(audit: AuditLog) -> Iterator[dict[str, Any]]:
    """Intents and results from the last to the first that the tail of the log holds whole."""
    unfit = {finding.line for finding in audit.checked().findings}
    for line in reversed(audit.tail()):
        if not line.strip() or _torn(line):
            continue
        try:
            entry = json.loads(line)
            if not isinstance(entry, dict):
                raise TypeError(line)
            if line.rstrip() in unfit:
                _refuse(audit, gates.EDITED)
            elif entry.get("event") == "intent":
                unfit = set()  # it was not refused: what had been done by hand before it was long past
            if entry.get("event") not in ("intent", "result"):
                continue
            moments = float(entry["host_monotonic_s"]), datetime.fromisoformat(entry["utc"]).timestamp()
            if entry["event"] == "intent" and not all(isinstance(entry[key]["raw"], int) for key in ("old", "new")):
                raise TypeError(line)
            if not isinstance(entry["name"], str) or any(moment != moment for moment in moments):
                raise TypeError(line)
        except (ValueError, TypeError, KeyError, RecursionError):
            _refuse(audit, gates.DAMAGED)
            continue
        yield entry


def _torn(line: bytes) -> bool:
    """Half a line of a killed writer: an intent that was not whole on the disk was never sent, and a result follows its intent."""
    return line.startswith(b'{"event"') and not line.rstrip().endswith(b"}")


def _counts(entry: Mapping[str, Any], always: Mapping[str, Any]) -> bool:
    """Whether the entry may be of the device that is written to now."""
    if not (entry.get("simulated") or always.get("simulated")):
        return True
    return bool(entry.get("place", entry.get("port")) in (always.get("place"), always.get("port")))


def _age(entry: Mapping[str, Any], now: float, audit: AuditLog) -> float:
    """Seconds that have passed since at least. Raises CheckFailed for what lies in the future."""
    noted = float(entry["host_monotonic_s"])
    bound = now - noted if noted <= now else now  # the machine has restarted since: its clock began at 0 then
    if entry.get("host") == audit.always.get("host"):
        return bound
    passed = (datetime.now(timezone.utc) - datetime.fromisoformat(entry["utc"])).total_seconds()
    if passed < 0:
        raise gates.refusal(
            gates.CLOCK,
            f"{audit.path}: the last write was at {entry['utc']}, which is {-passed:.0f} s in the future, so a clock was set back",
            "set the clock of this computer, then repeat the command. Nothing was sent.",
        )
    return min(bound, passed)


WRONG = {
    gates.EDITED: ("its last entries were edited or removed by hand", " `handctl ekso policy` shows which."),
    gates.DAMAGED: ("its end is damaged", ""),
}


def _refuse(audit: AuditLog, gate: str) -> None:
    """Raise CheckFailed for what was done to the log by hand or by a fault, if that may be of the last seconds."""
    if datetime.now(timezone.utc).timestamp() - audit.changed_at() > WINDOW:
        return
    wrong, more = WRONG[gate]
    raise gates.refusal(
        gate,
        f"{audit.path}: {wrong}, so handctl does not know what was written last, and when",
        f"repeat the command in {WINDOW:.0f} s, when the last write no longer matters.{more} Nothing was sent.",
    )
