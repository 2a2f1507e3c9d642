"""How a hand speaks where the manual is silent: who begins, what asks, what ends an object (dossier 2, 6).

Says nothing of bytes that come, and knows no link. The defaults find out by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from handctl.devices.aidin.map import AIDIN
from handctl.devices.aidin.messages import LARGEST_OUT, LONGEST_END, NOTHING, TERMINATORS
from handctl.errors import UsageError

if TYPE_CHECKING:
    from handctl.frame.options import Settings

DEEPEST = 8
COMMANDS = frozenset(param.key.lower() for param in AIDIN if not param.readable)


class ExchangeMode(Enum):
    """Who speaks first."""

    UNKNOWN = "auto"
    STREAM = "stream"
    POLL = "poll"
    COMMAND = "command"  # answers commands only


@dataclass(frozen=True, slots=True)
class Way:
    """What is said about a hand.

    exchange  UNKNOWN = listen, then ask
    poll      the object that asks for feedback and commands nothing, without its terminator
    end       the terminator of every object
    """

    exchange: ExchangeMode = ExchangeMode.UNKNOWN
    poll: bytes = NOTHING
    end: bytes = TERMINATORS["newline"]


FIND_OUT = Way()


def way_of(settings: Settings) -> Way:
    """The Way of --exchange, --poll-json and --tx-terminator. Raises UsageError for what does not fit together."""
    exchange = ExchangeMode(settings.own.get("exchange") or "auto")
    text = settings.own.get("poll_json")
    if text is not None and exchange in (ExchangeMode.STREAM, ExchangeMode.COMMAND):
        raise UsageError(
            f"--poll-json cannot be combined with --exchange {exchange.value}, which sends no request",
            hint="leave one of them out. Nothing was sent.",
        )
    poll = NOTHING if text is None else neutral(text)
    return Way(exchange, poll, TERMINATORS[settings.own.get("tx_terminator") or "newline"])


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
        raise UsageError(f"--poll-json: {len(data)} bytes, the hand's buffer has 2048", hint="use a shorter object")
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
