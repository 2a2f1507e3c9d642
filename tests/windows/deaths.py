"""handctl dies on Windows while it drives a device: the second process must stop it, as on Linux (tests/stop/test_deadman.py).

Each command of that matrix, each way to die that can be made under wine. The simulator tells what reached the device, and when.
"""

from __future__ import annotations

import os
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pexpect

from tests.stop.drives import BENCHES, DRIVEN, FURTHER, Bench, Drive, first_of, standing
from tests.support.cli import wait_until
from tests.windows.systems import System, Windows, end

CELLS = {**DRIVEN, **FURTHER}
PENDULUM = ("aidin currents",)
"""What their command keeps up has to end when it stands still, too."""
WAYS = {
    "terminated": "import _winapi; _winapi.TerminateProcess(_winapi.GetCurrentProcess(), 1)",
    "crashed": "import faulthandler; faulthandler._read_null()",
    "ended by a library": "os._exit(9)",
    "console gone": "",
    "suspended": "import ctypes; ctypes.WinDLL('ntdll').NtSuspendProcess(ctypes.c_void_p(-1))",
}
"""How handctl dies, and what it runs for that once a file `die` is there; where it is nothing, its terminal is closed."""
DYING = """
import os, sys, threading, time
def die():
    while not os.path.exists("die"): time.sleep(0.005)
    {way}
threading.Thread(target=die, daemon=True).start()
from handctl.cli import main
sys.exit(main())
"""
SECONDS = 25.0


def every() -> list[tuple[str, str]]:
    """Command and way to die; one that is only suspended is to be stopped where its motors run on."""
    return [(name, way) for way in WAYS for name in CELLS if way != "suspended" or name in PENDULUM]


def link_of(bench: Bench, windows: Windows, number: int) -> str:
    """The LINK of a served simulator for a program on Windows."""
    before, place, port = bench.simulator.link.rpartition("/dev/pts/")
    return before + windows.com(number, place + port) if place else bench.simulator.link


@contextmanager
def driving(windows: Windows, words: list[str], way: str, folder: Path) -> Iterator[Callable[[], object]]:
    """`handctl WORDS`, which dies when what this gives is called."""
    script = ["-c", DYING.format(way=WAYS[way] or "pass"), *words]
    if WAYS[way]:
        process = windows.start(script, folder)
        try:
            yield (folder / "die").touch
        finally:
            end(process)
            process.communicate()
        return
    program, *more = windows.begin(*script)
    console = pexpect.spawn(program, more, cwd=str(folder), env=windows.environment(folder), dimensions=(24, 80))
    try:
        yield lambda: os.close(console.child_fd)
    finally:
        console.closed, console.child_fd = True, -1
        with suppress(ProcessLookupError):
            os.killpg(console.pid, 9)


def survived(windows: Windows, linux: System, name: str, way: str, folder: Path, number: int) -> tuple[str, str]:
    """How long after the death the stop was out, and what is wrong, "" for nothing."""
    folder.mkdir()
    drive = CELLS[name]
    bench = Bench(folder, *BENCHES[drive.bench])
    try:
        link = link_of(bench, windows, number)
        for command in drive.before:
            done = linux.run([*bench.words(command), "--yes"], folder)
            if done.code:
                return "", f"`{command}` before it ended with {done.code}: {done.err!r:.300}"
        try:
            seen = f"stopped within {stopped(windows, bench, drive, way, link, folder):.0f} ms"
        except AssertionError as exc:
            return "", f"{exc}: {[data.hex(' ') for _, data in bench.heard()[-5:]]}"
        following = windows.run([bench.family, "status", "-p", link], folder)
        return seen, f"who comes next ends with {following.code}: {following.err!r:.300}" if following.code else ""
    finally:
        bench.simulator.stop()


def stopped(windows: Windows, bench: Bench, drive: Drive, way: str, link: str, folder: Path) -> float:
    """Milliseconds from a death to the last byte of the stop. Raises AssertionError where the device is not stopped."""
    begun = len(bench.heard())
    with driving(windows, [bench.family, *drive.command.split(), "-p", link], way, folder) as die:
        wait_until(lambda: bench.bytes_since(begun).count(drive.driving) >= drive.times, SECONDS)
        assert first_of(drive, bench.heard()[begun:]) is None, "the stop came before"
        moment = time.monotonic()
        die()
        wait_until(lambda: first_of(drive, bench.heard()[begun:]) is not None, SECONDS)
        wait_until(lambda: drive.stands(bench), SECONDS)
        wait_until(lambda: standing(bench, drive.place), SECONDS)
    return (last_of(drive, bench.heard()[begun:]) - moment) * 1000


def last_of(drive: Drive, heard: list[tuple[float, bytes]]) -> float:
    """The moment of the last byte of the stop, which has come."""
    found = re.search(drive.stop, b"".join(data for _, data in heard), re.DOTALL)
    assert found is not None
    return [moment for moment, data in heard for _ in data][found.end() - 1]
