"""A port that was lost in a movement, and is there again within a second: the stop reaches the device.

A contact that bounces, or a hub that starts anew, brings an adapter back under its name, while the device has gone on.
"""

from __future__ import annotations

import os
import pickle
import threading
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

import handctl
from handctl.errors import LinkError
from handctl.link import NoLink, RawAccess, fake
from handctl.link.deadman import RawBytes, guard_link
from handctl.link.fake import FakeLink
from handctl.link.serial import SerialLink
from handctl.model.command_settings import Settings
from handctl.model.stop_sequence import StopContext, StopPlan, found_again
from handctl.system import deadman_process
from handctl.system.deadman_process import DeadmanChild, Job
from tests.stop.bench import noting_access
from tests.support.bus_file import text
from tests.support.cli import run
from tests.support.each_row import each_row

READY = "clock=virtual&initialized=1"
MOVES = {
    "exo": ("exo position 0 0 0 0 0 --wait 5 -y", "fake://exo?clock=virtual", 0.3),
    "wrist": ("wrist move --pitch 20 --time 3000", "fake://wrist?clock=virtual", 0.5),
    "wrist on CAN": ("wrist move --pitch 20 --time 3000", "fake://wrist?bus=can&clock=virtual", 0.5),
    "hand": ("hand angle 0 0 0 0 0 0 --wait 5 -y", "fake://hand?clock=virtual", 0.25),
    "hand on CAN": ("hand angle 0 0 0 0 0 0 --wait 5 -y", "fake://hand?bus=can&clock=virtual", 0.25),
    "barrett": ("barrett close", f"fake://barrett?{READY}", 0.7),
    "realtime": ("barrett realtime --motors 1 --velocity 20 --duration 3", f"fake://barrett?{READY}", 0.7),
    "aidin": ("aidin currents index.m1=50 -y", "fake://aidin?clock=virtual", 1.0),
}
"""A command that moves, the device, and the second in which it does."""
STOPS = {
    "exo": "all forces to 0",
    "wrist": "stay at",
    "wrist on CAN": "stay at",
    "hand": "speed of every finger to 0",
    "hand on CAN": "speed of every finger to 0",
    "barrett": "^C",
    "realtime": "T at 9600 bit/s",
    "aidin": "stop, sent",
}


ASKS = {"exo": "04 30", "wrist": "04 30", "wrist on CAN": "can 10FF0001 [1] 04", "hand": "04 11"}
"""The question that goes out before the stop, or its flags: the name of a port may lead to another device by then."""


@each_row("move", MOVES)
def test_the_stop_goes_out_over_a_port_that_comes_back(move: str, tmp_path: Path) -> None:
    words, link, at = MOVES[move]
    trace = tmp_path / "trace"
    result = run(*words.split(), "-p", f"{link}&unplug={at}:0.4", "--json", "--trace", str(trace))
    writes = (result.stream[1] if move == "realtime" else result.json)["writes"]
    assert result.code == 3, result
    assert any(STOPS[move] in one["meaning"] and one["state"] == "confirmed" for one in writes), writes
    after = trace.read_text().partition("reconnect")[2]
    assert ASKS.get(move, "") in next(line for line in after.splitlines() if " > " in line), after


@each_row("move", [*ASKS, "hand on CAN"])
def test_ctrl_c_reaches_the_device_over_a_port_that_comes_back(move: str, tmp_path: Path) -> None:
    """Pressed while it is away, before anything was sent that shows it."""
    words, link, at = MOVES[move]
    trace, time_passes, told = tmp_path / "trace", fake._Simulated.sleep, list[float]()

    def pressed(link: Any, seconds: float) -> None:
        time_passes(link, seconds)
        if at < link.now() and not told:
            told.append(link.now())
            raise KeyboardInterrupt

    with mock.patch.object(fake._Simulated, "sleep", pressed):
        result = run(*words.split(), "-p", f"{link}&unplug={at}:0.4", "--json", "--trace", str(trace))
    assert (result.code, len(told)) == (130, 1), result
    assert any(STOPS[move] in one["meaning"] and one["state"] == "confirmed" for one in result.json["writes"]), result
    assert ASKS.get(move, "") in after(trace, "reconnect")[0]


@each_row("link", ["exo?", "wrist?", "wrist?bus=can&", "hand?", "hand?bus=modbus-tcp&", "barrett?", "aidin?"])
def test_a_stop_by_itself_goes_out_over_a_port_that_comes_back(link: str) -> None:
    stopped = run(link.partition("?")[0], "stop", "-p", f"fake://{link}clock=virtual&unplug=0.0001:0.4", "--json")
    assert stopped.code == 0, stopped
    gone = run(link.partition("?")[0], "stop", "-p", f"fake://{link}clock=virtual&unplug=0.0001:90", "--json")
    assert gone.code == 3 and gone.error["hint"], gone


