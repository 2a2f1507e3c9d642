"""The simulated BarrettHand moves: profiles, ends of movements, strain, heat, on virtual time. Sections: barrett manual.

Counts and times are literals worked out from §5.3 and §9.2: at the default SAMPLE a sample is 16 * 32 / 2 MHz = 256 µs,
a finger runs at 100 / 16 = 6.25 counts a sample and changes speed by 4 / 256 counts a sample each sample.
"""

from __future__ import annotations

import pytest

from tests.sim.barrett_bench import Bench, ready
from tests.support.each_row import each_row


def positions(bench: Bench) -> list[int]:
    return [int(text) for text in bench.get("P")[0].split()]


def motors(bench: Bench) -> list[str]:
    return bench.control("motors").split(", ")


# -- time -----------------------------------------------------------------------------------------------------------------


@each_row(
    ("preparations", "command", "seconds"),
    [
        ([], "GM 17500", 3200 * 256e-6),
        ([], "GC", 3120 * 256e-6),
        ([], "SC", 1320 * 256e-6),
        ([], "C", 3120 * 256e-6),  # the slowest motor counts
        ([], "1M 2500", 800 * 256e-6),  # just a triangle: 2500 = v²/a
        ([], "1M 400", 2 * 160 * 256e-6),  # triangle: 2 * sqrt(400 / (1/64))
        ([], "1M 0", 0.0),
        ([], "GHOME", 0.0),
        (["GFSET MCV 200"], "GC", (17000 / 12.5 + 12.5 * 64) * 256e-6),
        (["GFSET MOV 200"], "GC", 3120 * 256e-6),
        (["GFSET ACCEL 8"], "GC", (17000 / 6.25 + 6.25 * 32) * 256e-6),
        (["GFSET SAMPLE 63"], "GC", 3120 * 512e-6),
        (["GC"], "GO", 3120 * 256e-6),
        (["GC", "GFSET MOV 50"], "GO", (17000 / 3.125 + 3.125 * 64) * 256e-6),
        (["GC", "GFSET MCV 50"], "GO", 3120 * 256e-6),
        (["GC"], "GHOME", 3120 * 256e-6),
        ([], "1IC", (2 * (1700 * 64) ** 0.5) * 256e-6),
        ([], "1M", (8500 / 6.25 + 400) * 256e-6),
        (["1M 5000"], "1IO 2500", 800 * 256e-6),
    ],
)
def test_trapezoid_takes_its_time(preparations: list[str], command: str, seconds: float) -> None:
    bench = ready()
    for preparation in preparations:
        bench.ask(preparation)
    assert bench.seconds(command) == pytest.approx(seconds, abs=1e-9)


def test_other_clock() -> None:
    """1.25 MHz instead of 2.00 (§5.3.4, §9.1)."""
    assert ready(hctl_clock="1.25").seconds("GM 17500") == pytest.approx(3200 * 409.6e-6, abs=1e-9)


@each_row(
    ("samples", "place"),
    [
        (0, 0.0),
        (100, 100**2 / 128),
        (400, 1250.0),
        (1000, 1250 + 600 * 6.25),
        (2720, 1250 + 2320 * 6.25),
        (3020, 17000 - 100**2 / 128),
        (3119, 17000 - 1 / 128),
    ],
)
def test_profile_on_the_way(samples: int, place: float) -> None:
    """The joint is where the trapezoid says at each moment; ^C shows it (§9.2.1)."""
    bench = ready()
    bench.send("1C\r")
    bench.wait(samples * 256e-6)
    assert bench.send("\x03").endswith("ERR 16384\n\r=> ")
    assert positions(bench)[0] == round(place)


@each_row(("command", "name"), [("TC", "MCV"), ("TO", "MOV")])
def test_velocity_control(command: str, name: str) -> None:
    """§9.2.2, §8: no ramps, no goal, each finger a little different, until the stops; 30 ms more (§5.5 case 1)."""
    bench = ready()
    if command == "TO":
        bench.ask("GM 17000")
    bench.ask(f"1FSET {name} 80")
    way = 17791 if command == "TC" else 17050
    assert bench.seconds("1" + command) == pytest.approx(way / (5 * 0.97) * 256e-6 + 0.030, abs=1e-9)
    assert bench.seconds("2" + command) == pytest.approx(
        (way + 21 * (command == "TC")) / 6.25 * 256e-6 + 0.03, abs=1e-9
    )
    assert positions(bench) == ([17791, 17812, 0, 0] if command == "TC" else [-50, -50, 17000, 0])


