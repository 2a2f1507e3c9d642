"""The options: those that every command, group and the root accept, those that several commands share, and what types their values have.

The level nearest the verb wins; `command.settings_and_checks.resolve` adds the environment and the configuration file.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cache, reduce
from typing import TYPE_CHECKING, Any

import click

from handctl.errors import UsageError
from handctl.families import FAMILIES, HISTORY, OwnOption
from handctl.fast_classes import NamedTuple
from handctl.model.export_formats import FORMATS as EXPORT_FORMATS

if TYPE_CHECKING:
    from handctl.command.family import Family

# -- numbers, whose messages say what they accept --------------------------------------------------------------------

NEGATIVE_NUMBERS = {"ignore_unknown_options": True}
"""Settings of a command that takes ``-100`` as an argument; `model.param.given` then refuses a mistyped option."""
LONGEST = 1e6
"""Seconds, 11 days: more is a slip of the pen, and more than some clocks of an operating system can wait for."""


def range_in_words(kind: click.IntRange | click.FloatRange) -> str:
    """The limits of a number: ``above 0, up to 1000000``."""
    low = "" if kind.min is None else f"above {kind.min:g}" if kind.min_open else f"{kind.min:g}"
    high = "" if kind.max is None else f"below {kind.max:.10g}" if kind.max_open else f"{kind.max:.10g}"
    if low and high:
        return f"{low}, up to {high}" if kind.min_open and not kind.max_open else f"{low} to {high}"
    return f"{low if kind.min_open else f'{low} or more'}" if low else f"{high} or less"


def _convert(self: Any, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
    """As the range of click that this is one of, in our words."""
    try:
        number = self.number(value)
    except ValueError:
        self.fail(f"{value} is not a {self.noun}.", param, ctx)
    if not float("-inf") < number < float("inf"):
        self.fail(f"{value} is not a finite number.", param, ctx)
    try:
        return self.range.convert(self, value, param, ctx)
    except click.BadParameter:
        self.fail(f"{value} is out of range: {range_in_words(self)}.", param, ctx)


class FiniteRange(click.FloatRange):
    """A finite number in a range."""

    number, noun, range = float, "number", click.FloatRange
    _describe_range, convert = range_in_words, _convert


class WholeRange(click.IntRange):
    """A whole number in a range."""

    number, noun, range = int, "whole number", click.IntRange
    _describe_range, convert = range_in_words, _convert


SECONDS = FiniteRange(min=0, min_open=True, max=LONGEST)
"""A number above 0 that a clock can wait for."""


class Hertz(FiniteRange):
    """Samples a second: 0 for as fast as it goes, or a rate whose period a clock can wait for."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        rate = super().convert(value, param, ctx)
        if 0 < rate < 1 / LONGEST:
            self.fail(f"{value} is one sample in more than {LONGEST:.0f} seconds.", param, ctx)
        return rate


# -- files ----------------------------------------------------------------------------------------------------------


class _File(click.Path):
    """`additional`: suffixes of files that belong to it. `grows`: it is only appended to."""

    reads = False

    def __init__(self, *, additional: tuple[str, ...] = (), grows: bool = False) -> None:
        # Of one to write a folder is refused where it is known what is written.
        super().__init__(dir_okay=not self.reads)
        self.additional = additional
        self.grows = grows


class InFile(_File):
    """A file that a command reads."""

    reads = True


class OutFile(_File):
    """A file that a command writes. "-" is stdout for --output alone, and no file of that name."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if value == "-":
            if getattr(param, "key", "") == "output":
                return None
            self.fail("this cannot go to stdout: give the name of a file (./- for a file called -).", param, ctx)
        from handctl.system.disk import is_device

        if is_device(value):
            self.fail(f"{value} is a device, not a file. To connect to it, use -p {value}.", param, ctx)
        return super().convert(value, param, ctx)


# -- what a command line has said ---------------------------------------------------------------------------------------

CHOOSES = ("port", "device", "id")
"""Settings that say which device is meant. Given twice at one level, they leave it open."""
FORMATS = ("table", "plain", "json", "ndjson", "csv", "openmetrics")
META = "handctl"
"""Key in click's shared meta: the `CommandLine` of a command line."""


class Source(NamedTuple):
    """Where a setting comes from: its level in words, and the variable or the FILE:LINE."""

    level: str
    where: str = ""


