"""Who speaks first, the hand or we: the table that a connect runs on, and the section of the manual page that shows it.

The manual does not say it (dossier 6). Knows no bytes and no link; sans I/O.
"""

from __future__ import annotations

from typing import NamedTuple

LISTENED, ASKED, AGAIN, DOUBTED = "listened", "asked", "again", "doubted"
STATES = {
    LISTENED: "connected: listen for 0.3 s, or with `--exchange stream` for 1 s or --timeout. An object that has begun may finish",
    ASKED: "the empty object, or the one in `--poll-json`, has been sent. `--exchange poll` starts here",
    AGAIN: "it has been sent once more. Skipped with `--retries 0`",
    DOUBTED: "the reply may be the next object of a slow stream: listen for 1.2 s and send nothing",
}
FEEDBACK, LATE, DAMAGED, OTHER, NOTHING = "feedback", "late", "damaged", "other", "nothing"
SEEN = {
    FEEDBACK: "an object with feedback keys",
    LATE: "the same, but more than 0.13 s after the request. Only with `--exchange auto`",
    DAMAGED: "bytes that are not a JSON object or, before the first request, half an object",
    OTHER: "objects that are not feedback, or an echo of the request",
    NOTHING: "silence",
}
STREAMS, ANSWERS, STRANGER, SILENT = "streams", "answers", "stranger", "silent"
ENDS = {
    STREAMS: "the hand streams feedback: handctl reads it without sending a request",
    ANSWERS: "the hand replies: handctl sends a request for each reading",
    STRANGER: "exit code 5: data arrived, but not from an AIDIN-hand",
    SILENT: "exit code 4: no reply",
}


class Row(NamedTuple):
    """One line of the table."""

    state: str
    seen: str
    next: str


TABLE = (
    Row(LISTENED, FEEDBACK, STREAMS),
    Row(LISTENED, DAMAGED, STRANGER),
    Row(LISTENED, OTHER, ASKED),
    Row(LISTENED, NOTHING, ASKED),
    Row(ASKED, FEEDBACK, ANSWERS),
    Row(ASKED, LATE, DOUBTED),
    Row(ASKED, DAMAGED, STRANGER),
    Row(ASKED, OTHER, AGAIN),
    Row(ASKED, NOTHING, AGAIN),
    Row(AGAIN, FEEDBACK, ANSWERS),
    Row(AGAIN, LATE, DOUBTED),
    Row(AGAIN, DAMAGED, STRANGER),
    Row(AGAIN, OTHER, STRANGER),
    Row(AGAIN, NOTHING, SILENT),
    Row(DOUBTED, FEEDBACK, STREAMS),
    Row(DOUBTED, NOTHING, ANSWERS),
)
RULES = {(row.state, row.seen): row.next for row in TABLE}
UNASKED = {OTHER: STRANGER, NOTHING: SILENT}
"""The end instead of ASKED or AGAIN where nothing may be sent any more: `--exchange stream`, a dry run, `--retries 0`."""

PAGE = (
    "The manual does not say whether the hand or the computer sends first, so handctl finds out before it reads anything. "
    "Each line below shows what handctl receives and the next state. The request commands nothing, because any mode would "
    "move the hand or drop what it holds.",
    "With `--exchange stream` and in a dry run handctl sends nothing, so `listened` ends in `stranger` or `silent` instead. "
    "With `--exchange command` it sends no request: such a hand only replies to commands and cannot be read.",
)


def section() -> tuple[str, tuple[str, ...], list[tuple[str, str, list[str]]]]:
    """The section of the manual page: title, paragraphs, and for each state its text and its lines of the table."""
    items = [
        (state, f"{text}.", [f"{row.seen:<12}{row.next}" for row in TABLE if row.state == state])
        for state, text in STATES.items()
    ]
    rest: list[tuple[str, str, list[str]]] = [(name, f"{text}.", []) for name, text in (ENDS | SEEN).items()]
    return "WHO SPEAKS FIRST", PAGE, [*items, *rest]
