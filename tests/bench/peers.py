"""Start-up beside other tools that talk to devices: esptool, liquidctl, mpremote, in a throw-away environment."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import venv
from collections.abc import Iterator
from pathlib import Path

from tests.bench.measure import HANDCTL, Figure, quickest

PEERS = {
    "esptool": (["version"], ["--help"]),
    "liquidctl": (["--version"], ["--help"]),
    "mpremote": (["version"], ["--help"]),
}
"""Package and command -> what shows its version, what shows its help."""
GOAL = 1.0
"""No slower than any of them."""


class Peers:
    """What could be installed, by name with its version, and what could not."""

    def __init__(self) -> None:
        self.present: dict[str, str] = {}
        self.absent: list[str] = []

    def run(self, *, quick: bool) -> Iterator[Figure]:
        """Install and measure; the quickest of runs in turn."""
        runs = 5 if quick else 15
        self.present, self.absent = {}, []
        with tempfile.TemporaryDirectory() as folder:
            programs = Path(folder) / ("Scripts" if sys.platform == "win32" else "bin")
            venv.create(folder, with_pip=True)
            for name, (version, usage) in PEERS.items():
                if not self._install(programs / "python", name):
                    continue
                peer = str(programs / name)
                for what, ours, theirs in (("--version", "--version", version), ("-h", "-h", usage)):
                    value, other = quickest([[HANDCTL, ours], [peer, *theirs]], runs)
                    against = f"{name} {' '.join(theirs)}"
                    yield Figure(
                        f"start-up, {what}, against {name}", value * 1000, other * 1000, "ms", GOAL,
                        f"{name} {self.present[name]}; quickest of {runs}", against,
                    )  # fmt: skip

    def _install(self, python: Path, name: str) -> bool:
        """Whether pip could install it; notes its version. Byte code is compiled, as for handctl."""
        done = subprocess.run([python, "-m", "pip", "install", "-q", name], capture_output=True, check=False)
        if done.returncode:
            self.absent.append(name)
            return False
        code = f"from importlib.metadata import version; print(version({name!r}))"
        self.present[name] = subprocess.run(
            [python, "-c", code], capture_output=True, text=True, check=True
        ).stdout.strip()
        return True
