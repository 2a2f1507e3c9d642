"""A report as one HTML page: no script, nothing from outside, for a phone, a dark screen and A4 paper alike.

Everything that is not written in this file passes through `escape`. Knows what a report says, not where it comes from.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from itertools import chain

from handctl import __version__
from handctl.charts.curves import Curve, draw, escape, unchanged
from handctl.errors import HandctlError
from handctl.families import FAMILIES
from handctl.files import PAGE, PAGE_DATA, in_json
from handctl.model.result import Cell, Grid, Message
from handctl.wording import sentence


@dataclass(slots=True)
class Report:
    """What the page says; texts are final (redacted already), not yet escaped.

    problems   (section, error) in the order they happened; then the page is incomplete
    curves     quantity -> its elements; `words` are the quantities whose numbers are codes
    service    the complaint, what was done about it, and what is to be done next, where it was a service
    outlines   pictures of the device, finished SVG
    data       the same for a program, JSON
    masked     what the device sent is left out of the transcript
    missing    why a section is empty, by its name
    """

    kind: str
    command: str
    made: str
    simulated: bool
    facts: list[tuple[str, str]] = field(default_factory=list)
    problems: list[tuple[str, HandctlError]] = field(default_factory=list)
    findings: list[Message] = field(default_factory=list)
    checks: list[Grid] = field(default_factory=list)
    service: list[Grid] = field(default_factory=list)
    status: list[Grid] = field(default_factory=list)
    dump: list[Grid] = field(default_factory=list)
    curves: dict[str, list[Curve]] = field(default_factory=dict)
    words: frozenset[str] = frozenset()
    outlines: list[str] = field(default_factory=list)
    data: dict[str, object] = field(default_factory=dict)
    watched: str = ""
    seconds: float = 0.0
    counters: list[tuple[str, str]] = field(default_factory=list)
    environment: list[tuple[str, str]] = field(default_factory=list)
    transcript: list[str] = field(default_factory=list)
    privacy: str = ""
    masked: bool = False
    missing: dict[str, str] = field(default_factory=dict)


LEVELS = {"error": "Error", "warning": "Warning", "info": "Note"}
FOLDED = ("Dump", "Counters", "Environment", "Transcript")
"""Sections that are shut where nothing is wrong, so that the page is one."""
SECTIONS = ("Findings", "Status", "Watch", "Dump", "Counters", "Environment", "Transcript")
POLICY = "; ".join(("default-src 'none'", "style-src 'unsafe-inline'", "base-uri 'none'", "form-action 'none'"))
"""The browser itself refuses anything from outside."""


def _section(name: str, body: str, *, shut: bool) -> str:
    """A section; one that is `shut` shows its body when its heading is clicked, and is not printed."""
    key = name.lower()
    head = f'<h2 id="h-{key}">{name}</h2>\n'
    inner = f"<details><summary>{head}</summary>{body}</details>" if shut else head + body
    return f'<section id="{key}" aria-labelledby="h-{key}">{inner}</section>\n'


def plain_page(title: str, body: Iterable[str], style: str) -> str:
    """A page of finished pieces below a title."""
    pieces = "".join(f'<div class="scroll">{piece}</div>\n' if piece.startswith("<svg") else piece for piece in body)
    return f'{_head(title, style)}<h1>{escape(title)}</h1>\n<main class="wide">\n{pieces}</main>\n</body>\n</html>\n'


def _head(title: str, more: str = "") -> str:
    style = files(__package__).joinpath("page.css").read_text(encoding="utf-8")
    return (
        f'{PAGE}\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="referrer" content="no-referrer">\n'
        f'<meta name="generator" content="handctl {escape(__version__)}">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style}{more}</style>\n</head>\n<body>\n"
    )


def page(report: Report) -> str:
    title = f"{_name(report.kind)}: service report, {report.made}"
    head = ("Service",) if report.service else ()
    bodies = (
        *("".join(table(grid, name) for grid in report.service) for name in head),
        _findings(report),
        _outlines(report) + _grids(report.status, report, "Status"),
        _watch(report),
        _grids(report.dump, report, "Dump"),
        facts(report.counters),
        facts(report.environment),
        _transcript(report),
    )
    wrong = any(found.level != "info" for found in report.findings) or bool(report.problems)
    sections = "".join(
        _section(name, body, shut=name in FOLDED and not wrong)
        for name, body in zip((*head, *SECTIONS), bodies, strict=True)
    )
    links = "".join(f'<li><a href="#{name.lower()}">{name}</a></li>' for name in (*head, *SECTIONS))
    return (
        f"{_head(title)}"
        f'{_header(report)}<nav aria-label="Sections"><ul>{links}</ul></nav>\n<main>\n{sections}</main>\n'
        f'<footer><p class="note">This page is {escape(report.privacy)}.</p></footer>\n{_data(report)}</body>\n</html>\n'
    )


def _name(kind: str) -> str:
    """The device, without its wires: ``Inspire EH55BF1 exoskeleton hand``."""
    return FAMILIES[kind].help.partition(" (")[0] if kind in FAMILIES else kind


def _header(report: Report) -> str:
    mark = '<p class="mark">Simulated: these values are not from a device</p>\n' if report.simulated else ""
    known = [*report.facts, ("made", report.made), ("tool", f"handctl {__version__} ({report.command})")]
    return f"<header>\n{mark}<h1>{escape(_name(report.kind))}: service report</h1>\n{facts(known)}{_problems(report)}</header>\n"


def _problems(report: Report) -> str:
    if not report.problems:
        return ""
    items = "".join(_item(f"<strong>{escape(section)}</strong>:", error) for section, error in report.problems)
    return f'<div class="problems"><p class="error">Incomplete: parts of the device could not be read</p><ul>{items}</ul></div>\n'


def _item(head: str, said: HandctlError | Message) -> str:
    hint = f'<br><span class="note">Next: {escape(sentence(said.hint))}</span>' if said.hint else ""
    return f"<li>{head} {escape(sentence(said.text))} [<code>{escape(said.code)}</code>]{hint}</li>"


def _findings(report: Report) -> str:
    items = "".join(
        _item(f'<span class="{escape(found.level)}">{LEVELS.get(found.level, "Note")}:</span>', found)
        for found in report.findings
    )
    if not items and "Findings" in report.missing:
        return _empty(report, "Findings")
    said = f"<ul>{items}</ul>\n" if items else ""
    if not items and not report.checks:
        said = "<p>Nothing unhealthy was found.</p>\n"
    return said + "".join(table(grid) for grid in report.checks)


def _outlines(report: Report) -> str:
    return f'<div class="outlines">{"".join(report.outlines)}</div>\n' if report.outlines else ""


def _data(report: Report) -> str:
    """The report for a program: a script that no browser runs. Nothing in it can end it, or act on who reads the file."""
    if not report.data:
        return ""
    text = in_json(json.dumps(report.data, ensure_ascii=False))
    acting = [letter for letter in set(text) if letter in "<>&" or not letter.isprintable()]
    escapes = {ord(one): "\\u" + one.encode("utf-16-be").hex(" ", 2).replace(" ", "\\u") for one in acting}
    return f"<{PAGE_DATA}>{text.translate(escapes)}</script>\n"


def _empty(report: Report, section: str) -> str:
    return f'<p class="note">{escape(report.missing.get(section, "nothing"))}</p>\n'


def facts(found: Iterable[tuple[str, str]]) -> str:
    """Names with their texts."""
    rows = "".join(f"<dt>{escape(name)}</dt><dd>{escape(text)}</dd>" for name, text in found)
    return f"<dl>{rows}</dl>\n"


# -- tables -------------------------------------------------------------------------------------------------------


def _grids(grids: Sequence[Grid], report: Report, section: str) -> str:
    return "".join(table(grid, f"{section} {number}") for number, grid in enumerate(grids, 1)) or _empty(
        report, section
    )


def table(grid: Grid, name: str = "Checks") -> str:
    """A table that scrolls where it is wider than the page."""
    right = [' class="right"' if position in grid.right else "" for position in range(len(grid.headings))]
    heads = "".join(
        f'<th scope="col"{side}>{escape(text)}</th>' for text, side in zip(grid.headings, right, strict=True)
    )
    lines = "".join(f"<tr>{_cells(line, grid)}</tr>\n" for line in grid.lines)
    caption = f"<caption>{escape(grid.title)}</caption>" if grid.title else ""
    notes = "".join(f'<p class="note">{escape(note)}</p>\n' for note in grid.notes)
    return (
        f'<div class="scroll" role="region" tabindex="0" aria-label="{escape(grid.title or name)}">'
        f"<table>{caption}<thead><tr>{heads}</tr></thead>\n<tbody>{lines}</tbody></table></div>\n{notes}"
    )


def _cells(line: Sequence[str | Cell], grid: Grid) -> str:
    cells = []
    for position, cell in enumerate(line):
        text, tone = (cell.text, cell.tone) if isinstance(cell, Cell) else (cell, "")
        names = " ".join(filter(None, (tone, "right" if position in grid.right else "")))
        cells.append(f"<td{f' class={chr(34)}{escape(names)}{chr(34)}' if names else ''}>{escape(text)}</td>")
    return "".join(cells)


# -- curves and bytes ---------------------------------------------------------------------------------------------


def _watch(report: Report) -> str:
    """The curves that moved; all others in a line."""
    if not report.curves:
        return _empty(report, "Watch")
    parts = [f'<p class="note">{escape(report.watched)} Each picture has its own scale.</p>\n']
    alone = [group[0] for name, group in report.curves.items() if len(group) == 1 and name not in report.words]
    parts.append(_plots([curve for curve in alone if curve.moved], report.seconds))
    for name, group in report.curves.items():
        moved = [curve for curve in group if curve.moved and curve not in alone]
        if moved:
            parts.append(f"<h3>{escape(_united(group[0]))}</h3>\n")
            parts.append(_words(moved) if name in report.words else _plots(moved, report.seconds))
    if still := unchanged(chain(*report.curves.values()), report.words):
        parts.append(f'<p class="note">Unchanged: {escape(still)}.</p>\n')
    return "".join(parts)


def _united(curve: Curve) -> str:
    """A quantity with its unit."""
    return f"{curve.name} [{curve.unit}]" if curve.unit else curve.name


def _plots(group: Sequence[Curve], seconds: float) -> str:
    figures = "".join(
        f"<figure>{draw(curve, seconds)}<figcaption>{escape(curve.part or _united(curve))}"
        f"<span>{escape(curve.summary)}</span><span>{escape(curve.meaning)}</span></figcaption></figure>\n"
        for curve in group
    )
    return f'<div class="plots">{figures}</div>\n' if figures else ""


def _words(group: Sequence[Curve]) -> str:
    """Codes and bits: what they meant, in the order they came."""
    return facts((curve.part or curve.name, ", ".join(curve.labels) or curve.summary) for curve in group)


def _transcript(report: Report) -> str:
    if not report.transcript:
        return _empty(report, "Transcript")
    said = "> is the host, < the device. Times are seconds since the link was opened. "
    said += (
        "The bytes of the device are left out because they hold ids. --include-ids keeps them."
        if report.masked
        else "-p replay:FILE plays it back."
    )
    return f'<p class="note">{escape(said)}</p>\n<pre>{escape(chr(10).join(report.transcript))}</pre>\n'
