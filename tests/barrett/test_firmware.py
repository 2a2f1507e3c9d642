"""Loading firmware into the simulated hand on virtual time: the whole procedure and every way it can fail (barrett §3.7)."""

from __future__ import annotations

from typing import Any

import pytest

from handctl.devices.barrett.firmware.download import ON, Loader, version_in
from handctl.devices.barrett.firmware.srecords import Firmware, parse
from handctl.errors import NoAnswer
from handctl.link import Deadline
from handctl.model.prompts import Prompts
from tests.barrett.download import DATA, SIZE, Operated, Operator, Run, firmware, sha
from tests.barrett.srecords import END, record
from tests.barrett.support import Simulated, codes, hand_on
from tests.support.each_row import each_row


def stream(file: Firmware) -> bytes:
    """All bytes of a download behind X and `:` (7.2)."""
    parts = [bytes([255, r.address & 255, r.address >> 8, len(r.data), 255]) + r.data for r in file.records]
    return b"".join([b"\xff", *parts])


# -- the whole procedure ----------------------------------------------------------------------------------------------


@each_row("window", [1, 2, 4])
@each_row("query", ["", "echo-triggers=1", "wire=auto", "image=blank", "download-end=power", "firmware=4.4"])
def test_the_image_is_that_of_the_file(window: int, query: str) -> None:
    run = Run(query, window=window)
    assert run.error is None
    assert "image valid" in run.image and sha(DATA) in run.image and f"{SIZE} bytes" in run.image
    rows = run.rows
    assert (rows["file"], rows["bytes"], rows["image_sha256"]) == ("fw.s19", SIZE, sha(DATA))
    version = "4.4" if "4.4" in query else "4.33"
    assert version in rows["firmware"]
    assert (version in (rows["version_before"] or "")) is ("blank" not in query)
    assert (rows["serial_number"], rows["baud_rate"]) == (1042, 96)
    assert [rows[f"status.{motor}"] for motor in ("F1", "F2", "F3", "SPREAD")] == [4] * 4
    assert "init" in codes(run.hand) and "handctl barrett init" in run.hand.journal.messages[-1].text


def test_the_bytes_and_their_order() -> None:
    """X, then nothing until `:`, FF, records; the first one's triggers alone (7.2, 7.3)."""
    run = Run(file=firmware(bytes.fromhex("11 22 33 44 55 66 FF 00"), start=0x2000))
    sent = run.link.sent
    start = sent.index(b"X")
    stream = b"".join(sent[start:])
    assert stream.startswith(bytes.fromhex("58 FF FF 00 20 08 FF 11 22 33 44 55 66 FF 00"))
    assert sent[start : start + 5] == [b"X", b"\xff", b"\xff", b"\x00", b"\x20"]
    assert sha(bytes.fromhex("11 22 33 44 55 66 FF 00")) in run.image


def test_a_file_with_gaps_and_long_records(tmp_path: Any) -> None:
    lines = [record(0x3000, DATA), record(0x2000, b"\x01\x02"), record(0x4000, b"\xff" * 40)]
    run = Run(file=parse("x", "\n".join([*lines, END]).encode()), window=4)
    assert run.error is None and "ranges 2000-2001 3000-30C7 4000-4027" in run.image.replace(",", "")
    line = run.link.inner._line  # type: ignore[attr-defined]
    line.command(f"save-image {tmp_path / 'image'}")
    flat = b"\x01\x02".ljust(0x1000, b"\xff") + DATA.ljust(0x1000, b"\xff") + b"\xff" * 40
    assert (tmp_path / "image").read_bytes() == flat


def test_at_another_speed() -> None:
    """The monitor is 9600 only; a hand whose saved speed is 38400 is found again afterwards."""
    link = Simulated("baud=38400&wire=auto", 38400)
    run = Run(link=link)
    assert run.error is None and run.rows["baud_rate"] == 384
    assert sha(DATA) in run.image


