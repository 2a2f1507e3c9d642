"""A device that replies to a write as if it refused it, and carries it out: what a byte other than 01 means is not documented (exo §2.2.4, wrist §2.2.1)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from handctl.sim.hand.registers import Hand
from handctl.sim.inspire.frames import Asked
from handctl.sim.wrist.device import Module
from tests.support.cli import run
from tests.support.each_row import each_row

MOVES = [
    ("wrist", "move --yaw -10 --pitch 5", ""),
    ("wrist", "center", ""),
    ("wrist", "move --yaw -10 --pitch 5", "&bus=can&ack-dlc=1"),
    ("exo", "position index=300 --wait 2 --yes", ""),
    ("hand", "angle index=300 --wait 2 --yes", ""),
    ("hand", "position index=300 --wait 2 --yes", "&bus=can&model=tp"),
    ("hand", "angle index=300 --wait 2 --yes", "&bus=modbus-tcp&model=tp"),
]
SETS = [
    ("wrist", "set yaw_set=-10 --yes"),
    ("exo", "set position_set.index=300 --yes"),
    ("exo", "set force_set.index=100 --yes"),
    ("hand", "set angle_set.index=300 --yes"),
]


def done_all_the_same(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first write is carried out, and answered as one that was refused."""
    owner: Any = {"exo": Asked, "wrist": Module, "hand": Hand}[kind]
    write = owner.write
    refused: list[bool] = []

    def written(self: Any, *args: Any) -> bool | None:
        done: bool | None = write(self, *args)
        if done and not refused:
            refused.append(True)
            return False
        return done

    monkeypatch.setattr(owner, "write", written)


@each_row("kind, words, wire", MOVES)
def test_a_movement_that_was_begun_is_stopped(
    kind: str, words: str, wire: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done_all_the_same(kind, monkeypatch)
    result = run(kind, *words.split(), "-p", f"fake://{kind}?clock=virtual{wire}", "--json", "--trace", tmp_path / "t")
    assert result.code == 5 and "taken" in result.said, result
    first, *stop = result.json["writes"]
    assert first["state"] == "confirmed" and stop and all(step["state"] == "confirmed" for step in stop), result


@each_row("kind, words", SETS)
def test_a_value_that_is_held_was_not_refused(kind: str, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It may move: that is said with the command that stops it."""
    done_all_the_same(kind, monkeypatch)
    result = run(kind, *words.split(), "-p", f"fake://{kind}?clock=virtual", "--json")
    assert result.code == 5 and "taken" in result.said and f"handctl {kind} stop" in result.err, result
