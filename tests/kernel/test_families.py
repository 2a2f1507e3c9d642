"""Settings, commands and triggers: what each quantity of each map is, found out from the simulators, and what follows.

The simulators were transcribed from the manuals by themselves. What moves or pushes in them once it is written must be a
command in the map; the guide's line for scripts must be harmless on a worn hand.
"""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from handctl.docgen.read_command_tree import map_of
from handctl.families import FAMILIES
from handctl.link import NoLink, open_link
from handctl.model.command_settings import Settings
from handctl.model.param import (
    COMMAND,
    KINDS,
    MEASURED,
    PUSHES,
    SETTING,
    TRIGGER,
    Element,
    Param,
    ParamMap,
    Reading,
)
from handctl.model.result import Journal
from tests.support.cli import fake, memory, pairs, run, s16, spying, writes
from tests.support.each_row import each_row
from tests.support.places import GUIDES
from tests.support.snapshots import signed, snapshot_of

MAPS = {kind: found for kind in FAMILIES if (found := map_of(kind)) is not None}
QUANTITIES = [pytest.param(kind, param, id=f"{kind}-{param.name}") for kind, params in MAPS.items() for param in params]


@each_row(("kind", "param"), QUANTITIES)
def test_every_writable_quantity_has_a_kind(kind: str, param: Param) -> None:
    assert param.kind in KINDS
    assert (param.kind == MEASURED) == ("w" not in param.access)
    assert param.acts == "" or param.kind in (COMMAND, TRIGGER), "what moves or pushes is no setting"
    if param.kind == TRIGGER:
        assert param.verb and not param.writable


def test_a_map_refuses_a_quantity_of_the_wrong_kind() -> None:
    for wrong in (
        Param(name="target", doc="d", source="s", access="rw"),
        Param(name="angle", doc="d", source="s", kind=SETTING),
        Param(name="angle", doc="d", source="s", access="rw", kind="seting"),
    ):
        with pytest.raises(ValueError, match=f"{wrong.name} has access"):
            ParamMap("exo", [wrong])


# -- what the simulators do ----------------------------------------------------------------------------------------------

ALONE = {
    "move_time": "says how long the next movement takes: of the order, not of the device",
    "force_limit": "counts from the next movement on",
    "speed_set": "counts from the next movement on",
}
"""Commands that do nothing by themselves."""
SHOWN_OTHERWISE = {"strain_flip": "turns the reading of the strain around, not the finger"}
"""Settings that change what is read, and nothing that is held."""
PRESENT = 2.0
"""Seconds that pass between writing and looking."""


def after(kind: str, element: Element | None, value: float) -> dict[str, Any]:
    """What a fresh simulated device measures 2 s after `value` was written to `element` (None: nothing was)."""
    from importlib import import_module

    family = import_module(FAMILIES[kind].module("cli")).cli.family
    link = open_link(f"fake://{kind}?clock=virtual", baud=family.baud)
    device = family.open(link, Settings(), Journal())
    measured = [
        e
        for param in device.map
        if param.readable and param.kind == MEASURED and not param.optional
        for e in param.each
    ]
    device.read(measured)
    begun = link.now()
    if element is not None:
        (step,) = family.open(NoLink(), Settings(), Journal()).plan([(element, value)])
        link.write(step.data, link.deadline(1.0))
    link.sleep(begun + PRESENT - link.now())
    while link.read(link.deadline(0.05)):
        pass
    found: list[Reading] = device.read(measured)
    link.close()
    return {reading.element.full_name: reading.value for reading in found if not moves_by_itself(reading.element)}


def moves_by_itself(element: Element) -> bool:
    """Clocks, and what flickers with the moment of asking."""
    return bool(re.search("boot_time|uptime|temperature", element.param.name))


def values_of(param: Param) -> list[float]:
    """Values far apart: a present one cannot be near all of them."""
    if param.choices:
        return [float(value) for value in (min(param.choices), max(param.choices))]
    assert param.low is not None and param.high is not None
    return [float(param.low), float(param.high), float(round((param.low + param.high) / 3))]


