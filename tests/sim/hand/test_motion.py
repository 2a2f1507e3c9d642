"""How the fingers of a simulated RH56 hand move, what stops them, and what that does to them. Virtual time throughout."""

from __future__ import annotations

from tests.sim.hand.bench import Bench, write
from tests.support.each_row import each_row

STROKE, ANGLE, FORCE, CURRENT, ERROR, STATUS, TEMPERATURE = 1534, 1546, 1582, 1594, 1606, 1612, 1618
ANGLE_SET, FORCE_SET, SPEED_SET = 1486, 1498, 1522
DEAD_TIME = 0.066
INDEX = 3  # at 440 when it is found


def hand(model: str = "df", **options: object) -> Bench:
    return Bench(model=model, refresh=0, **options)


def tell(bench: Bench, first: int, *values: int) -> None:
    assert bench.ask(write(first, *values)) != ""


def test_nothing_moves_until_it_is_told() -> None:
    bench = hand()
    bench.wait(10.0)
    assert bench.words(ANGLE) == [110, 220, 330, 440, 550, 660]
    assert bench.acts() == {}


@each_row(("model", "full"), [("df", 0.8), ("tp", 0.6)])
def test_full_stroke_takes_its_time_at_full_speed(model: str, full: float) -> None:
    bench = hand(model)
    tell(bench, SPEED_SET, *[1000] * 6)
    tell(bench, ANGLE_SET, *[0] * 6)
    bench.wait(3.0)
    assert bench.words(ANGLE) == [0] * 6
    assert bench.words(STROKE) == [2000] * 6
    tell(bench, ANGLE_SET, *[1000] * 6)
    bench.wait(DEAD_TIME - 0.01 + full / 2)
    assert bench.words(ANGLE) == [500] * 6
    assert bench.words(STROKE) == [1000] * 6
    assert bench.bytes_at(STATUS) == [0] * 6, "opening"
    assert all(value > 120 for value in bench.words(CURRENT))
    bench.wait(full / 2)
    assert bench.words(ANGLE) == [1000] * 6
    assert bench.bytes_at(STATUS) == [2] * 6
    assert bench.words(CURRENT) == [21, -22, 23, 24, 25, 26]


def test_dead_time_and_speed_that_was_left() -> None:
    """The speed of the index finger is 604, as somebody left it."""
    bench = hand()
    tell(bench, ANGLE_SET + 2 * INDEX, 40)
    assert bench.words(ANGLE)[INDEX] == 440
    bench.wait(DEAD_TIME - 0.011)
    assert bench.words(ANGLE)[INDEX] == 440
    assert bench.bytes_at(STATUS)[INDEX] == 3
    bench.wait(0.101)
    assert bench.words(ANGLE)[INDEX] == round(440 - 0.1 * 1250 * 0.604)
    assert bench.bytes_at(STATUS)[INDEX] == 1, "closing"
    assert bench.words(ANGLE)[:INDEX] == [110, 220, 330], "the others stay"


def test_minus_one_leaves_a_finger() -> None:
    bench = hand()
    tell(bench, ANGLE_SET, -1, -1, -1, 300, -1, -1)
    bench.wait(3.0)
    assert bench.words(ANGLE) == [110, 220, 330, 300, 550, 660]
    assert bench.acts() == {"move": 1}


def test_a_stroke_moves_too() -> None:
    bench = hand()
    tell(bench, 1474 + 2 * INDEX, 2000)
    bench.wait(3.0)
    assert bench.words(ANGLE)[INDEX] == 0


def test_speed_0_stops_and_a_speed_lets_it_go_on() -> None:
    bench = hand(speed=100)
    tell(bench, ANGLE_SET, *[1000] * 6)
    bench.wait(1.0)
    tell(bench, SPEED_SET, *[0] * 6)
    stopped = bench.words(ANGLE)
    assert 110 < stopped[0] < 1000
    bench.wait(5.0)
    assert bench.words(ANGLE) == stopped
    tell(bench, SPEED_SET, *[1000] * 6)
    bench.wait(2.0)
    assert bench.words(ANGLE) == [1000] * 6


