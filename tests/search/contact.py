"""Contact with a device that is not the one of the manual: its answer to the first question in many ways, each documented
item missing in turn, numbers on the other side of what is assumed; against every command. No "another device", no false value.

How a simulator is changed, behind its back: `cases` for the BarrettHand, `contact_worlds` for the other families.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from handctl.devices.barrett.parameter_map import BARRETT, implausible, with_sign
from handctl.devices.ekso.parameter_map import SETTINGS
from tests.contract.cell import tried
from tests.contract.commands import ELSEWHERE, SECONDS, commands, scratch_of
from tests.contract.facts import facts_of
from tests.search.contact_worlds import WORLDS, Case
from tests.search.suite import Listed, bounded, parts
from tests.support.odd_barrett import odd, replaced

FOREIGN = {
    *("garbage", "echo", "echo-differs", "no-answer", "bad-line", "damaged", "cut-short", "stale", "late", "wrong-id"),
    *("bad-checksum", "wrong-command", "first-byte-lost", "other-device", "unknown-device"),
    *("other-model", "bad-json"),
}
"""Codes of errors that speak of another device or of a disturbed line."""
SILENT = {"no-answer", "late", "echo"}
"""What the read of one thing may end with that this device does not have: nothing else says so on most wires."""
TELLING = {"status", "dump", "snapshot", "diagnose", "report"}
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
SPELLINGS = (
    "no space",
    "two spaces",
    "tab",
    "colon",
    "full stop",
    "lower case",
    "a word",
    "text behind",
    "text in brackets",
)
"""Those that every status may have, whatever its number."""
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


def cases() -> Iterator[tuple[str, Case]]:
    """All hands, each with its name."""
    for name, text in ANSWERS.items():
        yield f"answer {name}", Case(partial(odd, first=replaced(ERROR, text)))
        if name in SPELLINGS:
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


def cases_of(family: str) -> Iterable[tuple[str, Case]]:
    """All devices of a family."""
    return cases() if family == "barrett" else WORLDS[family]()


@cache
def plain(family: str, command: str, options: tuple[str, ...]) -> tuple[int, dict[str, Any]]:
    """The code of a command on the manual's device, and its values by path."""
    with TemporaryDirectory() as folder:
        return outcome(family, command, Path(folder), options)[:2]


def outcome(
    family: str, command: str, folder: Path, options: tuple[str, ...] = ()
) -> tuple[int, dict[str, Any], set[str], list[Any]]:
    """Code, values by path and motor, codes of what was said, rows."""
    scratch_of(folder)
    result, rows, envelope, _ = tried(family, command, folder, options=options)
    values = {
        f"{row.get('path') or row.get('name')} {row.get('motor')}": row["value"]
        for row in rows
        if "value" in row and "name" in row
    }
    return result.code, values, {message["code"] for message in envelope["messages"]}, rows


class Contact(Listed):
    """A command and a device."""

    name = "contact"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for family in ("barrett", *WORLDS):
            for command in _named(family):
                for name, case in cases_of(family):
                    yield (family, command, name), (family, command, case)

    def tried(self, row: Any, folder: Path) -> str:
        family, command, case = row
        with bounded(SECONDS, command):
            usual, expected = plain(family, command, case.options)
            with case.world():
                code, values, codes, rows = outcome(family, command, folder, case.options)
        nothing = command == "snapshot" and case.lacks == "settings"  # all that it would hold
        single = (case.lacks or not case.proved) and (command not in TELLING or nothing)
        foreign = codes & FOREIGN - (SILENT if single else set())
        foreign -= {"late"} if family == "ekso" else set()  # a note beside what is said
        if command in facts_of(family).writes and case.prints is not None:
            foreign -= {"unknown-device"}  # what it shows must be plausible before a write
        assert not foreign or usual in (4, 5), f"exit {code}, {foreign}: another device?"
        if case.lacks:
            assert code in (0, usual) or (single and code in (2, 4, 5, 6, 7)), f"exit {code}, not {usual}: {codes}"
        elif not case.proved:
            assert code in (usual, 5, 6) or (single and code in (2, 4, 7)), f"exit {code}, not {usual} or 5: {codes}"
        elif case.prints is None:
            assert code == usual, f"exit {code} in place of {usual}: {codes}"
        if case.prints is None and "realtime" not in command:
            wrong = {
                path: value
                for path, value in values.items()
                if path in expected
                and value is not None
                and not alike(value, expected[path])
                and not moves(family, path)
            }
            assert not wrong, f"false values: {wrong}"
        elif case.prints is not None and family == "barrett":
            _judge_numbers(*case.prints, rows, code)
        elif case.prints is not None:
            _judge_marks(command, case, rows, codes)
        return f"exit {code}"

    def wanted(self) -> Iterable[str]:
        for family in ("barrett", *WORLDS):
            yield from (f"command {family} {command}" for command in _named(family))
            yield from (f"{family} {_kind(name, case)}" for name, case in cases_of(family))

    def shows(self, cell: str) -> Iterator[str]:
        _, family, command, name = parts(cell)
        yield f"command {family} {command}"
        yield f"{family} {_kind(name, dict(_cases_of(family))[name])}"


@cache
def _cases_of(family: str) -> tuple[tuple[str, Case], ...]:
    return tuple(cases_of(family))


def _kind(name: str, case: Case) -> str:
    """What a device has a pin for: the quantity where it shows another number, which of them does not matter."""
    return f"number of {case.prints[0]}" if case.prints is not None else name


def _named(family: str) -> list[str]:
    return [command for command, _ in commands(family) if (family, command) not in ELSEWHERE]


def moves(family: str, path: str) -> bool:
    """Whether this goes on by itself, so that it is another number a second later."""
    return family == "ekso" and path.split()[0] not in {word.name for word in SETTINGS}


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


UNREAD = {"diff", "force", "position"}
"""What shows readings that came otherwise than by a read, or two of each."""


def _judge_marks(command: str, case: Case, rows: list[Any], said: set[str]) -> None:
    """A number is read as it is, or not at all; where no device of the manual has it, the look at its health says so."""
    assert case.prints is not None
    path, number = case.prints
    shown = [row for row in rows if str(row.get("path")).startswith(path) and row.get("value") is not None]
    for row in shown if command not in UNREAD else ():
        assert abs(row["value"] - number) < 1e-6 * max(1, abs(number)), f"{number:g} is read as {row['value']}"
    if shown and command == "status" and case.strange:
        assert said & {"unhealthy", "remark"}, f"{path} {number:g} is not marked: {said}"


SUITES = (Contact(),)
