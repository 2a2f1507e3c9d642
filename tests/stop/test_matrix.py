"""Where a device is one second after its stop began, from wherever the stop came, and whatever became of its frames.

Each way of stopping x family x weather: the nth frame lost, a line with latency, somebody else who commands, half of the
device quiet, a command that stood still before it died. Judged by the device itself: it may coast and is never driven on or
back. Judged by what is claimed: a stop that is told as one has stopped it.
"""

from __future__ import annotations

import importlib
import pickle
import signal
import struct
from collections.abc import Callable
from contextlib import nullcontext
from itertools import pairwise
from types import SimpleNamespace
from typing import Any, NamedTuple
from unittest import mock

import pytest

from handctl.command.terminal_prompts import TerminalPrompts
from handctl.devices.inspire import eb90
from handctl.errors import OutputError
from handctl.families import FAMILIES
from handctl.link import RawAccess, deadman
from handctl.model.command_settings import Settings
from handctl.model.prompts import Prompts
from handctl.model.result import Journal
from handctl.model.stop_on_interrupt import interrupt_error
from handctl.model.stop_sequence import Stopped, context_for_link, run_stop, stop_sequence_of
from handctl.stop.device_access import DeviceAccess
from tests.stop.far import Far, Weather
from tests.support.each_row import each_row

SAMPLE = 0.1
"""Seconds from one reading of a place to the next, on a line without latency: what is older is no place to hold."""


class Case(NamedTuple):
    """A device of a family that moves.

    name   its simulator
    look   the simulated device -> where it is
    start  sets it going
    other  a frame of somebody else that keeps it going
    coast  counts that it runs on by itself
    """

    name: str
    look: Callable[[Any], tuple[int, ...]]
    start: Callable[[Any, Far], object]
    other: Callable[[], bytes] | None
    baud: int | None = 115200
    coast: int = 0


def registers(question: str) -> Callable[[Any], tuple[int, ...]]:
    def look(line: Any) -> tuple[int, ...]:
        data = bytes.fromhex(line.command(f"get {question}").removeprefix("ok "))
        return struct.unpack(f"<{len(data) // 2}h", data)

    return look


def currents(line: Any) -> tuple[int, ...]:
    """What an AIDIN-hand is driven by: it has no place to hold."""
    return tuple(round(float(word)) for word in line.command("get current_state").removeprefix("ok ").split())


def motors(line: Any) -> tuple[int, ...]:
    """Where the motors of a BarrettHand are."""
    words = line.command("motors").removeprefix("ok ").split()
    return tuple(int(after) for word, after in pairwise(words) if word == "P")


def flow(hand: Any, far: Far) -> None:
    from handctl.devices.aidin.device import object_of
    from handctl.devices.aidin.parameter_map import CURRENTS, Mode

    hand.conversation.connect()
    for _ in range(20):
        hand.conversation.tick(object_of(Mode.CURRENT, **{CURRENTS.command.key: [200.0] * 15}))


CURRENT = b'{"hand_mode":41,"hand_TT_cmd":[' + b",".join([b"200"] * 15) + b"]}\n"
CASES = {
    "exo": Case(
        "fake://exo?clock=virtual", registers("1546 12"),
        lambda hand, far: (hand.command("position", [1000] * 5), far.sleep(0.1)),
        lambda: eb90.command_request(1, eb90.POSITION_COMMAND, [1000] * 5),
    ),
    "wrist": Case(
        "fake://wrist?clock=virtual", registers("1020 4"),
        lambda wrist, far: (wrist.write(wrist.targets(20, -20, 5000)), far.sleep(0.1)),
        lambda: eb90.write_request(1, 1038, eb90.pack_s16([-2000, 2000]), eb90.WRIST_WRITE),
    ),
    "hand": Case(
        "fake://hand?clock=virtual&speed=100", registers("1546 12"),
        lambda hand, far: (hand.write([(one, 1000) for one in hand.map["angle_set"].each]), far.sleep(0.2)),
        lambda: eb90.write_request(1, 1522, eb90.pack_s16([100] * 6)),
        coast=40,
    ),
    "barrett": Case(
        "fake://barrett?clock=virtual&initialized=1", motors,
        lambda hand, far: (hand.line.connect(), far.write(b"C\r", far.deadline(1.0)), far.sleep(0.5)),
        lambda: b"C\r",
        9600,
        coast=200,
    ),
    "aidin": Case("fake://aidin?clock=virtual&start=homed&rate=50", currents, flow, lambda: CURRENT, None),
}  # fmt: skip


def opened(family: str) -> tuple[Any, Far]:
    """A device that moves, as a command has it open."""
    case = CASES[family]
    far = Far(case.name, case.look, case.baud)
    module = importlib.import_module(FAMILIES[family].module("cli"))
    device = module.cli.family.open(far, Settings(), Journal())
    device.options = Settings()
    case.start(device, far)
    return device, far


# -- the ways ------------------------------------------------------------------------------------------------------------


def by_verb(device: Any, far: Far) -> Stopped:
    """`handctl FAMILY stop`, which knows nothing of the device."""
    return run_stop(far, stop_sequence_of(device.kind, context_for_link(far, Settings())))


