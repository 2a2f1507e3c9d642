"""A test that hangs shows where, whatever runs it, and its process ends: a worker is replaced then, and the test is named.

As pytest's own `faulthandler_timeout` does, which starts and joins a thread for each test: here one is set anew when `AGAIN` s
have passed, so that a test that hangs has at most so much less.
"""

from __future__ import annotations

import faulthandler
import time
from collections.abc import Iterator

import pytest
from _pytest.faulthandler import fault_handler_stderr_fd_key

HANGS = 300.0
"""Seconds that no test takes."""
AGAIN = 5.0


class Hanging:
    """A plugin; what runs no test is not bounded."""

    def __init__(self) -> None:
        self.now, self.until = time.monotonic, 0.0

    @pytest.hookimpl(wrapper=True, trylast=True)
    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[object]:
        if (now := self.now()) >= self.until:
            self.until = now + AGAIN
            faulthandler.dump_traceback_later(HANGS, file=item.config.stash[fault_handler_stderr_fd_key], exit=True)
        try:
            return (yield)
        finally:
            if nextitem is None:
                self.pytest_exception_interact()

    @pytest.hookimpl(tryfirst=True)
    def pytest_exception_interact(self) -> None:
        """A debugger may wait for a person; the next test is bounded again."""
        faulthandler.cancel_dump_traceback_later()
        self.until = 0.0

    pytest_enter_pdb = pytest_exception_interact
