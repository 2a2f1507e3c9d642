"""The commands that every device has, as README and the guides list them."""

from __future__ import annotations

from typing import NamedTuple


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
    Verb("scan", "scan", "Runs `handctl scan` for this family only. It tries each id (1 to 254) and baud rate that the family can have, within a time limit if the line is silent. `--all` has no time limit."),
    Verb("doctor", "doctor", "Runs `handctl doctor` for this family: checks this computer, the link, and the device."),
    Verb("snapshot", "snapshot FILE", "Saves the settings to a file, and for `exo` and `wrist` the set points too."),
    Verb("diff", "diff A [B]", "Compares two snapshots, a snapshot and the device, or two devices. The exit code is 7 if they differ."),
    Verb("restore", "restore FILE", "Writes the settings that differ from a snapshot, and reads them back."),
    Verb("report", "report FILE", "Writes one page for a service ticket."),
    Verb("stop", "stop", "Sends the stop at once, without asking. A BarrettHand or an AIDIN-hand loses its motor power, an RH56 hand moves a little further, and an EksoNR may not stop at all: see handctl-safety(7)."),
)  # fmt: skip
