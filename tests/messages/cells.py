"""What the cells of the golden wire say: every message as it is read, without its numbers and bytes."""

from __future__ import annotations

import json
import re
from pathlib import Path

from tests.messages.sources import Saying
from tests.wire.book import replay
from tests.wire.record import Record

GOLDEN = Path(__file__).with_name("cells.txt")
HEAD = """\
# Every message that a cell of the golden wire says, by code: kind (of an error its exit code), text, hint.
# XX are bytes, N numbers; a list of like things is one. Not written by hand: python -m tests.messages --cells --write
"""
PLACES = re.compile(r"(fake|tcp|can|modbus)(\+\w+)?://[^\s`':,)]+[^\s`':,.)]|fake:\w+")
BYTES = re.compile(r"\b[0-9A-F]{2}(?: [0-9A-F]{2})+\b|\b(?=[A-F]*\d)(?=\d*[A-F])[0-9A-F]{2,}h?\b|\b0x[0-9A-Fa-f]+")
NUMBERS = re.compile(r"(?:(?<!\w)-)?\b\d+(?:[.,]\d+)*")
LISTS = re.compile(r"\b(N|XX)(?:(?:, | and | or |-)\1\b)+")


def messages(record: Record) -> str:
    """A record's messages behind its exit code, as `replay` wants them."""
    prefix = "messages: "
    lines = record.parts.get("envelope", "").splitlines()  # nobody hears what a command says whose process dies
    return "\n".join(
        [
            f"exit {next(iter(record.codes), '')}",
            *(line.removeprefix(prefix) for line in lines if line.startswith(prefix)),
        ]
    )


def plain(text: str) -> str:
    """Without what differs from one device, line or moment to the next."""
    for what, instead in ((PLACES, "LINK"), (BYTES, "XX"), (NUMBERS, "N"), (LISTS, r"\1")):
        text = what.sub(instead, text)
    return text


def read(told: str) -> set[Saying]:
    """The messages of a cell."""
    first, *lines = told.splitlines()
    found = set()
    for line in lines:
        if not isinstance(one := json.loads(line), dict):
            continue
        kind = first.replace("exit", "error") if one["level"] == "error" else one["level"]
        found.add(Saying(one["code"], kind, plain(one["text"]), plain(one["hint"])))
    return found


def sayings(keys: list[str], jobs: int) -> list[Saying]:
    """What these cells say, sorted, each once."""
    return sorted(set().union(*map(read, replay(keys, jobs, messages).values())))
