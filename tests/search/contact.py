"""Contact with a device that is not the one of the manual: its answer to the first question in many ways, each documented
item missing in turn, numbers on the other side of what is assumed; against every command. No "another device", no false value.

A family has a row in WORLDS: how its simulator is changed, behind its back.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from handctl.devices.barrett.map import BARRETT, implausible, with_sign
from tests.contract.cell import tried
from tests.contract.commands import ELSEWHERE, SECONDS, commands, scratch_of
from tests.search.suite import Listed, bounded, parts
from tests.support.odd_barrett import odd, replaced

World = Callable[[], AbstractContextManager[None]]
FOREIGN = {"garbage", "echo", "echo-differs", "no-answer", "bad-line", "damaged", "cut-short"}
"""Codes of errors that speak of another device or of a disturbed line."""
TELLING = {"status", "dump", "snapshot", "diagnose"}
"""What reads everything, and is content with what there is."""

ERROR = b"ERR 32"
ANSWERS: dict[str, bytes] = {
    "no space": b"ERR32",
    "two spaces": b"ERR  32",
    "tab": b"ERR\t32",
    "colon": b"ERR: 32",
    "full stop": b"ERR 32.",
    "lower case": b"err 32",
    "a word": b"ERROR 32",
    "text behind": b"ERR 32 Unknown command",
    "text in brackets": b"ERR 32 (Unknown command)",
    "text before": b"Unknown command ERR 32",
    "text alone": b"Unknown command",
    "text and the command": b"Unknown command: !",
    "question mark": b"?",
    "another number": b"ERR 1",
    "unknown name": b"ERR 64",
    "a sum": b"ERR 96",
    "number 0": b"ERR 0",
    "twice": b"ERR 32\n\rERR 32",
    "line before": b"Unknown command\n\rERR 32",
    "line behind": b"ERR 32\n\rUnknown command",
    "blank line before": b"\n\rERR 32",
    "blank line behind": b"ERR 32\n\r",
    "bell": b"\x07ERR 32",
    "back space": b"\x08 \x08ERR 32",
    "colour": b"\x1b[31mERR 32\x1b[0m",
    "XON": b"\x11ERR 32",
    "long text": b"ERR 32 " + b"unknown command, see the manual " * 6,
    "hexadecimal": b"ERR 0x20",
    "star": b"*ERR 32",
}
"""What stands in place of the manual's "ERR 32"."""
ECHOES = {"caret": b"^@", "none": b"", "space": b" ", "dot": b".", "twice": b"\0\0", "escaped": b"\\0"}
"""The echo of NUL."""
ENDS: dict[str, tuple[bytes, bytes]] = {
    "CR LF": (b"\n\r", b"\r\n"),
    "LF": (b"\n\r", b"\n"),
    "CR": (b"\n\r", b"\r"),
    "two line ends": (b"\n\r", b"\n\r\n\r"),
    "bare prompt": (b"=> ", b"=>"),
    "wide prompt": (b"=> ", b"=>  "),
    "two prompts": (b"=> ", b"=> \n\r=> "),
    "three prompts": (b"=> ", b"=> \n\r=> \n\r=> "),
    "prompt and line end": (b"=> ", b"=> \n\r"),
}
"""The ends of every answer."""


class Case(NamedTuple):
    """How a hand is, and how its result compares with that of the manual's: a parameter that it lacks, or what it prints of one."""

    world: World
    lacks: str = ""
    prints: tuple[str, int] | None = None


def cases() -> Iterator[tuple[str, Case]]:
    """All hands, each with its name."""
    for name, text in ANSWERS.items():
        yield f"answer {name}", Case(partial(odd, first=replaced(ERROR, text)))
        if name in ("no space", "two spaces", "text behind", "text in brackets"):
            yield f"errors {name}", Case(partial(odd, every=with_text(text)))
    for name, echo in ECHOES.items():
        yield f"echo {name}", Case(partial(odd, nul=echo))
    for name, (usual, other) in ENDS.items():
        yield f"ends {name}", Case(partial(odd, every=replaced(usual, other)))
    for param in BARRETT:
        if not param.since:
            yield f"without {param.mnemonic}", Case(partial(odd, without=param.mnemonic), lacks=param.mnemonic)
    for number in (-1, -50, -300, 65535, 65486, 65236, 40000, 32968, 18400, 100000):
        yield f"P {number}", Case(partial(odd, P=str(number)), prints=("P", number))
    for param in BARRETT:
        if param.high is not None and not param.since:
            number = int(param.high) + 1
            yield (
                f"{param.mnemonic} {number}",
                Case(partial(odd, **{param.mnemonic: str(number)}), prints=(param.mnemonic, number)),
            )


