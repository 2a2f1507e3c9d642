"""A served BarrettHand's switch and power, and the download that asks for them."""

from __future__ import annotations

import subprocess
import time
from pathlib import Path

from tests.support.cli import clean_environment, program, run, wait_until


def panel(path: Path, *words: str) -> str:
    result = run("sim", "control", path, *words)
    assert result.code == 0, result
    return result.out


def download(link: str, file: Path, control: Path, log: Path) -> subprocess.Popen[bytes]:
    """Starts a download, and turns the switch when it says so."""
    with log.open("wb") as err:
        process = subprocess.Popen(
            program("barrett", "firmware", "download", file, "-p", link, "--baud", "9600", "--yes", "--json"),
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=err, env=clean_environment(),
        )  # fmt: skip
    wait_until(lambda: "switch the power supply ON" in log.read_text())
    time.sleep(0.2)  # a `:` right behind the echo of X would pass for a text
    panel(control, "power-cycle")
    return process
