"""What the two families of Inspire share."""

from __future__ import annotations

from tests.contract.facts import Passed


def inspire(entry: Passed) -> bool:
    """Whether one of the frames in it is no read: flags 11 and 30, or CAN identifiers of type 0 and 4.

    00 goes ahead of a read, FF between two (`register_bus.question`).
    """
    if entry.can_id is not None:
        return entry.can_id >> 26 in (1, 5)
    rest = entry.data.lstrip(b"\0")
    while len(rest) >= 9 and rest[:2] == b"\xeb\x90" and rest[4] in (0x11, 0x30):
        rest = rest[rest[3] + 5 :].lstrip(b"\0\xff")
    return bool(rest)
