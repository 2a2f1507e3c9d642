"""The command lines that run on both systems: from the command tree and the facts of the families, and some by hand.

In a line {port} stands for the port of a served simulator; the folder in which it runs holds the files that it names.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from typing import NamedTuple

from handctl.families import FAMILIES
from tests.contract.facts import facts_of
from tests.harm.lines import examples


class Line(NamedTuple):
    """One command line.

    words    behind `handctl`
    part     of the matrix
    served   how its simulator is served: its words behind `sim`; () = none
    live     real time is in what it shows: of that only the number of lines is compared
    """

    words: tuple[str, ...]
    part: str
    served: tuple[str, ...] = ()
    live: bool = False

    def __str__(self) -> str:
        behind = f"   [{' '.join(self.served)}]" if self.served else ""
        return shlex.join(self.words) + behind


ALONE = """
-h | --version | help | help exo-guide | help safety | help options | exo -h | barrett realtime -h | ekso log -h | sim exo -h
stop -h | sim -h | doctor -h | trace -h | nothing | exo dum | exo get nothing --fake | exo set position_set.index=5000 --fake -y
exo dump | exo dump -p COM77 | exo dump -p tcp://127.0.0.1:1 | aidin status -p tcp://127.0.0.1:1 | exo dump -p usb:0403:6001
ports | ports --json | doctor | doctor --family exo -p 'fake://exo?clock=virtual' | exo save --fake | exo position 1 2 3 4 5 --fake | exo dump -p 'fake://exo?clock=virtual' --csv
exo dump -p 'fake://exo?clock=virtual' --json -o out.json | exo dump -p 'fake://exo?clock=virtual' -o out.txt | exo dump -p 'fake://exo?clock=virtual' -o exo | exo dump -p 'fake://exo?clock=virtual' -o nowhere/out.txt
exo dump -p 'fake://exo?clock=virtual' --format plain | exo dump -p 'fake://exo?clock=virtual' --color always | exo dump -p 'fake://exo?clock=virtual' --verbose | ekso describe --json | ekso describe --csv
exo dump -p 'fake://exo?clock=virtual' --trace own.txt | exo dump -p replay:exo/none.txt | devices list | devices add left exo -p COM5 | devices show left
-d left exo status | completion bash | completion zsh | completion fish | completion powershell | completion bash --install
sim forget exo | sim control nothing.sock help | sim exo --pty --duration 0.1 | stop -p tcp://127.0.0.1:1 | trace show exo/stored.json
"""
"""Lines of their own: texts, errors, outputs, names, completion."""

SERVED = {
    "exo": (
        "dump",
        "status --json",
        "watch --count 3 --rate 0 --csv",
        "set position_set.index=300 --yes",
        "position 500 400 300 200 100 --wait 3 --yes",
        "calibrate --yes",
        "snapshot new.json",
        "report report.html --watch 0",
        "id 2 --yes",
        "baud 57600 --yes",
        "stop",
    ),
    "wrist": (
        "dump",
        "status --json",
        "move --pitch 5 --yaw -5 --time 300 --yes",
        "watch --count 3 --rate 0 --csv",
        "hand-read 1000 1",
    ),
    "hand": (
        "dump",
        "status --json",
        "watch --count 3 --rate 0 --csv",
        "set speed_set.index=300 --yes",
        "angle 500 600 700 800 900 400 --wait 5 --yes",
        "id 7 --yes",
        "stop",
    ),
    "barrett": (
        "status",
        "get P MCV --json",
        "init --yes",
        "gcl 'FGET P' --json",
        "realtime --init --velocity 20 --count 20 --yes",
        "set MCV=80 --yes",
        "fingertips",
        "baud 19200 --yes",
    ),
    "ekso": (
        "settings",
        "settings --json",
        "get step_length --json",
        "set step_length=15.5 --operator me --yes",
        "log log.csv --count 20",
        "watch --count 3 --csv",
        "cancel --yes",
    ),
    "aidin": ("status", "get motor_pos", "home --yes", "watch --count 3 --csv", "max-torque 500 --yes"),
}
"""Lines over a served simulator, each on a device fresh from power-on: over a COM port, the AIDIN-hand over TCP."""
LIVE = ("watch", "log", "realtime", "report", "stop", "max-torque")
"""Commands that show times or moving values: of their output only the exit code and the number of lines are compared."""
SETS = {"ekso": ("--set", "sway=0", "--set", "startup=0.1"), "aidin": ("--set", "start=homed")}
FAULTY = {
    "exo": ("silent", "noise", "dribble", "disconnect"),
    "wrist": ("truncate",),
    "hand": ("bad-checksum",),
    "barrett": ("silent",),
    "ekso": ("silent",),
}
"""Faults of the line, with `status`, over a COM port."""


def alone() -> Iterator[Line]:
    """Lines that need no device."""
    for text in ALONE.replace("\n", "|").split("|"):
        if text.strip():
            yield Line(tuple(shlex.split(text)), "alone")


def simulated() -> Iterator[Line]:
    """Every command of every family on its simulator in virtual time: as a person reads it, then as a program does."""
    for path, lines in examples().items():
        for number, line in enumerate(lines):
            if line.family:
                words = [word.replace("{dir}", line.family) for word in line.words]
                yes = ["--yes"] if line.writes or line.asks else []
                at = ["-p", facts_of(line.family).link(line.family, " ".join(path[1:]))]
                yield Line((*words, *yes, *at), "simulator")
                if number == 0:
                    yield Line((*words, *yes, *at, "--format", "ndjson", "--trace", "trace.txt"), "simulator")


def served() -> Iterator[Line]:
    """Lines over a COM port that is a pseudo-terminal here, and over TCP."""
    for family in FAMILIES:
        on = SETS.get(family, ())
        wire = ("--tcp", "127.0.0.1:0") if family == "aidin" else ("--pty",)
        for text in SERVED.get(family, ("dump", "status --json")):
            words = shlex.split(text)
            yield Line((family, *words, "-p", "{port}"), "served", (family, *wire, *on), words[0] in LIVE)
        for fault in FAULTY.get(family, ()):
            words = (family, "status", "--timeout", "0.3", "--deadline", "6", "--retries", "1", "-p", "{port}")
            yield Line(words, "served", (family, *wire, *on, "--fault", fault))
    for wire in (("--tcp", "127.0.0.1:0"), ("--slcan-pty",), ("--slcan-tcp", "127.0.0.1:0")):
        yield Line(("wrist", "dump", "-p", "{port}"), "served", ("wrist", *wire))
    for wire in (("--modbus-pty",), ("--modbus-tcp", "127.0.0.1:0"), ("--slcan-pty",)):
        yield Line(("hand", "dump", "-p", "{port}"), "served", ("hand", *wire))
    yield Line(("scan", "-p", "{port}"), "served", ("exo", "--pty"))
    yield Line(("exo", "dump", "-p", "{port}"), "served", ("exo", "--tcp", "127.0.0.1:0"))


PARTS = {"alone": "without a device", "served": "over COM ports and TCP", "simulator": "simulator, in virtual time"}
"""Part -> how the table names it."""


def every(share: int = 1, part: str = "") -> list[Line]:
    """All lines, or one in `share` of each part, or of one part only."""
    kinds = {"alone": alone, "served": served, "simulator": simulated}
    wanted = [list(dict.fromkeys(kinds[name]())) for name in PARTS if part in ("", name)]
    return [line for kind in wanted for number, line in enumerate(kind) if number % share == 0]