def test_a_hand_left_at_speed_0_looks_dead() -> None:
    bench = hand(speed=0)
    tell(bench, ANGLE_SET, *[1000] * 6)
    bench.wait(5.0)
    assert bench.words(ANGLE) == [110, 220, 330, 440, 550, 660]
    assert bench.bytes_at(ERROR) == [0] * 6


@each_row(("speed", "grams"), [(25, 400), (1000, 400 + 3354)])
def test_stops_at_its_force_limit_and_beyond_when_it_is_fast(speed: int, grams: int) -> None:
    bench = hand("tp", object=900, speed=speed)
    tell(bench, ANGLE_SET, *[1000] * 6)
    bench.wait(60.0)
    tell(bench, FORCE_SET, *[400] * 6)
    tell(bench, ANGLE_SET, *[0] * 6)
    bench.wait(40.0)
    assert bench.bytes_at(STATUS) == [3] * 6
    assert bench.bytes_at(ERROR) == [0] * 6
    for force, rest in zip(bench.words(FORCE), (-11, 12, -13, 14, -15, 16), strict=True):
        assert abs(force - rest - grams) <= 1
    assert bench.words(ANGLE) == [round(900 - grams / 20)] * 6


def test_a_higher_limit_and_a_command_close_further() -> None:
    bench = hand("tp", object=900, speed=25)
    tell(bench, ANGLE_SET, *[950] * 6)
    bench.wait(60.0)
    tell(bench, FORCE_SET, *[100] * 6)
    tell(bench, ANGLE_SET, *[0] * 6)
    bench.wait(10.0)
    assert bench.words(ANGLE) == [895] * 6
    tell(bench, FORCE_SET, *[200] * 6)
    bench.wait(10.0)
    assert bench.words(ANGLE) == [895] * 6
    tell(bench, ANGLE_SET, *[0] * 6)
    bench.wait(10.0)
    assert bench.words(ANGLE) == [890] * 6
    tell(bench, ANGLE_SET, *[950] * 6)
    bench.wait(10.0)
    assert bench.words(ANGLE) == [950] * 6
    assert bench.bytes_at(STATUS) == [2] * 6


def test_force_deaf() -> None:
    """At its limit a finger took no command until the limit was another one (SMO)."""
    bench = hand("tp", object=900, speed=25, fault="force-deaf")
    tell(bench, ANGLE_SET, *[950] * 6)
    bench.wait(60.0)
    tell(bench, FORCE_SET, *[100] * 6)
    tell(bench, ANGLE_SET, *[0] * 6)
    bench.wait(10.0)
    tell(bench, ANGLE_SET, *[1000] * 6)
    bench.wait(10.0)
    assert bench.words(ANGLE) == [895] * 6
    tell(bench, FORCE_SET, *[101] * 6)
    tell(bench, ANGLE_SET, *[1000] * 6)
    bench.wait(10.0)
    assert bench.words(ANGLE) == [1000] * 6


def test_something_soft_that_gives_way_is_no_force_limit() -> None:
    bench = hand("tp", object=500, speed=25)
    tell(bench, ANGLE_SET + 2, 510)
    bench.wait(20.0)
    tell(bench, FORCE_SET, *[3000] * 6)
    tell(bench, ANGLE_SET + 2, 480)
    bench.wait(20.0)
    assert bench.words(ANGLE)[1] == 480
    assert bench.bytes_at(STATUS)[1] == 2
    assert bench.words(FORCE)[1] == 12 + 400


def test_an_obstacle_locks_the_rotor() -> None:
    bench = hand(fault="blocked")
    tell(bench, ANGLE_SET, *[1000] * 6)
    bench.wait(DEAD_TIME + 0.2)
    assert bench.words(ANGLE) == [110, 220, 330, 440, 550, 660]
    assert all(value > 500 for value in bench.words(CURRENT))
    assert bench.bytes_at(ERROR) == [0] * 6
    bench.wait(0.2)
    assert bench.bytes_at(ERROR) == [1] * 6
    assert bench.bytes_at(STATUS) == [6] * 6
    bench.run("fault none")
    bench.wait(3.0)
    assert bench.words(ANGLE) == [110, 220, 330, 440, 550, 660], "an error keeps a finger still"
    tell(bench, ANGLE_SET, *[1000] * 6)
    bench.wait(3.0)
    assert bench.words(ANGLE) == [110, 220, 330, 440, 550, 660]
    bench.ask(write(1004, 1, size=1))
    assert bench.bytes_at(ERROR) == [0] * 6
    tell(bench, ANGLE_SET, *[1000] * 6)
    bench.wait(3.0)
    assert bench.words(ANGLE) == [1000] * 6


