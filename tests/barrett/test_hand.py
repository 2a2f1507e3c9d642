"""Parameters of the BarrettHand read and written: batches, lost answers, read-back, its speed, snapshots (barrett §5.2)."""

from __future__ import annotations

import pytest

from handctl.devices.barrett import explain_bytes
from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.codec import Answer
from handctl.devices.barrett.gcl.line import GclLine
from handctl.devices.barrett.parameter_map import BARRETT
from handctl.devices.barrett.status_and_parameter_views import parameters_view, unhealthy
from handctl.errors import CheckFailed, DeviceRefused, NoAnswer, ProtocolError
from handctl.link.transcript import observed
from handctl.model.result import Journal
from handctl.screen.terminal_tables import fitting
from tests.barrett.support import (
    CR,
    QUESTION,
    ScriptedHand,
    changes,
    codes,
    elements,
    scripted,
    simulated,
)
from tests.support.each_row import each_row

DUMP = [
    "FGET DP DS HSG LSG MOV MCV MSG OD P S SG LCV LCVC LCPG LFV LFVC LFS",
    "FGET LFAP LFDP LFDPC ACCEL CT EN FDZ FIP FPG HOLD IHIT IOFF IVEL MPE",
    "FGET OT SAMPLE SGFLIP TSTOP",
    "PGET BAUD LFT OTEMP TEMP PTEMP UPSECS SN LFDPD",
]


# -- reading ----------------------------------------------------------------------------------------------------------


def test_dump_is_four_lines() -> None:
    """At most four round trips for all 148 values (issue; dossier 12)."""
    hand, link = simulated("")
    table = hand.dump()
    assert link.commands == [*DUMP, "VERS"]
    assert all(len(line) <= 70 and len(line.split()) <= 19 for line in DUMP)
    assert len(table.rows) == 35 * 4 + 8
    assert table.failure is None
    assert codes(hand) == []


def test_dump_says_what_the_hand_says() -> None:
    hand, _ = simulated("")
    rows = {(row["parameter"], row["motor"]): row for row in hand.dump().rows}
    assert [rows[("P", motor)]["value"] for motor in ("F1", "F2", "F3", "SPREAD")] == [1021, 2042, 3063, 404]
    assert [rows[("IVEL", motor)]["value"] for motor in ("F1", "F2", "F3", "SPREAD")] == [300, 300, 300, 150]
    assert rows[("TEMP", None)] == {
        "name": "temperature", "parameter": "TEMP", "motor": None, "value": 412, "unit": "0.1 °C", "label": "41.2 °C",
        "default": None, "path": "temperature", "scaled": 41.2, "scaled_unit": "°C",
    }  # fmt: skip
    assert rows[("SG", "SPREAD")]["label"] == "no gauge" and "no gauge" in rows[("SG", "SPREAD")]["doubt"]
    assert rows[("SG", "F1")]["doubt"] is None and "before HI" in rows[("P", "F1")]["doubt"]
    assert rows[("S", "F1")]["label"] == "Motor not initialized (4)"
    assert rows[("OTEMP", None)]["label"] == "off"
    assert (rows[("DP", "SPREAD")]["default"], rows[("DP", "F1")]["default"]) == (1575, 8500)


def test_dump_is_a_table_at_80_columns_whatever_it_holds() -> None:
    """The longest value of each parameter, changed and doubted: no table of a dump becomes records."""
    hand, _ = simulated("")
    table = hand.dump()
    for row in table.rows:
        param = BARRETT[row["name"]]
        high = param.high if param.high is not None else 2**31
        row["value"] = -high if param.low is None else high
    grids = parameters_view(table.rows)
    assert [grid.headings[0] for grid in grids] == ["GCL"] * 4
    assert all(fitting(grid, 80) for grid in grids), [fitting(grid, 80) for grid in grids]
    assert sum(len(grid.lines) for grid in grids) == len({row["name"] for row in table.rows})


def test_dump_warns_of_what_heats() -> None:
    hand, _ = simulated("")
    hand.line.ask("3FSET TSTOP 10000")
    hand.dump()
    message = hand.journal.messages[0]
    assert message.code == "audit"
    assert "F3: TSTOP = 10000" in message.text


@each_row(
    ("names", "lines"),
    [
        (["P"], ["FGET P"]), (["P.F1"], ["1FGET P"]), (["SG.F1", "SG.F3"], ["13FGET SG"]), (["P.S"], ["4FGET P"]),
        (["P.F1", "SG.SPREAD"], ["14FGET P SG"]), (["TEMP"], ["PGET TEMP"]), (["P", "TEMP", "SG"], ["FGET P SG", "PGET TEMP"]),
        (["TEMP", "SN"], ["PGET TEMP SN"]), (["P.F3", "P.F1", "P.F2"], ["123FGET P"]),
    ],
)  # fmt: skip
def test_get_lines(names: list[str], lines: list[str]) -> None:
    hand, link = simulated("")
    wanted = elements(*names)
    readings = hand.read(wanted)
    assert link.commands == lines
    assert [reading.element for reading in readings] == wanted
    assert all(reading.error is None for reading in readings)


