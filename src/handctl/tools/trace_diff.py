"""Compare two transcripts by their requests and replies, not by time or chunks.

An exchange is a request with its answer, or something that came by itself. The exchanges of both sides are walked side
by side; where they part, the nearest place within a window where they meet again is taken. Knows no protocol.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import NamedTuple

from handctl.model.explainer import HOST, ExplainedBytes, Value
from handctl.tools.trace_read import FAMILY_EVENT, TranscriptRow

WINDOW = 200
"""Exchanges that are looked ahead for the place where both meet again."""


@dataclass(slots=True)
class Exchange:
    """key: what it is about, without values; request and answer in words; line where it begins."""

    key: str
    line: int
    request: str = ""
    answer: str = ""
    values: dict[str, Value] = field(default_factory=dict)
    complete: bool = True

    def same(self, other: Exchange) -> bool:
        """Whether both say the same."""
        return self.request == other.request and self.answer == other.answer

    @property
    def text(self) -> str:
        """Request and answer in one line."""
        return " -> ".join(filter(None, (self.request, self.answer)))


class Difference(NamedTuple):
    """One step of the comparison: in both ("same" or "changed"), or in one of them only."""

    status: str
    a: Exchange | None
    b: Exchange | None


def exchanges(told: Iterable[TranscriptRow]) -> Iterator[Exchange]:
    """Exchanges in the order of their requests."""
    line: deque[Exchange] = deque()
    asked: dict[str, Exchange] = {}
    for row in told:
        if row.comment:
            continue
        if row.unanswered is not None:
            waiting = asked.pop(row.unanswered.asks, None)
            if waiting is not None:
                waiting.complete, waiting.answer = True, "no reply"
        elif row.piece is None:
            # Where a scan looked counts as little as when.
            event = row.event.partition(" on ")[0] if row.event.startswith(FAMILY_EVENT) else row.event
            line.append(Exchange(f"event {event}", row.first.line, request=f"event: {event}"))
        elif row.request is not None and row.piece.answers in asked:
            waiting = asked.pop(row.piece.answers)
            waiting.complete, waiting.answer = True, row.meaning
            waiting.values |= _values(row.piece)
        else:
            line.append(_opened(row, row.piece, asked))
        while line and line[0].complete:
            yield line.popleft()
    yield from line


def _opened(row: TranscriptRow, piece: ExplainedBytes, asked: dict[str, Exchange]) -> Exchange:
    key = f"{piece.direction} {piece.title or piece.meaning}"
    if piece.direction != HOST:
        return Exchange(key, row.first.line, answer=row.meaning, values=_values(piece))
    opened = Exchange(key, row.first.line, request=row.meaning, values=_values(piece), complete=not piece.asks)
    if piece.asks:
        asked[piece.asks] = opened
    return opened


def _values(piece: ExplainedBytes) -> dict[str, Value]:
    return {value.name: value for value in piece.values}


def compare(a: Iterator[Exchange], b: Iterator[Exchange]) -> Iterator[Difference]:
    """The steps that lead through both. Memory: two windows."""
    left: deque[Exchange] = deque()
    right: deque[Exchange] = deque()
    while True:
        left.extend(islice(a, WINDOW - len(left)))
        right.extend(islice(b, WINDOW - len(right)))
        if not left or not right:
            break
        skip_a, skip_b = _meeting(left, right)
        for _ in range(skip_a):
            yield Difference("only-a", left.popleft(), None)
        for _ in range(skip_b):
            yield Difference("only-b", None, right.popleft())
        if left and right and left[0].key == right[0].key:
            one, other = left.popleft(), right.popleft()
            yield Difference("same" if one.same(other) else "changed", one, other)
    for rest in (left, a):
        yield from (Difference("only-a", single, None) for single in rest)
    for rest in (right, b):
        yield from (Difference("only-b", None, single) for single in rest)


def _meeting(left: deque[Exchange], right: deque[Exchange]) -> tuple[int, int]:
    """How many to pass over on each side until both are about the same: the fewest together."""
    if left[0].key == right[0].key:
        return 0, 0
    first: dict[str, int] = {}
    for place, exchange in enumerate(right):
        first.setdefault(exchange.key, place)
    best = (len(left), len(right))
    for place, exchange in enumerate(left):
        if place >= sum(best):
            break
        other = first.get(exchange.key)
        if other is not None and place + other < sum(best):
            best = (place, other)
    return best


def changes(one: Exchange, other: Exchange) -> list[tuple[str, str, str]]:
    """(name, in A, in B) of the values that differ; [] where the words differ otherwise."""
    names = [*one.values, *(name for name in other.values if name not in one.values)]
    found = []
    for name in names:
        a, b = (side.values.get(name) for side in (one, other))
        if a != b:
            found.append((name, _shown(a), _shown(b)))
    return found


def _shown(value: Value | None) -> str:
    if value is None:
        return "absent"
    return f"{value.value} {value.unit}" if value.unit else str(value.value)
