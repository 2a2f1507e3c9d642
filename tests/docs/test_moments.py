"""No test ends in another way because the machine is slow, or because of what another test does meanwhile.

Read from the syntax of the tests. Measurements (`tests/bench`) and what runs under wine have their own rules.
"""

from __future__ import annotations

import ast
import re
import textwrap
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.support.cli import PATIENCE
from tests.support.each_row import each_row
from tests.support.places import PROJECT as ROOT
from tests.support.syntax import tree_of, walk

TESTS = ROOT / "tests"
LEAST = 20.0
"""Seconds of a wait that only a hang outlasts."""
CLOCKS = {"monotonic", "perf_counter", "time"}
MEASURED = {TESTS / "support/cli.py"}
"""`in_time` tries again where the machine was late."""
OPENS = {"communicate", "create_connection", "Serial", "serial_for_url", "spawn", "RH56Driver", "run", "join"}
"""What takes a `timeout` for what must come or end; `wait` too, where it is given by its name."""
PROCESSES = {"process", "holder", "player", "child", "client", "thread", "closed", "done"}
"""How tests name what they wait for by a position; simulators on virtual time are waited for as well."""
RUNS = {"run", "run_program"}
COMPARED = {"out", "rows", "raw", "values", "lines", "err", "json"}


@cache
def texts() -> dict[Path, str]:
    files = (path for path in TESTS.rglob("*.py") if path.relative_to(TESTS).parts[0] not in ("bench", "windows"))
    return {path: path.read_text(encoding="utf-8") for path in sorted(files)}


def seconds(node: ast.expr | None, names: dict[str, float]) -> float | None:
    """What it says in seconds: a number, or a name of one at the head of the module."""
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and not isinstance(node.value, bool):
        return float(node.value)
    return names.get(node.id) if isinstance(node, ast.Name) else None


def numbers(tree: ast.Module) -> dict[str, float]:
    """The numbers with a name at the head of a module."""
    found = {"PATIENCE": PATIENCE}
    for node in tree.body:
        if isinstance(node, ast.Assign) and len(node.targets) == 1:
            (target,) = node.targets
            pairs = (
                zip(target.elts, node.value.elts, strict=True)
                if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
                else [(target, node.value)]
            )
            for name, value in pairs:
                if isinstance(name, ast.Name) and (number := seconds(value, {})) is not None:
                    found[name.id] = number
    return found


def called(node: ast.AST) -> str:
    """The name of the function that is called, without what it belongs to."""
    if not isinstance(node, ast.Call):
        return ""
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


# -- how fast ------------------------------------------------------------------------------------------------------------


def hurried(tree: ast.Module) -> Iterator[ast.AST]:
    """Time that passed since, and must be less than a busy machine may take."""
    names = numbers(tree)
    for node in walk(tree):
        if not isinstance(node, ast.Compare):
            continue
        sides = [node.left, *node.comparators]
        for place, operator in enumerate(node.ops):
            less = isinstance(operator, (ast.Lt, ast.LtE))
            small, large = (sides[place], sides[place + 1]) if less else (sides[place + 1], sides[place])
            passed = isinstance(small, ast.BinOp) and isinstance(small.op, ast.Sub)
            if passed and any(called(part) in CLOCKS for part in walk(small)):
                bound = seconds(large, names)
                if isinstance(operator, (ast.Lt, ast.LtE, ast.Gt, ast.GtE)) and (bound is None or bound < LEAST):
                    yield node


def impatient(tree: ast.Module) -> Iterator[ast.AST]:
    """A wait for what must come that a busy machine may outlast; one for what must not come stands in `briefly`."""
    names, nodes = numbers(tree), walk(tree)
    silences = {
        id(part)
        for node in nodes
        if isinstance(node, ast.Try) and any("Timeout" in ast.unparse(one.type) for one in node.handlers if one.type)
        for line in node.body
        for part in walk(line)
    }
    for node in nodes:
        if not isinstance(node, ast.Call) or id(node) in silences:
            continue
        name, given = called(node), {word.arg: word.value for word in node.keywords}
        waits: list[ast.expr | None] = []
        if name in OPENS | {"wait"}:
            waits.append(given.get("timeout"))
        if name == "wait_until":
            waits += [given.get("seconds"), *node.args[1:2]]
        if name in ("wait", "join") and isinstance(node.func, ast.Attribute):
            owner = node.func.value
            if (owner.attr if isinstance(owner, ast.Attribute) else getattr(owner, "id", "")) in PROCESSES:
                waits += node.args[:1]
        if any(bound is not None and 0 < bound < LEAST for bound in (seconds(wait, names) for wait in waits)):
            yield node


# -- what others do --------------------------------------------------------------------------------------------------------


