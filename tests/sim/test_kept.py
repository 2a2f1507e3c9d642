"""Plain --fake: what was done to a simulated device is kept until log-out, and `watch` shows it in use."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from handctl.families import FAMILIES
from handctl.link import device_lock
from tests.support.cli import Result, clean_environment, run, start, wait_until
from tests.support.virtual import virtual_time

WRITES = {  # a change that needs no homing, and where it is read
    "exo": (("set", "position_set.index=300"), ("get", "position_set.index"), "300"),
    "wrist": (("move", "--pitch", "-10", "--time", "50"), ("get", "pitch_actual"), "-10.0"),
    "hand": (("set", "speed_set.index=300", "-y"), ("get", "speed_set.index"), "300"),
    "barrett": (("set", "MCV=80", "--motors", "1"), ("get", "MCV.F1"), "80"),
    "ekso": (("set", "step_length=15.50", "--operator", "test"), ("get", "step_length"), "15.5"),
    "aidin": (("bias",), ("get", "sensor_state.index.fx"), "0.0"),
}


@pytest.fixture(autouse=True)
def time_jumps(request: pytest.FixtureRequest) -> Iterator[None]:
    """--fake lives by the machine's clock: here nobody waits for it."""
    with nullcontext() if request.node.get_closest_marker("real") else virtual_time():
        yield


def folder() -> Path:
    """Where this test's devices are kept."""
    return Path(os.environ["XDG_RUNTIME_DIR"]) / "handctl"


def kept(name: str = "exo") -> bytes | None:
    """The state file of a device."""
    path = folder() / f"sim-{name}.json"
    return path.read_bytes() if path.exists() else None


def get(family: str, *words: str) -> str:
    """A value of the simulated device of --fake."""
    result = run(family, *words, "--fake", "--format", "plain")
    assert result.code == 0, result
    return result.out.split()[-1]


def written(family: str) -> Result:
    """What changes the simulated device of --fake."""
    return run(family, *WRITES[family][0], "--fake", "--yes")


@pytest.mark.parametrize("family", WRITES)
def test_a_command_finds_what_the_one_before_left(family: str) -> None:
    _, read, value = WRITES[family]
    before = get(family, *read)
    assert before != value and kept(family) is None
    first = written(family)
    assert first.code == 0, first
    assert f"`handctl sim forget {family}`" in first.err
    second = run(family, *read, "--fake", "--json")
    assert second.codes() == ["kept"]
    assert second.json["device"]["link"] == f"fake://{family}"
    assert get(family, *read) == value
    fresh = run(family, *read, "-p", f"fake://{family}", "--json", "--format", "json")
    assert fresh.codes() == [] and str(fresh.rows[0]["value"]) == before


def test_a_barretthand_that_was_initialized_closes() -> None:
    assert run("barrett", "close", "--fake").code == 6
    assert run("barrett", "init", "--fake").code == 0
    closed = run("barrett", "close", "--fake", "--json")
    assert closed.code == 0, closed
    assert get("barrett", "get", "P.F1") == "17000"


def test_an_aidin_hand_that_was_homed_moves() -> None:
    assert run("aidin", "home", "--fake", "--yes").code == 7  # homed, and nothing shows it
    moved = run("aidin", "joints", "index.q3=160", "thumb.q1=10", "--fake", "--yes")
    assert moved.code == 0, moved
    assert round(float(get("aidin", "get", "joint_pos.index.q3")), 1) == 160.0


def test_a_movement_under_way_has_ended() -> None:
    assert run("exo", "set", "position_set.index=1000", "--fake", "--yes").code == 0
    assert get("exo", "get", "position_actual.index") == "1000"


def test_the_environment_says_fake_as_well() -> None:
    assert run("exo", "set", "position_set.index=300", "--yes", env={"HANDCTL_FAKE": "1"}).code == 0
    assert get("exo", "get", "position_set.index") == "300"


def test_who_reads_plans_or_names_a_link_keeps_nothing() -> None:
    for words in (
        ("exo", "dump", "--fake"),
        ("exo", "status", "--fake"),
        ("exo", "set", "position_set.index=300", "--fake", "-n"),
        ("exo", "watch", "--count", "2", "--rate", "0", "--fake"),
        ("exo", "set", "position_set.index=300", "-p", "fake://exo", "--yes"),
        ("wrist", "status", "--fake", "--can"),
    ):
        assert run(*words).code == 0
        assert not folder().exists() or [one.name for one in folder().iterdir()] == []


def test_each_wire_is_kept_by_itself() -> None:
    assert run("wrist", "move", "--pitch", "-10", "--time", "50", "--fake", "--can", "--yes").code == 0
    assert kept("wrist-can") is not None and kept("wrist") is None
    assert run("sim", "forget", "wrist").code == 0
    assert kept("wrist-can") is None


@pytest.mark.parametrize("family", FAMILIES)
def test_watch_shows_it_in_use_and_changes_nothing(family: str) -> None:
    assert written(family).code == 0
    before = kept(family)
    moving = run(family, "watch", "--count", "7", "--rate", "10", "--fake", "--json")
    assert moving.code == 0, moving
    rows, _ = moving.stream
    seen: dict[str, set[object]] = {}
    for row in rows:
        seen.setdefault("/".join(str(row.get(key)) for key in ("name", "finger", "motor", "element")), set()).add(
            row["value"]
        )
    assert sum(len(values) > 2 for values in seen.values()) >= 2, seen
    assert not any(row.get("error") for row in rows)
    assert kept(family) == before


