"""SIGINT, SIGTERM and SIGKILL at random moments of every command that writes, then the same command again.

The moments are of real time: a seed repeats the draw, and mostly the place. What can be told without a clock is in `tests/stop/test_interruption.py`.
"""

from __future__ import annotations

import hashlib
import json
import random
import signal
import time
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path

import pytest

from handctl.families import FAMILIES
from tests.barrett.panel import download, panel
from tests.barrett.srecords import END, HEADER, record
from tests.search.suite import Suite, key, parts
from tests.support.cli import Simulator, run, wait_until
from tests.support.interruption import (
    CREEP,
    CREEP_SECONDS,
    ENDS,
    Bench,
    Case,
    begins,
    both,
    interrupt,
    is_,
    near,
    nothing,
    numbers,
    whole_json,
)

BENCHES: dict[str, tuple[str, ...]] = {
    "exo": ("exo", "--wire", "auto", "--set", "calibration=1"),
    "hand": ("hand", "--wire", "auto", "--model", "df", "--set", "calibration=1"),
    "hand-can": ("hand", "can", "--wire", "1"),
    "hand-rtu": ("hand", "rtu", "--wire", "auto"),
    "hand-tcp": ("hand", "modbus"),
    "wrist": ("wrist", "--wire", "auto"),
    "wrist-can": ("wrist", "can", "--wire", "1"),
    "barrett": ("barrett", "--wire", "auto", "--set", "initialized=1"),
    "ekso": ("ekso", "--wire", "auto", "--set", "sway=0"),
    "aidin": ("aidin", "--set", "start=open"),
    "machine": ("",),
}
"""Name -> family and options of the simulator."""
ME = "--yes --operator me"
F1 = "motors"
"""The question for the motors of a BarrettHand; the first number of the answer is the position of F1."""
M = "get motor_pos"
"""The same of an AIDIN-hand: m1 m2 m3 of thumb, index, …"""
OPENED = (
    "speed 1000 1000 1000 1000 1000 1000 -y",
    "angle 900 900 900 900 900 900 -y --wait 4",
    "speed 400 400 400 400 400 400 -y",
)
HAND = "get 1546 12"
"""An RH56 hand that is open, and moves so slowly that an interruption meets it on its way; where its fingers are."""
POSITIONS, FORCES, ANGLES = "get 1546 10", "get 1582 10", "get 1020 4"
OPEN = ("position 900 900 900 900 900 -y --wait 3",)
SLOWLY = ("center --time 100", "set move_time=1500")
NO_CURRENT = " ".join("0" * 15)


def saved(bench: Bench) -> None:
    """RAM and EEPROM agree on what was set."""
    assert bench.ask("ram DP") == bench.ask("eeprom DP")
    assert bench.ask("ram DP").split()[1] == "4321"


def as_saved(bench: Bench) -> None:
    """RAM is what the EEPROM holds."""
    assert bench.ask("ram DP") == bench.ask("eeprom DP")


def all_off(bench: Bench) -> None:
    """No motor has power."""
    assert "power on" not in bench.ask("motors")


def standing(bench: Bench) -> None:
    """No motor moves."""
    assert "moving" not in bench.ask("motors")


def greased(bench: Bench) -> None:
    """The journal of greasing has this point and no other."""
    (entries,) = json.loads((bench.folder / "state/handctl/barrett-greasing.json").read_text(encoding="utf-8")).values()
    assert set(entries) == {"spur.F1"}


def id_5(bench: Bench) -> None:
    """The hand answers to 5 and is told to be 1 again."""
    assert bench.ask("get 1000 1") == "05"
    assert run("exo", "id", "1", "-y", "--id", "5", "-p", bench.simulator.link).code == 0


def hand_7(bench: Bench) -> None:
    """The RH56 hand answers to 7 and is made 1 again."""
    assert bench.ask("get 1000 1") == "07"
    assert run("hand", "id", "1", "-y", "--id", "7", "-p", bench.simulator.link).code == 0


