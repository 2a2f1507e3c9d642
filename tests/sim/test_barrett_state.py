"""The simulated BarrettHand: parameters, EEPROM, power, state file, speed, faults. Sections: barrett manual."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handctl.sim.bus.wire_pair import resample
from tests.sim.barrett_bench import GLOBALS, MOTOR_33, PROMPT, Bench, ready
from tests.support.each_row import each_row

# Another reading of §5.3: mnemonic: (lowest, highest, default of a finger, default of the spread).
MOTOR = {
    **dict.fromkeys(["HSG", "LSG", "MSG"], (0, 256, 256, 256)),
    **dict.fromkeys(["MOV", "MCV"], (16, 4080, 100, 60)),
    **dict.fromkeys(["LCV", "LCPG", "LFV", "LFS", "LFAP", "LFDP", "EN"], (0, 1, 1, 1)),
    **dict.fromkeys(["LCVC", "LFVC", "LFDPC"], (0, 255, 1, 1)),
    **dict.fromkeys(["FDZ", "FIP"], (0, 255, 0, 0)),
    "DP": (0, 65535, 8500, 1575),
    "DS": (0, 65535, 1700, 315),
    "ACCEL": (0, 65535, 4, 2),
    "CT": (0, 65535, 17000, 3150),
    "FPG": (0, 255, 10, 10),
    "HOLD": (0, 1, 0, 1),
    "IHIT": (0, 65535, 2, 0),
    "IOFF": (0, 65535, 50, 0),
    "IVEL": (16, 4080, 300, 150),
    "MPE": (0, 65535, 50, 50),
    "OT": (0, 65535, 0, 0),
    "SAMPLE": (15, 255, 31, 31),
    "SGFLIP": (0, 1, 0, 0),
    "TSTOP": (0, 65535, 30, 30),
}
LATER = {"BS": (0, 1, 0, 0), "BDAT": (0, 20000, 1500, 1500)}  # 4.34
LATEST = dict.fromkeys(["LCT", "LFBP", "LFAIN"], (0, 1, 0, 0))  # 4.4
GLOBAL = {"LFT": (0, 1, 0), "OTEMP": (0, 1250, 0), "LFDPD": (0, 1, 0)}
ALL = {**MOTOR, **LATER, **LATEST}


def test_the_tables_are_whole() -> None:
    assert sorted([*MOTOR, "OD", "P", "S", "SG"]) == sorted(MOTOR_33)
    assert len(MOTOR_33) == 35
    assert sorted([*GLOBAL, "BAUD", "TEMP", "PTEMP", "UPSECS", "SN"]) == sorted(GLOBALS)


@each_row("name", ALL)
def test_motor_parameter(name: str) -> None:
    """Default, both ends of the range, beyond them, and each motor on its own."""
    low, high, finger, spread = ALL[name]
    bench = ready(firmware="4.4")
    usual = [finger, finger, finger, spread]
    assert bench.get(name) == [" ".join(map(str, usual))]
    for number, prefix in enumerate("123S"):
        for value in (low, high):
            assert bench.ask(f"{prefix}FSET {name} {value}") == []
            expected = [value if place == number else old for place, old in enumerate(usual)]
            assert bench.get(name) == [" ".join(map(str, expected))]
        for value in (low - 1, high + 1):
            assert bench.ask(f"{prefix}FSET {name} {value}") == ["ERR 128"]
        assert bench.get(name, prefix) == [str(high)]
        assert bench.ask(f"{prefix}FSET {name} {usual[number]}") == []


@each_row("name", GLOBAL)
def test_global_parameter(name: str) -> None:
    low, high, default = GLOBAL[name]
    bench = ready()
    assert bench.ask(f"PGET {name}") == [str(default)]
    for value in (low, high):
        assert bench.ask(f"PSET {name} {value}") == []
        assert bench.ask(f"PGET {name}") == [str(value)]
    for value in (low - 1, high + 1):
        assert bench.ask(f"PSET {name} {value}") == ["ERR 128"]
    assert bench.ask(f"PGET {name}") == [str(high)]


def test_two_names_of_one_value() -> None:
    """§5.3.1: HSG is an alias of MSG."""
    bench = ready()
    bench.ask("1FSET HSG 201")
    bench.ask("2FSET MSG 202")
    assert bench.get("HSG MSG") == ["201 202 256 256"] * 2


def test_setting_one_parameter_sets_no_other() -> None:
    bench = ready()
    before = bench.ask("FLISTAV")
    for number, name in enumerate(MOTOR):
        low, high, finger, _ = MOTOR[name]
        bench.ask(f"1FSET {name} {low if finger != low else min(high, 1 + number)}")
        after = bench.ask("FLISTAV")
        changed = {MOTOR_33[place] for place in range(35) if before[place] != after[place]}
        assert changed == {"MSG": {"HSG", "MSG"}, "HSG": {"HSG", "MSG"}, "SGFLIP": {"SG", "SGFLIP"}}.get(name, {name})
        bench.ask("FDEF")


@each_row(
    ("firmware", "names"),
    [("4.33", set()), ("4.34", {"BD", "BP", "BS", "BDAT"}), ("4.4", {"BD", "BP", *LATER, *LATEST})],
)
def test_firmware_variants(firmware: str, names: set[str]) -> None:
    bench = ready(firmware=firmware)
    assert bench.ask("VERS") == [firmware]
    assert set(bench.ask("FLISTA")) == {*MOTOR_33, *names}
    for name in ("BD", "BP", *LATER, *LATEST):
        assert (bench.get(name) == ["ERR 64"]) is (name not in names)


def test_readings_are_all_different() -> None:
    bench = Bench()
    rows = bench.get("P SG OD") + bench.ask("PGET TEMP PTEMP UPSECS SN")
    values = [value for row in rows for value in row.split()]
    assert values == (
        [
            "1021",
            "2042",
            "3063",
            "404",
            "112",
            "119",
            "126",
            "255",
            "104233",
            "98712",
            "110003",
            "20117",
            "412",
            "573",
            "7345678",
            "1042",
        ]
    )
    assert len(set(values)) == 16


def test_uptime() -> None:
    """§5.4.2: seconds with power on."""
    bench = ready()
    bench.wait(99.5)
    assert bench.ask("PGET UPSECS") == ["7345777"]
    bench.control("power off")
    bench.wait(1000.0)
    bench.control("power on")
    bench.run()
    assert bench.ask("PGET UPSECS") == ["7345778"]


# -- EEPROM -------------------------------------------------------------------------------------------------------------------


def test_save_load_default_by_motor() -> None:
    """§5.2.2: FSAVE and FLOAD of some motors leave the others."""
    bench = ready()
    bench.ask("FSET DP 11")
    bench.ask("12FSAVE")
    bench.ask("FSET DP 22")
    bench.ask("23FLOAD")
    assert bench.get("DP") == ["22 11 8500 22"]
    bench.ask("SFDEF")
    assert bench.get("DP") == ["22 11 8500 1575"]
    assert bench.control("eeprom DP") == "11 11 8500 1575"
    assert bench.control("saves") == "saves 1 0"


def test_save_load_default_of_globals() -> None:
    bench = ready()
    bench.ask("PSET LFT 1 OTEMP 650")
    bench.ask("PSAVE")
    bench.ask("PSET LFT 0 LFDPD 1")
    assert bench.ask("PDEF") == []
    assert bench.ask("PGET LFT OTEMP LFDPD") == ["0", "0", "0"]
    bench.ask("PLOAD")
    assert bench.ask("PGET LFT OTEMP LFDPD") == ["1", "650", "0"]
    assert bench.control("saves") == "saves 0 1"


@each_row(("command", "seconds"), [("FSAVE", 2.4), ("1FSAVE", 0.6), ("PSAVE", 0.08), ("FLOAD", 0.0), ("FDEF", 0.0)])
def test_saving_takes_time(command: str, seconds: float) -> None:
    """10 ms a byte, two bytes a value (our guess); nothing is heard meanwhile, but it is written at once."""
    bench = ready()
    bench.ask("FSET DP 77")
    assert bench.send(command + "\r").startswith(command)
    assert (bench.control("eeprom DP").split()[0] == "77") is ("FSAVE" in command)
    if seconds:
        assert bench.wait(seconds - 0.001) == ""
        assert bench.send("\x03VERS\r") == ""
        assert bench.wait(0.001) == PROMPT
    assert bench.send("\r") == PROMPT


def test_write_time_option() -> None:
    assert ready(write_time=0).seconds("FSAVE") == 0.0
    assert ready(write_time=0.001).seconds("1FSAVE") == pytest.approx(0.06)


def test_eeprom_wears_out_after_5000_saves() -> None:
    """§5.2.2, §5.2.3: each kind on its own."""
    bench = ready(write_time=0)
    bench.control("saves 4999 0")
    for value, kept in ((1, "1"), (2, "1")):
        bench.ask(f"1FSET DP {value}")
        bench.ask("1FSAVE")
        assert bench.control("eeprom DP").split()[0] == kept
    assert bench.control("saves") == "saves 5001 0"
    bench.control("saves 4999 4999")
    for value, kept in ((1, "1"), (0, "1")):
        bench.ask(f"PSET LFT {value}")
        bench.ask("PSAVE")
        assert bench.control("eeprom LFT") == kept


def test_worn_eeprom() -> None:
    bench = ready(fault="eeprom-worn")
    bench.ask("FSET DP 1")
    bench.ask("PSET LFT 1")
    assert bench.ask("FSAVE") == [] == bench.ask("PSAVE")
    assert bench.control("eeprom DP") == "8500 8500 8500 1575"
    assert bench.control("eeprom LFT") == "0"
    assert bench.control("saves") == "saves 1 1"


# -- RESET and power ------------------------------------------------------------------------------------------------------------

BANNER = "\n\rBarrettHand Firmware\n\rVersion 4.33\n\r=> "


@each_row("way", ["RESET", "power-cycle"])
def test_restart(way: str) -> None:
    """§5.2.4: RESET is a power cycle. RAM values and initialization go, EEPROM, odometer, uptime and peak stay."""
    bench = ready()
    bench.ask("FSET DP 10")
    bench.ask("1FSAVE")
    bench.ask("FSET DS 20")
    bench.ask("PSET LFT 1")
    bench.ask("M 2000")
    bench.control("temperature 600")
    if way == "RESET":
        assert bench.send("RESET\r") == "RESET"
    else:
        bench.send("half a li")
        assert bench.control(way) == "power cycled"
        assert bench.heard() == "" and bench.wait(0.0) == ":"  # the boot monitor
    assert bench.send("FGET P\r") == ""  # deaf while it starts
    assert bench.wait(0.999) == ""
    assert bench.wait(0.002) == BANNER
    assert bench.get("DP DS P S") == ["10 8500 8500 1575", "1700 1700 1700 315", "0 0 0 0", "4 4 4 4"]
    assert bench.ask("PGET LFT PTEMP") == ["0", "600"]
    assert bench.get("OD") == ["104235 98714 110005 20119"]
    assert "power on" not in bench.control("motors")
    assert bench.ask("M 0") == ["ERR 4"]
    bench.ask("1HI")
    assert bench.ask("1M 17000") == []


def test_restart_in_a_movement() -> None:
    bench = ready()
    bench.send("GC\r")
    bench.wait(0.4)
    bench.control("power-cycle")
    assert bench.run() == ":" + BANNER
    assert bench.get("P S") == ["0 0 0 0", "4 4 4 4"]
    bench.ask("HI")
    assert bench.seconds("GO") == 0.0


def test_restart_in_a_save() -> None:
    bench = ready()
    bench.send("FSAVE\r")
    bench.wait(0.4)
    bench.control("power off")
    assert bench.run() == ""
    assert bench.send("\r") == ""
    bench.control("power on")
    assert bench.run() == ":" + BANNER


def test_no_banner_at_the_first_start() -> None:
    """The hand has been on for a while; the option power-cycle=1 is another matter."""
    assert Bench().run() == ""
    late = Bench(power_cycle=1, boot=3)
    assert late.wait(0.0) == ":"
    assert late.line.next_event() == 3.0
    assert late.run() == BANNER


# -- speed ------------------------------------------------------------------------------------------------------------------------

PROMPT_BYTES = bytes.fromhex("0A 0D 3D 3E 20")


@each_row(
    ("data", "sent", "heard", "expected"),
    [
        ("0D", 9600, 38400, "78 00"),
        ("0D", 9600, 19200, "E6 80"),
        ("0A 0D 3D 3E 20", 9600, 19200, "98 80 E6 80 E6 18 18 F8"),
        ("0A 0D 3D 3E 20", 19200, 9600, "38 0E FF"),
        ("0A 0D 3D 3E 20", 9600, 9600, "0A 0D 3D 3E 20"),
        ("00 FF 55 AA", 38400, 38400, "00 FF 55 AA"),
        ("", 9600, 19200, ""),
        ("0D", -1, 9600, ""),
        ("0D", 9600, 0, ""),
    ],
)
def test_bits_at_a_wrong_speed(data: str, sent: int, heard: int, expected: str) -> None:
    assert resample(bytes.fromhex(data), sent, heard).hex(" ").upper() == expected


def test_probing_at_a_wrong_speed_is_harmless() -> None:
    """No speed makes a CR, a ^C or a letter of another speed's CR or ^C."""
    speeds = (600, 1200, 2400, 4800, 9600, 19200, 38400)
    heard = {
        byte
        for probe in (3, 13)
        for one in speeds
        for other in speeds
        if one != other
        for byte in resample(bytes([probe]), one, other)
    }
    assert heard == {0x00, 0x1E, 0x78, 0x80, 0xE6, 0xF8, 0xFC, 0xFE, 0xFF}