def test_time_of_a_download_is_its_floor() -> None:
    """Window 1 at 9600: 2 + 2 (3 + n) characters a record, within 5 %; window 2 needs little more than half."""
    large = firmware(bytes(2048))
    seconds = []
    for window in (1, 2):
        prompts = Operator()
        prompts.moving = False
        run = Run("wire=auto", file=large, window=window, prompts=prompts)
        assert run.error is None
        (told,) = [text for text in prompts.said if "sent and echoed" in text]
        seconds.append(float(told.split()[-2]))
    assert seconds[0] == pytest.approx(large.seconds, rel=0.05)
    assert 0.5 * large.seconds < seconds[1] < 0.62 * large.seconds
    assert "slow-adapter" not in codes(run.hand)


@pytest.mark.parametrize("moving", [True, False])
def test_progress(moving: bool) -> None:
    """A bar on a terminal, a line every 10 % elsewhere."""
    prompts = Operator()
    prompts.moving = moving
    run = Run("wire=auto", file=firmware(bytes(1024)), prompts=prompts)
    assert run.error is None
    bars = [text for text in prompts.shown if text.startswith("[")]
    lines = [text for text in prompts.said if "%" in text]
    if moving:
        assert len(bars) == 32 and not lines
        assert "[#####.....]" in bars[15] and "512 of 1024 bytes" in bars[15]
        assert "bytes/s" in bars[15] and "s left" in bars[15]
    else:
        assert not bars and 9 <= len(lines) <= 11 and "1024 of 1024 bytes" in lines[-1]


def test_a_slow_adapter_is_told_after_the_first_record() -> None:
    run = Run("wire=auto&turnaround=0.016")
    (message,) = [m for m in run.hand.journal.messages if m.code == "slow-adapter"]
    assert run.error is None and "16 ms" in message.text and "doctor" in str(message.hint)


# -- the operator -----------------------------------------------------------------------------------------------------


def test_the_operator_is_guided() -> None:
    link = Operated("wire=auto")
    prompts = Operator(link)
    run = Run(link=link, prompts=prompts)
    assert run.error is None and sha(DATA) in run.image
    off, on = prompts.said[1], prompts.said[2]  # the first line says what is being looked for
    assert "OFF" in off and "5 seconds" in off and "Do not pull any cable" in off
    assert "ON" in on


def test_a_hand_that_was_not_switched_off() -> None:
    """It still answers: X comes back, and the operator is asked again."""
    link = Operated()
    prompts = Operator(link)
    times = []

    def lazy(text: str) -> bool:
        times.append(text)
        if len(times) > 1:
            Operator.wait_for_enter(prompts, text)
        return True

    prompts.wait_for_enter = lazy  # type: ignore[method-assign]
    run = Run(link=link, prompts=prompts)
    assert run.error is None and sha(DATA) in run.image
    assert len(times) == 2 and any("power is on" in text for text in prompts.said)


def test_the_moment_was_missed() -> None:
    """The old firmware's banner came instead of `:` (7.3, step 5): said, and waited for the next switching."""
    link = Operated("window=0.5&boot=0.6&switch=200,206")
    prompts = Operator(link)
    ready = link.inner.read

    def deaf(deadline: Deadline, size: int = 4096) -> bytes:
        data = ready(deadline, size)
        return data.replace(b":", b"") if 5 < link.now() < 100 else data

    link.inner.read = deaf  # type: ignore[method-assign]
    run = Run(link=link, prompts=prompts)
    assert any("too late" in text for text in prompts.said)
    assert run.error is not None and run.failed[:2] == ("no-monitor", 4)
    assert "Nothing was loaded" in str(run.error.hint) and "image valid" in run.image


def test_a_monitor_that_invites_twice_is_one() -> None:
    link = Operated()
    inner, invited = link.inner.read, list[bytes]()

    def twice(deadline: Deadline, size: int = 4096) -> bytes:
        data = inner(deadline, size)
        if data != b":" or invited:
            return data
        invited.append(data)
        return b"::"

    link.inner.read = twice  # type: ignore[method-assign]
    run = Run(link=link, prompts=Operator(link))
    assert run.error is None and sha(DATA) in run.image and invited


