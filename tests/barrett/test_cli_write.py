"""`handctl barrett` writing: exact bytes, ranges, confirmations, speed, files, EEPROM."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest

from handctl.command import snapshots
from handctl.devices.barrett.device import BarrettHand
from handctl.sim.barrett.parameter_tables import Bank
from tests.barrett.commands import (
    MOTORS,
    POWER_ON,
    SETTINGS,
    STORED,
    WRITING,
    Command,
    eeprom,
    factory,
    fake,
    key_of,
    names,
    power_on,
    prepare,
    ram,
    saves,
    sent_lines,
    values_of,
    written_lines,
)
from tests.support.cli import Result, run, spying
from tests.support.each_row import each_row
from tests.support.swap import swapped

CLEAN = {"sent": 0, "received": 0, "retries": 0, "bad_frames": 0, "stray_bytes": 0}


@pytest.fixture
def scratch(tmp_path: Path) -> Path:
    prepare(tmp_path)
    return tmp_path


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The journal of saves goes to the test's own directory."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def ids(command: Command) -> str:
    return command.name


def do(*args: str | Path, port: str | None = None, **more: Any) -> Result:
    return run("barrett", *args, "-p", port or fake(), "--json", **more)


# -- writing ----------------------------------------------------------------------------------------------------------


@each_row("command", WRITING, ids=ids)
def test_dry_run_prints_the_bytes_and_sends_nothing(scratch: Path, command: Command) -> None:
    """Needs no device; asks nothing."""
    if command.name == "restore":
        return test_restore_dry_run(scratch)
    result = run("barrett", *command.words(scratch), "-n", "--json")
    assert (result.code, result.json["counters"]) == (0, CLEAN), result
    planned = [line for line in result.rows if not line["meaning"].startswith(("FGET", "2FGET", "^C"))]
    assert [row["bytes"] for row in planned] == [f"{line}\r".encode().hex(" ").upper() for line in command.lines]
    return None


def test_restore_dry_run(scratch: Path) -> None:
    """What already holds is only known with the hand: every value of the file is planned, the speed last."""
    result = do("restore", scratch / "stored.json", "-n")
    assert (result.code, result.json["counters"]) == (0, CLEAN)
    lines = [bytes.fromhex(row["bytes"]).decode() for row in result.rows]
    assert all(line.endswith("\r") and len(line) <= 71 for line in lines)
    planned: dict[str, int] = {}
    for line in lines:
        head, *words = line.split()
        verb = head.lstrip("1234")
        assert verb in ("FSET", "PSET")
        for mnemonic, value in zip(words[::2], words[1::2], strict=True):
            for digit in head.removesuffix(verb) or ("1234" if verb == "FSET" else "0"):
                motor = f".{MOTORS[int(digit) - 1]}" if digit != "0" else ""
                planned[POWER_ON[mnemonic][0] + motor] = int(value)
    assert planned == {**factory(), **STORED}
    assert lines[-1] == "PSET BAUD 96\r"
    assert "\n".join(lines).count("BAUD") == 1


@each_row("command", WRITING, ids=ids)
def test_writing(scratch: Path, command: Command) -> None:
    trace = scratch / "t.txt"
    yes = ["--yes"] if command.asks else []
    with spying() as spy:
        result = do(*command.words(scratch), *yes, "--trace", trace)
    assert result.code == 0, result
    assert written_lines(trace) == list(command.lines)
    assert {key: row["value"] for row in result.rows if (key := key_of(row))} == command.shows(power_on())
    held = {mnemonic: POWER_ON[mnemonic][2] for mnemonic in SETTINGS} | dict(command.ram)
    assert {mnemonic: ram(spy, mnemonic) for mnemonic in SETTINGS} == held


@pytest.mark.parametrize("command", [command for command in WRITING if command.asks], ids=ids)
def test_confirmation(scratch: Path, command: Command) -> None:
    trace = scratch / "t.txt"
    result = do(*command.words(scratch), "--trace", trace)
    assert (result.code, result.json["ok"]) == (8, False)
    assert "--yes" in result.error["hint"]
    assert not trace.exists() or written_lines(trace) == []


@each_row(
    "texts",
    [
        ("MCV=15",), ("MCV=4081",), ("DP=65536",), ("DP=-1",), ("HSG=257",), ("EN=2",), ("LCVC=0",), ("LFVC=0",),
        ("LFDPC=256",), ("ACCEL=0",), ("OTEMP=1251",), ("FPG=256",), ("MCV.F1=80", "MCV.F2=5"), ("P=1",), ("TEMP=1",),
        ("SN=1",), ("OD.F1=1",), ("NOTHING=1",), ("DP.F4=1",), ("DP.F1=",), ("DP",), ("DP=1.5",), ("DP=x",),
    ],
)  # fmt: skip
def test_out_of_range_is_refused_before_anything_is_sent(tmp_path: Path, texts: tuple[str, ...]) -> None:
    trace = tmp_path / "t.txt"
    for force in ([], ["--force"]):
        result = do("set", *texts, *force, "--trace", trace)
        assert (result.code, result.json["counters"]) == (2, CLEAN), result
        assert not trace.exists() or sent_lines(trace) == []


@pytest.mark.parametrize(
    ("text", "word", "line"),
    [
        ("OTEMP=60", "6.0 °C", "PSET OTEMP 60"),
        ("OTEMP=299", "29.9 °C", "PSET OTEMP 299"),
        ("IVEL.F1=301", "deforms the clutch", "1FSET IVEL 301"),
        ("IVEL.S=151", "deforms the clutch", "4FSET IVEL 151"),
        ("TSTOP=31", "heat up", "FSET TSTOP 31"),
        ("SAMPLE.F3=30", "not to change", "3FSET SAMPLE 30"),
        ("SGFLIP=1", "strain", "FSET SGFLIP 1"),
        ("IHIT.F1=6", "5 hits", "1FSET IHIT 6"),
        ("IOFF.F2=501", "0 to 500", "2FSET IOFF 501"),
    ],
)
def test_careful_values_need_force(tmp_path: Path, text: str, word: str, line: str) -> None:
    trace = tmp_path / "t.txt"
    result = do("set", text, "--trace", trace)
    assert (result.code, result.error["code"], result.json["counters"]) == (2, "careful", CLEAN)
    assert word in result.error["text"] and "--force" in result.error["hint"]
    assert not trace.exists() or sent_lines(trace) == []
    forced = do("set", text, "--force", "--trace", trace)
    assert (forced.code, written_lines(trace)) == (0, [line])
    (warning,) = [m for m in forced.json["messages"] if m["level"] == "warning"]
    assert word in warning["text"]


@pytest.mark.parametrize("text", ["OTEMP=0", "OTEMP=300", "IVEL.F1=300", "IVEL.S=150", "TSTOP=30", "HSG=255"])
def test_values_up_to_the_border_need_none(text: str) -> None:
    result = do("set", text, "--always")
    assert (result.code, result.json["messages"]) == (0, [])


@pytest.mark.parametrize(
    ("motors", "prefix"),
    [
        ("12S", "124"),
        ("S", "4"),
        ("G", "123"),
        ("4", "4"),
        ("gs", "1234"),
        ("321", "123"),
        ("F1,F3", "13"),
        ("all", "1234"),
    ],
)
def test_motors(tmp_path: Path, motors: str, prefix: str) -> None:
    """Whoever names all four means those with EN 0 too; without a prefix these stay out (§5.2.1)."""
    trace = tmp_path / "t.txt"
    for args, line in ((("move", "100"), "M 100"), (("set", "DP=100"), "FSET DP 100")):
        result = do(*args, "--motors", motors, "--trace", trace)
        assert result.code == 0
        assert written_lines(trace) in ([prefix + line], [line] if args[0] == "set" and prefix == "1234" else [])
        expected = [MOTORS[int(digit) - 1] for digit in prefix]
        assert [row["motor"] for row in result.rows] == expected
    assert do("stop", "--motors", motors, "--trace", trace).code == 0
    assert written_lines(trace) == [f"{prefix}T"]
    assert do("move", "--motors", "5").code == 2


def test_one_value_for_several_motors_shares_a_line(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    assert do("set", "DP.F1=5", "DP.F3=5", "DP.S=7", "--trace", trace).code == 0
    assert written_lines(trace) == ["13FSET DP 5", "4FSET DP 7"]


def test_set_baud_asks_as_its_verb_does(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    assert do("set", "BAUD=384", "--trace", trace).code == 8
    assert not trace.exists() or written_lines(trace) == []
    result = do("set", "BAUD=384", "--yes", "--trace", trace)
    assert (result.code, values_of(result)) == (0, {("BAUD", None): 384})
    assert written_lines(trace) == ["PSET BAUD 384"]


@pytest.mark.parametrize("rate", ["600", "1200", "2400", "4800", "9600", "19200", "38400"])
def test_every_speed_from_every_other(tmp_path: Path, rate: str) -> None:
    for start in ("600", "9600", "38400"):
        port = fake(state=tmp_path / f"{start}.json", baud=start)
        assert values_of(do("baud", rate, "--yes", port=port)) == {("BAUD", None): int(rate) // 100}
        assert do("get", "SN", port=port).rows[0]["value"] == 1042
    for rate in ("57600", "9601", "300", "96", "0", "384"):
        assert do("baud", rate, "--yes").code == 2


def test_a_hand_that_cannot_do_the_speed() -> None:
    result = do("baud", "38400", "--yes", port=fake(max_baud=19200))
    assert result.code in (3, 6, 7), result
    assert "9600" in json.dumps(result.json["messages"])


def test_reset_shows_the_banner_and_loads_what_was_saved(tmp_path: Path) -> None:
    port = fake(state=tmp_path / "state.json")
    assert do("set", "DP=3000", port=port).code == 0
    result = do("reset", "-y", port=port)
    assert (result.code, result.rows[0]["value"]) == (0, "BarrettHand Firmware\nVersion 4.33")
    assert "init" in json.dumps(result.json["messages"])
    after = values_of(do("get", "DP", "S", port=port))
    assert after == {**names("DP")(power_on()), **{("S", motor): 4 for motor in MOTORS}}


def test_load_and_defaults(tmp_path: Path) -> None:
    port = fake(state=tmp_path / "state.json")
    assert do("set", "DP=3000", "LFT=1", port=port).code == 0
    assert do("gcl", "FSAVE", "PSAVE", "--yes", port=port).code == 0
    assert do("defaults", "-y", port=port).code == 0
    assert values_of(do("dump", port=port)).items() >= names(*SETTINGS)(power_on()).items()
    assert do("load", "-y", port=port).code == 0
    assert values_of(do("get", "DP.F1", "LFT", port=port)) == {("DP", "F1"): 3000, ("LFT", None): 1}


@pytest.mark.parametrize(("verb", "named"), [("load", "FLOAD"), ("defaults", "FDEF")])
def test_one_motor_is_loaded_alone(tmp_path: Path, verb: str, named: str) -> None:
    """3FLOAD, SFDEF (§5.2.2): neither the other motors, nor the hand's own settings, nor its speed."""
    port, trace = fake(state=tmp_path / "state.json"), tmp_path / "t.txt"
    assert do("set", "DP=3000", "LFT=1", port=port).code == 0
    result = do(verb, "--motors", "3", "--trace", trace, port=port)
    assert (result.code, written_lines(trace)) == (0, [f"3{named}"])
    assert values_of(do("get", "DP", "LFT", port=port)) == {
        ("DP", "F1"): 3000, ("DP", "F2"): 3000, ("DP", "F3"): 8500, ("DP", "SPREAD"): 3000, ("LFT", None): 1,
    }  # fmt: skip


