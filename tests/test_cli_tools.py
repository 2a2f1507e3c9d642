"""The tools of the field kit as programs: what a start loads, what a pipe gets, what a full disk does."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.cli_support import run, run_program
from tests.test_layers import heavy, loaded

TOOLS = ("ports", "scan", "doctor")


@pytest.mark.parametrize("tool", TOOLS)
def test_help_loads_no_family_and_no_back_end(tool: str) -> None:
    code, modules = loaded(tool, "-h")
    assert code == 0
    assert heavy(modules) == set()
    assert not any(name.startswith(("handctl.devices.", "handctl.sim", "handctl.link.serial")) for name in modules)


@pytest.mark.parametrize("args", [("ports", "--json"), ("doctor", "--json")])
def test_looking_at_the_machine_loads_no_family_and_on_linux_no_pyserial(args: tuple[str, ...]) -> None:
    code, modules = loaded(*args)
    assert code in (0, 7)
    assert heavy(modules) == set()
    assert not any(name.startswith(("handctl.devices.", "handctl.sim")) for name in modules)


def test_a_scan_for_one_family_loads_that_one() -> None:
    code, modules = loaded("scan", "-p", "fake://ekso?clock=virtual", "--family", "ekso", "--json")
    assert code == 0
    families = {name.split(".")[2] for name in modules if name.startswith("handctl.devices.")}
    assert families == {"ekso"}


@pytest.mark.parametrize("tool", TOOLS)
def test_a_dry_run_of_what_only_reads_is_refused(tool: str) -> None:
    assert run(tool, "-n").code == 2


def test_stdout_holds_data_only() -> None:
    answer = run_program("scan", "-p", "fake://ekso?clock=virtual", "--format", "plain", "-v")
    assert (answer.code, answer.lines) == (0, [answer.out.rstrip("\n")])
    assert answer.out.startswith("ekso\t")
    assert "> 96 00 00 01" in answer.err


def test_a_full_disk_is_one_line_and_no_success() -> None:
    with open("/dev/full", "wb") as full:
        done = subprocess.run(
            [sys.executable, "-m", "handctl", "doctor"], stdout=full, stderr=subprocess.PIPE, timeout=30, check=False
        )
    assert done.returncode == 1
    assert b"cannot be written" in done.stderr
