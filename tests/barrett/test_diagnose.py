"""Troubleshooting: the book of symptoms, every check on a scripted hand, the movements on a simulated one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.maintenance import diagnose, health_limits, symptoms
from handctl.devices.barrett.maintenance.diagnose import CHECKS, ExaminedHand
from handctl.devices.barrett.maintenance.health_limits import Finding
from handctl.devices.barrett.maintenance.symptoms import PROCEDURES
from handctl.devices.barrett.parameter_map import BARRETT, GclParam
from handctl.errors import CheckFailed, Interrupted, LinkError, UsageError
from handctl.model.check_rows import FAIL, OK, SKIPPED, WARNING
from handctl.model.prompts import Prompts
from tests.barrett.support import Simulated, hand_on, scripted, simulated
from tests.support.each_row import each_row
from tests.support.scripted import ScriptedLink

# the 17 symptoms of §8 in the manual's order
NAMES = [
    "erratic", "no-communication", "strain-range", "strain-curve", "early-breakaway", "sticks-closed", "sticks-open",
    "wrong-direction", "no-breakaway", "uneven-torque", "incomplete-close", "spread-friction", "locking-ring", "tip-flops",
    "tip-backlash", "tip-hyperextended", "spread-uneven",
]  # fmt: skip


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def patient(query: str = "initialized=1") -> ExaminedHand:
    return ExaminedHand(simulated(query)[0])


def with_values(**changed: int) -> ExaminedHand:
    """A hand whose values are the factory's but for `MNEMONIC_MOTOR`."""
    body = patient()
    for key, value in changed.items():
        name, _, motor = key.partition("_")
        assert (name, motor or None) in body.values
        body.values[name, motor or None] = value
    return body


def statuses(found: list[Finding]) -> dict[str, str]:
    return {finding.check: finding.status for finding in found}


# -- the book ---------------------------------------------------------------------------------------------------------


def test_the_book_has_the_manuals_symptoms_and_only_known_checks() -> None:
    assert list(symptoms.SYMPTOMS) == NAMES
    for name, entry in symptoms.SYMPTOMS.items():
        assert set(entry.checks) <= set(CHECKS), name
        assert set(entry.trials) <= set(diagnose.TRIALS), name
        assert entry.steps and all("§" in source for _, source in entry.steps), name
    used = {check for entry in symptoms.SYMPTOMS.values() for check in entry.checks}
    assert set(CHECKS) == used | set(diagnose.USUAL)
    assert set(diagnose.TRIALS) == {trial for entry in symptoms.SYMPTOMS.values() for trial in entry.trials}


def test_procedures_have_sections() -> None:
    for procedure in PROCEDURES.values():
        assert procedure.steps and all("§" in source for _, source in procedure.steps)


def test_unknown_symptoms() -> None:
    with pytest.raises(UsageError) as caught:
        diagnose.symptom_of("stick-open")
    assert "sticks-open" in caught.value.hint
    with pytest.raises(UsageError) as caught:
        diagnose.symptom_of("backlash")
    assert "tip-backlash" in caught.value.hint


# -- checks -----------------------------------------------------------------------------------------------------------


