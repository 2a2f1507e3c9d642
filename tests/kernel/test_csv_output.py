"""Wide CSV: a line a sample and a column a quantity, in a person's unit; the long form stays beside it."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import pytest

from handctl.families import FAMILIES
from handctl.screen.csv_output import Wide, column_of
from tests.contract.facts import facts_of
from tests.support.cli import fake, run

UNREAD = {"name": "b", "path": "b", "unit": "mA", "error": "no answer"}


def table(text: str) -> list[dict[str, str]]:
    """CSV by its header; each line has as many cells as that."""
    lines = list(csv.reader(io.StringIO(text)))
    assert len({len(line) for line in lines}) == 1 and len(set(lines[0])) == len(lines[0])
    return [dict(zip(lines[0], line, strict=True)) for line in lines[1:]]


def watched(family: str, *words: str) -> str:
    done = run(family, "watch", "--count", "3", "--rate", "5", "-p", facts_of(family).link(family), *words)
    assert done.code == 0, done
    return done.out


@pytest.mark.parametrize("family", FAMILIES)
def test_wide_is_the_long_form_turned(family: str) -> None:
    """The same values at the same moments: those of the rows, scaled where the unit is a factor."""
    rows, _ = run(family, "watch", "--count", "3", "--rate", "5", "-p", facts_of(family).link(family), "--json").stream
    wide = table(watched(family, "--csv", "--wide"))
    assert len(wide) == 3
    found = {(line["t_s"], name): value for line in wide for name, value in line.items()}
    for row in rows:
        unit = (row.get("scaled_unit") or row["unit"] or "").replace(" ", "_")
        name = f"{row['path']}_{unit}" if unit else row["path"]
        assert found[str(row["t"]), name] == str(row.get("scaled", row["value"]))
    assert len(wide[0]) - 2 - ("doubt" in wide[0]) == len(rows) // 3
    assert len(table(watched(family, "--csv"))) == len(rows)


def test_a_file_that_is_named_csv_is_wide_and_csv(tmp_path: Path) -> None:
    path = tmp_path / "warm-up.csv"
    for words, length in (((), 2), (("--csv",), 2), (("--long",), 10), (("--csv", "--no-wide"), 10)):
        assert run("exo", "watch", "temperature", "--count", "2", "-p", fake(), "-o", path, *words).code == 0
        assert len(table(path.read_text(encoding="utf-8"))) == length, words
    plain = run("exo", "watch", "id", "--count", "1", "-p", fake(), "-o", path, "--format", "plain")
    assert plain.code == 0 and path.read_text(encoding="utf-8").startswith("0.0\tid")
    assert run("exo", "get", "id", "-p", fake(), "-o", path).code == 0
    assert path.read_text(encoding="utf-8").startswith("Name")
    env = {"HANDCTL_LONG": "1"}
    assert run("exo", "watch", "temperature", "--count", "2", "-p", fake(), "-o", path, env=env).code == 0
    assert len(table(path.read_text(encoding="utf-8"))) == 10


def test_a_result_is_one_line_and_what_is_no_quantity_stays() -> None:
    (line,) = table(
        run("barrett", "get", "TEMP", "BAUD", "EN", "-p", "fake://barrett?clock=virtual", "--csv", "--wide").out
    )
    assert (line["temperature_°C"], line["baud_rate_bit/s"], line["enabled.SPREAD"]) == ("41.2", "9600", "1")
    assert run("exo", "describe", "--csv", "--wide").out == run("exo", "describe", "--csv").out
    assert run("exo", "get", "id", "-p", fake(), "--wide").out == run("exo", "get", "id", "-p", fake()).out


def test_realtime_is_wide() -> None:
    words = ("barrett", "realtime", "--count", "3", "-p", "fake://barrett?clock=virtual&initialized=1", "--csv")
    wide, long = table(run(*words).out), table(run(*words, "--long").out)
    assert len(wide) == 3 and {"t_s", "position.F1_cts", "doubt", "error"} < set(wide[0])
    assert len(long) == 3 * len({(row["name"], row["motor"]) for row in long})


def test_what_was_not_read_is_empty_and_told() -> None:
    rows: list[dict[str, Any]] = [{"name": "a", "path": "a", "unit": None, "value": 1}, UNREAD, {**UNREAD, "path": "c"}]
    sheet = Wide(rows, {"t_s": 0.5})
    assert sheet.line(rows, str, {"t_s": 0.5}) == 't_s,a,b_mA,c_mA,error\r\n0.5,1,,,"b, c: no answer"\r\n'
    later = [{**rows[0], "value": None}, {**UNREAD, "path": "d"}]
    assert sheet.line(later, str, {"t_s": 1.0}) == "1.0,,,,d: no answer\r\n"
    assert list(sheet.left_out) == ["d_mA"]


def test_a_remark_has_a_column() -> None:
    rows = [{"name": "position", "motor": "F1", "value": 3, "unit": "cts", "doubt": "not initialized"}]
    assert Wide(rows, {}).line(rows, str, {}) == "position.F1_cts,doubt,error\r\n3,position.F1: not initialized,\r\n"
    assert column_of({"name": "x", "unit": "1/16 cts/sample"}) == "x_cts/sample"
