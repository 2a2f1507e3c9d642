"""SIGINT, SIGTERM and SIGKILL at seeded random moments of every command that writes, then the same command again.

A few cells here; every command with every signal, again and again for HANDCTL_LONG_SECONDS, with marker `long`.
"""

from __future__ import annotations

import json
import random
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from handctl.link import Deadline
from tests import barrett_support
from tests.cli_support import clean_environment, program, run
from tests.fuzz_support import SEED, long_seconds
from tests.interruption_support import ENDS, Bench, Case, begins, interrupt, is_, whole_json

BENCHES: dict[str, tuple[str, ...]] = {
    "exo": ("exo", "--wire", "auto", "--set", "calibration=1"),
    "wrist": ("wrist", "--wire", "auto"),
    "wrist-can": ("wrist", "can", "--wire", "1"),
    "barrett": ("barrett", "--wire", "auto", "--set", "initialized=1"),
    "ekso": ("ekso", "--wire", "auto", "--set", "sway=0"),
    "aidin": ("aidin", "--set", "start=open"),
}
"""Name -> family and options of the simulator."""
ME = "--yes --operator me"


def saved(bench: Bench) -> None:
    """RAM and EEPROM agree on what was set."""
    assert bench.ask("ram DP") == bench.ask("eeprom DP")
    assert bench.ask("ram DP").split()[1] == "4321"


def id_5(bench: Bench) -> None:
    """The hand answers to 5 and is told to be 1 again."""
    assert bench.ask("get 1000 1") == "05"
    assert run("exo", "id", "1", "-y", "--id", "5", "-p", bench.simulator.link).code == 0


def log_is_whole(bench: Bench) -> None:
    """Rows with as many columns as the header, numbered, and a sidecar that counts them."""
    header, *rows = (bench.folder / "gait.csv").read_text(encoding="utf-8").splitlines()
    assert {row.count(",") for row in rows} == {header.count(",")}
    assert json.loads((bench.folder / "gait.csv.json").read_text(encoding="utf-8"))["rows"] == len(rows) == 20


def page_is_whole(bench: Bench) -> None:
    """A report with its end."""
    assert (bench.folder / "page.html").read_text(encoding="utf-8").rstrip().endswith("</html>")


