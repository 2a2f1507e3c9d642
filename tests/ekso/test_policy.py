"""`handctl ekso policy` is what `set` keeps to; and what `set` says of an audit log that ends in a write without result."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from handctl.devices.ekso.audit_log import TAIL, AuditLog
from tests.ekso.commands import ME, SCALES, unit
from tests.support.cli import Result, run
from tests.support.person import person

STEPS = {
    # dossier 6.3: largest change at once; legs have no override; assist codes count in percent
    "upper_leg_length": (0.5, "in", False), "lower_leg_length": (0.5, "in", False), "step_length": (1.0, "in", True),
    "step_height": (0.5, "in", True), "swing_time": (0.1, "s", True), "stand_time": (0.25, "s", True),
    "knee_flexion": (2.0, "deg", True), "hip_flexion": (2.0, "deg", True), "forward_shift": (0.5, None, True),
    "lateral_shift": (0.5, None, True), "left_swing_assist": (10, "%", True), "right_swing_assist": (10, "%", True),
}  # fmt: skip


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The audit log goes to the test's own directory."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def policy() -> list[dict[str, Any]]:
    result = run("ekso", "policy", "--json")
    assert result.code == 0 and result.json["device"]["link"] is None
    return result.rows


def set_(*args: str, **options: object) -> Result:
    return run("ekso", "set", *args, *ME, "-p", unit(**options), "--json")


def test_the_table_is_that_of_the_dossier() -> None:
    rows = policy()
    assert all(list(row) == ["name", "id", "rule", "value", "unit", "override"] for row in rows)
    steps = {
        row["name"]: (row["value"], row["unit"], row["override"])
        for row in rows
        if row["rule"] == "step" and row["value"]
    }
    assert steps == STEPS
    assert {row["name"]: row["value"] for row in rows if row["rule"] == "posture"} == {
        "*": "sitting, standing",
        **dict.fromkeys(("upper_leg_length", "lower_leg_length", "walk_mode", "injury_mode"), "sitting"),
    }
    assert {row["name"]: row["value"] for row in rows if row["rule"] == "asked_twice"} == {
        "injury_mode": "2Free", "left_swing_assist": "Adapt, Max", "right_swing_assist": "Adapt, Max",
        "left_stance_support": "Flex, Full", "right_stance_support": "Flex, Full",
    }  # fmt: skip
    assert {row["rule"]: (row["value"], row["unit"]) for row in rows if row["name"] == "*"} == {
        "posture": ("sitting, standing", None), "joint_speed_below": (5.0, "deg/s"), "looks_apart": (0.1, "s"),
        "boot_time_within": (50, "ms"), "settings_at_once": (1, None), "between_writes": (1.0, "s"),
        "step_within": (10.0, "s"),
    }  # fmt: skip
    assert {row["name"] for row in rows if row["rule"] == "read_only"} == {"swing_complete", "pilot_id"}
    assert {row["name"] for row in rows} == {"*", *list(SCALES)[:22]}
    assert max(map(len, run("ekso", "policy").lines)) <= 80


@pytest.mark.parametrize(("name", "start"), [("step_length", 14.75), ("step_height", 1.75), ("swing_time", 1.1),
    ("stand_time", 0.65), ("knee_flexion", 12.5), ("hip_flexion", 8.2), ("forward_shift", -1.5), ("lateral_shift", 0.85)])  # fmt: skip
def test_set_keeps_to_the_step(name: str, start: float) -> None:
    """The step itself is taken, a hundredth more is not, in both directions."""
    step = STEPS[name][0]
    for direction in (1, -1):
        assert set_(f"{name}={start + direction * step:.2f}").code == 0
        beyond = set_(f"{name}={start + direction * (step + 0.01):.2f}")
        assert (beyond.code, beyond.error["code"]) == (2, "step-limit")
        assert set_(f"{name}={start + direction * (step + 0.01):.2f}", "--override-step-limit").code == 0


def test_an_unfinished_write_is_told(tmp_path: Path) -> None:
    path = tmp_path / "handctl" / "ekso-audit.jsonl"
    assert set_("step_length=15.0").code == 0
    entries = path.read_text(encoding="utf-8").splitlines(keepends=True)
    path.write_text(entries[0] + json.dumps({"event": "cancel"}) + "\n" + '{"event": "int', encoding="utf-8")
    result = set_("step_length=99")  # refused, and told all the same
    assert result.code == 2
    (message,) = [message for message in result.json["messages"] if message["code"] == "unfinished-write"]
    assert message["level"] == "warning" and "step_length 14.75 -> 15.0" in message["text"] and message["hint"]
    os.utime(path, (1e9, 1e9))  # put together by hand: right after that nothing would be written
    assert "unfinished-write" in set_("step_length=15.0").codes()
    assert "unfinished-write" not in set_("step_length=15.0").codes()


def test_an_unfinished_write_is_told_before_the_next_is_confirmed(tmp_path: Path) -> None:
    path = tmp_path / "handctl" / "ekso-audit.jsonl"
    assert set_("step_length=15.0").code == 0
    path.write_text(path.read_text(encoding="utf-8").splitlines(keepends=True)[0], encoding="utf-8")
    shown = person("ekso", "set", "step_height=2", "-p", unit(), columns=200, answers=["no"])
    before, asked, after = shown.text.partition("Type '2.00' to go on")
    assert (shown.code, bool(asked)) == (8, True), shown.text
    assert "has no result" in before and "has no result" not in after, "told once"


def test_what_the_log_ends_with(tmp_path: Path) -> None:
    path = tmp_path / "log"
    log = AuditLog(path, {})
    assert log.unfinished() is None
    for event, open_ in (
        ("intent", True),
        ("cancel", True),
        ("result", False),
        ("cancel-result", False),
        ("intent", True),
    ):
        log.record(event, 0.0)
        found = log.unfinished()
        assert (found is not None and found["event"] == "intent") == open_, event
    with path.open("a", encoding="utf-8") as file:
        file.write("null\n[1]\nnonsense\n" + "x" * (TAIL // 2))
    assert log.unfinished() is not None


def test_a_log_that_is_no_file_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
        assert AuditLog(path, {}).unfinished() is None
