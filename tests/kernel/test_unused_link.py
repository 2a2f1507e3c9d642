"""A link that is typed for a command that opens none is told, whatever the command: the tree says which they are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from handctl.command.command_tree import Command, root
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.leaves import Leaf, command_line, leaves

CODE = "link-unused"
LINK = "fake://exo?clock=virtual"
OFFLINE = (
    "twin check",
    "trace show",
    "trace diff",
    "plot",
    "ports",
    "history",
    "help",
    "completion",
    "ekso policy",
    "exo describe",
)
"""Some of them, so that the tree cannot lose the trait unseen."""
FILE = "FILE"
WHEN = {
    "prove": (("--list", "exo"), ("exo", "--list"), ("diff", FILE, FILE)),
    "diff": ((FILE, FILE),),
    "barrett fingertips": (("--positions", "1", "2", "3", "4"),),
    "barrett diagnose": (("--list",),),
}
"""What opens none with these words only; "diff" is that of every family that has one."""


@pytest.fixture(autouse=True)
def nothing_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is typed is understood and checked; the body of no command is carried out."""

    def body(_command: Command, _run: object) -> Callable[[], None]:
        return lambda: None

    monkeypatch.setattr(Command, "body", body)


def lines(folder: Path) -> Iterator[tuple[Leaf, list[str]]]:
    """Every command of the tree with what it requires."""
    file = folder / "file"
    file.write_text("")
    for leaf in leaves(root):
        yield leaf, command_line(leaf, {"other": str(file)})


def offline(leaf: Leaf) -> bool:
    return bool(getattr(leaf.command, "offline", False))


@each_row("before,after", [((), ("-p", LINK)), (("-p", LINK), ())])
def test_a_typed_link_is_told_by_all_that_open_none_and_by_no_other(
    before: tuple[str, ...], after: tuple[str, ...], tmp_path: Path
) -> None:
    found, expected = {}, {}
    for leaf, words in lines(tmp_path):
        result = run(*before, *words, *after)
        name = " ".join(leaf.words)
        found[name], expected[name] = CODE in result.said, offline(leaf)
        assert not offline(leaf) or result.code == 0, (name, result)
        assert not offline(leaf) or CODE not in run(*words, "--fake").said, "that names no device"
    assert found == expected
    assert [name for name in OFFLINE if not expected[name]] == [] and len(expected) > 150


def when(leaf: Leaf) -> tuple[tuple[str, ...], ...]:
    """With which words it opens none, though it may with others."""
    return WHEN.get(" ".join(leaf.words), WHEN.get(leaf.words[-1], ()) if len(leaf.words) == 2 else ())


def test_so_is_that_of_a_command_that_opens_none_with_these_words(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for leaf in leaves(root):
        assert bool(when(leaf)) == (getattr(leaf.command, "offline_when", None) is not None) or offline(leaf), (
            leaf.words
        )
        for more in when(leaf) if not offline(leaf) else ():
            words = [*leaf.words, *(str(tmp_path / "file") if word == FILE else word for word in more)]
            for line in ([*words, "-p", LINK], ["-p", LINK, *words]):
                told = run(*line)
                assert (told.code, CODE in told.said) == (0, True), (line, told)
            assert CODE not in run(*words, "--fake").said, "that names no device"
            assert CODE not in run(*words, env={"HANDCTL_PORT": LINK}).said


@each_row("env", [{"HANDCTL_PORT": LINK}, {"HANDCTL_FAKE": "1"}])
def test_a_link_of_the_environment_is_meant_for_other_commands(env: dict[str, str], tmp_path: Path) -> None:
    told = [leaf.words for leaf, words in lines(tmp_path) if offline(leaf) and CODE in run(*words, env=env).said]
    assert told == []


def test_so_is_that_of_a_script_and_of_a_named_device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    script, config = tmp_path / "script", tmp_path / "config.toml"
    script.write_text("exo describe id\n")
    config.write_text(f'[devices.left]\nkind = "exo"\nport = "{LINK}"\n')
    assert CODE not in run("batch", script, "-p", LINK).said
    assert CODE not in run("exo", "describe", "id", "-d", "left", env={"HANDCTL_CONFIG": str(config)}).said
    told = run("exo", "describe", "id", "-p", LINK, "--json")
    assert (told.code, told.codes()) == (0, [CODE]) and told.rows
