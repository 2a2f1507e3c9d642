"""Every vector of the RH56 dossier §4, request and answer byte for byte; those that are never sent are answered here too."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from handctl.sim import create
from tests.sim.hand.bench import TRANSCRIPTS, Bench
from tests.support.each_row import each_row

GROUPS = 54


class Case:
    def __init__(self, text: str) -> None:
        head, *lines = text.splitlines()
        self.name, _, self.kind = head.partition(": ")
        said = [line[2:].partition(" ") for line in lines if line.startswith("# ")]
        self.sim = next((rest for word, _, rest in said if word == "sim"), None)
        self.state = [rest for word, _, rest in said if word == "state"]
        self.lines = [match.groups() for line in lines if (match := re.match(r"([\d.]+ )?([<>]) (.*)", line))]


def cases() -> Iterator[Case]:
    for path in sorted(TRANSCRIPTS.glob("hand-*.txt")):
        for text in path.read_text(encoding="utf-8").split("\n# case ")[1:]:
            yield Case(text)


CASES = list(cases())
SHOWN = [case for case in CASES if case.sim is not None]


def made(case: Case) -> Any:
    options = dict(item.split("=") for item in (case.sim or "").split("&"))
    line = create("hand", options)
    line.advance(0.0)
    for text in case.state:
        line.command(text)
    return line


def frame_of(text: str) -> tuple[int, bytes]:
    """can IDENTIFIER [DLC] HEX"""
    words = text.split()
    assert words[0] == "can"
    assert int(words[2].strip("[]")) == len(words) - 3
    return int(words[1], 16), bytes.fromhex("".join(words[3:]))


def test_every_group_is_there() -> None:
    assert {case.name.split("-")[0] for case in CASES} >= {f"v{number}" for number in range(1, GROUPS + 1)}


@each_row("piece", [4096, 1])
@each_row("case", [case for case in SHOWN if "bus=can" not in str(case.sim)], ids=lambda case: case.name)
def test_answers_on_a_byte_line(case: Case, piece: int) -> None:
    line, now = made(case), 0.0
    for time, mark, text in case.lines:
        if mark == ">":
            assert line.take() == b""
            data = bytes.fromhex(text)
            for place in range(0, len(data), piece):
                line.feed(data[place : place + piece])
            now += 0.002  # the silence behind Modbus RTU
        elif time:
            line.advance(now + float(time) - 0.003)
            assert line.take() == b"", "too early"
            now += float(time)
        line.advance(now)
        if mark == "<":
            assert line.take().hex(" ").upper() == text
    assert line.take() == b""


@each_row("case", [case for case in SHOWN if "bus=can" in str(case.sim)], ids=lambda case: case.name)
def test_answers_on_can(case: Case) -> None:
    line = made(case)
    for _, mark, text in case.lines:
        identifier, data = frame_of(text)
        if mark == ">":
            line.feed_frame(identifier, data)
            line.advance(0.001)
        else:
            assert line.take_frames() == [(identifier, data)]
    assert line.take_frames() == []


# -- what is never sent unasked ---------------------------------------------------------------------------------------

NEVER = {case.name: [text for _, _, text in case.lines] for case in CASES if case.kind == "never"}
RESET, RUN = NEVER["v24-never"]
SAVE, CLEAR = NEVER["v30-never"]


@each_row(
    ("model", "frame", "acts"),
    [
        ("df", RESET, {"factory-reset": 1}),
        ("tp", RESET, {"factory-reset": 1}),
        ("f1", RESET, {}),
        ("dg2", RESET, {}),
        ("df", RUN, {"run": 1}),
        ("tp", RUN, {}),
        ("f1", RUN, {}),
        ("dg2", RUN, {}),
        ("df", SAVE, {"save": 1}),
        ("tp", SAVE, {"save": 1}),
        ("f1", SAVE, {"factory-reset": 1}),
        ("dg2", SAVE, {"factory-reset": 1}),
        ("df", CLEAR, {"clear": 1}),
        ("tp", CLEAR, {"clear": 1}),
        ("f1", CLEAR, {"save": 1}),
        ("dg2", CLEAR, {"save": 1}),
    ],
)
def test_each_generation_does_what_its_registers_say(model: str, frame: str, acts: dict[str, int]) -> None:
    bench = Bench(model=model)
    assert bench.ask(frame, 0.0) == f"90 EB{frame[5:]}", "it acknowledges all of them"
    assert bench.acts() == acts


def test_default_forces_of_a_df_move_an_f1() -> None:
    """1044 is ANGLE_SET of its thumb (dossier Q4)."""
    frame = "EB 90 01 0F 12 14 04 4C 04 20 03 20 03 20 03 20 03 20 03 "
    frame += f"{sum(bytes.fromhex(frame)[2:]) % 256:02X}"
    still, moved = Bench(model="df"), Bench(model="f1")
    for bench in (still, moved):
        bench.ask(frame, 3.0)
    assert still.acts() == {"settings": 5}, "one is above 1000 g"
    assert moved.acts() == {"move": 2, "force": 4}
    assert moved.words(1064)[4:] == [1100, 800]
