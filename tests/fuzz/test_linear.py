"""What a device sends without end, and a transcript of any length, costs as much as it is long: calls are counted, not seconds.

Each case is work over so many pieces. Twice as many may cost twice the calls and a little; of their square four times.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from handctl.devices.barrett.gcl import codec
from handctl.devices.ekso import frames
from handctl.devices.inspire import eb90, modbus_frames
from handctl.errors import ProtocolError
from tests.inspire.scanning import scan_on
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.scripted import Babble, calls_of

PIECES = 120


def growth(work: Callable[[int], object]) -> float:
    """How many times the calls twice as many pieces cost."""
    work(1)  # what is imported or compiled at the first use
    return calls_of(lambda: work(2 * PIECES)) / calls_of(lambda: work(PIECES))


Decoder = eb90.Decoder | codec.Decoder | frames.Decoder | modbus_frames.RtuDecoder | modbus_frames.TcpDecoder


def fed(decoder: Decoder, piece: bytes, count: int) -> None:
    for _ in range(count):
        decoder.feed(piece)
        while True:
            try:
                if decoder.next() is None or isinstance(decoder, codec.Decoder):  # an answer stays where it is
                    break
            except ProtocolError:
                continue


ALL_IDS = [eb90.read_reply_prefix(i, 1000, 2) for i in range(1, 255)]


@each_row("piece", [b"\x55" * 64, b"\x90\xeb" * 8, b"\x90\xeb\x01\xff", b"\x90\xeb\x01\x00" * 8, ALL_IDS[0]], ids=repr)
@each_row("prefixes", [ALL_IDS, [], [eb90.DEVICE]], ids=["all ids", "any", "device"])
def test_frames_of_the_inspire_family(piece: bytes, prefixes: list[bytes]) -> None:
    assert growth(lambda count: fed(eb90.Decoder(prefixes), piece, count)) < 2.5


@pytest.mark.parametrize(
    "piece",
    [b"\x55" * 64, b"\x01\x03" * 16, b"\x01\x03\x0c" * 16, b"\x01" * 64, b"\0\1\0\0\0\x0f\xff\x03" * 8],
    ids=repr,
)
@pytest.mark.parametrize("wire", ["rtu", "tcp"])
def test_answers_of_modbus(wire: str, piece: bytes) -> None:
    def made() -> modbus_frames.RtuDecoder | modbus_frames.TcpDecoder:
        return (
            modbus_frames.TcpDecoder()
            if wire == "tcp"
            else modbus_frames.RtuDecoder(1, modbus_frames.read_request(1546, 6))
        )

    assert growth(lambda count: fed(made(), piece, count)) < 2.5


def test_a_scan_looks_for_254_ids_at_the_cost_of_one() -> None:
    """Noise that begins no answer is passed over by one search, not by one an id."""
    for prefixes in (ALL_IDS[:1], ALL_IDS):
        eb90.Decoder(prefixes)  # it keeps what it makes of them, so whoever comes first counts more calls
    one, all_ids = (
        calls_of(lambda p=prefixes: fed(eb90.Decoder(p), b"\x55" * 64, 100))
        for prefixes in (ALL_IDS[:1], ALL_IDS)  # type: ignore[misc]
    )
    assert all_ids == one


def test_a_scan_of_a_line_that_floods() -> None:
    link = Babble(baud=115200)
    link.pause = 0.0005  # still eleven times what the line could carry
    assert calls_of(lambda: scan_on(link, ids=[1, 2])) < 50 * link._reads


@each_row("command", ["", "P", "FGET P"])
@each_row("piece", [b"\x55", b"P", b" ", b"=>", b"x=> P\n", b"\n\rP\n\r", b"\0P\n=>"], ids=repr)
def test_answers_of_the_barretthand(command: str, piece: bytes) -> None:
    assert growth(lambda count: fed(codec.Decoder(command), piece, count)) < 2.5


@each_row("piece", [b"[" * 64, b"\x01" * 4, b"\x10\x05"], ids=repr)
def test_frames_of_the_eksonr(piece: bytes) -> None:
    assert growth(lambda count: fed(frames.Decoder(), piece, count)) < 2.5


def test_text_is_no_answer_of_the_eksonr_at_the_cost_of_one_search() -> None:
    assert calls_of(lambda: frames.sign(b"[" * 100_000)) < 50


EQUAL = {
    "barrett": ("> 50 0D", ("< 50", "< 4C 4F 4F 50", "< 20", "> 50 0D")),
    "exo": ("< 90 EB 01 10", ("< EB 90 01 04", "< 55", "< 90 EB 01 10", "> EB 90 01 04 11 E8 03 0A 0B")),
    "ekso": ("> 01", ("< 55", "< 01")),
    "aidin": ("< 7B", ("< 22", "< 7B 7D", "< 2C")),
}
"""Family -> the first line of a transcript, and lines of which the rest is made."""


@each_row(("family", "line"), [(family, line) for family, (_, lines) in EQUAL.items() for line in lines])
def test_transcripts_of_equal_lines_are_compared(family: str, line: str, tmp_path: Path) -> None:
    def compared(count: int) -> None:
        path = tmp_path / f"{count}.txt"
        path.write_text(EQUAL[family][0] + "\n" + f"{line}\n" * count)
        assert run("trace", "diff", path, path, "--family", family).code == 0

    assert growth(compared) < 2.5
