"""What handctl promises of every device, in words: README's table of symptoms, the commands that every device has, and the exceptions.

README and the guides are filled from here, and `tests/promises` tries each row on every family. A family's exceptions are in its
module `page`: EXCEPTIONS, rows of the key of a promise, to what it does not apply, and why.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from typing import NamedTuple

from handctl.families import FAMILIES


class Symptom(NamedTuple):
    """A row of README's table.

    key    its name in the tests
    said   what handctl says, in backticks, or what is seen
    code   the exit code that comes with it, None where it has none of its own
    cause  what it comes from
    step   what to do; commands in backticks, of the first family, which stands for any
    """

    key: str
    said: str
    code: int | None
    cause: str
    step: str


SYMPTOMS = (
    Symptom("no-port", "`no such port`", 3, "The adapter is not plugged in, or has another name.", "`handctl ports`"),
    Symptom("not-permitted", "`not permitted`", 3, "Your user is not in the group of the port.", "`handctl doctor -p /dev/ttyUSB0`"),
    Symptom("in-use", "`in use`", 3, "Another program has the port open.", "`handctl ports`, then end that program"),
    Symptom("refused", "`connection refused`", 3, "The server is off, or another client holds the device.", "`handctl doctor -p tcp://192.168.0.10`"),
    Symptom("no-answer", "`no answer`", 4, "No power, a cable fault, a wrong id or a wrong speed.", "`handctl scan --all -p /dev/ttyUSB0`"),
    Symptom("no-frame", "`not a valid frame`", 5, "A wrong speed, noise, or another device.", "`handctl scan -p /dev/ttyUSB0`"),
    Symptom("echo", "`only our own bytes`", 5, "An echo or a short circuit: no device answers.", "Check the wiring, then `handctl doctor -p /dev/ttyUSB0`"),
    Symptom("other-family", "`this is a wrist module`", 6, "The device is not of the family that you typed.", "`handctl scan -p /dev/ttyUSB0`"),
    Symptom("not-initialized", "`Motor not initialized`", 6, "A BarrettHand needs HI after power-on.", "`handctl barrett init -p /dev/ttyUSB0`"),
    Symptom("not-reached", "`not reached`", 7, "A finger was blocked, or an AIDIN-hand was not homed after power-on.", "`handctl aidin home -p tcp://192.168.0.10`"),
    Symptom("hot", "`over_temperature` stays", None, "It cannot be cleared while the motor is hot.", "Let it cool, then `handctl exo clear-errors -p /dev/ttyUSB0`"),
    Symptom("not-saved", "the old id or speed is back", None, "The new one was not saved.", "`handctl exo save -p /dev/ttyUSB0`, then power-cycle it"),
    Symptom("out-of-range", "`out of range`", 2, "The value is refused, never clamped.", "`handctl exo describe`"),
    Symptom("not-confirmed", "not confirmed", 8, "The command moves or changes a device, and no one answered yes.", "Run it with `-n` to see the bytes, then with `--yes`"),
    Symptom("wrong-values", "the values look wrong", None, "The bytes on the line show why.", "`handctl exo status --trace run.txt`, then `handctl trace show run.txt`"),
)  # fmt: skip


class Verb(NamedTuple):
    """A command that every device has: its name, how it is typed, and what it does."""

    name: str
    typed: str
    does: str


VERBS = (
    Verb("status", "status [--check]", "The health, decoded. With `--check` the exit code is 7 when something is wrong."),
    Verb("dump", "dump", "Every documented quantity that can be read."),
    Verb("get", "get NAME...", "Quantities by name. `NAME.ELEMENT` takes one element."),
    Verb("set", "set NAME=VALUE...", "Writes, then reads back. Whatever can be set can be read with `get`."),
    Verb("describe", "describe [NAME...]", "Address, type, unit, range and access of each quantity. It needs no device."),
    Verb("watch", "watch [NAME...]", "A live view on a terminal, elsewhere a stream. Bounded by `--count` and `--duration`."),
    Verb("log", "log FILE", "A recording with the time of this computer, in which every gap is marked."),
    Verb("scan", "scan", "`handctl scan` for this family alone: it finds any id and speed that the device can have."),
    Verb("doctor", "doctor", "`handctl doctor` for this family: this computer, the link, and the device."),
    Verb("snapshot", "snapshot FILE", "All settings in a file."),
    Verb("diff", "diff A [B]", "Two snapshots, or a snapshot and the device. The exit code is 7 when they differ."),
    Verb("restore", "restore FILE", "Writes the settings that differ from a snapshot, and reads them back."),
    Verb("report", "report FILE", "One page for a service ticket."),
    Verb("stop", "stop", "Stops the device at once, and asks nothing."),
)  # fmt: skip

WORDS = {
    "verb": "has the command",
    "option": "takes the option",
    "arrival": "fails with exit code 7 if the target is not reached",
    "expect": "takes --expect",
    "leave-alone": "takes -1 for a finger to be left alone",
    "settings": "compares and restores settings",
    "model": "shows its model in JSON",
    **{row.key: row.said.replace("`", "") for row in SYMPTOMS},
}
"""Key of a promise -> its words in the table of exceptions."""


class Exempt(NamedTuple):
    """Where a promise does not hold: of which family, for what, and why."""

    family: str
    promise: str
    where: str
    why: str


def exceptions(family: str = "") -> Iterator[Exempt]:
    """Those of one family, or of all."""
    for name in [family] if family else FAMILIES:
        try:
            page = import_module(FAMILIES[name].module("page"))
        except ModuleNotFoundError:
            continue
        for promise, where, why in getattr(page, "EXCEPTIONS", ()):
            yield Exempt(name, promise, where, why)
