"""`terminal` of every family: what is asked before it goes out, what is shown, and what an interrupt stops."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from handctl.errors import UsageError
from handctl.families import FAMILIES
from handctl.tools import terminal as tool
from tests.contract.facts import facts_of, passed
from tests.support.cli import Simulator, run
from tests.support.each_row import each_row
from tests.support.person import person
from tests.support.terminal import Terminal

WRITE, READ = "EB 90 01 05 12 D4 05 2C 01 1E", "EB 90 01 04 11 E8 03 01 02"
GET_TIME, SET_VALUE = "96 00 00 01 75 E7", "9B 04 00 01 00 01 00 0F 8A EC"

WRITES: list[tuple[str, str, tuple[str, ...]]] = [
    # family, wire, lines of which the last completes what moves, writes or saves
    ("exo", "", (WRITE,)),
    ("exo", "", (READ, WRITE)),
    ("exo", "", ("EB 90 01 05 12", "D4 05 2C 01 1E")),
    ("exo", "", (READ + " EB", "90 01 05 12 D4 05 2C 01 1E")),
    ("wrist", "", ("EB 90 01 05 31 0E 04 05 00 4E",)),
    ("wrist", "bus=can", ("15038001#E80318FC",)),
    ("hand", "", ("EB 90 01 05 12 D4 05 2C 01 1E",)),
    ("hand", "bus=can", ("05750001#2C01",)),
    ("hand", "bus=modbus-tcp", ("00 01 00 00 00 06 01 06 05 D4 01 2C",)),
    ("barrett", "", ("FSAVE",)),
    ("barrett", "", ("hex 46 53 41", "VE")),
    ("barrett", "", ("PLOAD",)),
    ("barrett", "", ("hex FF FF",)),
    ("aidin", "", ('{"hand_mode":1}',)),
    ("aidin", "", ('{"hand\\u005fmode":1}',)),
    ("aidin", "", ('hex 7B 22 68', 'and_mode":1}')),
    ("ekso", "", ("2A 00 00 01",)),
    ("ekso", "", (GET_TIME + " 2A 00",)),
]  # fmt: skip
READS: list[tuple[str, str, str]] = [
    ("exo", "", READ),
    ("exo", "", READ.replace(" ", "")),
    ("wrist", "", "EB 90 01 04 30 00 04 04 3D"),
    ("wrist", "bus=can", "11000001#04"),
    ("hand", "", READ),
    ("hand", "bus=can", "00FA0001#04"),
    ("hand", "model=f1", "01 03 03 E8 00 01 04 7A"),
    ("hand", "bus=modbus-tcp", "00 01 00 00 00 06 01 03 03 E8 00 01"),
    ("barrett", "", "FGET P"),
    ("barrett", "", "hex 56 45 52 53 0D"),
    ("aidin", "exchange=poll", "{}"),
    ("aidin", "exchange=poll", " {}"),
    ("ekso", "", GET_TIME),
]


def link(family: str, *more: str) -> str:
    return facts_of(family).link(family, "", *filter(None, more))


def sent(trace: Path) -> list[bytes]:
    return [one.data for one in passed(trace) if one.mark == ">"]


# -- what is asked ----------------------------------------------------------------------------------------------------


@each_row("family, wire, lines", WRITES)
def test_what_may_write_is_asked_for(family: str, wire: str, lines: tuple[str, ...], tmp_path: Path) -> None:
    """Nobody can answer, so not a byte goes out: what is asked is known before the first line."""
    result = run(family, "terminal", *lines, "--trace", tmp_path / "trace", "-p", link(family, wire))
    assert (result.code, sent(tmp_path / "trace")) == (8, []), result


@each_row("family, wire, line", READS)
def test_a_request_to_read_goes_out_at_once(family: str, wire: str, line: str, tmp_path: Path) -> None:
    """And nothing else does. Its reply is shown with the time that it took."""
    result = run(family, "terminal", line, "--json", "--trace", tmp_path / "trace", "-p", link(family, wire))
    assert (result.code, len(sent(tmp_path / "trace"))) == (0, 1), result
    assert result.json["writes"] == []
    first, *rest = result.rows
    assert (first["direction"], first["kind"]) == ("host", "frame")
    assert any(row["direction"] == "device" and "round_trip_ms" in row for row in rest), result


@each_row("family", [family for family in FAMILIES if family != "ekso"])
def test_what_was_confirmed_is_sent_once_and_recorded(family: str, tmp_path: Path) -> None:
    lines = facts_of(family).words("terminal", tmp_path)
    result = run(family, "terminal", *lines, "-y", "--json", "--trace", tmp_path / "trace", "-p", link(family))
    assert result.code == 0, result
    ends = {"barrett": b"\r", "aidin": b"\n"}.get(family)
    typed = [bytes.fromhex(line) if ends is None else line.encode() + ends for line in lines]
    assert [data for data in sent(tmp_path / "trace") if data in typed] == typed
    written = result.json["writes"]
    assert written and all(step["state"] in ("confirmed", "sent") for step in written)


@each_row("family, line", [
    ("ekso", SET_VALUE),
    ("barrett", "LOOP"),
    ("barrett", "PSET BAUD 384"),
    ("hand", "EB 90 01 04 12 EE 03 01 09"),
    ("exo", "11000001#04"),
    ("exo", "no bytes"),
])  # fmt: skip
def test_what_is_never_sent(family: str, line: str, tmp_path: Path) -> None:
    """A setting of an EksoNR needs its audit log; the others are what `raw` and `gcl` refuse, or no bytes."""
    result = run(family, "terminal", line, "-y", "--trace", tmp_path / "trace", "-p", link(family))
    assert (result.code, sent(tmp_path / "trace")) == (2, []), result


def test_a_stranger_gets_nothing_that_writes(tmp_path: Path) -> None:
    """An identity check goes first, as before every write; it is shown, too."""
    result = run(
        "exo", "terminal", WRITE, "-y", "--json", "--trace", tmp_path / "trace", "-p", link("hand", "model=df")
    )
    assert result.code == 6, result
    assert bytes.fromhex(WRITE) not in sent(tmp_path / "trace")


# -- scripts ----------------------------------------------------------------------------------------------------------


def test_a_script_on_stdin_stops_at_the_first_failure() -> None:
    """Empty lines and comments are left out."""
    result = run("barrett", "terminal", "--json", "-p", link("barrett"), stdin="# a comment\n\nFGET P\nFOO\nVERS\n")
    assert result.code == 6, result
    assert [row["command"] for row in result.rows if row["direction"] == "host" and row.get("command")] == [
        "FGET P",
        "FOO",
    ]


@each_row("fault, code", [("silent", 4), ("bad-checksum", 5), ("loopback", 5), ("wrong-id", 5), ("disconnect", 3)])
def test_what_comes_in_place_of_a_reply(fault: str, code: int) -> None:
    assert run("exo", "terminal", READ, "-p", link("exo", f"fault={fault}")).code == code


def test_a_dry_run_shows_the_bytes(tmp_path: Path) -> None:
    result = run(
        "barrett", "terminal", "FGET P", "FSAVE", "-n", "--json", "--trace", tmp_path / "trace", "-p", link("barrett")
    )
    assert result.code == 0 and sent(tmp_path / "trace") == []
    assert [row["bytes"] for row in result.rows] == ["46 47 45 54 20 50 0D", "46 53 41 56 45 0D"]


# -- at a prompt ------------------------------------------------------------------------------------------------------


@pytest.fixture
def typing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look finds a line, as long as there are some."""
    monkeypatch.setattr(tool.keys, "typed_line", lambda stream: stream.readline())


