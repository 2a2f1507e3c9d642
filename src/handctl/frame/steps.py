"""The exact bytes of a plan as a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from handctl.model.result import Column, Table

if TYPE_CHECKING:
    from handctl.model.param import Step


def plan_table(steps: Sequence[Step]) -> Table:
    """The exact bytes of a plan."""
    rows = [
        {"step": number, "bytes": step.wire, "meaning": step.meaning, "moves": step.moves, "strands": step.strands}
        for number, step in enumerate(steps, 1)
    ]
    columns = (Column("step", "Step", right=True), Column("bytes", "Bytes"), Column("meaning", "Meaning"))
    return Table(rows=rows, columns=columns, plain=("bytes",))
