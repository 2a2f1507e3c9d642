"""The simulated BarrettHand: the line, every command, every status code, on virtual time. Sections: barrett manual."""

from __future__ import annotations

import pytest

from handctl.sim import create, kinds
from tests.sim.barrett_bench import GLOBALS, MOTOR_33, PROMPT, Bench, ready
from tests.support.each_row import each_row

# -- the dossier's transcripts --------------------------------------------------------------------------------------------

ODOMETER = "31 30 34 32 33 33 20 39 38 37 31 32 20 31 31 30 30 30 33 20 32 30 31 31 37"
VECTORS = {
    "empty line": ((), "0D", "0A 0D 3D 3E 20"),
    "positions": (
        (),
        "46 47 45 54 20 50 0D",
        "46 47 45 54 20 50 0A 0D 30 20 30 20 30 20 30 0A 0D 3D 3E 20",
    ),
    "two parameters": (
        (),
        "53 46 47 45 54 20 44 53 20 44 50 0D",
        "53 46 47 45 54 20 44 53 20 44 50 0A 0D 33 31 35 0A 0D 31 35 37 35 0A 0D 3D 3E 20",
    ),
    "lower case": (
        (),
        "66 67 65 74 20 6F 64 0D",
        f"66 67 65 74 20 6F 64 0A 0D {ODOMETER} 0A 0D 3D 3E 20",
    ),
    "error 4": (
        ("fault not-homed",),
        "47 4D 20 31 30 30 30 0D",
        "47 4D 20 31 30 30 30 0A 0D 45 52 52 20 34 0A 0D 3D 3E 20",
    ),
    "error 16": (
        ("block F1",),
        "31 4D 20 31 37 30 30 30 0D",
        "31 4D 20 31 37 30 30 30 0A 0D 45 52 52 20 31 36 0A 0D 3D 3E 20",
    ),
    "error 8192": (
        ("fault over-temperature",),
        "47 43 0D",
        "47 43 0A 0D 45 52 52 20 38 31 39 32 0A 0D 3D 3E 20",
    ),
    "error 32": ((), "46 4F 4F 0D", "46 4F 4F 0A 0D 45 52 52 20 33 32 0A 0D 3D 3E 20"),
    "error 64": (
        (),
        "31 46 47 45 54 20 50 20 58 58 0D",
        "31 46 47 45 54 20 50 20 58 58 0A 0D 30 0A 0D 45 52 52 20 36 34 0A 0D 3D 3E 20",
    ),
    "error 4096": (
        (),
        "31 50 47 45 54 20 54 45 4D 50 0D",
        "31 50 47 45 54 20 54 45 4D 50 0A 0D 45 52 52 20 34 30 39 36 0A 0D 3D 3E 20",
    ),
}


@each_row("name", VECTORS)
@each_row("bytewise", [False, True])
def test_transcript(name: str, bytewise: bool) -> None:
    preparations, request, reply = VECTORS[name]
    bench = ready()
    for preparation in preparations:
        bench.control(preparation)
    data = bytes.fromhex(request).decode()
    came = "".join(bench.send(byte) for byte in data) if bytewise else bench.send(data)
    came += bench.run()
    assert came.encode().hex(" ").upper() == reply


@each_row("fault", ["none", "silent", "noise", "no-echo"])
def test_a_line_at_its_limit_is_the_same_at_once_and_byte_by_byte(fault: str) -> None:
    for length in (15, 16, 17, 18, 40):
        came = []
        for pieces in (("x" * length + "\r",), (*"x" * length, "\r"), ("xxx", "x" * (length - 3), "\r")):
            bench = ready(line_limit=16)
            bench.control(f"fault {fault}")
            came.append("".join(map(bench.send, pieces)) + bench.run())
        assert came[1:] == came[:1] * 2, length