# -- HI -------------------------------------------------------------------------------------------------------------------


def test_hi_finds_the_stop_and_the_origin() -> None:
    """§5.2.1, §5.3.4: IVEL to the stop, IHIT more hits, IOFF back; 0.5 s are the alignment of the motor."""
    bench = Bench()
    step = 256e-6 / 18.75  # s per count at IVEL 300
    expected = 3113 * step + 0.03 + 0.5 + 2 * (400 * step + 0.03) + 50 * step
    assert bench.seconds("HI") == pytest.approx(expected, abs=1e-9)
    assert bench.get("P S") == ["0 0 0 0", "0 0 0 0"]


@each_row(
    ("setting", "more"),
    [
        ("IHIT 3", 400 * 256e-6 / 18.75 + 0.03),
        ("IHIT 0", -2 * (400 * 256e-6 / 18.75 + 0.03)),
        ("IOFF 500", 450 * 256e-6 / 18.75),
        ("TSTOP 60", 3 * 0.03),
        ("MOV 16", 0.0),
    ],
)
def test_hi_depends_on(setting: str, more: float) -> None:
    usual, other = Bench(), Bench()
    other.ask(f"3FSET {setting}")
    assert other.seconds("3HI") - usual.seconds("3HI") == pytest.approx(more, abs=1e-9)


def test_hi_without_a_way_takes_its_offset_for_the_origin() -> None:
    """After a jam the origin is wrong, and so is every position from then on."""
    bench = Bench()
    bench.control("block F1")
    bench.ask("1HI")
    bench.control("release F1")
    assert bench.get("P", "1") == ["0"]
    assert bench.ask("1M 17000") == ["ERR 16"]
    assert positions(bench)[0] == 17841 - 1071
    bench.ask("1HI")
    assert bench.ask("1M 17000") == []


def test_abort_of_hi_leaves_the_hand_without_initialization() -> None:
    bench = ready()
    bench.send("GHI\r")
    bench.wait(0.2)
    assert bench.send("\x03") == "\n\rERR 16384\n\r=> "
    assert bench.get("S") == ["16388 16388 16388 0"]
    assert bench.ask("GC") == ["ERR 4"]


# -- how movements end, §5.5 ---------------------------------------------------------------------------------------------------


@each_row(
    ("command", "answer"),
    [
        ("1M 15000", ["ERR 16"]),
        ("1IC 15000", ["ERR 16"]),
        ("1C", []),
        ("1TC", []),
    ],
)
def test_stall_at_an_obstacle(command: str, answer: list[str]) -> None:
    """Case 1: TSTOP more, motor off, 16 for position commands alone; the strain shows it."""
    bench = ready()
    bench.control("obstacle F1 9000")
    start = bench.now
    assert bench.ask(command) == answer
    assert bench.get("P SG S", "1") == ["9300", "172", "16" if answer else "0"]
    speed = 6.25 * (0.97 if command == "1TC" else 1.0)
    ramp = 0 if command == "1TC" else 200
    assert bench.now - start == pytest.approx((9300 / speed + ramp) * 256e-6 + 0.03, abs=1e-9)
    assert motors(bench)[0].endswith("power off")


def test_tip_force_follows_speed_and_gain() -> None:
    """§9.3.1 Figure 25, §9.3.2: MCV and FPG."""
    strains = []
    for setting in ("MCV 100", "MCV 50", "FPG 5", "MCV 4080"):
        bench = ready()
        bench.control("obstacle F2 9000")
        bench.ask(f"2FSET {setting}")
        bench.ask("2TC")
        strains += bench.get("SG", "2")
    assert strains == ["179", "149", "149", "239"]


