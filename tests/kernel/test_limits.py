"""Limits that a person sets, and where a stream ends: what they mean, what they name, and that nothing passes unread."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handctl.devices.inspire.exo.register_map import EXO
from handctl.errors import UsageError
from handctl.families import FAMILIES
from handctl.model.reading_limits import Bound, Watchdog, bound_in
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.screen import screen

LINK = "fake://exo?clock=virtual"  # temperatures 31 to 35 °C


def named(name: str) -> list[str]:
    return [element.path for element in EXO.find(name)[1]]


@each_row(("text", "low", "high"), [
    ("temperature=60", None, 60.0), ("temperature.index=-5..60.5", -5.0, 60.5), ("temperature=20..", 20.0, None),
    ("temperature=..60", None, 60.0),
])  # fmt: skip
def test_a_limit_is_a_highest_value_or_a_range(text: str, low: float | None, high: float | None) -> None:
    bound = bound_in(text, named, "--limit")
    assert (bound.low, bound.high, len(bound.paths)) == (low, high, 1 if "." in text.split("=")[0] else 5)


@each_row("text", ["temperature", "temperature=", "temperature=..", "temperature=x", "temperature=nan", "temperature=9..3",
                   "tempe=3", "=3"])  # fmt: skip
def test_what_is_no_limit_is_refused(text: str) -> None:
    with pytest.raises(UsageError) as refused:
        bound_in(text, named, "--limit")
    assert refused.value.hint


def test_the_ends_belong_to_it_and_the_farthest_is_told_with_its_first_moment() -> None:
    dog = Watchdog([Bound("x", frozenset({"x"}), 0.0, 10.0)])
    seen = [
        dog.look([{"name": "x", "path": "x", "value": v, "unit": "mA"}], t) for t, v in enumerate((0, 10, 12, 15, 11))
    ]
    assert seen == [False, False, True, True, True]
    assert dog.findings() == ["x 15 mA (limit: 0 to 10 mA), first after 2.0 s"]


@each_row(("words", "code"), [
    ("status --limit temperature=35", 0), ("status --limit temperature=34", 7), ("get temperature.ring --limit temperature=32", 0),
    ("get temperature --limit temperature.thumb=34.5", 7), ("dump --limit temperature=32..", 7),
    ("watch temperature --count 2 --limit temperature=34", 7), ("watch temperature --count 2 --limit temperature=40", 0),
    ("get error --limit temperature=99", 7), ("status --limit temperature", 2),
])  # fmt: skip
def test_a_limit_decides_the_exit_code(words: str, code: int) -> None:
    done = run("exo", *words.split(), "-p", LINK)
    assert done.code == code, done
    assert code != 7 or "temperature" in done.err


def test_a_limit_that_nothing_was_compared_with_is_told() -> None:
    done = run("exo", "get", "error", "--limit", "temperature=99", "-p", LINK, "--json")
    assert (done.code, done.error["code"]) == (7, "limit-unchecked")


def test_until_ends_a_stream() -> None:
    done = run("exo", "watch", "position_actual.index", "--until", "position_actual.index=..439", "-p", LINK, "--json")
    samples, end = done.stream
    assert (done.code, len(samples), end["messages"][-1]["code"]) == (0, 1, "until")


@pytest.mark.parametrize("family", list(FAMILIES))
def test_every_family_has_limits(family: str) -> None:
    rows = run(family, "status", "-p", f"fake://{family}?clock=virtual", "--json").rows
    row = next(
        row for row in rows if row.get("path") and isinstance(row.get("value"), int | float) and row["value"] > 0
    )
    found = run(
        family,
        "status",
        "--limit",
        f"{row['path']}={row['value'] / 2}",
        "-p",
        f"fake://{family}?clock=virtual",
        "--json",
    )
    assert found.code == 7 and found.error["code"] == "limit", found


def test_a_file_is_written_while_the_view_is_seen(tmp_path) -> None:  # type: ignore[no-untyped-def]
    seen = screen("exo", "watch", "temperature", "--count", "3", "-o", str(tmp_path / "x.csv"), "-p", LINK)
    assert seen.code == 0 and "3 samples" in "\n".join(seen.display)
    assert len((tmp_path / "x.csv").read_text().splitlines()) == 4


@each_row(("family", "words"), [
    ("aidin", "watch joint_pos --limit joint_pos=..1"), ("barrett", "strain --live --limit strain.F2=20"),
    ("barrett", "fingertips --live --limit tip_z=1"), ("barrett", "fingertips --limit joint_inner.F1=..-1"),
    ("hand", "tactile index_tip --watch --limit index_tip=..-1"), ("hand", "tactile --limit palm=..-1"),
])  # fmt: skip
def test_a_family_s_own_reading_commands_have_limits(family: str, words: str) -> None:
    link = f"fake://{family}?clock=virtual" + ("&model=tp" if family == "hand" else "")
    more = ["--count", "2"] if "--live" in words or "watch" in words else []
    done = run(family, *words.split(), *more, "-p", link, "--json")
    assert (done.code, done.said[-1]) == (7, "limit"), done


@pytest.mark.parametrize("family", list(FAMILIES))
def test_a_recording_has_limits_and_an_end(family: str, tmp_path: Path) -> None:
    link = f"fake://{family}?clock=virtual"
    rows, _ = run(family, "watch", "--count", "1", "-p", link, "--json").stream
    path, value = next((row["path"], row["value"]) for row in rows if isinstance(row.get("value"), int | float))
    words = ("--limit", f"{path}={value - 1}", "--until", f"{path}={value - 1}", "--count", "9")
    done = run(family, "log", str(tmp_path / "x.csv"), *words, "-p", link, "--json")
    assert (done.code, done.error["code"], done.rows[0]["rows"]) == (7, "limit", 1), done
    assert json.loads((tmp_path / "x.csv.json").read_text())["complete"]
