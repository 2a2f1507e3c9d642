"""Settings for what the manual leaves open: who sends first, what requests feedback, what ends an object (dossier 2, 6).

Knows no link. By default, handctl detects all of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from handctl.devices.aidin.json_codec import DEEPEST, LARGEST_OUT, LONGEST_END, NEUTRAL, TERMINATORS
from handctl.devices.aidin.parameter_map import AIDIN
from handctl.errors import UsageError
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.model.command_settings import Settings

PERIOD = 0.02
"""Seconds between two objects that are sent."""
FIRST_ANSWER_SECONDS, ANSWER_SECONDS, STREAM_SECONDS = 0.5, 0.2, 1.0
"""After so much silence without --timeout the first answer to an empty object is missing; each later one; the next object of a stream."""
LISTEN = 0.3
SETTLE = 0.03
"""Seconds after an answer in which the other keys may follow in objects of their own."""
QUICK = 0.1 + SETTLE
"""An answer to an empty object is there by then; what comes later may be the next object of a slow stream."""
SLOWEST = 1.2
"""Seconds of listening, with nothing asked, in which a stream of 1 Hz shows itself."""
COMMANDS = frozenset(param.key.lower() for param in AIDIN if not param.readable)


class ExchangeMode(Enum):
    """Who sends first."""

    UNKNOWN = "auto"
    STREAM = "stream"
    POLL = "poll"
    COMMAND = "command"  # answers commands only


@dataclass(frozen=True, slots=True)
class ExchangeSettings:
    """How to talk to a hand.

    exchange  UNKNOWN = listen, then ask
    poll      the object that asks for feedback and commands nothing, without its terminator
    end       the terminator of every object
    """

    exchange: ExchangeMode = ExchangeMode.UNKNOWN
    poll: bytes = NEUTRAL
    end: bytes = TERMINATORS["newline"]


FIND_OUT = ExchangeSettings()


def exchange_settings_of(settings: Settings) -> ExchangeSettings:
    """What --exchange, --poll-json and --tx-terminator say. Raises UsageError for what does not fit together."""
    exchange = ExchangeMode(settings.own.get("exchange") or "auto")
    text = settings.own.get("poll_json")
    if text is not None and exchange in (ExchangeMode.STREAM, ExchangeMode.COMMAND):
        raise UsageError(
            f"--poll-json cannot be combined with --exchange {exchange.value}, which sends no request",
            hint="leave one of them out. Nothing was sent.",
        )
    poll = NEUTRAL if text is None else neutral(text)
    return ExchangeSettings(exchange, poll, TERMINATORS[settings.own.get("tx_terminator") or "newline"])


def neutral(text: str) -> bytes:
    """An object of the user that asks for feedback, compact and in ASCII.

    Raises UsageError for a text that is not a JSON object, and for one with a key that commands: a mode moves the hand or
    drops what it holds, and never provokes a status.
    """
    from json import dumps, loads

    try:
        content = loads(text, parse_constant=_no_number)
        data = dumps(content, separators=(",", ":"), allow_nan=False).encode("ascii")
    except (ValueError, RecursionError) as exc:
        raise UsageError(f"--poll-json {text[:40]!r} is not JSON: {exc}", hint='e.g. {"get":1}') from exc
    if not isinstance(content, dict):
        raise UsageError(f"--poll-json {text[:40]!r} is not a JSON object", hint='e.g. {"get":1}')
    commanding = sorted(_keys(content) & COMMANDS)
    if commanding:
        raise UsageError(
            f"--poll-json: {', '.join(commanding)} would command the hand with each request",
            hint="leave command keys out of the poll object (aidin, Command keys). Nothing was sent.",
            code="commanding-poll",
        )
    if len(data) + LONGEST_END > LARGEST_OUT:
        raise UsageError(
            f"--poll-json: {plural(len(data), 'byte')}, but the hand's buffer holds 2048", hint="use a shorter object"
        )
    return data


def _no_number(name: str) -> None:
    raise ValueError(f"{name} is not a JSON number")


def _keys(content: object, depth: int = 0) -> set[str]:
    """All keys at any depth, in lower case and without what a careless parser might pass over."""
    if depth > DEEPEST:
        raise UsageError("--poll-json: nested too deeply", hint="use a flat object, as the hand does")
    if isinstance(content, list):
        return set().union(*(_keys(single, depth + 1) for single in content))
    if not isinstance(content, dict):
        return set()
    own = {key.strip(" \t\r\n\0").lower() for key in content}
    return own.union(*(_keys(single, depth + 1) for single in content.values()))


# -- who speaks first: the table that a connect runs on, and the section of the manual page that shows it -----------


LISTENED, ASKED, AGAIN, DOUBTED = "listened", "asked", "again", "doubted"
STATES = {
    LISTENED: f"connected: listen for {LISTEN:g} s, or with `--exchange stream` for {STREAM_SECONDS:g} s or --timeout. An object that has begun may finish",
    ASKED: "the empty object, or the one in `--poll-json`, has been sent. `--exchange poll` starts here",
    AGAIN: "it has been sent once more. Skipped with `--retries 0`",
    DOUBTED: f"the reply may be the next object of a slow stream: listen for {SLOWEST:g} s and send nothing",
}
FEEDBACK, LATE, DAMAGED, OTHER, NOTHING = "feedback", "late", "damaged", "other", "nothing"
SEEN = {
    FEEDBACK: "an object with feedback keys",
    LATE: f"the same, but more than {QUICK:g} s after the request. Only with `--exchange auto`",
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


UNASKED = {OTHER: STRANGER, NOTHING: SILENT}
"""The end instead of ASKED or AGAIN where nothing may be sent any more: `--exchange stream`, a dry run, `--retries 0`."""
_ANSWERED = {FEEDBACK: ANSWERS, LATE: DOUBTED, DAMAGED: STRANGER}
NEXT = {
    LISTENED: {FEEDBACK: STREAMS, DAMAGED: STRANGER, OTHER: ASKED, NOTHING: ASKED},
    ASKED: {**_ANSWERED, OTHER: AGAIN, NOTHING: AGAIN},
    AGAIN: {**_ANSWERED, **UNASKED},
    DOUBTED: {FEEDBACK: STREAMS, NOTHING: ANSWERS},
}
"""State -> what is seen there -> the next state."""

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
        (state, f"{text}.", [f"{seen:<12}{after}" for seen, after in NEXT[state].items()])
        for state, text in STATES.items()
    ]
    rest: list[tuple[str, str, list[str]]] = [(name, f"{text}.", []) for name, text in (ENDS | SEEN).items()]
    return "WHO SPEAKS FIRST", PAGE, [*items, *rest]