@cache
def untouched(kind: str) -> dict[str, Any]:
    return after(kind, None, 0)


SETTABLE = [
    pytest.param(kind, param, id=f"{kind}-{param.name}")
    for kind, params in MAPS.items()
    for param in params
    if param.writable and not param.strands
]


@each_row(("kind", "param"), SETTABLE)
def test_what_moves_or_pushes_once_written_is_a_command_and_nothing_else_is(kind: str, param: Param) -> None:
    changed = set()
    for value in values_of(param):
        now = after(kind, param.each[0], value if param.decimals else int(value))
        changed |= {name for name, was in untouched(kind).items() if now[name] != was}
    if param.name in SHOWN_OTHERWISE:
        assert changed and not param.acts
        return
    assert bool(changed) == bool(param.acts), changed
    if param.kind == COMMAND:
        assert param.acts or param.name in ALONE
    if changed and param.acts == PUSHES:
        assert any("force" in name for name in changed), changed


# -- snapshot, diff, restore ---------------------------------------------------------------------------------------------

SETTINGS = pairs(["id", "baud_code"])
SETPOINTS = pairs(["position_set", "force_set"])


def test_a_snapshot_tells_how_many_of_which_kind(tmp_path: Path) -> None:
    result = run("exo", "snapshot", tmp_path / "s.json", "-p", fake(), "--json")
    assert {row["name"] for row in result.rows if row["kind"] == SETTING} == set(SETTINGS)
    assert {row["name"] for row in result.rows if row["kind"] == COMMAND} == set(SETPOINTS)
    (written,) = [message for message in result.json["messages"] if message["code"] == "written"]
    assert "2 settings and 10 set points (position_set, force_set)" in written["text"]
    wrist = run("wrist", "snapshot", tmp_path / "w.json", "-p", "fake://wrist?clock=virtual")
    assert "written" in wrist.said and "3 set points (yaw_set, pitch_set, move_time)" in wrist.err


def test_the_line_of_the_guide_commands_nothing_on_a_worn_hand(tmp_path: Path) -> None:
    """snapshot; force 0; `exo diff …; [ $? -ne 7 ] || exo restore … --yes`: the forces of the file are not sent, and diff finds nothing."""
    prompts = (GUIDES / "scripts.md").read_text(encoding="utf-8")
    assert "exo diff before.json --format plain -q; [ $? -ne 7 ] || handctl exo restore before.json --yes" in prompts
    link, path, trace = fake(state=tmp_path / "state.json"), tmp_path / "before.json", tmp_path / "t.txt"
    assert run("exo", "force", *["-800"] * 5, "-y", "-p", link).code == 0
    assert run("exo", "snapshot", path, "-p", link).code == 0
    assert run("exo", "force", *["0"] * 5, "-y", "-p", link).code == 0
    assert run("exo", "position", *["700"] * 5, "-y", "-p", link).code == 0  # somebody moved a finger
    diff = run("exo", "diff", path, "--format", "plain", "-q", "-p", link)
    assert (diff.code, diff.out) == (0, "")
    for extra in ((), ("--setpoints", "-n")):
        assert run("exo", "restore", path, "--yes", "-p", link, "--trace", trace, *extra).code == 0
        assert not trace.exists() or writes(trace) == []
    assert memory(tmp_path / "state.json", 1498, 10) == s16(0, 0, 0, 0, 0)


def test_what_is_left_alone_is_told(tmp_path: Path) -> None:
    path = snapshot_of(tmp_path, id=1, force_set__index=-5)
    for verb in (("diff",), ("restore", "-y")):
        result = run("exo", verb[0], path, *verb[1:], "-p", fake(), "--json")
        (left,) = [message for message in result.json["messages"] if message["code"] == "setpoints"]
        assert "10 set points (position_set, force_set)" in left["text"] and "--setpoints" in left["hint"]
        assert (result.code, result.rows) == (0, [])


