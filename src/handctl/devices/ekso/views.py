"""How people see the words of an EksoNR: units, codes in words, bits in hex, boot time; old and new of a written setting."""

from __future__ import annotations

from handctl.devices.ekso.map import EKSO, FEEDBACK, MESSAGES, Word, boot_ms, boot_text
from handctl.model.result import Cell, Grid, Row


def words_view(rows: list[Row]) -> list[Grid]:
    """One line a word, with as many decimals as the wire has, bits in hex; units and codes in words."""
    ids = any(row.get("id") is not None for row in rows)
    headings = ("Name", *(["ID"] if ids else []), "Value", "Unit", "Meaning")
    lines = []
    for row in rows:
        identity = [str(row["id"]) if row.get("id") is not None else ""] if ids else []
        lines.append((row["name"], *identity, _value_cell(row), row["unit"] or "", _meaning(row)))
    notes = dict.fromkeys(f"{row['name']}: {row['error']}" for row in rows if "error" in row)
    boot = {row["name"]: row.get("raw") for row in rows}
    high, low = boot.get("boot_time_high"), boot.get("boot_time_low")
    uptime = [f"boot {boot_text(boot_ms([high, low]))}"] if isinstance(high, int) and isinstance(low, int) else []
    right = frozenset({1, 2} if ids else {1})
    return [Grid(headings, tuple(lines), right=right, notes=(*uptime, *notes))]


def written_view(rows: list[Row]) -> list[Grid]:
    """Old and new side by side."""
    lines = [
        (row["name"], str(row["id"]), EKSO[row["name"]].shown(row["before"]), EKSO[row["name"]].shown(row["value"]))
        for row in rows
    ]
    return [Grid(("Name", "ID", "Before", "Now"), tuple(lines), right=frozenset({1, 2, 3}))]


def _param_of(row: Row) -> Word | None:
    name = row["name"]
    return EKSO[name] if name in EKSO else next((param for param in FEEDBACK if param.name == name), None)


def _value_cell(row: Row) -> str | Cell:
    if "error" in row:
        return Cell("?", "bad")
    param = _param_of(row)
    return param.text(row["value"]) if param is not None else str(row["value"])


def _meaning(row: Row) -> str | Cell:
    label = row.get("label") or ""
    return Cell(label, "warn") if label.startswith("unknown") else label


def dump_view(rows: list[Row]) -> list[Grid]:
    """A grid per message."""
    grids = []
    clocks = [row for row in rows if row["message"] in ("date", "time")]
    if clocks:
        line = "  ".join(str(row.get("value", "?")) for row in clocks)
        grids.append(Grid(("Date and time",), ((line,),), title="EksoNR"))
    for message in MESSAGES:
        (grid,) = words_view([row for row in rows if row["message"] == message])
        grids.append(grid._replace(title=message.capitalize()))
    return grids
