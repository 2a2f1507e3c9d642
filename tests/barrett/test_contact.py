"""Contact with a hand that is not the one in the books: positions below 0, no firmware, other answers than the manual shows."""

from __future__ import annotations

import itertools
import re
from pathlib import Path
from typing import Any

import pytest

from handctl.devices.barrett import motion
from handctl.devices.barrett.gcl.codec import error_form, status_of
from handctl.devices.barrett.maintenance import fingertips
from handctl.devices.barrett.parameter_map import with_sign
from handctl.devices.barrett.realtime.blocks import Layout, Selection
from handctl.errors import ProtocolError
from handctl.model.prompts import Prompts
from tests.barrett.download import Operated, Operator, Run
from tests.barrett.support import codes, elements, scripted, simulated
from tests.support.cli import Result, run
from tests.support.each_row import each_row
from tests.support.odd_barrett import odd, replaced

# -- positions below 0 ----------------------------------------------------------------------------------------------


@each_row(
    ("index", "sent", "read"),
    [
        (0, 0, 0),
        (0, -50, -50),
        (0, 17883, 17883),
        (0, 65535, -1),
        (0, 65236, -300),
        (0, 47736, -17800),
        (0, 47735, 47735),
        (0, 32968, 32968),
        (0, 65536, 65536),
        (3, 65486, -50),
        (3, 62386, -3150),
        (3, 62385, 62385),
    ],
)
def test_a_word_without_a_sign(index: int, sent: int, read: int) -> None:
    """Only where nothing but the number with a sign is within the travel of the joint."""
    assert with_sign(index, sent) == read


@each_row(("sign", "place"), [("signed", -300), ("unsigned", -300), ("clamped", 0)])
def test_a_finger_at_its_open_stop(sign: str, place: int) -> None:
    """§5.3.4 IOFF 300: TO ends 300 counts below 0, in `get`, in RealTime and as an angle."""
    hand, _ = simulated(f"position-sign={sign}")
    hand.line.ask("FSET IOFF 300")
    hand.line.ask("HI")
    table = motion.move(hand, "123", "TO", None, Prompts(), expect="any")
    assert [row["value"] for row in table.rows] == [place] * 3
    assert [reading.value for reading in hand.read(elements("P"))] == [place] * 3 + [0]
    assert codes(hand).count("unsigned-position") == (sign == "unsigned")
    rows = fingertips.now(hand).rows
    assert {row["value"] for row in rows if row["name"] == "joint_inner"} == {place / 125}
    if sign != "clamped":
        table = motion.move(hand, "1", "IC", 1000, Prompts())
        assert (table.failure, table.rows[0]["value"], table.rows[0]["target"]) == (None, place + 1000, place + 1000)


def test_the_position_of_a_block() -> None:
    layout = Layout({0: Selection((), ("position",)), 3: Selection((), ("position", "breakaway_position"))})
    feedback = layout.decode(bytes.fromhex("2A FE D4 FF CE 45 94"))
    assert feedback.motors == {0: {"position": -300}, 3: {"position": -50, "breakaway_position": 17812}}


@each_row(
    ("positions", "broken"),
    [("0 32968 0 0", "0 0 0 0|0 0 0 0"), ("0 0 0 9000", "0 0 0 0|0 0 0 0"), ("0 0 0 0", "0 0 1 0|0 0 40000 0")],
)
def test_an_impossible_position_has_no_angle(positions: str, broken: str) -> None:
    hand, _ = scripted({"FGET P S": f"{positions}|0 0 0 0", "FGET BD BP": broken})
    with pytest.raises(ProtocolError) as caught:
        fingertips.now(hand)
    assert caught.value.code == "impossible"


def test_an_impossible_position_is_marked() -> None:
    hand, _ = scripted({"FGET P S": "0 32968 -300 0|0 0 0 0"})
    rows = hand.table(hand.read(elements("P", "S"))).rows
    assert [(row["value"], bool(row.get("doubt"))) for row in rows[:4]] == [
        (0, False),
        (32968, True),
        (-300, False),
        (0, False),
    ]


# -- no firmware, or not yet ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", ["found=monitor&monitor-echo=1", "found=boot&boot=20"])
def test_doctor_does_not_call_a_hand_without_firmware_sound(state: str) -> None:
    """A boot monitor is no answer, and nothing is sent to it at another speed."""
    answer = run("doctor", "-p", f"fake://barrett?clock=virtual&{state}", "--family", "barrett", "--json")
    rows = {row["check"]: row for row in answer.rows}
    assert answer.code == 7
    assert (rows["answer"]["status"], rows["speed"]["status"]) == ("fail", "skipped")
    assert "boot monitor" in rows["answer"]["evidence"] and "round_trip" not in rows


class Absent(Operator):
    """Nobody is there: -y without a terminal."""

    interactive = False

    def wait_for_enter(self, text: str) -> bool:
        return False


class Ticking(Operated):
    """Its clock goes on from one look to the next, as a real one does."""

    ticks = 0.0

    def now(self) -> float:
        self.ticks += 1e-6
        return super().now() + self.ticks