def with_text(text: bytes) -> Callable[[bytes], bytes]:
    """Every status in the form that ERR 32 has in `text`."""
    before, _, behind = text.partition(b"32")

    def change(data: bytes) -> bytes:
        lines = data.split(b"\n\r")
        return b"\n\r".join(before + line[4:] + behind if line.startswith(b"ERR ") else line for line in lines)

    return change


@cache
def plain(command: str) -> tuple[int, dict[str, Any]]:
    """The code of a command on the manual's hand, and its values by path."""
    with TemporaryDirectory() as folder:
        return outcome(command, Path(folder))[:2]


def outcome(command: str, folder: Path) -> tuple[int, dict[str, Any], set[str], list[Any]]:
    """Code, values by path and motor, codes of what was said, rows."""
    scratch_of(folder)
    result, rows, envelope, _ = tried("barrett", command, folder)
    values = {
        f"{row.get('path') or row.get('name')} {row.get('motor')}": row["value"]
        for row in rows
        if "value" in row and "name" in row
    }
    return result.code, values, {message["code"] for message in envelope["messages"]}, rows


class Contact(Listed):
    """A command and a hand."""

    name = "contact"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for command, _ in commands("barrett"):
            if ("barrett", command) not in ELSEWHERE:
                for name, case in cases():
                    yield ("barrett", command, name), (command, name, case)

    def tried(self, row: Any, folder: Path) -> str:
        command, _, case = row
        with bounded(SECONDS, command):
            usual, expected = plain(command)
            with case.world():
                code, values, codes, rows = outcome(command, folder)
        foreign = codes & FOREIGN
        assert not foreign or usual in (4, 5), f"exit {code}, {foreign}: another device?"
        if case.lacks:
            assert code in (0, usual) or (command not in TELLING and code in (2, 6, 7)), (
                f"exit {code} in place of {usual}"
            )
        elif case.prints is None:
            assert code == usual, f"exit {code} in place of {usual}"
        if case.prints is None and "realtime" not in command:
            wrong = {
                path: value
                for path, value in values.items()
                if path in expected and value is not None and not alike(value, expected[path])
            }
            assert not wrong, f"false values: {wrong}"
        elif case.prints is not None:
            _judge_numbers(*case.prints, rows, code)
        return f"exit {code}"

    def wanted(self) -> Iterable[str]:
        named = [command for command, _ in commands("barrett") if ("barrett", command) not in ELSEWHERE]
        return (*(f"command {command}" for command in named), *(f"hand {name}" for name, _ in cases()))

    def shows(self, cell: str) -> Iterator[str]:
        _, _, command, name = parts(cell)
        yield f"command {command}"
        yield f"hand {name}"


def alike(value: Any, expected: Any) -> bool:
    """Whether these may be one reading: temperatures and times go on."""
    if isinstance(value, int | float) and isinstance(expected, int | float):
        return abs(value - expected) <= 2 + abs(expected) * 0.01
    return bool(value == expected)


def _judge_numbers(name: str, number: int, rows: list[Any], code: int) -> None:
    """A number beyond the assumption is read as what it can only be, or marked, or an error."""
    for row in rows:
        if row.get("parameter") == name and isinstance(row.get("value"), int) and row.get("motor") and name == "P":
            index = ("F1", "F2", "F3", "SPREAD").index(row["motor"])
            right = with_sign(index, number)
            assert row["value"] == right, row
            assert not implausible(index, right) or row.get("doubt") or code, f"not marked: {row}"
        elif row.get("parameter") == name and row.get("value") == number and name != "P":
            assert row.get("doubt") or row.get("status") == "fail" or code, f"not marked: {row}"
        if row.get("name", "").startswith("joint_") and code == 0 and not row.get("doubt"):
            assert -35 <= row["value"] <= 215, row


SUITES = (Contact(),)
