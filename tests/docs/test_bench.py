"""The bench's arithmetic and reports, without measuring anything; the guide shows the last result that is checked in."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.bench import __main__ as bench
from tests.bench import report
from tests.bench.measure import Figure, environment, rounded

MET = Figure("exo dump", 17.2451, 16.9271, "ms", 1.1, "median of 9")
MISSED = Figure("start-up, -h", 70.0, 10.0, "ms", 6.0, "quickest of 5", "python -c pass")
REPORTED = Figure("wrist dump on CAN", 3.6, 0.6, "ms", None)
PAGE = "# title\n<!-- figures: measured -->\nold\n<!-- end -->\n<!-- links: generated -->\nkept\n<!-- end -->\n"


def found(*figures: Figure, absent: tuple[str, ...] = ()) -> dict[str, object]:
    return report.content(figures, quick=True, peers={"esptool": "5.0"}, absent=absent)


def test_a_figure_is_judged_by_its_ratio() -> None:
    assert [figure.met for figure in (MET, MISSED, REPORTED)] == [True, False, True]
    assert [figure.as_row()["verdict"] for figure in (MET, MISSED, REPORTED)] == ["met", "missed", "reported"]
    assert MET.as_row() == {
        "name": "exo dump", "value": 17.25, "unit": "ms", "against": "wire", "floor": 16.93, "ratio": 1.019,
        "goal": 1.1, "verdict": "met", "note": "median of 9",
    }  # fmt: skip
    assert (rounded(0.000123456), rounded(123456.0)) == (0.0001235, 123500.0)


def test_each_figure_is_a_line() -> None:
    lines = [report.line(figure.as_row()) for figure in (MET, MISSED, REPORTED)]
    assert lines[1].split() == [
        "start-up,", "-h", "70", "ms", "10", "ms", "(python", "-c", "pass)", "7.00", "≤", "6.00", "missed", "quickest", "of", "5",
    ]  # fmt: skip
    assert "reported" in lines[2]


def test_old_figures_are_called_old(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(report, "LAST", tmp_path / "last.json")
    report.LAST.write_text(report.dumps(found(MET)), encoding="utf-8")
    assert "were measured on this code" in report.age()
    monkeypatch.setattr(report, "source", lambda: "another")
    assert "the code has changed since" in report.age()


def test_the_file_names_a_class_of_machine_only() -> None:
    content = found(MET)
    assert set(content) == {"schema", "date", "python", "source", "machine", "quick", "peers", "absent", "figures"}
    text = report.dumps(content)
    assert json.loads(text) == content
    assert platform.node() not in text and str(Path.home()) not in text


def test_the_guide_gets_the_figures_and_keeps_the_rest() -> None:
    page = report.guide(PAGE, found(MET, MISSED, absent=("mpremote",)))
    assert "old" not in page and page.count("<!-- end -->") == 2 and page.endswith("kept\n<!-- end -->\n")
    assert "| exo dump | 17.25 ms | 16.93 ms (wire) | 1.02 | ≤ 1.10 | met |\n" in page
    assert "Not installed for this run: mpremote." in page and "quick run" in page
    assert report.guide(page, found(MET, MISSED, absent=("mpremote",))) == page
    with pytest.raises(ValueError, match="no section"):
        report.guide("# title\n", found(MET))


def test_the_guide_shows_the_last_result() -> None:
    last = json.loads(report.LAST.read_text(encoding="utf-8"))
    page = report.GUIDE.read_text(encoding="utf-8")
    assert report.guide(page, last) == page
    assert last["schema"] == report.SCHEMA
    assert {row["name"].split(",")[0].split(" ")[0] for row in last["figures"]} >= {
        "start-up", "peak", "TAB", "exo", "wrist", "barrett", "ekso", "aidin",
    }  # fmt: skip


def test_a_missed_goal_is_measured_again() -> None:
    runs: list[bool] = []

    def part(*, quick: bool) -> Iterator[Figure]:
        runs.append(quick)
        yield Figure("a", 12.0 - len(runs), 1.0, "ms", 10.0)
        yield Figure("b", float(len(runs)), 1.0, "ms", 5.0)

    def best(*, quick: bool) -> list[tuple[str, float]]:
        runs.clear()
        return [(figure.name, figure.value) for figure in bench.measured("x", part, quick)]

    assert (best(quick=False), runs) == ([("a", 10.0), ("b", 1.0)], [False, False])
    assert (best(quick=True), runs) == ([("a", 11.0), ("b", 1.0)], [True])
    assert [figure.met for figure in bench.measured("x", lambda quick: iter([MISSED]), False)] == [False]


def test_a_part_that_fails_is_a_row_and_the_rest_goes_on(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def broken(*, quick: bool) -> Iterator[Figure]:
        yield MET
        raise AssertionError("exit 4\nnot 0")

    path = tmp_path / "found.json"
    monkeypatch.setattr(bench, "PARTS", {"stop": broken, "late": lambda quick: iter([REPORTED])})
    monkeypatch.setattr("sys.argv", ["bench", "--json", str(path)])
    assert bench.main() == 1
    rows = json.loads(path.read_text(encoding="utf-8"))["figures"]
    assert [(row["name"], row["verdict"]) for row in rows] == [
        (MET.name, "met"), ("stop", "failed"), (REPORTED.name, "reported"),
    ]  # fmt: skip
    assert rows[1]["note"] == "AssertionError: exit 4 not 0" and rows[1]["value"] is None
    told = capsys.readouterr()
    assert "1 of 1 goals met; failed: stop\n" in told.out and "stop  " in told.out
    assert "Traceback" in told.err


def test_programs_start_as_a_user_starts_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setenv("HANDCTL_FORMAT", "json")
    assert not [name for name in environment() if name.startswith(("PYTHON", "HANDCTL_"))]
    assert "PATH" in environment()
