"""The page of `handctl ekso gait --page`: curves over the cycle, stride times, refused strides, figures, settings."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from math import floor, log10
from typing import Any, NamedTuple

from handctl.charts.curves import STYLE as CURVE_STYLE
from handctl.charts.curves import Box, escape, moment, ticks, times
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
WIDE, HIGH, LEFT, TOP, FOOT = 400, 210, 52, 30, 34
"""A picture of curves or of a histogram, and the room around what is drawn."""
LONG, ROW, NAME = 960, 24, 52
"""A timeline: its width, a row, the room for the name of a row."""
MOST_BINS = 25
WARM = (1, 0, 3, 4, 5, 6, 7)
"""Tones of what is refused: no green."""
STYLE = CURVE_STYLE + (
    ".cycles{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,24rem),1fr));gap:.6rem}"
    ".cycles polygon,.cycles rect{stroke:none}polygon{fill-opacity:.16}.second{stroke-dasharray:6 3}polyline{stroke-width:1.8}"
    "rect.second{fill-opacity:.55}.well{fill:var(--line,#d4d9df)}"
)


class Recording(NamedTuple):
    """A log, what it shows, and its name on the page: "" = it is the only one."""

    name: str
    log: LogFile
    walk: Walk


def page(found: Sequence[Recording], figures: Table) -> str:
    """The whole page; `figures` is the table that the command shows."""
    title = "Gait: " + " and ".join(os.path.basename(one.log.path) for one in found)
    return plain_page(title, _body(found, figures), STYLE)


def _body(found: Sequence[Recording], figures: Table) -> Iterator[str]:
    if any(one.log.simulated for one in found):
        yield '<p class="mark">Simulated: these values are not from a device</p>\n'
    yield f'<p class="note">{NOT_A_DIAGNOSIS}</p>\n'
    yield facts([(one.name or "log", _about(one)) for one in found])
    remarks = [(one, remark) for one in found for remark in (*_of_log(one.log), *one.walk.remarks)]
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
    told += [
        f"{number} {what} ({why})" if why else f"{plural(number, 'stride')} {what}"
        for what, why, number in walk.verdicts
    ]
    return ", ".join(filter(None, told))


def _of_log(log: LogFile) -> list[str]:
    """Why the log is incomplete. Without its folder: the page may be passed on."""
    return [remark.replace(log.path, os.path.basename(log.path)) for remark in log.remarks()]


def _span(walk: Walk) -> tuple[float, float]:
    known = [stretch.t for stretch in walk.stretches if stretch.t]
    return (min(t[0] for t in known), max(t[-1] for t in known)) if known else (0.0, 0.0)


def _by_feet(found: Sequence[Recording], title: str) -> Iterator[tuple[str, list[tuple[str, Walk, str]]]]:
    """The title of each picture of what the feet do, and (name, walk, side) in it: of one log both feet, of two each foot."""
    if len(found) == 1:
        yield title, [(side, found[0].walk, side) for side in SIDES]
        return
    for side in SIDES:
        yield f"{side.capitalize()} {title.lower()}", [(one.name, one.walk, side) for one in found]


def _curves(found: Sequence[Recording]) -> Iterator[str]:
    for signal, title in CURVES:
        for head, members in _by_feet(found, title):
            yield bands(head, [Band(name, curve(walk, side, signal)) for name, walk, side in members])


def _times(found: Sequence[Recording]) -> Iterator[str]:
    for head, members in _by_feet(found, "Stride time"):
        groups = [(name, [one.duration for one in walk.taken if one.side == side]) for name, walk, side in members]
        yield histogram(head, "s", groups, 0.02)


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


# -- pictures of what repeats: curves over its cycle with their deviation, a histogram, a timeline -------------------


class Band(NamedTuple):
    """One curve: mean and deviation at equal steps from the begin of the cycle to its end."""

    name: str
    points: Sequence[tuple[float, float]]


def bands(title: str, curves: Sequence[Band]) -> str:
    """Curves over the cycle; "" where there is none."""
    drawn = [(tone, band) for tone, band in enumerate(curves) if band.points]
    if not drawn:
        return ""
    low = min(mean - spread for _, band in drawn for mean, spread in band.points)
    high = max(mean + spread for _, band in drawn for mean, spread in band.points)
    room = (high - low) / 20 or 1.0
    box = Box(LEFT, TOP, WIDE - LEFT - 20, HIGH - TOP - FOOT, 100, low - room, high + room)
    pieces = _values(box)
    for tone, (_, points) in drawn:
        step = 100 / max(1, len(points) - 1)
        upper = [f"{box.x(at * step):.1f},{box.y(mean + spread):.1f}" for at, (mean, spread) in enumerate(points)]
        lower = [f"{box.x(at * step):.1f},{box.y(mean - spread):.1f}" for at, (mean, spread) in enumerate(points)]
        middle = " ".join(f"{box.x(at * step):.1f},{box.y(mean):.1f}" for at, (mean, _) in enumerate(points))
        pieces.append(f'<polygon class="c{tone}" points="{" ".join([*upper, *reversed(lower)])}"/>')
        pieces.append(f'<polyline class="c{tone}{_second(tone)}" points="{middle}"/>')
    pieces += [_below(box, box.x(at), f"{at} %") for at in (0, 20, 40, 60, 80, 100)]
    told = "; ".join(f"{band.name} {_ends(band.points)}" for _, band in drawn)
    return _picture(title, [band.name for band in curves], pieces, told)


def histogram(title: str, unit: str, groups: Sequence[tuple[str, Sequence[float]]], fine: float) -> str:
    """How often which value came, in bins no finer than `fine` that begin at round values, an empty one at each end; "" without values."""
    values = [value for _, group in groups for value in group]
    if not values:
        return ""
    sizes = (fine * step * 10**power for power in range(9) for step in (1, 2, 5))
    size = next(size for size in sizes if max(values) - min(values) <= MOST_BINS * size + 1e-9)
    first = floor(min(values) / size + 1e-6) - 1
    bins = floor(max(values) / size + 1e-6) - first + 2
    counts = [[0] * bins for _ in groups]
    for number, (_, group) in enumerate(groups):
        for value in group:
            counts[number][floor(value / size + 1e-6) - first] += 1
    most = max(map(max, counts))
    box = Box(LEFT, TOP, WIDE - LEFT - 20, HIGH - TOP - FOOT, bins * size, 0, most)
    pieces = _values(box)
    broad = box.width / bins / len(groups)
    for number, group_counts in enumerate(counts):
        for at, count in enumerate(group_counts):
            if count:
                x, y = box.x(at * size) + number * broad, box.y(count)
                pieces.append(
                    f'<rect class="c{number}{_second(number)}" x="{x:.1f}" y="{y:.1f}" width="{max(1, broad - 1):.1f}" '
                    f'height="{box.top + box.height - y:.1f}"><title>{count} from {(first + at) * size:.3f} {escape(unit)}</title></rect>'
                )
    digits = max(0, -floor(log10(size))) if size < 1 else 0
    for at in range(0, bins, max(1, -(-bins // 6))):
        pieces.append(_below(box, box.x(at * size), f"{(first + at) * size:.{digits}f}"))
    told = "; ".join(f"{name} {len(group)}" for name, group in groups)
    return _picture(f"{title} [{unit}]", [name for name, _ in groups], pieces, told, bars=True)


def timeline(title: str, rows: Sequence[tuple[str, Sequence[tuple[float, float, str]]]], reasons: Sequence[str], begin: float, end: float) -> str:  # fmt: skip
    """Rows of (from, to, reason), "" = nothing was wrong; a colour for each reason."""
    seconds = end - begin
    box = Box(NAME, 6, LONG - NAME - 14, len(rows) * ROW, seconds, 0, 1)
    pieces = []
    for number, (name, spans) in enumerate(rows):
        top = box.top + number * ROW
        pieces.append(f'<text class="small end" x="{NAME - 6}" y="{top + 15}">{escape(name)}</text>')
        for first, last, why in _joined(spans, seconds / box.width):
            x = box.x(first - begin)
            tone = _tone(reasons.index(why)) if why else "well"
            said = f"{why}: {first:.2f} s to {last:.2f} s" if why else f"counted, {first:.2f} s to {last:.2f} s"
            pieces.append(
                f'<rect class="{tone}" x="{x:.1f}" y="{top}" width="{max(1.0, box.x(last - begin) - x - 0.5):.1f}" '
                f'height="{ROW - 6}"><title>{escape(said)}</title></rect>'
            )
    pieces += [_below(box, box.x(t), moment(t, seconds)) for t in times(seconds)]
    height = box.top + box.height + 22
    legend = "".join(
        f'<svg viewBox="0 0 10 10" style="display:inline-block;width:.7em;height:.7em" aria-hidden="true">'
        f'<rect class="{tone}" width="10" height="10"/></svg> {escape(why)} &nbsp; '
        for tone, why in [("well", "counted"), *((_tone(at), why) for at, why in enumerate(reasons))]
    )
    return (
        f'<p class="note">{legend}</p>\n<div class="scroll"><svg viewBox="0 0 {LONG} {height:g}" role="img" '
        f'aria-label="{escape(title)}">{"".join(pieces)}</svg></div>\n'
    )


def _joined(spans: Sequence[tuple[float, float, str]], pixel: float) -> list[tuple[float, float, str]]:
    """The spans; of those narrower than some pixels neighbours of one kind become one, so that a page of hours stays small."""
    found: list[tuple[float, float, str]] = []
    for first, last, why in spans:
        if found and found[-1][2] == why and first - found[-1][1] < pixel and last - first < 3 * pixel:
            found[-1] = (found[-1][0], last, why)
        else:
            found.append((first, last, why))
    return found


def _tone(reason: int) -> str:
    return f"c{WARM[reason % len(WARM)]}"


def _second(tone: int) -> str:
    """Every other curve is broken: paper may have no colours."""
    return " second" if tone % 2 else ""


def _ends(points: Sequence[tuple[float, float]]) -> str:
    means = [mean for mean, _ in points]
    return f"{min(means):.4g} to {max(means):.4g}"


def _values(box: Box) -> list[str]:
    pieces = []
    for value in ticks(box.low, box.high, 4):
        y = box.y(value)
        pieces.append(f'<path class="axis" d="M{box.left} {y:.1f}H{box.left + box.width}"/>')
        pieces.append(f'<text class="small end" x="{box.left - 5}" y="{y + 4:.1f}">{value:.6g}</text>')
    return pieces


def _below(box: Box, x: float, text: str) -> str:
    return f'<text class="small mid" x="{x:.1f}" y="{box.top + box.height + 15:.1f}">{escape(text)}</text>'


def _picture(title: str, names: Sequence[str], pieces: Sequence[str], told: str, bars: bool = False) -> str:
    x = 14 + 8 * len(title)
    head = [f'<text class="head" x="0" y="16">{escape(title)}</text>']
    for tone, name in enumerate(names):
        shape = f'rect x="{x}" y="6" width="22" height="11"' if bars else f'path stroke-width="3" d="M{x} 12h22"'
        head.append(f'<{shape} class="c{tone}{_second(tone)}"/>')
        head.append(f'<text x="{x + 26}" y="16">{escape(name)}</text>')
        x += 42 + 7 * len(name)
    label = escape(f"{title}: {told}")
    return f'<figure><svg viewBox="0 0 {WIDE} {HIGH}" role="img" aria-label="{label}">{"".join((*head, *pieces))}</svg></figure>\n'
