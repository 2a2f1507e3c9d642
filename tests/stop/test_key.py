"""The stop key of a live view: shown, pressed on a real terminal, and the terminal as it was afterwards."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from tests.support.cli import Simulator, run
from tests.support.stop import Stand
from tests.support.terminal import Terminal

pytestmark = pytest.mark.real


@pytest.mark.parametrize("family", ["exo", "aidin"])
def test_the_key_stops_the_device(family: str, tmp_path: Path) -> None:
    place = Stand(family, tmp_path)
    try:
        with Terminal(family, "watch", "--rate", "20", "-p", place.link) as terminal:
            terminal.until("S stop")
            place.heard()
            terminal.send("S")
            assert terminal.finish() == 130
            assert "Stopped by the key S" in terminal.text
            assert not terminal.screen.cursor.hidden
        place.reached(0.0)
    finally:
        place.close()


@pytest.mark.parametrize("view", ["top", "watch"])
def test_the_key_stops_every_device_of_a_view_of_several(view: str, tmp_path: Path) -> None:
    """One is asked, one sends unasked; with Tab one is shown alone. No stop waits for the next sample, 100 s later."""
    kinds = ("exo", "aidin") if view == "top" else ("exo", "exo")
    folders = [tmp_path / str(number) for number in range(2)]
    for folder in folders:
        folder.mkdir()
    stands = [Stand(kind, folder) for kind, folder in zip(kinds, folders, strict=True)]
    config = tmp_path / "config.toml"
    config.write_text(
        "".join(
            f'[devices.d{number}]\nkind = "{stand.family}"\nport = "{stand.link}"\n'
            for number, stand in enumerate(stands)
        )
    )
    words = ("top",) if view == "top" else ("-d", "*", "watch")
    environment = {**stands[0].environment, "HANDCTL_CONFIG": str(config)}
    try:
        with Terminal(*words, "--rate", "20" if view == "watch" else "0.01", env=environment) as terminal:
            terminal.until("S stop all")
            for stand in stands:
                stand.heard()
            terminal.send("\t")
            terminal.run_for(0.3)
            terminal.send("S")
            assert terminal.finish() == 130, terminal.text
            assert "d0: stopped by the key S" in terminal.text.replace("D0", "d0") and "d1: stopped" in terminal.text
        for stand in stands:
            stand.reached(0.0)
        kept = run("history", "--json", env=environment).rows
        assert sorted(row["name"] for row in kept) == ["d0", "d1"] and all(row["writes"] for row in kept)
    finally:
        for stand in stands:
            stand.close()


@pytest.mark.parametrize("seconds", [0.02, 0.08])
def test_ctrl_c_right_after_the_key_does_not_cut_the_stops_off(seconds: float, tmp_path: Path) -> None:
    """Whoever presses both is in a hurry: the stop goes on, and what is said of it is what was sent."""
    stands = [Stand("exo", folder) for folder in (tmp_path / "0", tmp_path / "1") if folder.mkdir() is None]
    config = tmp_path / "config.toml"
    config.write_text("".join(f'[devices.d{at}]\nkind = "exo"\nport = "{one.link}"\n' for at, one in enumerate(stands)))
    try:
        with Terminal("top", env={**stands[0].environment, "HANDCTL_CONFIG": str(config)}) as terminal:
            terminal.until("S stop all")
            for stand in stands:
                stand.heard()
            terminal.send("S")
            terminal.run_for(seconds)
            terminal.send("\x03")
            assert terminal.finish() == 130, terminal.text
            assert "Traceback" not in terminal.text and "d1: stopped" in terminal.text.replace("D1", "d1")
        for stand in stands:
            stand.reached(0.0)
    finally:
        for stand in stands:
            stand.close()


def test_other_keys_do_nothing_and_ctrl_c_ends() -> None:
    with Simulator("--pty") as simulator, Terminal("exo", "watch", "-p", simulator.link) as terminal:
        terminal.until("S stop")
        terminal.send("xsyz\r\x1b[A")  # a small s, too, and an arrow, which begins with ESC
        terminal.until_number(r"(\d+) samples", above=terminal.until_number(r"(\d+) samples", above=0))
        terminal.send("\x03")
        assert terminal.finish() == 130
        assert "Stopped by the key" not in terminal.text


@pytest.mark.parametrize("key", ["q", "\x1b"])
def test_a_view_ends_without_touching_the_device_and_gives_the_terminal_back(key: str) -> None:
    with Simulator("--pty") as simulator, Terminal("exo", "watch", "-p", simulator.link) as terminal:
        terminal.until_samples(3)
        terminal.send(key)
        assert terminal.finish() == 0
        assert "true rate" in terminal.text and "Stopped" not in terminal.text
        assert terminal.data.rindex(b"\x1b[?1049l") > terminal.data.rindex(b"\x1b[?1049h")
        assert not terminal.screen.cursor.hidden


def test_what_was_typed_before_the_view_began_does_nothing() -> None:
    with Simulator("--pty") as simulator, Terminal("exo", "watch", "-p", simulator.link) as terminal:
        terminal.send("Sq")
        terminal.until("S stop")
        terminal.until_number(r"(\d+) samples", above=2)
        terminal.send("q")
        assert terminal.finish() == 0


def test_keys_record_freeze_and_help(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with Simulator("--pty") as simulator, Terminal("exo", "watch", "--rate", "50", "-p", simulator.link) as terminal:
        terminal.until("S stop")
        for key, shown in (
            ("?", "without asking"),
            ("?", "position_"),
            ("+", "-60 s"),
            ("r", "recording to"),
            (" ", "frozen"),
        ):
            terminal.send(key)
            terminal.until(shown)
        at = terminal.until_number(r"(\d+) samples", above=0)
        terminal.send(" ")
        terminal.until_number(r"(\d+) samples", above=at)  # read on meanwhile
        terminal.send("q")
        assert terminal.finish() == 0
    (made,) = tmp_path.glob("exo-*.csv")
    lines = made.read_text().splitlines()
    assert lines[0].startswith("t_s,position_actual.little,") and len(lines) > 1
    assert f"Recorded {len(lines) - 1} rows to {made.name}" in " ".join(terminal.text.split())


@pytest.mark.parametrize("how", ["ctrl-c", "term", "lost", "resized"])
def test_the_terminal_is_given_back_however_a_view_ends(how: str) -> None:
    with Simulator("--pty") as simulator, Terminal("exo", "watch", "--rate", "50", "-p", simulator.link) as terminal:
        terminal.until_samples(3)
        if how == "resized":
            for columns in (*range(30, 160, 7), 80):
                terminal.process.setwinsize(10 + columns % 30, columns)
                terminal.run_for(0.01)
            terminal.process.setwinsize(24, 80)
            terminal.send("q")
        elif how == "ctrl-c":
            terminal.send("\x03")
        elif how == "term":
            terminal.process.kill(signal.SIGTERM)
        else:
            simulator.stop()
        assert terminal.finish() == {"ctrl-c": 130, "term": 130, "lost": 3, "resized": 0}[how]
        assert terminal.data.rindex(b"\x1b[?1049l") > terminal.data.rindex(b"\x1b[?1049h")
        assert terminal.data.rindex(b"\x1b[?25h") > terminal.data.rindex(b"\x1b[?25l")
        assert "Traceback" not in terminal.text
