"""Hands of a generation that nothing proves, or of another than was typed, met by a command that writes."""

from __future__ import annotations

from pathlib import Path

from handctl.sim.hand.registers import ACTS
from tests.contract.commands import scratch_of, writing_commands
from tests.contract.facts import facts_of, passed
from tests.contract.facts.hand import rh56
from tests.support.cli import Spy, run, spying

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


def names() -> list[str]:
    """The commands that write."""
    return writing_commands("hand")


def tried(name: str, device: str, typed: str, wire: str, folder: Path) -> str:
    """Run one against such a hand: how it ended. Raises AssertionError where a frame reached it that it takes for another."""
    trace = folder / "trace.txt"
    words = [name, *facts_of("hand").words(name, scratch_of(folder)), *(["--model", typed] if typed else [])]
    with spying() as spy:
        done = run("hand", *words, "-y", "-p", link_of(device, wire), "--json", "--trace", trace)
    wrote = [entry.data for entry in passed(trace) if entry.mark == ">" and rh56(entry)]
    assert not [data for data in wrote if any(frame in data for frame in FRAMES)], done
    if name != STOPS:
        assert wrote == [], (done, wrote)
        assert unharmed(spy), done
        assert done.code in ((2, 4, 5, 6) if name == "raw" else (2, 5, 6)), (
            done
        )  # raw speaks the one protocol of its bytes
    return f"exit {done.code}"
