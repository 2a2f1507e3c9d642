"""Writing a setting of a worn EksoNR: every gate, one SetValue, read-back of everything, what is lost, the audit log."""

from __future__ import annotations

import os
import re
import shlex
import signal
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from handctl.devices.ekso.explain_bytes import EksoWriteRules
from handctl.devices.ekso.parameter_map import EKSO
from handctl.devices.ekso.setting_change import Change, differences
from handctl.devices.ekso.stillness import moving
from handctl.errors import (
    CheckFailed,
    DeviceRefused,
    HandctlError,
    Interrupted,
    NoAnswer,
    NotConfirmed,
    OutputError,
    ProtocolError,
    UsageError,
)
from handctl.link.transcript import observed
from handctl.model.device_clock import Span
from tests.ekso.bench import Bench, change
from tests.ekso.support import (
    DATA,
    DATA_WORDS,
    DRIVING,
    RISING,
    SET,
    SETTING_WORDS,
    SETTINGS,
    SITTING,
    STANDING,
    UNKNOWN,
    codes,
    frame,
    pack,
)
from tests.support.each_row import each_row
from tests.support.scripted import Reply


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


# -- one write --------------------------------------------------------------------------------------------------------


def test_a_setting_is_written_once_and_everything_read_back(bench: Bench) -> None:
    assert bench.set("step_length=16") == [16.0]
    assert bench.unit.commands() == [SETTINGS, DATA, DATA, SETTINGS, DATA, DATA, SET, SETTINGS]
    assert bench.unit.sent[6] == frame(SET, 7, pack([202, 1600]))
    assert bench.unit.settings[2] == 1600
    assert bench.asked == [("Set step_length 15.50 in -> 16.00 in. A person may be standing in the device", "16.00")]
    looks = [at for at, request in zip(bench.unit.sent_at, bench.unit.sent, strict=True) if request[0] == DATA]
    assert looks[1] - looks[0] >= 0.1
    assert looks[3] - looks[2] >= 0.1


@each_row(
    ("text", "body"),
    [
        ("upper_leg_length=17.5", "00 C8 06 D6"), ("lower_leg_length=15.5", "00 C9 06 0E"), ("step_height=2.5", "00 CB 00 FA"),
        ("swing_time=0.95", "00 CC 00 5F"), ("stand_time=0.75", "00 CD 00 4B"), ("knee_flexion=7", "00 CE 02 BC"),
        ("hip_flexion=1", "00 CF 00 64"), ("forward_shift=-1.25", "00 D0 FF 83"), ("lateral_shift=0.75", "00 D1 00 4B"),
        ("stand_mode=Manual Lean", "00 D2 00 00"), ("sit_mode=Min Lean", "00 D3 00 00"), ("walk_mode=ProStep+", "00 D4 00 03"),
        ("target_sounds=Off", "00 D5 00 00"), ("lean_allowance=Max", "00 D6 00 01"), ("injury_mode=2Free", "00 D7 00 03"),
        ("left_swing_assist=60 %", "00 D8 00 0C"), ("left_stance_support=Low", "00 D9 00 00"),
        ("right_swing_assist=code:21", "00 DA 00 15"), ("right_stance_support=Flex", "00 DB 00 04"),
    ],
)  # fmt: skip
def test_every_setting_has_its_own_parameter_id_and_word(tmp_path: Path, text: str, body: str) -> None:
    bench = Bench(tmp_path)
    bench.unit.data[18] = SITTING
    bench.set(text)
    assert bench.unit.written() == [bytes.fromhex(body)]


def test_nothing_is_sent_when_it_is_so_already(bench: Bench) -> None:
    assert bench.set("step_length=15.5") == [15.5]
    assert bench.unit.commands() == [SETTINGS]
    assert (bench.asked, bench.entries) == ([], [])


