"""A snapshot on a device that is not quite the one it is of: a register less, another model, a setting that is refused there."""

from __future__ import annotations

import json
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest

from handctl.command import snapshots
from handctl.sim.barrett.parameter_tables import Bank
from tests.barrett.commands import written_lines
from tests.support.cli import Result, run
from tests.support.odd_barrett import odd
from tests.support.swap import swapped

BARRETT = "fake://barrett?clock=virtual&initialized=1&state="


def messages(result: Result, code: str) -> list[str]:
    return [one["text"] for one in result.json["messages"] if one["code"] == code]


def changed(path: Path, **values: int) -> Path:
    """The snapshot with other values."""
    content = json.loads(path.read_text())
    content["values"].update({name.replace("__", "."): value for name, value in values.items()})
    content.pop("checksum")
    path.write_text(json.dumps({**content, "checksum": snapshots._checksum(content)}))
    return path


@pytest.fixture
def barrett(tmp_path: Path) -> tuple[str, Path]:
    """A hand, and a snapshot of another one with DP 9000 for F1."""
    link, path = f"{BARRETT}{tmp_path / 'state.json'}", tmp_path / "hand.json"
    assert run("barrett", "snapshot", path, "-p", link).code == 0
    return link, changed(path, default_position__F1=9000)


def lacking(name: str) -> AbstractContextManager[None]:
    return odd(without=name)


@pytest.mark.parametrize(("gcl", "name"), [("SGFLIP", "strain_flip"), ("LFDPD", "loop_feedback_delta_discard")])
def test_what_the_firmware_lacks_is_named_and_can_be_left_out(
    barrett: tuple[str, Path], gcl: str, name: str, tmp_path: Path
) -> None:
    link, path = barrett
    trace = tmp_path / "t.txt"
    with lacking(gcl):
        refused = run("barrett", "restore", path, "-y", "-p", link, "--json", "--trace", trace)
        assert (refused.code, refused.error["code"]) == (6, "not-on-this-firmware")
        assert name in refused.error["text"] and f"--skip {name} " in refused.error["hint"]
        assert written_lines(trace) == []
        done = run("barrett", "restore", path, "-y", "--skip", name, "-p", link, "--json", "--trace", trace)
    assert (done.code, written_lines(trace)) == (0, ["1FSET DP 9000"])
    assert [(row["name"], row["value"]) for row in done.rows] == [("default_position.F1", 9000)]
    assert [name in text for text in messages(done, "skipped")] == [True]


def test_one_element_is_left_out_alone(barrett: tuple[str, Path], tmp_path: Path) -> None:
    link, path = barrett
    changed(path, default_position__F2=9100)
    done = run("barrett", "restore", path, "-y", "--skip", "default_position.F1", "-p", link, "--json")
    assert [(row["name"], row["value"]) for row in done.rows] == [("default_position.F2", 9100)]
    assert "absent" not in done.codes(), "the file contains it"
    assert run("barrett", "restore", path, "-n", "--skip", "default_position", "-p", link, "--json").code == 0


@pytest.mark.parametrize("name", ["strain_flop", "default_position.F9", ""])
def test_a_name_that_the_snapshot_does_not_contain_is_refused(barrett: tuple[str, Path], name: str) -> None:
    link, path = barrett
    refused = run("barrett", "restore", path, "-y", "--skip", name, "-p", link, "--json")
    assert (refused.code, refused.error["code"], refused.json["counters"]["sent"]) == (2, "unknown-name", 0)


def test_everything_that_is_foreign_is_named_at_once(barrett: tuple[str, Path]) -> None:
    link, path = barrett
    changed(path, warp__F1=1, warp__F2=1, position__F1=5)
    refused = run("barrett", "restore", path, "-y", "-p", link, "--json")
    assert (refused.code, refused.error["code"], refused.json["counters"]["sent"]) == (2, "foreign", 0)
    assert "--skip warp --skip position.F1 " in refused.error["hint"]
    done = run("barrett", "restore", path, "-y", "--skip", "warp", "--skip", "position", "-p", link, "--json")
    assert (done.code, len(done.rows)) == (0, 1)


def test_what_is_refused_when_it_is_written_names_the_way_out(barrett: tuple[str, Path]) -> None:
    """ERR 256: it can be read here, and not be set."""
    link, path = barrett
    put = Bank.put

    def kept(bank: Bank, name: str, text: str, numbers: tuple[int, ...]) -> int:
        return 256 if name == "DP" else put(bank, name, text, numbers)

    with swapped((Bank, "put", kept)):
        refused = run("barrett", "restore", path, "-y", "-p", link, "--json")
    assert (refused.code, refused.error["code"]) == (6, "err-256") and "--skip" in refused.error["hint"]


def hand(*words: Any, model: str) -> Result:
    return run("hand", *words, "-p", f"fake://hand?clock=virtual&model={model}", "--json")


def test_another_model_takes_what_means_the_same(tmp_path: Path) -> None:
    """An RH56DFTP has no current limit; speed and force are those of an RH56DFX."""
    path = tmp_path / "df.json"
    assert hand("snapshot", path, model="df").code == 0
    changed(path, default_speed__ring=500)
    refused = hand("restore", path, "-y", model="tp")
    assert (refused.code, refused.error["code"]) == (2, "not-on-this-firmware")
    assert "--skip current_limit " in refused.error["hint"]
    assert all(row["state"] == "not-sent" for row in refused.json["writes"])
    done = hand("restore", path, "-y", "--skip", "current_limit", model="tp")
    assert (done.code, [(row["name"], row["value"]) for row in done.rows]) == (0, [("default_speed.ring", 500)])


@pytest.mark.parametrize(("model", "given", "theirs"), [("f1", [], "df"), ("df", ["--model", "f1"], "f1")])
def test_what_means_something_else_there_is_refused(tmp_path: Path, model: str, given: list[str], theirs: str) -> None:
    """A speed of 701 is of 4000 on an RH56F1, and of 1000 elsewhere."""
    path = tmp_path / "hand.json"
    assert hand("snapshot", path, model=model).code == 0
    skipped = ["--skip", "mode"] if model == "f1" else []
    refused = hand("restore", path, "-y", *given, *skipped, "--skip", "current_limit", model=theirs)
    assert (refused.code, refused.error["code"]) == (2, "other-meaning")
    assert "default_speed" in refused.error["text"]
    assert all(row["state"] == "not-sent" for row in refused.json["writes"])


@pytest.mark.parametrize(
    ("given", "kept"), [("DP", "default_position"), ("dp", "default_position"), ("DP.F1", "default_position.F1")]
)
def test_skip_takes_the_names_that_get_takes(barrett: tuple[str, Path], given: str, kept: str) -> None:
    """The manual's mnemonic, too; what is left out is told by the name that the file has."""
    link, path = barrett
    done = run("barrett", "restore", path, "-y", "--skip", given, "-p", link, "--json")
    assert (done.code, done.rows) == (0, []) and [kept in text for text in messages(done, "skipped")] == [True], done
