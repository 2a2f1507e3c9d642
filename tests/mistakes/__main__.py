"""python -m tests.mistakes [NAME…] [--list] [--find FILE…] [--suite-passed] [--jobs N]: every seeded mistake must be found by its tests.

Each mistake gets a process of its own, in which each test named with it must fail: one that has imported everything already
(`in_place`), or else one that imports the mistake (`seeded`). Then the cases that failed run without any mistake, where each must
pass; .ci/run leaves that out, for its suite has just run them all. Exit code 1 if a mistake was missed, if its line is gone from its
function, or if a test is not there.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

from tests.mistakes.in_place import Functions, functions, imported, replaceable, seed_in_place
from tests.mistakes.seeded import foreign, prepare, run, seed
from tests.mistakes.table import TOP, Mistake, Stale, mistakes
from tests.mistakes.together import Outcomes, together
from tests.support.each_row import FIRST
from tests.support.own_state import scratch


def healthy(tests: Sequence[str]) -> Outcomes:
    """The tests without a mistake."""
    verdict = run(tests)
    wrong = {name: f"fails without a mistake: {text}" for name, text in verdict.failed.items()}
    wrong.update({name: "is not there, or was skipped" for name in tests if name not in verdict.passed})
    return {"broken": verdict.broken, "wrong": wrong}


def seeded(one: Mistake, files: Sequence[str], known: Functions | None = None) -> Outcomes:
    """The tests of one mistake, or whole files, with the mistake; in place where all functions are known."""
    if not (files or one.tests):
        return {"broken": ["no test is named with it"]}
    try:
        if known is None:
            seed(one.patches)
        elif not seed_in_place(one.patches, known):
            return {"broken": ["cannot be seeded in place"]}
    except Stale as exc:
        return {"broken": [f"no longer fits: {exc}"]}
    before = foreign()
    verdict = run(files or one.tests)
    missed = [] if files else [name for name in one.tests if name not in verdict.failed]
    return {
        "broken": verdict.broken,
        "missed": [
            f"{name} {'passes' if name in verdict.passed else 'is not there, or was skipped'}" for name in missed
        ],
        "failed": verdict.failed,
        "items": list(verdict.items.values()),
        "took": verdict.passed,
        "foreign": sorted(foreign() - before),
    }


def chosen(names: Sequence[str]) -> list[Mistake]:
    """Those of these names, rooms or kinds; all without any."""
    known = mistakes()
    if unknown := [name for name in names if not any(name in (one.name, one.room, one.kind) for one in known)]:
        raise Stale(f"there is no mistake, room or kind {', '.join(unknown)}")
    return [one for one in known if not names or {one.name, one.room, one.kind} & set(names)]


def told(name: str, problems: Iterable[str]) -> None:
    """A mistake that was missed, and the command that says so again."""
    print(f"MISSED {name}\n  " + "\n  ".join(problems) + f"\n  repeat: python -m tests.mistakes {name}")


def tried(
    some: Sequence[Mistake], jobs: int, folder: Path, known: Functions | None, suite_passed: bool
) -> dict[str, list[str]]:
    """Each mistake, and what is wrong with it: nothing where each of its tests fails with it and passes without."""
    wrong: dict[str, list[str]] = {}
    items: dict[str, list[str]] = {}
    for name, result in together([(one.name, partial(seeded, one, (), known)) for one in some], jobs, folder):
        wrong[name] = [*result["broken"], *result.get("missed", ())]
        items[name] = result.get("items", [])
        prepare(result.get("foreign", ()))
    if suite_passed:
        return wrong
    files = sorted({item.partition("::")[0] for own in items.values() for item in own})
    shares: list[set[str]] = [set() for _ in range(jobs)]
    for item in {item for own in items.values() for item in own}:
        shares[files.index(item.partition("::")[0]) % jobs].add(item)
    without = [
        (f"without a mistake {part}", partial(healthy, sorted(share))) for part, share in enumerate(shares) if share
    ]
    for part, result in together(without, jobs, folder, 600.0):
        lost = dict.fromkeys(shares[int(part.split()[-1])], "; ".join(result["broken"])) if result["broken"] else {}
        failed = {**lost, **result.get("wrong", {})}
        for name, own in items.items():
            wrong[name] += [f"{item} {failed[item]}" for item in own if item in failed]
    return wrong


def in_place(some: Sequence[Mistake], jobs: int, folder: Path, suite_passed: bool) -> Outcomes:
    """These mistakes in children of one process that has imported everything: which are found there."""
    imported(sorted({test for one in some for test in one.tests}))
    known = functions()
    some = [one for one in some if replaceable(one.patches)]
    gc.freeze()
    return {"found": [name for name, wrong in tried(some, jobs, folder, known, suite_passed).items() if not wrong]}


def check(some: Sequence[Mistake], jobs: int, folder: Path, suite_passed: bool) -> int:
    """Run all of it, what can be seeded in place first; how many were missed."""
    ((_, there),) = together([("in place", partial(in_place, some, jobs, folder, suite_passed))], 1, folder, 900.0)
    found = there.get("found", ())
    missed: Counter[str] = Counter()
    rest = [one for one in some if one.name not in found]
    for name, problems in tried(rest, jobs, folder, None, suite_passed).items():
        if problems:
            missed[name] += 1
            told(name, problems)
    table(some, missed)
    print(f"{len(found)} of them were seeded in place")
    return len(missed)


def table(some: Sequence[Mistake], missed: Counter[str]) -> None:
    """How many there are of each kind and in each room."""
    for title, of in (("kind", lambda one: one.kind), ("room", lambda one: one.room)):
        print(f"\n{title:<36} seeded  found")
        for name, count in sorted(Counter(of(one) for one in some).items()):
            lost = sum(1 for one in some if of(one) == name and one.name in missed)
            print(f"{name:<36} {count:6} {count - lost:6}")
    print(f"\n{len(some)} mistakes, {len(some) - len(missed)} found")


def find(some: Sequence[Mistake], files: Sequence[str], jobs: int, folder: Path) -> None:
    """Which tests of these files, or below these folders, find each mistake, the quickest first."""
    below = {name: sorted((TOP / name).rglob("test_*.py")) for name in files}
    names = [str(path.relative_to(TOP)) for found in below.values() for path in found]
    names += [name for name, found in below.items() if not found]
    for name, result in together([(one.name, partial(seeded, one, names)) for one in some], jobs, folder, 600.0):
        print(
            f"{name}: {len(result.get('failed', ()))} tests find it{''.join('; ' + text for text in result['broken'])}"
        )
        failed, took = result.get("failed", {}), result.get("took", {})
        for test in sorted(failed, key=lambda test: took.get(test, 0.0))[:12]:
            print(f"  {took.get(test, 0.0):6.3f} s  {test}  {failed[test]}")


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m tests.mistakes", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="of mistakes, rooms or kinds; all without any")
    parser.add_argument("--list", action="store_true", help="name them, with the tests that must find each")
    parser.add_argument("--find", nargs="+", metavar="FILE", help="say which tests of these files or folders find them")
    parser.add_argument("--suite-passed", action="store_true", help="the tests are known to pass without a mistake")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes at once (2)")
    args = parser.parse_args()
    began = time.monotonic()
    try:
        some = chosen(args.names)
    except Stale as exc:
        parser.error(str(exc))
    if args.list:
        for one in some:
            print(f"{one.room:<10} {one.kind:<28} {one.name}")
            print("".join(f"{'':<11}{test}\n" for test in one.tests), end="")
        return 0
    gc.disable()  # syntax trees and modules: all of it stays. Each child has its own again, once its tests are collected
    os.environ[FIRST] = "1"
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"  # looking for plugins takes each child as long as a test
    with scratch() as folder:
        if args.find:
            find(some, args.find, args.jobs, folder)
            return 0
        lost = check(some, args.jobs, folder, args.suite_passed)
    print(f"{time.monotonic() - began:.1f} s")
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
