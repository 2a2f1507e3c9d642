"""Registers, flash, triggers and the open points of a simulated RH56 hand. Addresses are those of the dossier §3."""

from __future__ import annotations

from pathlib import Path

import pytest

from handctl.sim import create
from handctl.sim.hand.register_maps import GENERATIONS
from tests.sim.hand.bench import Bench, eb90, write
from tests.support.each_row import each_row

READ_ID = "EB 90 01 04 11 E8 03 01 02"
SAVE = write(1005, 1, size=1)
SAVED = "90 EB 01 04 11 ED 03 00 06"


def saved(bench: Bench, request: str = SAVE) -> str:
    """Saves; the result, without the acknowledgement."""
    assert bench.ask(request, 0.5) != ""
    return bench.wait(0.6)


# -- power, id, speed, IP address ---------------------------------------------------------------------------------------


def test_behind_a_power_on_nothing_was_commanded() -> None:
    bench = Bench(model="df")
    bench.line.power_cycle()
    assert bench.words(1486) == [-1] * 6
    assert bench.words(1474) == [-1] * 6
    assert bench.bytes_at(1612) == [255] * 6
    assert bench.words(1522) == bench.words(1032) == [701, 702, 703, 704, 705, 706]
    assert bench.words(1498) == bench.words(1044) == [501, 502, 503, 504, 505, 506]
    assert bench.words(1546) == [110, 220, 330, 440, 550, 660], "the fingers are where they were"
    bench.wait(5.0)
    assert bench.words(1546) == [110, 220, 330, 440, 550, 660]


def test_fresh() -> None:
    bench = Bench(model="df", fault="fresh")
    assert bench.words(1486) == [-1] * 6
    assert bench.bytes_at(1612) == [255] * 6
    assert bench.words(1522) == [500] * 6
    assert bench.words(1498) == [500, 500, 500, 500, 500, 259]


def test_id_acts_at_once_and_is_kept_by_a_save() -> None:
    bench = Bench(model="df")
    assert bench.ask(write(1000, 7, size=1)).startswith("90 EB 07")
    assert bench.ask(READ_ID) == ""
    assert bench.ask("EB 90 07 04 11 E8 03 01 08") == "90 EB 07 04 11 E8 03 07 0E"
    bench.line.power_cycle()
    assert bench.ask(READ_ID) != ""
    bench.ask(write(1000, 7, size=1))
    assert bench.ask("EB 90 07 04 12 ED 03 01 0E", 1.1).endswith("90 EB 07 04 11 ED 03 00 0C")
    bench.line.power_cycle()
    assert bench.ask(READ_ID) == ""


@each_row(("options", "number"), [({}, "07"), ({"ack_id": "old"}, "01")])
def test_who_acknowledges_an_id(options: dict[str, str], number: str) -> None:
    assert Bench(model="df", **options).ask(write(1000, 7, size=1)).startswith(f"90 EB {number}")


def test_speed_acts_behind_a_save_and_a_power_on() -> None:
    bench = Bench(model="df")
    bench.ask(write(1002, 1, size=1))
    assert bench.line.device.speed == 115200
    bench.line.power_cycle()
    assert bench.line.device.speed == 115200
    bench.ask(write(1002, 1, size=1))
    assert saved(bench) == SAVED
    assert bench.line.device.speed == 115200
    bench.line.power_cycle()
    assert bench.line.device.speed == 57600
    assert bench.acts() == {"baud": 2, "save": 1}


def test_921600_from_tp_on() -> None:
    assert Bench(model="tp", baud=921600).line.device.speed == 921600
    with pytest.raises(ValueError, match="baud=921600"):
        Bench(model="df", baud=921600)
    before = Bench(model="df")
    before.ask(write(1002, 3, size=1))
    assert before.bytes_at(1002, 1) == [0]


def test_speed_code_elsewhere_or_not_kept() -> None:
    bench = Bench(model="df", baud_register=1001)
    bench.ask(write(1002, 1, size=1))
    assert bench.bytes_at(1000, 3) == [1, 0, 0]
    bench.ask(write(1001, 1, size=1))
    assert bench.bytes_at(1000, 3) == [1, 1, 0]
    bench = Bench(model="tp", baud_kept=0)
    bench.ask(write(1002, 1, size=1))
    assert saved(bench) == SAVED
    bench.line.power_cycle()
    assert bench.line.device.speed == 115200


