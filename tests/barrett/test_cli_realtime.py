"""`handctl barrett realtime` through the command line: bytes, rows, streams, control values, exit codes."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from handctl.command.terminal_prompts import TerminalPrompts
from handctl.devices.barrett.realtime import control_values
from tests.barrett.commands import fake
from tests.support.cli import Result, run, spying
from tests.support.each_row import each_row

LINE = {"wire": "auto"}
EXAMPLE = (
    "--motors",
    "124",
    "--send",
    "velocity@12",
    "--receive",
    "strain@12,delta,temperature",
    "--velocity",
    "20,127",
    "--delta-unit",
    "1",
)
LIMITS = ("limit_sequential", "limit_overlapped", "limit_pipelined")


def do(*args: str | Path, port: str | None = None, **more: Any) -> Result:
    return run("barrett", "realtime", *args, "-p", port or fake(**LINE), "--json", **more)


def sent(trace: Path) -> list[bytes]:
    lines = [line.split() for line in trace.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return [bytes.fromhex("".join(words[2:])) for words in lines if words[1] == ">"]


def blocks(trace: Path) -> list[str]:
    """What was sent behind `LOOP`, up to ^C; in hex."""
    data = sent(trace)
    start = next(number for number, piece in enumerate(data) if piece.endswith(b"LOOP\r")) + 1
    return [piece.hex(" ").upper() for piece in data[start : data.index(b"\x03", start) + 1]]


def last_lines(trace: Path) -> list[str]:
    data = sent(trace)
    return [piece[:-1].decode() for piece in data[data.index(b"124LOOP\r") + 1 :] if piece[-1:] == b"\r" and piece[1:]]


def by_name(rows: list[dict[str, Any]]) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for row in rows:
        found.setdefault(row["name"] + (f".{row['motor']}" if row.get("motor") else ""), []).append(row["value"])
    return found


@pytest.mark.parametrize("more", [("--velocity", "20"), ("--init",)])
def test_a_disabled_motor_does_not_move_unnamed(more: tuple[str, ...], tmp_path: Path) -> None:
    """EN 0 keeps a motor out of what names no motors (§5.3.4); LOOP is a movement command (§5.2.1)."""
    port, trace = fake(state=tmp_path / "s.json"), tmp_path / "t.txt"
    assert run("barrett", "set", "EN.F2=0", "-p", port).code == 0
    result = do(*more, "--count", "2", "--trace", trace, port=port)
    assert (result.code, result.stream[1]["messages"][-1]["code"]) == (2, "disabled")
    assert not any(piece.endswith((b"LOOP\r", b"HI\r")) or b"SET" in piece for piece in sent(trace))
    assert do(*more, "--motors", "134", "--count", "2", port=port).code == 0
    assert do(*more, "--motors", "1234", "--count", "2", port=port).code == 0
    assert do("--count", "2", port=port).code == 0  # only watched


# -- the example ------------------------------------------------------------------------------------------------------


def test_the_example_of_the_manual(tmp_path: Path) -> None:
    """§6.4: blocks of 3 and 8 bytes, decoded, the floors of both speeds told."""
    trace = tmp_path / "t.txt"
    port = fake(**LINE, no_load="120,120,120", loop_jump="20,127,0,0")
    result = do(*EXAMPLE, "--count", "4", "--trace", trace, port=port)
    assert (result.code, result.err) == (0, ""), result
    rows, end = result.stream
    values = by_name(rows)
    assert {name: found[0] for name, found in values.items()} == {
        "velocity_command.F1": 20, "strain.F1": 120, "delta.F1": 20, "position.F1": 20,
        "velocity_command.F2": 127, "strain.F2": 120, "delta.F2": 127, "position.F2": 127,
        "delta.SPREAD": 0, "position.SPREAD": 0, "temperature": 41.2,
    }  # fmt: skip
    assert all(len(found) == 4 for found in values.values())
    times = [row["t"] for row in rows]
    assert times == sorted(times) and len(set(times)) == 4
    assert blocks(trace) == ["43 14 7F"] * 4 + ["63 00 00", "03"]
    assert last_lines(trace)[0] == "124T"
    assert end["stream"]["samples"] == 4
    assert (end["loop"]["control_bytes"], end["loop"]["feedback_bytes"]) == (3, 8)
    assert end["loop"]["line_limit_hz"] == {"sequential": 87.3, "overlapped": 106.7, "pipelined": 120.0}
    assert end["loop"]["latency"]["count"] == 4


def test_watching_only(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = do("--count", "3", "--trace", trace)
    rows, end = result.stream
    assert result.code == 0 and blocks(trace) == ["41", "41", "41", "03"]
    values = by_name(rows)
    assert (
        values["strain.F2"] == [119] * 3 and values["position.SPREAD"] == [0] * 3 and values["velocity.F1"] == [0] * 3
    )
    assert not any(name.startswith("velocity_command") for name in values)
    assert not [piece for piece in sent(trace) if b"SET" in piece or piece.lstrip(b"1234") == b"T\r"]
    assert (end["loop"]["control_bytes"], end["loop"]["feedback_bytes"]) == (1, 21)


def test_duration_and_rate() -> None:
    _, end = do("--duration", "0.5", "--rate", "20", "--receive", "position").stream
    assert 10 <= end["stream"]["samples"] <= 11
    assert (end["stream"]["asked_hz"], end["stream"]["late"]) == (20.0, 0)


def test_csv_one_row_a_value() -> None:
    result = run("barrett", "realtime", *EXAMPLE, "--count", "2", "-p", fake(**LINE), "--csv", "--long")
    assert result.code == 0
    rows = list(csv.DictReader(io.StringIO(result.out)))
    assert len(rows) == 22
    assert [row["name"] for row in rows[:3]] == ["velocity_command", "strain", "delta"]
    assert {row["motor"] for row in rows} == {"F1", "F2", "SPREAD", ""}
    assert [row["value"] for row in rows if row["name"] == "temperature"] == ["41.2", "41.2"]


# -- dry run ----------------------------------------------------------------------------------------------------------


def test_dry_run_is_the_bytes(tmp_path: Path) -> None:
    with spying() as spy:
        result = run("barrett", "realtime", *EXAMPLE, "-n", "--json")
    assert result.code == 0 and spy.lines == []
    steps = [bytes.fromhex(row["bytes"].replace(" ", "")) for row in result.stream[0]]
    lines = [step for step in steps if step[-1:] == b"\r"]
    assert b"124LOOP\r" in lines and lines[-1] == b"124T\r" and b"PSET LFT 1\r" in lines
    assert [step.hex(" ").upper() for step in steps if step[-1:] != b"\r"] == ["43 14 7F", "63 00 00", "03"]


def test_dry_run_with_hold_has_no_t() -> None:
    rows = run("barrett", "realtime", *EXAMPLE, "--hold", "-n", "--json").stream[0]
    assert rows[-1]["bytes"] == "03" and "31 32 34 54 0D" not in [row["bytes"] for row in rows]


def test_dry_run_of_watching_moves_nothing() -> None:
    rows = run("barrett", "realtime", "--motors", "1", "-n", "--json").stream[0]
    assert [row["bytes"] for row in rows] == ["31 4C 4F 4F 50 0D", "41", "03"]


def test_init_comes_before_everything(tmp_path: Path) -> None:
    trace = tmp_path / "trace.txt"
    port = fake(clock="virtual", initialized="0")
    assert do("--motors", "1", "--count", "1", port=port).code == 6
    result = do("--motors", "1", "--count", "1", "--init", "--trace", trace, port=port)
    assert result.code == 0
    lines = [piece for piece in sent(trace) if piece[-1:] == b"\r"]
    assert lines.index(b"1HI\r") < lines.index(b"1LOOP\r")


def test_an_init_that_fails_ends_it(tmp_path: Path) -> None:
    trace = tmp_path / "trace.txt"
    result = do(
        "--init", "--count", "1", "--trace", trace, port=fake(clock="virtual", initialized="0", fault="no-motor")
    )
    assert result.code == 6
    assert b"1234LOOP\r" not in sent(trace)


# -- what is refused --------------------------------------------------------------------------------------------------


@each_row(
    ("args", "word"),
    [
        (("--motors", ""), "--motors"),
        (("--motors", "5"), "5"),
        (("--send", "velocity,speed"), "speed"),
        (("--receive", "stran"), "stran"),
        (("--receive", "strain@3", "--motors", "12"), "--motors"),
        (("--velocity", "128"), "128"),
        (("--velocity", "-128"), "-128"),
        (("--velocity", "1,2", "--motors", "124"), "motors"),
        (("--gain", "256", "--velocity", "0"), "256"),
        (("--send", "gain"), "gain"),
        (("--send", "gain", "--gain", "5", "--velocity", "5"), "--velocity"),
        (("--control", "missing.csv"), "missing.csv"),
        (("--measure", "1"), "--measure"),
        (("--measure", "5", "--count", "9"), "--measure"),
        (("--measure", "5", "--duration", "9"), "--duration"),
        (("--count", "0"), "--count"),
    ],
)
def test_wrong_options(args: tuple[str, ...], word: str) -> None:
    with spying() as spy:
        result = run("barrett", "realtime", *args, "-p", fake(), "--json")
    assert result.code == 2 and word in result.out + result.err, result
    assert spy.lines == [], "the hand is not touched"


BAD_FILES = [
    ("t,velocity.F1\n0,20\n1,x\n", "line 3"),
    ("t,velocity.F1\n0,20\n1,200\n", "line 3"),
    ("t,velocity.F1\n0,20\n1\n", "line 3"),
    ("t,velocity.F3\n0,20\n", "line 1"),
    ("t,torque\n0,20\n", "line 1"),
    ("t,velocity\n1,20\n0,0\n", "0"),
    ("velocity\n20\n", "--control -"),
    ("", "no rows"),
    ("t,velocity\n", "rows"),
    ('{"t": 0, "velocity": 20}\n{"t": 1, "velocity": "a"}\n', "line 2"),
    ('{"t": 0, "velocity": 20}\nx\n', "line 2"),
]


@each_row(("text", "word"), BAD_FILES)
def test_bad_control_files(tmp_path: Path, text: str, word: str) -> None:
    """All rows are checked before the hand is touched."""
    file = tmp_path / "in.csv"
    file.write_text(text)
    with spying() as spy:
        result = do("--motors", "12", "--control", file)
    assert result.code == 2 and word in result.out + result.err, result
    assert spy.lines == []


@each_row("content", [b"\xff\xfe\x00", b"t,velocity\n0,\xc3\n"])
def test_control_files_that_are_no_text(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "in.csv"
    file.write_bytes(content)
    assert do("--control", file).code == 2
    assert do("--control", tmp_path).code == 2


def test_send_that_does_not_fit_the_file(tmp_path: Path) -> None:
    file = tmp_path / "in.csv"
    file.write_text("t,velocity.F1\n0,20\n1,0\n")
    assert do("--motors", "12", "--send", "velocity", "--control", file).code == 2
    assert do("--motors", "12", "--send", "velocity@1", "--control", file).code == 0


# -- control values ---------------------------------------------------------------------------------------------------

CSV = "t,velocity.F1,velocity.F2\n0.0,20,20\n0.1,0,-20\n0.2,,\n"
JSON = '{"t": 0, "velocity.F1": 20, "velocity.F2": 20}\n{"t": 0.1, "velocity.F1": 0, "velocity.F2": -20}\n{"t": 0.2}\n'


BOM, CRLF = "\ufeff" + CSV, CSV.replace("\n", "\r\n")


@pytest.mark.parametrize(
    ("text", "stdin"),
    [*((text, False) for text in (CSV, JSON, BOM, CRLF)), *((text, True) for text in (CSV, JSON, CRLF))],
)
def test_control_with_times(tmp_path: Path, text: str, stdin: bool) -> None:
    file, trace = tmp_path / "in", tmp_path / "t.txt"
    file.write_bytes(text.encode())
    result = do("--motors", "124", "--receive", "position@12", "--no-guard", "window", "--control", "-" if stdin else file, "--trace", trace,
                stdin=text)  # fmt: skip
    assert result.code == 0, result
    assert list(dict.fromkeys(blocks(trace))) == ["43 14 14", "43 00 EC", "63 00 00", "03"]
    rows, end = result.stream
    assert 0.15 < end["stream"]["seconds"] < 0.3
    assert by_name(rows)["velocity_command.F2"][-1] == -20
    assert last_lines(trace)[0] == "124T"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
@pytest.mark.parametrize(("deadline", "seconds"), [((), 30), (("--deadline", "5"), 5)])
def test_a_pipe_that_is_never_closed_is_not_read_for_ever(
    deadline: tuple[str, ...], seconds: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A row a second, and no end: a dry run ends as well, and nothing is sent."""
    pipe, trace, now = tmp_path / "pipe", tmp_path / "t.txt", [0.0]
    os.mkfifo(pipe)

    def gives(_descriptor: int, left: float | None) -> bool:
        now[0] += min(1.0, left or 0.0)
        os.write(writer, f"{now[0]},20\n".encode())
        return bool(left)

    monkeypatch.setattr(control_values, "gives", gives)
    monkeypatch.setattr(control_values, "clock", SimpleNamespace(now=lambda: now[0]))
    for dry in ((), ("-n",)):
        now[0], writer = 0.0, os.open(pipe, os.O_RDWR)
        os.write(writer, b"t,velocity.F1\n")
        assert do("--motors", "1", "--control", pipe, "--trace", trace, *deadline, *dry).code == 4
        assert now[0] == seconds and not trace.exists()
        os.close(writer)


