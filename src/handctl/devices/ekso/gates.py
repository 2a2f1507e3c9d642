"""What must hold before one SetValue goes out, as one table in the order in which it is asked; the writer runs on it.

Limits stand with the words (`map`) and in `ekso policy`. All of it is this tool's policy but what the ParameterID table of the
manual says. Knows no bytes and no link; sans I/O. `dossier` in a source is the protocol dossier, `ekso` the manual.
"""

from __future__ import annotations

from typing import NamedTuple

from handctl.errors import CheckFailed, DeviceRefused, HandctlError, LinkError, NotConfirmed, OutputError, UsageError

TYPED, READ, ASKED, TURN, ALONE, SENT = "typed", "read", "asked", "turn", "alone", "sent"
LOOK, LOOKS = "look", "looks"
MOMENTS = {
    TYPED: "what was typed, before the port is opened",
    READ: "before the question: the audit log, then the settings that were read",
    ASKED: "the question to a person, which `--yes` with `--operator` answers",
    TURN: "alone with the audit logs: what may follow the last writes to any EksoNR, whatever the run, the port or the log",
    ALONE: "right before SetValue, still alone with the log",
    SENT: "after SetValue, which is sent once",
    LOOK: "each of the two looks at the wearer (`still`)",
    LOOKS: "the two looks together",
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
    Gate(TYPED, UNKNOWN, "the name or ParameterID", "one that no table has", UsageError, "unknown-name", "", "ekso §6"),
    Gate(TYPED, READ_ONLY, "its ParameterID", "a quantity without one", UsageError, "read-only", "", "ekso §6"),
    Gate(TYPED, NUMBER, "the value", "no number, no label, no code", UsageError, "not-a-number", "", "dossier 6.4"),
    Gate(TYPED, AMBIGUOUS, "a bare number for assistance", "it may be percent or a code", UsageError, "ambiguous", "", "dossier 3.1"),
    Gate(TYPED, EXACT, "its decimals", "more than the scale has. Nothing is rounded", UsageError, "not-exact", "", "dossier 6.4"),
    Gate(TYPED, RANGE, "the word", "a value beyond the wire type, a code of no table", UsageError, "out-of-range", "", "dossier 6.4"),
    Gate(TYPED, ONE, "how many settings", "more than one", UsageError, "one-by-one", "", "dossier 6.1"),
    Gate(TYPED, OPERATOR, "`--operator` with `--yes`", "nobody is named", UsageError, "no-operator", "", "dossier 6.1"),
    Gate(TYPED, TERMINAL, "whether a person can answer", "no terminal", NotConfirmed, "not-confirmed", "--yes", "dossier 6.1"),
    Gate(READ, LOG, "the audit log", "no file that can be written", OutputError, "audit", "", "dossier 6.7"),
    Gate(READ, LISTED, "the new code", "one that is not documented", UsageError, "unlisted", "", "dossier 3.1"),
    Gate(READ, STEP, "old and new value", "more than the step of `ekso policy`, which the option lifts but for leg lengths. `restore` goes there in steps", UsageError, "step-limit", OVERRIDE, "dossier 6.3"),
    Gate(READ, STILL, "two GetData, 0.1 s apart", "a wearer who moves", CheckFailed, "not-still", "", "dossier 6.2"),
    Gate(READ, RESTARTED, "BootTime since the last look", "a restart: other settings may hold", CheckFailed, "restarted", "", "dossier 5"),
    Gate(ASKED, CONFIRMED, "the new value, typed", "anything else", NotConfirmed, "not-confirmed", "--yes", "dossier 6.1"),
    Gate(ASKED, TWICE, "a second yes for a mode that drives otherwise", "anything else", NotConfirmed, "not-confirmed", "--yes", "dossier 6.3"),
    Gate(TURN, FREE, "the lock of the log", "another handctl writes now", LinkError, "busy", "", "dossier 5"),
    Gate(TURN, EDITED, "the hashes of its last entries", "an edit in the last 10 s", CheckFailed, "audit-edited", "", "dossier 6.7"),
    Gate(TURN, DAMAGED, "the last lines", "one of the last 10 s that cannot be read", CheckFailed, "audit-damaged", "", "dossier 6.7"),
    Gate(TURN, CLOCK, "an entry of another machine", "one from the future", CheckFailed, "clock-set-back", "", "dossier 6.7"),
    Gate(TURN, PACE, "each value of the last 10 s, of any EksoNR", "more than the step from one of them. `restore` waits", UsageError, "step-limit", OVERRIDE, "dossier 6.6"),
    Gate(TURN, WAITED, "the waits of `restore`", "30 s: somebody else writes all the time", CheckFailed, "step-limit", OVERRIDE, "dossier 6.6"),
    Gate(ALONE, SAME, "GetSettings once more", "settings other than shown", CheckFailed, "changed-meanwhile", "", "dossier 6.5"),
    Gate(ALONE, STILL, "two GetData, 0.1 s apart", "a wearer who moves", CheckFailed, "not-still", "", "dossier 6.2"),
    Gate(ALONE, RESTARTED, "BootTime since the last look", "a restart: other settings may hold", CheckFailed, "restarted", "", "dossier 5"),
    Gate(ALONE, INTENT, "the entry of the audit log", "one that is not on the disk", OutputError, "audit", "", "dossier 6.7"),
    Gate(SENT, STATUS, "the status word", "any but 0", DeviceRefused, "status-{}", "", "dossier 2"),
    Gate(SENT, READ_BACK, "all 22 settings", "another value than sent, a change of another", CheckFailed, "read-back", "", "dossier 6.5"),
    Gate(SENT, RESULT, "the entry of the result", "one that is not on the disk", OutputError, "audit", "", "dossier 6.7"),
    Gate(LOOK, POSTURE, "State, its high digit", "neither sitting nor standing", CheckFailed, "not-still", "", "dossier 6.2"),
    Gate(LOOK, DRIVEN, "State, bit 0x0400", "joints that are being driven", CheckFailed, "not-still", "", "dossier 6.2"),
    Gate(LOOK, SEATED, "State, for leg lengths, `walk_mode`, `injury_mode`", "standing", CheckFailed, "not-still", "", "dossier 6.2"),
    Gate(LOOKS, REBOOT, "BootTime", "it went back", CheckFailed, "not-still", "", "dossier 6.2"),
    Gate(LOOKS, FRESH, "BootTime against our clock", "50 ms apart: the values are not fresh", CheckFailed, "not-still", "", "dossier 6.2"),
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
    "What `set` and `restore` ask before one SetValue goes out, and after it, in this order. Each line below is a gate, its exit "
    "code, the code of its error and the option that lifts it. The first that does not hold ends the command.",
    "All of it is this tool's policy, but that a setting is written by a ParameterID (ekso §6), and the status that the device "
    "answers: its own limits are not documented. `handctl ekso policy` prints the numbers.",
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