def moves(wire: str) -> list[Case]:
    """What moves an RH56 hand, on one of its wires. Behind a stop its speeds are 0, so it does not arrive."""
    closed = "64 00 64 00 64 00 64 00 64 00"
    return [
        Case(wire, "set angle_set.index=100 -y", 0.05, is_("get 1492 2", "64 00"), OPENED, still=HAND),
        Case(wire, "angle 100 100 100 100 100 -1 -y", 0.05, is_("get 1486 10", closed), OPENED, still=HAND),
        Case(wire, "angle 100 100 100 100 100 -1 -y --wait 5", 1.5, is_("get 1486 10", closed), OPENED, still=HAND, again=(0, 7)),
        Case(wire, "position 2000 2000 -1 -1 -1 -1 -y --wait 5", 1.5, is_("get 1474 4", "D0 07 D0 07"), OPENED, still=HAND, again=(0, 7)),
        Case(wire, "write 1486 6400C800 -y", 0.05, is_("get 1486 4", "64 00 C8 00"), OPENED, still=HAND),
        Case(wire, "restore {}/hand.json -y", 0.15, is_("get 1032 2", "2C 01"), ("set default_speed.little=300", "snapshot {}/hand.json", "set default_speed.little=301")),
        Case(wire, "stop", 0.08, is_("get 1522 12", " ".join(["00"] * 12)), OPENED, still=HAND),
        Case(wire, "id 7 -y", 0.7, hand_7 if wire == "hand" else nothing) if wire == "hand" else Case(wire, "speed 50 -1 -1 50 -1 -1 -y", 0.05, is_("get 1522 2", "32 00"), ("speed 60 -1 -1 60 -1 -1 -y",)),
    ]  # fmt: skip


def log_is_whole(bench: Bench) -> None:
    """Rows with as many columns as the header, numbered, and a sidecar that counts them."""
    header, *rows = (bench.folder / "gait.csv").read_text(encoding="utf-8").splitlines()
    assert {row.count(",") for row in rows} == {header.count(",")}
    assert json.loads((bench.folder / "gait.csv.json").read_text(encoding="utf-8"))["rows"] == len(rows) == 20


def page_is_whole(bench: Bench) -> None:
    """A report with its end."""
    assert (bench.folder / "page.html").read_text(encoding="utf-8").rstrip().endswith("</html>")


def audited(bench: Bench) -> None:
    """The audit log is there, each line whole."""
    lines = (bench.folder / "state/handctl/ekso-audit.jsonl").read_text(encoding="utf-8").splitlines()
    assert all(isinstance(json.loads(line), dict) for line in lines)


def cancelled(bench: Bench) -> None:
    """It came, with a good frame."""
    words = bench.ask("counts").split()
    assert int(words[words.index("cancel") + 1]) >= 1 and words[-1] == "0", words
    audited(bench)


def named(bench: Bench) -> None:
    """The configuration has both devices, once."""
    text = (bench.folder / "config/handctl/config.toml").read_text(encoding="utf-8")
    assert text.count("[devices.left]") == text.count("[devices.right]") == text.count("/dev/ttyUSB7") == 1


def forgotten(bench: Bench) -> None:
    """The configuration has nothing of it."""
    assert "right" not in (bench.folder / "config/handctl/config.toml").read_text(encoding="utf-8")


def completes(name: str) -> Callable[[Bench], None]:
    """The file is what the command prints."""

    def holds(bench: Bench) -> None:
        shell = {"handctl": "bash", "_handctl": "zsh", "handctl.fish": "fish", "handctl.ps1": "powershell"}[
            Path(name).name
        ]
        assert (bench.folder / name).read_text(encoding="utf-8") == run("completion", shell).out

    return holds


def motion_is_whole(bench: Bench) -> None:
    """As many rows as the header says."""
    lines = (bench.folder / "gait.mot").read_text(encoding="utf-8").splitlines()
    header, rows = lines[: lines.index("endheader") + 1], lines[lines.index("endheader") + 2 :]
    assert f"nRows={len(rows)}" in header and len(rows) == 20


def strides_are_whole(bench: Bench) -> None:
    """The header, and as many columns in each line."""
    lines = (bench.folder / "steps.csv").read_text(encoding="utf-8").splitlines()
    assert len(lines) > 2 and {line.count(",") for line in lines} == {12}


def streams_are_whole(bench: Bench) -> None:
    """The footer of its stream is there."""
    data = (bench.folder / "gait.xdf").read_bytes()
    assert data.startswith(b"XDF:") and b"</info>" in data[-400:], data[-400:]


