"""The BarrettHand's speed with the port following, its restart, snapshots with the speed last (barrett §5.2.4, §5.4.1)."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handctl.cli import main
from handctl.errors import CheckFailed, DeviceRefused, HandctlError, ProtocolError
from tests.barrett.support import (
    CR,
    QUESTION,
    ScriptedHand,
    changes,
    codes,
    elements,
    gcl,
    hand_on,
    scripted,
    simulated,
)
from tests.support.each_row import each_row
from tests.support.refused import refused

# -- the speed --------------------------------------------------------------------------------------------------------


@each_row("dribble", [0.0, 0.001])
def test_the_port_follows_the_speed(dribble: float) -> None:
    """13 echo bytes at the old speed, the port, 1 s, CR, prompt (dossier 1.2)."""
    link = ScriptedHand({"PSET BAUD 384": "", "PGET BAUD": "384"})
    link.dribble = dribble
    hand = hand_on(link)
    (reading,) = hand.write(changes("BAUD=384"))
    assert reading.value == 384
    assert link.bauds == [38400]
    assert link.sent == [QUESTION, b"PSET BAUD 384\r", CR, b"PGET BAUD\r"]
    assert link.sent_at[2] - link.sent_at[1] >= 1.0


@each_row("code", [6, 12, 24, 48, 96, 192, 384])
def test_every_speed_of_the_simulated_hand(code: int) -> None:
    hand, link = simulated("baud=9600" if code != 96 else "baud=2400")
    assert [reading.value for reading in hand.write(changes(f"BAUD={code}"))] == [code]
    assert link.baud == code * 100
    assert [reading.value for reading in hand.read(elements("SN"))] == [1042]


def test_baud_goes_last() -> None:
    hand, link = simulated("")
    hand.write(changes("BAUD=192", "LFT=1", "DP=5"))
    sets = [command for command in link.commands if "SET" in command]
    assert sets == ["FSET DP 5", "PSET LFT 1", "PSET BAUD 192"]


def test_a_hand_that_does_not_follow() -> None:
    """Some hands cannot do the higher speeds (dossier 1.1): it is found again at the old one."""
    hand, link = simulated("max-baud=9600")
    with pytest.raises(DeviceRefused) as caught:
        hand.write(changes("BAUD=384"))
    assert (caught.value.exit_code, caught.value.code, link.baud) == (6, "baud", 9600)
    assert hand.read(elements("BAUD"))[0].value == 96


@each_row("baud", [None, 9600])
def test_a_prompt_at_a_speed_that_means_nothing_is_no_evidence(baud: int | None) -> None:
    """A device server with a speed of its own, or a port that keeps its own: the prompt comes, and BAUD is what it was."""
    link = ScriptedHand({"PSET BAUD 384": "ERR 128", "PGET BAUD": "96"}, baud=baud)
    link.set_baud = lambda baud: None  # type: ignore[method-assign]
    hand = hand_on(link)
    with refused(CheckFailed, "read-back"):
        hand.write(changes("BAUD=384"))


def test_a_hand_lost_by_its_speed() -> None:
    hand, link = scripted({"PSET BAUD 384": b"PSET BAUD 384"})
    link.interrupt_at = float("inf")
    original = link._data

    def deaf(request: bytes) -> bytes:
        link.deaf = request.startswith(b"PSET")
        return original(request)

    link._data = deaf  # type: ignore[method-assign]
    with pytest.raises(HandctlError) as caught:
        hand.write(changes("BAUD=384"))
    assert caught.value.exit_code == 4
    assert "no prompt after PSET BAUD 384, at 38400 bit/s or any other baud rate" in caught.value.text
    assert link.commands == ["PSET BAUD 384"]


def test_a_wrong_echo_of_the_speed_keeps_the_port() -> None:
    hand, link = scripted({"PSET BAUD 384": b"PSET BAUX 384"})
    with pytest.raises(ProtocolError) as caught:
        hand.write(changes("BAUD=384"))
    assert caught.value.code == "echo-differs"
    assert "50 53 45 54" in caught.value.text
    assert link.bauds == []


# -- reset ------------------------------------------------------------------------------------------------------------


@each_row("before", ["", "colon"])
def test_reset_shows_the_banner(before: str) -> None:
    banner = gcl("RESET")[:5] + (b":" if before else b"") + b"\n\rBarrettHand Firmware\n\rVersion 4.33\n\r=> "
    hand, link = scripted({"RESET": banner})
    assert hand.line.restart().lstrip(":\n") == "BarrettHand Firmware\nVersion 4.33"
    assert link.sent == [b"RESET\r", QUESTION]
    assert codes(hand) == ["uninitialized"]


def test_a_slow_start_is_waited_for() -> None:
    """15 s for a restart (dossier 1.3); a hand that does not answer at all costs no more."""
    hand, _ = simulated("boot=12")
    assert "BarrettHand Firmware" in hand.line.restart()
    assert codes(hand) == ["uninitialized"]


def test_reset_to_another_speed_is_followed() -> None:
    hand, link = simulated("")
    hand.write(changes("BAUD=384"))
    hand.line.restart()
    assert link.baud == 9600
    assert [reading.value for reading in hand.read(elements("S", "BAUD"))] == [4, 4, 4, 4, 96]


# -- snapshot and restore ---------------------------------------------------------------------------------------------


def run(*args: object) -> int:
    return main(["barrett", *map(str, args)])


def test_snapshot_diff_restore(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    port, file = f"fake://barrett?clock=virtual&state={tmp_path / 'state'}", tmp_path / "snapshot.json"
    assert run("snapshot", file, "-p", port) == 0
    values = json.loads(file.read_text(encoding="utf-8"))["values"]
    assert len(values) == 128
    assert (values["max_close_velocity.SPREAD"], values["baud_rate"]) == (60, 96)
    assert run("diff", file, "-p", port) == 0
    capsys.readouterr()
    assert run("set", "MCV.F2=77", "-p", port) == 0
    assert run("diff", file, "-p", port) == 7
    capsys.readouterr()
    assert run("restore", file, "--yes", "--json", "-p", port) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert rows == [
        {
            "name": "max_close_velocity.F2",
            "kind": "setting",
            "before": 77,
            "value": 100,
            "moves": False,
            "pushes": False,
        }
    ]
    assert run("diff", file, "-p", port) == 0
    assert run("restore", file, "--yes", "-p", port) == 0


def test_restore_order(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Globals except BAUD, motors, BAUD last (dossier 3.3); the plan is the bytes."""
    file = tmp_path / "snapshot.json"
    assert run("snapshot", file, "-p", "fake://barrett?clock=virtual&baud=19200") == 0
    capsys.readouterr()
    assert run("restore", file, "-n", "--json", "-p", "fake://barrett?clock=virtual") == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    lines = [bytes.fromhex(row["bytes"]).decode().rstrip("\r") for row in rows]
    assert lines[-1] == "PSET BAUD 192"
    assert lines[0] == "PSET LFT 0 OTEMP 0 LFDPD 0"
    assert all("FSET" in line for line in lines[1:-1])
    assert sum("BAUD" in line for line in lines) == 1
