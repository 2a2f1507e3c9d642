"""Hooks of the whole test suite: the summary of the fault matrix, and its share of an ordinary run."""

from __future__ import annotations

import zlib

import pytest

from tests.matrix_report import (
    pytest_runtest_call,
    pytest_runtest_logreport,
    pytest_runtest_makereport,
    pytest_terminal_summary,
)

__all__ = [
    "pytest_collection_modifyitems",
    "pytest_runtest_call",
    "pytest_runtest_logreport",
    "pytest_runtest_makereport",
    "pytest_terminal_summary",
]

SHARE = 3
"""Of the cells of the fault matrices an ordinary run of the whole suite takes each third, always the same ones."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """`-m faults`, or naming a file, runs every cell; `.ci/run` does."""
    whole_suite = not config.option.file_or_dir or config.option.file_or_dir == ["tests"]
    if not whole_suite or "faults" in config.option.markexpr:
        return
    left = [item for item in items if item.get_closest_marker("faults") and zlib.crc32(item.nodeid.encode()) % SHARE]
    if left:
        dropped = set(left)
        items[:] = [item for item in items if item not in dropped]
        config.hook.pytest_deselected(items=left)