@each_row("baud", [6, 12, 24, 48, 96, 192, 384])
def test_every_speed(baud: int) -> None:
    """§5.4.1; the client at any other speed gets no prompt, at this one it does."""
    bench = ready()
    bench.send(f"PSET BAUD {baud}\r")
    assert bench.line.device.speed == 100 * baud
    for client in (600, 1200, 2400, 4800, 9600, 19200, 38400):
        bench.line.client_baud = client
        bench.send("\x03")
        assert (bench.send("\r") == PROMPT) is (client == 100 * baud)


def test_wrong_speed_leaves_noise_in_the_line() -> None:
    """One ERR 32 at the right speed, or none after ^C."""
    bench = ready()
    bench.line.client_baud = 19200
    bench.send("\r")
    bench.line.client_baud = 9600
    assert bench.send("\r") == "\n\rERR 32\n\r=> "
    assert bench.send("\r") == PROMPT
    bench.line.client_baud = 19200
    bench.send("\r")
    bench.line.client_baud = 9600
    assert bench.send("\x03\r") == PROMPT + PROMPT


def test_client_without_a_speed_is_always_understood() -> None:
    bench = ready()
    assert bench.send("PSET BAUD 384\r") == "PSET BAUD 384" + PROMPT
    assert bench.send("\r") == PROMPT