def released(tree: ast.Module) -> Iterator[ast.AST]:
    """The number of a TCP port that was free, and is used when the port is no longer ours."""
    for scope in (node for node in walk(tree) if isinstance(node, ast.FunctionDef)):
        for block in (node for node in walk(scope) if isinstance(node, ast.With)):
            inside = {id(part) for part in walk(block)}
            asked = {
                target.id
                for part in walk(block)
                if isinstance(part, ast.Assign)
                and {called(piece) for piece in walk(part.value)} - {"", "format"} == {"getsockname"}
                for target in part.targets
                if isinstance(target, ast.Name)
            }
            yield from (
                part
                for part in walk(scope)
                if isinstance(part, ast.Name)
                and isinstance(part.ctx, ast.Load)
                and part.id in asked
                and id(part) not in inside
            )


def unjoined(tree: ast.Module) -> Iterator[ast.AST]:
    """A thread that nobody can wait for: it may read from a descriptor whose number is another test's by then."""
    for node in walk(tree):
        starts = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr == "start"
        if starts and called(node.func.value) == "Thread":
            yield node


def alive(node: ast.Call) -> bool:
    """A command on a simulator in real time."""
    words = [part.value for part in walk(node) if isinstance(part, ast.Constant) and isinstance(part.value, str)]
    return "--fake" in words or any(word.startswith("fake://") and "clock=virtual" not in word for word in words)


def twice(tree: ast.Module) -> Iterator[ast.AST]:
    """The results of two runs, one of them on a device whose clock goes on between them."""
    for node in walk(tree):
        if isinstance(node, ast.Compare) and all(isinstance(operator, ast.Eq) for operator in node.ops):
            sides = [
                side.value
                for side in (node.left, *node.comparators)
                if isinstance(side, ast.Attribute) and side.attr in COMPARED
            ]
            if len(sides) > 1 and any(
                isinstance(side, ast.Call) and called(side) in RUNS and alive(side) for side in sides
            ):
                yield node


RULES: dict[Callable[[ast.Module], Iterator[ast.AST]], str] = {
    hurried: r"monotonic\(|perf_counter\(",
    impatient: r"timeout=(?!PATIENCE)[\dA-Z]|(wait|join)\((?!PATIENCE)[\dA-Z]|wait_until\(([^\n]*, [\dA-Z]|\n)",
    released: "getsockname",
    unjoined: r"Thread\(",
    twice: r"== run(_program)?\(|\)\.(out|rows|raw|values|lines|err|json) == ",
}
"""Each with what stands in every file that it may find something in."""


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_no_test_does(rule: Callable[[ast.Module], Iterator[ast.expr]]) -> None:
    found = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {ast.unparse(node)[:100]}"
        for path, text in texts().items()
        if re.search(RULES[rule], text) and path not in (MEASURED if rule is hurried else ())
        for node in rule(tree_of(path))
    ]
    assert not found, "\n".join(found)


SEEDED = {
    hurried: (
        "assert time.monotonic() - began < 2.5", "assert 0.1 < time.perf_counter() - began <= 5",
        "assert 4 > time.monotonic() - began", "LIMIT = 3\nassert time.monotonic() - began < LIMIT",
    ),
    impatient: (
        "process.communicate(timeout=5)", "process.wait(10)", "serial.Serial(link, 9600, timeout=0.5)",
        "wait_until(what, 5)", "self.process.wait(timeout=2)", "socket.create_connection(place, timeout=2)",
    ),
    released: (
        "def test():\n    with socket.create_server(('', 0)) as server:\n        port = server.getsockname()[1]\n    go(port)",
    ),
    unjoined: ("threading.Thread(target=serve, daemon=True).start()",),
    twice: ("assert run('ekso', 'status', '--fake').rows == run('ekso', 'status', '--fake').rows",),
}  # fmt: skip
SOUND = {
    hurried: (
        "assert time.monotonic() - began < 30", "LIMIT = 30\nassert time.monotonic() - began < LIMIT",
        "assert 0.3 <= time.monotonic() - began", "assert device.now - began < 2.5",
    ),
    impatient: ("process.wait(PATIENCE)", "bench.wait(0.5)", "wait_until(what)",
        "serial.Serial(link, timeout=PATIENCE)",
        "try:\n    process.wait(0.7)\nexcept subprocess.TimeoutExpired:\n    process.kill()",),
    released: (
        "def test():\n    with socket.create_server(('', 0)) as server:\n        port = server.getsockname()[1]\n        go(port)",
    ),
    unjoined: ("thread = threading.Thread(target=serve)\nthread.start()\nthread.join()",),
    twice: ("assert run('ekso', 'status', '-p', 'fake://ekso?clock=virtual').rows == first.rows",),
}  # fmt: skip


@each_row("rule", RULES, ids=lambda rule: rule.__name__)
def test_each_rule_finds_its_mistakes(rule: Callable[[ast.Module], Iterator[ast.AST]]) -> None:
    for text in SEEDED[rule]:
        assert list(rule(ast.parse(textwrap.dedent(text)))), text
    for text in SOUND[rule]:
        assert not list(rule(ast.parse(textwrap.dedent(text)))), text
