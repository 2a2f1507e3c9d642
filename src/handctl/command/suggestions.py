"""Suggestions for a mistyped command, by spelling and by meaning. A command that writes is only suggested together with what it
does, and by spelling only if it is one typing mistake away or no command that reads is similar.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import click

from handctl.command.options import command_line
from handctl.families import COMMANDS, FAMILIES
from handctl.misspellings import near, slips

LINK = re.compile(r"/dev/(tty|cu|serial|rfcomm)|COM\d+$|(can|usb|replay):|(tcp|fake|socket|rfc2217)://")

SAME = (
    # what is typed, and which commands may be meant, the most likely first
    ("info show state health summary check errors-now overview", "status"),
    ("all values everything read-all export-all", "dump"),
    ("list params parameters registers map quantities names", "list describe"),
    ("monitor live stream plot follow tail curve", "watch"),
    ("record log capture", "log watch"),
    ("halt abort kill emergency estop e-stop off freeze", "stop"),
    ("backup store-file export", "snapshot"),
    ("compare changes", "diff"),
    ("reset clear unlatch acknowledge", "clear-errors reset factory-reset"),
    ("restart reboot power-cycle", "reset"),
    ("factory default factory-defaults", "factory-reset defaults"),
    ("speed rate bitrate", "baud"),
    ("address rename", "id"),
    ("find search discover detect identify who", "scan"),
    ("firmware about fw", "version firmware"),
    ("diagnose troubleshoot test selftest problem symptom", "diagnose doctor"),
    ("support ticket service", "report"),
    ("grasp grip", "close"),
    ("release", "open"),
    ("initialize initialise setup", "init"),
    ("write change assign", "set"),
    ("keep flash store", "save"),
    ("simulate simulator fake", "sim"),
    ("decode transcript replay", "trace"),
    ("names name alias config", "devices"),
    ("journal audit writes written yesterday", "history"),
    ("man manual guide docs topics", "help"),
    ("serial tty adapters", "ports"),
)
"""By meaning, whatever the device."""


def meant(word: str, commands: Mapping[str, Any]) -> str:
    """A sentence for the end of a message, with a space before it, or nothing. `commands` are click's, or None for a reading one."""
    low = word.casefold()
    names = [name for typed, known in SAME if low in typed.split() for name in known.split() if name in commands]
    reading = [name for name, one in commands.items() if not getattr(one, "writes", False)]
    names += slips(low, commands) or near(low, reading)
    if not names:
        names = near(low, commands)
    if not names:
        return ""
    return f" Did you mean {' or '.join(_said(name, commands[name]) for name in dict.fromkeys(names))}?"


def without_device(name: str) -> str:
    """The sentence for a command that was typed below a device, and takes none; "" if it is none."""
    return f" It takes no device: `handctl {name}`." if name in COMMANDS and name not in FAMILIES else ""


def _said(name: str, command: Any) -> str:
    if not getattr(command, "writes", False):
        return repr(name)
    what = command.get_short_help_str(1000).rstrip(".")
    return f"{name!r} (writes: {what})"


def elsewhere(words: Sequence[str]) -> str:
    """What to type instead of a device's command without its family; "" if it is none."""
    from handctl.command.family import load

    name = words[0]
    having = [family for family in FAMILIES if name in load(family, "cli").cli.commands]
    if len(words) > 1 and words[1] in having:
        return f" The device comes first: `handctl {words[1]} {name}`."
    if not having:
        return ""
    if len(having) == 1:
        return f" Did you mean `handctl {having[0]} {name}`?"
    return f" The device comes first: {', '.join(f'`handctl {family} {name}`' for family in having)}. With `-d NAME` it is left out."


def top(words: Sequence[str]) -> str:
    """The sentence for a first word that is no command."""
    name = words[0]
    if name == "version":
        return f" `handctl --version` shows the version of handctl.{elsewhere(words)}"
    if found := elsewhere(words):
        return found
    from handctl.command.family import load

    if len(words) > 1 and words[1] in FAMILIES:
        return (
            meant(name, load(words[1], "cli").cli.commands) + f" The device comes first: `handctl {words[1]} COMMAND`."
        )
    verbs = dict.fromkeys(verb for family in FAMILIES for verb in load(family, "cli").cli.commands)
    slip = slips(name, verbs) if not slips(name, COMMANDS) else []
    if not slip and (found := meant(name, dict.fromkeys(COMMANDS))):
        return found
    if close := slip[:1] or near(name, verbs, most=1):
        where = elsewhere([*close, *words[1:]])
        return where if where.startswith(" Did") else f" Did you mean {close[0]!r}?{where}"
    from difflib import get_close_matches

    turned = [one for one in COMMANDS if sorted(one) == sorted(name.casefold())]  # the letters in another order
    vague = turned or get_close_matches(name, list(COMMANDS), n=2, cutoff=0.3)
    return f" Did you mean {' or '.join(map(repr, vague))}?" if vague else ""


def bare_link(words: Sequence[str]) -> str:
    """The first word that is a LINK and stands behind no option, where -p names none; "" if there is none."""
    if any(word.startswith(("-p", "--port")) for word in words):
        return ""
    before = ("", *words)
    return next((word for at, word in enumerate(words) if LINK.match(word) and not before[at].startswith("-")), "")


def device_in(ctx: click.Context, later: Sequence[str]) -> str | None:
    """The name that -d gives, before the first command or among the words that come `later`."""
    found = command_line(ctx).given.get("device")
    for word, following in zip(later, (*later[1:], ""), strict=True):
        if word == "--":
            break
        if word in ("-d", "--device"):
            found = following
        elif word.startswith("--device="):
            found = word.partition("=")[2]
        elif word.startswith("-d"):
            found = word[2:]
    return str(found) if found else None
