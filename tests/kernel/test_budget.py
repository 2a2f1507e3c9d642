"""The code does not grow, and a get does not take a longer way: `python -m tests.kernel.budget` lowers the figures."""

from __future__ import annotations

import json

import pytest

from tests.kernel.budget import GUIDE as PAGE
from tests.kernel.budget import KEPT, SECTION, code_lines, lived, lowered, over, sizes

HINT = "Take something away, or raise the figure in tests/kernel/budget.json and give the reason in the commit."


def test_no_room_grows() -> None:
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    assert not (grown := over(sizes(), kept)), f"{grown}. {HINT}"


@pytest.mark.real
def test_a_get_takes_no_longer_way() -> None:
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    figures, page = lived()
    assert not (grown := over(figures, kept["life"])), f"{grown}. {HINT}"
    found = SECTION.search(PAGE.read_text(encoding="utf-8"))
    assert found is not None and found[0] == found[1] + page + found[2], "python -m tests.kernel.budget writes the page"


def test_what_counts() -> None:
    assert code_lines('"""A docstring\nof two lines."""\n\n# a comment\nx = """two\nlines"""\n') == 2
    before = {"rooms": {"a": 5, "gone": 1}, "modules": 3}
    assert over({"rooms": {"a": 6, "new": 1}, "modules": 2}, before) == [
        "rooms a: 6 instead of 5",
        "rooms new: 1 instead of 0",
    ]
    assert lowered({"rooms": {"a": 6}, "modules": 2}, before) == {"rooms": {"a": 5}, "modules": 2}
