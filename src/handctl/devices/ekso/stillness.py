"""Whether the wearer of an EksoNR keeps still: two looks at GetData, before any setting is written.

The limits are this tool's policy (`ekso policy` shows them), not the device's.
"""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.ekso.dataport import DataPort
from handctl.devices.ekso.frames import Command
from handctl.devices.ekso.map import DATA, DRIVEN, SITTING, STANDING, Word, boot_ms, state_text
from handctl.errors import CheckFailed

APART = 0.1
"""Seconds between the two looks at the joints."""
MOST_SPEED = 5.0
"""deg/s; above, the wearer moves."""
BOOT_TOLERANCE_MS = 50
STATE = 18
JOINTS = tuple(param for param in DATA if param.name.endswith(("hip_angle", "knee_angle")))


def moving(first: Sequence[int], second: Sequence[int], seconds: float, sitting: Sequence[Word] = ()) -> str | None:
    """Why two GetData `seconds` apart are not those of somebody who sits or stands still; None when they are.

    `sitting` are settings that are written only while sitting.
    """
    for words in (first, second):
        state = words[STATE] & 0xFFFF
        if state >> 12 not in (SITTING, STANDING):
            return f"the posture is {state_text(state)}, neither sitting nor standing"
        if state & DRIVEN:
            return f"the joints are being driven: {state_text(state)}"
        if sitting and state >> 12 != SITTING:
            return f"{', '.join(param.name for param in sitting)}: only while sitting, the state is {state_text(state)}"
    passed = (boot_ms(second) - boot_ms(first)) % 2**32
    if passed >= 2**31:
        return "BootTime went back: the device has restarted"
    if abs(passed - seconds * 1000) > BOOT_TOLERANCE_MS:
        return f"BootTime advanced by {passed} ms in {seconds * 1000:.0f} ms: the values are not fresh"
    for param in JOINTS:
        speed = abs(param.raw_of(second[param.word]) - param.raw_of(first[param.word])) / 100 / (passed / 1000 or 1e-3)
        if speed >= MOST_SPEED:
            return f"{param.name} moves at {speed:.1f} deg/s"
    return None


def require_stillness(port: DataPort, sitting: Sequence[Word] = ()) -> int:
    """Two looks at least 100 ms apart; returns BootTime in ms. Raises CheckFailed naming the condition that fails."""
    first = port.read(Command.GET_DATA).words
    moment = (port.sent_at + port.answered_at) / 2
    port.link.sleep(APART)
    second = port.read(Command.GET_DATA).words
    why = moving(first, second, (port.sent_at + port.answered_at) / 2 - moment, sitting)
    if why is not None:
        raise CheckFailed(
            f"{port.where}: not written: {why}",
            hint=f"{'sit' if sitting else 'sit or stand'} still and repeat the command; there is no override",
            code="not-still",
        )
    return boot_ms(second)
