"""Which bytes command an AIDIN-hand (see `write_ledger`). The protocol has no acknowledgement: only feedback is evidence.

An object with a mode is a command, one without (a poll) is none. Objects of one mode in a row are one step: a mode is
sent every 20 ms for as long as it is to hold.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Sequence

from handctl.devices.aidin.map import Mode
from handctl.model.write_ledger import Frame

MODE = re.compile(rb'"hand_mode"[ :]*(\d{0,2})')
BLANKS = b" \t\r\n\0"
NEXT: dict[int, str] = {
    Mode.MAXTORQUE: "send it again, because the maximum torque cannot be read back",
    Mode.STOP: "`handctl aidin get current_state`, or switch the power off",
    Mode.BIAS: "`handctl aidin get sensor_state`",
}


class AidinWriteRules:
    """One connection."""

    def sent(self, data: bytes, can_id: int | None) -> Sequence[Frame]:
        """See WriteRules."""
        found = MODE.search(data)
        return (Frame(data, None, data.rstrip(BLANKS), group=f"mode {found[1].decode()}"),) if found else ()

    def came(self, data: bytes, can_id: int | None) -> Iterable[tuple[Hashable, bool]]:
        """See WriteRules."""
        return ()

    def planned(self, data: bytes, can_id: int | None) -> Hashable:
        """See WriteRules: the terminator is no part of the command."""
        return data.rstrip(BLANKS) if MODE.search(data) else None

    def next(self, data: bytes, can_id: int | None) -> str:
        """See WriteRules."""
        found = MODE.search(data)
        return NEXT.get(int(found[1] or -1) if found else -1, "`handctl aidin status`")


words = AidinWriteRules
