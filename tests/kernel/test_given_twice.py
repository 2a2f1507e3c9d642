"""An option that is given twice: what chooses the device or decides what is written is refused, of all else the last one counts.

Generated over the command tree: a new command or option is checked without being added to a list.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import click
import pytest

from handctl.command.command_tree import Command, root
from handctl.command.options import SharedOption
from handctl.command.several_devices import joined_for_a_stop
from handctl.errors import UsageError
from handctl.sim.cli import _raw_options
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.leaves import Leaf, leaves, taken


def contradicting(leaf: Leaf) -> Iterator[tuple[click.Option, bool]]:
    """The options of a command that take one value, and whether two of them contradict each other."""
    for param in leaf.command.get_params(click.Context(leaf.command)):
        if isinstance(param, click.Option) and not (param.multiple or param.is_flag or param.count):
            shared = isinstance(param, SharedOption)
            chooses = bool({"--port", "--device", "--id"} & {*param.opts})
            yield param, chooses if shared else getattr(leaf.command, "writes", False)


@each_row("leaf", [leaf for leaf in leaves(root) if isinstance(leaf.command, Command)])
def test_what_chooses_the_device_or_what_is_written_is_given_once(leaf: Leaf) -> None:
    """Two that are alike are one. A stop goes out without an option of its own, for all then, and with the last id."""
    for option, refuses in contradicting(leaf):
        name = option.opts[-1]
        told = isinstance(option, SharedOption) and option.key != "id"
        urgent = leaf.command.stops and not told  # type: ignore[attr-defined]
        try:
            taken([*leaf.words, name, "1", name, "2"])
        except UsageError as exc:
            assert (exc.code == "twice") == (refuses and not urgent), (name, exc.text)
        except click.UsageError:
            assert not refuses or urgent, name  # the values do not suit it, or something else is missing
        else:
            assert not refuses or urgent, name
        with suppress(click.UsageError, UsageError):
            taken([*leaf.words, name, "1", name, "1"])


def test_of_any_other_option_the_last_one_counts_and_a_level_is_not_another() -> None:
    link = "fake://exo?clock=virtual"
    result = run("exo", "get", "id", "-p", link, "--format", "csv", "--timeout", "1", "--timeout", "2", "--json")
    assert result.code == 0 and result.json["rows"], result
    assert run("-p", "fake://exo?seed=1", "exo", "--id", "3", "get", "id", "-p", link, "--id", "1").code == 0
    assert run("exo", "get", "id", "-p", link, "-p", link).code == 0
    for words in (("-p", link, "-p", "fake://exo"), ("-p", link, "--id", "1", "--id", "2"), ("-d", "a", "--device=b")):
        result = run("exo", "get", "id", *words, "--json")
        assert (result.code, result.rows, result.error["code"]) == (2, [], "twice"), (words, result)
    for words, code in ((("-p", link, "-p", "fake://exo"), "twice"), (("-d", "a", "--device=b"), "unknown-device")):
        result = run("exo", "stop", *words, "--json")
        assert (result.code, result.rows, result.error["code"]) == (2, [], code), (words, result)


def test_a_stop_with_two_ids_is_for_the_last_one_at_once() -> None:
    result = run("exo", "stop", "-p", "fake://exo?clock=virtual", "--id", "2", "--id", "1", "--json")
    assert (result.code, result.said[0], result.json["device"]["id"]) == (0, "passed-over", 1), result


def test_a_stop_with_two_choices_of_motors_is_for_all(tmp_path: Path) -> None:
    words = ("--motors", "1", "--motors", "2", "-p", "fake://barrett?clock=virtual&initialized=1", "--json")
    stopped = run("barrett", "stop", *words)
    assert (stopped.code, stopped.json["writes"][-1]["bytes"]) == (0, "54 0D"), stopped
    assert "twice" in stopped.said or "passed-over" in stopped.said, stopped
    opened = run("barrett", "open", *words)
    assert (opened.code, opened.said) == (2, ["twice"]), opened


@each_row(
    ("words", "line"),
    [
        ("stop -d left -d right", "stop -d left,right"),
        ("stop -d left -q --device=right -dleft", "stop -d left,right -q"),
        ("exo stop -d left,arm -d *", "exo stop -d left,arm,*"),
        ("-d left -d right stop", "-d left,right stop"),
        ("-d left stop -d right", "-d left stop -d right"),
        ("-d left exo -d arm stop -d right -d second", "-d left exo -d arm stop -d right,second"),
        ("stop -d left -- -d right", "stop -d left -- -d right"),
    ],
)
def test_a_stop_is_for_all_devices_that_are_named_at_one_level(words: str, line: str) -> None:
    assert joined_for_a_stop(words.split()) == line.split()


CONFIG = """[devices.left]
kind = "exo"
port = "fake://exo?clock=virtual"
[devices.right]
kind = "exo"
port = "fake://exo?clock=virtual&seed=2"
"""


@each_row(
    ("words", "more", "names", "code"),
    [
        (("-d", "left", "-d", "right"), "", ["left", "right"], 0),
        (("-d", "*"), "", ["left", "right"], 0),
        (("-d", "left", "-d", "*"), "", ["left", "right"], 0),
        (("-d", "*"), '[devices.arm]\nkind = "barrett"\n', ["left", "right"], 2),
        (("-d", "left", "-d", "arm"), '[devices.arm]\nkind = "barrett"\n', ["left"], 2),
        (("-d", "left,right"), '[devices.arm]\nkind = "barrett"\n', ["left", "right"], 0),
    ],
)
def test_a_stop_that_leaves_one_of_them_out_says_so_by_its_exit_code(
    words: tuple[str, ...], more: str, names: list[str], code: int, tmp_path: Path
) -> None:
    """And it stops the others."""
    (tmp_path / "config.toml").write_text(CONFIG + more)
    result = run("stop", *words, "--json", env={"HANDCTL_CONFIG": str(tmp_path / "config.toml")})
    assert result.code == code, result
    assert [(one["name"], one["exit_code"]) for one in result.json["results"]] == [(name, 0) for name in names]
    assert not code or (result.error["code"], "arm" in result.error["text"]) == ("config", True), result


@each_row(
    ("given", "settings", "raw"),
    [
        ({}, ("seed=1", "seed=2"), None),
        ({"seed": "1"}, ("seed=2",), None),
        ({}, ("power_cycle=1", "power-cycle=2"), None),
        ({"seed": None}, ("seed=1", "seed=1"), {"seed": "1"}),
        ({"seed": "1"}, ("seed=1", "x=2"), {"seed": "1", "x": "2"}),
    ],
)
def test_an_option_of_a_simulator_is_given_once_as_in_a_link(
    given: dict[str, str], settings: tuple[str, ...], raw: dict[str, str] | None
) -> None:
    if raw is None:
        with pytest.raises(click.UsageError):
            _raw_options(given, (), settings)
    else:
        assert _raw_options(given, (), settings) == raw