def test_live_control_ends_with_its_input(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = do("--motors", "12", "--receive", "position", "--control", "-", "--trace", trace, stdin="velocity\n20\n")
    assert result.code == 0, result
    assert blocks(trace)[-2:] == ["63 00 00", "03"] or blocks(trace) == [
        "03"
    ]  # the end may come before the first block


def test_a_bad_live_line_stops_the_motors(tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    result = do(
        "--motors", "12", "--receive", "position", "--control", "-", "--trace", trace, stdin="velocity\n20\nfast\n"
    )
    assert result.code == 7 and "line 3" in result.out, result
    assert blocks(trace)[-1] == "03"


def test_hold_and_power_off(tmp_path: Path) -> None:
    for args, expected in (((), True), (("--hold",), False)):
        trace = tmp_path / f"{expected}.txt"
        with spying() as spy:
            assert do(*EXAMPLE, "--count", "2", *args, "--trace", trace).code == 0
        assert ("124T" in last_lines(trace)) is expected
        motors = spy.lines[-1].command("motors")
        assert "moving" not in motors
        assert ("power on" in motors.split(",")[0]) is not expected


# -- measuring --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sequential", [False, True])
@pytest.mark.parametrize("baud", [9600, 38400])
def test_measure(baud: int, sequential: bool) -> None:
    args = ("--sequential",) if sequential else ()
    port = fake(**LINE, baud=baud)
    result = do(*EXAMPLE, "--measure", "100", "--baud", str(baud), *args, port=port)
    assert result.code == 0, result
    rows, end = result.stream if result.out.count("\n") > 1 else (result.rows, result.json)
    values = {row["name"]: row["value"] for row in rows}
    scale = baud / 9600
    floors = [round(hertz * scale, 1) for hertz in (87.27, 106.67, 120.0)]
    assert [values[name] for name in LIMITS] == pytest.approx(floors, abs=0.11)
    if sequential:
        assert 0.95 * floors[0] <= values["rate"] <= floors[1]
    else:
        assert 0.95 * floors[1] <= values["rate"] <= 1.001 * floors[2]
    assert (values["control_block"], values["feedback_block"], values["late"]) == (3, 8, 0)
    assert values["min"] <= values["median"] <= values["p95"] <= values["p99"] <= values["max"]
    assert sum(count for _, count in end["loop"]["latency"]["histogram"]) == 100
    assert "slow-adapter" not in [message["code"] for message in end["messages"]], "a perfect line is no slow adapter"


def test_measure_for_people() -> None:
    result = run("barrett", "realtime", "--measure", "50", "-p", fake(**LINE), "--format", "table")
    assert result.code == 0 and "limit_pipelined" in result.out and "█" in result.out
    without = run("barrett", "realtime", "--measure", "5", "-p", fake(), "--format", "table")
    assert without.code == 0, without  # no time passes: no rate


def test_a_slow_adapter_is_told() -> None:
    result = do("--motors", "1", "--receive", "strain", "--measure", "30", port=fake(**LINE, turnaround=0.016))
    assert result.code == 0 and "slow-adapter" in result.out


# -- failures ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "code", "name"),
    [
        ({"fault": "loop-silent"}, 4, None),
        ({"fault": "loop-drop"}, 5, None),
        ({"fault": "loop-extra"}, 5, None),
        ({"fault": "loop-error", "loop_code": 2048}, 6, "err-2048"),
        ({"fault": "loop-error", "loop_code": 8192}, 6, "err-8192"),
        ({"fault": "over-temperature"}, 6, "err-8192"),
        ({"fault": "deaf"}, 4, None),
        ({"fault": "disconnect", "after": 12}, 3, None),
    ],
)
def test_faults(options: dict[str, Any], code: int, name: str | None) -> None:
    result = do(*EXAMPLE, "--count", "50", port=fake(**LINE, loop_after=5, **options))
    assert result.code == code, result
    end = json.loads(result.lines[-1])
    end = end.get("end", end)
    errors = [message for message in end["messages"] if message["level"] == "error"]
    assert errors and end["exit_code"] == code
    assert name is None or name in [message["code"] for message in errors]


def test_the_meaning_of_2048() -> None:
    result = do(*EXAMPLE, "--count", "5", port=fake(**LINE, fault="loop-error", loop_code=2048))
    assert "2048" in result.out and "RealTime" in result.out


def test_a_measurement_that_fails() -> None:
    result = do("--measure", "20", port=fake(**LINE, fault="loop-drop", loop_after=5))
    assert result.code == 5


# -- signals ----------------------------------------------------------------------------------------------------------


@each_row("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_nothing_disturbs_the_leaving(number: signal.Signals) -> None:
    """A second signal must not fall between velocity 0 and T; the handler from before is back afterwards."""

    def fall(_number: int, _frame: object) -> None:
        raise AssertionError("disturbed")

    before = signal.signal(number, fall)
    try:
        with TerminalPrompts(quiet=True).without_interrupts():
            signal.raise_signal(number)
        assert signal.getsignal(number) is fall
    finally:
        signal.signal(number, before)


def test_presses_are_counted() -> None:
    before = signal.getsignal(signal.SIGINT)
    with TerminalPrompts(quiet=True).count_interrupts() as presses:
        assert presses.count == 0
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
        assert presses.count == 2
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize(("control", "late", "code"), [
    ((), 0.05, 0), ((), 0.3, 0), ((), 0.7, 4), (("--send", "velocity", "--velocity", "0"), 0.05, 0),
    (("--send", "velocity", "--velocity", "0"), 0.3, 4),
])  # fmt: skip
def test_patience_with_a_line_that_stumbles(control: tuple[str, ...], late: float, code: int) -> None:
    """A tenth of a second while values are sent (dossier 1.3); longer where nothing moves by our hand."""
    link = f"fake://barrett?clock=virtual&initialized=1&fault=late&late={late}"
    result = run("barrett", "realtime", "--receive", "position", *control, "--motors", "1", "--count", "2", "-p", link, "--json")  # fmt: skip
    assert result.code == code, result


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
@pytest.mark.parametrize("written", [b"", b"velocity.F1\n"])
def test_a_pipe_that_nobody_writes_is_not_waited_for_beyond_the_deadline(tmp_path: Path, written: bytes) -> None:
    """Opening it would already wait for who writes; and one who has opened it may say nothing."""
    os.mkfifo(tmp_path / "pipe")
    other = os.open(tmp_path / "pipe", os.O_RDWR) if written else None
    try:
        if other is not None:
            os.write(other, written)
        result = do("--control", tmp_path / "pipe", "--deadline", "0.05", "--trace", tmp_path / "t.txt")
    finally:
        if other is not None:
            os.close(other)
    _, closing = result.stream
    assert (result.code, [message["code"] for message in closing["messages"]]) == (4, ["deadline"]), result
    assert not (tmp_path / "t.txt").exists() or not sent(tmp_path / "t.txt")