def test_current_limit_protects_before_the_rotor_is_locked() -> None:
    bench = hand()
    bench.run("block index")
    tell(bench, 1020 + 2 * INDEX, 300)
    tell(bench, ANGLE_SET + 2 * INDEX, 0)
    bench.wait(1.0)
    assert bench.bytes_at(ERROR) == [0, 0, 0, 4, 0, 0]
    assert bench.bytes_at(STATUS)[INDEX] == 5


def test_load_warms_and_too_much_of_it_is_an_error_that_only_cooling_ends() -> None:
    bench = hand("tp", object=900, speed=1000)
    tell(bench, ANGLE_SET, *[1000] * 6)
    bench.wait(5.0)
    before = bench.bytes_at(TEMPERATURE)
    tell(bench, FORCE_SET, *[2500] * 6)
    tell(bench, ANGLE_SET, *[0] * 6)
    bench.wait(20.0)
    after = bench.bytes_at(TEMPERATURE)
    assert all(late > early + 10 for early, late in zip(before, after, strict=True))
    bench.wait(300.0)
    assert bench.bytes_at(ERROR) == [2] * 6
    assert bench.bytes_at(STATUS) == [7] * 6
    bench.ask(write(1004, 1, size=1))
    assert bench.bytes_at(ERROR) == [2] * 6
    for name in ("little", "ring", "middle", "index", "thumb_bend", "thumb_rotation"):
        bench.run(f"object {name} none")
    bench.wait(600.0)
    assert bench.bytes_at(ERROR) == [0] * 6


def test_readings_are_refreshed_at_33_hz() -> None:
    bench = Bench(model="df", speed=1000)
    bench.ask(write(ANGLE_SET, *[1000] * 6), 0.0)
    seen = set()
    for _ in range(400):
        bench.wait(0.001)
        seen.add(bytes(bench.hand.space.memory[ANGLE : ANGLE + 12]))
    assert 10 <= len(seen) <= 12, "0.334 s of movement at 0.0307 s each"


def test_a_finger_may_stop_short_without_a_word() -> None:
    bench = hand(fault="stops-short")
    tell(bench, ANGLE_SET, *[0] * 6)
    bench.wait(3.0)
    assert bench.words(ANGLE) == [0, 46, 0, 0, 0, 0]
    assert bench.bytes_at(STATUS) == [2] * 6


# -- touch ------------------------------------------------------------------------------------------------------------


def zones(bench: Bench) -> list[int]:
    return bench.words(3000, 1062)


def test_the_skin_feels_what_is_grasped() -> None:
    bench = hand("tp", object=800, speed=25, tactile="quiet")
    assert not any(zones(bench))
    tell(bench, ANGLE_SET, *[1000] * 6)
    bench.wait(60.0)
    tell(bench, FORCE_SET, *[600] * 6)
    tell(bench, ANGLE_SET, 0, -1, -1, -1, -1, -1)
    bench.wait(60.0)
    felt = zones(bench)
    tip, nail, pad = felt[:9], felt[9:105], felt[105:185]
    assert tip.index(max(tip)) == 4, "the middle of it"
    assert max(pad) > 0
    assert not any(nail)
    assert not any(felt[185:950]), "the other fingers touch nothing"
    assert any(felt[950:]), "the palm feels it"


def test_dead_and_saturated_zones() -> None:
    assert zones(hand("tp", fault="tactile-dead"))[370:379] == [0] * 9
    assert zones(hand("tp", fault="tactile-saturated"))[0] == -1


def test_touch_of_an_f1() -> None:
    bench = hand("f1", object=800)
    bench.ask(write(1040, 1740, 1740, 1740, 1740, 1400, 1800))
    bench.wait(10.0)
    before = bench.words(3000, 34)
    bench.ask(write(1040, -1, 900, -1, -1, -1, -1))
    bench.wait(10.0)
    after = bench.words(3000, 34)
    assert after[5] > before[5]
    assert after[:5] == before[:5]


# -- calibration, emergency stop, actions -------------------------------------------------------------------------------