@each_row("name", ["M 20000", "IC 20000"])
def test_goal_beyond_the_stop(name: str) -> None:
    """§5.3.2: the joint stops bound the range, and differ from finger to finger."""
    bench = ready()
    assert bench.ask(name) == ["ERR 16"]
    assert bench.get("P S") == ["17791 17812 17833 3158", "16 16 16 16"]


def test_opening_beyond_the_stop() -> None:
    bench = ready()
    bench.ask("M 100")
    assert bench.ask("GIO 500") == ["ERR 16"]
    assert positions(bench) == [-50, -50, -50, 100]
    assert bench.ask("IO 0") == []
    assert bench.ask("GIO 50") == []  # within MPE


@each_row(
    ("sign", "shown", "word", "delta"),
    [("signed", "-300", "FE D4", "80"), ("unsigned", "65236", "FE D4", "80"), ("clamped", "0", "00 00", "00")],
)
def test_a_position_below_0(sign: str, shown: str, word: str, delta: str) -> None:
    """§5.3.4 IOFF: the origin is that far from the open stop, where TO ends. How it is printed is not known."""
    bench = Bench(position_sign=sign)
    bench.ask("1FSET IOFF 300 LCV 0 LCPG 0 LFV 0 LFS 0")
    bench.ask("HI")
    bench.get("P", "1")
    assert bench.ask("1TO") == []
    bench.send("1LOOP\r")
    bench.line.feed(b"A")
    assert bench.line.take().hex(" ").upper() == f"2A {word} {delta}"
    bench.send("\x03")
    assert bench.get("P", "1") == [shown]


@each_row(("mpe", "answer"), [(790, ["ERR 16"]), (791, []), (792, [])])
def test_maximum_position_error(mpe: int, answer: list[str]) -> None:
    """§5.3.4 MPE: the stop of F1 is at 17791, the goal 791 counts beyond it."""
    bench = ready()
    bench.ask(f"1FSET MPE {mpe}")
    assert bench.ask("1M 18582") == answer


@each_row("milliseconds", [0, 30, 500, 65535])
def test_stop_time(milliseconds: int) -> None:
    """TSTOP in ms (§5.3.4, §5.5 case 1)."""
    bench = ready()
    bench.ask(f"1FSET TSTOP {milliseconds}")
    bench.control("block F1")
    assert bench.seconds("1C") == pytest.approx(milliseconds / 1000, abs=1e-9)


def test_no_acceleration_no_movement() -> None:
    bench = ready()
    bench.ask("1FSET ACCEL 0")
    assert bench.ask("1M 1000") == ["ERR 16"]
    assert bench.ask("1C") == []
    assert positions(bench)[0] == 0


@each_row("name", ["HSG", "MSG"])
def test_strain_limit_ends_at_once(name: str) -> None:
    """Case 2: SG above HSG, which MSG is another name of; no TSTOP. 112 without load, 0.2 a count."""
    bench = ready()
    bench.control("obstacle F1 9000")
    bench.ask(f"1FSET {name} 131")
    start = bench.now
    assert bench.ask("1M 17000") == ["ERR 16"]
    assert bench.get("P SG S", "1") == ["9100", "132", "16"]
    assert bench.now - start == pytest.approx((9100 / 6.25 + 200) * 256e-6, abs=1e-9)
    assert bench.ask("1C") == []
    assert bench.get("P", "1") == ["9100"], "already past the limit: it does not move"
    assert bench.ask("1O") == []
    assert bench.get("P", "1") == ["9100"], "not even open (§8: finger sticks)"
    bench.ask("1FSET HSG 255")
    bench.ask("1O")
    assert bench.get("P SG", "1") == ["0", "112"]


@each_row(("limit", "place"), [(254, 17000), (255, 17000), (256, 17000), (112, 17000), (111, 0)])
def test_strain_limit_without_load(limit: int, place: int) -> None:
    """Strain of F1 is 112; 255 and 256 mean no check (§5.3.1)."""
    bench = ready()
    bench.ask(f"1FSET HSG {limit}")
    bench.ask("1C")
    assert positions(bench)[0] == place


@each_row(("limit", "place"), [(0, 17000), (112, 17000), (113, 0), (254, 0), (255, 17000)])
def test_low_strain_limit(limit: int, place: int) -> None:
    bench = ready()
    bench.ask(f"1FSET LSG {limit}")
    bench.ask("1C")
    assert positions(bench)[0] == place


