"""`handctl ekso …`: the commands of the EksoNR DataPort."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import click

from handctl import __version__
from handctl.command import get_set_watch, snapshots
from handctl.command.command_tree import Command, Group
from handctl.command.common_commands import NAMES, add_map_verbs
from handctl.command.family import Family
from handctl.command.options import EXPORTS, LOG, RESAMPLE, SEGMENT, SKIP, FamilyOption, InFile, OutFile, log_options
from handctl.command.run import Asked, PlannedAction, Run
from handctl.devices.ekso import write_checks
from handctl.devices.ekso.dataport import DataPort
from handctl.devices.ekso.device import Ekso, one_setting, written_table
from handctl.devices.ekso.frames import LENGTH_MODES
from handctl.devices.ekso.gait_cli import add_gait
from handctl.devices.ekso.parameter_map import EKSO
from handctl.devices.ekso.write_policy import largest_step, policy_table, write_limits_of
from handctl.errors import Hint, OutputError, UsageError
from handctl.link import ByteLink
from handctl.model.command_settings import Settings
from handctl.model.device import Gate, limits_of
from handctl.model.export_formats import FORMATS
from handctl.model.param import Step
from handctl.model.result import Column, Journal, Table
from handctl.wording import plural

if TYPE_CHECKING:
    from handctl.devices.ekso.audit_log import AuditLog
    from handctl.devices.ekso.export_opensim import Exported
    from handctl.devices.ekso.log_reader import LogFile
    from handctl.record.row_source import Source


TEXTS = ("mot", "csv")
"""The formats of a log that are text; the others are those of every family."""
NOT_MEDICAL = "handctl is not a medical device, and you are responsible for the settings you change"


def open_ekso(link: ByteLink, settings: Settings, journal: Journal) -> Ekso:
    """An EksoNR behind `link`."""
    mode = str(settings.own.get("length_mode", "body"))
    port = DataPort(link, journal, **limits_of(settings, link), mode="body" if mode == "auto" else mode)
    port.gate = Gate(settings.assume_identity)
    return Ekso(port, find_length=mode == "auto")


cli = Group(
    "ekso",
    family=Family("ekso", open_ekso, 115200, speeds=(115200,)),
    help="Read, configure and log an EksoNR through its DataPort (serial over USB). A person may be standing in it. Reading changes "
    f"nothing. handctl checks every change and asks before it writes, then reads the setting back. Every change is logged. {NOT_MEDICAL}.",
)
add_map_verbs(
    cli,
    EKSO,
    example="step_length left_knee_angle 216",
    without=("set", "describe", "export", "log", "restore"),
    helps={
        "status": "Show a health summary: posture, joints, feet and unusual settings.",
        "stop": "Send CancelAction, which MAY NOT STOP THE DEVICE: use its own controls.\n\n"
        "The DataPort has no stop, and the effect of CancelAction is not documented. The motors keep their power. Works even "
        "while another handctl command is using the device. Never asks. Shows the bytes sent and the reply.",
    },
)


# -- recordings ---------------------------------------------------------------------------------------------------


@cli.verb("log", "Files")
@log_options
@click.option("--raw", is_flag=True, help="Append the 27 raw words to each row.")
@click.option("--include-pilot-id", is_flag=True, help="Keep the wearer's number (pilot id) in the sidecar.")
def log(run: Run, file: str, raw: bool, include_pilot_id: bool, **wishes: Any) -> Table:
    """Record GetData to FILE (CSV) with a sidecar FILE.json. Ctrl-C ends it.

    If FILE is a directory, handctl creates a new file in it. On a terminal, press any letter or space to set a mark.
    """
    from handctl.command import log_command

    def source(again: Callable[[], bool]) -> Source:
        from handctl.devices.ekso.recording_source import EksoSource

        return EksoSource(run.device(), again, raw=raw, personal=include_pilot_id)

    def reading(path: str) -> LogFile:
        from handctl.devices.ekso.log_reader import LogFile

        return LogFile(path)

    return log_command.log(run, file, log_command.RequestedOptions(**wishes), EKSO, source, reading)


@cli.verb("export", "Files", offline=True, to_file=True)
@LOG
@click.option(
    "--to",
    "--format",
    "kind",
    type=click.Choice([*TEXTS, *FORMATS]),
    help=f"Output: mot (OpenSim motion file), csv (the columns of the log), {EXPORTS} --format is the older name.",
)
@click.option("--si", is_flag=True, help="With csv: metres and radians instead of inches and degrees.")
@SEGMENT
@click.option(
    "--knee-sign",
    type=click.Choice(["1", "-1"]),
    help="With mot: sign of knee flexion in your model (default 1, as in the device; gait2392 needs -1).",
)
@RESAMPLE
def export(
    run: Run, log: str, kind: str | None, si: bool, segment: int | None, knee_sign: str | None, rate: float | None
) -> Table:
    """Turn a log into a file for OpenSim, pandas, BIDS and other tools. Needs no device.

    mot and csv go to stdout, or to FILE with -o. The others need -o. A motion file holds just one segment.
    """
    from handctl.command import export_command
    from handctl.devices.ekso import export_opensim as exports
    from handctl.devices.ekso.log_reader import LogFile

    as_rows = run.settings.format in ("json", "ndjson")
    kind = kind or ("csv" if run.settings.format == "csv" else None)
    path = export_command.take_file(run) if kind in FORMATS else run.settings.output
    _check_options(kind, si=si, knee_sign=knee_sign, rate=rate)
    source = LogFile(log)
    if kind in FORMATS:
        return export_command.export(run, str(path), source, kind, segment, rate)
    if kind == "csv":
        result = exports.table(source, segment=segment, si=si, as_rows=as_rows, say=export_command.cells_of(run))
    else:
        sign = int(knee_sign or "1")
        if knee_sign is None:
            run.journal.warn(
                "knee-sign",
                "knee flexion is positive, as in the device",
                hint="use --knee-sign -1 for models like gait2392",
            )
        result = exports.motion(
            source, segment=segment, knee_sign=sign, rate=rate, tool=export_command.TOOL, as_rows=as_rows
        )
    export_command.tell_simulated(run, source)
    return _shown(run, result, as_rows)


def _check_options(kind: str | None, *, si: bool, knee_sign: str | None, rate: float | None) -> None:
    if kind is None:
        raise UsageError("no format given", hint=f"use --to {', --to '.join((*TEXTS, *FORMATS))}")
    if kind != "mot" and knee_sign is not None:
        raise UsageError("--knee-sign works only with --to mot", hint="leave it out")
    if kind == "csv" and rate is not None:
        raise UsageError("--rate does not work with --to csv: it is written as recorded", hint="leave it out")
    if kind != "csv" and si:
        raise UsageError("--si works only with --to csv", hint="leave it out: the output is in degrees")


def _shown(run: Run, result: Exported, as_rows: bool) -> Table:
    for remark in result.remarks:
        run.journal.warn("log", remark)
    run.journal.info("exported", f"{plural(result.length, 'row')}, {result.seconds:.3f} s")
    if not as_rows:  # --format names the file here; what the environment says of tables means nothing
        run.settings = run.settings._replace(format="table")
    return Table(spool=result.spool.blocks)


# -- reading ------------------------------------------------------------------------------------------------------


LOOKS = {
    "time": "Show the device's time of day.",
    "date": "Show the device's date.",
    "settings": "Show all settings (GetSettings, 22 words).",
    "data": """Show the current sensor values (GetData, 27 words).

    Trunk, soles, hips, motor currents, joint angles, state and boot time.
    """,
    "feedback": "Show step counts, times and assistance (GetFeedback, 17 words).",
}
"""A command for each message that is read, and what it shows."""


def _look(message: str) -> Callable[[Run], Table]:
    def look(run: Run) -> Table:
        return run.device().shown(message)  # type: ignore[no-any-return]

    look.__doc__ = LOOKS[message]
    return look


for _message in LOOKS:
    cli.verb(_message, "Inspect")(_look(_message))


@cli.verb("describe", "Inspect", offline=True)
@click.argument("names", nargs=-1, metavar=NAMES)
def describe(run: Run, names: tuple[str, ...]) -> Table:
    """List all words with message, ParameterID, type, codes and aliases.

    Also shows the largest change that handctl writes at once. Needs no device.
    """
    table = get_set_watch.describe(EKSO, names)
    for row in table.rows:
        param, _ = EKSO.find(row["name"])
        limits = write_limits_of(param)
        policy = [f"{largest_step(param)} at once"] if limits.step else []
        policy += ["only while sitting"] if limits.sitting else []
        policy += [f"{' and '.join(limits.twice)} asked twice"] if limits.twice else []
        row |= {
            "message": param.message,
            "word": param.word if row["name"] in EKSO else None,
            "id": param.id,
            "aliases": ", ".join(param.aliases),
            "policy": ", ".join(policy) or None,
        }
    columns = (
        *table.columns[:1],
        Column("message", "Message"),
        Column("word", "Word", right=True),
        Column("id", "ID", right=True),
        *(column for column in table.columns[2:] if column.key != "persistent"),
        Column("policy", "Policy"),
        Column("aliases", "Also"),
    )
    return Table(rows=table.rows, columns=columns)


@cli.verb("policy", "Inspect", offline=True)
@click.option(
    "--audit",
    envvar="HANDCTL_AUDIT",
    metavar="FILE",
    type=InFile(),
    help="Audit log to check (default: ekso-audit.jsonl in the user's state folder).",
)
def policy(run: Run, audit: str | None) -> Table:
    """Show the checks and confirmations before a write. Needs no device.

    Lists the largest change per write, postures, the settings that need a second confirmation, and how still the device must be. Also
    checks the audit log: the exit code is 7 if an entry was edited, removed or moved. The device's own limits are not
    documented.
    """
    from pathlib import Path

    from handctl.devices.ekso.audit_log import AuditLog, check_whole_log, default_path

    table = policy_table()
    path = Path(audit) if audit else default_path()
    if audit or path.exists():
        table.failure = check_whole_log(AuditLog(path, {}), run.journal)
    return table


# -- writing ------------------------------------------------------------------------------------------------------


def _audit_options(body: Callable[..., Any]) -> Callable[..., Any]:
    body = click.option(
        "--audit",
        envvar="HANDCTL_AUDIT",
        metavar="FILE",
        type=OutFile(grows=True),
        help="A second audit log, as well as ekso-audit.jsonl in the user's state folder. Without a log no setting is written. The "
        "step limits use the last writes of all users of this computer, so they apply to every port and FILE.",
    )(body)
    return click.option("--operator", cls=FamilyOption, of="ekso")(body)


OVERRIDE = click.option(
    "--override-step-limit",
    "override",
    is_flag=True,
    help="Allow a larger change than this tool's policy does, except for leg lengths.",
)


def _always(run: Run) -> dict[str, Any]:
    """What stands in each entry of the audit log."""
    from getpass import getuser
    from platform import node

    try:
        user: str | None = getuser()
    except (OSError, KeyError):
        user = None
    return {
        "operator": run.settings.own.get("operator"),
        "user": user,
        "host": node(),
        "port": run.link_name(),
        "place": run.place,
        "simulated": run.open_link().fake,
        "tool": f"handctl {__version__}",
        "command": run.command,
    }


CHANGES = "This changes a setting of an exoskeleton that someone may be wearing"


def give_writer(run: Run, ekso: Ekso, file: str | None, *, override: bool, stepwise: bool = False) -> None:
    """Give the device all that writing needs; --yes stands for a person, who must be named."""
    from handctl.devices.ekso.audit_log import logs
    from handctl.devices.ekso.setting_writer import Writer

    run.prompts.say(NOT_MEDICAL)

    def ask(question: str, word: str) -> None:
        if run.settings.yes:
            run.prompts.say(question.partition(". ")[0])
        run.confirm(question, word=word)

    audit = logs(file, _always(run))
    audit.check()
    for log in [log for log in audit.every if log.personal]:
        _tell_edited(run, log)
        _tell_unfinished(run, log)
    ekso.writer = Writer(ekso.port, audit, ask, override=override, stepwise=stepwise, prompts=run.prompts)


def _tell_edited(run: Run, audit: AuditLog) -> None:
    from handctl.devices.ekso.audit_log import finding_texts

    for place in list(finding_texts(audit.checked()))[-1:]:
        run.journal.warn(
            "audit-edited",
            f"{audit.path}: an entry {place.partition(') ')[2]}",
            hint=Hint("run {} to see where", "ekso policy"),
        )


def _tell_unfinished(run: Run, audit: AuditLog) -> None:
    last = audit.unfinished()
    if last is None:
        return
    old, new = ((last.get(key) or {}).get("value") for key in ("old", "new"))
    run.journal.warn(
        "unfinished-write",
        f"the last write in {audit.path} has no result: {last.get('name')} {old} -> {new} at {last.get('utc')} "
        f"on {last.get('port')}",
        hint=Hint("compare it with {}: handctl was killed or could no longer write its log", "ekso settings"),
    )


def need_operator(run: Run) -> None:
    """Raise UsageError where nobody confirms the write and nobody is named for it."""
    if run.settings.yes and not run.settings.dry_run and not run.settings.own.get("operator", "").strip():
        raise write_checks.refusal(
            write_checks.OPERATOR,
            "--yes writes without asking: it needs --operator NAME",
            "add --operator NAME: the audit log must name who did it. Nothing was sent.",
        )


@cli.verb("set", "Settings", writes=True, asks=True)
@click.argument("assignments", nargs=-1, required=True, metavar="NAME=VALUE")
@_audit_options
@OVERRIDE
def set_(run: Run, assignments: tuple[str, ...], audit: str | None, override: bool) -> PlannedAction:
    """Write one setting, with every check.

    For example `step_length=15.5`, `walk_mode=ProStep` or `216='50 %'`. Shows the old and the new value and asks.
    The wearer must stay still. Sends the setting once, reads all settings back, and keeps an audit log.
    """
    change = one_setting(assignments)
    need_operator(run)

    def steps() -> list[Step]:
        planned: list[Step] = run.planner().plan([change])
        run.journal.info(
            "dry-run-gates",
            "the step limit and stillness are checked with the device, when the setting is written. The msgID, and so the CRC, depends on the reads before it",
        )
        return planned

    def look(ekso: Ekso) -> Asked:
        give_writer(run, ekso, audit, override=override)  # which asks by itself, with the old value
        return Asked()

    def write(ekso: Ekso) -> Table:
        before = ekso.words("settings")
        param = EKSO[change[0].param.name]
        if before[param.word] == param.to_raw(change[1]):
            run.journal.info("equal", f"{param.name} is already {param.shown(change[1])}. Nothing was written")
        else:
            run.ledger.plan(ekso.plan([change]))
        return written_table(ekso, before, ekso.write([change]))

    return PlannedAction(steps, write, CHANGES, look=look)


@cli.verb("restore", "Files", writes=True, asks=True)
@click.argument("file", type=InFile())
@_audit_options
@OVERRIDE
@SKIP
def restore(run: Run, file: str, audit: str | None, override: bool, skip: tuple[str, ...] = ()) -> PlannedAction:
    """Write the settings that differ from a snapshot, one by one.

    Uses the same checks and confirmations as `set`. Reaches a distant value in permitted steps, one every 10 s, and
    reads each one back. If it is interrupted, run it again: it continues from the current settings.
    """
    need_operator(run)
    if run.settings.dry_run:
        run.journal.info(
            "steps",
            "a distant value is reached in permitted steps, one every 10 s. How many it takes depends on the device's current values",
        )
    act = snapshots.restore(run, EKSO, file, skip=skip)

    def look(ekso: Ekso) -> Asked:
        with snapshots.nothing_written():
            give_writer(run, ekso, audit, override=override, stepwise=True)
        return act.looked(ekso)

    return act._replace(question=CHANGES, look=look)


class _WordRange(click.IntRange):
    """A word, also in hex as messages and the audit log show it."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if isinstance(value, str) and value.lower().startswith("0x"):
            with suppress(ValueError):
                value = int(value, 16)
        return super().convert(value, param, ctx)


