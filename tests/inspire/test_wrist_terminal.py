"""What a person sees of a wrist: tables, the live view, a movement and Ctrl-C in its middle, on a real pseudo-terminal."""

from __future__ import annotations

import re
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.inspire.wrist_commands import LIVE, ON, POWER_ON, WIRES, written_frames
from tests.support import forks
from tests.support.cli import Simulator, clean_environment, run, s16, wait_until
from tests.support.terminal import Terminal

pytestmark = pytest.mark.real

both = pytest.mark.parametrize("wire", WIRES)
NUMBER = r"(-?\d+\.\d+)"


@pytest.fixture(params=["pty", "slcan-pty"])
def sim(request: pytest.FixtureRequest) -> Iterator[Simulator]:
    with Simulator(f"--{request.param}", kind="wrist") as simulator:
        yield simulator


# -- tables -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("columns", [40, 80, 200])
@pytest.mark.parametrize("verb", ["dump", "status"])
@both
def test_tables_at_any_width(verb: str, columns: int, wire: str) -> None:
    """No line is wider than the terminal, no number is cut, folded or left out."""
    with Terminal("wrist", verb, "--fake", ON[wire], columns=columns) as terminal:
        assert terminal.finish() == 0
        lines = terminal.text.split("\n")
    assert all(len(line) <= columns for line in lines), [line for line in lines if len(line) > columns]
    words = " ".join(lines).replace("(", " ").split()
    assert "…" not in " ".join(lines)
    assert "simulated" in words
    for value in ("-3.45", "11.25", "111", "222", "31", "34", "11.00", "-3.00", "700"):
        assert value in words, (value, lines)


@pytest.mark.parametrize("verb", ["dump", "status"])
@both
def test_a_faulty_wrist_fits_80x24(verb: str, wire: str) -> None:
    port = "fake://wrist?fault=faults" + ("&bus=can" if wire == "can" else "")
    with Terminal("wrist", verb, "-p", port) as terminal:
        assert terminal.finish() == 0
        text, screen = terminal.text.rstrip("\n"), terminal.lines
    lines = text.split("\n")
    assert len(lines) <= 24 and lines[0] == screen[0], "it scrolled"
    assert all(len(line) <= 80 for line in lines)
    joined = " ".join(text.split())
    for part in ("locked_rotor", "over_current", "bit names assumed from the hand",
                 "actuator #2 by the register table, #1 by the CAN example"):  # fmt: skip
        assert any(part in line for line in lines), (part, text)  # not broken in the middle
    assert joined.count("locked_rotor") <= 2


def test_status_names_the_axes() -> None:
    with Terminal("wrist", "status", "--fake") as terminal:
        assert terminal.finish() == 0
        rows = [line.split() for line in terminal.lines]
    assert ["pitch", "-3.45", "-3.00"] in rows  # measured, set
    assert ["yaw", "11.25", "11.00"] in rows


# -- the live view ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rows", [12, 24, 50])
@both
def test_live_view(rows: int, wire: str) -> None:
    """Head and counters are on the screen whatever its height; angles have two decimals; a bar grows from zero."""
    at_rest = "fake://wrist" + ("?bus=can" if wire == "can" else "")
    with Terminal("wrist", "watch", "-p", at_rest, "--rate", "20", rows=rows) as terminal:
        lines = terminal.until_samples(8)
        assert terminal.screen.cursor.hidden
        terminal.send("\x03")
        assert terminal.finish() == 130
        assert not terminal.screen.cursor.hidden
        assert "Traceback" not in terminal.text
    assert "simulated" in lines[0] and "wrist watch" in lines[0] and "Hz" in lines[0]
    (rate,) = re.findall(r"([0-9.]+) Hz", lines[0])
    assert 0 < float(rate) <= 21
    assert lines[-1].startswith("sent "), lines
    assert ("foreign_frames 0" in lines[-1]) is (wire == "can"), lines[-1]
    assert len(lines) <= rows
    for name in LIVE:
        assert any(line.startswith(name) for line in lines), (name, lines)
    if rows == 12:
        return
    for name, span in (("pitch_actual", "-3.45..-3.45"), ("yaw_actual", "11.25..11.25")):
        (line,) = [line for line in lines if line.startswith(name)]
        assert span in line
        assert re.search(rf"▏ *{span.split('..')[0]} ", line), line
    for name, text in (("current_1024", "111 mA"), ("error_1", "ok"), ("temperature_2", "34 °C")):
        (line,) = [line for line in lines if line.startswith(name)]
        assert text in line


def test_live_view_follows_a_motion(tmp_path: Path) -> None:
    """Another program moves the wrist through the simulator's panel while the view looks on."""
    panel = tmp_path / "panel"
    with (
        Simulator("--tcp", "127.0.0.1:0", "--control", panel, kind="wrist") as simulator,
        Terminal("wrist", "watch", "pitch_actual", "-p", simulator.link, "--rate", "30") as terminal,
    ):
        terminal.until_samples(3)
        assert run("sim", "control", panel, "set", "1020", s16(2000).hex()).code == 0
        lines = terminal.until_screen(lambda lines: "-3.45..20.00" in "\n".join(lines))
        terminal.send("\x03")
        assert terminal.finish() == 130
    assert "simulated" not in "\n".join(lines)


# -- movement ---------------------------------------------------------------------------------------------------------


