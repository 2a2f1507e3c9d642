"""What a person sees of a wrist: tables, the live view, a movement and Ctrl-C in its middle."""

from __future__ import annotations

import itertools
import re
import signal
import subprocess
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from handctl.sim.engine.can_line import CanLine
from tests.inspire.wrist_commands import LIVE, POWER_ON, WIRES, written_frames
from tests.inspire.wrist_support import fake_port
from tests.support.cli import Simulator, clean_environment, run, s16, start, wait_until
from tests.support.each_row import each_row
from tests.support.person import once, person
from tests.support.screen import screen
from tests.support.terminal import Terminal

both = pytest.mark.parametrize("wire", WIRES)
NUMBER = r"(-?\d+\.\d+)"


# -- tables -----------------------------------------------------------------------------------------------------------


@each_row("verb, columns, wire", product(("dump", "status"), (40, 80, 200), WIRES))
def test_tables_at_any_width(verb: str, columns: int, wire: str) -> None:
    """No line is wider than the terminal, no number is cut, folded or left out."""
    shown = screen("wrist", verb, "-p", fake_port(wire), columns=columns)
    assert shown.code == 0
    assert all(len(line) <= columns for line in shown.lines), [line for line in shown.lines if len(line) > columns]
    words = shown.text.replace("(", " ").split()
    assert "…" not in shown.text
    assert "simulated" in words
    for value in ("-3.45", "11.25", "111", "222", "31", "34", "11.00", "-3.00", "700"):
        assert value in words, (value, shown.lines)


@each_row("verb, wire", product(("dump", "status"), WIRES))
def test_a_faulty_wrist_fits_80x24(verb: str, wire: str) -> None:
    shown = screen("wrist", verb, "-p", fake_port(wire, "fault=faults"))
    assert shown.code == 0
    text = shown.text.rstrip("\n")
    lines = text.split("\n")
    assert len(lines) <= 24 and lines[0].rstrip() == shown.display[0], "it scrolled"
    assert all(len(line) <= 80 for line in lines)
    for part in ("locked_rotor", "over_current", "bit names assumed from the hand",
                 "actuator #2 by the register table, #1 by the CAN example"):  # fmt: skip
        assert any(part in line for line in lines), (part, text)  # not broken in the middle
    assert text.count("locked_rotor") <= 2


def test_status_names_the_axes() -> None:
    rows = [line.split() for line in screen("wrist", "status", "-p", fake_port()).lines]
    assert ["pitch", "-3.45", "-3.00"] in rows  # measured, set
    assert ["yaw", "11.25", "11.00"] in rows


# -- the live view ----------------------------------------------------------------------------------------------------


@each_row("rows, wire", product((12, 24, 50), WIRES))
def test_live_view(rows: int, wire: str) -> None:
    """Head and counters are on the screen whatever its height; angles have two decimals; a bar grows from zero."""
    shown = screen("wrist", "watch", "-p", fake_port(wire), "--rate", "20", "--count", "8", rows=rows)
    assert shown.code == 0, shown.err
    lines = shown.display
    hidden, visible = (shown.data.rindex(code) for code in ("\x1b[?25l", "\x1b[?25h"))
    assert hidden < visible, "the cursor is back"
    assert "simulated" in lines[0] and "wrist watch" in lines[0] and "8 samples" in lines[0]
    (rate,) = re.findall(r"([0-9.]+) Hz", lines[0])
    assert 0 < float(rate) <= 21
    assert lines[-1].startswith("Ctrl-C ends"), lines
    assert len(lines) <= rows
    for name in LIVE:
        assert any(line.startswith(name) for line in lines), (name, lines)
    if rows == 12:
        return
    for name, span in (("pitch_actual", "-3.45..-3.45"), ("yaw_actual", "11.25..11.25")):
        line = next(line for line in lines if line.startswith(name))
        assert span in line
        assert re.search(rf"▏ *{span.split('..')[0]} ", line), line
    for name, text in (("current_1024", "111 mA"), ("error_1", "ok"), ("temperature_2", "34 °C")):
        line = next(line for line in lines if line.startswith(name))
        assert text in line


def test_live_view_follows_a_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    """The wrist is moved by somebody else at the fourth question of the view."""
    asked, feed = itertools.count(1), CanLine.feed_frame

    def moved(line: CanLine, *frame: Any) -> None:
        if next(asked) == 4:
            assert line.command(f"set 1020 {s16(2000).hex()}")
        feed(line, *frame)

    monkeypatch.setattr(CanLine, "feed_frame", moved)
    shown = screen("wrist", "watch", "pitch_actual", "-p", fake_port("can"), "--rate", "30", "--count", "9")
    assert shown.code == 0
    assert "-3.45..20.00" in "\n".join(shown.display)


# -- movement ---------------------------------------------------------------------------------------------------------


@both
def test_move_on_a_terminal(wire: str) -> None:
    shown = person("wrist", "move", "--pitch", "-10", "--yaw", "10", "--time", "400", "-p", fake_port(wire))
    assert shown.code == 0
    told = re.findall(rf"pitch {NUMBER}° of -10.00°, yaw {NUMBER}°", shown.text)
    assert len(told) >= 4  # progress moves
    assert all(len(number.partition(".")[2]) == 2 for pair in told for number in pair), told
    pitches = [float(pitch) for pitch, _ in told]
    assert pitches == sorted(pitches, reverse=True) and -10 <= pitches[-1] < pitches[0] <= -3.45
    rows = [line.split() for line in shown.display]
    assert ["pitch", "-10.00", "-10.00", "reached"] in rows and ["yaw", "10.00", "10.00", "reached"] in rows
    assert "arrived" in shown.text
    assert "[y/N]" not in shown.text


