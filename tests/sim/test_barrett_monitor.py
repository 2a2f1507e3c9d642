"""The boot monitor of the simulated BarrettHand, byte for byte, on virtual time. Sections: barrett manual."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

from tests.sim.barrett_bench import PROMPT, Bench, ready
from tests.support.each_row import each_row

BANNER = "\n\rBarrettHand Firmware\n\rVersion 4.33\n\r=> "
TEXT = "\n\rNo firmware: please download\n\r:"
RECORD = bytes.fromhex("11 22 33 44 55 66 FF 00")  # S10B2000112233445566FF0070


def say(bench: Bench, sent: str) -> str:
    """Writes bytes in hex; what comes at once, in hex."""
    bench.line.feed(bytes.fromhex(sent))
    return bench.line.take().hex(" ").upper()


def cycled(**options: object) -> Bench:
    """The switch was off for 5 s and is on again; the ':' has come. One record makes an image, unless it is said otherwise."""
    bench = ready(**{"image_records": 1, **options})
    bench.control("power off")
    bench.wait(5.0)
    assert say(bench, "58") == ""
    bench.control("power on")
    assert bench.wait(0.0) == ":"
    return bench


def send_record(bench: Bench, address: int, data: bytes) -> str:
    """One record, byte by byte, until an echo is wrong; "" or which byte had which echo."""
    head = bytes([address % 256, address // 256, len(data)])
    for part in (head, data):
        assert say(bench, "FF") == ""
        for number, byte in enumerate(part):
            echo = say(bench, f"{byte:02X}")
            if echo != f"{byte:02X}":
                return f"{'data' if part is data else 'head'} {number}: {echo}"
    return ""


def downloaded(*records: tuple[int, bytes], **options: object) -> Bench:
    bench = cycled(**options)
    assert say(bench, "FF") == ""
    for address, data in records or ((0x2000, RECORD),):
        assert send_record(bench, address, data) == ""
    return bench


def image(bench: Bench) -> str:
    return bench.control("image")


# -- the procedure --------------------------------------------------------------------------------------------------------------


def test_the_transcript() -> None:
    """§3.7 and the vendor's downloader: X while the power is off, ':', FF, then the record."""
    bench = ready(image_records=1)
    bench.control("power off")
    assert say(bench, "58") == ""
    bench.control("power on")
    assert bench.wait(0.0) == ":"
    echoes = [say(bench, byte) for byte in (*["FF", "FF", "00", "20", "08", "FF"], *RECORD.hex(" ").split())]
    assert echoes == ["", "", "00", "20", "08", "", "11", "22", "33", "44", "55", "66", "FF", "00"]
    assert image(bench) == (
        "image valid, version 4.33, 1 records, 8 bytes, ranges 2000-2007,"
        " sha256 55d6c6aa27b8a45c1cce49ef12efdfc2925f89e5684bd00c1bb6ec4e11d8f460"
    )


def test_bytes_sent_ahead_come_back_in_order() -> None:
    bench = cycled()
    assert say(bench, "FF FF 00 20 08 FF 11 22 33 44 55 66 FF 00") == "00 20 08 11 22 33 44 55 66 FF 00"


def test_triggers_with_an_echo() -> None:
    bench = cycled(echo_triggers=1)
    assert say(bench, "FF FF 00 20 01 FF AA FF") == "FF FF 00 20 01 FF AA FF"


def test_without_an_answer_the_firmware_starts() -> None:
    bench = cycled()
    assert bench.line.device.speed == 9600
    assert bench.send("X\r\x03=") == ""  # all but FF is ignored
    assert bench.wait(0.999) == ""
    assert bench.wait(0.002) == BANNER
    assert bench.get("S") == ["4 4 4 4"]


@each_row(
    ("options", "banner"),
    [({"boot": 0}, 0.0), ({"boot": 3}, 3.0), ({"boot": 3, "window": 1}, 3.0), ({"boot": 1, "window": 4}, 4.0)],
)
def test_window(options: dict[str, float], banner: float) -> None:
    bench = ready(**options)
    bench.control("power-cycle")
    text = bench.run()
    assert (text, bench.now) == (":" + BANNER, banner)


