"""All checks before a SetValue is sent, as one table in the order in which the writer runs them.

The limits are in `write_policy`. All of it is this tool's policy but what the ParameterID table of the
manual says. Knows no bytes and no link; sans I/O. `dossier` in a source is the protocol dossier, `ekso` the manual.
"""

from __future__ import annotations

from typing import NamedTuple

from handctl.errors import CheckFailed, DeviceRefused, HandctlError, LinkError, NotConfirmed, OutputError, UsageError
from handctl.model.device_clock import WITHIN_MS

TYPED, READ, ASKED, TURN, ALONE, SENT = "typed", "read", "asked", "turn", "alone", "sent"
LOOK, LOOKS = "look", "looks"
MOMENTS = {
    TYPED: "the command line, before the port is opened",
    READ: "before the confirmation: the audit log, then the settings read from the device",
    ASKED: "the confirmation by a person, which `--yes` with `--operator` gives",
    TURN: "with the audit logs locked: the last writes to any EksoNR, in any run, on any port and in any log",
    ALONE: "right before SetValue, with the log still locked",
    SENT: "after SetValue, which is sent once",
    LOOK: "each of the two readings of `still`",
    LOOKS: "the two readings together",
}

UNKNOWN, READ_ONLY, NUMBER, AMBIGUOUS = "known", "writable", "number", "unambiguous"
EXACT, RANGE, ONE, OPERATOR, TERMINAL = "exact", "range", "one", "operator", "person"
LOG, LISTED, STEP, STILL, RESTARTED = "log", "listed", "step", "still", "running on"
CONFIRMED, TWICE = "confirmed", "asked twice"
FREE, EDITED, DAMAGED, CLOCK, PACE, WAITED = "free", "unedited", "whole", "clock", "pace", "waited"
SAME, INTENT = "same", "logged"
STATUS, READ_BACK, RESULT = "status", "read back", "noted"
POSTURE, DRIVEN, SEATED = "posture", "undriven", "seated"
REBOOT, FRESH, SPEED = "same boot", "fresh", "speed"
OVERRIDE = "--override-step-limit"


class Gate(NamedTuple):
    """One line of the table: what is looked at, what is refused, how; `option` lifts it; `source` is manual or dossier."""

    moment: str
    name: str
    looked_at: str
    refused: str
    error: type[HandctlError]
    code: str
    option: str
    source: str


