"""What is told of a command beside its rows: the JSON envelope (cli contract, section 4), and the most helpful error message."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from handctl import __version__
from handctl.errors import HandctlError, Hint, Interrupted, OutputError, UsageError, joined
from handctl.families import FAMILIES
from handctl.files import in_json
from handctl.model.result import ENVELOPE_SCHEMA, Journal, Message
from handctl.screen.sanitize import utf8_stdout
from handctl.wording import sentence, utc

if TYPE_CHECKING:
    from handctl.command.settings_and_checks import Invocation
    from handctl.link import Link


def device_row(run: Invocation) -> dict[str, Any] | None:
    """`device` of the envelope; None where a command has no device."""
    if not run.family.kind:
        return None
    link = run.link
    name = (
        link.name
        if link is not None
        else (run.settings.port or (f"fake://{run.family.kind}" if run.settings.fake else None))
    )
    fake = link.fake if link is not None else bool(name and name.startswith("fake://"))
    bus = getattr(run.opened, "bus", None)
    number = getattr(bus, "id", run.settings.id) if run.family.ids else None
    row = {"kind": run.family.kind, "link": name, "fake": fake, "id": number}
    facts = getattr(run.opened, "about", {})
    row |= {key: facts[key] for key in ("model", "firmware", "serial") if facts.get(key)}
    if not run.said.include_ids:
        row.pop("serial", None)
    return {**row, "identity": "assumed"} if run.settings.assume_identity else row


def make_envelope(
    command: str,
    failure: HandctlError | None,
    device: dict[str, Any] | None,
    journal: Journal,
    extra: dict[str, Any],
    link: Link | None = None,
) -> dict[str, Any]:
    """The JSON envelope without rows. The `link`, where there is one, has the clock."""
    rows = [message.as_row() for message in journal.messages]
    if failure is not None:
        rows.append(Message("error", failure.code, failure.text, failure.hint).as_row())
    return {
        "schema": ENVELOPE_SCHEMA,
        "version": __version__,
        "time": utc(int(time.time() if link is None else link.wall())),
        "command": command,
        "device": device,
        "ok": failure is None,
        "exit_code": failure.exit_code if failure is not None else 0,
        "line": journal.line.as_row(),
        **extra,
        "messages": [{**row, "text": sentence(row["text"]), "hint": sentence(row["hint"])} for row in rows],
        "counters": journal.counters.as_row(),
    }


# -- of an error before the settings were known ---------------------------------------------------------------------


def in_file(key: str) -> Any:
    """The value of an option in the configuration file, for errors before the settings are known; None if unknown."""
    from handctl.command.config_file import read_config

    try:
        entry = read_config().values.get(key)
    except HandctlError:
        return None
    return entry.value if entry is not None else None


def late_envelope(args: Sequence[str], error: HandctlError, streams: bool, command: str, extra: dict[str, Any]) -> None:
    """JSON on stdout also when the command line itself was wrong, if JSON was asked for."""
    words = list(args)
    wanted = os.environ.get("HANDCTL_FORMAT", "") or ("json" if os.environ.get("HANDCTL_JSON") else "")
    for position, word in enumerate(words):
        if word == "--json":
            wanted = "json"
        elif word == "--format" and position + 1 < len(words):
            wanted = words[position + 1]
        elif word.startswith("--format="):
            wanted = word.partition("=")[2]
    wanted = wanted or str(in_file("format") or ("json" if in_file("json") else ""))
    if wanted not in ("json", "ndjson"):
        return
    envelope = make_envelope(command, error, None, Journal(), extra)
    utf8_stdout()
    try:
        sys.stdout.write(
            in_json(
                json.dumps(
                    {"end": envelope} if streams or wanted == "ndjson" else {**envelope, "rows": []}, ensure_ascii=False
                )
            )
            + "\n"
        )
        sys.stdout.flush()
    except OSError:
        return  # the error itself is still told on stderr


# -- why a command failed -------------------------------------------------------------------------------------------


def explained_error(run: Invocation, error: HandctlError) -> HandctlError:
    """The error as it is told: whose bytes came, or why nobody answered, as far as the family knows."""
    error = renamed(run, error)
    try:
        return why_silent(run, error)
    except (HandctlError, KeyboardInterrupt):
        return error


def why_silent(run: Invocation, error: HandctlError) -> HandctlError:
    """The error, or a better one where nothing valid ever came, as far as the family knows. Asks the device; raises HandctlError."""
    explain_silence = run.family.explain_silence
    silent = error.exit_code in (4, 5) and run.journal.counters.received == 0
    if run.opened is None or explain_silence is None or not silent or run.settings.baud is not None:
        return error
    return explain_silence(run.opened, error)


def renamed(run: Invocation, error: HandctlError) -> HandctlError:
    """The error, or whose bytes came instead of an answer, or the command that finds out who is there."""
    if not run.family.kind or error.exit_code not in (4, 5):
        return error
    from handctl.model import other_family_bytes

    error = other_family_bytes.renamed(error, run.family.kind)
    nobody = error.code in ("no-answer", "garbage") and not run.journal.counters.received and run.family.baud
    port = run.settings.port or ""
    advice = Hint("{} shows which device is there", f"scan -p {port}")
    if nobody and port and not port.startswith(("fake:", "replay:")) and advice not in error.hint:
        error.hint = joined(error.hint, advice)
    return error


def interrupted(run: Invocation) -> HandctlError:
    """Ctrl-C that no code inside has handled: stop the movement that this command started and no longer watches."""
    stop = run.journal.still_moving()
    if stop is None:
        return Interrupted()
    from handctl.model.stop_on_interrupt import stop_without_interrupts

    return stop_without_interrupts(stop, run.prompts)


def with_cause(run: Invocation, error: HandctlError) -> HandctlError:
    """The error; where --deadline was over, why it had not got on: bytes that came tell more than the end of the time."""
    late = run.end is not None and run.link is not None and run.link.now() >= run.end - 1e-6
    if not late or error.exit_code not in (4, 5):
        return error
    cause = run.journal.blamed if error.exit_code == 4 else error
    if cause is None:
        return error
    if not cause.bounded and cause.code != "deadline":
        cause.text = joined(cause.text, "--deadline was over before a valid reply came")
    return cause


def from_click(exc: click.UsageError) -> UsageError:
    """click's usage error as ours, with the command's own help as the next step."""
    path = exc.ctx.command_path if exc.ctx is not None else "handctl"
    text, hint = exc.format_message(), f"`{path} -h` shows how to use it"
    if isinstance(exc, click.NoSuchOption) and (own := _of_other_commands(exc)):
        text, hint = f"No such option {exc.option_name!r}", own
    elif isinstance(exc, click.NoSuchOption):  # in the same words with each release of click
        *others, last = [repr(name) for name in sorted(exc.possibilities or ())] or [""]
        near = " or ".join(filter(None, (", ".join(others), last)))
        text = f"No such option {exc.option_name!r}."
        if near:
            text += f" Did you mean {near}?"
    return UsageError(text, hint=hint)


def _of_other_commands(exc: click.NoSuchOption) -> str:
    """The next step for an option that only the commands of some family have, which a next step of `doctor` may name; "" for any other."""
    families = {
        family: one for family, row in FAMILIES.items() for one in row.options if f"--{one.name}" == exc.option_name
    }
    if not families:
        return ""
    having = f"{exc.option_name} is an option of the commands of {' and '.join(families)}"
    (option, *_) = families.values()
    if option.asked or exc.ctx is None or getattr(exc.ctx.command, "family", None) is not None:
        return having
    return f"set the variable HANDCTL_{option.key.upper()} in its place. {having}"


def more_serious(error: HandctlError | None, lost: OutputError) -> HandctlError:
    """Combine an error of the device with one of the output: the device's is more important, and its text covers both."""
    if error is None or isinstance(error, OutputError):
        return lost
    error.text, error.hint = joined(error.text, lost.text), joined(error.hint, lost.hint)
    return error