def by_holder(device: Any, far: Far) -> Stopped:
    """A command that is asked by another one."""
    journal = device.journal
    journal.counters.writes = 1
    run = SimpleNamespace(
        family=SimpleNamespace(kind=device.kind), opened=device, journal=journal, ledger=journal.ledger, writes=False,
        settings=Settings(), prompts=Prompts(), shows=False, stops=False, place="", session=None,
    )  # fmt: skip
    hold = DeviceAccess(run, None)  # type: ignore[arg-type]
    hold.around(far)
    told = hold.stop("asked")
    error = hold.stopped
    assert error is not None and (error.exit_code == 130) == (not told["error"]), "code and report say the same"
    return Stopped(told["text"], told["hint"], type(error) if error.exit_code != 130 else None, told["evidence"])


def ended_by_interrupt(device: Any, _far: Far) -> Stopped:
    """Ctrl-C inside a movement."""
    stopped: Stopped = device.stop()
    ended = interrupt_error(stopped)
    assert (ended.exit_code == 130) == (stopped.error is None), "130 is an acknowledged stop"
    return stopped


def by_child(device: Any, far: Far) -> Stopped | None:
    """The process that outlives a command that died: nobody hears what it says."""
    told: list[Any] = []
    with mock.patch.object(deadman, "guard_link", lambda *given, **_more: nullcontext(told.append(given))):
        device.guarded().__enter__()
    ((_link, stop, _warn),) = told
    way, stop = pickle.loads(pickle.dumps((RawAccess(-1), stop)))  # noqa: S301 - as it goes to the child on Windows
    with mock.patch.object(deadman, "RawBytes", lambda _raw_access: far):
        deadman.stop_in_child(way, stop, deadman._pack(b"", ()))
    return None


WAYS = {"verb": by_verb, "holder": by_holder, "ctrl-c": ended_by_interrupt, "child": by_child}


# -- the weather -----------------------------------------------------------------------------------------------------------


def half_deaf(seconds: float, data: bytes) -> bool:
    """The wrist behind a hand is quiet for a while, or the hand in front of it."""
    return seconds < 0.75 and data[:2] == eb90.HOST and data[4] in (eb90.WRIST_READ, eb90.WRIST_WRITE)


def other_of(family: str) -> Weather:
    return Weather(other=CASES[family].other)


WEATHER: dict[str, Callable[[str], Weather]] = {
    "fair": lambda _family: Weather(),
    **{f"frame {n} lost": lambda _family, n=n: Weather(lost=(n,)) for n in (1, 2, 3)},
    **{f"frames {n} and {n + 1} lost": lambda _family, n=n: Weather(lost=(n, n + 1)) for n in (1, 2)},
    **{f"{ms} ms there and back": lambda _family, ms=ms: Weather(one_way=ms / 2000) for ms in (100, 500)},
    "100 ms and frame 1 lost": lambda _family: Weather(lost=(1,), one_way=0.05),
    "half deaf": lambda _family: Weather(deaf=half_deaf),
    "somebody else": other_of,
}
OLD = {"0.1 s old": 0.1, "10 s old": 10.0}
"""What a command saw last; what it saw just now is the stop in fair weather."""


def judge(family: str, way: str, weather: Weather, old: float = 0.0) -> None:
    device, far = opened(family)
    far.rest(old)
    far.worsen(weather)
    began = far.now()
    stopped = WAYS[way](device, far)
    took = far.now() - began
    far.sleep(max(0.0, 1.0 - took) + 0.3)
    moves = far.seen.travel() > 0
    there = 2 * weather.one_way
    if weather.other is not None:
        assert stopped is None or stopped.error is not None, f"told as a stop while somebody else drives it: {stopped}"
        return
    if stopped is not None:
        assert stopped.error is None, f"not stopped: {stopped}"
    if not moves or family == "aidin":
        assert max(map(abs, far.seen.at[-1][1])) <= 20 or family != "aidin", "currents flow"
        return
    sample = max(SAMPLE, 2 * there)
    back, fastest = far.seen.driven_back(), far.seen.travel()
    assert back <= 2 * sample * fastest + CASES[family].coast, f"driven back by {back}, at {fastest:g} a second"
    late = 1.0 + 0.15 * len(weather.lost) + (there if there > 0.2 else 0.0) + (0.75 if weather.deaf is half_deaf else 0)
    assert far.seen.stood_from() <= late, f"driven on for {far.seen.stood_from():.2f} s"


@each_row("sky", list(WEATHER))
@each_row("way", list(WAYS))
@pytest.mark.parametrize("family", CASES)
def test_it_stands_a_second_later(family: str, way: str, sky: str) -> None:
    judge(family, way, WEATHER[sky](family))


@each_row("old", list(OLD))
@each_row("way", list(WAYS))
@pytest.mark.parametrize("family", CASES)
def test_a_place_that_is_old_is_not_held(family: str, way: str, old: str) -> None:
    """What a command saw last plays no part: neither in a child whose parent was suspended, nor elsewhere."""
    judge(family, way, Weather(), OLD[old])


@pytest.mark.parametrize("family", CASES)
def test_a_reader_that_sleeps_does_not_cut_off_the_stop_of_a_holder(family: str) -> None:
    """The alarm that waits for it is due while the stop goes out."""
    device, far = opened(family)
    write = far.write

    def late(*given: Any, **more: Any) -> None:
        signal.raise_signal(signal.SIGALRM)
        write(*given, **more)

    with TerminalPrompts(quiet=True).stop_if_slow(60.0, lambda: OutputError("no reader")):
        far.write = late  # type: ignore[method-assign]
        stopped = by_holder(device, far)
    assert stopped.error is None, stopped
