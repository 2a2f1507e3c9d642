"""Which bytes write to an EksoNR, what acknowledges them, and what to read if nothing does (see `write_ledger`).

The answer repeats command and msgID; its status word says accepted (0) or why not (ekso §6). A bare acknowledgement,
which may be an echo, proves nothing.
"""

from __future__ import annotations

from collections.abc import Hashable

from handctl.devices.ekso.frames import READS, Command, Decoder, Frame
from handctl.model.write_ledger import RequestReplyRules

CRC_BYTES = 2


class EksoWriteRules(RequestReplyRules[Frame]):
    """One connection."""

    def key(self, request: bytes) -> Hashable:
        return request[:1] + request[2:4] if request and request[0] not in READS.values() else None

    def same(self, request: bytes) -> Hashable:
        """The bytes without the running msgID and the sum over it."""
        return request[:2] + request[4:-CRC_BYTES]

    def decoder(self, request: bytes) -> Decoder:
        decoder = Decoder()
        decoder.expect(request)
        return decoder

    def verdict(self, frame: Frame, request: bytes) -> tuple[Hashable, bool] | None:
        """CancelAction and its answer are of one length: what equals the request is an echo."""
        if not frame.answers(request) or len(frame.body) != 2:
            return None
        return self.key(request), frame.status & 0xFF == 0

    def next(self, data: bytes, can_id: int | None) -> str:
        """See WriteRules."""
        return "`handctl ekso feedback`" if data[0] == Command.CANCEL_ACTION else "`handctl ekso settings`"


words = EksoWriteRules