CASES = [
    Case("exo", "set force_set.index=-9 -y", 0.03, is_("get 1504 2", "F7 FF"), ("set force_set.index=11 -y",)),
    Case("exo", "set position_set.index=100 -y", 0.03, is_("get 1492 2", "64 00"), OPEN, still=POSITIONS),
    Case("exo", "position 100 200 300 400 500 -y", 0.03, is_("get 1486 10", "64 00 C8 00 2C 01 90 01 F4 01"), OPEN, still=POSITIONS),
    Case("exo", "position 100 200 300 400 500 -y --wait 3", 0.9, is_("get 1486 10", "64 00 C8 00 2C 01 90 01 F4 01"), OPEN, still=POSITIONS),
    Case("exo", "clear-errors", 0.05),
    Case("exo", "force 801 802 803 804 805 -y", 0.03, is_("get 1498 10", "21 03 22 03 23 03 24 03 25 03"), ("force 0 0 0 0 0 -y",), still=FORCES),
    Case("exo", "write 1486 6400C800 -y", 0.03, is_("get 1486 4", "64 00 C8 00"), OPEN, still=POSITIONS),
    Case("exo", "raw EB 90 01 05 12 E0 05 F7 FF F3 -y --wait 0.1", 0.12, is_("get 1504 2", "F7 FF"), ("set force_set.index=11 -y",)),
    Case("exo", "id 5 -y", 0.7, id_5),
    Case("exo", "save -y", 1.1),
    Case("exo", "calibrate -y", 1.1, rests=1.3),
    Case("exo", "restore {}/exo.json -y --setpoints", 0.08, is_("get 1504 2", "F7 FF"), ("set force_set.index=-9 -y", "snapshot {}/exo.json", "set force_set.index=11 -y")),
    Case("exo", "factory-reset -y --undocumented-address --backup {}/before.json", 1.7, whole_json("before.json", "values"), fresh=("before.json",), again=(0, 2)),
    Case("exo", "stop", 0.08, is_("get 1498 10", "00 00 00 00 00 00 00 00 00 00"), ("force 100 100 100 100 100 -y",), still=POSITIONS),
    Case("exo", "snapshot {}/a.json", 0.04, whole_json("a.json", "checksum")),
    Case("exo", "dump -o {}/dump.json", 0.04, whole_json("dump.json", "rows"), fresh=("dump.json",)),
    Case("exo", "report {}/page.html --watch 0.3 --force", 0.5, page_is_whole),
    Case("exo", "log {}/gait.csv --rate 50 --count 20 --force", 0.5, log_is_whole),
    Case("exo", "baud 57600 -y", 0.03, is_("get 1001 1", "01"), ("baud 115200 -y",)),
    Case("exo", "baud 57600 -y --save", 1.1, is_("get 1001 1", "01"), ("baud 115200 -y",)),
    *(case for wire in ("hand", "hand-can", "hand-rtu", "hand-tcp") for case in moves(wire)),
    Case("hand", "set speed_set.index=50 -y", 0.03, is_("get 1528 2", "32 00"), ("set speed_set.index=60 -y",)),
    Case("hand", "speed 50 -1 -1 50 -1 -1 -y", 0.03, is_("get 1522 2", "32 00"), ("speed 60 -1 -1 60 -1 -1 -y",)),
    Case("hand", "force 200 -1 -1 300 -1 -1", 0.03, is_("get 1498 2", "C8 00"), ("force 201 -1 -1 301 -1 -1",)),
    Case("hand", "clear-errors", 0.05),
    Case("hand", "raw EB 90 01 05 12 D4 05 2C 01 1E -y --wait 0.1", 0.12, is_("get 1492 2", "2C 01"), OPENED),
    Case("hand", "save -y", 1.1),
    Case("hand", "calibrate -y", 11.5, rests=1.3),
    Case("hand", "factory-reset -y --backup {}/before.json", 1.7, whole_json("before.json", "values"), fresh=("before.json",), again=(0, 2)),
    Case("hand", "snapshot {}/a.json", 0.04, whole_json("a.json", "checksum")),
    Case("hand", "report {}/page.html --watch 0.3 --force", 0.5, page_is_whole),
    Case("hand", "log {}/gait.csv --rate 50 --count 20 --force", 0.5, log_is_whole),
    Case("hand-can", "network 192.168.11.211 -y", 2.6, is_("get 1700 4", "C0 A8 0B D3"), ("network 192.168.11.210 -y",)),
    Case("hand", "baud 57600 -y", 0.03, is_("get 1002 1", "01"), ("baud 115200 -y",)),
    Case("hand", "baud 57600 -y --save", 1.1, is_("get 1002 1", "01"), ("baud 115200 -y",)),
    Case("wrist", "set yaw_set=20", 0.03, is_("get 1038 2", "D0 07"), SLOWLY, still=ANGLES),
    Case("wrist", "move --pitch 10 --yaw -5 --time 900", 1.0, is_("get 1038 4", "0C FE E8 03"), ("center --time 100",), still=ANGLES),
    Case("wrist", "center --time 900", 1.0, is_("get 1038 4", "00 00 00 00"), ("move --pitch 10 --yaw -5 --time 100",), still=ANGLES),
    Case("wrist", "write 1038 D007", 0.03, is_("get 1038 2", "D0 07"), SLOWLY, still=ANGLES),
    Case("wrist", "raw EB 90 01 05 31 0E 04 2C 01 76 -y --wait 0.1", 0.12, is_("get 1038 2", "2C 01"), ("set yaw_set=5",)),
    Case("wrist", "restore {}/wrist.json -y --setpoints", 0.08, is_("get 1038 2", "D0 07"), ("set yaw_set=20", "snapshot {}/wrist.json", *SLOWLY), still=ANGLES),
    Case("wrist", "stop", 0.03, lambda bench: bench.ask("get 1038 2") == bench.ask("get 1022 2") or pytest.fail(bench.ask("get 1038 4")), ("center --time 100",), still=ANGLES),
    Case("wrist", "snapshot {}/a.json", 0.04, whole_json("a.json", "checksum")),
    Case("wrist", "report {}/page.html --watch 0.3 --force", 0.4, page_is_whole),
    Case("wrist", "log {}/gait.csv --rate 50 --count 20 --force", 0.5, log_is_whole),
    Case("wrist", "hand-write 1486 0A00 -y", 0.03, is_("hand-get 1486 2", "0A 00"), ("hand-write 1486 0B00 -y",)),
    Case("wrist-can", "set yaw_set=20", 0.03, is_("get 1038 2", "D0 07"), SLOWLY, still=ANGLES),
    Case("wrist-can", "move --pitch 10 --yaw -5 --time 900", 1.0, is_("get 1038 4", "0C FE E8 03"), ("center --time 100",), still=ANGLES),
    Case("wrist-can", "center --time 900", 1.0, is_("get 1038 4", "00 00 00 00"), ("move --pitch 10 --yaw -5 --time 100",), still=ANGLES),
    Case("wrist-can", "write 1038 D007", 0.03, is_("get 1038 2", "D0 07"), SLOWLY, still=ANGLES),
    Case("wrist-can", "raw 15038001#2C01 -y --wait 0.1", 0.12, is_("get 1038 2", "2C 01"), ("set yaw_set=5",)),
    Case("wrist-can", "restore {}/wrist.json -y --setpoints", 0.08, is_("get 1038 2", "D0 07"), ("set yaw_set=20", "snapshot {}/wrist.json", *SLOWLY), still=ANGLES),
    Case("wrist-can", "hand-write 1486 0A00 -y", 0.03, is_("hand-get 1486 2", "0A 00"), ("hand-write 1486 0B00 -y",)),
    Case("barrett", "set MCV=40 DP.F2=4321", 0.15, is_("ram DP", "8500 4321 8500 1575"), ("set DP=8500,8500,8500,1575 MCV=60",)),
    Case("barrett", "save -y", 3.3, saved, ("set DP.F2=1234", "save -y --force", "set DP.F2=4321"), again=(0, 2)),
    Case("barrett", "restore {}/barrett.json -y", 0.8, is_("ram DP", "8500 4321 8500 1575"), ("set DP.F2=4321", "snapshot {}/barrett.json", "set DP.F2=1234")),
    Case("barrett", "restore {}/barrett.json -y --save", 3.9, saved, ("set DP.F2=4321", "snapshot {}/barrett.json", "set DP.F2=1234")),
    Case("barrett", "move 5000 --motors 12", 0.8, near(F1, 0, 5000, 5000), ("home",), still=F1),
    Case("barrett", "init", 0.9, begins(F1, "F1 P 0 S 0"), ("close --motors 12",), still=F1),
    Case("barrett", "open", 1.0, near(F1, 0, 0, 0), ("close",), still=F1),
    Case("barrett", "close", 1.2, near(F1, 0, 17000, 17000), ("home",), still=F1),
    Case("barrett", "home", 1.0, near(F1, 0, 0, 0), ("close",), still=F1),
    # A step is relative: what a killed command has started goes on, and its repetition comes on top.
    Case("barrett", "step-close 2000 --motors 12", 0.4, near(F1, 0, 2000, 4000), ("home",), still=F1),
    Case("barrett", "step-open 2000 --motors 12", 0.4, near(F1, 0, 6000, 8000), ("move 10000 --motors 12",), still=F1),
    Case("barrett", "torque-close", 1.1, near(F1, 0, 17700, 17900), ("home",), still=F1),
    Case("barrett", "torque-open", 1.1, near(F1, 0, 0, 0), ("close",), still=F1),
    Case("barrett", "stop", 0.04, all_off, ("step-close 10 --motors S",)),
    Case("barrett", "gcl '1M 5000' '1M 3000'", 0.5, near(F1, 0, 3000, 3000), ("home",), still=F1),
    Case("barrett", "gcl '2FSET DP 77' '2FGET DP'", 0.06, is_("ram DP", "8500 77 8500 1575"), ("set DP=8500,8500,8500,1575",)),
    Case("barrett", "gcl FSAVE -y", 3.2, saved, ("set DP.F2=4321",)),
    Case("barrett", "snapshot {}/a.json", 0.4, whole_json("a.json", "checksum")),
    Case("barrett", "report {}/page.html --watch 0.3 --force", 1.5, page_is_whole),
    Case("barrett", "log {}/gait.csv --rate 50 --count 20 --force", 0.5, log_is_whole),
    Case("barrett", "realtime --send velocity --velocity 20 --duration 0.4 --motors 1 --timeout 1", 0.8, still=F1),
    Case("barrett", "strain --open", 1.8, near(F1, 0, 0, 0), ("close",), still=F1),
    # It tells that a motor needs `init`, as after an interrupted HI, and tries nothing more.
    Case("barrett", "diagnose wrong-direction --move -y --motors 1", 2.8, standing, ("init",), still=F1, again=(0, 7)),
    Case("barrett", "first-light --skip power-on --skip highest-speed -y", 6.0, standing, ("init",), still=F1, again=(0, 7)),
    Case("barrett", "maintenance --greased spur.F1", 0.2, greased),
    Case("barrett", "baud 38400 -y", 0.6, is_("ram BAUD", "384"), ("baud 9600 -y",)),
    Case("barrett", "baud 38400 -y --save", 1.9, both(is_("ram BAUD", "384"), is_("eeprom BAUD", "384")), ("baud 9600 -y",)),
    Case("barrett", "defaults -y", 0.1, is_("ram DP", "8500 8500 8500 1575"), ("set DP.F2=1234",)),
    Case("barrett", "load -y", 0.2, as_saved, ("set DP.F2=1235",)),
    Case("barrett", "reset -y", 2.0, near(F1, 1, 4, 4), ("init",)),  # the last: the next one needs `init`
    Case("ekso", f"set step_length=15.5 {ME}", 0.3, both(is_("get step_length", "1550"), audited), (f"set step_length=14.5 {ME}",)),
    Case("ekso", f"restore {{}}/ekso.json {ME}", 0.3, both(is_("get step_length", "1550"), audited), (f"set step_length=15.5 {ME}", "snapshot {}/ekso.json", f"set step_length=14.5 {ME}")),
    Case("ekso", f"cancel {ME}", 0.05, both(begins("counts", "set"), cancelled)),
    Case("ekso", "stop", 0.05, lambda bench: "cancel 0" not in bench.ask("counts") or pytest.fail("no CancelAction")),
    Case("ekso", "snapshot {}/a.json", 0.1, whole_json("a.json", "checksum")),
    Case("ekso", "report {}/page.html --watch 0.3 --force", 0.6, page_is_whole),
    Case("ekso", "log {}/gait.csv --rate 50 --count 20 --force", 0.5, log_is_whole),
    # Whose fingers are open already goes no way that shows where it ends.
    Case("aidin", "home -y", 3.6, begins("state", "mode 1 homed"), still=M, again=(0, 7)),
    Case("aidin", "initial -y", 0.6, near(M, 5, -20, 20), ("fingertips index.z=120",), still=M),
    Case("aidin", "encoders index.m1=500", 0.4, near(M, 3, 490, 510), ("encoders index.m1=0",), still=M),
    Case("aidin", "encoders 0 0 0 500 0 9000 0 0 0 0 0 0 0 0 0", 0.4, near(M, 5, 8900, 9100), ("encoders index.m3=0",), still=M),
    Case("aidin", "joints index.q3=160 -y", 0.6, near("get joint_pos", 6, 159.5, 160.5), ("initial -y",), still=M),
    Case("aidin", "joints -13 0 154 -45 0 160 -45 0 175 -45 0 175 -45 0 175 -y", 0.6, near("get joint_pos", 6, 159.5, 160.5), ("initial -y",), still=M),
    Case("aidin", "fingertips index.z=120", 0.8, near("get task_space_pos", 5, 119.5, 120.5), ("initial -y",), still=M),
    Case("aidin", "fingertips 0 45.5 146.7 0 2.6 120 0 2.6 149.5 0 2.6 149.5 0 2.6 149.5", 0.8, near("get task_space_pos", 5, 119.5, 120.5), ("initial -y",), still=M),
    Case("aidin", "currents index.m1=20 -y --duration 0.3", 1.0, is_("get current_state", NO_CURRENT), still=M),
    Case("aidin", "currents 0 0 0 20 0 0 0 0 0 0 0 0 0 0 0 -y --duration 0.3", 1.0, is_("get current_state", NO_CURRENT), still=M),
    Case("aidin", "check -y", 5.0, near(M, 5, -20, 60), still=M),
    Case("aidin", "report {}/page.html --watch 0.3 --force", 0.6, page_is_whole),
    Case("aidin", "log {}/gait.csv --rate 50 --count 20 --force", 0.5, log_is_whole),
    Case("aidin", "bias", 0.8),
    Case("aidin", "stop", 0.1, begins("state", "mode 3")),
    Case("aidin", "max-torque 700 -y", 0.3, lambda bench: "maxtorque 700" in bench.ask("state") or pytest.fail(bench.ask("state")), ("max-torque 900 -y",)),
    Case("machine", "devices add left exo -p /dev/ttyUSB7 --force --json", 0.3, named, ("devices add right exo -p /dev/ttyUSB8 --force", "devices add left exo -p /dev/ttyUSB6 --force")),
    Case("machine", "devices remove right --json", 0.3, forgotten, ("devices add right exo -p /dev/ttyUSB8 --force",), again=(0, 2)),
    Case("machine", "completion bash --install --json", 0.8, completes("data/bash-completion/completions/handctl"), fresh=("data/bash-completion/completions/handctl",)),
    Case("machine", "completion zsh --install --json", 0.8, completes("data/zsh/site-functions/_handctl"), fresh=("data/zsh/site-functions/_handctl",)),
    Case("machine", "completion fish --install --json", 0.8, completes("config/fish/completions/handctl.fish"), fresh=("config/fish/completions/handctl.fish",)),
    Case("machine", "ekso export {}/gait.csv -o {}/gait.mot --format mot", 0.3, motion_is_whole, ("ekso log {}/gait.csv -p fake://ekso?clock=virtual --count 20 --rate 50 --force",), fresh=("gait.mot",)),
    *(Case("machine", f"{family} export {{}}/gait.csv --to xdf -o {{}}/gait.xdf --json", 0.3, streams_are_whole, (f"{family} log {{}}/gait.csv -p fake://{family}?clock=virtual --count 20 --force",), fresh=("gait.xdf",)) for family in FAMILIES if family != "ekso"),
    Case("machine", "ekso gait {}/walk.csv --steps {}/steps.csv", 0.3, strides_are_whole, ("ekso log {}/walk.csv -p fake://ekso?clock=virtual&posture=walking --count 2000 --force",), fresh=("steps.csv",)),
]  # fmt: skip
DOWNLOAD = "barrett firmware download"
BY_NAME = {str(case): case for case in CASES}