def test_too_late_for_the_window() -> None:
    """The firmware is on its way and deaf."""
    bench = cycled(window=0.5)
    bench.wait(0.6)
    assert say(bench, "FF FF 00 20") == ""
    assert bench.run() == BANNER


def test_blank_ram() -> None:
    """§8: the hand prompts for a download (text invented) and stays there."""
    bench = cycled(image="blank")
    assert image(bench).startswith("image blank, version 4.33, 0 records, 0 bytes, ranges none,")
    assert bench.run() == TEXT
    assert bench.now == 6.0
    bench.wait(100.0)
    assert bench.send("\r\x03VERS\r") == ""
    assert say(bench, "FF") == ""
    assert send_record(bench, 0x2000, RECORD) == ""
    assert image(bench).startswith("image valid, ")


def test_blank_hand_that_has_been_on_for_long() -> None:
    bench = Bench(image="blank", baud=38400)
    assert bench.run() == ""
    assert bench.line.device.speed == 9600
    assert say(bench, "FF FF 00 20 01 FF AA") == "00 20 01 AA"


def test_a_stray_trigger_harms_no_firmware() -> None:
    """RAM changes with the first data byte, our guess."""
    bench = cycled()
    assert say(bench, "FF FF 00 20 01 FF") == "00 20 01"
    bench.wait(3600.0)
    bench.control("power-cycle")
    assert bench.run() == ":" + BANNER
    bench.control("power-cycle")
    bench.wait(0.0)
    assert say(bench, "FF FF 00 20 02 FF 0D") == "00 20 02 0D"
    bench.control("power-cycle")
    assert bench.run() == ":" + TEXT


def test_reset_and_the_monitor() -> None:
    bench = ready()
    assert bench.send("RESET\r") + bench.run() == "RESET" + BANNER
    bench = ready(reset_monitor=1)
    assert bench.send("RESET\r") == "RESET:"
    assert say(bench, "FF FF 00 20") == "00 20"
    bench = ready(reset_monitor=1)
    assert bench.send("RESET\r") + bench.run() == "RESET:" + BANNER


# -- the end of a download --------------------------------------------------------------------------------------------------------


def test_reset_starts_what_was_downloaded() -> None:
    bench = downloaded()
    bench.wait(100.0)
    assert bench.send("\r") == "\r"
    assert bench.send("RESET\r") == "RESET\r"
    assert bench.run() == BANNER
    assert bench.now == 106.0
    assert bench.get("S P") == ["4 4 4 4", "0 0 0 0"]
    assert bench.ask("GM 5") == ["ERR 4"]


def test_lower_case_and_several_tries() -> None:
    bench = downloaded()
    assert bench.send("RES\rRESET\r") + bench.run() == "RES\rRESET\r" + BANNER
    bench = downloaded()
    assert bench.send("reset\r") + bench.run() == "reset\r" + BANNER


@each_row("end", ["power", "quiet"])
def test_reset_need_not_end_it(end: str) -> None:
    bench = downloaded(download_end=end, download_quiet=60)
    assert bench.send("\rRESET\r") == ""
    bench.wait(59.0)
    assert bench.heard() == ""
    bench.control("power-cycle")
    assert bench.run() == ":" + BANNER


@each_row(
    ("end", "last", "words"),
    [
        ("reset", "", "incomplete"),
        ("reset", "\r", "incomplete"),
        ("reset", "!\0\r", "incomplete"),
        ("reset", "RESET\r", "valid"),
        ("quiet", "", "incomplete"),
        ("power", "", "valid"),
    ],
)
def test_an_image_is_whole_once_the_download_is_ended(end: str, last: str, words: str) -> None:
    """A client that dies between two records leaves no firmware, and neither does one that comes later and asks."""
    bench = downloaded((0x2000, b"\x01"), (0x2001, b"\x02"), download_end=end, download_quiet=60, image_records=0)
    assert image(bench).startswith("image incomplete, ")
    bench.send(last)
    bench.control("power off")
    assert image(bench).split(",")[0] == f"image {words}"
    bench.control("power on")
    assert bench.run() == ":" + (BANNER if words == "valid" else TEXT)


