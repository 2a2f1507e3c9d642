"""Run the matrix of promises and print it: `python -m tests.promises [TABLE…]`."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

from handctl.docgen.guide_tables import exceptions
from tests.promises.cells import tried
from tests.promises.tables import TABLES
from tests.support import own_state
from tests.support.in_process import in_process


def main() -> int:
    """Each table with its cells and those that fail; then the exceptions. 1 where one fails."""
    parser = argparse.ArgumentParser(prog="python -m tests.promises", description=__doc__)
    parser.add_argument("tables", nargs="*", choices=[[], *TABLES], metavar="TABLE", help=", ".join(TABLES))
    parser.add_argument("--only", metavar="TEXT", default="", help="only the cells with TEXT in their name")
    asked = parser.parse_args()
    count = bad = 0
    with tempfile.TemporaryDirectory() as folder:
        for name in ("XDG_STATE_HOME", "XDG_RUNTIME_DIR", "TMPDIR"):
            os.environ[name] = ""
        own_state.BELOW[:] = [Path(folder)]
        for table in asked.tables or TABLES:
            began, place = time.process_time(), Path(folder) / table
            with in_process():
                names, failed = tried((cell for cell in TABLES[table]() if asked.only in cell.name), place)
            print(
                f"{table}: {len(names)} cells, {len(failed)} broken, {time.process_time() - began:.1f} s of a processor"
            )
            for cell, why in failed.items():
                print(f"{table}\t{cell}\t{why}")
            count, bad = count + len(names), bad + len(failed)
    rows = list(exceptions())
    print(f"{count} cells, {bad} broken, {len(rows)} exceptions:")
    for row in rows:
        print(f"  {row.family}: {row.promise}: not {row.where}. {row.why}")
    return bool(bad)


if __name__ == "__main__":
    sys.exit(main())
