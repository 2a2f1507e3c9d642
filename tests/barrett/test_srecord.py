"""Firmware files of the BarrettHand (barrett §3.7; dossier 7.4): good variants, broken ones, each with its verdict."""

from __future__ import annotations

import hashlib

import bincopy
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from handctl.devices.barrett.firmware.srecords import Firmware, parse
from tests.barrett.srecords import BROKEN, END, EXAMPLE, GOOD, HEADER, record
from tests.support.each_row import each_row

DATA = bytes.fromhex("11 22 33 44 55 66 FF 00")


IMAGE = {
    **dict(enumerate(DATA, 0x2000)),
    **dict(enumerate(range(32), 0x2008)),
    **dict(enumerate(b"\xff" * 16, 0x3000)),
}


def load(*lines: str, end: str = "\n", last: str = "\n") -> Firmware:
    return parse("x.s19", (end.join(lines) + last).encode("latin-1"))


@each_row(
    ("before", "behind", "encoding"),
    [
        ("", "\x1a", "latin-1"),
        ("", "\x1a" + "\0" * 100, "latin-1"),
        ("", "\r\n\0\0\0", "latin-1"),
        ("\ufeff", "", "utf-8"),
        ("\ufeff", "\r\n\x1a", "utf-16-le"),
        ("\ufeff", "", "utf-16-be"),
    ],
)
def test_what_editors_and_dos_put_around_a_file(before: str, behind: str, encoding: str) -> None:
    text = "\r\n".join((HEADER, EXAMPLE, END))
    plain, padded = parse("x.s19", text.encode()), parse("x.s19", (before + text + "\r\n" + behind).encode(encoding))
    assert (padded.records, verdict(padded)) == (plain.records, {}) and plain.records


def worst(firmware: Firmware) -> str:
    return max((finding.status for finding in firmware.findings), key=("ok", "warning", "force", "fail").index)


def verdict(firmware: Firmware) -> dict[str, str]:
    """What is not ok: check -> status."""
    return {finding.check: finding.status for finding in firmware.findings if finding.status != "ok"}


def evidence(firmware: Firmware, check: str) -> str:
    (found,) = [finding for finding in firmware.findings if finding.check == check]
    return found.evidence


def memory(firmware: Firmware) -> dict[int, int]:
    return {record.address + place: byte for record in firmware.records for place, byte in enumerate(record.data)}


# -- good ones --------------------------------------------------------------------------------------------------------


def test_the_record_of_the_dossier() -> None:
    """Sum 28F -> 8F -> 70."""
    assert record(0x2000, DATA) == EXAMPLE
    firmware = load(EXAMPLE, END)
    assert verdict(firmware) == {}
    assert [(r.line, r.address, r.data) for r in firmware.records] == [(1, 0x2000, DATA)]


@each_row(
    ("end", "last", "change"),
    [
        ("\n", "\n", str), ("\r\n", "\r\n", str), ("\n", "", str), ("\r\n", "", str), ("\n\n \n", "\n\n", str),
        ("\r", "\r", str), (" \n\t", " \n", str), ("\n", "\n", str.lower), ("\n", "\n", lambda text: "s" + text[1:]),
        ("\n", "\n", lambda text: text[:2] + text[2:].lower()),
    ],
    ids=["lf", "crlf", "no-final", "crlf-no-final", "blank", "cr", "spaces", "lower", "lower-s", "lower-digits"],
)  # fmt: skip
def test_good_variants(end: str, last: str, change: type[str]) -> None:
    firmware = load(*(change(line) for line in GOOD), end=end, last=last)
    assert verdict(firmware) == {} and worst(firmware) == "ok"
    assert memory(firmware) == IMAGE
    assert (firmware.header, firmware.size, firmware.range_text) == ("BarrettHand v4.33", 56, "2000-2027, 3000-300F")