def test_the_audit_log_tells_what_goes_out_before_it_goes(bench: Bench) -> None:
    seen: list[list[dict[str, Any]]] = []

    def watching(_msg_id: int, _body: bytes) -> None:
        seen.append(bench.entries)

    bench.unit.on = {SET: watching}
    bench.set("forward_shift=-1")
    ((intent,),) = seen
    assert (intent["event"], intent["operator"], intent["port"], intent["id"]) == ("intent", "me", "unit", 208)
    assert intent["frame"] == bench.unit.sent[6].hex(" ").upper()
    assert (intent["old"], intent["new"]) == ({"raw": -75, "value": -0.75}, {"raw": -100, "value": -1.0})
    assert intent["boot_ms"] > 5_000_001
    assert intent["utc"].startswith("20")
    result = bench.entries[1]
    assert (result["event"], result["status"], result["verdict"]) == ("result", 0, "applied")
    assert result["answer"] == frame(SET, 7, bytes(2)).hex(" ").upper()
    assert result["read_back"]["forward_shift"] == -100
    assert "pilot_id" not in result["read_back"]


def test_without_a_log_nothing_is_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    bench = Bench(tmp_path / "file")
    error = bench.failing(OutputError, "step_length=16")
    assert (error.code, bench.unit.commands()) == ("audit", [SETTINGS])


def test_a_no_sends_nothing(bench: Bench) -> None:
    def refuse(question: str, word: str) -> None:
        raise NotConfirmed("not confirmed")

    assert bench.ekso.writer is not None
    bench.ekso.writer._ask = refuse  # type: ignore[attr-defined]
    bench.failing(NotConfirmed, "step_length=16")
    assert SET not in bench.unit.commands()


# -- step limits ------------------------------------------------------------------------------------------------------


def check_change(wanted: Change, override: bool) -> None:
    wanted.check_code()
    wanted.check_step(override)


LIMITS = {  # raw step that is allowed
    "upper_leg_length": 50, "lower_leg_length": 50, "step_length": 100, "step_height": 50, "swing_time": 10,
    "stand_time": 25, "knee_flexion": 200, "hip_flexion": 200, "forward_shift": 50, "lateral_shift": 50,
}  # fmt: skip


@each_row(("name", "most"), LIMITS.items())
def test_step_limits(name: str, most: int) -> None:
    for sign in (1, -1):
        check_change(change(name, 1000, 1000 + sign * most), False)
        with pytest.raises(UsageError) as caught:
            check_change(change(name, 1000, 1000 + sign * (most + 1)), False)
        assert caught.value.code == "step-limit"
        assert "policy" in caught.value.text
        if name.endswith("leg_length"):
            with pytest.raises(UsageError):
                check_change(change(name, 1000, 1000 + sign * (most + 1)), True)
        else:
            check_change(change(name, 1000, 1000 + sign * (most + 1)), True)


def test_steps_of_assistance_are_codes_and_other_codes_have_none() -> None:
    check_change(change("left_swing_assist", 10, 12), False)
    check_change(change("left_swing_assist", 20, 18), False)
    with pytest.raises(UsageError, match="10 %"):
        check_change(change("left_swing_assist", 10, 13), False)
    for old, new in ((10, 21), (21, 0), (23, 27), (20, 22), (99, 3)):
        check_change(change("left_swing_assist", old, new), False)
    check_change(change("walk_mode", 0, 3), False)
    with pytest.raises(UsageError) as caught:
        check_change(change("walk_mode", 0, 4), True)
    assert caught.value.code == "unlisted"


def test_a_step_too_far_sends_nothing(bench: Bench) -> None:
    error = bench.failing(UsageError, "step_length=16.51")
    assert (error.code, bench.unit.commands()) == ("step-limit", [SETTINGS])
    assert bench.entries == []


def test_the_override_is_for_steps_only(tmp_path: Path) -> None:
    bench = Bench(tmp_path, override=True)
    assert bench.set("step_length=20") == [20.0]
    assert bench.entries[0]["override"] is True
    bench.unit.data[18] = SITTING
    assert bench.failing(UsageError, "upper_leg_length=18").code == "step-limit"


@each_row(
    ("name", "old", "new", "twice"),
    [
        ("left_swing_assist", 10, 21, True), ("left_swing_assist", 22, 10, True), ("left_swing_assist", 10, 11, False),
        ("right_stance_support", 3, 5, True), ("right_stance_support", 4, 3, True), ("right_stance_support", 3, 2, False),
        ("injury_mode", 0, 3, True), ("injury_mode", 3, 0, True), ("injury_mode", 0, 1, False), ("lean_allowance", 2, 1, False),
    ],
)  # fmt: skip
def test_modes_that_are_asked_for_twice(name: str, old: int, new: int, twice: bool) -> None:
    assert change(name, old, new).asked_twice is twice


