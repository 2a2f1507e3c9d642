"""The part of the golden wire that is in the gate: of each command its run, one more cell in turn, and its death.

Which is the one in turn is a matter of places in golden.txt, never of a draw. `python -m tests.wire` replays all.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import pytest

from handctl.families import FAMILIES
from tests.messages import cells as messages
from tests.wire.book import differing, golden, parted, replayed
from tests.wire.cells import cells, groups
from tests.wire.record import Record, Recorder

TOOLS = "the tools"
STEP = 7
"""From one command to the next the cell in turn is so many places further: no command is tried under one fault only."""

Replay = Callable[[list[str]], list[str]]


@pytest.fixture(scope="module")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Replay:
    recorder = Recorder(tmp_path_factory.mktemp("wire"))
    known = golden()

    written = messages.GOLDEN.read_text(encoding="utf-8")
    unwritten: dict[str, None] = {}

    def noted(record: Record) -> str:
        unwritten.update(
            (str(one), None) for one in messages.read(messages.messages(record)) if str(one) not in written
        )
        return record.line

    def wrong(keys: list[str]) -> list[str]:
        """The cells that are not as they are written down, each with what shows it, and messages that are not."""
        found = replayed(recorder, [key for key in keys if key in known], noted)
        lines = [
            f"{key}: {parts}\n  repeat: python -m tests.wire --only '{key}'" for key, parts in differing(found, known)
        ]
        lines += [
            f"not in {messages.GOLDEN.name} (python -m tests.messages --cells --write):\n{one}" for one in unwritten
        ]
        unwritten.clear()
        return lines

    return wrong


@cache
def commands(owner: str) -> list[list[str]]:
    """The cells of each command of a family, or of the tools."""
    return [
        group
        for group in groups(list(cells()))
        if group[0].endswith(" | run") and (group[0].split()[0] if group[0].split()[0] in FAMILIES else TOOLS) == owner
    ]


OWNERS = [*FAMILIES, TOOLS]


def test_every_cell_is_written_down_and_no_other() -> None:
    known = golden()
    missing = [group[0] for group in groups([key for key in cells() if key not in known])]
    lines = [f"python -m tests.wire --write --only '{key.rpartition(' | ')[0]} |'" for key in missing]
    assert not missing, "\n".join(["no lines in tests/wire/golden.txt for:", *lines])
    gone = [key for key in known if key not in cells()]
    assert not gone, "\n".join(["python -m tests.wire --write removes what there is no more:", *gone])


@pytest.mark.parametrize("owner", OWNERS)
def test_each_command_runs_as_written_down(owner: str, replay: Replay) -> None:
    found = commands(owner)
    assert found
    assert not (wrong := replay([group[0] for group in found])), "\n".join(wrong)


@pytest.mark.parametrize("owner", OWNERS)
def test_each_command_ends_as_written_down(owner: str, replay: Replay) -> None:
    """Of each that writes, under one fault or by one interruption of all that there are for it; of the tools all."""
    others = [group[1:] for group in commands(owner) if group[1:] and (owner == TOOLS or cells()[group[0]].writes)]
    chosen = [group[number * STEP % len(group)] for number, group in enumerate(others)]
    assert chosen
    assert not (wrong := replay(chosen)), "\n".join(wrong)


@pytest.mark.parametrize("owner", OWNERS)
def test_the_child_is_told_what_is_written_down(owner: str, replay: Replay) -> None:
    dying = [key for group in commands(owner) for key in group if key.endswith(" | death")]
    assert dying
    assert not (wrong := replay(dying)), "\n".join(wrong)


def test_a_line_of_the_file_is_parted_where_its_outcome_begins() -> None:
    assert parted("exo raw 'A | B' | line | exit 4 | wire 0a1b2c") == ("exo raw 'A | B' | line", "exit 4 | wire 0a1b2c")
    changed = dict(differing({"a": "exit 4 | text 11", "b": "exit 0"}, {"a": "exit 0 | wire 00 | text 11"}))
    assert changed == {"a": "exit 0 -> 4, wire", "b": "not in golden.txt"}
