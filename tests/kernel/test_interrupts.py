"""How a command ends: two signals end it whatever the reader does, after its device; what it says it wrote is written."""

from __future__ import annotations

import fcntl
import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.cli import PATIENCE, clean_environment, program

pytestmark = pytest.mark.real

STREAM = ("ekso", "watch", "--fake", "--rate", "0")
DUMPS = {
    "dump": ("exo", "dump", "--fake"), "stop": ("exo", "stop", "--fake", "--json"),
    "usage": ("exo", "get", "nonsense", "--fake", "--json"),
}  # fmt: skip


@contextmanager
def sleeping() -> Iterator[int]:
    """The end of a pipe that nobody reads and that is full already, so that the first byte waits."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    try:
        while os.write(writing, b"x" * 4096):
            pass
    except BlockingIOError:
        pass
    os.set_blocking(writing, True)
    try:
        yield writing
    finally:
        os.close(reading)
        os.close(writing)


def is_full(descriptor: int) -> bool:
    poll = select.poll()
    poll.register(descriptor, select.POLLOUT)
    return not poll.poll(0)


def asleep(process: subprocess.Popen[bytes]) -> bool:
    """Whether the kernel has it wait for a pipe, or for an event on one, a tenth of a second long."""
    for _ in range(10):
        where = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[0]
        if where != "S":
            return False
        time.sleep(0.01)
    return True


def end_by_two(process: subprocess.Popen[bytes], number: int = signal.SIGTERM) -> float:
    """Two signals, as far apart as two wishes are; how long after the second it was gone."""
    limit = time.monotonic() + PATIENCE
    while not asleep(process):
        assert process.poll() is None and time.monotonic() < limit
    process.send_signal(number)
    try:
        process.wait(0.7)
        return 0.0
    except subprocess.TimeoutExpired:
        process.send_signal(number)
    begin = time.monotonic()
    try:
        process.wait(PATIENCE)
    finally:
        process.kill()
    return time.monotonic() - begin


def started(*words: str, stdout: int, stderr: int = subprocess.PIPE) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        program(*words), stdin=subprocess.DEVNULL, stdout=stdout, stderr=stderr, env=clean_environment()
    )


def check(process: subprocess.Popen[bytes], codes: tuple[int, ...] = (130,)) -> None:
    seconds = end_by_two(process)
    said = process.stderr.read() if process.stderr is not None else b""
    assert process.returncode in codes, (process.returncode, said)
    assert b"Traceback" not in said, said
    assert seconds < PATIENCE  # a second, on a machine that has time


def test_two_signals_end_a_stream_whose_reader_sleeps() -> None:
    reading, writing = os.pipe()
    try:
        process = started(*STREAM, "--json", stdout=writing)
        limit = time.monotonic() + PATIENCE
        while not is_full(writing):
            assert process.poll() is None and time.monotonic() < limit
            time.sleep(0.01)
        check(process)
    finally:
        os.close(reading)
        os.close(writing)


@pytest.mark.parametrize("name", DUMPS)
def test_two_signals_end_a_result_whose_reader_sleeps(name: str) -> None:
    with sleeping() as pipe:
        check(started(*DUMPS[name], stdout=pipe), (130, 2) if name == "usage" else (130,))


@pytest.mark.parametrize("words", [DUMPS["dump"], (*STREAM, "--json")], ids=" ".join)
def test_two_signals_end_what_writes_to_a_pipe_by_name(tmp_path: Path, words: tuple[str, ...]) -> None:
    """`-o` and `--trace` take one."""
    for option in ("-o", "--trace"):
        path = tmp_path / option
        os.mkfifo(path)
        reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        with sleeping() as pipe:
            filler = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
            while not is_full(filler):
                os.write(filler, b"x" * 4096)
            process = started(*words, option, str(path), stdout=pipe if option == "-o" else subprocess.DEVNULL)
            check(process)
        os.close(filler)
        os.close(reader)


def test_two_signals_end_what_says_more_than_its_stderr_takes() -> None:
    with sleeping() as pipe:
        check(started(*STREAM, "-v", stdout=subprocess.DEVNULL, stderr=pipe))


@pytest.mark.parametrize(("option", "code"), [("--trace", 1), ("-v", 0)])
def test_a_loop_goes_on_although_nobody_reads_the_trace(tmp_path: Path, option: str, code: int) -> None:
    """A motor would turn on while a line waits: the trace ends there, which is told, and the device is served."""
    with sleeping() as pipe:
        path = tmp_path / "trace"
        os.mkfifo(path)
        reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        words = ("barrett", "realtime", "--motors", "1", "--velocity", "3", "--receive", "position", "--json")
        fcntl.fcntl(reader, fcntl.F_SETPIPE_SZ, 4096)
        place = ("-p", "fake://barrett?initialized=1", "--count", "400")
        more = ("--trace", str(path)) if option == "--trace" else ("-v",)
        errors = pipe if option == "-v" else subprocess.PIPE
        process = started(*words, *place, *more, stdout=subprocess.PIPE, stderr=errors)
        out, _ = process.communicate(timeout=30)
        assert process.returncode == code
        assert json.loads(out.splitlines()[-1])["end"]["stream"]["samples"] == 400
        os.close(reader)


def test_samples_are_as_many_as_moments_in_the_rows() -> None:
    """Ctrl-C at any moment of a stream: the closing line counts what stands above it, no more and no less."""
    for turn in range(3):
        process = started(*STREAM, "--json", stdout=subprocess.PIPE)
        assert process.stdout is not None
        head = [process.stdout.readline() for _ in range(30 + 17 * turn)]
        process.send_signal(signal.SIGINT)
        rows = [json.loads(line) for line in [*head, *process.stdout]]
        end = rows.pop()["end"]
        assert process.wait(20) == 130
        assert end["stream"]["samples"] == len({row["t"] for row in rows})


EARLY = """
import os, signal, sys
from handctl import cli, lazy_stdlib
signal.signal(signal.SIGINT, signal.{handler})
lazy_stdlib.defer_unused_modules = lambda: os.kill(os.getpid(), signal.SIGINT)
sys.argv = ["handctl", "exo", "get", "id", "-p", "fake://exo?clock=virtual"]
sys.exit(cli.main())
"""


@pytest.mark.parametrize(("handler", "code"), [("default_int_handler", 130), ("SIG_IGN", 0)])
def test_ctrl_c_while_modules_are_loaded_is_no_traceback(handler: str, code: int) -> None:
    """Nothing has begun. In a shell's background job, where it is ignored, it stays so."""
    done = subprocess.run(
        [sys.executable, "-c", EARLY.format(handler=handler)], capture_output=True, text=True, check=False
    )
    assert (done.returncode, "Traceback" in done.stderr) == (code, False), done.stderr
    assert bool(done.stdout) is (code == 0)