@each_row(
    ("options", "result"),
    [
        ({}, SAVED),
        ({"result_flag": 18}, "90 EB 01 04 12 ED 03 00 07"),
        ({"fault": "save-fails"}, "90 EB 01 04 11 ED 03 FF 05"),
        ({"fault": "no-late-frames"}, ""),
    ],
)
def test_result_of_a_save(options: dict[str, object], result: str) -> None:
    bench = Bench(model="df", **options)
    bench.ask(write(1032, 1, 2, 3, 4, 5, 6))
    assert saved(bench) == result
    bench.line.power_cycle()
    assert (bench.words(1032) == [1, 2, 3, 4, 5, 6]) == ("save-fails" not in options.values())


@each_row(
    ("options", "result"),
    [({}, "90 EB 01 04 11 EC 03 00 05"), ({"result_address": 1005}, "90 EB 01 04 11 ED 03 00 06")],
)
def test_result_of_a_save_of_an_f1(options: dict[str, object], result: str) -> None:
    assert saved(Bench(model="f1", **options), write(1004, 1)) == result


def test_set_values_that_a_save_keeps_in_one_edition() -> None:
    kept = []
    for option in (0, 1):
        bench = Bench(model="df", set_points_kept=option)
        bench.ask(write(1522, *[50] * 6))
        saved(bench)
        bench.line.power_cycle()
        kept.append(bench.words(1522)[0])
    assert kept == [701, 50]


@each_row(("option", "kept"), [("flash", False), ("ram", True)])
def test_factory_reset(option: str, kept: bool) -> None:
    bench = Bench(model="tp", reset=option, id=9, baud=57600, ip="10.0.0.9")
    bench.ask(eb90("12 EE 03 01", 9))
    assert bench.ask(READ_ID) != ""
    assert bench.words(1032) == [500] * 6
    assert bench.bytes_at(1700, 4) == [192, 168, 11, 210]
    assert bench.line.device.speed == 57600
    bench.line.power_cycle()
    assert (bench.line.device.speed, bench.run("ip")) == ((57600, "10.0.0.9") if kept else (115200, "192.168.11.210"))
    assert (bench.ask(READ_ID) == "") == kept


def test_ip_address_acts_behind_a_save_and_a_power_on() -> None:
    bench = Bench(model="tp", bus="modbus-tcp")
    ask = "00 01 00 00 00 06 FF 03 06 A4 00 02"
    assert bench.ask("00 0A 00 00 00 0B FF 10 06 A4 00 02 04 A8 C0 D3 0B") != ""
    assert bench.run("ip") == "192.168.11.210"
    bench.ask("00 0B 00 00 00 06 FF 06 03 ED 00 01")
    assert bench.ask(ask).endswith("A8 C0 D3 0B")
    bench.line.power_cycle()
    assert bench.run("ip") == "192.168.11.211"
    assert bench.ask(ask) == "", "nobody is at the old address"
    bench.line.reconnect()
    assert bench.ask(ask).endswith("A8 C0 D3 0B")


# -- what is written ----------------------------------------------------------------------------------------------------


def test_values_out_of_range_and_gaps() -> None:
    out = write(1486, 1001, -2, 500, -1, 1000, 0)
    ignored, stored, strict = (
        Bench(model="tp"),
        Bench(model="tp", out_of_range="stored"),
        Bench(model="tp", fault="strict"),
    )
    assert ignored.ask(out) == stored.ask(out) == "90 EB 01 04 12 CE 05 01 EB"
    assert strict.ask(out) == ""
    assert ignored.words(1486) == [-1, -1, 500, -1, 1000, 0]
    assert stored.words(1486) == [1001, -2, 500, -1, 1000, 0]
    assert strict.words(1486) == [-1] * 6
    for bench in (ignored, stored, strict):
        bench.wait(5.0)
        assert all(0 <= angle <= 1000 for angle in bench.words(1546))
    assert ignored.ask(write(1056, 1)) != "", "a gap is acknowledged"
    assert strict.ask(write(1056, 1)) == ""