TABLE = (
    Gate(TYPED, UNKNOWN, "the name or ParameterID", "not in any table", UsageError, "unknown-name", "", "ekso §6"),
    Gate(TYPED, READ_ONLY, "its ParameterID", "a quantity that has none", UsageError, "read-only", "", "ekso §6"),
    Gate(TYPED, NUMBER, "the value", "not a number, label or code", UsageError, "not-a-number", "", "dossier 6.4"),
    Gate(TYPED, AMBIGUOUS, "a bare number for assistance", "could be percent or a code", UsageError, "ambiguous", "", "dossier 3.1"),
    Gate(TYPED, EXACT, "its decimals", "more than its scale has, because nothing is rounded", UsageError, "not-exact", "", "dossier 6.4"),
    Gate(TYPED, RANGE, "the word", "a value that does not fit the word, or a code that is in no table", UsageError, "out-of-range", "", "dossier 6.4"),
    Gate(TYPED, ONE, "how many settings", "more than one", UsageError, "one-by-one", "", "dossier 6.1"),
    Gate(TYPED, OPERATOR, "`--operator` with `--yes`", "no operator is named", UsageError, "no-operator", "", "dossier 6.1"),
    Gate(TYPED, TERMINAL, "a terminal where a person can confirm", "none", NotConfirmed, "not-confirmed", "--yes", "dossier 6.1"),
    Gate(READ, LOG, "the audit log", "a file that cannot be written", OutputError, "audit", "", "dossier 6.7"),
    Gate(READ, LISTED, "the new code", "a code that is not documented", UsageError, "unlisted", "", "dossier 3.1"),
    Gate(READ, STEP, "old and new value", "a larger step than `ekso policy` allows. The option lifts this except for leg lengths, and `restore` goes in several steps", UsageError, "step-limit", OVERRIDE, "dossier 6.3"),
    Gate(READ, STILL, "two GetData, 0.1 s apart", "a wearer who is moving", CheckFailed, "not-still", "", "dossier 6.2"),
    Gate(READ, RESTARTED, "BootTime since the last reading", "a restart, because other settings may be active", CheckFailed, "restarted", "", "dossier 5"),
    Gate(ASKED, CONFIRMED, "the new value, typed", "anything else", NotConfirmed, "not-confirmed", "--yes", "dossier 6.1"),
    Gate(ASKED, TWICE, "a second yes for a mode that changes how the device drives", "anything else", NotConfirmed, "not-confirmed", "--yes", "dossier 6.3"),
    Gate(TURN, FREE, "the lock of the log", "another handctl command is writing", LinkError, "busy", "", "dossier 5"),
    Gate(TURN, EDITED, "the hashes of its last entries", "an edit in the last 10 s", CheckFailed, "audit-edited", "", "dossier 6.7"),
    Gate(TURN, DAMAGED, "the last lines", "an entry of the last 10 s that cannot be read", CheckFailed, "audit-damaged", "", "dossier 6.7"),
    Gate(TURN, CLOCK, "the times of the entries", "a time in the future", CheckFailed, "clock-set-back", "", "dossier 6.7"),
    Gate(TURN, PACE, "each value of the last 10 s, of any EksoNR", "a larger step than allowed from any of them. `restore` waits instead", UsageError, "step-limit", OVERRIDE, "dossier 6.6"),
    Gate(TURN, WAITED, "the waits of `restore`", "a wait of 30 s, because someone else keeps writing", CheckFailed, "step-limit", OVERRIDE, "dossier 6.6"),
    Gate(ALONE, SAME, "GetSettings once more", "settings that differ from those shown", CheckFailed, "changed-meanwhile", "", "dossier 6.5"),
    Gate(ALONE, STILL, "two GetData, 0.1 s apart", "a wearer who is moving", CheckFailed, "not-still", "", "dossier 6.2"),
    Gate(ALONE, RESTARTED, "BootTime since the last reading", "a restart, because other settings may be active", CheckFailed, "restarted", "", "dossier 5"),
    Gate(ALONE, INTENT, "the entry of the audit log", "an entry that could not be written to the disk", OutputError, "audit", "", "dossier 6.7"),
    Gate(SENT, STATUS, "the status word", "any but 0", DeviceRefused, "status-{}", "", "dossier 2"),
    Gate(SENT, READ_BACK, "all 22 settings", "a value other than the one sent, or a change of another setting", CheckFailed, "read-back", "", "dossier 6.5"),
    Gate(SENT, RESULT, "the entry of the result", "an entry that could not be written to the disk", OutputError, "audit", "", "dossier 6.7"),
    Gate(LOOK, POSTURE, "State, its high digit", "a posture other than sitting or standing", CheckFailed, "not-still", "", "dossier 6.2"),
    Gate(LOOK, DRIVEN, "State, bit 0x0400", "joints that are being driven", CheckFailed, "not-still", "", "dossier 6.2"),
    Gate(LOOK, SEATED, "State, for leg lengths, `walk_mode`, `injury_mode`", "standing", CheckFailed, "not-still", "", "dossier 6.2"),
    Gate(LOOKS, REBOOT, "BootTime", "BootTime that went back", CheckFailed, "not-still", "", "dossier 6.2"),
    Gate(LOOKS, FRESH, "BootTime against this computer's clock", f"a difference of {WITHIN_MS} ms, because the values are not fresh", CheckFailed, "not-still", "", "dossier 6.2"),
    Gate(LOOKS, SPEED, "hips and knees", "5 deg/s or more", CheckFailed, "not-still", "", "dossier 6.2"),
)  # fmt: skip
GATES = {gate.name: gate for gate in TABLE}


def at(moment: str) -> tuple[str, ...]:
    """The gates of a moment, in the order in which they are asked."""
    return tuple(gate.name for gate in TABLE if gate.moment == moment)


def refusal(name: str, text: str, hint: str, *numbers: int) -> HandctlError:
    """The error of a gate; `numbers` are those in its code."""
    gate = GATES[name]
    return gate.error(text, hint=hint, code=gate.code.format(*numbers))


PAGE = (
    "The checks that `set` and `restore` make before they send a SetValue, and after it, in this order. Each line below is a "
    "check with its exit code, its error code and the option that lifts it. The first check that fails ends the command.",
    "All of these are this tool's policy, except that a setting is written by its ParameterID (ekso §6), and the status in "
    "the reply. The device's own limits are not documented. `handctl ekso policy` prints the figures.",
)


def section() -> tuple[str, tuple[str, ...], list[tuple[str, str, list[str]]]]:
    """The section of the manual page: title, paragraphs, for each moment its lines of the table, and each gate in words."""
    items = [
        (moment, f"{text}.", [_line(gate) for gate in TABLE if gate.moment == moment])
        for moment, text in MOMENTS.items()
    ]
    words: list[tuple[str, str, list[str]]] = [
        (gate.name, f"{gate.looked_at}. Refused: {gate.refused}{_manual(gate)}.", []) for gate in GATES.values()
    ]
    return "BEFORE A SETTING IS WRITTEN", PAGE, [*items, *words]


def _line(gate: Gate) -> str:
    return f"{gate.name:<13}{gate.error.exit_code:<3}{gate.code.format('N'):<19}{gate.option}".rstrip()


def _manual(gate: Gate) -> str:
    return f" ({gate.source})" if gate.source.startswith("ekso") else ""
