"""What the messages of `handctl ekso` say at single faults of the simulator, and what becomes of a write that is hit.

Every fault in every command, and at the write, its read-back and the cancel, is `tests/search/faults.py`; its exit codes are in
`tests/contract/facts/outcomes/ekso.py`. A frame has a CRC, a command and a msgID: whatever is damaged must be noticed.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.contract.facts.outcomes.ekso import NO_ANSWER, OUTCOMES
from tests.ekso.commands import ME, OFFLINE, Command, prepare, unit
from tests.search.faults import Cell
from tests.support.cli import Result, run, spying

WORDS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("silent", "deaf", "reboot"), ("no reply",)),
    **dict.fromkeys(("late", "wrong-id"), ("msgID",)), "wrong-command": ("instead of",),
    "truncate": ("cut off", "without a valid frame"), "short-body": ("body", "CRC"), "loopback": ("echo", "our own bytes"),
    **dict.fromkeys(("bad-checksum", "twin-id"), ("CRC", "checksum")), "acknowledge": ("acknowledged without data",),
    "disconnect": ("hung up",),
}  # fmt: skip
ON_SET = {
    "refuse": "refused in the present state", "stands-up": "refused in the present state", "not-taken": "read-back differs",
    "neighbour": "read-back differs", "fidget": "deg/s", "unknown-state": "unknown (0x5040)",
    "pendant": "settings changed in the meantime. Nothing was written: target_sounds is Forward, expected Off",
    "frozen-clock": "BootTime advanced by 0 ms", "clock-jump": "BootTime advanced by 51",
}  # fmt: skip
"""What `set` says."""
SPECIAL = {
    ("unlisted-codes", "diff"): "10 of 20 values differ",
    ("unlisted-codes", "set-label"): "read-back differs: lean_allowance is unknown (61)",
    ("unlisted-codes", "set-percent"): "read-back differs: left_swing_assist is unknown (54)",
    ("unlisted-codes", "set-twice"): "read-back differs: right_stance_support is unknown (57)",
    ("unlisted-codes", "restore"): "walk_mode, injury_mode: only while sitting",
    ("refuse", "cancel"): "refused in the present state",
    ("hip-offset", "status-check"): "right hip is +3",
    ("frozen-clock", "status-check"): "does not advance",
    ("clock-jump", "status-check"): "advanced by 51",
}


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    prepare(tmp_path)
    return tmp_path


def tried(scratch: Path, name: str, *options: str, words: tuple[str, ...] = ()) -> Cell:
    """One command of the list on the simulator."""
    row = next(row for row in OUTCOMES.rows if row.name == name)
    return Cell("ekso", "serial", row, scratch, "seed=1", *options, words=words)


def command_line(result: Result) -> str:
    """The text of its one error."""
    return str(result.error["text"])


def test_the_cause_is_named(scratch: Path) -> None:
    for fault, words in WORDS.items():
        for name in ("get", "set"):
            cell = tried(scratch, name, f"fault={fault}")
            assert (cell.result.code == 0 and fault == "twin-id") or any(
                word in command_line(cell.result) for word in words
            ), cell
    for fault, word in ON_SET.items():
        assert word in command_line(tried(scratch, "set", f"fault={fault}").result), fault
    for (fault, name), word in SPECIAL.items():
        assert word in command_line(tried(scratch, name, f"fault={fault}").result), (fault, name)


def test_a_write_that_may_have_been_taken_is_told(scratch: Path) -> None:
    """Behind it nothing answers: whether it was taken is not known, and the audit log has it."""
    for fault in ("silent", "truncate", "bad-checksum", "wrong-id", "disconnect"):
        cell = tried(scratch, "set", f"fault={fault}", "after=6")
        assert "was sent but could not be read back" in cell.result.error["hint"], cell
        (scratch / "state/handctl/ekso-audit.jsonl").unlink()
        hit = tried(scratch, "cancel", f"fault={fault}", "after=1")
        assert hit.result.code == 3 or hit.result.error["hint"].startswith(
            "It was sent and may have taken effect. The state "
        ), hit
    for fault in ("deaf", "reboot"):  # the next read shows that it was not
        cell = tried(scratch, "set", f"fault={fault}", "every=7")
        assert cell.result.code == 4 and "not applied" in command_line(cell.result), cell
    for fault in ("silent", "acknowledge", "acknowledge-set", "set-unanswered", "late"):  # and that it was
        cell = tried(scratch, "set", f"fault={fault}", "every=7")
        assert cell.result.code == 0 and "answer-lost" in cell.result.codes(), cell


def test_reads_are_repeated_with_a_new_number(scratch: Path) -> None:
    cell = tried(scratch, "dump", "fault=silent", "every=2")
    idents = [entry.data[2] * 256 + entry.data[3] for entry in cell.passed if entry.mark == ">"]
    assert cell.result.code == 0 and len(idents) > 6 and idents == list(range(1, len(idents) + 1)), cell


def test_a_healthy_unit_is_asked_for_nothing_else(scratch: Path) -> None:
    for row in OUTCOMES.rows:
        cell = tried(scratch, row.name)
        assert tuple(entry.data[0] for entry in cell.passed if entry.mark == ">") == row.asks, cell
        (scratch / "state/handctl/ekso-audit.jsonl").unlink(missing_ok=True)


def test_a_deadline_leaves_a_restore_undone(scratch: Path) -> None:
    """Only a write that has gone out is still read back."""
    for fault in (*NO_ANSWER, "dribble", "split", "noise"):
        cell = tried(scratch, "restore", f"fault={fault}", words=("--deadline", "0.3"))
        assert cell.result.code and len(cell.written) < 2, cell
        assert cell.spy.now <= 0.3 + (1.0 if cell.written else 0.15), cell


@pytest.mark.parametrize("command", OFFLINE, ids=lambda command: command.name)
def test_what_needs_no_device_opens_none(scratch: Path, command: Command) -> None:
    with spying() as spy:
        result = run("ekso", *command.words(scratch), "-p", unit(fault="silent"), env={"XDG_STATE_HOME": str(scratch)})
    assert result.code == (2 if command.name == "too-far" else 0), result
    assert not spy.lines and not (scratch / "handctl" / "ekso-audit.jsonl").exists()


# -- what the message says --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "args", [("status",), ("get", "step_length"), ("time",), ("set", "step_length=15.5", *ME), ("log", "x.csv")]
)
def test_error_names_link_bytes_and_next_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, args: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    for fault, codes in NO_ANSWER.items():
        result = run("ekso", *args, "-p", unit(fault=fault, seed=1), "--json", env={"XDG_STATE_HOME": str(tmp_path)})
        assert result.code in codes, (fault, result)
        if result.code == 0:
            continue
        error = result.error
        assert error["hint"] and "fake://ekso" in error["text"]
        assert not [other for other in ("exo", "wrist", "barrett", "aidin") if f"handctl {other}" in error["hint"]], (
            error
        )
        if result.code != 3:
            words = [word.strip("(),;") for word in error["text"].split()]
            assert "115200" in error["text"] and any(
                len(w) == 2 and set(w) <= set("0123456789ABCDEF") for w in words
            ), error
        if result.code == 4:
            assert "USB cable" in error["hint"] and "length-mode" in error["hint"]
        assert not (tmp_path / "x.csv").exists(), "a log without a row is not begun"


def test_a_neighbour_that_changed_is_named_with_the_way_back(scratch: Path) -> None:
    error = tried(scratch, "set", "fault=neighbour").result.error
    assert "step_height is 1.76 in, expected 1.75 in" in error["text"] and "status accepted" in error["text"]
    assert "`handctl ekso set step_length=14.75`" in error["hint"]


@pytest.mark.parametrize("name", ["set", "cancel"])
def test_every_status_is_told_in_words(scratch: Path, name: str) -> None:
    """Dossier 2: 1 wrong state, 2 out of range, 3 not allowed; whatever else counts as refused, with its number."""
    for status, words in {
        1: "refused in the present state",
        2: "out of range",
        3: "not allowed",
        9: "unknown (9)",
    }.items():
        cell = tried(scratch, name, "fault=refuse", f"refuse-status={status}")
        assert cell.result.code == 6 and words in command_line(cell.result), cell


@pytest.mark.parametrize("mode", ["n-4", "n-2", "frame"])
def test_faults_with_other_length_bytes(scratch: Path, mode: str) -> None:
    """The convention does not weaken what is noticed."""
    for fault in ("healthy", "bad-checksum", "short-body", "stray-zero", "unsolicited", "wrong-id", "echo"):
        for name in ("data", "time", "set", "cancel"):
            cell = tried(scratch, name, f"fault={fault}", f"length={mode}", words=("--length-mode", mode))
            assert cell.result.code in NO_ANSWER.get(fault, {0}), cell
            assert cell.result.code or "length-convention" in cell.result.codes(), cell


def test_a_recording_survives_every_third_fault(scratch: Path) -> None:
    """Rows are whole or absent, seq has the holes, and lost requests are counted."""
    for fault in (
        "silent",
        "deaf",
        "truncate",
        "bad-checksum",
        "wrong-id",
        "twin-id",
        "late",
        "acknowledge",
        "short-body",
    ):
        for path in scratch.glob("new.csv*"):
            path.unlink()
        cell = tried(scratch, "log", f"fault={fault}", "every=7", words=("--retries", "0"))
        assert cell.result.code == 0, cell
        header, *lines = (scratch / "new.csv").read_text(encoding="utf-8").splitlines()
        assert len(lines) == 3 and {line.count(",") for line in lines} == {header.count(",")}, cell
        lost, seq = cell.rows[0]["lost"], [int(line.split(",")[5]) for line in lines]
        assert (lost, seq) in ((1, [1, 3, 4]), (1, [1, 2, 4]), (0, [1, 2, 3])), (lost, seq, cell)
        assert ("lost" in cell.result.codes()) == bool(lost)
