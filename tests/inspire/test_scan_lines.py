"""Scanning on lines as they are: slow, jittery, half duplex, with others on it, over Bluetooth. The right device, or none."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import NamedTuple

import pytest

from handctl.devices.inspire import id_baud_save_reset
from handctl.devices.inspire.exo.device import ExoHand
from handctl.devices.inspire.id_search import TURNAROUND
from handctl.errors import CheckFailed
from handctl.families import FAMILIES
from handctl.link import open_link
from handctl.model.prompts import Progress
from handctl.model.scan_task import ScanTask
from tests.inspire.scanning import scan_hand, scanner
from tests.search import scan_grid
from tests.support.bus_file import text
from tests.support.cli import Result, run
from tests.support.scripted import changing, codes, fake_hand, hand_on, message

SPEEDS = [115200, 57600, 19200]
LOGGER = {"ask": "EB 90 C8 04 11 E8 03 01 C9", "every_ms": 100}
"""Somebody asks id 200, who is not there, for its id."""


class Line(NamedTuple):
    """One line with one hand on it."""

    kind: str
    latency: int
    spread: int
    id: int
    speed: int

    def file(self, folder: Path) -> Path:
        path = folder / "bus.toml"
        model = {"traffic": "half-duplex"}.get(self.kind, self.kind)
        masters = [LOGGER] if self.kind == "traffic" else []
        hand = {"kind": "exo", "id": self.id}
        path.write_text(
            text(model, [hand], masters, baud=self.speed, latency_ms=self.latency, spread_ms=self.spread)  # type: ignore[arg-type]
        )
        return path


KINDS = ("clean", "half-duplex", "traffic", "bluetooth")
GRID = [
    line
    for line in map(Line._make, product(KINDS, (0, 20, 62, 120, 250, 500), (0, 20, 60), (1, 3, 100, 254), SPEEDS))
    if line.kind == "bluetooth" or (line.id, line.speed) != (3, 19200)  # it is asked where it was typed
]
SHARE = [
    Line("clean", 0, 0, 254, 19200), Line("clean", 120, 0, 1, 57600), Line("clean", 500, 60, 100, 115200),
    Line("half-duplex", 0, 0, 100, 115200), Line("half-duplex", 20, 60, 3, 57600), Line("traffic", 0, 0, 100, 115200),
    Line("bluetooth", 62, 20, 1, 57600), Line("bluetooth", 500, 60, 254, 115200), Line("bluetooth", 120, 0, 3, 19200),
]  # fmt: skip


def hand_behind(path: Path) -> ExoHand:
    return hand_on(open_link(f"fake://bus?file={path}&clock=virtual", baud=115200))


def found(line: Line, folder: Path) -> tuple[ScanTask, float]:
    hand = hand_behind(line.file(folder))
    table = scan_hand(hand, ids=(), find_all=False)
    return table, hand.bus.link.now()


def right(line: Line, table: ScanTask) -> bool:
    speed = None if line.kind == "bluetooth" else line.speed
    return [(row["baud"], row["id"]) for row in table.rows] == [(speed, line.id)]


@pytest.mark.parametrize("line", SHARE, ids=str)
def test_the_right_hand_at_the_right_speed(line: Line, tmp_path: Path) -> None:
    table, _ = found(line, tmp_path)
    assert right(line, table), (table.rows, table.failure)


def test_late_answers_are_no_silence() -> None:
    hand, link = fake_hand("fault=late&late=0.12")
    table = scan_hand(hand, find_all=False)
    assert [(row["baud"], row["id"]) for row in table.rows] == [(115200, 1)]
    assert changing(link.sent) == []


@pytest.mark.parametrize("speed", SPEEDS)
def test_the_first_probes_reach_a_line_of_120_ms(speed: int, tmp_path: Path) -> None:
    """Id 1 at three speeds: the last of them answers within 1.5 s."""
    hand = hand_behind(Line("clean", 120, 0, 1, speed).file(tmp_path))
    seen: list[float] = []
    receive = hand.bus.link.read
    hand.bus.link.read = lambda *what: _noted(receive(*what), hand, seen)  # type: ignore[method-assign]
    table = scan_hand(hand, find_all=False)
    assert seen[0] < 1.5
    assert [(row["baud"], row["id"]) for row in table.rows] == [(speed, 1)]


def test_a_full_scan_of_a_clean_line_costs_little_more_than_its_wire() -> None:
    """254 ids at 3 speeds: the bytes of a question, what goes ahead of them, those of an answer, and 3 ms for it to begin."""
    hand = hand_on(open_link("fake://exo?wire=auto&clock=virtual", baud=115200))
    table = scan_hand(hand)
    ahead = {115200: 0, 57600: 2, 19200: 1}
    floor = sum(254 * (10 * (9 + 10 + ahead[speed]) / speed + TURNAROUND) for speed in SPEEDS)
    assert [(row["baud"], row["id"]) for row in table.rows] == [(115200, 1)]
    assert table.facts["seconds"] <= 1.10 * floor


def test_a_silent_scan_tells_what_it_waits_for() -> None:
    hand, _ = fake_hand("fault=silent")
    shown: list[str] = []
    scanner(hand, Progress(shown.append), find_all=False).run(range(1, 255), SPEEDS)
    assert shown[0] == "115200 bit/s, id 1, found 0"
    slowly = [line for line in shown if "Slowly" in line]
    assert slowly[0] == "115200 bit/s, id 1, found 0, 26 s left. Slowly: it may be half duplex"
    assert slowly[-1].startswith("19200 bit/s, id 254, found 0, 1 s left")
    assert all(len(line) < 80 for line in shown)
    assert "then again with 30 ms for each, as a delay that varies" in scan_text(hand)


def scan_text(hand: ExoHand) -> str:
    scan_hand(hand, ids=())
    return message(hand, "scanned")


def _noted(data: bytes, hand: ExoHand, seen: list[float]) -> bytes:
    if data:
        seen.append(hand.bus.link.now())
    return data


def test_a_bluetooth_line_is_named_and_has_no_speed(tmp_path: Path) -> None:
    path = Line("bluetooth", 60, 0, 1, 115200).file(tmp_path)
    result = run("exo", "scan", "-p", f"fake://bus?file={path}&clock=virtual", "--json")
    assert [(row["baud"], row["id"]) for row in result.rows] == [(None, 1)]
    line = result.json["line"]
    assert line["speed_matters"] is False
    assert 60 <= line["round_trip_ms"] <= 75
    assert "line" in result.codes()


def test_two_hands_on_a_half_duplex_line_are_found_one_by_one(tmp_path: Path) -> None:
    path = tmp_path / "bus.toml"
    path.write_text(text("half-duplex", [{"kind": "exo", "id": 97}, {"kind": "exo", "id": 100}]))
    hand = hand_behind(path)
    table = scan_hand(hand, baud=115200)
    assert [row["id"] for row in table.rows] == [97, 100]


def test_a_line_that_swallows_first_bytes_is_named(tmp_path: Path) -> None:
    path = tmp_path / "bus.toml"
    path.write_text(text("first-byte-lost", [{"kind": "exo"}]))
    for command in (("exo", "scan"), ("exo", "status")):
        result = run(*command, "-p", f"fake://bus?file={path}&clock=virtual", "--json")
        assert (result.code, result.error["code"]) == (5, "first-byte-lost")
    result = run("doctor", "--family", "exo", "-p", f"fake://bus?file={path}&clock=virtual", "--json")
    told = {row["check"]: row for row in result.rows}
    assert "first byte" in told["answer"]["evidence"]
    assert told["speed"]["status"] == "ok"


# -- id, baud ---------------------------------------------------------------------------------------------------------


def test_the_id_is_changed_while_a_logger_asks_another_hand(tmp_path: Path) -> None:
    path = tmp_path / "bus.toml"
    logger: dict[str, str | int | float | bool] = {"ask": "EB 90 03 04 11 E8 03 01 04", "every_ms": 50}
    path.write_text(text("half-duplex", [{"kind": "exo", "id": 1}, {"kind": "exo", "id": 3}], [logger]))
    hand = hand_behind(path)
    assert [row["value"] for row in id_baud_save_reset.change_id(hand, 9).rows] == [9]
    assert "others" in codes(hand)
    with pytest.raises(CheckFailed, match="taken"):
        id_baud_save_reset.change_id(hand, 3)


def test_the_id_is_changed_on_a_line_of_1200_ms_and_only_to_a_free_one(tmp_path: Path) -> None:
    path = tmp_path / "bus.toml"
    path.write_text(text("clean", [{"kind": "exo", "id": 1}, {"kind": "exo", "id": 3}], latency_ms=1200))
    with pytest.raises(CheckFailed, match="taken"):
        id_baud_save_reset.change_id(hand_behind(path), 3)
    assert [row["value"] for row in id_baud_save_reset.change_id(hand_behind(path), 5).rows] == [5]


def test_late_answers_are_not_taken_for_another_speed(tmp_path: Path) -> None:
    path = Line("clean", 900, 0, 1, 115200).file(tmp_path)
    result = run("exo", "status", "-p", f"fake://bus?file={path}&clock=virtual", "--json")
    assert result.error["code"] != "wrong-speed"


def test_the_doctor_names_a_slow_line_and_two_hands_with_one_id(tmp_path: Path) -> None:
    path = Line("bluetooth", 120, 0, 1, 115200).file(tmp_path)
    result = run("doctor", "--family", "exo", "--count", "10", "-p", f"fake://bus?file={path}&clock=virtual", "--json")
    told = {row["check"]: row for row in result.rows}
    assert told["delay"]["status"] == "warning"
    assert told["delay"]["remedy"]
    assert "does not matter" in told["speed"]["evidence"]
    path.write_text(text("half-duplex", [{"kind": "exo"}, {"kind": "exo", "seed": 5}]))
    result = run("doctor", "--family", "exo", "--count", "10", "-p", f"fake://bus?file={path}&clock=virtual", "--json")
    told = {row["check"]: row for row in result.rows}
    assert (told["answer"]["status"], told["speed"]["status"]) == ("fail", "ok")
    assert "one device has this id" in told["answer"]["remedy"]


@pytest.mark.parametrize("kind", ["exo", "wrist"])
@pytest.mark.parametrize(("model", "expected"), [
    ("clean", {"half_duplex": "full duplex", "packets": "byte by byte", "speed": "not at another speed"}),
    ("half-duplex", {"half_duplex": "half duplex", "packets": "byte by byte", "first_byte": "with their first byte"}),
    ("bluetooth", {"half_duplex": "full duplex", "packets": "packets of 20", "speed": "does not matter", "delay": "slow"}),
    ("serial-server", {"half_duplex": "half duplex", "packets": "in one piece", "delay": "slow"}),
])  # fmt: skip
def test_the_doctor_tells_what_the_line_is(model: str, expected: dict[str, str], kind: str, tmp_path: Path) -> None:
    path = tmp_path / "bus.toml"
    path.write_text(text(model, [{"kind": kind}]))
    result = run("doctor", "--family", kind, "--count", "5", "-p", f"fake://bus?file={path}&clock=virtual", "--json")
    told = {row["check"]: row for row in result.rows}
    assert {check: words for check, words in expected.items() if words not in told[check]["evidence"]} == {}
    assert (told["others"]["status"], told["error_rate"]["status"]) == ("ok", "ok")
    assert result.json["line"]["half_duplex"] is (expected["half_duplex"] == "half duplex")
    assert result.json["line"]["others"] is False


def test_the_doctor_names_others_and_a_lost_first_byte_with_a_remedy(tmp_path: Path) -> None:
    path = tmp_path / "bus.toml"
    told = {}
    for model, masters in (("half-duplex", [LOGGER]), ("first-byte-lost", [])):
        path.write_text(text(model, [{"kind": "exo"}], masters))
        link = f"fake://bus?file={path}&clock=virtual"
        result = run("doctor", "--family", "exo", "--count", "5", "-p", link, "--json")
        told[model] = {row["check"]: row for row in result.rows}
    others = told["half-duplex"]["others"]
    assert (others["status"], "one master" in others["remedy"]) == ("warning", True)
    assert "corrupted" not in told["half-duplex"]["error_rate"]["remedy"]
    first = told["first-byte-lost"]["first_byte"]
    assert (first["status"], "adapter" in first["remedy"]) == ("fail", True)
    assert told["first-byte-lost"]["half_duplex"]["status"] == "skipped"


def test_two_hands_and_a_logger_are_two_hands_and_twins_are_named_beside_one(tmp_path: Path) -> None:
    """What the logger's frames damage is no sign of a second device with that id."""
    path = tmp_path / "bus.toml"
    logger = {"ask": "EB 90 03 04 11 E8 03 01 04", "every_ms": 50}
    path.write_text(text("half-duplex", [{"kind": "exo"}, {"kind": "exo", "id": 3}], [logger]))  # type: ignore[list-item]
    hand = hand_behind(path)
    table = scan_hand(hand, ids=list(range(1, 9)))
    assert [(row["id"], row["suspicion"]) for row in table.rows] == [(1, None), (3, None)]
    assert hand.journal.line.others is True
    path.write_text(text("half-duplex", [{"kind": "exo"}, {"kind": "exo", "seed": 5}], [logger]))  # type: ignore[list-item]
    hand = hand_behind(path)
    table = scan_hand(hand, ids=list(range(1, 9)))
    assert table.failure is not None
    assert (table.rows, table.failure.code) == ([], "twin-id")
    result = run("doctor", "--family", "exo", "--count", "10", "-p", f"fake://bus?file={path}&clock=virtual", "--json")
    told = {row["check"]: row for row in result.rows}
    assert "one device has this id" in told["answer"]["remedy"]
    assert told["others"]["status"] == "warning"