def test_the_second_question(bench: Bench) -> None:
    bench.set("right_stance_support=Full")
    assert [word for _, word in bench.asked] == ["Full", "yes"]


# -- stillness --------------------------------------------------------------------------------------------------------

TENTH = Span(100, 100)


def looks(state: int = STANDING, ms: int = 100, **moved: int) -> tuple[list[int], list[int]]:
    """Two GetData, `ms` of BootTime apart; `moved` in raw units by name."""
    first = [*DATA_WORDS[:25], 76, 19265]
    first[18] = state
    second = list(first)
    boot = ((76 << 16) + 19265 + ms) % 2**32
    second[25:] = [boot >> 16, boot & 0xFFFF]
    for name, by in moved.items():
        second[EKSO[name].word] += by
    return first, second


@each_row("joint", [f"{side}_{joint}_angle" for side in ("left", "right") for joint in ("hip", "knee")])
def test_every_joint_must_be_still(joint: str) -> None:
    assert moving(*looks(**{joint: 49}), TENTH) is None
    assert moving(*looks(**{joint: -49}), TENTH) is None
    assert moving(*looks(**{joint: 50}), TENTH) == f"{joint} moves at 5.0 deg/s"
    assert moving(*looks(**{joint: -60}), TENTH) == f"{joint} moves at 6.0 deg/s"


@each_row(
    ("state", "says"),
    [
        (STANDING, None), (SITTING, None), (RISING, "rising or sitting down (0x3040)"), (DRIVING, "moving (0x3440)"),
        (UNKNOWN, "unknown (0x4440)"), (0x2440, "driven"), (0x1400, "driven"), (0x0040, "unknown (0x0040)"),
    ],
)  # fmt: skip
def test_postures(state: int, says: str | None) -> None:
    found = moving(*looks(state), TENTH)
    assert (found is None) if says is None else says in str(found)
    first, second = looks()
    second[18] = state
    found = moving(first, second, TENTH)
    assert (found is None) if says is None else says in str(found)


@each_row(("ms", "still"), [(100, True), (150, True), (50, True), (151, False), (49, False), (0, False), (-2, False)])
def test_boot_time_must_run_with_the_host(ms: int, still: bool) -> None:
    found = moving(*looks(ms=ms), TENTH)
    assert (found is None) is still
    if ms < 0:
        assert "restarted" in str(found)


@each_row(
    ("ms", "span", "still"),
    [(100, Span(100, 350), True), (350, Span(100, 350), True), (50, Span(100, 350), True), (400, Span(100, 350), True),
     (49, Span(100, 350), False), (401, Span(100, 350), False), (0, Span(100, 5000), False)],
)  # fmt: skip
def test_only_what_no_moment_of_the_round_trips_explains_is_not_fresh(ms: int, span: Span, still: bool) -> None:
    assert (moving(*looks(ms=ms), span) is None) is still


@pytest.mark.parametrize("late", [1, 2, 3, 4])
def test_one_late_reply_is_no_contradiction(bench: Bench, late: int) -> None:
    """Whichever of the four looks it strikes: BootTime is that of the request's arrival."""
    asked: list[int] = []

    def data(msg_id: int, _body: bytes) -> list[Any]:
        asked.append(msg_id)
        return [(0.25 if len(asked) == late else 0.002, frame(DATA, msg_id, bench.unit.body_of(DATA)))]

    bench.unit.on = {DATA: data}
    assert bench.set("step_length=16") == [16.0]


def test_boot_time_may_wrap() -> None:
    first, second = looks()
    first[25:], second[25:] = [0xFFFF, 0xFFFF], [0, 99]
    assert moving(first, second, TENTH) is None


@pytest.mark.parametrize("text", ["upper_leg_length=17.1", "lower_leg_length=16.1", "injury_mode=1", "walk_mode=1"])
def test_some_settings_only_while_sitting(bench: Bench, text: str) -> None:
    error = bench.failing(CheckFailed, text)
    assert error.code == "not-still"
    assert error.hint.startswith("sit still")
    assert SET not in bench.unit.commands()
    bench.unit.data[18] = SITTING
    bench.set(text)
    assert len(bench.unit.written()) == 1


