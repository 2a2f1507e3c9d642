"""What `-h` shows: own options, examples, and of the common options only those that a command accepts."""

from __future__ import annotations

import re
from typing import Any

import click
import pytest

from handctl.command.command_tree import root
from handctl.command.options import CONNECTION, SharedOption
from handctl.docgen.read_command_tree import read_tree
from handctl.families import FAMILIES
from tests.support.cli import run
from tests.support.each_row import each_row


def leaves() -> list[Any]:
    return [
        pytest.param(node, id=node.name) for node in read_tree().walk() if not node.children and node.path[0] != "sim"
    ]


WRITING = ("--dry-run", "--yes")
WITHOUT_A_LINK = ("ports", "completion", "trace show", "trace diff", "trace decode", "twin check", "devices list", "exo describe",
                  "barrett errors", "ekso policy", "barrett firmware check")  # fmt: skip


def help_of(*path: str) -> str:
    done = run(*path, "-h")
    assert (done.code, done.err) == (0, "")
    return done.out


@each_row("node", leaves)
def test_a_command_shows_examples_of_its_own(node) -> None:  # type: ignore[no-untyped-def]
    text = help_of(*node.path)
    found = re.findall(rf"^  handctl {node.name}( .*)?\n      \S", text.partition("\nExamples:\n")[2], re.MULTILINE)
    assert 1 <= len(found) <= 3


@each_row("node", leaves)
def test_the_common_options_are_those_that_a_command_accepts(node) -> None:  # type: ignore[no-untyped-def]
    text = help_of(*node.path)
    common = set(re.findall(r"--[\w-]+", text.partition("\nCommon options (")[2]))
    assert common == {option.names[-1] for option in node.options if option.shared}
    assert (set(WRITING) & common == set()) is not node.writes or node.path[0] in ("completion",)


def test_the_help_of_status_fits_a_screen() -> None:
    assert len(help_of("exo", "status").splitlines()) <= 24


@pytest.mark.parametrize("family", FAMILIES)
def test_what_a_protocol_does_not_have_is_not_offered(family: str) -> None:
    virtual = ("-p", f"fake://{family}?clock=virtual")
    given = (("--id", "1"), ("--baud", "115200"))
    refused = [name for name, value in given if run(family, "status", *virtual, name, value).code == 2]
    offered = re.findall(r"--[\w-]+", help_of(family, "status"))
    assert not set(refused) & set(offered)
    assert len(refused) == {"exo": 0, "wrist": 0, "barrett": 1, "ekso": 1, "aidin": 2}.get(family, len(refused))


@each_row("name", WITHOUT_A_LINK)
def test_what_opens_no_link_offers_none(name: str) -> None:
    offered = set(re.findall(r"--[\w-]+", help_of(*name.split()).partition("\nCommon options (")[2]))
    links = [option for option in root.get_params(click.Context(root)) if isinstance(option, SharedOption)]
    assert not {option.opts[-1] for option in links if option.section == CONNECTION} & offered


def test_what_is_not_offered_is_still_refused_with_its_reason() -> None:
    for words, why in (
        (("barrett", "status", "--fake", "--id", "2"), "--id: barrett has no device ids"),
        (("aidin", "status", "--fake", "--baud", "9600"), "--baud: aidin has no serial port"),
        (("exo", "status", "--fake", "-n"), "`handctl exo status` only reads"),
        (("ports", "-n"), "`handctl ports` only reads"),
    ):
        done = run(*words)
        assert done.code == 2 and why in done.err


def test_the_limits_of_a_number_are_words() -> None:
    assert "End after S seconds.  [above 0, up to 1000000]" in help_of("exo", "watch")
    assert "[1 or more]" in help_of("exo", "watch")


def test_an_output_that_cannot_be_written_comes_with_a_next_step() -> None:
    for words in (
        ("exo", "status", "-o", "/proc/x"),
        ("exo", "snapshot", "/proc/x.json"),
        ("exo", "report", "/proc/x.html"),
        ("exo", "status", "--trace", "/proc/x.txt"),
        ("exo", "log", "/proc/x.csv", "--count", "1"),
    ):
        done = run(*words, "-p", "fake://exo?clock=virtual", "--json")
        assert done.code == 1 and "Next: " in done.err, (words, done)


def test_help_has_both_names_whatever_context_came_first() -> None:
    """The tests of one worker share the tree: a context without our settings made `-h` unknown to all that followed."""
    command: Any = root
    for name in ("exo", "clear-errors"):
        command = command.get_command(click.Context(command), name)
    options = command.get_help_option(click.Context(command)).opts
    assert options == ["-h", "--help"]


@each_row(("line", "variable"), [
    ("doctor --family hand --protocol modbus", "HANDCTL_PROTOCOL"),
    ("prove aidin --tx-terminator nul", "HANDCTL_TX_TERMINATOR"),
    ("service --family aidin --exchange=poll", "HANDCTL_EXCHANGE"),
    ("exo status --exchange poll", ""), ("service --length-mode auto", ""),
])  # fmt: skip
def test_an_option_of_one_familys_commands_names_what_takes_its_place(line: str, variable: str) -> None:
    """A next step of `doctor` names the option, which the commands of all families do not have."""
    result = run(*line.split(), "--json")
    assert (result.code, [word for word in result.error["hint"].split() if word.startswith("HANDCTL_")]) == (
        2,
        [variable] * bool(variable),
    )


def test_the_variable_does_what_the_option_would() -> None:
    line = ("prove", "hand", "-p", "fake://hand?clock=virtual&speaks=modbus&baud=57600", "--baud", "57600")
    for protocol, code in (("modbus", 0), ("eb90", 4)):
        assert run(*line, "--only", "generation", "--json", env={"HANDCTL_PROTOCOL": protocol}).code == code
