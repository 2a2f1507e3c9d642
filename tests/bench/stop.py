"""`stop` from a second process: how long until the device has heard all of it, by the simulator's own clock.

Each figure is what a holder, or a bad place, adds to the same command without one. Allowed are 100 ms, and 500 ms where
the holder does not answer.
"""

from __future__ import annotations

import os
import resource
import shutil
import signal
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from handctl.sim.engine.serve import send_control
from handctl.system.processes import sleeps
from tests.bench.measure import Figure
from tests.support.cli import wait_until
from tests.support.stop import Stand

ALLOWED, ALLOWED_STUCK = 0.1, 0.5
MOST = 5
"""Tries until a short movement still runs when the stop comes: a busy machine starts a program slowly."""
HOLDERS: list[tuple[str, tuple[str, ...], bytes]] = [
    # family, the command that has the device ("" = its watch), the first bytes that tell that it does
    ("exo", (), b""),
    ("exo", ("calibrate", "-y"), bytes.fromhex("EB90010412F10301")),
    ("wrist", (), b""),
    ("wrist", ("move", "--pitch", "15", "--time", "8000"), bytes.fromhex("311004")),
    ("barrett", (), b""),
    ("barrett", ("realtime", "--motors", "1", "--velocity", "20", "--receive", "position", "--json"), b"C\x14"),
    ("ekso", (), b""),
    ("ekso", ("log", "gait.csv", "--rate", "50", "--force"), bytes([153])),
    ("aidin", (), b""),
    ("aidin", ("joints", "index.q3=116"), b'"hand_mode":22'),
    ("aidin", ("home", "-y"), b'"hand_mode":1}'),
    ("aidin", ("currents", "index.m1=200", "-y", "--duration", "20"), b",200,"),
]


def run(*, quick: bool) -> Iterator[Figure]:
    """All figures."""
    times = 2 if quick else 5
    alone: dict[str, float] = {}
    for family, words, first in HOLDERS:
        with tempfile.TemporaryDirectory() as folder:
            place = Stand(family, Path(folder))
            try:
                if family not in alone:
                    alone[family] = min(_stop(place) for _ in range(times))
                    yield from _bad_places(place, alone[family], times)
                name = f"stop, while `{family} {words[0] if words else 'watch'}` "
                for stuck, allowed in ((False, ALLOWED), (True, ALLOWED_STUCK)):
                    taken = [_held(place, words, first, stuck=stuck) for _ in range(times)]
                    what = "is suspended (SIGSTOP)" if stuck else "runs"
                    yield _figure(name + what, min(taken) - alone[family], allowed, alone[family])
            finally:
                place.close()


def _figure(name: str, added: float, allowed: float, alone: float) -> Figure:
    note = f"without a holder {alone * 1000:.0f} ms from its start"
    return Figure(name, max(added, 0.0) * 1000, allowed * 1000, "ms", 1.0, note, against="allowed")


def _stop(place: Stand, *, silent: bool = False, **more: Any) -> float:
    result, seconds = place.stop(**more)
    assert result.code == (4 if silent else 0), result
    return seconds


def _held(place: Stand, words: tuple[str, ...], first: bytes, *, stuck: bool) -> float:
    silent = words[:1] == ("calibrate",)  # the hand answers nothing meanwhile, and hears its stop all the same
    if silent:
        place.how = place.how._replace(stop=place.how.stop[:1])
    for _ in range(MOST):
        if silent:
            send_control(str(place.panel), "power-cycle")
        holder = place.hold(*words, until=first)
        if stuck:
            os.kill(holder.pid, signal.SIGSTOP)
            wait_until(lambda holder=holder: sleeps(holder.pid))  # type: ignore[misc]
        seconds = _stop(place, silent=silent)
        if holder.wait(10) == (-signal.SIGKILL if stuck else 4 if silent else 130):
            return seconds
    raise AssertionError(f"{words} always ends before the stop")


def full_disk() -> None:
    """No file grows any more."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))


def _bad_places(place: Stand, alone: float, times: int) -> Iterator[Figure]:
    """Nobody has the device, and something else is wrong."""
    broken = place.folder / "config.toml"
    broken.write_text("port = [")
    locks = place.runtime / "handctl"

    def squat() -> None:
        shutil.rmtree(locks)
        locks.write_text("squatted")

    cases: list[tuple[str, Callable[[], object], dict[str, Any]]] = [
        ("full disk", lambda: None, {"preexec_fn": full_disk}),
        ("unreadable configuration", lambda: None, {"env": {"HANDCTL_CONFIG": str(broken)}}),
        ("a file instead of the runtime folder", squat, {}),
    ]
    for name, prepare, more in cases:
        prepare()
        taken = min(_stop(place, **more) for _ in range(times))
        yield _figure(f"{place.family} stop, {name}", taken - alone, ALLOWED, alone)
    locks.unlink()
