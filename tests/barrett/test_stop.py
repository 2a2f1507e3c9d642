"""`barrett stop` for a hand at any speed: remembered, given, or neither; and nothing that it sends is a boot monitor's trigger."""

from __future__ import annotations

from itertools import combinations

import pytest

from handctl.devices.barrett import state_files
from handctl.devices.barrett.parameter_map import SPEEDS
from handctl.devices.barrett.stopper import power_off
from handctl.model.command_settings import Settings
from handctl.model.stop_sequence import SILENCE, StopContext, writes_without_replies
from handctl.sim.bus.wire_pair import RECEIVERS, resample
from tests.support.cli import Result, Spy, run, spying
from tests.support.each_row import each_row

WAITS, SLOW = 2.0, 6.0 + SILENCE
"""Seconds that somebody may wait for the stop of a hand whose speed nobody knows; where slow speeds are heard first."""
PREFIXES = ["", *("".join(chosen) for size in (1, 2, 3, 4) for chosen in combinations("1234", size))]


def stop(speed: int, *words: str, found: str = "moving") -> tuple[Result, Spy]:
    link = f"fake://barrett?clock=virtual&wire=auto&baud={speed}&found={found}&initialized=1"
    with spying() as spy:
        return run("barrett", "stop", "-p", link, "--json", *words), spy


def remember(monkeypatch: pytest.MonkeyPatch, speed: int | None) -> None:
    monkeypatch.setattr(state_files, "speed_of", lambda name: speed)


def text(result: Result) -> str:
    return " ".join(message["text"] for message in result.json["messages"])


@each_row("found", ["moving", "loop-moving"])
@each_row("remembered", [None, 38400, 600])
@each_row("speed", SPEEDS)
def test_a_hand_at_any_speed_is_stopped(
    speed: int, remembered: int | None, found: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It stands and has no power; the speed is told, and that the first one was none."""
    remember(monkeypatch, remembered)
    result, spy = stop(speed, found=found)
    assert result.code == 0, result
    motors = spy.lines[-1].command("motors")
    assert "moving" not in motors and "power on" not in motors, motors
    assert spy.now < (WAITS if min(speed, remembered or speed) >= 9600 else SLOW), "nobody waits so long"
    first = remembered or 9600
    assert f"at {speed} bit/s" in text(result), result
    assert (f"no reply at {first} bit/s" in text(result)) == (speed != first), result
    assert result.rows[-1]["meaning"] == f"T at {speed} bit/s: motor power off" and result.rows[-1]["answer"], result
    states = [row["state"] for row in result.json["writes"]]
    assert states[-1] == "confirmed" and (speed == first or states[0] == "sent"), "what nobody heard is not confirmed"


def test_the_known_speed_is_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """One ^C that no boot monitor takes for more, then T: nothing at 9600."""
    remember(monkeypatch, 38400)
    result, _ = stop(38400)
    assert [row["bytes"] for row in result.rows] == ["00 03", "54 0D"]
    remember(monkeypatch, 1200)
    result, _ = stop(38400, "--baud", "38400")
    assert [row["bytes"] for row in result.rows] == ["00 03", "54 0D"], "the speed that is given counts"
    result = run("barrett", "stop", "-n", "-p", "/dev/ttyUSB0", "--json")
    assert result.rows[0]["meaning"].startswith("^C at 1200 bit/s") and result.rows[0]["bytes"] == "03"


def test_a_hand_that_says_nothing_is_told_at_every_speed() -> None:
    result, _ = stop(9600, found="off")
    assert result.code == 4, result
    assert all(str(speed) in text(result) for speed in SPEEDS), result
    assert "witch the power supply off" in result.error["hint"]
    assert not [row for row in result.json["writes"] if row["state"] == "confirmed"]


@pytest.mark.parametrize("remembered", [None, 38400, 19200])
@pytest.mark.parametrize("uart", RECEIVERS)
@pytest.mark.parametrize("found", ["boot", "monitor"])
def test_firmware_is_not_harmed(found: str, uart: str, remembered: int | None, monkeypatch: pytest.MonkeyPatch) -> None:
    """The simulated hand decides, which hears every byte at its own speed."""
    remember(monkeypatch, remembered)
    link = f"fake://barrett?clock=virtual&wire=auto&uart={uart}&found={found}&boot=1&window=1"
    for words in ((), ("--motors", "123")):
        with spying() as spy:
            run("barrett", "stop", "-p", link, *words)
        wanted = "image valid" if found == "boot" else "image blank"
        assert spy.lines[-1].command("image").startswith(wanted), spy.lines[-1].command("image")


@each_row("receiver", RECEIVERS)
@each_row("speed", SPEEDS)
def test_nothing_that_goes_out_unheard_is_a_trigger(speed: int, receiver: str) -> None:
    """Each write alone; what an adapter sends without a pause, up to all repetitions of ^C, together."""
    for prefix in PREFIXES:
        for step in writes_without_replies(power_off(StopContext(Settings(), speed=speed), prefix)):
            at = int(step.meaning.partition(" at ")[2].partition(" ")[0])
            assert 0xFF not in resample(step.data, at, 9600, receiver), (step, at)
            if step.data[-1:] == b"\x03":
                assert not any(0xFF in resample(step.data * count, at, 9600, receiver) for count in range(10)), at
