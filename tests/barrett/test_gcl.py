"""The passthrough: commands told apart, what it does not carry, scripts, completion, help (barrett §5.2)."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace

import pytest

from handctl import connect, interrupts
from handctl.devices.barrett.device import BarrettHand, check_line
from handctl.devices.barrett.gcl import passthrough
from handctl.devices.barrett.gcl.codec import COMMANDS, KINDS, Answer, split
from handctl.devices.barrett.gcl.line import GclLine
from handctl.errors import DeviceRefused, Interrupted, NoAnswer, UsageError
from handctl.model.prompts import Prompts
from handctl.system import signals
from tests.barrett.commands import sent_lines
from tests.barrett.support import ABORT, gcl, scripted, simulated
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.person import person

NAMES = [
    "C",
    "HI",
    "HOME",
    "IC",
    "IO",
    "LOOP",
    "M",
    "O",
    "T",
    "TC",
    "TO",
    "FSET",
    "FGET",
    "FLOAD",
    "FSAVE",
    "FDEF",
    "FLIST",
    "FLISTV",
    "FLISTA",
    "FLISTAV",
    "PSET",
    "PGET",
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
    "ERR",
    "VERS",
]
WITHOUT_PREFIX = [
    "FLIST",
    "FLISTA",
    "PSET",
    "PGET",
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
    "ERR",
    "VERS",
]


# -- the book of commands ---------------------------------------------------------------------------------------------


def test_every_command_of_the_manual() -> None:
    """barrett §5.2.1 to §5.2.5; which take a prefix is said there."""
    assert list(COMMANDS) == NAMES
    assert [name for name in NAMES if not COMMANDS[name].prefix] == WITHOUT_PREFIX
    assert {name: c.argument for name, c in COMMANDS.items() if c.argument} == dict.fromkeys(
        ("IC", "IO", "M"), (0, 20000)
    )
    assert all(command.kind in KINDS for command in COMMANDS.values())
    assert not any(name.startswith(tuple("1234GS")) for name in NAMES), "so a prefix is never ambiguous"


@each_row(
    ("text", "prefix", "name", "arguments"),
    [
        ("12M 5000", "12", "M", ["5000"]), ("SGHOME", "SG", "HOME", []), ("gc", "G", "C", []), ("STC", "S", "TC", []),
        ("sfset ds 100 dp 1500", "S", "FSET", ["DS", "100", "DP", "1500"]), ("?", "", "?", []), ("?HI", "", "?", ["HI"]),
        ("?fset", "", "?", ["FSET"]), ("A?", "", "A?", []), ("  FGET   P ", "", "FGET", ["P"]), ("3FLISTAV", "3", "FLISTAV", []),
        ("1PGET TEMP", "1", "PGET", ["TEMP"]), ("ERR 3", "", "ERR", ["3"]), ("124LOOP", "124", "LOOP", []),
    ],
)  # fmt: skip
def test_split(text: str, prefix: str, name: str, arguments: list[str]) -> None:
    assert split(text) == (prefix, COMMANDS[name], tuple(arguments))


@each_row("text", ["", "FOO", "12", "S", "5M", "M5000", "GG", "1 M", "HIX"])
def test_split_of_no_command(text: str) -> None:
    assert split(text)[1] is None


# -- refusals ---------------------------------------------------------------------------------------------------------


@each_row("text", ["LOOP", "124loop", "RESET", "reset", "PSET BAUD 384", "pset lft 1 baud 6"])
def test_what_would_lose_the_line_is_refused(text: str) -> None:
    with pytest.raises(UsageError) as caught:
        check_line(text)
    assert caught.value.exit_code == 2
    assert caught.value.hint


@each_row("text", ["HI", "PSET LFT 1", "PGET BAUD", "?LOOP", "?RESET", "FOO", "", "PLOAD", "PSAVE"])
def test_what_is_carried(text: str) -> None:
    assert check_line(text) == []


@each_row(
    ("text", "words"),
    [
        ("PSET OTEMP 60", ["OTEMP = 60 (6.0 °C)"]), ("1FSET IVEL 900", ["IVEL = 900"]), ("FSET TSTOP 10000 DP 5", ["TSTOP = 10000"]),
        ("4fset mov 300", ["MOV = 300"]), ("1FSET MOV 300", []), ("PSET OTEMP 0", []), ("FSET CT 20000", ["CT = 20000"]),
        ("FSET MOV", []), ("FSET NOTHING 5", []), ("FGET MOV", []), ("FOO", []), ("", []),
        ("2FSET LCVC 8 OT 60000", ["LCVC = 8", "OT = 60000"]),
    ],
)  # fmt: skip
def test_the_manuals_traps_are_noted(text: str, words: list[str]) -> None:
    """What the manual warns of is refused as `set` refuses it, and said where it is forced (§5.3.4, dossier 3.1)."""
    found = check_line(text, force=True)
    assert len(found) == len(words) and all(word in note for word, note in zip(words, found, strict=True)), found
    if words:
        with pytest.raises(UsageError) as caught:
            check_line(text)
        assert caught.value.code == "careful"
    else:
        assert check_line(text) == []


@each_row("value", ["+4000", "-1", "4e3", "0x10", "300.0", "x"])
def test_a_value_that_cannot_be_read_is_not_guessed(value: str) -> None:
    with pytest.raises(UsageError) as caught:
        check_line(f"FSET IVEL {value}")
    assert caught.value.code == "careful"
    assert check_line(f"FSET IVEL {value}", force=True) == check_line(f"FSET XX {value}") == []


@each_row("text", ["FSET LFVC 0", "2FSET LFDPC 0", "FSET ACCEL 0", "PSET OTEMP 1251", "FSET EN 2"])
def test_a_value_out_of_range_is_refused_as_set_does(text: str) -> None:
    """0 as a divisor of the RealTime feedback is a division by zero in the hand (dossier 3.1)."""
    with pytest.raises(UsageError) as caught:
        check_line(text)
    assert caught.value.code == "out-of-range"
    check_line(text, force=True)


GUARDED = ["IVEL 4000", "TSTOP 10000", "MOV 2000", "LCVC 8", "OT 20000", "SAMPLE 15"]
PATHS = {
    "gcl": ("gcl", "FSET {}"),
    "gcl, the second line": ("gcl", "FGET P", "3FSET DP 5 {}"),
    "gcl --file": ("gcl", "--file", "@FSET {}"),
    "terminal": ("terminal", "FSET {}", "-y"),
    "terminal, in bytes": ("terminal", "hex {hex}", "-y"),
    "set": ("set", "{}"),
}


@each_row("path", PATHS)
@each_row("text", GUARDED)
def test_a_guarded_value_needs_force_on_every_path(path: str, text: str, tmp_path: Path) -> None:
    """Not one byte goes out; and where there is a --force, it goes out with a warning."""
    trace, name = tmp_path / "t.txt", text.replace(" ", "=")
    digits = f"fset {text}\x09\r".encode().hex(" ")
    words = [word.format(name if path == "set" else text, hex=digits) for word in PATHS[path]]
    for place, word in enumerate(words):
        if word.startswith("@"):
            (tmp_path / "script").write_text(f"# guarded\n{word[1:]}\n", encoding="utf-8")
            words[place] = str(tmp_path / "script")
    link = ("-p", "fake://barrett?clock=virtual&initialized=1", "--json", "--trace", str(trace))
    result = run("barrett", *words, *link)
    assert (result.code, result.error["code"]) == (2, "careful"), result
    assert not trace.exists() or sent_lines(trace) == []
    if words[0] != "terminal":
        forced = run("barrett", *words, "--force", *link)
        assert forced.code == 0 and "careful" in [message["code"] for message in forced.json["messages"]], forced


HARMFUL = {
    "HI": "IVEL 900",
    "GO": "MOV 900",
    "GTO": "MOV 900",
    "12IO 500": "MOV 900",
    "GHOME": "MOV 900",
    "1M 100": "MOV 900",
    "go": "MOV 900",
}
OPENING = {
    "gcl": ("gcl", "{}"),
    "gcl, the second line": ("gcl", "FGET P", "{}"),
    "gcl --file": ("gcl", "--file", "@{}"),
    "terminal": ("terminal", "{}", "-y"),
    "terminal, in bytes": ("terminal", "hex {hex}", "-y"),
}


@each_row("path", OPENING)
@each_row("line", HARMFUL)
def test_an_opening_that_may_harm_needs_force_on_every_path(path: str, line: str, tmp_path: Path) -> None:
    """Whoever has set the velocity, a typed opening is refused as `open` and `init` are (barrett §5.3.4 IVEL)."""
    state, trace = tmp_path / "state.json", tmp_path / "t.txt"
    state.unlink(missing_ok=True)
    link = ("-p", f"fake://barrett?clock=virtual&initialized=1&state={state}", "--json")
    assert run("barrett", "gcl", "GM 5000", f"FSET {HARMFUL[line]}", "--force", *link).code == 0
    words = [word.format(line, hex=f"{line}\r".encode().hex(" ")) for word in OPENING[path]]
    for place, word in enumerate(words):
        if word.startswith("@"):
            (tmp_path / "script").write_text(f"{word[1:]}\n", encoding="utf-8")
            words[place] = str(tmp_path / "script")
    result = run("barrett", *words, *link, "--trace", str(trace))
    assert (result.code, result.error["code"]) == (2, "opening-speed"), result
    assert line not in sent_lines(trace) and "--force" in result.error["hint"]
    if words[0] == "gcl":
        forced = run("barrett", *words, "--force", *link, "--trace", str(trace))
        assert forced.code in (0, 6) and line in sent_lines(trace), forced


@each_row("line", ["C", "GIC 500", "1M 9000", "T", "FGET P", "1M x"])
def test_what_opens_nothing_is_not_asked_about(line: str) -> None:
    hand, link = simulated()
    hand.line.ask("FSET MOV 4080")
    with suppress(UsageError):
        passthrough.run_all(hand, [passthrough.line_of(line)], keep_going=False)
    assert line in link.commands


def test_the_library_refuses_a_guarded_value() -> None:
    with connect("barrett", "fake://barrett?clock=virtual") as hand:
        with pytest.raises(UsageError):
            hand.gcl("FSET IVEL 4000")
        assert {row["value"] for row in hand.get("IVEL")} == {300, 150}


def test_from_the_first_line_that_may_move_death_stops_the_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    """A read sets up no child; a command that nobody knows may move something; behind a new baud rate it is another child."""
    lines = ["FGET P", "FSET DP 5", "1C", "1O", "PLOAD", "FGET P", "1M 50", "1FOO"]
    seen: list[object] = []
    ask = GclLine.ask

    @contextmanager
    def guarded(self: BarrettHand, **how: object) -> Iterator[None]:
        seen.append(how)
        yield
        seen.append("over")

    def noted(self: GclLine, command: str, **more: float) -> Answer:
        if command in (*lines, "FOO"):  # not what is asked before an opening
            seen.append(command)
        return ask(self, command, **more)

    monkeypatch.setattr(BarrettHand, "guarded", guarded)
    monkeypatch.setattr(GclLine, "ask", noted)
    run("barrett", "gcl", *lines, "--keep-going", "-y", "-p", "fake://barrett?clock=virtual&initialized=1")
    on: dict[str, object] = {}  # as `stop` does
    assert seen == ["FGET P", "FSET DP 5", on, "1C", "1O", "over", "PLOAD", "FGET P", on, "1M 50", "1FOO", "over"]
    seen.clear()
    run("barrett", "gcl", "FGET P", "FOO", "-p", "fake://barrett?clock=virtual")
    assert seen == ["FGET P", on, "FOO", "over"]


def test_saves_are_known() -> None:
    lines = ["HI", "123fsave", "FGET P", "PSAVE", "?PSAVE", "FLOAD"]
    assert [text for text in lines if passthrough.saves([text])] == ["123fsave", "PSAVE"]


def test_script() -> None:
    lines = ["HI\n", "\n", "# all\n", "  GC  # close\n", "#\n", "FGET P S", "   \n"]
    assert [(line.text, line.number) for line in passthrough.script(lines)] == [("HI", 1), ("GC", 4), ("FGET P S", 6)]
    assert passthrough.script([]) == []


# -- sending ----------------------------------------------------------------------------------------------------------


def lines_of(texts: list[str]) -> list[passthrough.ScriptLine]:
    return [passthrough.line_of(text) for text in texts]


def test_rows_are_the_hands_own_text() -> None:
    hand, _ = scripted({"FGET P S": "1 2 3 4|0 0 0 0", "err 3": "1 No motor board found"})
    table = passthrough.run_all(hand, lines_of(["FGET P S", "err 3"]), keep_going=False)
    assert table.rows == [
        {"command": "FGET P S", "lines": ["1 2 3 4", "0 0 0 0"], "text": "1 2 3 4\n0 0 0 0", "status": 0},
        {"command": "err 3", "lines": ["1 No motor board found"], "text": "1 No motor board found", "status": 0},
    ]
    assert table.failure is None
    assert passthrough.as_text(table.rows) == "=> FGET P S\n1 2 3 4\n0 0 0 0\n=> err 3\n1 No motor board found\n"


@each_row(("keep_going", "sent"), [(False, ["VERS", "FOO"]), (True, ["VERS", "FOO", "1T", "VERS"])])
def test_the_first_error(keep_going: bool, sent: list[str]) -> None:
    hand, link = scripted({"VERS": "4.33", "FOO": "ERR 32", "1T": "ERR 4"})
    table = passthrough.run_all(hand, lines_of(["VERS", "FOO", "1T", "VERS"]), keep_going=keep_going)
    assert link.commands == sent
    assert [row["command"] for row in table.rows] == sent
    assert table.rows[1]["error"] == "ERR 32: Unknown command (32)"
    assert isinstance(table.failure, DeviceRefused)
    assert (table.failure.code, table.failure.exit_code) == ("err-32", 6)
    assert "ERR 32: Unknown command (32)\n" in passthrough.as_text(table.rows)


def test_a_lost_answer_is_not_repeated() -> None:
    """What came before it is told all the same, and nothing goes out behind it."""
    hand, link = scripted({"FGET S": "0 0 0 0", "FGET P": None})
    table = passthrough.run_all(hand, lines_of(["FGET S", "FGET P", "VERS"]), keep_going=True)
    assert isinstance(table.failure, NoAnswer)
    assert link.commands == ["FGET S", "FGET P"]
    assert [(row["command"], row["status"], "error" in row) for row in table.rows] == [
        ("FGET S", 0, False),
        ("FGET P", None, True),
    ]


@each_row("command", ["PLOAD", "PDEF"])
def test_the_speed_is_looked_for_after_what_may_change_it(command: str) -> None:
    """PDEF goes to 9600, PLOAD to the saved speed (dossier 1.2)."""
    hand, link = simulated("baud=9600")
    link.set_baud(9600)
    hand.line.change_speed(384)
    assert link.baud == 38400
    passthrough.run_all(hand, lines_of([command]), keep_going=False)
    assert link.baud == 9600
    assert hand.version() == "4.33"


def test_interrupted() -> None:
    hand, link = simulated()
    link.interrupt_at = link.now() + 0.3
    table = passthrough.run_all(hand, lines_of(["GC", "FGET P"]), keep_going=False)
    assert isinstance(table.failure, Interrupted) and table.failure.exit_code == 130
    assert "16384" in table.failure.text
    assert ABORT in link.sent
    assert link.commands == ["GC", "FGET P HOLD", "FGET P HOLD"], "what is left of the script is not sent"


# -- completion and help ----------------------------------------------------------------------------------------------


@each_row(
    ("line", "word", "wanted"),
    [
        ("HO", "HO", ["HOME "]), ("12h", "12h", ["12HI ", "12HOME "]), ("FS", "FS", ["FSET ", "FSAVE "]),
        ("1P", "1P", []), ("v", "v", ["VERS "]), ("FGET SG", "SG", ["SG ", "SGFLIP "]), ("fget tst", "tst", ["TSTOP "]),
        ("FGET P LF", "LF", ["LFV ", "LFVC ", "LFS ", "LFAP ", "LFDP ", "LFDPC ", "LFT ", "LFDPD ", "LFBP ", "LFAIN "]), ("XX", "XX", []),
        ("gt", "gt", ["GT ", "GTC ", "GTO "]),
    ],
)  # fmt: skip
def test_candidates(line: str, word: str, wanted: list[str]) -> None:
    assert passthrough.candidates(line, word) == wanted


def test_an_empty_line_offers_all_commands() -> None:
    assert [word.strip() for word in passthrough.candidates("", "")] == NAMES
    assert [word.strip() for word in passthrough.candidates("S", "S")] == [
        f"S{n}" for n in NAMES if n not in WITHOUT_PREFIX
    ]


def test_help_texts() -> None:
    lines = passthrough.explain_help("?").splitlines()
    assert [line.split()[0] for line in lines] == NAMES
    assert "0..20000" in passthrough.explain_help("?m")
    assert "§5.2.2" in passthrough.explain_help("?FSAVE")
    assert "5,000" in passthrough.explain_help("?FSAVE")
    assert "16..4080" in passthrough.explain_help("?IVEL")
    assert passthrough.explain_help("?NOTHING") == ""


@each_row("more", [("--json",), ("--csv",), ("-o", "data.txt")])
def test_a_prompt_is_for_a_terminal(more: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was typed and answered is no JSON, CSV or file: refused before anything is sent (contract 4)."""
    monkeypatch.chdir(tmp_path)
    shown = person("barrett", "gcl", "-p", "fake://barrett?clock=virtual", *more, answers=["VERS"])
    assert shown.code == 2
    assert "interactive terminal" in " ".join(shown.text.split()) and "=> " not in shown.text
    assert not (tmp_path / "data.txt").exists()


