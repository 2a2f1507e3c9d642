"""Where the files of this project lie."""

from __future__ import annotations

from pathlib import Path

TESTS = Path(__file__).parents[1]
PROJECT = TESTS.parent
README = PROJECT / "README.md"
TRANSCRIPTS = TESTS / "transcripts"
