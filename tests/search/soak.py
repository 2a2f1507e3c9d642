"""Streams at full rate for as long as a cell may take: memory stays flat, the rate steady, no row is lost; slow readers lose none.

Real processes on both ends. What a cell returns is what was measured.
"""

from __future__ import annotations

import csv
import fcntl
import json
import statistics
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from itertools import count, pairwise
from pathlib import Path
from typing import Any

from tests.search.suite import Listed
from tests.support.cli import PATIENCE, Result, Simulator, check_schema, clean_environment, program

LENGTHS = (3.0, 15.0, 60.0)
"""Seconds of a cell; a shorter one finds the same sooner, where it is bad enough."""
LEAK_KILOBYTES = 768
"""Resident memory that a process may gain after its warm-up: 12 bytes a sample of the fastest stream in ten minutes."""
DRIFT, STALL = 0.9, 0.4
"""Rate of the last third to that of the first; rate of a window to the median, below which it is a stall."""
STALLS = 0.1
"""A machine that does other things too may stall in this part of the windows."""
DRIFT_SECONDS = 30.0
"""A shorter run shows what else the machine did, no drift."""
PIPE_BYTES, ROW_BYTES = 4096, 100
"""Size of a slow reader's pipe, and of a row of NDJSON at least."""


@dataclass(frozen=True)
class Stream:
    """A command that streams, the simulator it asks, rows of one sample, and the slowest rate that is full speed."""

    kind: str
    served: tuple[str, ...]
    command: tuple[str, ...]
    rows: int
    hertz: float
    """A third of what the line allows: a floor for a busy machine."""


STREAMS = {
    "exo watch": Stream("exo", ("--pty", "--wire", "auto"), ("watch", "--rate", "0"), 26, 38),
    "wrist watch": Stream("wrist", ("--pty", "--wire", "auto"), ("watch", "--rate", "0"), 8, 100),
    "wrist watch on CAN": Stream(
        "wrist", ("--slcan-tcp", "127.0.0.1:0", "--wire", "1"), ("watch", "--rate", "0"), 8, 80
    ),
    "barrett watch": Stream(
        "barrett", ("--pty", "--wire", "auto", "--set", "initialized=1"), ("watch", "--rate", "0"), 13, 4
    ),
    "barrett realtime": Stream(
        "barrett",
        ("--pty", "--wire", "auto", "--set", "initialized=1"),
        ("realtime", "--receive", "strain,velocity,position", "--motors", "124"),
        9,
        25,
    ),
    "ekso watch": Stream("ekso", ("--pty", "--wire", "115200"), ("watch", "--rate", "0"), 15, 55),
    "aidin watch": Stream("aidin", ("--tcp", "127.0.0.1:0"), ("watch", "--rate", "0"), 80, 33),
}
LONG_MS = 50
"""An interval of the log's rows that is a gap by any measure: eight times the line's period."""
LOGGED = Stream("ekso", ("--pty", "--wire", "115200"), ("log",), 1, 55)


def kilobytes(pid: int) -> int:
    """Resident memory of a process now."""
    lines = Path(f"/proc/{pid}/status").read_text(encoding="ascii").splitlines()
    return int(next(line for line in lines if line.startswith("VmRSS:")).split()[1])


@dataclass
class Memory:
    """What client and simulator held after their warm-up and when they were last looked at."""

    pids: tuple[int, int]
    first: tuple[int, int] = (0, 0)
    last: tuple[int, int] = (0, 0)

    def watch(self, client: subprocess.Popen[bytes], seconds: float) -> None:
        """Look every second until the client ends. The warm-up is a tenth of the time, at least 1 s."""
        warm = time.monotonic() + max(1.0, seconds / 10)
        while client.poll() is None:
            try:
                now = (kilobytes(self.pids[0]), kilobytes(self.pids[1]))
            except (OSError, StopIteration):  # it has just ended
                break
            if time.monotonic() < warm or not any(self.first):
                self.first = now
            self.last = now
            time.sleep(min(1.0, seconds / 20))

    @property
    def text(self) -> str:
        """Both in MiB."""
        pairs = zip(("client", "simulator"), self.first, self.last, strict=True)
        return ", ".join(f"{name} {a / 1024:.2f} -> {b / 1024:.2f} MiB" for name, a, b in pairs)

    def check(self) -> None:
        """Neither grew."""
        assert all(self.first), self
        for before, after in zip(self.first, self.last, strict=True):
            assert after - before <= LEAK_KILOBYTES, self.text


