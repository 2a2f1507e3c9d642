"""What `-h` shows, and which of the common options a command offers. Imports click and data only.

A command shows its arguments, its own options and its examples; of the common options only the names, and of those only
what it accepts: `Described.refused` is the one rule, which man pages and completions follow too.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from copy import copy
from typing import Any

import click

from handctl.frame.examples import MOST as MOST_EXAMPLES
from handctl.frame.examples import examples_of
from handctl.frame.family import Family
from handctl.frame.options import CONNECTION, OUTPUT, WRITING, SharedOption, own_options, shared_options, words_of

MOST = 1000
"""Characters of a first sentence: all of it."""
HEADINGS = ("Look", "Move", "Settings", "Service", "Files")
"""What a technician wants to do: the commands of a family are listed below these, in this order."""
BARE = "handctl.bare"
"""Key in click's shared meta: no word that is parsed is an option, so that none need be looked for."""
USUAL = ("status", "dump", "get", "watch", "describe", "stop", "set", "report", "doctor", "snapshot", "diff", "restore")
"""What every device has stands first below its heading, in this order."""


def columns() -> int:
    """Width of the terminal, as shutil says: its import, with all its archives, would be a tenth of a help's time."""
    try:
        return int(os.environ["COLUMNS"]) or 80
    except (KeyError, ValueError):
        pass
    try:
        assert sys.__stdout__ is not None
        return os.get_terminal_size(sys.__stdout__.fileno()).columns or 80
    except (AssertionError, AttributeError, ValueError, OSError):
        return 80


def _show_help(ctx: click.Context, _param: click.Parameter, value: bool) -> None:
    if value and not ctx.resilient_parsing:
        if ctx.terminal_width is None:
            ctx.terminal_width = max(min(columns(), ctx.max_content_width or 80) - 2, 50)
        sys.stdout.write(ctx.get_help() + "\n")
        ctx.exit()


class NoCommand(click.UsageError):
    """A group was called without a command: the message is its help, for stderr."""


@contextmanager
def bare(ctx: click.Context, words: Sequence[str]) -> Iterator[None]:
    """While these words are parsed: where none of them is an option, none is looked for."""
    before = ctx.meta.get(BARE, False)
    ctx.meta[BARE] = before or not (ctx.resilient_parsing or any(word.startswith("-") for word in words))
    try:
        yield
    finally:
        ctx.meta[BARE] = before


def need_command(ctx: click.Context, args: Sequence[str]) -> None:
    """For a group, before it is parsed: click 8.1 would take its help for what was asked, 8.2 and later do not."""
    if not args and not ctx.resilient_parsing:
        raise NoCommand(ctx.get_help(), ctx)


def plain_help(command: click.Command) -> None:
    """Help of a command that is not one of ours, and of those below it, goes where ours does and shows examples."""
    if "get_help_option" not in vars(command):
        made, options = command.get_help_option, command.format_options

        def with_examples(ctx: click.Context, formatter: click.HelpFormatter) -> None:
            options(ctx, formatter)
            write_examples(ctx, formatter)

        command.get_help_option = lambda ctx: _written_plainly(made(ctx))  # type: ignore[method-assign]
        command.format_options = with_examples  # type: ignore[method-assign]
    if isinstance(command, click.Group) and "parse_args" not in vars(command):
        parse = command.parse_args

        def parse_args(ctx: click.Context, args: list[str]) -> list[str]:
            need_command(ctx, args)
            return parse(ctx, args)

        command.parse_args = parse_args  # type: ignore[method-assign]
        for below in command.commands.values():
            plain_help(below)


def _written_plainly(option: click.Option | None) -> click.Option | None:
    """Help goes to stdout as it is: click would make a stream in ASCII UTF-8, and leave nothing to a substitute."""
    if option is not None:
        option.callback = _show_help
        option.help = "Show this help."
    return option