def test_speed_commands() -> None:
    """PDEF, PLOAD, RESET and power on change the speed too (§5.2.3, §5.2.4); PSAVE keeps it."""
    bench = ready()
    device = bench.line.device
    bench.ask("PSET BAUD 384")
    bench.ask("PLOAD")
    assert device.speed == 9600
    bench.ask("PSET BAUD 192")
    bench.ask("PSAVE")
    bench.ask("PDEF")
    assert device.speed == 9600
    bench.ask("PLOAD")
    assert device.speed == 19200
    bench.ask("PSET BAUD 6")
    bench.send("RESET\r")
    assert device.speed == 19200
    bench.run()
    bench.ask("PSET BAUD 384")
    bench.control("power-cycle")
    assert device.speed == 9600  # the boot monitor
    bench.run()
    assert device.speed == 19200
    bench.ask("HI")
    assert device.speed == 19200


def test_banner_comes_at_the_saved_speed() -> None:
    bench = ready()
    bench.line.client_baud = 9600
    bench.send("PSET BAUD 384\r")
    bench.line.client_baud = 38400
    bench.send("\r")
    bench.send("RESET\r")
    bench.line.client_baud = 9600
    assert bench.run() == BANNER


def test_some_hands_cannot_do_the_higher_speeds() -> None:
    bench = ready(max_baud=19200)
    assert bench.ask("PSET BAUD 384") == ["ERR 128"]
    assert bench.ask("PSET BAUD 192") == []


