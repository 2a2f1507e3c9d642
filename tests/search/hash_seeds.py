"""The order of a set must not show: the golden wire in processes with other hash seeds than this one."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.search.suite import Listed
from tests.wire.cells import cells, groups

SEEDS = ("0", "1", "2")
TOP = Path(__file__).parents[2]


class HashSeeds(Listed):
    """Command with its wire, hash seed: all that is done to it comes out as golden.txt has it."""

    name = "hash-seeds"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for name in (group[0].rpartition(" | ")[0] for group in groups(list(cells()))):
            for seed in SEEDS:
                yield (name.split()[0], name, seed), (name, seed)

    def tried(self, row: Any, folder: Path) -> str:
        name, seed = row
        words = ["-m", "tests.wire", "--jobs", "1", "--only", f"{name} |"]
        done = subprocess.run(
            [sys.executable, *words],
            cwd=TOP,
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=False,
        )
        again = f"PYTHONHASHSEED={seed} python {shlex.join(words)}"
        assert not done.returncode, f"{done.stdout[:2000]}{done.stderr[-1000:]}\nrepeat: {again}"
        return "as written down"


SUITES = (HashSeeds(),)
