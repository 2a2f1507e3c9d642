"""`handctl sim barrett` as a server on a pseudo-terminal and on TCP, with handctl and pyserial as its clients."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pexpect
import pytest
import serial

from tests.barrett.commands import names, power_on, sent_lines, values_of, written_lines
from tests.support.cli import (
    PATIENCE,
    Result,
    Simulator,
    clean_environment,
    kept,
    program,
    run,
    run_program,
    wait_until,
)
from tests.support.cli import (
    start as started,
)
from tests.support.each_row import each_row

Start = Callable[..., Simulator]
PLACES: dict[str, tuple[str, ...]] = {"pty": ("--pty",), "tcp": ("--tcp", "127.0.0.1:0")}
READY = ("--set", "initialized=1")
PROMPT = b"\n\r=> "


@pytest.fixture
def start() -> Iterator[Start]:
    running: list[Simulator] = []

    def starter(place: str, *args: str | Path) -> Simulator:
        running.append(Simulator(*PLACES[place], *args, kind="barrett"))
        return running[-1]

    yield starter
    for simulator in running:
        simulator.stop()


@pytest.fixture(autouse=True)
def state_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The journal of saves goes to the test's own directory."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))


places = each_row("place", PLACES)


def f1_at(panel: Path) -> int:
    """Where finger 1 is, in counts, as the simulator's panel tells."""
    return int(run("sim", "control", panel, "motors").out.split()[2])


def do(link: str, *args: str | Path) -> Result:
    result = run("barrett", *args, "-p", link, "--json")
    assert result.code == 0, result
    return result


# -- the same as in process -------------------------------------------------------------------------------------------


@pytest.mark.real
@places
def test_status_dump_and_set(start: Start, place: str) -> None:
    link = start(place, *READY).link
    assert re.fullmatch({"pty": r"/dev/\S+", "tcp": r"tcp://127\.0\.0\.1:\d+"}[place], link)
    dump = run_program("barrett", "dump", "-p", link, "--json")
    assert (dump.code, dump.err) == (0, "")
    truth = power_on()
    got = values_of(dump)
    assert 0 <= got.pop(("UPSECS", None)) - truth.pop(("UPSECS", None)) <= 10
    assert got == truth
    assert dump.json["device"] == {"kind": "barrett", "link": link, "fake": False, "id": None, "model": "BH8"}
    assert values_of(do(link, "status", "--check")).items() >= names("P", "SG", "S", "OD")(truth).items()
    assert values_of(do(link, "set", "MCV=80", "--motors", "12")) == {("MCV", "F1"): 80, ("MCV", "F2"): 80}
    rows = run("barrett", "get", "MCV", "-p", link, "--format", "plain")
    assert rows.out == "80\n80\n100\n60\n"
    samples, end = run("barrett", "watch", "P", "--count", "5", "--rate", "50", "-p", link, "--json").stream
    assert [row["value"] for row in samples] == [0] * 20 and end["stream"]["samples"] == 5


@pytest.mark.real
def test_movements(start: Start) -> None:
    """HI, then C."""
    link = start("tcp").link
    assert run("barrett", "close", "-p", link).code == 6
    assert [row["value"] for row in do(link, "init").rows] == [0] * 4

    assert [row["value"] for row in do(link, "close", "--motors", "G").rows] == [17000] * 3
    assert values_of(do(link, "get", "P.F1", "S.F1")) == {("P", "F1"): 17000, ("S", "F1"): 0}


# -- speed ------------------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_baud_and_the_next_command_finds_it(start: Start, tmp_path: Path) -> None:
    link, trace = start("pty", *READY).link, tmp_path / "t.txt"
    result = do(link, "baud", "38400", "--yes", "--trace", trace)
    assert values_of(result) == {("BAUD", None): 384} and written_lines(trace) == ["PSET BAUD 384"]
    later = do(link, "get", "BAUD", "SN")
    assert values_of(later) == {("BAUD", None): 384, ("SN", None): 1042}
    (found,) = [message for message in later.json["messages"] if message["code"] == "speed"]
    assert "38400" in found["text"] and "--baud 38400" in found["hint"]
    at_once = run("barrett", "get", "SN", "-p", link, "--baud", "38400", "--json")
    assert (at_once.code, at_once.codes()) == (0, [])


