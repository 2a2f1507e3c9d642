"""The message codes that name the cause of a fault, by fault, or by fault and device or wire where these say it otherwise."""

from __future__ import annotations

CAUSES: dict[str, set[str]] = {
    **{name: {"no-answer"} for name in ("silent", "no-wrist", "hang", "reboot", "block-silent")},
    "no-ack": {"no-ack"}, "bus-off": {"bus-off"},
    "deaf": {"no-answer"}, "deaf aidin": {"not-reached"},  # a stream goes on, and the hand does not move
    "disconnect": {"lost"}, "loopback": {"echo"}, "echo": {"echo-differs"}, "wrong-id": {"wrong-id"},
    "bad-checksum": {"bad-checksum"}, "bad-checksum aidin": {"bad-json"},
    "bad-checksum barrett": {"garbage"},  # GCL has no checksum, and no character with bit 7
    "truncate": {"cut-short", "garbage", "bad-checksum"}, "truncate aidin": {"bad-json"},
    "twin-id": {"bad-checksum"}, "twin-id can": {"no-answer", "bus-errors"},
    "duplicate": {"echo-differs"},
    "no-echo": {"no-echo", "echo-differs"},  # at the first question, or later
    "duplicate barrett": {"echo-differs", "garbage"},  # the answer to the first question, twice, is none that fits
    "hang barrett": {"no-answer", "echo", "garbage"},  # it repeats what it hears, alone or behind what came before
    "noise": {"echo-differs", "garbage", "cut-short", "bad-line"},  # before, in or behind an answer, as chance has it
    "refuse": {"refused"}, "refuse can": {"read-back"}, "refuse aidin": {"not-reached"},
    **{name: {"not-reached"} for name in ("blocked", "foreign", "weak", "frozen", "swapped")},
    "blocked wrist": {"blocked"}, "blocked exo": {"blocked"},
    **{f"{name} hand": {"not-fit"} for name in (
        "faults", "hot", "locked-rotor", "over-temperature", "over-current", "motor-abnormal", "communication", "unknown-bits")},
    "blocked hand": {"blocked"},
    # an answer of Modbus RTU ends with silence: a damaged one is not told from one that was cut off
    **{f"{name} rtu": {"cut-short"} for name in ("bad-checksum", "twin-id")},
    "bad-checksum hand tcp": {"cut-short"},
    # EksoNR
    "acknowledge": {"acknowledged", "echo"}, "short-body": {"bad-length", "acknowledged", "bad-checksum"},
    "wrong-command": {"wrong-command"}, "not-taken": {"read-back"}, "neighbour": {"read-back"},
    "pendant": {"changed-meanwhile"},
    **{name: {"not-still"} for name in ("fidget", "unknown-state", "frozen-clock", "clock-jump")},
    # AIDIN-hand
    "missing-key": {"missing-key"}, "wrong-length": {"bad-length"}, "nan": {"not-finite"}, "wrong-type": {"bad-type"},
    "not-json": {"garbage"}, "braces": {"bad-json"}, "degrees": {"kept-out-of-range"},
    # BarrettHand: any word may be wrong
    "erratic": {"usage", "read-back", "echo-differs", "cut-short", "garbage", "bad-length"},
}  # fmt: skip
"""Message codes that name the cause, by fault, or by fault and device or bus where these say it otherwise; no word of it
where a code of the device says more (exit 6)."""


OF_COMMANDS = {"stop": {"bad-answer", "link"}, "baud": {"lost-speed"}}
"""What these say besides: whatever came, it is not what tells that the motors are off, or the new speed."""


def causes_of(fault: str, family: str, wire: str, command: str) -> set[str]:
    """The codes that one cell may show; none where nothing is said of it."""
    keys = (f"{fault} {family} {wire}", f"{fault} {wire}", f"{fault} {family}", fault)
    known = next((CAUSES[key] for key in keys if key in CAUSES), set())
    return known | OF_COMMANDS.get(command, set()) if known else known
