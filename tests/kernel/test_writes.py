"""Every command that writes, on its simulator: `writes` is what the transcript shows, whatever became of the line.

The frames are taken from the transcript by rules of this file, written from the manuals, not by handctl's own.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from handctl.families import FAMILIES, WRITES
from handctl.frame import snapshot
from handctl.frame.clikit import Command, Group, root
from tests.support.cli import Result, run

ARGS: dict[str, str] = {
    "exo set": "position_set.index=300 force_set.thumb=-20",
    "exo restore": "{exo} --setpoints",
    "exo write": "1492 2C01",
    "exo raw": "EB 90 01 05 12 D4 05 2C 01 1E",
    "exo id": "7",
    "exo baud": "57600 --save",
    "exo clear-errors": "",
    "exo save": "",
    "exo factory-reset": "--undocumented-address --backup {dir}/b.json",
    "exo calibrate": "",
    "exo force": "10 20 30 -40 50",
    "exo position": "100 200 300 400 500 --wait 2",
    "exo stop": "",
    "wrist set": "pitch_set=5 yaw_set=3 move_time=500",
    "wrist restore": "{wrist} --setpoints",
    "wrist move": "--pitch 5 --yaw -5 --time 300",
    "wrist center": "",
    "wrist write": "1038 0500",
    "wrist hand-write": "1486 2C01",
    "wrist raw": "EB 90 01 05 31 0E 04 05 00 4E",
    "wrist stop": "",
    "barrett set": "MCV=80 HSG.F1=150",
    "barrett load": "",
    "barrett defaults": "",
    "barrett save": "--force",
    "barrett baud": "19200",
    "barrett reset": "",
    "barrett init": "",
    "barrett open": "",
    "barrett close": "",
    "barrett move": "9000 --motors 1",
    "barrett step-open": "0",
    "barrett step-close": "100",
    "barrett home": "",
    "barrett torque-open": "",
    "barrett torque-close": "",
    "barrett stop": "",
    "barrett gcl": "FGET§P FSET§MCV§70 HI",
    "barrett restore": "{barrett}",
    "barrett realtime": "--init --velocity 20 --count 20",
    "barrett strain": "--open",
    "barrett diagnose": "early-breakaway --move",
    "aidin home": "",
    "aidin initial": "",
    "aidin stop": "",
    "aidin bias": "",
    "aidin max-torque": "800",
    "aidin encoders": "index.m3=85000",
    "aidin joints": "index.q3=160",
    "aidin fingertips": "index.z=120",
    "aidin currents": "index.m1=100 --duration 0.3",
    "ekso set": "step_length=15.5 --operator me",
    "ekso restore": "{ekso} --operator me",
    "ekso cancel": "",
    "ekso stop": "",
}
"""Command -> its arguments; § is a blank within one."""
STATES = {"barrett": "initialized=1", "aidin": "start=homed", "aidin home": "start=used", "ekso": "", "exo": ""}
"""Family or command -> the state in which its simulator begins."""
ELSEWHERE = {"barrett firmware download": "needs a power switch: tests of its own"}
FAULTS = [f"{fault}&after={after}" for fault in ("silent", "disconnect") for after in (0, 2, 4, 6)]


def writing_commands(group: Group = root, path: str = "") -> Iterator[str]:
    for name in FAMILIES if group is root else group.commands:
        command = group.get_command(None, name)  # type: ignore[arg-type]
        if isinstance(command, Group):
            yield from writing_commands(command, f"{path} {name}".strip())
        elif isinstance(command, Command) and command.writes:
            yield f"{path} {name}"


COMMANDS = sorted(set(writing_commands()) - set(ELSEWHERE))


def test_every_command_that_writes_is_here_and_every_family_says_what_writes() -> None:
    assert set(COMMANDS) <= set(ARGS), "a command that writes is missing in ARGS"
    assert set(WRITES) == set(FAMILIES)


# -- the transcript, read without handctl -----------------------------------------------------------------------------


class Passed(NamedTuple):
    mark: str
    data: bytes
    can_id: int | None


def passed(trace: Path) -> list[Passed]:
    found = []
    for line in trace.read_text(encoding="utf-8").splitlines() if trace.exists() else []:
        words = line.split()
        if line.startswith("#") or len(words) < 2 or words[1] not in "<>":
            continue
        if words[2] == "can":
            found.append(Passed(words[1], bytes.fromhex("".join(words[5:])), int(words[3], 16)))
        else:
            found.append(Passed(words[1], bytes.fromhex("".join(words[2:])), None))
    return found


QUERIES = {
    *("FGET", "PGET", "FLIST", "FLISTV", "FLISTA", "FLISTAV", "PLIST", "PLISTV", "PLISTA", "PLISTAV"),
    *("VERS", "ERR", "A?", "!"),  # "!" is no command: a connection asks with it
}


MOTIONS = {"HI", "C", "O", "M", "IC", "IO", "HOME", "TC", "TO"}


class Barrett:
    """GCL lines are told by their first word; behind LOOP come blocks until ^C; ^C writes while something moves."""

    def __init__(self, *, stops: bool) -> None:
        self.stops = stops
        self.loop = self.moves = False

    def writes(self, entry: Passed) -> bool:
        data = entry.data
        if entry.mark == "<":
            self.moves = self.moves and b"=>" not in data
            return False
        if not data.strip(b"\x00\x03"):  # to leave a loop, a zero may go before
            self.moves, self.loop = self.moves or self.loop, False
            return self.moves or (self.stops and data[-1:] == b"\x03")
        if self.loop:
            return data not in (b"A", b"a")
        word = data.decode().strip("\0\r").replace("\0", "").upper().partition(" ")[0]  # 00 fills a control block
        name = word.lstrip("1234GS")
        self.loop = name == "LOOP"
        self.moves = self.moves or name in MOTIONS
        return bool(word) and name not in QUERIES and not word.startswith("?")


def inspire(entry: Passed) -> bool:
    if entry.can_id is not None:
        return entry.can_id >> 26 in (1, 5)
    return not (len(entry.data) == 9 and entry.data[:2] == b"\xeb\x90" and entry.data[4] in (0x11, 0x30))


def rule(command: str) -> Callable[[Passed], bool]:
    """What tells whether an entry writes; it is shown the whole transcript in order."""
    rules: dict[str, Callable[[Passed], bool]] = {
        "exo": inspire,
        "wrist": inspire,
        "barrett": Barrett(stops=command == "barrett stop").writes,
        "aidin": lambda entry: b'"hand_mode"' in entry.data,
        "ekso": lambda entry: entry.data[0] not in range(150, 155),
    }
    return rules[command.partition(" ")[0]]


def in_bytes(text: str) -> bytes:
    return bytes.fromhex(text.partition("]")[2] if "]" in text else text)


# -- one cell ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    for kind, values in {
        "exo": {"position_set.index": 300, "position_set.ring": 250, "force_set.little": 5},
        "wrist": {"pitch_set": 5.0, "yaw_set": 3.0, "move_time": 400},
        "barrett": {"max_close_velocity.F1": 80, "filter_derivative_zero.F2": 3, "over_temperature_limit": 700},
        "ekso": {"step_length": 15.5},
    }.items():
        content = snapshot.make(kind, {"kind": kind}, values, link="x", fake=True)
        snapshot.write(str(tmp_path / f"{kind}.json"), content)
    return tmp_path


def go(command: str, folder: Path, fault: str = "", *more: str) -> tuple[Result, list[dict[str, Any]], list[Passed]]:
    family, _, _ = command.partition(" ")
    trace = folder / "trace.txt"
    trace.unlink(missing_ok=True)
    files = {kind: str(folder / f"{kind}.json") for kind in FAMILIES}
    words = [word.format(dir=folder, **files).replace("§", " ") for word in ARGS[command].split()]
    options = ["clock=virtual", STATES.get(command, STATES.get(family, "")), f"fault={fault}" if fault else ""]
    link = f"fake://{family}?{'&'.join(filter(None, options))}"
    env = {"XDG_STATE_HOME": str(folder / "state")}
    result = run(*command.split(), *words, "-y", "-p", link, "--format", "ndjson", "--trace", trace, *more, env=env)
    last = json.loads(result.lines[-1])
    envelope = last["end"]
    return result, envelope["writes"], passed(trace)


def judge(command: str, writes: list[dict[str, Any]], transcript: list[Passed]) -> None:
    """What is listed as sent is what went out, in order; nothing else is; what nobody answered is not confirmed."""
    writing = rule(command)
    wrote = [writing(entry) for entry in transcript]
    frames = [(place, entry) for place, entry in enumerate(transcript) if wrote[place] and entry.mark == ">"]
    last_heard = max((place for place, entry in enumerate(transcript) if entry.mark == "<"), default=-1)
    at = 0
    for step in writes:
        if step["state"] == "not-sent":
            continue
        count = step.get("count", 1)
        own = frames[at : at + count]
        assert len(own) == count, f"{step} is not on the wire"
        assert own[0][1].data == in_bytes(step["bytes"]), step
        assert own[-1][1].data == in_bytes(step.get("last", step["bytes"])), step
        if step["state"] in ("confirmed", "refused"):
            assert own[-1][0] < last_heard, f"nothing was heard after {step}"
        else:
            assert step["next"], step
        at += count
    assert at == len(frames), f"went out and is not listed: {frames[at:]}"
    assert [step["step"] for step in writes] == list(range(1, len(writes) + 1))


# -- the cells --------------------------------------------------------------------------------------------------------

UNPROVEN = {"aidin max-torque", "aidin stop", "aidin currents"}
"""Nothing that the device tells can confirm these, or not from the state that its simulator begins in."""

PLANS = {
    *("exo set", "exo restore", "exo baud", "wrist set", "wrist restore", "ekso restore"),
    *("barrett set", "barrett restore", "barrett load", "barrett defaults", "barrett gcl"),
}
"""Several steps, of which each is sent when the one before is proved."""


@pytest.mark.parametrize("command", COMMANDS)
def test_on_a_healthy_device(command: str, scratch: Path) -> None:
    result, writes, transcript = go(command, scratch)
    judge(command, writes, transcript)
    assert writes, result
    assert [step["meaning"] for step in writes if not step["meaning"]] == []
    if command not in UNPROVEN:
        assert {step["state"] for step in writes} == {"confirmed"}, writes


@pytest.mark.faults
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("fault", FAULTS)
def test_on_a_line_that_fails(command: str, fault: str, scratch: Path) -> None:
    result, writes, transcript = go(command, scratch, fault)
    judge(command, writes, transcript)
    said = result.out + result.err
    envelope = json.loads(result.lines[-1])["end"]
    if any(step["state"] != "not-sent" for step in writes):
        assert "othing was sent" not in said and "othing was written" not in said, said
    else:
        assert not {"ack-lost", "answer-lost"} & {message["code"] for message in envelope["messages"]}, said
    if command in PLANS:
        states = [step["state"] for step in writes if step["bytes"] != "03"]  # ^C stops what may be moving
        rest = states[states.index("sent") + 1 :] if "sent" in states else []
        assert set(rest) <= {"not-sent"}, "went on behind a write that nothing confirmed"


@pytest.mark.parametrize("command", COMMANDS)
def test_a_dry_run_has_every_step_as_not_sent(command: str, scratch: Path) -> None:
    result, writes, transcript = go(command, scratch, "", "-n")
    assert result.code == 0, result
    asks_first = (
        command == "wrist stop"
    )  # it holds the angles that it reads: without an answer there is nothing to send
    assert {step["state"] for step in writes} == (set() if asks_first else {"not-sent"})
    assert not [entry for entry in transcript if entry.mark == ">" and rule(command)(entry)]
