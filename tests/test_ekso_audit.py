"""The audit log: appended, on the disk when `record` returns, readable after a kill, never without a place to write."""

from __future__ import annotations

import json
import os
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from handctl.devices.ekso.audit import AuditLog, default_path
from handctl.errors import OutputError

KILLED = """
import os, signal, sys
from pathlib import Path
from handctl.devices.ekso.audit import AuditLog
log = AuditLog(Path(sys.argv[1]), {"operator": "me"})
for number in range(3):
    log.record("intent", 1.5, number=number)
os.kill(os.getpid(), signal.SIGKILL)
"""


def lines(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def test_an_entry_is_a_line(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "log.jsonl"
    log = AuditLog(path, {"operator": "Zoë", "tool": "handctl 0"})
    log.record("intent", 12.25, id=202, old={"raw": 1, "value": 0.01})
    (entry,) = lines(path)
    assert entry.pop("utc")
    assert entry == {
        "event": "intent", "host_monotonic_s": 12.25, "operator": "Zoë", "tool": "handctl 0", "id": 202,
        "old": {"raw": 1, "value": 0.01},
    }  # fmt: skip
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_it_is_on_the_disk_before_record_returns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    write, fsync = os.write, os.fsync
    monkeypatch.setattr(os, "write", lambda file, data: done.append("write") or write(file, data))
    monkeypatch.setattr(os, "fsync", lambda file: done.append("fsync") or fsync(file))
    log = AuditLog(tmp_path / "log.jsonl", {})
    log.record("intent", 0.0)
    log.record("result", 0.0)
    assert done == ["fsync", "write", "fsync", "write", "fsync"], "the folder once, then after each entry"


def test_a_kill_loses_nothing(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False, timeout=30)
    assert done.returncode == -signal.SIGKILL
    assert [entry["number"] for entry in lines(path)] == [0, 1, 2]


def test_entries_are_appended_also_behind_half_a_line(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    path.write_bytes(b'{"event": "intent"}\n{"event": "res')
    AuditLog(path, {}).record("intent", 0.0)
    first, torn, last = path.read_text(encoding="utf-8").splitlines()
    assert (first, torn) == ('{"event": "intent"}', '{"event": "res')
    assert json.loads(last)["event"] == "intent"
    AuditLog(path, {}).record("result", 0.0)
    assert len(path.read_text(encoding="utf-8").splitlines()) == 4


def test_an_entry_is_whole_behind_half_a_line_of_another_handctl_at_work(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    log = AuditLog(path, {})
    log.record("intent", 0.0)
    with path.open("ab") as other:
        other.write(b'{"event": "inte')  # killed there, while this one runs
    log.record("result", 0.0)
    assert [json.loads(line)["event"] for line in path.read_text(encoding="utf-8").splitlines()[::2]] == [
        "intent", "result",
    ]  # fmt: skip


def test_nothing_is_held_open_between_entries(tmp_path: Path) -> None:
    log = AuditLog(tmp_path / "log.jsonl", {})
    log.check()
    log.record("intent", 0.0)
    open_files = {os.path.realpath(f"/proc/self/fd/{number}") for number in os.listdir("/proc/self/fd")}
    assert str(tmp_path / "log.jsonl") not in open_files
    (tmp_path / "log.jsonl").rename(tmp_path / "log.1")  # put away by the system's log rotation
    log.record("result", 0.0)
    assert [entry["event"] for name in ("log.1", "log.jsonl") for entry in lines(tmp_path / name)] == [
        "intent", "result",
    ]  # fmt: skip


@pytest.mark.parametrize("place", ["/dev/full", "folder", "file/log.jsonl"])
def test_no_log(place: str, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    log = AuditLog(tmp_path / place, {})
    with pytest.raises(OutputError) as caught:
        log.record("intent", 0.0)
    assert caught.value.code == "audit"
    assert "no setting is written" in caught.value.hint


def test_the_usual_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", "/state")
    assert default_path() == Path("/state/handctl/ekso-audit.jsonl")
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", "/people/me")
    assert default_path() == Path("/people/me/.local/state/handctl/ekso-audit.jsonl")