def test_values_come_to_their_motors() -> None:
    hand, _ = scripted({"134FGET P SG": "10 30 40|11 31 255"})
    readings = hand.read(elements("P.F1", "P.F3", "SG.SPREAD"))
    assert [reading.value for reading in readings] == [10, 30, 255]


def test_later_firmware_is_asked_by_itself() -> None:
    script = {"FGET P": "1 2 3 4", "FGET BD BP": "ERR 64", "FGET BD": "ERR 64", "FGET BP": "ERR 64"}
    hand, link = scripted(script)
    readings = hand.read(elements("P", "BD", "BP"))
    assert link.commands == ["FGET P", "FGET BD BP", "FGET BD", "FGET BP"]
    assert [reading.value for reading in readings[:4]] == [1, 2, 3, 4]
    assert {reading.error.code for reading in readings[4:] if reading.error} == {"err-64"}
    table = hand.table(readings)
    assert table.failure is not None
    assert table.failure.exit_code == 6
    assert len(table.rows) == 12


@each_row("firmware", ["4.34", "4.4"])
def test_later_firmware_has_them(firmware: str) -> None:
    hand, link = simulated(f"firmware={firmware}")
    assert [reading.value for reading in hand.read(elements("BDAT", "BS", "BD"))] == [1500] * 4 + [0] * 8
    assert link.commands == ["FGET BDAT BS BD"]
    rows = hand.dump().rows
    later = "BD BP BS BDAT" if firmware == "4.34" else "BD BP BS BDAT LCT LFBP LFAIN"
    assert link.commands[1:] == [*DUMP, "VERS", f"FGET {later}"]
    assert [row["parameter"] for row in rows[-4 * len(later.split()) :: 4]] == later.split()


@each_row("code", [32, 64, 1024])
def test_a_refused_batch_is_split(code: int) -> None:
    """On ERR 32, 64 or 1024 for a batched line, split it in two (dossier 1.4)."""
    script = {"GFGET P SG S DP": f"1 2 3|ERR {code}", "GFGET P SG": "1 2 3|4 5 6", "GFGET S DP": "0 0 0|7 8 9"}
    hand, link = scripted(script)
    names = [f"{name}.F{n}" for name in ("P", "SG", "S", "DP") for n in (1, 2, 3)]
    script = {command.replace("GFGET", "123FGET"): text for command, text in script.items()}
    link.script = {command: [text] for command, text in script.items()}
    readings = hand.read(elements(*names))
    assert [reading.value for reading in readings] == [1, 2, 3, 4, 5, 6, 0, 0, 0, 7, 8, 9]
    assert link.commands == ["123FGET P SG S DP", "123FGET P SG", "123FGET S DP"]


def test_only_the_unknown_name_is_lost() -> None:
    hand, link = scripted({"1FGET P SGFLIP": "5|ERR 64", "1FGET P": "5", "1FGET SGFLIP": "ERR 64"})
    position, flip = hand.read(elements("P.F1", "SGFLIP.F1"))
    assert position.value == 5
    assert flip.error is not None
    assert "Unknown parameter name (64)" in flip.error.text
    assert link.commands == ["1FGET P SGFLIP", "1FGET P", "1FGET SGFLIP"]


@each_row("limits", ["line-limit=40", "max-arguments=5"])
def test_dump_of_a_hand_with_tighter_limits(limits: str) -> None:
    hand, _ = simulated(limits)
    table = hand.dump()
    assert table.failure is None
    assert all("value" in row for row in table.rows)
    assert len(table.rows) == 148


def test_over_temperature_is_not_split() -> None:
    hand, link = scripted({"FGET P SG": "ERR 8192", "PGET TEMP OTEMP": "410|60"})
    refused = [reading.error for reading in hand.read(elements("P", "SG")) if reading.error]
    assert {error.code for error in refused} == {"err-8192"} and all("6.0 °C" in error.hint for error in refused)
    assert link.commands == ["FGET P SG", "PGET TEMP OTEMP"]  # once, to name the heat or the setting


def test_a_lost_line_keeps_the_others() -> None:
    hand, _ = scripted({"FGET P": "1 2 3 4", "PGET TEMP": None}, retries=0)
    table = hand.table(hand.read(elements("P", "TEMP")))
    assert [row.get("value") for row in table.rows] == [1, 2, 3, 4, None]
    assert "error" in table.rows[4]
    assert table.failure is not None
    assert table.failure.exit_code == 4


