"""`python -m handctl.newfamily NAME`: write a running family into the source tree here, and what is generated from it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from handctl.newfamily import Refused, carry_out, plan

NEXT = """The commands, tests and pages of {name} run already:
    handctl {name} status --fake
    python -m tests.pins --only {name}
    python -m pytest -q tests/contract tests/pins -k {name}
Now replace its protocol with what the manual says, first in src/handctl/sim/{name}, then in src/handctl/devices/{name}.
"""


def main(argv: Sequence[str]) -> int:
    """Exit code 0; 2 for a name that cannot be one, 1 where a file cannot be written."""
    if len(argv) != 1 or argv[0].startswith("-"):
        sys.stderr.write("usage: python -m handctl.newfamily NAME\n")
        return 2
    top, name = Path.cwd(), argv[0]
    try:
        files = plan(top, name)
        carry_out(files)
    except Refused as exc:
        sys.stderr.write(f"{exc}. Nothing was written.\n")
        return 2
    except OSError as exc:
        sys.stderr.write(f"{exc.filename}: {exc.strerror}. Nothing was written.\n")
        return 1
    for path, text in files.items():
        sys.stdout.write(f"{path.relative_to(top)}: {len(text.splitlines())} lines\n")
    here = {**os.environ, "PYTHONPATH": str(top / "src")}  # the tree that was written to, not the one that is installed
    done = subprocess.run([sys.executable, "-m", "handctl.docgen"], cwd=top, env=here, check=False)
    sys.stdout.write(NEXT.format(name=name))
    return done.returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
