"""The life of a command at its edges: output that cannot be written, bugs of ours, Ctrl-C and Ctrl-Z, questions, restore."""

from __future__ import annotations

import json
import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from handctl.command import get_set_watch, snapshots
from handctl.devices.barrett.parameter_map import BARRETT
from handctl.link.device_lock import hold
from handctl.link.fake import FakeLink
from handctl.model.param import Element
from tests.inspire.exo_commands import prepare
from tests.support.cli import PATIENCE, fake, run, spying, writes
from tests.support.each_row import each_row

# -- output -----------------------------------------------------------------------------------------------------------


@each_row("place", ["folder", "missing/file"])
@each_row("args", [("get", "id"), ("set", "position_set.index=300", "-y"), ("watch", "--count", "1")])
def test_an_output_that_cannot_be_written_is_told_before_the_device_is_served(
    tmp_path: Path, place: str, args: tuple[str, ...]
) -> None:
    (tmp_path / "folder").mkdir()
    with spying() as spy:
        result = run("exo", *args, "-p", fake(), "-o", tmp_path / place, "--format", "plain")
    assert result.code == 1
    assert "Nothing was sent" in result.err and str(tmp_path / place) in result.err
    assert spy.lines == []


# -- the link is let go -----------------------------------------------------------------------------------------------