@pytest.mark.parametrize("place", [11, 13, 15, 17])
def test_a_moving_wearer_is_not_written_to(bench: Bench, place: int) -> None:
    bench.unit.moving = {place: 6.0}
    error = bench.failing(CheckFailed, "step_length=16")
    assert (error.code, SET in bench.unit.commands(), bench.entries) == ("not-still", False, [])


def test_values_that_are_not_fresh(bench: Bench) -> None:
    bench.unit.boot_rate = 0.0
    assert "not fresh" in bench.failing(CheckFailed, "step_length=16").text


def test_a_restart_between_the_looks_ends_it(bench: Bench) -> None:
    def restart(question: str, word: str) -> None:
        bench.unit.boot0 = 1001

    assert bench.ekso.writer is not None
    bench.ekso.writer._ask = restart  # type: ignore[attr-defined]
    assert bench.failing(CheckFailed, "step_length=16").code == "restarted"
    assert SET not in bench.unit.commands()


def test_the_pendant_changed_something_meanwhile(bench: Bench) -> None:
    def meddle(question: str, word: str) -> None:
        bench.unit.settings[12] = 0

    assert bench.ekso.writer is not None
    bench.ekso.writer._ask = meddle  # type: ignore[attr-defined]
    error = bench.failing(CheckFailed, "step_length=16")
    assert error.code == "changed-meanwhile"
    assert "target_sounds is Off, expected Both" in error.text
    assert SET not in bench.unit.commands()


# -- what the device says, and what reads back --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("status", "says"),
    [
        (0x2001, "refused in the present state, state 0x20 (status 0x2001)"), (2, "value out of range"),
        (3, "value or command not allowed"), (9, "unknown (9)"), (0x01FF, "unknown (255)"),
    ],
)  # fmt: skip
def test_refusals_in_words(bench: Bench, status: int, says: str) -> None:
    bench.unit.status = status
    error = bench.failing(DeviceRefused, "step_length=16")
    assert says in error.text
    assert error.code == f"status-{status & 0xFF}"
    assert len(bench.unit.written()) == 1
    assert bench.entries[1]["status"] == status
    assert says in bench.entries[1]["verdict"]


def test_a_high_byte_alone_is_no_refusal(bench: Bench) -> None:
    bench.unit.on = {SET: lambda msg_id, body: [(0.001, frame(SET, msg_id, take(bench, body, 0x2000)))]}
    assert bench.set("step_length=16") == [16.0]


def take(bench: Bench, body: bytes, status: int) -> bytes:
    """Take the value, answer `status`."""
    bench.unit.set_to(int.from_bytes(body[:2], "big"), int.from_bytes(body[2:], "big"))
    return pack([status])


def test_accepted_without_effect(bench: Bench) -> None:
    bench.unit.effect = False
    error = bench.failing(CheckFailed, "step_length=16")
    assert error.code == "read-back"
    assert "step_length is 15.50 in, expected 16.00 in; status accepted" in error.text
    assert len(bench.unit.written()) == 1


def test_what_was_accepted_and_takes_effect_later_is_not_called_the_old_value(bench: Bench) -> None:
    unit, due = bench.unit, list[float]()

    def accept(msg_id: int, _body: bytes) -> list[Reply]:
        due.append(unit.clock + 0.3)
        return [(0.001, frame(SET, msg_id, pack([0])))]

    def look(_msg_id: int, _body: bytes) -> None:
        if due and unit.clock >= due[0]:
            unit.set_to(202, 1600)

    unit.on = {SET: accept, SETTINGS: look}
    assert bench.set("step_length=16") == [16.0]
    assert len(unit.written()) == 1


def test_refused_and_yet_taken(bench: Bench) -> None:
    bench.unit.on = {SET: lambda msg_id, body: [(0.001, frame(SET, msg_id, take(bench, body, 2)))]}
    ledger = bench.port.journal.ledger
    ledger.words = EksoWriteRules()
    observed(bench.port.link, ledger)
    assert "the new value reads back" in bench.failing(CheckFailed, "step_length=16").text
    assert [row["state"] for row in ledger.rows()] == ["sent"], "neither refused nor confirmed"