# -- the scan of every family ---------------------------------------------------------------------------------------


class Cell(NamedTuple):
    """One line with one device of the maker on it, for `handctl scan`."""

    kind: str
    latency: int
    family: str
    speed: int

    def asked(self, folder: Path) -> Result:
        path = folder / "bus.toml"
        path.write_text(text(self.kind, [{"kind": self.family, "id": 1}], [], baud=self.speed, latency_ms=self.latency))
        return run("scan", "-p", f"fake://bus?file={path}&clock=virtual", "--json")

    def right(self, answer: Result) -> bool:
        speed = None if self.kind == "bluetooth" else self.speed
        rows = [(row["family"], row["baud"], row["id"]) for row in answer.rows]
        return (answer.code, rows) == (0, [(self.family, speed, 1)])


LATENCIES = (0, 20, 62, 120, 180, 250, 300, 350, 400, 450, 500)
CELLS = [Cell(*each) for each in product(("clean", "half-duplex", "bluetooth"), LATENCIES, ("exo", "wrist"), SPEEDS)]
FEW = [
    Cell("clean", 0, "wrist", 19200), Cell("clean", 250, "wrist", 19200), Cell("clean", 400, "wrist", 19200),
    Cell("half-duplex", 300, "wrist", 19200), Cell("half-duplex", 350, "exo", 19200), Cell("clean", 250, "exo", 57600),
    Cell("half-duplex", 500, "wrist", 57600), Cell("bluetooth", 300, "exo", 115200), Cell("bluetooth", 180, "wrist", 19200),
]  # fmt: skip
"""An answer that comes behind its own probe is heard by the next one: at 19200 bit/s a BarrettHand may come between."""