class CommandLine:
    """What a command line has said so far, and who runs it: what all levels of click's contexts share.

    given        settings by key; a deeper level overwrites an earlier one
    levels       setting -> the level that gave it: 0 is `handctl` itself, 1 a family, 2 a command
    own          the same of options that only some commands of one family have
    sources      setting -> Source, for every setting that is not the default
    stopping     whether this may be a command that nothing holds up, as far as its line was read
    unfit        errors of options in such a line, for whoever knows which command it is
    passed_over  errors of the line, the environment and the file that did not hold up an urgent command
    bare         no word that is parsed is an option, so that none need be looked for
    include_ids  the result may hold what tells one device from another
    words        the words of the line, without `handctl`
    taken        who takes a line that is parsed and not run
    run          the `Run` of this line where it was read before, in a script or a session
    """

    def __init__(self) -> None:
        self.given: dict[str, Any] = {}
        self.levels: dict[str, int] = {}
        self.own: dict[str, Any] = {}
        self.sources: dict[str, Source] = {}
        self.stopping = False
        self.unfit: list[click.UsageError | UsageError] = []
        self.passed_over: list[UsageError] = []
        self.bare = False
        self.include_ids = False
        self.words: tuple[str, ...] = ()
        self.taken: Callable[[click.Context], object] | None = None
        self.run: Any = None


def command_line(ctx: click.Context) -> CommandLine:
    """Of the command line of this context."""
    found: CommandLine | None = ctx.meta.get(META)
    if found is None:
        found = ctx.meta[META] = CommandLine()
    return found


COMMAND_LINE = Source("command line")
ENVIRONMENT, NAMED, FILE, FACTS = "environment", "named device", "configuration file", "facts file"
WIRE_NAMES = {"serial": "a serial line", "can": "CAN", "modbus-tcp": "Modbus TCP"}
"""What a wire is called in help."""
CONNECTION, OUTPUT, WRITING = "Connection", "Output", "Writing"
"""Sections of the common options."""
WITHOUT_FILE = "completion"
"""Its script must come out whatever the file says, also when that is damaged."""
WITHOUT_DEVICE = ("devices list", "devices add", "devices remove")
"""They edit what the named devices are made of, so they must not need one."""


def given_twice(option: click.Option, values: Sequence[str], *, stopping: bool = False) -> UsageError:
    """The error of an option with these different values."""
    hint = "leave one of them out"
    if isinstance(option, SharedOption):
        if option.key == "device":
            hint = f"for both, give -d {','.join(values)}"
        elif stopping:
            hint = f"the stop is for {values[-1]}. Run it for the other one too"
    text = f"{max(option.opts, key=len)} is given twice, as {' and '.join(values)}"
    return UsageError(text, hint=hint, code="twice")


def words_of(ctx: click.Context) -> list[str]:
    """The words of a command after `handctl`."""
    above = words_of(ctx.parent) if ctx.parent is not None else []
    words = (ctx.info_name or "").split()
    return [*above, *words] if ctx.parent is not None else words[1:]


class SharedOption(click.Option):
    """An option that means the same at root, group and leaf. It writes `settings key = value` into `CommandLine.given`.

    One that must be `typed` has neither a variable nor a key in the configuration file. `family`: not every family has it.
    """

    def __init__(
        self,
        names: Sequence[str],
        section: str,
        key: str = "",
        fixed: Any = None,
        typed: bool = False,
        family: bool = False,
        **more: Any,
    ) -> None:
        self.section = section
        self.family = family
        self.fixed = fixed
        self.typed = typed
        super().__init__(list(names), expose_value=False, callback=self._remember, **more)
        self.key = key or str(self.name)

    def handle_parse_result(
        self, ctx: click.Context, opts: Mapping[str, Any], args: list[str]
    ) -> tuple[Any, list[str]]:
        """As click does, but for what was not given: it says nothing. What makes no sense does not hold up a stop; which of two
        places it is meant for is no such thing."""
        if self.name not in opts:
            return None, args
        try:
            return super().handle_parse_result(ctx, opts, args)
        except (click.UsageError, UsageError) as exc:
            if not command_line(ctx).stopping or self.key in ("port", "fake"):
                raise
            command_line(ctx).unfit.append(exc)
            return None, args

    def _remember(self, ctx: click.Context, param: click.Parameter, value: Any) -> None:
        source = ctx.get_parameter_source(param.name or "")
        if source is not click.core.ParameterSource.COMMANDLINE or (not value and isinstance(value, bool)):
            return
        given, levels = command_line(ctx).given, command_line(ctx).levels
        level = len(words_of(ctx))
        if self.key in ("port", "fake"):
            other = "fake" if self.key == "port" else "port"
            if levels.get(other) == level:
                raise UsageError("--port and --fake exclude each other", hint="give one of them")
            given.pop(other, None)
            levels.pop(other, None)
        if self.key == "wire" and levels.get("wire") == level and given["wire"] != self.fixed:
            raise UsageError(f"--{given['wire']} and --{self.fixed} exclude each other", hint="give one of them")
        given[self.key] = value if self.fixed is None else self.fixed
        levels[self.key] = level