@each_row(("option", "shown"), [("stored", [-1] * 6), ("kept", [300] * 6)])
def test_minus_one(option: str, shown: list[int]) -> None:
    bench = Bench(model="tp", minus_one=option)
    bench.ask(write(1486, *[300] * 6))
    bench.ask(write(1486, *[-1] * 6))
    assert bench.words(1486) == shown
    bench.wait(5.0)
    assert bench.words(1546) == [300] * 6, "it goes on"


def test_undocumented_bytes_are_zeros_or_silence() -> None:
    assert Bench(model="df").ask(eb90("11 A4 06 04")).endswith("A4 06 00 00 00 00 C3")
    assert Bench(model="df", fault="block-silent").ask(eb90("11 A4 06 04")) == ""
    assert Bench(model="tp", fault="block-silent").ask(eb90("11 A4 06 04")) != ""


def test_a_word_write_touches_two_bytes() -> None:
    """What the dossier §2.2 warns of: 0101 at 1004 clears and saves, 0100 at 1003 clears."""
    bench = Bench(model="tp", bus="modbus-tcp")
    bench.ask("00 01 00 00 00 06 01 06 03 EC 01 01")
    assert bench.acts() == {"clear": 1, "save": 1}
    bench.ask("00 01 00 00 00 06 01 06 03 EB 01 00")
    assert bench.acts() == {"clear": 2, "save": 1, "reserved": 1}
    bench.ask("00 01 00 00 00 13 01 10 03 EC 00 06 0C 00 01 00 01 00 01 00 01 00 01 00 01")
    assert bench.acts()["factory-reset"] == 1


@each_row("fault", ["refuse", "strict"])
def test_what_refuses_a_write(fault: str) -> None:
    bench = Bench(model="df", fault=fault)
    answer = bench.ask(write(1486, 2000))
    assert answer == ("90 EB 01 04 12 CE 05 00 EA" if fault == "refuse" else "")
    assert bench.acts() == {}


@each_row("number", ["00 00", "FD 00"])
def test_impossible_counts(number: str) -> None:
    assert Bench(model="df").ask(eb90(f"11 E8 03 {number[:2]}")) == ""


def test_faults_show_in_error_and_status() -> None:
    bench = Bench(model="tp", fault="faults")
    assert bench.bytes_at(1606) == [1, 2, 4, 6, 24, 0]
    assert bench.bytes_at(1612) == [6, 7, 5, 5, 7, 0]
    bench.ask(write(1004, 1, size=1))
    assert bench.bytes_at(1606) == [0, 2, 0, 2, 0, 0]


def test_hot_cools_down() -> None:
    bench = Bench(model="tp", fault="hot")
    assert bench.bytes_at(1606) == [2] * 6
    bench.wait(600.0)
    assert bench.bytes_at(1606) == [0] * 6


# -- books --------------------------------------------------------------------------------------------------------------


@each_row("model", GENERATIONS)
def test_no_two_registers_share_a_byte(model: str) -> None:
    taken: set[int] = set()
    for _, first, size, count, access, low, high in GENERATIONS[model].rows:
        places = set(range(first, first + size * count))
        assert not places & taken, first
        taken |= places
        assert access in ("r", "rw", "w")
        assert low < high


@each_row("model", GENERATIONS)
def test_every_word_is_one_register(model: str) -> None:
    words = [row[0] for row in GENERATIONS[model].rows]
    assert len(set(words)) == len(words)


@each_row("model", GENERATIONS)
def test_golden_values_are_all_different(model: str) -> None:
    bench = Bench(model=model)
    words = [
        "stroke",
        "angle",
        "force",
        "current",
        "stroke-set",
        "speed-set",
        "force-set",
        "default-speed",
        "default-force",
    ]
    values = [value for word in words for value in bench.hand.values(word)]
    values += bench.hand.values("current-limit") if "current-limit" in bench.hand.generation.words else ()
    assert len(set(values)) == len(values)


