"""`handctl barrett firmware check|download` through the command line: verdicts, exit codes, bytes, facts."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest

from tests.barrett.commands import fake
from tests.barrett.srecords import BROKEN, END, EXAMPLE, GOOD, HEADER, record
from tests.support.cli import Result, run, spying
from tests.support.each_row import each_row

DATA = bytes((number * 5 + 1) & 255 for number in range(150))
LINES = (HEADER, *(record(0x2C00 + place, DATA[place : place + 32]) for place in range(0, 150, 32)), END)
CHECKS = ["text", "types", "checksums", "addresses", "overlaps", "count", "end", "data"]


@pytest.fixture
def good(tmp_path: Path) -> Path:
    return write(tmp_path, LINES)


def write(folder: Path, lines: tuple[str, ...], name: str = "good.s19") -> Path:
    file = folder / name
    file.write_bytes(("\n".join(lines) + "\n").encode("latin-1"))
    return file


def check(file: Path, *args: str) -> Result:
    return run("barrett", "firmware", "check", file, *args, "--json")


def load(file: Path, *args: str, port: str | None = None, yes: bool = True, **more: Any) -> Result:
    return run(
        *("barrett", "firmware", "download", file, "-p", port or fake(), *args, "--json"),
        *(["--yes"] if yes else []),
        **more,
    )


# -- check ------------------------------------------------------------------------------------------------------------


def test_a_good_file(tmp_path: Path) -> None:
    file = write(tmp_path, GOOD, "BarrettHand™ v4 33.s19")
    result = check(file)
    assert (result.code, result.err) == (0, "")
    assert [(row["check"], row["status"]) for row in result.rows] == [(name, "ok") for name in CHECKS]
    facts = result.json["firmware"]
    assert facts["sha256"] == hashlib.sha256(file.read_bytes()).hexdigest()
    assert (facts["file"], facts["header"], facts["records"], facts["data_bytes"]) == (
        file.name,
        "BarrettHand v4.33",
        3,
        56,
    )
    assert facts["ranges"] == [[0x2000, 0x2027], [0x3000, 0x300F]]
    table = run("barrett", "firmware", "check", file)
    assert table.code == 0 and "2000-2027" in table.out and facts["sha256"] in table.out


@each_row("name", BROKEN)
def test_broken_files(tmp_path: Path, name: str) -> None:
    """Exit 7, the row of the check is bad, the message names file and reason, every bad row says what to do."""
    lines, which, status, words = BROKEN[name]
    file = write(tmp_path, lines, "bad.s19")
    result = check(file)
    assert result.code == 7, result
    assert {row["check"]: row["status"] for row in result.rows}[which] == ("warning" if status == "force" else "fail")
    assert all(row["remedy"] for row in result.rows if row["status"] != "ok")
    assert result.error["code"] == "firmware-file" and "bad.s19" in result.error["text"]
    if [row["check"] for row in result.rows if row["status"] == "fail"] in ([which], []):
        assert all(word in result.error["text"] for word in words)


def test_force_is_for_a_missing_end_only(tmp_path: Path) -> None:
    file = write(tmp_path, (HEADER, EXAMPLE))
    assert (check(file).code, check(file, "--force").code) == (7, 0)
    assert "--force" in check(file).error["hint"]
    damaged = write(tmp_path, (EXAMPLE[:-2] + "00", END), "damaged.s19")
    assert check(damaged, "--force").code == 7


@pytest.mark.parametrize("verb", ["check", "download"])
def test_files_that_cannot_be_read(tmp_path: Path, verb: str) -> None:
    for file in (tmp_path / "missing.s19", tmp_path):
        result = run("barrett", "firmware", verb, file, "--fake", "--yes")
        assert result.code == 2 and str(file) in result.err, result
    large = tmp_path / "large"
    large.write_bytes(b"\n" * 4_000_001)
    assert run("barrett", "firmware", verb, large, "--fake", "--yes").code == 2


# -- download ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("window", ["1", "2", "4"])
def test_the_image_is_identical(good: Path, window: str) -> None:
    with spying() as spy:
        result = load(good, "--window", window, port=fake(wire="auto", download_version="4.34"))
    assert result.code == 0, result
    values = {row["name"] + (f".{row['motor']}" if row["motor"] else ""): row["value"] for row in result.rows}
    digest = hashlib.sha256(DATA).hexdigest()
    assert digest in spy.lines[-1].command("image") and "image valid" in spy.lines[-1].command("image")
    assert (values["image_sha256"], values["bytes"], values["file"]) == (digest, 150, "good.s19")
    assert "4.33" in values["version_before"] and "4.34" in values["firmware"]
    assert result.json["firmware"]["records"] == 5
    assert any("handctl barrett init" in message["text"] for message in result.json["messages"])


def test_parameters_stay(good: Path, tmp_path: Path) -> None:
    """Only RAM is written: what was saved in the EEPROM is there afterwards (§3.7)."""
    port = fake(state=tmp_path / "state.json")
    assert run("barrett", "set", "DP.F1=4321", "-p", port).code == 0
    assert run("barrett", "gcl", "FSAVE", "--yes", "-p", port, env={"XDG_STATE_HOME": str(tmp_path)}).code == 0
    assert load(good, port=port).code == 0
    assert run("barrett", "get", "DP.F1", "-p", port, "--format", "plain").out == "4321\n"
    image = (tmp_path / "state.json").read_text()
    assert DATA.hex() in image


def test_it_asks_first(good: Path) -> None:
    with spying() as spy:
        result = load(good, yes=False)
    assert result.code == 8 and spy.lines == []
    assert "5 records, 150 bytes, 2C00-2C95" in result.error["text"] and "replaces" in result.error["text"]


@each_row("name", ["wrong checksum", "no end", "overlap with other bytes", "intel hex", "24 bit"])
def test_a_bad_file_never_reaches_the_line(tmp_path: Path, name: str) -> None:
    file = write(tmp_path, BROKEN[name][0], "bad.s19")
    with spying() as spy:
        result = load(file)
    assert result.code == 2 and result.error["code"] == "firmware-file" and spy.lines == []


def test_force_loads_a_file_without_an_end(tmp_path: Path) -> None:
    assert load(write(tmp_path, (HEADER, EXAMPLE)), "--force").code == 0


def test_dry_run_is_every_byte(good: Path) -> None:
    with spying() as spy:
        result = load(write(good.parent, (EXAMPLE, END), "one.s19"), "-n", yes=False)
    assert result.code == 0 and spy.lines == []
    assert [row["bytes"] for row in result.rows] == ["58", "FF", "FF 00 20 08 FF 11 22 33 44 55 66 FF 00"]
    assert len(load(good, "-n").rows) == 7


@pytest.mark.parametrize(
    ("fault", "place", "code", "where"),
    [
        ("wrong-echo", "0x2C40", 5, "2C40h"),
        ("missing-echo", "0x2C40", 4, "2C40h"),
        ("extra-byte", "0x2C41", 5, "2C4"),
        ("monitor-hang", "0x2C95", 4, "2C95h"),
        ("wrong-echo", "+2", 5, "2C00h"),
        ("missing-echo", "+36", 4, "2C20h"),
    ],
)
def test_faults_name_the_address(good: Path, fault: str, place: str, code: int, where: str) -> None:
    result = load(good, port=fake(fault=fault, download_at=quote(place)))
    assert result.code == code, result
    assert (
        where in result.error["text"]
        and ("the firmware has not changed" if place == "+2" else "incomplete") in result.error["hint"]
    )


def test_a_wrong_echo_is_shown_with_both_bytes(good: Path) -> None:
    result = load(good, port=fake(fault="wrong-echo", download_at="0x2C40"))
    assert f"sent {DATA[64]:02X}, received {DATA[64] ^ 64:02X}" in result.error["text"]


def test_a_silent_monitor(good: Path) -> None:
    """`:` came, no echo ever does."""
    result = load(good, port=fake(fault="deaf", window=30))
    assert (result.code, result.error["code"]) == (4, "no-echo") and "2C00h" in result.error["text"]


def test_the_old_firmware_starts_under_the_download(good: Path) -> None:
    """The monitor did not hear the first trigger: the banner is no echo."""
    result = load(good, port=fake(fault="deaf", window=1))
    assert result.code == 5 and "2C00h" in result.error["text"]


@pytest.mark.parametrize(("expect", "code"), [("4.34", 0), ("v4_34", 0), ("4.33", 7)])
def test_expect(good: Path, expect: str, code: int) -> None:
    result = load(good, "--expect", expect, port=fake(download_version="4.34"))
    assert result.code == code, result
    if code:
        assert result.error["code"] == "version" and "4.34" in result.error["text"]
        assert {row["name"] for row in result.rows} >= {"firmware", "image_sha256"}


@pytest.mark.parametrize("args", [("--expect", "new"), ("--window", "0"), ("--window", "5"), ("--window", "x")])
def test_wrong_options(good: Path, args: tuple[str, ...]) -> None:
    with spying() as spy:
        assert load(good, *args).code == 2
    assert spy.lines == []


def test_progress_is_sparse_without_a_terminal(good: Path) -> None:
    result = run("barrett", "firmware", "download", good, "-p", fake(wire="auto"), "--yes")
    assert result.code == 0
    lines = [line for line in result.err.splitlines() if "%" in line]
    assert 4 <= len(lines) <= 6 and "150 of 150 bytes" in lines[-1] and "\r" not in result.err
    quiet = run("barrett", "firmware", "download", good, "-p", fake(wire="auto"), "--yes", "--quiet")
    assert quiet.code == 0 and "%" not in quiet.err


def test_a_hand_without_firmware(good: Path) -> None:
    result = load(good, port=fake(image="blank"))
    assert result.code == 0
    assert {row["name"]: row["value"] for row in result.rows}["version_before"] is None


def test_not_alive_afterwards(good: Path) -> None:
    result = load(good, port=fake(image_records=99))
    assert result.code in (4, 5) and result.error["code"] == "not-alive"


def test_a_deadline_that_would_cut_the_download_off(tmp_path: Path) -> None:
    path = tmp_path / "f.s19"
    path.write_text("S10B2000112233445566FF0070\nS9030000FC\n")
    with spying() as spy:
        result = run("barrett", "firmware", "download", path, "--deadline", "5", "-y", "-p", "fake://barrett")
    assert result.code == 2 and "too short" in result.err and spy.lines == []
