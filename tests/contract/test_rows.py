"""Rows that join: in every family a row names itself as `get` takes it, and tells its value in a person's unit."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import pytest

from handctl.docgen.read_command_tree import map_of
from handctl.families import FAMILIES
from tests.contract.facts import facts_of
from tests.support.cli import run

MANY = "a case for each family and verb: a new family is tried without being added to a list"
SAID = ("name", "unit", "path", "scaled_unit")
"""Of two rows of one quantity the same, whatever moved meanwhile."""


def rows_of(family: str, *words: str, state: str = "") -> list[dict[str, Any]]:
    """The rows of a command, without the moment of a sample."""
    done = run(family, *words, "-p", facts_of(family).link(family, "", *filter(None, [state])), "--format", "ndjson")
    assert done.code in (0, 7), done
    return [{key: value for key, value in row.items() if key != "t"} for row in done.stream[0]]


def factor_of(unit: str | None) -> tuple[Fraction, str] | None:
    """``0.1 °C`` -> 1/10 of a °C, by another way than the program's; None for a unit without a factor."""
    words = (unit or "").split(" ", 1)
    try:
        return (Fraction(words[0]), words[1]) if len(words) == 2 else None
    except ValueError:
        return None


@pytest.mark.parametrize("verb", ["dump", "status", "watch", "get"])
@pytest.mark.parametrize("family", FAMILIES)
def test_a_row_names_what_get_takes(family: str, verb: str) -> None:
    params, computed = map_of(family), facts_of(family).computed
    assert params is not None
    words = {
        "watch": ("watch", "--count", "1"),
        "get": ("get", *(p.path for p in params.every if p.readable and not p.optional)),
    }
    rows = rows_of(family, *words.get(verb, (verb,)))
    assert {row["name"] for row in rows if "path" not in row} <= computed
    named = [row for row in rows if "path" in row]
    assert named and not {row["name"] for row in named} & computed
    again = rows_of(family, "get", *(row["path"] for row in named))
    assert [[row.get(key) for key in SAID] for row in again] == [[row.get(key) for key in SAID] for row in named]


@pytest.mark.parametrize("family", FAMILIES)
def test_every_element_has_one_path_that_is_its_own(family: str) -> None:
    """Also the parts of a vector, and what only later devices have."""
    params = map_of(family)
    assert params is not None
    paths = [
        f"{param.path}.{part}" if part else param.path for param in params.every for part in param.elements or ("",)
    ]
    assert len(set(paths)) == len(paths)
    for path in paths:
        _, (element,) = params.find(path)
        assert element.path == path


@pytest.mark.parametrize("family", FAMILIES)
def test_a_unit_with_a_factor_is_scaled(family: str) -> None:
    for row in [*rows_of(family, "dump"), *rows_of(family, "status")]:
        factor = factor_of(row["unit"])
        assert ("scaled" in row) == ("scaled_unit" in row) == (factor is not None), row
        if factor is not None:
            assert row["scaled"] == float(factor[0] * row["value"]), row
            assert row["scaled_unit"] == factor[1] and factor_of(factor[1]) is None


ALARMING = {
    family: alarming
    for family in FAMILIES
    if (alarming := [param.path for param in map_of(family) or () if param.readable and param.alarms])
}


@pytest.mark.parametrize("family", ALARMING)
def test_error_bits_are_a_list_beside_their_words(family: str) -> None:
    link = facts_of(family).link(family)
    for state in ("", "fault=over-temperature", "fault=locked-rotor"):
        done = run(family, "get", *ALARMING[family], "-p", f"{link}{state and '&'}{state}", "--format", "ndjson")
        if done.code == 2:
            continue  # this simulator has no such fault
        for row in filter(lambda row: "value" in row, done.stream[0]):
            assert bool(row["errors"]) == bool(row["value"]), row
            assert all(error in row["label"] for error in row["errors"]), row
