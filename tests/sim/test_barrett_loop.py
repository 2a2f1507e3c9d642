"""The simulated BarrettHand in RealTime mode, byte for byte, on virtual time. Sections: barrett manual."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.sim.barrett_bench import PROMPT, Bench, ready
from tests.support.each_row import each_row

EXAMPLE = (  # §6.4
    "12FSET LCV 1 LCVC 1 LCPG 0 LFV 0 LFS 1 LFAP 0 LFDP 1 LFDPC 1",
    "4FSET LCV 0 LCPG 0 LFV 0 LFS 0 LFAP 0 LFDP 1 LFDPC 1",
    "PSET LFT 1",
)
OFF = "FSET LCV 0 LCPG 0 LFV 0 LFS 0 LFAP 0 LFDP 0"
SAMPLE = 256e-6  # s: 16 * (31 + 1) / 2 MHz


def say(bench: Bench, sent: str) -> str:
    """Writes bytes in hex; what comes at once, in hex."""
    bench.line.feed(bytes.fromhex(sent))
    return take(bench)


def take(bench: Bench) -> str:
    return bench.line.take().hex(" ").upper()


def settle(bench: Bench, sent: str = "") -> str:
    """The same, and what comes until nothing is scheduled."""
    return (say(bench, sent) + " " + bench.run().encode("latin-1").hex(" ").upper()).strip()


def looping(*commands: str, enter: str = "LOOP", **options: object) -> Bench:
    bench = ready(**options)
    for command in commands:
        assert bench.ask(command) == []
    assert bench.send(enter + "\r") == enter + "*"
    return bench


def example(**options: object) -> Bench:
    return looping(*EXAMPLE, enter="124LOOP", **options)


# -- the dossier's transcripts --------------------------------------------------------------------------------------------


def test_the_example() -> None:
    """§6.4: 124LOOP, blocks of 3 and 8 bytes."""
    bench = ready()
    for command in EXAMPLE:
        bench.ask(command)
    assert say(bench, "31 32 34 4C 4F 4F 50 0D") == "31 32 34 4C 4F 4F 50 2A"
    for command in ("strain F1 120", "strain F2 120", "jump F1 20", "jump F2 127"):
        bench.control(command)
    assert say(bench, "43 14 7F") == "2A 78 14 78 7F 00 01 9C"
    assert say(bench, "63 14 7F") == "2A"
    assert say(bench, "61") == "2A"
    bench.control("temperature -55")
    assert say(bench, "41") == "2A 78 00 78 00 00 FF C9"
    assert say(bench, "03") == "0A 0D 3D 3E 20"


def test_the_example_from_options_alone() -> None:
    bench = example(no_load="120,120,126", loop_jump="20,127,0,0")
    assert say(bench, "43 14 7F") == "2A 78 14 78 7F 00 01 9C"
    assert say(example(temperature=-55, no_load="120,120,9"), "41") == "2A 78 00 78 00 00 FF C9"


def test_wrong_header() -> None:
    """§5.1.3, §6.1."""
    bench = example()
    assert say(bench, "5A") == "0A 0D 45 52 52 20 32 30 34 38 0A 0D 3D 3E 20"
    assert bench.ask("VERS") == ["4.33"]


@each_row("header", [0x00, 0x02, 0x04, 0x0D, 0x2A, 0x40, 0x42, 0x44, 0x60, 0x62, 0x64, 0xC3, 0xFF])
def test_other_headers(header: int) -> None:
    assert say(example(), f"{header:02X}") == "0A 0D 45 52 52 20 32 30 34 38 0A 0D 3D 3E 20"


@each_row(
    ("discard", "start", "jump", "answers"),
    [
        (0, 1500, 500, ["2A 7F", "2A 7B", "2A 00"]),
        (1, 1500, 500, ["2A 7F", "2A 00", "2A 00"]),
        (0, 2000, -500, ["2A 80", "2A 86", "2A 00"]),
    ],
)
def test_delta_position(discard: int, start: int, jump: int, answers: list[str]) -> None:
    """§6.2.3: LFDPC 2, 1500 to 2000."""
    bench = ready()
    bench.ask(f"1M {start}")
    bench.ask(OFF)
    bench.ask("1FSET LFDP 1 LFDPC 2")
    bench.ask(f"PSET LFDPD {discard}")
    assert bench.get("P", "1") == [str(start)]
    bench.send("1LOOP\r")
    bench.control(f"jump F1 {jump}")
    assert [say(bench, "41") for _ in answers] == answers


def test_factory_flags() -> None:
    """§5.3.3: 9 bytes and 21."""
    bench = ready()
    for name, start, strain in (("F1", 8490, 120), ("F2", 8481, 118), ("F3", 8499, 126), ("S", 1585, 255)):
        bench.control(f"position {name} {start}")
        bench.control(f"strain {name} {strain}")
    bench.get("P")
    bench.send("LOOP\r")
    say(bench, "63 10 0A 10 0A 10 0A F0 0A")
    for name, delta in (("F1", 10), ("F2", 9), ("F3", 11), ("S", -10)):
        bench.control(f"jump {name} {delta}")
    assert say(bench, "43 10 0A 10 0A 10 0A F0 0A") == (
        "2A 01 78 21 34 0A 01 76 21 2A 09 01 7E 21 3E 0B FF FF 06 27 F6"
    )


# -- entering and leaving ---------------------------------------------------------------------------------------------------


@each_row(
    ("enter", "size"), [("LOOP", 23), ("1LOOP", 8), ("421LOOP", 18), ("SGLOOP", 23), ("GLOOP", 18), ("12sLooP", 18)]
)
def test_selected_motors(enter: str, size: int) -> None:
    bench = looping("PSET LFT 1", enter=enter)
    assert len(bytes.fromhex(say(bench, "41"))) == size


def test_disabled_motor_is_left_out_without_a_prefix() -> None:
    """§5.3.4 EN, LOOP being a movement command."""
    for enter, size in (("LOOP", 16), ("GSLOOP", 21)):
        bench = looping("2FSET EN 0", enter=enter)
        assert len(bytes.fromhex(say(bench, "41"))) == size


@each_row(
    ("fault", "enter", "error"),
    [
        ("not-homed", "LOOP", 4),
        ("no-board", "LOOP", 1),
        ("no-motor", "LOOP", 2),
        ("no-board,no-motor,not-homed", "LOOP", 7),
        ("over-temperature", "LOOP", 8192),
        ("healthy", "LOOP 5", 1024),
        ("healthy", "1L00P", 32),
    ],
)
def test_loop_that_does_not_begin(fault: str, enter: str, error: int) -> None:
    bench = ready(fault=fault)
    assert bench.ask(enter) == [f"ERR {error}"]
    assert bench.ask("VERS") == ["4.33"]


def test_ready_motors_alone_are_enough() -> None:
    bench = ready(fault="no-motor")
    assert bench.send("12LOOP\r") == "12LOOP*"


def test_abort_byte_in_a_control_block_is_data() -> None:
    bench = example()
    assert say(bench, "63 03 03") == "2A"
    assert say(bench, "61") == "2A"
    bench.wait(1600 * SAMPLE)
    assert bench.send("\x03") == PROMPT
    # 3/16 count a sample; F1 has a little more friction than F2
    assert bench.control("motors").startswith("F1 P 291 S 0 SG 112 power on moving, F2 P 300 S 0")


def test_flags_are_those_of_the_entry() -> None:
    """§6.1; a changed flag counts at the next LOOP."""
    bench = looping(OFF, "1FSET LFS 1", enter="1LOOP")
    assert say(bench, "41") == "2A 70"
    assert bench.send("\x03") == PROMPT
    assert bench.ask("1FSET LFS 0 LFAP 1") == []
    assert bench.send("1LOOP\r") == "1LOOP*"
    assert say(bench, "41") == "2A 00 00"


def test_control_blocks_have_no_echo_and_an_empty_one_is_only_its_header() -> None:
    bench = looping(OFF)
    assert say(bench, "41 43 61 63") == "2A 2A 2A 2A"


def test_leaving_and_the_motors() -> None:
    """Whether they go on is not in the manual: both can be had."""
    for way, expected in (("run", "1000"), ("stop", "500")):
        bench = looping(OFF, "2FSET LCV 1", enter="2LOOP", loop_exit=way)
        say(bench, "63 10")
        bench.wait(500 * SAMPLE)
        assert bench.send("\x03") == PROMPT
        bench.wait(500 * SAMPLE)
        assert bench.get("P", "2") == [expected]
    bench.ask("T")
    assert "moving" not in bench.control("motors")


@each_row(("command", "position"), [("2T", 500), ("2M 600", 600), ("RESET", 0)])
def test_what_ends_a_velocity(command: str, position: int) -> None:
    bench = looping(OFF, "2FSET LCV 1", enter="2LOOP")
    say(bench, "63 10")
    bench.wait(500 * SAMPLE)
    bench.send("\x03" + command + "\r")
    bench.run()
    bench.wait(1.0)
    assert bench.get("P", "2") == [str(position)]
    assert "moving" not in bench.control("motors")


def test_power_cycle_ends_the_loop() -> None:
    bench = example()
    bench.control("power-cycle")
    assert bench.run() == ":\n\rBarrettHand Firmware\n\rVersion 4.33\n\r=> "
    assert bench.get("S") == ["4 4 4 4"]


# -- feedback ---------------------------------------------------------------------------------------------------------------


def test_feedback_is_the_state_before_the_block() -> None:
    """§6.1: sent when the header is received, acted on when complete."""
    bench = looping(OFF, "2FSET LCV 1 LFV 1 LFAP 1", enter="2LOOP")
    assert say(bench, "43 20") == "2A 00 00 00"
    bench.wait(1000 * SAMPLE)
    assert say(bench, "43") == "2A 02 07 D0"  # 2000
    bench.wait(1000 * SAMPLE)
    say(bench, "00")
    bench.wait(1000 * SAMPLE)
    assert say(bench, "41") == "2A 00 0F A0"  # 4000


def test_lasting_velocity_and_the_stop() -> None:
    """No watchdog; the joint stalls at its stop, powered and silent, and comes back."""
    bench = looping(OFF, "2FSET LCV 1 LFV 1 LFAP 1", enter="2LOOP")
    say(bench, "63 7F")
    bench.wait(3600.0)
    assert say(bench, "41") == "2A 00 45 94"  # 17812
    assert "F2 P 17812 S 0 SG 119 power on moving" in bench.control("motors")
    say(bench, "63 F0")
    bench.wait(812 * SAMPLE)
    assert say(bench, "41") == "2A FF 42 68"  # 17000
    bench.wait(3600.0)
    assert say(bench, "41") == "2A 00 FF CE"  # -50, the open stop


def test_same_velocity_again_loses_nothing() -> None:
    """400 blocks a second of 0.0625 count a sample: no rounding adds up."""
    bench = looping(OFF, "2FSET LCV 1 LFAP 1", enter="2LOOP")
    for _ in range(1600):
        say(bench, "63 01")
        bench.wait(10 * SAMPLE)
    assert say(bench, "41") == "2A 03 E8"


@each_row(
    ("setting", "block", "samples", "position"),
    [
        ("LCVC 1", "63 01", 1600, 100),
        ("LCVC 16", "63 01", 1600, 1600),
        ("LCVC 255", "63 01", 160, 2550),
        ("LCVC 0", "63 7F", 1600, 0),
        ("LCVC 1", "63 7F", 160, 1270),
        ("LCVC 2", "63 40", 160, 1280),
        ("LCPG 1", "63 10 04", 160, 160),
        ("LCPG 1", "63 10 FF", 160, 160),
        ("LCPG 1", "63 10 02", 160, 80),  # a weak gain lags, invented
        ("LCPG 1", "63 10 00", 160, 0),
        ("FPG 0", "63 10", 160, 0),
    ],
)
def test_velocity_and_gain(setting: str, block: str, samples: int, position: int) -> None:
    """§6.2.1: 1/16 count a sample, times LCVC; the gain, or FPG without LCPG."""
    bench = looping(OFF, f"2FSET LCV 1 LFAP 1 {setting}", enter="2LOOP")
    assert say(bench, block) == "2A"
    bench.wait(samples * SAMPLE)
    assert say(bench, "41") == f"2A {position >> 8:02X} {position & 255:02X}"


def test_most_negative_velocity() -> None:
    bench = looping(OFF, "2FSET LCV 1 LFAP 1 LFV 1", enter="2LOOP")
    bench.control("jump F2 9000")
    say(bench, "63 80")
    bench.wait(1000 * SAMPLE)
    assert say(bench, "41") == "2A F8 03 E8"  # -8 counts a sample, 9000 - 8000


@each_row(
    ("unit", "coefficient", "feedback"),
    [("sample", 1, "05"), ("sample", 2, "02"), ("sample", 0, "05"), ("10ms", 1, "7F"), ("10ms", 2, "61")],
)
def test_feedback_velocity(unit: str, coefficient: int, feedback: str) -> None:
    """§6.2.2: all integer, divided by LFVC; 5 counts a sample are 195 per 10 ms, which does not fit."""
    bench = looping(OFF, f"2FSET LCV 1 LFV 1 LFVC {coefficient}", enter="2LOOP", lfv_unit=unit)
    say(bench, "63 50")
    assert say(bench, "41") == f"2A {feedback}"


def test_delta_reference_is_that_of_fget_p() -> None:
    """§6.2.3; other ways to read P leave it alone, and power on begins at 0."""
    bench = ready()
    bench.ask(OFF)
    bench.ask("12FSET LFDP 1")
    bench.ask("12M 100")
    assert bench.get("P", "1") == ["100"]
    bench.ask("FLISTV")
    bench.send("12LOOP\r")
    assert say(bench, "41") == "2A 00 64"
    bench.control("jump F1 -7")
    assert bench.send("\x03") == PROMPT
    bench.send("12LOOP\r")
    assert say(bench, "41") == "2A F9 00"


def test_delta_keeps_the_remainder() -> None:
    """§6.2.3: what cannot be sent follows, unless LFDPD is set. Division goes towards 0, our guess."""
    for discard, answers in (
        (0, ["2A 00", "2A 01", "2A 00", "2A FF"]),
        (1, ["2A 00", "2A 00", "2A 00", "2A FF"]),
    ):
        bench = looping(OFF, "1FSET LFDP 1 LFDPC 10", f"PSET LFDPD {discard}", enter="1LOOP")
        got = []
        for jump in (9, 9, -9 if discard else -17, -10):
            bench.control(f"jump F1 {jump}")
            got.append(say(bench, "41"))
        assert got == answers


def test_position_is_sixteen_bits() -> None:
    bench = looping(OFF, "1FSET LFAP 1", enter="1LOOP")
    bench.control("jump F1 -2")
    assert say(bench, "41") == "2A FF FE"


def test_strain_and_obstacle() -> None:
    bench = looping(OFF, "2FSET LCV 1 LFS 1 LFAP 1 HSG 130", enter="2LOOP")
    bench.control("obstacle F2 1000")
    say(bench, "63 10")
    bench.wait(1020 * SAMPLE)
    assert say(bench, "41") == "2A 7B 03 FC"  # 119 + 4 at 1020; HSG does not act here (§6 does not say so)
    bench.wait(10.0)
    assert say(bench, "41") == "2A 80 04 18"  # stalled at 1048
    bench.control("release F2")
    bench.wait(100 * SAMPLE)
    assert say(bench, "41") == "2A 77 04 7C"  # 1148: it goes on from there
    bench.control("block F2")
    bench.wait(1.0)
    assert say(bench, "41") == "2A 77 04 7C"


def test_reversed_motor_runs_away() -> None:
    bench = looping(OFF, "1FSET LCV 1 LFAP 1", enter="1LOOP", fault="reversed")
    bench.control("jump F1 1000")
    say(bench, "63 10")
    bench.wait(100 * SAMPLE)
    assert say(bench, "41") == "2A 03 87"  # 903, with its friction
    bench.control("jump F1 100")
    bench.wait(100 * SAMPLE)
    assert say(bench, "41") == "2A 03 8A"  # 906: still the same way


def test_heat_in_the_loop() -> None:
    """What the hand does then is our guess: an error in place of the next '*' (§6.1), and the motors are off."""
    bench = example()
    say(bench, "63 10 10")
    bench.control("temperature 700")
    assert say(bench, "41") == "2A 70 00 77 00 00 02 BC"
    bench.send("\x03")
    bench.ask("PSET OTEMP 600")
    bench.control("temperature 412")
    bench.send("124LOOP\r")
    bench.control("temperature 700")
    assert say(bench, "41") == "0A 0D 45 52 52 20 38 31 39 32 0A 0D 3D 3E 20"
    assert "moving" not in bench.control("motors") and "power on" not in bench.control("motors")


# -- firmware 4.4 ------------------------------------------------------------------------------------------------------------


@each_row(
    ("firmware", "tenths", "bytes_"),
    [
        ("4.33", 412, "01 9C"),
        ("4.34", 412, "01 9C"),
        ("4.34", -55, "FF C9"),
        ("4.4", 412, "29"),
        ("4.4", -55, "FB"),
        ("4.4", 1250, "7D"),
    ],
)
def test_temperature(firmware: str, tenths: int, bytes_: str) -> None:
    bench = looping(OFF, "PSET LFT 1", firmware=firmware, temperature=tenths)
    assert say(bench, "41") == f"2A {bytes_}"


def test_later_data() -> None:
    """4.4: LCT in the control block, LFBP and LFAIN behind the others, high byte first."""
    bench = ready(firmware="4.4", fault="breakaway")
    bench.ask("3C")
    bench.ask(OFF)
    bench.ask("13FSET LFBP 1 LFAIN 1 LFS 1")
    bench.ask("PSET LFT 1")
    bench.send("13LOOP\r")
    assert say(bench, "41") == "2A 70 00 00 1F 7E 07 D0 3F 29"


def test_torque() -> None:
    """4.4; its effect is invented, its sign is not."""
    bench = looping(OFF, "2FSET LCT 1 LFAP 1", enter="2LOOP", firmware="4.4")
    assert say(bench, "63 01 00") == "2A"
    bench.wait(100 * SAMPLE)
    assert say(bench, "43 FF 80") == "2A 00 C8"
    bench.wait(100 * SAMPLE)
    assert say(bench, "43 00 00") == "2A 00 64"
    bench.wait(1.0)
    assert say(bench, "41") == "2A 00 64"


def test_breakaway_in_the_loop() -> None:
    bench = looping(OFF, "2FSET LCV 1 LFBP 1", enter="2LOOP", firmware="4.4")
    bench.control("breakaway F2 300")
    say(bench, "63 10")
    bench.wait(400 * SAMPLE)
    say(bench, "63 00")
    assert say(bench, "41") == "2A 01 2C"


# -- time ---------------------------------------------------------------------------------------------------------------------


def rate(bench: Bench, ready_for_next: Callable[[int, int], bool], blocks: int = 100) -> float:
    """Blocks of §6.4 in a second; `ready_for_next(received, sent)` says when the next one may go."""
    bench.run()
    received = sent = 0
    start = bench.now
    while received < 8 * blocks:
        if sent < blocks and ready_for_next(received, sent):
            bench.line.feed(b"C\x00\x00")
            sent += 1
        event = bench.line.next_event()
        assert event is not None
        bench.now = event
        bench.line.advance(event)
        received += len(bench.line.take())
    return blocks / (bench.now - start)


@pytest.mark.parametrize(
    ("speed", "overlapped", "pipelined"), [(38400, 426.7, 480.0), (9600, 106.7, 120.0), (19200, 213.3, 240.0)]
)
def test_timing_floors(speed: int, overlapped: float, pipelined: float) -> None:
    """8 bit, no parity, 1 stop bit: the next block after the last byte of the answer, or after its '*'."""
    bench = _timed(speed)
    assert rate(bench, lambda received, sent: received == 8 * sent) == pytest.approx(overlapped, rel=0.002)
    bench = _timed(speed)
    # the first block costs its header
    assert rate(bench, lambda received, sent: received > 8 * sent - 8) == pytest.approx(pipelined, rel=0.01)


def _timed(speed: int) -> Bench:
    bench = ready(wire="auto", baud=speed)
    for command in EXAMPLE:
        bench.ask(command)
    bench.send("124LOOP\r")
    assert bench.run().endswith("*")
    return bench


def test_answer_begins_at_the_end_of_the_header() -> None:
    """9600: 1.0417 ms a byte; '*' one byte later, and the block acts when its last byte is in."""
    bench = ready(wire=9600)
    bench.ask(OFF)
    bench.ask("2FSET LCV 1 LFAP 1")
    bench.send("2LOOP\r")
    assert bench.run().endswith("*")
    begin = bench.now
    bench.line.feed(b"C\x10")
    times = []
    while (event := bench.line.next_event()) is not None:
        bench.now = event
        bench.line.advance(event)
        times += [round((event - begin) * 960, 6)] * len(bench.line.take())
    assert times == [2.0, 3.0, 4.0]
    bench.now = begin + 2 / 960 + 100 * SAMPLE
    bench.line.advance(bench.now)
    assert bench.control("motors").split(", ")[1].startswith("F2 P 100 ")


# -- faults --------------------------------------------------------------------------------------------------------------------

SOUND = "2A 70 00 77 00 00 01 9C"


@each_row(
    ("options", "answer"),
    [
        ({"fault": "healthy"}, SOUND),
        ({"fault": "loop-error"}, "0A 0D 45 52 52 20 31 0A 0D 3D 3E 20"),
        ({"fault": "loop-error", "loop_code": 8194}, "0A 0D 45 52 52 20 38 31 39 34 0A 0D 3D 3E 20"),
        ({"fault": "loop-silent"}, ""),
        ({"fault": "loop-drop"}, "2A 70 00 77 00 01 9C"),
        ({"fault": "loop-extra"}, SOUND + " 2A"),
        ({"fault": "silent", "after": 4}, ""),
        ({"fault": "deaf", "after": 4}, ""),
        ({"fault": "bad-checksum", "after": 4}, "2A 70 00 77 80 00 01 9C"),
        ({"fault": "duplicate", "after": 4}, SOUND + " " + SOUND),
        ({"fault": "stale", "after": 4}, "2A " + SOUND),
        ({"fault": "dribble", "after": 4}, SOUND),
        ({"fault": "split", "after": 4}, SOUND),
        ({"fault": "late", "after": 4}, SOUND),
        ({"fault": "slow", "after": 4}, SOUND),
        ({"fault": "disconnect", "after": 4}, "2A 70 00 77"),
        ({"fault": "wrong-id", "after": 4}, SOUND),
        ({"fault": "refuse", "after": 4}, SOUND),
    ],
)
def test_faults(options: dict[str, object], answer: str) -> None:
    """After the 3 lines of §6.4 and LOOP."""
    bench = example(**options)
    assert settle(bench, "41") == answer
    assert bench.line.hung_up is (options["fault"] == "disconnect")


def test_times_of_late_and_dribble() -> None:
    for fault, times in (("late", [0.6]), ("slow", [0.02]), ("dribble", [0.003, 0.024])):
        bench = example(fault=fault, after=4)
        say(bench, "41")
        events = []
        while (event := bench.line.next_event()) is not None:
            bench.now = event
            bench.line.advance(event)
            if bench.line.take():
                events.append(round(event, 6))
        assert [events[0], events[-1]][: len(times)] == times, fault


def test_noise_and_truncation() -> None:
    answer = bytes.fromhex(settle(example(fault="noise", after=4), "41"))
    assert bytes.fromhex(SOUND) in answer and len(answer) > 9
    short = settle(example(fault="truncate", after=4, seed=2), "41")
    assert SOUND.startswith(short) and len(short) < len(SOUND)


def test_deaf_hand_loses_the_whole_block() -> None:
    """Its data are not headers."""
    bench = example(fault="deaf", after=4, every=2)
    assert say(bench, "41") == SOUND
    assert say(bench, "43 10 41") == ""
    assert say(bench, "41") == SOUND
    assert "moving" not in bench.control("motors")


def test_spared_blocks() -> None:
    bench = example(fault="loop-silent", loop_after=2)
    assert say(bench, "63 10 00") == "2A"
    assert say(bench, "41") == SOUND
    assert say(bench, "41") == ""
    bench.control("fault none")
    assert say(bench, "03 0D 41") == ""
    assert "F1 P 0 S 0 SG 112 power on moving" in bench.control("motors")
    bench.control("power-cycle")
    assert "Firmware" in bench.run()


def test_control_data_behind_an_error_are_typed_at_the_prompt() -> None:
    bench = example(fault="loop-error")
    assert say(bench, "43 14 50") == "0A 0D 45 52 52 20 31 0A 0D 3D 3E 20 14 50"


def test_wrong_speed() -> None:
    """The client hears framing errors, the hand a header that is none."""
    bench = example()
    bench.line.client_baud = 9600
    assert say(bench, "41") == SOUND
    bench.line.client_baud = 19200
    assert say(bench, "41") != SOUND
    bench.line.client_baud = 9600
    assert bench.ask("VERS") == ["4.33"]  # the garbled header has ended the loop


def test_state_of_a_loop_is_a_standstill(tmp_path: Path) -> None:
    path = tmp_path / "hand.json"
    bench = looping(OFF, "2FSET LCV 1", enter="2LOOP", state=path)
    say(bench, "63 10")
    bench.wait(500 * SAMPLE)
    bench.line.close()
    state = json.loads(path.read_text())
    assert (state["motors"][1]["place"], state["motors"][1]["reported"]) == (550.0, 0)
    again = Bench(state=path)
    assert again.get("P", "2") == ["500"]


@each_row(
    ("options", "complaint"),
    [
        ({"loop-jump": "1,2,3"}, "option loop-jump=1,2,3: not 4 numbers, such as 0,0,0,0"),
        ({"loop-jump": "1,2,3,x"}, "option loop-jump=x: not a whole number"),
        ({"loop-exit": "hold"}, "option loop-exit=hold: not one of run, stop"),
        ({"loop-code": "0"}, "option loop-code=0: out of range 1 to 32767"),
        ({"no-load": "1,2,256"}, "option no-load=256: out of range 0 to 255"),
        ({"lfv-unit": "s"}, "option lfv-unit=s: not one of sample, 10ms"),
    ],
)
def test_option_complaints(options: dict[str, str], complaint: str) -> None:
    with pytest.raises(ValueError) as caught:
        Bench(**options)
    assert str(caught.value).startswith(complaint)


def test_jumps_end_somewhere(tmp_path: Path) -> None:
    """The state file stays readable."""
    path = tmp_path / "hand.json"
    bench = ready(state=path)
    for _ in range(5):
        bench.control("jump all 30000")
    assert bench.get("P") == ["59950 59950 59950 60000"]
    bench.line.close()
    assert Bench(state=path).get("P", "S") == ["60000"]