def test_transcript_of_a_sum() -> None:
    """20 = 4 + 16: F1 does not reach its goal, F3 is not initialized (§5.1.3)."""
    bench = Bench()
    bench.ask("12HI")
    bench.control("block F1")
    came = bench.send("13M 17000\r") + bench.run()
    assert came.encode().hex(" ").upper() == ("31 33 4D 20 31 37 30 30 30 0A 0D 45 52 52 20 32 30 0A 0D 3D 3E 20")
    assert bench.get("S") == ["16 0 4 4"]


def test_transcript_of_an_abort() -> None:
    """§5.5 case 4: nothing but the echo, then ^C, then the status at once."""
    bench = ready()
    assert bench.send("C\r") == "C"
    assert bench.wait(0.1) == ""
    assert bench.send("\x03").encode().hex(" ").upper() == "0A 0D 45 52 52 20 31 36 33 38 34 0A 0D 3D 3E 20"


def test_transcript_of_the_echo_trap() -> None:
    """§5.2.4: the echo of ERR 3 is no status."""
    assert ready().send("ERR 3\r") == "ERR 3\n\r1 No motor board found\n\r2 No motor found\n\r=> "


def test_transcript_of_a_speed_change() -> None:
    """§5.4.1: 13 echo bytes at 9600, the rest at 38400, then the prompt at 38400."""
    bench = ready()
    bench.line.client_baud = 9600
    came = bench.send("PSET BAUD 384\r")
    assert came[:13] == "PSET BAUD 384"
    assert "=> " not in came
    bench.line.client_baud = 38400
    assert bench.send("\r") == PROMPT
    assert bench.line.device.speed == 38400


# -- the line -------------------------------------------------------------------------------------------------------------


def test_every_byte_is_echoed_as_it_arrives() -> None:
    bench = ready(wire="auto")
    bench.send("FGET P\r")
    came = []
    while (event := bench.line.next_event()) is not None:
        bench.line.advance(event)
        text = bench.heard()
        if text:
            came.append((round(event * 960, 6), text))
    assert came[:6] == [(number, letter) for number, letter in enumerate("FGET P", 2)]
    assert "".join(text for _, text in came) == "FGET P\n\r0 0 0 0\n\r=> "
    assert came[-1][0] == 7 + 14  # CR has arrived after 7 bytes, then 14 answer bytes


def test_no_wire_no_time() -> None:
    bench = ready()
    assert bench.line.next_event() is None
    bench.send("FGET P\r")
    assert bench.line.next_event() is None


@each_row(
    ("options", "answer"),
    [
        ({}, "VERS\n\r4.33\n\r=> "),
        ({"line_end": "crlf"}, "VERS\r\n4.33\r\n=> "),
        ({"prompt": "bare"}, "VERS\n\r4.33\n\r=>"),
        ({"line_end": "crlf", "prompt": "bare"}, "VERS\r\n4.33\r\n=>"),
    ],
)
def test_line_ends_and_prompts(options: dict[str, object], answer: str) -> None:
    assert ready(**options).send("VERS\r") == answer


@each_row(
    ("typed", "answer"),
    [
        ("  FGET   P  \r", "  FGET   P  \n\r0 0 0 0\n\r=> "),
        ("   \r", "   \n\r=> "),
        ("\nVERS\r", "\nVERS\n\rERR 32\n\r=> "),
        ("VERX\bS\r", "VERX\bS\n\rERR 32\n\r=> "),
        ("\xff\x00\r", "\xff\x00\n\rERR 32\n\r=> "),
        ("VERS\tX\r", "VERS\tX\n\rERR 32\n\r=> "),
        ("FGE\x03VERS\r", "FGE\n\r=> VERS\n\r4.33\n\r=> "),
        ("\x03\x03", "\n\r=> \n\r=> "),
        ("\r\rVERS\r", "\n\r=> \n\r=> VERS\n\r4.33\n\r=> "),
        ("vErS\r", "vErS\n\r4.33\n\r=> "),
    ],
)
def test_typing(typed: str, answer: str) -> None:
    """§5.1.1; ^C forgets half a line and prompts; there are no editing keys."""
    assert ready().send(typed) == answer


