"""Which tests pass without having asserted anything: `python -m tests.asserting [PYTEST…]`.

Every `assert` that holds is counted, and every exception that `pytest.raises` expects. Takes about twice the time of the tests.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from typing import Any

import pytest


class Counting:
    """A plugin of pytest."""

    def __init__(self) -> None:
        self.count = 0
        self.empty: list[str] = []

    def pytest_assertion_pass(self) -> None:
        self.count += 1

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        self.count = 0
        result = yield
        if not self.count:
            self.empty.append(item.nodeid)
        return result


def main(words: list[str]) -> int:
    counting = Counting()
    expect = pytest.raises

    def raises(*args: Any, **more: Any) -> Any:
        counting.count += 1
        return expect(*args, **more)

    pytest.raises = raises
    # The hook is compiled into the tests, so their usual bytecode is of no use.
    with tempfile.TemporaryDirectory() as folder:
        sys.pycache_prefix = folder
        code = pytest.main(
            ["-q", "-p", "no:xdist", "-o", "enable_assertion_pass_hook=true", *words], plugins=[counting]
        )
    print(*counting.empty, f"{len(counting.empty)} tests assert nothing", sep="\n")
    return int(code) or bool(counting.empty)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
