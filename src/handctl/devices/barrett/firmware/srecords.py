"""A firmware file, and how each of its records goes over the wire. Sans I/O: knows no link and no clock.

Motorola S-records, 16-bit, checked as a whole (barrett §3.7; dossier 7.4):

    S1 count address(4) data checksum     data, in the order of the file
    S0 header, S5 count of S1 records, S9 end: checked, never sent; 24- and 32-bit records are refused

bincopy unpacks a record; its whole-file class lets pass what must not (wrong S5, missing S9, data behind it, addresses
beyond 64 KiB), so those rules are here. The boot monitor's protocol, one S1 record <-> bytes and echoes (dossier 7.2):

    58 "X"  hand off;  on: 3A ":";  FF once;  then per record
    FF | address low, address high, count: each echoed | FF | data bytes: each echoed

There is no checksum on the wire and no end mark: the echo is the check, and only this side can react to it. The FF
triggers are not checked; whether a hand echoes them is found out with the first record.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from handctl.errors import ProtocolError

MAX_DATA = 32
"""Data bytes of a record as it is sent; longer ones are split (the reference reads at most 37)."""
ODD_AREAS = ((0x0000, 0x00FF, "internal RAM"), (0x1000, 0x103F, "registers"), (0xF800, 0xFFFF, "EEPROM"))
"""Default areas of the hand's processor that firmware should not fill; the real map is unknown: a warning only."""
OK, WARNING, FORCE, FAIL = "ok", "warning", "force", "fail"
BYTE_SECONDS = 10 / 9600
GOOD = {
    "text": "every line is an S-record",
    "types": "16-bit records only",
    "checksums": "every count and checksum is correct",
    "addresses": "all within 0000-FFFF",
    "overlaps": "none",
    "count": "no S5 record, or a correct one",
    "end": "S9 is the last record",
    "data": "present",
}
"""Check -> what it says where nothing is wrong, in the order in which they are shown."""


class Record(NamedTuple):
    """One data record: its line in the file, its address and its bytes."""

    line: int
    address: int
    data: bytes


class Finding(NamedTuple):
    """The verdict of one check. `status` is ok, warning, force (a warning that --force must answer) or fail."""

    check: str
    status: str
    evidence: str
    remedy: str = ""


@dataclass(slots=True)
class Firmware:
    """What a file holds. `records` are ready to be sent: in file order, 1 to 32 bytes each."""

    name: str
    sha256: str
    records: list[Record] = field(default_factory=list)
    header: str = ""
    findings: list[Finding] = field(default_factory=list)

    @property
    def size(self) -> int:
        """Data bytes."""
        return sum(len(record.data) for record in self.records)

    @property
    def ranges(self) -> list[tuple[int, int]]:
        """(first, last) address of each stretch without a gap, ascending."""
        found: list[tuple[int, int]] = []
        for first, last in sorted((r.address, r.address + len(r.data) - 1) for r in self.records):
            if found and first <= found[-1][1] + 1:
                found[-1] = (found[-1][0], max(found[-1][1], last))
            else:
                found.append((first, last))
        return found

    @property
    def image_sha256(self) -> str:
        """Hash of the data bytes in ascending order of their addresses."""
        memory = {record.address + place: byte for record in self.records for place, byte in enumerate(record.data)}
        return hashlib.sha256(bytes(memory[address] for address in sorted(memory))).hexdigest()

    @property
    def seconds(self) -> float:
        """Time of a download at 9600 bit/s, every byte waiting for its echo (dossier 12)."""
        return sum(2 + 2 * (3 + len(record.data)) for record in self.records) * BYTE_SECONDS

    @property
    def range_text(self) -> str:
        """``2000-C45F``."""
        return ", ".join(f"{first:04X}-{last:04X}" for first, last in self.ranges)


