"""The README against the program: every example line runs, the tables of commands and exit codes are those of the code."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from handctl import errors
from handctl.docgen.readme import MAKERS, SECTION, filled
from handctl.docgen.tree import read_tree
from handctl.families import COMMANDS, FAMILIES
from handctl.frame.options import lasting_options
from tests.support.cli import Result, run, run_program
from tests.support.places import README

TEXT = README.read_text(encoding="utf-8")
FENCED = re.compile(r"^```\w*\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(r"^    (\S.*)$", re.MULTILINE)
SPAN = re.compile(r"(?<!`)`([^`\n]*\bhandctl [^`\n]+)`(?!`)")
OPERATORS = frozenset("();<>|&")
MEANINGS = {
    0: "Done", 1: "bug", 2: "out of the documented range", 3: "link", 4: "Silence", 5: "no valid answer", 6: "refused",
    7: "check", 8: "confirmation", 130: "Ctrl-C",
}  # fmt: skip
"""A word or two of each meaning, from the contract's table of exit codes."""
GIVEN = {
    "plan.csv": "t,velocity.F1,velocity.F2\n0,20,20\n0.5,0,-20\n",
    "firmware.S19": "S10B2000112233445566FF0070\nS9030000FC\n",
}
"""Files that a reader brings along."""
FINDS = {"diagnose", "doctor"}
"""Commands whose exit code 7 is a finding, not a failure of the example."""


def commands_in(line: str) -> Iterator[list[str]]:
    """The words behind each `handctl` of a shell line, up to the next operator; comments are none of it."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    words = list(lexer)
    for position, word in enumerate(words):
        if word.rpartition("/")[2] != "handctl":
            continue
        rest = words[position + 1 :]
        end = next((i for i, text in enumerate(rest) if text and set(text) <= OPERATORS), len(rest))
        yield rest[:end]


def examples() -> list[tuple[str, ...]]:
    """Every handctl command line of the README in order: code blocks, then spans in the text."""
    lines = [line for block in FENCED.findall(TEXT) for line in block.replace("\\\n", " ").splitlines()]
    lines += INDENTED.findall(FENCED.sub("", TEXT))
    lines += [span for span in SPAN.findall(FENCED.sub("", TEXT)) if "…" not in span]
    return list(dict.fromkeys(tuple(words) for line in lines for words in commands_in(line)))


def bench_version(words: tuple[str, ...]) -> tuple[str, ...]:
    """The same command on a simulated device in virtual time, whatever port the example names."""
    kind = next((word for word in words if word in FAMILIES), "")
    kept: list[str] = []
    on_can = False
    rest = iter(words)
    for word in rest:
        if word in ("-p", "--port"):
            on_can = next(rest).startswith("can:")
        elif word == "--can":
            on_can = True
        elif word not in ("--fake", "--serial"):
            kept.append(word)
    if "log" in kept and "--duration" in kept:  # virtual time has no wire: a few rows are enough
        place = kept.index("--duration")
        kept[place : place + 2] = ["--count", "5"]
    if {"watch", "--live"} & set(kept) and not {"--count", "--duration"} & set(kept):
        kept += ["--count", "2"]
    return (*kept, "-p", f"fake://{kind}?clock=virtual{'&bus=can' if on_can else ''}")


def at_home() -> dict[str, str]:
    """An environment whose user folders are below the present directory."""
    return {"HOME": str(Path.cwd()), "XDG_CONFIG_HOME": str(Path.cwd() / "config")}


def tried(words: tuple[str, ...]) -> Result:
    """Run one example as far as is sensible without a device: a dry run, the simulator, a short server, its help."""
    group = len(words) == 1 and not words[0].startswith("-")  # named as a whole
    if group or "replay:" in " ".join(words) or words[:2] == ("sim", "control"):
        return run(*words, "-h")
    if words[:1] == ("sim",):
        return run(*words) if words[-1] in ("-h", "--help") else run_program(*words, "--duration", "0.1")
    if words[0] in ("scan", "doctor"):
        return run(*("fake://exo?clock=virtual" if word.startswith("/dev/tty") else word for word in words))
    if not any(word in FAMILIES for word in words) or {"-h", "--help", "describe"} & set(words) or "devices" in words:
        return run(*words, env=at_home())
    simulated = bench_version(words)
    planned = run(*simulated, "-n")
    return run(*simulated) if planned.code == 2 and "only reads" in planned.err else planned


def test_examples_of_every_family() -> None:
    assert len(examples()) >= 15
    for kind in FAMILIES:
        assert any(kind in words for words in examples()), f"no example of handctl {kind}"


def test_every_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In order and in one directory, as a reader would: one example's file is the next one's input."""
    monkeypatch.chdir(tmp_path)
    for name, text in GIVEN.items():
        (tmp_path / name).write_text(text, encoding="ascii")
    failed = {}
    for words in examples():
        result = tried(words)
        if result.code not in ((0, 7) if set(words) & FINDS else (0,)) or "Traceback" in result.err:
            failed[shlex.join(words)] = result
    assert not failed, failed


def test_the_examples_are_really_tried() -> None:
    assert list(commands_in("v=$(handctl exo get x --format plain)  # handctl no")) == [
        ["exo", "get", "x", "--format", "plain"]
    ]
    assert list(commands_in(".venv/bin/handctl -h >/dev/null || handctl sim exo --pty &")) == [
        ["-h"], ["sim", "exo", "--pty"],
    ]  # fmt: skip
    assert tried(("exo", "nosuch", "--fake")).code == 2
    assert tried(("exo", "dump", "--nosuch", "-p", "/dev/ttyUSB0")).code == 2
    assert tried(("exo", "set", "position_set.index=1001", "-p", "/dev/ttyUSB0")).code == 2
    assert tried(("sim", "exo", "--nosuch")).code == 2


def rows(heading: str) -> list[list[str]]:
    """The cells of the table whose first heading is this."""
    lines = TEXT.splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith(f"| {heading} |"))
    found = []
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            break
        found.append([cell.strip() for cell in line.strip("|").split("|")])
    return found


def test_exit_codes() -> None:
    def leaves(kind: type[errors.HandctlError]) -> set[int]:
        return {kind.exit_code}.union(
            *(leaves(sub) for sub in kind.__subclasses__() if sub.__module__ == errors.__name__)
        )

    table = {int(code): meaning for code, meaning in rows("exit code")}
    assert set(table) == {0} | leaves(errors.HandctlError) == set(MEANINGS)
    assert list(table) == sorted(table)
    for code, words in MEANINGS.items():
        assert words in table[code], (code, table[code])


def test_commands() -> None:
    table = [cells[0] for cells in rows("command")]
    assert table == [f"`handctl {name}`" for name in COMMANDS]


def test_generated_sections_are_as_generated() -> None:
    assert filled(TEXT, read_tree()) == TEXT, "run `python -m handctl.docgen`"
    assert {found["name"] for found in SECTION.finditer(TEXT)} == set(MAKERS)


def test_environment_variables() -> None:
    known = {f"HANDCTL_{str(option.name).upper()}" for option in lasting_options(("serial", "can"))}
    named = set(re.findall(r"\bHANDCTL_[A-Z_]+\b", TEXT))
    assert named and named <= known


def test_files_that_are_named_exist() -> None:
    root = README.parent
    assert (root / "src/handctl/schema/envelope-1.json").exists()
    for path in set(re.findall(r"`((?:src|tests|handctl)/[\w./-]+)`", TEXT)):
        assert (root / path).exists() or (root / "src" / path).exists(), path
