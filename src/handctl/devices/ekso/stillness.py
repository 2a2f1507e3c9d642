"""Whether the wearer of an EksoNR keeps still: two looks at GetData, before any setting is written.

The limits are this tool's policy (`ekso policy` shows them), not the device's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from handctl.devices.ekso import gates
from handctl.devices.ekso.dataport import DataPort
from handctl.devices.ekso.frames import Command
from handctl.devices.ekso.map import DATA, DRIVEN, SITTING, STANDING, Word, boot_ms, state_text
from handctl.model.clocks import Span

APART = 0.1
"""Seconds between the two looks at the joints."""
MOST_SPEED = 5.0
"""deg/s; above, the wearer moves."""
STATE = 18
JOINTS = tuple(param for param in DATA if param.name.endswith(("hip_angle", "knee_angle")))


class Seen(NamedTuple):
    """One look: State, the settings that are written only while sitting."""

    state: int
    sitting: Sequence[Word]


class Between(NamedTuple):
    """Two looks: the words of both, the ms of BootTime and those of ours between them."""

    first: Sequence[int]
    second: Sequence[int]
    passed: int
    span: Span


def _posture(seen: Seen) -> str | None:
    if seen.state >> 12 in (SITTING, STANDING):
        return None
    return f"the posture is {state_text(seen.state)}, neither sitting nor standing"


def _driven(seen: Seen) -> str | None:
    return f"the joints are being driven: {state_text(seen.state)}" if seen.state & DRIVEN else None


def _seated(seen: Seen) -> str | None:
    if not seen.sitting or seen.state >> 12 == SITTING:
        return None
    names = ", ".join(param.name for param in seen.sitting)
    return f"{names}: only while sitting, but the state is {state_text(seen.state)}"


def _reboot(looks: Between) -> str | None:
    return "BootTime went back: the device has restarted" if looks.passed >= 2**31 else None


def _fresh(looks: Between) -> str | None:
    if looks.span.fits(looks.passed):
        return None
    return f"BootTime advanced by {looks.passed} ms in {looks.span}: the values are not fresh"


def _speed(looks: Between) -> str | None:
    for param in JOINTS:
        turned = abs(param.raw_of(looks.second[param.word]) - param.raw_of(looks.first[param.word])) / 100
        speed = turned / (looks.passed / 1000 or 1e-3)
        if speed >= MOST_SPEED:
            return f"{param.name} moves at {speed:.1f} deg/s"
    return None


ONE_LOOK: Mapping[str, Callable[[Seen], str | None]] = {
    gates.POSTURE: _posture,
    gates.DRIVEN: _driven,
    gates.SEATED: _seated,
}
BOTH_LOOKS: Mapping[str, Callable[[Between], str | None]] = {
    gates.REBOOT: _reboot,
    gates.FRESH: _fresh,
    gates.SPEED: _speed,
}


def moving(first: Sequence[int], second: Sequence[int], span: Span, sitting: Sequence[Word] = ()) -> str | None:
    """Why two GetData that are `span` apart are not those of somebody who sits or stands still; None when they are.

    `sitting` are settings that are written only while sitting.
    """
    seen = [Seen(words[STATE] & 0xFFFF, sitting) for words in (first, second)]
    looks = Between(first, second, (boot_ms(second) - boot_ms(first)) % 2**32, span)
    found = [ONE_LOOK[gate](look) for look in seen for gate in gates.at(gates.LOOK)]
    if not any(found):
        found = [BOTH_LOOKS[gate](looks) for gate in gates.at(gates.LOOKS)]
    return next(filter(None, found), None)


def require_stillness(port: DataPort, sitting: Sequence[Word] = ()) -> int:
    """Two looks at least 100 ms apart; returns BootTime in ms. Raises CheckFailed naming the condition that fails."""
    first = port.read(Command.GET_DATA).words
    moment = port.moment
    port.link.sleep(APART)
    second = port.read(Command.GET_DATA).words
    why = moving(first, second, port.moment.since(moment), sitting)
    if why is not None:
        hint = f"{'sit' if sitting else 'sit or stand'} still and repeat the command. This check cannot be switched off"
        raise gates.refusal(gates.STILL, f"{port.where}: not written: {why}", hint)
    return boot_ms(second)
