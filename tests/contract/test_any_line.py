"""Ctrl-C at each line of the program that runs behind the first byte of a command that writes: between two steps too, not
only where it waits.

Either the exit code is 130, and what moves was told to stop, or the command had done its work, and its result is there
with exit code 0. In both cases the ledger knows what went out.
"""

from __future__ import annotations

import json
import shlex
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple
from unittest import mock

import pytest

from handctl.families import FAMILIES
from handctl.link.fake import FakeFrames, FakeLink
from tests.contract.cell import in_bytes, judge, wrote
from tests.contract.commands import ELSEWHERE, SECONDS, chosen, commands, scratch_of
from tests.contract.facts import Passed, facts_of, passed
from tests.matrix.report import bounded
from tests.support.cli import Result, run

pytestmark = pytest.mark.contract

SKIPPED = ("/handctl/sim/", "/unittest/", "/tests/")
"""Code that is no part of the command: the device, and what looks at it."""
PARTS = 4
"""A command has so many tests: each has an end within five minutes, also where every line is tried."""
PLACES = 2
"""Of the lines, where each came first and last, one in so many times the share of other products is tried."""

WRITING = [
    *((family, line, halt) for family in FAMILIES for line, halt in (facts_of(family).unwatched or {}).items()),
    *(
        (
            family,
            f"{name} {shlex.join(facts_of(family).words(name, Path('{dir}')))}",
            (facts_of(family).halts or {}).get(name, b""),
        )
        for family in FAMILIES
        for name, command in commands(family)
        if command.writes and not command.stops and (family, name) not in ELSEWHERE
    ),
]
"""Family, command and what stops what it has set going, b"" = nothing has to."""


class Stepper:
    """Follows the program line by line once it has sent something; at the step number `at` comes Ctrl-C."""

    def __init__(self, at: int = -1) -> None:
        self.at = at
        self.steps: list[tuple[str, int]] = []
        self.began = False

    def call(self, frame: FrameType, _event: str, _arg: object) -> Any:
        """What the interpreter asks at each call: who follows its lines."""
        name = frame.f_code.co_filename
        return None if name.startswith("<") or any(part in name for part in SKIPPED) else self.line

    def line(self, frame: FrameType, event: str, _arg: object) -> Any:
        if self.began and event == "line":
            self.steps.append((frame.f_code.co_filename, frame.f_lineno))
            if len(self.steps) - 1 == self.at:
                signal.raise_signal(signal.SIGINT)
        return self.line

    def telling(self, speak: Any) -> Any:
        def spoken(*args: Any) -> Any:
            self.began = True
            return speak(*args)

        return spoken

    @contextmanager
    def following(self) -> Iterator[None]:
        handler, tracer = signal.getsignal(signal.SIGINT), sys.gettrace()
        signal.signal(signal.SIGINT, signal.default_int_handler)
        try:
            with (
                mock.patch.object(FakeLink, "write", self.telling(FakeLink.write)),
                mock.patch.object(FakeFrames, "send", self.telling(FakeFrames.send)),
            ):
                sys.settrace(self.call)
                try:
                    yield
                finally:
                    sys.settrace(tracer)
        finally:
            signal.signal(signal.SIGINT, handler)

    @property
    def places(self) -> list[int]:
        """The first and the last step at each line."""
        first: dict[tuple[str, int], int] = {}
        last: dict[tuple[str, int], int] = {}
        for number, step in enumerate(self.steps):
            first.setdefault(step, number)
            last[step] = number
        return sorted({*first.values(), *last.values()})


class Ended(NamedTuple):
    """How a command ended, and what passed."""

    result: Result
    envelope: dict[str, Any]
    transcript: list[Passed]


def go(family: str, words: str, folder: Path, stepper: Stepper) -> Ended:
    trace, link = folder / "trace.txt", facts_of(family).link(family, words)
    for path in (trace, folder / "b.json"):
        path.unlink(missing_ok=True)
    typed = [word.replace("{dir}", str(folder)) for word in (family, *shlex.split(words))]
    more = ["-y", "-p", link, "--format", "ndjson", "--trace", str(trace)]
    with stepper.following():
        result = run(*typed, *more, env={"XDG_STATE_HOME": str(folder / "state")})
    return Ended(result, json.loads(result.lines[-1])["end"], passed(trace))


@pytest.mark.parametrize("part", range(PARTS))
@pytest.mark.parametrize(("family", "words", "halt"), WRITING, ids=[f"{one[0]} {one[1]}" for one in WRITING])
def test_ctrl_c_at_any_line(family: str, words: str, halt: bytes, part: int, tmp_path: Path, each: int) -> None:
    if not chosen([f"part {part}"], min(each, 4 * PARTS), f"{family} {words}"):
        return
    folder, name = scratch_of(tmp_path), words.split()[0]
    whole = Stepper()
    go(family, words, folder, Stepper())  # an import that is cut off would spoil what comes after it in this process
    usual = go(family, words, folder, whole)
    assert usual.result.code in (0, 7), usual.result
    places = [place for place in whole.places if place % PARTS == part]
    assert len(places) > 50
    wrong = []
    for place in map(int, chosen([str(place) for place in places], each * PLACES, f"{family} {words}")):
        where = "{}:{}".format(*whole.steps[place])
        with bounded(SECONDS, where):
            ended = go(family, words, folder, Stepper(place))
        try:
            judged(family, name, halt, ended, usual)
        except AssertionError as exc:
            wrong.append(f"{where}: {exc}")
    assert not wrong, f"{len(wrong)} of {len(places)}:\n" + "\n".join(wrong)


def judged(family: str, name: str, halt: bytes, ended: Ended, usual: Ended) -> None:
    """Raise AssertionError where it tells less than happened, or has not stopped what it says to have ended."""
    over, idle = facts_of(family).over, facts_of(family).idle
    done = ended.result.code == usual.result.code
    assert done or ended.result.code == 130, ended.result
    assert ended.envelope["device"] is not None, "the envelope knows of no device"
    went = wrote(family, name, ended.transcript)
    if went or done:
        writes = ended.envelope["writes"]
        if idle not in went:  # the prompt before it was lost with Ctrl-C: the ledger takes it for the end of a movement
            writes = [step for step in writes if in_bytes(step["bytes"]) != idle]
        judge(family, name, writes, ended.transcript)
    if done:
        assert went == wrote(family, name, usual.transcript), "it says to have done its work"
    elif halt and went and not went[-1].startswith(halt):
        sent = max(place for place, entry in enumerate(ended.transcript) if entry.data == went[-1])
        came = b"".join(entry.data for entry in ended.transcript[sent:] if entry.mark == "<")
        assert over and came.endswith(over), f"not stopped: {ended.result.err}"