@pytest.mark.parametrize("cell", FEW, ids=lambda cell: " ".join(map(str, cell)))
def test_a_late_device_is_found_by_the_scan_of_every_family(cell: Cell, tmp_path: Path) -> None:
    answer = cell.asked(tmp_path)
    assert cell.right(answer), answer


# -- every family -----------------------------------------------------------------------------------------------------

GRID_SHARE = [
    scan_grid.Cell("", "exo", "clean", 150, 77, 115200), scan_grid.Cell("exo", "exo", "half-duplex", 500, 254, 115200),
    scan_grid.Cell("", "wrist", "bluetooth", 500, 1, 115200), scan_grid.Cell("wrist", "wrist", "can", 150, 254, None),
    scan_grid.Cell("hand", "hand", "clean", 50, 2, 115200, "eb90"), scan_grid.Cell("hand", "hand", "clean", 150, 1, 115200, "eb90"),
    scan_grid.Cell("hand", "hand", "bluetooth", 50, 2, 115200, "eb90"), scan_grid.Cell("", "hand", "half-duplex", 50, 77, 115200, "modbus"),
    scan_grid.Cell("hand", "hand", "plain", 0, 254, 921600, "eb90"), scan_grid.Cell("", "barrett", "bluetooth", 500, None, 9600),
    scan_grid.Cell("ekso", "ekso", "bluetooth", 500, None, 115200), scan_grid.Cell("aidin", "aidin", "tcp", 500, None, None),
]  # fmt: skip


