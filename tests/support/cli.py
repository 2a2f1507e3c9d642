"""Helpers of the command-line tests: run handctl in this process or as a program, served simulators, transcripts.

`run` calls `handctl.cli.main` with captured streams and no terminal; `fake` spells links on virtual time; a `Spy` keeps
the simulated devices that commands talked to, so that a test can look into their memory afterwards.
"""

from __future__ import annotations

import io
import json
import os
import re
import selectors
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib import resources
from pathlib import Path
from types import TracebackType
from typing import Any

import click
import serial
from jsonschema import Draft202012Validator

import handctl.sim
from handctl import cli
from handctl.command import command_tree
from handctl.errors import HandctlError
from handctl.model.result import Journal
from tests.support.swap import swapped

PATIENCE = 30.0
"""Seconds for what must come or end: only a hang takes so long, on any machine."""
FINGERS = ("little", "ring", "middle", "index", "thumb")

# What the simulated hand shows at power-on (dossier, simulator notes): name -> (address, bytes an element, values).
POWER_ON: dict[str, tuple[int, int, tuple[int, ...]]] = {
    "id": (1000, 1, (1,)),
    "baud_code": (1001, 1, (0,)),
    "clear_errors": (1004, 1, (0,)),
    "save": (1005, 1, (0,)),
    "calibrate": (1009, 1, (0,)),
    "system_voltage": (1472, 2, (558,)),
    "position_set": (1486, 2, (151, 252, 353, 454, 555)),
    "force_set": (1498, 2, (-61, 62, -63, 64, -65)),
    "position_actual": (1546, 2, (110, 220, 330, 440, 550, 660)),
    "force_actual": (1582, 2, (-11, 12, -13, 14, -15)),
    "current": (1594, 2, (21, 22, 23, 24, 25)),
    "error": (1606, 1, (0, 0, 0, 0, 0)),
    "temperature": (1618, 1, (31, 32, 33, 34, 35)),
}


def elements(name: str) -> tuple[str | None, ...]:
    """The element names of a quantity, (None,) for a single value."""
    count = len(POWER_ON[name][2])
    return (None,) if count == 1 else (*FINGERS, "thumb_rotation")[:count]


class Result:
    """What one run left behind; `said` are the codes of its messages in their order, an error's last."""

    def __init__(self, code: int, out: bytes, err: bytes, said: Sequence[str] = ()) -> None:
        self.code = code
        self.said = list(said)
        self.raw = out
        self.out = out.decode()
        self.err = err.decode()
        self._valid = False

    def __repr__(self) -> str:
        return f"exit {self.code}\n--- stdout\n{self.out}--- stderr\n{self.err}"

    @property
    def json(self) -> dict[str, Any]:
        """The JSON envelope on stdout, checked against the packaged schema."""
        content = json.loads(self.out)
        self._validate(content)
        assert content["exit_code"] == self.code, self
        return content  # type: ignore[no-any-return]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The rows of the JSON envelope."""
        return list(self.json["rows"])

    @property
    def values(self) -> dict[str, Any]:
        """Value (or None where there is an error) by "name" or "name.finger"."""
        return {row["name"] + (f".{row['finger']}" if row.get("finger") else ""): row.get("value") for row in self.rows}

    @property
    def lines(self) -> list[str]:
        """Lines of stdout."""
        return self.out.splitlines()

    @property
    def stream(self) -> tuple[list[dict[str, Any]], dict[str, Any]]:
        """NDJSON: the rows, and the envelope of the closing line, checked against the schema."""
        *rows, last = [json.loads(line) for line in self.lines]
        assert set(last) == {"end"}, self
        self._validate(last["end"])
        assert last["end"]["exit_code"] == self.code, self
        assert "rows" not in last["end"]
        return rows, last["end"]

    def _validate(self, envelope: object) -> None:
        """Once: the text does not change."""
        if not self._valid:
            check_schema(envelope)
            self._valid = True

    @property
    def error(self) -> dict[str, Any]:
        """The one error message of the JSON envelope."""
        (message,) = [message for message in self.json["messages"] if message["level"] == "error"]
        return message  # type: ignore[no-any-return]

    def codes(self) -> list[str]:
        """Codes of all messages of the JSON envelope."""
        return [message["code"] for message in self.json["messages"]]


@cache
def schema() -> Draft202012Validator:
    """The validator of the packaged schema of the envelope."""
    text = resources.files("handctl").joinpath("schema", "envelope-1.json").read_text(encoding="utf-8")
    content = json.loads(text)
    Draft202012Validator.check_schema(content)
    return Draft202012Validator(content)


