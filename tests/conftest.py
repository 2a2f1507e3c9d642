"""Hooks of the whole test suite: the summary of the fault matrix, and its share of an ordinary run."""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# What tests share asserts, too, and shows what differs when it fails; told before any of it is imported.
pytest.register_assert_rewrite(*(f"tests.{path.name}" for path in Path(__file__).parent.iterdir() if path.is_dir()))

from tests.harm.table import Table
from tests.hostile.table import table as hostile_table
from tests.support import own_state as state
from tests.support.collecting import Collecting
from tests.support.in_process import in_process

__all__ = [
    "ordinary",
    "own_state",
    "pytest_collection_modifyitems",
    "pytest_configure",
]


@pytest.fixture(autouse=True)
def own_state(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """What this machine keeps for a user between commands is kept for each test apart, and never in a home."""
    for name in ("XDG_STATE_HOME", "XDG_RUNTIME_DIR", "TMPDIR"):
        monkeypatch.setenv(name, "")  # undone behind the test
    state.BELOW[:] = [tmp_path_factory.getbasetemp()]
    state.begin()


@pytest.fixture(autouse=True)
def ordinary(request: pytest.FixtureRequest, own_state: None) -> Iterator[None]:
    """A test that is not marked `real` stays in this process and on virtual time."""
    with nullcontext() if request.node.get_closest_marker("real") else in_process():
        yield


def pytest_configure(config: pytest.Config) -> None:
    """The tables of the harm matrix and of the hostile suite are plugins of their own, and so is a faster collecting."""
    config.pluginmanager.register(Collecting())
    config.pluginmanager.register(Table())
    config.pluginmanager.register(hostile_table())


# The same examples in each run: what a new one finds is a task for the long suites, not an end of an ordinary run by chance.
settings.register_profile(
    "any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True, database=None
)
settings.load_profile("any machine")

SHARE = 24
"""Of the cells of the fault matrices an ordinary run of the whole suite takes one in 24, always the same ones."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """`-m faults`, or naming a file, runs every cell, or those that HANDCTL_FAULTS_EACH=N leaves, as `.ci/run` does."""
    whole_suite = not config.option.file_or_dir or config.option.file_or_dir == ["tests"]
    asked = not whole_suite or "faults" in config.option.markexpr
    share = int(os.environ.get("HANDCTL_FAULTS_EACH", "1")) if asked else SHARE
    left = [item for item in items if item.get_closest_marker("faults") and zlib.crc32(item.nodeid.encode()) % share]
    if left:
        dropped = set(left)
        items[:] = [item for item in items if item not in dropped]
        config.hook.pytest_deselected(items=left)
