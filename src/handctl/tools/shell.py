"""`handctl shell`: commands at a prompt, on links that stay open: a port that was lost is opened again by the next line."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import click

from handctl.command.command_lines import UNFINISHED, options_for_lines, parse_line, split_line
from handctl.command.command_tree import ALONE, Command, root
from handctl.command.family import load, map_of
from handctl.command.open_links import Session
from handctl.command.run import Run
from handctl.command.terminal_prompts import is_terminal, print_message
from handctl.errors import HandctlError, Hint, UsageError, says_nothing_new
from handctl.families import COMMANDS, FAMILIES
from handctl.files import state_path
from handctl.interrupts import end_on_signals
from handctl.model.stop_on_interrupt import NOT_STOPPED, ended_by_interrupt
from handctl.system import terminal


@click.command("shell", cls=Command, writes=True)
@click.argument("family", required=False, type=click.Choice(list(FAMILIES)), metavar="[FAMILY]")
def cli(run: Run, family: str | None) -> None:
    """Type commands at a prompt. The link stays open between them.

    Type each command without `handctl`. If you give FAMILY or -d, leave out the family too. TAB completes commands and
    quantities, and the history is kept. `sleep S` waits S seconds. If the port was lost, the next line opens it again. Ctrl-C stops a movement,
    at the prompt too. Ctrl-D ends the shell and stops nothing.
    """
    if not run.prompts.interactive:
        raise UsageError("the shell needs a terminal", hint=Hint("send the lines to {}", "batch"), code="no-terminal")
    if run.settings.output:
        raise UsageError(
            "the shell cannot write its output to a file", hint="give -o in a line that you type in the shell"
        )
    Shell(run, family or "", input).run()


ENDS = ("exit", "quit")
NAMING = ("get", "watch", "set", "describe")
"""Commands whose words are quantities."""


class Shell:
    """One session at a prompt.

    family  that a line may leave out, "" = each line has its own
    given   the common options that hold for every line
    """

    def __init__(self, run: Run, family: str, read_line: Callable[[str], str]) -> None:
        self._run = run
        self._read_line = read_line
        self._given = options_for_lines(run.context)
        self.family = family or run.settings.kind or ""
        self._on_terminal = is_terminal(sys.stdin)
        self._session = Session(run.command, writes=True, guards=True)
        self._not_stopped: HandctlError | None = None
        """How the stop failed with which the last line, or an interrupt at the prompt, has ended."""

    @property
    def prompt(self) -> str:
        """Device and link."""
        settings = self._run.settings
        link = settings.port or ("simulated" if settings.fake else "")
        return f"{' '.join(filter(None, (settings.device or self.family, link))) or 'handctl'}> "

    def run(self) -> None:
        """Take lines until Ctrl-D or `exit`."""
        run = self._run
        try:
            with terminal.edited_lines(state_path("shell-history"), self.candidates):
                self._take_lines()
        finally:
            failure = self._not_stopped or self._session.close(run.journal)
        if failure is not None:
            raise failure

    def _take_lines(self) -> None:
        self._run.prompts.say("Lines are commands without `handctl`. TAB completes them. Ctrl-D or `exit` ends.")
        try:
            while self._one():
                pass
            if self._on_terminal and not is_terminal(sys.stdin):  # closed, which ends the input before the signal comes
                self._stop_moving()
        except KeyboardInterrupt as exc:
            self._stop_moving()
            raise self._not_stopped or exc from None

    def _one(self) -> bool:
        """Take a line and carry it out; False at the end."""
        end_on_signals(suspend=False)
        try:
            typed = self._read_line(self.prompt)
        except EOFError:
            if not self._on_terminal or is_terminal(sys.stdin):
                self._run.out("")
            return False
        except KeyboardInterrupt:
            stopped = self._session.stopped(self._run.journal)
            if stopped is not None or not self._stop_moving():
                print_message("note", stopped.text if stopped is not None else "Ctrl-D ends the shell", "")
            return True
        try:
            words = split_line(typed)
        except UsageError as exc:
            print_message("error", exc.text, exc.hint)
            return True
        except ValueError as exc:
            print_message("error", str(exc), UNFINISHED)
            return True
        if words[:1] == ["handctl"]:
            del words[0]
        if words[:1] and words[0] in ENDS:
            return False
        if words:
            self.carry_out(words)
        return True

    def _stop_moving(self) -> bool:
        """Stop what lines have set going and left; whether there was anything."""
        ended = self._session.stop_moving(self._run.prompts)
        for stop in ended:
            print_message("error", stop.text, stop.hint)
        self._not_stopped = next((stop for stop in ended if stop.code == NOT_STOPPED), None)
        return bool(ended)

    def carry_out(self, words: Sequence[str]) -> None:
        """Run one line; an error is shown, and the shell continues."""
        self._not_stopped = None
        try:
            parse_line(self._whole(words), self._given).run(self._session, self._run.journal)
        except click.exceptions.Exit:
            return  # it asked for help
        except HandctlError as exc:
            if not says_nothing_new(exc):
                print_message("error", exc.text, exc.hint)
            if ended_by_interrupt(exc):
                self._stop_moving()
        except click.ClickException as exc:
            print_message("error", exc.format_message(), "")

    def _whole(self, words: Sequence[str]) -> list[str]:
        """The line with its family, where the shell knows that and the line leaves it out."""
        first = next((word for word in words if not word.startswith("-")), "")
        leave = not self.family or (first in COMMANDS and first != "stop") or first in root.in_lines
        return list(words) if leave else [self.family, *words]

    # -- completion --

    def candidates(self, before: str, word: str) -> list[str]:
        """What fits at the cursor: commands, then their quantities."""
        words = before[: len(before) - len(word)].split()
        with contextlib.suppress(HandctlError, click.ClickException):
            return [f"{name} " for name in sorted(set(self._fitting(words))) if name.startswith(word)]
        return []

    def _fitting(self, words: Sequence[str]) -> Iterator[str]:
        words = [name for name in words if not name.startswith("-")]
        if not words:
            yield from (name for name in COMMANDS if name not in ALONE)
            yield from (*root.in_lines, *ENDS)
        if self.family and (not words or words[0] not in COMMANDS):
            words = [self.family, *words]
        if not words or words[0] not in FAMILIES:
            return
        node: Any = load(words[0], "cli").cli
        rest = list(words[1:])
        while rest and isinstance(node, click.Group):
            node = node.commands.get(rest.pop(0))
        if isinstance(node, click.Group):
            yield from node.commands
        elif node is not None and node.name in NAMING and (params := map_of(words[0])) is not None:
            for param in params:
                yield param.name
                yield from (f"{param.name}.{part}" for part in param.elements)