KNOWN: set[object] = set()
"""What the schema allows: rows, messages and writes by their shape."""
FREE = frozenset({"text", "hint", "bytes", "meaning", "next", "evidence", "last"})
"""Texts of messages and writes that may be anything."""


def shape(row: Any) -> tuple[Any, ...]:
    """All that the schema asks of a row: which keys it has, and what kind of value each."""
    kinds = tuple(map(type, row.values()))
    lists = [frozenset(map(type, value)) for value in row.values() if type(value) is list] if list in kinds else ()
    return (*row, *kinds, *lists, str(row.get("t", "")).startswith("-"))


def told(part: Any) -> Any:
    """All that the schema asks of a message or a step of a plan: of free text that it is text, of the rest what it is."""
    if not isinstance(part, dict):
        return repr(part)
    return tuple((key, type(value), bool(value)) if key in FREE else (key, repr(value)) for key, value in part.items())


def check_schema(envelope: Any) -> None:
    """Assert that an envelope is valid by the packaged schema."""
    new: dict[object, Any] = {}
    for part, kind in (("rows", shape), ("messages", told), ("writes", told)):
        if items := envelope.get(part):
            found = {kind(item): item for item in items}
            left = [item for key, item in found.items() if key not in KNOWN or item.get("level") == "error"]
            envelope, new = {**envelope, part: left}, {**new, **found}
    if (whole := _as_asked(envelope)) not in KNOWN:
        problems = [f"{'/'.join(map(str, e.absolute_path))}: {e.message}" for e in schema().iter_errors(envelope)]
        assert not problems, problems
    KNOWN.update(new, [whole])


def _as_asked(envelope: Any) -> str:
    """All that the schema asks of an envelope: of free text that it is text, of numbers their sign, of times their form."""
    if not isinstance(envelope, dict):
        return repr(envelope)
    return repr({key: ASKED[key](value) if key in ASKED else value for key, value in envelope.items()})


def _signs(value: Any) -> Any:
    numbers = (int, float)
    items = value.items() if isinstance(value, dict) else ()
    return {key: (type(one), one < 0) if type(one) in numbers else one for key, one in items} or value


def _device(value: Any) -> Any:
    items = value.items() if isinstance(value, dict) else ()
    return {key: one if key == "identity" else type(one) for key, one in items} or value


def _time(value: Any) -> str:
    return DIGIT.sub("0", repr(value))


def _messages(value: Any) -> Any:
    """Of one that is known to be right only its level: a failed command must have an error."""
    return [one["level"] if told(one) in KNOWN else one for one in value] if isinstance(value, list) else value


ASKED: dict[str, Callable[[Any], Any]] = {
    **dict.fromkeys(("command", "scan", "service", "loop", "statistics", "firmware"), type),
    **dict.fromkeys(("counters", "stream", "line"), _signs),
    **dict.fromkeys(("time", "started"), _time),
    "device": _device,
    "messages": _messages,
}
"""Key -> what of it the schema looks at; of others all."""
DIGIT = re.compile(r"[0-9]")


DROPPED = ("NO_COLOR", "COLUMNS", "LINES", "FORCE_COLOR", "PYTHONUNBUFFERED")


def clean_environment(extra: Mapping[str, str] | None = None) -> dict[str, str]:
    """The environment without anything that changes handctl's output, plus `extra`."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith("HANDCTL_") and k not in DROPPED}
    return {**kept, "XDG_CONFIG_HOME": "/dev/null/none", **(extra or {})}


@contextmanager
def environment(extra: Mapping[str, str] | None = None) -> Iterator[None]:
    """A clean environment; only what differs is touched, since thousands of commands run in one process.

    What is there is looked at as the system has it: `os.environ` decodes all of it each time.
    """
    raw: dict[bytes, bytes] = os.environ._data  # type: ignore[attr-defined]
    with restored_environment():
        ours = [name for name in raw if name.startswith(OURS)] if OURS in b"\0".join(raw) else ()
        for name in {*ours, *(raw.keys() & UNCLEAN)}:
            del os.environb[name]
        os.environ.update({"XDG_CONFIG_HOME": "/dev/null/none", **(extra or {})})
        yield


@contextmanager
def restored_environment() -> Iterator[None]:
    """Behind it the environment is as before, whatever was done to it."""
    raw: dict[bytes, bytes] = os.environ._data  # type: ignore[attr-defined]
    before = raw.copy()
    try:
        yield
    finally:
        for name in raw.keys() - before.keys():
            del os.environb[name]
        for name in [name for name, value in before.items() if raw.get(name) is not value]:
            os.environb[name] = before[name]


UNCLEAN = frozenset(map(os.fsencode, DROPPED))
OURS = b"HANDCTL_"


def run(
    *args: str | Path, env: Mapping[str, str] | None = None, stdin: str = "", stdout: io.TextIOWrapper | None = None
) -> Result:
    """Run handctl in this process, nothing being a terminal. What goes to a `stdout` of the test's own is not in the result."""
    kept, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", newline="") for _ in range(2))
    out = stdout or kept
    handlers = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    said: list[str] = []
    with (
        hearing(said),
        environment(env),
        swapped((sys, "stdout", out), (sys, "stderr", err), (sys, "stdin", io.StringIO(stdin))),
    ):
        try:
            code = cli.main([str(arg) for arg in args])
        finally:
            for number, handler in handlers.items():
                signal.signal(number, handler)
            kept.flush()
            err.flush()
    return Result(code, kept.buffer.getvalue(), err.buffer.getvalue(), said)  # type: ignore[attr-defined]


