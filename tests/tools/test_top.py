"""`handctl top`: all named devices, the one that needs a person first, and a silent one that stays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from handctl.model.command_settings import Settings
from handctl.model.reading_limits import Bound
from handctl.model.result import Journal, Row, Sample, Table
from handctl.screen.top_cards import TopCards
from tests.support.cli import Result, run
from tests.support.each_row import each_row

LINKS = {"left": ("exo", ""), "right": ("hand", "&fault=faults"), "gone": ("wrist", "&fault=silent")}


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "config.toml"
    path.write_text(
        "".join(
            f'[devices.{name}]\nkind = "{kind}"\nport = "fake://{kind}?clock=virtual{more}"\n'
            for name, (kind, more) in LINKS.items()
        )
    )
    return path


def top(config: Path, *words: str) -> Result:
    return run("top", "--count", "1", "--rate", "0", *words, "--json", env={"HANDCTL_CONFIG": str(config)})


def test_every_named_device_has_its_rows_and_a_silent_one_its_error(config: Path) -> None:
    samples, end = top(config).stream
    by: dict[str, list[Row]] = {}
    for row in samples:
        by.setdefault(row["device"], []).append(row)
    assert set(by) == set(LINKS) and end["exit_code"] == 0
    assert {"temperature", "position_actual"} <= {row["name"] for row in by["left"]}
    assert "no reply" in by["gone"][0]["error"] and "name" not in by["gone"][0]


@each_row("words", [("left", "right"), ("-d", "left,right")])
def test_names_are_arguments_or_those_of_d(config: Path, words: tuple[str, ...]) -> None:
    assert {row["device"] for row in top(config, *words).stream[0]} == {"left", "right"}


@each_row(
    ("limit", "code"), [("temperature=77", 7), ("temperature=78", 0), ("stroke_actual=2000", 0), ("nothing=1", 2)]
)
def test_a_limit_is_for_the_devices_that_have_the_quantity(config: Path, limit: str, code: int) -> None:
    """Only the hand has a stroke; it is at 78 °C."""
    assert top(config, "left", "right", "--limit", limit).code == code


def test_every_device_past_its_limit_is_named(config: Path) -> None:
    _, end = top(config, "left", "right", "--limit", "temperature=30").stream
    (error,) = [message for message in end["messages"] if message["level"] == "error"]
    assert "left: past the limit" in error["text"] and "right: past the limit" in error["text"].replace(
        "Right", "right"
    )


def test_without_a_name_the_next_step_is_told(tmp_path: Path) -> None:
    (tmp_path / "none.toml").write_text("")
    done = run("top", env={"HANDCTL_CONFIG": str(tmp_path / "none.toml")})
    assert done.code == 2 and "handctl devices add" in done.err


class Context:
    """As much of a running command as the cards need."""

    command, simulated, stop_key = "top", False, ""
    journal, settings = Journal(), Settings()


def cards(*samples: tuple[float, dict[str, Any]]) -> TopCards:
    limit = Bound("temperature", frozenset({"temperature"}), None, 60.0)
    table = Table(bounds=(limit,), flags=frozenset({"error"}))
    view = TopCards(Table(cards={name: lambda: table for name in ("a", "b", "c", "d")}), Context())  # type: ignore[arg-type]
    for t, row in samples:
        view.add(Sample(t, (row,)))
    return view


def reading(device: str, value: int, **more: Any) -> dict[str, Any]:
    return {"device": device, "name": "temperature", "path": "temperature", "value": value, "unit": "°C", **more}


def test_the_worst_card_is_the_first_and_says_what_is_wrong() -> None:
    view = cards(
        (0.0, reading("a", 30)), (0.0, reading("b", 61)), (1.0, {"device": "c", "error": "no reply"}), (4.0, reading("a", 57)),
    )  # fmt: skip
    lines = [line.plain for line in view._body(60, 20)]
    assert lines == [
        "b  temperature 61 °C (limit: at most 60)", "   temperature 61 °C", "c  silent for 3 s: no reply",
        "d  connecting", "a  ok", "   temperature 57 °C",
    ]  # fmt: skip
    assert [line.plain for line in view._body(60, 4)] == [lines[0], lines[2], lines[3], lines[4]]


def test_a_silent_device_that_answers_again_is_well() -> None:
    view = cards((0.0, {"device": "a", "error": "no reply"}), (1.0, reading("a", 30)))
    assert "a  ok" in [line.plain for line in view._body(60, 20)]


def test_tab_shows_one_device_after_the_other_and_then_all() -> None:
    view = cards((0.0, reading("a", 30)), (0.0, reading("b", 40)))
    seen = []
    for _ in range(3):
        view.next()
        seen.append(view._body(60, 20)[0].plain.split()[0])
    assert seen == ["a", "b", "c"]


def test_a_card_is_a_view_of_its_own_where_there_is_room() -> None:
    rows = [reading("a", 30, finger=part) | {"name": name} for name in ("force", "current") for part in ("x", "y")]
    view = cards((0.0, {"device": "c", "error": "no reply"}))
    view.add(Sample(0.0, tuple(rows)))
    low, high = ([line.plain for line in view._body(60, height)] for height in (10, 30))
    assert any("force 30" in line for line in low) and not any(line.startswith("x ") for line in low)
    assert any(line.split()[:3] == ["x", "30", "30"] for line in high), high
    assert all(len(view._body(60, height)) <= height for height in range(8, 50))


def test_csv_has_one_column_of_errors(config: Path) -> None:
    done = run("top", "--count", "1", "--rate", "0", "--csv", env={"HANDCTL_CONFIG": str(config)})
    lines = done.out.splitlines()
    assert lines[0].split(",").count("error") == 1 and len({line.count(",") for line in lines if '"' not in line}) == 1
