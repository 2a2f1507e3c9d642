"""The syntax of a source file, read once in a process: several tests look through all of them."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path


@cache
def tree_of(path: Path) -> ast.Module:
    """Nobody changes it."""
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """All of it in the order of `ast.walk`: what is around something comes before it."""
    return tuple(ast.walk(tree_of(path)))