def test_a_second_switching_after_the_missed_moment() -> None:
    link = Operated("window=0.5&boot=0.6&switch=40,46")
    prompts = Operator(link)
    inner = link.inner.read

    def deaf(deadline: Deadline, size: int = 4096) -> bytes:
        data = inner(deadline, size)
        return data.replace(b":", b"") if link.now() < 30 else data

    link.inner.read = deaf  # type: ignore[method-assign]
    run = Run(link=link, prompts=prompts)
    assert any("too late" in text for text in prompts.said)
    assert run.error is None and sha(DATA) in run.image


def test_nobody_switches() -> None:
    link = Operated()
    prompts = Operator(link)
    prompts.ready = False
    run = Run(link=link, prompts=prompts)
    assert run.failed[:2] == ("no-monitor", 4) and "Nothing was loaded" in str(run.error and run.error.hint)
    assert 120 <= link.now() < 140
    assert b"".join(link.sent).count(b"\xff") == 0, "no trigger without `:`"


def test_a_colon_in_a_text_is_not_the_monitor() -> None:
    """`:` behind a letter belongs to a text (the invented `download` text has one)."""
    link = Operated("image=blank")
    prompts = Operator(link)
    prompts.ready = False
    inner = link.inner.read
    texts = iter([b"\n\rPlease note:", b" version: 1\n\r", b"x", b": 2"])

    def chatty(deadline: Deadline, size: int = 4096) -> bytes:
        asked = any("ON. The download" in text for text in prompts.said)
        return (next(texts, b"") if asked else b"") or inner(deadline, size)

    link.inner.read = chatty  # type: ignore[method-assign]
    run = Run(link=link, prompts=prompts)
    assert run.failed[0] == "no-monitor" and next(texts, None) is None
    assert b"\xff" not in b"".join(link.sent)


def test_again_after_a_failure_when_the_operator_wants_it() -> None:
    link = Operated("fault=wrong-echo&download-at=0x2C40")
    prompts = Operator(link, answers=1)
    original = prompts.ask

    def ask(question: str, word: str) -> bool:
        link.control("download-at off")
        link.control("fault healthy")
        return original(question, word)

    prompts.ask = ask  # type: ignore[method-assign]
    run = Run(link=link, prompts=prompts)
    assert run.error is None and sha(DATA) in run.image
    assert len(prompts.asked) == 1 and "2C40h" in prompts.asked[0]


# -- faults at every kind of place ------------------------------------------------------------------------------------

FAULTS = {"wrong-echo": (5, "wrong-echo"), "missing-echo": (4, "no-echo"), "extra-byte": (5, "extra-byte"),
          "monitor-hang": (4, "no-echo")}  # fmt: skip
PLACES = {
    "+1": "address low byte of the record at 2C00h",
    "+2": "address high byte of the record at 2C00h",
    "+3": "count byte of the record at 2C00h",
    "0x2C00": "2C00h",
    "0x2C1F": "2C1Fh",
    "+36": "address low byte of the record at 2C20h",
    "+38": "count byte of the record at 2C20h",
    "0x2C40": "2C40h",
    "0x2CC7": "2CC7h",
}


@each_row("place", PLACES)
@each_row("fault", FAULTS)
def test_a_fault_at_every_kind_of_place(fault: str, place: str) -> None:
    """It stops at once and names the address; the hand is not called loaded."""
    run = Run(f"fault={fault}&download-at={place}&image-records=7")
    if fault == "extra-byte" and place == "0x2CC7":
        # Behind the very last echo nothing is awaited any more: the image is whole.
        assert run.error is None or run.failed[1] == 5
        return
    code, exit_code, text = run.failed
    assert (exit_code, code) == FAULTS[fault], text
    named = PLACES[place]
    if fault == "extra-byte":  # it lies behind the echo of that byte: the next place may be named
        assert "2C" in text or "came" in text
    else:
        assert named in text, text
    untouched = place in ("+1", "+2", "+3")  # address and count of the first record: no data byte has gone out
    left = "the firmware has not changed" if untouched else "whole file again"
    assert run.error is not None and left in str(run.error.hint)
    assert ("incomplete" in str(run.error.hint)) is not untouched
    assert run.done is None and (sha(DATA) not in run.image or place == "0x2CC7")
    before = run.link.sent[: run.link.sent.index(b"\xff")]
    assert before.count(b"X") == 1
    assert stream(run.file).startswith(b"".join(run.link.sent[len(before) :])), "nothing but the download"


