"""The stop key of a live view: shown, pressed on a real terminal, and the terminal as it was afterwards."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.cli import Simulator
from tests.support.stop import Stand
from tests.support.terminal import Terminal

pytestmark = pytest.mark.real


@pytest.mark.parametrize("family", ["exo", "aidin"])
def test_the_key_stops_the_device(family: str, tmp_path: Path) -> None:
    place = Stand(family, tmp_path)
    try:
        with Terminal(family, "watch", "--rate", "20", "-p", place.link) as terminal:
            terminal.until("s stops the device")
            place.heard()
            terminal.send("s")
            assert terminal.finish() == 130
            assert "Stopped by the key s" in terminal.text
            assert not terminal.screen.cursor.hidden
        place.reached(0.0)
    finally:
        place.close()


def test_other_keys_do_nothing_and_ctrl_c_ends() -> None:
    with Simulator("--pty") as simulator, Terminal("exo", "watch", "-p", simulator.link) as terminal:
        terminal.until("s stops the device")
        terminal.send("xyz q\r")
        terminal.until_number(r"(\d+) samples", above=terminal.until_number(r"(\d+) samples", above=0))
        terminal.send("\x03")
        assert terminal.finish() == 130
        assert "Stopped by the key" not in terminal.text
