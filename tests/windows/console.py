"""Ctrl-C on a Windows console while a device moves: it must be stopped where it is, as on Linux.

The console is wine's own on a pseudo-terminal: the key that is typed reaches the program as a console event. Of such events
only this one can be made there: closing the window, Ctrl-Break and log-off cannot.
"""

from __future__ import annotations

import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pexpect

from handctl.sim.engine.serve import send_control
from tests.contract.facts import facts_of, passed
from tests.support.cli import Simulator
from tests.windows.systems import System, Windows

TYPED = "\x03"
INTERRUPTED = 130
SECONDS = 30.0
STILL = 0.5
"""What does not move so long stands still."""


class Scene(NamedTuple):
    """A movement that is cut short.

    served    options of the simulator
    words     what moves it
    asked     control command of the simulator whose answer is where it stands
    ends     what this answer has in it where the movement was not cut short
    """

    served: tuple[str, ...]
    words: str
    asked: str
    ends: str


SCENES = {
    "exo": Scene(
        ("--pty",), "position 1000 1000 1000 1000 1000 --wait 10", "get 1546 10", "ok E8 03 E8 03 E8 03 E8 03 E8 03"
    ),
    "wrist": Scene(("--pty",), "move --pitch 20 --yaw -20 --time 4000", "get 1020 4", "ok D0 07 30 F8"),
    "barrett": Scene(("--pty", "--set", "initialized=1"), "close", "motors", "P 17000 "),
    "hand": Scene(
        ("--pty", "--set", "speed=100"), "angle 0 0 0 0 0 0 --wait 20", "get 1546 12", "ok 00 00 00 00 00 00"
    ),
    "aidin": Scene(("--tcp", "127.0.0.1:0", "--set", "start=used"), "home", "get motor_pos", "ok" + 15 * " 0"),
}


def at_last(place: Callable[[], str]) -> str:
    """Where a device stands still, "" where it moves on. It may turn back a little to where it was told to stay."""
    until, before = time.monotonic() + SECONDS, ""
    while before != (now := place()):
        if time.monotonic() > until:
            return ""
        before = now
        time.sleep(STILL)
    return now


def interrupted(system: System, family: str, folder: Path, number: int) -> str:
    """What is wrong with a movement that Ctrl-C ends, "" when the device stands still short of its end."""
    scene, panel, trace = SCENES[family], folder / "panel", folder / "trace.txt"
    begin = [sys.executable, "-m", "handctl", "sim"]
    with Simulator(*scene.served, "--control", panel, kind=family, begin=begin) as simulator:
        link = simulator.link
        if isinstance(system, Windows) and link.startswith("/dev/"):
            link = system.com(number, link)

        def place() -> str:
            return send_control(str(panel), scene.asked)

        before = place()
        words = [family, *scene.words.split(), "--yes", "-p", link, "--trace", trace.name]
        program, *more = system.begin("-m", "handctl", *words)
        console = pexpect.spawn(
            program, more, cwd=str(folder), env=system.environment(folder), dimensions=(24, 80), timeout=SECONDS
        )
        try:
            until = time.monotonic() + SECONDS
            while place() == before:
                if time.monotonic() > until or not console.isalive():
                    return f"it did not move: {console.read_nonblocking(4096, 1)!r}"
                time.sleep(0.01)
            console.send(TYPED)
            console.expect(pexpect.EOF)
            said = console.before
        except pexpect.ExceptionPexpect as exc:
            return f"the command did not end: {type(exc).__name__}"
        finally:
            console.close(force=True)
        halted = at_last(place)
        if not halted or scene.ends in halted:
            return f"it moved to its end: {halted}" if halted else f"the device moves on: {place()}"
    last = b"".join(entry.data for entry in passed(trace) if entry.mark == ">")
    stop = next(iter((facts_of(family).halts or {}).values()))
    if stop not in last:
        return f"the stop {stop!r} is not in the transcript"
    if console.exitstatus != INTERRUPTED:
        return f"exit code {console.exitstatus}, not {INTERRUPTED}: {said[-400:]!r}"
    return ""


PATIENT = "import sys; from handctl.link import tcp; tcp.CONNECT_SECONDS = 600.0; from handctl.cli import main; sys.exit(main())"
"""handctl, which would wait long for a server that does not answer."""
ASKED = "02"
"""The state of a connection that is asked for, in the kernel's table."""


def connecting(port: int) -> bool:
    """Whether somebody asks for a connection with a port of this machine."""
    rows = (line.split() for line in Path("/proc/net/tcp").read_text(encoding="ascii").splitlines()[1:])
    return any(row[2].endswith(f":{port:04X}") and row[3] == ASKED for row in rows)


def given_up(system: System, folder: Path) -> str:
    """What is wrong with Ctrl-C while handctl waits for a server that takes no connection, "" when it ends at once."""
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen(0)
        with socket.create_connection(server.getsockname()):  # the only one that it takes
            port = server.getsockname()[1]
            program, *more = system.begin("-c", PATIENT, "aidin", "status", "-p", f"tcp://127.0.0.1:{port}")
            console = pexpect.spawn(program, more, cwd=str(folder), env=system.environment(folder), timeout=SECONDS)
            try:
                until = time.monotonic() + SECONDS
                while not connecting(port):
                    if time.monotonic() > until or not console.isalive():
                        return f"it does not connect: {console.read_nonblocking(4096, 1)!r}"
                    time.sleep(0.01)
                console.send(TYPED)
                console.expect(pexpect.EOF)
                said = console.before
            except pexpect.ExceptionPexpect as exc:
                return f"the command did not end: {type(exc).__name__}"
            finally:
                console.close(force=True)
    return "" if console.exitstatus == INTERRUPTED else f"exit code {console.exitstatus}: {said[-400:]!r}"