def test_long_line_is_refused_whole() -> None:
    bench = ready(line_limit=20)
    assert bench.send("FSET DP 1 DS 2 MPE 3\r").endswith("3\n\r=> ")  # 20 characters
    assert bench.send("FSET DP 4 DS 5 MPE 66\r") == "FSET DP 4 DS 5 MPE 66\n\rERR 32\n\r=> "
    assert bench.get("DP DS MPE") == ["1 1 1 1", "2 2 2 2", "3 3 3 3"]


def test_longest_lines_of_known_clients_fit() -> None:
    """96 characters, 24 arguments."""
    bench = ready()
    command = "1FGET " + " ".join(["LFDPC"] * 15)
    assert len(command) == 95
    assert bench.ask(command) == ["1"] * 15
    assert len(bench.ask("FGET " + " ".join(["P"] * 24))) == 24


@each_row("prefix", ["", "1", "2", "3", "4", "S", "G", "321", "S123", "SG", "1G4S", "33"])
def test_prefixes(prefix: str) -> None:
    """§5.1.2; values in the order of the motors, each once."""
    chosen = {"1": "1", "2": "2", "3": "3", "4": "4", "S": "4", "G": "123"}
    numbers = sorted(set("".join(chosen[letter] for letter in prefix) or "1234"))
    assert ready().get("OD", prefix) == [
        " ".join({"1": "104233", "2": "98712", "3": "110003", "4": "20117"}[number] for number in numbers)
    ]


# -- commands and status codes ----------------------------------------------------------------------------------------------

COMMANDS = {
    **dict.fromkeys(
        ["C", "HI", "HOME", "LOOP", "O", "T", "TC", "TO", "FLOAD", "FSAVE", "FDEF", "FLISTV", "FLISTAV"], (True, 0)
    ),
    **dict.fromkeys(["M", "IC", "IO"], (True, 1)),
    **dict.fromkeys(
        [
            "FLIST",
            "FLISTA",
            "PLOAD",
            "PSAVE",
            "PDEF",
            "PLIST",
            "PLISTV",
            "PLISTA",
            "PLISTAV",
            "?",
            "A?",
            "RESET",
            "VERS",
        ],
        (False, 0),
    ),
    "ERR": (False, 1),
}


def test_all_34_commands_are_tested() -> None:
    assert len({*COMMANDS, "FSET", "FGET", "PSET", "PGET"}) == 34
    listed = [line.split()[0] for line in ready().ask("A?")]
    assert sorted(listed) == sorted([*COMMANDS, "FSET", "FGET", "PSET", "PGET"])


@each_row("command", COMMANDS)
def test_too_many_arguments(command: str) -> None:
    _, most = COMMANDS[command]
    assert ready().ask(f"{command} {'1 ' * (most + 1)}") == ["ERR 1024"]


@each_row("command", [*sorted(set(COMMANDS) - {"LOOP"}), "PSET BAUD 96", "PGET SN", "?HI"])
def test_prefix_where_none_is_taken(command: str) -> None:
    """§5.2.2 to §5.2.5; 4096 or not."""
    takes = COMMANDS.get(command, (False, 0))[0]
    for prefix in ("1", "G", "S4"):
        answer = ready(write_time=0).ask(prefix + command)
        assert (answer == ["ERR 4096"]) is not takes, prefix


@each_row("command", ["C", "HOME", "IC", "IO", "M", "O", "T", "TC", "TO"])
def test_not_initialized(command: str) -> None:
    """§5.2.1: 4 for every such motor, and the others move all the same."""
    bench = Bench()
    assert bench.ask(command) == ["ERR 4"]
    assert bench.get("P S") == ["1021 2042 3063 404", "4 4 4 4"]
    assert bench.ask("2HI") == []
    assert bench.get("S") == ["4 0 4 4"]
    # F2 is at 0 now: it cannot open by 1700 counts.
    assert bench.ask(command) == (["ERR 20"] if command == "IO" else ["ERR 4"])
    assert bench.ask("2" + command) == (["ERR 16"] if command == "IO" else [])
    assert bench.get("P", "13S") == ["1021 3063 404"]


