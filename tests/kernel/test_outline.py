"""The outline of a device: which finger is where, how it is coloured, and `status --picture`."""

from __future__ import annotations

from typing import Any

import pytest

from handctl.charts.curves import outline_svg
from handctl.command.family import load
from handctl.families import FAMILIES
from handctl.model.device_picture import Bar, Measure, Outline, bars_with_values, outline_grid, outline_of
from handctl.model.result import Cell, Row
from tests.support.cli import run
from tests.support.each_row import each_row

DRAWN = [kind for kind in FAMILIES if outline_of(kind) is not None]
ONE = Outline((Bar("a", 0, 4), Bar("b", -2, -2)), {"heat": Measure("t.{}", 50)}, errors="e.{}", bend=("p.{}", 0, 100))


def rows(heat: Any, *, position: int = 100, error: bool = False, **more: Any) -> list[Row]:
    return [
        {"path": "t.a", "value": heat, "unit": "°C", **more}, {"path": "p.a", "value": position},
        {"path": "e.a", "value": int(error), "errors": ["stuck"] if error else []},
    ]  # fmt: skip


@each_row(
    ("given", "text", "tone"),
    [
        (rows(44), "44", "good"),
        (rows(45), "45", "warn"),
        (rows(50), "50", "bad"),
        (rows(-51), "-51", "bad"),
        (rows(20, error=True), "20", "bad"),
        (rows(None, error=True), "?", "bad"),
        (rows(None), "-", "dim"),
        (rows(20, doubt="before homing"), "?", "dim"),
        (rows(400, scaled=40.0, scaled_unit="°C"), "40", "good"),
    ],
)
def test_the_colour_of_a_bar(given: list[Row], text: str, tone: str) -> None:
    if text == "?" and given[0]["value"] is None:
        given[0] = {"path": "t.a", "error": "no answer"}
    first, other = bars_with_values(ONE, "heat", given)
    assert (first.text, first.tone) == (text, tone)
    assert (other.text, other.tone, other.row) == ("-", "dim", {})


@each_row(("position", "full"), [(0, 1), (50, 2), (100, 4), (140, 4), (-5, 1)])
def test_a_bar_is_as_long_as_the_finger_is_straight(position: int, full: int) -> None:
    grid = outline_grid(ONE, "heat", rows(20, position=position))
    column = [line[0] for line in grid.lines[1:5]]
    assert [isinstance(cell, Cell) and cell.text == "████" for cell in column] == [False] * (4 - full) + [True] * full
    assert (grid.headings, grid.title) == (("a", "b"), "heat [°C]")


@pytest.mark.parametrize("kind", DRAWN)
def test_the_bars_of_a_family_are_quantities_of_it(kind: str) -> None:
    """Each measure of each bar is something that `status` reads; what a bar has not is told in its module."""
    status = run(kind, "status", "-p", f"fake://{kind}?clock=virtual", "--json").rows
    outline = outline_of(kind)
    assert outline is not None
    for by in outline.measures:
        without = [one.bar.part for one in bars_with_values(outline, by, status) if not one.row]
        assert without in ([], ["thumb_rotation"] if kind == "exo" else [])
        assert outline_svg(outline, by, status).count("<text") == 2 * len(outline.bars)
    assert load(kind, "outline").OUTLINE is outline


@pytest.mark.parametrize("kind", DRAWN)
def test_a_picture_fits_a_window(kind: str) -> None:
    done = run(kind, "status", "--picture", "-p", f"fake://{kind}?clock=virtual")
    assert done.code == 0
    assert len(done.lines) <= 20
    assert max(map(len, done.lines)) <= 100


@each_row("words", [("--picture", "beauty"), ("--picture=",)])
def test_what_cannot_be_drawn(words: tuple[str, ...]) -> None:
    done = run("exo", "status", *words, "-p", "fake://exo?clock=virtual", "--json")
    assert done.code == (2 if len(words) > 1 else 0)
    assert len(done.rows) == (
        0 if done.code else len(run("exo", "status", "-p", "fake://exo?clock=virtual", "--json").rows)
    )


@each_row("kind", ["exo", "hand", "wrist"])
def test_error_bits_are_named_below_the_picture(kind: str) -> None:
    done = run(kind, "status", "--picture", "error", "-p", f"fake://{kind}?clock=virtual&fault=faults")
    assert max(map(len, done.lines)) <= 80
    assert any(line.endswith(": locked_rotor") or ": locked_rotor (" in line for line in done.lines)


def test_actuators_without_a_known_place() -> None:
    assert outline_grid(ONE, "heat", [{"path": "t.m1", "value": 3}]).headings == ()
    assert outline_svg(ONE, "heat", [{"path": "t.m1", "value": 3}]) == ""
