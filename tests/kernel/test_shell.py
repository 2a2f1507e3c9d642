"""handctl shell: lines at a prompt on one open link, history, completion, and a port that comes back."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import click
import pexpect
import pytest

from handctl.command.command_lines import parse_line
from handctl.command.command_tree import root
from handctl.command.run import Run
from handctl.errors import NoAnswer
from handctl.link import deadman
from handctl.link.fake import FakeLink
from handctl.model.stop_on_interrupt import NOT_STOPPED
from handctl.sim.engine.serve import send_control
from handctl.tools.shell import Shell
from tests.support.cli import Simulator, clean_environment, fake, run, spying, start, wait_until
from tests.support.each_row import each_row
from tests.support.terminal import Terminal


@pytest.fixture
def handler() -> Iterator[None]:
    """What asks the program to end, as it was."""
    before = signal.getsignal(signal.SIGINT)
    yield
    signal.signal(signal.SIGINT, before)


def shell(typed: list[str], *options: str, family: str = "exo") -> tuple[Shell, list[str]]:
    """A shell into which these lines are typed, and the prompts that it shows."""
    rest, prompts = iter(typed), []

    def read_line(prompt: str) -> str:
        prompts.append(prompt)
        try:
            return next(rest)
        except StopIteration:
            raise EOFError from None

    one = parse_line(["exo", "describe", *options], {})
    context: click.Context = one.context
    return Shell(Run(context, one.settings, None), family, read_line), prompts


def test_lines_share_a_link_and_errors_do_not_end_it(handler: None, capsys: pytest.CaptureFixture[str]) -> None:
    made, prompts = shell(
        [
            "get id",
            "exo get id  # with the family",
            "handctl get 'x",
            "nonsense",
            "get nonsense",
            "",
            "-h",
            "get id",
            "exit",
            "get id",
        ],
        "-p",
        fake(),
    )
    with spying() as spy:
        made.run()
    out, err = capsys.readouterr()
    assert len(spy.lines) == 1 and spy.requests == 4  # the first one looks who is there
    assert prompts[0] == f"exo {fake()}> " and len(prompts) == 9
    assert out.count("id    1000") == 3 and "Usage: handctl exo" in out
    assert "No closing quotation" in err and "No such command 'nonsense'" in err and "no quantity 'nonsense'" in err


def test_a_lost_port_is_opened_again(handler: None, capsys: pytest.CaptureFixture[str]) -> None:
    made, _ = shell(["get id", "get id", "get id"], "-p", fake(fault="disconnect", after=2))
    with spying() as spy:
        made.run()
    out, err = capsys.readouterr()
    assert len(spy.lines) == 2 and out.count("id    1000") == 2 and "hung up" in err


def test_ctrl_c_at_the_prompt_ends_nothing(handler: None, capsys: pytest.CaptureFixture[str]) -> None:
    made, prompts = shell([], "-p", fake())
    keys: list[Any] = [KeyboardInterrupt, "get id", EOFError]

    def read_line(prompt: str) -> str:
        prompts.append(prompt)
        key = keys.pop(0)
        if isinstance(key, str):
            return key
        raise key

    made._read_line = read_line
    made.run()
    assert len(prompts) == 3 and "Ctrl-D ends the shell" in capsys.readouterr().err


def test_ctrl_c_in_a_line_stops_what_an_earlier_one_has_set_going(
    handler: None, capsys: pytest.CaptureFixture[str]
) -> None:
    made, _ = shell(["position 900 900 900 900 900 -y", "sleep 30", "get id"], "-p", fake())
    with spying() as spy, mock.patch.object(FakeLink, "sleep", side_effect=KeyboardInterrupt):
        made.run()
    out, err = capsys.readouterr()
    assert spy.byte_at(1486, 2) != (900).to_bytes(2, "little"), "held where it was"
    assert "interrupted" in err and "id    1000" in out


def test_ctrl_c_at_the_prompt_stops_what_a_line_has_set_going(
    handler: None, capsys: pytest.CaptureFixture[str]
) -> None:
    """Once: a second one finds nothing that moves."""
    made, prompts = shell([], "-p", fake())
    keys: list[Any] = ["position 900 900 900 900 900 -y", KeyboardInterrupt, "get id", KeyboardInterrupt, EOFError]

    def read_line(prompt: str) -> str:
        prompts.append(prompt)
        key = keys.pop(0)
        if isinstance(key, str):
            return key
        raise key

    made._read_line = read_line
    with spying() as spy:
        made.run()
    assert spy.byte_at(1486, 2) != (900).to_bytes(2, "little"), "held where it was"
    out, err = capsys.readouterr()
    assert err.count("interrupted") == 1 and "Ctrl-D ends the shell" in err and "id    1000" in out


@pytest.mark.parametrize(("last", "stopped"), [(KeyboardInterrupt, True), (EOFError, False)])
def test_a_shell_that_is_ended_stops_what_moves_and_ctrl_d_does_not(
    handler: None, last: type[BaseException], stopped: bool
) -> None:
    """An interrupt that comes between two lines ends it: a terminal that was closed (SIGHUP), SIGTERM."""
    made, _ = shell(["position 900 900 900 900 900 -y"], "-p", fake())
    one = made._one

    def ends() -> bool:
        if not one():
            raise last
        return True

    with spying() as spy, mock.patch.object(made, "_one", ends), pytest.raises(last):
        made.run()
    assert (spy.byte_at(1486, 2) != (900).to_bytes(2, "little")) == stopped


def test_a_stop_that_fails_at_the_prompt_is_the_end_of_the_shell(handler: None) -> None:
    made, _ = shell([], "-p", fake(fault="silent", after=6))
    keys: list[Any] = ["position 900 900 900 900 900 -y", KeyboardInterrupt, EOFError]

    def read_line(_prompt: str) -> str:
        key = keys.pop(0)
        if isinstance(key, str):
            return key
        raise key

    made._read_line = read_line
    with pytest.raises(NoAnswer) as caught:
        made.run()
    assert caught.value.code == NOT_STOPPED


class Guards:
    """The guards of links, and whether they are armed."""

    def __init__(self) -> None:
        self.events: list[str] = []

    @contextmanager
    def guard_link(self, *_given: Any, **_more: Any) -> Iterator[None]:
        self.events.append("armed")
        yield
        self.events.append("ended")


@pytest.mark.parametrize(
    ("lines", "events"),
    [
        (["get id", "describe"], []),
        (["position 900 900 900 900 900 -y", "get id"], ["armed", "ended"]),
        (["force 60 60 60 60 60 -y", "position 900 900 900 900 900 -y"], ["armed", "ended"]),
        (["set position_set.ring=900 -y", "stop", "get id", "force 60 60 60 60 60 -y"], ["armed", "ended"] * 2),
        (["position 900 900 900 900 900 -y -n"], []),
    ],
)
def test_from_the_first_line_that_moves_the_death_of_the_shell_stops_the_device(
    handler: None, lines: list[str], events: list[str]
) -> None:
    made, _ = shell(lines, "-p", fake())
    guards = Guards()
    with mock.patch.object(deadman, "guard_link", guards.guard_link):
        made.run()
    assert guards.events == events


@each_row(
    ("before", "found", "absent"),
    [
        ("", ["get ", "status ", "exo ", "barrett ", "ports ", "exit "], ["shell ", "sim "]),
        ("st", ["status ", "stop "], ["get "]),
        ("get te", ["temperature ", "temperature.index "], ["id "]),
        ("exo get temperature po", ["position_set "], ["temperature "]),
        ("barrett get TEM", [], []),
        ("barrett get temp", ["temperature "], []),
        ("barrett firmware ", ["check ", "download "], ["get "]),
        ("get temperature --json te", ["temperature "], []),
        ("nonsense te", [], ["temperature "]),
    ],
)
def test_completion_of_verbs_and_quantities(before: str, found: list[str], absent: list[str]) -> None:
    made, _ = shell([])
    word = before.rpartition(" ")[2]
    offered = made.candidates(before, word)
    assert set(found) <= set(offered) and not set(absent) & set(offered), offered
    assert all(one.startswith(word) for one in offered)


def test_the_prompt_names_what_is_known() -> None:
    assert shell([], family="")[0].prompt == "handctl> "
    assert shell([], "--fake")[0].prompt == "exo simulated> "


def test_it_needs_a_terminal() -> None:
    result = run("shell", "--fake")
    assert result.code == 2 and "handctl batch" in result.err
    assert "shell" in root.list_commands(click.Context(root))


@pytest.mark.real
def test_a_person_types_confirms_and_finds_the_line_again(tmp_path: Path) -> None:
    env = {"XDG_STATE_HOME": str(tmp_path)}
    with Terminal("shell", "exo", "-p", "fake://exo", env=env) as terminal:
        terminal.until("exo fake://exo> ")
        terminal.process.send("get te\t.in\t\r")
        terminal.until("1621")
        terminal.process.send("set position_set.index=300\r")
        terminal.until("[y/N]")
        terminal.process.send("y\r")
        terminal.until("1 confirmed")
        terminal.process.send("\x04")
        assert terminal.finish() == 0
    assert "set position_set.index=300" in (tmp_path / "handctl" / "shell-history").read_text(encoding="utf-8")


@pytest.mark.real
def test_a_terminal_that_is_closed_stops_what_moves(tmp_path: Path) -> None:
    """SIGHUP, or the end of the input before it: the force that a line has left is taken away."""
    simulator = Simulator("--pty", "--control", tmp_path / "panel")
    ask = partial(send_control, str(tmp_path / "panel"))
    try:
        with Terminal("shell", "exo", "-p", simulator.link) as terminal:
            terminal.until("> ")
            terminal.process.send("force 60 60 60 60 60 -y\r")
            wait_until(lambda: ask("get 1498 2") == "ok 3C 00")
            terminal.until("> ")
            with suppress(pexpect.ExceptionPexpect):  # it is still stopping the device
                terminal.process.close(force=False)
            wait_until(lambda: ask("get 1498 2") == "ok 00 00")
    finally:
        simulator.stop()


@pytest.mark.real
def test_a_batch_that_is_killed_while_it_sleeps_stops_what_moves(tmp_path: Path) -> None:
    """What an earlier line has set going, in a line that moves nothing."""
    simulator = Simulator("--pty", "--control", tmp_path / "panel")
    ask = partial(send_control, str(tmp_path / "panel"))
    script = tmp_path / "script"
    script.write_text("exo force 60 60 60 60 60\nsleep 60\n", encoding="utf-8")
    batch = start(
        ["batch", str(script), "-y", "-p", simulator.link], clean_environment(),
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        wait_until(lambda: ask("get 1498 2") == "ok 3C 00")
        wait_until(lambda: len(children_of(batch.pid)) == 1)
        batch.kill()
        wait_until(lambda: ask("get 1498 2") == "ok 00 00")
    finally:
        batch.kill()
        batch.communicate()
        simulator.stop()


def children_of(pid: int) -> list[str]:
    return Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8").split()