def cell(bench: Bench, case: Case, number: int, source: random.Random | None) -> int:
    """Interrupt the command once, repeat it, look at the device and the files; how the first ended."""
    for command in case.before:
        assert (done := bench.do(command)).code == 0, (command, done)
    for name in case.fresh:
        (bench.folder / name).unlink(missing_ok=True)
    code, err, finished, through = interrupt(bench, case, number, source)
    finished = finished or any((bench.folder / name).exists() for name in case.fresh)
    spoke = bench.trace.exists() and " > " in bench.trace.read_text(encoding="utf-8")
    orderly = (0, 130, *((6,) if case.rests else ())) if number != signal.SIGKILL else (0, -9)  # 6: it goes on
    # Before anything was sent, or behind the last word, the signal may end the interpreter itself.
    ours = code in orderly or ((finished or not spoke) and code == -number)
    python = code == 1 and not spoke and "handctl: error" not in err  # a signal while the interpreter itself starts
    assert ours or python, (code, err)
    assert finished or code != 130 or " -o " in case.command or case.bench == "machine", ("no JSON", err)
    if spoke:
        assert "Traceback" not in err, err
    if source and case.still and code == 130 and spoke and not through:
        time.sleep(0.15)  # what brakes comes to a stand
        began, before = time.monotonic(), bench.ask(case.still)
        time.sleep(CREEP_SECONDS)
        crept = [abs(new - old) for new, old in zip(numbers(bench.ask(case.still)), numbers(before), strict=True)]
        waited = (time.monotonic() - began) / CREEP_SECONDS  # more than once, on a busy machine
        assert max(crept) <= CREEP * waited, ("it still moves", crept, err)
    assert not bench.half_written()  # of an earlier run or of this one: whole in either case
    time.sleep(case.rests)
    done = bench.do(case.command)
    assert done.code in case.again, f"first: {code} {err}\nagain: {done}"
    case.holds(bench)
    left = [path for path in bench.files if path.suffix in (".part", ".tmp")]
    assert not left or number == signal.SIGKILL, left
    for path in left:  # only SIGKILL can leave one: it has the number of its process in its name and nobody reads it
        path.unlink()
    return code


