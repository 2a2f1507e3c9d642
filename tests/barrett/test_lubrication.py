"""Maintenance: strokes and cycles, greasing points and their journal, thresholds."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handctl.devices.barrett import state_files
from handctl.devices.barrett.maintenance import health_limits
from handctl.devices.barrett.maintenance import lubrication as upkeep
from handctl.errors import DeviceRefused, OutputError, UsageError
from handctl.model.check_rows import FAIL, OK, WARNING
from tests.barrett.support import codes, scripted

OD = "104233 98712 110003 20117"
POINTS = [f"{name}.F{n}" for name in ("worm", "spur", "motor-spur") for n in (1, 2, 3)] + ["palm.SPREAD"]


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def care(od: str = OD, serial: int = 1042, name: str = "", simulated: bool = False) -> upkeep.MaintenanceLog:
    hand, _ = scripted({"FGET OD": od, "PGET TEMP PTEMP OTEMP UPSECS SN": f"412|573|0|7345678|{serial}"})
    hand.link.fake = simulated
    return upkeep.MaintenanceLog(hand, name)


def lubrication(of: upkeep.MaintenanceLog) -> dict[str, tuple[int, str]]:
    return {row["point"]: (row["value"], row["status"]) for row in of.lubrication()}


def test_strokes_and_cycles() -> None:
    """Counts / 17,500 and / 3,100 (§7.3), two strokes a cycle; the dossier's example."""
    rows = care().rows()
    at = {(row["name"], row["motor"]): row["value"] for row in rows}
    assert [at["odometer", motor] for motor in ("F1", "SPREAD")] == [104233, 20117]
    assert [at["strokes", motor] for motor in ("F1", "F2", "F3", "SPREAD")] == [5956, 5640, 6285, 6489]
    assert (at["cycles", "F1"], at["cycles", "SPREAD"]) == (2978, 3245)
    assert (at["temperature", None], at["peak_temperature", None], at["uptime_seconds", None]) == (412, 573, 7345678)
    assert [row["point"] for row in rows if "point" in row] == POINTS
    assert {row["name"]: row["source"] for row in rows if row["value"] is None} == {
        "fastener_check": "barrett §7.2",
        "cable_pretension": "barrett §7.1",
        "strain_zero": "barrett §7.4",
        "firmware": "barrett §3.7",
    }


def test_due_counts_from_the_last_greasing() -> None:
    first = care()
    assert set(lubrication(first).values()) == {(5956, FAIL), (5640, FAIL), (6285, FAIL), (6489, FAIL)}
    first.grease(upkeep.chosen_points("spur.F1,palm"))
    later = lubrication(care("191733 98712 110003 33000"))  # 87,500,000 counts = 5000 strokes of F1 later
    assert later["spur.F1"] == (5000, WARNING)
    assert later["worm.F1"] == (10956, FAIL)
    assert later["palm.SPREAD"] == ((33000 - 20117) * 10 // 31, WARNING)
    assert lubrication(care("191734 98712 110003 20117"))["spur.F1"] == (5000, FAIL)  # 5000.06: over
    assert lubrication(care("104234 98712 110003 20117"))["spur.F1"] == (0, OK)


def test_the_journal_is_kept_by_serial_number_and_name(tmp_path: Path) -> None:
    care().grease(upkeep.chosen_points("all"))
    assert set(lubrication(care()).values()) == {(0, OK)}
    assert FAIL in {status for _, status in lubrication(care(serial=7)).values()}
    assert FAIL in {status for _, status in lubrication(care(simulated=True)).values()}
    assert FAIL in {status for _, status in lubrication(care(name="left")).values()}
    content = json.loads((tmp_path / "handctl" / "barrett-greasing.json").read_text())
    assert list(content) == ["1042"]
    assert sorted(content["1042"]) == sorted(POINTS)
    assert content["1042"]["palm.SPREAD"]["odometer"] == 20117
    assert not list((tmp_path / "handctl").glob("*.part"))


def test_serial_number_0_needs_a_name() -> None:
    with pytest.raises(UsageError, match="serial number is 0"):
        care(serial=0).grease(upkeep.chosen_points("all"))
    care(serial=0, name="left").grease(upkeep.chosen_points("all"))
    assert set(lubrication(care(serial=0, name="left")).values()) == {(0, OK)}
    assert FAIL in {status for _, status in lubrication(care(serial=0, name="right")).values()}
    assert FAIL in {status for _, status in lubrication(care(serial=0)).values()}
    assert "--hand NAME" in care(serial=0).lubrication()[0]["label"]
    hand, _ = scripted({"FGET OD": OD, "PGET TEMP PTEMP OTEMP UPSECS SN": "412|573|600|1|0"})
    upkeep.table_of(hand, upkeep.MaintenanceLog(hand), check=False)
    assert codes(hand) == ["which-hand"]


def test_an_odometer_that_went_back_is_another_hand() -> None:
    care().grease(upkeep.chosen_points("palm"))
    hand, _ = scripted({"FGET OD": "1 2 3 20116", "PGET TEMP PTEMP OTEMP UPSECS SN": "412|573|0|1|1042"})
    rows = upkeep.MaintenanceLog(hand).lubrication()
    assert [row["value"] for row in rows if row["motor"] == "SPREAD"] == [6489]
    assert codes(hand) == ["odometer-back"]


@pytest.mark.parametrize("text", ["{", "[]", '{"1042": 3}', '{"1042": {"palm.SPREAD": {"odometer": "x"}}}'])
def test_a_damaged_journal_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "handctl" / "barrett-greasing.json"
    path.parent.mkdir()
    path.write_text(text)
    with pytest.raises(UsageError, match="barrett-greasing"):
        care()
    assert path.read_text() == text


def test_a_journal_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "handctl").write_text("a file in the way")
    with pytest.raises(OutputError):
        state_files.store(tmp_path / "handctl" / "x.json", "thing", {})