def test_nothing_read_is_an_error() -> None:
    hand, _ = scripted({"FGET P": None}, retries=0)
    with pytest.raises(NoAnswer):
        hand.read(elements("P"))


def test_values_of_another_number_are_no_values() -> None:
    hand, _ = scripted({"FGET P": "1 2 3"}, retries=1)
    with pytest.raises(ProtocolError) as caught:
        hand.read(elements("P"))
    assert caught.value.code == "bad-line"


def test_a_spoiled_line_is_asked_again() -> None:
    hand, link = scripted({"FGET P": ["1 2 x 4", "1 2 3 4"]})
    assert [reading.value for reading in hand.read(elements("P"))] == [1, 2, 3, 4]
    assert link.commands == ["FGET P", "FGET P"]
    assert (hand.journal.counters.retries, hand.journal.counters.bad_frames) == (1, 1)


def test_a_spoiled_line_is_told_with_its_bytes() -> None:
    hand, link = scripted({"FGET P": b"FGET P\n\r\xb1 2 3 4\n\r=> "}, retries=0)
    with pytest.raises(ProtocolError) as caught:
        hand.read(elements("P"))
    for part in (link.name, "FGET P", "expected 4 numbers", "(B1 20 32 20 33 20 34)"):
        assert part in caught.value.text
    assert "cable" in caught.value.hint


def test_a_failed_line_names_the_link_once() -> None:
    hand, link = scripted({"FGET P": "1 2 3 4", "PGET TEMP": "x"}, retries=0)
    failure = hand.table(hand.read(elements("P", "TEMP"))).failure
    assert failure is not None and failure.text.startswith(f"{link.name}: TEMP: PGET TEMP: expected 1 numbers")
    assert failure.text.count(link.name) == 1


@each_row("text", ["4.33", "VERS 4.33", "BarrettHand Firmware|Version 4.33"])
def test_version_is_the_hands_own_text(text: str) -> None:
    hand, _ = scripted({"VERS": text})
    assert hand.version() == text.replace("|", " ")


def test_a_prompt_alone_is_no_version() -> None:
    """Of a download that is what shows that the new firmware runs."""
    hand, link = scripted({"VERS": ""})
    with pytest.raises(ProtocolError):
        hand.version()
    assert link.commands.count("VERS") == 1 + hand.line.retries


def test_refusal_names_the_sum() -> None:
    hand, link = scripted()
    error = hand.refusal(Answer("13M 17000", (), 20, b""))
    assert (error.exit_code, error.code) == (6, "err-20")
    assert f"{link.name}: 13M 17000: ERR 20: Motor not initialized (4) + Couldn't reach position (16)" in error.text
    assert "init" in error.hint


# -- status -----------------------------------------------------------------------------------------------------------


@each_row(
    ("query", "words"),
    [
        ("fault=no-board", "F2: No motor board found (1)"), ("fault=no-motor", "F3: No motor found (2)"),
        ("fault=hot", "70.2"), ("temperature=-550", "-55.0"), ("fault=unknown-codes", "(not used) (8)"),
    ],
)  # fmt: skip
def test_status_check(query: str, words: str) -> None:
    hand, _ = simulated(query)
    table = hand.status(True)
    assert table.failure is not None
    assert table.failure.exit_code == 7
    assert words in table.failure.text


def test_a_hand_that_waits_for_hi_is_told_once_for_all_motors() -> None:
    hand, _ = simulated("")
    table = hand.status(True)
    assert table.failure is not None and table.failure.exit_code == 7
    assert codes(hand) == ["unhealthy"]


def test_temperatures() -> None:
    def rows(temp: int, limit: int, peak: int = 500) -> list[dict[str, object]]:
        return [
            {"parameter": name, "motor": None, "value": value}
            for name, value in (("TEMP", temp), ("OTEMP", limit), ("PTEMP", peak))
        ]

    assert list(unhealthy(rows(650, 0))) == []
    assert len(list(unhealthy(rows(651, 0)))) == 1
    assert len(list(unhealthy(rows(601, 600)))) == 1
    assert list(unhealthy(rows(600, 600))) == []
    assert len(list(unhealthy(rows(400, 0, 650)))) == 1
    assert list(unhealthy(rows(400, 0, 649))) == []


# -- writing ----------------------------------------------------------------------------------------------------------


