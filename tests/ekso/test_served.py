"""`handctl sim ekso` as a server on a pseudo-terminal and on TCP, with handctl and pyserial as its clients; kill -9."""

from __future__ import annotations

import binascii
import json
import re
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import serial

from tests.ekso.commands import DATA_WORDS, ME, SETTING_WORDS
from tests.support.cli import PATIENCE, Result, Simulator, clean_environment, run, run_program, unhurried, wait_until
from tests.support.cli import start as started
from tests.support.each_row import each_row

pytestmark = pytest.mark.real

Start = Callable[..., Simulator]
PLACES: dict[str, tuple[str, ...]] = {"pty": ("--pty",), "tcp": ("--tcp", "127.0.0.1:0")}


@pytest.fixture
def start() -> Iterator[Start]:
    running: list[Simulator] = []

    def starter(place: str, *args: str | Path) -> Simulator:
        running.append(Simulator(*PLACES[place], "--set", "sway=0", *args, kind="ekso"))
        return running[-1]

    yield starter
    for simulator in running:
        simulator.stop()


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The audit log goes to the test's own directory."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


def do(link: str, *args: str | Path) -> Result:
    result = unhurried(lambda: run("ekso", *args, "-p", link, "--json"))
    assert result.code == 0, result
    return result


def audit(folder: Path) -> list[dict[str, Any]]:
    path = folder / "handctl" / "ekso-audit.jsonl"
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []


class Foreign:
    """A client of its own: pyserial and binascii, nothing of handctl."""

    def __init__(self, link: str) -> None:
        url = link.replace("tcp://", "socket://")
        self.port = serial.serial_for_url(url, baudrate=115200, timeout=PATIENCE)
        self.ident = 200

    def ask(self, command: int, body: bytes, count: int) -> bytes:
        """The body of an answer of `count` bytes, checked."""
        self.ident += 1
        head = bytes([command, len(body)]) + self.ident.to_bytes(2, "big") + body
        self.port.write(head + binascii.crc_hqx(head, 0xFFFF).to_bytes(2, "big"))
        answer = self.port.read(count + 6)
        assert len(answer) == count + 6 and binascii.crc_hqx(answer, 0xFFFF) == 0, answer
        assert answer[:4] == bytes([command, count]) + self.ident.to_bytes(2, "big")
        return bytes(answer[4:-2])

    def words(self, command: int, count: int) -> list[int]:
        body = self.ask(command, b"", 2 * count)
        return [int.from_bytes(body[at : at + 2], "big") for at in range(0, len(body), 2)]


@each_row("place", PLACES)
def test_a_foreign_client_reads_and_writes(start: Start, place: str) -> None:
    link = start(place).link
    assert re.fullmatch({"pty": r"/dev/\S+", "tcp": r"tcp://127\.0\.0\.1:\d+"}[place], link)
    client = Foreign(link)
    try:
        settings = [raw % 65536 for _, raw, _ in SETTING_WORDS]
        assert client.words(152, 22) == settings
        first = client.words(153, 27)
        assert first[:18] == [raw % 65536 for _, raw, _ in DATA_WORDS][:18] and first[18] == 0x2040
        assert client.ask(150, b"", 4)[3] == 0 and client.ask(151, b"", 4)[:3] == b"\x1a\x0b\x14"
        assert client.ask(155, b"\0\xca\6\x0e", 2) == b"\0\0"
        assert client.words(152, 22) == [*settings[:2], 1550, *settings[3:]]
        boot_time = first[-2] * 65536 + first[-1]  # it ticks every 2 ms

        def ticked() -> bool:
            later = client.words(153, 27)
            return later[-2] * 65536 + later[-1] > boot_time

        wait_until(ticked)
        assert client.ask(156, b"\1\0", 2) == b"\0\0"
    finally:
        client.port.close()
    assert do(link, "get", "step_length").rows[0]["raw"] == 1550


@each_row("place", PLACES)
def test_the_same_as_in_process(start: Start, place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    link = start(place).link
    result = run_program("ekso", "settings", "-p", link, "--json")
    assert (result.code, result.err) == (0, "")
    assert [row["raw"] for row in result.rows] == [raw for _, raw, _ in SETTING_WORDS]
    assert result.json["device"] == {"kind": "ekso", "link": link, "fake": False, "id": None, "model": "EksoNR"}
    (row,) = do(link, "set", "step_length=15.5", *ME).rows
    assert (row["before"], row["value"], row["raw"]) == (14.75, 15.5, 1550)
    assert [(entry["event"], entry["port"], entry["simulated"]) for entry in audit(tmp_path)] == [
        ("intent", link, False), ("result", link, False),
    ]  # fmt: skip
    samples, end = run("ekso", "watch", "state", "--count", "4", "--rate", "50", "-p", link, "--json").stream
    assert [row["value"] for row in samples] == [0x2040] * 4 and end["stream"]["samples"] == 4


def test_the_audit_log_survives_kill_9_and_the_next_set_tells(start: Start, tmp_path: Path) -> None:
    """Killed between SetValue and its answer: the intent is on the disk, and the next `set` says that nobody knows."""
    panel = tmp_path / "panel"
    link = start("pty", "--control", panel, "--fault", "set-unanswered").link

    def killed() -> Result:
        process = started(
            ["ekso", "set", "step_length=15.5", *ME, "-p", link, "--timeout", "5"],
            clean_environment(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        wait_until(lambda: "set 1 " in run("sim", "control", panel, "counts").out or process.poll() is not None)
        process.send_signal(signal.SIGKILL)
        _, err = process.communicate(timeout=PATIENCE)
        return Result(process.wait(), b"", err)

    assert unhurried(killed).code == -signal.SIGKILL
    (intent,) = audit(tmp_path)
    assert (intent["event"], intent["name"], intent["new"]["raw"], intent["operator"]) == (
        "intent", "step_length", 1550, "me",
    )  # fmt: skip
    assert bytes.fromhex(intent["frame"])[4:8] == b"\0\xca\6\x0e"
    assert run("sim", "control", panel, "fault", "none").code == 0
    told = do(link, "set", "step_height=2.0", *ME)
    (message,) = [message for message in told.json["messages"] if message["code"] == "unfinished-write"]
    assert message["level"] == "warning"
    assert (
        "step_length 14.75 -> 15.5" in message["text"] and link in message["text"] and intent["utc"] in message["text"]
    )
    assert [entry["event"] for entry in audit(tmp_path)] == ["intent", "intent", "result"]
    assert "unfinished-write" not in do(link, "set", "step_height=1.75", *ME).codes(), "told once"
    assert do(link, "get", "step_length").rows[0]["raw"] == 1550


def test_a_power_cycle_in_a_log_is_a_new_segment(start: Start, tmp_path: Path) -> None:
    panel, file = tmp_path / "panel", tmp_path / "gait.csv"
    link = start("pty", "--control", panel, "--set", "startup=0.2").link
    process = started(
        ["ekso", "log", file, "-p", link, "--rate", "100", "--timeout", "1", "--json"],
        clean_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    wait_until(lambda: file.exists() and file.read_bytes().count(b"\n") > 20)
    assert run("sim", "control", panel, "reboot").code == 0

    def segments_now() -> list[str]:
        return [line.split(",")[4] for line in file.read_text(encoding="utf-8").splitlines()[1:]]

    wait_until(lambda: segments_now()[-1] == "2")
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=30)
    content = json.loads(out)
    assert process.returncode == 130 and content["rows"][0]["segments"] == 2
    assert "rebooted" in [message["code"] for message in content["messages"]]
    segments = segments_now()
    assert segments == sorted(segments) and set(segments) == {"1", "2"}