def test_a_report_shows_it_in_use_and_changes_nothing(tmp_path: Path) -> None:
    assert run("exo", "set", "position_set.index=300", "--fake", "--yes").code == 0
    before = kept()
    page = tmp_path / "report.html"
    assert run("exo", "report", str(page), "--watch", "0.5", "--fake").code == 0
    assert "<polyline" in page.read_text(encoding="utf-8") or "<path" in page.read_text(encoding="utf-8")
    assert kept() == before


@pytest.mark.parametrize("family", FAMILIES)
def test_use_is_the_same_each_time(family: str) -> None:
    words = (family, "watch", "--count", "40", "--rate", "4", "-p", f"fake://{family}?use=on&clock=virtual", "--csv")
    first = run(*words)
    assert first.code == 0, first
    assert run(*words).out == first.out


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"\xff\xfe",
        b"[]",
        b'{"format": "handctl-sim/2", "kind": "exo"}',
        b'{"format": "handctl-sim/1", "kind": "wrist"}',
        b'{"format": "handctl-sim/1", "kind": "exo", "ram": 5}',
        b"[" * 100000,
    ],
)
def test_a_damaged_or_foreign_file_begins_afresh_and_says_so(content: bytes) -> None:
    folder().mkdir(0o700)
    (folder() / "sim-exo.json").write_bytes(content)
    read = run("exo", "get", "position_set.index", "--fake")
    assert read.code == 0 and "454" in read.out
    assert "`handctl sim forget exo` removes" in read.err
    assert kept() == content
    changed = run("exo", "set", "position_set.index=300", "--fake", "--yes")
    assert changed.code == 0 and "simulated exo" in changed.err
    assert get("exo", "get", "position_set.index") == "300"


SPOILED: tuple[Any, ...] = (None, "x", -1, 1e308, [], {}, [None] * 5, [1e308] * 15)


@pytest.mark.parametrize("family", WRITES)
def test_no_part_of_a_file_makes_a_traceback(family: str) -> None:
    """Here each fourth spoiled file; the suite `kept` of `tests/search` takes all."""
    spoiled(family, 4)


def spoiled(family: str, each: int) -> None:
    """Each value of the file in turn is of another type, or too large, or missing."""
    assert written(family).code == 0
    whole = json.loads(kept(family) or b"")
    for number, key in enumerate(whole):
        for other in SPOILED[number % each :: each]:
            state = {**whole, key: other}
            (folder() / f"sim-{family}.json").write_text(json.dumps(state), encoding="utf-8")
            result = run(family, "get", *WRITES[family][1][1:], "--fake")
            assert result.code in (0, 4), (key, other, result)
            assert "Traceback" not in result.err


def test_forget_may_be_said_twice() -> None:
    assert run("exo", "set", "position_set.index=300", "--fake", "--yes").code == 0
    (folder() / "sim-exo.json.4711.tmp").write_text("{")  # what a killed command leaves
    assert run("sim", "forget", "exo").code == 0
    assert list(folder().glob("sim-*")) == []
    again = run("sim", "forget")
    assert again.code == 0
    assert again.lines == [f"{family}: nothing to reset" for family in FAMILIES]
    assert get("exo", "get", "position_set.index") == "454"


def test_one_command_at_a_time_acts_on_it() -> None:
    held = device_lock.hold("fake://exo", "handctl exo set", family="exo", use="writes", kept=True)
    assert held is not None
    try:
        second = run("exo", "set", "position_set.index=300", "--fake", "--yes", "--json")
        assert second.code == 3 and second.error["code"] == "busy"
        assert "`handctl exo stop --fake`" in second.error["hint"]
        assert run("exo", "dump", "--fake").code == 0
    finally:
        held.release()
    assert run("exo", "set", "position_set.index=300", "--fake", "--yes").code == 0


@pytest.mark.real
def test_a_killed_command_leaves_a_whole_file() -> None:
    assert run("aidin", "bias", "--fake", "--yes").code == 0
    process = start(["aidin", "home", "--fake", "--yes", "-q"], clean_environment(), stdout=subprocess.DEVNULL)
    began = kept("aidin")
    try:
        wait_until(lambda: kept("aidin") != began and json.loads(kept("aidin") or b"{}").get("mode") == 1)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert json.loads(kept("aidin") or b"")["mode"] == 1
    found = run("aidin", "status", "--fake")
    assert found.code in (0, 7) and "the state that it was left in" in found.err


def test_without_a_folder_nothing_is_kept(tmp_path: Path) -> None:
    nowhere = {"XDG_RUNTIME_DIR": str(tmp_path / "none" / "run"), "TMPDIR": str(tmp_path / "none" / "tmp")}
    done = run("exo", "set", "position_set.index=300", "--fake", "--yes", env=nowhere)
    assert done.code == 0 and "simulated exo" in done.err
    assert run("exo", "dump", "--fake", env=nowhere).code == 0
