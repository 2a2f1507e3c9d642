"""What reaches stdout and stderr: tables on a pipe, plain, CSV, streams, full disks, closed pipes, signals."""

from __future__ import annotations

import csv
import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from handctl.errors import OutputError
from handctl.model.command_settings import Settings
from handctl.model.result import Column, Sample, Table
from handctl.screen.render import Sink, stream
from tests.support.cli import (
    FINGERS,
    PATIENCE,
    POWER_ON,
    Result,
    clean_environment,
    fake,
    in_time,
    program,
    refusing,
    run,
    run_program,
    wait_until,
)
from tests.support.each_row import each_row
from tests.support.person import pressed_at

FORMATS = ("table", "plain", "json", "ndjson", "csv")


# -- tables on a pipe: at any width in test_screens ----------------------------------------------------------------------


def test_the_dump_table_is_aligned() -> None:
    lines = run("exo", "dump", "-p", fake()).lines
    head = lines[0]
    for name, (address, _, values) in POWER_ON.items():
        (line,) = [text for text in lines if text.split()[0] == name]
        words = line.split()
        assert words[1] == str(address)
        shown = [f"{value:02X}" if name == "error" else str(value) for value in values]
        assert words[2 : 2 + len(values)] == shown
        if len(values) == 1:
            continue
        for finger, text in zip(FINGERS, shown, strict=False):
            end = head.index(f" {finger}") + 1 + len(finger)
            assert line[:end].endswith(text), (finger, line)
    assert "simulated" in lines[-1]


def test_the_status_table_has_a_line_per_finger() -> None:
    lines = run("exo", "status", "-p", fake()).lines
    for index, finger in enumerate(FINGERS):
        (line,) = [text for text in lines if text.startswith(f"{finger} ")]
        numbers = [POWER_ON[name][2][index] for name in
                   ("position_actual", "position_set", "force_actual", "force_set", "current", "temperature")]  # fmt: skip
        assert line.split()[1:] == [*map(str, numbers), "ok"]
    assert "115200" in lines[0] and "558" in lines[0] and "simulated" in lines[0]
    assert any("660" in line for line in lines)
    sick = run("exo", "status", "-p", fake(fault="faults")).out
    assert "over_temperature, over_current" in sick and "motor_abnormal, communication" in sick
    fresh = run("exo", "status", "-p", fake(fault="fresh")).out
    assert "-1" not in fresh.replace("-11", "").replace("-13", "").replace("-15", "")


def test_the_simulated_mark_is_in_every_human_output() -> None:
    for args in (("dump",), ("status",), ("get", "id"), ("id",), ("scan",), ("read", "1000", "2"), ("clear-errors",)):
        assert "simulated" in run("exo", *args, "-p", fake()).out, args


# -- plain, csv, ndjson -----------------------------------------------------------------------------------------------


def test_plain_is_bare() -> None:
    assert run("exo", "get", "system_voltage", "--format", "plain", "-p", fake()).out == "558\n"
    assert (
        run("exo", "get", "position_actual", "--format", "plain", "-p", fake()).out == "110\n220\n330\n440\n550\n660\n"
    )
    result = run("exo", "get", "error.index", "temperature.index", "id", "--format", "plain", "-p", fake())
    assert sorted(result.lines) == ["0", "1", "34"]
    dump = run("exo", "dump", "--format", "plain", "-p", fake())
    assert len(dump.lines) == 42
    assert dump.lines[0].split("\t")[0] == "id"
    assert {line.count("\t") for line in dump.lines} == {dump.lines[0].count("\t")}
    assert dump.err == ""


@pytest.mark.real
def test_plain_in_a_shell() -> None:
    done = subprocess.run(
        ["sh", "-c", f'v=$({sys.executable} -m handctl exo get system_voltage --format plain --fake); echo "[$v]"'],
        env=clean_environment(), capture_output=True, text=True, timeout=20, check=False,
    )  # fmt: skip
    assert (done.stdout, done.stderr, done.returncode) == ("[558]\n", "", 0)


