"""A command that ends in the middle shows what it had read: a lost link, silence, damage, for every family."""

from __future__ import annotations

import pytest

from handctl.families import FAMILIES
from handctl.sim import folder_of
from tests.contract.facts import facts_of
from tests.support.cli import run
from tests.support.each_row import each_row

CASES = [
    pytest.param(family, more, id=" ".join((family, *more)))
    for family in FAMILIES
    for more in ((), *([("bus=can",)] if "can" in getattr(folder_of(family), "WIRES", ()) else []))
]
ENDS = {"disconnect": 3, "silent": 4, "truncate": 5}


@each_row("fault", ENDS)
@each_row(("family", "more"), CASES)
def test_what_was_read_is_there(family: str, more: tuple[str, ...], fault: str) -> None:
    link, before = facts_of(family).link(family, "dump", *more), facts_of(family).broken_from
    whole = run(family, "dump", "-p", link, "--json")
    assert whole.code == 0
    seen = 0
    for after in range(before, before + 8):
        done = run(
            family, "dump", "-p", f"{link}&fault={fault}&after={after}", "--json", "--deadline", "20", "--retries", "0"
        )
        if done.code == 0:
            break
        rows = done.json["rows"]
        values = {(row["name"], str(row.get("motor") or row.get("finger"))) for row in rows if "value" in row}
        if done.json["counters"]["received"] > before:
            assert done.code in (ENDS[fault], 4, 5), done
        if values:
            seen += 1
            assert len(rows) <= len(whole.rows)
            assert all("error" in row for row in rows if "value" not in row)
    several = before > 0 and whole.json["counters"]["received"] > 1  # one answer with all values has no middle
    assert bool(seen) is several, f"{family} under {fault}: {seen} runs showed what they had read"
