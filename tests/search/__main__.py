"""Search: `python -m tests.search --minutes 10 --seed 1 [--only SUITE] [--jobs 2]`.

All cells of all suites in an order that the seed gives, without any other bound than the time. One command a finding,
which repeats it; counts at the end. `--cell KEY` runs one cell, `--list [SUITE]` tells the keys. Never a gate.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import selectors
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from tests.search.suite import BUSY, SECONDS, Suite, command, run, suites, told
from tests.support.own_state import scratch

AHEAD = 2000
"""Cells of a group among which the next one is drawn."""
LINE = 300


def chosen(only: str) -> list[Suite]:
    """The suites whose cells begin with `only`."""
    return [suite for suite in suites().values() if only.startswith(suite.name) or suite.name.startswith(only)]


def walk(only: str, seed: str, part: int = 0, of: int = 1) -> Iterator[str]:
    """All cells that begin with `only`, in the order of the seed; of several walkers each takes its groups."""
    draw = random.Random(f"{seed}/{part}")
    groups = [group for suite in chosen(only) for group in suite.groups()]
    random.Random(seed).shuffle(groups)
    left = [
        (source, list[str]()) for label, source in groups[part::of] if label.startswith(only) or only.startswith(label)
    ]
    while left:
        at = draw.randrange(len(left))
        source, ready = left[at]
        ready += islice(source, AHEAD - len(ready) if not ready else 1)
        if not ready:
            left.pop(at)
            continue
        place = draw.randrange(len(ready))
        ready[place], ready[-1] = ready[-1], ready[place]
        if (cell := ready.pop()).startswith(only):
            yield cell


def tried(cell: str) -> tuple[str, str]:
    """How it ended, and what is wrong with it; "" when nothing is."""
    folder = tempfile.mkdtemp(prefix="cell")
    try:
        return run(cell, Path(folder)), ""
    except KeyboardInterrupt:
        raise
    except BaseException as exc:  # noqa: BLE001 - whatever gets out of a cell is what is looked for
        return "", told(exc)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


class Worker:
    """A process that walks its part of the cells and tells of each when it begins and how it ended."""

    def __init__(self, args: argparse.Namespace, part: int, end: float, done: frozenset[str] = frozenset()) -> None:
        self.args, self.part, self.end, self.done = args, part, end, set(done)
        self.cell, self.since, self.text = "", time.monotonic(), b""
        self.pipe, out = os.pipe()
        self.pid = os.fork()
        if not self.pid:
            try:
                os.close(self.pipe)
                os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
                self._work(out)
                os._exit(0)
            except BaseException:  # noqa: BLE001 - the cells could not be listed
                traceback.print_exc()
            os._exit(1)
        os.close(out)

    def _work(self, out: int) -> None:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        for cell in walk(self.args.only, str(self.args.seed), self.part, self.args.jobs):
            if time.monotonic() > self.end:
                return
            if cell not in self.done:
                os.write(out, json.dumps([cell]).encode() + b"\n")
                outcome, wrong = tried(cell)
                os.write(out, json.dumps([cell, outcome, wrong[:4000]]).encode() + b"\n")

    def read(self) -> Iterator[tuple[str, str, str]]:
        """What has ended; raises EOFError where the process did."""
        if not (data := os.read(self.pipe, 65536)):
            raise EOFError
        *lines, self.text = (self.text + data).split(b"\n")
        self.since = time.monotonic()
        for line in lines:
            self.cell, *ended = json.loads(line)
            if ended:
                self.done.add(self.cell)
                yield self.cell, *ended
                self.cell = ""

    def ended(self) -> str:
        """How the process ended; "" where it was done."""
        os.close(self.pipe)
        code = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        return f"the process ended: {code}" if code or self.cell else ""


class Tally:
    """What came of the cells."""

    def __init__(self) -> None:
        self.cells: Counter[str] = Counter()
        self.wrong: Counter[str] = Counter()
        self.outcomes: dict[str, Counter[str]] = {}

    def note(self, cell: str, outcome: str, wrong: str) -> None:
        name = cell.partition(" | ")[0]
        self.cells[name] += 1
        if wrong:
            self.wrong[name] += 1
            print(f"{command(cell)}\n    {' '.join(wrong.split())[:LINE]}", flush=True)
        else:
            self.outcomes.setdefault(name, Counter())[outcome] += 1

    def told(self) -> str:
        """Counts by suite, and the outcomes that came most often."""
        lines = []
        for name, count in sorted(self.cells.items()):
            often = ", ".join(f"{n} {outcome}" for outcome, n in self.outcomes.get(name, Counter()).most_common(6))
            lines.append(f"{name}: {count} cells, {self.wrong[name]} findings; {often}")
        return "\n".join([*lines, f"{sum(self.cells.values())} cells, {sum(self.wrong.values())} findings"])


def search(args: argparse.Namespace) -> int:
    """Walk until the time is over or all cells are tried. 1 where something was found."""
    for suite in chosen(args.only):
        suite.seed = args.seed
        next(iter(suite.groups()), None)  # what is imported now is imported in every worker
    end, tally = time.monotonic() + 60 * args.minutes, Tally()
    workers = {worker.pipe: worker for worker in (Worker(args, part, end) for part in range(args.jobs))}
    try:
        while workers:
            with selectors.DefaultSelector() as waiting:
                for pipe in workers:
                    waiting.register(pipe, selectors.EVENT_READ)
                ready = [entry.fd for entry, _ in waiting.select(1.0)]
            for pipe in ready:
                worker = workers[pipe]
                try:
                    for ended in worker.read():
                        tally.note(*ended)
                except EOFError:
                    del workers[pipe]
                    if how := worker.ended():
                        tally.note(worker.cell or "listing", "", how)
                    if worker.cell:
                        again = Worker(args, worker.part, end, frozenset({*worker.done, worker.cell}))
                        workers[again.pipe] = again
            for worker in workers.values():
                if worker.cell and time.monotonic() - worker.since > 2 * BUSY * SECONDS:
                    os.kill(worker.pid, signal.SIGKILL)
    finally:
        for worker in workers.values():
            os.kill(worker.pid, signal.SIGKILL)
            worker.ended()
        print(tally.told())
    return 1 if tally.wrong.total() else 0


def repeat(cell: str) -> int:
    """One cell, and the whole of what is wrong with it."""
    outcome, wrong = tried(cell)
    print(wrong or outcome)
    return 1 if wrong else 0


@scratch()
def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.search", description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="a suite, or how the keys of the cells begin")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--cell", help="run this cell alone")
    parser.add_argument("--list", nargs="?", const="", help="tell the keys that begin so")
    args = parser.parse_args()
    if args.cell is not None:
        return repeat(args.cell)
    if args.list is not None:
        for suite in chosen(args.list):
            for cell in suite.cells():
                if cell.startswith(args.list):
                    print(cell)
        return 0
    return search(args)


if __name__ == "__main__":
    sys.exit(main())
