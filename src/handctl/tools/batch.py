"""`handctl batch`: a script of commands on one open link. All of it is understood, planned and confirmed before it begins."""

from __future__ import annotations

import contextlib
import io
import sys
from collections.abc import Iterator, Sequence

import click

from handctl.command.command_lines import (
    UNFINISHED,
    ScriptLine,
    options_for_lines,
    parse_line,
    split_line,
    with_line_number,
)
from handctl.command.command_tree import Command
from handctl.command.open_links import Session
from handctl.command.options import InFile
from handctl.command.run import Asked, Run
from handctl.command.settings_and_checks import shown_steps, unsent
from handctl.command.terminal_prompts import print_message
from handctl.errors import HandctlError, Hint, Interrupted, NotConfirmed, UsageError, joined, says_nothing_new
from handctl.files import BYTE_ORDER_MARK, atomic_write, read_text, text_lines, writing
from handctl.interrupts import was_interrupted
from handctl.model.result import Table
from handctl.model.stop_on_interrupt import NOT_STOPPED, ended_by_interrupt
from handctl.wording import plural


@click.command("batch", cls=Command, writes=True, streams=True)
@click.argument("file", type=InFile(), default="-", metavar="[FILE]")
@click.option(
    "--keep-going",
    is_flag=True,
    help="Continue after a line that failed. The exit code is still that of the first failure.",
)
def cli(run: Run, file: str, keep_going: bool) -> Table | None:
    """Run many commands on one open link, from FILE or stdin.

    Write each command on its own line, without `handctl`. `#` starts a comment, and `sleep S` waits S seconds. Options such as -p, -d, --yes and --json
    apply to every line that does not set its own. handctl checks all lines before it sends anything. If some lines
    need confirmation, it lists them and asks once. The exit code is that of the first line that failed.
    """
    return batch(run, file, keep_going=keep_going)


MOST_BYTES = 4_000_000
LONGEST_LINE = 20_000
"""Characters of a line."""
SHOWN = 20
"""Steps of one line that the question shows."""


def batch(run: Run, file: str, *, keep_going: bool) -> Table | None:
    """Run the lines of `file`, or of stdin for "-". The failure of the whole is that of the first line that failed."""
    text = _script(file)
    with _no_stdin():
        lines = list(_lines(text, run.context))
        if not lines:
            raise UsageError("the script has no command", hint="write one command a line, without `handctl`")
        plans = list(_plans(lines))
    lines = _confirmed(run, lines, plans)
    if path := run.settings.output:  # the last line of JSON goes there too, behind all others
        run.after_output.enter_context(_one_file(path))
        run.settings = run.settings._replace(output=None)
    with _no_stdin():
        return _run(run, lines, keep_going=keep_going)


def _script(file: str) -> str:
    if file != "-":
        return read_text(file, "a script", MOST_BYTES)
    if sys.stdin.isatty():
        raise UsageError(
            "no script given", hint=Hint("name a file, or send the lines on stdin. {} is a prompt", "shell")
        )
    try:
        text = sys.stdin.read(MOST_BYTES + 1)
    except (OSError, UnicodeDecodeError) as exc:
        raise UsageError(f"stdin: the script cannot be read: {exc}", hint="send text in UTF-8") from exc
    if len(text) > MOST_BYTES:
        raise UsageError(f"stdin: larger than {MOST_BYTES // 1_000_000} MB: not a script", hint="send fewer lines")
    return text.removeprefix(BYTE_ORDER_MARK)


@contextlib.contextmanager
def _no_stdin() -> Iterator[None]:
    """No line reads what the script came from, and none asks: that was done before."""
    before, sys.stdin = sys.stdin, io.StringIO()
    try:
        yield
    finally:
        sys.stdin = before


def _lines(text: str, context: click.Context) -> Iterator[ScriptLine]:
    """The commands of a script. Raises UsageError with the number of the line."""
    given = options_for_lines(context)
    known: dict[str, ScriptLine] = {}  # a line that occurs again is the same
    for number, raw in enumerate(text_lines(text), 1):
        if not (typed := raw.strip(" \t")):
            continue
        if len(typed) > LONGEST_LINE:
            raise UsageError(
                f"line {number} has {plural(len(typed), 'character')}: not a command", hint="write one command a line"
            )
        try:
            if typed in known:
                yield known[typed]._replace(number=number)
                continue
            words = split_line(typed)
            if words[:1] == ["handctl"]:
                raise UsageError(
                    "leave out the word handctl in a script", hint="start with the device, such as `exo get id`"
                )
            if words:
                with contextlib.redirect_stdout(io.StringIO()):  # of a line that asks for help
                    known[typed] = parse_line(words, given, number)
                yield known[typed]
        except ValueError as exc:
            raise UsageError(f"line {number}: {exc}: {typed}", hint=UNFINISHED) from exc
        except click.exceptions.Exit as exc:
            raise UsageError(f"line {number} asks for help: {typed}", hint="remove that line") from exc
        except HandctlError as exc:
            raise exc.reworded(f"line {number} ({typed}): {exc.text}") from exc


