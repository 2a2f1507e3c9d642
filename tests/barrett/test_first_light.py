"""`barrett first-light`: every step of the hour, what is asked, what is refused whatever is answered, and what ends it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from handctl.devices.barrett.gcl.codec import Answer
from handctl.devices.barrett.gcl.line import GclLine
from handctl.devices.barrett.maintenance import first_light, health_limits, signs_of_harm
from handctl.devices.barrett.maintenance.cli import LIGHT_STEPS
from handctl.devices.barrett.parameter_map import unmeasured
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
from handctl.model.proofs import MOVE, SignOfHarm
from tests.barrett.commands import MOTORS, fake, sent_lines
from tests.support.cli import Result, run, spying
from tests.support.each_row import each_row
from tests.support.person import once, person, pressed_at

COLD = "fake://barrett?clock=virtual"
READS = ("FGET", "PGET", "VERS")
MOVES = ("HI", "HOME", "TO", "IC", "C", "O")

STOPPED = ["T", "FGET P", "FGET P"]
"""Power off, and two readings that agree."""


def answering(monkeypatch: pytest.MonkeyPatch, change: Callable[[str, str, Answer], Answer]) -> None:
    """The simulated hand, with answers that `change` from (the last movement, command, answer)."""
    real, last = GclLine.ask, [""]

    def ask(line: GclLine, command: str, **more: Any) -> Answer:
        answer = real(line, command, **more)
        last[0] = command if command.split()[0].lstrip("1234") in MOVES else last[0]
        return change(last[0], command, answer)

    monkeypatch.setattr(GclLine, "ask", ask)


def saying(command: str, answer: Answer, name: str, value: str) -> Answer:
    """The same answer, where FGET or PGET asks for `name`: its line is `value`; "" = there is no such parameter."""
    verb, *names = command.split()
    if not verb.endswith("GET") or name not in names:
        return answer
    if not value:
        return answer._replace(lines=(), status=64)
    lines = list(answer.lines)
    digits = verb.removesuffix("FGET") if verb != "PGET" else ""
    lines[names.index(name)] = " ".join(value.split()[int(digit) - 1] for digit in digits) or value
    return answer._replace(lines=type(answer.lines)(lines))


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


def light(link: str = COLD, *words: str | Path, skip: tuple[str, ...] = ()) -> Result:
    skipped = [word for name in skip for word in ("--skip", name)]
    return run("barrett", "first-light", link, *skipped, *words, "--json")


def why(result: Result) -> dict[str, Any]:
    """What each step came to: its value, or why it has none."""
    return {row["fact"]: row["value"] if row["why"] is None else row["why"] for row in result.rows}


def moved(trace: Path) -> list[str]:
    return [line for line in sent_lines(trace) if line.split(" ")[0].lstrip("1234") in MOVES]


def only_read(trace: Path) -> bool:
    """Whether nothing but the connect and reads went out."""
    return all(not line.strip("!~\0") or line.split()[0].lstrip("1234") in READS for line in sent_lines(trace))


def test_the_names_of_the_steps_are_those_of_the_help() -> None:
    steps = first_light.steps_for("", attended=True)
    assert tuple(step.proof.name for step in steps) == LIGHT_STEPS
    assert all(step.proof.question and step.proof.steps for step in steps if step.proof.level == MOVE)


def test_a_hand_out_of_the_cupboard(tmp_path: Path) -> None:
    """The power comes on after 3 s: the whole hour, its facts, and the motors in the order in which they were driven."""
    trace, path = tmp_path / "t.txt", tmp_path / "facts.json"
    result = light(f"{COLD}&switch=0.5,3&firmware=4.34", "-y", "--trace", trace, "--keep", path)
    assert result.code == 7 and result.error["code"] == "findings", result.err
    assert why(result) == {
        "power-on": "':' banner", "firmware": "4.34", "settings": "factory values", "temperature": 41.2, "init": "ready",
        "strain": "in range", "origin": "reached", "position-at-stop": "signed", "finger-speed": "as set", "spread-speed": "as set",
        "highest-speed": 38400, "early-breakaway": "none", "breakaway": "needs-person", "grease": "due",
    }  # fmt: skip
    assert {row["verdict"] for row in result.rows if row["fact"] not in ("breakaway", "grease")} == {"as-assumed"}
    assert moved(trace)[:9] == ["1HI", "2HI", "3HI", "4HI", "1HOME", "2HOME", "3HOME", "4HOME", "1IC 200"]
    assert {row["state"] for row in result.json["writes"]} == {"confirmed"}
    content = json.loads(path.read_text(encoding="utf-8"))
    assert content["facts"]["position-at-stop"]["value"] == "signed" and "device" not in content
    assert run("prove", "diff", str(path), str(path), "--json").code == 0


def test_nothing_is_sent_before_the_hand_has_spoken(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    light(f"{COLD}&switch=0.5,3", "-y", "--trace", trace)
    marks = [line.split()[1] for line in trace.read_text().splitlines() if line.split()[1] in "<>"]
    assert marks[0] == "<"


@each_row(
    "query,found",
    [
        ("fault=strain-offset", {"strain": "outside: F3"}),
        ("fault=no-gauges", {"strain": "no gauges"}),
        ("fault=no-board", {"init": "F2: No motor board found (1)"}),
        ("initialized=1&fault=blocked", {
            "position-at-stop": "no-sign",
            "finger-speed": "F1 C: did not move at 0; F2 C: did not move at 0; F3 C: did not move at 0",
        }),
        ("firmware=4.34&fault=breakaway", {"early-breakaway": "F3"}),
        ("firmware=4.33", {"power-on": "no-sign", "early-breakaway": "not-present"}),
        ("found=boot", {"power-on": "':' banner"}),
        ("max-baud=19200", {"highest-speed": 19200}),
    ],
)  # fmt: skip
def test_what_a_step_finds(query: str, found: dict[str, object]) -> None:
    """With all steps before it; what comes behind it is skipped."""
    behind = LIGHT_STEPS[max(map(LIGHT_STEPS.index, found)) + 1 :]
    facts = why(light(f"{COLD}&{query}", "-y", skip=behind))
    assert {step: facts[step] for step in found} == found


def test_a_failed_step_is_data_and_the_next_is_offered(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = light(f"{COLD}&fault=no-motor", "-y", "--trace", trace)
    found = why(result)
    assert result.code == 7 and result.error["code"] == "findings"
    assert found["init"].startswith("F3: ") and found["origin"] == "err-2" and found["position-at-stop"] == "signed"
    assert "4HI" in moved(trace)


# -- what is asked --------------------------------------------------------------------------------------------------


def test_nobody_to_ask_and_nothing_is_sent(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    assert light(COLD, "--trace", trace).code == 8
    assert not trace.exists() or sent_lines(trace) == []


def test_with_all_that_moves_skipped_nobody_is_asked(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    asking = tuple(step.proof.name for step in first_light.steps_for("", attended=False) if step.proof.question)
    result = light(COLD, "--trace", trace, skip=asking)
    assert result.code == 7 and moved(trace) == []
    assert {why(result)[name] for name in asking} == {"skipped"}


def test_a_person_is_asked_before_each_step_and_a_no_moves_nothing(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    answers = ["", "", "", "s", "", "y", "", "n", "n", "n", "n", "n", "n", ""]
    shown = person("barrett", "first-light", "-p", f"{COLD}&found=boot", "--trace", trace, answers=answers)
    assert moved(trace) == ["1HI", "2HI", "3HI", "4HI"], shown.data
    lines = sent_lines(trace)
    assert lines.index("1HI") > lines.index("VERS")
    assert shown.data.index("as assumed: HI: F1") < shown.data.index("origin: "), (
        "each result is told before the next question"
    )


def test_the_clutch_needs_an_object_and_somebody_who_answers(tmp_path: Path) -> None:
    """The fault `breakaway` stands for the object at F3."""
    trace, done = tmp_path / "t.txt", [word for name in LIGHT_STEPS[:-2] for word in ("--skip", name)]
    link = fake(firmware="4.34", fault="breakaway")
    shown = person("barrett", "first-light", link, *done, "--json", "--trace", trace, answers=["y", ""])
    assert moved(trace) == ["3C", "3O"] and '"lets go and resets"' in shown.data
    unanswered = light(link, "-y", skip=LIGHT_STEPS[:-2])
    assert why(unanswered)["breakaway"] == "needs-person"


# -- what no answer can replace -------------------------------------------------------------------------------------


@each_row(
    "query,skip,step,reason",
    [
        ("", ("init",), "origin", "not-initialized"),
        ("", ("init", "settings"), "finger-speed", "not-initialized"),
    ],
)
def test_nothing_moves_before_hi(query: str, skip: tuple[str, ...], step: str, reason: str, tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    assert why(light(f"{COLD}&{query}", "-y", "--trace", trace, skip=skip))[step] == reason
    assert moved(trace) == []


def test_a_harmful_setting_moves_nothing_even_where_its_step_is_skipped(tmp_path: Path) -> None:
    state, trace = tmp_path / "hand.json", tmp_path / "t.txt"
    link = f"{COLD}&state={state}"
    assert run("barrett", "gcl", "1FSET IVEL 1000", "1FSAVE", "-y", "--force", "-p", link).code == 0
    result = light(link, "-y", "--trace", trace, skip=("settings",))
    assert why(result)["init"] == "settings" and moved(trace) == []
    assert why(light(link, "-y"))["settings"] == "harmful"


def test_heat_ends_the_run_before_anything_moves(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = light(f"{COLD}&fault=hot", "-y", "--trace", trace, skip=("temperature",))
    assert (result.code, result.error["code"]) == (7, "hot")
    assert moved(trace) == [] and why(result)["grease"] == "ended"


@each_row("query,code", [("fault=hot", "hot"), ("temperature=-550", "unread"), ("temperature=1250", "unread")])
def test_harm_at_the_first_look_is_said_and_nothing_is_sent(query: str, code: str, tmp_path: Path) -> None:
    """Whatever is answered: nobody has agreed to a movement yet, so the hand is not stopped either."""
    trace = tmp_path / f"{code}.txt"
    for words in (("-y",), ("-y", "--skip", "temperature")):
        result = light(f"{COLD}&{query}", *words, "--trace", trace)
        assert (result.code, result.error["code"]) == (7, code)
        assert only_read(trace) and result.json.get("writes", []) == []
        assert why(result)["grease"] == "ended"
    answers = ["", "", "", "", "", "", ""]
    shown = person("barrett", "first-light", "-p", f"{COLD}&{query}", "--trace", trace, answers=answers)
    assert shown.code == 7 and only_read(trace)


@each_row("tenths,fits", [(-550, False), (-1, False), (0, False), (1, True), (412, True), (1249, True), (1250, False)])
def test_what_can_be_the_temperature_of_a_board(tenths: int, fits: bool) -> None:
    assert unmeasured(tenths) is not fits
    assert (health_limits.temperature(tenths).status == "fail") is (tenths > 650 or not fits)


def test_heat_in_the_middle_ends_the_run_behind_that_motor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    trace, read = tmp_path / "t.txt", signs_of_harm.heat
    count = [0]

    def warmer(hand: Any) -> tuple[int, int]:
        count[0] += 1
        return (651, 650) if count[0] > 7 else read(hand)  # temperature twice over, init before, then behind each motor

    monkeypatch.setattr(signs_of_harm, "heat", warmer)
    result = light(COLD, "-y", "--trace", trace)
    assert (result.code, result.error["code"]) == (7, "hot")
    assert 1 <= len(moved(trace)) < 4
    assert sent_lines(trace)[-3:] == STOPPED, "the motors' power is off"


def test_harm_that_is_seen_between_two_steps_stops_the_hand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At the look before a later step: movement was agreed to by then, so the power of the motors goes off."""
    trace, objection = tmp_path / "t.txt", first_light.FirstLight._objection

    def hot(light: first_light.FirstLight, step: first_light.LightStep) -> Any:
        if step.proof.name == "origin":
            raise SignOfHarm("66.0 °C", code="hot")
        return objection(light, step)

    monkeypatch.setattr(first_light.FirstLight, "_objection", hot)
    result = light(COLD, "-y", "--trace", trace)
    assert (result.code, result.error["code"]) == (7, "hot")
    assert moved(trace)[-1] == "4HI" and sent_lines(trace)[-3:] == STOPPED


