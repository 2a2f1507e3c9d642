"""`handctl ekso log` over real pseudo-terminals whose port is unplugged and comes back as another one."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from handctl.sim.engine.serve import send_control
from tests.support.cli import Result, Simulator, clean_environment, program, run, wait_until
from tests.support.each_row import each_row

pytestmark = pytest.mark.real


class Bench:
    """A served EksoNR with a name as below by-id, and a log of it."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "gait.csv"
        self.name = folder / "usb-EksoNR-if00"
        self._control = folder / "control"
        self.simulator = Simulator(
            "--pty", "--by-id", self.name, "--control", self._control, "--set", "sway=0", kind="ekso"
        )  # fmt: skip
        self._taken: list[int] = []

    def log(self, *args: str) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            program("ekso", "log", self.path, "--rate", "50", "--json", *args, "-p", self.name),
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, env=clean_environment(),
        )  # fmt: skip
        self._log = process
        self.longer(5)
        return process

    def opened(self, place: str) -> bool:
        """Whether the log has this terminal open, which the system calls deleted once it is unplugged."""
        for descriptor in Path(f"/proc/{self._log.pid}/fd").iterdir():
            with contextlib.suppress(OSError):
                if os.readlink(descriptor).partition(" ")[0] == place:
                    return True
        return False

    @property
    def lines(self) -> int:
        return self.path.read_bytes().count(b"\n") if self.path.exists() else 0

    def longer(self, rows: int) -> None:
        """Wait for so many further rows."""
        wanted = self.lines + rows
        wait_until(lambda: self.lines >= wanted, 20)

    def unplug(self) -> str:
        """Take the port away; the terminal that it was, once the log has let go of it. Its number is kept from the next one."""
        before = os.readlink(self.name)
        send_control(str(self._control), "unplug")
        wait_until(lambda: not self.name.is_symlink())
        wait_until(lambda: not self.opened(before))
        for _ in range(64):  # a lower number may be free, too
            self._taken += os.openpty()
            if os.ttyname(self._taken[-1]) == before:
                break
        return before

    def replug(self) -> str:
        send_control(str(self._control), "replug")
        wait_until(self.name.exists)
        return os.readlink(self.name)

    def rows(self) -> list[dict[str, str]]:
        with open(self.path, encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))

    def sidecar(self) -> dict[str, Any]:
        return dict(json.loads(Path(f"{self.path}.json").read_text(encoding="utf-8")))

    def close(self) -> None:
        self.simulator.stop()
        for descriptor in self._taken:
            os.close(descriptor)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    yield made
    made.close()


def ended(process: subprocess.Popen[bytes]) -> Result:
    out, err = process.communicate(timeout=40)
    return Result(process.returncode, out, err)


def test_ten_unplugs_of_a_real_port_in_one_log(bench: Bench) -> None:
    process = bench.log("--silence", "20")
    places = []
    for _ in range(10):
        places.append(bench.unplug())
        places.append(bench.replug())
        bench.longer(3)
    assert len(set(places)) > 2, "it came back as another terminal"
    process.send_signal(signal.SIGINT)
    done = ended(process)
    assert done.code == 130, done
    (row,), rows, about = done.rows, bench.rows(), bench.sidecar()
    assert (row["holes"], row["segments"], done.codes().count("port-lost")) == (10, 11, 10)
    assert row["rows"] == len(rows) == about["rows"] == sum(segment["rows"] for segment in about["segments"])
    assert int(rows[-1]["seq"]) == row["rows"] + row["lost"]
    marked = [number for number, line in enumerate(rows, 1) if line["mark"].startswith("[port lost]")]
    assert marked == [hole["row"] for hole in about["holes"]]
    assert about["feedback"]["answered"] >= 2
    assert "by-path" in done.codes(), "the name of this test is a path"


def test_the_port_that_came_back_is_locked_as_the_first_was(bench: Bench) -> None:
    process = bench.log("--count", "60", "--silence", "20")
    first = bench.unplug()
    assert bench.replug() != first
    bench.longer(5)
    for name in (bench.name, os.readlink(bench.name)):
        busy = run("ekso", "time", "-p", name, "--json")
        assert (busy.code, busy.error["code"]) == (3, "busy")
    done = ended(process)
    assert (done.code, done.rows[0]["rows"]) == (0, 60)
    assert run("ekso", "time", "-p", bench.name).code == 0


@each_row("how", ["silence", "ctrl-c", "stop"])
def test_a_log_ends_in_order_while_its_port_is_gone(tmp_path: Path, how: str) -> None:
    with contextlib.closing(Bench(tmp_path)) as bench:
        ends_in_order(bench, how)


def ends_in_order(bench: Bench, how: str) -> None:
    process = bench.log("--silence", "1" if how == "silence" else "600")
    place = bench.unplug()
    if how == "ctrl-c":
        process.send_signal(signal.SIGINT)
    if how == "stop":
        process.terminate()
    done = ended(process)
    assert done.code == (3 if how == "silence" else 130), (done, place)
    about = bench.sidecar()
    assert (about["closed"], about["rows"]) == (True, len(bench.rows()))
    assert about["ended"] == ("lost" if how == "silence" else "interrupted")
    assert [hole["row"] for hole in about["holes"]] == [None]
