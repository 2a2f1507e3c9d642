"""`handctl history`: what was written to devices earlier, and that no command waits for it or fails because of it."""

from __future__ import annotations

import json
import os
import stat
from collections.abc import Mapping
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import pytest

import handctl
from handctl.command import write_history
from handctl.command.run import Run
from handctl.families import FAMILIES
from handctl.tools.history import _moment
from tests.support.cli import Result
from tests.support.cli import run as run_plainly
from tests.support.each_row import each_row

WRITES = {
    "exo": ("set", "force_set.index=300"),
    "wrist": ("set", "yaw_set=5"),
    "barrett": ("init",),
    "aidin": ("max-torque", "1"),
    "ekso": ("set", "step_length=15"),
    "hand": ("set", "force_limit.index=300"),
}


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path


def link(kind: str) -> str:
    return f"fake://{kind}?clock=virtual"


def run(*words: str | Path, env: Mapping[str, str] | None = None) -> Result:
    return run_plainly(*words, env={"HANDCTL_HISTORY": "all", "HANDCTL_OPERATOR": "Ann", **(env or {})})


def written(*words: str) -> Result:
    return run(*words, "--yes", "--json")


def kept(*words: str) -> list[dict[str, Any]]:
    return run("history", *words, "--json").rows


@each_row("kind", FAMILIES)
def test_what_a_command_wrote_is_there_with_its_record(home: Path, kind: str) -> None:
    history_of = len(kept(kind))
    done = written(kind, *WRITES[kind], "-p", link(kind))
    (row,) = kept(kind)[history_of:]
    assert row["writes"] == done.json["writes"] and row["exit_code"] == done.code
    assert row["line"].split()[: 1 + len(WRITES[kind])] == [kind, *WRITES[kind]] and row["link"] == link(kind)
    assert (row["kind"], row["command"]) == (kind, f"{kind} {WRITES[kind][0]}") and row["written"]


@each_row(
    ("words", "setting"),
    [
        (("exo", "get", "id", "-p", link("exo")), "all"),
        (("exo", "set", "force_set.index=9999999", "-y", "-p", link("exo")), "all"),
        (("exo", "set", "force_set.index=300", "-n", "-p", link("exo")), "all"),
        (("exo", "set", "force_set.index=300", "-y", "-p", link("exo")), "devices"),
        (("exo", "set", "force_set.index=300", "-y", "-p", link("exo")), "off"),
    ],
)
def test_nothing_is_kept_of_what_wrote_nothing_or_is_left_out(home: Path, words: tuple[str, ...], setting: str) -> None:
    run(*words, env={"HANDCTL_HISTORY": setting})
    assert kept() == [] and not write_history.folder().exists()