def test_silence_ends_it() -> None:
    bench = downloaded(download_end="quiet", download_quiet=1.5, image_records=0)
    bench.wait(1.4)
    assert send_record(bench, 0x3000, b"\x01") == ""
    assert bench.wait(1.49) == ""
    assert bench.run() == BANNER
    assert bench.now == pytest.approx(5.0 + 1.4 + 1.5 + 1.0)


def test_version_after_a_download() -> None:
    bench = ready(download_version="4.34", texts="prose")
    assert bench.ask("VERS") == ["BarrettHand Firmware 4.33"]
    bench = downloaded(download_version="4.34")
    bench.control("power-cycle")
    assert bench.run() == ":\n\rBarrettHand Firmware\n\rVersion 4.34\n\r=> "
    assert bench.ask("VERS") == ["4.34"]


def test_parameters_are_in_eeprom_and_survive() -> None:
    bench = ready(image_records=1)
    bench.ask("1FSET DP 1234")
    bench.ask("FSAVE")
    bench.ask("PSET OTEMP 650")
    bench.ask("PSAVE")
    bench.control("power-cycle")
    bench.wait(0.0)
    say(bench, "FF")
    assert send_record(bench, 0, bytes(16)) == ""
    bench.control("power-cycle")
    bench.run()
    assert bench.get("DP", "1") == ["1234"]
    assert bench.ask("PGET OTEMP") == ["650"]


# -- the image ----------------------------------------------------------------------------------------------------------------------


def test_ranges_hash_and_file(tmp_path: Path) -> None:
    """Gaps are FF; the last address wraps; a later record wins; records run together."""
    bench = downloaded((0x2002, b"\x03\x04"), (0x2000, b"\x01\x02"), (0x2006, b"\x07"), (0x2003, b"\x44"))
    flat = bytes.fromhex("01 02 03 44 FF FF 07")
    assert image(bench) == (
        "image valid, version 4.33, 4 records, 5 bytes, ranges 2000-2003 2006-2006,"
        f" sha256 {hashlib.sha256(flat).hexdigest()}"
    )
    path = tmp_path / "image.bin"
    assert bench.control(f"save-image {path}") == image(bench)
    assert path.read_bytes() == flat
    wrapped = downloaded((0xFFFF, b"\x01\x02"))
    assert "ranges 0000-0000 FFFF-FFFF" in image(wrapped)


def test_a_count_of_0_is_256() -> None:
    bench = cycled()
    assert say(bench, "FF FF 00 20 00 FF") == "00 20 00"
    assert say(bench, "AA " * 256) == ("AA " * 256).strip()
    assert "1 records, 256 bytes, ranges 2000-20FF" in image(bench)


@each_row(
    ("sent", "words"),
    [
        ("", "valid"),
        ("FF", "valid"),
        ("FF FF 00 20 02 FF", "valid"),
        ("FF FF 00 20 02 FF AA", "partial"),
        ("FF FF 00 20 02 FF AA BB", "valid"),
        ("FF FF 00 20 02 FF AA BB FF 02 20 01 FF", "valid"),
        ("FF FF 00 20 02 FF AA BB FF 02 20 02 FF CC", "partial"),
    ],
)
def test_what_an_aborted_download_leaves(sent: str, words: str) -> None:
    """Whole as long as its last record is."""
    bench = cycled()
    say(bench, sent)
    assert image(bench).split(",")[0] == f"image {words}"
    bench.control("power-cycle")
    assert bench.run() == ":" + (BANNER if words == "valid" else TEXT)


def test_a_good_download_after_a_bad_one() -> None:
    bench = cycled()
    say(bench, "FF FF 00 20 02 FF AA")
    bench.control("power-cycle")
    assert bench.wait(0.0) == ":"
    say(bench, "FF")
    assert send_record(bench, 0x2000, RECORD) == ""
    assert image(bench).startswith("image valid, version 4.33, 1 records, 8 bytes,")


def test_image_with_a_known_size() -> None:
    bench = downloaded((0x2000, b"\x01"), image_records=2)
    assert image(bench).startswith("image incomplete, ")
    assert bench.send("RESET\r") + bench.run() == "RESET\r"
    assert send_record(bench, 0x2001, b"\x01") == ""
    assert image(bench).startswith("image valid, ")