@each_row(
    ("check", "changed", "bad"),
    [
        (diagnose.status, {}, {}),
        (diagnose.status, {"S_F2": 4}, {"status.F2": WARNING}),
        (diagnose.status, {"S_F2": 2, "S_F3": 4}, {"status.F2": FAIL, "status.F3": WARNING}),
        (diagnose.parameters, {}, {}),
        (diagnose.parameters, {"DP_F1": 1}, {}),
        (diagnose.parameters, {"TSTOP_F3": 10000, "EN_F1": 0}, {"TSTOP.F3": FAIL, "EN.F1": WARNING}),
        (diagnose.parameters, {"MSG_F1": 3}, {"HSG.F1": FAIL}),
        (diagnose.over_temperature_limit, {"OTEMP": 60}, {"over_temperature_limit": FAIL}),
        (diagnose.temperature, {"TEMP": 651, "PTEMP": 651}, {"temperature": FAIL, "peak_temperature": WARNING}),
        (diagnose.status, {f"S_{motor}": 4 for motor in MOTORS}, {}),
        (diagnose.can_move, {}, {}),
        (diagnose.can_move, {f"S_{motor}": 4 for motor in MOTORS}, {}),
        (diagnose.can_move, {"HSG_F1": 100, "LSG_F2": 200}, {"can_move.F1": FAIL, "can_move.F2": FAIL}),
        (diagnose.can_move, {"HSG_F1": 112, "LSG_F2": 119}, {"can_move.F1": FAIL, "can_move.F2": FAIL}),  # at the limit
        (diagnose.can_move, {"HSG_F1": 113, "LSG_F2": 118}, {}),
        (diagnose.can_move, {"HSG_SPREAD": 100}, {"can_move.SPREAD": FAIL}),
        (diagnose.can_move, {"EN_F3": 0, "FPG_F1": 0}, {"can_move.F3": WARNING, "can_move.F1": FAIL}),
        (diagnose.can_move, {"ACCEL_F1": 65535, "ACCEL_F2": 0}, {"can_move.F1": FAIL, "can_move.F2": FAIL}),
        (diagnose.can_move, {"CT_F1": 0, "OT_F2": 60000, "OT_F3": 16980}, {f"can_move.F{n}": FAIL for n in (1, 2, 3)}),
        (diagnose.can_move, {"MOV_F1": 16, "TSTOP_F2": 0}, {"can_move.F1": WARNING, "can_move.F2": WARNING}),
        (diagnose.can_move, {"S_F1": 1, "S_F2": 6}, {"can_move.F1": FAIL, "can_move.F2": FAIL}),
        (diagnose.can_move, {"OTEMP": 60}, {f"can_move.{motor}": FAIL for motor in MOTORS}),
        (diagnose.can_move, {"OTEMP": 600, "TEMP": 601}, {f"can_move.{motor}": FAIL for motor in MOTORS}),
        (diagnose.parameters, {"OT_F1": 60000, "LCVC_F2": 8, "MOV_F3": 4080}, {"OT.F1": WARNING, "LCVC.F2": WARNING, "MOV.F3": FAIL}),
        (diagnose.strain_limits, {"HSG_F1": 112}, {"strain_limits.F1": FAIL}),
        (diagnose.strain_limits, {"LSG_F2": 119, "SG_F3": 255, "HSG_F3": 200}, {"strain_limits.F2": FAIL, "strain_limits.F3": FAIL}),
        (diagnose.strain_limits, {"HSG_F1": 113, "LSG_F1": 111}, {}),
        (diagnose.velocities, {"MOV_F1": 39}, {"velocities": WARNING}),
        (diagnose.velocities, {"MCV_SPREAD": 40}, {}),
        (diagnose.init_settings, {"IOFF_F2": 51}, {"init_settings": WARNING}),
        (diagnose.init_settings, {"IOFF_SPREAD": 51}, {}),
        (diagnose.equal_fingers, {"FPG_F3": 11}, {"equal_fingers": WARNING}),
        (diagnose.equal_fingers, {"FPG_SPREAD": 11}, {}),
        (diagnose.close_target, {"CT_F2": 16999}, {"close_target.F2": WARNING}),
        (diagnose.open_position, {}, {}),
    ],
)  # fmt: skip
def test_checks(check: Callable[[ExaminedHand], list[Finding]], changed: dict[str, int], bad: dict[str, str]) -> None:
    found = check(with_values(**changed))
    assert {name: status for name, status in statuses(found).items() if status != OK} == bad
    assert all(finding.remedy and finding.source for finding in found if finding.bad)


def test_what_was_meant_in_whole_degrees_is_never_above_the_limit() -> None:
    said = {celsius: health_limits.over_temperature_limit(celsius).evidence for celsius in (60, 65, 66, 120)}
    assert [celsius for celsius, text in said.items() if f"OTEMP={10 * celsius}" in text] == [60, 65]


