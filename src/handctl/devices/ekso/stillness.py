"""Whether the wearer keeps still: two looks at GetData, before any setting is written. Knows no link. The limits are those of `write_policy`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from handctl.devices.ekso import write_checks
from handctl.devices.ekso.parameter_map import DATA, DRIVEN, SITTING, STANDING, Word, boot_ms, state_text
from handctl.devices.ekso.write_policy import MOST_SPEED
from handctl.model.device_clock import Span

STATE = 18
JOINTS = tuple(param for param in DATA if param.name.endswith(("hip_angle", "knee_angle")))


def _look(state: int, sitting: Sequence[Word]) -> Mapping[str, str]:
    """Gate -> what of one look speaks against a wearer who keeps still, "" = nothing."""
    posture, shown = state >> 12, state_text(state)
    names = ", ".join(param.name for param in sitting)
    return {
        write_checks.POSTURE: ""
        if posture in (SITTING, STANDING)
        else f"the posture is {shown}, neither sitting nor standing",
        write_checks.DRIVEN: f"the joints are being driven: {shown}" if state & DRIVEN else "",
        write_checks.SEATED: f"{names}: only while sitting, but the state is {shown}"
        if sitting and posture != SITTING
        else "",
    }


def _between(first: Sequence[int], second: Sequence[int], span: Span) -> Mapping[str, str]:
    """The same of both looks together."""
    passed = (boot_ms(second) - boot_ms(first)) % 2**32
    fast = ""
    for param in JOINTS:
        turned = abs(param.raw_of(second[param.word]) - param.raw_of(first[param.word])) / 100
        speed = turned / (passed / 1000 or 1e-3)
        if speed >= MOST_SPEED and not fast:
            fast = f"{param.name} moves at {speed:.1f} deg/s"
    return {
        write_checks.REBOOT: "BootTime went back: the device has restarted" if passed >= 2**31 else "",
        write_checks.FRESH: ""
        if span.fits(passed)
        else f"BootTime advanced by {passed} ms in {span}: the values are not fresh",
        write_checks.SPEED: fast,
    }


def moving(first: Sequence[int], second: Sequence[int], span: Span, sitting: Sequence[Word] = ()) -> str | None:
    """Why two GetData `span` apart show that the wearer moves; None if they show a wearer who sits or stands still.

    `sitting` are settings that are written only while sitting.
    """
    looks = [_look(words[STATE] & 0xFFFF, sitting) for words in (first, second)]
    found = [look[gate] for look in looks for gate in write_checks.at(write_checks.LOOK)]
    between = _between(first, second, span)
    found += [between[gate] for gate in write_checks.at(write_checks.LOOKS)]
    return next(filter(None, found), None)