def test_csv_is_rfc_4180() -> None:
    result = run("exo", "dump", "--csv", "-p", fake())
    assert result.raw.count(b"\r\n") == 43
    assert result.raw.count(b"\n") == 43
    assert result.raw.endswith(b"\r\n")
    rows = list(csv.DictReader(io.StringIO(result.raw.decode(), newline="")))
    assert [(row["name"], row["finger"], row["value"]) for row in rows[7:9]] == [
        ("position_set", "ring", "252"),
        ("position_set", "middle", "353"),
    ]
    assert {len(row) for row in csv.reader(io.StringIO(result.raw.decode(), newline=""))} == {len(rows[0])}
    assert not any("error" in row for row in rows)
    quoted = run("exo", "describe", "baud_code", "--csv")
    assert '"0 = 115200 baud, 1 = 57600 baud, 2 = 19200 baud"' in quoted.out


def test_csv_of_a_stream_keeps_its_columns_when_a_sample_fails() -> None:
    link = fake(fault="silent", after=2, every=3)
    result = run("exo", "watch", "system_voltage", "--count", "9", "--retries", "0", "--csv", "-p", link)
    rows = list(csv.DictReader(io.StringIO(result.out)))
    assert result.code == 0 and len(rows) == 9 and list(rows[0])[-1] == "error"
    assert all(None not in row and None not in row.values() for row in rows), "ragged"
    assert sum(bool(row["error"]) for row in rows) >= 2
    assert all(bool(row["value"]) != bool(row["error"]) for row in rows)


def test_csv_of_a_stream_has_one_header_with_units() -> None:
    result = run("exo", "watch", "system_voltage", "current.index", "--count", "3", "--csv", "-p", fake())
    assert result.lines[0].startswith("t_s,name,")
    assert sum(line.startswith("t_s") for line in result.lines) == 1
    assert len(result.lines) == 7
    assert result.raw.count(b"\r\n") == 7


def test_ndjson_of_a_table() -> None:
    rows, end = run("exo", "dump", "--format", "ndjson", "-p", fake()).stream
    assert len(rows) == 42
    assert (rows[5]["name"], rows[5]["value"]) == ("system_voltage", 558)
    assert (end["ok"], end["command"]) == (True, "exo dump")


def test_nothing_but_data_on_stdout() -> None:
    """Notes and warnings go to stderr, in every format."""
    for form in FORMATS:
        result = run("exo", "clear-errors", "-p", fake(fault="over-temperature"), "--format", form)
        assert result.code == 0
        assert "cannot be cleared" not in result.out or form in ("json", "ndjson")
        assert ("cannot be cleared" in result.err) is (form not in ("json", "ndjson"))


def test_quiet_leaves_errors_only() -> None:
    link = fake(fault="over-temperature")
    assert "handctl: warning: " in run("exo", "clear-errors", "-p", link).err
    assert run("exo", "clear-errors", "-q", "-p", link).err == ""
    assert run("exo", "clear-errors", "-q", "-p", link).out == run("exo", "clear-errors", "-p", link).out
    assert run("exo", "scan", "-q", "-p", fake()).err == ""
    assert run("exo", "watch", "id", "--count", "1", "-q", "-p", fake()).err == ""
    failed = run("exo", "dump", "-q", "-p", fake(fault="silent"))
    assert failed.err.startswith("handctl: error: ")


# -- full disk, closed pipe -------------------------------------------------------------------------------------------