def test_the_forecast_of_heat_names_both_temperatures_in_degrees() -> None:
    found = diagnose.can_move(with_values(OTEMP=600, TEMP=601))
    assert "60.1 °C is above OTEMP 60.0 °C" in found[0].evidence


SETTINGS = [param for param in BARRETT if param.writable and not param.is_global and not param.since]


@each_row("param", SETTINGS, ids=lambda param: param.mnemonic)
@each_row("end", ["low", "high"])
def test_the_forecast_of_every_setting_at_its_ends_comes_true(param: GclParam, end: str) -> None:
    """Whatever one setting is: a finger that is said to move moves, to close and to open."""
    body = patient()
    value = (max(param.choices) if end == "high" else min(param.choices)) if param.choices else getattr(param, end)
    assert not body.hand.line.ask(f"1FSET {param.mnemonic} {value}").status
    said = health_limits.can_move("F1", body.values)
    went = []
    for command in ("1M 9000", "1C", "1O"):
        before = patient_position(body)
        body.hand.line.ask(command, at_least=600.0)
        went.append(abs(patient_position(body) - before) > 300)
    if said.status == OK:
        assert went == [True] * 3, said
    if not any(went):
        assert said.status == FAIL, said


def patient_position(body: ExaminedHand) -> int:
    return body.read("P")["P", "F1"]


def test_remedies_name_real_settings() -> None:
    """What is told to be typed after `set` is accepted by the map."""
    body = with_values(
        IOFF_F2=51,
        OTEMP=60,
        TSTOP_F3=99,
        CT_F1=5,
        HSG_F1=1,
        FPG_F2=0,
        ACCEL_F3=0,
        EN_F1=0,
        BAUD=384,
        MOV_F2=20,
        SGFLIP_F1=1,
    )
    found = [finding for name in ("can_move", "parameters", "over_temperature_limit", "init_settings", "close_target", "strain_limits", "velocities")
             for finding in CHECKS[name](body)]  # fmt: skip
    told = [
        finding.remedy.partition("barrett set ")[2].partition("`")[0]
        for finding in found
        if "barrett set" in finding.remedy
    ]
    assert len(told) >= 8
    for text in told:
        words = [word for word in text.split() if "=" in word]
        assert BARRETT.assignments_on(words, MOTORS), text


def test_repeatable() -> None:
    settings = {param.mnemonic for param in BARRETT if param.writable and not param.since}
    good, _ = scripted({"*": "7"})
    assert statuses(diagnose.repeatable(ExaminedHand(good))) == {"repeatable": OK}
    bad, link = scripted({"*": "7"})
    body = ExaminedHand(bad)
    assert body.values["DP", "F1"] == 7
    link.script["*"] = ["8"]
    (finding,) = diagnose.repeatable(body)
    assert finding.status == FAIL and "firmware download" in finding.remedy
    assert f"{(len(settings) - 4) * 4 + 4} settings" in finding.evidence


@pytest.mark.parametrize(("query", "status"), [("firmware=4.33", SKIPPED), ("firmware=4.34", OK)])
def test_breakaway(query: str, status: str) -> None:
    assert statuses(diagnose.breakaway(patient(query))) == {"breakaway": status}


def test_breakaway_that_happened() -> None:
    hand, _ = scripted({"FGET BD BP": "0 0 1 0|0 0 2000 0"})
    (finding,) = diagnose.breakaway(ExaminedHand(hand))
    assert (finding.status, "F3 at 2000" in finding.evidence) == (WARNING, True)


def test_strain_of_a_closed_finger_is_not_judged() -> None:
    hand, _ = scripted({"123FGET P S OT SGFLIP": "0 9000 0|0 0 0|0 0 0|0 0 0", "123FGET SG": "120 180 120"})
    found = statuses(diagnose.strain_(ExaminedHand(hand)))
    assert found == {"strain.F1": OK, "strain.F2": SKIPPED, "strain.F3": OK}


