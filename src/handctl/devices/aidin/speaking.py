"""Who speaks first, the hand or we: the table that a connect runs on, and the section of the manual page that shows it.

The manual does not say it (dossier 6). Knows no bytes and no link; sans I/O.
"""

from __future__ import annotations

from typing import NamedTuple

LISTENED, ASKED, AGAIN, DOUBTED = "listened", "asked", "again", "doubted"
STATES = {
    LISTENED: "connected, and listened to for 0.3 s. With `--exchange stream` for 1 s, or --timeout. What has begun may finish",
    ASKED: "the empty object, or that of `--poll-json`, was sent. `--exchange poll` begins here",
    AGAIN: "sent once more. Never with `--retries 0`",
    DOUBTED: "the answer may be the next object of a slow stream: listened to for 1.2 s, nothing is sent",
}
FEEDBACK, LATE, DAMAGED, OTHER, NOTHING = "feedback", "late", "damaged", "other", "nothing"
SEEN = {
    FEEDBACK: "an object with keys of feedback",
    LATE: "the same, but later than 0.13 s after it was asked for. Only with `--exchange auto`",
    DAMAGED: "bytes that are not a JSON object. Before anything was sent, half an object too",
    OTHER: "objects that are not feedback, or what was sent comes back",
    NOTHING: "silence",
}
STREAMS, ANSWERS, STRANGER, SILENT = "streams", "answers", "stranger", "silent"
ENDS = {
    STREAMS: "the hand sends feedback unasked: nothing is sent to read it",
    ANSWERS: "the hand answers: it is asked for each reading",
    STRANGER: "exit 5: something speaks, but not as an AIDIN-hand does",
    SILENT: "exit 4: nothing answers",
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
    "The manual does not say who speaks first, so it is found out before anything is read. Each line below is what is seen, "
    "and the next state. What is asked with commands nothing: a mode moves the hand or drops what it holds.",
    "Where nothing may be sent, with `--exchange stream` and in a dry run, `listened` ends in `stranger` or `silent` "
    "instead of asking. With `--exchange command` nothing is asked: the hand only answers commands, and cannot be read.",
)


def section() -> tuple[str, tuple[str, ...], list[tuple[str, str, list[str]]]]:
    """The section of the manual page: title, paragraphs, and for each state its text and its lines of the table."""
    items = [
        (state, f"{text}.", [f"{row.seen:<12}{row.next}" for row in TABLE if row.state == state])
        for state, text in STATES.items()
    ]
    rest: list[tuple[str, str, list[str]]] = [(name, f"{text}.", []) for name, text in (ENDS | SEEN).items()]
    return "WHO SPEAKS FIRST", PAGE, [*items, *rest]
