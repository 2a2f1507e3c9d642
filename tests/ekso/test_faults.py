"""Every fault of the simulator times every ekso command: the right value, or the right exit code and a cause.

Never a wrong value, a second SetValue, a setting that nobody meant, a traceback or a hang. Runs the real `main()` against
the simulator in virtual time. A frame has a CRC, a command and a msgID: whatever is damaged must be noticed.
"""

from __future__ import annotations

import json
import time
from functools import cached_property
from pathlib import Path
from typing import Any

import pytest

from tests.ekso.commands import (
    BOOT,
    CANCEL,
    COMMANDS,
    ME,
    OFFLINE,
    PLACES,
    POWER_ON,
    READING,
    SCALES,
    SET,
    WRITES,
    Command,
    prepare,
    unit,
)
from tests.ekso.faults import (
    ANSWER_LOST,
    FAULTS,
    HIT_CANCEL,
    LUCKY,
    NEVER_TAKEN,
    NO_ANSWER,
    NOT_HEARD,
    PHASES,
    SETS,
    STILLNESS,
    UNHARMED,
    expected,
)
from tests.support.cli import Result, Spy, run, sent, spying

pytestmark = pytest.mark.faults
REAL_SECONDS, VIRTUAL_SECONDS = 30.0, 20.0

# -- one cell ---------------------------------------------------------------------------------------------------------