def states(result: Result) -> list[str]:
    return [row["state"] for row in result.json["writes"]]


@pytest.mark.parametrize("deaf", [False, True])
def test_factory_values_are_read_back(tmp_path: Path, deaf: bool) -> None:
    """FDEF is acknowledged by a prompt, also where nothing has changed: only the values show it."""
    port = fake(state=tmp_path / "state.json")
    assert do("set", "DP=3000", "LFT=1", port=port).code == 0
    with swapped((Bank, "default", lambda *_: None)) if deaf else nullcontext():
        result = do("defaults", "-y", port=port)
    assert (result.code, states(result)) == ((7, ["sent", "sent"]) if deaf else (0, ["confirmed"] * 2))
    assert not deaf or result.error["code"] == "read-back"


def test_other_factory_values_are_no_failure(tmp_path: Path) -> None:
    """The manual's table is of one firmware."""
    port, usual = fake(state=tmp_path / "state.json"), Bank.default
    assert do("set", "DP=3000", port=port).code == 0

    def other(bank: Bank, numbers: tuple[int, ...]) -> None:
        usual(bank, numbers)
        for number in numbers if "DP" in bank.values else ():
            bank.values["DP"][number] = 9000

    with swapped((Bank, "default", other)):
        result = do("defaults", "-y", "--motors", "1", port=port)
    assert (result.code, states(result), result.codes().count("other-defaults")) == (0, ["confirmed"], 1)


