"""The command tree: groups and commands that accept the shared options, and the root.

Help and completion load click and the data in `families`, no device family. The help of a command shows its arguments, its own
options and its examples; of the common options only the names, and of those only what it accepts: `Described.refused` is the
one rule, which man pages and completions follow too.
"""

from __future__ import annotations

import gc
import importlib
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import click

from handctl import __version__
from handctl.command.family import Family
from handctl.command.options import (
    CHOOSES,
    CONNECTION,
    OUTPUT,
    WRITING,
    InFile,
    OutFile,
    SharedOption,
    command_line,
    given_twice,
    lacking,
    own_options,
    shared_options,
)
from handctl.families import COMMANDS, LISTED

if TYPE_CHECKING:
    from handctl.command.run import PlannedAction, Run
    from handctl.model.result import Table

MOST = 1000
"""Characters of a first sentence: all of it."""
HEADINGS = ("Inspect", "Move", "Settings", "Service", "Files")
"""What a technician wants to do: the commands of a family are listed below these, in this order."""
USUAL = ("status", "dump", "get", "watch", "describe", "stop", "set", "report", "doctor", "snapshot", "diff", "restore")
"""What every device has stands first below its heading, in this order."""
TRAITS = ("heading", "writes", "streams", "stops", "offline", "offline_when", "asks", "family", "to_file")
ALONE = ("sim", "completion", "batch", "shell", "service")
"""Commands that are no line of a batch."""


def _show_help(ctx: click.Context, _param: click.Parameter, value: bool) -> None:
    if value and not ctx.resilient_parsing:
        if ctx.terminal_width is None:
            from handctl.command.help_text import columns

            ctx.terminal_width = max(min(columns(), ctx.max_content_width or 80) - 2, 50)
        sys.stdout.write(ctx.get_help() + "\n")
        ctx.exit()


HELP = click.Option(
    ["-h", "--help"], is_flag=True, expose_value=False, is_eager=True, callback=_show_help, help="Show this help."
)
"""Of every command. It goes to stdout as it is: click would make a stream in ASCII UTF-8, and leave nothing to a substitute."""


class NoCommand(click.UsageError):
    """A group was called without a command: the message is its help, for stderr."""


def need_command(ctx: click.Context) -> None:
    """For a group without arguments, before it is parsed: click 8.1 would take its help for what was asked, 8.2 and later do not."""
    if not ctx.resilient_parsing:
        raise NoCommand(ctx.get_help(), ctx)


def plain_help(command: click.Command) -> None:
    """Help of a command that is not one of ours, and of those below it, goes where ours does and shows examples."""
    if "get_help_option" not in vars(command):
        options = command.format_options

        def with_examples(ctx: click.Context, formatter: click.HelpFormatter) -> None:
            from handctl.command.help_text import write_examples

            options(ctx, formatter)
            write_examples(ctx, formatter)

        command.get_help_option = lambda ctx: HELP  # type: ignore[method-assign]
        command.format_options = with_examples  # type: ignore[method-assign]
    if isinstance(command, click.Group) and "parse_args" not in vars(command):
        parse = command.parse_args

        def parse_args(ctx: click.Context, args: list[str]) -> list[str]:
            if not args:
                need_command(ctx)
            return parse(ctx, args)

        command.parse_args = parse_args  # type: ignore[method-assign]
        for below in command.commands.values():
            plain_help(below)