@pytest.mark.parametrize(("text", "status"), [("4.33", OK), ("BarrettHand v4.4", OK), ("garbage", FAIL)])
def test_firmware(text: str, status: str) -> None:
    hand, _ = scripted({"VERS": text})
    assert statuses(diagnose.firmware(ExaminedHand(hand))) == {"firmware": status}


# -- the line ---------------------------------------------------------------------------------------------------------


def test_every_speed_is_tried_and_named() -> None:
    hand = hand_on(ScriptedLink(baud=9600))
    found, failure = diagnose.examine(ExaminedHand(hand), diagnose.USUAL, None)
    assert failure is None
    assert statuses(found) == {"communication": FAIL, **dict.fromkeys(diagnose.USUAL, SKIPPED)}
    for speed in (600, 1200, 2400, 4800, 9600, 19200, 38400):
        assert f"{speed}: silence" in found[0].evidence
    assert "power supply" in found[0].remedy


def test_a_hand_at_another_speed_is_found() -> None:
    hand, _ = simulated("initialized=1&baud=19200")
    link_hand = hand_on(hand.link, retries=0)  # type: ignore[arg-type]
    finding = diagnose.communication(link_hand, None)
    assert (finding.status, "prompt at 19200 bit/s" in finding.evidence) == (OK, True)


def test_garbage_is_shown_per_speed() -> None:
    hand = hand_on(ScriptedLink(lambda request: [(0.0, b"\xfe")], baud=9600))
    finding = diagnose.communication(hand, 9600)
    assert finding.status == FAIL
    assert (
        "9600:" in finding.evidence
        and "no other baud rate, because of --baud" in finding.evidence
        and "FE" in finding.evidence
        and "38400" not in finding.evidence
    )
    assert "cable" in finding.remedy


def test_the_boot_monitor_is_recognized() -> None:
    link = ScriptedLink(baud=9600)
    link.put(0.0, b":")
    finding = diagnose.communication(hand_on(link), None)
    assert (finding.status, finding.source) == (FAIL, "barrett §3.7")
    assert "firmware download" in finding.remedy


def test_a_hand_that_falls_silent_is_not_waited_for_again_and_again() -> None:
    hand, link = scripted({"VERS": None}, retries=1)
    found, _ = diagnose.examine(ExaminedHand(hand), diagnose.USUAL, None)
    expected = {"communication": OK, "firmware": FAIL, **dict.fromkeys(diagnose.USUAL[1:], SKIPPED)}
    assert statuses(found) == expected
    assert link.commands == ["VERS", "VERS"]


def test_a_lost_line_keeps_the_rows_and_its_own_error() -> None:
    hand = hand_on(Simulated("initialized=1&fault=disconnect"))
    found, failure = diagnose.examine(ExaminedHand(hand), diagnose.USUAL, None)
    assert isinstance(failure, LinkError)
    assert statuses(found) == {"communication": FAIL, **dict.fromkeys(diagnose.USUAL, SKIPPED)}
    assert diagnose.table_of(hand, found, None, failure).failure is failure


def test_a_hot_hand_still_tells_its_temperature() -> None:
    """ERR 8192 on every motor command; PGET answers (§5.4.1)."""
    hand, _ = simulated("initialized=1&fault=over-temperature")
    found, _ = diagnose.examine(ExaminedHand(hand), diagnose.USUAL, None)
    got = statuses(found)
    assert (got["temperature"], got["over_temperature_limit"], got["status"], got["firmware"]) == (FAIL, OK, FAIL, OK)
    assert "8192" in {finding.check: finding.evidence for finding in found}["status"]


