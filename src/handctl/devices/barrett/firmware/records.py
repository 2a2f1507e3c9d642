"""The boot monitor's protocol, one S1 record <-> bytes and echoes (dossier 7.2). Sans I/O: knows no link and no clock.

    58 "X"  hand off;  on: 3A ":";  FF once;  then per record
    FF | address low, address high, count: each echoed | FF | data bytes: each echoed

There is no checksum on the wire and no end mark: the echo is the check, and only this side can react to it. The FF
triggers are not checked; whether a hand echoes them is found out with the first record.
"""

from __future__ import annotations

from handctl.devices.barrett.firmware.srecord import Record
from handctl.errors import ProtocolError

SELECT = b"X"
READY = b":"
TRIGGER = b"\xff"
WINDOWS = (1, 4)
"""Bytes sent ahead of their echo: 1 as the reference; up to 2 nothing can be lost, 4 is an assumption (dossier 7.7)."""


class EchoError(ProtocolError):
    """An echo that differs, or one too many."""


class Transfer:
    """One record on its way: `take` gives what may be sent now, `feed` checks what came back.

    window          bytes that may be without their echo; each trigger waits for all echoes before it
    triggers_echo   whether the monitor echoes the FF triggers too
    """

    def __init__(self, record: Record, *, window: int = 1, triggers_echo: bool = False) -> None:
        head = bytes((record.address & 0xFF, record.address >> 8, len(record.data)))
        self._groups = [head, bytes(record.data)]
        self._address = record.address
        self._window = window
        self.triggers_echo = triggers_echo
        self._in_data = False
        self._begin()

    def _begin(self) -> None:
        self._trigger = TRIGGER if not self.triggers_echo else b""
        self._bytes = (TRIGGER if self.triggers_echo else b"") + self._groups.pop(0)
        self._sent = self._echoed = 0

    @property
    def done(self) -> bool:
        """Whether every byte was sent and echoed."""
        return not self._groups and self._echoed == len(self._bytes)

    @property
    def where(self) -> str:
        """What is awaited, e.g. ``2C40h`` or ``the address of the record at 2C40h``."""
        lead = 1 if self.triggers_echo else 0
        if not self._in_data:
            part = ("address low", "address high", "count")[max(0, min(2, self._echoed - lead))]
            return f"the {part} byte of the record at {self._address:04X}h"
        return f"{self._address + max(0, self._echoed - lead):04X}h"

    @property
    def in_data(self) -> bool:
        """Whether address and count are confirmed and data bytes go out."""
        return self._in_data

    @property
    def awaited(self) -> int:
        """The byte whose echo comes next."""
        return self._bytes[self._echoed]

    def trigger(self) -> bytes:
        """The trigger of the group that begins now, alone: to listen whether it is echoed. b"" when it is sent."""
        trigger, self._trigger = self._trigger, b""
        return trigger

    def take(self) -> bytes:
        """What may be sent now."""
        count = min(self._window - (self._sent - self._echoed), len(self._bytes) - self._sent)
        if count <= 0:
            return b""
        out = self.trigger() + self._bytes[self._sent : self._sent + count]
        self._sent += count
        return out

    def feed(self, data: bytes) -> None:
        """Check echoes. Raises EchoError naming the address, what was sent and what came."""
        for byte in data:
            if self._echoed >= self._sent:
                raise EchoError(f"at {self.where}: {byte:02X} arrived although nothing was expected", code="extra-byte")
            if byte != self.awaited:
                raise EchoError(f"at {self.where}: sent {self.awaited:02X}, received {byte:02X}", code="wrong-echo")
            self._echoed += 1
            if self._echoed == len(self._bytes) and self._groups:
                self._in_data = True
                self._begin()

    @property
    def between(self) -> bool:
        """Whether a group begins now: nothing of it is sent yet."""
        return self._sent == 0 and bool(self._trigger)
