"""What confirms a write to an RH56 hand that has no read-back, and what does not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from tests.support.cli import Result, run
from tests.support.each_row import each_row
from tests.support.odd_devices import odd_registers


def states(done: Result) -> list[str]:
    return [row["state"] for row in done.json["writes"]]


@each_row("words", [("save",), ("clear-errors",), ("factory-reset", "--backup"), ("raw", "01 06 05 F8 00 64 09 1C")])
def test_our_own_bytes_confirm_nothing(tmp_path: Path, words: tuple[str, ...]) -> None:
    """The reply to function 06 equals its request, and on a line with echo that comes back by itself (rh56 §2.2)."""
    link = "fake://hand?clock=virtual&speaks=modbus&fault=echo"
    more = [str(tmp_path / "before.json")] if "--backup" in words else []
    with odd_registers(every=lambda frame: b"" if frame[1:2] == b"\x06" else frame):
        lost = run("hand", *words, *more, "-p", link, "--protocol", "modbus", "-y", "--json")
    assert states(lost) == ["sent"], lost
    more = [str(tmp_path / "again.json")] if more else []
    assert states(run("hand", *words, *more, "-p", link, "--protocol", "modbus", "-y", "--json")) == ["confirmed"]


def test_the_result_of_a_save_of_another_hand_confirms_nothing() -> None:
    with odd_registers(every=lambda frame: sealed(b"\3" + frame[3:-1]) if frame[4:7] == b"\x11\xed\x03" else frame):
        done = run("hand", "save", "-p", "fake://hand?clock=virtual", "-y", "--json")
    assert "no-result" in done.codes() and states(done) == ["sent"], done


@each_row(
    ("changed", "code", "error"),
    [
        (lambda frame: sealed(b"\x02" + frame[3:-1]), 5, "stale"),
        (lambda frame: sealed(frame[2:-2] + b"\xff") if frame[4:7] == b"\x11\xed\x03" else frame, 6, "refused"),
    ],
)
def test_raw_bytes_of_a_save_are_judged_as_those_of_an_exo(
    changed: Callable[[bytes], bytes], code: int, error: str
) -> None:
    with odd_registers(every=lambda frame: changed(frame) if frame[5:7] == b"\xed\x03" else frame):
        done = run(
            "hand",
            "raw",
            "EB 90 01 04 12 ED 03 01 08",
            "--wait",
            "2",
            "-p",
            "fake://hand?clock=virtual",
            "-y",
            "--json",
        )
    assert (done.code, done.error["code"]) == (code, error), done


def sealed(body: bytes) -> bytes:
    """A frame of the device around this body."""
    return b"\x90\xeb" + body + bytes([sum(body) & 255])
