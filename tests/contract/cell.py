"""One run of one command of a family on its simulator, and what holds of every run, whatever is wrong with the line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests.contract.facts import Passed, facts_of, passed
from tests.support.cli import Result, run


def in_bytes(text: str) -> bytes:
    return bytes.fromhex(text.partition("]")[2] if "]" in text else text)


def go(
    family: str, command: str, folder: Path, fault: str = "", *more: str
) -> tuple[Result, list[dict[str, Any]], list[Passed]]:
    """Run it; what came of it, its ledger, and what passed."""
    facts, trace = facts_of(family), folder / "trace.txt"
    trace.unlink(missing_ok=True)
    link = facts.link(family, command, f"fault={fault}" if fault else "")
    words = [*command.split(), *facts.words(command, folder), "-y", "-p", link]
    env = {"XDG_STATE_HOME": str(folder / "state")}
    result = run(family, *words, "--format", "ndjson", "--trace", trace, *more, env=env)
    last = json.loads(result.lines[-1])
    envelope = last["end"]
    return result, envelope["writes"], passed(trace)


def judge(family: str, command: str, writes: list[dict[str, Any]], transcript: list[Passed]) -> None:
    """What is listed as sent is what went out, in order; nothing else is; what nobody answered is not confirmed."""
    writing = facts_of(family).rule(command)
    wrote = [writing(entry) for entry in transcript]
    frames = [(place, entry) for place, entry in enumerate(transcript) if wrote[place] and entry.mark == ">"]
    last_heard = max((place for place, entry in enumerate(transcript) if entry.mark == "<"), default=-1)
    at, idle = 0, facts_of(family).idle
    for step in writes:
        if step["state"] == "not-sent" or in_bytes(step["bytes"]) == idle not in [entry.data for _, entry in frames]:
            continue  # a stop where nothing moved is listed, and no write
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


STOPS = ("set the speed of every finger to 0", "all forces to 0", "hold at ", "move no finger", "stay at ")
"""How the steps of a stop begin in words."""
POWER_OFF = ": motor power off"
"""How T of a BarrettHand's stop ends; a T that was typed is a command like any other, and has no such words."""


def stops(step: dict[str, Any]) -> bool:
    """Whether a write stops what may be moving: ^C, or a step of the stop behind an error."""
    meaning = step["meaning"]
    return step["bytes"] == "03" or meaning.startswith(STOPS) or meaning.endswith(POWER_OFF)


LAST = "end"
STREAMS = "streams"
CODES = {0, 2, 3, 4, 5, 6, 7, 8}


def tried(
    family: str, command: str, folder: Path, *more: str, options: tuple[str, ...] = (), link: str = ""
) -> tuple[Result, list[dict[str, Any]], dict[str, Any], list[Passed]]:
    """Run any command of a family with --yes, on its simulator with `options` or on `link`; its rows, its envelope by the schema, and what passed."""
    facts, trace = facts_of(family), folder / "trace.txt"
    trace.unlink(missing_ok=True)
    words = [*command.split(), *facts.words(command, folder), "-p", link or facts.link(family, command, *options)]
    yes = ["-y"] if command in facts.writes else []
    env = {"XDG_STATE_HOME": str(folder / "state")}
    result = run(family, *words, *yes, "--format", "ndjson", "--trace", trace, *more, env=env)
    rows, envelope = result.stream
    assert "Traceback" not in result.err and result.code != 1, result
    return result, rows, envelope, passed(trace)


def wrote(family: str, command: str, transcript: list[Passed]) -> list[bytes]:
    """What of a transcript writes, by the family's rule."""
    writing = facts_of(family).rule(command)
    found = [(entry, writing(entry)) for entry in transcript]
    return [entry.data for entry, writes in found if writes and entry.mark == ">"]
