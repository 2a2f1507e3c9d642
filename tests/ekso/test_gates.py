"""The table of the gates before a setting is written: each row refuses through the command line, in its order, and is drawn."""

from __future__ import annotations

import ast
import errno
import importlib
import os
from pathlib import Path
from typing import Any

import pytest

from handctl.devices.ekso import change, gates, settings
from handctl.devices.ekso.audit import WINDOW, AuditLog
from handctl.devices.ekso.map import DRIVEN, SETTINGS
from handctl.frame import console
from handctl.model.clocks import WITHIN_MS
from tests.ekso.commands import ME
from tests.support.cli import Result, run, sent
from tests.support.each_row import each_row

SET = 155
STEP = ("step_length=16", *ME)
REFUSED: dict[str, tuple[tuple[str, ...], str, str]] = {
    # gate -> (arguments of `set`, fault or posture of the unit, a piece of the text)
    gates.UNKNOWN: (("220=1", *ME), "", "no ParameterID 220"),
    gates.READ_ONLY: (("swing_complete=1", *ME), "", "no ParameterID (ekso §6"),
    gates.NUMBER: (("step_length=long", *ME), "", "is not a number"),
    gates.AMBIGUOUS: (("216=50", *ME), "", "percent or a code"),
    gates.EXACT: (("swing_time=0.295", *ME), "", "does not round"),
    gates.RANGE: (("forward_shift=327.68", *ME), "", "forward_shift"),
    gates.ONE: (("step_length=16", "step_height=2.1", *ME), "", "2 settings at once"),
    gates.OPERATOR: (("step_length=16", "--yes"), "", "--operator NAME"),
    gates.TERMINAL: (("step_length=16",), "", "not an interactive terminal"),
    gates.LOG: ((*STEP, "--audit", "/dev/full"), "", "audit log cannot be written"),
    gates.STEP: (("step_length=17", *ME), "", "policy (not the device's limit)"),
    gates.STILL: (STEP, "fault=frozen-clock", "not written"),
    gates.SAME: (STEP, "fault=pendant", "settings changed in the meantime"),
    gates.STATUS: (STEP, "fault=refuse", "(status 0x"),
    gates.READ_BACK: (STEP, "fault=not-taken", "the read-back differs"),
    gates.POSTURE: (STEP, "posture=walking", "neither sitting nor standing"),
    gates.SEATED: (("walk_mode=First Step", *ME), "", "only while sitting"),
    gates.FRESH: (STEP, "fault=frozen-clock", "not fresh"),
    gates.SPEED: (("step_length=14", *ME), "fault=fidget&preset=clinic", "deg/s"),
}
ELSEWHERE = {
    # what needs a log of its own, a wait or a device in a rare state: gate -> the test that reaches it
    gates.LISTED: "test_cli.test_a_snapshot_with_a_code_that_nobody_knows_can_be_restored_around_it",
    gates.RESTARTED: "test_settings.test_a_restart_between_the_looks_ends_it",
    gates.CLOCK: "test_memory.test_the_clock_of_another_machine_is_not_ours",
    gates.WAITED: "test_memory.test_somebody_else_who_writes_all_the_time_ends_the_waits",
    gates.EDITED: "test_audit.test_a_set_warns_of_an_edited_log_and_refuses_while_it_is_fresh",
    gates.INTENT: "test_gates.test_an_entry_that_does_not_reach_the_disk",
    gates.RESULT: "test_gates.test_an_entry_that_does_not_reach_the_disk",
    gates.DRIVEN: "test_settings.test_postures",
    gates.REBOOT: "test_settings.test_boot_time_must_run_with_the_host",
    gates.CONFIRMED: "test_gates.test_the_questions",
    gates.TWICE: "test_gates.test_the_questions",
    gates.FREE: "test_gates.test_another_writer_is_not_waited_for",
    gates.DAMAGED: "test_gates.test_a_damaged_log",
    gates.PACE: "test_gates.test_the_pace_holds_over_runs",
}


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The audit log goes to the test's own directory."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def set_(*args: str, unit: str = "", **more: Any) -> Result:
    preset = "" if "preset=" in unit else "&preset=vectors"
    return run("ekso", "set", *args, "-p", f"fake://ekso?clock=virtual{preset}&{unit}".rstrip("&"), "--json", **more)