class Described(click.Command):
    """A command that accepts the common options, and lists those that make sense after its own.

    They are made when a command is parsed, not when it is defined: most commands of a family are never used in a run.
    """

    family: Family | None = None
    heading = ""
    writes = False
    offline = False
    _own: list[click.Parameter] | None = None
    _shared: list[click.Parameter] | None = None
    _parser: tuple[list[click.Parameter], Any] | None = None
    _once: Sequence[click.Option] = ()
    """Options of which `_parser` keeps all values: two different ones contradict each other, for the option chooses the device, or what a
    command that writes does. Of any other option the last one counts, as everywhere on Unix: an alias may hold the first one."""

    def refused(self) -> frozenset[str]:
        """Common options that this command cannot use, by key; "" means all options of the link.

        Who gives one all the same is told why (`command.settings_and_checks`, `command_tree.Command`).
        """
        keys = set() if self.writes else {"dry_run", "yes", "history"}
        if not self.writes and self.family is None:
            keys |= {"assume_identity"}
        if self.offline:
            keys |= {"", "assume_identity"}
        if self.family is not None:
            keys |= {*lacking(self.family)}
        return frozenset(keys)

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        if self._own is None:
            self._own = super().get_params(ctx)
        if command_line(ctx).bare:
            return [*self._own]
        if self._shared is None:
            family = self.family
            wires, own = (family.wires, own_options(family.kind)) if family is not None else ((), ())
            # An option of its own stands for the shared one.
            named = {name for param in self.params for name in param.opts}
            shared = shared_options(wires, own, self.refused())
            self._shared = [option for option in shared if not named & {*option.opts}]
        return [*self._own, *self._shared]

    def make_parser(self, ctx: click.Context) -> Any:
        """As click does, but once for the same options: a parser keeps nothing of a line but its context.

        Short options are found at once. Else each that is typed costs click the import of difflib, for what it would suggest
        in place of a long one.
        """
        params = self.get_params(ctx)
        if self._parser is None or params != self._parser[0]:
            made = super().make_parser(ctx)
            long, short = (getattr(made, name, None) for name in ("_long_opt", "_short_opt"))
            if isinstance(long, dict) and isinstance(short, dict):
                long.update(short)
                once = {}
                for option in long.values():
                    one = option.obj
                    contradicts = one.key in CHOOSES if isinstance(one, SharedOption) else self.writes
                    if contradicts and not (one.multiple or one.is_flag or one.count):
                        option.action, once[one.name] = "append", one
                self._once = [*once.values()]
            self._parser = params, made
        made = self._parser[1]
        parser: Any = object.__new__(type(made))  # as `copy.copy`, which takes ten times as long
        vars(parser).update(vars(made), ctx=ctx)
        if self._once:
            parser.parse_args = partial(self._parsed, parser)
        return parser

    def _parsed(self, parser: Any, args: list[str]) -> tuple[dict[str, Any], list[str], list[click.Parameter]]:
        """What click's parser makes of the words. Raises UsageError for an option that contradicts itself."""
        found, rest, order = type(parser).parse_args(parser, args)
        ctx = parser.ctx
        for option in self._once:
            if option.name not in found:
                continue
            values = list(dict.fromkeys(found[option.name]))
            found[option.name] = values[-1]
            if len(values) == 1 or ctx.resilient_parsing:
                continue
            stopping = command_line(ctx).stopping
            if not stopping or (isinstance(option, SharedOption) and option.key != "id"):
                raise given_twice(option, values)
            # It does not hold up a stop: that is for all that an option of its own could mean, and for the last id.
            command_line(ctx).unfit.append(given_twice(option, values, stopping=True))
            if not isinstance(option, SharedOption):
                del found[option.name]
        return found, rest, order

    def get_help_option(self, ctx: click.Context) -> click.Option:
        return HELP

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        common = [param for param in self.get_params(ctx) if isinstance(param, SharedOption)]
        own = [param for param in self.get_params(ctx) if isinstance(param, click.Option) and param not in common]
        records = [param.get_help_record(ctx) for param in own]
        with formatter.section("Options"):
            formatter.write_dl([record for record in records if record is not None])
        self.format_examples(ctx, formatter)
        self.format_common(ctx, formatter, [param for param in common if not param.hidden])

    def format_examples(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        from handctl.command.help_text import write_examples

        write_examples(ctx, formatter)

    def format_common(
        self, ctx: click.Context, formatter: click.HelpFormatter, options: Sequence[SharedOption]
    ) -> None:
        """The common options of a command: their names, and where they are explained."""
        from handctl.command.help_text import wrapped

        with formatter.section("Common options (see `handctl help options` or handctl(1))"):
            for title in (CONNECTION, OUTPUT, WRITING):
                names = [max(option.opts, key=len) for option in options if option.section == title]
                if names:
                    wrapped(formatter, f"{title}: {', '.join(names)}", "  ", "    ")


class Command(Described):
    """A leaf command with the shared options. Its traits are given by their names:

    heading  one of HEADINGS
    writes   --dry-run makes sense for it
    streams  --json means NDJSON
    stops    an emergency, which nothing holds up
    offline  it never opens a link
    offline_when  (its parameters) -> whether it opens none with these
    asks     it asks first, always or in these words, behind a ";" those of when it does not
    to_file  what it makes is a file, which -o names
    """

    streams = False
    stops = False
    asks: bool | str = False
    to_file = False
    offline_when: Callable[[Mapping[str, Any]], bool] | None = None

    def __init__(self, *args: Any, **more: Any) -> None:
        vars(self).update({trait: more.pop(trait) for trait in TRAITS if trait in more})
        super().__init__(*args, **more)
        self.wires = self.family.wires if self.family is not None else ()

    def opens_none(self, params: Mapping[str, Any]) -> bool:
        """Whether it opens no link with these parameters."""
        return self.offline or (self.offline_when is not None and self.offline_when(params))

    @cached_property
    def only_reads(self) -> bool:
        """Whether it asks a device, and neither writes to it nor opens a file."""
        files = any(isinstance(param.type, InFile | OutFile) and param.name != "output" for param in self.params)
        return self.family is not None and not (self.writes or self.streams or self.offline or files)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As click does; its message on the number of values knows neither the command nor what the values are called."""
        command_line(ctx).stopping = self.stops
        try:
            return super().parse_args(ctx, args)
        except click.UsageError as exc:
            text = exc.message
            for param in self.params:
                if isinstance(param, click.Argument) and param.metavar:
                    text = text.replace(f"Argument '{param.name}' takes", f"{param.metavar} takes")
            if exc.ctx is not None and text == exc.message:
                raise
            raise click.UsageError(text, exc.ctx or ctx) from exc

    def invoke(self, ctx: click.Context) -> None:
        if (taken := command_line(ctx).taken) is not None:
            taken(ctx)
            return
        from handctl.command.run import Run
        from handctl.command.settings_and_checks import resolve

        run = Run(ctx, resolve(ctx, self.wires, urgent=self.stops), self.family)
        if not gc.isenabled():  # see `cli.main`; no loop is held up by a look through what was imported
            gc.freeze()
            gc.enable()
        with run.shown():
            run.carry_out(self.body(run))

    def body(self, run: Run) -> Callable[[], Table | PlannedAction | None]:
        """What a run of the parsed line carries out: it gets the run first, then what was parsed."""
        assert self.callback is not None
        return partial(self.callback, run, **run.context.params)


class Group(Described, click.Group):
    """A group with the shared options. `first`: commands listed first below their heading, after the common ones."""

    command_class = Command

    def __init__(
        self, *args: Any, heading: str = "", first: Sequence[str] = (), family: Family | None = None, **more: Any
    ) -> None:
        super().__init__(*args, **more)
        self.heading = heading
        self.first = (*USUAL, *first)
        self.family = family

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if not args:
            need_command(ctx)
        told = command_line(ctx)
        told.words = told.words if ctx.parent is not None else tuple(args)
        told.stopping = "stop" in args
        before = told.bare
        try:
            if not (ctx.resilient_parsing or args[0].startswith("-")):
                told.bare = True  # an option would be the command's: what follows its name is parsed there
            return super().parse_args(ctx, args)
        finally:
            told.bare = before

    def refused(self) -> frozenset[str]:
        """What all its commands refuse."""
        below = [one.refused() for one in self.commands.values() if isinstance(one, Described)]
        return frozenset.intersection(*below) if below else frozenset()

    def format_examples(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Its commands have them."""

    def format_common(
        self, ctx: click.Context, formatter: click.HelpFormatter, options: Sequence[SharedOption]
    ) -> None:
        """List the family's own options in full, and say where the others are explained."""
        mine = [option for option in options if option.family]
        if mine:
            with formatter.section(f"Options accepted by every {self.name} command"):
                formatter.write_dl([record for option in mine if (record := option.get_help_record(ctx)) is not None])
        formatter.write_paragraph()
        formatter.write_text(
            f"Run `{ctx.command_path} COMMAND -h` for one command with examples, `handctl help options` for the common options, `handctl help` for the guides."
        )

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        name = args[0]
        if self.get_command(ctx, name) is None and not name.startswith("-") and not ctx.resilient_parsing:
            from handctl.command.suggestions import meant, without_device

            raise click.UsageError(
                f"No such command {name!r}.{without_device(name) or meant(name, self.commands)}", ctx
            )
        return super().resolve_command(ctx, args)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """By heading; below it first what every device has, then `first`, then the rest as it was added."""
        headings, first = (*HEADINGS, ""), self.first

        def place(name: str) -> tuple[int, int]:
            rank = first.index(name) if name in first else len(first)
            return headings.index(getattr(self.commands[name], "heading", "")), rank

        return sorted(self.commands, key=place)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        self.format_commands(ctx, formatter)
        super().format_options(ctx, formatter)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        rows = self.listed(ctx)
        widest = max((len(name) for _, name, _ in rows), default=0)
        for heading in dict.fromkeys(heading for heading, _, _ in rows):
            with formatter.section(heading):
                formatter.write_dl([(name.ljust(widest), text) for at, name, text in rows if at == heading])

    def listed(self, ctx: click.Context) -> list[tuple[str, str, str]]:
        """Heading, name and whole first sentence of each command: click cuts it, and what is left may mislead."""
        found = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        return [
            (getattr(one, "heading", "") or "Commands", name, one.get_short_help_str(MOST))
            for name, one in found
            if one is not None and not one.hidden
        ]

    def verb(self, name: str, heading: str = "", **traits: Any) -> Callable[[Callable[..., Any]], Command]:
        """Decorator: add a leaf command whose body gets the Run first and returns a Table (or None).

        A family's command needs a `heading` of HEADINGS, below which the help lists it; `traits` as in `Command`.
        """
        return self.command(name, heading=heading, family=self.family, **traits)  # type: ignore[return-value]


class Root(Group):
    """The root: lists its commands from `families` and imports the module of the one that is used.

    in_lines  further commands of a line that is one of several (`command.command_lines`)
    """

    in_lines: dict[str, click.Command] = {}  # noqa: RUF012 - there is one root

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [name for names in LISTED.values() for name in names]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return self.in_lines.get(cmd_name) if command_line(ctx).taken is not None else None
        command = importlib.import_module(COMMANDS[cmd_name][0]).cli
        assert isinstance(command, click.Command)
        if not isinstance(command, Described):
            plain_help(command)
        return command

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """With -d the family may be left out: the device says which it is."""
        name = args[0]
        if name in ALONE and command_line(ctx).taken is not None:
            raise click.UsageError(f"`handctl {name}` cannot be one of several commands.", ctx)
        if name in COMMANDS or name.startswith("-") or self.get_command(ctx, name) is not None:
            return super().resolve_command(ctx, args)
        from handctl.command.config_file import read_config
        from handctl.command.suggestions import device_in, top

        device = device_in(ctx, args)
        if device is None:
            raise click.UsageError(f"No such command {name!r}.{top(args)}", ctx)
        kind = read_config().find(device).kind
        return kind, self.get_command(ctx, kind), args

    def listed(self, ctx: click.Context) -> list[tuple[str, str, str]]:
        """From `families`: nothing of a command is loaded."""
        found = ((heading, name, COMMANDS[name][1]) for heading, names in LISTED.items() for name in names)
        return [(heading, name, f"{text[0].upper()}{text[1:]}.") for heading, name, text in found]

    def format_examples(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """To begin with."""
        Described.format_examples(self, ctx, formatter)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[Any]:
        from click.shell_completion import CompletionItem

        names = [CompletionItem(name, help=text) for name, (_, text) in COMMANDS.items() if name.startswith(incomplete)]
        return names or click.Command.shell_complete(self, ctx, incomplete)


root = Root(
    "handctl",
    help="Diagnose and configure hand and exoskeleton devices.",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)


click.version_option(__version__, "-V", "--version", message=f"handctl {__version__}", help="Show the version.")(root)