class _Reader:
    """Collects what each check finds: every line is read, nothing stops at the first mistake."""

    def __init__(self) -> None:
        self.bad: dict[str, list[Finding]] = {check: [] for check in GOOD}
        self.records: list[Record] = []
        self.header = ""
        self.headers = 0
        self.ended_at = 0
        self.counts: list[tuple[int, int]] = []
        self.s1 = 0
        self.empty = 0

    def note(self, check: str, evidence: str, remedy: str, status: str = FAIL) -> None:
        self.bad[check].append(Finding(check, status, evidence, remedy))

    def line(self, number: int, text: str) -> None:
        from bincopy import Error, unpack_srec

        if text[:1] not in "Ss" or len(text) < 2:
            self.note("text", f"line {number} is not an S-record: {text[:24]!r}", "use the vendor's .S19 file as it is")
            return
        kind = text[1]
        if kind in "2378":
            self.note("types", f"line {number}: S{kind} has {24 if kind in '28' else 32}-bit addresses", SIXTEEN_BIT)
            return
        if kind not in "0159":
            self.note("types", f"line {number}: S{kind} is not a type of a 16-bit file", SIXTEEN_BIT)
            return
        try:
            _, address, size, data = unpack_srec(f"S{text[1:]}")
        except (Error, ValueError, IndexError) as exc:
            self._broken(number, text, exc)
            return
        self._take(number, kind, address, size, bytes(data))

    def _broken(self, number: int, text: str, exc: Exception) -> None:
        digits = text[2:]
        if any(letter not in "0123456789abcdefABCDEF" for letter in digits) or len(digits) % 2:
            what = f"line {number}: not pairs of hexadecimal digits: {text[:40]!r}"
        elif len(digits) < 8:
            what = f"line {number} is too short: {text!r}"
        elif int(digits[:2], 16) != len(digits) // 2 - 1:
            what = f"line {number}: its count says {int(digits[:2], 16)} bytes, {len(digits) // 2 - 1} are present"
        else:
            found = int(digits[-2:], 16)
            right = ~sum(bytes.fromhex(digits[:-2])) & 0xFF
            what = f"line {number}: checksum {found:02X}, the bytes give {right:02X}"
        self.note("checksums", what, DAMAGED)

    def _take(self, number: int, kind: str, address: int, size: int, data: bytes) -> None:
        # The type is not part of the checksum: one wrong bit makes a data record a header or an end record.
        if kind == "0" and (self.headers or self.s1):
            self.note(
                "types", f"line {number}: a header (S0) after other records, possibly a corrupted data record", DAMAGED
            )
        elif kind == "0":
            self.headers += 1
            self.header = "".join(chr(byte) for byte in data if 32 <= byte < 127).strip()
        elif kind in "59" and size:
            self.note(
                "types", f"line {number}: S{kind} with {size} data bytes, possibly a corrupted data record", DAMAGED
            )
        elif kind == "5":
            self.counts.append((number, address))
        elif kind == "9":
            self.ended_at = self.ended_at or number
        else:
            self.s1 += 1
            if self.ended_at:
                self.note(
                    "end",
                    f"line {number}: data after the end record in line {self.ended_at}",
                    "download the file again",
                )
            if not size:
                self.empty += 1
            elif address + size > 0x10000:
                self.note("addresses", f"line {number}: {address:04X}h + {size} bytes is beyond FFFFh", SIXTEEN_BIT)
            else:
                self.records.append(Record(number, address, data))

    def finish(self) -> None:
        """Checks that need the whole file."""
        if not self.s1:
            self.note(
                "data", "no S1 record: there is nothing to load", "use another file: this is not BarrettHand firmware"
            )
        elif not self.records and not self.bad["addresses"]:
            self.note("data", "every S1 record is empty", "use another file: this is not BarrettHand firmware")
        for number, count in self.counts:
            if count != self.s1 & 0xFFFF:
                self.note(
                    "count",
                    f"line {number}: S5 says {count} data records, the file has {self.s1}",
                    "lines are missing, or there twice",
                )
        if not self.ended_at:
            self.note("end", "no end record (S9), so the file may be incomplete", "download the file again", FORCE)
        self._overlaps()
        for first, last, what in ODD_AREAS:
            inside = [r for r in self.records if r.address <= last and r.address + len(r.data) > first]
            if inside:
                self.note(
                    "addresses",
                    f"line {inside[0].line}: data in {first:04X}-{last:04X}, the processor's default {what}",
                    "the hand's actual memory map is unknown: compare the file with the vendor's",
                    WARNING,
                )

    def _overlaps(self) -> None:
        memory: dict[int, tuple[int, int]] = {}
        for record in self.records:
            clash: tuple[str, str] | None = None
            for place, byte in enumerate(record.data):
                before = memory.setdefault(record.address + place, (byte, record.line))
                if before[1] == record.line:
                    continue
                where = f"line {record.line}: address {record.address + place:04X} is also in line {before[1]}"
                if before[0] != byte:
                    clash = (FAIL, f"{where}, with {before[0]:02X} instead of {byte:02X}")
                    break
                clash = clash or (WARNING, f"{where}, with the same bytes")
            if clash is not None:
                self.note(
                    "overlaps", clash[1], "download the file again: it is not defined which bytes apply", clash[0]
                )


