"""The status codes of a BarrettHand (ERR n): a sum of powers of two, what each means, and the next step (barrett §5.1.3, T3). Sans I/O."""

from __future__ import annotations

from handctl.errors import HandctlError, Hint

NOT_INITIALIZED = 4
"""Status of a motor that HI has not initialized yet (barrett §5.1.3, T3)."""
NOT_REACHED = 16
"""Status of M, HOME, IC and IO where a motor did not get to its place (barrett §5.5)."""
UNKNOWN_COMMAND, UNKNOWN_NAME = 32, 64
"""Status of a word that is no command, and of a parameter that this firmware does not have (barrett §5.1.3, T3)."""
ABORTED = 16384
"""Status of what ^C has ended (barrett §5.1.3, T3)."""
OF_ONE_MOTOR = 1 | 2 | 4
"""Statuses of single motors: a movement moves the others all the same (barrett §5.2.1)."""
OVER_TEMPERATURE = 8192
"""Status of a motor, or of a motor command, above OTEMP (barrett §5.4.1)."""
STATUS_CODES: dict[int, tuple[str, str]] = {
    1: ("No motor board found", "power-cycle the hand, then ask the vendor (electronics)"),
    2: ("No motor found", "power-cycle the hand, then ask the vendor (electronics or cable)"),
    NOT_INITIALIZED: (
        "Motor not initialized",
        Hint("run {}. The fingers open fully: keep the space around them free", "barrett init"),
    ),
    NOT_REACHED: (
        "Couldn't reach position",
        Hint("look for an obstacle, a strain limit, or MPE: {}", "barrett status"),
    ),
    UNKNOWN_COMMAND: (
        "Unknown command",
        Hint("check the name, or check the cable for noise: {} lists the commands", "barrett help"),
    ),
    UNKNOWN_NAME: (
        "Unknown parameter name",
        Hint(
            "check the name: {} lists them all. If it is right, this firmware does not have this parameter",
            "barrett describe",
        ),
    ),
    128: ("Invalid value", Hint("see the ranges with {}", "barrett describe")),
    256: ("Tried to write a read only parameter", "read it with `handctl barrett get`: it cannot be written"),
    1024: ("Too many arguments for this command", "give fewer arguments at a time"),
    2048: ("Invalid RealTime control block header", "check the hand's loop flags: the block did not match them"),
    4096: ("Command can't have motor prefix", "leave the motors out"),
    OVER_TEMPERATURE: (
        "Overtemperature fault tripped",
        Hint("compare TEMP with OTEMP in {}, and let the hand cool", "barrett status"),
    ),
    ABORTED: (
        "Cntl-C abort command received",
        "nothing to do if you stopped it yourself. If not, another program may have sent ^C",
    ),
}
"""barrett §5.1.3, T3: code -> (the manual's wording, next step)."""


def split_status(code: int) -> list[int]:
    """The powers of two in a status sum, lowest first; nothing is dropped."""
    return [1 << bit for bit in range(code.bit_length()) if code >> bit & 1]


def shows_heat(error: HandctlError) -> bool:
    """Whether a hand refused for its temperature."""
    return error.code.startswith("err-") and bool(int(error.code[4:]) & OVER_TEMPERATURE)


def explain_status(code: int) -> str:
    """``20`` -> ``Motor not initialized (4) + Couldn't reach position (16)``; 0 -> ``ready``."""
    if code == 0:
        return "ready"
    parts = []
    for bit in split_status(code):
        text = STATUS_CODES[bit][0] if bit in STATUS_CODES else ("(not used)" if bit in (8, 512) else "unknown")
        parts.append(f"{text} ({bit})")
    return " + ".join(parts)


def hint_for(code: int) -> str:
    """The next step for the most telling bit of a status sum."""
    return next(
        (STATUS_CODES[bit][1] for bit in split_status(code) if bit in STATUS_CODES),
        "ask the vendor: the manual does not list this code (T3)",
    )
