"""The lines, the kinds and the places of the hostile suite; its cells are the suites `hostile-…`."""

from __future__ import annotations

from pathlib import Path

from handctl.command.command_tree import root
from handctl.families import FAMILIES
from tests.harm.lines import examples, leaves, tree
from tests.hostile.devices import KINDS, places
from tests.hostile.random_cells import Lines
from tests.hostile.setting_cells import NAMES, commands


def test_every_command_has_a_line() -> None:
    """A command or family that is new in the tree is asked for by name, and every kind of hostility meets it."""
    assert set(examples()) == set(tree())
    assert {place.hostility for place in places()} == set(KINDS)


def test_each_option_is_tried() -> None:
    assert {"port", "timeout", "format", "yes", "trace", "output", "debug", "poll_json"} <= set(NAMES)
    assert {words[0] for words in commands()} >= set(FAMILIES)


def test_the_lines_reach_every_command(tmp_path: Path) -> None:
    """They are thousands, of every command, and most of them are understood by the parser."""
    source = Lines(0, tmp_path)
    made = [source.one() for _ in range(10 * len(source.leaves))]
    assert len({tuple(words) for words in made}) > 0.8 * len(made)
    missed = [path for path, _ in leaves(root, ()) if not any(set(path) <= set(words) for words in made)]
    assert not missed
