"""One mistake in one process: the module is compiled with its line replaced, and pytest runs here on what must find it.

The files stay as they are. A module is patched on its way from the file into the interpreter, any other file as it is opened.
"""

from __future__ import annotations

import builtins
import contextlib
import gc
import importlib
import importlib.machinery
import importlib.util
import io
import os
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from types import CodeType
from typing import Any

import pytest

from tests.mistakes.table import SOURCES, TOP, Patch

QUICK = (
    "-q", "--tb=line", "--no-header", "--no-summary", "--assert=plain", "--capture=fd", f"--rootdir={TOP}",
    *(word for name in ("cacheprovider", "xdist", "hypothesispytest", "stepwise", "junitxml", "doctest", "unittest", "pastebin",
      "nose", "faulthandler", "logging", "anyio", "cov") for word in ("-p", f"no:{name}")),
)  # fmt: skip


class Seeding(importlib.machinery.SourceFileLoader):
    """Loads one module with the mistake in it."""

    def __init__(self, name: str, path: str, text: str) -> None:
        super().__init__(name, path)
        self.text = text

    def get_code(self, _name: str) -> CodeType:
        return compile(self.text, self.path, "exec", dont_inherit=True)


class Finder:
    """Finds the modules that are to have a mistake, and leaves all others to those behind it."""

    def __init__(self, texts: dict[str, tuple[Path, str]]) -> None:
        self.texts = texts

    def find_spec(self, name: str, *_: object) -> importlib.machinery.ModuleSpec | None:
        if name not in self.texts:
            return None
        path, text = self.texts[name]
        inner = [str(path.parent)] if path.name == "__init__.py" else None
        return importlib.util.spec_from_file_location(
            name, path, loader=Seeding(name, str(path), text), submodule_search_locations=inner
        )


def seed(patches: Sequence[Patch], anew: bool = False) -> None:
    """Let this process see the source with the mistake in it: where it imports it, with `anew` for another time, and opens it."""
    texts: dict[str, str] = {}
    for patch in patches:
        texts[patch.module] = patch.applied(texts.get(patch.module) or patch.path.read_text(encoding="utf-8"))
    paths = {patch.module: patch.path for patch in patches}
    modules = {name: (paths[name], text) for name, text in texts.items() if paths[name].suffix == ".py"}
    if not anew and (known := modules.keys() & sys.modules.keys()):
        raise AssertionError(f"imported too early: {', '.join(known)}")
    sys.meta_path.insert(0, Finder(modules))  # type: ignore[arg-type]
    _opened_instead({str(place): text for name, text in texts.items() for place in _places(paths[name])})


def _places(path: Path) -> Iterator[Path]:
    """A file, and the same in the package where that is installed elsewhere."""
    yield path
    installed = importlib.util.find_spec("handctl")
    if installed is not None and installed.origin and path.is_relative_to(SOURCES / "handctl"):
        yield Path(installed.origin).parent / path.relative_to(SOURCES / "handctl")


def _opened_instead(texts: dict[str, str]) -> None:
    """Whoever opens one of these files reads that text; it lies in a file without a name."""
    kept = {}
    for path, text in texts.items():
        kept[path] = tempfile.NamedTemporaryFile("w", encoding="utf-8", newline="")  # noqa: SIM115
        kept[path].write(text)
        kept[path].flush()
    plain = io.open

    def opened(file: Any, *more: Any, **named: Any) -> Any:
        place = os.path.abspath(file) if isinstance(file, str | os.PathLike) else file
        return plain(kept[place].name if place in kept else file, *more, **named)

    io.open = builtins.open = opened  # type: ignore[assignment]


class Verdict:
    """A plugin: of the modules it is given it runs the tests asked for, each only until it has failed once.

    Where a whole file is asked for, all its tests are.
    """

    def __init__(self, wanted: Iterable[str]) -> None:
        self.wanted = tuple(wanted)
        self.names = {one.partition("[")[0].split("::")[1] for one in self.wanted if "::" in one}
        if not all("::" in one for one in self.wanted):
            self.names.clear()
        self.failed: dict[str, str] = {}
        self.items: dict[str, str] = {}  # the one that failed first
        self.passed: dict[str, float] = {}
        self.broken: list[str] = []

    def of(self, nodeid: str) -> str | None:
        """Which of the tests asked for this item belongs to."""
        for one in self.wanted:
            if nodeid == one or nodeid.startswith((one + "[", one + "::")):
                return one if "::" in one else nodeid.partition("[")[0]
        return None

    @pytest.hookimpl(tryfirst=True)
    def pytest_pycollect_makeitem(self, name: str) -> list[pytest.Item] | None:
        """What no test is asked for by that name makes no items: they are most of what a child does."""
        return None if not self.names or name in self.names else []

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = [item for item in items if self.of(item.nodeid)]

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
        if self.of(item.nodeid) not in self.failed:
            return None
        # What the one before has left up for this one: else the next one fails for that, whatever it looks at.
        item.session._setupstate.teardown_exact(nextitem)
        return True

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self.broken.append(f"{report.nodeid} does not import: {str(report.longrepr).splitlines()[-1]}")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        name = self.of(report.nodeid)
        if name is None or (report.when != "call" and report.passed) or report.skipped:
            return
        if report.failed:
            told = getattr(report.longrepr, "reprcrash", None)
            self.items.setdefault(name, report.nodeid)
            self.failed.setdefault(name, str(told.message if told else report.longrepr).partition("\n")[0][:200])
        self.passed[name] = self.passed.get(name, 0.0) + report.duration


def run(tests: Iterable[str]) -> Verdict:
    """Run these tests here."""
    verdict = Verdict(tests)
    files = sorted({one.partition("::")[0] for one in verdict.wanted})
    gc.freeze()
    place = f"--basetemp={tempfile.mkdtemp()}/tests"
    pytest.main([*QUICK, place, *(str(TOP / file) for file in files)], plugins=[verdict])
    return verdict


def foreign() -> set[str]:
    """The modules that are imported here and in which no mistake can be."""
    return {name for name in sys.modules if name.partition(".")[0] not in ("handctl", "tests", "__main__")}


def prepare(names: Iterable[str]) -> None:
    """Import these: once here, then every child has them."""
    for name in names:
        with contextlib.suppress(Exception):  # some are made by others, and cannot be imported
            importlib.import_module(name)