@each_row(
    "name,value,after,code,last",
    [
        ("S", "8192 0 0 0", "2HI", "hot", "2HI"),
        ("S", "0 0 0 8196", "1HI", "hot", "1HI"),
        ("S", "8196 4 4 4", "", "hot", ""),
        ("TEMP", "", "1HI", "unread", "1HI"),
        ("TEMP", "-550", "1HI", "unread", "1HI"),
        ("TEMP", "1250", "2HI", "unread", "2HI"),
        ("TEMP", "-550", "", "unread", ""),
        ("P", "", "1HOME", "unread", "1HOME"),
        ("P", "-3000 0 0 0", "1IC 200", "unread", "1IC 200"),
    ],
)
def test_a_sign_of_harm_ends_the_run(name: str, value: str, after: str, code: str, last: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    """From the movement `after` on the hand says `value` for `name` ("" = it no longer has it): nothing moves after it."""
    trace = tmp_path / f"{name}{after}{code}.txt"
    with monkeypatch.context() as patch:
        answering(patch, lambda at, command, answer: saying(command, answer, name, value) if at == after else answer)
        result = light(COLD, "-y", "--trace", trace)
    assert (result.code, result.error["code"]) == (7, code), result.err
    assert moved(trace)[-1:] == ([last] if last else [])
    assert sent_lines(trace)[-3:] == STOPPED if last else only_read(trace), (
        "a hand is stopped once a movement was agreed to"
    )
    assert why(result)["grease"] == "ended"


def test_a_finger_that_moves_the_wrong_way_ends_the_run(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = light(f"{COLD}&fault=reversed", "-y", "--trace", trace)
    assert (result.code, result.error["code"]) == (7, "wrong-way"), result.err
    assert moved(trace)[-1] == "1IC 200" and sent_lines(trace)[-3:] == STOPPED and sent_lines(trace).count("T") == 1
    assert "The hand was stopped" in result.err and why(result)["position-at-stop"] == "wrong-way"


def test_prove_stops_the_hand_too(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    words = ("--level", "move", "--only", "position-at-stop", "-y", "--json", "--trace", trace, "-p")
    result = run("prove", "barrett", *words, f"{COLD}&initialized=1&fault=reversed")
    assert (result.code, result.error["code"]) == (7, "wrong-way"), result.err
    assert moved(trace) == ["1IC 200"] and sent_lines(trace).count("T") == 1


HARMFUL = [("TSTOP", "5000"), ("IVEL", "4080"), ("MOV", "4080"), ("IHIT", "9"), ("IOFF", "900"), ("FIP", "3"), ("SAMPLE", "62"), ("SGFLIP", "1")]  # fmt: skip


@each_row("name,value", HARMFUL)
def test_a_setting_that_becomes_harmful_ends_the_run(name: str, value: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:  # fmt: skip
    trace = tmp_path / f"{name}.txt"
    four = " ".join([value] * 4)
    with monkeypatch.context() as patch:
        answering(patch, lambda at, command, answer: saying(command, answer, name, four) if at == "4HI" and command.startswith("FGET") else answer)  # fmt: skip
        result = light(COLD, "-y", "--trace", trace)
    assert (result.code, result.error["code"]) == (7, "settings"), result.err
    assert moved(trace) == ["1HI", "2HI", "3HI", "4HI"] and sent_lines(trace)[-3:] == STOPPED


@each_row("name", ["TSTOP", "IVEL", "MOV", "HOLD", "SAMPLE", "IHIT", "IOFF", "FIP"])
def test_a_harmful_setting_that_cannot_be_read_moves_nothing(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trace = tmp_path / f"{name}.txt"
    with monkeypatch.context() as patch:
        answering(patch, lambda _at, command, answer: saying(command, answer, name, ""))
        result = light(COLD, "-y", "--trace", trace)
    assert why(result)["init"] == "settings" and moved(trace) == []
    row = next(row for row in result.rows if row["fact"] == "init")
    assert row["verdict"] == "refused" and f"{name} could not be read" in row["evidence"]


def test_a_hand_without_sgflip_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    answering(monkeypatch, lambda _at, command, answer: saying(command, answer, "SGFLIP", ""))
    assert why(light(COLD, "-y"))["init"] == "ready"


def test_a_disturbed_line_in_a_movement_ends_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Bytes that belong to no reply came while 2HI moved: it is not done again."""
    trace, real = tmp_path / "t.txt", GclLine.ask

    def ask(line: GclLine, command: str, **more: Any) -> Answer:
        line.journal.counters.stray_bytes += 3 * (command == "2HI")
        return real(line, command, **more)

    monkeypatch.setattr(GclLine, "ask", ask)
    result = light(COLD, "-y", "--trace", trace, "--repeat", "3")
    assert (result.code, result.error["code"]) == (7, "disturbed"), result.err
    assert moved(trace) == ["1HI", "2HI"] and sent_lines(trace)[-3:] == STOPPED
    assert next(row["verdict"] for row in result.rows if row["fact"] == "init") == "not-shown"


@each_row("after", range(40, 100, 10))
def test_no_movement_is_repeated_on_a_disturbed_line(after: int, tmp_path: Path) -> None:
    trace = tmp_path / f"{after}.txt"
    light(f"{COLD}&fault=stale&after={after}", "-y", "--trace", trace, "--repeat", "3")
    assert all(moved(trace).count(f"{digit}HI") <= 1 for digit in "1234")


def test_a_stop_without_a_reply_is_not_called_stopped() -> None:
    result = light(f"{COLD}&fault=hang&after=100", "-y")
    assert "The stop was sent (^C and T), but the hand did not reply: it may still be moving" in result.err
    assert "was stopped" not in result.err


@each_row("after, code", [(100, 5), (104, 4), (108, 4)])
def test_no_reply_in_a_movement_stops_the_hand(after: int, code: int, tmp_path: Path) -> None:
    """5 where the echo of a question still came."""
    trace = tmp_path / "t.txt"
    result = light(f"{COLD}&fault=hang&after={after}", "-y", "--trace", trace)
    assert result.code == code and why(result)["grease"] == "ended"
    lines = sent_lines(trace)
    assert lines[-1] == "T" and moved(trace)


@each_row("seconds", [6.2, 7.0, 8.0, 9.5, 12.0, 14.0, 16.0])
def test_ctrl_c_stops_it_anywhere(seconds: float) -> None:
    with spying() as spy, pressed_at(seconds):
        shown = person("barrett", "first-light", COLD, "-y")
    assert shown.code == 130, shown.data
    motors = spy.lines[-1].device.hand.motors
    assert not any(motor.drive for motor in motors)


def test_ctrl_c_at_a_question_ends_with_the_table() -> None:
    shown = person(
        "barrett", "first-light", COLD, answers=["", "", "", "", "", ""], press=once(lambda seen: "init:" in seen)
    )
    assert shown.code == 130 and "not done" in shown.data


@each_row(
    "error,harm",
    [
        (NoAnswer("x"), True),
        (ProtocolError("x"), True),
        (LinkError("x"), True),
        (Interrupted("x"), True),
        (SignOfHarm("x", code="hot"), True),
        (DeviceRefused("x", code="err-8192"), True),
        (DeviceRefused("x", code="err-8196"), True),
        (DeviceRefused("x", code="err-16"), False),
        (DeviceRefused("x", code="err-4"), False),
        (CheckFailed("x"), False),
        (CheckFailed("x", code="unread"), True),
        (UsageError("x", code="opening-speed"), False),
    ],
)
def test_what_is_a_sign_of_harm(error: HandctlError, harm: bool) -> None:
    assert first_light.is_harm(error) is harm


def test_a_dry_run_shows_every_movement() -> None:
    rows = run("barrett", "first-light", "--fake", "-n", "--json", "--skip", "init").rows
    lines = [bytes.fromhex(row["bytes"]).decode().strip() for row in rows]
    assert lines[:5] == ["1HOME", "2HOME", "3HOME", "4HOME", "1IC 200"]
    assert len(MOTORS) == 4 and "3C" in lines
    assert run("barrett", "first-light", COLD, "-p", COLD, "-n").code == 2
