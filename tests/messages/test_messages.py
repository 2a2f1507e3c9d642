"""Every message is written down, and each of them is read as a diff before it changes."""

from __future__ import annotations

import difflib
from pathlib import Path

from tests.messages.sources import GOLDEN, HEAD, listed, sayings

CELLS = Path(__file__).parent / "cells.txt"


def test_every_message_of_the_source_is_written_down() -> None:
    known, now = GOLDEN.read_text(encoding="utf-8"), HEAD + listed(sayings())
    changed = "".join(difflib.unified_diff(known.splitlines(True), now.splitlines(True), GOLDEN.name, "now", n=1))
    assert not changed, f"if meant: python -m tests.messages --write\n{changed}"


def test_no_hint_shows_the_place_of_its_command() -> None:
    """A `{}` inside the braces of an f-string is not unescaped, and stays around the command."""
    assert "{`" not in CELLS.read_text(encoding="utf-8")
