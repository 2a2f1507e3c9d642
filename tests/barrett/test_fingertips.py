"""Fingertips of a hand: what is asked of it, which angles hold, what is said when the firmware does not tell."""

from __future__ import annotations

import pytest

from handctl.devices.barrett.maintenance import fingertips
from handctl.errors import DeviceRefused, NoAnswer, UsageError
from tests.barrett.support import codes, scripted
from tests.support.each_row import each_row

READY = "|0 0 0 0"
HOT = {"PGET TEMP OTEMP": "702|600"}
OLD = {
    "FGET P S": f"8500 8500 8500 1575{READY}",
    "FGET P": "8500 8500 8500 1575",
    "FGET BD BP": "ERR 64",
    "FGET BD": "ERR 64",
    "FGET BP": "ERR 64",
}


def of(rows: list[dict[str, object]], name: str) -> list[object]:
    return [row["value"] for row in rows if row["name"] == name]


def test_old_firmware_is_asked_once_for_breakaway() -> None:
    hand, link = scripted(OLD)
    tips = fingertips.Tips(hand)
    rows = tips.rows()
    assert of(rows, "tip_x") == [-52.7139, 52.7139, 0]
    assert {row["state"] for row in rows} == {"assumed before breakaway"}
    assert codes(hand) == ["breakaway-unknown"]
    link.sent.clear()
    assert tips.rows() == rows
    assert link.commands == ["FGET P"]


def test_new_firmware_tells_where_the_clutch_let_go() -> None:
    hand, link = scripted({"FGET P S": f"12000 8500 8500 1575{READY}", "FGET BD BP": "1 0 0 0|8000 77 0 0"})
    rows = fingertips.Tips(hand).rows()
    assert link.commands == ["FGET P S", "FGET BD BP"]
    assert of(rows, "joint_inner") == [64, 68, 68]
    assert of(rows, "joint_outer") == [64, 22.6667, 22.6667]
    assert of(rows, "tip_z") == [138.2736, 172.3713, 172.3713]
    states = {row["motor"]: row["state"] for row in rows}
    assert states == {"F1": "after breakaway", "F2": "before breakaway", "F3": "before breakaway"}
    assert codes(hand) == []


def test_a_refused_position_is_an_error() -> None:
    hand, _ = scripted({**HOT, "FGET P S": "ERR 8192", "FGET BD BP": "ERR 8192"})
    with pytest.raises(DeviceRefused, match="8192"):
        fingertips.now(hand)


def test_a_breakaway_that_is_refused_otherwise_is_an_error() -> None:
    hand, _ = scripted({**HOT, "FGET P S": f"0 0 0 0{READY}", "FGET BD BP": "ERR 8192"})
    with pytest.raises(DeviceRefused, match="8192"):
        fingertips.now(hand)


def test_a_hand_that_was_never_initialized_has_no_fingertips() -> None:
    """P counts from where it was switched on (§5.2.1): the rows say so, each what it depends on."""
    hand, _ = scripted({**OLD, "FGET P S": "8500 8500 8500 1575|0 4 0 0"})
    rows = fingertips.now(hand).rows
    assert {row["motor"] for row in rows if row["doubt"]} == {"F2"}
    assert {row["name"] for row in rows if row["doubt"]} == {
        "position",
        "joint_inner",
        "joint_outer",
        "tip_x",
        "tip_y",
        "tip_z",
    }
    assert all("before HI" in row["doubt"] for row in rows if row["doubt"]) and "not-initialized" in codes(hand)
    hand, _ = scripted({**OLD, "FGET P S": "8500 8500 8500 1575|0 0 0 4"})
    rows = fingertips.now(hand).rows
    assert {(row["motor"], row["name"]) for row in rows if row["doubt"]} == {
        (finger, name) for finger in ("F1", "F2") for name in ("joint_spread", "tip_x", "tip_y", "tip_z")
    }


def test_a_restart_in_a_stream_is_noticed_within_a_second() -> None:
    hand, _ = scripted({**OLD, "FGET P S": [f"0 0 0 0{READY}", "0 0 0 0|4 4 4 4"]})
    table = fingertips.stream(hand, rate=10, count=15, duration=None)
    assert table.samples is not None
    doubted = [sample.t for sample in table.samples if any(row["doubt"] for row in sample.rows)]
    assert doubted and doubted[0] <= 1.1


@each_row("text", ["F4=1", "F1", "F1=x", "F1=-1", "F1=20001", "=5"])
def test_breakaway_words(text: str) -> None:
    with pytest.raises(UsageError):
        fingertips.breakaways([text])


def test_breakaway_words_good() -> None:
    assert fingertips.breakaways(["f1=6000", "3=20000"]) == {"F1": 6000, "F3": 20000}


def test_stream_keeps_rate_and_survives_one_lost_answer() -> None:
    hand, _ = scripted({**OLD, "FGET P S": [f"0 0 0 0{READY}", f"375 0 0 0{READY}"], "FGET P": b""}, retries=0)
    table = fingertips.stream(hand, rate=2, count=3, duration=None)
    assert table.samples is not None
    first, second, third = table.samples
    assert first.t == 0
    assert all("error" in row and "value" not in row for row in second.rows)
    assert [row["value"] for row in third.rows if row["name"] == "joint_outer"] == [1, 0, 0]
    assert table.summary is not None
    stream = table.summary()["stream"]
    assert (stream["samples"], stream["failed"], stream["asked_hz"]) == (3, 1, 2)


def test_stream_gives_up() -> None:
    hand, _ = scripted({**OLD, "FGET P S": [f"0 0 0 0{READY}", b""], "FGET P": b""}, retries=0)
    table = fingertips.stream(hand, rate=0, count=None, duration=None)
    assert table.samples is not None
    seen = []
    with pytest.raises(NoAnswer):
        for sample in table.samples:
            seen.append(sample)
    assert len(seen) == 3  # one good, two failed; the third failure ends it


def test_stream_ends_after_its_duration() -> None:
    hand, link = scripted(OLD)
    table = fingertips.stream(hand, rate=10, count=None, duration=1.0)
    assert table.samples is not None
    begin = link.now()
    assert len(list(table.samples)) == 10
    assert link.now() - begin == pytest.approx(0.9)  # as `watch`: behind the last moment there is nothing to wait for