def test_registers_that_tell_an_f1() -> None:
    """What tells F1 from a byte map: angles, status and temperatures as words (dossier §1.1)."""
    bench = Bench(model="f1")
    assert all(500 <= angle <= 1800 for angle in bench.words(1064))
    assert all(0 <= status <= 8 for status in bench.words(1088))
    assert all(10 <= degrees <= 90 for degrees in bench.words(1094))


# -- options, control, state ----------------------------------------------------------------------------------------------


@each_row(
    ("options", "text"),
    [
        ({"model": "rh56"}, "option model=rh56: not one of df, tp, f1, dg2"),
        ({"model": "df", "bus": "modbus-tcp"}, "option bus=modbus-tcp: a hand of generation df has no Ethernet"),
        ({"ip": "1.2.3"}, "option ip=1.2.3: not an IP address, as 192.168.11.210"),
        ({"ip": "1.2.3.400"}, "option ip=1.2.3.400: not an IP address, as 192.168.11.210"),
        ({"bus": "wire"}, "option bus=wire: not one of serial"),
        ({"fault": "nothing"}, "unknown fault 'nothing'"),
        ({"txid": "1"}, "unknown option 'txid'"),
    ],
)
def test_options_that_are_refused(options: dict[str, str], text: str) -> None:
    with pytest.raises(ValueError, match=text.replace(".", r"\.")):
        create("hand", options)


@each_row(
    "text",
    ["get 9000 1", "set 1000", "temperature thumb 40", "object index 2000", "block nothing", "set 8191 00 00", "fly"],
)
def test_control_commands_that_are_refused(text: str) -> None:
    with pytest.raises(ValueError):
        Bench().run(text)


def test_control_commands() -> None:
    bench = Bench(model="f1")
    assert "thumb_bend" in bench.run("help")
    bench.run("set 1064 E8 03")
    assert bench.words(1064) == [1000, 1011, 1021, 1031, 1210, 1320]
    bench.run("temperature index 60")
    assert bench.words(1094)[3] == 60
    bench.run("set 1082 01 00")
    assert bench.words(1088)[0] == 6
    bench.run("set 1000 05")
    assert bench.ask(eb90("11 E8 03 02", 5)).startswith("90 EB 05")


@pytest.mark.parametrize("model", GENERATIONS)
def test_state_file(model: str, tmp_path: Path) -> None:
    path = tmp_path / "hand.json"
    first = Bench(model=model, state=path)
    place = first.hand.space.place("angle-set") // first.hand.generation.unit
    first.ask(write(place, 700))
    first.wait(0.2)
    first.ask(write(first.hand.space.place("default-speed") // first.hand.generation.unit, 33))
    first.line.close()
    second = Bench(model=model, state=path)
    assert second.hand.values("angle") == first.hand.values("angle")
    assert second.hand.values("default-speed")[0] == 33
    assert second.acts() == first.acts()
    second.wait(9.0)
    assert second.hand.values("angle")[0] == max(700, second.hand.generation.ends[0][0])
    other = "df" if model != "df" else "tp"
    with pytest.raises(ValueError, match="of a hand of generation"):
        Bench(model=other, state=path)


def test_a_saved_id_survives_in_the_state_file(tmp_path: Path) -> None:
    path = tmp_path / "hand.json"
    first = Bench(state=path, baud=57600, ip="10.1.2.3")
    first.ask(write(1000, 8, size=1))
    first.ask(eb90("12 ED 03 01", 8))
    first.line.close()
    second = Bench(state=path, power_cycle=1)
    assert second.ask(eb90("11 E8 03 01", 8)) != ""
    assert second.line.device.speed == 57600
    assert second.run("ip") == "10.1.2.3"


def test_somebody_uses_it() -> None:
    bench = Bench(model="tp", use="on", tactile="quiet")
    seen = []
    for _ in range(80):
        bench.wait(0.2)
        seen.append((bench.words(1546)[0], bench.words(1582)[0], max(bench.words(3000, 105))))
    assert max(angle for angle, _, _ in seen) > 900
    assert min(angle for angle, _, _ in seen) < 450
    assert max(force for _, force, _ in seen) > 300
    assert max(felt for _, _, felt in seen) > 0
    assert bench.bytes_at(1606) == [0] * 6