def test_a_refused_odometer_is_an_error() -> None:
    hand, _ = scripted(
        {"FGET OD": "ERR 8192", "PGET TEMP OTEMP": "702|600", "PGET TEMP PTEMP OTEMP UPSECS SN": "702|702|600|1|1042"}
    )
    with pytest.raises(DeviceRefused):
        upkeep.MaintenanceLog(hand)


@pytest.mark.parametrize(
    ("text", "points"),
    [("all", POINTS), ("worm", POINTS[:3]), ("palm", POINTS[9:]), ("spur.F2", ["spur.F2"]), ("SPUR.2", ["spur.F2"]),
     ("palm,worm.f3,palm", ["worm.F3", "palm.SPREAD"]), ("motor-spur.F1", ["motor-spur.F1"])],
)  # fmt: skip
def test_points(text: str, points: list[str]) -> None:
    assert [f"{point.name}.{motor}" for point, motor in upkeep.chosen_points(text)] == points


@pytest.mark.parametrize("text", ["", "x", "worm.F4", "palm.F1", "worm.", "all.F1", ","])
def test_no_points(text: str) -> None:
    with pytest.raises(UsageError):
        upkeep.chosen_points(text)


def test_thresholds() -> None:
    """Dossier 9.4."""
    assert [health_limits.temperature(t).status for t in (600, 601, 650, 651)] == [OK, WARNING, WARNING, FAIL]
    assert [health_limits.peak(t).status for t in (649, 650)] == [OK, WARNING]
    assert [health_limits.over_temperature_limit(t).status for t in (0, 60, 299, 300, 600, 650, 651)] == [
        OK, FAIL, FAIL, OK, OK, OK, WARNING,
    ]  # fmt: skip
    assert "600" in health_limits.over_temperature_limit(60).evidence
    assert [health_limits.motor_status("F1", s).status for s in (0, 4, 16, 16384, 20, 1, 2, 5, 8192, 8)] == [
        OK, WARNING, WARNING, WARNING, WARNING, FAIL, FAIL, FAIL, FAIL, FAIL,
    ]  # fmt: skip
    assert [upkeep.due(strokes) for strokes in (0, 3999.9, 4000, 5000, 5000.1)] == [
        OK,
        OK,
        WARNING,
        WARNING,
        FAIL,
    ]


def test_setting_thresholds() -> None:
    def verdict(name: str, motor: str | None, value: int) -> str:
        found = list(health_limits.settings({(name, motor): value}))
        assert len(found) <= 1
        return found[0].status if found else OK

    for name, motor, value, expected in [
        ("IVEL", "F1", 300, OK), ("IVEL", "F1", 299, WARNING), ("IVEL", "F1", 301, FAIL), ("IVEL", "SPREAD", 151, FAIL),
        ("IHIT", "F2", 5, WARNING), ("IHIT", "F2", 6, FAIL), ("IOFF", "F3", 500, WARNING), ("IOFF", "F3", 501, FAIL),
        ("TSTOP", "F1", 30, OK), ("TSTOP", "F1", 20, WARNING), ("TSTOP", "F1", 31, FAIL), ("MOV", "F1", 40, OK),
        ("MOV", "F1", 39, WARNING), ("MCV", "SPREAD", 39, WARNING), ("EN", "F2", 0, WARNING), ("BAUD", None, 384, WARNING),
        ("BAUD", None, 97, FAIL), ("HOLD", "F1", 1, WARNING), ("HOLD", "SPREAD", 1, OK), ("SGFLIP", "F1", 1, FAIL),
        ("DP", "F1", 70000, FAIL), ("DP", "F1", 1, OK), ("FDZ", "F1", 3, WARNING), ("MOV", "F1", 15, FAIL),
    ]:  # fmt: skip
        assert verdict(name, motor, value) == expected, (name, motor, value)
    assert [f.check for f in health_limits.settings({("HSG", "F1"): 150, ("MSG", "F1"): 256})] == ["HSG.F1"]
