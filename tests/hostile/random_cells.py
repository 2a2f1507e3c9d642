"""Random command lines from the tree: thousands, seeded, in this process, against simulators and nonsense.

No line may reach a real port, and none may wait: a simulator is on virtual time, streams and servers are bounded, stdin is empty.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

import click

import handctl.link.can
import handctl.link.serial
import handctl.link.tcp
from handctl.command.command_tree import root
from handctl.command.options import InFile, OutFile, SharedOption
from handctl.errors import LinkError
from handctl.families import FAMILIES
from tests.harm import lines as examples
from tests.harm.lines import leaves
from tests.hostile.cell import Folder, Tried, attempt
from tests.hostile.devices import READY
from tests.hostile.texts import TEXTS

LINES = 100
"""Of one seed."""
SERVERS = ("sim",)
"""They serve until they are ended: only their command line is looked at."""
WORDS = ("", "-", "--", "x", "=", "a=1", "a.b=c", "1", "0", "-1", "1e9", "0x10", "1,2,3", "*", ",", "left", "°", "EB 90", "P", "id",
         "all", "index", "\u202e", "\x1b[2J", "\udcff", "none.txt", "../..", "/dev/null", "[", "{}", "%s", "{0}", "\\")  # fmt: skip


class Refused:
    """In place of what opens a real device."""

    def __init__(self, link: str = "", *_: Any, **__: Any) -> None:
        raise LinkError(f"{link}: not in this test", code="cannot-open")


@contextmanager
def no_devices() -> Iterator[None]:
    """No command of this process opens a port, a socket or a bus."""
    with (
        mock.patch.object(handctl.link.serial, "open_serial", Refused),
        mock.patch.object(handctl.link.tcp, "TcpLink", Refused),
        mock.patch.object(handctl.link.can, "CanLink", Refused),
    ):
        yield


class Lines:
    """Command lines made from the tree, each a little wrong or not at all."""

    def __init__(self, seed: int, folder: Path) -> None:
        self.random = random.Random(seed)
        self.folder = folder
        self.leaves = list(leaves(root, ()))
        self.known = examples.examples()

    def one(self) -> list[str]:
        """A command line; options of all stand anywhere, as a user may type them."""
        dice = self.random
        path, command = dice.choice(self.leaves)
        words: list[str] = []
        for depth, name in enumerate(path):
            words += self._shared(command, 0.15) if depth else []
            words.append(name)
        if path in self.known and dice.random() < 0.5:
            line = dice.choice(self.known[path])
            words += [
                word.replace("{dir}", str(self.folder / (line.family or "exo"))) for word in line.words[len(path) :]
            ]
        else:
            words += self._own(command)
        words += self._shared(command, 0.5)
        if dice.random() < 0.3:
            at = dice.randrange(len(words) + 1)
            match dice.randrange(3):
                case 0:
                    words.insert(at, self._word())
                case 1 if at < len(words):
                    del words[at]
                case _:
                    words[at:at] = words[at : at + 1]
        return [word.replace("\0", "") for word in (*words, *self._bounds(path, command))]

    def _bounds(self, path: Sequence[str], command: click.Command) -> list[str]:
        """What keeps a line from waiting; the options nearest the verb win."""
        if path[0] in SERVERS:
            return ["-h"]
        names = {name for param in command.params for name in param.opts}
        more = [word for name in ("--count", "--duration") if name in names for word in (name, "2")]
        dice = self.random.random()
        if path[0] not in FAMILIES and dice < 0.7:
            # on `--fake` a scan of all ids of all families takes its 22 s of real time
            return [*more, "--deadline", "10"] if path[0] == "scan" else more
        kind = path[0] if path[0] in FAMILIES and dice < 0.9 else self.random.choice(tuple(FAMILIES))
        link = f"fake://{kind}?clock=virtual" + "".join(f"&{key}={value}" for key, value in READY.get(kind, {}).items())
        if self.random.random() < 0.3:
            link += "&fault=" + self.random.choice(
                ("noise", "silent", "truncate", "echo", "wrong-id", "stale", "disconnect")
            )
        return [*more, "-p", link, "--deadline", "20"]

    def _own(self, command: click.Command) -> list[str]:
        words: list[str] = []
        for param in command.params:
            if isinstance(param, click.Argument):
                count = self.random.randrange(4) if param.nargs < 0 else param.nargs
                words += [self._value(param) for _ in range(count)] if self.random.random() < 0.9 else []
            elif not isinstance(param, SharedOption) and (param.required or self.random.random() < 0.3):
                words += self._option(param)
        return words

    def _shared(self, command: click.Command, chance: float) -> list[str]:
        options = [one for one in command.get_params(click.Context(command)) if isinstance(one, SharedOption)]
        words: list[str] = []
        while options and self.random.random() < chance:
            words += self._option(self.random.choice(options))
        return words

    def _option(self, param: click.Parameter) -> list[str]:
        name = self.random.choice(param.opts)
        if isinstance(param, click.Option) and param.is_flag:
            return [name]
        values = [self._value(param) for _ in range(max(param.nargs, 1))]
        joined = name.startswith("--") and len(values) == 1 and self.random.random() < 0.3
        return [f"{name}={values[0]}"] if joined else [name, *values]

    def _value(self, param: click.Parameter) -> str:
        kind, dice = param.type, self.random
        if dice.random() < 0.25:
            return self._word()
        if isinstance(kind, click.Choice):
            return str(dice.choice(list(kind.choices)))
        if isinstance(kind, OutFile):
            return str(self.folder / dice.choice(("new.txt", "exo", "none/at/all", "here/new.csv")))
        if isinstance(kind, InFile):
            return str(
                self.folder
                / dice.choice(("exo", "barrett", "new.json", "exo/stored.json", "wrist/power-on.json", "new.csv"))
            )
        if kind.name.startswith(("integer", "float")) or isinstance(kind, click.FloatRange):
            return dice.choice(("0", "1", "2", "5", "100", "0.5", "-3", "65535", "1e3"))
        return dice.choice(
            (*WORDS, "position_set.index=300", "MCV=80", "system_voltage", "step_length", "index.q3=160", "500")
        )

    def _word(self) -> str:
        return (
            self.random.choice(WORDS)
            if self.random.random() < 0.8
            else self.random.choice(list(TEXTS.values()))[:5_000]
        )


def rows(seed: int) -> Iterator[tuple[bool, list[str]]]:
    """The lines of a seed, and whether JSON is asked for; {dir} is a scratch folder."""
    source = Lines(seed, Path("{dir}"))
    for number in range(LINES):
        words = source.one()
        # click puts an option that is typed twice where it stands first: --json --csv --json is CSV
        json_wanted = not {"-h", "--", "--json"} & set(words) and number % 3 == 0
        yield json_wanted, [*words, *(["--json"] if json_wanted else [])]


def try_line(words: Sequence[str], how: str, folder: Folder) -> Tried:
    """Run one."""
    with no_devices():
        return attempt([word.replace("{dir}", str(folder.path)) for word in words], how, folder)