def test_state_file(tmp_path: Path) -> None:
    path = tmp_path / "hand.json"
    bench = downloaded(state=path, download_version="9.9")
    before = image(bench)
    bench.line.close()
    again = Bench(state=path)
    assert image(again) == before
    assert again.ask("VERS") == ["9.9"]


def test_killed_in_the_middle_of_a_download(tmp_path: Path) -> None:
    """The state file knows of the download from its first data byte on, without an orderly end."""
    path = tmp_path / "hand.json"
    bench = cycled(state=path)
    say(bench, "FF FF 00 20 02 FF AA")
    assert json.loads(path.read_text())["image"]["partial"] is True
    again = Bench(state=path)
    assert not image(again).startswith("image valid")
    assert again.line.device.speed == 9600
    assert again.send("\r") + again.run() == ""
    fresh = Bench(state=path, power_cycle=1)
    assert fresh.run() == ":" + TEXT


def test_state_file_is_kept_up_to_date(tmp_path: Path) -> None:
    """Each 64 records: a file of thousands is not written anew for each."""
    path = tmp_path / "hand.json"
    bench = downloaded(*((2 * number, b"\x01\x02") for number in range(130)), state=path)
    state = json.loads(path.read_text())["image"]
    assert (state["records"], state["partial"]) == (128, True)
    bench.control("power off")
    state = json.loads(path.read_text())["image"]
    assert (state["records"], state["partial"]) == (130, False)


@each_row(
    ("name", "value"),
    [
        ("partial", 2),
        ("records", -1),
        ("version", 4.33),
        ("ranges", [[65535, "0102"]]),
        ("ranges", [[0, "0"]]),
        ("ranges", [["0", "00"]]),
        ("ranges", 7),
    ],
)
def test_damaged_state(tmp_path: Path, name: str, value: object) -> None:
    path = tmp_path / "hand.json"
    ready(state=path).line.close()
    state = json.loads(path.read_text())
    state["image"][name] = value
    path.write_text(json.dumps(state))
    with pytest.raises(ValueError, match="damaged or foreign"):
        Bench(state=path)


# -- power off for long ---------------------------------------------------------------------------------------------------------


def rested(seconds: int, **options: object) -> Bench:
    bench = downloaded((0x2000, bytes(256 - 1)), **options)
    bench.control("power off")
    assert bench.control(f"age {seconds}") == f"age {seconds}"
    bench.control("power on")
    assert bench.wait(0.0) == ":"
    return bench


@each_row(
    ("options", "seconds", "words"),
    [
        ({}, 172800, "valid"),
        ({}, 172801, "valid decayed"),
        ({}, 345600, "valid decayed"),
        ({}, 345601, "blank"),
        ({"decay": "blank"}, 172801, "blank"),
        ({"decay": "errors"}, 999999999, "valid decayed"),
        ({"retention": 10}, 10, "valid"),
        ({"retention": 10}, 11, "valid decayed"),
    ],
)
def test_retention(options: dict[str, object], seconds: int, words: str) -> None:
    """§3.7: two days, then it degrades, in the end it is cleared."""
    bench = rested(seconds, **options)
    assert image(bench).split(",")[0] == f"image {words}"
    assert bench.run() == (TEXT if words == "blank" else BANNER)


def test_time_that_passes_counts_as_well() -> None:
    bench = ready(retention=10, decay="blank")
    bench.control("power off")
    bench.wait(10.5)
    bench.control("power on")
    assert bench.run() == ":" + TEXT


def test_decayed_firmware_behaves_erratically_until_a_download() -> None:
    """§3.7, §8."""
    bench = rested(172801)
    bench.run()
    assert sum(bench.send("VERS\r").endswith("ERR 32" + PROMPT) for _ in range(100)) in range(4, 30)
    known = bytes(255)
    assert hashlib.sha256(known).hexdigest() not in image(bench)
    bench.control("power-cycle")
    bench.wait(0.0)
    say(bench, "FF")
    assert send_record(bench, 0x2000, RECORD) == ""
    bench.send("RESET\r")
    bench.run()
    assert all(bench.ask("VERS") == ["4.33"] for _ in range(100))