class Cell:
    """One command line against one fault."""

    def __init__(self, tmp_path: Path, command: Command, fault: str, *more: str, **options: object) -> None:
        self.command, self.fault = command, fault
        trace = tmp_path / "trace.txt"
        log = tmp_path / "handctl" / "ekso-audit.jsonl"
        for path in (tmp_path / "new.csv", tmp_path / "new.csv.json", tmp_path / "new.json", trace, log):
            path.unlink(missing_ok=True)
        self.link = unit(posture=command.posture, fault=fault, seed=1, **options)
        args = ["ekso", *command.words(tmp_path), "-p", self.link, "--json", "--trace", str(trace), *more]
        began = time.monotonic()
        with spying() as spy:
            self.result: Result = run(*args, env={"XDG_STATE_HOME": str(tmp_path)})
        self.seconds = time.monotonic() - began
        self.spy: Spy = spy
        self.sent = sent(trace) if trace.exists() else []
        self.audit = [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []
        self.csv = (tmp_path / "new.csv").read_text() if (tmp_path / "new.csv").exists() else ""

    def __repr__(self) -> str:
        return f"ekso {' '.join(self.command.args)} -p '{self.link}': {self.result!r}"

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """The rows, whatever the format; the output is valid by the schema."""
        return self.result.stream[0] if self.command.kind == "stream" else self.result.rows

    @cached_property
    def messages(self) -> list[dict[str, Any]]:
        """The messages of the envelope."""
        envelope = self.result.stream[1] if self.command.kind == "stream" else self.result.json
        return list(envelope["messages"])

    @property
    def written(self) -> list[bytes]:
        """Bodies of the SetValue requests on the wire."""
        return [data[4:-2] for data in self.sent if data[0] == SET]

    @property
    def device(self) -> Any:
        """The simulated unit."""
        return self.spy.lines[-1].device

    def changed(self) -> dict[str, int]:
        """The unit's settings that are not those of power-on any more, in their own sign."""
        now = {name: self.device.settings[place] for name, place in PLACES.items()}
        return {
            name: raw - 65536 if raw >= 32768 else raw for name, raw in now.items() if raw != POWER_ON[name] % 65536
        }

    def sound(self) -> None:
        """No traceback, valid JSON, one error with a hint, bounded time, each write once and none that was not asked."""
        assert self.result.code != 1 and "Traceback" not in self.result.err, self
        errors = [message for message in self.messages if message["level"] == "error"]
        assert len(errors) == (self.result.code != 0), self
        for error in errors:
            assert self.command.kind == "none" or "fake://ekso" in error["text"] or error["code"] == "differ", error
            assert error["hint"] or self.result.code in (6, 7), error
        assert self.seconds < REAL_SECONDS and (not self.spy.lines or self.spy.now < VIRTUAL_SECONDS), self
        assert self.written == self.command.frames[: len(self.written)], (self.written, self)
        cancels = [data for data in self.sent if data[0] == CANCEL]
        assert len(cancels) <= (self.command.kind == "cancel"), self
        assert all(150 <= data[0] <= 156 for data in self.sent), self
        assert not self.sent or self.device.violations == 0, self
        if self.command.kind == "none":
            assert self.sent == [] and not self.spy.lines, self

    def audited(self) -> None:
        """Every write has its intent with the frame, and what became of it; nothing else is in the log."""
        if self.command.kind == "cancel":
            frames = [data for data in self.sent if data[0] == CANCEL]
            assert [entry["event"] for entry in self.audit] == ["cancel", "cancel-result"] * len(frames), self
            assert [bytes.fromhex(entry["frame"]) for entry in self.audit[::2]] == frames, (self.audit, self)
            return
        assert [entry["event"] for entry in self.audit] == ["intent", "result"] * len(self.written), (self.audit, self)
        frames = [bytes.fromhex(entry["frame"])[4:-2] for entry in self.audit if entry["event"] == "intent"]
        assert frames == self.written, self
        assert all(entry["operator"] == "me" and entry["simulated"] is True for entry in self.audit), self.audit

    def harmless(self) -> None:
        """The unit's settings are those of before, but for what was written, and what the fault itself changes."""
        if not self.spy.lines:
            return
        own = {"neighbour": {"step_height", "lateral_shift", "upper_leg_length", "right_swing_assist", "swing_complete",
                             "lower_leg_length", "stand_time", "right_stance_support"}, "pendant": {"target_sounds"}}  # fmt: skip
        wanted = {name: raw for _, raw, name in self.command.writes[: len(self.written)]}
        for name, raw in self.changed().items():
            assert wanted.get(name) == raw or name in own.get(self.fault, ()), (name, raw, self)

    def truth(self, name: str) -> set[int] | None:
        """The raw values that a word may have in a row; None when it moves by itself."""
        if name in BOOT or name not in POWER_ON:
            return None
        if self.fault == "fidget" and ("hip" in name or "knee" in name) and "stance" not in name:
            return None
        fixed = {("unknown-state", "state"): 0x5040, ("stuck-sensor", "left_toe_pressure"): 333,
                 ("hip-offset", "right_hip_x"): POWER_ON["right_hip_x"] + 30}  # fmt: skip
        if name == "upright_time":  # goes on counting
            return set(range(POWER_ON[name], POWER_ON[name] + int(VIRTUAL_SECONDS)))
        values = {fixed.get((self.fault, name), POWER_ON[name])}
        values |= {raw for _, raw, key in self.command.writes if key == name}
        if self.fault == "unlisted-codes" and 10 <= PLACES.get(name, 0) != PLACES["pilot_id"]:
            values.add(40 + PLACES[name])
        if self.fault == "pendant" and name == "target_sounds":
            values |= {0, 1, 2, 3}
        return values

    def truthful(self) -> None:
        """No value that is not the unit's; raw and value belong together."""
        for row in self.rows:
            allowed = self.truth(str(row.get("name")))
            if allowed is None or row.get("value") is None:
                continue
            scale = SCALES[row["name"]]
            assert row["value"] in {raw / scale for raw in allowed}, (row, self)
            if "raw" in row:
                assert row["raw"] == round(row["value"] * scale), (row, self)

    def complete(self) -> None:
        """Success: every row is there with a value, and the unit holds what was written."""
        names = [row["name"] for row in self.rows if "name" in row]
        if self.command.shows:
            assert sorted(names) == sorted(self.command.shows), self
            assert self.command.kind == "stream" or all("value" in row for row in self.rows), self
        if self.command.kind == "log":
            assert self.csv.count("\n") == 4 and self.rows[0]["rows"] == 3, (self.csv, self)
        assert self.written == self.command.frames, self
        for _, raw, name in self.command.writes:
            assert self.changed()[name] == raw, (name, self)

    def holds(self, code: int, words: str, *, lucky: bool = False) -> None:
        """The whole expectation."""
        self.sound()
        self.audited()
        self.harmless()
        self.truthful()
        assert self.result.code == code or (lucky and self.result.code == 0), (code, self)
        if self.result.code == 0:
            self.complete()
        else:
            (error,) = [message for message in self.messages if message["level"] == "error"]
            assert any(word in error["text"] for word in words.split("|")), (words, error)

    def warned(self, code: str) -> bool:
        """Whether a warning of that code is there."""
        return any(message["code"] == code and message["level"] == "warning" for message in self.messages)


@pytest.fixture(scope="module")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the input files of the commands, and the audit log."""
    path = tmp_path_factory.mktemp("faults")
    prepare(path)
    return path


# -- the matrix -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", [*READING, *WRITES], ids=lambda command: command.name)
@pytest.mark.parametrize("fault", FAULTS)
def test_fault(scratch: Path, fault: str, command: Command) -> None:
    cell = Cell(scratch, command, fault)
    code, words = expected(fault, command.name)
    cell.holds(code, words, lucky=fault in LUCKY)
    assert cell.warned("answer-lost") == (fault in ANSWER_LOST and command.name in SETS), cell
    if fault in STILLNESS and command.name in SETS:
        assert cell.written == [], cell
    if fault == "healthy":
        assert tuple(data[0] for data in cell.sent) == command.asks, cell


def test_every_fault_is_tried() -> None:
    from handctl.sim import model_class
    from handctl.sim.engine.line import LINE_FAULTS

    assert set(FAULTS) == {*LINE_FAULTS, *model_class("ekso").FAULTS}


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("fault", FAULTS)
def test_fault_at_the_write(scratch: Path, fault: str, phase: str) -> None:
    """Just the SetValue is hit, just its read-back, or both: once on the wire, and its fate is told."""
    options, table = PHASES[phase]
    code, words = table.get(fault, (0, ""))
    for command in WRITES[:3] if fault not in UNHARMED else WRITES[:1]:
        cell = Cell(scratch, command, fault, **options)
        cell.holds(code, words, lucky=fault in LUCKY)
        assert len(cell.written) == 1, cell
        taken = fault not in NOT_HEARD[phase] and (phase == "read-back" or fault not in NEVER_TAKEN)
        assert (command.writes[0][2] in cell.changed()) == taken, cell
        assert cell.warned("answer-lost") == (words == "answer-lost"), cell
        if (code in (3, 4, 5) and words != "not applied" and fault != "loopback") or (code, phase) == (3, "write"):
            (error,) = [message for message in cell.messages if message["level"] == "error"]
            assert "was sent and could not be read back" in error["hint"] or "not applied" in error["text"], error
        verdict = cell.audit[-1]["verdict"]
        assert (verdict == "applied") == (cell.result.code == 0), (verdict, cell)


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_at_the_cancel(scratch: Path, fault: str) -> None:
    """Just CancelAction is hit: it was sent once, the log has it, and an error says that it may have been taken."""
    (command,) = [command for command in WRITES if command.kind == "cancel"]
    cell = Cell(scratch, command, fault, after=1)
    code, words = HIT_CANCEL.get(fault, (0, ""))
    cell.holds(code, words, lucky=fault in LUCKY)
    assert [data[0] for data in cell.sent if data[0] == CANCEL] == [CANCEL], cell
    if code in (4, 5) and cell.result.code:
        (error,) = [message for message in cell.messages if message["level"] == "error"]
        assert error["hint"].startswith("It was sent and may have been taken; the state "), error


ONCE = ("silent", "deaf", "truncate", "bad-checksum", "wrong-id", "twin-id", "late", "acknowledge", "wrong-command",
        "short-body", "reboot")  # fmt: skip


@pytest.mark.parametrize("fault", ONCE)
def test_every_second_answer_lost_is_asked_for_again(scratch: Path, fault: str) -> None:
    """Reads are repeated with a new msgID and come to the same values."""
    for command in READING:
        if command.name in ("status-check", "diff"):
            continue
        cell = Cell(scratch, command, fault, every=2)
        if fault == "reboot":  # starts the counts anew: only that it goes through
            cell.sound()
            assert cell.result.code == 0, cell
            continue
        cell.holds(0, "")
        idents = [data[2] * 256 + data[3] for data in cell.sent]
        assert idents == list(range(1, len(idents) + 1)), (idents, cell)


@pytest.mark.parametrize("fault", [*NO_ANSWER, "dribble", "split", "noise"])
def test_deadline_bounds_the_whole_command(scratch: Path, fault: str) -> None:
    """--deadline counts for everything; only a write that has gone out is still read back."""
    for name in ("status", "dump", "watch", "log", "set", "restore", "cancel"):
        (command,) = [command for command in COMMANDS if command.name == name]
        cell = Cell(scratch, command, fault, "--deadline", "0.3")
        cell.sound()
        assert cell.spy.now <= 0.3 + (1.0 if cell.written else 0.15), (cell.spy.now, cell)
        # the deadline falls between two bytes of an answer that comes in pieces
        assert cell.result.code in {expected(fault, name)[0], 0, 4} | (
            {5} if fault in ("dribble", "split") else set()
        ), cell
        if name == "restore":
            assert len(cell.written) < 2 and cell.result.code, cell


@pytest.mark.parametrize("command", OFFLINE, ids=lambda command: command.name)
def test_what_needs_no_device_opens_none(scratch: Path, command: Command) -> None:
    cell = Cell(scratch, command, "silent")
    cell.sound()
    assert cell.result.code == (2 if command.name == "too-far" else 0), cell
    assert cell.audit == []


# -- what the message says --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "args", [("status",), ("get", "step_length"), ("time",), ("set", "step_length=15.5", *ME), ("log", "x.csv")]
)
@pytest.mark.parametrize("fault", NO_ANSWER)
def test_error_names_link_bytes_and_next_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str, args: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run("ekso", *args, "-p", unit(fault=fault, seed=1), "--json", env={"XDG_STATE_HOME": str(tmp_path)})
    if fault in LUCKY and result.code == 0:
        return
    assert result.code == NO_ANSWER[fault][0]
    error = result.error
    assert error["hint"] and "fake://ekso" in error["text"]
    for other in ("exo", "wrist", "barrett", "aidin"):
        assert f"handctl {other}" not in error["hint"], error
    if result.code != 3:
        assert "115200" in error["text"]
        assert any(len(word.strip("(),;")) == 2 and int(word.strip("(),;"), 16) >= 0 for word in error["text"].split()
                   if word.strip("(),;").isalnum() and set(word.strip("(),;")) <= set("0123456789ABCDEF")), error  # fmt: skip
    if result.code == 4:
        assert "USB cable" in error["hint"] and "length-mode" in error["hint"]
    assert not (tmp_path / "x.csv").exists(), "a log without a row is not begun"


def test_a_neighbour_that_changed_is_named_with_the_way_back(scratch: Path) -> None:
    cell = Cell(scratch, WRITES[0], "neighbour")
    error = cell.result.error
    assert "step_height is 1.76 in, expected 1.75 in" in error["text"] and "status accepted" in error["text"]
    assert "`handctl ekso set step_length=14.75`" in error["hint"]


@pytest.mark.parametrize("status", [1, 2, 3, 9])
def test_every_status_is_told_in_words(scratch: Path, status: int) -> None:
    """Dossier 2: 1 wrong state, 2 out of range, 3 not allowed; whatever else counts as refused, with its number."""
    words = {1: "refused in the present state", 2: "out of range", 3: "not allowed", 9: "unknown (9)"}
    for command in (WRITES[0], WRITES[-1]):
        cell = Cell(scratch, command, "refuse", refuse_status=status)
        cell.holds(6, words[status])


@pytest.mark.parametrize("mode", ["n-4", "n-2", "frame"])
def test_faults_with_other_length_bytes(scratch: Path, mode: str) -> None:
    """The convention does not weaken what is noticed."""
    for fault in ("healthy", "bad-checksum", "short-body", "stray-zero", "unsolicited", "wrong-id", "echo"):
        for command in (READING[4], READING[6], WRITES[0], WRITES[-1]):
            cell = Cell(scratch, command, fault, "--length-mode", mode, length=mode)
            cell.holds(*expected(fault, command.name))
            if cell.result.code == 0:
                assert cell.warned("length-convention"), cell


def test_a_recording_survives_every_third_fault(scratch: Path) -> None:
    """Rows are whole or absent, seq has the holes, and lost requests are counted."""
    (command,) = [command for command in READING if command.name == "log"]
    for fault in ONCE[:-1]:
        cell = Cell(scratch, command, fault, "--retries", "0", every=7)
        cell.sound()
        assert cell.result.code == 0, cell
        lines = cell.csv.splitlines()
        assert len(lines) == 4 and {line.count(",") for line in lines} == {lines[0].count(",")}, cell
        lost = cell.rows[0]["lost"]
        seq = [int(line.split(",")[5]) for line in lines[1:]]
        assert (lost, seq) in ((1, [1, 3, 4]), (1, [1, 2, 4]), (0, [1, 2, 3])), (lost, seq, cell)
        assert cell.warned("lost") == bool(lost)