@each_row("move", [name for name in MOVES if name != "aidin"])
def test_of_a_port_that_stays_away_nothing_is_said_to_have_stopped(move: str) -> None:
    words, link, at = MOVES[move]
    result = run(*words.split(), "-p", f"{link}&unplug={at}:90", "--json")
    assert result.code == 3 and "has stopped" not in result.err and "power off" in result.err, result


@each_row("move", MOVES)
def test_a_stop_that_no_port_took_is_not_listed_as_sent(move: str, tmp_path: Path) -> None:
    """Nor does the transcript have it, and played again the command ends in the same way."""
    words, link, at = MOVES[move]
    trace = tmp_path / "trace"
    result = run(*words.split(), "-p", f"{link}&unplug={at}:90", "--json", "--trace", str(trace))
    writes = (result.stream[1] if move == "realtime" else result.json)["writes"]
    first = "^C" if move == "realtime" else STOPS[move]
    stops = {one["state"] for one in writes if first in one["meaning"]}
    assert stops <= {"not-sent"} and (stops or "wrist" in move), writes
    lines = trace.read_text().splitlines()
    lost = next(number for number, line in enumerate(lines) if line.endswith("! disconnect"))
    assert not [line for line in lines[lost:] if " > " in line], lines[lost:]
    again = run(*words.split(), "-p", f"replay:{trace}", "--json")
    assert again.code == 3 and "replay-miss" not in again.out, again
    told = run(*words.split(), "-p", f"{link}&unplug={at}:90", "-q").err
    assert not stops or ("warning: writes: " in told and "not sent: " in told), told


# -- what an earlier line has left moving -----------------------------------------------------------------------------

GO = "exo position 900 900 900 900 900 -y"
ASK, FORCES_0 = "EB 90 01 04 30", "EB 90 01 0B 31"
"""How the question and the first step of the stop begin."""


def after(trace: Path, event: str) -> list[str]:
    """What was sent behind this event."""
    lines = trace.read_text().partition(f"! {event}")[2].splitlines()
    return [line.partition(" > ")[2] for line in lines if " > " in line]


def begins(frames: list[str], *starts: str) -> bool:
    return len(frames) >= len(starts) and all(map(str.startswith, frames, starts))


@each_row(("line", "away", "code", "stopped"), [
    ("exo status", "1:0.9", 3, True),
    (f"{GO} --wait 5", "1:0.9", 3, True),
    ("exo stop", "1:0.9", 0, True),
    ("exo status", "1:90", 3, False),
    ("exo watch --count 50", "1.5:0.4", 3, True),
    ("exo watch --count 50", "1.5:90", 3, False),
])  # fmt: skip
def test_what_an_earlier_line_has_left_moving_is_stopped_over_a_port_that_comes_back(
    line: str, away: str, code: int, stopped: bool, tmp_path: Path
) -> None:
    """Whether the port was lost between two lines or within one: who is there is asked, and nothing else goes out before the stop."""
    trace = tmp_path / "trace"
    link = f"fake://exo?clock=virtual&unplug={away}"
    script = f"{GO}\nsleep 1.2\n{line}\nexo set id=7 -y"
    result = run("batch", "-p", link, "--json", "--trace", str(trace), stdin=script)
    assert result.code == code, result
    assert begins(after(trace, "reconnect"), *[ASK, FORCES_0] * stopped), trace.read_text()
    if code:
        assert result.stream[1]["lines"] == 3, "the line behind it is not begun"
        assert ("handctl has stopped what earlier" in result.err) is stopped, result
        assert ("power off" in result.err) is not stopped


def test_each_device_that_was_left_moving_is_stopped_over_a_port_that_comes_back(tmp_path: Path) -> None:
    file = tmp_path / "bus.toml"
    file.write_text(text("clean", [{"kind": "exo", "id": 1}, {"kind": "exo", "id": 2}], unplug="1:0.9"))
    trace = tmp_path / "trace"
    script = f"{GO} --id 1\n{GO} --id 2\nsleep 1.2\nexo status --id 1"
    result = run("batch", "-p", f"fake://bus?file={file}&clock=virtual", "--trace", str(trace), stdin=script)
    forces = [frame for frame in after(trace, "reconnect") if frame[12:14] == "31"]
    assert result.code == 3 and {frame[:8] for frame in forces} == {"EB 90 01", "EB 90 02"}, result
    assert all(f"xo id {number}: the hand acknowledged" in result.err for number in (1, 2)), result


