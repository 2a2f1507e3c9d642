"""What a search for devices on a line met, in words."""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.inspire import eb90
from handctl.devices.inspire.asker import Findings
from handctl.devices.inspire.mishaps import hint_for
from handctl.errors import ProtocolError
from handctl.sentence import plural

ONE_ID = "leave one device on the line, change its id with `id`, then connect the other one"
BAD_HINT = "leave one device on the line and check the cable and the ground: two devices have the same id, or the line is disturbed"


def ids_text(ids: Sequence[int]) -> str:
    return f"id {', '.join(map(str, ids))}"


def span_text(ids: Sequence[int]) -> str:
    return f"id {ids[0]}" if len(ids) == 1 else f"ids {ids[0]} to {ids[-1]}"


def left_text(speed: int | None, first: int, last: int, family: str) -> str:
    return f"ids {first} to {last} of {family}{at_text(speed)}: --all asks there"


def at_text(speed: int | None) -> str:
    return f" at {speed}" if speed else ""


def nothing(
    name: str, what: str, family: str, found: Findings, twins: Sequence[int], summary: str
) -> ProtocolError | None:
    """The error of what came instead of a device, None where nothing came. `twins` are ids that two devices have."""
    twice = [device_id for device_id, count in found.damaged.items() if count >= 2]
    code, text, hint = "", "", ""
    if twins:
        code, hint = "twin-id", ONE_ID
        text = f"two devices with the same id: {ids_text(twins)} answers, damaged by the other device's answer"
    elif twice:
        code, hint = "bad-checksum", BAD_HINT
        text = f"{ids_text(twice)} answered, but each time with a wrong checksum"
    elif found.beheaded:
        code = "first-byte-lost"
        text = f"{ids_text(sorted(found.beheaded))} answered, but the first byte of each answer is missing"
    elif found.foreign:
        code = "wrong-id"
        text = f"{ids_text([device_id for _, device_id in found.unconfirmed])} answered, but not when it was asked"
    elif found.echo:
        code, text = "echo", f"no {what}, only our own bytes came back"
    elif found.garbage:
        code, text = "garbage", f"no {what}, but received {plural(found.garbage, 'byte')}, not a valid frame"
    if not code:
        return None
    came = found.came if code == "garbage" and eb90.sign(found.came) else b""
    return ProtocolError(f"{name}: {text} ({summary})", hint=hint or hint_for(code, family), code=code, came=came)
