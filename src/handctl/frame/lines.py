"""Command lines as they are typed behind `handctl`: taken apart, planned without a device, and run in a session."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn

import click

from handctl.errors import HandctlError, UsageError
from handctl.frame.clikit import Command, root
from handctl.frame.envelope import from_click
from handctl.frame.invocation import check_before
from handctl.frame.options import COMMAND_LINE, said, words_of
from handctl.frame.run import Run, plan_table
from handctl.frame.usage import NoCommand
from handctl.model.guide import Guide

if TYPE_CHECKING:
    from handctl.frame.connection import Session
    from handctl.frame.family import Family
    from handctl.frame.options import Settings
    from handctl.link import Link
    from handctl.model.param import Step
    from handctl.model.result import Table

HERE = ("stop",)
"""Commands without a family that use the links of a session."""


class Line(NamedTuple):
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

    def plan(self) -> Plan:
        """What it means to do. Raises UsageError."""
        run = Planning(self.context, self.settings, self.leaf.family)
        if "-" in self.context.params.values():
            raise UsageError("standard input cannot be read here", hint="give a file instead of -")
        if self.leaf.offline and run.outputs:
            return Plan()  # it writes its files where it stands
        return run.plan(self.leaf.body(self.context, run))

    def confirmed(self) -> Line:
        """The same line with a yes."""
        told = said(self.context)
        told.sources = {**told.sources, "yes": COMMAND_LINE}
        return self._replace(settings=self.settings._replace(yes=True))

    def run(self, session: Session) -> None:
        """Carry it out and show its result. Raises HandctlError."""
        said(self.context).session = session
        self.leaf.carry_out(self.context, Run(self.context, self.settings, self.leaf.family))


def line(words: Sequence[str], given: Mapping[str, Any], number: int = 0) -> Line:
    """Take the words apart; `given` are common options that hold where the line says nothing else.

    Raises UsageError, click's Exit where the line only asked for help.
    """
    context = click.Context(root, info_name="handctl", **root.context_settings)
    told = said(context)
    told.given = {key: value for key, value in given.items() if not key.endswith("@")}
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
            if f"{key}@" not in told.given:
                told.given.pop(key, None)
        told.taken = None
        command = " ".join(words_of(leaf))
        return Line(number, command, leaf, leaf.command, leaf.command.settings(leaf))
    except NoCommand as exc:
        raise UsageError(
            "no command", hint=f"`{exc.ctx.command_path if exc.ctx else 'handctl'} -h` lists them"
        ) from exc
    except click.UsageError as exc:
        raise from_click(exc) from exc


def defaults(context: click.Context) -> dict[str, Any]:
    """The common options of a command that runs others, as far as each of these takes them over."""
    given = {key: value for key, value in said(context).given.items() if not key.endswith("@")}
    given.pop("output", None)
    if given.get("format") == "json":
        given["format"] = "ndjson"
    return given


def placed(error: HandctlError, one: Line) -> HandctlError:
    """The error, beginning with the line that it is of."""
    return error.retold(f"line {one.number} ({one.command}): {error.text}")


# -- what a line means to do ----------------------------------------------------------------------------------------


class Plan(NamedTuple):
    """What a command would do.

    question  what it asks before, "" = nothing
    word      that must be typed for a yes, "" = none
    steps     what it writes, as far as that is known without the device
    """

    question: str = ""
    word: str = ""
    steps: tuple[Step, ...] = ()


class _UsesDeviceError(BaseException):
    """From here on the body would need the device. No Exception: no body may take it for a failure."""


class Planning(Run):
    """A run that ends where the device would be used. Sends nothing, shows nothing, asks nothing."""

    def __init__(self, ctx: click.Context, settings: Settings, family: Family | None) -> None:
        super().__init__(ctx, settings, family)
        self._plan = Plan()

    def person(self) -> Guide:
        return Guide()

    def plan(self, body: Callable[[], Any]) -> Plan:
        """What the body means to do. Raises UsageError and what else it finds wrong without the device."""
        check_before(self)
        with suppress(_UsesDeviceError):
            body()
        return self._plan

    def device(self) -> NoReturn:
        self.link_name()
        raise _UsesDeviceError

    def open_link(self, *, again: bool = False, baud: int | None = None) -> Link:
        return self.device()

    def planned(self, steps: Sequence[Step]) -> Table | None:
        self._plan = self._plan._replace(steps=tuple(steps))
        return plan_table(steps) if self.settings.dry_run else None

    def confirm(self, question: str, steps: Sequence[Step] = (), *, word: str = "") -> None:
        self._plan = Plan(question, word, tuple(steps) or self._plan.steps)
        raise _UsesDeviceError

    def need_answer(self, question: str) -> None:
        self._plan = self._plan._replace(question=question)

    def offer(self, question: str) -> bool:
        return False
