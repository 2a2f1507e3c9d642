"""What the source of handctl can say, read from its syntax: errors, warnings, notes, and what an ended command leaves behind.

A text stands as it is written, with what is put into it in braces. Names of texts, and functions that only return texts, are
followed to where the words are; [a | b] is one of several.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from tests.support.syntax import tree_of

TOP = Path(__file__).parents[2]
SOURCES = TOP / "src" / "handctl"
GOLDEN = Path(__file__).with_name("sources.txt")
HEAD = """\
# Every message that the source of handctl can say, by code: kind (of an error its exit code), text, hint.
# {…} is what the code puts in, [a | b] one of several. Not written by hand: python -m tests.messages --write
"""
NOTES = {"warn": "warning", "info": "info"}
DEEP = 4
"""Names and functions that are followed one behind the other."""
MOST = 12
"""Of several."""
Function = ast.FunctionDef | ast.Lambda
Assigned = tuple[ast.expr, ast.expr]
LEAVES = (ast.Constant, ast.Name, ast.expr_context, ast.operator, ast.alias)
BARE = re.compile(r"\{[^{}]*\}")
"""A text of which nothing is known."""


class Module:
    """One file: what it names at its head, what it takes from others, its functions, classes and calls; read in one pass."""

    def __init__(self, tree: ast.Module) -> None:
        self.constants: dict[str, ast.expr] = {}
        self.functions: dict[str, ast.FunctionDef] = {}
        self.classes: list[ast.ClassDef] = []
        self.imported: dict[str, tuple[str, str]] = {}
        """Name here -> module, and its name there."""
        self.calls: list[tuple[ast.Call, tuple[Function, ...], str]] = []
        """Every call, with the functions around it and the class that it stands in."""
        self.called: dict[str, list[tuple[ast.Call, tuple[Function, ...]]]] = {}
        """The calls by the name that is called."""
        self.given: dict[int, list[Assigned]] = {}
        """Function -> what is assigned in it."""
        self._read(tree, (), "")

    def _read(self, node: ast.AST, around: tuple[Function, ...], owner: str) -> None:
        match node:
            case ast.FunctionDef() | ast.Lambda():
                around = (*around, node)
                if isinstance(node, ast.FunctionDef):
                    self.functions[node.name] = node
            case ast.ClassDef():
                owner = node.name
                self.classes.append(node)
            case ast.Call():
                self.calls.append((node, around, owner))
                self.called.setdefault(_name(node.func), []).append((node, around))
            case ast.Assign() | ast.AnnAssign() | ast.NamedExpr() if node.value is not None:
                for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                    for function in around:
                        self.given.setdefault(id(function), []).append((target, node.value))
                    if not around and not owner:
                        self.constants.update(_assigned(target, node.value))
            case ast.ImportFrom(module=str(there)) if there.startswith("handctl"):
                self.imported.update({each.asname or each.name: (there, each.name) for each in node.names})
        for inner in node.__dict__.values():
            if isinstance(inner, ast.AST):
                if not isinstance(inner, LEAVES):
                    self._read(inner, around, owner)
            elif isinstance(inner, list):
                for each in inner:
                    if isinstance(each, ast.AST) and not isinstance(each, LEAVES):
                        self._read(each, around, owner)


def _name(called: ast.expr) -> str:
    return called.attr if isinstance(called, ast.Attribute) else called.id if isinstance(called, ast.Name) else ""


def _assigned(target: ast.expr, value: ast.expr) -> dict[str, ast.expr]:
    """The names of a target, each with what it is given."""
    if isinstance(target, ast.Name):
        return {target.id: value}
    if not isinstance(target, ast.Tuple) or not isinstance(value, ast.Tuple):
        return {}
    return {to.id: each for to, each in zip(target.elts, value.elts, strict=False) if isinstance(to, ast.Name)}


@cache
def modules() -> dict[str, Module]:
    found = {}
    for path in sorted(SOURCES.rglob("*.py")):
        words = path.relative_to(SOURCES.parent).with_suffix("").parts
        if words[1] not in ("docgen", "newfamily"):  # for those who work on handctl
            name = ".".join(words[:-1] if words[-1] == "__init__" else words)
            found[name] = Module(tree_of(path))
    return found


# -- a text ----------------------------------------------------------------------------------------------------------------


@dataclass
class Scope:
    """Where a text is written: its module, the functions around it, and how far it was followed."""

    module: Module
    around: tuple[Function, ...] = ()
    deep: int = 0
    seen: frozenset[int] = field(default_factory=frozenset)

    def within(self, module: Module, *around: Function, of: ast.AST) -> Scope:
        return Scope(module, around, self.deep + 1, self.seen | {id(of)})


def said(node: ast.expr | None, scope: Scope) -> str:
    """A text with what is put into it."""
    match node:
        case None:
            return ""
        case ast.Constant():
            return str(node.value) if node.value is not None else ""
        case ast.JoinedStr():
            return "".join(said(part, scope) for part in node.values)
        case ast.FormattedValue():
            text = said(node.value, scope)
            return text if text != _plain(node.value) or node.format_spec is None else _plain(node)
        case ast.BinOp(op=ast.Add()):
            return said(node.left, scope) + said(node.right, scope)
        case ast.Call(func=ast.Name(id="joined")):
            return ". ".join(said(part, scope).rstrip(".") for part in node.args)
        case _:
            found = list(dict.fromkeys(said(each, where) for each, where in _behind(node, scope)))
            if len(found) > MOST or all(BARE.fullmatch(text) or not text for text in found):
                return _plain(node)
            return found[0] if len(found) == 1 else f"[{' | '.join(found)}]"


def _plain(node: ast.expr) -> str:
    text = ast.unparse(ast.Expr(node))
    return text[2:-1] if isinstance(node, ast.FormattedValue) else "{" + text.replace("self.", "") + "}"


def _behind(node: ast.expr, scope: Scope) -> Iterator[tuple[ast.expr, Scope]]:
    """The texts that an expression may be."""
    match node:
        case ast.IfExp():
            yield node.body, scope
            yield node.orelse, scope
        case ast.BoolOp():
            yield from ((each, scope) for each in node.values if not isinstance(each, ast.Compare))
        case ast.Subscript():
            for owner, where in _behind(node.value, scope):
                if isinstance(owner, ast.Dict):
                    yield from ((each, where) for each in owner.values)
        case ast.Name() | ast.Attribute() | ast.Call() if scope.deep < DEEP and id(node) not in scope.seen:
            yield from _named(node, scope)


def _named(node: ast.Name | ast.Attribute | ast.Call, scope: Scope) -> Iterator[tuple[ast.expr, Scope]]:
    """What a name was given, and what a function returns."""
    target = node.func if isinstance(node, ast.Call) else node
    module, name = scope.module, ""
    match target:
        case ast.Name():
            name = target.id
            if not isinstance(node, ast.Call) and (given := list(_given(name, scope))):
                yield from ((each, scope.within(module, *around, of=node)) for each, around in given)
                return
            if name in module.imported:
                there, name = module.imported[name]
                module = modules().get(there, module)
        case ast.Attribute(value=ast.Name(id=owner)):
            name = target.attr
            if owner in module.imported:
                there, inner = module.imported[owner]
                module = modules().get(f"{there}.{inner}", modules().get(there, module))
            elif owner not in ("self", "cls") or (not isinstance(node, ast.Call) and name not in module.functions):
                return
    if not isinstance(node, ast.Call) and name in module.constants:
        yield module.constants[name], scope.within(module, of=node)
    elif name in module.functions:
        function = module.functions[name]
        yield from ((each, scope.within(module, function, of=node)) for each in _returned(function))


def _given(name: str, scope: Scope) -> Iterator[tuple[ast.expr, tuple[Function, ...]]]:
    """What a name is assigned in the functions around, or as their argument by who calls them in this module."""
    for place, function in reversed(list(enumerate(scope.around))):
        found = [
            each
            for target, value in scope.module.given.get(id(function), ())
            for part in (
                [value.body, value.orelse]
                if isinstance(value, ast.IfExp) and isinstance(target, ast.Tuple)
                else [value]
            )
            if (each := _assigned(target, part).get(name)) is not None
        ]
        if found:
            yield from ((each, scope.around[: place + 1]) for each in found)
            return
        if isinstance(function, ast.FunctionDef) and (given := list(_arguments(name, function, scope.module))):
            yield from given
            return


def _arguments(name: str, function: ast.FunctionDef, module: Module) -> Iterator[tuple[ast.expr, tuple[Function, ...]]]:
    """What an argument is given by the calls of this module."""
    names = [arg.arg for arg in function.args.args if arg.arg not in ("self", "cls")]
    if name not in [*names, *(arg.arg for arg in function.args.kwonlyargs)]:
        return
    for call, around in module.called.get(function.name, ()):
        by_name = next((word.value for word in call.keywords if word.arg == name), None)
        place = names.index(name) if name in names else len(call.args)
        value = by_name or (call.args[place] if place < len(call.args) else None)
        if value is not None:
            yield value, around


def _returned(function: ast.FunctionDef) -> list[ast.expr]:
    return [node.value for node in ast.walk(function) if isinstance(node, ast.Return) and node.value is not None]


# -- a message -------------------------------------------------------------------------------------------------------------


@cache
def errors() -> dict[str, tuple[int, str, str]]:
    """Class -> exit code, code, and the class it is made from."""
    found: dict[str, tuple[int, str, str]] = {}
    nodes = [node for module in modules().values() for node in module.classes]
    for _ in range(DEEP):
        for node in nodes:
            bases = [_name(base) for base in node.bases]
            of = next((base for base in bases if base in found), None)
            if of is None and node.name != "HandctlError":
                continue
            exit_code, code = found[of][:2] if of else (1, "error")
            for line in node.body:
                if isinstance(line, ast.Assign) and isinstance(line.value, ast.Constant):
                    (target,) = line.targets
                    exit_code = int(str(line.value.value)) if ast.unparse(target) == "exit_code" else exit_code
                    code = str(line.value.value) if ast.unparse(target) == "default_code" else code
            found[node.name] = exit_code, code, of or ""
    return found


@dataclass(frozen=True, order=True)
class Saying:
    """One message: its code, what it is ("error 5", "warning"), its text and its hint."""

    code: str
    kind: str
    text: str
    hint: str = ""

    def __str__(self) -> str:
        return f"  {self.kind}: {self.text}\n" + (f"    -> {self.hint}\n" if self.hint else "")


def _saying(call: ast.Call, module: Module, around: tuple[Function, ...], owner: str) -> Saying | None:
    name = _name(call.func)
    scope = Scope(module, around)
    given = {word.arg: word.value for word in call.keywords if word.arg}
    places = [*call.args, None, None, None, None]
    if isinstance(call.func, ast.Attribute) and name == "__init__" and ast.unparse(call.func.value) == "super()":
        name = owner
    if name in errors() and (call.args or "text" in given):
        exit_code, code, _ = errors()[name]
        text, hint = given.get("text", places[0]), given.get("hint")
        code = said(given["code"], scope) if "code" in given else code
        return Saying(code, f"error {exit_code}", said(text, scope), said(hint, scope))
    if name == "retold" and call.args:
        code = said(given["code"], scope) if "code" in given else "(as it was)"
        return Saying(code, "error, in other words", said(places[0], scope), said(given.get("hint"), scope))
    if name == "Left" and (call.args or given):
        hints = [said(given.get(word, place), scope) for word, place in (("hint", places[1]), ("behind", None))]
        return Saying(
            "(left)", "behind an error", said(given.get("text", places[0]), scope), " … ".join(filter(None, hints))
        )
    first = [places[0]] if name in ("note", "Message") else []
    places = places[len(first) :]
    if (name in NOTES and len(call.args) > 1) or (first and len(call.args) > 2):
        kind = said(first[0], scope) if first else NOTES[name]
        return Saying(said(places[0], scope), kind, said(places[1], scope), said(given.get("hint", places[2]), scope))
    return None


def sayings() -> list[Saying]:
    """All of them, sorted, each once."""
    found = set()
    for module in modules().values():
        for call, around, owner in module.calls:
            if (one := _saying(call, module, around, owner)) is not None:
                found.add(one)
    return sorted(found)


def listed(found: list[Saying]) -> str:
    """As sources.txt and cells.txt have them: below each code what is said under it."""
    lines, code = [], None
    for one in found:
        if one.code != code:
            code = one.code
            lines.append(f"\n{code}\n")
        lines.append(str(one))
    return "".join(lines)
