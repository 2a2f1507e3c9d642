"""Every fault of the simulator times every ekso command: the right value, or the right exit code and a cause.

Never a wrong value, a second SetValue, a setting that nobody meant, a traceback or a hang. Runs the real `main()` against
the simulator in virtual time. A frame has a CRC, a command and a msgID: whatever is damaged must be noticed.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ekso.cell import Cell
from tests.ekso.commands import (
    CANCEL,
    COMMANDS,
    ME,
    OFFLINE,
    READING,
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
from tests.support.cli import run

pytestmark = pytest.mark.faults

# -- one cell ---------------------------------------------------------------------------------------------------------


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
        assert error["hint"].startswith("It was sent and may have been taken. The state "), error


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
