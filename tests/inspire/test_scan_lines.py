"""Scanning on lines as they are: slow, jittery, half duplex, with others on it, over Bluetooth. The right device, or none."""

from __future__ import annotations

import time
from itertools import product
from pathlib import Path
from random import Random
from typing import NamedTuple

import pytest

from handctl.devices.inspire.exo import procedures
from handctl.devices.inspire.exo.device import ExoHand
from handctl.errors import CheckFailed
from handctl.link import open_link
from handctl.model.result import Table
from handctl.sim.bus.models import text
from tests.fuzz.support import long_seconds
from tests.inspire.scanning import scan_hand
from tests.support.cli import run
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
    Line(*each) for each in product(KINDS, (0, 20, 62, 120, 250, 500), (0, 20, 60), (1, 3, 100, 254), SPEEDS)
]  # fmt: skip
SHARE = [
    Line("clean", 0, 0, 254, 19200), Line("clean", 120, 0, 1, 57600), Line("clean", 500, 60, 100, 115200),
    Line("half-duplex", 0, 0, 100, 115200), Line("half-duplex", 20, 60, 3, 57600), Line("traffic", 0, 0, 100, 115200),
    Line("bluetooth", 62, 20, 1, 57600), Line("bluetooth", 500, 60, 254, 115200), Line("bluetooth", 120, 0, 3, 19200),
]  # fmt: skip


def hand_behind(path: Path) -> ExoHand:
    return hand_on(open_link(f"fake://bus?file={path}&clock=virtual", baud=115200))


def found(line: Line, folder: Path) -> tuple[Table, float]:
    hand = hand_behind(line.file(folder))
    table = scan_hand(hand, speeds=SPEEDS, find_all=False)
    return table, hand.bus.link.now()


def right(line: Line, table: Table) -> bool:
    speed = None if line.kind == "bluetooth" else line.speed
    return [(row["baud"], row["id"]) for row in table.rows] == [(speed, line.id)]


@pytest.mark.parametrize("line", SHARE, ids=str)
def test_the_right_hand_at_the_right_speed(line: Line, tmp_path: Path) -> None:
    table, _ = found(line, tmp_path)
    assert right(line, table), (table.rows, table.failure)


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_the_whole_grid(kind: str, tmp_path: Path) -> None:
    """Prints seconds of virtual time, least and most, by latency and spread; no row may be wrong.

    With HANDCTL_LONG_SECONDS the part of it that can be run in this test's share, the same lines first each time.
    """
    wrong, missed = [], []
    seconds: dict[tuple[int, int], list[float]] = {}
    lines = [line for line in GRID if line.kind == kind]
    Random(1).shuffle(lines)
    end = time.monotonic() + long_seconds(len(KINDS))
    for line in lines:
        if time.monotonic() > end:
            break
        table, took = found(line, tmp_path)
        seconds.setdefault((line.latency, line.spread), []).append(took)
        if not right(line, table):
            (wrong if table.rows else missed).append(line)
    for (latency, spread), took in sorted(seconds.items()):
        print(f"{kind:12} latency {latency:3} ms, spread {spread:2} ms: {min(took):6.2f} to {max(took):6.2f} s")
    assert wrong == []
    assert missed == []


def test_late_answers_are_no_silence() -> None:
    hand, link = fake_hand("fault=late&late=0.12")
    table = scan_hand(hand, speeds=SPEEDS, find_all=False)
    assert [(row["baud"], row["id"]) for row in table.rows] == [(115200, 1)]
    assert changing(link.sent) == []


def test_the_first_probes_reach_a_line_of_120_ms(tmp_path: Path) -> None:
    """Id 1 at three speeds: the last of them answers within 1.5 s."""
    path = Line("clean", 120, 0, 1, 19200).file(tmp_path)
    hand = hand_behind(path)
    seen: list[float] = []
    receive = hand.bus.link.read
    hand.bus.link.read = lambda *what: _noted(receive(*what), hand, seen)  # type: ignore[method-assign]
    scan_hand(hand, speeds=SPEEDS, find_all=False)
    assert seen[0] < 1.5


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
    table = scan_hand(hand, speeds=[115200])
    assert [row["id"] for row in table.rows] == [97, 100]
    assert hand.journal.line.half_duplex is True
    assert "One id at a time" in message(hand, "line")


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
    assert [row["value"] for row in procedures.change_id(hand, 9).rows] == [9]
    assert "others" in codes(hand)
    with pytest.raises(CheckFailed, match="taken"):
        procedures.change_id(hand, 3)


def test_the_id_is_changed_on_a_line_of_1200_ms_and_only_to_a_free_one(tmp_path: Path) -> None:
    path = tmp_path / "bus.toml"
    path.write_text(text("clean", [{"kind": "exo", "id": 1}, {"kind": "exo", "id": 3}], latency_ms=1200))
    with pytest.raises(CheckFailed, match="taken"):
        procedures.change_id(hand_behind(path), 3)
    assert [row["value"] for row in procedures.change_id(hand_behind(path), 5).rows] == [5]


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
