"""What each way of stopping, connecting, probing and scanning sends when nobody answers, from the code that sends it.

A BarrettHand that starts answers nobody for as long as its boot window lasts, so this is what it hears.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from itertools import product
from pathlib import Path

from handctl.devices.barrett.parameter_map import SPEEDS
from handctl.devices.barrett.realtime.blocks import Layout, Selection
from handctl.devices.barrett.realtime.enter_and_leave import Session
from handctl.devices.barrett.realtime.loop_flags import FlagRequest
from handctl.devices.barrett.stopper import power_off
from handctl.devices.inspire.eb90 import read_request
from handctl.devices.inspire.hand.probe import TARGET
from handctl.errors import HandctlError
from handctl.families import FAMILIES
from handctl.link.deadman import EarlyWrite, Guard
from handctl.model.command_settings import Settings
from handctl.model.stop_sequence import StopContext, exchange_steps, stop_sequence_of
from handctl.tools.family_probe import probe_of
from tests.barrett.line_receiver import Sent
from tests.barrett.support import hand_on
from tests.support.cli import run
from tests.support.scripted import ScriptedLink

HAND_SPEEDS = TARGET.speeds
Way = tuple[str, list[Sent]]
GAINS = (0, 1, 3, 7, 10, 15, 63, 127, 128, 240, 254, 255)
PREFIXES = ("", "1", "12", "123", "1234")


class Silence(ScriptedLink):
    """Nobody answers. What was sent, when, and at which speed."""

    def __init__(self, baud: int) -> None:
        super().__init__(baud=baud)
        self.writes: list[Sent] = []

    def write(self, data: bytes, deadline: object) -> None:
        self.writes.append(Sent(self.clock, self.baud or 0, bytes(data)))
        self.clock += 10 * len(data) / (self.baud or 1)


def sent(baud: int, what: Callable[[Silence], object]) -> list[Sent]:
    """What `what` sends on a link that is silent."""
    link = Silence(baud)
    with contextlib.suppress(HandctlError):
        what(link)
    return link.writes


def stops() -> Iterator[Way]:
    """The verb, and the holder that is asked: they run the same talk."""
    for family in FAMILIES:
        for speed in HAND_SPEEDS if family == "hand" else probe_of(family).SPEEDS:
            context = StopContext(Settings(), speed=speed)
            yield (
                f"{family} stop at {speed}",
                sent(speed, lambda link, f=family, a=context: exchange_steps(link, stop_sequence_of(f, a), [])),
            )  # type: ignore[misc]
    for speed, prefix in product(SPEEDS, PREFIXES[1:]):
        context = StopContext(Settings(), speed=speed)
        yield (
            f"barrett stop {prefix} at {speed}",
            sent(speed, lambda link, p=prefix, a=context: exchange_steps(link, power_off(a, p), [])),
        )  # type: ignore[misc]


def interrupts() -> Iterator[Way]:
    """Ctrl-C, an answer that does not come while something moves, and a loop that is left, of a BarrettHand."""
    for speed in SPEEDS:
        yield f"Ctrl-C at {speed}", sent(speed, lambda link: hand_on(link).line.abort())
        yield f"leave RealTime at {speed}", sent(speed, lambda link: hand_on(link).line.leave_loop())
        yield f"resynchronise at {speed}", sent(speed, lambda link: hand_on(link).line.resynchronise(stop=True))


class Noted(Guard):
    """Keeps what the child would send first, instead of a child."""

    def __init__(self) -> None:
        super().__init__(None, lambda _link: None, lambda *_words: None)
        self.first: list[EarlyWrite] = []

    def update(self, first: Sequence[EarlyWrite], heartbeat: float | None = None) -> None:
        self.first = list(first)


def deaths() -> Iterator[Way]:
    """What the child sends: behind each block that drives, of whatever motors and control values; then the plan of a stop."""
    carried = (("velocity", "gain"), ("velocity",), ("torque",))
    for speed, motors, names, gain in product(SPEEDS, range(1, 5), carried, GAINS):
        if gain and "gain" not in names:
            continue
        link = Silence(speed)
        hand = hand_on(link)
        flag_request = FlagRequest(tuple(range(motors)), {}, False, False, frozenset(), 1)
        session = Session(hand, flag_request, drives=True)
        noted = session.dead_man = Noted()
        if names != ("torque",):
            session.layout = Layout({index: Selection(names, ()) for index in range(motors)})
            session.last = {index: {"velocity": 20, "gain": gain} for index in range(motors)}
            session.tell_dead_man()
        for shot in noted.first:
            if shot.data:
                link.write(shot.data, None)
            link.sleep(shot.pause)
        for powered in (False, True):
            exchange_steps(link, power_off(hand.stop_context()._replace(powered=powered), flag_request.prefix), [])
        yield f"kill -9 at {speed}: {motors} motors, {', '.join(names)}, gain {gain}", link.writes


def connects() -> Iterator[Way]:
    """A BarrettHand is looked for, from each speed that may be remembered, by what reads and by what stops."""
    for speed, interrupt in product(SPEEDS, (False, True)):
        found = sent(speed, lambda link, i=interrupt: hand_on(link, interrupt=i).line.connect())  # type: ignore[misc]
        yield f"connect at {speed}, {'stops' if interrupt else 'reads'}", found


COMMANDS = (
    *(("scan", "--ids", ids) for ids in ("1-2", "1-8")),
    *((family, "scan", "--ids", ids) for family in ("exo", "wrist", "hand") for ids in ("1-2", "1-20")),
    ("exo", "scan", "--ids", "3,13"),
    *((family, "scan") for family in FAMILIES if "serial" in probe_of(family).WIRES),
    *((family, command) for family in ("exo", "hand") for command in ("id", "baud")),
    *((family, "status", "--baud", str(speed)) for family in ("exo", "wrist") for speed in (115200, 57600, 19200)),
    *(("hand", "status", "--baud", str(speed)) for speed in HAND_SPEEDS),
    *(("exo", "force", "0", "0", "0", "0", "0", "-y", "--baud", str(speed)) for speed in (115200, 57600, 19200)),
    *(("doctor", "--family", family, "--count", "2") for family in FAMILIES if "serial" in probe_of(family).WIRES),
)  # fmt: skip


def commands(folder: Path, words: tuple[tuple[str, ...], ...] = COMMANDS) -> Iterator[Way]:
    """What commands send that look for somebody; of a simulator that is silent, on virtual time."""
    trace = folder / "trace.txt"
    for command in words:
        trace.unlink(missing_ok=True)
        family = next((word for word in command if word in FAMILIES), "exo")
        silent = "found=off" if family == "barrett" else "fault=silent"
        result = run(*command, "-p", f"fake://{family}?{silent}&clock=virtual", "--json", "--trace", trace)
        assert result.code in (4, 7), result
        baud = int(command[command.index("--baud") + 1]) if "--baud" in command else FIRST.get(family, 115200)
        yield " ".join(command), list(traced(trace, baud))


FIRST = {"barrett": 9600}


def traced(trace: Path, baud: int) -> Iterator[Sent]:
    """The writes of a transcript."""
    for line in trace.read_text(encoding="utf-8").splitlines():
        words = line.split()
        if words[1:3] == ["!", "baud"]:
            baud = int(words[3])
        elif words[1:2] == [">"]:
            yield Sent(float(words[0]), baud, bytes.fromhex("".join(words[2:])))


def scans(ids: range) -> Iterator[Way]:
    """The reads that a scan or a connect may begin with, of these ids, one at a time."""
    from handctl.devices.inspire.identity import TABLE
    from handctl.devices.inspire.register_bus import AHEAD, READS

    spans = {(flag, span) for flag, found in READS.items() for span in found}
    spans |= {(0x30 if sign.space == "wrist" else 0x11, span) for sign in TABLE for span in sign.reads}
    spans |= {(0x11, (1546, 4))}
    for number, (flag, span), speed in product(ids, sorted(spans), HAND_SPEEDS):
        yield (
            f"id {number}, {span} at {speed}",
            [Sent(0.0, speed, AHEAD.get(speed, b"") + read_request(number, *span, flag))],
        )
