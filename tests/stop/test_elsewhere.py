"""A stop by a name that leads to another port than when a command opened it: that command stops its device, too."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from handctl.devices.barrett import state_files
from handctl.link import device_lock, port_users
from handctl.link.device_lock import Holder, canonical, held_elsewhere, remembered
from handctl.stop import stop_command, stop_listener
from handctl.system import processes
from tests.stop.bench import PORT, Bench
from tests.support.cli import run
from tests.support.each_row import each_row


def lock_of(link: str) -> Path:
    path = Path(os.environ["XDG_RUNTIME_DIR"]) / "handctl" / device_lock._file_name(canonical(link))
    path.parent.mkdir(mode=0o700, exist_ok=True)
    return path


class Named:
    """A name of PORT; `held` by a command of another process from when it led to /dev/zero."""

    def __init__(self, folder: Path, patch: pytest.MonkeyPatch) -> None:
        self.name = str(folder / "usb-1a86-port0")
        os.symlink(PORT, self.name)
        self.told: dict[str, Any] | None = None
        self.asked: list[str] = []
        self.ended: list[Holder] = []
        patch.setattr(port_users, "handctl_commands", lambda *_: iter(()))
        patch.setattr(stop_listener, "ask", self._ask)
        patch.setattr(stop_command, "_end", lambda _run, who: self.ended.append(who))

    def held(self, link: str, family: str = "exo", use: str = "writes") -> None:
        pid = os.getppid()
        holder = Holder(pid, processes.began(pid), family, use, link, "handctl batch")
        lock_of("/dev/zero").write_text(holder.line)

    def _ask(self, lock: str, *_: object) -> tuple[bool, dict[str, Any] | None]:
        self.asked.append(lock)
        return self.told is not None, self.told


@pytest.fixture
def named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Named:
    Bench(monkeypatch).there = "exo?"
    return Named(tmp_path, monkeypatch)


@each_row(
    "words, error, code",
    [(("stop",), "", 0), (("exo", "stop"), "", 0), (("stop",), "NoAnswer", 4), (("exo", "stop"), "DeviceRefused", 6)],
)
def test_both_are_stopped(words: tuple[str, ...], error: str, code: int, named: Named) -> None:
    """What a command moves by this name, and what is there now; a failure of either is one."""
    named.held(named.name)
    named.told = {"text": "the other one", "hint": "", "error": error}
    result = run(*words, "-p", named.name, "--json")
    assert (result.code, named.asked[-1:], named.ended) == (code, [str(lock_of("/dev/zero"))], []), result
    assert "elsewhere" in result.codes() and any(not row["reads"] for row in result.rows), result


def test_a_command_that_does_not_hear_is_ended(named: Named) -> None:
    """Its child stops the device then. That nobody says so is no success."""
    named.held(named.name)
    result = run("stop", "-p", named.name, "--json")
    assert (result.code, result.error["code"], len(named.ended)) == (4, "elsewhere", 1), result


def test_a_download_that_does_not_hear_goes_on(named: Named) -> None:
    named.held(named.name, "barrett")
    state_files._keep_download(named.name, {"told": False})
    result = run("exo", "stop", "-p", named.name, "--json")
    assert (result.code, named.ended) == (0, []) and "elsewhere" in result.codes(), result


def test_a_dry_run_asks_nobody(named: Named) -> None:
    named.held(named.name)
    assert run("exo", "stop", "-n", "-p", named.name).code == 0 and named.asked == []


@each_row(
    "link, use, found",
    [
        ("{}", "writes", True), ("can:slcan:{}@115200?bitrate=500000", "writes", True), ("spy://{}", "writes", True),
        ("{}", "reads", False), ("{}", "stops", False), ("{}2", "writes", False), (PORT, "writes", False),
    ],
)  # fmt: skip
def test_which_commands_opened_this_name(link: str, use: str, found: bool, named: Named) -> None:
    """Those that write. What leads to the same port as ever is in its own lock."""
    named.held(link.format(named.name), use=use)
    for asked in (named.name, f"can:slcan:{named.name}"):
        assert [one.holder.family for one in held_elsewhere(asked) if one.holder] == ["exo"] * found, asked
    lock_of("/dev/zero").rename(lock_of(PORT))
    assert [*held_elsewhere(named.name)] == [], "the holder of this port is asked as ever"


def test_what_is_no_lock_holds_up_no_stop(named: Named) -> None:
    """A pipe waits for who writes to it, if it is opened as a file is."""
    for link in (PORT, "/dev/zero"):
        os.mkfifo(lock_of(link))
    assert remembered(named.name) == (None, []) and [*held_elsewhere(named.name)] == []