@contextmanager
def refusing(kind: str) -> Iterator[io.TextIOWrapper]:
    """A stdout that takes nothing: a full disk ("full"), or a pipe whose reader has left ("left")."""
    reader, writer = os.pipe()
    os.close(reader)
    number = writer if kind == "left" else os.open("/dev/full", os.O_WRONLY)
    ours = os.dup(1)  # handctl lets its own go nowhere then
    out = io.TextIOWrapper(open(number, "wb"), encoding="utf-8")  # noqa: SIM115 - closing it may fail
    try:
        yield out
    finally:
        with suppress(OSError):  # what it did not take is tried once more
            out.close()
        os.dup2(ours, 1)
        os.close(ours)
        if kind != "left":
            os.close(writer)


@contextmanager
def hearing(said: list[str]) -> Iterator[None]:
    """Take the code of every message of the commands in this process, whatever way it is shown."""
    note, main = Journal.note, command_tree.root.main

    def noted(journal: Journal, level: str, code: str, text: str, hint: str = "") -> None:
        said.append(code)
        note(journal, level, code, text, hint)

    def ended(*args: Any, **more: Any) -> Any:
        try:
            return main(*args, **more)
        except (HandctlError, click.UsageError) as exc:
            said.append(getattr(exc, "code", "usage"))
            raise

    with swapped((Journal, "note", noted), (command_tree.root, "main", ended)):
        yield


def program(*args: str | Path) -> list[str]:
    """The command line that runs handctl as a program of its own."""
    return [sys.executable, "-m", "handctl", *(str(arg) for arg in args)]


def start(args: Sequence[str | Path], env: Mapping[str, str], **more: Any) -> subprocess.Popen[bytes]:
    """handctl as a process of its own, with no stdin."""
    return subprocess.Popen(program(*args), env=dict(env), stdin=subprocess.DEVNULL, **more)


def run_program(*args: str | Path, env: Mapping[str, str] | None = None, timeout: float = 30.0, **more: Any) -> Result:
    """Run handctl as a process of its own, without a terminal."""
    process = start(args, clean_environment(env), stdout=subprocess.PIPE, stderr=subprocess.PIPE, **more)
    try:
        out, err = process.communicate(timeout)
    finally:
        process.kill()
    return Result(process.wait(), out, err)


def unhurried(what: Callable[[], Result], seconds: float = PATIENCE) -> Result:
    """What a command over real time comes to. On a busy machine an EksoNR's values may be too old: handctl rightly refuses to
    write then, has sent no setting, and asks to repeat the command."""
    end = time.monotonic() + seconds
    while (result := what()).code == 7 and "the values are not fresh" in result.err and time.monotonic() < end:
        pass
    return result


def fake(**options: object) -> str:
    """A simulated hand in this process on virtual time; names may use _ for -."""
    return "fake://exo?" + "&".join(["clock=virtual", *(f"{k.replace('_', '-')}={v}" for k, v in options.items())])


class Spy:
    """The simulated devices that commands opened in this process, in order."""

    def __init__(self) -> None:
        self.lines: list[Any] = []

    def byte_at(self, address: int, count: int = 1) -> bytes:
        """Memory of the last device."""
        device = self.lines[-1].device
        device.publish()
        return bytes(device.space.memory[address : address + count])

    @property
    def now(self) -> float:
        """Virtual seconds that the last command took."""
        return float(self.lines[-1].device.now)

    @property
    def requests(self) -> int:
        """Requests that the last device understood."""
        return int(self.lines[-1].requests)


@contextmanager
def spying(made: Callable[[Any], object] = lambda _line: None) -> Iterator[Spy]:
    """Collect the simulated devices that are created meanwhile; `made` is shown each before anything is sent to it."""
    spy, create = Spy(), handctl.sim.create

    def note(kind: str, options: dict[str, str]) -> Any:
        spy.lines.append(create(kind, options))
        made(spy.lines[-1])
        return spy.lines[-1]

    with swapped((handctl.sim, "create", note)):
        yield spy