def test_a_load_is_said_where_it_was_seen(tmp_path: Path) -> None:
    """A value that has changed, or RAM as handctl saved it, shows a load; else it is acknowledged, and no more."""
    port = fake(state=tmp_path / "state.json")
    unseen = do("load", "-y", port=port)  # RAM and EEPROM are alike, and handctl has never saved
    assert (unseen.code, states(unseen), unseen.codes().count("load-unseen")) == (0, ["sent", "sent"], 2)
    assert do("set", "DP=3000", "LFT=1", port=port).code == 0
    with swapped((Bank, "load", lambda *_: None)):
        deaf = do("load", "-y", port=port)
    assert (deaf.code, states(deaf)) == (0, ["sent", "sent"])
    seen = do("load", "-y", port=port)
    assert (states(seen), seen.codes().count("loaded")) == (["confirmed"] * 2, 2)
    assert do("save", "-y", port=port).code == 0
    assert states(do("load", "-y", port=port)) == ["confirmed"] * 2  # as handctl saved it last
    assert do("set", "DP=3000", port=port).code == 0
    assert do("gcl", "FSAVE", "-y", port=port).code == 0  # of unknown values
    assert do("save", "-y", "--motors", "1", port=port).code == 0
    assert do("set", "DP=3100", port=port).code == 0
    with swapped((Bank, "load", lambda *_: None)):
        deaf = do("load", "-y", "--motors", "1", port=port)
    assert (states(deaf), "saved-elsewhere" in deaf.codes()) == (["sent"], True)