def test_facts() -> None:
    firmware = load(*GOOD)
    content = ("\n".join(GOOD) + "\n").encode()
    assert firmware.sha256 == hashlib.sha256(content).hexdigest()
    assert firmware.image_sha256 == hashlib.sha256(bytes(IMAGE[address] for address in sorted(IMAGE))).hexdigest()
    assert load(EXAMPLE, END).image_sha256 == "55d6c6aa27b8a45c1cce49ef12efdfc2925f89e5684bd00c1bb6ec4e11d8f460"
    assert firmware.ranges == [(0x2000, 0x2027), (0x3000, 0x300F)]
    assert firmware.name == "x.s19"


@pytest.mark.parametrize(("count", "size", "seconds"), [(1315, 32, 98.6), (2325, 16, 96.9), (2048, 32, 153.6)])
def test_time_of_a_download(count: int, size: int, seconds: float) -> None:
    """Dossier 12: 72 and 40 character times a record at 9600."""
    lines = [record(number * size, bytes(size)) for number in range(count)]
    assert load(*lines, END).seconds == pytest.approx(seconds, abs=0.06)


@each_row(("count", "sizes"), [(1, [1]), (32, [32]), (33, [32, 1]), (64, [32, 32]), (252, [32] * 7 + [28])])
def test_long_records_are_split(count: int, sizes: list[int]) -> None:
    data = bytes(number % 251 for number in range(count))
    firmware = load(record(0x4000, data), END)
    assert [len(part.data) for part in firmware.records] == sizes
    assert b"".join(part.data for part in firmware.records) == data
    assert [part.address for part in firmware.records] == [0x4000 + 32 * number for number in range(len(sizes))]
    assert {part.line for part in firmware.records} == {1}


def test_records_stay_in_the_order_of_the_file() -> None:
    firmware = load(record(0x5000, b"\x01"), record(0x4000, b"\x02"), record(0x4800, b"\x03"), END)
    assert [part.address for part in firmware.records] == [0x5000, 0x4000, 0x4800]


@each_row(("count", "expected"), [(2, {}), (1, {"count": "fail"}), (3, {"count": "fail"})])
def test_s5(count: int, expected: dict[str, str]) -> None:
    lines = (EXAMPLE, record(0x2008, b"\x01"), record(count, b"", "5"), END)
    firmware = load(*lines)
    assert verdict(firmware) == expected
    if expected:
        assert f"says {count}" in evidence(firmware, "count") and "has 2" in evidence(firmware, "count")


def test_s5_behind_s9_as_some_programs_write_it() -> None:
    assert verdict(load(EXAMPLE, END, record(1, b"", "5"))) == {}


def test_up_to_the_last_address() -> None:
    firmware = load(record(0x2000, b"\x00"), record(0xF7FF, b"\x01"), END)
    assert verdict(firmware) == {}
    assert verdict(load(record(0xFFE0, bytes(32)), END)) == {"addresses": "warning"}  # EEPROM, but in range


# -- broken ones ------------------------------------------------------------------------------------------------------


@each_row("name", BROKEN)
def test_broken_files_have_clear_verdicts(name: str) -> None:
    lines, check, status, words = BROKEN[name]
    firmware = load(*lines)
    assert verdict(firmware).get(check) == status, firmware.findings
    assert worst(firmware) in ("fail", status)
    for word in words:
        assert word in evidence(firmware, check), evidence(firmware, check)
    assert all(finding.remedy for finding in firmware.findings if finding.status != "ok")


def test_verdicts_differ() -> None:
    """Ten and more kinds of damage, and as many different sentences."""
    told = {evidence(load(*lines), check) for lines, check, _, _ in BROKEN.values()}
    assert len(told) >= len(BROKEN) - 1 >= 10


def test_every_line_is_read() -> None:
    """Two wrong lines: the first is named, the other counted."""
    bad = EXAMPLE[:-2] + "00"
    firmware = load(bad, bad, EXAMPLE, END)
    assert evidence(firmware, "checksums") == "line 1: checksum 00, the bytes give 70 (and 1 more)"