def refused_by(result: Result, name: str) -> bool:
    gate = gates.GATES[name]
    code = gate.code.format(1)
    return (result.code, result.error["code"]) == (gate.error.exit_code, code)


@each_row("name", REFUSED)
def test_each_gate_refuses(name: str, tmp_path: Path) -> None:
    args, unit, text = REFUSED[name]
    trace = tmp_path / "t.txt"
    result = set_(*args, "--trace", str(trace), unit=unit)
    assert refused_by(result, name), result
    assert text in result.error["text"]
    written = [data for data in sent(trace) if data[0] == SET] if trace.exists() else []
    assert len(written) == (gates.GATES[name].moment == gates.SENT)


def test_every_row_is_reached() -> None:
    assert set(gates.GATES) == set(REFUSED) | set(ELSEWHERE) and not set(REFUSED) & set(ELSEWHERE)
    for place in ELSEWHERE.values():
        module, _, test = place.partition(".")
        assert f"def {test}(" in (Path(__file__).parent / f"{module}.py").read_text(encoding="utf-8"), place


@pytest.mark.parametrize(
    ("setting", "typed", "name"),
    [("step_length=16", "yes\n", gates.CONFIRMED), ("right_stance_support=Full", "Full\nno\n", gates.TWICE)],
)
def test_the_questions(setting: str, typed: str, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(console, "is_terminal", lambda _stream: True)
    assert refused_by(set_(setting, stdin=typed), name)


def test_another_writer_is_not_waited_for(tmp_path: Path) -> None:
    path = tmp_path / "log"
    with AuditLog(path, {}).alone():
        assert refused_by(set_(*STEP, "--audit", str(path)), gates.FREE)


def test_a_damaged_log(tmp_path: Path) -> None:
    path = tmp_path / "log"
    path.write_text("garbage\n", encoding="utf-8")
    assert refused_by(set_(*STEP, "--audit", str(path)), gates.DAMAGED)
    os.utime(path, (1e9, 1e9))
    assert set_(*STEP, "--audit", str(path)).code == 0


@pytest.mark.parametrize(
    ("name", "entry"), [(gates.INTENT, 1), (gates.INTENT, 2), (gates.RESULT, 3), (gates.RESULT, 4)]
)
def test_an_entry_that_does_not_reach_the_disk(
    name: str, entry: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither in the log that was named nor in the user's own."""
    path, trace = tmp_path / "log", tmp_path / "t.txt"
    path.touch()
    (tmp_path / "handctl").mkdir()
    (tmp_path / "handctl" / "ekso-audit.jsonl").touch()
    calls: list[int] = []

    def full(file: int) -> None:
        calls.append(file)
        if len(calls) == entry:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("handctl.devices.ekso.audit.os.fsync", full)
    result = set_(*STEP, "--audit", str(path), "--trace", str(trace))
    assert refused_by(result, name), result
    assert [data[0] for data in sent(trace)].count(SET) == (name == gates.RESULT)
    assert ("Only its audit log entry is missing" in result.error["text"]) == (name == gates.RESULT)


def test_the_pace_holds_over_runs(tmp_path: Path) -> None:
    unit = f"state={tmp_path / 'state'}"
    assert set_("step_length=16.5", *ME, unit=unit).code == 0
    assert refused_by(set_("step_length=17", *ME, unit=unit), gates.PACE)
    assert set_("step_length=17", *ME, gates.OVERRIDE, unit=unit).code == 0, "its option lifts it"


def test_what_is_wrong_first_by_the_table_is_refused_first() -> None:
    """Everything wrong at once; what was refused is mended, and the next row refuses."""
    bad = "fault=pendant"
    both = "posture=walking&" + bad
    full = ("--audit", "/dev/full")
    ladder = {
        gates.UNKNOWN: (("220=1", "pilot_id=1", "step_length=x", "--yes", *full), both),
        gates.READ_ONLY: (("pilot_id=1", "step_length=x", "--yes", *full), both),
        gates.NUMBER: (("step_length=x", "step_height=9", "--yes", *full), both),
        gates.ONE: (("step_length=17", "step_height=9", "--yes", *full), both),
        gates.OPERATOR: (("step_length=17", "--yes", *full), both),
        gates.LOG: (("step_length=17", *ME, *full), both),
        gates.STEP: (("step_length=17", *ME), both),
        gates.STILL: (STEP, both),
        gates.SAME: (STEP, bad),
    }
    order = [gate.name for gate in gates.TABLE if gate.name in ladder]
    assert list(dict.fromkeys(order)) == list(ladder)
    for name, (args, unit) in ladder.items():
        assert refused_by(set_(*args, unit=unit), name), name


def test_no_refusal_has_a_code_beside_the_table() -> None:
    """The writer, its memory, its looks and its verdict raise what the table holds; each row is one that somebody raises."""
    named: set[str] = set()
    for name in ("settings", "change", "audit", "map"):
        source = Path(str(importlib.import_module(f"handctl.devices.ekso.{name}").__file__)).read_text(encoding="utf-8")
        nodes = list(ast.walk(ast.parse(source)))
        codes = [word for node in nodes if isinstance(node, ast.Call) for word in node.keywords if word.arg == "code"]
        assert not codes, name
        named |= {getattr(gates, node.attr) for node in nodes if isinstance(node, ast.Attribute) and node.attr.isupper() and hasattr(gates, node.attr)}  # fmt: skip
    asked_by_the_commands = {gates.ONE, gates.OPERATOR, gates.TERMINAL, gates.CONFIRMED, gates.TWICE}
    assert named - set(gates.MOMENTS) == set(gates.GATES) - asked_by_the_commands


def test_a_gate_that_is_asked_twice_is_one_gate() -> None:
    for gate in gates.TABLE:
        assert gate._replace(moment="") == gates.GATES[gate.name]._replace(moment=""), gate.name
    assert gates.at(gates.READ) == (gates.LOG, gates.LISTED, gates.STEP, gates.STILL, gates.RESTARTED)
    assert gates.at(gates.ALONE) == (gates.SAME, gates.STILL, gates.RESTARTED, gates.INTENT)
    assert gates.at(gates.LOOK) + gates.at(gates.LOOKS) == tuple(change.STILL)
    looks = [gates.GATES[name] for name in gates.at(gates.LOOK) + gates.at(gates.LOOKS)]
    assert {(gate.error, gate.code) for gate in looks} == {gates.GATES[gates.STILL][4:6]}


def test_the_numbers_in_the_words_are_those_of_the_policy() -> None:
    words = {name: f"{gate.looked_at} {gate.refused}" for name, gate in gates.GATES.items()}
    for name, number in (
        (gates.STILL, f"{change.APART} s"), (gates.FRESH, f"{WITHIN_MS} ms"),
        (gates.SPEED, f"{change.MOST_SPEED:.0f} deg/s"), (gates.PACE, f"{WINDOW:.0f} s"), (gates.WAITED, f"{3 * WINDOW:.0f} s"),
        (gates.EDITED, f"{WINDOW:.0f} s"), (gates.DAMAGED, f"{WINDOW:.0f} s"), (gates.READ_BACK, f"{len(SETTINGS)} settings"),
        (gates.DRIVEN, f"0x{DRIVEN:04X}"),
    ):  # fmt: skip
        assert number in words[name], name
    assert settings.BETWEEN_WRITES < WINDOW


def test_the_page_shows_every_line() -> None:
    _, _, items = gates.section()
    shown = [(moment, line) for moment, _, lines in items for line in lines]
    assert len(shown) == len(gates.TABLE)
    for gate, (moment, line) in zip(gates.TABLE, shown, strict=True):
        assert moment == gate.moment and line.startswith(gate.name) and f" {gate.error.exit_code} " in line
        assert (gate.option in line) and gate.code.format("N") in line
    assert {name for name, _, _ in items} == set(gates.MOMENTS) | set(gates.GATES)
