"""The completions of bash, zsh, fish and PowerShell: one table of what may follow where, written out for each shell.

The walk over a line is the shell's own, in `completion_template.bash` and so on beside this file: the table is put into it. No process
is started for a TAB. Options are looked up in words of the form `--opt=token`; see `tree.Value.token` for the tokens.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from typing import ClassVar

from handctl.docgen.read_command_tree import Node, Option
from handctl.families import FAMILIES
from handctl.model.param import Param

MARK = "completion of handctl, generated from its command tree"
"""Stands in the first lines of every script: how an installed one is recognised as ours."""
PREFIXES = ("tcp://", "usb:", "can:socketcan:", "can:slcan:", "can:pcan:", "socket://", "replay:")
"""How a LINK may begin, beside a path and the simulators."""
PORTS = ("/dev/serial/by-id/*", "/dev/ttyUSB*", "/dev/ttyACM*", "/dev/rfcomm*", "/dev/cu.usb*")
INTERFACES = ("/sys/class/net/can*", "/sys/class/net/vcan*", "/sys/class/net/slcan*")
SLCAN = ("/dev/ttyACM*", "/dev/ttyUSB*")


def plain(text: str) -> str:
    """A help text as one line without markup."""
    return " ".join(text.replace("`", "").split())


class Shell:
    """bash, and what it has in common with the others: how tables are written.

    path      of its completion under `completions/`; the file name is the one that the shell looks for
    keys      variables of a map: names to read, names to set, all names, elements of vectors, values of enumerations
    node, map before, between and behind the variables of a command, and of a family's map
    whole     a map sets what is empty, too
    globs     what stands behind a pattern of ports, and of interfaces
    """

    path = "bash/handctl"
    source = "completion_template.bash"
    keys: ClassVar = ("read", "set", "name", "elements", "values")
    node: ClassVar = ("        {}) ", " ", " ;;")
    map: ClassVar = ("        {})\n            ", "\n            ", "\n            ;;")
    whole = True
    globs: ClassVar = ("", "")

    @staticmethod
    def quote(text: str) -> str:
        """A text as one word."""
        return shlex.quote(text)

    def told(self, word: str, text: str | None = None) -> str:
        """A word with its help, where the shell shows that."""
        return word

    def pair(self, word: str, content: Sequence[str]) -> str:
        """A word and what belongs to it."""
        return f"{word}={','.join(content)}"

    def listed(self, words: Iterable[str]) -> str:
        """The words of a table."""
        return self.quote(" ".join(words))

    def put(self, key: str, words: Iterable[str]) -> str:
        """A table as the content of a variable."""
        return f"{key}={self.listed(words)}"

    # -- what is the same in all of them ---------------------------------------------------------------------------

    def script(self, tree: Node) -> str:
        shared = tree.shared
        places = {
            "@MARK@": MARK,
            "@SHARED@": self.listed(self._names(shared)),
            "@SHARED_TAKES@": self.listed(self._takes(shared)),
            "@NODES@": "\n".join(self._node(node, shared) for node in tree.walk()),
            "@MAPS@": "\n".join(self._map(node) for node in tree.children if node.params),
            "@PREFIXES@": " ".join(PREFIXES),
            "@FAKES@": " ".join(f"fake://{family}" for family in FAMILIES),
            "@PORTS@": " ".join(pattern + self.globs[0] for pattern in PORTS),
            "@INTERFACES@": " ".join(pattern + self.globs[1] for pattern in INTERFACES),
            "@SLCAN@": " ".join(pattern + self.globs[0] for pattern in SLCAN),
        }
        text = files(__package__).joinpath(self.source).read_text(encoding="utf-8")
        for place, content in places.items():
            text = text.replace(place, content)
        return text

    def _names(self, options: Iterable[Option]) -> list[str]:
        return [self.told(name, option.help) for option in options for name in option.names]

    def _takes(self, options: Iterable[Option]) -> list[str]:
        """Which of them take a value, and what can complete it."""
        return [self.pair(name, [option.value.token]) for option in options if option.value for name in option.names]

    def _node(self, node: Node, shared: tuple[Option, ...]) -> str:
        """A command: its options without the `shared` ones, and the names of those that it does not offer."""
        own = [option for option in node.options if option not in shared]
        return self._case(self.node, self.quote(node.name), {
            "cmds": [self.told(child.path[-1], child.summary) for child in node.children],
            "opts": self._names(own),
            "takes": self._takes(own),
            "args": [self.told(argument.value.token + "*" * argument.repeats) for argument in node.arguments],
            "lacks": [name for option in shared if option not in node.options for name in option.names],
        })  # fmt: skip

    def _map(self, node: Node) -> str:
        """The words that the verbs of a map take. A mnemonic is a second name, and has no help."""
        params, settable = node.params, [param for param in node.params if param.writable]

        def names(chosen: Iterable[Param]) -> list[str]:
            said = [self.told(param.name, param.doc) for param in chosen]
            return said + [self.told(short) for short in map(mnemonic, chosen) if short]

        def content(pairs: Iterable[tuple[Param, Sequence[str]]]) -> list[str]:
            both = [((param.name, mnemonic(param)), words) for param, words in pairs if words]
            return [self.pair(name, words) for names, words in both for name in names if name]

        tables = (
            names([param for param in params if param.readable]), names(settable), names(params),
            content((param, param.elements) for param in params),
            content((param, tuple(map(str, param.choices))) for param in settable),
        )  # fmt: skip
        return self._case(self.map, node.name, dict(zip(self.keys, tables, strict=True)), whole=self.whole)

    def _case(
        self, layout: tuple[str, str, str], name: str, tables: Mapping[str, Sequence[str]], *, whole: bool = False
    ) -> str:
        head, between, tail = layout
        return (
            head.format(name)
            + between.join(self.put(key, words) for key, words in tables.items() if words or whole)
            + tail
        )


class Zsh(Shell):
    """With helps."""

    path = "zsh/_handctl"
    source = "completion_template.zsh"
    node = map = ("        ({})\n            ", "\n            ", "\n            ;;")
    globs = ("(N)", "(N:t)")

    def told(self, word: str, text: str | None = None) -> str:
        return self.quote(word if text is None else word.replace(":", "\\:") + f":{plain(text)}")

    def pair(self, word: str, content: Sequence[str]) -> str:
        return f"{word} {self.quote(' '.join(content))}"

    def listed(self, words: Iterable[str]) -> str:
        return " ".join(words)

    def put(self, key: str, words: Iterable[str]) -> str:
        return f"{key}=({self.listed(words)})"


class Fish(Shell):
    """With helps."""

    path = "fish/handctl.fish"
    source = "completion_template.fish"
    keys = ("readable", "settable", "known", "elements", "values")
    node = map = ("        case {}\n            ", "\n            ", "")
    whole = False

    @staticmethod
    def quote(text: str) -> str:
        """In single quotes only a backslash and a quote are special."""
        escaped = text.replace("\\", "\\\\").replace("'", "\\'")
        return f"'{escaped}'"

    def told(self, word: str, text: str | None = None) -> str:
        return self.quote(word if text is None else f"{word}\t{plain(text)}")

    def listed(self, words: Iterable[str]) -> str:
        return " ".join(words)

    def put(self, key: str, words: Iterable[str]) -> str:
        return f"set {key} {self.listed(words)}"


class PowerShell(Shell):
    """Its tables are text, not hash tables: those take -v and -V for one key."""

    path = "powershell/handctl.ps1"
    source = "completion_template.ps1"
    node = ("        {} {{ ", "; ", " }")
    map = ("        '{}' {{\n            ", "\n            ", "\n        }")
    whole = False

    @staticmethod
    def quote(text: str) -> str:
        """In single quotes only a quote is special."""
        doubled = text.replace("'", "''")
        return f"'{doubled}'"

    def put(self, key: str, words: Iterable[str]) -> str:
        return f"$found.{key} = {self.listed(words)}"


SHELLS: dict[str, Shell] = {"bash": Shell(), "zsh": Zsh(), "fish": Fish(), "powershell": PowerShell()}


def mnemonic(param: Param) -> str:
    """The device's own short name of a quantity where it has one, e.g. ``HSG``."""
    return str(getattr(param, "mnemonic", ""))
