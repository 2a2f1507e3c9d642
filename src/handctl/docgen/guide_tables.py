"""The tables that are generated in README.md and in the guides: devices, commands, questions, links, exit codes.

The commands that every device has, the troubleshooting of README, and what is promised for every device with each family's
exceptions are data here; `tests/promises` checks every row.

Each is between `<!-- NAME: … -->` and `<!-- end -->`; everything else of the page is left as it is.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from handctl import guides
from handctl.command.family import page_of
from handctl.docgen.man_pages import LINKS, exit_codes
from handctl.docgen.read_command_tree import Node
from handctl.families import COMMANDS, FAMILIES
from handctl.guides import Heading, Para


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
    Verb("scan", "scan", "Runs `handctl scan` for this family only. It tries each id (1 to 254) and baud rate that the family can have. On a line where nothing replies, it ends after a time limit, unless you add `--all`."),
    Verb("doctor", "doctor", "Runs `handctl doctor` for this family: checks this computer, the link, and the device."),
    Verb("snapshot", "snapshot FILE", "Saves the settings to a file. For `exo`, it also saves the set points; for `wrist`, which has no settings, only the set points."),
    Verb("diff", "diff A [B]", "Compares two snapshots, a snapshot and the device, or two devices. The exit code is 7 if they differ."),
    Verb("restore", "restore FILE", "Writes the settings that differ from a snapshot, and reads them back."),
    Verb("report", "report FILE", "Writes one page for a service ticket."),
    Verb("stop", "stop", "Sends the stop at once, without asking. A BarrettHand or an AIDIN-hand loses its motor power, an RH56 hand moves a little further, and an EksoNR may not stop at all: see handctl-safety(7)."),
)  # fmt: skip


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
    Symptom("refused", "`connection refused`", 3, "Either the device or its network adapter is switched off, or another client is already connected.", "`handctl doctor -p tcp://192.168.0.10`"),
    Symptom("no-answer", "`no reply`", 4, "No power, a faulty cable, the wrong id or the wrong baud rate.", "`handctl scan --all -p /dev/ttyUSB0`"),
    Symptom("no-frame", "`instead of a valid frame`", 5, "The wrong baud rate, noise, or a different device.", "`handctl scan -p /dev/ttyUSB0`"),
    Symptom("echo", "`only our own bytes`", 5, "An echo or a short circuit: no device replies.", "Check the wiring, then `handctl doctor -p /dev/ttyUSB0`"),
    Symptom("other-family", "`this is a wrist module`", 6, "The device belongs to a different family than the one you typed.", "`handctl scan -p /dev/ttyUSB0`"),
    Symptom("not-initialized", "`Motor not initialized`", 6, "A BarrettHand must be initialized (HI) after power-on.", "`handctl barrett init -p /dev/ttyUSB0`"),
    Symptom("not-reached", "`not reached`", 7, "A finger is blocked, or an AIDIN-hand has not been homed since power-on.", "Free the finger, or home the hand: `handctl aidin home -p tcp://192.168.0.10`"),
    Symptom("hot", "`over_temperature` stays", None, "No command clears it. It goes away once the actuator has cooled down.", "Let it cool. `handctl exo clear-errors -p /dev/ttyUSB0` clears the other errors and shows any that remain"),
    Symptom("not-saved", "the old id or baud rate is back", None, "The new one has not been saved.", "Set it again, run `handctl exo save -p /dev/ttyUSB0` (add `--id` and the new id if you changed the id), then power-cycle the device"),
    Symptom("out-of-range", "`out of range`", 2, "The value is outside the documented range.", "Look up the range with `handctl exo describe`"),
    Symptom("not-confirmed", "not confirmed", 8, "The command moves or changes a device, and it was not confirmed.", "Run it with `--dry-run` (`-n`) to see the bytes, then with `--yes`"),
    Symptom("wrong-values", "the values look wrong", None, "Corrupted data, or a different device. A recording of the bytes shows which of the two it is.", "`handctl exo status -p /dev/ttyUSB0 --trace run.txt`, then `handctl trace show run.txt`"),
)  # fmt: skip


class Exempt(NamedTuple):
    """An exception from a promise: the family, the key of the promise, the commands or options, and what they do instead, and why."""

    family: str
    promise: str
    where: str
    why: str


def exceptions(family: str = "") -> Iterator[Exempt]:
    """The exceptions of one family, or of all."""
    for name in [family] if family else FAMILIES:
        for promise, where, why in getattr(page_of(name), "EXCEPTIONS", ()):
            yield Exempt(name, promise, where, why)


SECTION = re.compile(r"(<!-- (?P<name>[a-z-]+): generated[^>]*-->\n).*?(<!-- end -->)", re.DOTALL)

KNOWN = "Sources"
"""The section of a family's guide from which README's table of devices takes two sentences."""


def filled(text: str, tree: Node) -> str:
    """The page with its sections generated again. Raises KeyError for an unknown section."""
    return SECTION.sub(lambda found: found[1] + "\n".join(MAKERS[found["name"]](tree)) + "\n" + found[3], text)


def _known(family: str) -> tuple[str, str, str]:
    """The first two paragraphs of a guide's section KNOWN: what it was tested with, and what the family's bytes rest on."""
    if family not in guides.names():
        return "Not yet run on real hardware.", "The manual.", ""
    text = guides.source(family)
    blocks = list(guides.blocks(text))
    place = next(place for place, block in enumerate(blocks) if isinstance(block, Heading) and block.text == KNOWN)
    said = [block.text for block in blocks[place + 1 : place + 3] if isinstance(block, Para)]
    return said[0][:1].upper() + said[0][1:], said[1], f"{guides.title(text)[0]}(7)"


def _verbs(tree: Node) -> Iterable[str]:
    """Verbs that all devices have, then those of each device."""
    by_family = {
        node.path[0]: [child.path[-1] for child in node.children] for node in tree.children if node.path[0] in FAMILIES
    }
    usual = [name for name in next(iter(by_family.values())) if all(name in names for names in by_family.values())]
    rows = [("every device", usual)]
    rows += [(f"`{name}`", [verb for verb in names if verb not in usual]) for name, names in by_family.items()]
    return _markdown(
        ("device", "commands"), ((device, ", ".join(f"`{verb}`" for verb in verbs)) for device, verbs in rows)
    )


def _asks(tree: Node) -> Iterable[str]:
    """Which commands of each family ask first, and which start immediately, by their rows."""
    rows = []
    for family in [node for node in tree.children if node.path[0] in FAMILIES]:
        first, at_once = [], []
        for leaf in [one for one in family.walk() if one.writes]:
            name = f"`{' '.join(leaf.path[1:])}`"
            asked, _, else_ = leaf.asks.partition("; ") if isinstance(leaf.asks, str) else ("", "", "")
            first += [" ".join(filter(None, (name, asked)))] if leaf.asks else []
            at_once += [" ".join(filter(None, (name, else_)))] if else_ or not leaf.asks else []
        rows.append((f"`{family.path[0]}`", ", ".join(first), ", ".join(at_once)))
    return _markdown(("family", "asks first", "starts immediately"), rows)


MAKERS: dict[str, Callable[[Node], Iterable[str]]] = {
    "devices": lambda _tree: _markdown(
        ("command", "device", "tested with", "sources", "guide"),
        ((f"`handctl {name}`", COMMANDS[name][1], *_known(name)) for name in FAMILIES),
    ),
    "verbs": _verbs,
    "asks": _asks,
    "links": lambda _tree: _markdown(("LINK (`-p`)", "meaning"), ((f"`{name}`", text) for name, text in LINKS)),
    "exit-codes": lambda _tree: _markdown(("exit code", "meaning"), ((str(code), text) for code, text in exit_codes())),
    "symptoms": lambda _tree: _markdown(
        ("message or symptom", "cause", "next step"),
        ((row.said + (f" ({row.code})" if row.code is not None else ""), row.cause, row.step) for row in SYMPTOMS),
    ),
    "usual": lambda _tree: _markdown(("command", "what it does"), ((f"`{row.typed}`", row.does) for row in VERBS)),
    "exceptions": lambda _tree: _markdown(
        ("device and what it concerns", "what is different"),
        ((f"`{row.family}`: {row.where}", row.why) for row in exceptions()),
    ),
}


def _markdown(heading: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> Iterable[str]:
    yield f"| {' | '.join(heading)} |"
    yield "|---" * len(heading) + "|"
    for row in rows:
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |"