@each_row("clock", [Operated, Ticking])
def test_a_download_does_not_wait_long_for_a_hand_that_is_on(clock: type[Operated]) -> None:
    link = clock()
    prompts = Absent(link)
    prompts.ready = False
    failed = Run(link=link, prompts=prompts)
    assert failed.failed[:2] == ("still-on", 6) and link.now() < 15
    assert b"".join(link.sent).count(b"\xff") == 0 and "image valid" in failed.image


def test_a_hand_that_a_script_switches() -> None:
    link = Operated("switch=3,8")
    prompts = Absent(link)
    prompts.ready = False
    assert Run(link=link, prompts=prompts).error is None


def test_a_download_that_is_cut_off_leaves_no_firmware() -> None:
    """Half of the records arrived whole, one after the other: it is no firmware all the same."""
    failed = Run("fault=monitor-hang&download-at=0x2C80")
    assert failed.failed[0] == "no-echo" and not failed.image.startswith("image valid")


# -- another answer to the first question ---------------------------------------------------------------------------

ODD: dict[str, dict[str, Any]] = {
    "an echoed NUL": {"nul": b"^@"},
    "text behind the number": {"every": replaced(b"ERR 32", b"ERR 32 Unknown command")},
    "no space": {"every": replaced(b"ERR 32", b"ERR32")},
    "another word": {"every": replaced(b"ERR ", b"Error: ")},
    "two prompts": {"every": replaced(b"=> ", b"=> \n\r=> ")},
    "a sentence": {"first": replaced(b"ERR 32", b"What?")},
}


def bad(result: Result) -> set[str]:
    """What a check complains of: a new hand is to be greased."""
    return {row["check"] for row in result.rows if row.get("status") in ("fail", "warning")}


HAND = "fake://barrett?clock=virtual&initialized=1"


@pytest.mark.parametrize("name", ODD)
def test_another_answer_is_contact(name: str) -> None:
    """Every command works on it as `scan` does, and what is unexpected is told once."""
    for words in ("status", "dump", "get P", "version", "gcl VERS", "set DS.F1=1000", "init -y", "scan", "diagnose"):
        with odd(**ODD[name]):
            result = run("barrett", *words.split(), "-p", HAND, "--json")
        codes_seen = [message["code"] for message in result.json["messages"]]
        assert result.code == (7 if words == "diagnose" else 0), (words, result)
        if words == "diagnose":
            assert bad(result) <= bad(run("barrett", "diagnose", "-p", HAND, "--json"))
        assert codes_seen.count("other-text") == (words != "scan"), (words, codes_seen)
        assert "loop" not in codes_seen


def test_noise_is_no_other_answer() -> None:
    """Other text that does not come again in the same way proves nothing."""
    count = itertools.count(1000)
    with odd(first=lambda data: data.replace(b"ERR", b"%d" % next(count))):
        result = run("barrett", "status", "-p", HAND, "--json")
    assert result.code == 5


# -- a firmware without one parameter -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["SGFLIP", "MSG", "LFDPD", "OD", "EN", "UPSECS"])
def test_a_firmware_without_one_parameter(name: str, tmp_path: Path) -> None:
    file = tmp_path / "f.json"
    for words in ("status", "dump", f"snapshot {file}", "strain", "diagnose", "status --check"):
        if (words, name) in {("strain", "OD")}:
            continue
        with odd(without=name):
            result = run("barrett", *words.split(), "-p", HAND, "--json")
        assert result.code == 0 or (words, result.code) == ("diagnose", 7), (words, result)
        if words == "diagnose":
            assert bad(result) <= bad(run("barrett", "diagnose", "-p", HAND, "--json"))
        assert all(row.get("parameter") != name for row in result.rows), words
    assert file.exists()
    with odd(without=name):
        assert run("barrett", "diff", str(file), "-p", HAND, "--json").code == 0
        assert run("barrett", "get", name, "-p", HAND, "--json").code == 6


@pytest.mark.parametrize("spelled", [b"ERROR %d", b"error: %d.", b"E%d", b"Sorry, code %d (see the manual)"])
def test_a_refusal_is_known_by_what_the_hand_says_to_an_unknown_command(spelled: bytes) -> None:
    """Else a firmware without one parameter would be a disturbed line in every command that reads all."""
    with odd(without="SGFLIP", every=lambda data: re.sub(rb"ERR (\d+)", lambda m: spelled % int(m[1]), data)):
        dump, one, typed = (
            run("barrett", *words, "-p", HAND, "--json") for words in (["dump"], ["get", "SGFLIP"], ["gcl", "FGET XX"])
        )
    assert (dump.code, one.code, typed.code) == (0, 6, 6)
    assert "not-on-this-firmware" in dump.said and "err-64" in one.said
    assert {row["parameter"] for row in dump.rows} >= {"P", "TSTOP", "TEMP"}


def test_a_line_of_numbers_is_no_refusal() -> None:
    assert error_form("32") is None and error_form("What?") is None and error_form("E321") is None
    form = error_form("Error: 32")
    assert [status_of(line, "FGET P", form) for line in ("64 0 0 0", "Error: 64", "ERR 64", "Error: x")] == [
        None,
        (64, "Error: 64"),
        (64, ""),
        None,
    ]
    assert status_of("Error: 64", "ERR", form) is None, "the list of all codes"
