"""The JSON envelope of a command, without its rows (cli contract, section 4)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from handctl import __version__
from handctl.sentence import sentence, utc

if TYPE_CHECKING:
    from handctl.errors import HandctlError
    from handctl.frame.run import Run
    from handctl.link import Link
    from handctl.model.result import Message

INCLUDE_IDS = "handctl.include-ids"
"""Key in click's shared meta: the result may hold what tells one device from another."""


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
    facts = getattr(run.opened, "about", {})
    row |= {key: facts[key] for key in ("model", "firmware", "serial") if facts.get(key)}
    if not run.meta.get(INCLUDE_IDS):
        row.pop("serial", None)
    return {**row, "identity": "assumed"} if run.settings.assume_identity else row


def make_envelope(
    command: str,
    failure: HandctlError | None,
    device: dict[str, Any] | None,
    messages: Sequence[Message],
    counters: dict[str, Any] | None,
    extra: dict[str, Any] | None,
    link: Link | None = None,
) -> dict[str, Any]:
    """The JSON envelope without rows. The `link`, where there is one, has the clock."""
    from handctl.model.profile import Profile
    from handctl.model.result import SCHEMA, Counters

    rows = [message.as_row() for message in messages]
    if failure is not None:
        rows.append({"level": "error", "code": failure.code, "text": failure.text, "hint": failure.hint})
    return {
        "schema": SCHEMA,
        "version": __version__,
        "time": utc(int(time.time() if link is None else link.wall())),
        "command": command,
        "device": device,
        "ok": failure is None,
        "exit_code": failure.exit_code if failure is not None else 0,
        "line": Profile().as_row(),
        **(extra or {}),
        "messages": [{**row, "text": sentence(row["text"]), "hint": sentence(row["hint"])} for row in rows],
        "counters": counters if counters is not None else Counters().as_row(),
    }
