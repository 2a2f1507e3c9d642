"""Strain without load: statistics, verdicts, the preparation, the adjusting view."""

from __future__ import annotations

import pytest

from handctl.devices.barrett.maintenance import strain_gauges
from handctl.errors import CheckFailed, DeviceRefused
from handctl.model.check_rows import FAIL, OK, SKIPPED, WARNING
from handctl.model.prompts import Prompts
from tests.barrett.support import codes, scripted, simulated
from tests.support.each_row import each_row

OPEN = {"123FGET P S OT SGFLIP": "0 50 -50|0 0 0|0 0 0|0 0 0"}


def test_statistics_of_twenty_readings() -> None:
    readings = ["100 120 140", "102 121 139"] * 10
    hand, link = scripted({**OPEN, "123FGET SG": readings})
    table = strain_gauges.table(hand, check=True)
    assert link.commands == ["123FGET P S OT SGFLIP", *["123FGET SG"] * 20]
    got = [(row["motor"], row["value"], row["min"], row["max"], row["readings"], row["status"]) for row in table.rows]
    assert got == [("F1", 101.0, 100, 102, 20, OK), ("F2", 120.5, 120, 121, 20, OK), ("F3", 139.5, 139, 140, 20, OK)]
    assert {(row["name"], row["parameter"], row["fingers_open"]) for row in table.rows} == {
        ("strain_no_load", "SG", True)
    }
    assert table.failure is None and codes(hand) == []


@each_row(
    ("reading", "statuses", "fails"),
    [
        ("100 140 120", [OK, OK, OK], False),
        ("99 141 120", [WARNING, WARNING, OK], True),
        ("0 120 120", [FAIL, OK, OK], True),
        ("120 255 120", [OK, FAIL, OK], True),
        ("255 255 255", [SKIPPED] * 3, False),
    ],
)
def test_verdicts(reading: str, statuses: list[str], fails: bool) -> None:
    hand, _ = scripted({**OPEN, "123FGET SG": reading})
    table = strain_gauges.table(hand, check=True)
    assert [row["status"] for row in table.rows] == statuses
    assert isinstance(table.failure, CheckFailed) == fails
    assert strain_gauges.table(scripted({**OPEN, "123FGET SG": reading})[0], check=False).failure is None


def test_fingers_that_may_be_loaded() -> None:
    hand, _ = scripted({"123FGET P S OT SGFLIP": "0 251 9|4 0 0|0 0 0|0 0 1", "123FGET SG": "120 120 120"})
    table = strain_gauges.table(hand, check=False)
    assert codes(hand) == ["strain-flip", "not-open"]
    assert "F1 is not initialized, F2 is at 251" in hand.journal.messages[1].text
    assert {row["fingers_open"] for row in table.rows} == {False}


def test_preparation_is_initialize_free_the_spread_open() -> None:
    hand, link = simulated("initialized=0")
    strain_gauges.prepare(hand, Prompts())
    assert [line for line in link.commands if "GET" not in line] == ["HI", "4T", "123O"]
    assert [step.data for step in strain_gauges.preparation_steps()] == [b"HI\r", b"4T\r", b"123O\r"]
    assert strain_gauges.loaded_fingers(hand) == []


def test_preparation_stops_at_a_refusal() -> None:
    hand, link = simulated("fault=over-temperature&initialized=1")
    with pytest.raises(DeviceRefused, match="8192"):
        strain_gauges.prepare(hand, Prompts())
    assert [line for line in link.commands if "GET" not in line] == ["HI"]


def test_the_adjusting_view() -> None:
    hand, _ = scripted({**OPEN, "123FGET SG": ["188 99 120", "140 100 255"]})
    table = strain_gauges.stream(hand, rate=0, count=2, duration=None)
    assert table.samples is not None
    first, second = table.samples
    deviation = [[(r["value"], r["label"]) for r in s.rows if r["name"] == "beside_window"] for s in (first, second)]
    assert deviation == [
        [(48, "48 above 140"), (-1, "1 below 100"), (0, "ok")],
        [(0, "ok"), (0, "ok"), (None, "no gauge")],
    ]
    assert [row["value"] for row in first.rows if row["name"] == "strain"] == [188, 99, 120]
    assert table.ranges == {"strain": strain_gauges.NO_LOAD}


def test_a_refused_reading_is_an_error() -> None:
    hand, link = scripted({**OPEN, "123FGET SG": "ERR 8192", "PGET TEMP OTEMP": "651|650"})
    with pytest.raises(DeviceRefused) as caught:
        strain_gauges.measure(hand)
    assert link.commands == ["123FGET SG", "PGET TEMP OTEMP"]
    assert "8192" in caught.value.text
    assert caught.value.hint.endswith("TEMP is 65.1 °C, OTEMP 65.0 °C")
    assert caught.value.hint.startswith("let the hand cool")