def held(trace: Path) -> tuple[float, float]:
    """(yaw, pitch) of the second and last write of a transcript, which holds both axes."""
    _, last = written_frames(trace)
    on_can = len(last.split()[0]) == 8
    data = bytes.fromhex(last.partition("] ")[2] if on_can else last)[0 if on_can else 7 :][:4]
    assert last.startswith("15038001 [4] " if on_can else "EB 90 01 07 31 0E 04 ")
    return tuple(int.from_bytes(data[i : i + 2], "little", signed=True) / 100 for i in (0, 2))  # type: ignore[return-value]


def stands(link: str, pitch: float) -> None:
    """The wrist is told to stay at a pitch, and does."""
    now = run("wrist", "get", "pitch_actual", "pitch_set", "yaw_actual", "-p", link, "--json").values
    assert now["pitch_set"] == pitch and abs(now["pitch_actual"] - pitch) < 0.3
    again = run("wrist", "get", "pitch_actual", "-p", link, "--json").values
    assert abs(again["pitch_actual"] - pitch) < 0.3


@each_row("wire, key", product(WIRES, (signal.SIGINT, signal.SIGTERM)))
def test_ctrl_c_in_the_middle_holds_the_wrist(wire: str, key: signal.Signals, tmp_path: Path) -> None:
    """The manual has no stop: the axes are commanded to where they are just then."""
    trace, link = tmp_path / "t.txt", fake_port(wire, f"state={tmp_path / 'state'}")
    args = ("move", "--pitch", "20", "--time", "15000", "-p", link, "--trace", trace)
    shown = person("wrist", *args, press=once(lambda seen: re.search(r"pitch -2\.\d\d°", seen), key))
    assert shown.code == 130
    yaw, pitch = held(trace)
    assert (yaw, -3.0 <= pitch < -2.0) == (11.25, True), (yaw, pitch)
    assert f"stay at pitch {pitch:.2f}°, yaw 11.25°" in " ".join(shown.text.split())
    stands(link, pitch)


@pytest.mark.real
def test_ctrl_c_on_a_real_terminal_and_port(tmp_path: Path) -> None:
    """They take 15 s from -3.45 to 20 degrees, so that the key comes in the middle on a busy machine, too."""
    trace = tmp_path / "t.txt"
    with Simulator("--slcan-pty", kind="wrist") as sim:
        args = ("move", "--pitch", "20", "--time", "15000", "-p", sim.link, "--trace", trace)
        with Terminal("wrist", *args) as terminal:
            terminal.until_number(rf"pitch {NUMBER}°", above=-3.0)
            terminal.send("\x03")
            assert terminal.finish() == 130
        yaw, pitch = held(trace)
        assert (yaw, -3.0 <= pitch < 20.0) == (11.25, True), (yaw, pitch)
        stands(sim.link, pitch)


@pytest.mark.real
def test_interrupt_without_a_terminal(tmp_path: Path) -> None:
    """A script's background job is stopped the same way; JSON says so."""
    trace = tmp_path / "t.txt"
    with Simulator("--pty", kind="wrist") as sim:
        process = start(
            ["wrist", "center", "--time", "15000", "-p", sim.link, "--json", "--trace", trace],
            clean_environment(),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        wait_until(lambda: trace.exists() and len(trace.read_text().splitlines()) > 12)
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=30)
    assert process.returncode == 130
    yaw, pitch = held(trace)
    assert 0 < yaw <= 11.25 and -3.45 <= pitch < 0
    assert f"pitch {pitch:.2f}°, yaw {yaw:.2f}°" in out.decode()


@pytest.mark.parametrize("times", [1, 2])
def test_ctrl_c_at_a_wrist_that_is_gone(times: int) -> None:
    """What could not be stopped is said, with what to do; also to who presses again before it has given up."""
    port = fake_port(query="fault=silent&after=6")
    left = [signal.SIGINT] * times
    shown = person(
        "wrist", "move", "--pitch", "20", "--time", "3000", "-p", port, "--timeout", "0.3", "--retries", "1",
        press=lambda seen: left.pop() if left and "° of" in seen else None,
    )  # fmt: skip
    text = " ".join(shown.text.split())
    assert (shown.code, left) == (4, [])
    assert "Traceback" not in text
    assert "the stop has not been confirmed" in text and "power" in text, text


@both
def test_restore_shows_the_plan_and_asks(tmp_path: Path, wire: str) -> None:
    snap, trace = tmp_path / "s.json", tmp_path / "t.txt"
    assert run("wrist", "snapshot", snap, "-p", fake_port()).code == 0
    port = fake_port(wire, f"state={tmp_path / 'state.json'}")
    assert run("wrist", "set", "yaw_set=5", "-p", port).code == 0
    expected = "15038001 [2] 4C 04" if wire == "can" else "EB 90 01 05 31 0E 04 4C 04 99"
    for answer, code in (("n", 8), ("y", 0)):
        shown = person("wrist", "restore", snap, "--setpoints", "-p", port, "--trace", trace, answers=[answer])
        assert shown.code == code, shown.text
        before, asked, _ = shown.text.partition("[y/N]")
        assert asked and re.search(r"yaw_set +5.0 +11.0", before) and "MOVES" in before
        assert written_frames(trace) == ([expected] if code == 0 else [])
    assert POWER_ON["yaw_set"][2] == "4C 04"