def test_low_limit_ends_the_opening() -> None:
    """The strain falls below LSG where the finger leaves the object."""
    bench = ready()
    bench.control("obstacle F1 9000")
    bench.ask("1C")
    bench.ask("1FSET LSG 122")
    assert bench.ask("1O") == []
    assert bench.get("P SG", "1") == ["9049", "121"]


def test_motor_without_gauge_reads_255_and_trips_any_limit() -> None:
    """§5.3.2, §8: that is why HSG must be 256 there."""
    bench = ready()
    bench.ask("SFSET HSG 200")
    assert bench.ask("SM 1000") == ["ERR 16"]
    assert bench.get("P SG", "S") == ["0", "255"]


def test_flipped_strain() -> None:
    """SGFLIP (§5.3.4): 255 - SG, and the limits change places with it."""
    bench = ready()
    bench.ask("1FSET SGFLIP 1 LSG 124")
    assert bench.get("SG") == ["143 119 126 255"]
    bench.control("obstacle F1 9000")
    bench.ask("1C")
    assert bench.get("P SG", "1") == ["9096", "123"]


def test_strain_from_outside() -> None:
    bench = ready()
    bench.ask("GFSET HSG 150")
    assert bench.send("GM 15000\r") == "GM 15000"
    bench.wait(0.3)
    bench.control("strain F2 151")
    assert bench.run() == "\n\rERR 16\n\r=> "
    place = round(1250 + (0.3 / 256e-6 - 400) * 6.25)
    assert bench.get("P S SG", "G") == [f"15000 {place} 15000", "0 16 0", "112 151 126"]
    bench.control("strain F2 off")
    assert bench.get("SG", "2") == ["119"]


@each_row("hold", [0, 1])
@each_row("end", ["goal", "stall", "strain", "abort"])
def test_hold(hold: int, end: str) -> None:
    """§5.5: after any of the four cases the motor is off or holds, by HOLD alone."""
    bench = ready()
    bench.ask(f"FSET HOLD {hold}")
    if end == "stall":
        bench.control("block all")
    elif end == "strain":
        bench.ask("FSET LSG 254")
        bench.control("strain all 5")
    bench.send("C\r")
    bench.wait(0.001)
    if end == "abort":
        bench.send("\x03")
    bench.run()
    assert {text.split(" power ")[1] for text in motors(bench)} == {"on" if hold else "off"}


def test_terminate_power() -> None:
    """T (§5.2.1): off even where it complains about others."""
    bench = Bench()
    bench.ask("FSET HOLD 1")
    bench.ask("13HI")
    assert [text.split(" power ")[1] for text in motors(bench)] == ["on", "off", "on", "off"]
    assert bench.ask("12T") == ["ERR 4"]
    assert [text.split(" power ")[1] for text in motors(bench)] == ["off", "off", "on", "off"]
    assert bench.ask("3T") == []


def test_enabled() -> None:
    """EN (§5.3.4): movements without prefix leave the others alone; with prefix, and FGET, it does not count."""
    bench = ready()
    bench.ask("2FSET EN 0")
    bench.ask("M 1000")
    assert positions(bench) == [1000, 0, 1000, 1000]
    bench.ask("2M 500")
    assert positions(bench) == [1000, 500, 1000, 1000]
    bench.ask("FSET EN 0 HOLD 1")
    assert bench.seconds("C") == 0.0
    bench.ask("SM 10")
    bench.ask("T")  # T acts on all four
    assert "power on" not in bench.control("motors")


def test_default_arguments() -> None:
    """DP and DS (§5.3.1)."""
    bench = ready()
    bench.ask("M")
    assert positions(bench) == [8500, 8500, 8500, 1575]
    bench.ask("IC")
    assert positions(bench) == [10200, 10200, 10200, 1890]
    bench.ask("2FSET DS 200 DP 7")
    bench.ask("IO")
    assert positions(bench) == [8500, 10000, 8500, 1575]
    bench.ask("2M")
    assert positions(bench) == [8500, 7, 8500, 1575]


