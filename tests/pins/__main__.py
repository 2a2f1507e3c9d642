"""Choose the pins of some suites: `python -m tests.pins SUITE… [--minutes M] [--seed S] [--only TEXT]`.

Cells are tried in an order that the seed gives, first those that show what needs a pin. One is kept when it shows something, or ends in
a way, that no other of its group has. What fails is printed and not kept. What a search has found stays.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from itertools import islice

from tests.pins import BY_HAND, file_of, found, pins
from tests.search.__main__ import tried
from tests.search.suite import Suite, command, suites

MOST = 4000
"""Cells of a group among which is chosen."""


def candidates(suite: Suite, seed: int, only: str) -> list[str]:
    """Cells in the order in which they are tried: of each group one in turn."""
    draw = random.Random(seed)
    groups = []
    for label, source in suite.groups():
        if not only or only in label or label == suite.name:
            cells = [cell for cell in islice(source, MOST * (50 if label == suite.name else 1)) if only in cell]
            draw.shuffle(cells)
            groups.append(cells)
    longest = max(map(len, groups), default=0)
    return [cells[place] for place in range(longest) for cells in groups if place < len(cells)]


def choose(suite: Suite, seed: int, minutes: float, only: str, each: int) -> list[str]:
    """The cells that show something new, within the time; all that is wanted is shown, whatever time that takes."""
    kept = [cell for cell in pins(suite) if only and only not in cell]
    seen = {what for cell in kept for what in suite.shows(cell)}
    wanted = Counter({what: each for what in suite.wanted() if (not only or only in what) and what not in seen})
    outcomes: set[tuple[str, str]] = set()
    end = time.monotonic() + 60 * minutes
    later = []
    for cell in candidates(suite, seed, only):
        if new := [what for what in suite.shows(cell) if wanted[what] > 0]:
            if (outcome := told(cell)) is not None:
                wanted.subtract(new)
                outcomes.add((suite.group(cell), outcome))
                kept.append(cell)
        else:
            later.append(cell)
    for cell in later:
        if time.monotonic() > end:
            break
        outcome = told(cell)
        if outcome is not None and (suite.group(cell), outcome) not in outcomes:
            outcomes.add((suite.group(cell), outcome))
            kept.append(cell)
    if bare := sorted(what for what, left in wanted.items() if left == each):
        print(f"{suite.name}: nothing shows {bare}", file=sys.stderr)
    return sorted(set(kept))


def told(cell: str) -> str | None:
    """How it ended; None where it failed, which is printed."""
    outcome, wrong = tried(cell)
    if wrong:
        print(f"{command(cell)}\n    {' '.join(wrong.split())[:300]}", flush=True)
        return None
    return outcome


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.pins", description=__doc__)
    parser.add_argument("suites", nargs="*", help="suites (default: those that have pins)")
    parser.add_argument("--minutes", type=float, default=1.0, help="time for further outcomes of each suite")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--each", type=int, default=1, help="pins for each thing that needs one")
    parser.add_argument("--only", default="", help="choose anew only among cells with this text in their key")
    args = parser.parse_args()
    for name in args.suites or [suite.name for suite in suites().values() if file_of(suite).exists()]:
        suite = suites()[name]
        by_hand = found(suite)
        chosen = [cell for cell in choose(suite, args.seed, args.minutes, args.only, args.each) if cell not in by_hand]
        lines = [f"# Cells of the suite {name} that the gate replays. See tests/README.md.", *chosen]
        lines += ["", BY_HAND, *by_hand] if by_hand else []
        file_of(suite).write_text("\n".join(lines) + "\n", encoding="utf-8")
        print(f"{name}: {len(chosen)} cells, and {len(by_hand)} that a search has found")
    return 0


if __name__ == "__main__":
    sys.exit(main())
