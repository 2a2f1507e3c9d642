"""Replay the golden wire, write it again, or show one cell: `python -m tests.wire -h`."""

from __future__ import annotations

import argparse
import difflib
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.wire.book import differing, golden, record, replay, write
from tests.wire.cells import cells

TOP = Path(__file__).parents[2]
MOST = 60
"""Cells that differ and are named; of more, how many."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.wire", description=__doc__)
    parser.add_argument("--only", metavar="TEXT", default="", help="only the cells with TEXT in their name")
    parser.add_argument("--jobs", type=int, default=min(2, os.cpu_count() or 1), help="processes (default: 2)")
    parser.add_argument("--all", action="store_true", help=f"name every cell that differs, not {MOST}")
    deed = parser.add_mutually_exclusive_group()
    deed.add_argument("--write", action="store_true", help="write golden.txt again")
    deed.add_argument("--list", action="store_true", help="list the cells")
    deed.add_argument("--show", metavar="CELL", help="run one cell and show all that is hashed of it")
    deed.add_argument(
        "--diff", metavar="CELL", nargs="+", help="CELL [REV]: what has changed since REV (default: HEAD)"
    )
    asked = parser.parse_args()
    if asked.show:
        print(record(named(asked.show)).shown(), end="")
        return 0
    if asked.diff:
        cell, rev, *_ = [*asked.diff, "HEAD"]
        return diff(named(cell), rev)
    keys = [key for key in cells() if asked.only in key]
    if asked.list or not keys:
        print("\n".join(keys) or f"no cell has {asked.only!r} in its name")
        return not keys
    return replay_all(keys, asked)


def replay_all(keys: list[str], asked: argparse.Namespace) -> int:
    """Replay these cells and compare, or write; 1 where one differs."""
    began = time.monotonic()
    found, known = replay(keys, asked.jobs), golden()
    changed = list(differing(found, known))
    gone = [key for key in known if key not in cells()]
    for key, parts in changed if asked.all else changed[:MOST]:
        print(f"{key}: {parts}")
    if len(changed) > MOST and not asked.all:
        print(f"… and {len(changed) - MOST} more (--all names them)")
    print(f"{len(found)} cells in {time.monotonic() - began:.0f} s, {len(changed)} differ, {len(gone)} are no more")
    if asked.write:
        write(found)
        return 0
    if changed:
        print(f"see one:  python -m tests.wire --diff '{changed[0][0]}'")
        print("if meant: python -m tests.wire --write, and say why in the commit")
    return bool(changed or gone)


def named(text: str) -> str:
    """The one cell of that name, or with that text in it."""
    found = [text] if text in cells() else [key for key in cells() if text in key]
    if len(found) != 1:
        sys.exit("\n".join([f"{len(found)} cells have {text!r} in their name", *found[:MOST]]))
    return found[0]


def diff(cell: str, rev: str) -> int:
    """What the cell came to in a revision, run there in a process of its own, against what it comes to now."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        git = ["git", "-C", str(TOP), "worktree"]
        subprocess.run([*git, "add", "--quiet", "--detach", str(tree), rev], check=True)
        try:
            env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tree / "src"), str(tree)])}
            words = [sys.executable, "-m", "tests.wire", "--show", cell]
            then = subprocess.run(words, cwd=tree, env=env, capture_output=True, text=True, check=False)
        finally:
            subprocess.run([*git, "remove", "--force", str(tree)], check=True)
    if then.returncode:
        print(then.stdout + then.stderr, file=sys.stderr)
        return 2
    now = record(cell).shown()
    lines = list(difflib.unified_diff(then.stdout.splitlines(), now.splitlines(), rev, "now", n=4, lineterm=""))
    print("\n".join(lines) or f"{cell}: as in {rev}")
    return bool(lines)


if __name__ == "__main__":
    sys.exit(main())
