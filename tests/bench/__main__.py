"""`python -m tests.bench [--quick] [--peers] [--json FILE] [--guide]`: measure everything, a row as it comes, exit 1 on a missed goal.

`--age` measures nothing: it reports whether the code has changed since the published figures. A part that fails is a row of the table, with what it has measured until then, and the others are measured all the same.
"""

from __future__ import annotations

import argparse
import sys
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

from tests.bench import aidin, barrett, ekso, exo, exports, hand, plot, session, startup, stop, tab, transcript, wrist
from tests.bench.measure import Figure
from tests.bench.peers import Peers
from tests.bench.report import age, content, dumps, line, publish

PARTS: dict[str, Callable[..., Iterator[Figure]]] = {
    "startup": startup.run,
    "tab": tab.run,
    "exo": exo.run,
    "wrist": wrist.run,
    "barrett": barrett.run,
    "ekso": ekso.run,
    "aidin": aidin.run,
    "hand": hand.run,
    "session": session.run,
    "stop": stop.run,
    "transcript": transcript.run,
    "plot": plot.run,
    "exports": exports.run,
}
TRIES = 3
"""A part with a missed goal is measured again: a busy machine only ever makes figures worse, a slow program each time."""


def main() -> int:
    """Run all measurements."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer repetitions, no sequential scan")
    parser.add_argument(
        "--peers", action="store_true", help="install other tools for a while and measure their start-up"
    )
    every = [*PARTS, "peers"]
    parser.add_argument("--only", metavar="PART", nargs="+", choices=every, default=[], help=", ".join(every))
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    parser.add_argument(
        "--guide",
        action="store_true",
        help="write tests/bench/last.json and the section Benchmarks of handctl-development(7)",
    )
    parser.add_argument("--age", action="store_true", help="only report whether the published figures are of this code")
    options = parser.parse_args()
    if options.age:
        print(age())
        return 0
    if options.guide and options.only:
        parser.error("--guide shows everything, not --only a part")
    peers = Peers()
    parts = {**PARTS, "peers": peers.run} if options.peers or "peers" in options.only else PARTS
    figures: list[Figure] = []
    for name, part in parts.items():
        if not options.only or name in options.only:
            figures += measured(name, part, options.quick)
    found = content(figures, quick=options.quick, peers=peers.present, absent=peers.absent)
    for name in peers.absent:
        print(f"{name} could not be installed")
    failed = [figure.name for figure in figures if figure.failed]
    missed = [figure.name for figure in figures if not figure.met and not figure.failed]
    goals = sum(figure.goal is not None for figure in figures)
    print(
        f"{goals - len(missed)} of {goals} goals met"
        + (f"; missed: {', '.join(missed)}" if missed else "")
        + (f"; failed: {', '.join(failed)}" if failed else "")
    )
    if options.json:
        options.json.write_text(dumps(found), encoding="utf-8")
    if options.guide and not failed:
        publish(found)
    return 1 if missed or failed else 0


def measured(name: str, part: Callable[..., Iterator[Figure]], quick: bool) -> list[Figure]:
    """The figures of a part; with a missed goal, and unless `quick`, the best of each of up to TRIES measurements.

    An error in it is no matter of speed: the part is not tried again, and a figure of its name says so.
    """
    best: dict[str, Figure] = {}
    for _ in range(1 if quick else TRIES):
        try:
            for figure in part(quick=quick):
                print(line(figure.as_row()), flush=True)
                if figure.name not in best or figure.ratio < best[figure.name].ratio:
                    best[figure.name] = figure
        except Exception as exc:  # noqa: BLE001 - whatever it is, the other parts are measured
            traceback.print_exc()
            failure = Figure.failure(name, exc)
            print(line(failure.as_row()), flush=True)
            return [*best.values(), failure]
        if all(figure.met for figure in best.values()):
            break
    return list(best.values())


if __name__ == "__main__":
    sys.exit(main())