@each_row(
    ("address", "size", "status"),
    [(0x00FF, 1, "warning"), (0x0100, 1, None), (0x0FFF, 1, None), (0x0FFF, 2, "warning"), (0x103F, 1, "warning"),
     (0x1040, 1, None), (0xF7FF, 1, None), (0xF7FF, 2, "warning"), (0xF800, 1, "warning"), (0xFFFF, 1, "warning")],
)  # fmt: skip
def test_areas_of_the_processor_are_a_warning(address: int, size: int, status: str | None) -> None:
    firmware = load(record(address, bytes(size)), END)
    assert verdict(firmware).get("addresses") == status


def test_the_same_bytes_twice_are_a_warning() -> None:
    firmware = load(EXAMPLE, EXAMPLE, END)
    assert verdict(firmware) == {"overlaps": "warning"}
    assert "line 2" in evidence(firmware, "overlaps") and firmware.ranges == [(0x2000, 0x2007)]


def test_same_bytes_first_and_others_later_in_one_record() -> None:
    """The clash counts, not the harmless beginning."""
    assert verdict(load(EXAMPLE, record(0x2006, b"\xff\x01"), END)) == {"overlaps": "fail"}


def test_empty_records_are_left_out() -> None:
    firmware = load(EXAMPLE, record(0x3000, b""), END)
    assert verdict(firmware) == {"empty": "warning"} and len(firmware.records) == 1


# -- the oracle -------------------------------------------------------------------------------------------------------


@given(
    st.lists(st.binary(min_size=1, max_size=60), min_size=1, max_size=12),
    st.integers(0x2000, 0x4000),
    st.integers(0, 40),
)
def test_the_same_image_as_bincopy(parts: list[bytes], start: int, gap: int) -> None:
    lines, at = [HEADER], start
    for part in parts:
        lines.append(record(at, part))
        at += len(part) + gap
    firmware = load(*lines, END)
    oracle = bincopy.BinFile()
    oracle.add_srec("\n".join([*lines, END]))
    assert verdict(firmware) == {}
    assert memory(firmware) == {
        segment.address + place: byte for segment in oracle.segments for place, byte in enumerate(segment.data)
    }
    assert firmware.ranges == [
        (segment.address, segment.address + len(segment.data) - 1) for segment in oracle.segments
    ]
    assert firmware.header == oracle.header.decode() if isinstance(oracle.header, bytes) else oracle.header


@given(
    st.binary(max_size=200) | st.lists(st.sampled_from([*GOOD, GOOD[2][:-3], "S", ""])).map("\n".join).map(str.encode)
)
@example("\n".join(GOOD).encode())
def test_any_file(content: bytes) -> None:
    firmware = parse("x", content)
    assert worst(firmware) in ("ok", "warning", "force", "fail")
    assert all(1 <= len(part.data) <= 32 for part in firmware.records)


@given(st.integers(0, len(EXAMPLE) - 1), st.sampled_from("0123456789ABCDEFXS \n"))
def test_any_changed_character_is_found(place: int, letter: str) -> None:
    """One wrong character of a record never passes for another image."""
    text = f"{HEADER}\n{EXAMPLE[:place]}{letter}{EXAMPLE[place + 1 :]}\n{END}\n"
    firmware = parse("x", text.encode())
    assert worst(firmware) == "fail" or memory(firmware) == dict(enumerate(DATA, 0x2000))


def test_a_record_that_turned_into_a_header() -> None:
    """The type digit is not in the checksum: S0 behind data is data that got lost."""
    lines = list(GOOD)
    lines[2] = "S0" + lines[2][2:]
    firmware = load(*lines)
    assert verdict(firmware).get("types") in ("fail", "force")
    assert "line 3" in evidence(firmware, "types") and firmware.header == "BarrettHand v4.33"
