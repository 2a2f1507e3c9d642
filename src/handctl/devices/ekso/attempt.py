"""What came instead of an answer of the DataPort, in words: which of the ways to go wrong it was, and what to do (dossier ekso)."""

from __future__ import annotations

from collections.abc import Iterator

from handctl.devices.ekso.frames import OVERHEAD, Command, Frame, name_of
from handctl.errors import ProtocolError
from handctl.model.result import hex_bytes
from handctl.sentence import plural


class Attempt:
    """What came while one answer was waited for; `sent_before` requests of ours went before it."""

    def __init__(self, request: bytes, sent_before: int) -> None:
        self.request = request
        self.sent_before = sent_before
        self.key = key_of(request)
        self.received = bytearray()
        self.broken: ProtocolError | None = None
        self.foreign: Frame | None = None
        self.empty: Frame | None = None

    def mishap(self) -> tuple[str, str]:
        """(code, text) of why there is no answer; the codes are keys of HINTS."""
        name = name_of(self.request[0])
        if self.broken is not None:
            return self.broken.code, f"the reply to {name} is damaged: {self.broken.text}"
        if self.empty is not None and self.empty.data == self.request:
            reads = len(self.request) == OVERHEAD
            return (
                "echo",
                f"{name}: {'acknowledged without data (or the line echoes)' if reads else 'only our own bytes came back'}",
            )
        if self.empty is not None:
            return "acknowledged", f"{name}: acknowledged without data"
        if self.foreign is not None:
            frame = self.foreign
            behind = (self.key[1] - frame.msg_id) & 0xFFFF
            code = "wrong-id" if frame.command in tuple(Command) else "unsolicited"
            if code == "wrong-id":
                code = "wrong-command" if behind == 0 else "late" if behind <= self.sent_before else code
            return (
                code,
                f"{name_of(frame.command)} with msgID {frame.msg_id} arrived instead of {name} with msgID {self.key[1]}",
            )
        for at in _places(self.received[2:], self.request[2:4]):
            command = self.received[at]
            if command == self.request[0]:
                return "cut-short", f"the reply to {name} was cut off after {plural(len(self.received), 'byte')}"
            if command in tuple(Command):
                return "wrong-command", f"a reply to {name_of(command)} arrived instead of {name}"
        return "garbage", f"received {plural(len(self.received), 'byte')} without a valid frame"


def key_of(request: bytes) -> tuple[int, int]:
    """Command and msgID, which the answer repeats."""
    return request[0], int.from_bytes(request[2:4], "big")


def _places(data: bytes | bytearray, part: bytes) -> Iterator[int]:
    at = data.find(part)
    while at >= 0:
        yield at
        at = data.find(part, at + 1)


def shorten(data: bytes, limit: int = 40) -> str:
    text = hex_bytes(data[:limit])
    return text if len(data) <= limit else f"{text} … ({len(data)} bytes)"


HINTS = {
    "silence": "check that the device is on, that the USB cable is connected, and that no other program uses the port. If it is on, it may need another --length-mode (auto tries them with GetTime)",
    "echo": "check the cable for a loop, or whether this is another kind of device. If the device replies elsewhere, it acknowledges without data: report it",
    "acknowledged": "read the value back: an acknowledgement without a status does not mean success",
    "bad-checksum": "check the cable and the hub, and that no other program reads the port: bytes were damaged on the line",
    "bad-length": "report the bytes shown: this may be another protocol version, or they may be damaged",
    "wrong-id": "check whether a second program uses this port: this is the reply to another request",
    "late": "use a longer --timeout: replies take longer than allowed",
    "unsolicited": "try again. The device sent something without a request and did not reply",
    "wrong-command": "report the bytes shown: this may be another protocol version, or a second program may use this port",
    "cut-short": "check the cable, and that no other program reads the port: the reply was cut off",
    "garbage": "check the baud rate (usually 115200 bit/s), and whether this is another kind of device: the data contains no valid frame",
}
