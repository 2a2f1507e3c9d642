"""CSV: one row per value, or wide: one row per sample with a column per quantity. Knows no sink and no terminal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from handctl.model.param import scale_of
from handctl.model.result import Column, Row, name_of
from handctl.screen.sanitize import text_of

if TYPE_CHECKING:
    from handctl.screen.render import Context


UNITS = {
    "raw_counts": "raw counts", "a": "A", "raw": "",
    **{unit: unit for unit in ("cts/sample²", "cts/sample", "bit/s", "steps", "cts", "deg", "mA", "°C", "mm", "ms", "in", "A", "g", "s", "%", "°")},
}  # fmt: skip
"""What a heading may end with behind a "_", and the unit: those of all maps, and what the columns of a log have of them."""
REMARKS = ("guard", "doubt")
"""Keys of a row with a text about its value: one column for all quantities of a sample."""


def csv_cell(text: str) -> str:
    """A printable text as a cell, as `csv.writer` has it, which looks at each character by itself."""
    return '"' + text.replace('"', '""') + '"' if "," in text or '"' in text else text


def csv_lines(
    columns: Sequence[Column], rows: Sequence[Row], guard: Callable[[str], str], *, header: bool, with_errors: bool
) -> str:
    """With or without a last column for errors, which must be the same for all lines of a stream."""
    import csv
    import io

    buffer = io.StringIO()
    writer = csv.writer(buffer)  # RFC 4180: CRLF, quotes doubled
    with_errors = with_errors and all(column.key != "error" for column in columns)
    if header:
        writer.writerow([column.csv_name for column in columns] + (["error"] if with_errors else []))
    for row in rows:
        writer.writerow(
            [guard(text_of(row.get(column.key))) for column in columns]
            + ([guard(text_of(row.get("error")))] if with_errors else [])
        )
    return buffer.getvalue()


def column_of(row: Row) -> str:
    """The heading of its column: ``temperature.index_°C``, in a person's unit."""
    scale = scale_of(row.get("unit") or "")
    unit = str(scale.unit if scale is not None else row.get("unit") or "").replace(" ", "_")
    return f"{name_of(row)}_{unit}" if unit else name_of(row)


def of_column(heading: str) -> tuple[str, str, str]:
    """Name, part and unit of a heading: ``temperature.index_°C`` -> temperature, index, °C."""
    end = next((end for end in UNITS if heading.endswith(f"_{end}")), None)
    name, _, part = (heading if end is None else heading.removesuffix(f"_{end}")).partition(".")
    return name, part, UNITS.get(end or "", "")


def in_persons_unit(row: Row) -> Any:
    """The value of a row, without the factor of its unit; None where it was not read."""
    value = row.get("value")
    scale = scale_of(row.get("unit") or "")
    return scale.of(value) if scale is not None and isinstance(value, int | float) else value


def is_wide(context: Context, rows: Sequence[Row], *, by_default: bool) -> bool:
    """Whether these rows become one line: quantities, each once, where that is asked for or usual."""
    wished = by_default if context.settings.wide is None else context.settings.wide
    columns = [column_of(row) for row in rows if "name" in row and ("value" in row or "error" in row)]
    return wished and bool(columns) and len(set(columns)) == len(columns) == len(rows)


class Wide:
    """The lines of samples. The first one says which columns there are, behind those of its moment."""

    def __init__(self, rows: Sequence[Row], moment: Row) -> None:
        remarks = [key for key in REMARKS if any(key in row for row in rows)]
        self._columns = [Column(column) for column in (*moment, *map(column_of, rows))]
        self._columns += [Column(key) for key in remarks]
        self._known = {column.key for column in self._columns}
        self._header = True
        self.left_out: dict[str, None] = {}
        """Columns that later samples had and the first one had not."""

    def line(self, rows: Sequence[Row], guard: Callable[[str], str], moment: Row) -> str:
        """One sample."""
        found: Row = moment | {column_of(row): in_persons_unit(row) for row in rows}
        self.left_out |= dict.fromkeys(found.keys() - self._known)
        for key in (*REMARKS, "error"):
            remarks = [f"{name_of(row)}: {row[key]}" for row in rows if row.get(key)]
            found[key] = "; ".join(remarks) if key != "error" else "; ".join(_once(rows))
        header, self._header = self._header, False
        return csv_lines(self._columns, [found], guard, header=header, with_errors=True)


def _once(rows: Sequence[Row]) -> list[str]:
    """Each error once, with what it kept from being read."""
    kept: dict[str, list[str]] = {}
    for row in rows:
        if row.get("error"):
            kept.setdefault(str(row["error"]), []).append(name_of(row))
    return [f"{', '.join(names)}: {error}" for error, names in kept.items()]
