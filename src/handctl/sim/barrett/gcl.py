"""The supervisory commands of the simulated BarrettHand: one line of GCL in, answer lines and a status code out.

Knows commands and parameters, no wire (barrett §5.1, §5.2). Where the manual is silent the behaviour is our guess and the
comment says so. No print-out of lists, help, status codes and version is in the manual: all layouts are invented, and the option
"texts" selects one of three, so that a client cannot rely on any. The words are the manual's own names.

    values   8500 8500 8500 1575      DP Default Position       HI Hand Initialize      4.33
    names    DP 8500 8500 8500 1575   DP - Default Position     HI - Hand Initialize    Version 4.33
    prose    DP: 8500 8500 8500 1575  DP: Default Position      HI: Hand Initialize     BarrettHand Firmware 4.33
"""

from __future__ import annotations

from handctl.sim.barrett.parameter_tables import (
    BAD_VALUE,
    COMMANDS,
    ERRORS,
    MOVES,
    NO_PREFIX,
    PREFIX,
    READ_ONLY,
    ROWS,
    TOO_HOT,
    TOO_MANY,
    UNKNOWN_COMMAND,
    UNKNOWN_NAME,
    Bank,
    decimal_number,
)

TYPE_CHECKING = False
if TYPE_CHECKING:
    from handctl.sim.barrett.shared_state import Board

ALL = (0, 1, 2, 3)
BETWEEN = {"values": " ", "names": " - ", "prose": ": "}
VERSION = {"values": "", "names": "Version ", "prose": "BarrettHand Firmware "}
WRITES = ("FSET", "FLOAD", "FSAVE", "FDEF", "PSET", "PLOAD", "PSAVE", "PDEF")


class Answer:
    """What a command prints: lines, then a status code if it is not 0; `seconds` is how long it is busy before that."""

    def __init__(self, code: int = 0, lines: list[str] | None = None, seconds: float = 0.0) -> None:
        self.code = code
        self.lines = [] if lines is None else lines
        self.seconds = seconds


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
    if len(arguments) > (device.given["max-arguments"] if row[2] < 0 else row[2] + glued):
        return Answer(TOO_MANY)
    if "refuse" in device.hits and name in WRITES:
        return Answer(READ_ONLY)
    motors = tuple(sorted({number for letter in prefix for number in PREFIX[letter]})) or ALL
    if row[1] and device.hand.too_hot() and (device.given["otemp-stops"] == "all" or name in (*MOVES, "LOOP", "T")):
        if name == "T":
            device.hand.terminate(motors)
        return Answer(TOO_HOT)  # any motor command (§5.4.1)
    if (name in MOVES or name == "LOOP") and not prefix:  # on the enabled motors alone (§5.3.4 EN)
        motors = tuple(number for number in motors if device.memory.motor.get("EN", number))
    if name in MOVES:
        return _move(device, name, motors, arguments)
    match name:
        case "LOOP":
            return _loop(device, motors)
        case "T":
            return Answer(device.hand.terminate(motors))
        case "RESET":
            device.reset()
            return None
        case "?" | "A?" | "ERR" | "VERS":
            return _text(device, name, arguments)
    device.dirty = device.dirty or name in WRITES
    bank, numbers = (device.memory.motor, motors) if name[0] == "F" else (device.memory.common, (0,))
    return _parameters(device, name[1:], bank, numbers, arguments)


def _split(words: list[str]) -> tuple[str, str, list[str]]:
    """Motor prefix, command, arguments; no command starts with a letter of the prefix. ?NAME has NAME as argument."""
    head = words[0]
    name = head.lstrip("1234GS")
    prefix = head[: len(head) - len(name)]
    if name[:1] == "?" and len(name) > 1:
        return prefix, "?", [name[1:], *words[1:]]
    return prefix, name, words[1:]


def _move(device: Board, name: str, motors: tuple[int, ...], arguments: list[str]) -> Answer | None:
    """Movement commands (§5.2.1)."""
    argument = decimal_number(arguments[0], 0, 20000) if arguments else None
    if arguments and argument is None:
        return Answer(BAD_VALUE)
    device.hand.start(name, motors, argument)
    return None


