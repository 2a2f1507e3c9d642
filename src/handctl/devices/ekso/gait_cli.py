"""`handctl ekso gait`: the strides of a log as figures and as a list, and two logs side by side. What they mean is in `gait`."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from handctl.command.command_tree import Group
from handctl.command.options import InFile, OutFile
from handctl.command.run import Run
from handctl.errors import CheckFailed
from handctl.files import atomic_write, writing
from handctl.model.result import Column, Row, Table

if TYPE_CHECKING:
    from handctl.devices.ekso.gait import Figure, Walk
    from handctl.devices.ekso.log_reader import LogFile

FIGURES = (
    Column("name", "Figure"),
    Column("side", "Side"),
    Column("value", "Mean", right=True),
    Column("deviation", "SD", right=True),
    Column("strides", "Strides", right=True),
    Column("unit", "Unit"),
)
CHANGES = (
    Column("name", "Figure"),
    Column("side", "Side"),
    Column("before", "Before", right=True),
    Column("after", "After", right=True),
    Column("change", "Change", right=True),
    Column("interval", "+/- 95 %", right=True),
    Column("unit", "Unit"),
    Column("clear", "Clear"),
)
STEPS = ("segment", "side", "contact_s", "off_s", "next_contact_s", "duration_s", "stance_percent", "swing_percent",
         "peak_toe_raw", "peak_heel_raw", "knee_range_deg", "verdict", "doubt")  # fmt: skip


def add_gait(group: Group) -> None:
    """Add the command."""

    @group.verb("gait", "Files", offline=True)
    @click.argument("log", metavar="LOG", type=InFile(additional=(".json",)))
    @click.argument("later", metavar="[LATER]", required=False, type=InFile(additional=(".json",)))
    @click.option("--steps", metavar="FILE", type=OutFile(), help="Write every stride, counted or not, to FILE (CSV).")
    @click.option(
        "--page",
        metavar="FILE",
        type=OutFile(),
        help="Write the curves, figures and strides not counted to FILE (HTML).",
    )
    def gait(run: Run, log: str, later: str | None, steps: str | None, page: str | None) -> Table:
        """Find the strides in a log: cadence, stance, symmetry, variability. Needs no device.

        With LATER, compares two logs and lists the settings that differ. The thresholds come from the
        recording itself. Strides that are not counted are listed with the reason. Not a diagnosis.
        """
        from handctl.devices.ekso.gait import compared, walk_of
        from handctl.devices.ekso.log_reader import LogFile

        source = LogFile(log)
        walk = walk_of(source)
        if steps is not None:
            _write(steps, _list_of(walk))  # also where no stride counts: it says why
        _tell(run, log, source, walk)
        if later is None:
            found = Table(rows=[*map(_figure, walk.figures), *_counts(walk)], columns=FIGURES)
            if page is not None:
                _write(page, _page([("", source, walk)], found))
            return found
        after = LogFile(later)
        second = walk_of(after)
        _tell(run, later, after, second)
        changed = _settings(source.sidecar, after.sidecar)
        rows = [
            {"name": one.before.name, "side": one.before.side, "before": round(one.before.mean, 3) + 0.0,
             "after": round(one.after.mean, 3) + 0.0, "change": round(one.change, 3) + 0.0,
             "interval": None if one.error is None else round(one.error, 3),
             "unit": one.before.unit, "clear": "yes" if one.clear else "no"}
            for one in compared(walk, second)
        ]  # fmt: skip
        settings = [{"name": f"setting: {name}", "before": old, "after": new} for name, old, new in changed]
        found = Table(rows=[*settings, *rows], columns=CHANGES)
        if page is not None:
            _write(page, _page([("before", source, walk), ("after", after, second)], found))
        return found


def _figure(one: Figure) -> Row:
    return {"name": one.name, "side": one.side, "value": round(one.mean, 3) + 0.0, "deviation": round(one.deviation, 3),
            "strides": one.strides, "unit": one.unit}  # fmt: skip


def _counts(walk: Walk) -> list[Row]:
    """How many strides count, how many do not and why, and how many are doubtful."""
    return [
        {"name": "strides", "side": "both", "value": number, "unit": f"{what}: {why}" if why else what}
        for what, why, number in walk.verdicts
    ]


def _tell(run: Run, path: str, source: LogFile, walk: Walk) -> None:
    """What was found beside the figures. Raises CheckFailed where no stride counts."""
    from handctl.command.export_command import tell_simulated

    for remark in source.remarks():
        run.journal.warn("log", remark)
    for remark in walk.remarks:
        run.journal.warn("sensor", f"{path}: {remark}")
    counted = ", ".join(f"{row['value']} {row['unit']}" for row in _counts(walk))
    run.journal.info("strides", f"{path}: strides: {counted}")
    tell_simulated(run, source)
    if not walk.taken:
        raise CheckFailed(
            f"{path}: no stride was found",
            hint="record at least ten steps with `handctl ekso log`. --steps lists what was refused, and why",
            code="no-stride",
        )


def _settings(before: dict[str, Any] | None, after: dict[str, Any] | None) -> list[tuple[str, Any, Any]]:
    """The settings that differ between two sidecars."""
    old, new = ((sidecar or {}).get("settings_before") or {} for sidecar in (before, after))
    return [
        (name, old[name].get("label") or old[name].get("value"), new[name].get("label") or new[name].get("value"))
        for name in old
        if name in new and old[name].get("raw") != new[name].get("raw")
    ]


def _page(found: Sequence[tuple[str, LogFile, Walk]], figures: Table) -> str:
    from handctl.devices.ekso.gait_page import Recording, page

    return page([Recording(*one) for one in found], figures)


def _list_of(walk: Walk) -> str:
    """All strides as CSV."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(STEPS)
    for step in walk.steps:
        whole = step.end == step.end
        numbers = (step.contact, step.off, step.end, step.duration)
        shares = (100 * step.stance, 100 * (1 - step.stance)) if whole else ("", "")
        writer.writerow([
            step.segment, step.side, *(f"{value:.3f}" if value == value else "" for value in numbers),
            *(f"{share:.1f}" if share != "" else "" for share in shares),
            *("" if peak is None else f"{peak:.0f}" for peak in (step.peak_toe, step.peak_heel)),
            f"{step.knee:.2f}" if whole else "", step.refused or "counted", step.doubt,
        ])  # fmt: skip
    return text.getvalue()


def _write(path: str, text: str) -> None:
    """A file. Raises OutputError."""
    with writing(path), atomic_write(path) as file:
        file.write(text)