@cache
def shared_options(
    wires: tuple[str, ...] = (), own: tuple[OwnOption, ...] = (), refused: frozenset[str] = frozenset()
) -> Sequence[SharedOption]:
    """The options that every command, group and the root accept, with those of a family that has several `wires` and some
    of its `own`. What is `refused`, by key, is understood, but not offered; "" stands for the section CONNECTION.
    They hold nothing of a run, so they are made once.
    """
    connect, output, safety = CONNECTION, OUTPUT, WRITING
    found = [
        SharedOption(["-p", "--port"], connect, metavar="LINK", help="The link to the device: /dev/ttyUSB0, COM3, usb:VID:PID[:SERIAL], tcp://HOST:PORT, fake://…, replay:FILE, any pyserial URL."),
        SharedOption(["--fake"], connect, is_flag=True, help="Use the built-in simulator of this device."),
        SharedOption(["--facts"], connect, type=InFile(), metavar="FILE", help="What `handctl prove` found out about this device: it takes the place of handctl's assumptions."),
        *(SharedOption([f"--{wire}"], connect, key="wire", fixed=wire, family=True, is_flag=True, help=f"With --fake or --dry-run, use {WIRE_NAMES[wire]}{' (the default)' if wire == wires[0] else f' instead of {WIRE_NAMES[wires[0]]}'}.") for wire in wires),
        SharedOption(["-d", "--device"], connect, metavar="NAME", help="A named device from the configuration file (see `handctl devices`). A,B or '*' selects several."),
        *(SharedOption([f"--{option.name}"], connect, family=True, is_flag=option.flag, type=click.Choice(option.choices) if option.choices else None, metavar=option.metavar or None, help=option.help) for option in own),
        SharedOption(["--id"], connect, type=int, metavar="N", help="Device id."),
        SharedOption(["--baud"], connect, type=WholeRange(min=1), metavar="N", help="Baud rate of the serial port in bit/s."),
        SharedOption(["--timeout"], connect, type=SECONDS, metavar="S", help="Seconds to wait for a reply."),
        SharedOption(["--deadline"], connect, type=SECONDS, metavar="S", help="Time limit for the whole command, in seconds."),
        SharedOption(["--retries"], connect, type=WholeRange(min=0, max=100), metavar="N", help="Retry a read up to N times if there is no valid reply. Writes are never retried."),
        SharedOption(["--trace"], connect, type=OutFile(), metavar="FILE", help="Record every byte with its time to FILE. -p replay:FILE plays it back."),
        SharedOption(["--format"], output, type=click.Choice(FORMATS), help="Output format (default: table)."),
        SharedOption(["--json"], output, key="format", fixed="json", is_flag=True, help="Same as --format json. A stream prints one row per line."),
        SharedOption(["--csv"], output, key="format", fixed="csv", is_flag=True, help="Same as --format csv."),
        SharedOption(["-o", "--output"], output, type=OutFile(), metavar="FILE", help="Write output to FILE instead of stdout. FILE is replaced only when complete."),
        SharedOption(["--append"], output, is_flag=True, help="With --csv -o FILE: add the rows to FILE. The header is written once, and the columns must match. With `log FILE`: record the next trial, into FILE with a number."),
        SharedOption(["--time"], output, is_flag=True, help="Add the date and time (UTC) to each row of CSV, plain or JSON."),
        SharedOption(["--no-formulas"], output, is_flag=True, help="In CSV, put ' before any text that a spreadsheet would take for a formula."),
        SharedOption(["--wide"], output, key="wide", fixed=True, is_flag=True, help="In CSV, write one row per sample, with a column for each quantity."),
        SharedOption(["--long", "--no-wide"], output, key="wide", fixed=False, is_flag=True, help="In CSV, write one row per value (the default, except for realtime and watch -o FILE.csv)."),
        SharedOption(["--color"], output, type=click.Choice(["auto", "always", "never"]), help="When to use colour (default: auto, which respects NO_COLOR)."),
        SharedOption(["-q", "--quiet"], output, is_flag=True, help="Print only errors to stderr."),
        SharedOption(["-v", "--verbose"], output, is_flag=True, help="Print every byte to stderr, in the form that --trace records."),
        SharedOption(["--debug"], output, is_flag=True, help="Show tracebacks."),
        SharedOption(["-n", "--dry-run"], safety, is_flag=True, help="Print the exact bytes that would be written, and send nothing."),
        SharedOption(["-y", "--yes"], safety, is_flag=True, help="Answer yes to all confirmations."),
        SharedOption(["--history"], safety, type=click.Choice(HISTORY), help="Which writes `handctl history` shows later: those to devices (default), all (simulated devices too), or none (off)."),
        SharedOption(["--assume-identity"], safety, typed=True, is_flag=True, help="Skip the check of the device's identity. Only accepted on the command line."),
    ]  # fmt: skip
    for option in found:
        option.hidden = option.key in refused or (option.section == CONNECTION and "" in refused)
    return found