@pytest.fixture
def port() -> Iterator[tuple[socket.socket, str]]:
    """A server that says nothing, and its LINK."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(PATIENCE)
        yield server, f"tcp://127.0.0.1:{server.getsockname()[1]}"


@pytest.mark.real
def test_a_bug_of_ours_lets_the_link_and_its_lock_go(
    port: tuple[socket.socket, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    server, link = port

    def broken(self: Any, *_: object) -> None:
        self.device()
        kept.append(self)  # nothing is closed because it is forgotten
        raise ZeroDivisionError("oops")

    kept: list[Any] = []
    monkeypatch.setattr(get_set_watch, "bounds_of", broken)
    result = run("exo", "get", "id", "-p", link, "--json")
    assert (result.code, result.error["code"]) == (1, "internal")
    connection, _ = server.accept()
    with connection:
        connection.settimeout(PATIENCE)
        assert connection.recv(1) == b"", "closed"
    lock = hold(link, "the next one")
    assert lock is not None
    lock.release()


def test_a_device_on_tcp_that_another_handctl_holds_is_busy(port: tuple[socket.socket, str]) -> None:
    server, link = port
    held = hold(link, "handctl exo watch")
    assert held is not None
    result = run("exo", "get", "id", "-p", link.replace("127.0.0.1", "localhost"), "--json")
    held.release()
    assert (result.code, result.error["code"]) == (3, "busy")
    assert "`handctl exo watch`" in result.error["text"]
    server.settimeout(0.05)
    with pytest.raises(TimeoutError):
        server.accept()


def test_ctrl_c_while_the_link_is_closed_closes_it_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[bool] = []
    close = FakeLink.close

    def pressed(link: FakeLink) -> None:
        closed.append(True)
        if len(closed) == 1:
            raise KeyboardInterrupt
        close(link)

    monkeypatch.setattr(FakeLink, "close", pressed)
    result = run("exo", "get", "id", "-p", fake(), "--json")
    assert result.code == 130
    assert result.values == {"id": 1}, "what came of the command is not lost"
    assert len(closed) == 2


@each_row(("args", "ends"), [(("set", "force_set.index=300", "-y"), True), (("get", "id"), False)])
def test_ctrl_z_ends_what_may_move_something(
    monkeypatch: pytest.MonkeyPatch, args: tuple[str, ...], ends: bool
) -> None:
    """Asleep, the command could not stop the device; one that reads may sleep."""
    before = {number: signal.getsignal(number) for number in (signal.SIGTSTP, signal.SIGINT, signal.SIGQUIT)}
    handlers: list[Any] = []
    read = FakeLink.read

    def look(link: FakeLink, *more: Any) -> bytes:
        handlers.append(signal.getsignal(signal.SIGTSTP))
        return read(link, *more)

    monkeypatch.setattr(FakeLink, "read", look)
    try:
        signal.signal(signal.SIGTSTP, signal.SIG_DFL)
        assert run("exo", *args, "-p", fake()).code == 0
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert handlers
    assert all((handler != signal.SIG_DFL) is ends for handler in handlers)


# -- questions --------------------------------------------------------------------------------------------------------


@each_row("text", ["id=2", "baud_code=1", "position_set.index=300", "force_set.thumb=7"])
def test_set_asks_for_what_strands_and_for_what_moves(tmp_path: Path, text: str) -> None:
    trace = tmp_path / "trace.txt"
    result = run("exo", "set", text, "-p", fake(), "--json", "--trace", trace)
    assert (result.code, result.error["code"]) == (8, "not-confirmed")
    assert text in result.error["text"]
    assert ("unreachable" in result.error["text"]) is text.startswith(("id", "baud"))
    assert ("moves a device" in result.error["text"]) is text.startswith(("position", "force"))
    assert not trace.exists() or writes(trace) == []


def test_the_question_of_a_restore_names_what_moves(tmp_path: Path) -> None:
    prepare(tmp_path)
    result = run("exo", "restore", tmp_path / "stored.json", "--setpoints", "-p", fake(), "--json")
    assert (result.code, result.error["code"]) == (8, "not-confirmed")
    assert "MOVES the device: position_set." in result.error["text"]


# -- restore ----------------------------------------------------------------------------------------------------------


def test_what_a_snapshot_does_not_hold_is_named_and_left(tmp_path: Path) -> None:
    prepare(tmp_path)
    path = tmp_path / "stored.json"
    held = json.loads(path.read_text(encoding="utf-8"))["values"]
    del held["force_set.ring"], held["baud_code"]
    snapshots.write(str(path), snapshots.make("exo", {"kind": "exo", "id": 1}, held, link="fake://exo", fake=True))
    result = run("exo", "restore", path, "--setpoints", "-p", fake(), "--json", "-y")
    assert result.code == 0
    (message,) = [message for message in result.json["messages"] if message["code"] == "absent"]
    assert "force_set.ring" in message["text"] and "baud_code" in message["text"]
    assert "force_set.thumb" not in message["text"]


def test_what_concerns_the_whole_device_is_restored_before_its_parts() -> None:
    """OTEMP or LFT of a hand first, then its motors, and last what may strand it."""
    motor, whole, stranding = (
        (Element(BARRETT.by_mnemonic(name), 0), value) for name, value in (("MCV", 50), ("OTEMP", 600), ("BAUD", 96))
    )
    names = [[element.full_name for element, _ in group] for group in snapshots._groups([motor, stranding, whole])]
    assert names == [[whole[0].full_name], [motor[0].full_name], [stranding[0].full_name]]


def test_a_value_that_only_one_snapshot_holds_is_a_difference(tmp_path: Path) -> None:
    prepare(tmp_path)
    whole, part = tmp_path / "power-on.json", tmp_path / "part.json"
    held = json.loads(whole.read_text(encoding="utf-8"))["values"]
    value = held.pop("force_set.ring")
    snapshots.write(str(part), snapshots.make("exo", {"kind": "exo", "id": 1}, held, link="fake://exo", fake=True))
    for a, b, row in (
        (part, whole, {"name": "force_set.ring", "kind": "command", "a": None, "b": value}),
        (whole, part, {"name": "force_set.ring", "kind": "command", "a": value, "b": None}),
    ):
        result = run("exo", "diff", a, b, "--setpoints", "--json")
        assert (result.code, result.error["code"], result.rows) == (7, "differ", [row])


def test_a_sample_with_one_quantity_that_can_be_read_is_no_failed_sample() -> None:
    """Three failed samples running end a stream; a key that is always wrong does not, but at its end it is told as `get` does."""
    link = "fake://aidin?clock=virtual&start=homed&fault=wrong-length"
    rows, end = run(
        "aidin", "watch", "motor_pos", "joint_pos", "--count", "5", "--rate", "2", "--json", "-p", link
    ).stream
    assert (end["ok"], end["stream"]["samples"], end["stream"]["failed"]) == (False, 5, 0)
    assert end["exit_code"] == 5
    assert all(("error" in row) is (row["name"] == "motor_pos") for row in rows) and len(rows) == 5 * 35


@each_row(
    ("line", "command", "streams"),
    [
        ("top --count 1", "top", True),
        ("exo watch --rate 5", "exo watch", True),
        ("-p exo wrist get id", "wrist get", False),
        ("--deadline=3 exo set force_set.index=5", "exo set", False),
        ("-d left,right exo save", "exo save", False),
        ("trace show x", "trace show", False),
    ],
)
def test_an_error_before_the_command_began_names_it_and_has_its_shape(
    tmp_path: Path, line: str, command: str, streams: bool
) -> None:
    """Values of options are no command."""
    (tmp_path / "c.toml").write_text("retries = -5\n")
    done = run(*line.split(), "--json", env={"HANDCTL_CONFIG": str(tmp_path / "c.toml")})
    envelope = done.stream[1] if streams else done.json
    assert (done.code, envelope["command"]) == (2, command)
    assert ("writes" in envelope) == (command in ("exo set", "exo save"))