@both
def test_move_on_a_terminal(wire: str) -> None:
    link = "fake://wrist?bus=can" if ON[wire] == "--can" else "fake://wrist"
    for milliseconds in (400, 2000, 10000):  # the longer it takes, the more a busy machine shows of it
        args = ("--pitch", "-10", "--yaw", "10", "--time", str(milliseconds), "-p", link)
        with Terminal("wrist", "move", *args) as terminal:
            assert terminal.finish() == 0
            text, lines = terminal.text, terminal.lines
        shown = re.findall(rf"pitch {NUMBER}°, yaw {NUMBER}°", text)
        if len(shown) >= 4:
            break
    assert len(shown) >= 4  # progress moves
    assert all(len(number.partition(".")[2]) == 2 for pair in shown for number in pair), shown
    pitches = [float(pitch) for pitch, _ in shown]
    assert pitches == sorted(pitches, reverse=True) and -10 <= pitches[-1] < pitches[0] <= -3.45
    rows = [line.split() for line in lines]
    assert ["pitch", "-10.00", "-10.00"] in rows and ["yaw", "10.00", "10.00"] in rows
    assert "arrived" in text
    assert "[y/N]" not in text


def held(trace: Path) -> tuple[float, float]:
    """(yaw, pitch) of the second and last write of a transcript, which holds both axes."""
    _, last = written_frames(trace)
    on_can = len(last.split()[0]) == 8
    data = bytes.fromhex(last.partition("] ")[2] if on_can else last)[0 if on_can else 7 :][:4]
    assert last.startswith("15038001 [4] " if on_can else "EB 90 01 07 31 0E 04 ")
    return tuple(int.from_bytes(data[i : i + 2], "little", signed=True) / 100 for i in (0, 2))  # type: ignore[return-value]


@pytest.mark.parametrize("key", ["\x03", "SIGTERM"])
def test_ctrl_c_in_the_middle_holds_the_wrist(sim: Simulator, tmp_path: Path, key: str) -> None:
    """The manual has no stop: the axes are commanded to where they are just then.

    They take 15 s from -3.45 to 20 degrees, so that the key comes in the middle on a busy machine, too.
    """
    trace = tmp_path / "t.txt"
    args = ("move", "--pitch", "20", "--time", "15000", "-p", sim.link, "--trace", trace)
    with Terminal("wrist", *args) as terminal:
        shown = terminal.until_number(rf"pitch {NUMBER}°", above=-3.0)
        if key == "\x03":
            terminal.send(key)
        else:
            terminal.process.kill(signal.SIGTERM)
        assert terminal.finish() == 130
        text = " ".join(terminal.text.split())
    yaw, pitch = held(trace)
    assert (yaw, shown <= pitch < 5.0) == (11.25, True), (yaw, shown, pitch)
    assert f"stay at pitch {pitch:.2f}°, yaw 11.25°" in text
    stands = run("wrist", "get", "pitch_actual", "yaw_actual", "-p", sim.link, "--json").values
    assert abs(stands["pitch_actual"] - pitch) < 0.3 and stands["yaw_actual"] == 11.25
    again = run("wrist", "get", "pitch_actual", "pitch_set", "-p", sim.link, "--json").values
    assert again["pitch_set"] == pitch
    assert abs(again["pitch_actual"] - pitch) < 0.3


def test_interrupt_without_a_terminal(sim: Simulator, tmp_path: Path) -> None:
    """A script's background job is stopped the same way; JSON says so."""
    trace = tmp_path / "t.txt"
    process = forks.start(
        ["wrist", "center", "--time", "5000", "-p", sim.link, "--json", "--trace", trace],
        clean_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    wait_until(lambda: trace.exists() and len(trace.read_text().splitlines()) > 12)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 130
    yaw, pitch = held(trace)
    assert 0 < yaw < 11.25 and -3.45 < pitch < 0
    assert f"pitch {pitch:.2f}°, yaw {yaw:.2f}°" in out.decode()


@pytest.mark.parametrize("times", [1, 2])
def test_ctrl_c_at_a_wrist_that_is_gone(times: int) -> None:
    """What could not be stopped is said, with what to do; also to who presses again before it has given up."""
    port = "fake://wrist?fault=silent&after=6"
    more = ("--timeout", "0.3", "--retries", "1" if times == 1 else "50")
    with Terminal("wrist", "move", "--pitch", "20", "--time", "3000", "-p", port, *more) as terminal:
        terminal.until("pitch")
        terminal.run_for(0.3)
        for _ in range(times):
            terminal.send("\x03")
            terminal.run_for(0.3)
        assert terminal.finish() == 130
        text = " ".join(terminal.text.split())
    assert "Traceback" not in text
    assert "could NOT be stopped" in text and "power" in text, text


@both
def test_restore_shows_the_plan_and_asks(tmp_path: Path, wire: str) -> None:
    snap, trace = tmp_path / "s.json", tmp_path / "t.txt"
    assert run("wrist", "snapshot", snap, "--fake").code == 0
    state = tmp_path / "state.json"
    port = f"fake://wrist?state={state}" + ("&bus=can" if wire == "can" else "")
    assert run("wrist", "set", "yaw_set=5", "-p", port).code == 0
    expected = "15038001 [2] 4C 04" if wire == "can" else "EB 90 01 05 31 0E 04 4C 04 99"
    for answer, code in (("n\r", 8), ("y\r", 0)):
        with Terminal("wrist", "restore", snap, "--setpoints", "-p", port, "--trace", trace) as terminal:
            terminal.until("[y/N]")
            assert expected in terminal.text and "MOVES" in terminal.text
            terminal.send(answer)
            assert terminal.finish() == code
        assert written_frames(trace) == ([expected] if code == 0 else [])
    assert POWER_ON["yaw_set"][2] == "4C 04"
