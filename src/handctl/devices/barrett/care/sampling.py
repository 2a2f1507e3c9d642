"""How the live views of care take a moment for the kernel's sampler. Knows no parameter."""

from __future__ import annotations

from collections.abc import Callable

from handctl.errors import HandctlError, NoAnswer, ProtocolError
from handctl.model.result import Row
from handctl.model.sampling import ReadRows


def moments(read: Callable[[], list[Row]]) -> ReadRows:
    """`read` for a Sampler: a moment without a valid answer repeats the last rows with the error as value."""
    rows: list[Row] = []

    def moment() -> tuple[list[Row], HandctlError | None]:
        nonlocal rows
        try:
            rows = read()
        except (NoAnswer, ProtocolError) as exc:
            return [_failed(row, exc.text) for row in rows], exc
        return rows, None

    return moment


def _failed(row: Row, text: str) -> Row:
    return {**{key: value for key, value in row.items() if key != "value"}, "error": text}