CASES = [
    Case("exo", "set force_set.index=-9 -y", 0.05, is_("get 1504 2", "F7 FF"), ("set force_set.index=11 -y",)),
    Case("exo", "position 100 200 300 400 500 -y", 0.05, is_("get 1486 10", "64 00 C8 00 2C 01 90 01 F4 01"), ("position 900 900 900 900 900 -y",)),
    Case("exo", "position 100 200 300 400 500 -y --wait 3", 0.9, still="get 1546 10", before=("position 900 900 900 900 900 -y --wait 3",)),
    Case("exo", "clear-errors", 0.05),
    Case("exo", "force 1 2 3 4 5 -y", 0.05, is_("get 1498 10", "01 00 02 00 03 00 04 00 05 00"), ("force 0 0 0 0 0 -y",)),
    Case("exo", "id 5 -y", 0.7, id_5),
    Case("exo", "save -y", 1.1),
    Case("exo", "calibrate -y", 1.1, rests=1.3),
    Case("exo", "restore {}/exo.json -y", 0.08, is_("get 1504 2", "F7 FF"), ("set force_set.index=-9 -y", "snapshot {}/exo.json", "set force_set.index=11 -y")),
    Case("exo", "factory-reset -y --undocumented-address --backup {}/before.json", 1.7, whole_json("before.json", "values"), fresh=("before.json",), again=(0, 2)),
    Case("exo", "snapshot {}/a.json", 0.04, whole_json("a.json", "checksum")),
    Case("exo", "dump -o {}/dump.json", 0.04, whole_json("dump.json", "rows"), fresh=("dump.json",)),
    Case("exo", "report {}/page.html --watch 0.3 --force", 0.5, page_is_whole),
    Case("exo", "baud 57600 -y", 0.05, is_("get 1001 1", "01"), ("baud 115200 -y",)),
    Case("wrist", "set yaw_set=3", 0.05, is_("get 1038 2", "2C 01"), ("set yaw_set=5",)),
    Case("wrist", "move --pitch 10 --yaw -5 --time 300", 0.4, is_("get 1038 4", "0C FE E8 03"), ("center",), still="get 1044 4"),
    Case("wrist", "restore {}/wrist.json -y", 0.08, is_("get 1038 2", "2C 01"), ("set yaw_set=3", "snapshot {}/wrist.json", "set yaw_set=5")),
    Case("wrist", "hand-write 1486 0A00 -y", 0.05, is_("hand-get 1486 2", "0A 00"), ("hand-write 1486 0B00 -y",)),
    Case("wrist-can", "set yaw_set=3", 0.05, is_("get 1038 2", "2C 01"), ("set yaw_set=5",)),
    Case("wrist-can", "move --pitch 10 --yaw -5 --time 300", 0.4, is_("get 1038 4", "0C FE E8 03"), ("center",), still="get 1044 4"),
    Case("barrett", "set MCV=40 DP.F2=4321", 0.15, is_("ram DP", "8500 4321 8500 1575"), ("set DP=8500,8500,8500,1575 MCV=60",)),
    Case("barrett", "save -y", 3.3, saved, ("set DP.F2=1234", "save -y --force", "set DP.F2=4321"), again=(0, 2)),
    Case("barrett", "restore {}/barrett.json -y", 0.8, is_("ram DP", "8500 4321 8500 1575"), ("set DP.F2=4321", "snapshot {}/barrett.json", "set DP.F2=1234")),
    Case("barrett", "move 5000 --motors 12", 0.8, begins("motors", "F1 P 5000"), ("home",), still="motors"),
    Case("barrett", "init", 0.9, begins("motors", "F1 P 0 S 0")),
    Case("barrett", "realtime --send velocity --velocity 20 --duration 0.4 --motors 1", 0.8, still="motors"),
    Case("barrett", "baud 38400 -y", 0.6, is_("ram BAUD", "384")),
    Case("barrett", "defaults -y", 0.1, is_("ram DP", "8500 8500 8500 1575"), ("set DP.F2=1234",)),
    Case("barrett", "load -y", 0.2),
    Case("ekso", f"set step_length=15.5 {ME}", 0.3, is_("get step_length", "1550"), (f"set step_length=14.5 {ME}",)),
    Case("ekso", f"restore {{}}/ekso.json {ME}", 0.3, is_("get step_length", "1550"), (f"set step_length=15.5 {ME}", "snapshot {}/ekso.json", f"set step_length=14.5 {ME}")),
    Case("ekso", "log {}/gait.csv --rate 50 --count 20 --force", 0.5, log_is_whole),
    Case("aidin", "home -y", 3.6, begins("state", "mode 1 homed"), still="get motor_pos"),
    Case("aidin", "encoders index.m1=500", 0.4, still="get motor_pos"),
    Case("aidin", "joints index.q3=160 -y", 0.6, still="get motor_pos"),
    Case("aidin", "currents index.m1=20 -y --duration 0.3", 1.0, is_("get current_state", " ".join("0" * 15)), still="get motor_pos"),
    Case("aidin", "bias", 0.8),
    Case("aidin", "stop", 0.1, begins("state", "mode 3")),
    Case("aidin", "max-torque 700", 0.3, lambda bench: "maxtorque 700" in bench.ask("state") or pytest.fail(bench.ask("state")), ("max-torque 900",)),
]  # fmt: skip
SHORT = [  # (case, signal): what differs most in how it ends
    ("exo set force_set.index=-9", signal.SIGKILL),
    ("exo save", signal.SIGKILL),
    ("exo restore {}/exo.json", signal.SIGINT),
    ("exo snapshot {}/a.json", signal.SIGKILL),
    ("wrist move --pitch 10 --yaw -5 --time 300", signal.SIGINT),
    ("wrist-can set yaw_set=3", signal.SIGKILL),
    ("barrett set MCV=40 DP.F2=4321", signal.SIGKILL),
    ("barrett realtime --send velocity --velocity 20 --duration 0.4 --motors 1", signal.SIGKILL),
    ("ekso set step_length=15.5", signal.SIGKILL),
    ("ekso log {}/gait.csv --rate 50 --count 20 --force", signal.SIGTERM),
    ("aidin encoders index.m1=500", signal.SIGINT),
]
BY_NAME = {str(case): case for case in CASES}
Get = Callable[[str], Bench]


@pytest.fixture(scope="module")
def bench_of(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Get]:
    """One simulator for all cells of a bench: each finds it as the one before has left it."""
    running: dict[str, Bench] = {}

    def get(name: str) -> Bench:
        if name not in running:
            family, *args = BENCHES[name]
            running[name] = Bench(family, tmp_path_factory.mktemp(name), *args)
        return running[name]

    yield get
    for bench in running.values():
        bench.simulator.stop()


