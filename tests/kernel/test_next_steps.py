"""A next step that names a command has it as data: what a program does next is never read out of a sentence."""

from __future__ import annotations

import ast
import re
import shlex
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

import click

import handctl
from handctl.command.command_lines import parse_line
from handctl.errors import Aftermath, HandctlError, Hint, NoAnswer, command_of, joined
from handctl.families import FAMILIES
from handctl.model.check_rows import FAIL, Check
from handctl.model.device_picture import remedies_of
from handctl.model.result import Message
from handctl.wording import sentence
from tests.support.syntax import nodes_of_kind

CALLS = {"Remedy": 1, "Check": 3, "Finding": 3, "Reason": 1, "Aftermath": 1, "warn": 2, "info": 2, "verdict": 4}
"""Call -> which of its arguments is a next step."""
NAMES = frozenset({"hint", "remedy", "behind"})
PLACE = re.compile(r"\b[A-Z]{3,}\b(?!=)|…|=[A-Z]+\b|\b[AB]\b")
"""A word of a command that the reader replaces."""
ALONE = frozenset({"shell", "batch", "service", "prove"})
"""Commands that cannot be one of several."""


@cache
def modules() -> dict[str, tuple[ast.AST, ...]]:
    root = Path(handctl.__file__).parent
    return {
        str(path.relative_to(root)): tuple(nodes_of_kind(path, ast.keyword, ast.Call, ast.Assign))
        for path in sorted(root.rglob("*.py"))
        if path.relative_to(root).parts[0] not in ("sim", "docgen")
    }


def steps(nodes: Iterable[ast.AST]) -> Iterator[ast.expr]:
    """The literals of a module that are next steps."""
    for node in nodes:
        if isinstance(node, ast.keyword) and node.arg in NAMES:
            yield from literals(node.value)
        elif isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            yield from (one for part in node.args[CALLS.get(name, 99) :][:1] for one in literals(part))
        elif isinstance(node, ast.Assign) and any(getattr(target, "id", "") in NAMES for target in node.targets):
            yield from literals(node.value)


def literals(node: ast.expr) -> Iterator[ast.expr]:
    if isinstance(node, ast.IfExp):
        yield from (*literals(node.body), *literals(node.orelse))
    elif isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str)):
        yield node


def words_of(node: ast.expr) -> str:
    if isinstance(node, ast.JoinedStr):
        return "".join(str(part.value) if isinstance(part, ast.Constant) else "exo" for part in node.values)
    return str(node.value) if isinstance(node, ast.Constant) else ""


@cache
def runs(command: str) -> bool:
    """Whether a command is complete: it exists, it has all its arguments, and none of them is to be replaced."""
    words = shlex.split(command)
    if PLACE.search(command):
        return False
    try:
        parse_line(words, {})
    except click.exceptions.Exit:  # -h
        return True
    except HandctlError:
        return words[0] in ALONE
    return True


def test_a_next_step_does_not_hide_a_command_in_its_text() -> None:
    hidden = [
        f"{module}:{node.lineno}: {command}"
        for module, nodes in modules().items()
        for node in steps(nodes)
        for command in re.findall(r"`handctl ([^`]+)`", words_of(node))
        if runs(command)
    ]
    assert hidden == []


def test_a_command_that_is_data_can_be_run() -> None:
    given = [
        (f"{module}:{part.lineno}", str(part.value))
        for module, nodes in modules().items()
        for node in nodes
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Hint"
        for part in node.args[1:]
        if isinstance(part, ast.Constant)
    ]
    assert len(given) > 50
    assert [place for place in given if not runs(place[1])] == []


def test_the_command_of_each_remedy_is_data() -> None:
    for kind in FAMILIES:
        for key, remedy in remedies_of(kind).items():
            named = re.findall(r"`handctl ([^`]+)`", remedy.step)
            assert command_of(remedy.hint) == next(filter(runs, named), ""), (kind, key)


def test_the_command_goes_where_the_text_goes() -> None:
    step = Hint("free the finger, then run {} or {}", "exo clear-errors", "exo scan")
    assert step == "free the finger, then run `handctl exo clear-errors` or `handctl exo scan`"
    for text in (step, sentence(step), joined("wait", step), joined(step, Hint("run {}", "ports"))):
        assert command_of(text) == "exo clear-errors"
    error = NoAnswer("silent", hint=step, left=Aftermath("it may move", "stop it"))
    assert command_of(error.hint) == "exo clear-errors"
    row = {"command": "handctl exo clear-errors"}
    assert row.items() <= Message("error", "x", "text", error.hint).as_row().items()
    assert row.items() <= Check("x", FAIL, "text", step).as_row().items()
    assert "command" not in Message("error", "x", "text", "no `handctl exo scan` as data").as_row()
