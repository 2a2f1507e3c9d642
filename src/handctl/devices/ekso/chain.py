"""The chain of the audit log: each entry ends with a hash over itself and the entry before it.

    {"event": "intent", …, "chain": "<SHA-256 of the chain before, then of this line without its own>"}

An entry that was edited does not fit its hash; where one was removed, added or moved, the next does not fit. What was cut off at
the end does not show, and who knows this can write a new chain: it shows an edit, it is no signature. Knows lines, no file.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

_LINK = re.compile(rb', "chain": "([0-9a-f]{64})"\}$')


class Finding(NamedTuple):
    """A line of the log that does not fit: its number, counted from 1, the line, and what is wrong with it."""

    number: int
    line: bytes
    text: str


class Checked(NamedTuple):
    """A log that was looked through: entries with a hash, older ones without, halves of killed writers, what is wrong."""

    chained: int
    unchained: int
    torn: int
    findings: tuple[Finding, ...]


def linked(entry: bytes, before: str) -> bytes:
    """A JSON object as the line of an entry behind `before`."""
    return entry[:-1] + b', "chain": "' + _digest(before.encode() + entry).encode() + b'"}'


def held(lines: Iterable[bytes]) -> str:
    """What the next entry builds on, the lines given from the last to the first; "" for the first entry."""
    for line in lines:
        if (link := _link(line.rstrip())) is not None:
            return link
    return ""


ENTRY = 8192
"""Bytes kept of a line that is no entry of the chain: no entry of ours is longer."""


def check(lines: Iterable[bytes], *, whole: bool = True) -> Checked:
    """Look through a log; without `whole` the lines begin somewhere in it, and the first is taken as it is."""
    before = "" if whole else None
    counts = {"chained": 0, "unchained": 0, "torn": 0}
    findings: list[Finding] = []
    for number, raw in enumerate(lines, 1):
        line = raw.rstrip()
        if not line:
            continue
        found, link = _LINK.search(line), _link(line)
        if found is not None:
            counts["chained"] += 1
            if before is not None and _digest(before.encode() + line[: found.start()] + b"}") != link:
                findings.append(
                    Finding(number, line[:ENTRY], "was edited, or an entry before it is missing or was moved")
                )
        elif link is not None and not counts["chained"]:
            counts["unchained"] += 1  # of a handctl that knew no chain
        elif link is None and line.startswith(b'{"event"'):
            counts["torn"] += 1  # half a line of a killed writer
        else:
            findings.append(
                Finding(number, line[:ENTRY], "has no hash: an older handctl wrote it, or it was added by hand")
            )
        before = link if link is not None else before
    return Checked(**counts, findings=tuple(findings))


def told(checked: Checked) -> Iterator[str]:
    """The findings for people: ``line 7 (2026-11-22T10:00:00.000+00:00, intent step_length) was edited, …``."""
    for finding in checked.findings:
        try:
            entry = json.loads(finding.line)
            words = f"{entry['utc']}, {entry['event']} {entry.get('name', '')}".rstrip()
        except (ValueError, TypeError, KeyError, RecursionError):
            words = "no entry"
        yield f"line {finding.number} ({words}) {finding.text}"


def _link(line: bytes) -> str | None:
    """What the entry behind this line builds on; None for a line that is no whole entry."""
    found = _LINK.search(line)
    if found is not None:
        return found[1].decode()
    try:
        return _digest(line) if isinstance(json.loads(line), dict) else None
    except (ValueError, RecursionError):
        return None


def _digest(data: bytes) -> str:
    import hashlib

    return hashlib.sha256(data).hexdigest()
