"""Hooks of the whole test suite: where a test keeps its state, and what an ordinary one must not do."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from functools import cache
from importlib import metadata
from pathlib import Path

import pytest

# What is imported from here on is compiled and rewritten once, not by every worker in every run. `Collecting` ends this.
KEPT, sys.dont_write_bytecode = sys.dont_write_bytecode, False
# What tests share asserts, too, and shows what differs when it fails; told before any of it is imported.
pytest.register_assert_rewrite(*(f"tests.{path.name}" for path in Path(__file__).parent.iterdir() if path.is_dir()))

from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers

from tests.support import own_state as state
from tests.support.collecting import Collecting
from tests.support.hanging import Hanging
from tests.support.in_process import in_process
from tests.support.telling import quickly

__all__ = [
    "pytest_configure",
    "pytest_runtest_setup",
    "pytest_runtest_teardown",
]


# Ignored under `nohup` or behind the `&` of a shell; a child ignores what its parent does, and would not end.
for number, default in ((signal.SIGHUP, signal.SIG_DFL), (signal.SIGINT, signal.default_int_handler)):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, default)

INSIDE = pytest.StashKey[ExitStack]()
OWN = ("XDG_STATE_HOME", "XDG_RUNTIME_DIR", "TMPDIR")
BEFORE = pytest.StashKey[list[tuple[str, "str | None"]]]()


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> Iterator[None]:
    """A test that is not marked `real` stays in this process and on virtual time, and so do the fixtures that it is the first to use.

    What this machine keeps for a user between commands is kept for each test apart, and never in a home. Some 10,000
    tests need that, so it is no fixture: each would be looked up, set up and torn down.
    """
    item.stash[BEFORE] = [(name, os.environ.get(name)) for name in OWN]
    for name in OWN:
        os.environ[name] = ""
    state.BELOW[:] = [item.config._tmp_path_factory.getbasetemp()]  # type: ignore[attr-defined]
    state.begin()
    if not item.get_closest_marker("real"):
        item.stash[INSIDE] = stack = ExitStack()
        stack.enter_context(in_process())
    yield


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> Iterator[None]:
    """Behind all of it: what was tried and swallowed is an error."""
    try:
        yield
    finally:
        if INSIDE in item.stash:
            item.stash[INSIDE].close()
        for name, was in item.stash.get(BEFORE, []):
            if was is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = was


def pytest_configure(config: pytest.Config) -> None:
    """Collecting in less time is a plugin of its own, and what ends a test that hangs."""
    if place := state.memory():
        os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", place)
    config.pluginmanager.register(Collecting(KEPT))
    if config.pluginmanager.hasplugin("faulthandler"):
        config.pluginmanager.register(Hanging())
    quickly()


# Reports and doctors name the packages. Their versions stay while tests run, and each would be read from its file again.
metadata.version = cache(metadata.version)

# The same few examples in each run: what a new one finds is a task for the search, not an end of an ordinary run by chance.
settings.register_profile(
    "any machine",
    max_examples=40,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize=True,
    database=None,
)
settings.load_profile("any machine")
# It would take constants out of the modules that happen to be loaded: other examples in each worker, and a second to read them.
providers.is_local_module_file = lambda path: False