def test_saved_speed_option() -> None:
    bench = ready(baud=38400)
    assert bench.line.device.speed == 38400
    assert bench.ask("PGET BAUD") == ["384"]
    bench.control("power-cycle")
    assert bench.line.device.speed == 9600
    bench.run()
    assert bench.line.device.speed == 38400


@each_row(("speed", "floor"), [(9600, 0.7), (38400, 0.17)])
def test_wire_time_of_a_whole_dump(speed: int, floor: float) -> None:
    """Every byte of the four requests and answers, except the echo, which overlaps the request."""
    bench = ready(wire="auto", baud=speed)
    names = [MOTOR_33[:17], MOTOR_33[17:31], MOTOR_33[31:]]
    size = 0
    for command in (*("FGET " + " ".join(part) for part in names), "PGET " + " ".join(GLOBALS)):
        answer = bench.send(command + "\r") + bench.run()
        size += len(answer) + 1
        assert answer.endswith(PROMPT)
    assert bench.now == pytest.approx(size * 10 / speed, rel=0.001)
    assert floor < bench.now < floor * 1.15


# -- state file -----------------------------------------------------------------------------------------------------------------


def test_state_file_keeps_everything(tmp_path: Path) -> None:
    path = tmp_path / "hand.json"
    bench = Bench(state=path, firmware="4.34")
    bench.ask("123HI")
    bench.ask("1FSET DP 1234")
    bench.ask("2FSET DS 55")
    bench.ask("2FSAVE")
    bench.ask("PSET OTEMP 650 BAUD 192")
    bench.control("obstacle F3 5000")
    bench.ask("GM 10000")
    bench.control("temperature 500")
    bench.wait(100.0)
    rows = "P S SG OD DP DS BD"
    before = bench.get(rows) + bench.ask("PGET OTEMP TEMP PTEMP UPSECS BAUD SN") + [bench.control("eeprom DS")]
    bench.line.close()
    again = Bench(state=path, firmware="4.34")
    after = again.get(rows) + again.ask("PGET OTEMP TEMP PTEMP UPSECS BAUD SN") + [again.control("eeprom DS")]
    assert after == before
    assert again.line.device.speed == 19200
    assert again.control("saves") == "saves 1 0"
    assert json.loads(path.read_text())["simulated"] is True
    cycled = Bench(state=path, power_cycle=1)
    cycled.run()
    assert cycled.get("P S DP DS") == ["0 0 0 0", "4 4 4 4", "8500 8500 8500 1575", "1700 55 1700 315"]
    assert cycled.line.device.speed == 9600