def _loop(device: Board, motors: tuple[int, ...]) -> Answer | None:
    """LOOP (§5.2.1), a movement command: a motor that is not ready is an error and nothing begins (our guess)."""
    if code := device.hand.unready(motors):
        return Answer(code)
    device.enter_loop(motors)
    return None


def _parameters(device: Board, name: str, bank: Bank, numbers: tuple[int, ...], arguments: list[str]) -> Answer:
    """FGET, PGET and all others with these letters (§5.2.2 to §5.2.5)."""
    match name:
        case "GET":
            return _get(device, arguments, bank, numbers)
        case "SET":
            return _pairs(arguments, bank, numbers)
        case "LOAD":
            bank.load(numbers)
        case "SAVE":
            return Answer(seconds=bank.save(numbers, "eeprom-worn" in device.faults) * device.given["write-time"])
        case "DEF":
            bank.default(numbers)
        case "LIST":
            between = BETWEEN[device.given["texts"]]
            return Answer(lines=[f"{row}{between}{bank.rows[row][7]}" for row in bank.names(False)])
        case "LISTA":  # names alone
            names = bank.names(True)
            return Answer(lines=[" ".join(names)] if device.given["texts"] == "names" else names)
        case _:  # LISTV, LISTAV: one line for each parameter
            before = {"values": "", "names": "{} ", "prose": "{}: "}[device.given["texts"]]
            return Answer(
                lines=[before.format(row) + values(device, row, bank, numbers) for row in bank.names(name == "LISTAV")]
            )
    return Answer()


def _get(device: Board, names: list[str], bank: Bank, numbers: tuple[int, ...]) -> Answer:
    """One line for each name, one value for each motor (§5.2.2); what came before a wrong name is printed."""
    answer = Answer()
    for name in names:
        if name not in bank.rows:
            answer.code = UNKNOWN_NAME
            break
        answer.lines.append(values(device, name, bank, numbers))
        if name == "P":  # remembered for LFDP (§6.2.3)
            for number in numbers:
                device.hand.motors[number].reported = device.placed(device.hand.motors[number].position(device.now))
    return answer


def values(device: Board, name: str, bank: Bank, numbers: tuple[int, ...]) -> str:
    """The value line of one parameter, in the order of the motors whatever the prefix said."""
    found = [device.read_common(name) if bank is device.memory.common else device.read(name, n) for n in numbers]
    if "erratic" in device.hits:
        found = [
            number if device.random.between(0, 7) else number ^ (1 << device.random.between(0, 11)) for number in found
        ]
    return " ".join(map(str, found))


def _pairs(arguments: list[str], bank: Bank, numbers: tuple[int, ...]) -> Answer:
    """Name and value, any number of times (§5.2.2); the first wrong one ends the command, those before it stay set.

    A name without a value is an invalid value (our guess).
    """
    for at in range(0, len(arguments), 2):
        code = bank.put(arguments[at], (arguments[at + 1 : at + 2] or [""])[0], numbers)
        if code:
            return Answer(code)
    return Answer()


def _text(device: Board, name: str, arguments: list[str]) -> Answer:
    """What is printed for people: ? alone or ?NAME, A?, ERR, VERS."""
    texts = device.given["texts"]
    between = BETWEEN[texts]
    if name == "VERS":
        return Answer(lines=[VERSION[texts] + device.version])
    if name == "ERR":  # all codes, or those in the sum n; bits without a meaning are left out
        number = decimal_number(arguments[0], 0, 65535) if arguments else 32767
        if number is None:
            return Answer(BAD_VALUE)
        return Answer(lines=[f"{code}{between}{text}" for code, text in ERRORS if number & code])
    if name == "?" and arguments and arguments[0] not in ROWS:
        return Answer(UNKNOWN_COMMAND)
    asked = [ROWS[arguments[0]]] if name == "?" and arguments else [r for r in COMMANDS if name == "A?" or not r[3]]
    return Answer(lines=[f"{row[0]}{between}{row[4]}" for row in asked])