@each_row("window", [2, 4])
@each_row("fault", FAULTS)
def test_a_fault_with_a_window(fault: str, window: int) -> None:
    run = Run(f"fault={fault}&download-at=0x2C45", window=window)
    code, exit_code, text = run.failed
    if fault == "missing-echo":
        assert exit_code in (4, 5)  # the next echo may be taken for it: it differs
        assert "2C45h" in text
    elif fault == "extra-byte":
        assert exit_code == 5 and ("2C45h" in text or "2C46h" in text)
    else:
        assert (exit_code, code) == FAULTS[fault], text
    if fault == "wrong-echo":
        assert "2C45h" in text and f"sent {DATA[0x45]:02X}, received {DATA[0x45] ^ 0x40:02X}" in text
        assert run.error is not None and "Leave --window out" in str(run.error.hint)


def test_silence_never_passes_for_an_echo_of_00() -> None:
    """A defect of the reference (7.5): a read that timed out gave 00."""
    run = Run("fault=monitor-hang&download-at=0x2C10", file=firmware(bytes(64)))
    assert run.failed[:2] == ("no-echo", 4) and "2C10h" in run.failed[2]


def test_a_silent_monitor() -> None:
    run = Run("fault=monitor-hang&download-at=%2B1")
    assert run.failed[1] == 4


def test_after_a_failure_the_next_download_heals() -> None:
    link = Simulated("fault=wrong-echo&download-at=0x2C40")
    assert Run(link=link).failed[0] == "wrong-echo"
    link.inner._line.command("download-at off")  # type: ignore[attr-defined]
    link.inner._line.command("fault healthy")  # type: ignore[attr-defined]
    again = Run(link=link)
    assert again.error is None and sha(DATA) in again.image and "image valid" in again.image
    assert again.rows["version_before"] is None


# -- Ctrl-C -----------------------------------------------------------------------------------------------------------


def test_the_first_ctrl_c_asks_and_goes_on() -> None:
    prompts = Operator()
    prompts.press_at = {6: 1}
    run = Run("wire=auto", prompts=prompts)
    assert run.error is None and sha(DATA) in run.image
    assert len([text for text in prompts.instructed if "Press Ctrl-C again" in text]) == 1, "with -q, too"


def test_what_a_person_does_next_is_said_with_q_too() -> None:
    """Else the supply stays off, and whoever sees nothing of a Ctrl-C presses it again."""
    link = Operated("")
    prompts = Operator(link)
    assert Run(link=link, prompts=prompts).error is None
    assert prompts.instructed == [ON]


def test_the_second_ctrl_c_stops_and_says_where() -> None:
    prompts = Operator()
    prompts.press_at = {4: 1, 6: 2}
    run = Run("wire=auto", file=firmware(bytes(1024)), prompts=prompts)
    _, exit_code, text = run.failed
    assert exit_code == 130 and "2C" in text and "of 1024 bytes" in text
    assert "load the whole file again" in text and "leave it off" in text
    sent = int(text.split(" of 1024")[0].split()[-1])
    assert 0 < sent < 1024 and sent % 32 == 0


# -- afterwards -------------------------------------------------------------------------------------------------------


def test_a_hand_that_is_not_alive_afterwards() -> None:
    """Every byte was echoed, the image is not whole (two records more are needed)."""
    run = Run("image-records=99")
    code, exit_code, text = run.failed
    assert (code, exit_code in (4, 5)) == ("not-alive", True)
    assert "every byte was echoed" in text and "handctl barrett version" in str(run.error and run.error.hint)


@pytest.mark.parametrize("end", ["reset", "quiet", "power"])
def test_every_way_a_download_may_end(end: str) -> None:
    run = Run(f"download-end={end}&download-version=4.40")
    assert run.error is None and "4.40" in run.rows["firmware"]


def test_the_operator_cycles_once_more() -> None:
    link = Operated("download-end=power")
    prompts = Operator(link)
    run = Run(link=link, prompts=prompts)
    assert run.error is None and sha(DATA) in run.image
    assert any("No firmware has replied yet" in text for text in prompts.said)


