"""One command line of several, as `batch`, `shell` and -d with several devices have them: parse it, plan it without a device, run it in a session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

import click

from handctl.command.command_tree import Command, NoCommand, root
from handctl.command.envelope import from_click
from handctl.command.open_links import Session
from handctl.command.options import COMMAND_LINE, SECONDS, command_line, words_of
from handctl.command.run import Asked, PlannedAction, Run
from handctl.command.settings_and_checks import check_before, resolve
from handctl.errors import HandctlError, UsageError
from handctl.files import refuse_controls
from handctl.model.prompts import Prompts

if TYPE_CHECKING:
    from handctl.link import Link
    from handctl.model.command_settings import Settings
    from handctl.model.result import Journal

HERE = ("stop", "sleep")
"""Commands without a family that use the links of a session."""


class ScriptLine(NamedTuple):
    """A command line whose words make sense.

    number   in its script, from 1
    command  all its words that name the command, such as "exo get"
    """

    number: int
    command: str
    context: click.Context
    leaf: Command
    settings: Settings

    @property
    def shared(self) -> bool:
        """Whether it uses the links of its session."""
        return self.leaf.family is not None or self.leaf.offline or self.command in HERE

    def plan(self) -> Asked:
        """What it asks. Raises UsageError and what else it finds wrong without the device."""
        run = Planning(self.context, self.settings, self.leaf.family, Prompts())
        if "-" in self.context.params.values():
            raise UsageError("standard input cannot be read here", hint="give a file instead of -")
        if self.leaf.offline and run.outputs:
            return Asked()  # it writes its files where it stands
        check_before(run)
        if self.leaf.stops:
            return Asked()  # it asks nothing, and would begin by asking who has the device
        with suppress(_UsesDeviceError):
            if isinstance(made := self.leaf.body(run)(), PlannedAction):
                return made.asked
        return Asked()

    def confirmed(self) -> ScriptLine:
        """The same line with a yes."""
        told = command_line(self.context)
        told.sources = {**told.sources, "yes": COMMAND_LINE}
        return self._replace(settings=self.settings._replace(yes=True))

    def run(self, session: Session, journal: Journal) -> None:
        """Carry it out and show its result. Raises HandctlError."""
        if not self.shared:
            session.release(journal)  # it may want the port for itself
        told = command_line(self.context)
        run, told.run = told.run, None
        if run is None:
            run = Run(self.context, self.settings, self.leaf.family, session=session)
        else:
            run.again()
        try:
            with run.shown():
                run.carry_out(self.leaf.body(run))
        finally:
            if not self.shared:
                session.take_back()
        if self.leaf.only_reads and not run.settings.output:  # the same line again asks the same
            told.run = run


@click.command("sleep", cls=Command)
@click.argument("seconds", metavar="S", type=SECONDS)
def sleep(run: Run, seconds: float) -> None:
    """Wait S seconds. The link stays open. Ctrl-C ends the wait."""
    deadline = run.settings.deadline
    if deadline is not None and seconds > deadline:
        raise UsageError(
            f"sleep {seconds:g} takes longer than the --deadline of {deadline:g} s",
            hint=f"write `sleep {seconds:g} --deadline {seconds + 1:g}`. Nothing was sent.",
        )
    if run.session is not None:  # else it is only planned
        run.session.sleep(seconds, run.journal)


root.in_lines["sleep"] = sleep


UNFINISHED = "close the quote. A backslash does not continue a command on the next line"
"""The way out where `split_line` raises ValueError."""


def split_line(typed: str) -> list[str]:
    """The words of a typed line, without its comment. Raises ValueError for an open quote, UsageError for a control character."""
    import shlex

    words = shlex.split(typed, comments=True)
    for word in words:
        refuse_controls(word)
    return words


def parse_line(words: Sequence[str], given: Mapping[str, Any], number: int = 0) -> ScriptLine:
    """Take the words apart; `given` are common options that hold where the line says nothing else.

    Raises UsageError, click's Exit where the line only asked for help.
    """
    context = click.Context(root, info_name="handctl", **root.context_settings)
    told = command_line(context)
    told.given = dict(given)
    told.bare = not any(word.startswith("-") for word in words)
    found: list[click.Context] = []
    told.taken = found.append
    try:
        with context.scope(cleanup=False):
            root.parse_args(context, list(words))
            root.invoke(context)
        (leaf,) = found
        assert isinstance(leaf.command, Command)
        for key in {"dry_run", "assume_identity"} & leaf.command.refused():
            if key not in told.levels:
                told.given.pop(key, None)
        told.taken = None
        command = " ".join(words_of(leaf))
        return ScriptLine(
            number, command, leaf, leaf.command, resolve(leaf, leaf.command.wires, urgent=leaf.command.stops)
        )
    except NoCommand as exc:
        raise UsageError(
            "no command", hint=f"`{exc.ctx.command_path if exc.ctx else 'handctl'} -h` lists them"
        ) from exc
    except click.UsageError as exc:
        error = from_click(exc)
        if exc.ctx is not None and exc.ctx.command in root.in_lines.values():  # `handctl sleep -h` is no command
            arguments = [one for one in exc.ctx.command.params if isinstance(one, click.Argument)]
            words = " ".join((str(exc.ctx.info_name), *(one.make_metavar(exc.ctx) for one in arguments)))
            error.hint = f"write it as `{words}`"
        raise error from exc


def options_for_lines(context: click.Context) -> dict[str, Any]:
    """The common options of a command that runs others, as far as each of these takes them over."""
    given = dict(command_line(context).given)
    given.pop("output", None)
    if given.get("format") == "json":
        given["format"] = "ndjson"
    return given


def with_line_number(error: HandctlError, one: ScriptLine) -> HandctlError:
    """The error, beginning with the line that it is of."""
    return error.reworded(f"line {one.number} ({one.command}): {error.text}")


# -- what a line means to do ----------------------------------------------------------------------------------------


class _UsesDeviceError(BaseException):
    """From here on the body would need the device. No Exception: no body may take it for a failure."""


class Planning(Run):
    """A run that ends where the device would be used. Sends nothing, shows nothing, asks nothing."""

    def device(self) -> NoReturn:
        self.link_name()
        raise _UsesDeviceError

    def open_link(self, *, again: bool = False, baud: int | None = None, listening: bool = False) -> Link:
        return self.device()