def test_writes_to_a_device_are_kept_without_being_asked_for(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("handctl.link.fake._Simulated.fake", False)  # as a link to a device says
    assert run_plainly("exo", "set", "force_set.index=300", "-y", "-p", link("exo")).code == 0
    assert [row["kind"] for row in kept()] == ["exo"]


def test_batch_and_library_and_stop_are_there(home: Path) -> None:
    script = home / "s.txt"
    script.write_text("exo set force_set.index=310\nexo get id\nexo set force_set.index=320\n")
    assert run("batch", script, "-y", "-p", link("exo")).code == 0
    with handctl.simulate("exo", history="all") as device:
        device.set("force_set.index=330", confirm=True)
    assert run("exo", "stop", "-p", link("exo")).code == 0
    rows = kept()
    assert [row["command"] for row in rows] == ["exo set", "exo set", "exo set", "exo stop"]
    assert [row["within"] for row in rows] == ["batch", "batch", "library", None]
    assert "force_set.index=330" in rows[2]["line"] and len(rows[3]["writes"]) == 2


def test_a_library_call_keeps_nothing_of_a_simulator_that_did_not_ask(home: Path) -> None:
    with handctl.simulate("exo") as device:
        device.set("force_set.index=330", confirm=True)
    assert kept() == []


def test_a_failed_command_is_there_with_its_error(home: Path) -> None:
    done = written("barrett", "close", "-p", link("barrett"))
    (row,) = kept()
    assert row["exit_code"] == done.code == 6 and row["failure"] and row["writes"][0]["state"] == "refused"
    assert "refused" in row["written"]


def test_the_stop_of_a_command_that_reads_is_there(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As the key S or another handctl asks for it in the middle of a stream."""
    before = Run.carry_out

    def stopped(self: Run, body: Any) -> Any:
        found = before(self, body)
        assert self.connection.device_access is not None
        self.connection.device_access.stop("stopped by the key S")
        return found

    with monkeypatch.context() as patched:
        patched.setattr(Run, "carry_out", stopped)
        assert run("exo", "get", "id", "-p", link("exo")).code == 130
    (row,) = kept()
    assert row["writes"][0]["meaning"] == "all forces to 0" and row["exit_code"] == 130
    assert all(step["state"] == "sent" for step in row["writes"]) and "stopped by the key S" in row["failure"]


# -- the files ------------------------------------------------------------------------------------------------------------


def test_the_files_are_private_and_bounded(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(write_history, "MOST_BYTES", 1500)
    for value in range(300, 330):
        assert written("exo", "set", f"force_set.index={value}", "-p", link("exo")).code == 0
    names = sorted(path.name for path in write_history.folder().iterdir())
    assert len(names) == write_history.KEPT and "history-1.jsonl" not in names
    assert {stat.S_IMODE(path.stat().st_mode) for path in write_history.folder().iterdir()} == {0o600}
    assert stat.S_IMODE(write_history.folder().stat().st_mode) == 0o700
    assert all(path.stat().st_size < 3000 for path in write_history.folder().iterdir())
    lines = [row["line"].split()[2] for row in kept()]
    assert lines == [f"force_set.index={value}" for value in range(330 - len(lines), 330)] and len(lines) > 4
    assert [row["line"].split()[2] for row in kept("--last", "2")] == lines[-2:]


def test_a_long_command_is_cut_and_counted(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(write_history, "MOST_STEPS", 1)
    monkeypatch.setattr(write_history, "MOST_TEXT", 10)
    run("exo", "stop", "-p", link("exo"))
    (row,) = kept()
    assert row["steps"] == 2 and len(row["writes"]) == 1 and row["writes"][0]["bytes"] == "EB 90 01 0…"


@each_row("trouble", ["file", "folder", "fifo", "full"])
def test_trouble_with_the_disk_is_no_trouble_of_the_command(
    home: Path, trouble: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    where = write_history.folder()
    if trouble == "file":
        where.parent.mkdir(parents=True, exist_ok=True)
        where.write_text("")
    elif trouble in ("folder", "fifo"):
        monkeypatch.setenv("XDG_STATE_HOME", str(home / trouble))
        write_history.folder().mkdir(parents=True)
        first = write_history.folder() / "history-1.jsonl"
        os.mkfifo(first) if trouble == "fifo" else first.mkdir()
    else:

        def full(*_: object) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(write_history, "_append", full)
    for words in (("exo", "set", "force_set.index=300", "-y"), ("exo", "stop")):
        done = run(*words, "-p", link("exo"), "--json")
        assert done.code == 0 and not [row for row in done.json["messages"] if row["level"] != "info"]


def test_damaged_lines_are_left_out_and_the_next_one_is_whole(home: Path) -> None:
    written("exo", "set", "force_set.index=300", "-p", link("exo"))
    (path,) = write_history.files()
    path.write_bytes(path.read_bytes() + b'\xff[1]\n{"writes": 5}\n{"time": "x", "writes": [')
    written("exo", "set", "force_set.index=301", "-p", link("exo"))
    assert [row["line"].split()[2] for row in kept()] == ["force_set.index=300", "force_set.index=301"]


FOREIGN: dict[str, dict[str, Any]] = {
    "device": {"device": {"kind": [1], "name": {}}},
    "line": {"line": None},
    "time": {"time": 5},
    "writes": {"writes": {}},
    "others": {"others": 5},
    "exit code": {"exit_code": {}},
}
ODD: dict[str, dict[str, Any]] = {
    "time without a zone": {"time": "2026-11-26T10:00:00"},
    "no time": {"time": "yesterday"},
    "first year": {"time": "0001-01-01T00:00:00"},
    "numbers": {"writes": [1, {"meaning": 5}], "steps": "a", "options": 7, "within": 3},
    "keys of ours": {"device": {"kind": "exo", "link": "x", "time": 5, "line": 4, "writes": 3}},
}


@each_row("name", {**FOREIGN, **ODD})
def test_a_line_of_another_program_is_shown_or_left_out(home: Path, name: str) -> None:
    where = write_history.folder()
    where.mkdir(parents=True, exist_ok=True)
    entry = {"time": "2026-11-26T10:00:00Z", "line": "x", "device": {"kind": "exo", "link": "y"}, "writes": []}
    changes = {**FOREIGN, **ODD}[name]
    (where / "history-1.jsonl").write_text(json.dumps({**entry, **changes}) + "\n")
    for words in ([], ["exo"], ["--since", "2h"], ["--csv"], ["--json"]):
        assert run("history", *words).code == 0, words
    assert len(kept()) == (name in ODD)


def test_a_folder_that_cannot_be_made_is_told(home: Path) -> None:
    (home / "state").write_text("a file")
    assert "none can be" in run("history").err


# -- which rows -----------------------------------------------------------------------------------------------------------


def _entries(*moments: datetime) -> None:
    write_history.folder().mkdir(parents=True)
    lines = [
        {"time": moment.isoformat(), "line": f"exo set id={number}", "device": {"name": None, "kind": "exo", "link": "COM3"}, "writes": []}
        for number, moment in enumerate(moments)
    ]  # fmt: skip
    (write_history.folder() / "history-1.jsonl").write_text("".join(f"{json.dumps(line)}\n" for line in lines))


def test_since_takes_what_a_person_says(home: Path) -> None:
    now = datetime.now(timezone.utc)
    _entries(now - timedelta(days=30), now - timedelta(hours=3), now)
    for word, count in (
        ("2h", 1),
        ("4 h", 2),
        ("yesterday", 2),
        ("60d", 3),
        ("2020-01-01", 3),
        ("2020-01-01T10:00Z", 3),
    ):
        assert len(kept("--since", word)) == count, word
    assert 1 <= len(kept("--since", "today")) <= 2
    assert run("history", "--since", "tomorrow").code == 2


def test_yesterday_is_a_day_also_where_clocks_change() -> None:
    now = datetime(2026, 3, 30, 9, 0).astimezone()
    found = _moment("yesterday", now)
    assert found is not None and (found.day, found.hour) == (29, 0)


def test_a_device_is_chosen_by_family_name_or_link(home: Path) -> None:
    config = home / "config.toml"
    config.write_text(f'[devices.left]\nkind = "exo"\nport = "{link("exo")}"\n')
    env = {"HANDCTL_CONFIG": str(config)}
    run("exo", "set", "force_set.index=300", "-y", "-p", link("exo"))
    run("wrist", "set", "yaw_set=5", "-y", "-p", link("wrist"))
    run("exo", "set", "force_set.index=301", "-y", "-d", "left", env=env)
    for words, count in ((("exo",), 2), (("left",), 2), ((link("wrist"),), 1), ((), 3), (("-d", "left"), 2)):
        assert len(run("history", *words, "--json", env=env).rows) == count, words
    assert run("history", "lef", env=env).code == 2
    text = run("history", env=env).out
    assert "left" in text and f"wrist {link('wrist')}" in text


def test_an_empty_history_says_so(home: Path) -> None:
    done = run("history", "--json")
    assert done.code == 0 and [row["code"] for row in done.json["messages"]] == ["none"]
    assert str(home) in done.json["messages"][0]["text"]


def test_a_damaged_library_value_is_refused() -> None:
    with pytest.raises(handctl.HandctlError), handctl.simulate("exo", history="sometimes") as device:
        device.get("id")
