"""Collecting in less time: what pytest makes of a test module is kept, made by one worker only, and left to no collector.

Every worker of xdist imports all test modules. Rewriting their assertions is most of that, and is done anew by every
worker in every run where PYTHONDONTWRITEBYTECODE is set. Here it is kept beside the tests, as Python does otherwise.
"""

from __future__ import annotations

import compileall
import contextlib
import gc
import importlib
import sys
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).parents[1]
SOURCES = TESTS.parent / "src"


LONGEST = (
    "contract/test_newfamily.py",
    "stop/test_stop.py",
    "inspire/test_wrist_served.py",
    "stop/test_key.py",
    "docs/test_install.py",
    "harm/test_served.py",
    "barrett/test_served.py",
    "stop/test_deadman.py",
    "pins/test_contract.py",
    "wire/test_wire.py",
    "pins/test_faults.py",
    "aidin/test_check.py",
    "pins/test_hostile.py",
    "promises/test_promises.py",
    "pins/test_any_line.py",
)
"""Files that take far longer than their number of tests says. A worker that began one of them last would be waited for."""


def _worth_telling(send: Callable[..., None], name: str, **what: Any) -> None:
    report = what.get("data", {}) if name == "testreport" else {}
    passed = report.get("outcome") == "passed"
    if name == "logstart" or (passed and report["when"] != "call"):
        return
    if passed:
        report["keywords"] = {}  # a dozen each: they say why one was skipped
    send(name, **what)


class Collecting:
    """A plugin; it changes what collecting costs and nothing else. `kept` is whether bytecode is written afterwards."""

    def __init__(self, kept: bool) -> None:
        self.kept = kept

    def pytest_sessionstart(self, session: pytest.Session) -> None:
        """A worker tells how a test ended, and not that it began, was set up and was torn down: nobody reads that, nor what
        it would show on a terminal of its own."""
        session.config.option.loadscopereorder = False  # the workers' order is that of `pytest_collection_modifyitems`
        plugins = session.config.pluginmanager
        for plugin in plugins.get_plugins():
            if type(plugin).__name__ == "WorkerInteractor":
                plugin.sendevent = partial(_worth_telling, plugin.sendevent)
                plugins.unregister(name="terminalreporter")

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection(self, session: pytest.Session) -> None:
        # Some 20,000 tests are born and none dies: a garbage collector would only go over them again and again.
        gc.disable()
        controls = session.config.pluginmanager.hasplugin("dsession")  # its workers collect, it does not
        if controls or session.config.option.file_or_dir not in ([], ["tests"]):
            return
        worker = getattr(session.config, "workerinput", {"workerid": "gw0", "workercount": 1})
        first, each = int(worker["workerid"].removeprefix("gw")), worker["workercount"]
        # Its share first. By then the others have made theirs, and collecting finds all of them made.
        for path in sorted(SOURCES.rglob("*.py"))[first::each]:
            compileall.compile_file(path, quiet=2)
        for path in sorted(TESTS.rglob("test_*.py"), key=lambda path: (-path.stat().st_size, path))[first::each]:
            # What does not import fails where it is collected, by name.
            with contextlib.suppress(Exception, pytest.skip.Exception):
                importlib.import_module(".".join(path.relative_to(TESTS.parent).with_suffix("").parts))

    @pytest.hookimpl(tryfirst=True)
    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Workers take whole files, the longest first: those of `LONGEST`, then those of most tests, as xdist has it."""
        if not hasattr(config, "workerinput"):
            return
        tests = Counter(item.path for item in items)
        ranks = {TESTS / name: rank for rank, name in enumerate(LONGEST)}
        items.sort(key=lambda item: (ranks.get(item.path, len(ranks)), -tests[item.path]))

    @pytest.hookimpl(trylast=True)
    def pytest_collection_finish(self) -> None:
        sys.dont_write_bytecode = self.kept
        # What was collected stays to the end: no collection during a test, nor in a child that it forks, looks at it.
        gc.freeze()
        gc.set_threshold(2_000, 20, 100)  # so few are still in the caches of the processor when they are gone over
        gc.enable()

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self) -> None:
        # pytest looks for what nobody closed; what has been there for long is no garbage, and is not gone over again.
        gc.collect(1)
        gc.freeze()
