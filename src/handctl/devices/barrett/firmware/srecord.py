"""A firmware file: Motorola S-records, 16-bit, checked as a whole (barrett §3.7; dossier 7.4). Sans I/O.

    S1 count address(4) data checksum     data, in the order of the file
    S0 header, S5 count of S1 records, S9 end: checked, never sent; 24- and 32-bit records are refused

Reads text, gives records and findings; knows no link. bincopy unpacks a record; its whole-file class lets pass what must
not (wrong S5, missing S9, data behind it, addresses beyond 64 KiB), so those rules are here.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

MAX_DATA = 32
"""Data bytes of a record as it is sent; longer ones are split (the reference reads at most 37)."""
ODD_AREAS = ((0x0000, 0x00FF, "internal RAM"), (0x1000, 0x103F, "registers"), (0xF800, 0xFFFF, "EEPROM"))
"""Default areas of the hand's processor that firmware should not fill; the real map is unknown: a warning only."""
OK, WARNING, FORCE, FAIL = "ok", "warning", "force", "fail"
BYTE_SECONDS = 10 / 9600
CHECKS = ("text", "types", "checksums", "addresses", "overlaps", "count", "end", "data")


class Record(NamedTuple):
    """One data record: where it stands in the file, its address and bytes."""

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

    def worst(self) -> str:
        """The worst status of all findings."""
        return max((finding.status for finding in self.findings), key=(OK, WARNING, FORCE, FAIL).index)

    @property
    def range_text(self) -> str:
        """``2000-C45F``."""
        return ", ".join(f"{first:04X}-{last:04X}" for first, last in self.ranges)


class _Reader:
    """Collects what each check finds: every line is read, nothing stops at the first mistake."""

    def __init__(self) -> None:
        self.bad: dict[str, list[tuple[str, str, str]]] = {check: [] for check in CHECKS}
        self.records: list[Record] = []
        self.header = ""
        self.headers = 0
        self.ended_at = 0
        self.counts: list[tuple[int, int]] = []
        self.s1 = 0
        self.empty = 0

    def note(self, check: str, evidence: str, remedy: str, status: str = FAIL) -> None:
        self.bad[check].append((status, evidence, remedy))

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
                "types", f"line {number}: a header (S0) after other records, possibly a damaged data record", DAMAGED
            )
        elif kind == "0":
            self.headers += 1
            self.header = "".join(chr(byte) for byte in data if 32 <= byte < 127).strip()
        elif kind in "59" and size:
            self.note(
                "types", f"line {number}: S{kind} with {size} data bytes, possibly a damaged data record", DAMAGED
            )
        elif kind == "5":
            self.counts.append((number, address))
        elif kind == "9":
            self.ended_at = self.ended_at or number
        else:
            self.s1 += 1
            if self.ended_at:
                self.note(
                    "end", f"line {number}: data after the end record in line {self.ended_at}", "get the file again"
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
                    "count", f"line {number}: S5 says {count} data records, the file has {self.s1}", "lines are missing"
                )
        if not self.ended_at:
            self.note("end", "no end record (S9), so the file may be incomplete", "get the file again", FORCE)
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
                self.note("overlaps", clash[1], "get the file again: it is not defined which bytes apply", clash[0])


DAMAGED = "get the file again, and do not edit it: it is damaged"
SIXTEEN_BIT = "BarrettHand firmware has 16-bit S1 records"
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


def parse(name: str, content: bytes) -> Firmware:
    """A file's records and the verdict of every check. Never raises: what is wrong is a finding."""
    reader = _Reader()
    text = content.decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
    for number, line in enumerate(text.split("\n"), 1):
        if line.strip():
            reader.line(number, line.strip())
    reader.finish()
    firmware = Firmware(name, hashlib.sha256(content).hexdigest(), list(_split(reader.records)), reader.header)
    firmware.findings = [_finding(check, reader.bad[check]) for check in CHECKS]
    if reader.empty:
        firmware.findings.append(Finding("empty", WARNING, f"{reader.empty} records without data", "they are skipped"))
    return firmware


def _finding(check: str, bad: Sequence[tuple[str, str, str]]) -> Finding:
    if not bad:
        return Finding(check, OK, GOOD[check])
    status = max((entry[0] for entry in bad), key=(OK, WARNING, FORCE, FAIL).index)
    first = next(entry for entry in bad if entry[0] == status)
    more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
    return Finding(check, status, first[1] + more, first[2])


def _split(records: Iterable[Record]) -> Iterable[Record]:
    for record in records:
        for start in range(0, len(record.data), MAX_DATA):
            yield Record(record.line, record.address + start, record.data[start : start + MAX_DATA])
