"""Marks from outside have their own time, and stand in the log and its sidecar."""

from __future__ import annotations

import io
import json
import socket
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from handctl.errors import LinkError
from handctl.record.marks import LONGEST, Heard, Marks
from tests.support.cli import Simulator, run

pytestmark = pytest.mark.real


def until(found: Callable[[], list[Heard]], count: int) -> list[Heard]:
    marks: list[Heard] = []
    end = time.monotonic() + 20
    while len(marks) < count and time.monotonic() < end:
        marks += found()
    return marks


def test_a_datagram_is_a_mark_with_the_time_at_which_it_came() -> None:
    with closing(Marks(str, port=0)) as marks, closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as sender:
        times = []
        for text in ("trial 1", "  \n", "x" * 500, "b\xfc".encode("latin-1")):
            before = time.time()
            sender.sendto(text if isinstance(text, bytes) else text.encode(), ("127.0.0.1", marks.port or 0))
            if not isinstance(text, str) or text.strip():
                (mark,) = until(lambda: list(marks.take()), 1)
                times.append((before, mark.utc_s, time.time()))
                assert mark.by == "udp" and len(mark.text) <= LONGEST
        assert all(before <= (at or 0) <= after for before, at, after in times) and len(times) == 3


def test_lines_and_keys_are_marks_too() -> None:
    keys = iter(["k"])
    with closing(Marks(lambda: next(keys, ""), lines=io.StringIO("go\n\nstop\n"))) as marks:
        found = until(lambda: list(marks.take()), 3)
    assert sorted((mark.by, mark.text) for mark in found) == [("key", "k"), ("line", "go"), ("line", "stop")]


def test_a_port_that_is_taken_is_told() -> None:
    with closing(Marks(str, port=0)) as marks, pytest.raises(LinkError, match="cannot listen") as refused:
        Marks(str, port=marks.port)
    assert "--mark-udp" in refused.value.hint


def test_a_mark_is_within_a_sample_of_its_row(tmp_path: Path) -> None:
    path = tmp_path / "w.csv"
    with Simulator("--pty", kind="ekso") as simulator:
        done = run("ekso", "log", path, "--mark-stdin", "--duration", "0.5", "-p", simulator.link, stdin="go\n")
    assert done.code == 0, done
    (mark,) = json.loads(Path(f"{path}.json").read_text())["marks"]
    (heard,) = mark["heard"]
    rows = [line.split(",") for line in path.read_text().splitlines()]
    at = float(rows[mark["row"]][rows[0].index("host_mono_s")])
    assert (mark["text"], heard["by"]) == ("go", "line") and 0 <= at - heard["host_mono_s"] < 0.5


def test_a_byte_that_is_no_utf8_spoils_no_recording(tmp_path: Path) -> None:
    path = tmp_path / "w.csv"
    with Simulator("--pty", kind="ekso") as simulator:
        done = run(
            "ekso",
            "log",
            path,
            "--mark",
            "a\udcff",
            "--mark-stdin",
            "--duration",
            "0.5",
            "-p",
            simulator.link,
            stdin="caf\udce9\n",
        )
    assert done.code == 0, done
    content = Path(f"{path}.json").read_bytes()
    assert b"\\ud" not in content and {
        one["text"] for mark in json.loads(content)["marks"] for one in mark["heard"]
    } >= {"caf\ufffd"}
    assert run("ekso", "log", "--check", path).code == 0
