"""The third book: every `>` of tests/transcripts comes from the host, every `<` is taken; the simulator says the same.

The meaning of the `#` comments is explained in tests/transcripts/README.md.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from handctl.cli import main
from handctl.command.get_set_watch import select
from handctl.devices.inspire import id_baud_save_reset
from handctl.devices.inspire.exo import calibration, raw
from handctl.devices.inspire.exo.device import ExoHand
from handctl.devices.inspire.exo.register_map import EXO
from handctl.errors import HandctlError, UsageError
from handctl.link.transcript import Entry, parse
from handctl.model.prompts import Prompts
from handctl.model.result import Table
from handctl.sim import create
from tests.support.each_row import each_row
from tests.support.scripted import Reply, ScriptedLink, codes, hand_on, hexed, unhex
from tests.support.transcripts import AFTER, BEFORE, EXIT_CODES, FOLDER, KINDS, Case, read_cases

CASES = [case for path in sorted(FOLDER.glob("exo-*.txt")) for case in read_cases(path)]


def named(cases: list[Case]) -> list[object]:
    return [pytest.param(case, id=case.name) for case in cases]


HOST_CASES = named([case for case in CASES if case.kind != "never"])
SIM_CASES = named([case for case in CASES if "sim" in case.says])


# -- the files themselves ---------------------------------------------------------------------------------------------


def test_files_say_what_they_mean() -> None:
    assert len(CASES) >= 50
    assert len({case.name for case in CASES}) == len(CASES)
    for case in CASES:
        assert case.kind in KINDS, case.name
        assert case.exchanges, case.name
        assert "host" in case.says, case.name
        assert ("gives" in case.says) != ("fails" in case.says), case.name
        assert (case.kind in ("reject", "never")) == ("fails" in case.says), case.name
        assert case.kind == "never" or ("sim" in case.says) != ("not" in case.says), case.name


def test_every_frame_of_a_request_has_its_sum() -> None:
    """By hand: low byte of the sum between header and sum (exo §2.2.1 note 2)."""
    for case in CASES:
        for exchange in case.exchanges:
            frame = exchange.request
            assert frame[:2] == unhex("EB 90"), case.name
            assert frame[3] == len(frame) - 5, case.name
            assert sum(frame[2:-1]) % 256 == frame[-1], case.name


def test_every_section_with_bytes_has_a_case() -> None:
    text = " ".join(path.read_text(encoding="utf-8") for path in FOLDER.glob("exo-*.txt"))
    sections = [f"§2.2.{n}" for n in range(1, 5)] + [f"§2.3.{n}" for n in range(1, 14)]
    assert [section for section in sections if section not in text] == []


# -- the host ---------------------------------------------------------------------------------------------------------


class Player:
    """Answers exactly the requests of a case, in order.

    A read may be repeated; then it gets the same replies again. Anything else that was not recorded is an error.
    """

    def __init__(self, case: Case, feed: str) -> None:
        self._exchanges = case.exchanges
        self._feed = feed
        self._position = -1
        self.repeated_although_answered = 0

    def __call__(self, request: bytes) -> Iterator[Reply]:
        current = self._exchanges[self._position] if self._position >= 0 else None
        if current is not None and request == current.request and request[4] == 0x11 and not self._expects(request):
            self.repeated_although_answered += bool(current.replies)
        else:
            self._position += 1
            assert self._position < len(self._exchanges), f"never recorded: {hexed(request)}"
            current = self._exchanges[self._position]
            assert hexed(request) == hexed(current.request)
        for number, (delay, data) in enumerate(current.replies):
            yield from self._pieces(delay, data, number == 0, number == len(current.replies) - 1)

    def _expects(self, request: bytes) -> bool:
        following = self._exchanges[self._position + 1 : self._position + 2]
        return bool(following) and following[0].request == request

    def _pieces(self, delay: float, data: bytes, first: bool, last: bool) -> Iterator[Reply]:
        if self._feed == "byte by byte":
            for number, byte in enumerate(data):
                yield delay + number * 0.0001, bytes([byte])
        elif self._feed == "with garbage around":
            yield delay, BEFORE * first + data + AFTER * last
        else:
            yield delay, data

    @property
    def finished(self) -> bool:
        return self._position == len(self._exchanges) - 1


def act(hand: ExoHand, words: list[str]) -> Table | str:
    """Let the host do what a `# host` line says."""
    prompts = Prompts()
    match words:
        case ["get", *names]:
            return hand.table(hand.read(select(EXO, tuple(names))))
        case ["dump"]:
            return hand.dump()
        case ["read", address, count]:
            return hexed(hand.bus.read(int(address), int(count)))
        case ["probe", device_id]:
            return str(id_baud_save_reset.probe(hand.bus, int(device_id)))
        case ["set", *assignments]:
            return hand.table(hand.write(EXO.assignments(assignments)))
        case ["id", new]:
            return id_baud_save_reset.change_id(hand, int(new))
        case ["baud", rate]:
            return id_baud_save_reset.change_baud(hand, int(rate))
        case ["clear-errors"]:
            return id_baud_save_reset.clear_errors(hand)
        case ["save"]:
            return id_baud_save_reset.save(hand, prompts)
        case ["factory-reset"]:
            return id_baud_save_reset.factory_reset(hand)
        case ["calibrate"]:
            return calibration.calibrate(hand, prompts)
        case ["force" | "position", *values]:
            return hand.command(words[0], [int(value) for value in values])
    raise AssertionError(f"unknown action {words}")


def command_line(result: Table | str) -> str:
    if isinstance(result, str):
        return result
    if result.failure is not None:
        raise result.failure
    return " ".join(str(row["value"]) for row in result.rows)


@each_row("feed", ["whole", "byte by byte", "with garbage around"])
@each_row("case", HOST_CASES)
def test_host_sends_and_takes(case: Case, feed: str) -> None:
    player = Player(case, feed)
    hand = hand_on(ScriptedLink(player), case.device_id)
    if "gives" in case.says:
        assert command_line(act(hand, case.says["host"].split())) == case.says["gives"]
        assert player.repeated_although_answered == 0
    else:
        with pytest.raises(HandctlError) as caught:
            command_line(act(hand, case.says["host"].split()))
        if feed != "with garbage around":
            assert caught.value.code == case.says["fails"]
        assert caught.value.exit_code == EXIT_CODES[case.says["fails"]]
    assert player.finished or (
        "fails" in case.says and feed == "with garbage around"
    )  # of that no form is known, and nothing more is asked
    if "notes" in case.says:
        assert case.says["notes"] in codes(hand)


@pytest.mark.parametrize("case", named([case for case in CASES if case.kind == "twin"]))
def test_a_twin_is_not_taken_from_an_echo(case: Case) -> None:
    hand = hand_on(ScriptedLink(lambda request: [(0.0, request)]), case.device_id)
    with pytest.raises(HandctlError) as caught:
        act(hand, case.says["host"].split())
    assert (caught.value.code, caught.value.exit_code) == ("echo", 5)


@pytest.mark.parametrize("case", named([case for case in CASES if case.kind == "never"]))
def test_host_refuses_to_send(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
    (exchange,) = case.exchanges
    with pytest.raises(UsageError) as caught:
        raw.plan_raw(exchange.request, False)
    assert caught.value.code == case.says["fails"]
    assert main(["exo", "raw", hexed(exchange.request), "--port", "fake://exo?clock=virtual", "--yes", "--json"]) == 2
    assert '"sent": 0' in capsys.readouterr().out


# -- the simulator ----------------------------------------------------------------------------------------------------


@each_row("feed", ["whole", "byte by byte"])
@each_row("case", SIM_CASES)
def test_simulator_answers(case: Case, feed: str) -> None:
    text = case.says["sim"]
    options = dict(item.split("=") for item in text.split("&")) if text != "healthy" else {}
    line = create("exo", options)
    now = 0.0
    line.advance(now)
    for exchange in case.exchanges:
        asked = now
        for piece in [exchange.request] if feed == "whole" else [bytes([byte]) for byte in exchange.request]:
            line.feed(piece)
        wanted = b"".join(data for _, data in exchange.replies)
        heard = line.take()
        while len(heard) < len(wanted) and (event := line.next_event()) is not None and event < asked + 60.0:
            now = max(now, event)
            line.advance(now)
            heard += line.take()
        assert hexed(heard) == hexed(wanted)
        if exchange.replies:
            assert now - asked == pytest.approx(exchange.replies[-1][0], abs=0.05)
        else:
            now += 0.5
            line.advance(now)
            assert hexed(line.take()) == ""


# -- replay -----------------------------------------------------------------------------------------------------------


def test_a_transcript_file_is_a_device(capsys: pytest.CaptureFixture[str]) -> None:
    port = f"replay:{FOLDER / 'exo-registers.txt'}"
    assert main(["exo", "get", "temperature", "--format", "plain", "--port", port]) == 0
    assert capsys.readouterr().out.split() == ["31", "32", "33", "34", "35"]
    assert main(["exo", "dump", "--format", "plain", "--port", port]) == 0


def test_unmarked_entries_are_not_lost() -> None:
    entries: list[Entry] = [entry for path in FOLDER.glob("exo-*.txt") for entry in parse(path.open(encoding="utf-8"))]
    inside = sum(len(exchange.replies) + 1 for case in CASES for exchange in case.exchanges)
    assert len(entries) == inside
