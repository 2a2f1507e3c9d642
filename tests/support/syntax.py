"""The syntax of a source file, read once in a process: several tests look through all of them."""

from __future__ import annotations

import ast
import gc
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import Any, TypeVar


@cache
def tree_of(path: Path) -> ast.Module:
    """Nobody changes it."""
    collects = gc.isenabled()
    gc.disable()  # no node of a tree is garbage, and while it grows a collector would go over all of them again and again
    try:
        return ast.parse(path.read_text(encoding="utf-8"), str(path))
    finally:
        gc.freeze()
        if collects:
            gc.enable()


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """All of it in the order of `ast.walk`: what is around something comes before it."""
    return tuple(walk(tree_of(path)))


Node = TypeVar("Node", bound=ast.AST)


def nodes_of_kind(path: Path, *kinds: type[Node]) -> list[Node]:
    """Those of these classes, one class behind the other: most tests look for a few."""
    return [node for kind in kinds for node in _by_kind(path).get(kind, ())]


@cache
def _by_kind(path: Path) -> dict[type[ast.AST], list[Any]]:
    found: dict[type[ast.AST], list[Any]] = defaultdict(list)
    for node in nodes_of(path):
        found[type(node)].append(node)
    return found


def walk(node: ast.AST) -> list[ast.AST]:
    """As `ast.walk`, which goes through two generators for each node: here there are millions. Of a name not its context."""
    found = [node]
    for one in found:  # it grows meanwhile
        for name in _parts(type(one)):
            value = getattr(one, name, None)
            if type(value) is list:
                found += [item for item in value if isinstance(item, ast.AST)]
            elif value is not None and isinstance(value, ast.AST):
                found.append(value)
    return found


@cache
def _parts(kind: type[ast.AST]) -> tuple[str, ...]:
    """The fields that may hold a node."""
    return () if kind is ast.Constant else tuple(name for name in kind._fields if name not in ("ctx", "id", "attr"))


def below(node: ast.AST) -> list[ast.AST]:
    """The statements right below one, and the clauses of `try` and `match` that hold some: an expression holds none."""
    return [child for name in _blocks(type(node)) for child in getattr(node, name)]


def statements(node: ast.AST) -> list[ast.AST]:
    """All of them below a node."""
    found = below(node)
    for one in found:  # it grows meanwhile
        found += below(one)
    return found


@cache
def _blocks(kind: type[ast.AST]) -> tuple[str, ...]:
    """The fields that hold statements."""
    return tuple(name for name in kind._fields if name in ("body", "handlers", "orelse", "finalbody", "cases"))
