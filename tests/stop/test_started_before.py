"""A command that was started before another process stopped the device, and reaches the device after it, sets nothing going."""

from __future__ import annotations

import os
from typing import Any

import pytest

from handctl.command import open_links
from handctl.command.open_links import Session
from handctl.link import Link, open_link
from handctl.link.device_lock import hold
from handctl.system import clock
from tests.support.cli import Result, run
from tests.support.each_row import each_row

PORT = "/dev/null"
"""A character device, as a port is: its lock is that of a port, and nothing is ever opened."""
DRIVES = {
    "exo": "exo position index=300 -y",
    "wrist": "wrist center",
    "barrett": "barrett close",
    "ekso": "ekso cancel -y",
    "hand": "hand angle index=300 -y",
}
"""Family -> a line that moves its device, or cancels what it does."""


class Port:
    """What is behind PORT: how often it was opened, and what went out."""

    def __init__(self) -> None:
        self.there = ""
        self.opened = 0

    def open(self, name: str, **options: Any) -> Link:
        self.opened += 1
        return open_link(
            f"fake://{self.there}?initialized=1&clock=virtual"
            if self.there == "barrett"
            else f"fake://{self.there}?clock=virtual",
            baud=options.get("baud"),
        )


@pytest.fixture
def port(monkeypatch: pytest.MonkeyPatch) -> Port:
    found = Port()
    monkeypatch.setattr(open_links, "open_link", found.open)
    return found


def stop_by(pid: int, patch: pytest.MonkeyPatch) -> None:
    """What another process notes while it stops the device."""
    with patch.context() as other:
        held = hold(PORT, "handctl stop")
        assert held is not None
        other.setattr(os, "getpid", lambda: pid)
        held.note_stop()
        held.release()


def slept(port: Port, patch: pytest.MonkeyPatch, *lines: str, pid: int = 4194303) -> Result:
    """A script whose `sleep` lasts until process `pid` has stopped the device."""
    patch.setattr(Session, "sleep", lambda *_: stop_by(pid, patch))
    return run("batch", "-p", PORT, "--json", stdin="\n".join(lines))


@each_row("family", DRIVES)
def test_a_script_that_slept_through_a_stop_moves_nothing(
    family: str, port: Port, monkeypatch: pytest.MonkeyPatch
) -> None:
    port.there, port.opened = family, 0
    result = slept(port, monkeypatch, "sleep 5", DRIVES[family], f"{family} status")
    assert (result.code, port.opened) == (130, 0), result
    again = run("batch", "-p", PORT, "--json", stdin=DRIVES[family])
    assert again.code != 130 and port.opened, "what is started after the stop may move it"


def test_what_only_reads_goes_on(port: Port, monkeypatch: pytest.MonkeyPatch) -> None:
    port.there = "exo"
    assert slept(port, monkeypatch, "sleep 5", "exo status").code in (0, 7)


def test_a_stop_of_the_script_itself_ends_nothing(port: Port, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor does planning it ask who has the device, or take its lock."""
    port.there = "barrett"
    result = run("batch", "-p", PORT, "--json", stdin="barrett status\nbarrett stop\nstop\nbarrett close\n")
    assert result.code == 0 and port.opened == 1, result
    own = slept(port, monkeypatch, "sleep 5", "barrett close", pid=os.getpid())
    assert own.code == 0, own


def test_a_stop_counts_from_its_moment(monkeypatch: pytest.MonkeyPatch) -> None:
    began = clock.now()
    stop_by(4194303, monkeypatch)
    stop_by(os.getpid(), monkeypatch)
    held = hold(PORT, "handctl barrett close")
    assert held is not None
    assert held.stopped_since(began), "its own stop does not hide that of another process"
    assert not held.stopped_since(clock.now())
    held.release()


@each_row("text", ["", "\n", "x y\n", "1e9 5\n", "99999999999.0 5\n", "1.0\n", "\x00\xff"])
def test_a_damaged_note_or_one_from_before_the_computer_started_stops_nothing(text: str) -> None:
    held = hold(PORT, "handctl exo set")
    assert held is not None
    folder, name = os.path.split(held.path)
    with open(os.path.join(folder, name.replace("lock-", "stopped-")), "w", encoding="latin-1") as file:
        file.write(text)
    assert not held.stopped_since(0.0)
    held.note_stop()
    assert not held.stopped_since(0.0), "its own stop"
    held.release()


def test_a_stop_leaves_its_note(port: Port) -> None:
    """Also that of a script, and before its first byte."""
    for words, script in ((("barrett", "stop"), ""), (("batch",), "barrett status\nstop")):
        port.there, began = "barrett", clock.now()
        assert run(*words, "-p", PORT, stdin=script).code == 0
        held = hold(PORT, "handctl barrett close")
        assert held is not None
        with pytest.MonkeyPatch.context() as other:
            other.setattr(os, "getpid", lambda: 4194303)
            assert held.stopped_since(began), words
        held.release()
