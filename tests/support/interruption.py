"""Commands that write, what each shall leave behind, and how one run of them is interrupted and then repeated.

The device is asked through the control socket of its simulator, which is not handctl's code of that family.
"""

from __future__ import annotations

import json
import random
import re
import shlex
import signal
import struct
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from handctl.command.config_file import from_toml
from handctl.sim.engine.serve import send_control
from tests.support.cli import PATIENCE, Result, Simulator, clean_environment, run, start, wait_until

ENDS = (signal.SIGINT, signal.SIGKILL, signal.SIGTERM)
CREEP = 30.0
"""By how much a number may change in CREEP_SECONDS after a stop: a wrist goes back to where it was told to stay.

All movements here change one by more than 100 in that time.
"""
CREEP_SECONDS = 0.1
START_UP = 0.5
"""Longest time from the start of the process to its first byte that is waited through at random."""


PLACES = {
    "": ("--pty",),
    "can": ("--slcan-pty",),
    "rtu": ("--modbus-pty",),
    "modbus": ("--modbus-tcp", "127.0.0.1:0"),
    "tcp": ("--tcp", "127.0.0.1:0"),
}
"""Word of a bench -> where its simulator serves."""


class Bench:
    """One simulator with its control socket, and a folder for files; `{}` in a command stands for the folder.

    The family "" is this machine: whole commands, no link, no simulator.
    """

    def __init__(self, family: str, folder: Path, *args: str) -> None:
        self.family, self.folder = family, folder
        self.panel = folder / "panel"
        self._simulator: Simulator | None = None
        if not family:
            return
        wire = next((arg for arg in args if arg in PLACES), "tcp" if family == "aidin" else "")
        self._more = ["--protocol", "modbus"] if wire == "rtu" else []
        self._simulator = Simulator(
            *PLACES[wire], *(arg for arg in args if arg not in PLACES), "--control", self.panel, kind=family
        )

    @property
    def simulator(self) -> Simulator:
        """The device; this machine has none."""
        assert self._simulator is not None
        return self._simulator

    def stop(self) -> None:
        """End what it started."""
        if self._simulator is not None:
            self._simulator.stop()

    def ask(self, question: str) -> str:
        """What the control socket says, without its ok."""
        answer = send_control(str(self.panel), question)
        assert answer.startswith("ok "), answer
        return answer.removeprefix("ok ")

    def words(self, command: str) -> list[str]:
        """The words of a command of this family, with its link."""
        words = [word.replace("{}", str(self.folder)) for word in shlex.split(command)]
        return [self.family, *words, "-p", self.simulator.link, *self._more, "--json"] if self.family else words

    def do(self, command: str) -> Result:
        """Run it undisturbed."""
        return run(*self.words(command), env=self.environment)

    @property
    def environment(self) -> dict[str, str]:
        """Where commands keep what they remember."""
        places = {name: str(self.folder / name) for name in ("state", "data", "config")}
        return {f"XDG_{name.upper()}_HOME": place for name, place in places.items()}

    def start(self, command: str) -> Any:
        """Run it as a process of its own."""
        words = [*self.words(command), *(["--trace", str(self.trace)] if self.family else [])]
        pipe = subprocess.PIPE
        return start(words, clean_environment(self.environment), stdout=pipe, stderr=pipe, cwd=self.folder)

    @property
    def trace(self) -> Path:
        """Where the interrupted command records its bytes."""
        return self.folder / "trace.txt"

    def sent(self) -> int:
        """Frames that the interrupted command has sent so far."""
        return self.trace.read_text(encoding="utf-8").count(" > ") if self.trace.exists() else 0

    @property
    def files(self) -> list[Path]:
        """What commands keep in the folder; a socket is no file."""
        return [path for path in self.folder.rglob("*") if path.is_file()]

    def half_written(self) -> list[str]:
        """Files that are there, but not whole; of those that grow (trace, log, audit) each line must be."""
        return [path.name for path in self.files if not path.name.endswith((".part", ".tmp")) and not whole(path)]


def whole(path: Path) -> bool:
    """Whether a file has its end and its form, as far as its name says which that is."""
    if path.suffix == ".xdf":
        return path.read_bytes().endswith(b"</info>")
    text = path.read_bytes().decode()
    if path.suffix not in (".json", ".html") and text[-1:] not in ("", "\n"):
        return False
    try:
        match path.suffix:
            case ".json":
                json.loads(text)
            case ".jsonl":
                assert all(isinstance(json.loads(line), dict) for line in text.splitlines())
            case ".toml":
                from_toml(text)
            case ".csv":
                assert len({line.count(",") for line in text.splitlines()}) <= 1
            case ".html":
                return text.rstrip().endswith("</html>")
    except (ValueError, AssertionError):
        return False
    return True


def nothing(bench: Bench) -> None:
    """No state to look at."""


@dataclass(frozen=True)
class Case:
    """A command and what it leaves.

    seconds  how long it takes from its first byte on, without a device from its start on; interrupted within this time
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
    behind: int = 1
    """Frame of the command behind which it is interrupted where no moment is drawn."""
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


def both(*parts: Callable[[Bench], None]) -> Callable[[Bench], None]:
    """Several of them."""

    def holds(bench: Bench) -> None:
        for part in parts:
            part(bench)

    return holds


def whole_json(name: str, key: str) -> Callable[[Bench], None]:
    """The file is JSON with this key."""

    def holds(bench: Bench) -> None:
        assert key in json.loads((bench.folder / name).read_text(encoding="utf-8"))

    return holds


def numbers(answer: str) -> list[float]:
    """The numbers of an answer of the control socket; bytes in hex are words of 16 bits, low byte first."""
    if re.fullmatch(r"[0-9A-F]{2}( [0-9A-F]{2} [0-9A-F]{2})* [0-9A-F]{2}", answer):
        return [float(number) for (number,) in struct.iter_unpack("<h", bytes.fromhex(answer))]
    return [float(word) for word in re.findall(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?", answer)]


def near(question: str, place: int, low: float, high: float) -> Callable[[Bench], None]:
    """The number at this place of the answer is in this range."""

    def holds(bench: Bench) -> None:
        number = numbers(bench.ask(question))[place]
        assert low <= number <= high, (question, bench.ask(question))

    return holds


class Ending(NamedTuple):
    """How an interrupted command ended.

    finished  whether its envelope is there: behind it a signal may end the interpreter itself
    through   whether its work was done and only its result was left to show: what `set` has set going then goes on
    """

    code: int
    err: str
    finished: bool
    through: bool


def interrupt(bench: Bench, case: Case, number: int, source: random.Random | None) -> Ending:
    """Start the command, end it at a random moment; without a source as soon as it has sent the last frame of `behind`."""
    bench.trace.unlink(missing_ok=True)
    process = bench.start(case.command)
    if source is None:
        wait_until(lambda: process.poll() is not None or bench.sent() >= case.behind)
    elif not bench.family:
        time.sleep(source.random() * case.seconds)
    elif source.random() < 0.9:  # while it talks; else anywhere in its start-up
        end = time.monotonic() + PATIENCE
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
    finished, through = False, b"while the result was written" in err
    if out and process.returncode != -signal.SIGKILL:
        last = json.loads(out if out.startswith(b"{\n") else out.splitlines()[-1])
        last = last.get("end", last)
        assert process.returncode < 0 or last["exit_code"] == process.returncode
        finished, through = "exit_code" in last, through or bool(last.get("rows"))
    return Ending(process.returncode, err.decode(), finished, through)
