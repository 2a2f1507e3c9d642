"""The tools of the field kit as programs: what a start loads, what a pipe gets, what closed streams do."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.support.cli import Simulator, clean_environment, program, run
from tests.support.each_row import each_row
from tests.support.loading import heavy, loaded

TOOLS = ("ports", "scan", "doctor")


@pytest.mark.real
@each_row("tool", TOOLS)
def test_help_loads_no_family_and_no_back_end(tool: str) -> None:
    code, modules = loaded(tool, "-h")
    assert code == 0
    assert heavy(modules) == set()
    assert not any(name.startswith(("handctl.devices.", "handctl.sim", "handctl.link.serial")) for name in modules)


@pytest.mark.real
@each_row("args", [("ports", "--json"), ("doctor", "--json")])
def test_looking_at_the_machine_loads_no_family_and_on_linux_no_pyserial(args: tuple[str, ...]) -> None:
    code, modules = loaded(*args)
    assert code in (0, 7)
    assert heavy(modules) == set()
    assert not any(name.startswith(("handctl.devices.", "handctl.sim")) for name in modules)


@pytest.mark.real
def test_a_scan_for_one_family_loads_that_one() -> None:
    code, modules = loaded("scan", "-p", "fake://ekso?clock=virtual", "--family", "ekso", "--json")
    assert code == 0
    families = {name.split(".")[2] for name in modules if name.startswith("handctl.devices.")}
    assert families == {"ekso"}


@each_row("tool", TOOLS)
def test_a_dry_run_of_what_only_reads_is_refused(tool: str) -> None:
    assert run(tool, "-n").code == 2


def test_stdout_holds_data_only() -> None:
    answer = run("scan", "-p", "fake://ekso?clock=virtual", "--format", "plain", "-v")
    assert (answer.code, answer.lines) == (0, [answer.out.rstrip("\n")])
    assert answer.out.startswith("ekso\t")
    assert "> 96 00 00 01" in answer.err


@pytest.mark.real
def test_closed_streams_are_not_taken_by_a_link(tmp_path: Path) -> None:
    """Else the port would be descriptor 1 or 2, and what is meant for a person would go to the device."""
    trace = tmp_path / "trace.txt"
    with Simulator("--pty") as simulator:
        for end, code in (("<&- >&- 2>&-", 1), (">&-", 1), ("2>&-", 0), ("<&-", 0)):
            words = program("exo", "get", "id", "-v", "--trace", trace, "-p", simulator.link)
            done = subprocess.run(
                ["sh", "-c", f'exec "$@" {end}', "sh", *words], env=clean_environment(), capture_output=True, timeout=30,
                check=False,
            )  # fmt: skip
            assert (done.returncode, b"id" in done.stdout) == (code, not code), end
            sent = [line.split("> ")[1] for line in trace.read_text().splitlines() if " > " in line]
            assert sent == ["EB 90 01 04 11 E8 03 01 02", "EB 90 01 04 11 46 06 12 74"], end  # then who answers
