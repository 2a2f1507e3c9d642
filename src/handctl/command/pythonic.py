"""What a message says to somebody at a terminal, in the words of a program: methods for commands, arguments for options."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from handctl.command.command_tree import Command

OPTION = re.compile(r"(?<![\w-])(--[a-z]+(?:-[a-z]+)*|-[pdny]\b)(?:=(?=\w))?")
MEANS = {
    "-p": "link",
    "-d": "a named device",
    "-n": "dry_run",
    "-y": "confirm",
    "--yes": "confirm=True",
    "--fake": "simulate()",
}
"""Options that have another name there; of all others - becomes _."""
OPENED = ("-p", "--port", "-d", "--device")
"""Options whose value says which device: it is open already."""


def in_python(text: str, kind: str, known: Mapping[str, Command]) -> str:
    """`text` for a program that has a device of family `kind`, whose methods are the commands `known`.

    A command of another program, or of handctl as a whole, stays as it is typed.
    """
    return "".join(
        _code(piece, kind, known) if piece[:1] == "`" else OPTION.sub(_name, piece)
        for piece in re.split("(`[^`]*`)", text)
    )


def _name(found: re.Match[str]) -> str:
    return MEANS.get(found[1]) or found[1].lstrip("-").replace("-", "_")


def _code(piece: str, kind: str, known: Mapping[str, Command]) -> str:
    """What stands between backticks: a command of this family becomes a call, an option an argument."""
    try:
        words = shlex.split(piece.strip("`"))
    except ValueError:
        return piece
    typed = words[:1] == ["handctl"]
    own = words[1:2] == [kind] or words[1:2] in (["-d"], ["--device"])
    words = [word for word in words[typed:] if word != kind]
    while words and words[0] in OPENED:
        del words[:2]
    for count in (2, 1) if own or not typed else ():
        name = "_".join(words[:count]).replace("-", "_")
        if len(words) >= count and name in known and (typed or " -" in piece):
            return f"`{name}({', '.join(_arguments(words[count:], known[name]))})`"
    return piece if typed else OPTION.sub(_name, piece)


def _arguments(words: list[str], command: click.Command) -> list[str]:
    """Words behind a command as arguments of a method."""
    options = {name: param for param in command.params if isinstance(param, click.Option) for name in param.opts}
    found, rest = [], list(words)
    while rest:
        word = rest.pop(0)
        if not re.match("--?[a-z]", word):
            found.append(_literal(word))
            continue
        option, takes = options.get(word), word in OPENED or bool(rest and rest[0].isupper())
        if option is not None:
            takes = not option.is_flag
        value: Any = _literal(rest.pop(0)) if takes and rest else True
        if word not in OPENED:
            found.append(f"{MEANS.get(word, word.lstrip('-')).partition('=')[0].replace('-', '_')}={value}")
    return found


def _literal(word: str) -> str:
    return word if re.fullmatch("-?[0-9.]+|…", word) else f'"{word}"'