def downloaded(tmp_path: Path, number: int, source: random.Random) -> None:
    """At random places of the download: the first Ctrl-C only warns, the second ends it; the next download heals the hand."""
    file, control = tmp_path / "fw.s19", tmp_path / "panel"
    data = source.randbytes(1024)
    records = (record(0x2000 + place, data[place : place + 32]) for place in range(0, 1024, 32))
    file.write_text("\n".join([HEADER, *records, END]), encoding="utf-8")
    options = ("image-records=32", "boot=0.2", "window=20", "download-end=quiet", "download-quiet=0.3")
    simulator = Simulator(
        "--pty", "--wire", "38400", "--control", control, *(word for option in options for word in ("--set", option)),
        kind="barrett",
    )  # fmt: skip
    try:
        for turn in range(2):
            log = tmp_path / f"first{turn}.txt"
            process = download(simulator.link, file, control, log)
            wait_until(lambda log=log: "bytes/s" in log.read_text(encoding="utf-8"))
            time.sleep(source.random() * 0.4)
            process.send_signal(number)
            if number != signal.SIGKILL and process.poll() is None:
                wait_until(lambda log=log, one=process: "Press it again" in log.read_text() or one.poll() is not None)
                time.sleep(0.05)
                process.send_signal(number)
            out, _ = process.communicate(timeout=30)
            assert process.returncode in (0, -9 if number == signal.SIGKILL else 130), log.read_text(encoding="utf-8")
            whole_image = "image valid" in panel(control, "image")
            assert whole_image == (process.returncode == 0) or number == signal.SIGKILL
            if out:
                assert json.loads(out)["exit_code"] == process.returncode
        last = download(simulator.link, file, control, tmp_path / "last.txt")
        out, _ = last.communicate(timeout=60)
        assert last.returncode == 0, out
        image = panel(control, "image")
        assert "image valid" in image and hashlib.sha256(data).hexdigest() in image
        assert run("barrett", "version", "-p", simulator.link).code == 0
    finally:
        simulator.stop()


class Interruption(Suite):
    """Command, signal, seed of the moment."""

    name = "interruption"

    def cells(self) -> Iterator[str]:
        for seed in count(self.seed):
            for name in (*BY_NAME, DOWNLOAD):
                for number in ENDS:
                    yield key(self.name, name, number.name, f"seed {seed}")

    def run(self, cell_: str, folder: Path) -> str:
        _, name, signal_, seed = parts(cell_)
        number, source = signal.Signals[signal_], random.Random(f"{name} {seed}")
        if name == DOWNLOAD:
            downloaded(folder, number, source)
            return "healed"
        case = BY_NAME[name]
        family, *args = BENCHES[case.bench]
        bench = Bench(family, folder, *args)
        try:
            return f"exit {cell(bench, case, number, source)}"
        finally:
            bench.stop()


SUITES = (Interruption(),)