@pytest.mark.real
def test_a_saved_speed_survives_the_power(start: Start, tmp_path: Path) -> None:
    """BAUD in RAM is lost at a power cycle, saved it stays (§5.2.3, §5.4.1)."""
    panel = tmp_path / "panel"
    link = start("pty", *READY, "--control", panel, "--set", "boot=0.1").link

    def power_cycle() -> int:
        assert run("sim", "control", panel, "power-cycle").code == 0
        seen: list[Result] = []  # until it has booted

        def answers() -> bool:
            seen.append(run("barrett", "get", "BAUD", "-p", link, "--json"))
            return seen[-1].code == 0

        wait_until(answers)
        return int(seen[-1].rows[0]["value"])

    do(link, "baud", "19200", "--yes")
    assert power_cycle() == 96
    do(link, "baud", "19200", "--save", "--yes")
    assert run("sim", "control", panel, "eeprom", "BAUD").out.strip().endswith("192")
    assert power_cycle() == 192
    banner = run("barrett", "reset", "-y", "-p", link, "--baud", "19200", "--json")
    assert (banner.code, banner.rows[0]["value"]) == (0, "BarrettHand Firmware\nVersion 4.33")


# -- interrupted ------------------------------------------------------------------------------------------------------


@pytest.mark.real
@each_row(("place", "number"), [("pty", signal.SIGINT), ("tcp", signal.SIGINT), ("pty", signal.SIGTERM)])
def test_interrupt_in_the_middle_of_a_movement(start: Start, tmp_path: Path, place: str, number: int) -> None:
    """^C stops every motor (§5.5 case 4): exit 130, positions told, and there they stay."""
    panel, trace = tmp_path / "panel", tmp_path / "t.txt"
    link = start(place, *READY, "--control", panel).link
    do(link, "set", "MCV=20", "--force")  # 17,000 counts in 3.5 s
    process = started(
        ["barrett", "close", "-p", link, "--json", "--trace", trace],
        clean_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    wait_until(lambda: trace.exists() and "C" in sent_lines(trace))
    wait_until(lambda: f1_at(panel) > 1500)
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130, (out, err)
    content = json.loads(out)
    (message,) = [message for message in content["messages"] if message["level"] == "error"]
    told = {motor: int(value) for motor, value in re.findall(r"(F\d|SPREAD) (\d+)", message["text"])}
    assert set(told) == {"F1", "F2", "F3", "SPREAD"} and 500 < told["F1"] < 15000, message
    assert "16384" in message["text"]
    assert written_lines(trace) == ["C"]
    now = {row["motor"]: row["value"] for row in do(link, "get", "P").rows}
    assert all(abs(now[motor] - told[motor]) <= 2 for motor in told), (now, told)


@pytest.mark.real
def test_a_hand_that_ignores_the_abort(start: Start, tmp_path: Path) -> None:
    """What could not be stopped is said, with what to do."""
    panel, trace = tmp_path / "panel", tmp_path / "t.txt"
    link = start("pty", *READY, "--fault", "no-abort", "--control", panel).link
    do(link, "set", "MCV=16", "--force")
    process = started(
        ["barrett", "close", "-p", link, "--json", "--trace", trace],
        clean_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    wait_until(lambda: trace.exists() and "C" in sent_lines(trace))
    wait_until(lambda: f1_at(panel) > 500)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=30)
    assert process.returncode == 4
    assert b"not-stopped" in out and b"Traceback" not in out


# -- the port ---------------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_a_second_opener_is_told(start: Start, tmp_path: Path) -> None:
    link = start("pty", *READY).link
    do(link, "set", "MCV=40")  # 17,000 counts in 1.8 s
    process = started(
        ["barrett", "close", "--motors", "1", "-p", link, "--trace", tmp_path / "trace"],
        clean_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    wait_until(lambda: (tmp_path / "trace").exists() and "> 31 43 0D" in (tmp_path / "trace").read_text(), 20.0)
    second = run("barrett", "get", "SN", "-p", link, "--json")
    _, err = process.communicate(timeout=30)
    assert second.code == 3 and second.error["hint"], second
    assert process.returncode == 0, err  # the first one is not disturbed


@pytest.mark.real
@places
def test_a_server_that_is_killed(start: Start, tmp_path: Path, place: str) -> None:
    simulator, trace = start(place, *READY), tmp_path / "t.txt"
    process = started(
        ["barrett", "watch", "P", "--rate", "50", "-p", simulator.link, "--json", "--trace", trace],
        clean_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    wait_until(lambda: trace.exists() and len(trace.read_text().splitlines()) > 12)
    with kept(simulator.link):
        simulator.stop(signal.SIGKILL)
        out, err = process.communicate(timeout=30)
        assert process.returncode == 3, (out, err)
        last = json.loads(out.decode().splitlines()[-1])["end"]
        assert last["exit_code"] == 3 and b"Traceback" not in err
        gone = run("barrett", "get", "SN", "-p", simulator.link, "--json")
        assert gone.code == 3


# -- foreign clients --------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_pyserial_client_and_handctl_take_turns(start: Start) -> None:
    """A half-typed line and an answer that nobody fetched belong to nobody."""
    link = start("pty", *READY).link
    for _ in range(2):
        with serial.Serial(link, 9600, timeout=PATIENCE) as port:
            port.write(b"fget sg\r")
            assert port.read_until(PROMPT) == b"fget sg\n\r112 119 126 255" + PROMPT
            port.write(b"FSET DP 1\r2FSET DP 99")
        result = do(link, "get", "DP")
        assert [row["value"] for row in result.rows] == [1] * 4
    url = start("tcp", *READY).link.replace("tcp://", "socket://")
    assert values_of(do(url, "get", "SN")) == {("SN", None): 1042}


@pytest.mark.real
def test_live_control_through_a_pipe(start: Start, tmp_path: Path) -> None:
    """Each line counts from when it comes; one that is a second old counts no more; the end of the pipe ends the loop."""
    link, trace = start("pty", *READY).link, tmp_path / "trace.txt"

    def sent() -> list[str]:
        text = trace.read_text(encoding="utf-8") if trace.exists() else ""
        return [line.split("> ", 1)[1] for line in text.splitlines() if " > " in line]

    words = ("realtime", "--motors", "1", "--receive", "position", "--control", "-", "--rate", "50", "--timeout", "1",
             "--no-guard", "window")  # fmt: skip
    with subprocess.Popen(
        program("barrett", *words, "--trace", trace, "-p", link, "--json"), env=clean_environment(),
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdin is not None and process.stderr is not None

        def say(text: str, block: str) -> None:
            process.stdin.write(text.encode())  # type: ignore[union-attr]
            process.stdin.flush()  # type: ignore[union-attr]
            wait_until(lambda: block in sent())

        say("velocity\n20\n", "43 14")
        say("-30\n", "43 E2")
        wait_until(lambda: sent()[-1] == "43 00")  # a second without a line
        say("1", "43 00")
        say("0\n", "43 0A")  # a line that comes in two pieces
        process.stdin.close()
        assert (process.wait(PATIENCE), process.stderr.read()) == (0, b"")
    assert sent()[sent().index("03", 3) - 1] == "63 00" and "31 54 0D" in sent()  # velocity 0, ^C, 1T
    moving = [block for block in sent() if block.startswith("43")]
    assert list(dict.fromkeys(moving)) == ["43 14", "43 E2", "43 00", "43 0A"]


# -- a terminal program ---------------------------------------------------------------------------------------------------


@pytest.mark.real
def test_a_terminal_program_talks_to_the_hand(start: Start) -> None:
    """No client of the BarrettHand is in a registry: pyserial's miniterm, which knows nothing of GCL, reads, sets, moves, stops."""
    simulator = start("pty", *READY)
    terminal = pexpect.spawn(
        sys.executable, ["-m", "serial.tools.miniterm", "--raw", "--eol", "CR", simulator.link, "9600"], timeout=20, echo=False,
        env={**clean_environment(), "TERM": "dumb"},
    )  # fmt: skip
    try:
        terminal.expect_exact("Quit:")
        for typed, answer in (
            ("\r", b"\n\r=> "),
            ("FGET DP\r", b"FGET DP\n\r8500 8500 8500 1575\n\r=> "),
            ("1FSET DP 77 MCV 16\r", b"1FSET DP 77 MCV 16\n\r=> "),
            ("1FGET DP MCV\r", b"1FGET DP MCV\n\r77\n\r16\n\r=> "),
            ("VERS\r", b"VERS\n\r4.33\n\r=> "),
            ("1C\r", b"1C"),
            ("\x03", b"\n\rERR 16384\n\r=> "),
        ):
            terminal.send(typed)
            terminal.expect_exact(answer.replace(b"\n", b"\r\n"))  # by its own terminal
    finally:
        terminal.close(force=True)
    rows = do(simulator.link, "get", "P", "DP").rows
    moved = {(row["parameter"], row["motor"]): row["value"] for row in rows}
    assert moved["DP", "F1"] == 77
    assert moved["P", "F1"] < 17000, "^C ended it before its target"