# -- damage, and Ctrl-C at the prompt ---------------------------------------------------------------------------------


def test_a_damaged_character_is_no_answer() -> None:
    """GCL is text of seven bits: a character with bit 7 set was damaged on the line. What came is shown all the same."""
    hand, _ = scripted({"VERS": (gcl("VERS", "4.33").replace(b"4.33", b"4.\xb33"),)})
    table = passthrough.run_all(hand, lines_of(["VERS"]), keep_going=False)
    assert table.failure is not None
    assert (table.failure.exit_code, table.failure.code) == (5, "damaged")
    assert [row["command"] for row in table.rows] == ["VERS"]


def test_a_damaged_answer_to_a_question_is_asked_again() -> None:
    hand, link = scripted({"VERS": (gcl("VERS", "4.33").replace(b"4.33", b"4.\xb33"), gcl("VERS", "4.33"))})
    assert hand.version() == "4.33"
    assert link.commands.count("VERS") == 2


def test_a_movement_is_interrupted_however_soon_after_a_ctrl_c_at_the_prompt(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two signals within half a second are one wish; but a wish that the prompt has answered is over."""
    hand, link = scripted({"FGET P HOLD": "5 5 5 5|0 0 0 1"})
    typed = iter(["", "12C", None])

    def read_line(_prompt: str) -> str:
        text = next(typed)
        if text is None:
            raise EOFError
        if not text:
            signal.raise_signal(signal.SIGINT)
        return text

    def moves(command: str, **_: object) -> object:
        signal.raise_signal(signal.SIGINT)
        raise AssertionError(f"{command} goes on")

    before = {number: signal.getsignal(number) for number in signals.numbers(suspend=False)}
    interrupts.end_on_signals(suspend=False)
    try:
        monkeypatch.setattr(hand.line, "ask", moves)
        run = SimpleNamespace(prompts=Prompts(), out=lambda text: None)
        passthrough.interactive(run, hand, read_line, lambda text: None)  # type: ignore[arg-type]
    finally:
        signals.give_back(before.items())
    assert ABORT in link.sent
