"""What must hold for a value to mean what it seems to: initialized, a gauge, a firmware that has it. Pure; sends nothing."""

from __future__ import annotations

import re
from collections.abc import Sequence

from handctl.devices.barrett.map import BARRETT
from handctl.model.result import Journal, Row

NOT_HOMED = "not initialized: P counts from the position at power-on and means nothing before HI (barrett §5.2.1)"
NO_GAUGE = "no gauge (barrett §5.3.2)"
FIRST = {"4.34": (4, 3, 4), "4.4": (4, 4, 0)}
"""Firmware that a parameter's `since` names, as numbers."""


def mark_not_homed(rows: Sequence[Row]) -> None:
    """Say of each position whose motor's status stands beside it whether it means anything."""
    status = {row["motor"]: row.get("value") for row in rows if row.get("parameter") == "S"}
    for row in rows:
        code = status.get(row["motor"]) if row.get("parameter") == "P" and "value" in row else None
        if code is not None:
            row["doubt"] = NOT_HOMED if int(code) & 4 else None


def later_settings(firmware: str, journal: Journal) -> list[str]:
    """Names of the settings that came with later firmware and this one has (dossier 6.5)."""
    later = [param for param in BARRETT if param.since and param.writable]
    known = re.search(r"(\d+)\.(\d)(\d?)", firmware.replace("_", "."))
    if known is None:
        names = " ".join(param.mnemonic for param in later)
        journal.warn("later-firmware", f"the firmware does not report its version, so {names} were not read")
        return []
    version = tuple(int(digit or 0) for digit in known.groups())
    return [param.name for param in later if version >= FIRST[param.since]]
