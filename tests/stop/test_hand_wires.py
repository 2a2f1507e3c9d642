"""An RH56 hand is stopped from outside on the wires beside EB90, which is in test_stop: alone, and while another handctl moves it."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from handctl.sim.engine.serve import send_control
from tests.support.cli import Simulator, clean_environment, run, start, wait_until

pytestmark = pytest.mark.real

PLACES: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "Modbus RTU, named": (("--modbus-pty",), ("--protocol", "modbus")),
    "Modbus TCP": (("--modbus-tcp", "127.0.0.1:0"), ()),
    "CAN on a pty": (("--slcan-pty",), ()),
}
"""How it is served, and the options of a command there."""
MOVES = ("angle", "1000", "1000", "1000", "1000", "1000", "-1", "-y", "--wait", "60", "--json")
OPEN = " ".join(["E8 03"] * 5)
STANDS = " ".join(["00"] * 12)


class Hand:
    """A served hand that takes 40 s for a whole stroke."""

    def __init__(self, folder: Path, wire: str) -> None:
        place, self.more = PLACES[wire]
        self.panel = folder / "panel"
        self.simulator = Simulator(*place, "--set", "speed=20", "--control", self.panel, kind="hand")
        self.link = self.simulator.link
        (folder / "run").mkdir(mode=0o700)
        self.environment = {"XDG_RUNTIME_DIR": str(folder / "run"), "XDG_STATE_HOME": str(folder / "state")}

    def ask(self, question: str) -> str:
        return send_control(str(self.panel), question).removeprefix("ok ")


@pytest.fixture(params=PLACES)
def hand(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Hand]:
    made = Hand(tmp_path, request.param)
    yield made
    made.simulator.stop()


def test_a_hand_that_moves_is_stopped_and_who_moves_it_ends(hand: Hand) -> None:
    """By `hand stop`, by `stop` without the family, and once more while nobody has it."""
    for words in (("hand", "stop"), ("stop",)):
        hand.ask(f"set 1486 {' '.join(['FF'] * 12)}")  # else the new speed lets the fingers go on to their last target
        set_speed = run("hand", "speed", *["20"] * 6, "-y", *hand.more, "-p", hand.link, env=hand.environment)
        assert set_speed.code == 0, set_speed
        mover = start(
            ["hand", *MOVES, *hand.more, "-p", hand.link], clean_environment(hand.environment),
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        )  # fmt: skip
        try:
            wait_until(lambda: hand.ask("get 1486 10") == OPEN, 30.0)
            stopped = run(
                *words, *(hand.more if words[0] == "hand" else ()), "-p", hand.link, "--json", env=hand.environment
            )
            assert stopped.code == 0, stopped
            assert mover.wait(20) == 130
            assert mover.stderr is not None and b"at the request of another handctl command" in mover.stderr.read()
        finally:
            mover.kill()
            mover.communicate()
        assert hand.ask("get 1522 12") == STANDS
        here = hand.ask("get 1546 12")
        assert hand.ask("get 1546 12") == here != hand.ask("get 1486 12")
    alone = run("hand", "stop", *hand.more, "-p", hand.link, "--json", env=hand.environment)
    states = [row["state"] for row in alone.json["writes"]]
    assert alone.code == 0 and states[-1] == "confirmed" and set(states[:-1]) <= {"sent", "confirmed"}, alone