@each_row("argument", ["20001", "-1", "+1", "x", "1.5", "99999999999999999999", "0x10", "²"])
@each_row("command", ["M", "IC", "IO"])
def test_movement_arguments_out_of_range(command: str, argument: str) -> None:
    """0 to 20000 (§5.2.1)."""
    bench = ready()
    assert bench.ask(f"G{command} {argument}") == ["ERR 128"]
    assert bench.get("P") == ["0 0 0 0"]


@each_row(
    ("command", "code"),
    [
        ("GET", 32),
        ("G", 32),
        ("12", 32),
        ("FGETP", 32),
        ("G FGET P", 32),
        ("? HI", 1024),
        ("?HI x", 1024),
        ("?FOO", 32),
        ("??FOO", 32),
        ("ERR x", 128),
        ("ERR 65536", 128),
        ("FGET DPX", 64),
        ("FGET TEMP", 64),
        ("PGET DP", 64),
        ("PGET LFT XX", 64),
        ("FGET LFDPD", 64),
        ("FSET XX 1", 64),
        ("PSET XX 1", 64),
        ("FSET BAUD 96", 64),
        ("FSET DP", 128),
        ("FSET DP 1 DS", 128),
        ("FSET DP -1", 128),
        ("PSET LFT", 128),
        ("PSET BAUD 97", 128),
        ("PSET BAUD 1152", 128),
        ("PSET BAUD 0", 128),
        *((f"FSET {name} 1", 256) for name in ("OD", "P", "S", "SG")),
        *((f"PSET {name} 1", 256) for name in ("TEMP", "PTEMP", "UPSECS", "SN")),
        ("FGET " + "P " * 65, 1024),
        ("PSET " + "LFT 1 " * 33, 1024),
    ],
)
def test_status_code(command: str, code: int) -> None:
    assert ready(line_limit=1000).ask(command)[-1] == f"ERR {code}"


def test_values_before_the_wrong_name_are_printed() -> None:
    assert ready().ask("PGET BAUD OTEMP XX LFT") == ["96", "0", "ERR 64"]


def test_pairs_before_the_wrong_one_stay_set() -> None:
    """§5.1.3: the command is terminated there."""
    bench = ready()
    assert bench.ask("1FSET DP 11 DS 70000 MPE 33") == ["ERR 128"]
    assert bench.get("DP DS MPE", "1") == ["11", "1700", "50"]


def test_no_names_no_lines() -> None:
    bench = ready()
    for command in ("FGET", "PGET", "FSET", "PSET"):
        assert bench.ask(command) == []


def test_arguments_limit() -> None:
    bench = ready(max_arguments=3)
    assert bench.get("P P P") == ["0 0 0 0"] * 3
    assert bench.get("P P P P") == ["ERR 1024"]


# -- lists and texts, all layouts invented ----------------------------------------------------------------------------------

STANDARD, SHOWN_GLOBALS = MOTOR_33[:20], GLOBALS[:7]


@each_row(
    ("command", "names"),
    [
        ("FLIST", STANDARD),
        ("FLISTA", MOTOR_33),
        ("PLIST", SHOWN_GLOBALS),
        ("PLISTA", GLOBALS),
    ],
)
def test_lists_of_names(command: str, names: list[str]) -> None:
    """Advanced parameters only where A is asked (§5.3.4, §5.4.3)."""
    for layout in ("values", "names", "prose"):
        lines = ready(texts=layout).ask(command)
        if layout == "names" and command.endswith("A"):
            assert lines == [" ".join(names)]
        else:
            assert [line.split()[0].rstrip(":") for line in lines] == names