@pytest.mark.usefixtures("typing")
def test_a_person_is_asked_and_may_say_no(tmp_path: Path) -> None:
    """What follows goes on; what was not confirmed is no write."""
    answers = [READ, WRITE, "n", READ]
    shown = person("exo", "terminal", "--trace", tmp_path / "trace", "-p", link("exo"), answers=answers)
    assert shown.code == 0, shown
    assert sent(tmp_path / "trace") == [bytes.fromhex(READ)] * 2
    assert "write position_set.index = 300" in " ".join(shown.data.split())


@pytest.mark.usefixtures("typing")
@each_row("family, begun, rest", [("exo", WRITE[:14], WRITE[15:]), ("barrett", "hex 46 53 41", "VE")])
def test_the_rest_of_what_was_begun_is_asked_for_too(family: str, begun: str, rest: str, tmp_path: Path) -> None:
    """Alone it would be harmless."""
    answers = [begun, "y", rest, "n"]
    shown = person(family, "terminal", "--trace", tmp_path / "trace", "-p", link(family), answers=answers)
    gone = sent(tmp_path / "trace")
    assert shown.code == 0 and bytes.fromhex(begun.removeprefix("hex ")) in gone, shown
    assert not [data for data in gone if data in (*_hex(rest), rest.encode() + b"\r")], gone