def test_state_is_on_disk_before_the_prompt(tmp_path: Path) -> None:
    path = tmp_path / "hand.json"
    bench = ready(state=path)
    bench.ask("1FSET DP 77")
    assert json.loads(path.read_text())["ram"]["motor"]["DP"][0] == 77
    bench.ask("1FSAVE")
    assert json.loads(path.read_text())["eeprom"]["motor"]["DP"][0] == 77
    bench.ask("1M 300")
    assert json.loads(path.read_text())["motors"][0]["place"] == 350


def test_state_in_the_middle_of_a_movement_is_a_standstill(tmp_path: Path) -> None:
    path = tmp_path / "hand.json"
    bench = ready(state=path)
    bench.send("1C\r")
    bench.wait(1000 * 256e-6)
    bench.line.close()
    assert Bench(state=path).get("P", "1") == [str(1250 + 3750)]


def test_state_of_another_firmware(tmp_path: Path) -> None:
    """EEPROM survives a download; what the new firmware has beside gets its default."""
    path = tmp_path / "hand.json"
    first = ready(state=path)
    first.ask("1FSET DP 5")
    first.line.close()
    assert Bench(state=path, firmware="4.4").get("DP BDAT", "1") == ["5", "1500"]


@each_row(
    ("place", "value"),
    [
        (("ram", "motor", "DP"), [1, 2, 3]),
        (("ram", "motor", "DP", 0), 65536),
        (("ram", "motor", "DP", 0), "x"),
        (("ram", "global", "BAUD"), 97),
        (("eeprom", "motor", "IVEL", 3), 15),
        (("saves",), [1]),
        (("motors",), []),
        (("motors", 0, "place"), None),
        (("motors", 0, "strain"), 256),
        (("heat", "temperature"), 1e9),
        (("kind",), "exo"),
        (("ram",), None),
    ],
)
def test_damaged_state_file(tmp_path: Path, place: tuple[str | int, ...], value: object) -> None:
    path = tmp_path / "hand.json"
    ready(state=path).line.close()
    state = json.loads(path.read_text())
    inner = state
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    path.write_text(json.dumps(state))
    with pytest.raises(ValueError, match=r"damaged or foreign .* Delete it to start over"):
        Bench(state=path)


# -- faults -----------------------------------------------------------------------------------------------------------------------

GOOD = "FGET DP\n\r8500 8500 8500 1575\n\r=> "


