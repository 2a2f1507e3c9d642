"""What a seeded mistake is: a line of one function, another line in its place, and the tests that must find it.

A mistake names its line by its text, never by its number, so that it survives what is written around it. When the text is gone
from its function, the mistake fails by name: it is then written again, or leaves together with what it guarded.
"""

from __future__ import annotations

import ast
import importlib
import pkgutil
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from textwrap import dedent, indent

TOP = Path(__file__).parents[2]
SOURCES = TOP / "src"


class Stale(Exception):
    """A mistake that no longer fits the source, or a test that is not there."""


@dataclass(frozen=True)
class Patch:
    """One place: `module` is dotted, or the path of a file that is no Python; `function` is qualified, "" the whole file.

    `line` is one line or several, without indentation, and stands there exactly once; `instead` is what takes its place.
    """

    module: str
    function: str
    line: str
    instead: str

    @property
    def path(self) -> Path:
        """The file that is changed."""
        if "/" in self.module or not self.module.startswith("handctl"):
            return TOP / self.module
        place = SOURCES.joinpath(*self.module.split("."))
        return place / "__init__.py" if place.is_dir() else place.with_suffix(".py")

    def lines(self, text: str) -> tuple[int, int]:
        """The numbers of the first and the last line that it replaces."""
        lines = text.splitlines()
        first, last = _span(text, self.function) if self.function else (0, len(lines))
        wanted = [line.strip() for line in dedent(self.line).strip().splitlines()]
        found = [
            number
            for number in range(first, last - len(wanted) + 1)
            if [line.strip() for line in lines[number : number + len(wanted)]] == wanted
        ]
        if len(found) != 1:
            where = f"{self.module}:{self.function or 'the whole file'}"
            raise Stale(f"{where} has {len(found) or 'no'} {'lines' if found else 'line'} {self.line.strip()!r}")
        return found[0] + 1, found[0] + len(wanted)

    def applied(self, text: str) -> str:
        """The file's text with the mistake in it."""
        first, last = self.lines(text)
        lines = text.splitlines(keepends=True)
        begin = lines[first - 1]
        room = begin[: len(begin) - len(begin.lstrip())]
        lines[first - 1 : last] = [indent(dedent(self.instead).strip() + "\n", room)]
        return "".join(lines)


@cache
def parsed(text: str) -> ast.Module:
    """A file's syntax; many mistakes are in the same one."""
    return ast.parse(text)


def _span(text: str, function: str) -> tuple[int, int]:
    """First line and the one behind the last of a function or class, decorators with it."""
    body: list[ast.stmt] = parsed(text).body
    found: ast.stmt | None = None
    for name in function.split("."):
        found = next((node for node in _within(body) if getattr(node, "name", None) == name), None)
        if found is None:
            raise Stale(f"there is no {function}")
        body = found.body  # type: ignore[attr-defined]
    assert found is not None
    first = min([found.lineno, *(mark.lineno for mark in getattr(found, "decorator_list", ()))])
    return first - 1, found.end_lineno or first


def _within(body: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Statements of a body, those in its if and try blocks too, but not those of functions and classes in it."""
    for node in body:
        yield node
        if not isinstance(node, ast.FunctionDef | ast.ClassDef):
            for part in ("body", "orelse", "finalbody"):
                yield from _within(getattr(node, part, []))


@dataclass(frozen=True)
class Mistake:
    """A mistake with a name, of a kind, and the tests of which each must fail on it, by node id or a beginning of it."""

    name: str
    kind: str
    patches: tuple[Patch, ...]
    tests: tuple[str, ...]
    room: str = ""


def mistake(
    name: str, kind: str, module: str, function: str, line: str, instead: str, *tests: str, also: tuple[Patch, ...] = ()
) -> Mistake:
    """A mistake in one place, or with `also` in several: host and simulator, say, that agree on what is wrong."""
    return Mistake(name, kind, (Patch(module, function, line, instead), *also), tests)


def mistakes() -> list[Mistake]:
    """All of them, by room: each module of `rows` is one."""
    from tests.mistakes import rows

    found: list[Mistake] = []
    for room in sorted(info.name for info in pkgutil.iter_modules(rows.__path__)):
        of_room = importlib.import_module(f"{rows.__name__}.{room}").ROWS
        found += [Mistake(one.name, one.kind, one.patches, one.tests, room) for one in of_room]
    names = [one.name for one in found]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise Stale(f"two mistakes have the name {', '.join(twice)}")
    return found
