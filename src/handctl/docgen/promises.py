"""The promises that hold for every device, as text: README's table of symptoms, the commands of every device, and the exceptions.

The tables of README and the guides are generated from here, and `tests/promises` checks each row for every family. The exceptions of a
family are in its module `page`: EXCEPTIONS, rows of (key of the promise, commands or options that it does not cover, reason).
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import NamedTuple

from handctl.families import FAMILIES


class Symptom(NamedTuple):
    """A row of README's table.

    key    its name in the tests
    said   words of the message, in backticks, or the symptom
    code   its exit code, None if it has none of its own
    cause  the usual cause
    step   the next step; commands in backticks, for the first family as an example
    """

    key: str
    said: str
    code: int | None
    cause: str
    step: str


SYMPTOMS = (
    Symptom("no-port", "`no such port`", 3, "The adapter is not plugged in, or has a different name.", "`handctl ports`"),
    Symptom("not-permitted", "`not permitted`", 3, "Your user is not in the group that may use the port.", "`handctl doctor -p /dev/ttyUSB0`"),
    Symptom("in-use", "`in use`", 3, "Another program has the port open.", "Find it with `handctl ports`, then close it"),
    Symptom("refused", "`connection refused`", 3, "The server is off, or another client is connected to the device.", "`handctl doctor -p tcp://192.168.0.10`"),
    Symptom("no-answer", "`no answer`", 4, "No power, a faulty cable, the wrong id or the wrong baud rate.", "`handctl scan --all -p /dev/ttyUSB0`"),
    Symptom("no-frame", "`instead of a valid frame`", 5, "The wrong baud rate, noise, or a different device.", "`handctl scan -p /dev/ttyUSB0`"),
    Symptom("echo", "`only our own bytes`", 5, "An echo or a short circuit: no device replies.", "Check the wiring, then `handctl doctor -p /dev/ttyUSB0`"),
    Symptom("other-family", "`this is a wrist module`", 6, "The device belongs to a different family than the one you typed.", "`handctl scan -p /dev/ttyUSB0`"),
    Symptom("not-initialized", "`Motor not initialized`", 6, "A BarrettHand must be initialized (HI) after power-on.", "`handctl barrett init -p /dev/ttyUSB0`"),
    Symptom("not-reached", "`not reached`", 7, "A finger is blocked, or an AIDIN-hand has not been homed since power-on.", "`handctl aidin home -p tcp://192.168.0.10`"),
    Symptom("hot", "`over_temperature` stays", None, "It cannot be cleared while the motor is hot.", "Let it cool, then `handctl exo clear-errors -p /dev/ttyUSB0`"),
    Symptom("not-saved", "the old id or baud rate is back", None, "The new one has not been saved.", "Set it again, run `handctl exo save -p /dev/ttyUSB0`, then power-cycle the device"),
    Symptom("out-of-range", "`out of range`", 2, "The value is outside the documented range.", "Look up the range with `handctl exo describe`"),
    Symptom("not-confirmed", "not confirmed", 8, "The command moves or changes a device, and it was not confirmed.", "Run it with `-n` to see the bytes, then with `--yes`"),
    Symptom("wrong-values", "the values look wrong", None, "The bytes on the line show the reason.", "`handctl exo status --trace run.txt`, then `handctl trace show run.txt`"),
)  # fmt: skip


class Verb(NamedTuple):
    """A command that every device has: its name, its usage, and its effect."""

    name: str
    typed: str
    does: str


VERBS = (
    Verb("status", "status [--check]", "Shows a decoded health summary. With `--check`, the exit code is 7 if something is wrong."),
    Verb("dump", "dump", "Shows every documented quantity that can be read."),
    Verb("get", "get NAME...", "Shows quantities by name. `NAME.ELEMENT` selects one element."),
    Verb("set", "set NAME=VALUE...", "Writes quantities and reads them back. Everything that can be set can be read with `get`."),
    Verb("describe", "describe [NAME...]", "Lists the address, type, unit, range and access of each quantity. It needs no device."),
    Verb("watch", "watch [NAME...]", "Shows a live view on a terminal, and a stream elsewhere. `--count` and `--duration` limit it."),
    Verb("log", "log FILE", "Records samples with the time of this computer, and marks every gap."),
    Verb("scan", "scan", "Runs `handctl scan` for this family only. It finds any id and baud rate that the device can have."),
    Verb("doctor", "doctor", "Runs `handctl doctor` for this family: checks this computer, the link, and the device."),
    Verb("snapshot", "snapshot FILE", "Saves all settings to a file."),
    Verb("diff", "diff A [B]", "Compares two snapshots, or a snapshot and the device. The exit code is 7 if they differ."),
    Verb("restore", "restore FILE", "Writes the settings that differ from a snapshot, and reads them back."),
    Verb("report", "report FILE", "Writes one page for a service ticket."),
    Verb("stop", "stop", "Stops the device at once, without asking."),
)  # fmt: skip

WORDS = {
    "verb": "has the command",
    "option": "accepts the option",
    "arrival": "fails with exit code 7 if the target is not reached",
    "expect": "accepts --expect",
    "leave-alone": "accepts -1 to leave a finger alone",
    "settings": "compares and restores settings",
    "model": "shows its model in JSON",
    **{row.key: row.said.replace("`", "") for row in SYMPTOMS},
}
"""Key of a promise -> its text in the table of exceptions."""


class Exempt(NamedTuple):
    """An exception from a promise: the family, the commands or options, and the reason."""

    family: str
    promise: str
    where: str
    why: str


def exceptions(family: str = "") -> Iterator[Exempt]:
    """The exceptions of one family, or of all."""
    for name in [family] if family else FAMILIES:
        try:
            page = import_module(FAMILIES[name].module("page"))
        except ModuleNotFoundError:
            continue
        for promise, where, why in getattr(page, "EXCEPTIONS", ()):
            yield Exempt(name, promise, where, why)
