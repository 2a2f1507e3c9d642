"""--deadline ends a command, and does not hide why it had not got on: every family with every fault of its line."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from tests.support.cli import Result, run, spying

COMMANDS = {
    "exo": ("dump", "get position_actual"), "wrist": ("dump", "get pitch_actual"), "barrett": ("status", "get DP"),
    "ekso": ("dump", "status"), "aidin": ("dump", "get motor_pos"),
}  # fmt: skip
FAULTS = ("noise", "truncate", "bad-checksum", "wrong-id", "twin-id", "echo", "garble", "dribble", "stray", "swap")
DEADLINES = ("0.1", "0.2", "0.35", "0.6", "1", "2.5")


def once(family: str, command: str, fault: str, *more: str) -> Result:
    retries = ("--retries", "30") if more else ()  # so that the deadline ends it
    return run(
        family, *command.split(), "-p", f"fake://{family}?clock=virtual&fault={fault}", "--json", *retries, *more
    )


@cache
def cause(family: str, command: str, fault: str) -> str:
    """The code of the error of exit 5 that it ends with when there is time; "" where it ends otherwise."""
    result = once(family, command, fault)
    return str(result.error["code"]) if result.code == 5 else ""


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("family", COMMANDS)
def test_the_cause_stays(family: str, fault: str, tmp_path: Path) -> None:
    for command in COMMANDS[family]:
        if not cause(family, command, fault):
            continue
        for seconds in DEADLINES:
            trace = tmp_path / "t"
            with spying() as spy:
                result = once(family, command, fault, "--deadline", seconds, "--trace", str(trace))
            came = any(line.split()[1:2] == ["<"] for line in trace.read_text().splitlines())
            if not came:
                continue
            assert result.code == 5, (command, seconds, result)
            assert result.error["code"] != "deadline", (command, seconds, result.error)
            if spy.now >= float(seconds):
                assert "--deadline" in result.error["text"], result.error


def test_most_faults_are_such() -> None:
    """The table above is not empty: faults that end with exit 5 in each family."""
    for family, commands in COMMANDS.items():
        assert sum(bool(cause(family, commands[0], fault)) for fault in FAULTS) >= 2, family
