"""What `handctl ekso` must say at every fault of its simulator: exit code and cause, written by hand.

From the contract's exit codes (cli.md 5) and the dossier (4 to 6); nothing is computed by handctl.
"""

from __future__ import annotations

from tests.ekso.commands import WRITES

SETS = tuple(command.name for command in WRITES if command.kind == "set")

# -- what the contract allows: by hand, from cli.md §5 and the dossier -------------------------------------------------

UNHARMED = ("healthy", "garble", "noise", "dribble", "split", "echo", "duplicate", "stale", "slow", "unsolicited",
            "stray-zero", "stuck-sensor")  # fmt: skip
"""The answer is there, in pieces, late within its time, or among other bytes: everything succeeds."""
NO_ANSWER: dict[str, tuple[int, str]] = {
    # fault -> exit code, words of which one names the cause
    "silent": (4, "no answer"), "deaf": (4, "no answer"), "reboot": (4, "no answer"),
    "late": (5, "msgID"), "wrong-id": (5, "msgID"), "wrong-command": (5, "instead of|, not Get|, not Set"),
    "truncate": (5, "cut off|do not form a frame"), "bad-checksum": (5, "CRC|checksum"), "twin-id": (5, "CRC|checksum"),
    "short-body": (5, "body|CRC"), "loopback": (5, "echo|our own bytes"), "acknowledge": (5, "acknowledged without data"),
    "disconnect": (3, "hung up"),
}  # fmt: skip
"""No valid answer to anything."""
LUCKY = ("twin-id",)
"""The AND of two frames may be the one frame, by chance; then its values are right."""
SPECIAL: dict[tuple[str, str], tuple[int, str]] = {
    ("unlisted-codes", "diff"): (7, "10 of 20 values differ"),
    ("unlisted-codes", "set-label"): (7, "read-back differs: lean_allowance is unknown (61)"),
    ("unlisted-codes", "set-percent"): (7, "read-back differs: left_swing_assist is unknown (54)"),
    ("unlisted-codes", "set-twice"): (7, "read-back differs: right_stance_support is unknown (57)"),
    ("unlisted-codes", "restore"): (7, "walk_mode, injury_mode: only while sitting"),
    ("refuse", "cancel"): (6, "refused in the present state"),
    ("hip-offset", "status-check"): (7, "right hip is +3"),
    ("frozen-clock", "status-check"): (7, "stands still"),
    ("clock-jump", "status-check"): (7, "advanced by 51"),
}  # fmt: skip
ON_SETS: dict[str, tuple[int, str]] = {
    "refuse": (6, "refused in the present state"),
    "stands-up": (6, "refused in the present state"),
    "not-taken": (7, "read-back differs"),
    "neighbour": (7, "read-back differs"),
    "pendant": (7, "settings changed meanwhile, nothing was written: target_sounds is Forward, expected Off"),
    "fidget": (7, "deg/s"),
    "unknown-state": (7, "unknown (0x5040)"),
    "frozen-clock": (7, "BootTime advanced by 0 ms"),
    "clock-jump": (7, "BootTime advanced by 51"),
    "acknowledge-set": (0, ""), "set-unanswered": (0, ""),
    "unlisted-codes": (0, ""), "hip-offset": (0, ""),
}  # fmt: skip
"""What each `set` and `restore` says; reading is not befallen (0)."""
ANSWER_LOST = ("acknowledge-set", "set-unanswered")
"""Applied, and said so with a warning (dossier 5)."""
FAULTS = (*UNHARMED, *NO_ANSWER, *ON_SETS)
STILLNESS = ("fidget", "unknown-state", "frozen-clock", "clock-jump", "pendant")
"""Seen before the write: nothing goes out."""


def expected(fault: str, name: str) -> tuple[int, str]:
    """Exit code, and the words of which the message has one."""
    if (fault, name) in SPECIAL:
        return SPECIAL[fault, name]
    if fault in NO_ANSWER:
        return NO_ANSWER[fault]
    if fault in ON_SETS and name in SETS:
        return ON_SETS[fault]
    return 0, ""


# One SetValue is the seventh request of a `set`: after stillness, before the read-back. What if just that one is hit?
HIT_WRITE: dict[str, tuple[int, str]] = {
    "disconnect": (3, "hung up"),
    "deaf": (4, "not applied"), "reboot": (4, "not applied"), "loopback": (5, "echo|our own bytes"),
    "refuse": (6, "refused"), "stands-up": (6, "refused"), "unknown-state": (6, "refused"),
    "not-taken": (7, "read-back"), "neighbour": (7, "read-back"),
    **dict.fromkeys(("silent", "truncate", "bad-checksum", "wrong-id", "late", "acknowledge", "acknowledge-set",
                     "set-unanswered", "wrong-command", "short-body"), (0, "answer-lost")),
}  # fmt: skip
HIT_READ_BACK: dict[str, tuple[int, str]] = {
    "disconnect": (3, "hung up"), "loopback": (5, "echo"), "unlisted-codes": (7, "read-back"),
}  # fmt: skip
"""Any other read-back is repeated."""
HIT_BOTH: dict[str, tuple[int, str]] = {
    **NO_ANSWER,
    "refuse": (6, "refused"), "stands-up": (6, "refused"), "unknown-state": (6, "refused"),
    "not-taken": (7, "read-back"), "neighbour": (7, "read-back"), "unlisted-codes": (7, "read-back"),
    **dict.fromkeys(ANSWER_LOST, (0, "answer-lost")),
}  # fmt: skip
HIT_CANCEL: dict[str, tuple[int, str]] = {
    **NO_ANSWER,
    "late": (4, "no answer"),  # never repeated, so that nothing had come yet
    "short-body": (5, "acknowledged without data"),  # a status without its word
    "refuse": (6, "refused in the present state"),
}
"""Only CancelAction is hit, the second request of `cancel`: the time before it said who is there."""
PHASES = {
    "write": ({"every": 7}, HIT_WRITE),
    "read-back": ({"every": 8}, HIT_READ_BACK),
    "both": ({"after": 6}, HIT_BOTH),
}
NOT_HEARD = {"write": {"deaf", "reboot", "loopback"}, "read-back": set(), "both": {"deaf", "reboot", "loopback"}}
"""Faults under which the unit does not get the SetValue, by phase."""
NEVER_TAKEN = ("refuse", "stands-up", "not-taken", "unknown-state")
