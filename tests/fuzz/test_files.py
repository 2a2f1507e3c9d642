"""Snapshot and configuration files that are damaged in every way: exit 2 or a right result, never more, nothing sent."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.fuzz.support import SEED, mutated, run_episodes
from tests.fuzz.texts import CONFIG, CONFIG_TOKENS, checksum, damaged
from tests.support.cli import Result, run
from tests.support.each_row import each_row

FAMILIES = {"exo": (), "wrist": (), "barrett": (), "ekso": ("--operator", "me")}
Change = Callable[[dict[str, Any], random.Random], None]


def sent(trace: Path) -> bool:
    """Whether a transcript has a line of the host."""
    return trace.exists() and any(" > " in line for line in trace.read_text(encoding="utf-8").splitlines())


def made(folder: Path) -> dict[str, bytes]:
    """A snapshot of each simulated device."""
    for family in FAMILIES:
        link = f"fake://{family}?clock=virtual" + ("&sway=0" if family == "ekso" else "")
        assert run(family, "snapshot", folder / family, "-p", link).code == 0
    return {family: (folder / family).read_bytes() for family in FAMILIES}


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return made(tmp_path_factory.mktemp("good"))


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What commands remember goes to the test's own directory."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def put(name: str, value: object) -> Change:
    """A key of the file replaced."""
    return lambda content, source: content.update({name: value})


def value(new: object) -> Change:
    """One of the values replaced."""

    def change(content: dict[str, Any], source: random.Random) -> None:
        content["values"][source.choice(sorted(content["values"]))] = new

    return change


def nested(depth: int) -> list[Any]:
    """Lists in lists."""
    deep: list[Any] = []
    for _ in range(depth):
        deep = [deep]
    return deep


SIGNED: dict[str, Change] = {  # with a checksum that fits, so that the content itself is judged
    **{f"{name} = {new!r}"[:40]: put(name, new) for name in ("schema", "kind", "values") for new in (None, 1, [], "x", {}, {"a": "b"})},
    **{f"value {new!r}"[:24]: value(new) for new in (None, True, "1", [], {}, -(10**30), 10**400, 1e308, 70000, float("nan"), float("inf"), -float("inf"))},
    "unknown name": lambda content, source: content["values"].update({"nosuch.thing": 1}),
    "newer": put("schema", "handctl-snapshot/2"),
    "long name": lambda content, source: content["values"].update({"x" * 100_000: 1}),
    "deep": put("device", nested(400)),
    "odd identity": put("device", "\ud800"),
    "not a time": put("time", {"a": [1, None]}),
}  # fmt: skip
RAW: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda data: b"",
    "UTF-16": lambda data: data.decode().encode("utf-16"),
    "NUL": lambda data: data[:50] + b"\0" + data[50:],
    "cut": lambda data: data[: len(data) // 2],
    "twice": lambda data: data + data,
    "doubled key": lambda data: data.replace(b'"values"', b'"kind": "exo",\n  "values": {},\n  "values"', 1),
    "NaN": lambda data: data.replace(b'"fake"', b'"more": NaN, "fake"', 1),
    "very deep": lambda data: b"[" * 100_000,
    "deep object": lambda data: b'{"a":' * 100_000,
    "long number": lambda data: data.replace(b'"fake"', b'"more": ' + b"9" * 5000 + b', "fake"', 1),
    "no UTF-8": lambda data: data.replace(b"handctl", b"hand\xffctl"),
    "a list": lambda data: b"[" + data + b"]",
}


def refused(result: Result) -> bool:
    """Whether it ended with 2 and one envelope, no traceback."""
    assert "Traceback" not in result.err, result
    assert result.json["messages"]
    return result.code == 2


def restore(family: str, path: Path, trace: Path) -> Result:
    """`restore` in front of a simulator on virtual time, recorded."""
    trace.unlink(missing_ok=True)
    return run(family, "restore", path, "--yes", *FAMILIES[family], "--json", "--trace", trace, "-p", f"fake://{family}?clock=virtual")  # fmt: skip


@each_row("name", SIGNED)
def test_a_snapshot_that_says_something_else(good: dict[str, bytes], tmp_path: Path, name: str) -> None:
    source = random.Random(f"{SEED} {name}")
    family = source.choice(sorted(FAMILIES))
    content = json.loads(good[family])
    SIGNED[name](content, source)
    content["checksum"] = checksum(content)
    path, trace = tmp_path / "bad.json", tmp_path / "trace.txt"
    path.write_text(json.dumps(content), encoding="utf-8")
    result = restore(family, path, trace)
    # What is said about the device is not written to it; of no values none differs.
    accepted = name in ("odd identity", "not a time", "deep", "values = {}")
    assert refused(result) is not accepted, result
    assert result.code == (0 if accepted else 2)
    assert accepted or not sent(trace)
    same = run(family, "diff", path, path, "--json")
    assert same.code == 0 if accepted else same.code in (0, 2), (
        same
    )  # whether a value fits the device is not asked there


@each_row("name", RAW)
def test_a_snapshot_that_is_damaged(good: dict[str, bytes], tmp_path: Path, name: str) -> None:
    family = random.Random(f"{SEED} {name}").choice(sorted(FAMILIES))
    path, trace = tmp_path / "bad.json", tmp_path / "trace.txt"
    path.write_bytes(RAW[name](good[family]))
    assert refused(restore(family, path, trace)), name
    assert not sent(trace)
    assert refused(run(family, "diff", path, "-p", f"fake://{family}?clock=virtual", "--json", "--trace", trace))
    assert not sent(trace)


def snapshots(good: dict[str, bytes], folder: Path) -> Callable[[random.Random], int]:
    """Random damage: refused before anything is sent, or the very content."""
    path, trace = folder / "any.json", folder / "trace.txt"

    def episode(source: random.Random) -> int:
        family = source.choice(sorted(FAMILIES))
        path.write_bytes(mutated(source, good[family], b'{}[]":,0123456789.eE-\\ \n\xff'))
        same = _content(path) == json.loads(good[family])  # only blanks between its words, or in a text
        assert refused(restore(family, path, trace)) or same
        assert same or not sent(trace)
        return 1

    return episode


def _content(path: Path) -> object:
    try:
        return json.loads(path.read_bytes())
    except (ValueError, RecursionError):
        return None


def configurations(folder: Path) -> Callable[[random.Random], int]:
    """Random damage to the configuration file: 2 with its line, or a command that works, or is silent at a speed that it names."""
    path = folder / "config.toml"

    def episode(source: random.Random) -> int:
        path.write_bytes(damaged(source, CONFIG, CONFIG_TOKENS))
        for args in (("devices", "list"), ("devices", "show", "left"), ("exo", "get", "id", "--fake")):
            result = run(*args, "--json", env={"HANDCTL_CONFIG": str(path)})
            assert "Traceback" not in result.err, result
            assert result.code in ((0, 2, 4) if "--fake" in args else (0, 2)), result
        return 3

    return episode


def test_files_damaged_at_random(good: dict[str, bytes], tmp_path: Path) -> None:
    run_episodes(snapshots(good, tmp_path), 40)
    run_episodes(configurations(tmp_path), 40)
