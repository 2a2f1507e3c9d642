"""No pin is left out."""

from __future__ import annotations

from tests.pins.replay import ALL, files, pinned


def test_every_file_of_pins_is_replayed_by_one_test_file() -> None:
    replayed = [suite.name for name in ALL for suite in pinned(name)]
    assert sorted(replayed) == sorted(files())
    assert {suite.name for suite in pinned()} == files()
