"""Commands that write, interrupted behind a frame that the transcript names, and repeated: a few processes; a file that is half written.

Ctrl-C at each place where a command listens, and at each line of the program, are `tests/contract`; random moments of every command with
every signal are `tests/search/interruption.py`.
"""

from __future__ import annotations

import importlib
import os
import signal
from dataclasses import replace
from pathlib import Path
from unittest import mock

import pytest

from handctl.docgen.read_command_tree import Node, Value, read_tree
from handctl.families import FAMILIES
from handctl.link import Deadline
from tests.barrett import support
from tests.search.interruption import BENCHES, BY_NAME, CASES, cell
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.interruption import Bench

ELSEWHERE = {
    "stop": ("stop.test_stop", "test_the_lock_tells_the_family"),
    "batch": ("stop.test_deadman", "test_a_killed_batch_stops_the_device"),
    "shell": ("kernel.test_shell", "test_a_person_types_confirms_and_finds_the_line_again"),
    "hand pair": ("inspire.test_rh56_pair_cli", "test_ctrl_c_in_the_movement_holds_both_hands_and_names_nobody"),
    "service": ("tools.test_service", "test_an_interrupt_ends_in_a_report_that_is_continued"),
    **{
        f"{family} terminal": ("tools.test_terminal", "test_ctrl_c_stops_what_a_line_has_set_going")
        for family in FAMILIES
    },
    "prove": ("tools.test_prove", "test_ctrl_c_in_the_middle_puts_it_back"),
    "barrett firmware download": ("search.interruption", "downloaded"),
    **dict.fromkeys(
        [f"sim {family}" for family in (*FAMILIES, "bus")],
        ("sim.test_barrett_serve", "test_what_a_kill_leaves_of_settings_and_of_half_a_firmware"),
    ),
}
"""Command -> module and test: a download needs somebody at the power switch, a simulator is no command that ends."""
READ_ONLY = {
    *(f"{family} diff" for family in FAMILIES if family != "aidin"), "trace show", "trace diff", "twin check",
    "barrett firmware check", "sim control", "ekso policy", "plot",
}  # fmt: skip
"""Commands with a FILE that they only read, or a socket."""
OWN_FILES = {"barrett maintenance", "exo dump"}
"""Commands that write a file which is not an argument or option of theirs: a journal, what -o names (one for all)."""
SHORT = [  # case, signal, behind which of its frames: one of each way to end, one of each wire
    ("exo set force_set.index=-9", signal.SIGKILL, 2),
    ("exo restore {}/exo.json --setpoints", signal.SIGINT, 3),
    ("hand-can angle 100 100 100 100 100 -1 --wait 5", signal.SIGINT, 12),
    ("hand-rtu speed 50 -1 -1 50 -1 -1", signal.SIGTERM, 12),
    ("hand-tcp speed 50 -1 -1 50 -1 -1", signal.SIGKILL, 12),
    ("wrist-can set yaw_set=20", signal.SIGKILL, 2),
    ("barrett gcl '1M 5000' '1M 3000'", signal.SIGINT, 3),
    ("ekso log {}/gait.csv --rate 50 --count 20 --force", signal.SIGTERM, 9),
    ("aidin fingertips index.z=120", signal.SIGINT, 4),
]


@pytest.mark.real
@pytest.mark.parametrize(("name", "number", "behind"), SHORT, ids=[f"{one[0]} {one[1].name}" for one in SHORT])
def test_interrupted_and_repeated(tmp_path: Path, name: str, number: int, behind: int) -> None:
    case = BY_NAME[name]
    family, *args = BENCHES[case.bench]
    bench = Bench(family, tmp_path, *args)
    try:
        cell(bench, replace(case, behind=behind), number, None)
    finally:
        bench.stop()


@each_row("seconds", [0.0, 0.5, 1.0, 1.5, 3.0])
def test_a_hand_that_is_still_saving_is_found_at_its_own_speed(seconds: float) -> None:
    """It is silent until FSAVE is through; a search of the speeds that goes on meanwhile comes back to the first."""
    _, link = support.simulated()
    link.write(b"FSAVE\r", Deadline(link.now, link.now() + 1))
    link.sleep(seconds)
    hand = support.hand_on(link)
    hand.line.connect()
    assert link.inner.baud == 9600  # type: ignore[attr-defined]
    assert "speed" not in support.codes(hand)
    assert hand.version() == support.simulated()[0].version()


def test_every_command_that_writes_is_interrupted() -> None:
    """Each that writes to a device, and each that writes a file, has a case here or a test elsewhere."""
    leaves = [node for node in read_tree().walk() if node.path and not node.children]
    written = {
        " ".join(node.path)
        for node in leaves
        if node.writes or any(value is not None and value.kind == "file" for value in _own_values(node))
    }
    lines = [case.command if case.bench == "machine" else f"{BENCHES[case.bench][0]} {case.command}" for case in CASES]
    covered = {name for node in leaves for line in lines if f"{line} ".startswith(f"{(name := ' '.join(node.path))} ")}
    assert not (READ_ONLY | set(ELSEWHERE)) & covered, "they have cases now"
    assert written - READ_ONLY - set(ELSEWHERE) == covered - OWN_FILES, "which command has no case?"
    assert written >= READ_ONLY | set(ELSEWHERE) and covered >= OWN_FILES
    for module, name in set(ELSEWHERE.values()):
        assert callable(getattr(importlib.import_module(f"tests.{module}"), name))


def _own_values(node: Node) -> list[Value | None]:
    """What the arguments and the options of one command take, without the shared options."""
    shared = [option.value for option in node.options if not option.shared]
    return [*(argument.value for argument in node.arguments), *shared]


@each_row("place", ["fsync", "replace"])
@each_row("when", ["before", "behind"])
def test_the_configuration_file_is_the_old_one_or_the_new_one(tmp_path: Path, place: str, when: str) -> None:
    """Ctrl-C where the file is written out and where it takes the place of the old one; the next edit works."""
    config = tmp_path / "config.toml"
    environment = {"HANDCTL_CONFIG": str(config)}
    old = "# kept\nretries = 3\n"
    config.write_text(old, encoding="utf-8")
    true = getattr(os, place)

    def pressed(*args: object) -> None:
        if when == "behind":
            true(*args)
        signal.raise_signal(signal.SIGINT)

    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with mock.patch.object(os, place, pressed):
            first = run("devices", "add", "left", "exo", "-p", "/dev/ttyUSB7", env=environment)
    finally:
        signal.signal(signal.SIGINT, handler)
    text = config.read_text(encoding="utf-8")
    assert text == old or (text.startswith(old) and text.endswith("\n") and "/dev/ttyUSB7" in text), text
    assert first.code == (130 if text == old else first.code) and not list(tmp_path.glob("*.part")), first
    again = run("devices", "add", "left", "exo", "-p", "/dev/ttyUSB7", env=environment)
    assert again.code == 0 or (text != old and again.code == 2), again
    assert run("devices", "show", "left", env=environment).code == 0
