"""Compare what handctl says with what is written down, or write it again: `python -m tests.messages -h`."""

from __future__ import annotations

import argparse
import difflib
import os
import sys
from pathlib import Path

from tests.messages import cells, sources
from tests.wire.cells import cells as all_cells


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.messages", description=(__doc__ or "").partition(",")[0])
    parser.add_argument("--cells", action="store_true", help="what the cells say, too: takes as long as tests.wire")
    parser.add_argument("--write", action="store_true", help="write sources.txt again, and with --cells cells.txt")
    parser.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1), help="processes (default: 2)")
    asked = parser.parse_args()
    found = [(sources.GOLDEN, sources.HEAD + sources.listed(sources.sayings()))]
    if asked.cells:
        said = cells.sayings(list(all_cells()), asked.jobs)
        found.append((cells.GOLDEN, cells.HEAD + sources.listed(said)))
    return sum(differs(path, text, write=asked.write) for path, text in found)


def differs(path: Path, text: str, *, write: bool) -> bool:
    """Show what differs; True where it does and is left as it is."""
    known = path.read_text(encoding="utf-8") if path.exists() else ""
    lines = difflib.unified_diff(known.splitlines(True), text.splitlines(True), path.name, "now", n=2)
    sys.stdout.writelines(lines)
    if write:
        path.write_text(text, encoding="utf-8")
    elif known != text:
        print("\nif meant: the same command with --write; the commit says why")
    return known != text and not write


if __name__ == "__main__":
    sys.exit(main())