@each_row(
    "first, second, taken, gap, says",
    [
        (0, 0x2001, True, 0.001, "reads back the new value"),
        (0x2001, 0, True, 0.001, "reads back the new value"),
        (0, 2, False, 0.001, "reads back the old value"),
        (0, 2, True, 0.03, "reads back the new value"),  # it comes while the settings are being read
    ],
)
def test_two_answers_that_contradict_each_other_are_no_success(
    tmp_path: Path, first: int, second: int, taken: bool, gap: float, says: str
) -> None:
    bench = Bench(tmp_path)

    def twice(msg_id: int, body: bytes) -> list[Reply]:
        if taken:
            take(bench, body, 0)
        bench.unit.turn = 0.05
        return [(0.001, frame(SET, msg_id, pack([first]))), (0.001 + gap, frame(SET, msg_id, pack([second])))]

    bench.unit.on = {SET: twice}
    error = bench.failing(CheckFailed, "step_length=16")
    assert (error.code, error.exit_code) == ("read-back", 7)
    assert says in error.text and f"0x{first:04X}" in error.text and f"0x{second:04X}" in error.text
    assert "contradiction" in codes(bench.port.journal) and "duplicate" not in codes(bench.port.journal)
    assert len(bench.unit.written()) == 1 and bench.entries[1]["verdict"] == error.text


def test_the_same_answer_twice_contradicts_nothing(bench: Bench) -> None:
    bench.unit.on = {SET: lambda msg_id, body: [(0.001, frame(SET, msg_id, take(bench, body, 0)) * 2)]}
    assert bench.set("step_length=16") == [16.0]
    assert "contradiction" not in codes(bench.port.journal)


@each_row("word", [word for word in range(22) if word != 2])
def test_any_other_word_that_changes_is_noticed(tmp_path: Path, word: int) -> None:
    bench = Bench(tmp_path)

    def meddle(msg_id: int, body: bytes) -> list[Reply]:
        bench.unit.settings[word] += 1
        return [(0.001, frame(SET, msg_id, take(bench, body, 0)))]

    bench.unit.on = {SET: meddle}
    error = bench.failing(CheckFailed, "step_length=16")
    assert error.code == "read-back"
    assert "step_length=15.50`" in error.hint
    assert bench.entries[1]["event"] == "result"


def test_the_way_back_can_be_pasted_into_a_shell(bench: Bench) -> None:
    def meddle(msg_id: int, body: bytes) -> list[Reply]:
        bench.unit.settings[10] = 0
        return [(0.001, frame(SET, msg_id, take(bench, body, 0)))]

    bench.unit.on = {SET: meddle}
    bench.unit.settings[10] = 17  # a code that nobody knows: no command sets it back
    error = bench.failing(CheckFailed, "left_swing_assist=60 %")
    (line,) = re.findall("`(handctl ekso set .*?)`", error.hint)
    assert shlex.split(line) == ["handctl", "ekso", "set", "left_swing_assist=50 %"]
    assert error.hint.endswith("handctl cannot undo walk_mode")


def lost(bench: Bench, *, taken: bool, replies: Callable[[int], list[Reply]] = lambda _msg_id: []) -> None:
    """SetValue is taken or not, and its answer is `replies`."""

    def answer(msg_id: int, body: bytes) -> list[Reply]:
        if taken:
            take(bench, body, 0)
        return replies(msg_id)

    bench.unit.on = {SET: answer}


def test_the_answer_is_lost_and_the_value_taken(bench: Bench) -> None:
    lost(bench, taken=True)
    assert bench.set("step_length=16") == [16.0]
    assert codes(bench.port.journal) == ["answer-lost"]
    assert len(bench.unit.written()) == 1
    assert (bench.entries[1]["answer"], bench.entries[1]["verdict"]) == (None, "applied")


def test_the_answer_is_lost_and_the_value_not_taken(bench: Bench) -> None:
    lost(bench, taken=False)
    error = bench.failing(NoAnswer, "step_length=16")
    assert "not applied" in error.text
    assert len(bench.unit.written()) == 1
    assert bench.unit.commands()[-2:] == [SETTINGS, SETTINGS]
    assert bench.unit.sent_at[-1] - bench.unit.sent_at[-2] >= 1.0, "read twice, a second apart"