def test_targets() -> None:
    """CT and OT (§5.3.4); C opens where the joint is beyond its target, and neither reports 16 (§5.2.1)."""
    bench = ready()
    bench.ask("FSET CT 900 OT 100")
    for command, place in (("C", 900), ("O", 100)):
        assert bench.ask(command) == []
        assert positions(bench) == [place] * 4
    bench.ask("M 2000")
    assert bench.ask("C") == []
    assert positions(bench) == [900] * 4


def test_all_four_motors_end_on_their_own() -> None:
    """The command is over with the last; what is done first is switched off first."""
    bench = ready()
    bench.send("C\r")
    bench.wait(0.4)
    assert [text.endswith("moving") for text in motors(bench)] == [True, True, True, False]
    assert bench.run() == "\n\r=> "


# -- ^C, type-ahead -----------------------------------------------------------------------------------------------------------


def test_only_the_abort_is_heard_while_it_moves() -> None:
    bench = ready()
    bench.send("GC\r")
    bench.wait(0.1)
    assert bench.send("FGET P\r") == ""
    assert bench.run() == "\n\r=> "
    assert positions(bench) == [17000, 17000, 17000, 0]


def test_abort_stops_all_motors_and_adds_to_the_sum() -> None:
    bench = Bench()
    bench.ask("12HI")
    bench.control("block F2")
    bench.send("GM 17000\r")
    bench.wait(0.4)
    assert bench.send("\x03") == "\n\rERR 16404\n\r=> "  # 16384 + 16 + 4
    assert bench.get("S", "G") == ["16384 16 4"]
    place = positions(bench)[0]
    assert 0 < place < 17000
    bench.wait(5.0)
    assert positions(bench)[0] == place
    assert bench.ask("1M 100") == []
    assert bench.get("S", "1") == ["0"]


def test_deaf_to_the_abort() -> None:
    bench = ready(fault="no-abort")
    bench.send("GC\r")
    bench.wait(0.1)
    assert bench.send("\x03") == ""
    assert bench.run() == "\n\r=> "


# -- what gets in the way -----------------------------------------------------------------------------------------------------


def test_block_and_release_in_the_middle() -> None:
    bench = ready()
    bench.send("1C\r")
    bench.wait(0.4)
    bench.control("block F1")
    start = bench.now
    assert bench.run() == "\n\r=> "
    assert bench.now - start == pytest.approx(0.03, abs=1e-9)
    assert 8000 < positions(bench)[0] < 9000
    bench.control("release F1")
    bench.ask("1C")
    assert positions(bench)[0] == 17000


def test_obstacle_that_appears_in_the_middle() -> None:
    bench = ready()
    bench.send("1C\r")
    bench.wait(0.1)
    bench.control("obstacle F1 12000")
    bench.run()
    assert positions(bench)[0] == 12300


def test_breakaway_is_seen_from_4_34_on() -> None:
    """§9.3.1, §9.5: BD and BP; opening forgets them, BS stops there."""
    bench = ready(firmware="4.34")
    bench.control("breakaway F2 6000")
    assert bench.get("BD BP") == ["0 0 0 0", "0 0 0 0"]
    bench.ask("GC")
    assert bench.get("P BD BP", "G") == ["17000 17000 17000", "0 1 0", "0 6000 0"]
    bench.ask("GM 0")
    assert bench.get("BD BP", "2") == ["1", "6000"]
    bench.ask("GO")
    assert bench.get("BD BP", "2") == ["0", "0"]
    bench.ask("2FSET BS 1")
    assert bench.ask("2M 17000") == ["ERR 16"]
    assert bench.get("P BD BP", "2") == ["6000", "1", "6000"]


def test_spread_yields_without_power_and_fingers_do_not() -> None:
    """§2, §9.3.2: back-drivable, and HOLD 1 keeps it (§5.3.4)."""
    bench = ready()
    assert bench.control("push S 700") == "push S 700"
    assert positions(bench) == [0, 0, 0, 700]
    with pytest.raises(ValueError, match="F1 cannot be pushed"):
        bench.control("push F1 700")
    bench.ask("SC")
    with pytest.raises(ValueError, match="S cannot be pushed"):
        bench.control("push S 700")
    bench.ask("ST")
    bench.control("push S 1500")
    assert positions(bench)[3] == 1500


