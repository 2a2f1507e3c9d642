"""The supervisory commands of the simulated BarrettHand: one line of GCL in, answer lines and a status code out.

Knows commands and parameters, no wire (barrett §5.1, §5.2). Where the manual is silent the behaviour is our guess and the comment says so.
"""

from __future__ import annotations

from handctl.sim.barrett.answer import Answer
from handctl.sim.barrett.memory import decimal_number
from handctl.sim.barrett.tables import (
    BAD_VALUE,
    MOVES,
    NO_PREFIX,
    NOT_INITIALIZED,
    PREFIX,
    READ_ONLY,
    ROWS,
    TOO_HOT,
    TOO_MANY,
    UNKNOWN_COMMAND,
    UNKNOWN_NAME,
)

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable

    from handctl.sim.barrett.board import Board

ALL = (0, 1, 2, 3)
WRITES = ("FSET", "FLOAD", "FSAVE", "FDEF", "PSET", "PLOAD", "PSAVE", "PDEF")


def execute(device: Board, text: str) -> Answer | None:
    """Carries a line out. None: the answer comes later, at the end of a movement or after a restart."""
    words = [word for word in text.upper().split(" ") if word]
    if not words:
        return Answer()
    prefix, name, arguments = _split(words)
    row = ROWS.get(name)
    if row is None or ("erratic" in device.hits and not device.random.between(0, 7)):
        return Answer(UNKNOWN_COMMAND)
    if prefix and not row[1]:
        return Answer(NO_PREFIX)
    glued = len(words[0]) > len(prefix) + len(name)  # ?NAME; a space between them is refused (§5.2.4)
    if len(arguments) > (device.most_arguments if row[2] < 0 else row[2] + glued):
        return Answer(TOO_MANY)
    if "refuse" in device.hits and name in WRITES:
        return Answer(READ_ONLY)
    motors = tuple(sorted({number for letter in prefix for number in PREFIX[letter]})) or ALL
    if row[1] and device.hand.too_hot() and (device.heat_stops_all or name in (*MOVES, "LOOP", "T")):
        if name == "T":
            device.hand.terminate(motors)
        return Answer(TOO_HOT)  # any motor command (§5.4.1)
    if name in MOVES:
        return _move(device, name, motors, not prefix, arguments)
    if name == "LOOP":
        return _loop(device, motors, not prefix)
    return _other(device, name, motors, arguments)


def _split(words: list[str]) -> tuple[str, str, list[str]]:
    """Motor prefix, command, arguments; no command starts with a letter of the prefix. ?NAME has NAME as argument."""
    head = words[0]
    name = head.lstrip("1234GS")
    prefix = head[: len(head) - len(name)]
    if name[:1] == "?" and len(name) > 1:
        return prefix, "?", [name[1:], *words[1:]]
    return prefix, name, words[1:]


def _move(device: Board, name: str, motors: tuple[int, ...], unnamed: bool, arguments: list[str]) -> Answer | None:
    """Movement commands (§5.2.1). Without prefix they act on the enabled motors alone (§5.3.4 EN)."""
    argument = decimal_number(arguments[0], 0, 20000) if arguments else None
    if arguments and argument is None:
        return Answer(BAD_VALUE)
    if unnamed:
        motors = tuple(number for number in motors if device.memory.get("EN", number))
    device.hand.start(name, motors, argument)
    return None


def _loop(device: Board, motors: tuple[int, ...], unnamed: bool) -> Answer | None:
    """LOOP (§5.2.1), a movement command: a motor that is not ready is an error and nothing begins (our guess)."""
    if unnamed:
        motors = tuple(number for number in motors if device.memory.get("EN", number))
    code = 0
    for number in motors:
        motor = device.hand.motors[number]
        if motor.fault or not motor.initialized:
            code |= motor.fault or NOT_INITIALIZED
    if code:
        return Answer(code)
    device.enter_loop(motors)
    return None


def _other(device: Board, name: str, motors: tuple[int, ...], arguments: list[str]) -> Answer | None:
    memory = device.memory
    device.dirty = device.dirty or name in WRITES
    match name:
        case "T":
            return Answer(device.hand.terminate(motors))
        case "FGET":
            return _get(device, arguments, motors)
        case "FSET":
            return _pairs(arguments, lambda parameter, text: memory.set(parameter, text, motors))
        case "FLOAD":
            memory.load(motors)
        case "FSAVE":
            return Answer(seconds=memory.save(motors, device.worn) * device.write_time)
        case "FDEF":
            memory.default(motors)
        case "PGET":
            return _get(device, arguments, None)
        case "PSET":
            return _pairs(arguments, lambda parameter, text: memory.set_common(parameter, text, device.fastest))
        case "PLOAD":
            memory.load_common()
        case "PSAVE":
            return Answer(seconds=memory.save_common(device.worn) * device.write_time)
        case "PDEF":
            memory.default_common()
        case "RESET":
            device.reset()
            return None
        case "FLISTV" | "FLISTAV" | "PLISTV" | "PLISTAV":
            return _list_values(device, name, motors)
        case _:
            from handctl.sim.barrett import texts

            return texts.answer(device, name, arguments)
    return Answer()


def _get(device: Board, names: list[str], motors: tuple[int, ...] | None) -> Answer:
    """One line for each name, one value for each motor (§5.2.2); what came before a wrong name is printed."""
    answer = Answer()
    known = device.memory.common_rows if motors is None else device.memory.motor_rows
    for name in names:
        if name not in known:
            answer.code = UNKNOWN_NAME
            break
        answer.lines.append(values(device, name, motors))
        if name == "P":  # remembered for LFDP (§6.2.3)
            for number in motors or ():
                device.hand.motors[number].reported = device.read("P", number)
    return answer


def values(device: Board, name: str, motors: tuple[int, ...] | None) -> str:
    """The value line of one parameter, in the order of the motors whatever the prefix said."""
    if motors is None:
        numbers = [device.read_common(name)]
    else:
        numbers = [device.read(name, number) for number in motors]
    if "erratic" in device.hits:
        numbers = [
            number if device.random.between(0, 7) else number ^ (1 << device.random.between(0, 11))
            for number in numbers
        ]
    return " ".join(str(number) for number in numbers)


def _pairs(arguments: list[str], setter: Callable[[str, str], int]) -> Answer:
    """Name and value, any number of times (§5.2.2); the first wrong one ends the command, those before it stay set.

    A name without a value is an invalid value (our guess).
    """
    for at in range(0, len(arguments), 2):
        code = setter(arguments[at], (arguments[at + 1 : at + 2] or [""])[0])
        if code:
            return Answer(code)
    return Answer()


def _list_values(device: Board, name: str, motors: tuple[int, ...]) -> Answer:
    """FLISTV, PLISTV, FLISTAV, PLISTAV: one line for each parameter (§5.2.2 to §5.2.5)."""
    of_motors, advanced = name[0] == "F", name[5] == "A"
    names = device.memory.motor_names(advanced) if of_motors else device.memory.common_names(advanced)
    rows = [(row, values(device, row, motors if of_motors else None)) for row in names]
    if device.texts == "values":
        return Answer(lines=[text for _, text in rows])
    return Answer(lines=[f"{row} {text}" if device.texts == "names" else f"{row}: {text}" for row, text in rows])