@each_row(
    ("fault", "answer"),
    [
        ("healthy", GOOD),
        ("silent", ""),
        ("deaf", ""),
        ("no-echo", GOOD[7:]),
        ("hang", "FGET DP"),
        ("echo", "FGET DP\r" + GOOD),
        ("loopback", "FGET DP\r"),
        ("duplicate", GOOD + GOOD[7:]),
        ("dribble", GOOD),
        ("split", GOOD),
        ("late", GOOD),
        ("slow", GOOD),
        ("disconnect", GOOD[: 7 + 13]),
        ("bad-checksum", GOOD[: 7 + 13] + "\xb5" + GOOD[7 + 14 :]),
        ("wrong-id", GOOD),
        ("twin-id", GOOD),
        ("refuse", GOOD),
        ("no-echo,duplicate", GOOD[7:] * 2),
    ],
)
def test_fault_of_the_line(fault: str, answer: str) -> None:
    bench = ready(fault=fault)
    assert bench.send("FGET DP\r") + bench.run() == answer


@each_row("fault", ["silent", "deaf", "late", "no-echo", "truncate"])
def test_what_is_carried_out_all_the_same(fault: str) -> None:
    bench = ready(fault=fault)
    bench.send("1FSET DP 5\r")
    bench.run()
    assert bench.control("ram DP") == ("8500 8500 8500 1575" if fault == "deaf" else "5 8500 8500 1575")


def test_late_answer_has_its_echo_in_time() -> None:
    bench = ready(fault="late", late=2)
    assert bench.send("VERS\r") == "VERS"
    assert bench.wait(1.999) == ""
    assert bench.wait(0.001) == "\n\r4.33\n\r=> "


def test_stale_answer_comes_before_the_echo() -> None:
    bench = ready(fault="stale", after=1)
    assert bench.send("VERS\r") == "VERS\n\r4.33\n\r=> "
    assert bench.send("PGET LFT\r") == "\n\r4.33\n\r=> PGET LFT\n\r0\n\r=> "


def test_truncated_answers() -> None:
    bench = ready(fault="truncate")
    for _ in range(20):
        answer = bench.send("FGET DP\r")
        assert GOOD.startswith(answer) and 8 <= len(answer) < len(GOOD)


def test_noise_strikes_echo_or_answer() -> None:
    places = set()
    for seed in range(20):
        answer = ready(fault="noise", seed=seed).send("FGET DP\r")
        assert answer != GOOD
        places.add("answer" if answer.startswith("FGET DP") else "echo" if answer.endswith(GOOD[1:]) else "?")
    assert places == {"answer", "echo"}


def test_after_and_every_count_lines() -> None:
    bench = ready(fault="silent", after=2, every=2)
    assert [bool(bench.send("VERS\r")) for _ in range(8)] == [True, True, True, False, True, False, True, False]
    assert bench.control("requests") == "requests 8"


def test_abort_counts_as_a_line_when_nothing_was_typed() -> None:
    bench = ready()
    bench.send("\x03VERS\x03\r")
    assert bench.control("requests") == "requests 3"


@each_row("command", ["FSET DP 1", "FLOAD", "FSAVE", "FDEF", "PSET LFT 1", "PLOAD", "PSAVE", "PDEF"])
def test_refused_writes(command: str) -> None:
    bench = ready(fault="refuse")
    assert bench.ask(command) == ["ERR 256"]
    assert bench.control("saves") == "saves 0 0"
    assert bench.get("DP", "1") == ["8500"]


def test_hanging_hand_hears_nothing_until_it_is_switched_off() -> None:
    bench = ready(fault="hang", after=1)
    assert bench.send("\r") == PROMPT
    assert bench.send("VERS\r") == "VERS"
    assert bench.send("\x03\r") + bench.run() == ""
    bench.control("fault none")
    assert bench.send("\x03\r") + bench.run() == ""
    bench.control("power-cycle")
    assert bench.run() == ":" + BANNER


@each_row(
    ("fault", "name", "row"),
    [
        ("not-homed", "S", "4 4 4 4"),
        ("no-board", "S", "0 1 0 0"),
        ("no-motor", "S", "0 0 2 0"),
        ("no-board,no-motor,not-homed", "S", "4 1 2 4"),
        ("unknown-codes", "S", "0 0 520 0"),
        ("strain", "SG", "112 221 126 255"),
        ("strain-offset", "SG", "112 119 188 255"),
        ("no-gauges", "SG", "255 255 255 255"),
    ],
)
def test_state_of_the_body(fault: str, name: str, row: str) -> None:
    bench = ready(fault=fault)
    healthy = ready().get(name)[0]
    assert bench.get(name) == [row]
    bench.control("fault none")
    if fault != "not-homed" and "," not in fault:
        assert bench.get(name) == [healthy]


