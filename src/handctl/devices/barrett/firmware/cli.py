"""`handctl barrett firmware …`: check a firmware file, load it into the hand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from handctl.command.command_tree import Group
from handctl.command.options import InFile, WholeRange
from handctl.command.run import PlannedAction, Run
from handctl.devices.barrett.status_and_parameter_views import CHECKED, LABEL, MOTOR, NAME
from handctl.errors import CheckFailed, UsageError
from handctl.files import read
from handctl.model.param import Step
from handctl.model.result import Cell, Column, Grid, Row, Table
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.devices.barrett.device import BarrettHand
    from handctl.devices.barrett.firmware.srecords import Firmware

POWER_SECONDS = 20.0
"""For the power switch and the hand's return, beside the download itself."""


def add_firmware(group: Group) -> None:
    """Add the command group to the family's group."""
    firmware = Group(
        "firmware",
        heading="Service",
        family=group.family,
        help="Check a firmware file, or load it into the hand (§3.7).",
    )
    group.add_command(firmware)

    @firmware.verb("check", offline=True)
    @click.argument("file", type=InFile())
    @click.option("--force", is_flag=True, help="Accept a file that has no end record.")
    def check(run: Run, file: str, force: bool) -> Table:
        """Check an S-record FILE. Needs no device.

        Checks the records, checksums, ranges, overlaps, counts and the end record. The exit code is 7 if the file must
        not be loaded.
        """
        found = _load(file)
        table = _table(found)
        problem = _problem(found, force)
        if problem is not None:
            table.failure = CheckFailed(f"{file}: {problem[0]}", hint=problem[1], code="firmware-file")
        return table

    @firmware.verb("download", writes=True, asks=True)
    @click.argument("file", type=InFile())
    @click.option("--force", is_flag=True, help="Load a file even if it has no end record.")
    @click.option(
        "--expect", metavar="VERSION", help="Exit with code 7 unless the hand then reports this version, such as 4.34."
    )
    @click.option(
        "--window",
        type=WholeRange(1, 4),
        default=1,
        show_default=True,
        metavar="N",
        help="Bytes to send ahead of their echo, 1 to 4. 2 halves the time. More than 2 has not been tried on hardware.",
    )
    def download(run: Run, file: str, force: bool, expect: str | None, window: int) -> PlannedAction:
        """Load a firmware FILE into the hand.

        handctl checks the file, asks you to switch the power supply off and on, and compares the echo of every byte. The
        hand must answer afterwards. Only RAM is written, so the parameters stay as they are. The first Ctrl-C only
        warns. The second one stops the download and leaves the hand without firmware.
        """
        from handctl.devices.barrett.firmware.download import Loader, version_in

        found = _load(file)
        problem = _problem(found, force)
        if problem is not None:
            raise UsageError(f"{file}: {problem[0]}", hint=f"{problem[1]}. Nothing was sent.", code="firmware-file")
        if expect is not None and version_in(expect) is None:
            raise UsageError(f"--expect {expect!r} is not a version", hint="use a number such as --expect 4.34")
        needed = found.seconds + POWER_SECONDS
        if run.settings.deadline is not None and run.settings.deadline < needed:
            raise UsageError(
                f"--deadline {run.settings.deadline:g} is too short: this download takes about {needed:.0f} s",
                hint="use a longer one, or none. An interrupted download leaves the hand without firmware. Nothing was sent.",
            )

        def load(hand: BarrettHand) -> Table:
            run.prompts.say(f"Firmware file OK: {_summary(found)}")
            done = Loader(hand, run.prompts, found, window=window, expect=version_in(expect) if expect else None).run()
            done.columns, done.extra = (NAME, MOTOR, Column("value", "Value"), LABEL), {"firmware": _facts(found)}
            return done

        question = f"{_summary(found)}. This replaces the hand's firmware. An interrupted download leaves the hand without firmware"
        return PlannedAction(lambda: _steps(found), load, question)


def _load(path: str) -> Firmware:
    from handctl.devices.barrett.firmware.srecords import parse

    content = read(
        path, "a firmware file", 4_000_000, hint="use the vendor's .S19 file. A file for 64 KiB is smaller than 300 kB"
    )
    return parse(path.replace("\\", "/").rpartition("/")[2], content)


def _problem(firmware: Firmware, force: bool) -> tuple[str, str] | None:
    """Why the file must not be loaded: text and next step; None when it may."""
    for status in ("fail", *(() if force else ("force",))):
        for finding in firmware.findings:
            if finding.status == status:
                hint = f"{finding.remedy}, or use --force to load it anyway" if status == "force" else finding.remedy
                return f"{finding.check}: {finding.evidence}", hint
    return None


def _summary(firmware: Firmware) -> str:
    return (
        f"{plural(len(firmware.records), 'record')}, {firmware.size} bytes, {firmware.range_text}, "
        f"about {max(1, round(firmware.seconds))} s"
    )


def _facts(firmware: Firmware) -> dict[str, Any]:
    return {
        "file": firmware.name,
        "sha256": firmware.sha256,
        "image_sha256": firmware.image_sha256,
        "header": firmware.header or None,
        "records": len(firmware.records),
        "data_bytes": firmware.size,
        "ranges": [[first, last] for first, last in firmware.ranges],
        "seconds_at_9600": round(firmware.seconds, 1),
    }


def _table(firmware: Firmware) -> Table:
    from handctl.model.check_rows import TONES

    rows: list[Row] = [
        {**one._asdict(), "status": "warning" if one.status == "force" else one.status} for one in firmware.findings
    ]

    def view(rows: list[Row]) -> list[Grid]:
        lines = tuple((row["check"], Cell(row["status"], TONES[row["status"]]), row["evidence"]) for row in rows)
        notes = (
            *((f"header: {firmware.header}",) if firmware.header else ()),
            _summary(firmware),
            f"sha256 {firmware.sha256}",
        )
        return [Grid(("Check", "Status", "Evidence"), lines, firmware.name, notes=notes)]

    return Table(rows=rows, columns=CHECKED[:-1], view=view, extra={"firmware": _facts(firmware)})


def _steps(firmware: Firmware) -> list[Step]:
    """The bytes of the opening and of every record."""
    from handctl.devices.barrett.firmware.srecords import SELECT, TRIGGER, head_of

    steps = [Step("with the hand's power off", SELECT, strands=True), Step("when the hand says : (3A)", TRIGGER)]
    for record in firmware.records:
        meaning = f"line {record.line}: {plural(len(record.data), 'byte')} to {record.address:04X}h"
        steps.append(Step(meaning, TRIGGER + head_of(record) + TRIGGER + record.data, strands=True))
    return steps
