"""The rules of tests/STYLE.md that a machine can hold, over every text that a person reads."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from handctl.docgen.read_command_tree import read_tree
from handctl.families import COMMANDS
from tests.docs.words import ROOMS, modules, spoken, texts
from tests.support.each_row import each_row
from tests.support.places import PROJECT as ROOT
from tests.support.places import TEXTS


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


@each_row("room", ROOMS)
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
