"""Every reading command of every family, on the device of every other family that its wire can carry: 6, and never a table.

The commands are those of the registry, the devices the simulators. What is silent to a question proves nothing: then it is
4 or 5, and the message names the command that finds out who is there.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from handctl.command import snapshots
from handctl.command.family import load, map_of
from handctl.families import FAMILIES
from handctl.tools.family_probe import probe_of
from tests.support.cli import Result, run
from tests.support.each_row import each_row

READING = ("status", "dump", "get", "watch", "log", "snapshot", "diff", "report")
GENERATIONS = {"hand": ("hand?model=df", "hand?model=tp", "hand?model=f1", "hand?model=dg2")}
"""Of a family whose devices differ in what answers."""
UNDERSTOOD = {("exo", "wrist"), ("exo", "hand"), ("wrist", "exo"), ("wrist", "hand"), ("hand", "exo")}
"""(command, device): they speak one frame, so the device answers and proves what it is: 6."""
SAME = {("hand", "wrist"): "the hand that carries a wrist is a hand, and may be read as one"}
"""(command, device) -> why it is no stranger."""


def devices(family: str) -> tuple[str, ...]:
    return GENERATIONS.get(family, (f"{family}?",))


def serial(family: str) -> bool:
    return "serial" in probe_of(family).WIRES


def words(family: str, verb: str, folder: Path) -> tuple[str, ...]:
    if verb == "get":
        params = map_of(family)
        assert params is not None
        return verb, next(param.name for param in params if param.readable)
    if verb == "watch":
        return verb, "--count", "2"
    if verb == "diff":
        path = folder / "a.json"
        snapshots.write(str(path), snapshots.make(family, {"kind": family}, {}, link="x", fake=True))
        more = [param.name for param in load(family, "cli").cli.commands[verb].params]
        return verb, str(path), *(("--setpoints",) if "setpoints" in more else ())
    if verb in ("log", "snapshot", "report"):
        return verb, str(folder / f"{verb}.html"), *(("--watch", "0", "--force") if verb == "report" else ())
    return (verb,)


def asked(family: str, verb: str, device: str, folder: Path, *more: str) -> Result:
    joint = "" if device.endswith("?") else "&"
    args = (*words(family, verb, folder), "-p", f"fake://{device}{joint}clock=virtual", "--timeout", "0.2", *more)
    return run(family, *args, "--json")


def code_of(result: Result) -> str:
    return str((result.stream[1]["messages"][-1] if '"end"' in result.out else result.error)["code"])


PAIRS = [(mine, other) for mine in FAMILIES for other in FAMILIES if mine != other and serial(mine) and serial(other)]


def test_a_table_of_foreign_registers_is_refused(tmp_path: Path) -> None:
    """One of the pairs below, for the seeded mistakes."""
    result = asked("exo", "status", devices("hand")[0], tmp_path)
    assert (result.code, code_of(result)) == (6, "other-device")


@each_row(("mine", "other"), PAIRS)
@each_row("verb", READING)
def test_a_stranger_is_never_shown_as_a_table(mine: str, other: str, verb: str, tmp_path: Path) -> None:
    group = load(mine, "cli").cli
    if verb not in group.commands or (mine, other) in SAME:
        return
    for device in devices(other):
        result = asked(mine, verb, device, tmp_path)
        if (mine, other) in UNDERSTOOD:
            assert (result.code, code_of(result)) == (6, "other-device"), (device, result)
        else:
            assert result.code in (2, 4, 5, 6), (device, result)


@each_row(("mine", "other"), sorted(UNDERSTOOD))
def test_who_insists_gets_the_table(mine: str, other: str, tmp_path: Path) -> None:
    for device in devices(other):
        result = asked(mine, "dump", device, tmp_path, "--assume-identity")
        assert (result.code == 0 and "identity-assumed" in result.codes()) or result.code in (4, 5), (device, result)
        assert result.json["device"]["identity"] == "assumed" and result.json["device"].get("model") is None


@each_row("model", ["df", "tp", "f1", "dg2"])
@pytest.mark.parametrize("verb", ["status", "dump", "get", "watch"])
def test_a_generation_that_was_typed_makes_no_exo_a_hand(model: str, verb: str, tmp_path: Path) -> None:
    result = asked("hand", verb, "exo?", tmp_path, "--model", model)
    assert result.code in ((6,) if model in ("df", "tp") else (4, 5, 6)), result


@each_row("family", list(FAMILIES))
def test_the_right_device_is_shown_with_its_model(family: str, tmp_path: Path) -> None:
    for device in devices(family):
        result = asked(family, "status", device, tmp_path)
        assert result.code == 0 and result.json["device"]["model"], (device, result)
