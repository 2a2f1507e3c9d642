"""What `.ci/windows` makes of two runs of a line, and of a machine on which its parts cannot be had; wine is not needed here."""

from __future__ import annotations

import ast
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from tests.support.syntax import nodes_of
from tests.windows import excuses, lines
from tests.windows.__main__ import Tried, tried
from tests.windows.excuses import Excuse, masked
from tests.windows.lines import Line
from tests.windows.matrix import EQUAL, EXCUSED, WRONG, judged
from tests.windows.systems import CHECKOUT, Ended, assemble, end

LINE = Line(("exo", "dump"), "alone")
ONE = Ended(0, b"a\nb\n", b"", {"out.txt": b"1\n"})


@pytest.fixture
def excused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(excuses, "EXCUSES", (Excuse(re.compile("exo"), "because", re.compile(rb"c\n")),))


def test_only_equal_bytes_are_equal() -> None:
    assert judged(LINE, ONE, ONE).verdict == EQUAL
    for other, shown in (
        (ONE._replace(code=3), "exit code 0 on Linux, 3 on Windows"),
        (ONE._replace(out=b"a\r\nb\r\n"), "stdout: lines end with CR LF"),
        (ONE._replace(err=b"x\n"), "stderr: +x"),
        (ONE._replace(files={}), "out.txt: -1"),
        (ONE._replace(out=b"a\nb"), "stdout: the same words, other bytes"),
    ):
        cell = judged(LINE, ONE, other)
        assert cell.verdict == WRONG and shown in cell.difference, cell


@pytest.mark.usefixtures("excused")
def test_a_reason_excuses_words_but_not_another_exit_code() -> None:
    assert judged(LINE, ONE, ONE._replace(out=b"a\nb\nc\n"))[1:3] == (EXCUSED, "because")
    assert judged(LINE, ONE, ONE._replace(code=1)).verdict == WRONG


@pytest.mark.usefixtures("excused")
def test_a_reason_excuses_nothing_beside_its_own_words() -> None:
    cell = judged(LINE, ONE, ONE._replace(out=b"a\nB\nc\n", err=b"Message(text='x')\n"))
    assert (cell.verdict, cell.difference) == (WRONG, ("stdout: -b", "stdout: +B", "stderr: +Message(text='x')"))


def test_a_scene_is_waited_for_no_longer_than_its_time(capsys: pytest.CaptureFixture[str]) -> None:
    over = threading.Event()
    scenes: list[tuple[str, str, Tried]] = [
        ("a", "1", lambda: ("held", "")), ("a", "2", lambda: (str(over.wait()), "")), ("a", "3", lambda: ("", f"{1 // 0}")),
    ]  # fmt: skip
    found = tried(iter(scenes), 0.05)
    over.set()
    assert [scene.wrong for scene in found] == [
        "",
        "not over after 0 s",
        "ZeroDivisionError: integer division or modulo by zero",
    ]
    assert capsys.readouterr().out.count("\n") == 3
    (late,) = tried(iter(scenes[:1]), until=0.0)
    assert late.left and not late.wrong, "what has no time is not run, and says so"


@pytest.mark.usefixtures("excused")
def test_a_reason_that_is_not_needed_is_wrong() -> None:
    assert judged(LINE, ONE, ONE).verdict == WRONG


def test_of_a_live_line_the_number_of_lines_counts() -> None:
    live = LINE._replace(live=True)
    assert judged(live, ONE, ONE._replace(out=b"c\nd\n", err=b"3 ms\n", files={"out.txt": b"2"})).verdict == EQUAL
    for other in (
        ONE._replace(out=b"c\n"),
        ONE._replace(out=b"c\r\nd\r\n"),
        ONE._replace(files={}),
        ONE._replace(code=4),
    ):
        assert judged(live, ONE, other).verdict == WRONG


def test_what_differs_from_run_to_run_is_masked() -> None:
    assert masked(b'"made": "2026-11-23T05:02:11.5Z", "round_trip_ms": 8.3') == b'"made": "TIME", "round_trip_ms": MS'
    assert masked(b"0.000389 > EB 90\n") == b"TIME > EB 90\n"
    assert masked(b"uptime_seconds  7345679  s") == b"uptime_seconds  SECONDS  s"


def test_every_reason_is_of_a_line() -> None:
    every = [str(line) for line in lines.every()]
    assert len(set(every)) == len(every) > 200
    for excuse in excuses.EXCUSES:
        assert any(excuse.lines.match(line) for line in every), excuse


def test_without_its_parts_one_line_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(assemble, "wine", str)
    monkeypatch.setattr(assemble.os, "geteuid", lambda: 1000)
    assert assemble.main([str(tmp_path / "parts")]) == assemble.SKIPPED
    said = capsys.readouterr().err
    assert said.startswith("skipped: wine64") and said.count("\n") == 1
    assert not (tmp_path / "parts").exists()


@pytest.mark.real
def test_a_helper_that_keeps_the_pipes_is_not_waited_for() -> None:
    """As wine's desktop, which the first program with a window starts."""
    words = (
        "import subprocess, sys; print(sys.stdin.read(), flush=True); subprocess.Popen(['sleep', '60']); sys.exit(3)"
    )
    pipe = subprocess.PIPE
    process = subprocess.Popen(
        [sys.executable, "-c", words], stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True
    )
    try:
        assert assemble.said(process, b"x" * 100_000, 30.0) == (b"x" * 100_000 + b"\n", b"")
        assert process.poll() == 3
    finally:
        end(process)


@pytest.mark.real
def test_what_does_not_end_is_not_waited_for() -> None:
    process = subprocess.Popen(["sleep", "60"], stdout=subprocess.PIPE, start_new_session=True)
    with pytest.raises(subprocess.TimeoutExpired):
        assemble.said(process, b"", 0.5)
    end(process)
    assert assemble.said(process, b"", 30.0) == (b"", b"") and process.poll() == -signal.SIGKILL


def test_every_text_that_is_written_names_its_line_ends() -> None:
    source, found = CHECKOUT / "src" / "handctl", []
    for path in source.rglob("*.py"):
        if path.relative_to(source).parts[0] in ("docgen", "newfamily", "build_zipapp.py"):
            continue  # run where handctl is developed
        text = path.read_text(encoding="utf-8")
        for node in nodes_of(path) if "open(" in text else ():
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "open" and len(node.args) > 1:
                mode = node.args[1].value if isinstance(node.args[1], ast.Constant) else ""
                named = {keyword.arg for keyword in node.keywords}
                if mode in ("w", "x", "a") and "newline" not in named:
                    found.append(f"{path.relative_to(source)}:{node.lineno}")
    assert not found
