"""A served simulator for the tests of `stop`: who holds it, what it heard when by its own clock, and how each is stopped."""

from __future__ import annotations

import json
import subprocess
import time
from pathlib import Path
from typing import Any, NamedTuple

from handctl.sim.engine.serve import send_control
from tests.support.cli import PATIENCE, Result, Simulator, clean_environment, start, wait_until


def summed(text: str) -> bytes:
    """A frame of EB 90 from its digits without the sum."""
    data = bytes.fromhex(text)
    return data + bytes([sum(data[2:]) % 256])


class How(NamedTuple):
    """How a family is stopped: bytes that its device must hear, from the manuals, and options of the simulator.

    watch   a reading command that holds the device, without its link
    drive   a command that drives it, with the first bytes that tell that it does
    """

    stop: tuple[bytes, ...]
    sim: tuple[str, ...] = ()
    watch: tuple[str, ...] = ("watch", "--rate", "20", "--json")
    drive: tuple[tuple[str, ...], bytes] | None = None


RELEASE = bytes.fromhex("EB90010B31000000000000000000003D")
BEYOND = "90EB010D3184038E039803A2034C04F401"
"""The answer of an exo to the forces in which one finger reads 1100, which is no position: it is left alone, and the others are held
(exo §2.3.7). Without the sum."""
HOW: dict[str, How] = {
    "exo": How(
        (RELEASE, bytes.fromhex("EB90010B32")),
        drive=(("calibrate", "-y"), bytes.fromhex("EB90010412F10301")),
    ),
    "wrist": How(
        (bytes.fromhex("EB900107310E04"),),
        drive=(("move", "--pitch", "15", "--time", "8000"), bytes.fromhex("311004")),
    ),
    "barrett": How(
        (b"\x03", b"T\r"),
        ("--set", "initialized=1"),
        drive=(
            ("realtime", "--motors", "1", "--velocity", "20", "--receive", "position", "--timeout", "20", "--json"),
            b"C\x14",
        ),
    ),
    "ekso": How((bytes.fromhex("9C02"),)),
    "hand": How(
        (bytes.fromhex("EB90010F12F20500000000000000000000000019"),),
        ("--set", "speed=20"),  # a whole stroke in 40 s
        drive=(("angle", *["1000"] * 5, "-1", "-y", "--wait", "30"), bytes.fromhex("EB90010D12CE05")),
    ),
    "aidin": How(
        (b'{"hand_mode":3}\n',),
        ("--set", "start=homed", "--set", "rate=40"),
        drive=(("currents", "index.m1=200", "-y", "--duration", "20"), b",200,"),
    ),
}
"""By family: a new family is not in it until somebody has said what its manual calls a stop."""


class Stand:
    """One simulator, folders of its own for locks, and the processes that were started on it."""

    def __init__(self, family: str, folder: Path, *more: str) -> None:
        self.family, self.folder = family, folder
        self.how = HOW[family]
        self.panel = folder / "panel"
        place = ("--tcp", "127.0.0.1:0") if family == "aidin" else ("--pty",)
        self.simulator = Simulator(
            *place, *self.how.sim, *more, "--duration", "600", "--control", self.panel, kind=family
        )
        self.link = self.simulator.link
        self.runtime = folder / "run"
        self.runtime.mkdir(mode=0o700)
        self.environment = {
            "XDG_RUNTIME_DIR": str(self.runtime),
            "TMPDIR": str(folder / "tmp"),
            "XDG_STATE_HOME": str(folder / "state"),
        }
        self._started: list[subprocess.Popen[bytes]] = []

    def close(self) -> None:
        """End all that was started."""
        for process in self._started:
            if process.poll() is None:
                process.kill()
            process.wait(PATIENCE)
            if process.stderr is not None:
                process.stderr.close()
        self.simulator.stop()

    def heard(self) -> list[tuple[float, bytes]]:
        """What the device has heard since the last call, with its moment on the monotonic clock."""
        told = send_control(str(self.panel), "heard")
        return [(moment, bytes.fromhex(text)) for moment, text in json.loads(told.removeprefix("ok "))]

    def hold(self, *words: str, until: bytes = b"") -> subprocess.Popen[bytes]:
        """Start a command on the device (its `watch` unless told otherwise); returns once the device has heard of it."""
        self.heard()
        output = self.folder / f"out-{len(self._started)}"
        with output.open("wb") as out:
            process = start(
                [self.family, *(words or self.how.watch), "-p", self.link],
                clean_environment(self.environment), stdout=out, stderr=subprocess.PIPE, cwd=self.folder,
            )  # fmt: skip
        self._started.append(process)
        came = b""

        def begun() -> bool:
            nonlocal came
            assert process.poll() is None, process.communicate()
            came += b"".join(data for _, data in self.heard())
            # a hand that streams is asked for nothing: then rows tell that it is watched
            return until in came if until else bool(came) or output.stat().st_size > 0

        wait_until(begun)
        return process

    def stop(self, *words: str, env: dict[str, str] | None = None, **more: Any) -> tuple[Result, float]:
        """Run `stop`; its result, and the seconds from its start to the last of its first bytes at the device."""
        self.heard()
        begun = time.monotonic()
        process = start(
            [*(words or (self.family, "stop", "--json")), "-p", self.link],
            clean_environment({**self.environment, **(env or {})}),
            stdout=more.pop("stdout", subprocess.PIPE), stderr=subprocess.PIPE, cwd=self.folder, **more,
        )  # fmt: skip
        self._started.append(process)
        out, err = process.communicate(timeout=PATIENCE)
        return Result(process.returncode, out or b"", err), self.reached(begun)

    def reached(self, begun: float) -> float:
        """Seconds from `begun` until the device had heard all bytes of its stop, in their order."""
        heard = self.heard()
        place, moment = 0, begun
        for wanted in self.how.stop:
            came = b""
            for number, (at, data) in enumerate(heard[place:], place):
                came += data
                if wanted in came:
                    place, moment = number, at
                    break
            else:
                raise AssertionError(f"the device did not hear {wanted!r}, but {heard}")
        return moment - begun
