"""TAB in an interactive bash with the committed completion: from the key to the last letter that it writes."""

from __future__ import annotations

import shutil
import statistics
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from tests.bench.measure import Figure
from tests.support.shell import PROMPT, Terminal

GOAL_MS = 5.0
LINES = {
    "a command": ("handctl exo du", "mp "),
    "a quantity": ("handctl exo get position_actual.in", "dex "),
    "an option": ("handctl exo dump --dead", "line "),
}


def run(*, quick: bool) -> Iterator[Figure]:
    """Yield the figures; medians. Nothing where there is no bash."""
    if shutil.which("bash") is None:
        return
    with tempfile.TemporaryDirectory() as folder:
        terminal = Terminal("bash", Path(folder) / "home")
        try:
            for name, (line, rest) in LINES.items():
                times = [pressed(terminal, line, rest) for _ in range(20 if quick else 60)]
                note = f"median of {len(times)}, slowest {max(times):.1f} ms"
                yield Figure(f"TAB in bash, {name}", statistics.median(times), GOAL_MS, "ms", 1.0, note, "limit")
        finally:
            terminal.close()


def pressed(terminal: Terminal, line: str, rest: str) -> float:
    """Milliseconds from TAB behind `line` until `rest` is there."""
    terminal.child.send(line)
    terminal.child.expect_exact(line)
    start = time.perf_counter()
    terminal.child.send("\t")
    terminal.child.expect_exact(rest)
    took = time.perf_counter() - start
    terminal.child.sendline("")
    terminal.child.expect_exact(PROMPT)
    return took * 1000