def test_missing_electronics_stop_only_their_motor() -> None:
    bench = Bench(fault="no-board,no-motor")
    assert bench.ask("HI") == ["ERR 3"]
    assert bench.ask("C") == ["ERR 3"]
    assert bench.get("P") == ["17000 0 0 3150"]
    assert bench.ask("1O") == []


def test_blocked_hand() -> None:
    bench = ready(fault="blocked")
    assert bench.ask("GM 1000") == ["ERR 16"]
    assert bench.ask("SC") == []
    assert bench.get("P") == ["0 0 0 0"]
    bench.control("fault none")
    assert bench.ask("GM 1000") == []


def test_object_in_the_hand() -> None:
    bench = ready(fault="obstacle")
    assert bench.ask("GC") == []
    assert bench.get("P SG") == ["9500 9650 9800 0", "172 179 186 255"]
    assert bench.ask("GM 17000") == ["ERR 16"]


def test_hot_hand() -> None:
    bench = ready(fault="hot")
    assert bench.ask("PGET TEMP PTEMP OTEMP") == ["702", "702", "0"]
    assert bench.ask("GM 10") == []
    bench.control("fault over-temperature")
    assert bench.ask("PGET TEMP PTEMP OTEMP") == ["702", "702", "600"]
    assert bench.ask("GM 20") == ["ERR 8192"]
    bench.control("fault none")
    assert bench.ask("PGET TEMP PTEMP OTEMP") == ["412", "702", "600"]
    assert bench.ask("GM 20") == []


def test_breakaway_of_f3() -> None:
    bench = ready(fault="breakaway", firmware="4.34")
    bench.ask("GC")
    assert bench.get("BD BP") == ["0 0 1 0", "0 0 2000 0"]


def test_decayed_firmware_is_erratic() -> None:
    """§8: it obeys some commands; what is read twice differs."""
    bench = ready(fault="erratic", seed=3)
    answers = [bench.ask("FGET CT")[0] for _ in range(60)]
    assert 2 < answers.count("ERR 32") < 20
    wrong = [answer for answer in answers if answer not in ("ERR 32", "17000 17000 17000 3150")]
    assert 10 < len(wrong) < 50
    bench.control("fault none")
    assert bench.ask("FGET CT") == ["17000 17000 17000 3150"]


# -- control ----------------------------------------------------------------------------------------------------------------------


def test_control_commands() -> None:
    bench = ready()
    assert bench.control("help").count("|") == 29
    bench.control("position all 321")
    assert bench.get("P") == ["321 321 321 321"]
    assert bench.get("OD") == ["104233 98712 110003 20117"]
    bench.control("temperature -55")
    assert bench.ask("PGET TEMP") == ["-55"]
    assert bench.control("ram MSG") == "256 256 256 256"
    assert bench.control("ram otemp") == "0"
    assert bench.control("motors").startswith("F1 P 321 S 0 SG 112 power off, F2")


@each_row(
    ("command", "complaint"),
    [
        ("block F4", "unknown motor 'F4'. Known: F1, F2, F3, S, all"),
        ("temperature hot", "'hot' is not a whole number from -550 to 1250"),
        ("temperature 1251", "'1251' is not a whole number from -550 to 1250"),
        ("strain F1 256", "'256' is not a whole number from 0 to 255"),
        ("ram P", "no stored parameter 'P'"),
        ("leap", "unknown command 'leap'. Known: temperature"),
        ("obstacle F1", "unknown command 'obstacle F1'. Known: temperature"),
    ],
)
def test_control_complaints(command: str, complaint: str) -> None:
    with pytest.raises(ValueError) as caught:
        ready().control(command)
    assert str(caught.value).startswith(complaint)


def test_position_of_a_moving_motor_cannot_be_set() -> None:
    bench = ready()
    bench.send("1C\r")
    bench.wait(0.1)
    with pytest.raises(ValueError, match="F1 is moving"):
        bench.control("position F1 3")