@each_row(
    ("name", "header", "expect", "version", "code", "warned"),
    [
        ("fw.s19", "x", "4.34", "4.34", None, False),
        ("fw.s19", "x", "4.34", "4.33", "version", False),
        ("BarrettHand v4_34.S19", "x", None, "4.33", None, True),
        ("BarrettHand v4_34.S19", "x", None, "4.34", None, False),
        ("fw.s19", "Version 4.34", None, "4.33", None, True),
        ("v4_33.S19", "x", "4.34", "4.34", None, False),
        ("fw.s19", "x", None, "4.34", None, False),
    ],
)
def test_versions(name: str, header: str, expect: str | None, version: str, code: str | None, warned: bool) -> None:
    file = parse(name, "\n".join([record(0, header.encode(), "0"), record(0x2000, DATA[:8]), END]).encode())
    run = Run(f"download-version={version}", file=file, expect=expect)
    assert run.done is not None
    mismatch = run.done.failure
    assert (mismatch.code if mismatch else None) == code
    if mismatch is not None:
        assert mismatch.exit_code == 7 and "4.33" in mismatch.text and "4.34" in mismatch.text
    assert ("version" in codes(run.hand)) is warned


@each_row(
    ("text", "found"),
    [("BarrettHand™ Firmware v4_34.S19", "4.34"), ("4.33", "4.33"), ("v4.4x", "4.4"), ("fw", None), ("7", None)],
)
def test_version_in(text: str, found: str | None) -> None:
    assert version_in(text) == found


def test_a_lost_link() -> None:
    run = Run("fault=disconnect&after=60")
    assert run.failed[1] == 3
    assert any(word in f"{run.failed[2]} {run.error and run.error.hint}" for word in ("2C", "whole file"))


def test_the_deadline() -> None:
    """It bounds the wait for the power switch; a download that has begun is finished, half of one is none."""
    link = Simulated("wire=auto")
    run = Run(link=link, file=firmware(bytes(4096)), bound=Deadline(link.now, 6.0))
    assert run.error is None and link.now() > 6.0


# -- the old firmware, and a hand that restarts -------------------------------------------------------------------------


@each_row("boot", ["0.1", "1", "5"])
def test_a_colon_with_the_banner_behind_it_is_no_invitation(boot: str) -> None:
    """`:` and banner in one chunk: the firmware runs. No FF goes to its interpreter, and nothing is called incomplete."""
    run = Run(f"boot-chunk=together&boot={boot}")
    code, exit_code, text = run.failed
    assert (code, exit_code) == ("no-monitor", 4), text
    assert not [data for data in run.link.sent if b"\xff" in data]
    assert run.image.startswith("image valid")
    assert run.error is not None
    assert run.error.code == "no-monitor" and "incomplete" not in run.error.hint


class Failing(Simulated):
    """Its supply fails for a moment when data byte number `at` is about to go out."""

    at = 0

    def write(self, data: bytes, deadline: Deadline) -> None:
        if len(self.sent) == self.at:
            self.inner._line.command("power-cycle")  # type: ignore[attr-defined]
        super().write(data, deadline)


@each_row("at", [30, 60])
def test_a_restart_in_the_middle_of_a_download_is_named(at: int) -> None:
    link = Failing("image-records=7")
    link.at = at
    run = Run(link=link)
    code, exit_code, text = run.failed
    assert (code, exit_code) == ("restarted", 5), text
    assert "received 3A" in text and text.endswith("the hand restarted because of its power or its cable")
    assert run.error is not None and "incomplete" in run.error.hint


def test_the_deadline_is_the_time_that_is_told() -> None:
    link = Simulated("boot-chunk=together")
    hand = hand_on(link, bound=link.deadline(40.0))
    with pytest.raises(NoAnswer) as caught:
        Loader(hand, Prompts(), firmware(), window=1, expect=None).run()
    assert "(--deadline)" in caught.value.text and "120" not in caught.value.text
    within = float(caught.value.text.partition("within ")[2].split()[0])
    assert 30 < within <= 40
