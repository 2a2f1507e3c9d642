"""Transcripts, replay and the link around a simulator (cli contract, sections 3 and 6)."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handctl.errors import HandctlError, LinkError, UsageError
from handctl.link import ByteLink, CanFrame, Deadline, FrameLink, open_link
from handctl.link.fake import split_url
from handctl.link.transcript import Entry, TraceWriter, observed, parse
from tests.support.cli import PATIENCE, run
from tests.support.each_row import each_row
from tests.support.scripted import ScriptedLink, hand_on, hexed, unhex
from tests.support.virtual import virtual_time

READ_ID, ID_IS_1 = "EB 90 01 04 11 E8 03 01 02", "90 EB 01 04 11 E8 03 01 02"
READ_VOLTAGE, VOLTAGE = "EB 90 01 04 11 C0 05 02 DD", "90 EB 01 05 11 C0 05 2E 02 0C"


# -- parsing ----------------------------------------------------------------------------------------------------------


def one(line: str) -> Entry:
    (entry,) = parse([line])
    return entry


@each_row(
    ("line", "entry"),
    [
        (f"0.000000 > {READ_ID}", Entry(0.0, ">", unhex(READ_ID), "", None, 1)),
        (f"> {READ_ID}", Entry(None, ">", unhex(READ_ID), "", None, 1)),
        ("12.5 < 90 eb", Entry(12.5, "<", b"\x90\xeb", "", None, 1)),
        ("  <  00  FF ", Entry(None, "<", b"\x00\xff", "", None, 1)),
        ("0.1 ! baud 57600", Entry(0.1, "!", b"", "baud 57600", None, 1)),
        ("! power-cycle", Entry(None, "!", b"", "power-cycle", None, 1)),
        ("0.010000 > can 11000001 [1] 04", Entry(0.01, ">", b"\x04", "", 0x11000001, 1)),
        ("< can 15038001 [0]", Entry(None, "<", b"", "", 0x15038001, 1)),
    ],
)
def test_lines(line: str, entry: Entry) -> None:
    assert one(line) == entry


def test_comments_and_empty_lines_are_left_out_but_counted() -> None:
    entries = parse(["# one", "", "   ", f"> {READ_ID}", "  # two", f"< {ID_IS_1}\n"])
    assert [(entry.mark, entry.line) for entry in entries] == [(">", 4), ("<", 6)]


@each_row(
    "line",
    [
        "hello", "> XY", "> 9", "> 999", "> 90EB", "90 EB 01", "0.1", "0.1 0.2 > 90", "0.1 90 EB", "abc > 90", "? 90",
        "> can 11000001", "> can 11000001 [2] 04", "> can xyz [1] 04", "> can 11000001 [x] 04", "> can 11000001 04",
        "> 9\u0660",
    ],
)  # fmt: skip
def test_bad_lines_are_named_by_number(line: str) -> None:
    with pytest.raises(UsageError) as caught:
        parse(["# first", f"> {READ_ID}", line], "some.txt")
    assert caught.value.exit_code == 2
    assert "some.txt, line 3" in caught.value.text


@each_row(
    "line", ["nan > 90", "inf > 90", "-inf < 90", "-1.0 > 90", "> ", "0.5 <", "> can -1 [0]", "> can 20000000 [0]"]
)
def test_lines_that_cannot_have_been_recorded(line: str) -> None:
    """A time is a number of seconds since the start, a frame has bytes, a CAN identifier has 29 bits."""
    with pytest.raises(UsageError) as caught:
        parse([line], "some.txt")
    assert "line 1" in caught.value.text


# -- recording --------------------------------------------------------------------------------------------------------


def test_a_tap_writes_what_passes() -> None:
    lines: list[str] = []
    link = ScriptedLink(lambda request: [(0.00412, unhex(ID_IS_1))], baud=115200)
    link.sleep(100.0)
    tapped = observed(link, TraceWriter(lines.append))
    tapped.write(unhex(READ_ID), tapped.deadline(1.0))
    assert tapped.read(tapped.deadline(1.0)) == unhex(ID_IS_1)
    assert tapped.read(tapped.deadline(0.5)) == b""
    tapped.set_baud(57600)
    tapped.event("hello")
    assert lines == [
        f"0.000000 > {READ_ID}\n",
        f"0.004120 < {ID_IS_1}\n",
        "0.504120 ! baud 57600\n",
        "0.504120 ! hello\n",
    ]
    assert (tapped.baud, link.baud, tapped.name, tapped.can_set_baud) == (57600, 57600, "scripted", True)


def test_a_tap_records_before_the_link_fails() -> None:
    lines: list[str] = []
    tapped = observed(open_link("fake://exo?clock=virtual&fault=disconnect"), TraceWriter(lines.append))
    with pytest.raises(LinkError):
        tapped.write(unhex(READ_ID), tapped.deadline(1.0))
        for _ in range(3):
            tapped.read(tapped.deadline(1.0))
        tapped.write(unhex(READ_ID), tapped.deadline(1.0))
    assert lines[0] == f"0.000000 > {READ_ID}\n"


def test_a_tap_notes_a_power_cycle_and_passes_on_what_the_link_is() -> None:
    lines: list[str] = []
    link = observed(open_link("fake://exo?clock=virtual", baud=57600), TraceWriter(lines.append))
    assert (link.fake, link.baud, link.can_set_baud, link.replayed) == (True, 57600, True, False)
    assert link.power_cycle() is True
    assert lines == ["0.000000 ! power-cycle\n"]
    link.sleep(1.5)
    assert link.now() == 1.5
    assert observed(ScriptedLink(), TraceWriter(lines.append)).power_cycle() is False
    assert len(lines) == 1
    link.close()


def test_times_go_on_over_a_second_opening() -> None:
    lines: list[str] = []
    tap = TraceWriter(lines.append)
    link = ScriptedLink()
    observed(link, tap).event("first")
    link.sleep(2.0)
    tap.opened(link.now())
    link.event("second")
    assert lines == ["0.000000 ! first\n", "2.000000 ! second\n"]


@given(st.lists(st.tuples(st.sampled_from("><"), st.binary(min_size=1, max_size=40)), max_size=20))
def test_what_a_tap_writes_is_what_parse_reads(passed: list[tuple[str, bytes]]) -> None:
    lines: list[str] = []
    tap = TraceWriter(lines.append)
    observed(ScriptedLink(), tap)
    for number, (mark, data) in enumerate(passed):
        tap.passed(number / 1000, mark, data, None)
    assert [(entry.mark, entry.data) for entry in parse(lines)] == passed
    assert [entry.time for entry in parse(lines)] == [number / 1000 for number in range(len(passed))]


# -- replaying --------------------------------------------------------------------------------------------------------


def transcript(folder: Path, *lines: str) -> str:
    path = folder / "t.txt"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return f"replay:{path}"


def test_a_recording_gives_the_same_rows(tmp_path: Path) -> None:
    lines: list[str] = []
    live = hand_on(observed(open_link("fake://exo?clock=virtual&fault=faults"), TraceWriter(lines.append))).dump()
    again = hand_on(open_link(transcript(tmp_path, *lines))).dump()
    assert again.rows == live.rows
    assert len(live.rows) == 42


@each_row("fault", ["echo", "noise", "dribble", "stale", "duplicate", "block-silent"])
def test_a_recording_of_a_bad_line_gives_the_same_rows(tmp_path: Path, fault: str) -> None:
    lines: list[str] = []
    live = hand_on(observed(open_link(f"fake://exo?clock=virtual&fault={fault}"), TraceWriter(lines.append))).dump()
    again = hand_on(open_link(transcript(tmp_path, *lines))).dump()
    assert again.rows == live.rows


def test_a_request_that_was_never_recorded(tmp_path: Path) -> None:
    link = open_link(transcript(tmp_path, f"> {READ_ID}", f"< {ID_IS_1}"))
    assert (link.replayed, link.fake, link.can_set_baud) == (True, False, False)
    with pytest.raises(LinkError) as caught:
        link.write(unhex(READ_VOLTAGE), link.deadline(1.0))
    assert (caught.value.exit_code, caught.value.code) == (3, "replay-miss")
    assert READ_VOLTAGE in caught.value.text
    assert caught.value.hint


def test_repeated_requests_take_their_answers_in_turn_and_start_anew(tmp_path: Path) -> None:
    link = open_link(
        transcript(tmp_path, f"> {READ_ID}", "< 01", f"> {READ_VOLTAGE}", "< 02", f"> {READ_ID}", "< 03", "< 04")
    )
    heard = []
    for _ in range(3):
        link.write(unhex(READ_ID), link.deadline(1.0))
        data = b""
        while chunk := link.read(link.deadline(0.1)):
            data += chunk
        heard.append(hexed(data))
    assert heard == ["01", "03 04", "01"]


def test_recorded_silence_costs_no_time(tmp_path: Path) -> None:
    import time

    hand = hand_on(open_link(transcript(tmp_path, f"> {READ_ID}")), timeout=200.0)
    before = time.monotonic()
    with pytest.raises(HandctlError) as caught:
        hand.bus.read(1000, 1)
    assert caught.value.exit_code == 4
    assert time.monotonic() - before < PATIENCE


def test_reading_a_replay_in_small_pieces(tmp_path: Path) -> None:
    link = open_link(transcript(tmp_path, f"> {READ_ID}", f"< {ID_IS_1}"))
    link.write(unhex(READ_ID), link.deadline(1.0))
    assert [link.read(link.deadline(1.0), 4) for _ in range(4)] == [
        unhex("90 EB 01 04"), unhex("11 E8 03 01"), unhex("02"), b"",
    ]  # fmt: skip
    link.close()


def test_what_came_unasked_comes_again_at_its_time(tmp_path: Path) -> None:
    link = open_link(transcript(tmp_path, "0.010 < 01 02", "0.020 < 03", "0.050 < 04"))
    assert link.read(link.deadline(0)) == b""
    assert [(link.read(link.deadline(1.0), 1), link.now()) for _ in range(3)] == [
        (b"\x01", 0.010), (b"\x02", 0.010), (b"\x03", 0.020),
    ]  # fmt: skip
    assert (link.read(link.deadline(0.01)), link.now()) == (b"", pytest.approx(0.03))
    assert (link.read(link.deadline(1.0)), link.now()) == (b"\x04", 0.050)
    assert (link.read(link.deadline(1.0)), link.now()) == (b"", pytest.approx(1.05))
    with pytest.raises(LinkError) as caught:
        link.write(unhex(READ_ID), link.deadline(1.0))
    assert caught.value.code == "replay-miss"


def test_time_goes_by_between_requests_as_it_did(tmp_path: Path) -> None:
    link = open_link(transcript(tmp_path, "0.1 < 01", "1.0 > AA", "1.5 < 02", "3.0 > BB", "< 03"))
    link.write(b"\xaa", link.deadline(1.0))
    assert link.now() == 1.0
    assert link.read(link.deadline(0)) == b"\x01"
    assert (link.read(link.deadline(1.0)), link.now()) == (b"\x02", 1.5)
    link.write(b"\xbb", link.deadline(1.0))
    assert (link.read(link.deadline(0)), link.now()) == (b"\x03", 3.0)


def test_a_request_more_than_recorded_hears_what_a_stream_said_last(tmp_path: Path) -> None:
    """How often a command repeats itself until something is reached is a matter of microseconds."""
    link = open_link(transcript(tmp_path, "0.0 < 01", "0.1 > AA", "0.2 < 02", "0.3 > AA", "0.4 < 03"))
    heard = []
    for _ in range(4):
        link.write(b"\xaa", link.deadline(1.0))
        while chunk := link.read(link.deadline(0.15)):
            heard.append(chunk)
    assert heard == [b"\x01", b"\x02", b"\x03", b"\x03", b"\x03"]


@pytest.mark.parametrize("command", [("status",), ("home", "--yes"), ("joints", "index.q3=160"), ("stop",)])
def test_a_hand_that_streams_can_be_played(command: tuple[str, ...], tmp_path: Path) -> None:
    from tests.support.cli import run

    path = tmp_path / "t"
    live = run("aidin", *command, "-p", "fake://aidin?clock=virtual&start=homed&rate=97", "--trace", path, "--json")
    again = run("aidin", *command, "-p", f"replay:{path}", "--json")
    assert (live.code, again.code) == (0, 0), again
    for old, new in zip(live.rows, again.rows, strict=True):  # one object earlier or later, where it is still settling
        assert {**new, "value": 0, "rad": 0} == {**old, "value": 0, "rad": 0}
        assert new.get("value") == pytest.approx(old.get("value"), abs=0.05)
    other = run("aidin", "max-torque", "900", "-y", "-p", f"replay:{path}", "--json")
    assert (other.code, other.error["code"]) == (3, "replay-miss")


def test_transcripts_that_cannot_be_played(tmp_path: Path) -> None:
    binary = tmp_path / "binary"
    binary.write_bytes(b"\xff\xfe\x00")
    for link in (
        f"replay:{tmp_path / 'missing.txt'}",
        f"replay:{tmp_path}",
        f"replay:{binary}",
        "replay:",
        transcript(tmp_path, "# nothing"),
        transcript(tmp_path, "! power-cycle"),
        transcript(tmp_path, "< can 11000001 [1] 04"),
        transcript(tmp_path, "rubbish"),
    ):
        with pytest.raises(UsageError) as caught:
            open_link(link)
        assert caught.value.exit_code == 2


# -- the simulator as a link ------------------------------------------------------------------------------------------


@each_row(
    ("url", "parts"),
    [
        ("fake://exo", ("exo", {})), ("fake://exo/", ("exo", {})), ("fake://exo?", ("exo", {})),
        ("fake://exo?seed=1&fault=noise", ("exo", {"seed": "1", "fault": "noise"})),
        ("fake://exo?state=/tmp/a%20b&x=", ("exo", {"state": "/tmp/a b", "x": ""})),
        ("fake://exo?a=b=c&&", ("exo", {"a": "b=c"})),
    ],
)  # fmt: skip
def test_urls_of_simulators(url: str, parts: tuple[str, dict[str, str]]) -> None:
    assert split_url(url) == parts


@each_row(
    "url",
    [
        "fake://", "fake://nothing", "fake://exo?seed", "fake://exo?nothing=1", "fake://exo?fault=nothing",
        "fake://exo?seed=x", "fake://exo?clock=fast", "fake://exo?id=0", "fake://exo?id=255", "fake://exo?baud=9600",
        "fake://exo?state=/nowhere/at/all/file", "fake://exo?every=0",
    ],
)  # fmt: skip
def test_urls_that_name_no_simulator(url: str) -> None:
    with pytest.raises(UsageError) as caught:
        open_link(url)
    assert caught.value.exit_code == 2
    assert url in caught.value.text


def test_fake_says_that_it_is_one() -> None:
    link = open_link("fake://exo?clock=virtual", baud=115200)
    assert (link.fake, link.name, link.baud, link.can_set_baud) == (True, "fake://exo?clock=virtual", 115200, True)
    link.close()
    link.close()


def test_virtual_time_jumps_to_what_happens_next() -> None:
    import time

    link = open_link("fake://exo?clock=virtual")
    before = time.monotonic()
    link.write(unhex("EB 90 01 04 12 ED 03 01 08"), link.deadline(1.0))
    assert hexed(link.read(link.deadline(0.3))) == "90 EB 01 04 12 ED 03 01 08"
    assert link.now() == 0.0
    assert link.read(link.deadline(0.5)) == b""
    assert link.now() == 0.5
    assert hexed(link.read(link.deadline(100.0))) == "90 EB 01 04 11 ED 03 00 06"
    assert link.now() == pytest.approx(1.0)
    assert link.read(link.deadline(1000.0)) == b""
    assert link.now() == pytest.approx(1001.0)
    assert time.monotonic() - before < PATIENCE


def test_real_time_is_that_of_the_machine() -> None:
    with virtual_time() as clock:
        link = open_link("fake://exo?turnaround=0.05")
        began = clock.now()
        link.write(unhex(READ_ID), link.deadline(PATIENCE))
        assert hexed(link.read(link.deadline(PATIENCE))) == ID_IS_1
        assert clock.now() - began == pytest.approx(0.05, abs=0.001)
        link.close()


def test_wire_time_of_a_dump() -> None:
    """195 bytes at 10 bits and 115200 baud are 16.93 ms (exo §2.1)."""
    link = open_link("fake://exo?clock=virtual&wire=115200", baud=115200)
    hand_on(link).dump()
    assert link.now() == pytest.approx(0.01693, abs=0.00002)


def test_small_reads_of_a_simulator_lose_nothing() -> None:
    link = open_link("fake://exo?clock=virtual")
    link.write(unhex(READ_ID), link.deadline(1.0))
    assert hexed(b"".join(link.read(link.deadline(1.0), 2) for _ in range(6))) == ID_IS_1


def test_a_speed_that_differs_is_silence_until_it_fits() -> None:
    link = open_link("fake://exo?clock=virtual&baud=57600", baud=115200)
    link.write(unhex(READ_ID), link.deadline(1.0))
    assert link.read(link.deadline(1.0)) == b""
    link.set_baud(57600)
    link.write(unhex(READ_ID), link.deadline(1.0))
    assert hexed(link.read(link.deadline(1.0))) == ID_IS_1


def test_hanging_up_is_a_lost_link() -> None:
    link = open_link("fake://exo?clock=virtual&fault=disconnect")
    link.write(unhex(READ_ID), link.deadline(1.0))
    with pytest.raises(LinkError) as caught:
        for _ in range(3):
            link.read(link.deadline(1.0))
    assert (caught.value.exit_code, caught.value.code) == (3, "lost")
    with pytest.raises(LinkError):
        link.write(unhex(READ_ID), link.deadline(1.0))


def test_power_cycle_drops_what_was_on_the_wire() -> None:
    link = open_link("fake://exo?clock=virtual&wire=115200", baud=115200)
    link.write(unhex(READ_ID), link.deadline(1.0))
    assert link.power_cycle() is True
    assert link.read(link.deadline(1.0)) == b""
    link.write(unhex(READ_ID), link.deadline(1.0))
    assert hexed(link.read(link.deadline(1.0))) != ""


def test_state_file_keeps_what_was_saved(tmp_path: Path) -> None:
    url = f"fake://exo?clock=virtual&state={tmp_path / 'state.json'}"
    link = open_link(url)
    link.write(unhex("EB 90 01 04 12 E8 03 02 04"), link.deadline(1.0))
    link.close()
    link = open_link(url)
    link.write(unhex("EB 90 02 04 11 E8 03 01 03"), link.deadline(1.0))
    assert hexed(link.read(link.deadline(1.0))) == "90 EB 02 04 11 E8 03 02 04"
    link.close()


def test_a_lost_link_is_in_the_transcript_and_lost_again_in_its_replay(tmp_path: Path) -> None:
    for number, (link, words) in enumerate([
        ("fake://exo?clock=virtual&fault=disconnect", ("exo", "status")),
        ("fake://wrist?clock=virtual&fault=disconnect", ("wrist", "status")),
        ("fake://barrett?clock=virtual&fault=disconnect", ("barrett", "get", "LFT")),
        ("fake://ekso?clock=virtual&fault=disconnect", ("ekso", "time")),
        ("fake://aidin?clock=virtual&fault=disconnect", ("aidin", "status")),
    ]):  # fmt: skip
        trace = tmp_path / f"{number}.txt"
        assert run(*words, "-p", link, "--trace", trace).code == 3
        events = [entry.text for entry in parse(trace.read_text().splitlines()) if entry.mark == "!"]
        assert events == ["disconnect"]
        again = run(*words, "-p", f"replay:{trace}", "--json")
        assert (again.code, again.error["code"]) == (3, "lost"), (words, again)
        assert again.error["hint"]


def test_a_link_that_is_only_slow_to_take_data_is_not_lost() -> None:
    lines: list[str] = []

    class Stuck(ScriptedLink):
        def write(self, data: bytes, deadline: Deadline) -> None:
            raise LinkError("takes no data", code="write-timeout")

    tapped = observed(Stuck(), TraceWriter(lines.append))
    with pytest.raises(LinkError):
        tapped.write(b"\x01", tapped.deadline(1.0))  # type: ignore[attr-defined]
    assert [line.split()[1:] for line in lines] == [[">", "01"]]  # the line is recorded, no event


@each_row("place", ["/dev/zero", "folder"])
def test_a_transcript_without_an_end_is_refused(tmp_path: Path, place: str) -> None:
    (tmp_path / "folder").mkdir()
    result = run("exo", "get", "id", "-p", f"replay:{place if place[0] == '/' else tmp_path / place}")
    assert result.code == 2 and "not a transcript" in result.err


# -- a line that fails ------------------------------------------------------------------------------------------------


class Torn(ScriptedLink):
    """Loses the line while it writes."""

    def write(self, data: bytes, deadline: Deadline) -> None:
        self.clock += 0.5
        raise LinkError("torn")


def test_what_was_being_sent_when_the_line_was_lost_stands_in_the_transcript() -> None:
    """It may have reached the device: whoever reads the transcript must see it, at the time when it was sent."""
    lines: list[str] = []
    link = observed(Torn(), TraceWriter(lines.append))
    assert isinstance(link, ByteLink)
    with pytest.raises(LinkError):
        link.write(b"\x01\x02", link.deadline(1.0))
    assert lines == ["0.000000 > 01 02\n"]


class Bus(FrameLink):
    """A bus on which nobody acknowledges."""

    name = "bus"

    def send(self, frame: CanFrame, deadline: Deadline) -> None:
        self.error_frames += 1
        raise LinkError("bus off")

    def receive(self, deadline: Deadline) -> CanFrame | None:
        self.error_frames += 1
        return None

    def close(self) -> None:
        """Nothing to release."""


def test_a_tapped_bus_tells_its_error_frames_and_what_was_being_sent() -> None:
    lines: list[str] = []
    link = observed(Bus(), TraceWriter(lines.append))
    assert isinstance(link, FrameLink)
    assert link.receive(link.deadline(0.0)) is None
    assert link.error_frames == 1
    with pytest.raises(LinkError):
        link.send(CanFrame(0x15038001, b"\x04"), link.deadline(1.0))
    assert [line.split(" ", 1)[1] for line in lines] == ["> can 15038001 [1] 04\n"]