def test_a_load_tells_of_values_that_set_refuses(tmp_path: Path) -> None:
    """They were saved by whoever; from now on the hand opens so fast, as far as nothing refuses it."""
    port = fake(state=tmp_path / "state.json")
    assert "careful" not in do("load", "-y", port=port).codes()
    assert do("gcl", "FSET IVEL 900", "FSAVE", "FDEF", "--force", "-y", port=port).code == 0
    result = do("load", "-y", port=port)
    told = [message["text"] for message in result.json["messages"] if message["code"] == "careful"]
    assert result.code == 0 and "careful" in result.codes() and "IVEL = 900" in " ".join(told), result
    assert do("gcl", "HI", port=port).code == 2


def test_some_motors_are_saved_alone(tmp_path: Path) -> None:
    """123FSAVE (§5.2.2): the spread and the hand's own settings stay as saved, and the journal knows it."""
    port, trace = fake(state=tmp_path / "state.json"), tmp_path / "t.txt"
    with spying() as spy:
        assert do("save", "--yes", port=port).code == 0
        assert do("set", "DP=77", "LFT=1", port=port).code == 0
        result = do("save", "--motors", "G", "--yes", "--trace", trace, port=port)
        assert (result.code, written_lines(trace)) == (0, ["123FSAVE"])
        assert [row["name"] for row in result.rows] == [f"default_position.F{n}" for n in (1, 2, 3)]
        assert eeprom(spy, "DP") == (77, 77, 77, 1575) and eeprom(spy, "LFT") == (0,)
        assert do("save", "--motors", "G", "--yes", port=port).code == 2  # nothing of theirs has changed
        rest = do("save", "--yes", "--trace", trace, port=port)
        assert [row["name"] for row in rest.rows] == ["default_position.SPREAD", "loop_feedback_temperature"]
        assert eeprom(spy, "DP") == (77, 77, 77, 77) and eeprom(spy, "LFT") == (1,)
    assert [row["meaning"] for row in do("save", "--motors", "3", "-n").rows] == ["3FSAVE"]


# -- files ------------------------------------------------------------------------------------------------------------