def sent(trace: Path) -> list[bytes]:
    """Everything that a transcript says the host sent, line by line."""
    lines = [line.split() for line in trace.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return [bytes.fromhex("".join(words[2:])) for words in lines if words[1] == ">"]


def writes(trace: Path) -> list[bytes]:
    """The frames in a transcript that write or move: flags 12, 31, 32."""
    return [data for data in sent(trace) if data[4] in (0x12, 0x31, 0x32)]


def frame(text: str) -> bytes:
    """Bytes from hex digits."""
    return bytes.fromhex(text)


class Simulator:
    """`handctl sim KIND …` as a process; `link` is what it announced. `begin` takes the place of `handctl sim`."""

    def __init__(self, *args: str | Path, kind: str = "exo", begin: Sequence[str] = ()) -> None:
        words, pipe = [kind, *(str(arg) for arg in args)], subprocess.PIPE
        self.process = (
            subprocess.Popen([*begin, *words], stdout=pipe, stderr=pipe, env=clean_environment())
            if begin
            else start(["sim", *words], clean_environment(), stdout=pipe, stderr=pipe)
        )
        assert self.process.stdout is not None
        with selectors.DefaultSelector() as waiting:
            waiting.register(self.process.stdout, selectors.EVENT_READ)
            assert waiting.select(PATIENCE), "no ready line"
        first = self.process.stdout.readline()
        if not first:
            raise AssertionError(f"the simulator did not start: {self.stop()}")
        ready = json.loads(first)
        assert ready["ready"] is True
        self.link = str(ready["link"])
        self.links: list[str] = ready.get("links", [self.link])

    def stop(self, number: int = signal.SIGTERM) -> tuple[int, str, str]:
        """End it; exit code, further stdout, stderr."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        out, err = self.process.communicate(timeout=PATIENCE)
        return self.process.returncode, out.decode(), err.decode()

    def __enter__(self) -> Simulator:
        return self

    def __exit__(self, kind: type[BaseException] | None, exc: BaseException | None, tb: TracebackType | None) -> None:
        self.stop()


@contextmanager
def kept(link: str) -> Iterator[None]:
    """Keep the name of a pseudo-terminal from being given to another test's when its server has gone."""
    place = link.removeprefix("can:slcan:")
    if not place.startswith("/dev/pts/"):
        yield
        return
    port = os.open(place, os.O_RDWR | os.O_NOCTTY)
    try:
        yield
    finally:
        os.close(port)


def in_time(what: Callable[[], object], least: float, most: float, tries: int = 10) -> None:
    """`what` takes between so many seconds, on a machine that has time: one that has none is late now and then."""
    took: list[float] = []
    for _ in range(tries):
        began = time.perf_counter()
        what()
        took.append(time.perf_counter() - began)
        assert took[-1] >= least, f"sooner than {least} s: {took}"
        if took[-1] < most:
            return
    raise AssertionError(f"never between {least} and {most} s: {took}")


@contextmanager
def briefly(port: serial.Serial, seconds: float = 0.5) -> Iterator[None]:
    """What is read within must not come, so it is waited for so long only; what comes after it has time again."""
    kept, port.timeout = port.timeout, seconds
    try:
        yield
    finally:
        port.timeout = kept


def wait_until(what: Any, seconds: float = PATIENCE) -> None:
    """Wait until `what()` is true."""
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.01)


def memory(state: Path, address: int, count: int = 1) -> bytes:
    """RAM in a simulator's state file; what it does not list is 0."""
    runs: Mapping[str, str] = json.loads(state.read_text(encoding="utf-8"))["ram"]
    ram = bytearray(4096)
    for place, digits in runs.items():
        data = bytes.fromhex(digits)
        ram[int(place) : int(place) + len(data)] = data
    return bytes(ram[address : address + count])


def flash(state: Path) -> dict[str, int]:
    """Flash in a simulator's state file: id and speed_code."""
    return dict(json.loads(state.read_text(encoding="utf-8"))["flash"])


def s16(*values: int) -> bytes:
    """Signed 16-bit values, low byte first."""
    return b"".join(value.to_bytes(2, "little", signed=True) for value in values)


def pairs(names: Sequence[str]) -> dict[str, int]:
    """The power-on values of quantities by full name."""
    return {
        name + (f".{part}" if part else ""): value
        for name in names
        for part, value in zip(elements(name), POWER_ON[name][2], strict=True)
    }


ENVELOPE_KEYS = ["schema", "version", "command", "device", "ok", "exit_code", "rows", "messages", "counters"]
