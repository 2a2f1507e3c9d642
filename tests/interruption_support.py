"""Commands that write, what each shall leave behind, and how one run of them is interrupted and then repeated.

The device is asked through the control socket of its simulator, which is not handctl's code of that family.
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from handctl.sim.serve import send_control
from tests.cli_support import Result, Simulator, clean_environment, program, run

ENDS = (signal.SIGINT, signal.SIGKILL, signal.SIGTERM)
START_UP = 0.5
"""Longest time from the start of the process to its first byte that is waited through at random."""


class Bench:
    """One simulator with its control socket, and a folder for files; `{}` in a command stands for the folder."""

    def __init__(self, family: str, folder: Path, *args: str) -> None:
        self.family, self.folder = family, folder
        self.panel = folder / "panel"
        place = ("--tcp", "127.0.0.1:0") if family == "aidin" else ("--slcan-pty",) if "can" in args else ("--pty",)
        self.simulator = Simulator(*place, *(arg for arg in args if arg != "can"), "--control", self.panel, kind=family)

    def ask(self, question: str) -> str:
        """What the control socket says, without its ok."""
        answer = send_control(str(self.panel), question)
        assert answer.startswith("ok "), answer
        return answer.removeprefix("ok ")

    def words(self, command: str) -> list[str]:
        """The words of a command of this family, with its link."""
        return [self.family, *command.replace("{}", str(self.folder)).split(), "-p", self.simulator.link, "--json"]

    def do(self, command: str) -> Result:
        """Run it undisturbed."""
        return run(*self.words(command), env=self.environment)

    @property
    def environment(self) -> dict[str, str]:
        """Where commands keep what they remember."""
        return {"XDG_STATE_HOME": str(self.folder / "state")}

    def start(self, command: str) -> subprocess.Popen[bytes]:
        """Run it as a process of its own."""
        return subprocess.Popen(
            program(*self.words(command), "--trace", self.trace),
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            env=clean_environment(self.environment), cwd=self.folder,
        )  # fmt: skip

    @property
    def trace(self) -> Path:
        """Where the interrupted command records its bytes."""
        return self.folder / "trace.txt"


def nothing(bench: Bench) -> None:
    """No state to look at."""


@dataclass(frozen=True)
class Case:
    """A command and what it leaves.

    seconds  how long it takes from its first byte on; the interruption comes within this time
    holds    asserts that the device, or a file, is in the state asked for
    before   commands that bring the device somewhere else first
    still    a question to the control socket whose answer must not change any more after Ctrl-C
    again    codes that the repetition may end with: 0, unless the first run can have done it already
    """

    bench: str
    command: str
    seconds: float
    holds: Callable[[Bench], None] = nothing
    before: tuple[str, ...] = ()
    still: str = ""
    again: tuple[int, ...] = (0,)
    fresh: tuple[str, ...] = field(default=())
    """Files that are taken away first."""
    rests: float = 0.0
    """Seconds before the repetition: what no command can stop (a calibration, exo §2.3.6) goes on meanwhile."""

    def __str__(self) -> str:
        return f"{self.bench} {self.command.replace(' -y', '').replace(' --yes --operator me', '')}"


def is_(question: str, answer: str) -> Callable[[Bench], None]:
    """The control socket answers exactly this."""

    def holds(bench: Bench) -> None:
        assert bench.ask(question) == answer, question

    return holds


def begins(question: str, answer: str) -> Callable[[Bench], None]:
    """The answer of the control socket begins with this."""

    def holds(bench: Bench) -> None:
        assert bench.ask(question).startswith(answer), (question, bench.ask(question))

    return holds


def whole_json(name: str, key: str) -> Callable[[Bench], None]:
    """The file is JSON with this key."""

    def holds(bench: Bench) -> None:
        assert key in json.loads((bench.folder / name).read_text(encoding="utf-8"))

    return holds


def interrupt(bench: Bench, case: Case, number: int, source: random.Random) -> tuple[int, str, bool]:
    """Start the command, end it at a random moment; (exit code, stderr, whether it had given its whole result)."""
    bench.trace.unlink(missing_ok=True)
    process = bench.start(case.command)
    if source.random() < 0.9:  # while it talks; else anywhere in its start-up
        end = time.monotonic() + 10
        while not (bench.trace.exists() and " > " in bench.trace.read_text(encoding="utf-8")):
            if process.poll() is not None or time.monotonic() > end:
                break
            time.sleep(0.002)
        time.sleep(source.random() * case.seconds)
    else:
        time.sleep(source.random() * START_UP)
    if process.poll() is None:
        process.send_signal(number)
    out, err = process.communicate(timeout=30)
    finished = False
    if out and process.returncode != -signal.SIGKILL:
        last = json.loads(out if out.startswith(b"{\n") else out.splitlines()[-1])
        last = last.get("end", last)
        assert process.returncode < 0 or last["exit_code"] == process.returncode
        finished = "exit_code" in last
    return process.returncode, err.decode(), finished