def test_an_old_snapshot_which_names_no_kinds_still_loads(tmp_path: Path) -> None:
    """The file is as it always was: values by name; which of them are commands, the map says."""
    path = tmp_path / "old.json"
    content = {
        "schema": "handctl-snapshot/1", "kind": "exo", "device": {"kind": "exo", "id": 1},
        "tool": {"name": "handctl", "version": "0.1.0"}, "time": "2026-01-31T12:00:00+00:00", "link": "x", "fake": False,
        "values": {**SETTINGS, **SETPOINTS, "baud_code": 1, "force_set.index": -5},
    }  # fmt: skip
    path.write_text(json.dumps(signed(content)))
    assert [row["name"] for row in run("exo", "diff", path, "-p", fake(), "--json").rows] == ["baud_code"]
    assert [row["name"] for row in run("exo", "restore", path, "-y", "-p", fake(), "--json").rows] == ["baud_code"]
    both = run("exo", "restore", path, "-y", "--setpoints", "-p", fake(), "--json")
    assert [(row["name"], row["kind"], row["pushes"]) for row in both.rows] == [
        ("force_set.index", COMMAND, True),
        ("baud_code", SETTING, False),
    ]


def test_a_dry_run_shows_what_moves_and_what_pushes(tmp_path: Path) -> None:
    path = snapshot_of(tmp_path)
    without = run("exo", "restore", path, "-n", "--json")
    assert [row["meaning"].partition(" =")[0] for row in without.rows] == ["write baud_code", "write id"]
    rows = run("exo", "restore", path, "-n", "--setpoints", "--json").rows
    meanings = [row["meaning"] for row in rows]
    assert [text.split()[0] for text in meanings] == ["MOVES:", "PUSHES:", "write", "write"]
    assert "position_set.little = 151" in meanings[0] and "force_set.thumb = -65" in meanings[1]
    assert [row["moves"] for row in rows] == [True, True, False, False]


def test_forces_have_a_question_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both are asked before the first byte is written, and --yes answers both."""
    from handctl.command.terminal_prompts import TerminalPrompts

    asked: list[str] = []
    said: list[str] = []
    answers: list[bool] = []

    def ask(_self: TerminalPrompts, question: str, _word: str) -> bool:
        asked.append(question)
        return answers.pop(0)

    monkeypatch.setattr(TerminalPrompts, "ask", ask)
    monkeypatch.setattr(TerminalPrompts, "say", lambda _self, text: said.append(text))
    monkeypatch.setattr("handctl.command.terminal_prompts.is_terminal", lambda _file: True)
    path = snapshot_of(tmp_path, force_set__index=-5, position_set__thumb=-1)
    trace = tmp_path / "t.txt"
    for given, code in (([True, True], 0), ([True, False], 8), ([False], 8)):
        asked.clear()
        answers[:] = given
        with spying():
            result = run("exo", "restore", path, "--setpoints", "-p", fake(), "--trace", trace)
        assert (result.code, answers) == (code, []), result
        assert "MOVES the device: position_set.thumb" in asked[0] and "force" not in asked[0]
        assert asked[1:] == [] or "PUSHES with a force until another is commanded" in asked[1]
        assert asked[1:] == [] or "force_set.index    64  -5" in said[-1]
        assert len(writes(trace)) == (2 if code == 0 else 0)
    asked.clear()
    assert run("exo", "restore", path, "--setpoints", "-y", "-p", fake()).code == 0
    assert asked == []


def test_setpoints_are_offered_where_a_map_has_some() -> None:
    for kind, params in MAPS.items():
        commands = any(param.kind == COMMAND and param.writable and not param.optional for param in params)
        if any(param.writable for param in params):
            for verb in ("diff", "restore"):
                assert ("--setpoints" in run(kind, verb, "--help").out) == commands, (kind, verb)
