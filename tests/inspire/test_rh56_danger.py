"""The frames that mean something else on another generation, from every command over every wire (dossier V24, V30, §6 Q4).

The save of a DF is the factory reset of an F1, its clearing of errors the save of one: neither may reach a hand whose generation
is not proved, nor one of another generation than was typed.
"""

from __future__ import annotations

import zlib
from pathlib import Path

import pytest

from handctl.families import FAMILIES
from handctl.sim.hand.model import ACTS
from tests.contract.commands import scratch_of, writing_commands
from tests.contract.facts import facts_of, passed
from tests.contract.facts.hand import rh56
from tests.harm.cell import share
from tests.support.cli import Spy, run, spying
from tests.support.each_row import each_row

DANGERS = {
    "EB90": ("EB 90 01 04 12 EE 03 01 09", "EB 90 01 04 12 12 09 01 33", "EB 90 01 04 12 ED 03 01 08", "EB 90 01 04 12 EC 03 01 07"),
    "RTU": ("01 06 03 EE 00 01 28 7B", "01 06 09 12 00 01 EB 93", "01 06 03 ED 00 01 D8 7B", "01 06 03 EC 00 01 89 BB"),
}  # fmt: skip
"""Factory reset, sequence run, save, clear errors of DF and TP: V24, V30, V44; in Modbus by the same arithmetic."""
FRAMES = [bytes.fromhex(frame) for frames in DANGERS.values() for frame in frames]
SERIAL = {"EB90": "speaks=both", "RTU": "speaks=modbus"}
OTHERS = [
    # device, what was typed
    *(("f1", typed) for typed in ("", "df", "tp", "dg2")),
    *(("dg2", typed) for typed in ("", "df", "tp", "f1")),
    *(("df", typed) for typed in ("f1", "dg2")),
    *(("tp", typed) for typed in ("f1", "dg2")),
    *((f"{model}&fault=foreign", "") for model in ("df", "tp")),
]
"""Hands of a generation that nothing proves, or of another than was typed."""
SHARE = 6
"""A run of the whole suite takes one cell in so many; this file alone takes all."""
STOPS = "stop"
"""It asks nothing and waits for nothing, and sends speed 0 alone: of no generation a trigger (§9)."""


def link_of(device: str, wire: str) -> str:
    bus = {"CAN": "bus=can", "TCP": "bus=modbus-tcp"}.get(wire, SERIAL.get(wire, ""))
    return f"fake://hand?clock=virtual&model={device}&{bus}"


def cases() -> list[tuple[str, str, str]]:
    found = []
    for device, typed in OTHERS:
        wires = [*SERIAL, *(["CAN"] if device[:2] in ("df", "tp") else []), *(["TCP"] if device[:2] == "tp" else [])]
        found += [(device, typed, wire) for wire in wires]
    return found


def unharmed(spy: Spy) -> bool:
    """Whether no trigger was started and nothing was changed."""
    return all(not any(line.device.hand.acts[name] for name in ACTS) for line in spy.lines)


@each_row(("device", "typed", "wire"), cases())
@each_row("name", writing_commands("hand"))
def test_no_hand_of_unproven_or_other_generation_is_written_to(
    name: str, device: str, typed: str, wire: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if zlib.crc32(f"{name}|{device}|{typed}|{wire}".encode()) % min(share(request.config), SHARE):
        return
    scratch, trace = scratch_of(tmp_path), tmp_path / "trace.txt"
    words = [name, *facts_of("hand").words(name, scratch), *(["--model", typed] if typed else [])]
    with spying() as spy:
        done = run("hand", *words, "-y", "-p", link_of(device, wire), "--json", "--trace", trace)
    wrote = [entry.data for entry in passed(trace) if entry.mark == ">" and rh56(entry)]
    assert not [data for data in wrote if any(frame in data for frame in FRAMES)], done
    if name == STOPS:
        return
    assert wrote == [], (done, wrote)
    assert unharmed(spy), done
    assert done.code in ((2, 4, 5, 6) if name == "raw" else (2, 5, 6)), done  # raw speaks the one protocol of its bytes


@each_row("model", ["f1", "dg2"])
@each_row("wire", SERIAL)
@each_row("assumed", [False, True])
@each_row("frame", FRAMES, ids=lambda frame: frame.hex(" "))
def test_a_frame_that_is_typed_does_not_reach_one_either(
    frame: bytes, assumed: bool, wire: str, model: str, tmp_path: Path
) -> None:
    """--assume-identity alone is no word on the generation."""
    trace = tmp_path / "trace.txt"
    more = ["--assume-identity"] if assumed else []
    with spying() as spy:
        done = run(
            "hand", "raw", frame.hex(), "--force-ambiguous", "-y", *more, "-p", link_of(model, wire), "--trace", trace
        )
    assert done.code in (4, 5, 6), done
    assert frame not in [entry.data for entry in passed(trace) if entry.mark == ">"]
    assert unharmed(spy)


@pytest.mark.parametrize("frame", [frames[place] for frames in DANGERS.values() for place in (0, 1)])
@pytest.mark.parametrize("model", ["", "df", "tp"])
def test_a_reset_and_a_stored_movement_need_a_word_more(frame: str, model: str, tmp_path: Path) -> None:
    """Also towards the hand whose frames they are (V24)."""
    with spying() as spy:
        done = run(
            "hand", "raw", frame, "-y", "-p", link_of(model or "tp", "EB90"), *(["--model", model] if model else [])
        )
    assert (done.code, spy.lines) == (2, []), done
    assert "--force-ambiguous" in done.err


@pytest.mark.parametrize("address", [1003, 1007, 1008, 2320, 2322])
def test_what_lies_beside_the_triggers_is_never_written(address: int) -> None:
    """A stored sequence runs at 2322, a gesture at 1008 (§3.1, §3.3, §9): also with --undocumented."""
    with spying() as spy:
        done = run("hand", "write", str(address), "01", "--undocumented", "-y", "-p", link_of("df", "EB90"))
    assert (done.code, spy.lines) == (2, []), done


@pytest.mark.parametrize("family", [family for family in FAMILIES if family != "hand"])
@pytest.mark.parametrize("model", ["f1", "dg2"])
def test_no_command_of_another_family_sends_one(family: str, model: str, tmp_path: Path) -> None:
    scratch = scratch_of(tmp_path)
    for name in writing_commands(family):
        trace = tmp_path / "trace.txt"
        trace.unlink(missing_ok=True)
        words = [*name.split(), *facts_of(family).words(name, scratch)]
        with spying() as spy:
            done = run(family, *words, "-y", "-p", link_of(model, "EB90"), "--deadline", "20", "--trace", trace)
        assert done.code != 0 or name == STOPS, (name, done)
        sent = b"".join(entry.data for entry in passed(trace) if entry.mark == ">")
        assert not [frame for frame in FRAMES if frame in sent], name
        assert unharmed(spy), (name, done)
