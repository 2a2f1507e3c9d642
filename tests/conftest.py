"""Hooks of the whole test suite: the summary of the fault matrix."""

from tests.matrix_report import (
    pytest_runtest_call,
    pytest_runtest_logreport,
    pytest_runtest_makereport,
    pytest_terminal_summary,
)

__all__ = ["pytest_runtest_call", "pytest_runtest_logreport", "pytest_runtest_makereport", "pytest_terminal_summary"]