def cell(bench: Bench, case: Case, number: int, source: random.Random) -> None:
    """Interrupt the command once, repeat it, look at the device and the files."""
    for command in case.before:
        assert (done := bench.do(command)).code == 0, (command, done)
    for name in case.fresh:
        (bench.folder / name).unlink(missing_ok=True)
    code, err, finished = interrupt(bench, case, number, source)
    finished = finished or any((bench.folder / name).exists() for name in case.fresh)
    spoke = bench.trace.exists() and " > " in bench.trace.read_text(encoding="utf-8")
    orderly = (0, 130) if number != signal.SIGKILL else (0, -9)
    # Before anything was sent, or behind the last word, the signal may end the interpreter itself.
    assert code in orderly or ((finished or not spoke) and code == -number), (code, err)
    if spoke:
        assert "Traceback" not in err, err
    if case.still and code == 130 and spoke:
        time.sleep(0.15)  # what brakes comes to a stand
        before = bench.ask(case.still)
        time.sleep(0.1)
        assert bench.ask(case.still) == before, "it still moves"
    for name in ("a.json", "dump.json", "page.html", "before.json"):
        file = bench.folder / name
        if file.exists():  # of an earlier run or of this one: whole in either case
            assert file.read_bytes().endswith((b"\n", b"\r\n", b"</html>")), name
    time.sleep(case.rests)
    done = bench.do(case.command)
    assert done.code in case.again, (code, err, done)
    case.holds(bench)
    left = [path.name for path in bench.folder.iterdir() if path.name.endswith((".part", ".tmp"))]
    assert not left or number == signal.SIGKILL, left
    for name in left:  # only SIGKILL can leave one: it has the number of its process in its name and nobody reads it
        (bench.folder / name).unlink()


@pytest.mark.parametrize(("name", "number"), SHORT, ids=[f"{name} {number.name}" for name, number in SHORT])
def test_interrupted_and_repeated(bench_of: Get, name: str, number: int) -> None:
    case = BY_NAME[name]
    cell(bench_of(case.bench), case, number, random.Random(f"{SEED} {name}"))


@pytest.mark.long
@pytest.mark.parametrize("name", BY_NAME)
def test_interrupted_and_repeated_often(bench_of: Get, name: str) -> None:
    """Once, then for this case's share of the time, or ten times with each signal; the first signals take turns."""
    case, source = BY_NAME[name], random.Random(f"long {name}")
    first = list(BY_NAME).index(name)
    end = time.monotonic() + long_seconds(len(CASES))
    for turn in range(30):
        if turn and time.monotonic() > end:
            break
        cell(bench_of(case.bench), case, ENDS[(first + turn) % len(ENDS)], source)


@pytest.mark.parametrize("seconds", [0.0, 0.5, 1.0, 1.5, 3.0])
def test_a_hand_that_is_still_saving_is_found_at_its_own_speed(seconds: float) -> None:
    """It is silent until FSAVE is through; a search of the speeds that goes on meanwhile comes back to the first."""
    _, link = barrett_support.simulated()
    link.write(b"FSAVE\r", Deadline(link.now, link.now() + 1))
    link.sleep(seconds)
    hand = barrett_support.hand_on(link)
    hand.line.connect()
    assert link.inner.baud == 9600  # type: ignore[attr-defined]
    assert "speed" not in barrett_support.codes(hand)
    assert hand.version() == barrett_support.simulated()[0].version()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_the_configuration_file(tmp_path: Path, number: int) -> None:
    """`devices add` interrupted anywhere: the file is the old one or the new one, and the next edit works."""
    config = tmp_path / "config.toml"
    environment = {"HANDCTL_CONFIG": str(config)}
    old = "# kept\nretries = 3\n"
    source = random.Random(SEED)
    for turn in range(3):
        config.write_text(old, encoding="utf-8")
        process = subprocess.Popen(
            program("devices", "add", "left", "exo", "-p", "/dev/ttyUSB7"), env=clean_environment(environment),
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        time.sleep(0.05 + source.random() * 0.2)
        if process.poll() is None:
            process.send_signal(number)
        process.communicate(timeout=20)
        text = config.read_text(encoding="utf-8")
        assert text == old or (text.startswith(old) and text.endswith("\n") and "/dev/ttyUSB7" in text), turn
        again = run("devices", "add", "left", "exo", "-p", "/dev/ttyUSB7", env=environment)
        assert again.code == 0 or (text != old and again.code == 2), again
        assert run("devices", "show", "left", env=environment).code == 0
