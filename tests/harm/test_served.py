"""The same on a real terminal device: simulators as processes behind a pty, real time, locks and speeds as on a port."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.support.cli import Simulator, run

pytestmark = pytest.mark.real

COMMANDS = {
    "exo": ("exo force 1000 1000 1000 1000 1000 -y", "exo clear-errors"),
    "wrist": ("wrist move --pitch 5",),
    "barrett": ("barrett set MCV=80",),
}
"""What is meant for one family; all others get it."""
MOVES = {"boot_ms", "rtc", "clock", "heat", "temperatures", "temperature", "peak", "uptime", "feedback"}
"""What goes on by itself in a device at rest."""


def state_of(path: Path) -> Any:
    """The state file of a simulator without what goes on by itself."""
    return _still(json.loads(path.read_text(encoding="utf-8")))


def _still(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _still(item) for key, item in value.items() if key not in MOVES}
    return [_still(item) for item in value] if isinstance(value, list) else value


@pytest.mark.parametrize("device", ["exo", "barrett"])
def test_no_harm_on_a_port(device: str, tmp_path: Path) -> None:
    untouched, met = tmp_path / "untouched.json", tmp_path / "met.json"
    extra = ("--set", "initialized=1") if device == "barrett" else ()
    for path in (untouched, met):
        with Simulator("--pty", "--state", path, "--duration", "600", *extra, kind=device) as simulator:
            for family, commands in COMMANDS.items() if path == met else ():
                for command in commands if family != device else ():
                    done = run(*command.split(), "-p", simulator.link, env={"XDG_RUNTIME_DIR": str(tmp_path)})
                    assert done.code not in (0, 1, 130), (command, done)
    assert state_of(met) == state_of(untouched)
