"""FSAVE and PSAVE: the EEPROM is rated for 5,000, so values are compared first and saves are counted (barrett §5.2.2, §5.2.3).

The hand tells neither how often it was saved nor what its EEPROM holds: FLOAD would show that, and replace what is in RAM.
handctl keeps its own journal per serial number, below the user's state folder. Saves made by other programs are not in it, so
what it says is what handctl saved, and never what the hand held.
"""

from __future__ import annotations

from typing import Any

from handctl.devices.barrett import state_files
from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.codec import motors_of
from handctl.devices.barrett.parameter_map import BARRETT, standard
from handctl.errors import Aftermath, DeviceRefused, HandctlError, Hint, Interrupted, NotIdentified, UsageError
from handctl.files import state_path
from handctl.model.result import Column, Row, Table

MOST_SAVES = 5000
FILE, WHAT = "barrett-saves.json", "journal of saves"
UNKNOWN_KEYS = ("0", "simulated-0")


def _whole(entry: object) -> bool:
    """Whether a hand's entry in the journal has the form that handctl writes."""
    if not isinstance(entry, dict) or not isinstance(entry.get("saves"), int):
        return False
    values = entry.get("values", {})
    return isinstance(values, dict) and all(isinstance(value, int) for value in values.values())


def present(hand: BarrettHand) -> dict[str, int]:
    """All settings of this firmware as they are in RAM, by full name. Raises why one of them could not be read."""
    elements = BARRETT.elements(*(param.mnemonic for param in standard() if param.writable))
    return {reading.element.full_name: int(reading.required) for reading in hand.present(hand.read(elements))}


def save(hand: BarrettHand, *, force: bool, prefix: str = "") -> Table:
    """RAM to EEPROM for what changed since handctl's last save; refuses a save that changes nothing.

    With a GCL `prefix` the motors that it names only; the rest of the EEPROM stays as it is (barrett §5.2.2 FSAVE).
    Raises UsageError when nothing changed (unless `force`), DeviceRefused when the hand reports an error.
    """
    everything = present(hand)
    chosen = motors_of(prefix)
    now = {name: value for name, value in everything.items() if not prefix or name.rpartition(".")[2] in chosen}
    journal = SaveJournal(hand)
    before = {name: value for name, value in journal.last.items() if name in now}
    if now == before and not force:
        raise UsageError(
            "the settings are those that handctl saved last on this hand. The EEPROM cannot be read, so it is not known whether another program has saved since",
            hint=f"use --force to save them again. The EEPROM is rated for {MOST_SAVES} saves. Nothing was written.",
            code="saved-already",
        )
    changed = [name for name in now if now[name] != before.get(name)]
    halves = (
        (f"{prefix}FSAVE", any("." in name for name in changed)),
        ("PSAVE", any("." not in name for name in changed)),
    )[: 1 if prefix else 2]
    verbs = [verb for verb, touched in halves if touched or force]
    if len(verbs) == 1 and not force and not prefix:
        hand.journal.info(
            "half",
            f"only {verbs[0]} is sent, because the rest has not changed since handctl last saved it",
            hint="use --force to write both halves, in case another program has saved since",
        )
    done: list[str] = []
    for verb in verbs:
        sent = hand.journal.counters.sent
        try:
            hand.do(verb)
        except DeviceRefused:
            if done:  # one half is in the EEPROM: count it, and let the next save write all again
                journal.count({})
            raise
        except (HandctlError, KeyboardInterrupt) as exc:
            unsent = isinstance(exc, NotIdentified) or hand.journal.counters.sent == sent
            if done or not unsent:
                journal.count({})  # it may have been written: the next save writes everything
            if unsent:
                raise
            raise _unsure(exc, verb) from exc
        done.append(verb)
    journal.count(journal.last | now)
    rows: list[Row] = [
        {"name": name, "before": None, "last_save": before.get(name), "value": now[name], "default": default_of(name)}
        for name in (changed if before else [name for name, value in now.items() if value != default_of(name)])
    ]
    columns = (
        Column("name", "Name"),
        Column("last_save", "Last save", right=True),
        Column("value", "Saved", right=True),
        Column("default", "Default", right=True),
    )
    return Table(rows=rows, columns=columns)


def _unsure(exc: HandctlError | KeyboardInterrupt, verb: str) -> HandctlError:
    """What is known of a save whose answer did not come."""
    hint = Hint("leave the power on for 15 s, then run {}. The save was counted", "barrett dump")
    error = exc.reworded(exc.text, hint="") if isinstance(exc, HandctlError) else Interrupted()
    error.add_aftermath(Aftermath(f"{verb} was sent, and the hand may be writing its EEPROM", hint))
    return error


class SaveJournal:
    """The journal, and the entry of one hand in it. Raises UsageError where the journal cannot be read."""

    def __init__(self, hand: BarrettHand) -> None:
        self._hand = hand
        self._entries = state_files.load(state_path(FILE), WHAT, _whole)
        (serial,) = hand.read(BARRETT.elements("SN"))
        self._key = f"{'simulated-' if hand.link.fake else ''}{int(serial.value or 0)}"
        self._entry: dict[str, Any] = self._entries.get(self._key, {})

    @property
    def last(self) -> dict[str, int]:
        """What handctl saved last in this hand, by full name; {} where that is not known.

        A serial number of 0 is that of every hand upgraded in the field: its entry may speak of another.
        """
        values: dict[str, int] = self._entry.get("values", {}) if self._key not in UNKNOWN_KEYS else {}
        return values

    def count(self, now: dict[str, int]) -> None:
        """Count one save, which left these values; after one of unknown values, {}, the next save writes everything."""
        count = int(self._entry.get("saves", 0)) + 1
        self._entries[self._key] = self._entry = {"saves": count, "values": now}
        try:
            state_files.store(state_path(FILE), WHAT, self._entries)
        except HandctlError as exc:
            self._hand.journal.warn("journal", f"saved, but {exc.text}")
        self._hand.journal.info("saves", f"save number {count} by handctl, of at most {MOST_SAVES} in the hand's life")


class Ledger(SaveJournal):
    """Reads what the journal needs before a save is made otherwise, so that the save can be counted afterwards.

    Made before anything is written: when the hand cannot tell (over-temperature), nothing has been changed yet.
    """

    def __init__(self, hand: BarrettHand) -> None:
        super().__init__(hand)
        self._values = present(hand)

    def count_common(self, **changed: int) -> None:
        """Count one PSAVE of what was read, with what has been `changed` since: the motors stay as saved last."""
        now = {name: value for name, value in self._entry.get("values", {}).items() if "." in name}
        self.count(now | {name: value for name, value in self._values.items() if "." not in name} | changed)


def default_of(name: str) -> int | None:
    """The factory value of a setting by its full name."""
    param, elements = BARRETT.find(name)
    return param.default_of(elements[0].index)
