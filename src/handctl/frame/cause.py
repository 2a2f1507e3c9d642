"""Why a command failed, in the words that help most: who it was that answered, and what came before the time was over."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from handctl.errors import HandctlError, Interrupted, OutputError, UsageError, joined

if TYPE_CHECKING:
    from handctl.frame.run import Run


def as_told(run: Run, error: HandctlError) -> HandctlError:
    """The error as it is told: whose bytes came, or why nobody answered, as far as the family knows."""
    error = _renamed(run, error)
    explain_silence = run.family.explain_silence if run.family is not None else None
    silent = error.exit_code in (4, 5) and run.journal.counters.received == 0
    if run.opened is None or explain_silence is None or not silent or run.settings.baud is not None:
        return error
    try:
        return explain_silence(run.opened, error)
    except (HandctlError, KeyboardInterrupt):
        return error


def _renamed(run: Run, error: HandctlError) -> HandctlError:
    """The error, or whose bytes came instead of an answer, or the command that finds out who is there."""
    if run.family is None or error.exit_code not in (4, 5):
        return error
    from handctl.model.foreign import pointed, renamed

    error = renamed(error, run.family.kind)
    nobody = error.code in ("no-answer", "garbage") and not run.journal.counters.received and run.family.baud
    port = run.settings.port or ""
    return pointed(error, port) if nobody and port and not port.startswith(("fake:", "replay:")) else error


def interrupted(run: Run) -> HandctlError:
    """Ctrl-C where nobody inside answers to it. What this command has set going, and watches no more, is stopped."""
    stop = run.journal.still_moving()
    if stop is None:
        return Interrupted("interrupted")
    from handctl.model.leaving import stopped

    return stopped(stop, run.guide)


def judged(run: Run, error: HandctlError | None) -> HandctlError | None:
    """What is shown of an error: whose bytes came, and what held a command up that --deadline ended."""
    return None if error is None else _renamed(run, _with_cause(run, error))


def _with_cause(run: Run, error: HandctlError) -> HandctlError:
    """The error; where --deadline was over, why it had not got on: bytes that came tell more than the end of the time."""
    late = run.end is not None and run.link is not None and run.link.now() >= run.end - 1e-6
    if not late or error.exit_code not in (4, 5):
        return error
    cause = run.journal.blamed if error.exit_code == 4 else error
    if cause is None:
        return error
    if "--deadline" not in cause.text:
        cause.text = joined(cause.text, "--deadline was over before a valid answer came")
    return cause


def from_click(exc: click.UsageError) -> UsageError:
    """click's usage error as ours, with the command's own help as the next step."""
    path = exc.ctx.command_path if exc.ctx is not None else "handctl"
    text = exc.format_message()
    if isinstance(exc, click.NoSuchOption):  # in the same words with each release of click
        near = ", ".join(repr(name) for name in sorted(exc.possibilities or ()))
        text = f"No such option {exc.option_name!r}."
        if near:
            text += f" Did you mean {near}?" if "," not in near else f" (Did you mean one of: {near}?)"
    return UsageError(text, hint=f"`{path} -h` shows how to use it")


def weightier(error: HandctlError | None, lost: OutputError) -> HandctlError:
    """Of what went wrong with the device and the output that was lost: the device's weighs more, and tells both."""
    if error is None or isinstance(error, OutputError):
        return lost
    error.text, error.hint = joined(error.text, lost.text), joined(error.hint, lost.hint)
    return error
