"""The rules of tests/STYLE.md that a machine can hold, over every text that a person reads."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from handctl import guides
from handctl.docgen.tree import read_tree
from handctl.families import COMMANDS
from tests.support.each_row import each_row
from tests.support.places import PROJECT as ROOT
from tests.support.places import TEXTS

SOURCE = ROOT / "src/handctl"
ROOMS = {
    "aidin": ("devices/aidin",),
    "barrett": ("devices/barrett",),
    "ekso": ("devices/ekso",),
    "inspire": ("devices/inspire",),
    "sim": ("sim",),
    "kernel": ("frame", "link", "model", "report", "schema", "screen", "stop", "tools"),
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
VERBATIM = ("Cntl-C abort command received", "LFV in counts per sample (default) or per 10 ms: sample, 10ms")
"""The manuals' own words, and what a program prints that is none of ours."""


def page() -> str:
    return (ROOT / "tests/STYLE.md").read_text(encoding="utf-8")


def column(heading: str, number: int) -> list[str]:
    """One column of the table below a heading of the page."""
    rows = [line for line in page().split(heading, 1)[1].split("\n## ")[0].splitlines() if line.startswith("| ")]
    return [row.split("|")[number].partition(" (")[0].strip() for row in rows[1:]]


NEVER = [word for cell in column("## One thing, one word", 3) for word in cell.split(", ") if word]
WORDS = column("## Not this, but that", 1) + NEVER
BANNED = re.compile(rf"(?<![\w`-])({'|'.join(map(re.escape, WORDS))})(?!\w)", re.IGNORECASE)
SPELT = re.compile(rf"\b(?:{'|'.join(map(re.escape, column('## Spelling', 1)))})(?:s|d|ed|ing)?\b", re.IGNORECASE)
ONE = re.compile(
    r"(?<![\w.,:^+×*/-])1 (?!is\b|was\b|has\b|does\b|less\b|ms\b|as\b|bus\b|us\b|afterwards\b)[a-z]+(?<!s)s\b(?! \d)"
)
"""The plural of one."""
UNIT = re.compile(r"(?<![\w.#-])\d+(?:\.\d+)?(?:ms|mm|bit/s|Hz|kHz|mA|°C|bytes?|kB|MB)\b")
"""A number without a space before its unit."""


class Module(NamedTuple):
    """Its strings without the docstrings, with `{}` for values, its errors without a hint, and its plurals after a `len`."""

    literals: list[tuple[int, str]]
    hintless: list[tuple[int, str]]
    counts: list[tuple[int, str]]


@cache
def module(path: Path) -> Module:
    found = Module([], [], [])
    tree, inner, guarded = ast.parse(path.read_text(encoding="utf-8")), set[int](), set[int]()
    for node in ast.walk(tree):  # what is around something comes before it
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            inner.add(id(node.value))
        elif isinstance(node, ast.IfExp):
            guarded.update(id(part) for part in ast.walk(node))
        elif isinstance(node, ast.JoinedStr) and id(node) not in inner:
            inner.update(id(part) for part in ast.walk(node) if part is not node)
            text = "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values)
            found.literals.append((node.lineno, text))
            counted = "".join(
                str(part.value)
                if isinstance(part, ast.Constant)
                else "{len}"
                if ast.unparse(part).lstrip("f'\"").startswith("{len(")
                else "{}"
                for part in node.values
            )
            if id(node) not in guarded and re.search(r"(?<!of )\{len\} (?:more )?[a-z]+(?<!s)s\b", counted):
                found.counts.append((node.lineno, text))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inner:
            found.literals.append((node.lineno, node.value))
        elif isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            if ast.unparse(node.exc.func).startswith("click."):
                continue  # `frame.options.from_click` adds the command's own help as the next step
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


def sentences(text: str) -> list[str]:
    return re.split(r"(?<=[.!?:])\s+|\n", text)


def faults(text: str) -> Iterator[str]:
    """What a text has against the rules."""
    plain = re.sub(r"`[^`]*`|\"[^\"]*\"", "QUOTED", text)
    for found in BANNED.finditer(plain):
        yield f"{found[0]!r}: see the tables of tests/STYLE.md"
    for found in SPELT.finditer(plain):
        yield f"{found[0]!r}: spelling"
    for found in ONE.finditer(plain):
        yield f"{found[0]!r}: the plural of one"
    for found in UNIT.finditer(plain):
        yield f"{found[0]!r}: a unit without a space"


@pytest.mark.parametrize("room", ROOMS)
def test_texts(room: str) -> None:
    found = [f"{place}: {fault}: {text[:120]!r}" for place, text in texts(room) for fault in faults(text)]
    assert not found, f"{len(found)} faults\n" + "\n".join(found)


@pytest.mark.parametrize("room", ROOMS)
def test_every_error_has_a_next_step(room: str) -> None:
    found = [f"{place}:{line}: {name} without a hint" for place, one in modules(room) for line, name in one.hintless]
    assert not found, "\n".join(found)


@each_row("top", COMMANDS)
def test_help(top: str) -> None:
    """Each help begins with a capital, ends with a full stop, has a first sentence of one line, and keeps to the rules."""
    found = []
    for node in next(child for child in read_tree().children if child.name == top).walk():
        pieces = [
            (node.name, node.help),
            *((f"{node.name} {option.names[-1]}", option.help) for option in node.options),
        ]
        for place, text in pieces:
            words = re.sub(r"\s+", " ", text.replace("\b", "")).strip()
            faulty = list(faults(words))
            if words and not re.match(r"[A-Z0-9`-]|handctl", words):
                faulty.append("begins without a capital")
            if words and not words.endswith((".", "]", ":", "…")):
                faulty.append("ends without a full stop")
            if place == node.name and len(sentences(words)[0]) > 76:
                faulty.append(f"the first sentence has {len(sentences(words)[0])} characters")
            found += [f"{place}: {fault}: {words[:100]!r}" for fault in faulty]
    assert not found, f"{len(found)} faults\n" + "\n".join(found)


def spoken(text: str) -> Iterator[str]:
    """The words of README or a guide, a paragraph, an item or a cell at a time; not what a program prints or compares."""
    text = re.sub(r"<!-- figures.*?<!-- end -->|^ {4}[^\n]*$|^!\[[^\n]*$", "", text, flags=re.DOTALL | re.MULTILINE)
    for block in guides.blocks(text):
        if isinstance(block, guides.Table):
            yield from (cell for row in block.rows for cell in row)
        elif not isinstance(block, guides.Code):
            yield block.text


@each_row("name", TEXTS)
def test_readme_and_guides(name: str) -> None:
    pieces = list(spoken(TEXTS[name].read_text(encoding="utf-8")))
    assert len(pieces) > 10
    found = [f"{fault}: {text[:160]!r}" for text in pieces for fault in faults(text)]
    assert not found, f"{len(found)} faults\n" + "\n".join(found)


def test_the_rules_find_what_they_name() -> None:
    for bad in (
        "handctl tells the speed", "1 bytes arrived", "wait 10ms", "the baudrate is wrong", "the behavior of the hand",
    ):  # fmt: skip
        assert list(faults(bad)), bad
    assert not list(
        faults('The hand did not answer within 0.3 s; finger 1 is blocked. Run `x 1 bytes` and read "anew".')
    )


def test_no_message_counts_one_in_the_plural() -> None:
    """`plural` does it. Of a number that is never one, say so here."""
    found = [
        f"{place}:{number}: {text[:120]!r}"
        for room in ROOMS
        for place, one in modules(room)
        for number, text in one.counts
    ]
    assert found == []