PADDING = "\0\x1a \t\r\n"
DAMAGED = "download the file again, and do not edit it: it is corrupted"
SIXTEEN_BIT = "BarrettHand firmware has 16-bit S1 records"


def parse(name: str, content: bytes) -> Firmware:
    """A file's records and the verdict of every check. Never raises: what is wrong is a finding."""
    reader = _Reader()
    text = _text(content).replace("\r\n", "\n").replace("\r", "\n")
    for number, line in enumerate(text.split("\n"), 1):
        if line.strip():
            reader.line(number, line.strip())
    reader.finish()
    firmware = Firmware(name, hashlib.sha256(content).hexdigest(), list(_split(reader.records)), reader.header)
    firmware.findings = [_finding(check, reader.bad[check]) for check in GOOD]
    if reader.empty:
        firmware.findings.append(Finding("empty", WARNING, f"{reader.empty} records without data", "they are skipped"))
    return firmware


def _text(content: bytes) -> str:
    """The text of a file, without what editors and DOS put around it: a byte order mark, ^Z and NUL behind the last line."""
    for mark, encoding in ((b"\xef\xbb\xbf", "latin-1"), (b"\xff\xfe", "utf-16-le"), (b"\xfe\xff", "utf-16-be")):
        if content.startswith(mark):
            return content[len(mark) :].decode(encoding, "replace").rstrip(PADDING)
    return content.decode("latin-1").rstrip(PADDING)


def _finding(check: str, bad: Sequence[Finding]) -> Finding:
    """The worst of what a check has found, the first of its kind."""
    if not bad:
        return Finding(check, OK, GOOD[check])
    worst = max(bad, key=lambda one: (OK, WARNING, FORCE, FAIL).index(one.status))
    return worst._replace(evidence=worst.evidence + (f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""))


def _split(records: Iterable[Record]) -> Iterable[Record]:
    for record in records:
        for start in range(0, len(record.data), MAX_DATA):
            yield Record(record.line, record.address + start, record.data[start : start + MAX_DATA])


# -- on the wire ---------------------------------------------------------------------------------------------------

SELECT = b"X"
READY = b":"
TRIGGER = b"\xff"


def head_of(record: Record) -> bytes:
    """What goes ahead of a record's data: address low, address high, count."""
    return bytes((record.address & 0xFF, record.address >> 8, len(record.data)))


class EchoError(ProtocolError):
    """An echo that differs, or one too many."""


class Transfer:
    """The transfer of one record: `take` returns the bytes that may be sent now, `feed` checks the echoes.

    window          bytes that may be without their echo, 1 as the reference; up to 2 nothing can be lost, 4 is an assumption
                    (dossier 7.7); each trigger waits for all echoes before it
    triggers_echo   whether the monitor echoes the FF triggers too
    """

    def __init__(self, record: Record, *, window: int = 1, triggers_echo: bool = False) -> None:
        self._groups = [head_of(record), bytes(record.data)]
        self._address = record.address
        self._window = window
        self.triggers_echo = triggers_echo
        self.in_data = False
        """Whether address and count are confirmed and data bytes go out."""
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
        if not self.in_data:
            part = ("address low", "address high", "count")[max(0, min(2, self._echoed - lead))]
            return f"the {part} byte of the record at {self._address:04X}h"
        return f"{self._address + max(0, self._echoed - lead):04X}h"

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
        """Check echoes. Raises EchoError with the address, the byte sent and the byte received."""
        for byte in data:
            if self._echoed >= self._sent:
                raise EchoError(f"at {self.where}: {byte:02X} arrived although nothing was expected", code="extra-byte")
            if byte != self.awaited:
                raise EchoError(f"at {self.where}: sent {self.awaited:02X}, received {byte:02X}", code="wrong-echo")
            self._echoed += 1
            if self._echoed == len(self._bytes) and self._groups:
                self.in_data = True
                self._begin()

    @property
    def between(self) -> bool:
        """Whether a group begins now: nothing of it is sent yet."""
        return self._sent == 0 and bool(self._trigger)
