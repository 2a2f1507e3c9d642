"""Which bytes write to an EksoNR, what acknowledges them, what to read when nothing does (see `ledger`).

The answer repeats command and msgID; its status word says accepted (0) or why not (ekso §6). A bare acknowledgement,
which may be an echo, proves nothing.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence

from handctl.devices.ekso.frames import Command, Decoder
from handctl.errors import ProtocolError
from handctl.model.ledger import Frame

READS = range(Command.GET_TIME, Command.SET_VALUE)
CRC_BYTES = 2


class EksoWrites:
    """One connection."""

    def __init__(self) -> None:
        self._decoder = Decoder()
        self._key: Hashable = None
        self._sent = b""

    def sent(self, data: bytes, can_id: int | None) -> Sequence[Frame]:
        """See WriteWords."""
        if not data or data[0] in READS:
            return ()
        self._key = data[:1] + data[2:4]
        self._sent = data  # CancelAction and its answer are of one length: what equals it is an echo
        self._decoder = Decoder()
        self._decoder.expect(data)
        return (Frame(data, self._key, self.planned(data, None)),)

    def came(self, data: bytes, can_id: int | None) -> Iterable[tuple[Hashable, bool]]:
        """See WriteWords."""
        self._decoder.feed(data)
        found: list[tuple[Hashable, bool]] = []
        while True:
            try:
                frame = self._decoder.next()
            except ProtocolError:
                continue
            if frame is None:
                return found
            key = bytes([frame.command]) + frame.msg_id.to_bytes(2, "big")
            if key == self._key and len(frame.body) == 2 and frame.data != self._sent:
                found.append((key, frame.words[0] & 0xFF == 0))

    def planned(self, data: bytes, can_id: int | None) -> Hashable:
        """See WriteWords: the bytes without the running msgID and the sum over it."""
        return data[:2] + data[4:-CRC_BYTES] if data and data[0] not in READS else None

    def next(self, data: bytes, can_id: int | None) -> str:
        """See WriteWords."""
        return "`handctl ekso feedback`" if data[0] == Command.CANCEL_ACTION else "`handctl ekso settings`"


def words() -> EksoWrites:
    """See EksoWrites."""
    return EksoWrites()