def _plans(lines: Sequence[ScriptLine]) -> Iterator[Asked]:
    """The plan of each. Raises UsageError."""
    known: dict[int, Asked] = {}
    for one in lines:
        key = id(one.context)
        if key not in known:
            known[key] = _planned(one)
        yield known[key]


def _planned(one: ScriptLine) -> Asked:
    try:
        return one.plan()
    except click.UsageError as exc:
        raise with_line_number(
            UsageError(exc.format_message(), hint="correct that line. Nothing was sent."), one
        ) from exc
    except HandctlError as exc:
        raise with_line_number(exc, one) from exc


def _confirmed(run: Run, lines: Sequence[ScriptLine], plans: Sequence[Asked]) -> list[ScriptLine]:
    """The lines, confirmed where needed: one question for all, after showing the plan. Raises NotConfirmed."""
    open_ = [
        (one, plan)
        for one, plan in zip(lines, plans, strict=True)
        if plan.question and not one.settings.yes and not one.settings.dry_run
    ]
    if not open_:
        return list(lines)
    for one, plan in open_:
        run.prompts.say(f"line {one.number}: {one.command}: {plan.question}")
        for text in shown_steps(plan.steps[:SHOWN], run.settings):
            run.prompts.say(text)
        if len(plan.steps) > SHOWN:
            run.prompts.say(f"  and {plural(len(plan.steps) - SHOWN, 'more step')}. -n shows them")
    first, plan = open_[0]
    if not run.prompts.interactive:
        where = f"line {first.number} ({first.command}): {plan.question}"
        raise NotConfirmed(f"{where}. {run.prompts.nobody}", hint=joined(run.prompts.otherwise, unsent(run.journal)))
    words = dict.fromkeys(plan.word for _, plan in open_ if plan.word)
    count = f"{len(open_)} of {len(lines)} lines ask" if len(open_) > 1 else "One line asks"
    if not run.prompts.ask(f"{count} for confirmation", " ".join(words)):
        raise NotConfirmed("not confirmed: nothing was sent", hint="run the command again to confirm it")
    asking = {one.number for one, _ in open_}
    answered = [one.confirmed() if one.number in asking else one for one in lines]
    for one in answered:
        if one.number in asking:
            _planned(one)  # a yes without a person may need more words, such as who it was
    return answered


@contextlib.contextmanager
def _one_file(path: str) -> Iterator[None]:
    """What would go to stdout goes to a file, which appears whole. Raises OutputError."""
    with writing(path), atomic_write(path) as file, contextlib.redirect_stdout(file):
        yield


def _run(run: Run, lines: Sequence[ScriptLine], *, keep_going: bool) -> Table | None:
    dry = run.settings.dry_run
    writes = any(one.leaf.writes and not one.settings.dry_run for one in lines)
    session = Session(run.command, writes=writes, began=run.began, guards=writes)
    failed: list[tuple[ScriptLine, HandctlError]] = []
    done = 0
    try:
        for one in lines:
            if dry and not one.leaf.writes and not one.leaf.offline:
                run.journal.info("left-out", f"line {one.number} ({one.command}) only reads: skipped in a dry run")
                continue
            done += 1
            session.place = {"line": one.number, "command": one.command}
            error = _carried_out(one, session, run)
            if error is not None:
                failed.append((one, error))
            if error is not None and not (keep_going and not ended_by_interrupt(error)):
                break
        stops = session.stop_moving(run.prompts) if failed and ended_by_interrupt(failed[-1][1]) else []
    finally:
        error = session.close(run.journal)
    failure = _failure(failed, done, stops) if failed else error
    if run.settings.format in ("json", "ndjson"):
        return Table(extra={"lines": done, "failed": len(failed)}, failure=failure)
    if failure is not None:
        raise failure
    return None


def _carried_out(one: ScriptLine, session: Session, run: Run) -> HandctlError | None:
    """Run one line; the error with which it ended."""
    try:
        one.run(session, run.journal)
    except HandctlError as exc:
        if not says_nothing_new(exc):
            told = with_line_number(exc, one)
            print_message("error", told.text, told.hint)
        return exc
    return Interrupted() if was_interrupted() else None


def _failure(
    failed: Sequence[tuple[ScriptLine, HandctlError]], done: int, stops: Sequence[HandctlError]
) -> HandctlError:
    """The failure of the whole: a stop that was not confirmed, else it ends as the first line that failed.

    `stops` are those of what earlier lines had set going, after an interrupt.
    """
    one, first = failed[0]
    ends = sorted(stops, key=lambda stop: stop.code == NOT_STOPPED)
    interrupted = first.exit_code == Interrupted.exit_code
    last = ends.pop() if ends and (interrupted or ends[-1].code == NOT_STOPPED) else None
    for stop in ends:
        print_message("note", stop.text, stop.hint)
    if last is not None:
        return last
    if interrupted:
        return Interrupted()
    text = f"{len(failed)} of {plural(done, 'line')} failed, the first is line {one.number} ({one.command})"
    failure = HandctlError(text, hint=f"see the message of line {one.number}", code="line-failed")
    failure.exit_code = first.exit_code
    return failure
