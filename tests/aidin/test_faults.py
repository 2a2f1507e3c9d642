"""What `handctl aidin` does at single faults of the simulator: every fault in every command is `tests/search/faults.py`."""

from __future__ import annotations

import pytest

from handctl.devices.aidin import stopper
from tests.contract.facts.outcomes.aidin import ROWS
from tests.support.cli import run, spying
from tests.support.each_row import each_row

ARGS = {row.name: (*row.args, *(["--yes"] if row.asks else [])) for row in ROWS}


def fake(**options: object) -> str:
    made = {
        "clock": "virtual",
        "seed": 1,
        "rate": 12,
        "start": "homed",
        **options,
    }  # a slower stream costs the suite less
    return "fake://aidin?" + "&".join(f"{key}={value}" for key, value in made.items())


@pytest.mark.parametrize("name", ["home", "stop", "max-torque"])
def test_a_hand_that_only_answers_commands_is_the_users_word(name: str) -> None:
    result = run("aidin", *ARGS[name], "--exchange", "command", "-p", fake(exchange="command"))
    assert result.code == 0, result


@each_row(("after", "fault"), [(after, fault) for after in (3, 33, 45) for fault in ("silent", "deaf")])
def test_an_initial_position_is_not_confirmed_by_what_came_before_the_hand_fell_silent(after: int, fault: str) -> None:
    """After 33 and 45 objects the motors are near 0: a reading of then shows neither that they stand nor where."""
    link = fake(exchange="command", fault=fault, after=after)
    result = run("aidin", *ARGS["initial"], "--exchange", "command", "--assume-homed", "-p", link, "--json")
    assert (result.code, [step["state"] for step in result.json["writes"]]) == (4, ["sent"]), result


def test_the_rest_of_a_damaged_answer_is_there() -> None:
    result = run("aidin", "status", "-p", fake(fault="wrong-length"), "--json")
    wrong = {row["key"] for row in result.rows if "error" in row}
    assert result.code == 5 and wrong == {"motor_pos", "task_space_pos"} and len(result.rows) == 95
    assert all(row["value"] is not None for row in result.rows if row["key"] not in wrong)
    assert "homed-unknown" not in result.codes(), "encoders that could not be read are not 0"


@each_row("fault", ["healthy", "silent", "dribble", "noise", "truncate", "unclosed"])
def test_deadline_bounds_homing_and_no_stop(fault: str) -> None:
    """Homing is not begun when it cannot end; `stop` goes on until the hand tells that no current flows, or gives up by itself."""
    for name, limit, codes in (
        ("home", 0.6, (2,)),
        ("stop", (stopper.TIMES + stopper.CONFIRM) * stopper.PERIOD, (0, 4, 5)),
    ):
        with spying() as spy:
            result = run("aidin", *ARGS[name], "-p", fake(fault=fault), "--deadline", "0.4", "--json")
        assert result.code in codes and (not spy.lines or spy.now <= limit + 0.001), (name, spy.now, result)
