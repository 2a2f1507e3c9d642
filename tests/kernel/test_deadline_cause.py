"""--deadline ends a command, and does not hide why it had not got on: every family with every fault of its line."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from tests.support.cli import Result, run, spying
from tests.support.each_row import each_row

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


@each_row("fault", FAULTS)
@each_row("family", COMMANDS)
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


SILENT = [
    ("exo get id", "fake://exo?", "0.1", "0.1"),
    ("exo get id", "fake://exo?", "0.5", "0.2"),
    ("exo raw EB90010411E8030102", "fake://exo?", "0.1", "0.1"),
    ("wrist get pitch_actual", "fake://wrist?", "0.1", "0.1"),
    ("wrist get pitch_actual", "fake://wrist?bus=can&", "0.25", "0.25"),
    ("wrist raw EB900104300004043D", "fake://wrist?", "0.1", "0.1"),
    ("ekso get step_length", "fake://ekso?", "0.1", "0.08"),
    ("ekso get step_length", "fake://ekso?", "0.75", "0.21"),
    ("aidin get joint_pos --exchange stream", "fake://aidin?", "0.4", "0.4"),
]


@each_row(("command", "link", "deadline", "waited"), SILENT)
def test_silence_tells_the_time_that_was_really_waited(command: str, link: str, deadline: str, waited: str) -> None:
    """--deadline cuts the last wait short: neither --timeout nor its default is how long anybody listened."""
    result = run(*command.split(), "-p", f"{link}clock=virtual&fault=silent", "--deadline", deadline, "--json", "--yes")
    assert result.code == 4, result
    assert f" {waited} s" in result.error["text"], result.error


@each_row(("command", "link"), sorted({(command, link) for command, link, _, _ in SILENT}))
def test_silence_until_the_timeout_tells_the_timeout(command: str, link: str) -> None:
    wait = ("--wait", "0.7") if "raw" in command else ("--timeout", "0.7")
    result = run(
        *command.split(), "-p", f"{link}clock=virtual&fault=silent", *wait, "--retries", "0", "--json", "--yes"
    )
    assert result.code == 4, result
    assert " 0.7 s" in result.error["text"], result.error
    assert "--deadline" not in result.error["text"], result.error