def test_snapshot_diff_restore(tmp_path: Path) -> None:
    port, file, trace = fake(state=tmp_path / "state.json"), tmp_path / "snap.json", tmp_path / "t.txt"
    assert do("snapshot", file, port=port).code == 0
    content = json.loads(file.read_text(encoding="utf-8"))
    assert content["values"] == factory() and len(content["values"]) == 31 * 4 + 4
    assert content["device"]["serial_number"] == 1042 and content["device"]["firmware"] == "4.33"
    assert do("diff", file, port=port).code == 0
    assert do("set", "DP.F2=4321", "LFT=1", port=port).code == 0
    different = do("diff", file, port=port)
    assert different.code == 7 and {row["name"] for row in different.rows} == set(STORED)
    restored = do("restore", file, "--yes", "--trace", trace, port=port)
    assert restored.code == 0 and written_lines(trace) == ["PSET LFT 0", "2FSET DP 8500"]
    assert "EEPROM" in json.dumps(restored.json)
    assert do("diff", file, port=port).code == 0
    assert do("restore", file, "--yes", "--trace", trace, port=port).code == 0 and written_lines(trace) == []


def test_a_snapshot_of_another_hand_is_called_that(tmp_path: Path) -> None:
    """The serial number of an upgraded hand is 0 and tells nothing."""
    file = tmp_path / "snap.json"
    for theirs, told in ((1042, False), (312, True), (0, False)):
        snapshots.write(str(file), snapshots.make("barrett", {"serial_number": theirs}, factory(), link="", fake=True))
        for command in (("restore", file, "--yes"), ("diff", file)):
            codes = [message["code"] for message in do(*command).json["messages"]]
            assert ("other-device" in codes) is told, (theirs, command)


