"""The simulated EksoNR with faults, of its line and its own: literal bytes in and out, on virtual time."""

from __future__ import annotations

from handctl.sim import model_class
from handctl.sim.engine.line_and_faults import LINE_FAULTS
from tests.sim.ekso_bench import (
    CANCEL,
    GET_DATA,
    GET_DATE,
    GET_FEEDBACK,
    GET_SETTINGS,
    GET_TIME,
    POWER_ON,
    SET_OK,
    SET_STEP,
    SET_WRONG_STATE,
    TIME_4,
    UNASKED,
    Bench,
    message,
)
from tests.support.each_row import each_row

# -- faults of the line ------------------------------------------------------------------------------------------------


@each_row(
    ("fault", "reply"),
    [
        ("silent", ""),
        ("deaf", ""),
        ("bad-checksum", SET_OK[:-2] + "34"),
        ("wrong-id", message(155, 0xCE, b"\0\0").hex(" ").upper()),
        ("echo", f"{SET_STEP} {SET_OK}"),
        ("loopback", SET_STEP),
        ("duplicate", f"{SET_OK} {SET_OK}"),
        ("stale", f"{TIME_4} {SET_OK}"),
        ("refuse", SET_WRONG_STATE),
        ("wrong-command", message(156, 0xCD, b"\0\0").hex(" ").upper()),
        ("acknowledge", "9B 00 00 CD 54 A1"),
        ("acknowledge-set", "9B 00 00 CD 54 A1"),
        ("set-unanswered", ""),
        ("unsolicited", f"{UNASKED} {SET_OK}"),
        ("stray-zero", f"{SET_OK} 00"),
        ("short-body", "9B 00 00 CD 54 A1"),
        ("reboot", ""),
    ],
)
def test_faults_strike_after_the_first_requests(fault: str, reply: str) -> None:
    bench = Bench(preset="vectors", fault=fault, after=1)
    assert bench.ask(GET_TIME) == TIME_4
    assert bench.ask(SET_STEP) == reply


def test_late_truncated_noisy_cut() -> None:
    bench = Bench(fault="late")
    assert bench.ask(GET_TIME) == ""
    assert bench.wait(0.59) == ""
    assert bench.wait(0.02) == TIME_4
    short = Bench(fault="truncate").ask(GET_TIME)
    assert short
    assert short != TIME_4
    assert TIME_4.startswith(short)
    noisy = Bench(fault="noise").ask(GET_TIME)
    assert TIME_4 in noisy
    assert len(noisy) > len(TIME_4)
    bench = Bench(fault="disconnect")
    assert bench.ask(GET_TIME) == TIME_4[:14]
    assert bench.line.hung_up
    bench = Bench(fault="dribble")
    assert bench.ask(GET_TIME) == ""
    assert bench.wait(0.029) != TIME_4
    assert bench.wait(0.2).endswith("2A")


def test_every_fault_meets_every_command() -> None:
    requests = [GET_TIME, GET_DATE, GET_SETTINGS, GET_DATA, GET_FEEDBACK, SET_STEP, CANCEL]
    for fault in {**LINE_FAULTS, **model_class("ekso").FAULTS}:
        bench = Bench(fault=fault, every=2)
        for request in requests:
            bench.ask(request)
            bench.wait(0.8)
            bench.line.reconnect()
        assert bench.line.command("fault none") == "fault none"
        bench.wait(2.0)
        assert bench.ask(GET_TIME)[:11] == "96 04 00 C8", fault


# -- faults of the device ----------------------------------------------------------------------------------------------


def test_not_taken() -> None:
    bench = Bench(fault="not-taken")
    assert bench.set(202, 1500) == (0, 0)
    assert bench.words(152) == POWER_ON


def test_neighbour() -> None:
    bench = Bench(fault="neighbour")
    assert bench.set(202, 1500) == (0, 0)
    assert bench.words(152) == [1680, 1640, 1500, 176, *POWER_ON[4:]]
    assert bench.set(214, 1) == (0, 0)
    assert bench.words(152) == [1681, 1640, 1500, 176, *POWER_ON[4:21], 1]


def test_set_unanswered_is_carried_out() -> None:
    bench = Bench(preset="vectors", fault="set-unanswered")
    assert bench.ask("9B 04 02 08 00 DA 00 15 8F CE") == ""
    assert bench.words(152)[15] == 21


def test_pendant() -> None:
    bench = Bench(fault="pendant", after=1)
    assert [bench.words(152)[12] for _ in range(4)] == [0, 0, 1, 2]


@each_row(
    ("options", "state"), [({"posture": "sitting"}, 0x1040), ({"preset": "vectors"}, 0x2040)], ids=["live", "fixed"]
)
def test_stands_up(options: dict[str, str], state: int) -> None:
    bench = Bench(fault="stands-up", **options)
    assert bench.words(153)[18] == state
    assert bench.set(202, 1500) == (0x30, 1)
    assert bench.words(153)[18] == 0x3040


def test_words_that_lie() -> None:
    assert Bench(fault="unlisted-codes").words(152)[10:] == [50, 51, 52, 53, 54, 55, 56, 57, 58, 4711, 60, 61]
    assert Bench(fault="unknown-state").words(153)[18] == 0x5040
    healthy, stuck, offset = Bench(), Bench(fault="stuck-sensor"), Bench(fault="hip-offset")
    good, other = healthy.words(153), offset.words(153)
    assert [b - a for a, b in zip(good, other, strict=True)] == [0] * 6 + [30] + [0] * 20
    for bench in (healthy, stuck):
        bench.wait(1.0)
    assert healthy.words(153)[4] != good[4]
    assert stuck.words(153)[4] == 333


def test_short_body_has_a_good_check_value() -> None:
    bench = Bench(preset="vectors", fault="short-body")
    assert bench.ask(GET_DATA) == (
        "99 34 00 CB 01 C2 FF B5 00 5F 02 62 00 78 01 E0 FF CF 0E 10 00 62 0E 26 FF 47 08 A2 FF D8 03 48 00 D2 FD 85"
        " FF C9 01 40 20 40 04 04 00 00 00 00 00 7D 00 01 00 0C 00 4C 1B BB"
    )


def test_unsolicited_frames_come_by_themselves() -> None:
    bench = Bench(fault="unsolicited")
    assert bench.wait(1.5) == " ".join([UNASKED] * 4)
    assert bench.line.command("fault unsolicited,bad-checksum") == "fault bad-checksum,unsolicited"
    assert bench.ask(GET_TIME).startswith(f"{UNASKED} 96 04 00 C8")
    bench.line.command("fault none")
    assert bench.wait(1.0) == ""
    assert bench.line.command("unsolicited") == "unsolicited"
    assert bench.wait(0.01) == UNASKED
