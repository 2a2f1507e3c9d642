"""Where the files of this project lie."""

from __future__ import annotations

from pathlib import Path

TESTS = Path(__file__).parents[1]
PROJECT = TESTS.parent
README = PROJECT / "README.md"
GUIDES = PROJECT / "src/handctl/guides"
TRANSCRIPTS = TESTS / "transcripts"

TEXTS = {"README": README, **{path.stem: path for path in sorted(GUIDES.glob("*.md"))}}
"""What a person reads before the program: README and the guides, by name."""
