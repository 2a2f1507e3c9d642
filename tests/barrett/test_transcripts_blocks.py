"""The third book of the BarrettHand's other two languages: RealTime blocks and the boot monitor, host and simulator.

`# host blocks …` and `# host download …` are explained at the head of the files.
"""

from __future__ import annotations

import hashlib

import pytest

from handctl.devices.barrett.firmware.srecords import READY, SELECT, TRIGGER, Transfer, parse
from handctl.devices.barrett.realtime.blocks import (
    CONTROL,
    FEEDBACK,
    Decoder,
    Feedback,
    Layout,
    LoopError,
    Selection,
)
from handctl.devices.barrett.realtime.loop_rows import Positions
from handctl.sim import create
from tests.support.each_row import each_row
from tests.support.scripted import hexed
from tests.support.transcripts import FOLDER, Case, Exchange, read_cases

BLOCKS = read_cases(FOLDER / "barrett-realtime.txt")
DOWNLOADS = read_cases(FOLDER / "barrett-download.txt")
CONTROLS, FEEDBACKS = ({flag: name for name, flag in names.items()} for names in (CONTROL, FEEDBACK))


def named(cases: list[Case]) -> list[object]:
    return [pytest.param(case, id=case.name) for case in cases]


def answered(exchange: Exchange) -> bytes:
    return b"".join(data for _, data in exchange.replies)


def test_files_say_what_they_mean() -> None:
    assert (len(BLOCKS), len(DOWNLOADS)) == (9, 4)
    assert len({case.name for case in BLOCKS + DOWNLOADS}) == 13
    for case in BLOCKS + DOWNLOADS:
        assert case.kind == "accept" and {"host", "gives"} <= case.says.keys()
        assert ("sim" in case.says) != ("not" in case.says), case.name


# -- RealTime blocks --------------------------------------------------------------------------------------------------


def layout_of(words: list[str]) -> tuple[Layout, int]:
    """``1:LCV,LFS 4:LFDP LFT2 LFDPC2`` -> the layout and LFDPC."""
    motors, temperature, divisor = {}, 0, 1
    for word in words:
        motor, colon, flags = word.partition(":")
        if colon:
            names = flags.split(",")
            motors[int(motor) - 1] = Selection(
                tuple(CONTROLS[flag] for flag in names if flag in CONTROLS),
                tuple(FEEDBACKS[flag] for flag in names if flag in FEEDBACKS),
            )
        elif word.startswith("LFDPC"):
            divisor = int(word[5:])
        else:
            temperature = int(word.removeprefix("LFT"))
    return Layout(motors, temperature), divisor


def sends(layout: Layout, words: list[str]) -> bytes:
    """The bytes of a block, made by the host where it has something to make."""
    header, *texts = words
    if header in ("C", "c"):
        numbers = iter(map(int, texts))
        values = {index: {name: next(numbers) for name in motor.control} for index, motor in layout.motors.items()}
        return layout.control(values, feedback=header == "C")
    return b"\x03" if header == "^C" else header.encode()


def told(layout: Layout, header: str, data: bytes, pieces: bool) -> str:
    """What the host's decoder makes of an answer."""
    decoder = Decoder(layout)
    decoder.expect(header in ("C", "A"))
    for piece in [bytes([byte]) for byte in data] if pieces else [data]:
        decoder.feed(piece)
        match decoder.next():
            case None:
                continue
            case True:
                return "ack"
            case LoopError(status):
                return f"status {status}" if status else "prompt"
            case Feedback(motors, temperature):
                found = [value for values in motors.values() for value in values.values()]
                return " ".join(map(str, [*found, *([] if temperature is None else [temperature])]))
    raise AssertionError("no answer")