@each_row(
    ("texts", "lines"),
    [
        (["MCV=80"], ["FSET MCV 80"]), (["HSG.F1=150", "HSG.F2=150"], ["12FSET HSG 150"]), (["DP.S=5"], ["4FSET DP 5"]),
        (["MCV=80", "DS=5"], ["FSET DS 5 MCV 80"]), (["LFT=1", "OTEMP=600"], ["PSET LFT 1 OTEMP 600"]),
        (["HSG.F1=1", "HSG.F2=2", "HSG.F3=1"], ["13FSET HSG 1", "2FSET HSG 2"]),
        (["LFT=1", "EN.F3=0"], ["3FSET EN 0", "PSET LFT 1"]),
    ],
)  # fmt: skip
def test_write_lines(texts: list[str], lines: list[str]) -> None:
    hand, link = simulated("")
    wanted = changes(*texts)
    assert [step.data for step in hand.plan(wanted)] == [line.encode() + CR for line in lines]
    readings = hand.write(wanted)
    assert link.commands[: len(lines)] == lines
    assert all("GET" in line for line in link.commands[len(lines) :])
    assert [(reading.element, reading.value) for reading in readings] == wanted


def test_a_plan_is_what_is_sent_also_with_baud() -> None:
    hand, link = simulated("")
    wanted = changes("BAUD=384", "LFT=1")
    planned = [step.data for step in hand.plan(wanted)]
    hand.write(wanted)
    assert [data for data in link.sent if b"SET" in data] == planned
    assert [step.strands for step in hand.plan(wanted)] == [False, True]


def test_a_refused_write_says_what_is_set() -> None:
    hand, link = scripted({"1FSET DP 5": "", "2FSET DP 6": "ERR 128"})
    with pytest.raises(DeviceRefused) as caught:
        hand.write(changes("DP.F1=5", "DP.F2=6"))
    assert caught.value.code == "err-128"
    assert "1FSET DP 5" in caught.value.hint
    assert link.commands == ["1FSET DP 5", "2FSET DP 6"]


def test_a_line_refused_in_its_middle_may_be_half_set() -> None:
    """The first wrong pair ends the line; whether those before it stay is not known (§5.1.3): it is said."""
    hand, _ = simulated("firmware=4.33")
    with pytest.raises(DeviceRefused) as caught:
        hand.write(changes("MCV=80", "BS=1", "MOV=90"))
    assert caught.value.code == "err-64" and "MCV" in caught.value.hint
    hand, _ = simulated("firmware=4.33")
    with pytest.raises(DeviceRefused) as caught:
        hand.write(changes("BS=1"))
    assert "perhaps" not in caught.value.hint.lower()


def test_a_lost_answer_is_read_back_not_written_again() -> None:
    hand, link = scripted({"FSET DP 5": None, "FGET DP": "5 5 5 5"})
    assert [reading.value for reading in hand.write(changes("DP=5"))] == [5, 5, 5, 5]
    assert link.commands == ["FSET DP 5", "FGET DP"]
    assert link.sent[1] == QUESTION
    assert codes(hand) == ["answer-lost"]


@each_row("answer", ["", None])
def test_read_back_differs(answer: str | None) -> None:
    hand, _ = scripted({"FSET DP 5": answer, "FGET DP": "5 5 8500 5"})
    with pytest.raises(CheckFailed) as caught:
        hand.write(changes("DP=5"))
    assert (caught.value.code, caught.value.exit_code) == ("read-back", 7)
    assert "default_position.F3 reads 8500 after 5 was written" in caught.value.text


def test_the_odometer_is_told_in_strokes() -> None:
    """§7.3: counts / 17,500 for a finger, / 3,100 for the spread; OD counts thousands (dossier 9)."""
    hand, _ = simulated("")
    table = hand.status(check=False)
    labels = {row["motor"]: row["label"] for row in table.rows if row["parameter"] == "OD"}
    assert labels == {"F1": "5956 strokes", "F2": "5640 strokes", "F3": "6285 strokes", "SPREAD": "6489 strokes"}
    assert table.view is not None
    (grid,) = table.view(table.rows)
    assert grid.headings[3] == "Strokes"
    assert [line[3] for line in grid.lines] == ["5956", "5640", "6285", "6489"]


def test_a_value_that_reads_back_otherwise_is_not_confirmed() -> None:
    """Neither by its prompt nor by the other values that were written with it: the ledger says what is true."""
    journal, link = Journal(), ScriptedHand({"FSET DP 5": "", "FGET DP": "5 5 8500 5"})
    journal.ledger.words = explain_bytes.words()
    hand = BarrettHand(GclLine(observed(link, journal.ledger), journal))  # type: ignore[arg-type]
    with pytest.raises(CheckFailed):
        hand.write(changes("DP=5"))
    (row,) = journal.ledger.rows()
    assert (row["state"], row["evidence"]) == ("sent", "reads back otherwise"), row
