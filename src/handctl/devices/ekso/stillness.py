"""Whether the wearer keeps still: two looks at GetData, before any setting is written. Knows no link. The limits are those of `write_policy`."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from handctl.devices.ekso import write_checks
from handctl.devices.ekso.parameter_map import DATA, DRIVEN, SITTING, STANDING, Word, boot_ms, state_text
from handctl.devices.ekso.write_policy import MOST_SPEED
from handctl.model.device_clock import Span

STATE = 18
JOINTS = tuple(param for param in DATA if param.name.endswith(("hip_angle", "knee_angle")))


class StillnessCheck(NamedTuple):
    """Two looks: State of the one that is judged, the settings that are written only while sitting, the words of both, and
    the ms of BootTime and those of ours between them."""

    state: int
    sitting: Sequence[Word]
    first: Sequence[int]
    second: Sequence[int]
    passed: int
    span: Span


def _posture(seen: StillnessCheck) -> str | None:
    if seen.state >> 12 in (SITTING, STANDING):
        return None
    return f"the posture is {state_text(seen.state)}, neither sitting nor standing"


def _driven(seen: StillnessCheck) -> str | None:
    return f"the joints are being driven: {state_text(seen.state)}" if seen.state & DRIVEN else None


def _seated(seen: StillnessCheck) -> str | None:
    if not seen.sitting or seen.state >> 12 == SITTING:
        return None
    names = ", ".join(param.name for param in seen.sitting)
    return f"{names}: only while sitting, but the state is {state_text(seen.state)}"


def _reboot(seen: StillnessCheck) -> str | None:
    return "BootTime went back: the device has restarted" if seen.passed >= 2**31 else None


def _fresh(seen: StillnessCheck) -> str | None:
    if seen.span.fits(seen.passed):
        return None
    return f"BootTime advanced by {seen.passed} ms in {seen.span}: the values are not fresh"


def _speed(seen: StillnessCheck) -> str | None:
    for param in JOINTS:
        turned = abs(param.raw_of(seen.second[param.word]) - param.raw_of(seen.first[param.word])) / 100
        speed = turned / (seen.passed / 1000 or 1e-3)
        if speed >= MOST_SPEED:
            return f"{param.name} moves at {speed:.1f} deg/s"
    return None


STILL: Mapping[str, Callable[[StillnessCheck], str | None]] = {
    write_checks.POSTURE: _posture, write_checks.DRIVEN: _driven, write_checks.SEATED: _seated,
    write_checks.REBOOT: _reboot, write_checks.FRESH: _fresh, write_checks.SPEED: _speed,
}  # fmt: skip


def moving(first: Sequence[int], second: Sequence[int], span: Span, sitting: Sequence[Word] = ()) -> str | None:
    """Why two GetData `span` apart show that the wearer moves; None if they show a wearer who sits or stands still.

    `sitting` are settings that are written only while sitting.
    """
    passed = (boot_ms(second) - boot_ms(first)) % 2**32
    looks = [StillnessCheck(words[STATE] & 0xFFFF, sitting, first, second, passed, span) for words in (first, second)]
    found = [STILL[gate](look) for look in looks for gate in write_checks.at(write_checks.LOOK)]
    found += [] if any(found) else [STILL[gate](looks[0]) for gate in write_checks.at(write_checks.LOOKS)]
    return next(filter(None, found), None)
