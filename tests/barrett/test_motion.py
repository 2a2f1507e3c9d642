"""Movements: what is sent, where they should end and how they did (barrett §5.2.1, §5.5)."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from unittest import mock

import pytest

from handctl.cli import main
from handctl.devices.barrett import motion
from handctl.errors import CheckFailed, DeviceRefused, Interrupted, NoAnswer, ProtocolError, UsageError
from handctl.link import Deadline
from handctl.link.fake import FakeLink
from handctl.model.prompts import Prompts
from handctl.model.stop_on_interrupt import NOT_STOPPED
from tests.barrett.commands import fake
from tests.barrett.support import ABORT, BARRETT, PROMPT, ScriptedHand, Simulated, codes, hand_on, scripted, simulated
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.scripted import NotedGuide


def doing(link: Simulated | ScriptedHand) -> list[str]:
    """The commands that are no reads."""
    return [command for command in link.commands if "GET " not in command]


def moved(query: str, prefix: str, name: str, argument: int | None = None) -> tuple[dict[str, dict], Simulated, object]:
    """Rows by motor after a movement of the simulated hand, its link, and the failure."""
    hand, link = simulated(query)
    table = motion.move(hand, prefix, name, argument, Prompts())
    return {row["motor"]: row for row in table.rows}, link, table.failure


# -- what is sent -----------------------------------------------------------------------------------------------------


@each_row(
    ("prefix", "name", "argument", "text"),
    [
        ("", "HI", None, "HI"), ("4", "C", None, "4C"), ("123", "O", None, "123O"), ("13", "M", 1000, "13M 1000"),
        ("12", "IO", 5000, "12IO 5000"), ("123", "IC", 5000, "123IC 5000"), ("", "M", 0, "M 0"), ("", "M", 20000, "M 20000"),
        ("", "IC", None, "IC"), ("", "HOME", None, "HOME"), ("4", "TC", None, "4TC"), ("4", "TO", None, "4TO"),
    ],
)  # fmt: skip
def test_command_text(prefix: str, name: str, argument: int | None, text: str) -> None:
    """The manual's own examples among them."""
    assert motion.command_text(prefix, name, argument) == text


@each_row("argument", [-1, 20001, 1 << 40])
def test_arguments_are_checked(argument: int) -> None:
    with pytest.raises(UsageError) as caught:
        motion.command_text("", "M", argument)
    assert (caught.value.code, caught.value.exit_code) == ("out-of-range", 2)
    hand, link = simulated()
    with pytest.raises(UsageError):
        motion.move(hand, "", "IC", argument, Prompts())
    assert link.sent == []


@each_row("line", [b"ER\xb2 16", b"ERR 1\xb6", b"noise"])
def test_a_spoiled_status_is_no_success(line: bytes) -> None:
    """The rows tell where the motors stand all the same; the exit code is that of an answer that is not valid."""
    hand, link = scripted(
        {"*": "0", "12M 5000": b"12M 5000\n\r" + line + b"\n\r=> ", "T": b"T\n\r" + line + b"\n\r=> "}
    )
    table = motion.move(hand, "12", "M", 5000, Prompts())
    assert [row["motor"] for row in table.rows] == ["F1", "F2"]
    assert isinstance(table.failure, ProtocolError) and table.failure.code == "bad-line"
    assert line.hex(" ").upper() in table.failure.text and link.name in table.failure.text
    with pytest.raises(ProtocolError) as caught:
        motion.power_off(hand, "")
    assert "may still have power" in caught.value.hint


VERBS = {
    "init": "HI", "open": "O", "close": "C", "move": "M", "step-open": "IO", "step-close": "IC", "home": "HOME",
    "torque-open": "TO", "torque-close": "TC",
}  # fmt: skip


