"""A firmware download in words (dossier 7.2): records from the host, their echoes from the boot monitor.

FF once;  then per record   FF | address low, address high, count | FF | data       each but the FF is echoed
"""

from __future__ import annotations

from collections import deque

from handctl.model.piece import DEVICE, HOST, Part, Piece, stray

TRIGGER = 0xFF
HEAD = 5
"""Bytes of a record before its data: trigger, address, count, trigger."""


def record_parts(raw: bytes) -> tuple[Part, ...]:
    """A whole record field by field."""
    address, count = int.from_bytes(raw[1:3], "little"), raw[3]
    return (
        Part(raw[:1], "trigger", "not echoed"), Part(raw[1:2], "address low", f"{raw[1]:02X}"),
        Part(raw[2:3], "address high", f"address {address:04X}h"), Part(raw[3:4], "count", f"{count} data bytes"),
        Part(raw[4:5], "trigger", "not echoed"), Part(raw[5:], "data", f"{address:04X}h to {address + count - 1:04X}h"),
    )  # fmt: skip


def record_piece(raw: bytes, key: str = "") -> Piece:
    """A whole record."""
    address, count = int.from_bytes(raw[1:3], "little"), raw[3]
    return Piece(
        direction=HOST, raw=raw, meaning=f"download record: {count} bytes at {address:04X}h", asks=key,
        fields={"address": address, "count": count}, parts=record_parts(raw),
    )  # fmt: skip


def records(data: bytes) -> list[Piece]:
    """The pieces of download bytes as the host sends them, from a trigger on; [] if they are none."""
    pieces: list[Piece] = []
    if data[:2] == b"\xff\xff" and _whole(data[1:]):
        pieces.append(Piece(direction=HOST, raw=data[:1], meaning="the first trigger of a download"))
        data = data[1:]
    while data:
        size = _whole(data)
        if not size:
            return []
        pieces.append(record_piece(data[:size]))
        data = data[size:]
    return pieces


def _whole(data: bytes) -> int:
    """Bytes of the record that begins here, 0 = none."""
    if len(data) < HEAD + 1 or data[0] != TRIGGER or data[4] != TRIGGER or not data[3]:
        return 0
    return HEAD + data[3] if len(data) >= HEAD + data[3] else 0


class MonitorWords:
    """One download. A record is told once it is whole, its echo once every byte came back.

    Whether the monitor echoes the triggers too is found out with the first echo.
    """

    def __init__(self) -> None:
        self._out = bytearray()
        self._back = bytearray()
        self._awaited: deque[tuple[int, str]] = deque()
        """(byte, "" | "trigger" | "first") of everything that was sent and may come back."""
        self._ends: deque[tuple[str, int, int]] = deque()
        """(key, address, bytes) of the records on their way."""
        self._begun = False
        self._echoes: bool | None = None
        self._count = 0

    def flush(self) -> list[Piece]:
        """What is not complete."""
        pieces = self._told()
        if self._out:
            pieces.append(stray(HOST, bytes(self._out), f"an unfinished record: {len(self._out)} bytes", "cut-short"))
        self._out.clear()
        self._awaited.clear()
        return pieces

    def host(self, data: bytes) -> tuple[list[Piece], bytes]:
        """Records, and what follows the download: anything but a trigger where a record begins."""
        pieces: list[Piece] = []
        for place, byte in enumerate(data):
            if not self._out and byte != TRIGGER:
                return pieces, data[place:]
            if not self._begun:
                self._begun = True
                self._awaited.append((byte, "first"))
                pieces.append(Piece(direction=HOST, raw=b"\xff", meaning="the first trigger of a download"))
                continue
            self._out.append(byte)
            size = len(self._out)
            self._awaited.append((byte, "trigger" if size in (1, HEAD) else ""))
            if size == HEAD and not self._out[3]:
                pieces.append(stray(HOST, bytes(self._out), "a record without data"))
                self._out.clear()
            elif size > HEAD and size == HEAD + self._out[3]:
                self._count += 1
                key = f"record {self._count}"
                self._ends.append((key, int.from_bytes(self._out[1:3], "little"), size))
                pieces.append(record_piece(bytes(self._out), key))
                self._out.clear()
        return pieces, b""

    def device(self, data: bytes) -> list[Piece]:
        """Echoes. One that differs is told with what was sent."""
        pieces: list[Piece] = []
        for byte in data:
            self._decide(byte)
            while self._awaited and self._awaited[0][1] and not self._echoes:
                self._awaited.popleft()
            if not self._awaited:
                pieces += self._odd(byte, f"{byte:02X} arrived although nothing was expected")
                continue
            sent, kind = self._awaited.popleft()
            if byte != sent:
                pieces += self._odd(byte, f"wrong echo: sent {sent:02X}, received {byte:02X}")
            elif kind == "first":
                pieces.append(Piece(direction=DEVICE, raw=bytes([byte]), meaning="echo of the first trigger"))
            else:
                self._back.append(byte)
                pieces += self._whole_echo()
        return pieces + self._whole_echo()

    def _decide(self, byte: int) -> None:
        """With the first echo: a trigger that comes back, unless the first address byte looks the same."""
        if self._echoes is None and self._awaited:
            first = next((sent for sent, kind in self._awaited if not kind), None)
            self._echoes = byte == TRIGGER and bool(self._awaited[0][1]) and first != TRIGGER

    def _whole_echo(self) -> list[Piece]:
        """The echo of the oldest record, once it is complete."""
        if not self._ends:
            return []
        key, address, size = self._ends[0]
        size -= 0 if self._echoes else 2
        if len(self._back) < size:
            return []
        self._ends.popleft()
        raw = bytes(self._back[:size])
        del self._back[:size]
        text = f"echo of the record at {address:04X}h: {size} bytes, all correct"
        return [Piece(direction=DEVICE, raw=raw, meaning=text, answers=key)]

    def _odd(self, byte: int, text: str) -> list[Piece]:
        """A byte that is no echo; the record's echo can no longer be told whole."""
        return [*self._told(), Piece(direction=DEVICE, raw=bytes([byte]), meaning=text, problem="wrong-echo")]

    def _told(self) -> list[Piece]:
        """The echoes so far, before something else is told."""
        raw = bytes(self._back)
        self._back.clear()
        if raw and self._ends:
            self._ends.popleft()
        return [Piece(direction=DEVICE, raw=raw, meaning=f"echoes: {len(raw)} bytes")] if raw else []