def own_options(kind: str = "") -> tuple[OwnOption, ...]:
    """Those that every command of a family has, or of all families in the order in which the file's keys are listed."""
    rows = [FAMILIES[kind]] if kind else FAMILIES.values()
    found = [option for row in rows for option in row.options if not option.asked]
    return tuple(sorted(found, key=lambda option: not option.named))


def lacking(family: Family) -> dict[str, str]:
    """What the protocol of a family does not have: the key of the option -> its name."""
    return ({} if family.ids else {"id": "device ids"}) | ({"baud": "serial port"} if family.baud is None else {})


def refuse_lacking(family: Family, given: Collection[str]) -> None:
    """Raise UsageError when an option is `given` for what the protocol of this family does not have."""
    for key, what in lacking(family).items():
        if key in given:
            raise UsageError(f"--{key}: {family.kind} has no {what}", hint=f"run the command without --{key}")


@cache
def lasting_options(wires: tuple[str, ...]) -> Sequence[SharedOption]:
    """The shared options that a variable and the configuration file may hold."""
    return [option for option in shared_options(wires, own_options()) if not option.typed]


# -- options that only some commands of one family have -------------------------------------------------------------


class FamilyOption(click.Option):
    """`@click.option("--operator", cls=FamilyOption, of="ekso")`. `check` raises UsageError for a value that makes no sense."""

    def __init__(self, names: Sequence[str], of: str, check: Callable[[Any], object] | None = None) -> None:
        (option,) = (row for row in FAMILIES[of].options if f"--{row.name}" in names)
        self._check = check
        super().__init__(
            list(names),
            envvar=f"HANDCTL_{option.key.upper()}",
            metavar=option.metavar,
            help=option.help,
            expose_value=False,
            callback=self._remember,
        )

    def _remember(self, ctx: click.Context, param: click.Parameter, value: Any) -> None:
        if value is None:
            return
        if self._check is not None:
            self._check(value)
        command_line(ctx).own[param.name or ""] = value


# -- options that several commands have -------------------------------------------------------------------------------

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def combined_options(*options: Decorator) -> Decorator:
    """Decorator: these options, in this order."""
    return lambda body: reduce(lambda made, option: option(made), reversed(options), body)


def ending(what: str) -> Decorator:
    """Decorator: the options that end a stream of `what`, `count` and `duration`."""
    return combined_options(
        click.option("--count", type=WholeRange(min=1), metavar="N", help=f"End after N {what}."),
        click.option("--duration", type=SECONDS, metavar="S", help="End after S seconds."),
    )


def streaming(rate: float) -> Decorator:
    """Decorator: the options of a stream, `rate` (with this default), `count` and `duration`."""
    return combined_options(
        click.option(
            "--rate",
            type=Hertz(min=0),
            default=rate,
            show_default=True,
            metavar="HZ",
            help="Samples per second (0: as fast as the device replies).",
        ),
        ending("samples"),
    )


