"""The commands `export LOG` and `log --check FILE` of every family: a recording in another program's format, and its two clocks. Neither needs a device."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from handctl import __version__
from handctl.command.run import Run
from handctl.errors import CheckFailed, UsageError
from handctl.model.export_formats import FORMATS
from handctl.model.result import Column, Row, Table
from handctl.screen.sanitize import no_formula
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.record.clock_survey import Segment, Survey
    from handctl.record.log_reader import LogFile

TOOL = f"handctl {__version__}"
WRITTEN = (
    Column("file", "File"),
    Column("rows", "Rows", right=True),
    Column("seconds", "Duration", right=True, unit="s"),
)
CHECKED = (
    Column("segment", "Segment", right=True),
    Column("begins", "Begins with"),
    Column("row", "Row", right=True),
    Column("rows", "Rows", right=True),
    Column("pause", "Pause before", right=True, unit="s"),
    Column("start", "Start", right=True, unit="s"),
    Column("duration", "Duration", right=True, unit="s"),
    Column("gaps", "Gaps", right=True),
    Column("drift", "Drift", right=True, unit="ppm"),
    Column("residual", "Residual", right=True, unit="ms"),
    Column("apart", "Apart", right=True, unit="ms"),
)
"""`drift` is by how much the host's clock is faster than the device's; `apart` the most by which they contradict each other."""


def cells_of(run: Run) -> Callable[[str], str]:
    """What a text becomes in a cell of a CSV file, by --no-formulas."""
    return no_formula if run.settings.no_formulas else str


def take_file(run: Run) -> str:
    """The file that -o names, which from now on is the export's own: whatever else is told goes to stdout."""
    path = run.settings.output
    run.settings = run.settings._replace(output=None)
    return "" if path in (None, "-") else str(path)


def export(run: Run, path: str, source: LogFile, kind: str | None, segment: int | None, rate: float | None) -> Table:
    """Write the file; what is shown is its name and size."""
    from handctl.record.exports import Export, write

    if kind is None:
        raise UsageError("no format given", hint=f"use --to {', --to '.join(FORMATS)}")
    if rate is not None and not FORMATS[kind].rated:
        raise UsageError(f"--rate does not work with --to {kind}: it is written as recorded", hint="leave it out")
    if not path:
        raise UsageError(
            f"--to {kind} needs a file: the output is not text",
            hint=f"add -o {FORMATS[kind].example}",
            code="no-output",
        )
    work = Export(source, path, TOOL, segment, rate)
    write(work, kind)
    tell_simulated(run, source)
    for remark in work.remarks:
        run.journal.warn("log", remark)
    for note in work.notes:
        run.journal.info("resampled", note)
    run.journal.info("exported", f"{plural(work.rows, 'row')}, {work.seconds:.3f} s")
    return Table(rows=[{"file": path, "rows": work.rows, "seconds": work.seconds}], columns=WRITTEN)


def tell_simulated(run: Run, source: LogFile) -> None:
    """Say so where a simulator was recorded."""
    if source.simulated:
        run.settings = run.settings._replace(port=None, fake=True)
        run.journal.info("simulated", f"{source.path}: this is a recording of a simulator, not of a device")


# -- log --check ----------------------------------------------------------------------------------------------------------


def check(run: Run, source: LogFile) -> Table:
    """The segments of a log as its rows show them: why each begins, the fit of the clocks, what is missing."""
    from handctl.record.clock_survey import survey
    from handctl.record.log_reader import UNTOUCHED, Incomplete

    try:
        found = survey(source)
    except Incomplete as exc:
        return Table(rows=[], columns=CHECKED, failure=CheckFailed(exc.text, hint=UNTOUCHED, code="log"))
    tell_simulated(run, source)
    findings = [*source.remarks(), *_contradictions(source, found)]
    for text in findings:
        run.journal.warn("log", text)
    failure = CheckFailed(f"{source.path}: {plural(len(findings), 'finding')}", code="log") if findings else None
    return Table(rows=[_row(found, one) for one in found.segments.values()], columns=CHECKED, failure=failure)


def _row(found: Survey, one: Segment) -> Row:
    fit = one.fit.as_row()
    return {
        "segment": one.number,
        "begins": ", ".join(one.notes) or "start",
        "row": one.first_row,
        "rows": one.rows,
        "pause": round(one.pause_s, 3),
        "start": one.first.t_ms / 1000,
        "duration": round((one.last.t_ms - one.first.t_ms) / 1000, 3),
        "gaps": one.gaps,
        "a_s": fit["a_s"] + 0.0 if fit else None,
        "b": fit["b"] if fit else None,
        "drift": round((fit["b"] - 1) * 1e6, 1) if fit else None,
        "residual": fit["residual_ms"] if fit else None,
        "apart": round(one.apart_ms, 3) if found.clocked else None,
    }


def _contradictions(source: LogFile, found: Survey) -> list[str]:
    """Where the rows are not what the sidecar says, or the clocks part within a segment."""
    said = {one.get("segment"): one for one in (source.sidecar or {}).get("segments") or []} if source.closed else {}
    texts = []
    for number, one in found.segments.items():
        if one.apart:
            texts.append(f"segment {number}: the device's clock and this computer's part by {one.apart_ms:+.0f} ms")
        about: dict[str, Any] = said.get(number, {})
        fit, own = about.get("clock_fit"), one.fit.as_row()
        ends = {"boot_ms": one.boots, "t_s": [one.first.t_ms / 1000, one.last.t_ms / 1000]}
        if source.closed and (
            (about.get("first_row"), about.get("rows")) != (one.first_row, one.rows)
            or any(about.get(key, value) != value for key, value in ends.items())
        ):
            texts.append(f"segment {number}: the sidecar has other rows or times")
        elif fit and own and abs(fit["a_s"] - own["a_s"]) + abs(fit["b"] - own["b"]) * one.last.t_ms / 1000 > 0.001:
            texts.append(f"segment {number}: the sidecar has another clock fit")
    return [*texts, *_others_in_sidecar(source.sidecar, found)] if source.sidecar and source.closed else texts


def _others_in_sidecar(sidecar: Mapping[str, Any], found: Survey) -> Iterator[str]:
    """The marks and the ends of which the sidecar says something else than the rows."""
    from handctl.record.clock_survey import NOTE

    said = {one["row"]: str(one.get("text")) for one in sidecar.get("marks") or () if one.get("row") is not None}
    for row in sorted(found.marks.keys() | said):
        text, own = found.marks.get(row, ""), said.get(row, "")
        if not text.endswith(own) or NOTE.sub("", text.removesuffix(own)):
            yield f"row {row}: the sidecar has another mark"
    for name, segment, at in (("start", min(found.segments), 0), ("end", max(found.segments), 1)):
        boot = found.segments[segment].boots[at]
        if (sidecar.get(name) or {}).get("boot_ms", boot) != boot:
            yield f"{name}: the sidecar has another time of the device"
