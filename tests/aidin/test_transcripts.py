"""The third book of the AIDIN-hand: every `>` comes from the host, every `<` is taken; the simulator answers the poll.

The meaning of the `#` comments is explained in tests/transcripts/README.md. A `<` without `>` is streamed.
"""

from __future__ import annotations

import json

import pytest

from handctl.devices.aidin.json_codec import Decoder
from handctl.link.transcript import Entry, parse
from handctl.sim import create
from tests.aidin.support import hand_on
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.scripted import ScriptedLink
from tests.support.transcripts import FOLDER, Case, read_cases

CASES = [case for path in sorted(FOLDER.glob("aidin-*.txt")) for case in read_cases(path)]
WORDS = {"case", "host", "gives", "fails", "sim", "not"}


def entries(case: Case) -> list[Entry]:
    return parse(case.lines, case.name)


def sent(case: Case) -> list[bytes]:
    return [entry.data for entry in entries(case) if entry.mark == ">"]


def received(case: Case) -> list[bytes]:
    return [entry.data for entry in entries(case) if entry.mark == "<"]


def named(cases: list[Case]) -> list[object]:
    return [pytest.param(case, id=case.name) for case in cases]


COMMANDS = [case for case in CASES if case.kind == "accept" and not received(case)]
FEEDBACK = [case for case in CASES if received(case)]


def test_files_say_what_they_mean() -> None:
    assert len(CASES) == 14
    assert len({case.name for case in CASES}) == len(CASES)
    for case in CASES:
        assert case.kind in ("accept", "resync", "never"), case.name
        assert ("sim" in case.says) != ("not" in case.says) or case.kind == "never", case.name
        for data in sent(case):
            assert data.endswith(b"}\n") and len(data) <= 2047, case.name
            json.loads(data)
    modes = {json.loads(data).get("hand_mode") for case in COMMANDS for data in sent(case)}
    assert modes == {1, 2, 3, 4, 5, 10, 22, 32, 41}


@each_row("case", named(COMMANDS))
def test_the_host_sends_it(case: Case) -> None:
    result = run("aidin", *case.says["host"].split(), "--dry-run", "--json")
    assert result.code == 0, result
    assert [bytes.fromhex(row["bytes"]) for row in result.rows] == sent(case)


@pytest.mark.parametrize("case", named([case for case in CASES if case.kind == "never"]))
def test_the_host_never_sends_it(case: Case) -> None:
    result = run("aidin", *case.says["host"].split(), "--dry-run", "--json")
    assert (result.code, result.error["code"]) == (2, case.says["fails"])


def last_numbers(case: Case) -> list[tuple[str, float]]:
    """`# gives KEY NUMBER …`: a number of each key (the last but joint_pos and task_space_pos, which have others)."""
    words = case.says["gives"].split()
    return [(key, float(number)) for key, number in zip(words[::2], words[1::2], strict=True)]


@each_row("size", [1, 7, 1448, 10**6])
@each_row("case", named(FEEDBACK))
def test_the_host_takes_it_in_any_pieces(case: Case, size: int) -> None:
    decoder, found = Decoder(), []
    for data in received(case):
        for at in range(0, len(data), size):
            decoder.feed(data[at : at + size])
            while (content := decoder.next()) is not None:
                found += list(content.items())
    wanted = last_numbers(case)
    assert [key for key, _ in found] == [key for key, _ in wanted]
    for (key, number), (_, values) in zip(wanted, found, strict=True):
        assert number in values, key  # type: ignore[operator]


@each_row("case", named([case for case in FEEDBACK if case.kind == "accept"]))
def test_the_host_shows_it(case: Case) -> None:
    data = received(case)
    link = ScriptedLink(lambda request: [(0.001, piece) for piece in data] if sent(case) == [request] else [])
    for number in range(0 if sent(case) else 50):
        for piece in data:
            link.put(0.01 * number, piece)
    table = hand_on(link).dump()
    assert table.failure is None
    wire = json.loads(b"".join(data))
    for key, values in wire.items():
        rows = [row for row in table.rows if row["key"] == key]
        assert [row.get("rad", row["value"]) for row in rows] == values


@pytest.mark.parametrize("case", named([case for case in CASES if "sim" in case.says]))
def test_the_simulator_says_the_same(case: Case) -> None:
    line = create("aidin", dict(word.split("=") for word in case.says["sim"].split("&")))
    line.advance(0.0)
    came = b""
    for request in sent(case):
        line.feed(request)
        line.advance(line.next_event() or 0.1)
        line.advance(0.1)
        came += line.take()
    assert came == b"".join(received(case))
