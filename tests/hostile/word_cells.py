"""Nonsense in place of each option's and each argument's value, and of each number in a word or a LINK, in every command of the
tree."""

from __future__ import annotations

import re
import socket
from collections.abc import Iterator
from unittest import mock

import click

from handctl.command.options import SharedOption
from handctl.families import FAMILIES
from tests.harm import lines as examples
from tests.hostile.cell import Folder, Tried, attempt
from tests.hostile.devices import READY
from tests.hostile.texts import LINK, TEXTS

KINDS = ("digits", "digits of other scripts", "past all bounds", "no bound", "zero", "not UTF-8", "lines")
LINKS = (
    "tcp://localhost:{}", "tcp://[::1]:{}", "socket://localhost:{}", "{}", "usb:0403:6001:{}", "/dev/none?{}",
    "fake://{{}}?clock=virtual@{}", "fake://{{}}?clock=virtual&id={}", "fake://{{}}?clock=virtual&baud={}",
    "fake://{{}}?clock=virtual&fault={}", "can:slcan:{}", "can:slcan:/dev/none?bitrate={}",
)  # fmt: skip
NUMBER = re.compile(r"(?<![A-Za-z_.])\d+")
SERVERS = ("--tcp localhost:{}", "--tcp {}", "--slcan-tcp localhost:{}", "--modbus-tcp localhost:{}")


def spoiled(command: click.Command, text: str) -> Iterator[tuple[str, ...]]:
    """What follows a command, with this text as the value of one option or of all arguments."""
    arguments = [param for param in command.params if isinstance(param, click.Argument)]
    if arguments:
        yield tuple(text for param in arguments for _ in range(max(1, param.nargs)))
        yield (f"id={text}",)
    for param in command.params:
        if isinstance(param, click.Option) and not isinstance(param, SharedOption) and not param.is_flag:
            yield (max(param.opts, key=len), *(text for _ in range(param.nargs)))


def link_of(family: str) -> str:
    """A simulator that is ready to do what it is asked."""
    return LINK.format(family) + "".join(f"&{key}={value}" for key, value in READY.get(family, {}).items())


def cells(name: str, text: str) -> Iterator[tuple[str, ...]]:
    """Command lines of one family, or of the tools that talk to any."""
    for path, command in examples.tree().items():
        if (path[0] if path[0] in FAMILIES else "") != name:
            continue
        names = {option for param in command.params for option in param.opts}
        link = ("-p", link_of(name or "exo"), "--deadline", "5")
        ends = tuple(word for option in ("--count", "--duration") if option in names for word in (option, "2"))
        base = examples.examples()[path][0].words
        for words in spoiled(command, text):
            arguments = () if not words[0].startswith("--") else base[len(path) :]
            yield (*path, *ends, *arguments, *words, *link)
        for line in examples.examples()[path]:  # a number inside a word: NAME=VALUE, FROM-TO, index.q3=160
            for at, word in enumerate(line.words[len(path) :], len(path)):
                spoilt = NUMBER.sub(lambda _: text, word)
                asks_for_help = spoilt.startswith("-") and "h" in spoilt  # short options in one word, -h among them
                if spoilt != word and "{dir}" not in word and not asks_for_help:
                    yield (*line.words[:at], spoilt, *line.words[at + 1 :], *link)


def links(name: str, text: str) -> Iterator[tuple[str, ...]]:
    """A reading command of a family at each kind of LINK, and its simulator at each kind of place."""
    for form in LINKS:
        link = form.format(text).format(name)
        yield name, "status", "-p", link, "--deadline", "1"
        yield "scan", "-p", link, "--family", name, "--deadline", "1"
    for form in SERVERS:
        if text != TEXTS["zero"]:  # which is any free port
            yield "sim", name, *form.format(text).split(" ", 1)


def rows() -> Iterator[tuple[str, str, str, tuple[str, ...]]]:
    """Family or "", kind, how the line is named, its words; {dir} is a scratch folder."""
    for name in (*FAMILIES, ""):
        for kind in KINDS:
            text = TEXTS[kind]
            for words in (*cells(name, text), *(links(name, text) if name else ())):
                yield name, kind, " ".join(words).replace(text, "{}"), words


def try_words(name: str, words: tuple[str, ...], folder: Folder) -> Tried:
    """A command line with nonsense in it, and no network: a number that is a port by accident leads nowhere."""
    typed = [word.replace("{dir}", str(folder.path / (name or "exo"))) for word in words]
    with mock.patch.object(socket, "getaddrinfo", side_effect=socket.gaierror(-2, "not in this test")):
        return attempt([*typed, "--json"], "json" if words[0] != "sim" else "any", folder)
