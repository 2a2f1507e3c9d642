"""What an EksoNR tells, as rows and for people: messages, clock, status and its checks, cancel; and what it may import."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from handctl.command.get_set_watch import select
from handctl.devices.ekso.device import dump_view, one_setting, words_view
from handctl.devices.ekso.parameter_map import EKSO, MESSAGES
from handctl.devices.ekso.status import status_view, unfit
from handctl.errors import (
    CheckFailed,
    DeviceRefused,
    HandctlError,
    Interrupted,
    LinkError,
    NoAnswer,
    ProtocolError,
    UsageError,
)
from handctl.model.param import Reading
from handctl.model.result import Cell, Grid
from tests.ekso.support import (
    CANCEL,
    DATA,
    DATE,
    FEEDBACK,
    SETTING_WORDS,
    SETTINGS,
    TIME,
    UNKNOWN,
    Unit,
    codes,
    ekso_on,
    frame,
    pack,
)
from tests.support.each_row import each_row
from tests.support.loading import back_ends, heavy, loaded
from tests.support.scripted import Reply

SPELLED = {"settings": SETTINGS, "data": DATA, "feedback": FEEDBACK}


def texts(grid: Grid) -> list[list[str]]:
    """The cells of a grid as text."""
    return [[cell.text if isinstance(cell, Cell) else cell for cell in line] for line in grid.lines]


# -- messages ---------------------------------------------------------------------------------------------------------


@each_row("message", MESSAGES)
def test_every_word_is_a_row(message: str) -> None:
    """A ladder: every word has another value, so none can stand in the place of another."""
    unit = Unit()
    count = len(MESSAGES[message])
    words = [0xF000 + 17 * word for word in range(count)]
    unit.on = {SPELLED[message]: lambda msg_id, _: [(0.001, frame(SPELLED[message], msg_id, pack(words)))]}
    rows = ekso_on(unit).shown(message).rows
    assert len(unit.sent) == 1
    assert [row["word"] for row in rows] == list(range(count))
    for row, param in zip(rows, MESSAGES[message], strict=True):
        raw = words[param.word] - (65536 if param.signed else 0)
        assert (row["name"], row["id"], row["raw"], row["unit"]) == (param.name, param.id, raw, param.unit)
        assert row["value"] == raw / 10**param.decimals
        if param.choices:
            assert row["label"] == f"unknown ({raw})"


def test_rows_of_the_vectors() -> None:
    unit = Unit()
    ekso = ekso_on(unit)
    rows = {row["name"]: row for row in ekso.shown("settings").rows}
    assert rows["forward_shift"] == {
        "name": "forward_shift", "word": 8, "id": 208, "value": -0.75, "raw": -75, "unit": None, "label": None,
        "path": "forward_shift",
    }  # fmt: skip
    assert [rows[name]["label"] for name in ("walk_mode", "left_swing_assist", "swing_complete", "lean_allowance")] == [
        "ProStep", "50 %", "0.5", "Off",
    ]  # fmt: skip
    rows = {row["name"]: row for row in ekso.shown("data").rows}
    assert [rows[name]["value"] for name in ("right_hip_x", "left_hip_y", "weight_shift", "va_ref_time")] == [
        -4.9,
        36.22,
        0.125,
        1.2,
    ]
    assert rows["state"]["label"] == "standing (0x2040)"
    assert rows["foot_state"]["label"] == "0x0404"


def test_elements_are_read_with_one_request_a_message() -> None:
    unit = Unit()
    ekso = ekso_on(unit)
    readings = ekso.read(select(EKSO, ("202", "Torso Pitch Angle", "walk", "left_knee_angle")))
    assert [reading.value for reading in readings] == [15.5, 4.5, 2, 3.2]
    assert [reading.raw for reading in readings] == [b"\x06\x0e", b"\x01\xc2", b"\x00\x02", b"\x01\x40"]
    assert unit.commands() == [SETTINGS, DATA]


def test_a_message_that_fails_leaves_the_others() -> None:
    unit = Unit()
    unit.on = {DATA: lambda _msg_id, _body: []}
    ekso = ekso_on(unit)
    table = ekso.table(ekso.read(select(EKSO, ("step_length", "torso_pitch"))))
    assert table.rows[0]["value"] == 15.5
    assert "value" not in table.rows[1]
    assert "no reply to GetData" in table.rows[1]["error"]
    assert table.failure is not None
    assert (table.failure.exit_code, table.failure.code) == (4, "no-answer")
    with pytest.raises(NoAnswer):
        ekso.read(select(EKSO, ("torso_pitch",)))


def test_the_dump_has_everything_and_what_failed() -> None:
    unit = Unit()
    table = ekso_on(unit).dump()
    assert [row["message"] for row in table.rows] == [
        *("date", "time"), *["settings"] * 22, *["data"] * 27, *["feedback"] * 17,
    ]  # fmt: skip
    assert sorted(unit.commands()) == [TIME, DATE, DATE, SETTINGS, DATA, FEEDBACK]
    unit.on = dict.fromkeys((FEEDBACK, TIME), lambda _msg_id, _body: [])
    table = ekso_on(unit).dump()
    assert [row["message"] for row in table.rows] == ["date", *["settings"] * 22, *["data"] * 27]
    assert table.failure is None
    assert dump_view(table.rows)[0].lines == (("2026-11-20",),)
    kept = iter([True] * 2)
    unit.on = dict.fromkeys(range(150, 157), lambda _msg_id, _body: None if next(kept, False) else [])
    assert ekso_on(unit).dump().failure is not None  # silent from the third answer on: that is no firmware's way
    unit.on = dict.fromkeys(range(150, 157), lambda _msg_id, _body: [])
    with pytest.raises(NoAnswer):
        ekso_on(unit).dump()


# -- clock ------------------------------------------------------------------------------------------------------------


@each_row("pad", [b"", b"\x00", b"\x07"])
def test_time_and_date_with_three_or_four_bytes(pad: bytes) -> None:
    unit = Unit()
    unit.on = {
        TIME: lambda msg_id, _: [(0.001, frame(TIME, msg_id, bytes([23, 59, 59]) + pad))],
        DATE: lambda msg_id, _: [(0.001, frame(DATE, msg_id, bytes([7, 1, 31]) + pad))],
    }
    ekso = ekso_on(unit)
    (row,) = ekso.shown("time").rows
    assert row == {
        "name": "time", "word": None, "id": None, "value": "23:59:59", "raw": 0x173B3B, "unit": None, "label": None,
        "hour": 23, "minute": 59, "second": 59, "bytes": 3 + len(pad), "path": "time",
    }  # fmt: skip
    (row,) = ekso.shown("date").rows
    assert (row["value"], row["raw"], row["year"], row["month"], row["day"]) == ("2007-01-31", 0x07011F, 7, 1, 31)
    assert codes(ekso.journal) == []


def test_an_impossible_clock_is_shown_and_noted() -> None:
    unit = Unit()
    unit.on = {TIME: lambda msg_id, _: [(0.001, frame(TIME, msg_id, bytes([24, 60, 5])))]}
    ekso = ekso_on(unit)
    assert ekso.shown("time").rows[0]["value"] == "24:60:05"
    assert "hour 24, minute 60" in ekso.journal.messages[0].text


def test_midnight_between_the_two_messages() -> None:
    unit = Unit()
    days = iter([20, 21, 21, 21])
    unit.on = {DATE: lambda msg_id, _: [(0.001, frame(DATE, msg_id, bytes([26, 11, next(days)])))]}
    date, time = ekso_on(unit).now()
    assert (date["value"], time["value"]) == ("2026-11-21", "14:05:37")
    assert unit.commands() == [DATE, TIME, DATE, TIME, DATE]


# -- status -----------------------------------------------------------------------------------------------------------


def test_a_healthy_unit() -> None:
    unit = Unit()
    ekso = ekso_on(unit)
    table = ekso.status(True)
    assert table.failure is None
    rows = {row["name"]: row for row in table.rows}
    assert rows["boot_ms"]["value"] >= 5_000_101
    assert rows["boot_ms"]["label"].startswith("1 h 23 m 20.")
    assert (rows["date"]["value"], rows["time"]["value"]) == ("2026-11-20", "14:05:37")
    assert isinstance(rows["clock_offset"]["value"], int)
    assert "unhealthy" not in codes(ekso.journal)
    state, joints, feet, settings = status_view(table.rows)
    assert texts(state)[0] == ["posture", "standing (0x2040)"]
    assert texts(state)[3] == ["clock", "2026-11-20 14:05:37"]
    assert texts(joints)[3] == ["right knee", "8.40", "-0.40"]
    assert texts(feet) == [["left", "120", "480", "9.8", "36.22"], ["right", "95", "610", "-4.9", "36.00"]]
    assert texts(settings)[2] == ["step_length", "15.50 in", "injury_mode", "Bilateral"]
    for grid in (state, joints, feet, settings):
        lines = [list(grid.headings), *texts(grid)]
        assert sum(max(len(line[i]) for line in lines) + 2 for i in range(len(lines[0]))) <= 80


SPOILT: dict[str, tuple[Any, str]] = {
    "frozen": (lambda unit: setattr(unit, "boot_rate", 0.0), "BootTime does not advance"),
    "fast": (lambda unit: setattr(unit, "boot_rate", 3.0), "BootTime advanced by"),
    "right hip": (lambda unit: unit.data.__setitem__(6, 20), "the sensor on that side"),
    "legs": (lambda unit: unit.settings.__setitem__(0, 1400), "both hips are off"),
    "leg length": (lambda unit: unit.settings.__setitem__(1, 2600), "lower_leg_length 26.00 in is implausible"),
    "angle": (lambda unit: unit.data.__setitem__(17, 14000), "left_knee_angle 140.00 deg is implausible"),
    "roll": (lambda unit: unit.data.__setitem__(1, -6100), "torso_roll -61.00 deg is implausible"),
}


@each_row(("spoil", "says"), SPOILT.values(), ids=SPOILT)
def test_what_cannot_be_is_found(spoil: Any, says: str) -> None:
    unit = Unit()
    spoil(unit)
    ekso = ekso_on(unit)
    table = ekso.status(True)
    assert isinstance(table.failure, CheckFailed)
    assert says in table.failure.text.replace("Both", "both")
    assert table.failure.hint
    assert says in " ".join(message.text for message in ekso.journal.messages)
    assert ekso_on(unit).status(False).failure is None


def test_what_stands_out_is_no_fault() -> None:
    unit = Unit()
    unit.settings[10], unit.settings[16], unit.data[18] = 17, 5, UNKNOWN
    ekso = ekso_on(unit)
    assert ekso.status(True).failure is None
    said = " ".join(message.text for message in ekso.journal.messages)
    for text in (
        "walk_mode is unknown (17), word 10",
        "left_stance_support is unusual: Full",
        "unknown (0x4440)",
        "swing_assist differs: left 50 %, right 60 %",
    ):
        assert text in said


def test_a_restart_between_two_looks() -> None:
    unit = Unit()
    boots = itertools.chain([[76, 19265]], itertools.repeat([0, 1001]))
    unit.on = {DATA: lambda msg_id, _: [(0.001, frame(DATA, msg_id, pack([*unit.data[:25], *next(boots)])))]}
    failure = ekso_on(unit).status(True).failure
    assert failure is not None
    assert "the device has restarted" in failure.text


@each_row(("apart", "found"), [(-5200, True), (-4000, False), (4500, False), (5500, True)])
def test_boot_time_of_feedback_and_data_must_agree(apart: int, found: bool) -> None:
    unit = Unit()

    def answer(msg_id: int, _body: bytes) -> list[Reply]:
        boot = (unit.boot[0] << 16) + unit.boot[1] + apart
        return [(0.001, frame(FEEDBACK, msg_id, pack([*unit.feedback[:15], boot >> 16, boot & 0xFFFF])))]

    unit.on = {FEEDBACK: answer}
    failure = ekso_on(unit).status(True).failure
    assert (failure is not None) is found
    assert failure is None or "BootTime of data and feedback differ" in failure.text


def test_status_without_a_clock() -> None:
    unit = Unit()
    unit.on = {TIME: lambda _msg_id, _body: []}
    assert ekso_on(unit).status(False).failure is None
    table = ekso_on(unit).status(True)
    assert isinstance(table.failure, CheckFailed) and "time cannot be read" in table.failure.text
    assert "no reply to GetTime" in next(row["error"] for row in table.rows if row["name"] == "clock")
    assert texts(status_view(table.rows)[0])[3] == ["clock", "? ?"]


def test_a_link_that_is_lost_at_the_clock_is_no_success() -> None:
    def gone(_msg_id: int, _body: bytes) -> list[Reply]:
        raise LinkError("the port is gone", code="lost")

    unit = Unit()
    unit.on = {DATE: gone}
    table = ekso_on(unit).status(False)
    assert isinstance(table.failure, LinkError)
    assert len(table.rows) > 50
    unit = Unit()
    unit.on = {DATE: lambda _msg_id, _body: []}
    table = ekso_on(unit, timeout=1.0, bound=unit.deadline(1.5)).status(True)
    assert (
        isinstance(table.failure, NoAnswer) and table.failure.code == "no-answer" and "--deadline" in table.failure.text
    )


def test_unfit_at_the_edges() -> None:
    unit = Unit()
    ekso = ekso_on(unit)
    data = {r.element.param.name: float(r.value or 0) for r in ekso.readings("data")}
    settings = {r.element.param.name: float(r.value or 0) for r in ekso.readings("settings")}
    assert unfit(data, settings) == []
    for off, count in ((0.2, 0), (-0.2, 0), (0.4, 2), (-0.4, 2)):
        assert len(unfit({**data, "left_hip_x": data["left_hip_x"] + off}, settings)) == count
    for off, count in ((0.08, 0), (-0.12, 2)):
        assert len(unfit({**data, "left_hip_y": data["left_hip_y"] + off}, settings)) == count


# -- cancel -----------------------------------------------------------------------------------------------------------


def cancelling(unit: Unit, word: int = 0x0100) -> tuple[list[tuple[str, dict[str, object]]], Any]:
    """What is noted, and the table or the error."""
    noted: list[tuple[str, dict[str, object]]] = []
    try:
        return noted, ekso_on(unit).cancel(word, lambda event, fields: noted.append((event, fields)))
    except HandctlError as exc:
        return noted, exc


def test_cancel_is_sent_once_and_noted() -> None:
    unit = Unit()
    noted, table = cancelling(unit, 1)
    assert unit.sent == [frame(CANCEL, 1, b"\x00\x01")]
    assert table.rows == [
        {"name": "cancel_action", "word": 0, "id": None, "value": 0, "raw": 0, "unit": None, "label": "accepted"}
    ]
    assert [event for event, _ in noted] == ["cancel", "cancel-result"]
    assert noted[0][1]["frame"] == unit.sent[0].hex(" ").upper()
    unit = Unit()
    unit.status = 3
    noted, error = cancelling(unit)
    assert isinstance(error, DeviceRefused)
    assert "value or command not allowed" in error.text
    assert noted[1][1]["status"] == 3
    noted, error = cancelling(Unit(), 0)
    assert isinstance(error, UsageError)
    assert noted == []


def test_two_answers_to_cancel_that_contradict_each_other_are_no_success() -> None:
    for statuses in ([0, 2], [2, 0]):
        unit = Unit()
        unit.on = {
            CANCEL: lambda msg_id, _body, of=statuses: [
                (0.001 + 0.01 * n, frame(CANCEL, msg_id, pack([status]))) for n, status in enumerate(of)
            ]
        }
        noted, error = cancelling(unit)
        assert isinstance(error, DeviceRefused) and error.exit_code == 6
        assert all(f"0x{status:04X}" in str(noted[1][1]["verdict"]) for status in statuses)
        assert unit.commands() == [CANCEL]


def test_cancel_without_an_answer_shows_the_state_and_is_not_repeated() -> None:
    unit = Unit()
    unit.on = {CANCEL: lambda _msg_id, _body: []}
    noted, error = cancelling(unit)
    assert isinstance(error, NoAnswer)
    assert "The state is standing (0x2040)" in error.hint
    assert unit.commands() == [CANCEL, DATA]
    assert noted[1][1]["answer"] is None


def test_ctrl_c_says_that_cancel_was_sent() -> None:
    for when in (0.01, 0.6):  # while its answer is awaited, and while the state is read
        unit = Unit()

        def silent(_msg_id: int, _body: bytes, unit: Unit = unit, when: float = when) -> list[Reply]:
            unit.interrupt_at = unit.clock + when
            return []

        unit.on = {CANCEL: silent, DATA: lambda _msg_id, _body: []}
        noted, error = cancelling(unit)
        assert isinstance(error, Interrupted)
        assert error.text == "interrupted. CancelAction was sent and may have taken effect"
        assert noted[-1] == (
            "cancel-result", {"answer": None, "verdict": "interrupted before its reply"},
        )  # fmt: skip
        assert unit.commands().count(CANCEL) == 1


def test_cancel_that_was_not_sent_does_not_claim_it() -> None:
    unit = Unit()
    noted: list[tuple[str, dict[str, object]]] = []
    with pytest.raises(NoAnswer) as caught:
        ekso_on(unit, bound=unit.deadline(0.0)).cancel(0x0100, lambda event, fields: noted.append((event, fields)))
    assert "CancelAction was not sent" in caught.value.text
    assert (caught.value.hint, unit.sent) == ("give a longer --deadline", [])
    assert noted[1][0] == "cancel-result"
    unit = Unit()
    unit.interrupt_at = 0.001  # while the line is made quiet
    with pytest.raises(KeyboardInterrupt):
        cancelling(unit)
    assert unit.sent == []


def test_an_echo_of_cancel_is_no_status() -> None:
    """Its default word, read as a status, would be `accepted`."""
    unit = Unit()
    unit.on = {CANCEL: lambda msg_id, body: [(0.001, frame(CANCEL, msg_id, body))]}
    _, error = cancelling(unit)
    assert isinstance(error, ProtocolError)
    assert error.code == "echo"


# -- plans and people ---------------------------------------------------------------------------------------------------


def test_plans() -> None:
    unit = Unit()
    ekso = ekso_on(unit)
    (step,) = ekso.plan([one_setting(["forward_shift=-0.75"])])
    assert step.data == frame(155, 1, bytes.fromhex("00 D0 FF B5"))
    assert step.meaning == "forward_shift = -0.75"
    ekso.words("settings")
    (step,) = ekso.plan([one_setting(["walk_mode=First Step"])])
    assert step.meaning == "walk_mode ProStep -> First Step"
    with pytest.raises(UsageError) as caught:
        ekso.plan([one_setting(["swing_time=2"])])
    assert caught.value.code == "step-limit"
    assert unit.commands() == [SETTINGS]
    with pytest.raises(UsageError) as caught:
        one_setting(["step_length=15", "step_height=2"])
    assert caught.value.code == "one-by-one"


def test_lines_for_people() -> None:
    ekso = ekso_on(Unit())
    (grid,) = words_view(ekso.shown("settings").rows)
    assert grid.headings == ("Name", "ID", "Value", "Unit", "Meaning")
    assert texts(grid)[2] == ["step_length", "202", "15.50", "in", ""]
    assert texts(grid)[19] == ["pilot_id", "", "7", "", ""]
    (grid,) = words_view(ekso.shown("data").rows)
    assert texts(grid)[22] == ["weight_shift", "0.125", "", ""]
    assert grid.notes[0].startswith("boot 1 h 23 m 20.")
    elements = select(EKSO, ("step_length",))
    (grid,) = words_view([ekso.row(Reading(elements[0], None, b"", NoAnswer("silence")))])
    assert grid.lines[0][2] == Cell("?", "bad")
    assert grid.notes == ("step_length: silence",)
    assert SETTING_WORDS[2] == 1550


# -- layers -----------------------------------------------------------------------------------------------------------


@pytest.mark.real
@each_row("args", [("ekso", "-h"), ("ekso", "describe", "--json"), ("ekso", "status", "-h")])
def test_without_a_device_nothing_is_loaded(args: tuple[str, ...]) -> None:
    code, modules = loaded(*args)
    assert code == 0
    assert heavy(modules) == set()
    assert back_ends(modules) == set()
    assert not any(name.startswith("handctl.sim") for name in modules)


@pytest.mark.real
def test_a_dump_loads_its_family_alone() -> None:
    code, modules = loaded("ekso", "dump", "--fake", "--json")
    assert code == 0
    assert heavy(modules) == set()
    assert "socket" not in modules
    assert all(name.startswith("handctl.devices.ekso") for name in modules if name.startswith("handctl.devices."))