def test_a_restart_within_a_restore_is_no_success(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Noticed while the last values were read back, which are right: those of before are the EEPROM's again."""
    file, trace = tmp_path / "snap.json", tmp_path / "t.txt"
    snapshots.write(str(file), snapshots.make("barrett", {}, factory() | STORED, link="", fake=True))
    write = BarrettHand.write

    def restarting(hand: BarrettHand, changes: Any) -> Any:
        hand.journal.warn("restarted", "noticed by a read")
        return write(hand, changes)

    monkeypatch.setattr(BarrettHand, "write", restarting)
    restored = do("restore", file, "--save", "--yes", "--trace", trace)
    assert (restored.code, restored.error["code"]) == (5, "restarted")
    assert "FSAVE" not in written_lines(trace)


def test_restore_changes_the_speed_last(tmp_path: Path) -> None:
    port, file, trace = fake(state=tmp_path / "state.json"), tmp_path / "snap.json", tmp_path / "t.txt"
    assert do("snapshot", file, port=port).code == 0
    assert do("set", "DP=1", port=port).code == 0
    assert do("baud", "38400", "--yes", port=port).code == 0
    assert do("restore", file, "--yes", "--trace", trace, port=port).code == 0
    assert written_lines(trace) == ["123FSET DP 8500", "4FSET DP 1575", "PSET BAUD 96"]
    assert do("diff", file, port=port).code == 0


@pytest.mark.parametrize("damage", ["byte", "foreign", "missing", "careful"])
def test_restore_refuses_before_anything_is_sent(scratch: Path, damage: str) -> None:
    file, trace = scratch / "stored.json", scratch / "t.txt"
    if damage == "byte":
        file.write_text(file.read_text(encoding="utf-8").replace("4321", "4322"), encoding="utf-8")
    elif damage == "foreign":
        file.unlink()
        assert run("exo", "snapshot", file, "--fake").code == 0
    elif damage == "missing":
        file.unlink()
    else:
        values = {**factory(), "init_velocity.F1": 400}
        snapshots.write(str(file), snapshots.make("barrett", {"kind": "barrett"}, values, link="x", fake=True))
    result = do("restore", file, "--yes", "--trace", trace)
    assert (result.code, result.json["counters"]) == (2, CLEAN), result
    assert not trace.exists() or sent_lines(trace) == []


# -- EEPROM -----------------------------------------------------------------------------------------------------------


def test_save_is_counted_and_refused_when_nothing_changed(tmp_path: Path) -> None:
    port, trace = fake(state=tmp_path / "state.json"), tmp_path / "t.txt"
    with spying() as spy:
        first = do("save", "--yes", port=port)
        assert first.code == 0 and "1 by handctl, of at most 5000" in json.dumps(first.json["messages"])
        assert saves(spy) == (1, 1)
        again = do("save", "--yes", "--trace", trace, port=port)
        assert (again.code, written_lines(trace)) == (2, []) and "--force" in again.error["hint"]
        assert do("set", "DP.F1=7", port=port).code == 0
        second = do("save", "--yes", "--trace", trace, port=port)
        assert second.code == 0 and written_lines(trace) == ["FSAVE"]  # nothing global has changed
        assert (saves(spy), eeprom(spy, "DP")) == ((2, 1), (7, 8500, 8500, 1575))
        assert [(row["name"], row["last_save"], row["value"]) for row in second.rows] == [
            ("default_position.F1", 8500, 7)
        ]
        assert "2 by handctl" in json.dumps(second.json["messages"])


def test_save_with_a_changed_speed(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = do("save", "--yes", "--trace", trace, port=fake(baud=38400))
    assert (result.code, result.error["code"], written_lines(trace)) == (2, "baud-not-default", [])
    assert "baud 9600" in result.error["hint"]
    assert do("save", "--yes", "--force", "--trace", trace, port=fake(baud=38400)).code == 0
    assert written_lines(trace) == ["FSAVE", "PSAVE"]


def test_every_save_is_counted(tmp_path: Path) -> None:
    """Whichever command wrote the EEPROM: the count is of the hand, and what it holds is known."""
    port = fake(state=tmp_path / "state.json")
    with spying() as spy:
        assert do("save", "--yes", port=port).code == 0
        assert do("baud", "38400", "--save", "--yes", port=port).code == 0
        assert eeprom(spy, "BAUD") == (384,)
        assert do("baud", "9600", "--yes", port=port).code == 0
        last = do("save", "--yes", port=port)  # BAUD differs from what the EEPROM holds
        assert last.code == 0, last
        assert eeprom(spy, "BAUD") == (96,)
        assert "3 by handctl" in json.dumps(last.json["messages"])
        assert do("restore", "--help").code == 0


def test_restore_and_save(scratch: Path) -> None:
    with spying() as spy:
        assert do("restore", scratch / "stored.json", "--save", "--yes").code == 0
        assert eeprom(spy, "DP") == (8500, 4321, 8500, 1575) and eeprom(spy, "LFT") == (1,)


@pytest.mark.parametrize("name", ["stored.json", "factory.json"])
def test_restore_asks_before_it_saves(scratch: Path, name: str) -> None:
    """Also when the hand already holds every value: the EEPROM is written all the same (contract 7)."""
    result = do("restore", scratch / name, "--save")
    assert (result.code, result.error["code"]) == (8, "not-confirmed")
    assert "EEPROM" in result.error["text"] and result.json["counters"] == CLEAN


def test_restore_does_not_save_another_speed_by_accident(scratch: Path) -> None:
    trace, file = scratch / "t.txt", scratch / "fast.json"
    content = snapshots.make("barrett", {}, {**factory(), "baud_rate": 384}, link="fake://barrett", fake=True)
    snapshots.write(str(file), content)
    result = do("restore", file, "--save", "--yes")
    assert (result.code, result.error["code"], result.json["counters"]) == (2, "baud-not-default", CLEAN)
    assert do("restore", file, "--save", "--yes", "--force", "--trace", trace).code == 0
    assert written_lines(trace) == ["PSET BAUD 384", "FSAVE", "PSAVE"]


def test_a_dry_run_of_restore_shows_the_saves(scratch: Path) -> None:
    rows = do("restore", scratch / "stored.json", "--save", "-n").rows
    assert [(row["step"], row["bytes"]) for row in rows[-2:]] == [
        (len(rows) - 1, "46 53 41 56 45 0D"),
        (len(rows), "50 53 41 56 45 0D"),
    ]


def test_a_saved_speed_says_nothing_of_the_motors(tmp_path: Path) -> None:
    """PSAVE keeps hand parameters only: a motor parameter in RAM is still to be saved."""
    port = fake(state=tmp_path / "state.json")
    with spying() as spy:
        assert do("save", "--yes", port=port).code == 0
        assert do("set", "DP.F1=7", port=port).code == 0
        assert do("baud", "9600", "--save", "--yes", port=port).code == 0
        assert eeprom(spy, "DP")[0] == 8500
        last = do("save", "--yes", port=port)
        assert last.code == 0, last
        assert eeprom(spy, "DP")[0] == 7


def test_a_damaged_journal_is_no_reason_to_lose_count(tmp_path: Path) -> None:
    place = tmp_path / "handctl" / "barrett-saves.json"
    place.parent.mkdir()
    place.write_text("{", encoding="utf-8")
    trace = tmp_path / "t.txt"
    assert do("save", "--yes", "--trace", trace).code == 2
    assert written_lines(trace) == [] and place.read_text(encoding="utf-8") == "{"
