"""Cells of the searched suites that the gate replays, a file a suite. `python -m tests.pins` chooses them."""

from __future__ import annotations

from pathlib import Path

from tests.search.suite import Suite

HERE = Path(__file__).parent
BY_HAND = "# found by a search:"
"""Below this line of a file stand cells that once failed; no choice drops them."""


def file_of(suite: Suite) -> Path:
    """Where the pins of a suite are."""
    return HERE / f"{suite.name}.txt"


def pins(suite: Suite) -> list[str]:
    """The pins of a suite, those of a search last."""
    path = file_of(suite)
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def found(suite: Suite) -> list[str]:
    """Those that a search has found."""
    path = file_of(suite)
    _, mark, text = (path.read_text(encoding="utf-8") if path.exists() else "").partition(BY_HAND)
    return [line for line in text.splitlines() if line] if mark else []
