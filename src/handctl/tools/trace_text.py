"""Told rows for people: one line a row on a pipe, never cut; on a terminal wrapped, the bytes below in one line."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import Any

from handctl.model.piece import HOST, SIDES
from handctl.sentence import plural
from handctl.tools.trace_read import Stamp, Statistics, Told, wire

NARROW = 72
INDENT = 26
BAR = 30


def row_text(told: Told, width: int | None) -> str:
    """One row as lines of text; `width` None = a pipe."""
    if told.comment:
        return told.comment
    mark = "!" if told.kind == "event" else " " if told.piece is None else ">" if told.piece.direction == HOST else "<"
    flag = "*" if told.problem else " "
    trip = "" if told.round_trip is None else f"+{told.round_trip * 1000:.3f} ms"
    head = f"{moment(told.first)} {mark}{flag}{trip:>11} "
    data = "" if told.piece is None else wire(told.piece)
    if width is None:
        return f"{head} {told.meaning}" + (f"  [{data}]" if data else "")
    lines = _wrapped(head, told.meaning, width)
    if data:
        indent = INDENT if width >= NARROW else 4
        lines.append(" " * indent + _elided(data, width - indent))
    return "\n".join(lines)


def moment(stamp: Stamp) -> str:
    """The time, or the line where there is none."""
    return f"{stamp.t:11.6f}" if stamp.t is not None else f"{f'line {stamp.line}':>11}"


def _wrapped(head: str, text: str, width: int) -> list[str]:
    if width < NARROW:
        return [head.rstrip(), *textwrap.wrap(text, max(20, width - 2), initial_indent="  ", subsequent_indent="  ")]
    indent = " " * INDENT
    return textwrap.wrap(text, width, initial_indent=f"{head:<{INDENT}}", subsequent_indent=indent) or [head]


def _elided(data: str, width: int) -> str:
    if len(data) <= width:
        return data
    head, bracket, rest = data.rpartition("] ")
    words = rest.split()
    tail = f" … ({plural(len(words), 'byte')})"
    room = max(0, (width - len(head + bracket) - len(tail) + 1) // 3)
    return f"{head}{bracket}{' '.join(words[:room])}{tail}"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def statistics_text(statistics: Statistics) -> Iterator[str]:
    """The closing lines."""
    row: dict[str, Any] = statistics.as_row()
    rates = row["bytes_per_second"]
    yield ""
    yield f"device      {row['family']}"
    for side in SIDES:
        rate = f", {rates[side]:g} bytes/s" if rates else ""
        stray = f", {row['stray_bytes'][side]} of them in no frame" if row["stray_bytes"][side] else ""
        yield f"{side:<11} {_count(row['frames'][side], 'frame')}, {_count(row['bytes'][side], 'byte')}{stray}{rate}"
    yield f"requests    {row['requests']}, {row['answered']} answered"
    if row["problems"]:
        yield f"problems    {', '.join(f'{code} {count}' for code, count in sorted(row['problems'].items()))}"
    trips = row["round_trip"]
    if not trips["count"]:
        return
    late = f", {trips['late']} longer than twice the median" if trips["late"] else ""
    yield f"round trip  min {trips['min_ms']:g}, median {trips['median_ms']:g}, max {trips['max_ms']:g} ms{late}"
    most = max(count for _, count in trips["histogram"])
    for edge, count in trips["histogram"]:
        label = f"to {edge:g} ms" if edge is not None else "longer"
        yield f"  {label:>12} {'#' * max(1 if count else 0, round(BAR * count / most)):<{BAR}} {count}".rstrip()
