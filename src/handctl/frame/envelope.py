"""The JSON envelope of a command, without its rows (cli contract, section 4)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from handctl import __version__
from handctl.sentence import sentence

if TYPE_CHECKING:
    from handctl.errors import HandctlError
    from handctl.frame.run import Run
    from handctl.model.result import Message


def device_row(run: Run) -> dict[str, Any] | None:
    """`device` of the envelope; None where a command has no device."""
    if run.family is None:
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
    return {**row, "identity": "assumed"} if run.settings.assume_identity else row


def make_envelope(
    command: str,
    failure: HandctlError | None,
    device: dict[str, Any] | None,
    messages: Sequence[Message],
    counters: dict[str, Any] | None,
    extra: dict[str, Any] | None,
) -> dict[str, Any]:
    """The JSON envelope without rows."""
    from handctl.model.profile import Profile
    from handctl.model.result import SCHEMA, Counters

    rows = [message.as_row() for message in messages]
    if failure is not None:
        rows.append({"level": "error", "code": failure.code, "text": failure.text, "hint": failure.hint})
    return {
        "schema": SCHEMA,
        "version": __version__,
        "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "command": command,
        "device": device,
        "ok": failure is None,
        "exit_code": failure.exit_code if failure is not None else 0,
        "line": Profile().as_row(),
        **(extra or {}),
        "messages": [{**row, "text": sentence(row["text"]), "hint": sentence(row["hint"])} for row in rows],
        "counters": counters if counters is not None else Counters().as_row(),
    }