def planned(capsys: pytest.CaptureFixture[str], *args: str) -> list[str]:
    assert main(["barrett", *args, "-n", "--json", "--fake"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    return [bytes.fromhex(row["bytes"]).decode() for row in rows]


@pytest.mark.parametrize(("verb", "gcl"), VERBS.items())
def test_verbs(verb: str, gcl: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert planned(capsys, verb) == [f"{gcl}\r"]
    assert planned(capsys, verb, "--motors", "12S") == [f"124{gcl}\r"]
    assert planned(capsys, verb, "--motors", "G") == [f"123{gcl}\r"]


@each_row(("words", "lines"), [
    ("F1=9000 F2=9000", ["12M 9000\r"]), ("F1=9000 F3=500 F2=9000", ["12M 9000\r", "3M 500\r"]),
    ("S=100 G=3", ["4M 100\r", "123M 3\r"]), ("spread=100", ["4M 100\r"]), ("9000 --motors 12", ["12M 9000\r"]),
])  # fmt: skip
def test_motors_have_a_place_of_their_own(words: str, lines: list[str]) -> None:
    done = run("barrett", "move", *words.split(), "-n", "--json")
    assert [bytes.fromhex(row["bytes"]).decode() for row in done.rows] == lines


@each_row(
    "words", ["F1=1 G=2", "F1=1 F1=1", "1 2", "F1=1 5", "F1=1 --motors 2", "F7=1", "F1=", "F1=x", "F1=20001", "x", "=3"]
)
def test_places_that_cannot_be_meant(words: str) -> None:
    assert run("barrett", "move", *words.split(), "-n", "--json").code == 2


def test_what_is_refused_for_one_moves_none() -> None:
    """Opening faster than IVEL: the second line of movement is looked at before the first is sent."""
    hand, link = simulated("initialized=1")
    goals = motion.goals_of(["F1=9000", "F2=0"], "", "M")
    hand.write([(BARRETT.elements("MOV")[1], 2000)])
    motion.move(hand, "2", "M", 500, Prompts())
    with pytest.raises(UsageError):
        motion.move_each(hand, goals, "M", Prompts())
    assert not any(command.startswith("1M") for command in link.commands)


def test_the_rows_of_all_are_shown_and_the_first_failure_ends_it() -> None:
    hand, _ = simulated("initialized=1")
    table = motion.move_each(hand, motion.goals_of(["F1=9000", "F2=500"], "", "M"), "M", Prompts())
    assert {row["motor"]: row["value"] for row in table.rows} == {"F1": 9000, "F2": 500} and table.failure is None


def test_stop_is_ctrl_c_and_power_off(capsys: pytest.CaptureFixture[str]) -> None:
    """At the speed of the port; at the others ^C alone, without what a boot monitor at 9600 takes for its trigger."""
    others = ["\0\x03"] * 2 + ["\x03"] * 4
    assert planned(capsys, "stop") == ["\x03", "T\r", *others]
    assert planned(capsys, "stop", "--motors", "1234") == ["\x03", "1234T\r", *others]


@pytest.mark.parametrize("verb", ["close", "init"])
def test_four_motors_named_are_four_motors(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a prefix a disabled motor stays where it is; with one it moves (barrett §5.1.2, §5.3.4 EN)."""
    assert planned(capsys, verb, "--motors", "1234") == [f"1234{VERBS[verb]}\r"]


@each_row("args", [["close", "--motors", ""], ["stop", "--motors", ""], ["set", "DP=1", "--motors", ""]])
def test_an_empty_choice_is_not_everything(args: list[str]) -> None:
    assert main(["barrett", *args, "--fake", "-n"]) == 2


# -- every movement, on the simulated hand ----------------------------------------------------------------------------

TARGETS = [
    # movement, argument, where a finger and the spread go from P 0 (5000 and 1000 for those that open)
    ("C", None, 17000, 3150), ("M", None, 8500, 1575), ("M", 1200, 1200, 1200), ("IC", None, 1700, 315),
    ("IC", 500, 500, 500), ("HOME", None, 0, 0), ("O", None, 0, 0),
]  # fmt: skip


@each_row(("name", "argument", "finger", "spread"), TARGETS)
def test_goals_are_reached(name: str, argument: int | None, finger: int, spread: int) -> None:
    rows, _, failure = moved("initialized=1", "", name, argument)
    assert failure is None
    for motor, row in rows.items():
        goal = spread if motor == "SPREAD" else finger
        assert row["target"] == goal
        assert abs(row["value"] - goal) <= 50
        assert row["ended"] == "reached"
        assert row["unit"] == "cts"
        assert (row["strain"] is None) == (motor == "SPREAD"), "255 is no gauge, and no strain"


@each_row(("argument", "goal"), [(None, 3300), (400, 4600)])
def test_step_open_counts_from_here(argument: int | None, goal: int) -> None:
    hand, link = simulated()
    hand.line.ask("GM 5000")
    link.sent.clear()
    table = motion.move(hand, "123", "IO", argument, Prompts())
    assert link.commands[0].split()[:2] == ["123FGET", "P"]
    assert doing(link) == ["123IO" + (f" {argument}" if argument else "")]
    assert link.commands[-1].startswith("123FGET SG P"), "the strain first: it relaxes"
    for row in table.rows:
        assert abs(row["target"] - goal) <= 50
        assert abs(row["value"] - row["target"]) <= 50
        assert row["ended"] == "reached"


def test_init() -> None:
    rows, link, failure = moved("", "", "HI")
    assert failure is None
    assert doing(link) == ["HI"]
    assert {row["ended"] for row in rows.values()} <= {"reached", "initialized"}
    assert [row["status"] for row in rows.values()] == [0, 0, 0, 0]


@each_row("name", ["TC", "TO"])
def test_torque_has_no_goal(name: str) -> None:
    rows, _, failure = moved("initialized=1", "12", name)
    assert failure is None
    assert list(rows) == ["F1", "F2"]
    assert {row["target"] for row in rows.values()} == {None}
    assert all("stalled" in row["ended"] for row in rows.values())


def test_closed_on_something_is_a_contact() -> None:
    """O and C never report 16 (§5.5): position against goal tells."""
    rows, _, failure = moved("initialized=1&fault=obstacle", "123", "C")
    assert isinstance(failure, CheckFailed) and (failure.code, failure.exit_code) == ("not-reached", 7)
    assert {row["arrival"] for row in rows.values()} == {"contact"}
    assert all(9000 < row["value"] < 10000 for row in rows.values())
    assert {row["ended"] for row in rows.values()} == {"stalled short of the target"}
    assert {row["target"] for row in rows.values()} == {17000}


@each_row(
    ("query", "prefix", "name", "argument", "codes_of"),
    [
        # what is expected, in the order reached, contact, any -> the code of the failure
        ("", "", "HI", None, (None, "no-contact", None)),
        ("initialized=1", "1", "M", 1000, (None, "no-contact", None)),
        ("initialized=1", "123", "C", None, (None, "no-contact", None)),
        ("initialized=1&fault=obstacle", "123", "C", None, ("not-reached", None, None)),
        ("initialized=1&fault=obstacle", "", "C", None, ("not-reached", None, None)),
        ("initialized=1&fault=obstacle", "1", "M", 12000, ("not-reached", None, None)),
        ("initialized=1&fault=blocked", "1", "M", 3000, ("not-reached", None, None)),
        ("initialized=1", "12", "TC", None, (None, None, None)),
        ("", "1", "C", None, ("err-4", "err-4", "err-4")),
    ],
)
def test_what_is_expected_of_a_movement(
    query: str, prefix: str, name: str, argument: int | None, codes_of: tuple[str | None, ...]
) -> None:
    for expect, code in zip(("reached", "contact", "any"), codes_of, strict=True):
        hand, _ = simulated(query)
        failure = motion.move(hand, prefix, name, argument, Prompts(), expect=expect).failure
        assert (failure.code if failure else None) == code, expect


def test_a_move_that_is_stopped_is_an_error() -> None:
    rows, _, failure = moved("initialized=1&fault=obstacle", "1", "M", 12000)
    assert isinstance(failure, CheckFailed)
    assert failure.code == "not-reached"
    assert rows["F1"]["ended"] == "stalled short of the target"


@each_row("name", ["M", "C", "HOME", "IC", "TC"])
def test_before_hi(name: str) -> None:
    rows, _, failure = moved("", "", name)
    assert isinstance(failure, DeviceRefused)
    assert (failure.code, failure.exit_code) == ("err-4", 6)
    assert {row["ended"] for row in rows.values()} == {"not initialized: did not move"}


@each_row(
    "query,words,state,told",
    [
        ("initialized=1&fault=obstacle", ("move", "12000", "--motors", "1"), "sent", "carried out, ERR 16: F1 stalled"),
        ("initialized=1&fault=obstacle", ("gcl", "1M 12000"), "sent", ""),
        ("", ("close",), "refused", "ERR 4: F1 not initialized"),
        ("", ("close", "--motors", "1"), "refused", "ERR 4: F1 not initialized"),
        ("", ("gcl", "1C"), "refused", "refused by the device"),
        ("", ("gcl", "C"), "sent", ""),
        ("initialized=1", ("close",), "confirmed", "acknowledged by the device"),
        ("initialized=1", ("gcl", "1M 90000"), "refused", "refused by the device"),
    ],
)
def test_a_movement_that_was_made_was_not_refused(query: str, words: tuple[str, ...], state: str, told: str) -> None:
    """ERR 16 tells where a movement ended; ERR 4 of several motors may be that of one, and the others have moved."""
    result = run("barrett", *words, "--json", "-p", f"fake://barrett?clock=virtual&{query}")
    (row,) = result.json["writes"]
    assert (row["state"], told in row.get("evidence", "")) == (state, True), row


def test_one_motor_that_is_not_initialised_refuses_nothing_for_the_others(tmp_path: Path) -> None:
    link = f"fake://barrett?clock=virtual&state={tmp_path / 'hand.json'}"
    assert run("barrett", "init", "--motors", "23", "-p", link).code == 0
    (row,) = run("barrett", "move", "500", "--motors", "12", "--json", "-p", link).json["writes"]
    assert (row["state"], row["evidence"].split(":")[0]) == ("sent", "carried out, ERR 4"), row
    assert "F1 not initialized" in row["evidence"] and "F2 reached" in row["evidence"], row


def test_strain_ends_a_movement() -> None:
    hand, _ = simulated("initialized=1&fault=strain")
    hand.line.ask("GFSET HSG 200")
    table = motion.move(hand, "123", "C", None, Prompts())
    assert [row["ended"] for row in table.rows] == ["reached", "strain limit: 221 is above HSG 200", "reached"]


@each_row(
    "query", ["initialized=1&fault=over-temperature", "initialized=1&fault=over-temperature&otemp-stops=movements"]
)
@each_row("name", ["C", "HOME", "M", "TC"])
def test_over_temperature(query: str, name: str) -> None:
    rows, _, failure = moved(query, "", name)
    assert isinstance(failure, DeviceRefused)
    assert failure.code == "err-8192"
    for row in rows.values():
        assert "temperature" in row["ended"], "it did not move, and why is known"


def test_a_disabled_motor_did_not_move() -> None:
    """Without a prefix only enabled motors move (§5.3.4 EN): the others neither stalled nor reached anything."""
    hand, _ = simulated()
    hand.line.ask("2FSET EN 0")
    table = motion.move(hand, "", "C", None, Prompts())
    ended = {row["motor"]: row["ended"] for row in table.rows}
    assert ended.pop("F2", "disabled").startswith(("disabled", "not enabled"))
    assert set(ended.values()) == {"reached"}


@each_row(
    ("prefix", "argument", "warned"), [("1", 17800, 0), ("1", 17801, 1), ("4", 3150, 0), ("4", 3151, 1), ("", 20000, 2)]
)
def test_beyond_the_joint(prefix: str, argument: int, warned: int) -> None:
    hand, _ = simulated()
    motion.move(hand, prefix, "M", argument, Prompts())
    assert codes(hand).count("beyond") == warned, "one for all fingers, one for the spread"


def test_one_command_of_movement_and_a_word_while_it_runs() -> None:
    hand, link = simulated()
    prompts = NotedGuide()
    motion.move(hand, "1", "M", 1000, prompts)
    assert doing(link) == ["1M 1000"]
    assert link.commands[-1].startswith("1FGET SG P")
    assert "1M 1000" in prompts.shown[0]


@pytest.mark.parametrize("words", [
    ("move", "F1=9000", "F2=5000", "--expect", "any"), ("close", "--motors", "1", "--expect", "contact"),
    ("torque-close", "--motors", "1"), ("gcl", "1M 9000", "2M 5000"),
])  # fmt: skip
def test_a_prompt_while_a_motor_turns_ends_no_movement(words: tuple[str, ...]) -> None:
    """The hand answers nothing behind it: handctl stops it, says so in the record of writes, and moves nothing more."""
    sent: list[bytes] = []
    read, write = FakeLink.read, FakeLink.write

    def too_early(link: FakeLink, deadline: Deadline, size: int = 4096) -> bytes:
        data = read(link, deadline, size)
        last = b"".join(sent[-1:])
        return data + PROMPT if data and last[:2] in (b"1M", b"1C", b"1T") and data.endswith(last[-2:-1]) else data

    def noted(link: FakeLink, data: bytes, deadline: Deadline) -> None:
        sent.append(data)
        write(link, data, deadline)

    with mock.patch.object(FakeLink, "read", too_early), mock.patch.object(FakeLink, "write", noted):
        result = run("barrett", *words, "--json", "-p", "fake://barrett?clock=virtual&initialized=1")
    assert (result.code, result.error["code"]) == (5, "false-prompt")
    assert b"2M 5000\r" not in sent
    assert [(row["bytes"], row["state"]) for row in result.json["writes"] if row["state"] != "not-sent"][1:] == [
        ("03", "confirmed")
    ]


def test_motors_that_are_not_seen_standing_have_reached_nothing() -> None:
    hand, link = scripted(
        {"*": "0", "1M 900": "", "FGET P": [f"{place} 0 0 0" for place in (300, 400, 500, 600)], "T": ""}
    )
    with pytest.raises(ProtocolError) as caught:
        motion.move(hand, "1", "M", 900, Prompts())
    assert caught.value.code == "moving" and ABORT in link.sent[link.sent.index(b"1M 900\r") :]


@each_row(("late", "after", "timeout", "name"), [
    ("0.6", 0, 1.0, "HOME"), ("0.6", 1, None, "TC"), ("0.9", 0, 1.0, "M"), ("1.1", 3, 1.0, "C"), ("1.6", 1, 1.0, "HOME"), ("1.6", 2, None, "C"),
])  # fmt: skip
def test_on_a_late_line_no_answer_behind_a_movement_is_taken_for_another(
    late: str, after: int, timeout: float | None, name: str
) -> None:
    """The question behind its prompt is answered late too, and that is waited for; numbers are not its answer."""
    fault = f"&fault=late&late={late}&after={after}"
    hands = [simulated(f"initialized=1{more}", timeout=timeout)[0] for more in ("", fault)]
    tables = [motion.move(hand, "1", name, None, Prompts()) for hand in hands]
    assert tables[0].rows == tables[1].rows and [table.failure for table in tables] == [None, None]


def test_a_slow_movement_is_waited_for() -> None:
    """max(20 s, 3 x the estimate from MCV and SAMPLE) (dossier 1.3): 17,000 counts at 1 count in 2.05 ms are 35 s."""
    hand, _ = simulated()
    hand.line.ask("1FSET MCV 16 SAMPLE 255")
    table = motion.move(hand, "1", "C", None, Prompts())
    assert table.rows[0]["ended"] == "reached"


# -- how it ended, from numbers ---------------------------------------------------------------------------------------

OFF = {"HSG": 256, "LSG": 256, "MPE": 50, "S": 0, "SG": 120}


@each_row(
    ("name", "now", "goal", "status", "words"),
    [
        ("M", {"P": 1000}, 1000, 0, "reached"), ("M", {"P": 1050}, 1000, 0, "reached"),
        ("M", {"P": 951}, 1000, 16, "reached"), ("M", {"P": 1051}, 1000, 16, "stalled short"),
        ("M", {"P": 1051, "MPE": 60}, 1000, 0, "reached"), ("C", {"P": 9212}, 17000, 0, "stalled short"),
        ("TC", {"P": 9212}, None, 0, "stalled"), ("TO", {"P": 0}, 0, 0, "stalled"),
        # strain (§5.5 case 2): beyond, not at, the limit
        ("C", {"P": 5, "SG": 201, "HSG": 200}, 17000, 0, "201 is above HSG 200"),
        ("C", {"P": 5, "SG": 200, "HSG": 200}, 17000, 0, "stalled short"),
        ("C", {"P": 5, "SG": 99, "LSG": 100}, 17000, 0, "99 is below LSG 100"),
        ("C", {"P": 5, "SG": 100, "LSG": 100}, 17000, 0, "stalled short"),
        ("C", {"P": 5, "SG": 254, "HSG": 254}, 17000, 0, "stalled short"),
        ("C", {"P": 5, "SG": 254, "HSG": 253}, 17000, 0, "254 is above HSG 253"),
        ("TC", {"P": 5, "SG": 201, "HSG": 200}, None, 0, "strain limit"),
        # 255 and 256 are off; 255 is no gauge (§5.3.1, §5.3.2)
        ("C", {"P": 5, "SG": 254, "HSG": 255, "LSG": 255}, 17000, 0, "stalled short"),
        ("C", {"P": 5, "SG": 1, "HSG": 256, "LSG": 256}, 17000, 0, "stalled short"),
        ("C", {"P": 5, "SG": 255, "HSG": 200}, 17000, 0, "stalled short"),
        # ^C (case 4)
        ("C", {"P": 5}, 17000, 16384, "^C"), ("C", {"P": 5, "S": 16384}, 17000, 0, "^C"),
        # the status of the motor
        ("C", {"P": 5, "S": 4}, 17000, 4, "not initialized"), ("M", {"P": 5, "S": 8192}, 17000, 8192, "temperature"),
        ("C", {"P": 5, "S": 1}, 17000, 1, "No motor board"), ("C", {"P": 5, "S": 2}, 17000, 2, "No motor found"),
        ("HI", {"P": 0, "S": 2}, 0, 2, "No motor found"), ("HI", {"P": 9000}, 0, 0, "not 0 after HI"),
    ],
)  # fmt: skip
def test_how_it_ended(name: str, now: dict[str, int], goal: int | None, status: int, words: str) -> None:
    assert words in motion.how_it_ended(name, {**OFF, **now}, goal, status).words


@each_row(
    ("name", "now", "goal", "status", "start", "ended"),
    [
        ("C", 100, 17000, 0, 100, ("unmoved", "did not move")), ("C", 150, 17000, 0, 100, ("unmoved", "did not move")),
        ("C", 151, 17000, 0, 100, ("contact", "stalled short of the target")),
        ("O", 9000, 0, 0, 9000, ("unmoved", "did not move")), ("O", 100, 0, 0, 9000, ("contact", "stalled short of the target")),
        # M, HOME, IC and IO answer ERR 16 where a motor stalled: without it nothing shows that one did
        ("M", 100, 5000, 0, 100, ("unmoved", "did not move")),
        ("M", 2000, 5000, 0, 100, ("short", "ended short of the target without ERR 16")),
        ("M", 2000, 5000, 16, 100, ("contact", "stalled short of the target")),
        ("M", 100, 5000, 16, 100, ("contact", "stalled short of the target")),
        ("M", 100, 5000, 4, 100, ("blocked", "not initialized: did not move")), ("HI", 9000, 0, 0, None, ("short", "its position is not 0 after HI")),
        # under torque control it ends where it stalls, which is somewhere on its way
        ("TO", 150, None, 0, 100, ("contact", "stalled on something, or at the joint stop")),
        ("TO", 151, None, 0, 100, ("astray", "moved the wrong way")), ("TC", 100, None, 0, 9000, ("astray", "moved the wrong way")),
        ("TC", 9000, None, 0, None, ("contact", "stalled on something, or at the joint stop")),
    ],
)  # fmt: skip
def test_only_what_moved_or_says_so_touched_something(
    name: str, now: int, goal: int | None, status: int, start: int | None, ended: tuple[str, str]
) -> None:
    assert motion.how_it_ended(name, {**OFF, "P": now}, goal, status, motion.Start(start)) == ended


def test_a_finger_that_closes_when_it_is_to_open_has_gone_astray() -> None:
    """Also under torque control, which has no target (barrett §8: moves in the opposite direction)."""
    opened = run("barrett", "torque-open", "-p", fake(fault="reversed"), "--json")
    assert opened.code == 6 and [row["arrival"] for row in opened.rows] == ["astray", "contact", "contact", "contact"]


@each_row("name", ["HOME", "M", "HI", "O"])
def test_an_unknown_position_is_not_reached(name: str) -> None:
    assert motion.how_it_ended(name, {}, 0, 0).verdict != "reached"


# -- power off --------------------------------------------------------------------------------------------------------


@each_row("status", ["", "ERR 4", "ERR 1", "ERR 5"])
def test_stop_works_though_it_complains(status: str) -> None:
    """The manual prints "ERR 1" where a motor is not initialized; the others are off all the same (§5.2.1 T)."""
    hand, link = scripted({"12T": status})
    text = motion.power_off(hand, "12")
    assert text.endswith("motor power is off") and status.removeprefix("ERR ") in text
    assert link.commands == ["12T"]


def test_stop_refused() -> None:
    hand, _ = scripted({"T": "ERR 32"})
    with pytest.raises(DeviceRefused):
        motion.power_off(hand, "")


@each_row("places, error", [
    ("5 5 5 5", None), ("5 5 5", ProtocolError), ("ERR 8192", ProtocolError), (None, NoAnswer),
    (["1 1 1 1", "99 1 1 1", "199 1 1 1", "299 1 1 1"], DeviceRefused),
])  # fmt: skip
def test_a_hand_that_was_found_again_is_seen_standing(places: str | None, error: type[Exception] | None) -> None:
    hand, _ = scripted({"T": "", "FGET P": places})
    with pytest.raises(error) if error is not None else nullcontext():
        assert motion.find_and_power_off(hand, "").endswith("motor power is off")


# -- Ctrl-C -----------------------------------------------------------------------------------------------------------


@each_row("name", ["C", "M", "TC"])
def test_ctrl_c_stops_the_hand(name: str) -> None:
    hand, link = simulated()
    link.interrupt_at = link.now() + 0.3
    with pytest.raises(Interrupted) as caught:
        motion.move(hand, "123", name, 16000 if name == "M" else None, Prompts())
    assert caught.value.exit_code == 130
    assert ABORT in link.sent
    assert "16384" in caught.value.text
    places = [int(word.rstrip(",")) for word in caught.value.text.rpartition("Positions:")[2].split()[1::2]]
    assert len(places) == 4
    assert all(100 < place < 16000 for place in places[:3])
    link.sleep(3.0)
    assert [int(place) for place in hand.line.ask("FGET P").lines[0].split()] == places


def test_ctrl_c_on_a_hand_that_does_not_stop() -> None:
    hand, link = simulated("initialized=1&fault=no-abort")
    hand.line.ask("1FSET MCV 16 SAMPLE 100")
    link.interrupt_at = link.now() + 0.3
    with pytest.raises(NoAnswer) as caught:
        motion.move(hand, "1", "M", 16000, Prompts())
    assert (caught.value.exit_code, caught.value.code) == (4, NOT_STOPPED)
    assert "switch the power supply off" in caught.value.hint


def test_ctrl_c_and_silence() -> None:
    hand, link = scripted(
        {
            "C": None,
            "T": None,
            "FGET CT OT P MCV SAMPLE S": "17000 17000 17000 3150|0 0 0 0|0 0 0 0|100 100 100 60|31 31 31 31|0 0 0 0",
        }
    )
    link.on_abort = None
    link.interrupt_at = link.clock + 1.0
    with pytest.raises(NoAnswer) as caught:
        motion.move(hand, "", "C", None, Prompts())
    assert (caught.value.exit_code, caught.value.code) == (4, NOT_STOPPED)
    assert doing(link) == ["C", "T", "T"], "the motors keep their power only where ^C was answered"
    assert link.sent[-13:] == [*[ABORT] * 9, b"T\r", ABORT, ABORT, b"T\r"]


def test_the_names_of_goals_exist() -> None:
    assert {BARRETT.by_mnemonic(name).name for name in motion.GOALS.values()} == {
        "close_target", "open_target", "default_position",
    }  # fmt: skip
    assert hand_on(Simulated()).kind == "barrett"


# -- what would harm --------------------------------------------------------------------------------------------------


@each_row(
    ("name", "argument", "line"),
    [
        ("O", None, "1FSET MOV 4080"), ("TO", None, "1FSET MOV 301"), ("IO", 500, "1FSET MOV 4080"), ("HOME", None, "1FSET MOV 4080"),
        ("M", 100, "1FSET MOV 4080"), ("HI", None, "1FSET IVEL 900"), ("O", None, "1FSET MOV 200 IVEL 100"),
        ("O", None, "1FSET MOV 4080 IVEL 4080"),
    ],
)  # fmt: skip
def test_no_opening_faster_than_ivel_may_be(name: str, argument: int | None, line: str) -> None:
    """§5.3.4 IVEL WARNING, §8: whatever set it, and whether or not it was saved; --force does it all the same."""
    hand, link = simulated()
    hand.line.ask("1M 5000")
    hand.line.ask(line)
    link.sent.clear()
    with pytest.raises(UsageError) as caught:
        motion.move(hand, "1", name, argument, Prompts())
    assert (caught.value.code, doing(link)) == ("opening-speed", [])
    assert "IVEL" in caught.value.text and "--force" in caught.value.hint
    assert len(link.commands) == 1, "one line of questions, as before"
    motion.move(hand, "1", name, argument, Prompts(), force=True)
    assert doing(link) == [motion.command_text("1", name, argument)]


@each_row(("name", "argument"), [("C", None), ("M", 9000), ("IC", 500), ("TC", None)])
def test_closing_asks_nothing_of_mov(name: str, argument: int | None) -> None:
    hand, link = simulated()
    hand.line.ask("1FSET MOV 4080")
    motion.move(hand, "1", name, argument, Prompts())
    assert doing(link)[-1] == motion.command_text("1", name, argument)


@each_row(("name", "line"), [
    ("O", "1FSET OT 60000"), ("C", "1FSET CT 0"), ("O", "1FSET OT 9000 CT 5000"), ("C", "1FSET OT 9000 CT 9000"),
])  # fmt: skip
def test_targets_that_turn_it_around(name: str, line: str) -> None:
    """`set OT=60000`, then `open` closed the hand (§5.3.4)."""
    hand, link = simulated()
    hand.line.ask(line)
    link.sent.clear()
    with pytest.raises(UsageError) as caught:
        motion.move(hand, "1", name, None, Prompts())
    assert (caught.value.code, doing(link)) == ("targets", [])
