"""The page of `handctl ekso gait --page`: curves over the cycle, stride times, refused strides, figures, settings."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from handctl import __version__
from handctl.charts.curves import escape
from handctl.charts.cycles import STYLE, Band, bands, histogram, timeline
from handctl.devices.ekso.gait import SIDES, Walk, curve
from handctl.devices.ekso.log_reader import LogFile
from handctl.model.result import Grid, Table
from handctl.report.html import facts, plain_page, table
from handctl.wording import plural, sentence

CURVES = (("knee", "Knee [deg]"), ("hip", "Hip [deg]"), ("toe", "Toe [raw counts]"), ("heel", "Heel [raw counts]"))
MOST_REFUSED = 200
"""Strides in the table of those that are not counted; `--steps` writes all."""
NOT_A_DIAGNOSIS = (
    "The figures describe the recording. They are not a diagnosis. Strides are found from the foot pressures; "
    "the device's State word is not used, because its codes for walking are not known."
)


class Recording(NamedTuple):
    """A log, what it shows, and its name on the page: "" = it is the only one."""

    name: str
    log: LogFile
    walk: Walk


def page(found: Sequence[Recording], figures: Table) -> str:
    """The whole page; `figures` is the table that the command shows."""
    title = "Gait: " + " and ".join(os.path.basename(one.log.path) for one in found)
    return plain_page(title, _body(found, figures), STYLE, __version__)


def _body(found: Sequence[Recording], figures: Table) -> Iterator[str]:
    if any(one.log.simulated for one in found):
        yield '<p class="mark">Simulated: these values are not from a device</p>\n'
    yield f'<p class="note">{NOT_A_DIAGNOSIS}</p>\n'
    yield facts([(one.name or "log", _about(one)) for one in found])
    remarks = [(one, remark) for one in found for remark in one.walk.remarks]
    if remarks:
        items = "".join(
            f"<li>{escape(sentence(f'{one.name}: ' * bool(one.name) + remark))}</li>" for one, remark in remarks
        )
        yield f'<ul class="warning">{items}</ul>\n'
    yield "<h2>Figures</h2>\n"
    yield table(_grid(figures), "Figures")
    yield "<h2>Curves over the gait cycle</h2>\n"
    yield '<p class="note">From one contact of the foot (0 %) to its next one (100 %), counted strides only: mean, and one standard deviation on both sides.</p>\n'
    yield f'<div class="cycles">{"".join(_curves(found))}</div>\n'
    yield "<h2>Stride times</h2>\n"
    yield f'<div class="cycles">{"".join(_times(found))}</div>\n'
    yield "<h2>Strides, counted and not counted</h2>\n"
    reasons = sorted({step.refused for one in found for step in one.walk.steps if step.refused})
    for one in found:
        yield from _refused(one, reasons)
    yield from _settings(found)


def _about(one: Recording) -> str:
    walk = one.walk
    rows = sum(len(stretch.t) for stretch in walk.stretches)
    begin, end = _span(walk)
    began = ((one.log.sidecar or {}).get("start") or {}).get("utc") or ""
    told = [os.path.basename(one.log.path), str(began), f"{end - begin:.1f} s", plural(rows, "row")]
    told.append(f"{plural(len(walk.taken), 'stride')} counted")
    told += [
        f"{number} not counted ({why})"
        for why, number in Counter(step.refused for step in walk.steps if step.refused).items()
    ]
    told += [f"{number} doubtful ({why})" for why, number in Counter(s.doubt for s in walk.taken if s.doubt).items()]
    return ", ".join(filter(None, told))


def _span(walk: Walk) -> tuple[float, float]:
    known = [stretch.t for stretch in walk.stretches if stretch.t]
    return (min(t[0] for t in known), max(t[-1] for t in known)) if known else (0.0, 0.0)


def _curves(found: Sequence[Recording]) -> Iterator[str]:
    for signal, title in CURVES:
        if len(found) == 1:
            yield bands(title, [Band(side, curve(found[0].walk, side, signal)) for side in SIDES])
            continue
        for side in SIDES:
            yield bands(
                f"{side.capitalize()} {title.lower()}", [Band(one.name, curve(one.walk, side, signal)) for one in found]
            )


def _times(found: Sequence[Recording]) -> Iterator[str]:
    def group(one: Recording, side: str) -> list[float]:
        return [step.duration for step in one.walk.taken if step.side == side]

    if len(found) == 1:
        yield histogram("Stride time", "s", [(side, group(found[0], side)) for side in SIDES], 0.02)
        return
    for side in SIDES:
        yield histogram(f"{side.capitalize()} stride time", "s", [(one.name, group(one, side)) for one in found], 0.02)


def _refused(one: Recording, reasons: Sequence[str]) -> Iterator[str]:
    walk = one.walk
    begin, end = _span(walk)

    def until(step: Any) -> float:  # the last contact has no end
        return step.end if step.end == step.end else end

    rows = [
        (side, [(step.contact, until(step), step.refused) for step in walk.steps if step.side == side])
        for side in SIDES
    ]
    if one.name:
        yield f"<h3>{escape(one.name)}</h3>\n"
    yield timeline(f"Strides of {os.path.basename(one.log.path)}", rows, reasons, begin, end)
    refused = [step for step in walk.steps if step.refused]
    lines = tuple(
        (str(step.segment), step.side, f"{step.contact:.2f}", f"{until(step) - step.contact:.2f}", step.refused)
        for step in refused[:MOST_REFUSED]
    )
    if lines:
        more = len(refused) - len(lines)
        notes = (f"{more} more are not listed here: --steps FILE writes all of them.",) if more else ()
        heads = ("Segment", "Side", "Contact [s]", "Duration [s]", "Why it is not counted")
        yield table(Grid(heads, lines, right=frozenset({0, 2, 3}), notes=notes), "Strides that are not counted")


def _settings(found: Sequence[Recording]) -> Iterator[str]:
    """The settings of each log, those that differ first and marked."""
    known: list[dict[str, Any]] = [(one.log.sidecar or {}).get("settings_before") or {} for one in found]
    names = list(dict.fromkeys(name for settings in known for name in settings))
    if not names:
        return
    lines = []
    for name in names:
        texts = [_told(settings.get(name)) for settings in known]
        lines.append((name, *texts, *(["differs" if len(set(texts)) > 1 else ""] if len(found) > 1 else [])))
    lines.sort(key=lambda line: line[-1] != "differs")
    heads = ("Setting", *(one.name or "Value" for one in found), *([""] if len(found) > 1 else []))
    yield "<h2>Settings</h2>\n"
    yield table(Grid(heads, tuple(lines)), "Settings")


def _told(setting: dict[str, Any] | None) -> str:
    if setting is None:
        return "not known"
    value = setting.get("label") if setting.get("label") is not None else setting.get("value")
    return " ".join(str(part) for part in (value, setting.get("unit")) if part is not None)


def _grid(figures: Table) -> Grid:
    columns = figures.columns or ()
    rows = [row for row in figures.rows if row["name"] != "strides"]  # which the page says of each log
    lines = tuple(
        tuple("" if row.get(column.key) is None else str(row[column.key]) for column in columns) for row in rows
    )
    right = frozenset(at for at, column in enumerate(columns) if column.right)
    return Grid(tuple(column.title for column in columns), lines, right=right)
