"""Records of a download file: the format's own example, whole and broken ones, and a writer of new ones."""

from __future__ import annotations

EXAMPLE = "S10B2000112233445566FF0070"


def record(address: int, data: bytes, kind: str = "1") -> str:
    """An S-record with a 16-bit address, made by the rule of the dossier."""
    body = bytes([len(data) + 3]) + address.to_bytes(2, "big") + data
    return f"S{kind}{(body + bytes([~sum(body) & 255])).hex().upper()}"


HEADER = record(0, b"BarrettHand v4.33", "0")
END = record(0, b"", "9")
GOOD = (HEADER, EXAMPLE, record(0x2008, bytes(range(32))), record(0x3000, b"\xff" * 16), END)
BROKEN: dict[str, tuple[tuple[str, ...], str, str, tuple[str, ...]]] = {
    # name -> lines, check, status, words of the evidence
    "wrong checksum": ((EXAMPLE[:-2] + "71", END), "checksums", "fail", ("line 1", "checksum 71", "70")),
    "wrong data": ((EXAMPLE.replace("33", "34"), END), "checksums", "fail", ("line 1", "checksum 70", "6F")),
    "cut in the middle": ((HEADER, EXAMPLE[:-6]), "checksums", "fail", ("line 2", "count", "11")),
    "line too long": ((EXAMPLE + "00", END), "checksums", "fail", ("line 1", "count", "12")),
    "odd digits": ((EXAMPLE[:-1], END), "checksums", "fail", ("line 1", "hexadecimal")),
    "no hex": ((EXAMPLE.replace("5566", "55G6"), END), "checksums", "fail", ("line 1", "hexadecimal")),
    "too short": (("S103", END), "checksums", "fail", ("line 1", "too short")),
    "24 bit": ((HEADER, "S20820000011223344" + "2D", END), "types", "fail", ("line 2", "S2", "24-bit")),
    "32 bit": (("S30920000000112233442C", END), "types", "fail", ("S3", "32-bit")),
    "32-bit end": ((EXAMPLE, "S70500000000FA"), "types", "fail", ("line 2", "S7", "32-bit")),
    "S8": ((EXAMPLE, "S804000000FB"), "types", "fail", ("line 2", "S8", "24-bit")),
    "S4": ((record(0, b"", "4"), EXAMPLE, END), "types", "fail", ("line 1", "S4")),
    "S6": ((EXAMPLE, record(1, b"", "6"), END), "types", "fail", ("line 2", "S6")),
    "no end": ((HEADER, EXAMPLE), "end", "force", ("S9",)),
    "data after the end": ((EXAMPLE, END, record(0x3000, b"\x01")), "end", "fail", ("line 3", "line 2")),
    "lines missing": ((EXAMPLE, record(7, b"", "5"), END), "count", "fail", ("S5 says 7", "has 1")),
    "overlap with other bytes": (
        (EXAMPLE, record(0x2004, b"\x55\x67"), END), "overlaps", "fail", ("line 2", "2005", "line 1", "66", "67"),
    ),
    "beyond 64 KiB": ((record(0xFFFF, b"\x01\x02"), END), "addresses", "fail", ("line 1", "FFFF")),
    "no data": ((HEADER, END), "data", "fail", ("no S1",)),
    "empty file": (("",), "data", "fail", ("no S1",)),
    "only empty records": ((record(0x2000, b""), END), "data", "fail", ("empty",)),
    "intel hex": ((":10010000214601360121470136007EFE09D2190140",), "text", "fail", ("line 1", ":1001")),
    "a text": (("Dear user,", EXAMPLE, END), "text", "fail", ("line 1", "Dear")),
    "binary": (("\x7fELF\x01\x02",), "text", "fail", ("line 1",)),
}  # fmt: skip