class Described(click.Command):
    """Accepts the common options, offers those that make sense, and names them behind its own.

    They are made when a command is parsed, not when it is defined: most commands of a family are never used in a run.
    """

    family: Family | None = None
    heading = ""
    writes = False
    offline = False
    _shared: list[click.Parameter] | None = None
    _parser: tuple[list[click.Parameter], Any] | None = None

    def refused(self) -> frozenset[str]:
        """Common options that this command cannot use, by key; "" stands for all that concern a link.

        Who gives one all the same is told why (`frame.premises`, `clikit.Command`).
        """
        keys = set() if self.writes else {"dry_run", "yes"}
        if not self.writes and self.family is None:
            keys |= {"assume_identity"}
        if self.offline:
            keys |= {"", "assume_identity"}
        if self.family is not None:
            keys |= {"id"} if not self.family.ids else set()
            keys |= {"baud"} if self.family.baud is None else set()
        return frozenset(keys)

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        if ctx.meta.get(BARE):
            return super().get_params(ctx)
        if self._shared is None:
            family = self.family
            wires, own = (family.wires, own_options(family.kind)) if family is not None else ((), ())
            named = {
                name for param in self.params for name in param.opts
            }  # an option of its own stands for the shared one
            shared = shared_options(wires, own, self.refused())
            self._shared = [option for option in shared if not named & {*option.opts}]
        return [*super().get_params(ctx), *self._shared]

    def make_parser(self, ctx: click.Context) -> Any:
        """As click does, but once for the same options: a parser keeps nothing of a line but its context.

        Short options are found at once. Else each that is typed costs click the import of difflib, for what it would suggest
        in place of a long one.
        """
        params = self.get_params(ctx)
        if self._parser is None or list(map(id, params)) != list(map(id, self._parser[0])):
            made = super().make_parser(ctx)
            long, short = (getattr(made, name, None) for name in ("_long_opt", "_short_opt"))
            if isinstance(long, dict) and isinstance(short, dict):
                long.update(short)
            self._parser = params, made
        parser = copy(self._parser[1])
        parser.ctx = ctx
        return parser

    def get_help_option(self, ctx: click.Context) -> click.Option | None:
        return _written_plainly(super().get_help_option(ctx))

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        common = [param for param in self.get_params(ctx) if isinstance(param, SharedOption)]
        own = [param for param in self.get_params(ctx) if isinstance(param, click.Option) and param not in common]
        records = [param.get_help_record(ctx) for param in own]
        with formatter.section("Options"):
            formatter.write_dl([record for record in records if record is not None])
        self.format_examples(ctx, formatter)
        self.format_common(ctx, formatter, [param for param in common if not param.hidden])

    def format_examples(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        write_examples(ctx, formatter)

    def format_common(
        self, ctx: click.Context, formatter: click.HelpFormatter, options: Sequence[SharedOption]
    ) -> None:
        """The common options of a command: their names, and where they are explained."""
        with formatter.section("Common options, see `handctl help options` or handctl(1)"):
            for title in (CONNECTION, OUTPUT, WRITING):
                names = [max(option.opts, key=len) for option in options if option.section == title]
                if names:
                    _wrapped(formatter, f"{title}: {', '.join(names)}", "  ", "    ")


def write_examples(ctx: click.Context, formatter: click.HelpFormatter) -> None:
    """Two or three command lines with what they show."""
    if examples := examples_of(words_of(ctx))[:MOST_EXAMPLES]:
        with formatter.section("Examples"):
            for line, text in examples:
                formatter.write(f"  {line}\n")
                _wrapped(formatter, text.replace("`", ""), "      ")


def _wrapped(formatter: click.HelpFormatter, text: str, first: str, later: str | None = None) -> None:
    """A text with each option in one piece: click would break at hyphens."""
    later = first if later is None else later
    import textwrap

    lines = textwrap.wrap(text, formatter.width, initial_indent=first, subsequent_indent=later, break_on_hyphens=False)
    formatter.write("\n".join(lines) + "\n")