@each_row("way", ["ctrl-c", "asked"])
def test_a_stop_between_two_lines_goes_out_over_a_port_that_comes_back(way: str, tmp_path: Path) -> None:
    """By Ctrl-C, and by the wish of another process: who is there is asked anew."""
    trace, told = tmp_path / "trace", list[Any]()
    time_passes = FakeLink.sleep

    def pressed(link: FakeLink, seconds: float) -> None:
        time_passes(link, 1.2 if seconds == 30 else seconds)
        if seconds == 30 and not told:
            told.append(access[-1].stop("asked") if way == "asked" else None)
            raise KeyboardInterrupt

    link = "fake://exo?clock=virtual&unplug=1:0.9"
    with noting_access() as access, mock.patch.object(FakeLink, "sleep", pressed):
        result = run("batch", "-p", link, "--json", "--trace", str(trace), stdin=f"{GO}\nsleep 30")
    assert result.code == 130, result
    assert begins(after(trace, "reconnect"), ASK, FORCES_0), trace.read_text()


def test_a_program_hears_of_the_stop_and_its_next_call_opens_the_link_again() -> None:
    with handctl.connect("exo", "fake://exo?clock=virtual&unplug=1:0.9") as hand:
        hand.position(900, 900, 900, 900, 900, confirm=True)
        link = hand._line.last.link
        link.sleep(1.2)
        with pytest.raises(LinkError, match="handctl has stopped what earlier") as caught:
            hand.get("id")
        assert caught.value.code == "lost"
        assert hand.get("id")[0]["value"] == 1


class Bouncing(NoLink):
    """A link with a descriptor, lost and back with another one."""

    def __init__(self, back: bool) -> None:
        self.access: RawAccess | None = RawAccess(41)
        self.back = back
        self.guarded: list[bool] = []

    def raw_access(self) -> RawAccess | None:
        return self.access

    def reconnect(self, seconds: float) -> bool:
        self.guarded.append(self.guard.pid is not None)
        self.access = RawAccess(42) if self.back else None
        if not self.back:
            raise LinkError("still gone")
        return True


@each_row("back", [True, False])
def test_the_second_process_lets_go_of_the_lost_port_and_has_the_new_one(
    back: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As long as anybody has a lost USB port open, the system gives the adapter that comes back another name."""
    jobs: list[int] = []

    def started(job: Job) -> DeadmanChild:
        jobs.append(job.way)
        return DeadmanChild(4711, -1, -1)

    monkeypatch.setattr(deadman_process, "can_be", lambda: True)
    monkeypatch.setattr(deadman_process, "started", started)
    monkeypatch.setattr(deadman_process, "ended", lambda _child: None)
    link = Bouncing(back)
    with guard_link(link, print, print), guard_link(link, repr, print):
        assert jobs == [41, 41] and link.guard.pid == 4711
        assert found_again(link) is back and link.elsewhere is back
        assert link.guarded == [False] and (link.access is None or link.access.elsewhere)
        assert jobs[2:] == [42] * back
    assert jobs[3:] == [42] * back, "and so has the outer one"


@each_row(("kind", "elsewhere", "first"), [
    ("exo", False, "all forces to 0"), ("exo", True, "ask who is there"),
    ("wrist", False, "read where it is, or is to be"), ("wrist", True, "ask who is there"),
])  # fmt: skip
def test_the_second_process_asks_anew_who_is_there_behind_a_port_that_came_back(
    kind: str, elsewhere: bool, first: str
) -> None:
    """On Windows it gets its job pickled."""
    context = StopContext(Settings(), speed=115200, proven=True)
    access, plan = pickle.loads(pickle.dumps((RawAccess(-1, elsewhere=elsewhere), StopPlan(kind, context))))  # noqa: S301 - our own
    assert next(plan.sequence(RawBytes(access))).step.meaning == first


def test_ctrl_c_over_a_link_that_was_opened_anew_asks_who_is_there(tmp_path: Path) -> None:
    """Here a line had it for itself in between, with other options."""
    trace, time_passes = tmp_path / "trace", FakeLink.sleep

    def pressed(link: FakeLink, seconds: float) -> None:
        if seconds == 30:
            link.event("pressed")
            raise KeyboardInterrupt
        time_passes(link, seconds)

    script = f"{GO}\nexo status -v\nsleep 30"
    with mock.patch.object(FakeLink, "sleep", pressed):
        run("batch", "-p", "fake://exo?clock=virtual", "--trace", str(trace), stdin=script)
    assert ASK in after(trace, "pressed")[0], trace.read_text()


@pytest.mark.real
def test_a_serial_port_is_looked_for_until_it_is_back(tmp_path: Path) -> None:
    name = tmp_path / "tty"

    def plugged() -> int:
        device, port = os.openpty()
        name.symlink_to(os.ttyname(port))
        held.extend((device, port))
        return device

    held: list[int] = []
    plugged()
    link = SerialLink(str(name), 9600)
    for descriptor in held:
        os.close(descriptor)
    held.clear()
    name.unlink()
    with pytest.raises(LinkError):
        link.reconnect(0.1)
    back = threading.Timer(0.2, plugged)
    back.start()
    assert link.reconnect(5.0)
    back.join()
    link.write(b"\x03", link.deadline(1.0))
    assert os.read(held[0], 8) == b"\x03"
    link.close()
    for descriptor in held:
        os.close(descriptor)