def test_an_acknowledgement_without_status_is_no_success_by_itself(bench: Bench) -> None:
    lost(bench, taken=True, replies=lambda msg_id: [(0.001, frame(SET, msg_id))])
    assert bench.set("step_length=16") == [16.0]
    assert codes(bench.port.journal) == ["answer-lost"]
    lost(bench, taken=False, replies=lambda msg_id: [(0.001, frame(SET, msg_id))])
    assert bench.failing(ProtocolError, "step_length=16.5").code == "acknowledged"


def test_the_answer_is_lost_and_something_else_changed(bench: Bench) -> None:
    def meddle(_msg_id: int, _body: bytes) -> list[Reply]:
        bench.unit.settings[3] = 999
        return []

    bench.unit.on = {SET: meddle}
    assert bench.failing(CheckFailed, "step_length=16").code == "read-back"


def test_a_read_back_that_fails_says_that_the_value_was_sent(bench: Bench) -> None:
    def die(msg_id: int, _body: bytes) -> list[Reply]:
        bench.unit.on = dict.fromkeys((SETTINGS, DATA), lambda _msg_id, _body: [])
        return [(0.001, frame(SET, msg_id, bytes(2)))]

    bench.unit.on = {SET: die}
    error = bench.failing(NoAnswer, "step_length=16")
    assert "was sent but could not be read back" in error.hint
    assert bench.entries[1]["verdict"].startswith("read-back failed")


@pytest.mark.parametrize("taken", [True, False])
def test_ctrl_c_waits_for_the_read_back(bench: Bench, taken: bool) -> None:
    def interrupted(_msg_id: int, body: bytes) -> list[Reply]:
        if taken:
            take(bench, body, 0)
        bench.unit.interrupt_at = bench.unit.clock + 0.01
        return []

    bench.unit.on = {SET: interrupted}
    error = bench.failing(Interrupted, "step_length=16")
    assert ("was written and read back" if taken else "not applied") in error.text
    assert bench.unit.commands()[-1] == SETTINGS
    assert bench.entries[1]["read_back"]["step_length"] == (1600 if taken else 1550)
    assert len(bench.unit.written()) == 1


@pytest.mark.parametrize("presses", [1, 2])
def test_ctrl_c_while_the_settings_are_read_back(bench: Bench, presses: int) -> None:
    """One is no reason to leave a worn device unread; two are."""

    def interrupted(_msg_id: int, body: bytes) -> list[Reply]:
        def read(msg_id: int, _body: bytes) -> list[Reply]:
            for _ in range(presses):
                signal.raise_signal(signal.SIGINT)
            bench.unit.on = {}
            return [(0.2, frame(SETTINGS, msg_id, bench.unit.body_of(SETTINGS)))]

        bench.unit.on = {SETTINGS: read}
        return [(0.001, frame(SET, _msg_id, take(bench, body, 0)))]

    bench.unit.on = {SET: interrupted}
    error = bench.failing(Interrupted, "step_length=16")
    assert error.exit_code == 130
    if presses == 1:
        assert "was written and read back" in error.text
        assert bench.entries[1]["read_back"]["step_length"] == 1600
    else:
        assert "interrupted again" in error.text and bench.entries[1]["read_back"] is None
    assert len(bench.unit.written()) == 1


