"""A command that ends in the middle shows what it had read: a lost link, silence, damage, for every family."""

from __future__ import annotations

import pytest

from tests.support.cli import run

CASES = {  # family -> (fake link, answers before the fault begins)
    "exo": ("fake://exo?clock=virtual", 1),
    "wrist": ("fake://wrist?clock=virtual&bus=can", 1),
    "barrett": ("fake://barrett?clock=virtual&initialized=1", 4),
    "ekso": ("fake://ekso?clock=virtual", 2),
}
ENDS = {"disconnect": 3, "silent": 4, "truncate": 5}


@pytest.mark.parametrize("fault", ENDS)
@pytest.mark.parametrize("family", CASES)
def test_what_was_read_is_there(family: str, fault: str) -> None:
    link, before = CASES[family]
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
    assert seen, f"no run of {family} under {fault} showed what it had read"
