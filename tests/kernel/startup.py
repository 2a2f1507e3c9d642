"""`python -m tests.kernel.startup`: what a command loads and runs until it ends, by class of command, against figures that only fall.

Counted are the modules that Python does not have by itself, and the calls of Python functions, those of click, rich and the
standard library included, but for the import system's own. A busy machine changes neither. The command lowers what has become less. To raise a figure, edit `startup.json` and
give the reason in the commit.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

from tests.kernel.budget import lowered, over

KEPT = Path(__file__).with_name("startup.json")
Figures = dict[str, dict[str, int]]
COMMANDS = (
    "--version",
    "-h",
    "exo -h",
    "exo dump -h",
    "exo dump -p {exo} --json",
    "exo dump -p {exo}",
    "exo dump -p {exo} --color always",
    "exo get temperature -p {exo}",
    "exo set position_set.index=300 -n",
    "exo watch temperature --count 1 -p {exo} --json",
    "exo describe",
    "exo scan --ids 1 -p {exo}",
    "exo stop -p {exo}",
    "wrist dump -p {wrist} --json",
    "barrett dump -p {barrett} --json",
    "ekso dump -p {ekso} --json",
    "aidin dump -p {aidin} --json",
    "hand dump -p {hand} --json",
    "batch {script} -p {exo} --json",
    "trace show {trace}",
    "devices list",
)
"""A command of each class; {exo} is a simulated one on virtual time."""
TRACE = "# handctl exo get\n0.000000 > EB 90 01 04 11 C0 05 02 DD\n0.004120 < 90 EB 01 05 11 C0 05 20 1C 18\n"
CHILD = """
import sys
before, calls, out = set(sys.modules), 0, sys.argv.pop(1)
def count(frame, event, _):
    global calls
    calls += event == "call" and not frame.f_code.co_filename.startswith("<frozen ")
sys.setprofile(count)
from handctl.cli import main
main()
sys.setprofile(None)
with open(out, "w") as file:
    print(len(set(sys.modules) - before), calls, file=file)
"""


def machine() -> dict[str, str]:
    """What the figures are counted with: another Python, or another click, loads other modules."""
    return {"python": "{}.{}".format(*sys.version_info), **{name: version(name) for name in ("click", "rich")}}


def counted(commands: Iterable[str] = COMMANDS) -> Figures:
    """The figures of each command, each in a process of its own that finds nothing of this user's."""
    found: Figures = {}
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        (home / "trace.txt").write_text(TRACE, encoding="utf-8")
        (home / "script").write_text("exo get temperature\nexo get temperature\n", encoding="utf-8")
        kinds = ("exo", "wrist", "barrett", "ekso", "aidin", "hand")
        names = {kind: f"fake://{kind}?clock=virtual" for kind in kinds}
        names |= {"trace": str(home / "trace.txt"), "script": str(home / "script")}
        kept = {name: os.environ[name] for name in ("PATH", "SYSTEMROOT") if name in os.environ}
        env = {**kept, "HOME": folder, "PYTHONHASHSEED": "0", "COLUMNS": "80", "LANG": "C.UTF-8"}
        for command in commands:
            words = [sys.executable, "-c", CHILD, str(home / "counted"), *command.format(**names).split()]
            subprocess.run(words, cwd=folder, env=env, stdin=subprocess.DEVNULL, capture_output=True, check=True)
            modules, calls = map(int, (home / "counted").read_text(encoding="utf-8").split())
            found[command] = {"modules": modules, "calls": calls}
    return found


def main() -> int:
    """Lower the figures; 1 where one has grown."""
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    known = kept.get("commands", {}) if kept.get("machine") == machine() else {}
    now = counted()
    KEPT.write_text(
        json.dumps({"machine": machine(), "commands": lowered(now, known)}, indent=1) + "\n", encoding="utf-8"
    )
    for command, figures in now.items():
        print(f"{command:50} {figures['modules']:5} modules {figures['calls']:6} calls")
    grown = over(now, known) if known else []
    print(*grown, sep="\n")
    return 1 if grown else 0


if __name__ == "__main__":
    sys.exit(main())
