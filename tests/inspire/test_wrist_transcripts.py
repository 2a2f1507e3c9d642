"""The third book of the wrist, on both wires: every `>` comes from the host, every `<` is taken; the simulator agrees.

The meaning of the `#` comments is explained in tests/transcripts/README.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

from handctl.cli import main
from handctl.command.get_set_watch import select
from handctl.devices.inspire.wrist import raw
from handctl.devices.inspire.wrist.device import Wrist
from handctl.devices.inspire.wrist.register_map import WRIST
from handctl.errors import HandctlError, UsageError
from handctl.link import ByteLink, CanFrame, FrameLink
from handctl.link.transcript import Entry, parse
from handctl.model.result import Table
from handctl.sim import create
from tests.inspire.wrist_support import Arrival, ScriptedFrames, can, fake_port, wrist_on
from tests.support.each_row import each_row
from tests.support.scripted import ScriptedLink, hexed, unhex
from tests.support.transcripts import AFTER, BEFORE, EXIT_CODES, FOLDER, KINDS, Case, read_cases

CASES = [case for path in sorted(FOLDER.glob("wrist-*.txt")) for case in read_cases(path)]
READ_FLAGS = (0x30, 0x11)
FOREIGN = ("10FF0007 [1] 02", "10FF0007 [2] 00 00", "00000001 [0]", "1FFFFFFF [8] 11 22 33 44 55 66 77 88")
"""The traffic of others: another hand, a flag-0 frame of no length, an identifier of all ones."""


@dataclass
class Exchange:
    """One request and what came before the next one, with the delay of each piece."""

    request: Entry
    replies: list[tuple[float, Entry]] = field(default_factory=list)


def exchanges_of(case: Case) -> list[Exchange]:
    found: list[Exchange] = []
    asked = 0.0
    for entry in parse(case.lines, case.name):
        if entry.mark == ">":
            asked = entry.time or 0.0
            found.append(Exchange(entry))
        else:
            found[-1].replies.append(((entry.time or asked) - asked, entry))
    return found


def on_can(case: Case) -> bool:
    return case.name.startswith("wrist-can/")


def text_of(entry: Entry) -> str:
    return hexed(entry.data) if entry.can_id is None else str(CanFrame(entry.can_id, entry.data))


def named(cases: list[Case]) -> list[object]:
    return [pytest.param(case, id=case.name) for case in cases]


HOST_CASES = [case for case in CASES if case.kind != "never"]
SERIAL, CAN = ([case for case in HOST_CASES if on_can(case) is wanted] for wanted in (False, True))
NEVER = named([case for case in CASES if case.kind == "never"])
SIM_CASES = [case for case in CASES if "sim" in case.says]


# -- the files themselves ---------------------------------------------------------------------------------------------


def test_files_say_what_they_mean() -> None:
    assert (len(SERIAL), len(CAN), len(NEVER)) >= (30, 20, 6)
    assert len({case.name for case in CASES}) == len(CASES)
    for case in CASES:
        assert case.kind in KINDS, case.name
        assert exchanges_of(case), case.name
        assert "host" in case.says, case.name
        assert ("gives" in case.says) != ("fails" in case.says), case.name
        assert (case.kind in ("reject", "never")) == ("fails" in case.says), case.name
        assert case.kind == "never" or ("sim" in case.says) != ("not" in case.says), case.name
        for entry in parse(case.lines):
            assert (entry.can_id is not None) == on_can(case), case.name


def test_every_serial_request_has_its_sum_and_the_wrists_flag() -> None:
    """By hand: low byte of the sum between header and sum; 30/31 or, for the hand, 11/12 (wrist §2.2)."""
    for case in CASES:
        for request in (exchange.request.data for exchange in exchanges_of(case) if not on_can(case)):
            assert request[:2] == unhex("EB 90"), case.name
            assert request[3] == len(request) - 5, case.name
            assert sum(request[2:-1]) % 256 == request[-1], case.name
            assert request[4] in ((0x11, 0x12) if "/hand-" in case.name else (0x30, 0x31)), case.name


def test_every_section_with_bytes_has_a_case() -> None:
    text = " ".join(path.read_text(encoding="utf-8") for path in FOLDER.glob("wrist-*.txt"))
    for section in ("wrist §1", "wrist §2.1", "wrist §2.2", "wrist §2.2.1", "wrist §2.3", "wrist §2.3.1", "§2.3.2"):
        assert section in text, section


def test_unmarked_entries_are_not_lost() -> None:
    paths = FOLDER.glob("wrist-*.txt")
    entries = [entry for path in paths for entry in parse(path.read_text(encoding="utf-8").splitlines())]
    inside = sum(len(exchange.replies) + 1 for case in CASES for exchange in exchanges_of(case))
    assert len(entries) == inside


# -- the host ---------------------------------------------------------------------------------------------------------


class Player:
    """Answers exactly the requests of a case, in order.

    A read may be repeated; then it gets the same replies again. Anything else that was not recorded is an error.
    """

    def __init__(self, case: Case, feed: str) -> None:
        self._exchanges = exchanges_of(case)
        self._feed = feed
        self._position = -1
        self.repeated_although_answered = 0

    def _next(self, sent: str, reads: bool) -> list[tuple[float, Entry]]:
        following = self._exchanges[self._position + 1 : self._position + 2]
        current = self._exchanges[self._position] if self._position >= 0 else None
        expected = bool(following) and text_of(following[0].request) == sent
        if current is not None and reads and text_of(current.request) == sent and not expected:
            self.repeated_although_answered += bool(current.replies)
            return current.replies
        self._position += 1
        assert following, f"never recorded: {sent}"
        assert sent == text_of(following[0].request)
        return following[0].replies

    def serial(self, request: bytes) -> Iterator[tuple[float, bytes]]:
        replies = self._next(hexed(request), request[4] in READ_FLAGS)
        for number, (delay, entry) in enumerate(replies):
            data = entry.data
            if self._feed == "byte by byte":
                yield from ((delay + place * 0.0001, data[place : place + 1]) for place in range(len(data)))
            elif self._feed == "with garbage around":
                yield delay, BEFORE * (number == 0) + data + AFTER * (number == len(replies) - 1)
            else:
                yield delay, data

    def frames(self, request: CanFrame) -> Iterator[Arrival]:
        replies = self._next(str(request), request.can_id >> 26 in (0, 4))
        around = [can(text) for text in FOREIGN] if self._feed == "with traffic around" else []
        for delay, entry in replies:
            yield from ((delay, frame) for frame in around)
            yield delay, CanFrame(entry.can_id or 0, entry.data)
        yield from ((0.001, frame) for frame in around if replies)

    @property
    def finished(self) -> bool:
        return self._position == len(self._exchanges) - 1


def link_of(case: Case, player: Player) -> ByteLink | FrameLink:
    return ScriptedFrames(player.frames) if on_can(case) else ScriptedLink(player.serial)


def act(wrist: Wrist, words: list[str]) -> str:
    """Let the host do what a `# host` line says; what it gives as text."""
    match words:
        case ["get", *names]:
            table = wrist.table(wrist.read(select(WRIST, tuple(names))))
        case ["dump"]:
            table = wrist.dump()
        case ["read", address, count]:
            return hexed(wrist.bus.read(int(address), int(count)))
        case ["set", *assignments]:
            table = wrist.table(wrist.write(WRIST.assignments(assignments)))
        case ["write", address, data]:
            raw.plan_write(wrist, int(address), unhex(data))
            table = raw.write(wrist, int(address), unhex(data))
        case ["hand-read", address, count]:
            return raw_of(raw.hand_read(wrist, int(address), int(count)))
        case ["hand-write", address, data]:
            hand = raw.carrier(wrist)
            raw.plan_hand_writes(hand, int(address), unhex(data), force=False, undocumented=False)
            return raw_of(raw.hand_write(hand, int(address), unhex(data)))
        case _:
            raise AssertionError(f"unknown action {words}")
    if table.failure is not None:
        raise table.failure
    return " ".join(str(row["value"]) for row in table.rows)


def raw_of(table: Table) -> str:
    if table.failure is not None:
        raise table.failure
    (row,) = table.rows
    return str(row["raw"])


@each_row(
    ("case", "feed"),
    [
        *(
            pytest.param(case, feed, id=f"{case.name}-{feed}")
            for case in SERIAL
            for feed in ("whole", "byte by byte", "with garbage around")
        ),
        *(
            pytest.param(case, feed, id=f"{case.name}-{feed}")
            for case in CAN
            for feed in ("alone", "with traffic around")
        ),
    ],
)
def test_host_sends_and_takes(case: Case, feed: str) -> None:
    player = Player(case, feed)
    wrist = wrist_on(link_of(case, player), case.device_id)
    if "gives" in case.says:
        assert act(wrist, case.says["host"].split()) == case.says["gives"]
        assert player.repeated_although_answered == 0
    else:
        with pytest.raises(HandctlError) as caught:
            act(wrist, case.says["host"].split())
        if feed in ("whole", "byte by byte", "alone"):
            assert caught.value.code == case.says["fails"]
            assert caught.value.exit_code == EXIT_CODES[case.says["fails"]]
        else:
            assert caught.value.exit_code in (EXIT_CODES[case.says["fails"]], 5)
    assert player.finished or (
        "fails" in case.says and feed == "with garbage around"
    )  # of that no form is known, and nothing more is asked


@pytest.mark.parametrize("case", named([case for case in CASES if case.kind == "twin"]))
def test_a_twin_is_not_taken_from_an_echo(case: Case) -> None:
    wrist = wrist_on(ScriptedLink(lambda request: [(0.0, request)]), case.device_id)
    with pytest.raises(HandctlError) as caught:
        act(wrist, case.says["host"].split())
    assert (caught.value.code, caught.value.exit_code) == ("echo", 5)


@each_row("case", NEVER)
def test_host_refuses_to_plan(case: Case) -> None:
    (exchange,) = exchanges_of(case)
    with pytest.raises(UsageError) as caught:
        if on_can(case):
            raw.plan_can(raw.parse_can(text_of(exchange.request)), False)
        else:
            raw.plan_raw(exchange.request.data, False)
    assert caught.value.code == case.says["fails"]


@pytest.mark.parametrize("case", NEVER)
def test_host_refuses_to_send(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
    (exchange,) = exchanges_of(case)
    port = fake_port("can" if on_can(case) else "serial")
    assert main(["wrist", "raw", *text_of(exchange.request).split(), "-p", port, "--yes", "--json"]) == 2
    assert '"sent": 0' in capsys.readouterr().out


# -- the simulator ----------------------------------------------------------------------------------------------------


def options_of(case: Case) -> dict[str, str]:
    text = case.says["sim"]
    return dict(item.split("=") for item in text.split("&")) if text != "healthy" else {}


@each_row("feed", ["whole", "byte by byte"])
@each_row("case", named([case for case in SIM_CASES if not on_can(case)]))
def test_simulator_answers_on_the_serial_line(case: Case, feed: str) -> None:
    line = create("wrist", options_of(case))
    now = 0.0
    line.advance(now)
    for exchange in exchanges_of(case):
        asked, request = now, exchange.request.data
        for piece in [request] if feed == "whole" else [bytes([byte]) for byte in request]:
            line.feed(piece)
        wanted = b"".join(entry.data for _, entry in exchange.replies)
        heard = line.take()
        while len(heard) < len(wanted) and (event := line.next_event()) is not None and event < asked + 10.0:
            now = max(now, event)
            line.advance(now)
            heard += line.take()
        now += 0.5
        line.advance(now)
        assert hexed(heard + line.take()) == hexed(wanted)


@each_row("case", named([case for case in SIM_CASES if on_can(case)]))
def test_simulator_answers_on_can(case: Case) -> None:
    line = create("wrist", {"bus": "can", **options_of(case)})
    now = 0.0
    line.advance(now)
    for exchange in exchanges_of(case):
        line.feed_frame(exchange.request.can_id, exchange.request.data)
        now += 0.5
        line.advance(now)
        heard = [str(CanFrame(*frame)) for frame in line.take_frames()]
        assert heard == [text_of(entry) for _, entry in exchange.replies]


# -- replay -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("wire", ["serial", "can"])
def test_a_transcript_file_is_a_device(wire: str, capsys: pytest.CaptureFixture[str]) -> None:
    port = f"replay:{FOLDER / f'wrist-{wire}.txt'}"
    assert main(["wrist", "get", "pitch_actual", "--format", "plain", "--port", port]) == 0
    assert capsys.readouterr().out.split() == ["-3.45"]
    assert main(["wrist", "set", "pitch_set=-10", "yaw_set=10", "--format", "plain", "--port", port]) == 0
