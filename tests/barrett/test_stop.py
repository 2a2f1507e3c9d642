"""`barrett stop` for a hand at any speed: remembered, given, or neither; and nothing that it sends is a boot monitor's trigger."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import combinations

import pytest

from handctl.devices.barrett import state_files
from handctl.devices.barrett.gcl.passthrough import DeathGuard
from handctl.devices.barrett.parameter_map import SPEEDS
from handctl.devices.barrett.stopper import CTRL_C_KEEPS_POWER, power_off
from handctl.errors import DeviceRefused, HandctlError, NoAnswer, ProtocolError
from handctl.model.command_settings import Settings
from handctl.model.prompts import Prompts
from handctl.model.stop_sequence import (
    AGAIN,
    SILENCE,
    StopContext,
    Stopped,
    StopPlan,
    exchange_steps,
    run_stop,
    writes_without_replies,
)
from handctl.sim.bus.wire_pair import RECEIVERS, resample
from tests.barrett.support import ABORT, gcl, scripted, simulated
from tests.support.cli import Result, Spy, run, spying
from tests.support.each_row import each_row
from tests.support.scripted import Reply, ScriptedLink

READING = 30 * 10 / 600
"""Seconds of two readings of the positions, 30 bytes there and back, at the slowest speed: half of it each."""
WAITS, SLOW = 2.0, 6.0 + SILENCE + READING
"""Seconds that somebody may wait for the stop of a hand whose speed nobody knows; where slow speeds are heard first."""
PLACES = "46 47 45 54 20 50 0D"
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
    off, look = result.rows[-2:]
    assert off["meaning"] == f"T at {speed} bit/s: motor power off" and off["answer"], result
    assert look["meaning"] == "read the positions" and "Positions: F1 " in text(result), result
    states = [row["state"] for row in result.json["writes"]]
    assert states[-1] == "confirmed" and (speed == first or states[0] == "sent"), "what nobody heard is not confirmed"


def test_the_known_speed_is_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """One ^C that no boot monitor takes for more, then T: nothing at 9600."""
    remember(monkeypatch, 38400)
    result, _ = stop(38400)
    assert [row["bytes"] for row in result.rows] == ["00 03", "54 0D", PLACES]
    remember(monkeypatch, 1200)
    result, _ = stop(38400, "--baud", "38400")
    assert [row["bytes"] for row in result.rows] == ["00 03", "54 0D", PLACES], "the speed that is given counts"
    result = run("barrett", "stop", "-n", "-p", "/dev/ttyUSB0", "--json")
    assert result.rows[0]["meaning"].startswith("^C at 1200 bit/s") and result.rows[0]["bytes"] == "03"


def test_a_hand_that_says_nothing_is_told_at_every_speed() -> None:
    result, _ = stop(9600, found="off")
    assert result.code == 4, result
    assert all(str(speed) in text(result) for speed in SPEEDS), result
    assert "witch the power supply off" in result.error["hint"]
    assert not [row for row in result.json["writes"] if row["state"] == "confirmed"]


def test_prompts_that_are_late_are_no_reading() -> None:
    """Those of nine ^C come behind the echo of the query, ahead of its values."""
    result = run("barrett", "stop", "--json", "-p", "fake://barrett?clock=virtual&fault=late")
    assert result.code == 0 and "Positions: F1 1021" in text(result), result


@each_row("seconds", [place / 10 for place in range(12)])
def test_a_hand_that_is_saving_is_asked_until_it_has_saved(seconds: float) -> None:
    """It is deaf for 2.6 s, and its prompt at the end is no reply to T."""
    _, link = simulated()
    link.write(b"FSAVE\r", link.deadline(1))
    link.sleep(seconds)
    link.discard()
    stopped = run_stop(link, power_off(StopContext(Settings(), speed=9600, fixed=True, proven=True)))
    assert stopped.error is None and "T was acknowledged" in stopped.text, stopped


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


# -- it stands: two readings that agree ---------------------------------------------------------------------------------


Place = Callable[[float], float]
"""Where the motors read so many seconds after ^C, or after T."""


class Coasting:
    """A hand that acknowledges ^C and T, and whose motors go on as `places` say; T ends that where it `obeys` it."""

    def __init__(self, places: Place, *, obeys: bool = False, hold: str = "0 0 0 1", reads: bool = True) -> None:
        self.places, self.obeys, self.hold, self.reads = places, obeys, hold, reads
        self.since: float | None = None
        self.rest: float | None = None
        self.link = ScriptedLink(self.answer)

    def answer(self, request: bytes) -> list[Reply]:
        now = self.link.now()
        self.since = now if self.since is None else self.since
        at = self.rest if self.rest is not None else self.places(now - self.since)
        if request == b"\x03":
            return [(0.001, b"\n\rERR 16384\n\r=> ")]
        command = request.removesuffix(b"\r").decode()
        if command == "T" and self.obeys:
            self.rest = at
        lines = [" ".join([str(round(at))] * 4)] if "P" in command else []
        lines += [self.hold] if "HOLD" in command else []
        if "FGET" in command and not self.reads:
            return []
        return [(0.001, gcl(command, *lines))]

    def stopped(self, *, powered: bool) -> Stopped:
        context = StopContext(Settings(), speed=9600, fixed=True, powered=powered)
        return exchange_steps(self.link, power_off(context), [])

    @property
    def commands(self) -> list[bytes]:
        return [one.removesuffix(b"\r") for one in self.link.sent]


COASTS: dict[str, tuple[Place, type[HandctlError] | None]] = {
    "stands": (lambda since: 4711.0, None),
    "trembles": (lambda since: 4711.0 + 2 * (int(since * 20) % 2), None),
    "brakes": (lambda since: 4711.0 + 300 * min(since, 0.4), None),
    "coasts": (lambda since: 4711.0 + 6000 * since, DeviceRefused),
    "coasts slowly": (lambda since: 4711.0 - 244 * since, DeviceRefused),
}


@each_row("coasts", COASTS)
@each_row("powered", [True, False])
def test_a_stop_is_seen_in_two_readings(powered: bool, coasts: str) -> None:
    """One look cannot show it: two that agree do. Where they never agree, T has gone out and the stop is no success."""
    places, error = COASTS[coasts]
    hand = Coasting(places)
    stopped = hand.stopped(powered=powered)
    assert stopped.error is error, stopped
    assert sum(one.startswith(b"FGET P") for one in hand.commands) >= 2
    assert (b"T" in hand.commands) == (not powered or error is not None)
    assert ("Positions: F1 " in stopped.text) == (error is None)


def test_a_hand_that_goes_on_after_ctrl_c_loses_its_power() -> None:
    hand = Coasting(COASTS["coasts"][0], obeys=True)
    stopped = hand.stopped(powered=True)
    assert stopped.error is DeviceRefused, "it has not obeyed ^C"
    assert f"{AGAIN}, and now it stands still" in stopped.text and hand.commands.count(b"T") == 1
    assert hand.commands.index(b"T") > hand.commands.index(b"FGET P HOLD") and "motor power is off" in stopped.text


def test_positions_that_do_not_come_are_no_success() -> None:
    hand = Coasting(lambda since: 0.0, reads=False)
    assert hand.stopped(powered=False).error is NoAnswer
    hand = Coasting(lambda since: 0.0, reads=False)
    assert hand.stopped(powered=True).error is NoAnswer and b"T" in hand.commands


@each_row(
    "hold,kept,off",
    [("0 0 0 1", "SPREAD", "F1, F2, F3"), ("1 1 1 1", "F1, F2, F3, SPREAD", ""), ("0 1 0 0", "F2", "F1, F3, SPREAD")],
)
def test_which_motors_keep_their_power_is_read(hold: str, kept: str, off: str) -> None:
    """After ^C a motor whose HOLD is 0 is off (barrett §5.5 case 4)."""
    stopped = Coasting(lambda since: 5.0, hold=hold).stopped(powered=True)
    assert f"HOLD keeps {kept} powered" in stopped.text and (f"{off} should be off" in stopped.text) == bool(off)
    none = Coasting(lambda since: 5.0, hold="0 0 0 0").stopped(powered=True)
    assert "no motor powered" in none.text


def test_a_hand_that_restarts_at_ctrl_c_holds_nothing() -> None:
    """Its motors have no power until HI, whatever HOLD is."""

    class Restarting(Coasting):
        def answer(self, request: bytes) -> list[Reply]:
            banner = b"\n\rBarrettHand Firmware\n\r4.33\n\r=> "
            return [(0.001, banner)] if request == b"\x03" else super().answer(request)

    stopped = Restarting(lambda since: 0.0).stopped(powered=True)
    assert stopped.error is None and "HOLD" not in stopped.text and "(HI)" in stopped.text


def test_a_stop_of_some_motors_goes_out_once_more_too() -> None:
    """For the child of a loop of these motors, as for the verb."""
    hand = Coasting(COASTS["coasts"][0])
    plan = StopPlan("barrett", StopContext(Settings(), speed=9600, fixed=True), partial(power_off, prefix="1"))
    assert plan(hand.link).goes_on
    assert [one for one in hand.commands if one in (b"\x03", b"1T")] == [b"\x03", b"1T"] * 2


@each_row("pieces", [b"\n\r=> ", b"\n\r=> T", b"T\n", b""])
def test_a_prompt_is_not_told_as_none(pieces: bytes) -> None:
    """T is not acknowledged: what came is a prompt where it is one."""
    link = ScriptedLink(lambda request: [(0.001, pieces)] if request == b"T\r" and pieces else [])
    context = StopContext(Settings(), speed=9600, fixed=True)
    stopped = exchange_steps(link, power_off(context), [])
    assert stopped.error is (ProtocolError if pieces else NoAnswer)
    assert ("A prompt came" in stopped.text) == (b"=>" in pieces) and "instead of a prompt" not in stopped.text


def test_the_death_of_a_command_takes_the_power_off_whatever_holds() -> None:
    """Ctrl-C says which motors HOLD keeps powered; here nobody is left to be told (safety(7))."""
    hand, link = scripted({"*": "1", "T": ""})
    gcl = DeathGuard(hand)
    gcl.before("C")
    assert link.guard is not None
    plans = link.guard.stops
    with hand.driven(Prompts(), powered=CTRL_C_KEEPS_POWER) as guard:
        plans += guard.stops
    for plan in plans:
        link.sent.clear()
        plan(link)
        assert link.sent[:2] == [ABORT, b"T\r"]
    assert len(plans) == 2
