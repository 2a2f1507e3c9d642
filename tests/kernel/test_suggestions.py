"""What a wrong word is answered with: near by spelling and meaning, and nothing that writes without saying so."""

from __future__ import annotations

import json
import pathlib
import re

import pytest

from handctl.command.family import load
from handctl.command.suggestions import meant
from handctl.families import FAMILIES
from tests.support.cli import run
from tests.support.each_row import each_row

MEANT = [
    ("exo stats", "Did you mean 'status'?"),
    ("exo reset", "'clear-errors' (writes: "),
    ("exo factroy-reset", "'factory-reset' (writes: "),
    ("exo monitor", "'watch'"),
    ("trace shwo x", "'show'"),
    ("status exo", "`handctl exo status`"),
    ("set exo x=1", "`handctl exo set`"),
    ("dmup exo", "'dump'"),
    ("dump", "`handctl exo dump`, `handctl wrist dump`"),
    ("version", "`handctl --version`"),
    ("version", "`handctl barrett version`"),
    ("statsu", "Did you mean 'status'? The device comes first: `handctl exo status`"),
    ("statsu exo", "Did you mean 'status'? The device comes first: `handctl exo COMMAND`."),
    ("exo statsu", "Did you mean 'status'?"),
    ("ekso plot gait.csv", "It takes no device: `handctl plot`."),
    ("exo top", "It takes no device: `handctl top`."),
    ("exo stpo", "Did you mean 'stop' (writes: "),
    ("anlge", "`handctl hand angle`"),
    ("help exot", "'exo'"),
    ("find", "'scan'"),
    ("prots", "'ports'"),
    ("oxe dump", "'exo'"),
    ("barrett get MCVV --fake", "Did you mean MCV?"),
    ("exo get temprature --fake", "Did you mean temperature?"),
    ("barrett diagnose strain-rnge", "Did you mean strain-range"),
    ("sim exo --pty --fault noize", "Did you mean 'noise'?"),
]


@each_row(("line", "said"), MEANT)
def test_a_wrong_word_is_answered_with_what_was_meant(line: str, said: str) -> None:
    done = run(*line.split())
    assert (done.code, done.out) == (2, "")
    assert said in done.err


@pytest.mark.parametrize("family", FAMILIES)
def test_what_writes_is_never_offered_without_what_it_does(family: str) -> None:
    """For each name with one letter less, and for each word of common speech."""
    commands = load(family, "cli").cli.commands
    tried = {name[:place] + name[place + 1 :] for name in commands for place in range(len(name))} - {""}
    for word in sorted({*tried, "reset", "clear", "release", "write", "factory", "read-all", "stat"} - set(commands))[
        ::3
    ]:
        said = run(family, word).err.partition("Did you mean ")[2]
        for name, why in re.findall(r"'([\w-]+)'( \(writes: )?", said):
            assert bool(why) is getattr(commands[name], "writes", False), (word, said)


@pytest.fixture
def left(tmp_path: pathlib.Path) -> dict[str, str]:
    path = tmp_path / "config.toml"
    path.write_text('[devices.left]\nkind = "exo"\nport = "fake://exo?clock=virtual"\n', encoding="utf-8")
    return {"HANDCTL_CONFIG": str(path)}


@pytest.mark.parametrize(
    "words", [("-d", "left", "status"), ("status", "-d", "left"), ("--device=left", "status"), ("status", "-dleft")]
)
def test_a_named_device_needs_no_family(words: tuple[str, ...], left: dict[str, str]) -> None:
    done = run(*words, "--format", "plain", env=left)
    assert done.out == run("exo", "status", "-d", "left", "--format", "plain", env=left).out
    assert done.code == 0 and done.out
    assert json.loads(run(*words, "--json", env=left).out)["command"] == "exo status"


def test_a_named_device_that_has_no_such_command_or_no_such_name(left: dict[str, str]) -> None:
    for words, said in (("-d left stauts", "'status'"), ("-d lfet status", "Did you mean left?")):
        done = run(*words.split(), env=left)
        assert done.code == 2 and said in done.err


def test_two_swapped_neighbours_are_always_understood() -> None:
    """Each command of each family, with each pair of neighbours swapped."""
    for family in FAMILIES:
        commands = load(family, "cli").cli.commands
        for name in commands:
            for at in range(len(name) - 1):
                typed = name[:at] + name[at + 1] + name[at] + name[at + 2 :]
                assert typed in commands or repr(name) in meant(typed, commands), (family, typed)


@each_row(
    ("typed", "hint"),
    [
        ("stop /dev/ttyUSB0", "Write `-p /dev/ttyUSB0`"),
        ("exo status COM3", "Write `-p COM3`"),
        ("hand stop tcp://10.0.0.5:6000", "Write `-p tcp://10.0.0.5:6000`"),
        ("ekso log a.csv b.csv -p /dev/ttyUSB0", "`handctl ekso log -h`"),
        ("exo dump -o /dev/ttyUSB0 more", "`handctl exo dump -h`"),
    ],
)
def test_a_link_without_its_option_is_told_where_it_belongs(typed: str, hint: str) -> None:
    result = run(*typed.split())
    assert result.code == 2 and hint in result.err, result
