"""The table of the gates before a setting is written: each row refuses through the command line, in its order, and is drawn."""

from __future__ import annotations

import ast
import errno
import importlib
import os
from pathlib import Path
from typing import Any

import pytest

from handctl.command import terminal_prompts
from handctl.devices.ekso import stillness, write_checks, write_policy
from handctl.devices.ekso.audit_log import AuditLog
from handctl.devices.ekso.parameter_map import DRIVEN, SETTINGS
from handctl.model.device_clock import WITHIN_MS, Span
from tests.ekso.commands import ME
from tests.support.cli import Result, run, sent
from tests.support.each_row import each_row

SET = 155
STEP = ("step_length=16", *ME)
REFUSED: dict[str, tuple[tuple[str, ...], str, str]] = {
    # gate -> (arguments of `set`, fault or posture of the unit, a piece of the text)
    write_checks.UNKNOWN: (("220=1", *ME), "", "no ParameterID 220"),
    write_checks.READ_ONLY: (("swing_complete=1", *ME), "", "no ParameterID (ekso §6"),
    write_checks.NUMBER: (("step_length=long", *ME), "", "is not a number"),
    write_checks.AMBIGUOUS: (("216=50", *ME), "", "percent or a code"),
    write_checks.EXACT: (("swing_time=0.295", *ME), "", "does not round"),
    write_checks.RANGE: (("forward_shift=327.68", *ME), "", "forward_shift"),
    write_checks.ONE: (("step_length=16", "step_height=2.1", *ME), "", "2 settings at once"),
    write_checks.OPERATOR: (("step_length=16", "--yes"), "", "--operator NAME"),
    write_checks.TERMINAL: (("step_length=16",), "", "not an interactive terminal"),
    write_checks.LOG: ((*STEP, "--audit", "/dev/full"), "", "audit log cannot be written"),
    write_checks.STEP: (("step_length=17", *ME), "", "policy (not the device's limit)"),
    write_checks.STILL: (STEP, "fault=frozen-clock", "not written"),
    write_checks.SAME: (STEP, "fault=pendant", "settings changed in the meantime"),
    write_checks.STATUS: (STEP, "fault=refuse", "(status 0x"),
    write_checks.READ_BACK: (STEP, "fault=not-taken", "the read-back differs"),
    write_checks.POSTURE: (STEP, "posture=walking", "neither sitting nor standing"),
    write_checks.SEATED: (("walk_mode=First Step", *ME), "", "only while sitting"),
    write_checks.FRESH: (STEP, "fault=frozen-clock", "not fresh"),
    write_checks.SPEED: (("step_length=14", *ME), "fault=fidget&preset=clinic", "deg/s"),
}
ELSEWHERE = {
    # what needs a log of its own, a wait or a device in a rare state: gate -> the test that reaches it
    write_checks.LISTED: "test_cli.test_a_snapshot_with_a_code_that_nobody_knows_can_be_restored_around_it",
    write_checks.RESTARTED: "test_settings.test_a_restart_between_the_looks_ends_it",
    write_checks.CLOCK: "test_memory.test_the_clock_of_another_machine_is_not_ours",
    write_checks.WAITED: "test_memory.test_somebody_else_who_writes_all_the_time_ends_the_waits",
    write_checks.EDITED: "test_audit.test_a_set_warns_of_an_edited_log_and_refuses_while_it_is_fresh",
    write_checks.INTENT: "test_write_checks.test_an_entry_that_does_not_reach_the_disk",
    write_checks.RESULT: "test_write_checks.test_an_entry_that_does_not_reach_the_disk",
    write_checks.DRIVEN: "test_settings.test_postures",
    write_checks.REBOOT: "test_settings.test_boot_time_must_run_with_the_host",
    write_checks.CONFIRMED: "test_write_checks.test_the_questions",
    write_checks.TWICE: "test_write_checks.test_the_questions",
    write_checks.FREE: "test_write_checks.test_another_writer_is_not_waited_for",
    write_checks.DAMAGED: "test_write_checks.test_a_damaged_log",
    write_checks.PACE: "test_write_checks.test_the_pace_holds_over_runs",
}


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The audit log goes to the test's own directory."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def set_(*args: str, unit: str = "", **more: Any) -> Result:
    preset = "" if "preset=" in unit else "&preset=vectors"
    return run("ekso", "set", *args, "-p", f"fake://ekso?clock=virtual{preset}&{unit}".rstrip("&"), "--json", **more)


