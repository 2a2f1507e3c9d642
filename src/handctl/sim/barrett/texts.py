"""What the simulated BarrettHand prints for people: lists, help, status codes, version (barrett §5.2.2 to §5.2.5).

No print-out of these is in the manual: all layouts are invented, and the option "texts" selects one of three, so that
a client cannot rely on any. The words are the manual's own names. Loaded on use.

    values   8500 8500 8500 1575      DP Default Position       HI Hand Initialize      4.33
    names    DP 8500 8500 8500 1575   DP - Default Position     HI - Hand Initialize    Version 4.33
    prose    DP: 8500 8500 8500 1575  DP: Default Position      HI: Hand Initialize     BarrettHand Firmware 4.33
"""

from __future__ import annotations

from handctl.sim.barrett.answer import Answer
from handctl.sim.barrett.memory import decimal_number
from handctl.sim.barrett.tables import BAD_VALUE, COMMANDS, ERRORS, ROWS, UNKNOWN_COMMAND

TYPE_CHECKING = False
if TYPE_CHECKING:
    from handctl.sim.barrett.board import Board

BETWEEN = {"values": " ", "names": " - ", "prose": ": "}
VERSION = {"values": "", "names": "Version ", "prose": "BarrettHand Firmware "}


def answer(device: Board, name: str, arguments: list[str]) -> Answer:
    """FLIST, PLIST, FLISTA, PLISTA, ?, A?, ERR, VERS."""
    between = BETWEEN[device.texts]
    motor, common = device.memory.motor_rows, device.memory.common_rows
    match name:
        case "FLIST":
            return Answer(lines=[f"{row}{between}{motor[row][7]}" for row in device.memory.motor_names(False)])
        case "PLIST":
            return Answer(lines=[f"{row}{between}{common[row][6]}" for row in device.memory.common_names(False)])
        case "FLISTA" | "PLISTA":  # names alone
            names = device.memory.motor_names(True) if name[0] == "F" else device.memory.common_names(True)
            return Answer(lines=[" ".join(names)] if device.texts == "names" else names)
        case "A?":
            return Answer(lines=[f"{row[0]}{between}{row[4]}" for row in COMMANDS])
        case "VERS":
            return Answer(lines=[VERSION[device.texts] + device.version])
        case "ERR":
            return _errors(arguments, between)
    return _help(arguments, between)


def _help(arguments: list[str], between: str) -> Answer:
    """? alone, or ?NAME."""
    if not arguments:
        return Answer(lines=[f"{row[0]}{between}{row[4]}" for row in COMMANDS if not row[3]])
    row = ROWS.get(arguments[0])
    if row is None:
        return Answer(UNKNOWN_COMMAND)
    return Answer(lines=[f"{row[0]}{between}{row[4]}"])


def _errors(arguments: list[str], between: str) -> Answer:
    """ERR lists all codes, ERR n those in the sum n; bits without a meaning are left out."""
    number = decimal_number(arguments[0], 0, 65535) if arguments else 32767
    if number is None:
        return Answer(BAD_VALUE)
    return Answer(lines=[f"{code}{between}{text}" for code, text in ERRORS if number & code])
