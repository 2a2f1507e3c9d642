"""What a command was asked to do: its settings, its files, and the checks before it starts, as of which device is meant and
that no output file replaces another file. Sends nothing and opens no link.

Settings come from the command line, the environment, a named device and the configuration file, in that order (`resolve`).
A device that the environment or the file names stands back when a level above it says where the device is.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, TextIO

import click

from handctl.command.family import NO_FAMILY, Family, in_words, load, on_can, wire_in
from handctl.command.options import (
    COMMAND_LINE,
    ENVIRONMENT,
    FACTS,
    FILE,
    NAMED,
    WITHOUT_DEVICE,
    WITHOUT_FILE,
    InFile,
    OutFile,
    SharedOption,
    Source,
    command_line,
    lasting_options,
    refuse_lacking,
    words_of,
)
from handctl.command.terminal_prompts import TerminalPrompts, print_message
from handctl.errors import Hint, OutputError, UsageError, typed
from handctl.fast_classes import NamedTuple
from handctl.files import clash, state_path, why_unwritable
from handctl.model.command_settings import Settings
from handctl.model.result import Journal, Message
from handctl.system import clock
from handctl.system.user_folders import config_path

if TYPE_CHECKING:
    from handctl.link import Link
    from handctl.model.param import Changes, ParamMap, Step
    from handctl.model.prompts import Prompts
    from handctl.model.write_ledger import Ledger

UNASKED = "yes-unasked"
"""The message that no -q silences."""


class Invocation:
    """One invocation of a command: settings, person, device, and the open device.

    context  click's, of the parsed line
    said     what the command line and its levels share
    session  the commands of which this is one, and what they have in common; None for one that stands alone
    began    when it was asked for, by `clock.now`
    in_use   whether the simulated device of plain --fake is shown in use
    link     once it is open, and `opened` the device behind it
    end      when --deadline has passed, by the clock of the link
    """

    shows = True
    """Whether it shows its messages and result itself, and answers to signals; else a program or another run does."""
    journal: Journal
    link: Link | None
    opened: Any
    end: float | None

    def __init__(
        self, ctx: click.Context, settings: Settings, family: Family | None, prompts: Prompts | None, session: Any
    ) -> None:
        self.context = ctx
        self.settings = settings
        self.family = family or NO_FAMILY
        self.command = " ".join(words_of(ctx))
        self.said = command_line(ctx)
        self.sources = self.said.sources
        self.session = session
        self.began = clock.now() if session is None or session.began is None else session.began
        self.streams = bool(getattr(ctx.command, "streams", False))
        self.writes = bool(getattr(ctx.command, "writes", False))
        self.stops = bool(getattr(ctx.command, "stops", False))
        self.in_use = self.streams
        self.inputs, self.outputs = files_of(ctx)
        named = (settings.device, settings.port, settings.output, settings.trace, settings.facts)
        typed.clear()
        typed.update(filter(None, named), (one.path for one in (*self.inputs, *self.outputs)))
        self.prompts = prompts or TerminalPrompts(settings.quiet)
        self.typed: TextIO = sys.stdin
        """A source of lines that a body reads in addition to its arguments."""

    def only_reads(self, without: str) -> None:
        """This form of a command, `without` what makes it write or move, does neither. Raises UsageError in a dry run."""
        if self.settings.dry_run:
            text = f"`handctl {self.command}` without {without} only reads"
            raise UsageError(text, hint="run it without -n, it changes nothing")
        self.writes = False

    def reach(self, link: str | None) -> None:
        """Take LINK as the argument of a command for the device that is meant; None = as the options say. Raises UsageError."""
        if link is None:
            return
        if self.settings.device or self.sources.get("port") == COMMAND_LINE:
            raise UsageError("two devices given", hint="give LINK, -p or -d", code="two-devices")
        self.settings = self.settings._replace(port=link, fake=False)

    def mapped(self, params: ParamMap[Any]) -> ParamMap[Any]:
        """The map of the device that is meant."""
        return params if self.family.map_of is None else self.family.map_of(self.settings)

    def planner(self) -> Any:
        """The device without a link: can check and plan writes, cannot send."""
        from handctl.link import NoFrames, NoLink

        refuse_other_family(self)
        link = NoFrames() if on_can(self.settings) else NoLink()
        return self.family.open(link, self.settings, self.journal)

    def link_name(self) -> str:
        """The LINK: --port, or the simulator for --fake. Raises UsageError when neither is given; never picks one."""
        from handctl.link import is_can

        refuse_other_family(self)
        port, wire = self.settings.port, self.settings.wire
        kind = self.family.kind
        if port and not port.startswith("replay:"):
            if is_can(port) and "can" not in self.family.wires:
                raise UsageError(
                    f"{port}: this device has no CAN interface",
                    hint="give a serial port, usb:VID:PID or tcp://HOST:PORT",
                )
            if wire is not None and kind and wire_in(self.family, port) != wire:
                raise UsageError(
                    f"--{wire} does not fit {port}", hint="leave it out: the LINK already selects the wire"
                )
            if kind:
                refuse_serial(self.family, port)
        if port:
            return port
        if self.settings.fake:
            return self._simulated()
        where = "-p LINK (`handctl ports` lists the serial ports, -p tcp://HOST:PORT is a TCP device)"
        if self.family.tcp_port is not None and not self.family.wires:
            where = f"-p tcp://HOST (port {self.family.tcp_port} when not given)"
        raise UsageError(
            "no device given",
            hint=Hint(f"give {where}, -d NAME (see {{}}), or --fake for the simulated {kind}", "devices list"),
            code="no-link",
        )

    def _simulated(self) -> str:
        """The LINK of plain --fake: the simulator of the family on the wire that was asked for."""
        family, wire = self.family, self.settings.wire
        said = [family.simulated(self.settings)]
        if family.kind and wire is not None and wire != family.wires[0]:
            said.append(f"bus={wire}")
        text = "&".join(filter(None, said))
        return f"fake://{family.kind}{'?' if text else ''}{text}"

    @property
    def keeps(self) -> bool:
        """Whether what this command does to a simulated device is kept for the next one."""
        return self.settings.fake and self.may_write and not self.settings.dry_run

    @property
    def owner(self) -> str:
        """The command in whose name the device is held and recorded: this one, or that of its session."""
        return self.command if self.session is None else self.session.command

    @property
    def may_write(self) -> bool:
        """Whether something may be written while the link is open: by this command, or by another one of its session."""
        return self.writes if self.session is None else self.session.writes

    @property
    def place(self) -> str:
        """Where the LINK leads, the same for all names of one port."""
        from handctl.link.device_lock import canonical

        return canonical(self.link_name(), self.family.tcp_port)

    @property
    def shares_line(self) -> bool:
        """Whether the configuration has several named devices at the place of this LINK. Errors in the file are ignored."""
        from handctl.command.config_file import read_config
        from handctl.link.device_lock import canonical

        try:
            devices = read_config(passed=[]).devices.values()
        except UsageError:
            return False
        ports = [one.entries["port"].value for one in devices if "port" in one.entries]
        tcp_port = self.family.tcp_port
        return sum(canonical(port, tcp_port) == self.place for port in ports) > 1

    @property
    def ledger(self) -> Ledger:
        """The writes that this command planned, and their results."""
        ledger = self.journal.ledger
        if self.writes and ledger.words is None and self.family.kind:
            from functools import partial

            ledger.words = load(self.family.kind, "write_rules").words()
            ledger.explain = partial(in_words, self.family.kind)
        return ledger


def check_before(run: Invocation) -> None:
    """Raise UsageError or OutputError where this command line cannot be meant."""
    # CommandLine for good in the environment or the file it is a safety catch, and what only reads does not need it.
    if run.settings.dry_run and not run.writes and run.sources.get("dry_run") == COMMAND_LINE:
        raise UsageError(
            f"`handctl {run.command}` only reads. --dry-run is for commands that write or move",
            hint="run it without -n, it changes nothing",
        )
    if "assume_identity" in run.sources and "assume_identity" in getattr(run.context.command, "refused", frozenset)():
        raise UsageError(
            f"`handctl {run.command}` does not check which device answers", hint="run it without --assume-identity"
        )
    opens_none = getattr(run.context.command, "opens_none", None)
    if opens_none is not None and opens_none(run.context.params):
        _tell_unused(run)
    if run.stops:
        _let_pass(run)
        return
    _check_named_device(run)
    _check_files(run)
    path = run.settings.output
    if path and (why := why_unwritable(path)):  # now, not when the device has been served
        raise OutputError(f"{path}: cannot be written: {why}", hint="choose another file for -o. Nothing was sent.")
    if run.settings.format == "openmetrics":
        from handctl.screen.openmetrics import refuse

        refuse(run.command)
    if run.settings.append or run.settings.time:
        _check_columns(run)
    if run.family.kind:
        refuse_lacking(run.family, [key for key, source in run.sources.items() if source == COMMAND_LINE])
        run.family.check(run.settings)


def _tell_unused(run: Invocation) -> None:
    """Say that a LINK was typed for nothing; that of a script, the environment, the file or a named device is meant for others too."""
    if "port" in command_line(run.context).levels:
        here = "" if getattr(run.context.command, "offline", False) else " for this"
        text = (
            f"`handctl {run.command}` opens no link{here}: -p {run.settings.port} was not used, and no device was asked"
        )
        run.journal.warn("link-unused", text, "leave it out")


def _check_columns(run: Invocation) -> None:
    """--append and --time as they make sense; typed where they do not, UsageError."""
    from handctl.screen.render import stream_format

    settings = run.settings
    how = stream_format(run) if run.streams else settings.format
    typed = run.sources.get("append") == COMMAND_LINE
    # A stream has a file only for a recording.
    records = run.command.endswith(" log") or (run.streams and bool(run.outputs))
    trials = typed and records and not settings.output
    append = settings.append and (trials or (how == "csv" and bool(settings.output) and not run.streams))
    time = settings.time and how not in ("table", "openmetrics")
    if settings.append and not append and typed:
        hint = "use `log FILE --append` for recordings" if run.streams else "add --csv and -o FILE"
        raise UsageError("--append adds one reading to a CSV file", hint=f"{hint}. Nothing was sent.")
    if settings.time and not time and run.sources.get("time") == COMMAND_LINE:
        raise UsageError(
            "--time adds a column to CSV, plain or JSON output", hint="add --csv, --json or --format plain"
        )
    run.settings = settings._replace(append=append, time=time)


def _let_pass(run: Invocation) -> None:
    """No file and no format holds up a stop. What its family has to say is `stop.stop_command.fall_back`."""
    _check_named_device(run)
    if run.settings.format == "openmetrics":
        run.settings = run.settings._replace(format="table")
    path = run.settings.output
    if path and run.sources["output"] != COMMAND_LINE and (why := why_unwritable(path)):
        run.settings = run.settings._replace(output=None)
        run.journal.warn("passed-over", f"{path} ({run.sources['output'].where}): cannot be written: {why}")
    try:
        _check_files(run)  # what clashes is written nowhere then
    except UsageError as exc:
        run.journal.warn("passed-over", exc.text)


def _check_files(run: Invocation) -> None:
    """Raise UsageError when an output of this run would replace an input, the configuration file or another output."""
    settings = run.settings
    outputs = [
        NamedFile(label, path) for label, path in (("--output", settings.output), ("--trace", settings.trace)) if path
    ]
    if not outputs and not run.outputs:
        return
    replayed = (settings.port or "").partition("replay:")
    inputs = [NamedFile("--port", replayed[2])] if replayed[1] and not replayed[0] else []
    inputs += [NamedFile("--facts", settings.facts)] if settings.facts else []
    own = NamedFile("the configuration file", config_path())
    try:
        refuse_clashes([*run.inputs, *inputs, own], [*outputs, *run.outputs])
    except UsageError:
        run.settings = settings._replace(output=None, trace=None)  # the envelope of the error must not go there either
        raise


def _check_named_device(run: Invocation) -> None:
    """Whether the device that -d names is meant; a default device is judged when its link is needed."""
    if run.sources.get("device") == COMMAND_LINE and not run.stops:
        refuse_other_family(run)
    source = run.sources.get("port") or run.sources.get("fake")
    if run.settings.kind is None or source is None or source.level != ENVIRONMENT:
        return
    text = f"{source.where} replaces the port of {run.settings.device!r}"
    if run.writes and not run.stops and not run.settings.dry_run:
        raise UsageError(
            f"{text}, so it is unclear which device is meant",
            hint=f"unset {source.where}, or run the command without -d",
            code="two-devices",
        )
    run.journal.warn("other-port", text, f"unset {source.where} to reach {run.settings.device}")


def refuse_other_family(run: Invocation) -> None:
    """Raise UsageError where the name of the device says another family than the command."""
    kind = run.settings.kind
    if not run.family.kind or kind in (None, run.family.kind):
        return
    name = run.settings.device
    raise UsageError(
        f"{name!r} is of family {kind} ({run.sources['kind'].where}), not {run.family.kind}",
        hint=Hint(f"use `handctl {kind} …` for {name}, or see {{}} for the others", "devices list"),
        code="wrong-family",
    )


def refuse_serial(family: Family, link: str) -> None:
    """Raise UsageError for a serial port where this family has TCP only."""
    from handctl.link.link_interface import path_in

    if family.tcp_port is not None and not family.wires and (path_in(link) or link.startswith("usb:")):
        hint = f"-p tcp://HOST (port {family.tcp_port} when not given)"
        raise UsageError(f"{link}: {family.kind} has no serial port", hint=hint)


def unsent(journal: Journal) -> str:
    """What is certain where the answer to a question was no: some questions are made of what was read."""
    return "nothing was written" if journal.counters.sent else "nothing was sent"


def told(question: str, changes: Changes | None) -> str:
    """The question for who sees no table."""
    return question if changes is None else changes.told(question)


def shown_steps(steps: Sequence[Step], settings: Settings, changes: Changes | None = None) -> list[str]:
    """What is going to be written, a line a step, for who is asked; with the bytes where -v shows those of all other frames.

    Without -v a single step is left out, since the question says what it does, and so are all that the table has.
    """
    if settings.verbose:
        return [f"  {step.meaning}: {step.wire}" for step in steps]
    return [] if changes or len(steps) == 1 else [f"  {step.meaning}" for step in steps]


def tell_unasked(run: Invocation, question: str, steps: Sequence[Step]) -> None:
    """Say it when a variable or a file answered; where that moves a worn device, at once and whatever -q says."""
    source = run.sources["yes"]
    if source == COMMAND_LINE:
        return
    device = run.opened if run.opened is not None else run.planner()
    moves = not steps or any(step.moves for step in steps)  # a question without steps tells of them by itself
    if getattr(device, "worn", False) and moves:
        text = f"a device that someone may be wearing moves without asking, because of {source.where}: {question}"
        if not any(message.code == UNASKED for message in run.journal.messages):
            run.journal.messages.append(Message("warning", UNASKED, text))
            print_message("warning", text, "")
    elif source.level == FILE:
        run.journal.warn("yes-from-file", f"confirmation was skipped, because of yes = true in {source.where}")


# -- the settings ----------------------------------------------------------------------------------------------------


def resolve(ctx: click.Context, wires: tuple[str, ...] = (), device: str = "", *, urgent: bool = False) -> Settings:
    """The settings of this command; with `device`, as `-d` with that name would have them. Where each comes from is
    kept in its `CommandLine`.

    Raises UsageError for an environment variable or a configuration file that cannot be understood. With `urgent` they
    are passed over, each with its error in `CommandLine.passed_over`, as long as it is said which device it is.
    """
    told = command_line(ctx)
    given, unfit, told.unfit = told.given, told.unfit, []
    if unfit and not urgent:
        raise unfit[0]
    chosen = _Chosen()
    for key, value in given.items():
        chosen.offer(key, value, COMMAND_LINE)
    if device:
        chosen.values["device"], chosen.sources["device"] = device, COMMAND_LINE
    options = lasting_options(wires)
    passed = told.passed_over
    passed += [exc if isinstance(exc, UsageError) else UsageError(exc.format_message()) for exc in unfit]
    _take_environment(ctx, chosen, options, passed if urgent else None)
    command = " ".join(words_of(ctx))
    if command != WITHOUT_FILE:
        try:
            _from_file(chosen, options, passed if urgent else None, with_device=command not in WITHOUT_DEVICE)
        except UsageError as exc:
            if not urgent or not chosen.linked:
                raise
            passed.append(exc)
    try:
        if "facts" in chosen.values:
            _take_facts(ctx, chosen, told.own)
    except UsageError as exc:
        if not urgent:
            raise
        passed.append(exc)
    if urgent:
        _ignore_dry_run(chosen, passed)
    told.sources = chosen.sources
    return Settings().having({**chosen.values, "own": told.own})


def _take_facts(ctx: click.Context, chosen: _Chosen, own: Mapping[str, Any]) -> None:
    """What the facts file says where nothing else does. Raises UsageError for a file of another family."""
    from handctl.model import facts_file

    path = chosen.values["facts"]
    content = facts_file.read(path)
    family = getattr(ctx.command, "family", None)
    if family is not None and family.kind != content["family"]:
        raise UsageError(
            f"{path}: the facts of a device of family {content['family']}, not {family.kind}",
            hint=f"use the file of this device: `handctl prove {family.kind} -o FILE` makes one. Nothing was sent.",
            code="facts",
        )
    for key, value in facts_file.settings_of(content, path).items():
        if key not in own:
            chosen.offer(key, value, Source(FACTS, path))


def _ignore_dry_run(chosen: _Chosen, passed: list[UsageError]) -> None:
    """A dry run that a variable or the file has set is a safety catch: it keeps things from moving, and so does a stop."""
    source = chosen.sources.get("dry_run", COMMAND_LINE)
    if source != COMMAND_LINE:
        del chosen.values["dry_run"], chosen.sources["dry_run"]
        hint = "give -n on the command line to see the bytes and send nothing"
        passed.append(UsageError(f"dry_run, set in {source.where}, is ignored: a stop is always sent", hint=hint))


def _take_environment(
    ctx: click.Context, chosen: _Chosen, options: Sequence[SharedOption], passed: list[UsageError] | None
) -> None:
    """What the environment says where the command line does not; what makes no sense goes to `passed`, if there is one."""
    named = passed is not None and "device" in chosen.values  # it says where the device is, and no variable elsewhere
    linked = chosen.linked or named
    found: dict[str, tuple[SharedOption, Any]] = {}
    present = {name for name in os.environ if name.startswith("HANDCTL_")}
    for option in options if present else ():
        variable = f"HANDCTL_{str(option.name).upper()}"
        text = os.environ.get(variable)
        if not text or option.key in chosen.values or (linked and option.key in ("device", "port", "fake")):
            if text and passed is not None and named and not chosen.linked and option.key in ("port", "fake"):
                passed.append(UsageError(f"{variable} selects another link", hint=f"unset {variable}"))
            continue
        try:
            value = _from_environment(ctx, option, text)
        except UsageError as exc:
            if passed is None:
                raise
            passed.append(exc)
            continue
        if option.fixed is None or value:
            found[variable] = option, value if option.fixed is None else option.fixed
    for name in found and _pairs(
        {name: option.key for name, (option, value) in found.items() if value}, "environment", passed
    ):
        del found[name]
    if passed is not None and {"HANDCTL_DEVICE", "HANDCTL_FAKE"} <= found.keys():
        del found["HANDCTL_FAKE"]  # a simulator needs no stop
        passed.append(UsageError("HANDCTL_FAKE selects another link", hint="unset HANDCTL_FAKE"))
    for variable, (option, value) in found.items():
        chosen.offer(option.key, value, Source(ENVIRONMENT, variable))


class _Chosen:
    """The settings so far, from the highest level down: a setting that is present is kept."""

    def __init__(self) -> None:
        self.values: dict[str, Any] = {}
        self.sources: dict[str, Source] = {}

    @property
    def linked(self) -> bool:
        """Whether it is said where the device is."""
        return self.values.get("port") is not None or bool(self.values.get("fake"))

    def offer(self, key: str, value: Any, source: Source) -> None:
        """A value of a lower level, where no higher one has said anything."""
        if key not in self.values and not (key in ("port", "fake") and self.linked):
            self.values[key] = value
            self.sources[key] = source


def _from_file(
    chosen: _Chosen, options: Sequence[SharedOption], passed: list[UsageError] | None, with_device: bool
) -> None:
    path = config_path()
    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        if os.environ.get("HANDCTL_CONFIG") and with_device:
            raise UsageError(
                f"HANDCTL_CONFIG={path}: no such file",
                hint="correct or unset HANDCTL_CONFIG, or make the file with `handctl devices add`",
                code="config",
            ) from None
        if not (with_device and "device" in chosen.values):
            return
    except OSError:
        pass  # it may not be looked at, so it is there: reading it will say why
    from handctl.command.config_file import read_config

    config = read_config(path, passed)
    values = {
        option: entry
        for option in options
        if (entry := config.values.get(str(option.name))) and (option.fixed is None or entry.value)
    }
    twice = _pairs({str(option.name): option.key for option, entry in values.items() if entry.value}, path, passed)
    values = {option: entry for option, entry in values.items() if option.name not in twice}
    if with_device:
        if "device" in config.values and not chosen.linked:
            name, line = config.values["device"]
            chosen.offer("device", name, Source(FILE, f"{path}:{line}"))
        if "device" in chosen.values:
            device = config.find(chosen.values["device"])
            if device.kind:
                chosen.offer("kind", device.kind, Source(NAMED, f"{path}:{device.line}"))
            for key, entry in device.entries.items():
                chosen.offer(key, entry.value, Source(NAMED, f"{path}:{entry.line}"))
    for option, entry in values.items():
        if option.key == "device" or (option.key == "wire" and chosen.values.get("port")):
            continue  # the LINK says which wire it is
        value = entry.value if option.fixed is None else option.fixed
        chosen.offer(option.key, value, Source(FILE, f"{path}:{entry.line}"))


def _pairs(keys: dict[str, str], where: str, passed: list[UsageError] | None) -> list[str]:
    """Two entries of the file, or two variables, that speak of one setting: UsageError, or with `passed` the later ones."""
    said: dict[str, str] = {}
    later: list[str] = []
    for name, key in keys.items():
        about = "port" if key == "fake" else key
        if about in said:
            text = f"{where}: {said[about]} and {name} exclude each other"
            error = UsageError(text, hint="keep one of the two", code="config")
            if passed is None or about == "port":
                raise error
            passed.append(error)
            later.append(name)
            continue
        said[about] = name
    return later


def _from_environment(ctx: click.Context, option: SharedOption, text: str) -> Any:
    try:
        return (click.BOOL if option.is_flag else option.type).convert(text, option, ctx)
    except click.UsageError as exc:
        raise UsageError(
            f"environment variable HANDCTL_{str(option.name).upper()}={text}: {exc.message}", hint="correct or unset it"
        ) from exc


# -- the files ---------------------------------------------------------------------------------------------------------


class NamedFile(NamedTuple):
    """A file of this run: its name for the user, its path, whether it is only appended to, whether it has a sidecar."""

    label: str
    path: str
    grows: bool = False
    recorded: bool = False


def files_of(ctx: click.Context) -> tuple[list[NamedFile], list[NamedFile]]:
    """The files that the parameters of this command name: inputs, outputs."""
    inputs: list[NamedFile] = []
    outputs: list[NamedFile] = []
    for param in ctx.command.params:
        kind, given = param.type, ctx.params.get(param.name or "")
        if not isinstance(kind, InFile | OutFile):
            continue
        label = param.get_usage_pieces(ctx)[0] if isinstance(param, click.Argument) else param.opts[0]
        group = inputs if isinstance(kind, InFile) else outputs
        for path in given if isinstance(given, tuple) else (given,):
            if path and path != "-":
                group += [
                    NamedFile(label, f"{path}{ending}", kind.grows, bool(kind.additional))
                    for ending in ("", *kind.additional)
                ]
                if group is inputs and os.path.islink(path):  # what belongs to the file itself is no output, either
                    group += [NamedFile(label, f"{os.path.realpath(path)}{ending}") for ending in kind.additional]
    return inputs, outputs


def refuse_clashes(inputs: list[NamedFile], outputs: list[NamedFile]) -> None:
    """Raise UsageError when an output is an input or another output, under whatever name, a file that handctl keeps, or a recording.

    Called before any of them is opened: so an input is never lost, and a recording that cannot be repeated is not overwritten.
    """
    kept = str(state_path(""))
    for position, output in enumerate(outputs):
        for other in (*inputs, *outputs[:position]):
            if clash(output.path, other.path):
                same = "" if output.path == other.path else f" ({other.path})"
                raise UsageError(
                    f"{output.label} {output.path}: the same file as {other.label}{same}",
                    hint="name another file. Nothing was opened, and nothing was sent.",
                    code="same-file",
                )
        if not output.grows and os.path.realpath(output.path).startswith(os.path.join(os.path.realpath(kept), "")):
            raise UsageError(
                f"{output.label} {output.path}: handctl keeps its own records in {kept}",
                hint="name a file in another folder. Nothing was opened, and nothing was sent.",
                code="same-file",
            )
        if not output.recorded and os.path.exists(output.path):
            from handctl.record.csv_and_sidecar import is_recording

            if is_recording(output.path):
                raise UsageError(
                    f"{output.label} {output.path}: a recording, or the sidecar of one",
                    hint="name another file, or delete the recording first. Nothing was opened, and nothing was sent.",
                    code="file-exists",
                )
