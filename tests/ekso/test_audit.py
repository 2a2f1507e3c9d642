"""The audit log: appended, on the disk when `record` returns, readable after a kill, never without a place to write."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import stat
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from handctl.devices.ekso.audit_log import TAIL, AuditLog, default_path
from handctl.errors import OutputError
from tests.ekso.commands import ME, unit
from tests.support.cli import Result, run
from tests.support.each_row import each_row

WRITER = """
import sys
from pathlib import Path
from handctl.devices.ekso.audit_log import AuditLog
for number in range(20):
    AuditLog(Path(sys.argv[1]), {"writer": sys.argv[2]}).record("intent", float(number))
"""

KILLED = """
import os, signal, sys
from pathlib import Path
from handctl.devices.ekso.audit_log import AuditLog
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
    assert entry.pop("utc") and len(str(entry.pop("chain"))) == 64
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


@pytest.mark.real
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


@each_row("place", ["/dev/full", "folder", "file/log.jsonl"])
def test_no_log(place: str, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    log = AuditLog(tmp_path / place, {})
    with pytest.raises(OutputError) as caught:
        log.record("intent", 0.0)
    assert caught.value.code == "audit"


def test_the_usual_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", "/state")
    assert default_path() == Path("/state/handctl/ekso-audit.jsonl")
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", "/people/me")
    assert default_path() == Path("/people/me/.local/state/handctl/ekso-audit.jsonl")


# -- the chain ----------------------------------------------------------------------------------------------------


def told_by(path: Path) -> list[tuple[int, str]]:
    return [(found.number, found.text.split(",")[0]) for found in AuditLog(path, {}).checked(whole=True).findings]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Five entries, the second with a letter beyond ASCII."""
    path = tmp_path / "log.jsonl"
    for number in range(5):
        AuditLog(path, {"operator": "Zoë"}).record("intent", float(number), name=f"n{number}", old={"raw": 1})
    return path


def test_each_entry_holds_a_hash_of_itself_and_the_one_before(log: Path) -> None:
    """Recomputed here by the words of the docstring alone."""
    before = ""
    for line in log.read_bytes().splitlines():
        body, _, end = line.rpartition(b', "chain": ')
        before = hashlib.sha256(before.encode() + body + b"}").hexdigest()
        assert end == f'"{before}"}}'.encode()
    assert told_by(log) == []


EDITS: dict[str, tuple[Callable[[list[str]], list[str]], list[tuple[int, str]]]] = {
    "edited": (lambda lines: [*lines[:2], lines[2].replace('"raw": 1', '"raw": 2'), *lines[3:]], [(3, "was edited")]),
    "edited last": (lambda lines: [*lines[:4], lines[4].replace("n4", "n5")], [(5, "was edited")]),
    "removed": (lambda lines: [*lines[:1], *lines[2:]], [(2, "was edited")]),
    "first removed": (lambda lines: lines[1:], [(1, "was edited")]),
    "swapped": (
        lambda lines: [lines[0], lines[2], lines[1], *lines[3:]],
        [(2, "was edited"), (3, "was edited"), (4, "was edited")],
    ),
    "twice": (lambda lines: [*lines[:2], lines[1], *lines[2:]], [(3, "was edited")]),
    "without its hash": (
        lambda lines: [*lines[:2], lines[2][: lines[2].index(', "chain"')] + "}\n", *lines[3:]],
        [(3, "has no hash: an older handctl wrote it"), (4, "was edited")],
    ),
    "put in": (
        lambda lines: [*lines[:2], '{"event": "result"}\n', *lines[2:]],
        [(3, "has no hash: an older handctl wrote it"), (4, "was edited")],
    ),
    "no entry": (lambda lines: [*lines[:2], "nonsense\n", *lines[2:]], [(3, "has no hash: an older handctl wrote it")]),
}  # fmt: skip


@pytest.mark.parametrize("name", EDITS)
def test_an_edit_shows(name: str, log: Path) -> None:
    edit, found = EDITS[name]
    log.write_text("".join(edit(log.read_text(encoding="utf-8").splitlines(keepends=True))), encoding="utf-8")
    assert told_by(log) == found
    AuditLog(log, {}).record("result", 9.0)
    assert told_by(log) == found, "what is written later fits what is there"


def test_what_is_no_edit(log: Path) -> None:
    """Half a line of a killed writer, empty lines, a log that was put away, entries of a handctl that knew no chain."""
    with log.open("ab") as file:
        file.write(b'\n{"event": "intent", "old": {"raw": 1}')
    AuditLog(log, {}).record("result", 6.0)
    checked = AuditLog(log, {}).checked(whole=True)
    assert (checked.chained, checked.unchained, checked.torn, checked.findings) == (6, 0, 1, ())
    log.rename(log.with_suffix(".1"))
    AuditLog(log, {}).record("intent", 7.0)
    assert told_by(log) == told_by(log.with_suffix(".1")) == []
    log.write_text('{"event": "intent"}\n{"event": "result"}\n')
    for _ in range(2):
        AuditLog(log, {}).record("intent", 8.0)
    checked = AuditLog(log, {}).checked(whole=True)
    assert (checked.chained, checked.unchained, checked.findings) == (2, 2, ())
    log.write_text(log.read_text().replace('{"event": "result"}', '{"event": "RESULT"}'))
    assert told_by(log) == [(3, "was edited")], "the last of the old ones is held by the first of the new"


@pytest.mark.real
def test_several_programs_write_one_chain(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    with ThreadPoolExecutor(4) as pool:  # threads share no range lock against each other, programs do
        list(
            pool.map(
                lambda number: subprocess.run([sys.executable, "-c", WRITER, str(path), str(number)], check=True),
                range(4),
            )
        )
    checked = AuditLog(path, {}).checked(whole=True)
    assert (checked.chained, checked.findings) == (80, ())


def test_the_end_of_a_long_log_is_enough_for_the_next_entry(tmp_path: Path) -> None:
    path = tmp_path / "log.jsonl"
    log = AuditLog(path, {"filler": "x" * 1000})
    for number in range(100):
        log.record("intent", float(number))
    assert path.stat().st_size > TAIL
    assert (log.checked().findings, log.checked(whole=True).chained) == ((), 100)
    assert log.checked().chained < 70


def test_policy_tells_whether_the_log_is_as_it_was_written(log: Path, tmp_path: Path) -> None:
    """Exit code 7 with the places, and the table all the same."""
    good = run("ekso", "policy", "--audit", str(log), "--json")
    (message,) = good.json["messages"]
    assert good.code == 0 and "5 entries, none was edited, removed or moved" in message["text"], good
    log.write_text(log.read_text(encoding="utf-8").replace("n1", "n7"), encoding="utf-8")
    edited = run("ekso", "policy", "--json", env={"HANDCTL_AUDIT": str(log)})
    assert (edited.code, edited.error["code"]) == (7, "audit-edited") and edited.rows == good.rows
    assert "line 2 (" in edited.error["text"] and "intent n7) was edited" in edited.error["text"]
    log.write_text('{"event": "intent"}\n')
    old = run("ekso", "policy", "--audit", str(log), "--json")
    assert old.code == 0 and "Entries from an older handctl, without a hash: 1." in old.json["messages"][0]["text"]
    (tmp_path / "other").write_text("a: b\n")
    for place in ("/dev/zero", str(tmp_path), str(tmp_path / "none"), str(tmp_path / "other")):
        assert run("ekso", "policy", "--audit", place).code == 2
    none = run("ekso", "policy", "--json", env={"XDG_STATE_HOME": str(tmp_path)})
    assert none.code == 0 and none.json["messages"] == []


def test_a_set_warns_of_an_edited_log_and_refuses_while_it_is_fresh(tmp_path: Path) -> None:
    """The policy remembers the last writes by the log: within 10 s of an edit nothing is written."""
    path = tmp_path / "log.jsonl"

    def set_(value: str) -> Result:
        return run("ekso", "set", f"step_height={value}", *ME, "--audit", str(path), "-p", unit(), "--json")

    assert set_("2").code == 0
    path.write_text(path.read_text(encoding="utf-8").replace('"value": 2.0', '"value": 1.7'), encoding="utf-8")
    refused = set_("2")
    assert (refused.code, refused.error["code"]) == (7, "audit-edited"), refused
    assert "audit-edited" in refused.codes() and [row["state"] for row in refused.json["writes"]] == ["not-sent"]
    os.utime(path, (1e9, 1e9))
    for _ in range(2):  # the second is told by the first that the edit is old
        done = set_("2")
        assert done.code == 0 and "audit-edited" in done.codes(), done
