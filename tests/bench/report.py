"""The figures as a table for people, as JSON, and as the section of a guide that shows the last result."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import re
from collections.abc import Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from tests.bench.measure import Figure

TOP = Path(__file__).parent.parent.parent
LAST = Path(__file__).parent / "last.json"
"""The result that GUIDE shows; written by --guide only."""
GUIDE = TOP / "src/handctl/guides/development.md"
SCHEMA = "handctl-bench/1"
SECTION = re.compile(r"(<!-- figures: [^>]*-->\n).*?(<!-- end -->)", re.DOTALL)
COLUMNS = ("figure", "value", "floor or peer", "ratio", "goal", "verdict")
WIDTHS = (52, 12, 34, 5, 6, 8)
"""Of COLUMNS on a terminal."""


def content(
    figures: Sequence[Figure], *, quick: bool, peers: Mapping[str, str], absent: Sequence[str]
) -> dict[str, Any]:
    """What the JSON file holds: the class of machine, never its name."""
    return {
        "schema": SCHEMA,
        "date": datetime.now(timezone.utc).date().isoformat(),
        "python": platform.python_version(),
        "source": source(),
        "machine": f"{os.cpu_count()} cores {platform.machine()}",
        "quick": quick,
        "peers": dict(peers),
        "absent": list(absent),
        "figures": [figure.as_row() for figure in figures],
    }


def cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    """One figure's cells, as COLUMNS."""
    if row["value"] is None:
        return (row["name"], "", "", "", "", row["verdict"])
    goal = "" if row["goal"] is None else f"≤ {row['goal']:.2f}"
    floor = f"{row['floor']:.4g} {row['unit']} ({row['against']})"
    ratio = f"{row['ratio']:.2f}"
    if row["verdict"] == "missed" and ratio == f"{row['goal']:.2f}":
        ratio = f"{row['ratio']:.3f}"  # rounded, it would look met
    return (row["name"], f"{row['value']:.4g} {row['unit']}", floor, ratio, goal, row["verdict"])


def line(row: Mapping[str, Any]) -> str:
    """A figure in a terminal, its note at the end."""
    padded = (text.ljust(width) for text, width in zip(cells(row), WIDTHS, strict=True))
    return "  ".join([*padded, row["note"]]).rstrip()


def source() -> str:
    """A checksum of all code that is measured."""
    digest = hashlib.sha256()
    for path in sorted((TOP / "src/handctl").rglob("*.py")):
        digest.update(path.relative_to(TOP).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]


def age() -> str:
    """Whether the published figures were measured on this code. Old figures refuse nothing, but somebody must be told."""
    last = json.loads(LAST.read_text(encoding="utf-8"))
    if last.get("source") == source():
        return "The figures in handctl-development(7) were measured on this code."
    return (
        f"The figures in handctl-development(7) are from {last['date']}, and the code has changed since. "
        "`python -m tests.bench --peers --guide` measures it again."
    )


def guide(text: str, last: Mapping[str, Any]) -> str:
    """The page with its section of figures made anew. Raises ValueError when it has none."""
    head = [
        f"{last['date']}, Python {last['python']}, {last['machine']}{', quick run' if last['quick'] else ''}. "
        "A ratio is value / floor or peer; lower is better.",
        "",
        f"| {' | '.join(COLUMNS)} |",
        "|---|---|---|---|---|---|",
    ]
    lines = [*head, *(f"| {' | '.join(cells(row))} |" for row in last["figures"])]
    if last["absent"]:
        lines += ["", f"Not installed for this run: {', '.join(last['absent'])}."]
    filled, count = SECTION.subn(lambda found: found[1] + "\n".join(lines) + "\n" + found[2], text)
    if count != 1:
        raise ValueError("the guide has no section of figures")
    return filled


def dumps(found: Mapping[str, Any]) -> str:
    """The JSON file's text."""
    return json.dumps(found, indent=1, ensure_ascii=False) + "\n"


def publish(found: Mapping[str, Any]) -> None:
    """Write the last result and the guide's section of it."""
    page = GUIDE
    filled = guide(page.read_text(encoding="utf-8"), found)
    LAST.write_text(dumps(found), encoding="utf-8")
    page.write_text(filled, encoding="utf-8")
