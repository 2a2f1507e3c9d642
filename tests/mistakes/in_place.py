"""One mistake in a process that has imported everything: its function gets the code of the function with the mistake.

Importing handctl and the tests is most of what a process of one mistake does. Here one process does it for all, and its children
begin where it stands. What is made at import (a table, a class, what a decorator or a cache keeps) has no mistake in it then:
whoever finds nothing here tries again with `seeded.seed`.
"""

from __future__ import annotations

import ast
import contextlib
import gc
import importlib
import pkgutil
from collections.abc import Iterator, Sequence
from types import CodeType, FunctionType

from tests.mistakes.seeded import seed
from tests.mistakes.table import Patch, Stale, parsed

Place = tuple[str, str, int]
"""Where a function is: its file, its name, its first line."""
Functions = dict[Place, list[FunctionType]]


def imported(tests: Sequence[str]) -> None:
    """Import all of handctl, and the files of these tests; what each test would read first is read."""
    import handctl  # not sooner: a mistake that cannot be seeded in place is imported
    from tests.support import cli

    files = sorted({test.partition("::")[0] for test in tests})
    names = ["tests.conftest", *(file.removesuffix(".py").replace("/", ".") for file in files)]
    names += [found.name for found in pkgutil.walk_packages(handctl.__path__, "handctl.")]
    for name in names:
        if not name.endswith("__main__"):
            with contextlib.suppress(Exception):  # an extra that is not here; a test that does not import fails by name
                importlib.import_module(name)
    cli.schema()


def functions() -> Functions:
    """All that there are now."""
    found: Functions = {}
    for each in gc.get_objects():
        if type(each) is FunctionType:
            code = each.__code__
            found.setdefault((code.co_filename, code.co_name, code.co_firstlineno), []).append(each)
    return found


def seed_in_place(patches: Sequence[Patch], known: Functions) -> bool:
    """Let this process, which has imported all, see the source with the mistake in it; whether that can be done."""
    ready: list[tuple[FunctionType, CodeType]] = []
    texts = {patch.module: patch.path.read_text(encoding="utf-8") for patch in patches}
    if len(texts) < len(patches):
        return False
    for patch in patches:
        path = str(patch.path)
        places = {(path, *one) for one in _around(texts[patch.module], patch)}
        codes = {place: code for code in _codes(compile(patch.applied(texts[patch.module]), path, "exec", dont_inherit=True))
                 if (place := (path, code.co_name, code.co_firstlineno)) in places}  # fmt: skip
        there = [(one, codes[place]) for place in codes for one in known.get(place, ())]
        if not there or any(one.__code__.co_freevars != code.co_freevars for one, code in there):
            return False
        ready += there
    seed(patches, anew=True)
    for one, code in ready:
        one.__code__ = code
    return True


def _around(text: str, patch: Patch) -> Iterator[tuple[str, int]]:
    """Name and first line of each function that has the line of the patch in its body; none if it is in no body."""
    if patch.path.suffix != ".py" or not patch.function:
        return
    first, last = patch.lines(text)
    for node in ast.walk(parsed(text)):
        if isinstance(node, ast.FunctionDef) and node.body[0].lineno <= first and last <= (node.end_lineno or 0):
            yield node.name, min([node.lineno, *(mark.lineno for mark in node.decorator_list)])


def _codes(code: CodeType) -> Iterator[CodeType]:
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield each
            yield from _codes(each)


def replaceable(one: Sequence[Patch]) -> bool:
    """Whether a mistake could be seeded here: it still fits, and is in bodies of functions."""
    try:
        return all(list(_around(patch.path.read_text(encoding="utf-8"), patch)) for patch in one)
    except Stale:
        return False