def test_erase_and_age() -> None:
    bench = ready()
    bench.control("erase")
    assert bench.ask("VERS") == ["4.33"]  # it still runs
    with pytest.raises(ValueError, match="RAM does not age while the power is on"):
        bench.control("age 5")
    bench.control("power-cycle")
    assert bench.run() == ":" + TEXT


def test_switch_by_the_clock() -> None:
    """For a client in the same process, which has no control socket."""
    bench = ready(switch="2,8")
    assert bench.wait(1.9) == ""
    assert bench.send("\r") == PROMPT
    assert bench.wait(0.2) == ""
    assert bench.send("X\r") == ""
    assert bench.wait(5.8) == ""
    assert bench.wait(0.2) == ":"
    assert bench.run() == BANNER
    assert bench.now == 9.0


# -- faults -----------------------------------------------------------------------------------------------------------------------

# echo number: 1 2 3 low, high, count of the first record, 4 5 its data, 6 7 8 and 9 10 of the second
PLACES = {
    1: "1 head 0",
    2: "1 head 1",
    3: "1 head 2",
    4: "1 data 0",
    5: "1 data 1",
    6: "2 head 0",
    7: "2 head 1",
    8: "2 head 2",
    9: "2 data 0",
    10: "2 data 1",
}


@each_row("number", PLACES)
@each_row("fault", ["wrong-echo", "missing-echo", "extra-byte", "monitor-hang"])
def test_download_faults_at_every_place(fault: str, number: int) -> None:
    data = {1: (0x2000, b"\xa5\x02"), 2: (0x2002, b"\x03\x04")}
    sent = [0x00, 0x20, 0x02, 0xA5, 0x02, 0x02, 0x20, 0x02, 0x03, 0x04][number - 1]
    bench = cycled(fault=fault, download_at=f"+{number}")
    say(bench, "FF")
    got = ""
    for record, (address, content) in data.items():
        got = got or (f"{record} {wrong}" if (wrong := send_record(bench, address, content)) else "")
    echo = {
        "wrong-echo": f"{sent ^ 0x40:02X}",
        "missing-echo": "",
        "extra-byte": f"{sent:02X} {sent ^ 0x55:02X}",
        "monitor-hang": "",
    }[fault]
    assert got == f"{PLACES[number]}: {echo}"
    valid = image(bench).startswith("image valid")
    if fault == "wrong-echo":
        assert not valid
    bench.control("fault none")
    bench.control("power-cycle")
    assert bench.wait(0.0) == ":"
    say(bench, "FF")
    assert send_record(bench, 0x2000, RECORD) == ""
    assert image(bench).startswith("image valid, version 4.33, 1 records, 8 bytes,")


def test_fault_at_an_address() -> None:
    bench = cycled(fault="wrong-echo", download_at="0x2003")
    say(bench, "FF")
    assert send_record(bench, 0x2000, b"\x01\x02") == ""
    assert send_record(bench, 0x2002, b"\x03\x04") == "data 1: 44"
    assert image(bench).startswith("image spoiled, ")
    bench.control("power-cycle")
    bench.wait(0.0)
    bench.control("download-at 2002")
    say(bench, "FF")
    assert send_record(bench, 0x2002, b"\x03\x04") == "data 0: 43"
    bench.control("power-cycle")
    bench.wait(0.0)
    bench.control("download-at +2")
    say(bench, "FF")
    assert send_record(bench, 0x2002, b"\x03\x04") == "head 1: 60"
    bench.control("power-cycle")
    bench.wait(0.0)
    bench.control("download-at off")
    say(bench, "FF")
    assert send_record(bench, 0x2002, b"\x03\x04") == "head 0: 42"


