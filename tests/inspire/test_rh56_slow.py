"""RH56 hands at 19200 bit/s: a BarrettHand listens there, and takes the 03 of every Modbus read for ^C (barrett §1).

So Modbus RTU is asked there only where somebody says that a hand speaks it.
"""

from __future__ import annotations

from pathlib import Path

from tests.support.cli import run
from tests.support.each_row import each_row

LINK = "fake://hand?baud=19200&speaks=modbus&clock=virtual"


@each_row("words", ["status --baud 19200", "scan --ids 1-1", "scan --ids 1-1 --protocol eb90"])
def test_nobody_is_asked_in_modbus_unless_that_is_typed(words: str, tmp_path: Path) -> None:
    trace = tmp_path / "trace.txt"
    answer = run("hand", *words.split(), "-p", LINK, "--trace", str(trace), "--json")
    assert answer.code == 4, answer
    slow, speed = list[str](), "19200" if "--baud" in words else "115200"
    for line in trace.read_text().splitlines():
        if "! baud " in line:
            speed = line.split()[-1]
        elif " > " in line and int(speed) <= 38400:
            slow.append(line.partition(" > ")[2])
    assert slow
    assert not [one for one in slow if {"03", "0D", "FF"} & set(one.split())]


@each_row("words", ["status --baud 19200", "scan --ids 1-1", "scan --ids 1-1 --baud 19200"])
def test_a_hand_that_is_said_to_speak_it_is_found(words: str) -> None:
    answer = run("hand", *words.split(), "--protocol", "modbus", "-p", LINK, "--json")
    assert answer.code == 0, answer
    if "scan" in words:
        assert [(row["baud"], row["id"], row["protocol"]) for row in answer.rows] == [(19200, 1, "modbus-rtu")]


def test_silence_there_names_the_option() -> None:
    answer = run("hand", "status", "--baud", "19200", "-p", LINK, "--json")
    assert "--protocol modbus" in answer.json["messages"][-1]["hint"]


def test_a_typed_protocol_is_the_only_one_that_is_scanned() -> None:
    for protocol, speaks in (("eb90", "modbus"), ("modbus", "eb90")):
        link = f"fake://hand?speaks={speaks}&clock=virtual"
        assert run("hand", "scan", "--ids", "1-1", "--protocol", protocol, "-p", link, "--json").code == 4
        assert run("hand", "scan", "--ids", "1-1", "--protocol", speaks, "-p", link, "--json").code == 0


@each_row("speed", [921600, 57600, 19200])
def test_a_hand_at_another_speed_is_looked_at_there(speed: int) -> None:
    rows, silent = dict[int, object](), dict[int, int]()
    for baud in (115200, speed):
        link = f"fake://hand?baud={baud}&speaks=eb90&clock=virtual"
        answer = run("hand", "scan", "--ids", "1-1", "--protocol", "eb90", "-p", link, "--json")
        (row,), counters = answer.rows, answer.json["counters"]
        rows[baud], silent[baud] = (row["model"], row["evidence"]), counters["sent"] - counters["received"]
    assert rows[speed] == rows[115200]
    assert silent[speed] <= silent[115200] + 8, "two questions at each speed before, two to see whether it matters"
