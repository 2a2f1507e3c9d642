"""FSAVE and PSAVE: at most 5,000 in the life of a hand, so they are compared first and counted (barrett §5.2.2, §5.2.3).

The hand does not tell how often it was saved. handctl keeps its own journal per serial number, below the user's state
folder; saves made by other programs are not in it.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from handctl.devices.barrett.hand import BarrettHand, refusal
from handctl.devices.barrett.parameters import BARRETT, all_elements, standard
from handctl.errors import HandctlError, OutputError, UsageError
from handctl.result import Column, Row, Table

MOST_SAVES = 5000


def journal_path() -> Path:
    """Where the saves are counted: $XDG_STATE_HOME/handctl, by default ~/.local/state/handctl."""
    base = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    return Path(base) / "handctl" / "barrett-saves.json"


def load_journal() -> dict[str, Any]:
    """The journal; empty when there is none. Raises UsageError when it is damaged."""
    path = journal_path()
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as exc:
        raise UsageError(
            f"{path}: the journal of saves cannot be read: {exc}", hint="move it away to start a new count"
        ) from exc
    if not isinstance(content, dict):
        raise UsageError(f"{path}: not a journal of saves", hint="move it away to start a new count")
    return content


def store_journal(content: dict[str, Any]) -> None:
    """Write the journal atomically. Raises OutputError."""
    path = journal_path()
    temporary = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(temporary, "w", encoding="utf-8") as file:
            json.dump(content, file, indent=1, sort_keys=True)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError as exc:
        raise OutputError(f"{path}: the journal of saves cannot be written: {exc.strerror or exc}") from exc


def present(hand: BarrettHand) -> dict[str, int]:
    """All settings as they are in RAM, by full name."""
    readings = hand.read(all_elements([param for param in standard() if param.writable]))
    for reading in readings:
        if reading.error is not None:
            raise reading.error
    return {reading.element.full_name: int(reading.value) for reading in readings if reading.value is not None}


def save(hand: BarrettHand, *, force: bool, simulated: bool) -> Table:
    """RAM to EEPROM for what changed since handctl's last save; refuses a save that changes nothing.

    Raises UsageError when nothing changed (unless `force`), DeviceRefused when the hand reports an error.
    """
    now = present(hand)
    (serial,) = hand.read(all_elements([BARRETT.by_mnemonic("SN")]))
    key = f"{'simulated-' if simulated else ''}{int(serial.value or 0)}"
    journal = load_journal()
    known = journal.get(key, {})
    before: dict[str, int] = known.get("values", {})
    if now == before and not force:
        raise UsageError(
            "nothing has changed since the last save",
            hint=f"the EEPROM lasts {MOST_SAVES} saves; --force saves all the same. Nothing was sent.",
        )
    changed = [name for name in now if now[name] != before.get(name)]
    verbs = [
        verb
        for verb, touched in (
            ("FSAVE", any("." in name for name in changed)),
            ("PSAVE", any("." not in name for name in changed)),
        )
        if touched
    ]
    for verb in verbs or ["FSAVE", "PSAVE"]:
        answer = hand.line.ask(verb)
        if answer.status:
            raise refusal(answer)
    count = int(known.get("saves", 0)) + 1
    journal[key] = {"saves": count, "values": now}
    try:
        store_journal(journal)
    except HandctlError as exc:
        hand.journal.warn("journal", f"saved, but {exc.text}")
    hand.journal.info("saves", f"save number {count} by handctl of at most {MOST_SAVES} in the hand's life")
    rows: list[Row] = [
        {"name": name, "before": before.get(name), "value": now[name], "default": default_of(name)}
        for name in (changed if before else differing(now))
    ]
    columns = (
        Column("name", "Name"),
        Column("before", "Last save", right=True),
        Column("value", "Saved", right=True),
        Column("default", "Default", right=True),
    )
    return Table(rows=rows, columns=columns)


def differing(now: dict[str, int]) -> list[str]:
    """Settings that differ from the factory's."""
    return [name for name, value in now.items() if value != default_of(name)]


def default_of(name: str) -> int | None:
    """The factory value of a setting by its full name."""
    param, elements = BARRETT.find(name)
    return param.default_of(elements[0].index)