def test_reversed_finger() -> None:
    """§8: moves the wrong way."""
    bench = ready()
    bench.ask("GM 3000")
    bench.control("fault reversed")
    assert bench.ask("GIC 200") == ["ERR 16"]
    assert positions(bench) == [2800, 3200, 3200, 0]


# -- odometer, heat -------------------------------------------------------------------------------------------------------------


def test_odometer_counts_every_way() -> None:
    """§5.3.2: in thousands of counts; all motors start in the middle of one."""
    bench = ready()
    for _ in range(3):
        bench.ask("GM 2000")
        bench.ask("GM 0")
    assert bench.get("OD") == ["104245 98724 110015 20117"]
    bench.send("1C\r")
    bench.wait(0.4)
    bench.send("\x03")
    assert bench.get("OD", "1") == ["104253"]  # 8515.6 more


def test_odometer_counts_initialization() -> None:
    """To the stop, 20 hits of 2 * 200 counts, and the offset."""
    bench = Bench()
    bench.ask("1FSET IHIT 20 IOFF 900")
    bench.ask("1HI")
    assert bench.get("OD", "1") == ["104242"]  # 104233.0 + (1071 + 8000 + 900) / 1000


def test_temperature_rises_with_work_and_falls_again() -> None:
    bench = ready()
    assert bench.ask("PGET TEMP PTEMP") == ["412", "573"]
    bench.ask("GFSET TSTOP 30000")
    bench.control("block all")
    bench.ask("GC")
    heated = int(bench.ask("PGET TEMP")[0])
    assert 500 < heated < 800
    assert bench.ask("PGET PTEMP") == [str(max(573, heated))]
    bench.wait(600.0)
    assert bench.ask("PGET TEMP") == ["412"]


def test_longer_stop_time_heats_more() -> None:
    """§5.3.4 TSTOP: above 30 the motors heat quickly."""
    risen = []
    for tstop in (30, 60, 300):
        bench = ready(otemp_stops="movements")
        bench.ask(f"FSET TSTOP {tstop} MCV 16")
        bench.ask("1C")
        risen.append(int(bench.ask("PGET TEMP")[0]) - 412)
    assert 0 < risen[0] < risen[1] < risen[2]


def test_over_temperature_stops_every_motor_command() -> None:
    """§5.4.1: above OTEMP, not at it; 0 is off; PSET still works."""
    bench = ready()
    bench.control("temperature 600")
    for limit, answer in ((0, []), (600, []), (599, ["ERR 8192"]), (60, ["ERR 8192"]), (1250, [])):
        assert bench.ask(f"PSET OTEMP {limit}") == []
        assert bench.ask("GM 10") == answer
        assert bench.ask("FGET P") == (answer or ["10 10 10 0"])


@each_row("command", ["C", "HI", "HOME", "IC", "IO", "M", "O", "T", "TC", "TO", "LOOP", "FGET P", "FSET DP 1", "FLOAD"])
def test_which_commands_heat_stops(command: str) -> None:
    movement = command not in ("FGET P", "FSET DP 1", "FLOAD")
    assert ready(fault="over-temperature").ask(command) == ["ERR 8192"]
    answer = ready(fault="over-temperature", otemp_stops="movements").ask(command)
    assert (answer == ["ERR 8192"]) is movement


def test_terminate_power_works_above_the_limit() -> None:
    bench = ready()
    bench.ask("SM 100")
    bench.control("fault over-temperature")
    assert bench.ask("ST") == ["ERR 8192"]
    assert "power on" not in bench.control("motors")


def test_trip_in_the_middle_of_a_movement() -> None:
    bench = ready()
    bench.ask("PSET OTEMP 430")
    bench.ask("FSET TSTOP 60000")
    bench.control("block all")
    bench.send("GC\r")
    assert bench.run() == "\n\rERR 8192\n\r=> "
    assert 1.0 < bench.now < 59.0
    assert bench.ask("PGET TEMP") == ["431"]
    bench.ask("PSET OTEMP 0")
    assert bench.get("S", "G") == ["8192 8192 8192"]
