"""Every text that a person reads: the strings of the package, README and the guides."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from handctl import guides
from tests.support.places import PROJECT as ROOT
from tests.support.syntax import nodes_of, walk

SOURCE = ROOT / "src/handctl"
ROOMS = {
    "aidin": ("devices/aidin",),
    "barrett": ("devices/barrett",),
    "ekso": ("devices/ekso",),
    "inspire": ("devices/inspire",),
    "sim": ("sim",),
    "kernel": ("command", "link", "model", "record", "report", "schema", "screen", "stop", "system", "tools"),
    "root": ("*.py",),
}
"""Which folders of the package are read together."""
ERRORS = {
    "UsageError",
    "LinkError",
    "NoAnswer",
    "ProtocolError",
    "DeviceRefused",
    "CheckFailed",
    "NotConfirmed",
    "SimError",
}
LOOKED_AT = {ast.Expr, ast.IfExp, ast.JoinedStr, ast.Constant, ast.Raise}
VERBATIM = ("Cntl-C abort command received", "LFV in counts per sample (default) or per 10 ms: sample, 10ms")
"""The manuals' own words, and what a program prints that is none of ours."""


class Module(NamedTuple):
    """Its strings without the docstrings, with `{}` for values, its errors without a hint, and its plurals after a `len`."""

    literals: list[tuple[int, str]]
    hintless: list[tuple[int, str]]
    counts: list[tuple[int, str]]


@cache
def module(path: Path) -> Module:
    found = Module([], [], [])
    inner, guarded, counts = set[int](), set[int](), "{len(" in path.read_text(encoding="utf-8")
    for node in nodes_of(path):  # what is around something comes before it
        if type(node) not in LOOKED_AT:
            continue
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            inner.add(id(node.value))
        elif isinstance(node, ast.IfExp):
            guarded.update(id(part) for part in walk(node))
        elif isinstance(node, ast.JoinedStr) and id(node) not in inner:
            inner.update(id(part) for part in walk(node) if part is not node)
            text = "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values)
            found.literals.append((node.lineno, text))
            counted = "".join(
                str(part.value)
                if isinstance(part, ast.Constant)
                else "{len}"
                if counts and ast.unparse(part).lstrip("f'\"").startswith("{len(")
                else "{}"
                for part in node.values
            )
            if id(node) not in guarded and re.search(r"(?<!of )\{len\} (?:more )?[a-z]+(?<!s)s\b", counted):
                found.counts.append((node.lineno, text))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inner:
            found.literals.append((node.lineno, node.value))
        elif isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            if ast.unparse(node.exc.func).startswith("click."):
                continue  # `command.envelope.from_click` adds the command's own help as the next step
            name = getattr(node.exc.func, "id", getattr(node.exc.func, "attr", ""))
            if name in ERRORS and not any(keyword.arg == "hint" for keyword in node.exc.keywords):
                found.hintless.append((node.lineno, name))
    return found


def modules(room: str) -> Iterator[tuple[str, Module]]:
    for folder in ROOMS[room]:
        for path in sorted(SOURCE.glob(folder) if "*" in folder else (SOURCE / folder).rglob("*.py")):
            yield str(path.relative_to(SOURCE)), module(path)


def texts(room: str) -> Iterator[tuple[str, str]]:
    """Place and words of every text of a room: a string of four words or more that is neither code nor markup."""
    for place, one in modules(room):
        for line, text in one.literals:
            if len(text.split()) >= 4 and not re.search(r"<\w+|[{(]\n|</|: \{", text) and text not in VERBATIM:
                yield f"{place}:{line}", text


def spoken(text: str) -> Iterator[str]:
    """The words of README or a guide, a paragraph, an item or a cell at a time; not what a program prints or compares."""
    text = re.sub(r"<!-- figures.*?<!-- end -->|^ {4}[^\n]*$|^!\[[^\n]*$", "", text, flags=re.DOTALL | re.MULTILINE)
    for block in guides.blocks(text):
        if isinstance(block, guides.Table):
            yield from (cell for row in block.rows for cell in row)
        elif not isinstance(block, guides.Code):
            yield block.text
