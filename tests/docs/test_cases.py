"""A test function has few cases: a failure says which fact is wrong, and collecting stays quick."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from types import ModuleType

import pytest

from tests.support.collecting import LONGEST, TESTS

MOST = 12
"""Cases of a function. A larger table is one test (`tests/support/each_row.py`), or its module has a text MANY that says why."""


def crowded(cases: Iterable[tuple[ModuleType, str]]) -> list[str]:
    """The functions that have more cases, each with their count, where the module does not say why."""
    counts = Counter(cases)
    return [
        f"{module.__name__}.{name}: {count} cases"
        for (module, name), count in counts.items()
        if count > MOST and not (isinstance(why := getattr(module, "MANY", None), str) and why)
    ]


def test_a_function_has_few_cases_or_its_module_says_why(request: pytest.FixtureRequest) -> None:
    """Of all that is collected in this run."""
    items = [item for item in request.session.items if isinstance(item, pytest.Function)]
    assert items
    found = crowded((item.module, item.originalname) for item in items)
    assert not found, "\n".join(found)


def test_the_files_that_are_begun_first_are_there() -> None:
    assert [name for name in LONGEST if not (TESTS / name).is_file()] == []


def test_too_many_cases_are_found() -> None:
    silent, bytes_only, says = ModuleType("silent"), ModuleType("bytes_only"), ModuleType("says")
    bytes_only.MANY, says.MANY = b"\x10", "a case for every command"  # type: ignore[attr-defined]
    cases = [(module, "test") for module in (silent, bytes_only, says) for _ in range(MOST + 1)]
    assert crowded(cases) == ["silent.test: 13 cases", "bytes_only.test: 13 cases"]
    assert crowded(cases[:MOST]) == []
