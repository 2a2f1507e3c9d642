"""A plugin for the command line, `-p tests.support.backwards`: the tests of a run, last first. None may need what another one left."""

from __future__ import annotations

import pytest


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.reverse()