@cli.verb("cancel", "Settings", writes=True)
@click.option(
    "--word",
    default=0x0100,
    show_default=True,
    metavar="N",
    type=_WordRange(1, 0xFFFF),
    help="Command word, not 0. 0x0100 is 256.",
)
@_audit_options
def cancel(run: Run, word: int, audit: str | None) -> PlannedAction:
    """Send CancelAction once. This MAY NOT STOP THE DEVICE.

    Never asks, and logs it. It is sent even if the log cannot be written.
    The manual does not say which actions it cancels.
    """

    def act(ekso: Ekso) -> Table:
        from pathlib import Path

        from handctl.devices.ekso.audit_log import AuditLog, default_path

        log = AuditLog(Path(audit) if audit else default_path(), _always(run))

        def record(event: str, fields: dict[str, object]) -> None:
            try:
                log.record(event, ekso.link.now(), **fields)
            except OutputError as exc:  # stopping must not depend on a disk
                run.journal.warn("audit", exc.text)

        return ekso.cancel(word, record)

    return PlannedAction(run.planner().plan_cancel(word), act)


# -- every command -------------------------------------------------------------------------------------------------


def _check_mode(text: str) -> str:
    """A length convention or "auto". Raises UsageError."""
    if text not in (*LENGTH_MODES, "auto"):
        raise UsageError(f"unknown --length-mode {text!r}", hint=f"auto, {', '.join(LENGTH_MODES)}")
    return text


add_gait(cli)
for _name, _command in cli.commands.items():
    if _name not in ("describe", "export", "gait", "policy") and isinstance(_command, Command):
        _command.params.append(FamilyOption(["--length-mode"], "ekso", _check_mode))
