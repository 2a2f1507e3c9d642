"""EksoNR at the edges: writes in pieces, a lost entry, clocks just out of range, slow lines, the command's own deadline."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from handctl.command.terminal_prompts import TerminalPrompts
from handctl.devices.ekso.audit_log import AuditLog
from handctl.devices.ekso.device import Ekso, one_setting
from handctl.devices.ekso.explain_bytes import EksoWriteRules
from handctl.devices.ekso.frames import Command, cancel_body, encode
from handctl.devices.ekso.setting_writer import Writer
from handctl.errors import NoAnswer, OutputError, ProtocolError, UsageError
from handctl.record import csv_and_sidecar as recording_module
from handctl.record.recording_loop import Limits
from tests.ekso.recordings import Device, opened, recorded, steady
from tests.ekso.support import DATE, TIME, Unit, codes, ekso_on, frame, port_on
from tests.support.each_row import each_row


def writer_of(folder: Path, unit: Unit) -> Ekso:
    """A device whose settings are written without a question, with its log in `folder`."""
    port = port_on(unit)
    ekso = Ekso(port)
    audit = AuditLog(folder / "audit.jsonl", {"operator": "me", "port": "unit"})
    ekso.writer = Writer(
        port, audit, lambda _question, _word: None, override=False, prompts=TerminalPrompts(quiet=True)
    )
    return ekso


# -- writing ----------------------------------------------------------------------------------------------------------


def test_after_the_read_back_the_deadline_of_the_command_holds_again(tmp_path: Path) -> None:
    """Only the read-back of what was sent goes on beyond --deadline; the next setting of a restore does not."""
    unit = Unit()
    ekso = writer_of(tmp_path, unit)
    ekso.words("settings")
    ekso.port.bound = unit.deadline(1.0)  # over before the second after the first write has passed
    with pytest.raises(NoAnswer) as caught:
        ekso.write([one_setting([text]) for text in ("step_length=16", "step_height=2.25")])
    assert caught.value.code == "deadline"
    assert "Already written: step_length." in caught.value.hint
    assert len(unit.written()) == 1


def test_a_write_whose_result_cannot_be_noted_is_told_as_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unit = Unit()
    ekso = writer_of(tmp_path, unit)
    ekso.words("settings")
    record = AuditLog.record

    def full(log: AuditLog, event: str, host_s: float, **fields: object) -> None:
        if event == "result":
            raise OutputError("audit.jsonl: the audit log cannot be written: No space left on device", code="audit")
        record(log, event, host_s, **fields)

    monkeypatch.setattr(AuditLog, "record", full)
    with pytest.raises(
        OutputError, match=r"was written and read back. Only its audit log entry is missing: .*No space"
    ) as caught:
        ekso.write([one_setting(["step_length=16"])])
    assert (caught.value.code, len(unit.written())) == ("audit", 1)


def test_an_entry_that_the_system_takes_in_pieces_is_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write = os.write
    monkeypatch.setattr(os, "write", lambda file, data: write(file, bytes(data)[:7]))
    AuditLog(tmp_path / "log.jsonl", {}).record("intent", 1.5, name="step_length")
    monkeypatch.undo()
    (line,) = (tmp_path / "log.jsonl").read_bytes().splitlines()
    assert json.loads(line)["name"] == "step_length"


# -- reading ----------------------------------------------------------------------------------------------------------


@each_row(
    ("what", "body", "wrong"),
    [
        ("date", (26, 0, 20), "month 0"),
        ("date", (26, 13, 20), "month 13"),
        ("date", (26, 11, 0), "day 0"),
        ("date", (26, 11, 32), "day 32"),
        ("date", (100, 11, 20), "year 100"),
        ("time", (24, 0, 0), "hour 24"),
        ("time", (0, 60, 0), "minute 60"),
        ("time", (0, 0, 60), "second 60"),
        ("date", (26, 2, 30), "day 30 of month 2"),
        ("date", (26, 2, 29), "day 29 of month 2"),
        ("date", (24, 2, 29), ""),
        ("date", (26, 11, 31), "day 31 of month 11"),
        ("date", (26, 8, 31), ""),
        ("date", (0, 1, 1), ""),
        ("date", (99, 12, 31), ""),
        ("time", (0, 0, 0), ""),
        ("time", (23, 59, 59), ""),
    ],
)
def test_a_clock_just_in_and_just_out_of_range(what: str, body: tuple[int, ...], wrong: str) -> None:
    unit = Unit()
    command = DATE if what == "date" else TIME
    unit.on = {command: lambda msg_id, _body: [(0.001, frame(command, msg_id, bytes(body)))]}
    ekso = ekso_on(unit)
    ekso.shown(what)
    assert codes(ekso.journal) == (["clock"] if wrong else [])
    assert [message.text.rpartition(": ")[2] for message in ekso.journal.messages] == ([wrong] if wrong else [])


def test_on_a_slow_line_an_answer_may_take_its_ten_bits_a_byte() -> None:
    """Request of 6 and answer of 60 bytes at 1200 bit/s are 0.55 s on the wire, beside what the timeout allows."""
    unit = Unit()
    unit.on = {Command.GET_DATA: lambda _msg_id, _body: []}
    unit.baud = 1200
    port = port_on(unit, timeout=0.25, retries=0)
    port.resynchronise()
    asked = unit.clock
    with pytest.raises(NoAnswer):
        port.read(Command.GET_DATA)
    assert unit.clock - asked == pytest.approx(66 * 10 / 1200 + 0.25)


def test_another_command_with_our_msgid_is_not_late() -> None:
    """A longer --timeout, the advice for a late answer, would not help."""
    unit = Unit()
    unit.on = {TIME: lambda msg_id, _body: [(0.001, frame(DATE, msg_id, bytes([26, 11, 20, 0])))]}
    with pytest.raises(ProtocolError) as caught:
        port_on(unit, retries=0).read(Command.GET_TIME)
    assert caught.value.code == "wrong-command"
    assert "GetDate with msgID 1 arrived instead of GetTime with msgID 1" in caught.value.text


# -- recording --------------------------------------------------------------------------------------------------------


def test_silence_counts_from_the_last_answer(tmp_path: Path) -> None:
    """A log of ten seconds, one of them without an answer, is not ended by a silence of six."""
    script = [*steady(10, period=1000), (1.0, NoAnswer("silent")), *steady(2, 12001, 1000)]
    failure, recording, _ = recorded(tmp_path / "a.csv", script, limits=Limits(rows=12, silence=6))
    assert (failure, recording.rows, recording.lost) == (None, 12, 1)


def test_a_closed_log_is_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.csv"
    recording = opened(path, Device([]))
    synced: list[tuple[int, int]] = []
    fsync = os.fsync

    def note(file: int) -> None:
        found = os.fstat(file)
        synced.append((found.st_ino, found.st_size))
        fsync(file)

    monkeypatch.setattr(os, "fsync", note)
    recording.close()
    assert synced == [(path.stat().st_ino, path.stat().st_size)]


def test_a_log_that_appears_meanwhile_is_not_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.csv"
    path.write_text("of another run")
    monkeypatch.setattr(recording_module, "refuse_existing", lambda _path, _force: None)
    with pytest.raises(UsageError, match="exists"):
        recording_module.open_new(str(path), False)
    assert path.read_text() == "of another run"


@each_row("name", ["a.csv", "a.csv.json"])
def test_a_link_that_leads_nowhere_is_a_file_that_is_there(tmp_path: Path, name: str) -> None:
    (tmp_path / name).symlink_to(tmp_path / "gone")
    with pytest.raises(UsageError, match=f"{name} exists"):
        recording_module.open_new(str(tmp_path / "a.csv"), False)


def test_an_echo_of_cancel_action_confirms_nothing() -> None:
    """The answer has the length of the request, and its low status byte reads 0: only the bytes tell an echo."""
    words = EksoWriteRules()
    request = encode(Command.CANCEL_ACTION, 0xF000, cancel_body(), "body")
    assert len(words.sent(request, None)) == 1 and list(words.came(request, None)) == []
    answer = encode(Command.CANCEL_ACTION, 0xF000, bytes(2), "body")
    assert [accepted for _, accepted in words.came(answer, None)] == [True], "after its echo, too"
