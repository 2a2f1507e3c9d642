"""`handctl help [TOPIC]`: man pages, guides and the common options as text, even without man(1).

The pages are made at once from what the man pages are made of, so they fit this version and need neither files nor a network.
"""

from __future__ import annotations

import re
import shutil
import sys

import click

from handctl.command.command_tree import Command, root
from handctl.command.options import CONNECTION, OUTPUT, WRITING, SharedOption
from handctl.command.run import Run
from handctl.errors import Hint, UsageError
from handctl.families import COMMANDS, FAMILIES
from handctl.misspellings import near
from handctl.model.result import Column, Table

OPTIONS = "options"
HOW = (
    "Common options can go anywhere on the line: `handctl -p PORT exo status` is the same as `handctl exo status -p PORT`. "
    "If you give one twice, the one closest to the command itself wins. Side by side, the last one wins, but two different -p, -d or "
    "--id are an error, and so are two different values for an option of a command that writes. "
    "Of these, `stop` refuses only two different -p: see handctl-stopping(7).\n\n"
    "Each has an environment variable, such as HANDCTL_PORT for --port, and a key in the configuration file. The command "
    "line comes first, then the environment, then the named device, then the file. Only --assume-identity must be typed.\n\n"
    "Each command accepts only the options listed by its `-h`. For example, a command that only reads has no --dry-run."
)


@click.command("help", cls=Command, offline=True)
@click.argument("topic", nargs=-1, metavar="[TOPIC]...")
def cli(run: Run, topic: tuple[str, ...]) -> Table | None:
    """Show a page of the manual, a guide, or the help of one command. Without TOPIC: list them all.

    A page longer than the screen opens in your pager. On a pipe it is plain text.
    """
    words = re.sub(r"\(\d\)$", "", " ".join(topic).removeprefix("handctl-")).split()  # a page as it is named in print
    if not words:
        rows = [{"topic": name, "about": about} for name, about in _topics().items()]
        return Table(rows=rows, columns=(Column("topic", "Topic"), Column("about", "About")), plain=("topic",))
    text = _text(words)
    too_long = sys.stdout.isatty() and len(text.splitlines()) >= shutil.get_terminal_size().lines
    if run.settings.format == "table" and not run.settings.output and too_long:
        click.echo_via_pager(text)
        return None
    return Table(rows=[{"topic": " ".join(words), "text": text}], text=lambda _rows: text, columns=(Column("text"),))


def _guides() -> dict[str, tuple[str, str]]:
    """Topic -> text of the guide, and one line about it."""
    from handctl import guides

    texts = {name: guides.source(name) for name in guides.names()}
    titles = {name: guides.title(text) for name, text in texts.items()}
    return {page.removeprefix("handctl-"): (texts[name], about) for name, (page, about) in titles.items()}


def _topics() -> dict[str, str]:
    """Topic -> one line about it."""
    found = {OPTIONS: "the options that most commands have: links, output, safety", "handctl": "handctl as a whole"}
    found |= {name: about for name, (_, about) in _guides().items()}
    return found | {name: text for name, (_, text) in COMMANDS.items()}


def _text(words: list[str]) -> str:
    """The text of a topic. Raises UsageError if there is none."""
    name = words[0]
    if len(words) == 1:
        from handctl.docgen import man_pages
        from handctl.docgen.read_command_tree import read_tree
        from handctl.docgen.roff import plain

        if name == OPTIONS:
            return _options()
        if name in COMMANDS or name == "handctl":
            return plain(man_pages.one(read_tree(), name))
        if name in (guides := _guides()):
            return plain(man_pages.guide(guides[name][0]))
    elif (context := _exists(words)) is not None:
        return context.get_help() + "\n"
    raise _unknown(words)


def _exists(words: list[str]) -> click.Context | None:
    """The command of these words; None if there is none."""
    context: click.Context | None = click.Context(root, info_name="handctl", **root.context_settings)
    for word in words:
        context = _below(context, word) if context is not None else None
    return context


def _below(context: click.Context, word: str) -> click.Context | None:
    group = context.command
    found = group.get_command(context, word) if isinstance(group, click.Group) else None
    return click.Context(found, context, word, **found.context_settings) if found is not None else None


def _unknown(words: list[str]) -> UsageError:
    name = " ".join(words)
    known = list(_topics())
    if words[0] in COMMANDS:
        context = _below(click.Context(root, info_name="handctl"), words[0])
        if context is not None and isinstance(context.command, click.Group):
            known = [f"{words[0]} {verb}" for verb in context.command.list_commands(context)]
    below = [f"{family} {name}" for family in FAMILIES if _exists([family, name])] if len(words) == 1 else []
    close = below or near(name, known)
    meant = f"did you mean {' or '.join(map(repr, close))}? " if close else ""
    return UsageError(f"no help on {name!r}", hint=Hint(f"{meant}{{}} lists the topics", "help"), code="no-topic")


def _options() -> str:
    """All common options in full, with those that one family has."""
    context = click.Context(root, info_name="handctl", **root.context_settings)
    formatter = context.make_formatter()
    for paragraph in HOW.split("\n\n"):
        formatter.write_text(paragraph)
        formatter.write_paragraph()
    options = [param for param in root.get_params(context) if isinstance(param, SharedOption)]
    for title in (CONNECTION, OUTPUT, WRITING):
        with formatter.section(title):
            formatter.write_dl([
                record for option in options if option.section == title and (record := option.get_help_record(context))
            ])  # fmt: skip
    formatter.write_text("Options specific to one family are listed in `handctl FAMILY -h`.")
    return formatter.getvalue()