watch_options = streaming(10.0)
"""Of `watch`, with the default rate."""
reads_option = click.option(
    "--count",
    type=WholeRange(1, 10000),
    default=100,
    show_default=True,
    metavar="N",
    help="Read the device N times to measure the error rate.",
)
"""Of `handctl doctor`, and of a family's."""
scan_options = combined_options(
    click.option(
        "--ids",
        metavar="IDS",
        help="Ids to try, such as 1-20 or 1,2,4-12. Default: the one given with --id, otherwise all (on CAN 1 to 254), starting with the usual one.",
    ),
    click.option(
        "--all",
        "find_all",
        is_flag=True,
        help="Keep searching after the first device, without a time limit, and search a silent line again with longer timeouts.",
    ),
)
"""How far a search goes."""


REPLY_WAIT = click.option(
    "--wait",
    type=SECONDS,
    default=0.5,
    show_default=True,
    metavar="S",
    help="Listen for S seconds after the last byte.",
)
page_options = combined_options(
    click.option(
        "--include-ids",
        is_flag=True,
        help="Include serial numbers, the wearer's number (pilot id), and the replies that contain them.",
    ),
    click.option("--force", is_flag=True, help="Replace FILE.html if it exists."),
)
"""Of what writes a report."""
ALWAYS = click.option("--always", is_flag=True, help="Write settings even if they already have this value.")
SKIP = click.option(
    "--skip",
    multiple=True,
    metavar="NAME",
    help="Leave out this setting of the snapshot, or one element of it. Can be repeated.",
)
LIMIT = click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="NAME=VALUE",
    help="At the end, exit with code 7 if NAME rose above VALUE or left NAME=LOWEST..HIGHEST. Can be repeated.",
)
UNTIL = click.option(
    "--until",
    "until",
    multiple=True,
    metavar="NAME=VALUE",
    help="End when NAME rises above VALUE or leaves NAME=LOWEST..HIGHEST. Can be repeated.",
)
BOUNDS = combined_options(LIMIT, UNTIL)


mark_options = combined_options(
    click.option("--mark", metavar="TEXT", default="", help="Mark the first row with TEXT."),
    click.option(
        "--mark-udp",
        type=WholeRange(0, 65535),
        metavar="PORT",
        help="Each datagram to this UDP port of this computer sets a mark with its text (0: any free port).",
    ),
    click.option(
        "--lsl",
        is_flag=True,
        help="Send rows and marks on the Lab Streaming Layer, and record the marks that other programs send there. Needs handctl[lsl].",
    ),
    click.option("--mark-stdin", is_flag=True, help="Each line on standard input sets a mark with its text."),
)
"""How the rows of a recording get marks."""
log_options = combined_options(
    click.argument("file", type=OutFile(additional=(".json",))),
    streaming(0.0),
    mark_options,
    click.option(
        "--silence",
        type=SECONDS,
        default=60.0,
        show_default=True,
        metavar="S",
        help="End after S seconds without a valid reply. handctl also waits this long for a lost port to come back.",
    ),
    click.option("--force", is_flag=True, help="Overwrite FILE."),
    click.option(
        "--check",
        is_flag=True,
        help="Record nothing: check the recording FILE, and show its segments, its gaps, and how well the device's clock and this computer's agree. "
        "Needs no device. Exit code 7 if it is incomplete or does not match its sidecar.",
    ),
    BOUNDS,
)
"""FILE, and the options of `log_command.RequestedOptions`."""
LOG = click.argument("log", metavar="LOG", type=InFile(additional=(".json",)))


_listed = [
    f"{name} ({one.about}{', needs handctl[' + name + ']' if one.library else ''})"
    for name, one in EXPORT_FORMATS.items()
]
EXPORTS = f"{', '.join(_listed[:-1])} or {_listed[-1]}."
"""What --to offers every family, in its help."""
SEGMENT = click.option("--segment", type=WholeRange(min=1), metavar="N", help="Only segment N.")
RESAMPLE = click.option(
    "--rate",
    type=FiniteRange(min=0, min_open=True, max=1000),
    metavar="HZ",
    help="Only for c3d, and mot of an EksoNR: resample to this rate, never across a gap (c3d: default is the rate of the log).",
)
export_options = combined_options(
    LOG,
    click.option("--to", "kind", type=click.Choice(list(EXPORT_FORMATS)), help=f"Output: {EXPORTS}"),
    SEGMENT,
    RESAMPLE,
)


def suspendable(seconds: float) -> Decorator:
    """Decorator: `may_suspend`, for what drives motors that do not stop by themselves: else it may hang for so long."""
    return click.option(
        "--may-suspend",
        is_flag=True,
        help=f"Do not stop the motors when this command is suspended (SIGSTOP) for {seconds:g} s.",
    )