@dataclass
class Reader:
    """Takes the lines of a stream as they come: samples by their time, rows of each, the closing line."""

    times: list[float] = field(default_factory=list)
    rows: Counter[float] = field(default_factory=Counter)
    end: dict[str, Any] = field(default_factory=dict)

    def take(self, line: bytes) -> None:
        """One line of NDJSON."""
        assert not self.end, "a line behind the closing one"
        content = json.loads(line)
        if "end" in content:
            check_schema(content["end"])
            self.end = content["end"]
            return
        assert "error" not in content, content
        moment = content["t"]
        if moment not in self.rows:
            assert not self.times or moment > self.times[-1], "time runs backwards"
            self.times.append(moment)
        self.rows[moment] += 1

    def check_complete(self, stream: Stream) -> None:
        """Every sample that the program counted is there with all its rows; nothing went wrong on the line."""
        told, counters = self.end["stream"], self.end["counters"]
        assert (told["samples"], told["failed"]) == (len(self.times), 0)
        assert set(self.rows.values()) == {stream.rows}
        assert (counters["retries"], counters["bad_frames"], counters["stray_bytes"]) == (0, 0, 0)
        assert (self.end["ok"], self.end["messages"]) == (True, [])


def rates(times: list[float]) -> list[float]:
    """Samples a second in up to 30 windows of one length, each of at least 0.5 s and some 20 samples."""
    span = times[-1] - times[0]
    count = max(1, min(30, len(times) // 20, int(span / 0.5)))
    length = span / count
    found = Counter(min(count - 1, int((moment - times[0]) / length)) for moment in times[:-1])
    return [found[number] / length for number in range(count)]


def steady(times: list[float], hertz: float) -> str:
    """Assert a full and steady rate; the text of the report."""
    windows = rates(times)
    median = statistics.median(windows)
    third = max(1, len(windows) // 3)
    text = f"{len(times)} samples, {median:.1f} Hz ({min(windows):.1f} to {max(windows):.1f} in {len(windows)} windows)"
    assert median >= hertz, text
    assert sum(window < STALL * median for window in windows) <= max(1, STALLS * len(windows)), text
    if times[-1] - times[0] >= DRIFT_SECONDS:
        assert statistics.median(windows[-third:]) >= DRIFT * statistics.median(windows[:third]), text
    return text


@contextmanager
def streaming(stream: Stream, *more: str | Path) -> Iterator[tuple[subprocess.Popen[bytes], Memory]]:
    """The command against its served simulator; ends both."""
    with Simulator(*stream.served, kind=stream.kind) as simulator:
        words = program(stream.kind, *stream.command, *more, "-p", simulator.link, "--json")
        with subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=clean_environment()
        ) as client:
            try:
                yield client, Memory((client.pid, simulator.process.pid))
            finally:
                client.kill()


def undisturbed(soak: Callable[[], str]) -> str:
    """What it says of itself, at one of three tries: on a busy machine a stream is late, and asks again, now and then."""
    for _ in range(2):
        with suppress(AssertionError):
            return soak()
    return soak()


def soaked(name: str, seconds: float) -> str:
    """One stream on a served simulator."""
    stream, reader = STREAMS[name], Reader()
    with streaming(stream, "--duration", str(seconds)) as (client, memory):
        assert client.stdout is not None and client.stderr is not None
        looking = threading.Thread(target=memory.watch, args=(client, seconds))
        looking.start()
        for line in client.stdout:
            reader.take(line)
        errors = client.stderr.read()
        assert (client.wait(PATIENCE), errors) == (0, b"")
        looking.join()
    reader.check_complete(stream)
    assert reader.times[-1] >= seconds - 1
    memory.check()
    return f"{name}, {seconds:.1f} s: {steady(reader.times, stream.hertz)}; {memory.text}"


def logged(file: Path, seconds: float) -> str:
    """The log of one stream on a served simulator."""
    with streaming(LOGGED, file, "--duration", str(seconds)) as (client, memory):
        memory.watch(client, seconds)
        out, _ = client.communicate(timeout=30)
        result = Result(client.returncode, out, b"")
    assert (result.code, result.json["ok"]) == (0, True)
    (row,) = result.rows
    with file.open(encoding="utf-8", newline="") as content:
        rows = [(int(line["seq"]), int(line["boot_ms"]), float(line["t_s"])) for line in csv.DictReader(content)]
    assert [number for number, _, _ in rows] == list(range(1, len(rows) + 1))
    assert all(before[1] < after[1] for before, after in pairwise(rows))
    assert (row["rows"], row["lost"], row["segments"]) == (len(rows), 0, 1)
    waits = sum(after[1] - before[1] > LONG_MS for before, after in pairwise(rows))
    assert waits <= row["gaps"], "a long interval that the log does not tell"
    assert json.loads(Path(f"{file}.json").read_text(encoding="utf-8"))["closed"] is True
    memory.check()
    rate = steady([t for _, _, t in rows], LOGGED.hertz)
    return f"ekso log, {seconds:.1f} s: {rate}; {row['gaps']} gaps; {memory.text}"


def slowly(stream: Stream, seconds: float) -> Reader:
    """What a reader with a small pipe gets that takes half of what a third of the full rate needs."""
    reader, rest = Reader(), b""
    pause = 1024 / (stream.rows * ROW_BYTES * stream.hertz / 2)
    with streaming(stream, "--duration", str(seconds)) as (client, _):
        assert client.stdout is not None and client.stderr is not None
        fcntl.fcntl(client.stdout, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        while data := client.stdout.read(1024):
            *lines, rest = (rest + data).split(b"\n")
            for line in lines:
                reader.take(line)
            time.sleep(pause)
        assert (client.wait(PATIENCE), client.stderr.read(), rest) == (0, b"", b"")
    return reader


def check_slow(name: str, seconds: float) -> str:
    """A slow reader makes the stream slow, which is told as `late`, but finds every row of every sample."""
    stream = STREAMS[name]
    fast = Stream(stream.kind, stream.served, (*stream.command, "--rate", str(2 * stream.hertz)), stream.rows,
                  stream.hertz)  # fmt: skip
    reader = slowly(fast, seconds)
    reader.check_complete(fast)
    told = reader.end["stream"]
    assert told["late"] > 0 and told["rate_hz"] < told["asked_hz"], told
    return f"{told['samples']} samples, {told['rate_hz']} of {told['asked_hz']} Hz, {told['late']} late, none lost"


class Soak(Listed):
    """A stream, how it is read, seconds."""

    name = "soak"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for seconds in LENGTHS:
            for name in STREAMS:
                yield (name, "full rate", f"{seconds:g} s"), (name, soaked, seconds)
                if name != "barrett watch":  # which is slower than the slow reader
                    yield (name, "slow reader", f"{seconds:g} s"), (name, check_slow, seconds)
            yield ("ekso log", "full rate", f"{seconds:g} s"), ("", logged, seconds)

    def tried(self, row: Any, folder: Path) -> str:
        name, what, seconds = row
        numbers = count()
        return undisturbed(lambda: what(name or folder / f"{next(numbers)}.csv", seconds))


SUITES = (Soak(),)
