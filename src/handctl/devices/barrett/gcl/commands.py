"""The commands of the Grasper Control Language: what each takes, how long it may last, what it does (barrett §5.2).

Data, sans I/O: knows no wire. `kind` sets the deadline: "query", "set", "save", "motion", "init", "reset", "loop".
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple


class Command(NamedTuple):
    """One GCL command. `argument` is (lowest, highest) of an optional number, None where it takes none."""

    name: str
    prefix: bool
    kind: str
    doc: str
    source: str
    argument: tuple[int, int] | None = None


_TRAVEL = (0, 20000)

COMMANDS: dict[str, Command] = {
    command.name: command
    for command in (
        Command("C", True, "motion", "close to CT (spread: F1 and F2 move next to F3)", "barrett §5.2.1"),
        Command("HI", True, "init", "initialize: find the open stop (must be the first movement)", "barrett §5.2.1"),
        Command("HOME", True, "motion", "move to 0", "barrett §5.2.1"),
        Command("IC", True, "motion", "close by a distance (default: DS)", "barrett §5.2.1", _TRAVEL),
        Command("IO", True, "motion", "open by a distance (default: DS)", "barrett §5.2.1", _TRAVEL),
        Command("LOOP", True, "loop", "enter RealTime", "barrett §5.2.1, §6"),
        Command("M", True, "motion", "move to a position (default: DP)", "barrett §5.2.1", _TRAVEL),
        Command("O", True, "motion", "open to OT", "barrett §5.2.1"),
        Command("T", True, "set", "motor power off", "barrett §5.2.1"),
        Command("TC", True, "motion", "close under torque control until it stalls", "barrett §5.2.1"),
        Command("TO", True, "motion", "open under torque control until it stalls", "barrett §5.2.1"),
        Command("FSET", True, "set", "set motor parameters in RAM: NAME VALUE pairs", "barrett §5.2.2"),
        Command("FGET", True, "query", "read motor parameters", "barrett §5.2.2"),
        Command("FLOAD", True, "set", "motor parameters from EEPROM to RAM", "barrett §5.2.2"),
        Command("FSAVE", True, "save", "motor parameters from RAM to EEPROM (at most 5,000 times)", "barrett §5.2.2"),
        Command("FDEF", True, "set", "motor parameters to factory values, in RAM", "barrett §5.2.2"),
        Command("FLIST", False, "query", "standard motor parameters", "barrett §5.2.2"),
        Command("FLISTV", True, "query", "standard motor parameters with values", "barrett §5.2.2"),
        Command("FLISTA", False, "query", "all motor parameters", "barrett §5.2.5"),
        Command("FLISTAV", True, "query", "all motor parameters with values", "barrett §5.2.5"),
        Command("PSET", False, "set", "set hand parameters in RAM: NAME VALUE pairs", "barrett §5.2.3"),
        Command("PGET", False, "query", "read hand parameters", "barrett §5.2.3"),
        Command("PLOAD", False, "speed", "hand parameters from EEPROM to RAM (may change the speed)", "barrett §5.2.3"),
        Command("PSAVE", False, "save", "hand parameters from RAM to EEPROM (at most 5,000 times)", "barrett §5.2.3"),
        Command(
            "PDEF", False, "speed", "hand parameters to factory values, in RAM (may change the speed)", "barrett §5.2.3"
        ),
        Command("PLIST", False, "query", "standard hand parameters", "barrett §5.2.3"),
        Command("PLISTV", False, "query", "standard hand parameters with values", "barrett §5.2.3"),
        Command("PLISTA", False, "query", "all hand parameters", "barrett §5.2.5"),
        Command("PLISTAV", False, "query", "all hand parameters with values", "barrett §5.2.5"),
        Command("?", False, "query", "help (?NAME describes a command)", "barrett §5.2.4"),
        Command("A?", False, "query", "help on standard and advanced commands", "barrett §5.2.5"),
        Command("RESET", False, "reset", "restart the firmware: motors uninitialized, saved speed", "barrett §5.2.4"),
        Command("ERR", False, "query", "text for a status code or a sum of codes", "barrett §5.2.4"),
        Command("VERS", False, "query", "firmware version", "barrett §5.2.4"),
    )
}

SECONDS = {
    "query": 3.0,
    "set": 3.0,
    "speed": 3.0,
    "save": 15.0,
    "reset": 15.0,
    "motion": 20.0,
    "init": 30.0,
    "loop": 1.5,
}
"""Longest wait for the prompt beyond wire time (dossier 1.3)."""


def kind_of(text: str) -> str:
    """The kind of the command in a line, "baud" for one that sets the speed; "" for what is no command."""
    _, command, arguments = split(text)
    if command is None:
        return ""
    return "baud" if command.name == "PSET" and "BAUD" in arguments else command.kind


def split(text: str) -> tuple[str, Command | None, list[str]]:
    """``12M 5000`` -> ("12", the command M, ["5000"]); an unknown command gives None. No command begins with G or S."""
    prefix, command, words = _split(text)
    return prefix, command, list(words)


@lru_cache(1024)
def _split(text: str) -> tuple[str, Command | None, tuple[str, ...]]:
    words = tuple(text.upper().split())
    if not words:
        return "", None, ()
    head = words[0]
    if head.startswith("?"):
        return "", COMMANDS["?"], (head[1:], *words[1:]) if head[1:] else words[1:]
    size = len(head) - len(head.lstrip("1234GS"))
    return head[:size], COMMANDS.get(head[size:]), words[1:]
