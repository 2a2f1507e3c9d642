"""`python -m tests.bench [--quick] [--json FILE]`: measure, print one table, exit 1 when a goal is missed."""

from __future__ import annotations

import argparse
import json
import platform
import sys
from datetime import UTC, datetime
from pathlib import Path

from tests.bench import aidin, barrett, exo, startup, wrist
from tests.bench.measure import Figure


def main() -> int:
    """Run all measurements."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="fewer repetitions, no full scan")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    options = parser.parse_args()
    figures: list[Figure] = []
    for part in (startup.run, exo.run, wrist.run, barrett.run, aidin.run):
        for figure in part(quick=options.quick):
            figures.append(figure)
            print(figure.line(), flush=True)
    missed = [figure.name for figure in figures if not figure.met]
    if options.json:
        content = {
            "time": datetime.now(UTC).isoformat(timespec="seconds"),
            "python": platform.python_version(),
            "machine": platform.machine(),
            "figures": [figure.as_row() for figure in figures],
        }
        options.json.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    print(
        f"{len(figures) - len(missed)} of {len(figures)} goals met"
        + (f"; missed: {', '.join(missed)}" if missed else "")
    )
    return 1 if missed else 0


sys.exit(main())
