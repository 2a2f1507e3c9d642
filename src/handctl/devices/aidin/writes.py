"""Which bytes command an AIDIN-hand (see `ledger`). The protocol has no acknowledgement: only feedback is evidence.

An object with a mode is a command, one without (a poll) is none. Objects of one mode in a row are one step: a mode is
sent every 20 ms for as long as it is to hold.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence

from handctl.devices.aidin.map import Mode
from handctl.model.ledger import Frame

MODE = b'"hand_mode"'
BLANKS = b" \t\r\n\0"
NEXT: dict[int, str] = {
    Mode.MAXTORQUE: "send it again, because the maximum torque cannot be read back",
    Mode.STOP: "`handctl aidin get current_state`, or switch the power off",
    Mode.BIAS: "`handctl aidin get sensor_state`",
}


class AidinWrites:
    """One connection."""

    def sent(self, data: bytes, can_id: int | None) -> Sequence[Frame]:
        """See WriteWords."""
        place = data.find(MODE)
        if place < 0:
            return ()
        return (Frame(data, None, data.rstrip(BLANKS), group=f"mode {_mode(data, place)}"),)

    def came(self, data: bytes, can_id: int | None) -> Iterable[tuple[Hashable, bool]]:
        """See WriteWords."""
        return ()

    def planned(self, data: bytes, can_id: int | None) -> Hashable:
        """See WriteWords: the terminator is no part of the command."""
        return data.rstrip(BLANKS) if MODE in data else None

    def next(self, data: bytes, can_id: int | None) -> str:
        """See WriteWords."""
        return NEXT.get(_mode(data, data.find(MODE)), "`handctl aidin status`")


def _mode(data: bytes, place: int) -> int:
    """The number of the mode; -1 where none stands."""
    digits = data[place + len(MODE) :].lstrip(b" :")[:2]
    number = bytes(byte for byte in digits if 48 <= byte < 58)
    return int(number) if number else -1


words = AidinWrites