@each_row(
    ("fault", "echo"),
    [
        ("healthy", "A5"),
        ("wrong-echo", "E5"),
        ("missing-echo", ""),
        ("extra-byte", "A5 F0"),
        ("monitor-hang", ""),
        ("silent", ""),
        ("deaf", ""),
        ("bad-checksum", "25"),
        ("truncate", ""),
        ("duplicate", "A5 A5"),
        ("stale", "01 A5"),
        ("echo", "A5 A5"),
        ("refuse", "A5"),
        ("wrong-id", "A5"),
    ],
)
def test_each_byte_is_a_request(fault: str, echo: str) -> None:
    """First trigger, trigger, low, high, count, trigger: 6; the data byte is the 7th."""
    bench = cycled(fault=fault, after=6)
    assert say(bench, "FF FF 00 20 01 FF") == "00 20 01"
    assert (say(bench, "A5") + " " + bench.run().encode("latin-1").hex(" ").upper()).strip() == echo
    assert bench.line.requests == 7
    assert image(bench).split(",")[0] == {"wrong-echo": "image spoiled"}.get(fault, "image valid")


def test_late_and_lost_line() -> None:
    bench = cycled(fault="late", after=6)
    say(bench, "FF FF 00 20 01 FF")
    assert say(bench, "A5") == ""
    assert (bench.wait(0.599), bench.wait(0.001)) == ("", "\xa5")
    bench = cycled(fault="disconnect", after=6)
    say(bench, "FF FF 00 20 01 FF")
    assert say(bench, "A5") == ""
    assert bench.line.hung_up


def test_hanging_monitor_stays_deaf() -> None:
    bench = cycled(fault="monitor-hang", download_at="+2")
    assert say(bench, "FF FF 00") == "00"
    assert say(bench, "20") == ""
    bench.control("fault none")
    assert say(bench, "FF FF 00 20 0D 03") == ""
    bench.control("power-cycle")
    assert bench.run() == ":" + BANNER


def test_wrong_speed() -> None:
    """9600 only: ':' is garbled for a client at 38400, and so is what it sends."""
    bench = ready(baud=38400)
    bench.line.client_baud = 38400
    bench.control("power-cycle")
    assert bench.wait(0.0) not in ("", ":")
    assert say(bench, "FF FF 00 20 01 FF") != "00 20 01"
    bench.line.client_baud = 9600
    bench.control("power-cycle")
    assert bench.wait(0.0) == ":"
    assert say(bench, "FF FF 00 20 01 FF") == "00 20 01"
    bench.control("power-cycle")
    bench.wait(0.0)
    bench.line.client_baud = 38400
    assert bench.run() == BANNER


def test_time_on_the_wire() -> None:
    """One after the other: two byte times each, one for a trigger; the device's own speed is 9600."""
    bench = ready(baud=38400, wire="auto")
    bench.control("power-cycle")
    assert bench.wait(0.0) == ""
    bench.wait(1 / 960)
    start, echoes = bench.now, b""
    for byte in bytes.fromhex("FF FF 00 20 08 FF") + RECORD:
        bench.line.feed(bytes([byte]))
        while (event := bench.line.next_event()) is not None and event < start + 0.9:
            bench.now = event
            bench.line.advance(event)
            echoes += bench.line.take()
    # 14 bytes and 11 echoes, the triggers being data of the next request
    assert bench.now - start == pytest.approx((14 + 11) / 960)
    assert echoes == bytes.fromhex("00 20 08") + RECORD


@each_row(
    ("options", "complaint"),
    [
        ({"download-at": "2G"}, "download-at '2G': use a hex address such as 0x2C40, +N for the N-th echo, or off"),
        ({"download-at": "10000"}, "download-at '10000': use a hex address"),
        ({"download-at": "+"}, "download-at '+': use a hex address"),
        ({"download-at": "-1"}, "download-at '-1': use a hex address"),
        ({"image": "good"}, "option image=good: not one of valid, blank"),
        ({"switch": "1"}, "option switch=1: use ascending seconds"),
        ({"switch": "2,1"}, "option switch=2,1: use ascending seconds"),
        ({"switch": "2,x"}, "option switch=x: not a number of seconds"),
        ({"decay": "slow"}, "option decay=slow: not one of both, errors, blank"),
    ],
)
def test_option_complaints(options: dict[str, str], complaint: str) -> None:
    with pytest.raises(ValueError) as caught:
        Bench(**options)
    assert str(caught.value).startswith(complaint)
