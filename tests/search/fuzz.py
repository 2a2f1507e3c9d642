"""Without an end: every decoder, file and simulator under streams of one seed, and the state machine of every device."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

from hypothesis import Phase, seed, settings
from hypothesis.stateful import run_state_machine_as_test

from tests.ekso import test_cli_log
from tests.fuzz import test_files, test_fuzz, test_machines
from tests.fuzz.support import Episode, run_episodes
from tests.search.suite import Listed, Suite, key, parts
from tests.sim import test_kept
from tests.support.virtual import virtual_time

SLOWEST = 5.0
"""Processor seconds that one episode may take: what is quadratic shows in its floods."""
STEPS = 30
DAMAGED = ("snapshots", "configurations")


class Seeded(Suite):
    """Cells of names and numbers, without an end."""

    names: tuple[str, ...] = ()

    def cells(self) -> Iterator[str]:
        for number in count(self.seed):
            for name in self.names:
                yield key(self.name, name, f"seed {number}")


class Fuzz(Seeded):
    """Some thousand chunks of one seed for a decoder, a simulator or a file."""

    name = "fuzz"
    names = (*test_fuzz.DECODERS, *DAMAGED)

    def run(self, cell: str, folder: Path) -> str:
        _, name, number = parts(cell)
        chunks = 40 if name in DAMAGED else test_fuzz.FILES.get(name, test_fuzz.SHORT)
        done, slowest = run_episodes(self.episode(name, folder), chunks, int(number.split()[1]))
        assert done >= chunks and slowest < SLOWEST, (done, slowest)
        return "right"

    def episode(self, name: str, folder: Path) -> Episode:
        if name == "snapshots":
            return test_files.snapshots(test_files.made(folder), folder)
        return test_files.configurations(folder) if name in DAMAGED else test_fuzz.episode_of(name, folder)


class Machines(Seeded):
    """Random commands against a device and the small model of its manual."""

    name = "machines"
    names = tuple(test_machines.MACHINES)

    def run(self, cell: str, folder: Path) -> str:
        _, name, number = parts(cell)
        machine, examples, _ = test_machines.MACHINES[name]
        bounded = settings(
            max_examples=examples, stateful_step_count=STEPS, deadline=None, database=None, derandomize=False,
            suppress_health_check=test_machines.QUIET, print_blob=True, phases=[Phase.generate],
        )  # fmt: skip
        seed(int(number.split()[1]))(machine)
        run_state_machine_as_test(machine, settings=bounded)  # type: ignore[no-untyped-call]
        return "right"


class Unplugs(Seeded):
    """Ten times the cable is pulled, in one log of an EksoNR."""

    name = "unplugs"
    names = ("rate 0", "rate 50")

    def run(self, cell: str, folder: Path) -> str:
        _, rate, number = parts(cell)
        test_cli_log.unplugged(folder, int(rate.split()[1]), int(number.split()[1]))
        return "whole"


class Kept(Listed):
    """The state of a simulator in which one value is spoiled, each in turn."""

    name = "kept"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for family in test_kept.WRITES:
            yield (family,), family

    def tried(self, row: Any, folder: Path) -> str:
        with virtual_time():
            test_kept.spoiled(row, 1)
        return "told"


SUITES = (Fuzz(), Machines(), Unplugs(), Kept())