def test_colours_are_codes_where_there_is_no_console(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("rich.console.detect_legacy_windows", lambda: True)  # on Windows without a console
    from handctl.screen.terminal_tables import console_on

    with Sink(Settings(kind="exo", color="always", output=str(tmp_path / "out.txt"))) as sink:
        assert not console_on(sink.file, sink.color).legacy_windows


LINK = fake()
RESULTS = (
    *(("exo", "dump", "-p", LINK, "--format", form) for form in FORMATS), ("exo", "describe"), ("-h",), ("exo", "-h"),
    ("exo", "status", "-p", LINK, "--color", "always"), ("exo", "get", "id", "-p", LINK, "--format", "plain"),
    *(("exo", "watch", "-p", LINK, "--count", "2", form) for form in ("--json", "--csv")), ("exo", "watch", "-p", LINK, "--json"),
    ("--version",), ("completion", "bash"), ("doctor",), ("ekso", "time", "-p", "fake://ekso?clock=virtual", "--json"),
)  # fmt: skip


@each_row("args", RESULTS, ids=" ".join)
def test_full_disk_is_one_line_and_not_0(args: tuple[str, ...]) -> None:
    with refusing("full") as full:
        done = run(*args, stdout=full)
    assert done.code == 1
    (line,) = [line for line in done.err.splitlines() if not line.startswith("  Next:")]
    assert line.startswith("handctl: error: stdout")


@each_row(
    ("args", "code"),
    [
        (("exo", "get", "id", "-p", fake(fault="silent"), "--json"), 4),
        (("exo", "get", "id", "-p", fake(fault="silent")), 4),
        (("exo", "dmup", "--json"), 2),
    ],
)
def test_an_error_on_a_full_disk_is_told_once(args: tuple[str, ...], code: int) -> None:
    with refusing("full") as full:
        done = run(*args, stdout=full)
    assert done.code == code
    assert done.err.count("handctl: error: ") == 1, done


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
@pytest.mark.parametrize(("fault", "code"), [("silent", 4), ("bad-checksum", 5), ("healthy", 1)])
@pytest.mark.parametrize("words", [("get", "id"), ("watch", "--count", "2")])
def test_the_error_of_the_device_weighs_more_than_a_full_disk(words: tuple[str, ...], fault: str, code: int) -> None:
    for form in ("json", "csv"):
        done = run("exo", *words, "--format", form, "-o", "/dev/full", "-p", f"fake://exo?clock=virtual&fault={fault}")
        assert done.code == code, done


@each_row("form", ["table", "json"])
def test_what_was_written_is_told_though_stdout_takes_nothing(form: str) -> None:
    with refusing("full") as full:
        done = run("exo", "force", *"12345", "-y", "--format", form, "-p", fake(), stdout=full)
    assert (done.code, done.said[-1]) == (1, "output")
    assert "handctl: note: writes: 1 confirmed" in done.err


@each_row("args", RESULTS, ids=" ".join)
def test_a_reader_that_has_left_is_no_error(args: tuple[str, ...]) -> None:
    with refusing("left") as left:
        done = run(*args, stdout=left)
    assert (done.code, done.err) == (0, "")


@pytest.mark.real
@pytest.mark.parametrize("words", [("exo", "watch", "--count", "2", "--fake", "--json"), ("--version",), ("exo", "-h")], ids=" ".join)  # fmt: skip
def test_a_program_whose_stdout_takes_nothing_says_it_in_one_line(words: tuple[str, ...]) -> None:
    for end in (">/dev/full", ">&-"):
        done = subprocess.run(["sh", "-c", f'exec "$@" {end}', "sh", *program(*words)], env=clean_environment(),
                              stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, timeout=PATIENCE, check=False, text=True)  # fmt: skip
        assert done.returncode == 1 and done.stderr.count("handctl: error: ") == 1, done
        assert done.stderr.count("\n") == 1 + done.stderr.count("\n  Next: "), done
        assert done.stderr.startswith("handctl: error: stdout"), done


@pytest.mark.real
@pytest.mark.parametrize(
    "args", [("exo", "describe"), ("exo", "watch", "--fake", "--json", "--rate", "0")], ids=" ".join
)
def test_a_closed_pipe_is_quiet(args: tuple[str, ...]) -> None:
    process = subprocess.Popen(program(*args), stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                               stdin=subprocess.DEVNULL, env=clean_environment())  # fmt: skip
    assert process.stdout is not None and process.stderr is not None
    if "watch" in args:
        process.stdout.readline()
    process.stdout.close()
    try:
        assert process.wait(PATIENCE) in (0, 141, -signal.SIGPIPE)
        assert process.stderr.read() == b""
    finally:
        process.kill()
        process.stderr.close()


@pytest.mark.real
def test_head_gets_its_line() -> None:
    done = subprocess.run(["bash", "-c", f"{sys.executable} -m handctl exo watch --fake --csv --rate 0 | head -1"],
                          env=clean_environment(), capture_output=True, timeout=20, check=False)  # fmt: skip
    assert done.stdout.startswith(b"t_s,name,")
    assert done.stdout.count(b"\n") == 1
    assert done.stderr == b""


# -- streams ----------------------------------------------------------------------------------------------------------


def test_watch_counts_samples_and_tells_the_true_rate() -> None:
    rows, end = run("exo", "watch", "position_actual", "--count", "11", "--rate", "20", "--json", "-p", fake()).stream
    assert len(rows) == 66
    assert sorted({row["t"] for row in rows}) == pytest.approx([sample / 20 for sample in range(11)])
    assert [row["value"] for row in rows[:6]] == [110, 220, 330, 440, 550, 660]
    assert end["stream"] == {"samples": 11, "failed": 0, "late": 0, "seconds": 0.5, "rate_hz": 20.0, "asked_hz": 20.0}
    assert end["counters"]["sent"] == 12  # and one that shows which device it is


def test_watch_for_a_duration() -> None:
    rows, end = run("exo", "watch", "id", "--duration", "2", "--rate", "4", "--json", "-p", fake()).stream
    assert len(rows) == 8
    assert end["stream"]["rate_hz"] == 4.0
    both = run("exo", "watch", "id", "--duration", "2", "--count", "3", "--rate", "4", "--json", "-p", fake())
    assert both.stream[1]["stream"]["samples"] == 3


def test_watch_that_cannot_keep_up_says_so() -> None:
    link = fake(wire=19200)
    _, end = run("exo", "watch", "--count", "20", "--rate", "100", "--json", "-p", link, "--baud", "115200").stream
    assert end["stream"]["asked_hz"] == 100
    assert 5 < end["stream"]["rate_hz"] < 30
    assert end["stream"]["late"] > 0


def test_watch_without_names_shows_what_changes() -> None:
    rows, _ = run("exo", "watch", "--count", "1", "--json", "-p", fake()).stream
    names = list(dict.fromkeys(row["name"] for row in rows))
    assert names == ["position_actual", "force_actual", "current", "error", "temperature"]
    assert len(rows) == 26


@pytest.mark.real
def test_watch_in_real_time() -> None:
    """On a machine that has time; one that has none is late now and then."""
    rates: list[float] = []

    def watched() -> None:
        result = run_program("exo", "watch", "id", "--count", "6", "--rate", "20", "--json", "--fake")
        rows, end = result.stream
        assert (result.code, len(rows)) == (0, 6)
        rates.append(end["stream"]["rate_hz"])

    for _ in range(10):
        in_time(watched, 0.2, 5.0)
        if rates[-1] == pytest.approx(20, rel=0.1):
            return
    pytest.fail(f"never: {rates}")


@each_row("number", [signal.SIGINT, signal.SIGTERM])
@each_row("how", ["--json", "--csv", "--format=plain", "--format=table"])
def test_a_signal_ends_a_stream_in_order(number: signal.Signals, how: str) -> None:
    with pressed_at(0.25, number):
        result = run("exo", "watch", "--rate", "10", "-p", fake(), how)
    assert (result.code, result.said[-1]) == (130, "interrupted")
    if how == "--json":
        rows, end = result.stream
        assert (end["exit_code"], end["ok"]) == (130, False)
        assert end["stream"]["samples"] == len(rows) / 26 == 3
    else:
        assert result.out.endswith("\n")


@each_row("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_during_a_wait(number: signal.Signals) -> None:
    """Not a stream: nothing reaches stdout until then. JSON says that it was interrupted."""
    with pressed_at(1.0, number):
        result = run("exo", "dump", "-p", fake(fault="silent"), "--timeout", "30", "--json")
    assert (result.code, result.error["code"]) == (130, "interrupted")


@pytest.mark.real
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_program_in_a_wait(number: signal.Signals, tmp_path: Path) -> None:
    trace = tmp_path / "t.txt"
    words = ("exo", "dump", "-p", "fake://exo?fault=silent", "--timeout", "30", "--json", "--trace", trace)
    process = subprocess.Popen(program(*words),
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=clean_environment())  # fmt: skip
    wait_until(lambda: trace.exists() and " > " in trace.read_text(encoding="utf-8"))
    process.send_signal(number)
    out, err = process.communicate(timeout=PATIENCE)
    result = Result(process.returncode, out, err)
    assert (result.code, result.error["code"]) == (130, "interrupted")
    assert "Traceback" not in result.err


def test_the_closing_line_of_an_error() -> None:
    result = run("exo", "watch", "id", "--json", "-p", fake(fault="silent", after=4), "--retries", "0")
    rows, end = result.stream
    assert result.code == 4
    assert [row.get("value") for row in rows] == [1, 1, 1, *[None] * (len(rows) - 3)]
    assert end["messages"][-1]["code"] == "no-answer"
    assert json.loads(result.lines[-1]) == {"end": end}


@pytest.mark.real
def test_an_interrupted_stream_leaves_a_whole_file(tmp_path: Path) -> None:
    path = tmp_path / "out.ndjson"
    process = subprocess.Popen(
        program("exo", "watch", "id", "--fake", "--rate", "20", "--json", "-o", path), env=clean_environment()
    )
    wait_until(lambda: any(part.read_text().count("\n") >= 5 for part in tmp_path.glob("*.part")), 20.0)
    process.send_signal(signal.SIGINT)
    assert process.wait(PATIENCE) == 130
    *rows, last = [json.loads(line) for line in path.read_text().splitlines()]
    assert len(rows) >= 5 and {row["value"] for row in rows} == {1}
    assert last["end"]["exit_code"] == 130
    assert [entry.name for entry in tmp_path.iterdir()] == ["out.ndjson"]


# -- the sink, by itself ----------------------------------------------------------------------------------------------


class Gone(io.StringIO):
    """A pipe whose reader has left."""

    def write(self, text: str) -> int:
        raise BrokenPipeError(32, "Broken pipe")


def test_a_reader_that_leaves_in_the_middle_of_a_write_is_quiet() -> None:
    sink = Sink(Settings())
    sink.file = Gone()
    sink.write("x" * 100_000)
    assert sink.broken
    sink.write("more")


def test_a_file_that_was_not_finished_takes_no_place(tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError), Sink(Settings(output=str(path))) as sink:
        sink.write("half")
        raise ZeroDivisionError
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_nothing_is_written_behind_a_reader_that_sleeps(tmp_path: Path) -> None:
    """Also not the closing line: waiting until it is taken would never end."""

    def samples() -> Iterator[Sample]:
        yield Sample(0.0, ({"name": "id", "value": 1},))
        raise OutputError("the rows were not taken", code="reader")

    path = tmp_path / "out.ndjson"
    settings = Settings(output=str(path), format="ndjson")
    with Sink(settings) as sink:
        context = SimpleNamespace(settings=settings, simulated=True, envelope=lambda failure, extra=None: {"ok": False}, closing=lambda failure, extra=None: {"end": {"ok": False}},
                                  with_cause_named=lambda failure: failure)  # fmt: skip
        failure = stream(Table(columns=(Column("value", "Value"),), samples=samples()), sink, context)  # type: ignore[arg-type]
    assert isinstance(failure, OutputError)
    assert path.read_text() == '{"t": 0.0, "name": "id", "value": 1}\n'


def test_a_value_that_could_not_be_read_is_empty_in_plain() -> None:
    """A script that takes the last word of a line must not get a word of the error."""
    link = "fake://aidin?clock=virtual&start=homed&fault=wrong-length"
    result = run("aidin", "get", "motor_pos", "joint_pos", "--format", "plain", "-p", link)
    assert result.code == 5
    assert result.lines[:15] == [""] * 15
    assert len(result.lines) == 35 and all(float(line) > -180 for line in result.lines[15:])


def test_csv_has_a_column_for_what_could_not_be_read() -> None:
    link = "fake://aidin?clock=virtual&start=homed&fault=wrong-length"
    rows = list(csv.DictReader(io.StringIO(run("aidin", "get", "motor_pos", "joint_pos", "--csv", "-p", link).out)))
    assert len(rows) == 35
    assert all("expected 15 numbers, found 14" in row["error"] and row["value"] == "" for row in rows[:15])
    assert all(row["error"] == "" and row["value"] for row in rows[15:])
    assert "error" not in run("exo", "get", "id", "--csv", "-p", fake()).out