@each_row(
    ("command", "names"),
    [("FLISTV", STANDARD), ("FLISTAV", MOTOR_33), ("PLISTV", SHOWN_GLOBALS), ("PLISTAV", GLOBALS)],
)
def test_lists_of_values(command: str, names: list[str]) -> None:
    bench = ready()
    get = "FGET" if command[0] == "F" else "PGET"
    values = [bench.ask(f"{get} {name}")[0] for name in names]
    assert bench.ask(command) == values
    named = ready(texts="names").ask(command)
    assert named == [f"{name} {value}" for name, value in zip(names, values, strict=True)]
    prose = ready(texts="prose").ask(command)
    assert prose == [f"{name}: {value}" for name, value in zip(names, values, strict=True)]


def test_value_list_of_one_motor() -> None:
    assert ready().ask("SFLISTV")[:6] == ["1575", "315", "256", "256", "60", "60"]


@each_row(
    ("texts", "version", "help_", "error", "parameter"),
    [
        ("values", "4.34", "HI Hand Initialize", "4 Motor not initialized", "DP Default Position"),
        ("names", "Version 4.34", "HI - Hand Initialize", "4 - Motor not initialized", "DP - Default Position"),
        (
            "prose",
            "BarrettHand Firmware 4.34",
            "HI: Hand Initialize",
            "4: Motor not initialized",
            "DP: Default Position",
        ),
    ],
)
def test_texts(texts: str, version: str, help_: str, error: str, parameter: str) -> None:
    bench = ready(texts=texts, firmware="4.34")
    assert bench.ask("VERS") == [version]
    assert bench.ask("?hi") == [help_]
    assert bench.ask("ERR 4") == [error]
    assert bench.ask("FLIST")[0] == parameter


def test_help_hides_the_advanced_commands_but_describes_them() -> None:
    bench = ready()
    listed = [line.split()[0] for line in bench.ask("?")]
    assert len(listed) == 29
    assert not {"A?", "FLISTA", "FLISTAV", "PLISTA", "PLISTAV"} & set(listed)
    assert bench.ask("?FLISTAV") == ["FLISTAV Finger List All Value"]
    assert bench.ask("?A?") == ["A? Help All"]
    assert bench.ask("??") == ["? Help"]


def test_status_codes_are_explained() -> None:
    """§5.1.3, all 15; a sum is taken apart."""
    bench = ready()
    codes = [line.split(" ", 1)[0] for line in bench.ask("ERR")]
    assert codes == [str(2**power) for power in range(15)]
    assert bench.ask("ERR 20") == ["4 Motor not initialized", "16 Couldn't reach position"]
    assert bench.ask("ERR 8196") == ["4 Motor not initialized", "8192 Overtemperature fault tripped"]
    assert bench.ask("ERR 0") == []


# -- options ----------------------------------------------------------------------------------------------------------------


def test_it_is_a_known_kind() -> None:
    assert "barrett" in kinds()


@each_row(
    ("options", "complaint"),
    [
        ({"firmware": "4.5"}, "option firmware=4.5"),
        ({"baud": "115200"}, "option baud=115200"),
        ({"texts": "x"}, "option texts=x"),
        ({"boot": "-1"}, "option boot=-1"),
        ({"fault": "nonsense"}, "unknown fault 'nonsense' of the simulated barrett"),
        ({"nonsense": "1"}, "unknown option 'nonsense' of the simulated barrett"),
    ],
)
def test_bad_options(options: dict[str, str], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint.replace(".", r"\.")) as caught:
        create("barrett", options)
    assert "\n" not in str(caught.value)


def test_same_seed_same_run() -> None:
    def play(seed: int) -> str:
        bench = ready(seed=seed, fault="noise,erratic")
        return "".join(bench.send("FGET DP DS CT OD\r") for _ in range(20))

    assert play(1) == play(1)
    assert play(1) != play(2)