@pytest.mark.usefixtures("typing")
def test_a_person_sees_what_was_typed_wrong(tmp_path: Path) -> None:
    shown = person("barrett", "terminal", "-p", link("barrett"), answers=["LOOP", "hex Z", "FGET P"])
    assert shown.code == 0
    assert "barrett realtime" in shown.data and "FGET P: read position" in shown.data


@pytest.mark.usefixtures("typing")
@each_row("line, code", [("GC", 4), ("FGET P", 0)])
def test_ctrl_d_before_the_reply_leaves_nothing_moving(line: str, code: int, tmp_path: Path) -> None:
    """The end of a terminal is the end of a movement that it has started, where its reply has not come."""
    ready = link("barrett", "wire=auto")
    shown = person("barrett", "terminal", "-p", ready, "--trace", tmp_path / "trace", answers=[line])
    assert shown.code == code, shown
    assert (b"T\r" in sent(tmp_path / "trace")) == bool(code)


STOPS: dict[str, tuple[str, bytes]] = {
    # family: a line that moves or may, and the bytes of its stop
    "exo": (WRITE, bytes.fromhex("EB 90 01 0B 32")),
    "wrist": ("EB 90 01 05 31 0E 04 05 00 4E", bytes.fromhex("EB 90 01 07 31 0E 04")),
    "barrett": ("1M 9000", b"\x03"),
    "ekso": ("2A 00 00 01", b"\x9c"),
    "aidin": ('{"hand_mode":1}', b'{"hand_mode":3}'),
    "hand": (WRITE, bytes.fromhex("EB 90 01 0F 12")),
}


@each_row("family", list(FAMILIES))
def test_ctrl_c_stops_what_a_line_has_set_going(family: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As soon as that line is out; before it nothing is stopped."""
    line, stop = STOPS[family]
    trace = tmp_path / "trace"

    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(tool.Conversation, "hear", interrupted)
    result = run(family, "terminal", line, "-y", "--trace", trace, "-p", link(family))
    assert result.code in (130, 4, 5, 6), result
    gone = sent(trace)
    typed = next(place for place, data in enumerate(gone) if data.rstrip(b"\r\n") in (line.encode(), *_hex(line)))
    assert any(data.startswith(stop) for data in gone[typed + 1 :]), [data.hex(" ") for data in gone]
    reads = {family: line for family, _, line in reversed(READS)}
    assert run(family, "terminal", reads[family], "--trace", trace, "-p", link(family)).code == 130
    assert len(sent(trace)) == 1


def _hex(line: str) -> list[bytes]:
    try:
        return [bytes.fromhex(line)]
    except ValueError:
        return []


@each_row("text", ["", "1A3", "1A3#DEADBEEF00112233445566"])
def test_what_is_no_can_frame(text: str) -> None:
    result = run("wrist", "terminal", text or " ", "-p", "fake://wrist?bus=can&clock=virtual")
    assert result.code == UsageError.exit_code


# -- on a real terminal -----------------------------------------------------------------------------------------------


@pytest.mark.real
def test_lines_are_typed_on_a_terminal() -> None:
    """What the device says is shown while nothing is typed; Ctrl-C stops what was set going."""
    with (
        Simulator("--pty", "--set", "initialized=1", kind="barrett") as simulator,
        Terminal("barrett", "terminal", "-p", simulator.link) as typed,
    ):
        typed.until("Ctrl-D ends")
        typed.send("FGET P\n")
        typed.until("FGET P: read position")
        typed.until("position ")
        typed.send("FSAVE\n")
        typed.until("Go on?")
        typed.send("n\n")
        typed.until("Not confirmed")
        typed.send("1M 15000\n")
        typed.until("1M 15000: move")
        typed.send("\x03")
        assert typed.finish() == 130
        assert "motor power is off" in " ".join(typed.text.split())


@pytest.mark.real
def test_ctrl_d_ends_the_terminal() -> None:
    with (
        Simulator("--pty", kind="exo") as simulator,
        Terminal("exo", "terminal", "-p", simulator.link) as typed,
    ):
        typed.until("Ctrl-D ends")
        typed.send("\x04")
        assert typed.finish() == 0