def test_table() -> None:
    hand, _ = scripted()
    good = diagnose.table_of(hand, [Finding("a", OK, "fine"), Finding("b", SKIPPED, "-")], "tip-flops", None)
    assert good.failure is None
    assert [row["check"] for row in good.rows] == ["a", "b", "by_hand.1"]
    assert good.rows[2]["status"] == SKIPPED and "§8" in good.rows[2]["source"]
    bad = diagnose.table_of(hand, [Finding("a", WARNING, "meh", "do it", "§1")], None, None)
    assert isinstance(bad.failure, CheckFailed) and "1 warning: a" in bad.failure.text
    assert bad.rows == [{"check": "a", "status": WARNING, "evidence": "meh", "remedy": "do it", "source": "§1"}]


# -- movements --------------------------------------------------------------------------------------------------------

HEALTHY = "initialized=1"


@each_row(
    ("trial", "query", "bad"),
    [
        ("initialize", "initialized=0", {}),
        ("initialize", HEALTHY + "&fault=no-motor", {"initialize.F3": FAIL}),
        ("open", HEALTHY, {}),
        ("close", HEALTHY, {}),
        ("close", HEALTHY + "&fault=obstacle", {"close.F1": FAIL, "close.F2": FAIL, "close.F3": FAIL}),
        ("direction", HEALTHY, {}),
        ("direction", HEALTHY + "&fault=reversed", {"direction.F1": FAIL}),
        ("direction", HEALTHY + "&fault=blocked", {f"direction.F{n}": WARNING for n in (1, 2, 3)}),
        ("direction", "initialized=0", {"direction": FAIL}),
        ("strain_curve", HEALTHY, {}),
        ("strain_curve", HEALTHY + "&fault=no-gauges", {f"strain_curve.F{n}": SKIPPED for n in (1, 2, 3)}),
        ("torque_speed", HEALTHY, {}),
        ("spread_time", HEALTHY, {}),
    ],
)
def test_trials(trial: str, query: str, bad: dict[str, str]) -> None:
    hand, link = simulated(query)
    found = diagnose.run_all(ExaminedHand(hand), [trial], "123", Prompts())
    got = {name: status for name, status in statuses(found).items() if status != OK}
    assert got == bad
    moved = [line for line in link.commands if "GET" not in line]
    planned = [step.data.decode().strip() for step in diagnose.steps([trial], "123")]
    assert moved == planned if not (FAIL in bad.values() and "initialized=0" in query) else moved == planned[:1]


def test_the_movements_are_those() -> None:
    got = {name: trial.commands("12") for name, trial in diagnose.TRIALS.items()}
    assert got == {
        "initialize": ["12HI"],
        "open": ["12O"],
        "close": ["12C"],
        "direction": ["12IC 200", "12IO 200"],
        "strain_curve": ["12O", *["12IC 850"] * 20, "12O"],
        "torque_speed": ["1O", "1TC", "1O", "2O", "2TC", "2O"],
        "spread_time": ["123O", "4O", "4C", "4O"],
    }


def test_a_slow_spread_is_seen() -> None:
    body = patient()
    body.values["MCV", "SPREAD"] = body.values["MOV", "SPREAD"] = 4080  # what the hand was told is far slower
    hand = body.hand
    hand.checked(hand.line.ask("4FSET MCV 16 MOV 16"))
    assert {finding.status for finding in diagnose.run_all(body, ["spread_time"], "123", Prompts())} == {WARNING}


def test_a_failed_trial_ends_the_rest() -> None:
    hand, link = simulated("initialized=0")
    found = diagnose.run_all(ExaminedHand(hand), ["open", "direction"], "12", Prompts())
    assert statuses(found) == {"open": FAIL, "direction": SKIPPED}
    assert [line for line in link.commands if "GET" not in line] == ["12O"]


@pytest.mark.parametrize("trial", ["close", "torque_speed"])
def test_interrupt_stops_the_hand(trial: str) -> None:
    hand, link = simulated(HEALTHY)
    link.interrupt_at = link.now() + 0.4
    with pytest.raises(Interrupted, match=r"\^C stopped the hand"):
        diagnose.run_all(ExaminedHand(hand), [trial], "123", Prompts())
    assert b"\x03" in link.sent
