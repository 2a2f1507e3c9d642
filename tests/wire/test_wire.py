"""The part of the golden wire that is in the gate: its pins, `tests/pins/wire.txt`. `python -m tests.wire` replays all."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from handctl.families import FAMILIES
from tests.messages import cells as messages
from tests.pins import pins
from tests.pins.replay import complete
from tests.search.suite import suites
from tests.search.wire import TOOLS
from tests.wire.book import differing, golden, parted, replayed
from tests.wire.cells import cells, groups
from tests.wire.record import Record, Recorder

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


def test_every_cell_is_written_down_and_no_other() -> None:
    known = golden()
    missing = [group[0] for group in groups([key for key in cells() if key not in known])]
    lines = [f"python -m tests.wire --write --only '{key.rpartition(' | ')[0]} |'" for key in missing]
    assert not missing, "\n".join(["no lines in tests/wire/golden.txt for:", *lines])
    gone = [key for key in known if key not in cells()]
    assert not gone, "\n".join(["python -m tests.wire --write removes what there is no more:", *gone])


@pytest.mark.parametrize("owner", [*FAMILIES, TOOLS])
def test_pins(owner: str, replay: Replay) -> None:
    suite = suites()["wire"]
    chosen = [cell for cell in pins(suite) if suite.group(cell) == owner]
    assert chosen
    assert not (stale := [f"{cell}: {why}" for cell in chosen if (why := suite.stale(cell))]), "\n".join(stale)
    keys = {suite.table[cell].key for cell in chosen}
    assert not (wrong := replay([key for key in cells() if key in keys])), "\n".join(wrong)


def test_what_needs_a_pin_has_one() -> None:
    complete(suites()["wire"])


def test_a_line_of_the_file_is_parted_where_its_outcome_begins() -> None:
    assert parted("exo raw 'A | B' | line | exit 4 | wire 0a1b2c") == ("exo raw 'A | B' | line", "exit 4 | wire 0a1b2c")
    changed = dict(differing({"a": "exit 4 | text 11", "b": "exit 0"}, {"a": "exit 0 | wire 00 | text 11"}))
    assert changed == {"a": "exit 0 -> 4, wire", "b": "not in golden.txt"}