@pytest.mark.parametrize("entry", ["intent", "result"])
def test_ctrl_c_waits_for_an_entry_of_the_log(bench: Bench, entry: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk may take its time: what was sent is told, and noted, all the same."""
    fsync = os.fsync

    def slow(file: int) -> None:
        if bench.entries and bench.entries[-1]["event"] == entry and not pressed:
            pressed.append(entry)
            signal.raise_signal(signal.SIGINT)
        fsync(file)

    pressed: list[str] = []
    monkeypatch.setattr(os, "fsync", slow)
    error = bench.failing(Interrupted, "step_length=16")
    assert pressed == [entry]
    assert [noted["event"] for noted in bench.entries] == ["intent", "result"]
    if entry == "intent":
        assert "step_length 15.50 in -> 16.00 in was not sent" in error.text
        assert (bench.unit.written(), bench.entries[1]["verdict"]) == ([], "not sent: interrupted")
    else:
        assert "step_length 15.50 in -> 16.00 in was written and read back" in error.text
        assert bench.entries[1]["verdict"] == "applied"


def test_a_deadline_does_not_keep_a_written_value_from_being_read_back(bench: Bench) -> None:
    lost(bench, taken=True)
    bench.port.bound = bench.unit.deadline(0.6)
    assert bench.set("step_length=16") == [16.0]
    bench.port.bound = bench.unit.deadline(0.15)
    error = bench.failing(NoAnswer, "step_length=16.5")
    assert len(bench.unit.written()) == 1
    assert error.exit_code == 4


# -- several, one by one (restore) --------------------------------------------------------------------------------------


def test_several_are_written_one_by_one_a_second_apart(bench: Bench) -> None:
    bench.unit.data[18] = SITTING
    assert bench.set("step_length=16", "walk_mode=ProStep+", "forward_shift=-1") == [16.0, 3, -1.0]
    assert bench.unit.written() == [pack([202, 1600]), pack([212, 3]), pack([208, -100])]
    times = [at for at, request in zip(bench.unit.sent_at, bench.unit.sent, strict=True) if request[0] == SET]
    assert all(b - a >= 1.0 for a, b in pairwise(times))
    assert [entry["event"] for entry in bench.entries] == ["intent", "result"] * 3
    assert len(bench.asked) == 3


def test_what_can_be_refused_is_refused_before_the_first(bench: Bench) -> None:
    with pytest.raises(CheckFailed, match="walk_mode"):
        bench.set("step_length=16", "walk_mode=ProStep+")
    with pytest.raises(UsageError):
        bench.set("step_length=16", "swing_time=3")
    assert bench.unit.written() == []


def test_what_stops_in_between_says_what_is_done(bench: Bench) -> None:
    def second_fails(msg_id: int, body: bytes) -> list[Reply] | None:
        return [(0.001, frame(SET, msg_id, pack([2])))] if len(bench.unit.written()) == 2 else None

    bench.unit.on = {SET: second_fails}
    with pytest.raises(DeviceRefused) as caught:
        bench.set("step_length=16", "step_height=2.2", "swing_time=0.95")
    assert "Already written: step_length." in caught.value.hint
    assert len(bench.unit.written()) == 2
    bench.unit.on = {}
    bench.set("step_length=16", "step_height=2.2", "swing_time=0.95")
    assert bench.unit.written()[2:] == [pack([203, 220]), pack([204, 95])], "run again, it goes on where it stopped"


@pytest.mark.parametrize(
    ("stop", "kind", "text", "hint"),
    [
        (NotConfirmed("no", hint="nothing was sent"), NotConfirmed, "no", "Already written: step_length."),
        (
            KeyboardInterrupt(),
            Interrupted,
            "interrupted. Already written: step_length",
            "repeat the command: it continues",
        ),
    ],
)
def test_a_no_or_a_ctrl_c_at_the_next_question_says_what_is_done(
    bench: Bench, stop: BaseException, kind: type[HandctlError], text: str, hint: str
) -> None:
    def ask(question: str, _word: str) -> None:
        if "step_height" in question:
            raise stop

    assert bench.ekso.writer is not None
    bench.ekso.writer._ask = ask  # type: ignore[attr-defined]
    with pytest.raises(kind) as caught:
        bench.set("step_length=16", "step_height=2.2")
    assert caught.value.text == text
    assert caught.value.hint.startswith(hint)
    assert bench.unit.written() == [pack([202, 1600])]
    with pytest.raises(type(stop)) as first:
        bench.set("step_height=2.2")
    assert first.value is stop, "with nothing written there is nothing to add"


def test_differences_name_every_word() -> None:
    changed = [*SETTING_WORDS]
    changed[0], changed[10] = 1750, 99
    text = differences(tuple(SETTING_WORDS), tuple(changed))
    assert text == "upper_leg_length is 17.50 in, expected 17.00 in; walk_mode is unknown (99), expected ProStep"