def test_calibration_opens_closes_opens_and_zeroes() -> None:
    bench = hand()
    assert bench.ask(write(1009, 1, size=1), 0.0) != ""
    poses = []
    for _ in range(5):
        bench.wait(1.19)
        poses.append(bench.words(ANGLE))
    assert poses == [
        [1000] * 6,
        [0, 0, 0, 0, 1000, 1000],
        [1000] * 6,
        [1000, 1000, 1000, 1000, 0, 0],
        [1000] * 6,
    ]
    assert bench.wait(0.1) == "90 EB 01 04 11 02 00 00 18"
    assert bench.words(FORCE) == [0] * 6
    assert bench.acts() == {"calibrate": 1}


def test_a_hand_that_calibrates_takes_no_other_command() -> None:
    bench = hand()
    bench.ask(write(1009, 1, size=1), 0.0)
    bench.wait(0.5)
    tell(bench, ANGLE_SET, *[500] * 6)
    bench.wait(10.0)
    assert bench.words(ANGLE) == [1000] * 6


def test_a_calibration_that_stays_still() -> None:
    bench = hand("tp", calibration_moves=0)
    bench.ask(write(1009, 1, size=1), 0.0)
    bench.wait(6.1)
    assert bench.words(ANGLE) == [110, 220, 330, 440, 550, 660]
    assert bench.words(FORCE) == [0] * 6


@each_row(("model", "place", "status"), [("f1", 1131, 1088), ("dg2", 1301, 1192)])
def test_emergency_stop_of_the_new_generations(model: str, place: int, status: int) -> None:
    bench = hand(model)
    count = bench.hand.generation.count
    angle = bench.hand.space.place("angle") // 2
    tell(bench, bench.hand.space.place("angle-set") // 2, *[1800] * count)
    bench.wait(0.2)
    tell(bench, place, 1)
    stopped = bench.words(angle, count)
    assert bench.words(status, count) == [8] * count
    bench.wait(3.0)
    assert bench.words(angle, count) == stopped
    tell(bench, place, 0)
    bench.wait(3.0)
    assert bench.words(angle, count) == stopped
    assert bench.words(status, count) == [2] * count


def test_a_stored_action_moves_a_df_at_once() -> None:
    bench = hand()
    bench.ask(write(2322, 1, size=1))
    bench.wait(3.0)
    assert bench.words(ANGLE) == [500] * 6
    assert bench.acts() == {"run": 1}
    assert bench.bytes_at(2322, 1) == [0], "it clears itself"


@each_row(("options", "acts"), [({}, {"reserved": 1}), ({"gestures": 1}, {"reserved": 1, "gesture": 1})])
def test_1008_moves_with_older_firmware(options: dict[str, int], acts: dict[str, int]) -> None:
    bench = hand(**options)
    bench.ask(write(1008, 3, size=1))
    bench.wait(3.0)
    assert bench.acts() == acts
    assert (bench.words(ANGLE) == [500] * 6) == ("gestures" in options)


def test_full_stroke_of_an_f1_takes_a_second_at_speed_2000() -> None:
    bench = hand("f1")
    tell(bench, 1052, *[2000] * 6)
    tell(bench, 1040, 900, 900, 900, 900, 1100, 600)
    bench.wait(3.0)
    assert bench.words(1064) == [900, 900, 900, 900, 1100, 600]
    tell(bench, 1040, 1740, 1740, 1740, 1740, 1400, 1800)
    bench.wait(DEAD_TIME - 0.01 + 0.5)
    assert bench.words(1064) == [1320, 1320, 1320, 1320, 1250, 1200]
    bench.wait(0.5)
    assert bench.words(1064) == [1740, 1740, 1740, 1740, 1400, 1800]


def test_small_steps_of_time_give_the_same_as_one_jump() -> None:
    both = []
    for step in (0.0071, 4.0):
        bench = hand("tp", object=300, speed=700)
        tell(bench, ANGLE_SET, 0, 1000, 0, 500, 20, 900)
        while bench.now < 4.0:
            bench.wait(min(step, 4.0 - bench.now))
        both.append((bench.words(ANGLE), bench.words(STROKE), bench.bytes_at(STATUS), bench.bytes_at(TEMPERATURE)))
    assert both[0] == both[1]
