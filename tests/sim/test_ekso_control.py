"""The simulated EksoNR: clocks, restarts, the speed of its wire, control commands, options, the state file. Virtual time."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.sim.ekso_bench import GET_DATA, GET_TIME, POWER_ON, TIME_4, Bench, message
from tests.support.each_row import each_row

# -- clocks -------------------------------------------------------------------------------------------------------------


def boot(bench: Bench) -> int:
    high, low = bench.words(153)[25:]
    return high * 65536 + low


def test_boot_time_ticks_by_2_ms() -> None:
    bench = Bench()
    seen = []
    for step in range(50):
        bench.now = step * 0.001
        bench.line.advance(bench.now)
        seen.append(boot(bench))
    assert seen == [7654321 + 2 * (step // 2) for step in range(50)]


@each_row(
    ("start", "words"), [(65533, [0, 65533, 1, 1]), (4294967293, [65535, 65533, 0, 1]), (131070, [1, 65535, 2, 3])]
)
def test_boot_time_carries(start: int, words: list[int]) -> None:
    bench = Bench(boot=start)
    first = bench.words(154)[15:]
    bench.wait(0.004)
    assert first + bench.words(153)[25:] == words


def test_reboot() -> None:
    bench = Bench(persist=0)
    assert bench.set(202, 1500) == (0, 0)
    bench.line.command("reboot")
    assert bench.ask(GET_TIME) == ""
    assert bench.wait(0.99) == ""
    assert bench.ask(GET_TIME) == ""
    bench.wait(0.03)
    assert bench.ask(GET_TIME) == message(150, 0xC8, bytes([14, 5, 38, 0])).hex(" ").upper()
    assert boot(bench) == 21
    assert bench.words(154)[:3] == [0, 0, 0]
    assert bench.words(152) == POWER_ON


def test_reboot_in_a_log() -> None:
    bench = Bench(fault="reboot", after=2, every=2)
    seen = []
    for _ in range(12):
        bench.line.feed(bytes.fromhex(GET_DATA))
        data = bench.line.take()
        seen.append(int.from_bytes(data[54:58], "big") if data else None)
        bench.wait(0.6)
    assert seen == [7654321, 7654921, 7655521, None, None, 201, None, None, 201, None, None, 201]


def test_settings_survive_power_off_by_default() -> None:
    bench = Bench()
    assert bench.set(219, 1) == (0, 0)
    bench.line.power_cycle()
    assert boot(bench) == 1
    assert bench.words(152)[17] == 1


def test_frozen_and_jumping_clock() -> None:
    bench = Bench(fault="frozen-clock", after=1)
    seen = []
    for _ in range(4):
        seen.append(boot(bench))
        bench.wait(0.1)
    assert seen == [7654321, 7654421, 7654421, 7654421]
    bench.line.command("fault clock-jump")
    assert [boot(bench), boot(bench)] == [7654721 + 5000, 7654721 + 10000]


def test_calendar_turns() -> None:
    bench = Bench(rtc="2028-02-28T23:59:58")
    seen = []
    for _ in range(3):
        clock, date = message(150, 1), message(151, 1)
        bench.line.feed(date + clock)
        data = bench.line.take()
        seen.append([*data[4:7], *data[14:17]])
        bench.wait(1.0)
    assert seen == [[28, 2, 28, 23, 59, 58], [28, 2, 28, 23, 59, 59], [28, 2, 29, 0, 0, 0]]
    for text, wait, wanted in (
        ("2099-12-31T23:59:59", 1.0, "2000-01-01T00:00:00"),
        ("2026-02-28T12:00:00", 86400.0, "2026-03-01T12:00:00"),
        ("2026-04-30T00:00:00", 86400.0, "2026-05-01T00:00:00"),
    ):
        bench.line.command(f"rtc {text}")
        bench.wait(wait)
        assert bench.line.command("rtc") == f"rtc {wanted}"


@each_row(
    ("text", "why"),
    [
        ("soon", "is not YYYY"),
        ("2026-01-01_00:00:00", "is not YYYY"),
        ("2026-01-01T00:00:0x", "is not YYYY"),
        ("2026-02-29T00:00:00", "no such day"),
        ("1999-01-01T00:00:00", "no such day"),
        ("2026-13-01T00:00:00", "no such day"),
        ("2026-01-01T24:00:00", "no such time"),
    ],
)
def test_impossible_dates(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        Bench().line.command(f"rtc {text}")
    with pytest.raises(ValueError, match=why):
        Bench(rtc=text)


# -- the wire ------------------------------------------------------------------------------------------------------------


@each_row(
    ("command", "count", "per_second"),
    [(153, 66, 174.5), (152, 56, 205.7), (154, 46, 250.4)],
    ids=["data", "set", "fb"],
)
def test_wire_floor(command: int, count: int, per_second: float) -> None:
    bench = Bench(wire="auto")
    request, answered, begin = message(command, 1), 0, 0.0
    for _ in range(20):
        bench.line.feed(request)
        data = b""
        while len(data) < count - 6:
            event = bench.line.next_event()
            assert event is not None
            bench.now = max(bench.now, event)
            bench.line.advance(bench.now)
            data += bench.line.take()
        answered += 1
    assert answered / (bench.now - begin) == pytest.approx(per_second, abs=0.1)


def test_answers_on_a_grid() -> None:
    bench = Bench(quantum=20)
    bench.wait(0.025)
    assert bench.ask(GET_TIME) == ""
    assert bench.line.next_event() == pytest.approx(0.04)
    assert bench.wait(0.015) == TIME_4
    assert bench.ask(GET_TIME) == TIME_4


def test_speed_matters_except_on_usb() -> None:
    bench = Bench()
    bench.line.client_baud = 9600
    assert bench.ask(GET_TIME) == ""
    bench = Bench(usb=1)
    bench.line.client_baud = 9600
    assert bench.ask(GET_TIME) == TIME_4
    assert Bench(baud=9600).line.device.speed == 9600


# -- control and state ---------------------------------------------------------------------------------------------------


def test_control_commands() -> None:
    bench = Bench(sway=0)
    tell = bench.line.command
    assert tell("get step_length") == tell("get 202") == "1475"
    assert tell("set forward_shift -75") == "set forward_shift -75"
    assert tell("get 208") == "65461"
    assert tell("set pilot_id 7") == "set pilot_id 7"
    assert bench.words(152)[19] == 7
    assert tell("state 4440") == "state 4440"
    assert bench.set(202, 1500) == (0x44, 1)
    assert tell("data 2 2746") == "data 2 2746"
    assert tell("data 2") == "2746"
    assert bench.words(153)[2] == 2746
    tell("live")
    assert tell("posture") == "posture standing state 2040"
    assert bench.words(153)[2] == 260
    tell("boot 98")
    assert tell("boot") == "boot 99"
    assert "reboot" in tell("help")


@each_row(
    "text",
    [
        *("dance", "set 199 1", "set step_length", "set step_length 65536", "set step_length x", "posture flying"),
        *("pose 1 2", "pose 1 2 nan", "pose a b c", "data 27", "data 0 -40000", "state 20", "state zzzz", "boot -1"),
        *("walk", "get", "get ²", "reboot now", "rise up", "boot 4294967296"),
    ],
)
def test_bad_control_commands(text: str) -> None:
    bench = Bench(sway=0)
    with pytest.raises(ValueError, match=r"."):
        bench.line.command(text)
    assert bench.words(152) == POWER_ON


@each_row(
    ("name", "value"),
    [
        *(("preset", "x"), ("posture", "x"), ("boot", "-1"), ("boot", "4294967296"), ("rtc", "x"), ("time-body", "5")),
        *(("length", "n"), ("quantum", "15"), ("baud", "19200"), ("refuse-status", "0"), ("fault", "x"), ("x", "1")),
    ],
)
def test_bad_options(name: str, value: str) -> None:
    with pytest.raises(ValueError, match=r".") as caught:
        Bench(**{name: value})
    assert "\n" not in str(caught.value)


def test_state_file(tmp_path: Path) -> None:
    path = tmp_path / "ekso.json"
    bench = Bench(state=path, posture="rising", sway=0)
    bench.wait(9.0)
    bench.line.command("set step_height 300")
    before, feedback = bench.words(153), bench.words(154)
    bench.line.close()
    state = json.loads(path.read_text())
    assert (state["kind"], state["simulated"], state["settings"][3]) == ("ekso", True, 300)
    again = Bench(state=path, sway=0)
    assert again.words(153) == before
    assert again.words(154) == feedback
    assert again.line.command("rtc") == "rtc 2026-11-20T14:05:46"
    again.wait(3.0)
    assert again.words(153)[18] == 0x2040
    assert again.words(152)[3] == 300
    fresh = Bench(state=path, power_cycle=1)
    assert boot(fresh) == 1
    assert fresh.words(152)[3] == 300
    assert Bench(state=path, power_cycle=1, persist=0).words(152) == POWER_ON


@each_row(
    ("name", "value"),
    [
        ("settings", [1]),
        ("settings", [-1] * 22),
        ("feedback", None),
        ("boot_ms", -1),
        ("rtc", "x"),
        ("body", {}),
        ("body", {"place": 1.0, "direction": 0, "walking": 1, "clock": 0.0}),
    ],
)
def test_damaged_state_file(tmp_path: Path, name: str, value: object) -> None:
    path = tmp_path / "ekso.json"
    bench = Bench(state=path)
    bench.line.close()
    state = json.loads(path.read_text())
    path.write_text(json.dumps({**state, name: value}))
    with pytest.raises(ValueError, match="damaged or foreign"):
        Bench(state=path)
