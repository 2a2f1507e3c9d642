"""What the two families of Inspire share."""

from __future__ import annotations

from tests.contract.facts import Passed


def inspire(entry: Passed) -> bool:
    """Whatever is no read: flags 11 and 30, or CAN identifiers of type 0 and 4."""
    if entry.can_id is not None:
        return entry.can_id >> 26 in (1, 5)
    return not (len(entry.data) == 9 and entry.data[:2] == b"\xeb\x90" and entry.data[4] in (0x11, 0x30))