def refused_by(result: Result, name: str) -> bool:
    gate = write_checks.GATES[name]
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
    assert len(written) == (write_checks.GATES[name].moment == write_checks.SENT)


def test_every_row_is_reached() -> None:
    assert set(write_checks.GATES) == set(REFUSED) | set(ELSEWHERE) and not set(REFUSED) & set(ELSEWHERE)
    for place in ELSEWHERE.values():
        module, _, test = place.partition(".")
        assert f"def {test}(" in (Path(__file__).parent / f"{module}.py").read_text(encoding="utf-8"), place


@pytest.mark.parametrize(
    ("setting", "typed", "name"),
    [
        ("step_length=16", "yes\n", write_checks.CONFIRMED),
        ("right_stance_support=Full", "Full\nno\n", write_checks.TWICE),
    ],
)
def test_the_questions(setting: str, typed: str, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(terminal_prompts, "is_terminal", lambda _stream: True)
    assert refused_by(set_(setting, stdin=typed), name)


def test_another_writer_is_not_waited_for(tmp_path: Path) -> None:
    path = tmp_path / "log"
    with AuditLog(path, {}).alone():
        assert refused_by(set_(*STEP, "--audit", str(path)), write_checks.FREE)


def test_a_damaged_log(tmp_path: Path) -> None:
    path = tmp_path / "log"
    path.write_text("garbage\n", encoding="utf-8")
    assert refused_by(set_(*STEP, "--audit", str(path)), write_checks.DAMAGED)
    os.utime(path, (1e9, 1e9))
    assert set_(*STEP, "--audit", str(path)).code == 0


@pytest.mark.parametrize(
    ("name", "entry"),
    [(write_checks.INTENT, 1), (write_checks.INTENT, 2), (write_checks.RESULT, 3), (write_checks.RESULT, 4)],
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

    monkeypatch.setattr("handctl.devices.ekso.audit_log.os.fsync", full)
    result = set_(*STEP, "--audit", str(path), "--trace", str(trace))
    assert refused_by(result, name), result
    assert [data[0] for data in sent(trace)].count(SET) == (name == write_checks.RESULT)
    assert ("Only its audit log entry is missing" in result.error["text"]) == (name == write_checks.RESULT)


def test_the_pace_holds_over_runs(tmp_path: Path) -> None:
    unit = f"state={tmp_path / 'state'}"
    assert set_("step_length=16.5", *ME, unit=unit).code == 0
    assert refused_by(set_("step_length=17", *ME, unit=unit), write_checks.PACE)
    assert set_("step_length=17", *ME, write_checks.OVERRIDE, unit=unit).code == 0, "its option lifts it"


def test_what_is_wrong_first_by_the_table_is_refused_first() -> None:
    """Everything wrong at once; what was refused is mended, and the next row refuses."""
    bad = "fault=pendant"
    both = "posture=walking&" + bad
    full = ("--audit", "/dev/full")
    ladder = {
        write_checks.UNKNOWN: (("220=1", "pilot_id=1", "step_length=x", "--yes", *full), both),
        write_checks.READ_ONLY: (("pilot_id=1", "step_length=x", "--yes", *full), both),
        write_checks.NUMBER: (("step_length=x", "step_height=9", "--yes", *full), both),
        write_checks.ONE: (("step_length=17", "step_height=9", "--yes", *full), both),
        write_checks.OPERATOR: (("step_length=17", "--yes", *full), both),
        write_checks.LOG: (("step_length=17", *ME, *full), both),
        write_checks.STEP: (("step_length=17", *ME), both),
        write_checks.STILL: (STEP, both),
        write_checks.SAME: (STEP, bad),
    }
    order = [gate.name for gate in write_checks.TABLE if gate.name in ladder]
    assert list(dict.fromkeys(order)) == list(ladder)
    for name, (args, unit) in ladder.items():
        assert refused_by(set_(*args, unit=unit), name), name


def test_no_refusal_has_a_code_beside_the_table() -> None:
    """The writer, its memory, its looks and its verdict raise what the table holds; each row is one that somebody raises."""
    named: set[str] = set()
    for name in ("setting_writer", "setting_change", "stillness", "audit_log", "parameter_map"):
        source = Path(str(importlib.import_module(f"handctl.devices.ekso.{name}").__file__)).read_text(encoding="utf-8")
        nodes = list(ast.walk(ast.parse(source)))
        codes = [word for node in nodes if isinstance(node, ast.Call) for word in node.keywords if word.arg == "code"]
        assert not codes, name
        named |= {getattr(write_checks, node.attr) for node in nodes if isinstance(node, ast.Attribute) and node.attr.isupper() and hasattr(write_checks, node.attr)}  # fmt: skip
    asked_by_the_commands = {
        write_checks.ONE,
        write_checks.OPERATOR,
        write_checks.TERMINAL,
        write_checks.CONFIRMED,
        write_checks.TWICE,
    }
    assert named - set(write_checks.MOMENTS) == set(write_checks.GATES) - asked_by_the_commands


def test_a_gate_that_is_asked_twice_is_one_gate() -> None:
    for gate in write_checks.TABLE:
        assert gate._replace(moment="") == write_checks.GATES[gate.name]._replace(moment=""), gate.name
    assert write_checks.at(write_checks.READ) == (
        write_checks.LOG,
        write_checks.LISTED,
        write_checks.STEP,
        write_checks.STILL,
        write_checks.RESTARTED,
    )
    assert write_checks.at(write_checks.ALONE) == (
        write_checks.SAME,
        write_checks.STILL,
        write_checks.RESTARTED,
        write_checks.INTENT,
    )
    assert write_checks.at(write_checks.LOOK) == tuple(stillness._look(0, ()))
    assert write_checks.at(write_checks.LOOKS) == tuple(stillness._between([0] * 27, [0] * 27, Span(0, 0)))
    looks = [
        write_checks.GATES[name] for name in write_checks.at(write_checks.LOOK) + write_checks.at(write_checks.LOOKS)
    ]
    assert {(gate.error, gate.code) for gate in looks} == {write_checks.GATES[write_checks.STILL][4:6]}


def test_the_numbers_in_the_words_are_those_of_the_policy() -> None:
    words = {name: f"{gate.looked_at} {gate.refused}" for name, gate in write_checks.GATES.items()}
    for name, number in (
        (write_checks.STILL, f"{write_policy.READS_APART} s"), (write_checks.FRESH, f"{WITHIN_MS} ms"),
        (write_checks.SPEED, f"{write_policy.MOST_SPEED:.0f} deg/s"), (write_checks.PACE, f"{write_policy.STEP_SECONDS:.0f} s"), (write_checks.WAITED, f"{3 * write_policy.STEP_SECONDS:.0f} s"),
        (write_checks.EDITED, f"{write_policy.STEP_SECONDS:.0f} s"), (write_checks.DAMAGED, f"{write_policy.STEP_SECONDS:.0f} s"), (write_checks.READ_BACK, f"{len(SETTINGS)} settings"),
        (write_checks.DRIVEN, f"0x{DRIVEN:04X}"),
    ):  # fmt: skip
        assert number in words[name], name
    assert write_policy.BETWEEN_WRITES < write_policy.STEP_SECONDS


def test_the_page_shows_every_line() -> None:
    _, _, items = write_checks.section()
    shown = [(moment, line) for moment, _, lines in items for line in lines]
    assert len(shown) == len(write_checks.TABLE)
    for gate, (moment, line) in zip(write_checks.TABLE, shown, strict=True):
        assert moment == gate.moment and line.startswith(gate.name) and f" {gate.error.exit_code} " in line
        assert (gate.option in line) and gate.code.format("N") in line
    assert {name for name, _, _ in items} == set(write_checks.MOMENTS) | set(write_checks.GATES)
