"""The third book of the BarrettHand: every `>` comes from the host, every `<` is taken; the simulator says the same.

The meaning of the `#` comments is explained in tests/transcripts/README.md.
"""

from __future__ import annotations

import pytest

from handctl.cli import main
from handctl.command.get_set_watch import select
from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.codec import Answer
from handctl.devices.barrett.parameter_map import BARRETT
from handctl.link.transcript import parse
from handctl.sim import create
from tests.barrett.support import ABORT, CR, MET, PROMPT, QUESTION, hand_on
from tests.support.each_row import each_row
from tests.support.scripted import Reply, ScriptedLink, hexed
from tests.support.transcripts import FOLDER, Case, read_cases

CASES = [case for path in sorted(FOLDER.glob("barrett-supervisory*.txt")) for case in read_cases(path)]
FEEDS = ("whole", "byte by byte", "cr lf", "bare prompt", "bare prompt byte by byte")


def named(cases: list[Case]) -> list[object]:
    return [pytest.param(case, id=case.name) for case in cases]


# -- the files themselves ---------------------------------------------------------------------------------------------


def test_files_say_what_they_mean() -> None:
    assert len(CASES) >= 40
    assert len({case.name for case in CASES}) == len(CASES)
    for case in CASES:
        assert case.kind == "accept", case.name
        assert {"host", "gives"} <= case.says.keys(), case.name
        assert ("sim" in case.says) != ("not" in case.says), case.name
        for exchange in case.exchanges:
            command = exchange.request
            assert command == ABORT or command.endswith(CR), case.name
            assert len(command) <= 71, case.name
            assert b"\n" not in command, case.name
            if command not in (ABORT, CR):
                assert exchange.replies[0][1].startswith(command[:-1]), f"{case.name}: echo"


def test_every_line_of_the_files_is_in_a_case() -> None:
    entries = [
        entry for path in FOLDER.glob("barrett-supervisory*.txt") for entry in parse(path.open(encoding="utf-8"))
    ]
    assert len(entries) == sum(1 + len(exchange.replies) for case in CASES for exchange in case.exchanges)


def test_every_status_that_the_supervisory_line_can_give() -> None:
    """T3 without the electronics' 1 and 2, RealTime's 2048 and the unused ones."""
    seen = {int(case.says["gives"].rpartition("status ")[2]) for case in CASES if "status" in case.says["gives"]}
    assert {0, 4, 16, 20, 32, 64, 128, 256, 1024, 4096, 8192, 16384} <= seen


# -- the host ---------------------------------------------------------------------------------------------------------


class Player:
    """Answers exactly the requests of a case, in order; the connection before it is no part of it."""

    def __init__(self, case: Case, feed: str) -> None:
        self.exchanges = case.exchanges
        self.feed = feed
        self.position = -1  # the question of the connection
        self.interrupts = "abort" in case.says["host"]

    def __call__(self, request: bytes) -> list[Reply]:
        if self.position < 0:
            assert request == QUESTION
            self.position += 1
            return self._pieces(MET)
        assert self.position < len(self.exchanges), f"never recorded, so {hexed(request)}"
        current = self.exchanges[self.position]
        assert hexed(request) == hexed(current.request)
        self.position += 1
        return [piece for _, data in current.replies for piece in self._pieces(data)]

    def _pieces(self, data: bytes) -> list[Reply]:
        if "cr lf" in self.feed:
            data = data.replace(b"\n\r", b"\r\n")
        if "bare prompt" in self.feed and data.endswith(b"=> "):
            data = data[:-1]
        if "byte by byte" in self.feed:
            return [(0.0005 * place, bytes([byte])) for place, byte in enumerate(data)]
        return [(0.0, data)]


def command_line(answer: Answer) -> str:
    return f"{'|'.join(answer.lines)} status {answer.status}".strip()


def act(hand: BarrettHand, link: ScriptedLink, text: str) -> str:
    """Let the host do what a `# host` line says."""
    verb, _, rest = text.partition(" ")
    match verb:
        case "gcl":
            return command_line(hand.line.ask(rest))
        case "get":
            readings = hand.read(select(BARRETT, tuple(rest.split())))
        case "set":
            readings = hand.write(BARRETT.assignments_on(rest.split(), BARRETT["position"].elements))
        case "baud":
            readings = hand.write([(BARRETT.find("BAUD")[1][0], int(rest))])
            assert link.baud == int(rest) * 100
        case "abort":
            link.interrupt_at = link.clock + 0.5
            with pytest.raises(KeyboardInterrupt):
                hand.line.ask(rest)
            answer = hand.line.abort()
            assert answer is not None
            return command_line(answer)
        case _:
            raise AssertionError(f"unknown action {text}")
    assert [reading.error for reading in readings if reading.error] == []
    return " ".join(str(reading.value) for reading in readings)


@each_row("feed", FEEDS)
@each_row("case", named(CASES))
def test_host_sends_and_takes(case: Case, feed: str) -> None:
    player = Player(case, feed)
    link = ScriptedLink(player, 9600)
    hand = hand_on(link)
    hand.line.connect()
    assert act(hand, link, case.says["host"]) == case.says["gives"]
    assert player.position == len(player.exchanges)
    assert hand.journal.counters.retries == 0


# -- the simulator ----------------------------------------------------------------------------------------------------


@each_row("feed", ["whole", "byte by byte"])
@each_row("case", named([case for case in CASES if "sim" in case.says]))
def test_simulator_answers(case: Case, feed: str) -> None:
    text = case.says["sim"]
    line = create("barrett", dict(item.split("=") for item in text.split("&")) if text != "healthy" else {})
    now = 0.0
    line.advance(now)
    for exchange in case.exchanges:
        for piece in [exchange.request] if feed == "whole" else [bytes([byte]) for byte in exchange.request]:
            line.feed(piece)
        wanted = b"".join(data for _, data in exchange.replies)
        heard = line.take()
        until = now + 60.0
        while len(heard) < len(wanted) and (event := line.next_event()) is not None and event < until:
            now = max(now, event)
            line.advance(now)
            heard += line.take()
        if exchange.request.startswith(b"PSET BAUD"):  # what follows the echo has the new speed
            heard = heard[: len(wanted)]
        assert hexed(heard) == hexed(wanted)
        assert hexed(line.take()) == ""


# -- replay -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("start", [
    [f"> {hexed(QUESTION)}", f"< {hexed(MET)}"],
    [f"> {hexed(ABORT)}", f"< {hexed(PROMPT)}", f"> {hexed(CR)}", f"< {hexed(PROMPT)}"],  # as recorded until 0.1
])  # fmt: skip
def test_a_transcript_file_is_a_device(start: list[str], tmp_path: object, capsys: pytest.CaptureFixture[str]) -> None:
    (case,) = [case for case in CASES if case.name.endswith("/temperature")]
    file = tmp_path / "session.txt"  # type: ignore[operator]
    file.write_text("\n".join([*start, *case.lines]) + "\n", encoding="utf-8")
    assert main(["barrett", "get", "TEMP", "UPSECS", "--format", "plain", "-p", f"replay:{file}"]) == 0
    assert capsys.readouterr().out.split() == ["412", "7345678"]
