"""Choose the pins of some suites: `python -m tests.pins [SUITE…] [--more N] [--cheaper N] [--seed S] [--only TEXT] [--beside DATA]`.

Candidates are the present pins, cells of what has no pin yet, and N more of each suite in an order that the seed gives. Of these the
cheapest are kept that together show every line and branch of handctl, every outcome of a group and all that needs a pin.
With --cheaper, N further cells are tried for each thing whose cheapest pin takes long. They only stand in for dearer ones: what
they show besides needs no pin.
With --only the other pins stay, and what these do not show gets one. What fails is printed and not kept. What a search has found stays.
--beside is coverage's data of the suite without its pins (`coverage run -m pytest -q --ignore tests/pins`): lines and branches that it
shows need no pin.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections.abc import Hashable, Iterator, Mapping
from itertools import islice

from tests.pins import BY_HAND, file_of, found, pins
from tests.pins.cover import Following, Shown, arcs, cover
from tests.search.suite import Suite, command, suites
from tests.support.own_state import scratch

MOST = 4000
"""Cells of a group among which is chosen."""
EACH = 3
"""Candidates for each thing that has no pin yet."""
DEAR = 60_000
"""Calls of a cell that may have a cheaper one in its place."""


def drawn(suite: Suite, seed: int, only: str) -> list[str]:
    """Its cells in the order of the seed: of each group one in turn."""
    draw = random.Random(seed)
    groups = []
    for label, source in suite.groups():
        if not only or only in label or label == suite.name:
            some = islice(source, MOST * (50 if label == suite.name else 1))
            cells = [*islice((cell for cell in some if only in cell), MOST * (1 if only else 50))]
            draw.shuffle(cells)
            groups.append(cells)
    longest = max(map(len, groups), default=0)
    return [cells[place] for place in range(longest) for cells in groups if place < len(cells)]


def candidates(suite: Suite, seed: int, only: str, more: int) -> list[str]:
    """Cells to choose from: pins that can still be run, some for each thing without one, and so many more."""
    some = [cell for cell in pins(suite) if only in cell and not suite.stale(cell)]
    kept = [cell for cell in pins(suite) if only not in cell]
    bare = dict.fromkeys(set(suite.wanted()) - {what for cell in [*some, *kept] for what in suite.shows(cell)}, EACH)
    if bare or more:
        for cell in drawn(suite, seed, only):
            new = [what for what in suite.shows(cell) if bare.get(what)]
            for what in new:
                bare[what] -= 1
            if new or more > 0:
                some.append(cell)
                more -= not new
            elif not any(bare.values()):
                break
    if nothing := sorted(what for what, left in bare.items() if left == EACH and only in what):
        print(f"{suite.name}: nothing shows {nothing}", file=sys.stderr)
    return list(dict.fromkeys(some))


def stand_ins(suite: Suite, seed: int, seen: Mapping[str, Shown], number: int) -> Iterator[str]:
    """So many further cells for each thing that only dear ones show."""
    least: dict[str, int] = {}
    for cell in set(seen).intersection(pins(suite)):
        for what in suite.shows(cell):
            least[what] = min(seen[cell].cost, least.get(what, seen[cell].cost))
    left = {what: number for what, cost in least.items() if cost > DEAR}
    for cell in drawn(suite, seed, "") if number else ():
        new = [what for what in suite.shows(cell) if left.get(what)] if cell not in seen else []
        for what in new:
            left[what] -= 1
        if new:
            yield cell


def bare(suite: Suite, only: str) -> frozenset[Hashable]:
    """What has no pin that stays; lines and branches of those that stay are not known."""
    has = {what for cell in pins(suite) if only not in cell for what in suite.shows(cell)}
    return frozenset((suite.name, "shows", what) for what in {*suite.wanted()} - has)


def tell(cell: str, shown: Shown) -> None:
    """What is wrong with a cell, if anything is."""
    if shown.wrong:
        print(f"{command(cell)}\n    {' '.join(shown.wrong.split())[:300]}", flush=True)


@scratch()
def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.pins", description=__doc__)
    parser.add_argument("suites", nargs="*", help="suites (default: those that have pins)")
    parser.add_argument("--more", type=int, default=0, help="further cells of each suite to choose from (0)")
    parser.add_argument("--cheaper", type=int, default=0, help="cells to try in place of each dear one (0)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="choose anew only among cells with this text in their key")
    parser.add_argument(
        "--beside", metavar="DATA", default="", help="what the rest of the suite shows, as coverage has it"
    )
    args = parser.parse_args()
    elsewhere = arcs(args.beside) if args.beside else frozenset()
    chosen = [suites()[name] for name in args.suites] or [one for one in suites().values() if file_of(one).exists()]
    following, seen = Following(), dict[str, Shown]()
    for suite in chosen:
        needed = bare(suite, args.only) if args.only else frozenset()
        for cell in candidates(suite, args.seed, args.only, args.more):
            shown = following.shown(suite, cell, lines=not args.only)
            what = shown.what & needed if args.only else shown.what - elsewhere
            seen[cell] = shown._replace(what=what)
            tell(cell, shown)
    needed = frozenset(what for shown in seen.values() for what in shown.what)
    for suite in chosen:
        for cell in [*stand_ins(suite, args.seed, seen, args.cheaper)]:
            shown = following.shown(suite, cell, lines=not args.only)
            seen[cell] = shown._replace(what=shown.what & needed)
            tell(cell, shown)
    best = cover(seen)
    for suite in chosen:
        by_hand = found(suite)
        kept = [cell for cell in pins(suite) if args.only and args.only not in cell]
        own = sorted(
            {*kept, *(cell for cell in best if cell in seen and cell.startswith(f"{suite.name} | "))} - {*by_hand}
        )
        lines = [f"# Cells of the suite {suite.name} that the gate replays. See tests/README.md.", *own]
        lines += ["", BY_HAND, *by_hand] if by_hand else []
        file_of(suite).write_text("\n".join(lines) + "\n", encoding="utf-8")
        cost = sum(seen[cell].cost for cell in own if cell in seen) / 1e6
        print(f"{suite.name}: {len(own)} cells of {cost:.1f} million calls, and {len(by_hand)} that a search has found")
    return 0


if __name__ == "__main__":
    sys.exit(main())