@each_row("pieces", [False, True], ids=["whole", "byte by byte"])
@each_row("case", named(BLOCKS))
def test_host_makes_and_takes_blocks(case: Case, pieces: bool) -> None:
    word, *blocks = [part.split() for part in case.says["host"].split("|")]
    layout, divisor = layout_of(word[1:])
    exchanges = case.exchanges[-len(blocks) :]
    got = []
    for block, exchange in zip(blocks, exchanges, strict=True):
        assert hexed(sends(layout, block)) == hexed(exchange.request)
        got.append(told(layout, block[0], answered(exchange), pieces))
        if got[-1].split()[0] not in ("ack", "prompt", "status"):
            assert layout.feedback_size == len(answered(exchange))
    text, _, positions = case.says["gives"].partition(" position ")
    assert "|".join(got) == text
    if positions:
        wanted, start = positions.split(" from ")
        places = Positions(
            Layout({0: Selection((), ("delta",), delta_divisor=divisor)}), {0: int(start)}, discards=False
        )
        deltas = [Feedback({0: {"delta": int(value)}}, None) for value in got]
        assert [places.update(delta)[0][0] for delta in deltas] == [int(value) for value in wanted.split()]


@each_row("case", named([case for case in BLOCKS if "sim" in case.says]))
def test_simulator_answers_blocks(case: Case) -> None:
    line = create("barrett", dict(item.split("=") for item in case.says["sim"].split("&")))
    now = 0.0
    line.advance(now)
    for exchange in case.exchanges:
        line.feed(exchange.request)
        heard, wanted = line.take(), answered(exchange)
        while len(heard) < len(wanted) and (event := line.next_event()) is not None:
            now = max(now, event)
            line.advance(now)
            heard += line.take()
        assert hexed(heard) == hexed(wanted)


# -- boot monitor -----------------------------------------------------------------------------------------------------


def parts(case: Case) -> tuple[int, bool, list[str]]:
    """Window, whether triggers are echoed, S-records."""
    words, records = case.says["host"].split("|")
    return int(words.split()[1]), "echoed" in words, records.split()


@each_row("case", named(DOWNLOADS))
def test_host_sends_records(case: Case) -> None:
    window, triggers, lines = parts(case)
    firmware = parse("x", "\n".join([*lines, "S9030000FC"]).encode())
    start, download = case.exchanges
    assert (start.request, answered(start)) == (SELECT, READY)
    echoes = answered(download)
    sent = TRIGGER
    if triggers:
        assert echoes[:1] == TRIGGER
        echoes = echoes[1:]
    for record in firmware.records:
        transfer = Transfer(record, window=window, triggers_echo=triggers)
        waiting = 0
        while not transfer.done:
            out = transfer.take()
            sent += out
            waiting += len(out)
            transfer.feed(echoes[:1])
            echoes = echoes[1:]
    assert (hexed(sent), echoes) == (hexed(download.request), b"")
    assert firmware.image_sha256 == case.says["gives"]


@each_row("pieces", [False, True], ids=["whole", "byte by byte"])
@each_row("case", named(DOWNLOADS))
def test_simulator_keeps_the_image(case: Case, pieces: bool) -> None:
    line = create("barrett", dict(item.split("=") for item in case.says["sim"].split("&")))
    line.advance(0.0)
    line.take()
    line.command("power off")
    start, download = case.exchanges
    line.advance(5.0)
    line.feed(start.request)
    line.command("power on")
    line.advance(5.0)
    assert line.take() == answered(start)
    heard = b""
    for piece in [bytes([byte]) for byte in download.request] if pieces else [download.request]:
        line.feed(piece)
        heard += line.take()
    assert hexed(heard) == hexed(answered(download))
    line.feed(b"RESET\r")
    assert f"sha256 {case.says['gives']}" in line.command("image") and "image valid" in line.command("image")


def test_the_vectors_are_the_files() -> None:
    """The hash in the file is that of the data bytes, not of what somebody's code made of them."""
    data = bytes.fromhex("11 22 33 44 55 66 FF 00")
    assert [case.says["gives"] for case in DOWNLOADS] == [
        *[hashlib.sha256(data).hexdigest()] * 3,
        hashlib.sha256(data + b"\xaa\xbb").hexdigest(),
    ]