@pytest.mark.parametrize("cell", GRID_SHARE, ids=lambda cell: " ".join(map(str, cell)))
def test_every_family_is_found_by_its_own_scan_and_by_that_of_all(cell: scan_grid.Cell, tmp_path: Path) -> None:
    """A share; the suite `scan-grid` of `tests/search` takes all."""
    cell.found(tmp_path)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_silent_line_is_told_within_six_seconds(family: str, tmp_path: Path) -> None:
    scan_grid.Silent(family).told(tmp_path)


@pytest.mark.parametrize(("kind", "speaks"), [("exo", ""), ("hand", "eb90"), ("hand", "modbus")])
def test_two_devices_as_shipped_are_told_as_two_with_one_id(kind: str, speaks: str, tmp_path: Path) -> None:
    """Not as a bad checksum, and soon."""
    more = {"speaks": speaks, "model": "df"} if speaks else {}
    path = tmp_path / "bus.toml"
    path.write_text(text("half-duplex", [{"kind": kind, **more}, {"kind": kind, "seed": 5, **more}]))
    trace = tmp_path / "trace.txt"
    answer = run(kind, "scan", "-p", f"fake://bus?file={path}&clock=virtual", "--json", "--trace", str(trace))
    told = [row["suspicion"] for row in answer.rows] or [answer.error["code"]]
    assert told in (["are there two devices with this id?"], ["twin-id"]), answer
    assert "twin-id" in answer.codes() and scan_grid.lasted(trace) < 7.0


def test_modbus_rtu_at_another_speed_is_said_not_to_have_been_asked(tmp_path: Path) -> None:
    path = tmp_path / "bus.toml"
    path.write_text(text("half-duplex", [{"kind": "hand", "speaks": "modbus"}], baud=19200))
    words = ("hand", "scan", "-p", f"fake://bus?file={path}&clock=virtual", "--json")
    answer = run(*words)
    assert answer.code == 4 and any("--protocol modbus" in text for text in answer.json["scan"]["left"]), answer
    assert [row["baud"] for row in run(*words, "--protocol", "modbus").rows] == [19200]


@pytest.mark.parametrize("family", FAMILIES)
def test_the_scan_of_a_family_is_that_of_all_with_this_family_alone(family: str) -> None:
    link = f"fake://{family}?clock=virtual"
    own = run(family, "scan", "-p", link, "--json")
    both = run("scan", "--family", family, "-p", link, "--json")
    assert (own.code, own.rows, own.json["scan"]) == (0, both.rows, both.json["scan"])
