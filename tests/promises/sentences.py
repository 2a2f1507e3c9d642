"""Each sentence of handctl-safety(7), handctl-stopping(7), handctl-movements(7) and handctl-output(7) that names an exit code, and each row of the table of exit codes."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from unittest import mock

from handctl import guides
from handctl.docgen.man_pages import exit_codes
from handctl.families import FAMILIES
from handctl.guides import Item, Para
from tests.contract.cell import wrote
from tests.contract.facts import facts_of, passed
from tests.promises.cells import Cell, link_of, made, needs, row_of, typed
from tests.promises.symptoms import writing_of
from tests.promises.verbs import SICK
from tests.support.cli import run
from tests.support.places import TESTS

GUIDES = ("safety", "stopping", "movements", "output")
SENTENCE = re.compile(r"(?<=[.:])\s+(?=[A-Z`])")


def sentences() -> list[str]:
    """Those outside of tables and code."""
    found = []
    for guide in GUIDES:
        texts = [block.text for block in guides.blocks(guides.source(guide)) if isinstance(block, Para | Item)]
        found += [
            one for text in texts for one in SENTENCE.split(text) if re.search(r"exit code \d", one, re.IGNORECASE)
        ]
    return found


COVERED: Mapping[str, tuple[str, str]] = {
    "Only two different `-p` side by side": (
        "kernel/test_given_twice.py",
        "test_of_any_other_option_the_last_one_counts",
    ),
    "If a value goes past it, `watch` and `log` end at once": ("kernel/test_limits.py", "test_until_ends_a_stream"),
    "Exit code 7 means that something was found or could not be read": (
        "tools/test_service.py",
        "test_a_step_that_fails_is_a_row_with_its_code",
    ),
    "Only `log --force` replaces a recording": ("kernel/test_file_gate.py", "test_no_output_replaces_a_recording"),
    "A limit for a quantity that was never read": (
        "kernel/test_limits.py",
        "test_a_limit_that_nothing_was_compared_with",
    ),
    "A handctl command that was started before the stop": (
        "stop/test_started_before.py",
        "test_a_script_that_slept_through_a_stop_moves_nothing",
    ),
    "If the device has a new target, or its position is still changing": (
        "stop/test_standstill.py",
        "test_what_moves_slowly_behind_a_stop_is_seen",
    ),
    "A reading farther out does not count as a position": (
        "stop/test_standstill.py",
        "test_an_exo_holds_each_finger_that_reads_a_position",
    ),
    "A device that is slowing down gets up to 0.9 s": ("stop/test_standstill.py", "test_readings_after_a_stop"),
    "If the device no longer replies, handctl cannot tell": (
        "stop/test_standstill.py",
        "test_a_device_that_is_not_seen_again_is_no_success",
    ),
    "Ctrl-C ends only the `calibrate` command": (
        "stop/test_calibration.py",
        "test_a_stop_says_that_the_calibration_goes_on",
    ),
    "nothing is written (exit code 6)": ("stop/test_whose.py", "test_"),
    "If it detects none on a CAN bus, no stop is sent (exit code 2)": (
        "stop/test_whose.py",
        "test_where_nobody_answers_the_next_step_is_said",
    ),
    "While firmware is being downloaded": ("stop/test_which_device.py", "test_a_download_that_does_not_hear"),
    "If it is a firmware download": ("stop/test_which_device.py", "test_no_stop_reaches_a_download"),
    "In each case, the other command ends with exit code 130": ("stop/test_stop.py", "test_"),
    "Exit code 130 means that the device acknowledged the stop": (
        "contract/test_contract.py",
        "test_ctrl_c_in_a_movement_sends_its_stop",
    ),
    "With exit code 3, 4, 5, 6 or 7, the device may still be moving": (
        "stop/test_stop_sequence.py",
        "test_a_hold_that_is_not_acknowledged_is_no_stop",
    ),
    "For an EksoNR and an AIDIN-hand, there are exceptions": (
        "aidin/test_exchange_settings.py",
        "test_stop_says_when_feedback_proves_nothing",
    ),
    "For an EksoNR, exit code 0 only means": ("stop/test_stop.py", "test_an_ekso_has_no_stop_and_it_is_said"),
    "Exit code 0 means that the device acknowledged the stop": (
        "stop/test_standstill.py",
        "test_",
    ),
    "Exit code 0 means that Ctrl-C came too late": ("kernel/test_interrupts.py", "test_"),
    "the command is refused with exit code 6": ("promises/symptoms.py", "other_family"),
    "If the device does not reply": ("promises/sentences.py", "_silent"),
    "The other results": ("kernel/test_movement.py", "test_what_is_expected"),
    "If two devices reply": ("inspire/test_twins.py", "test_nothing_that_strands_reaches_two_devices_with_one_id"),
    "If another program has the port open, handctl refuses to use it": ("link/test_rivals.py", "test_"),
    "the line or call that finds the link lost stops it": (
        "stop/test_lost_port.py",
        "test_what_an_earlier_line_has_left_moving",
    ),
    "show no table": ("contract/test_strangers.py", "test_a_stranger_is_never_shown_as_a_table"),
    "The command then ends with exit code 4 or 5": ("contract/test_strangers.py", "test_"),
}
"""Words of a sentence -> the test that holds it against the families: file, and how its function begins."""


def cells() -> Iterator[Cell]:
    for number, sentence in enumerate(sentences(), 1):
        yield Cell(f"sentence {number}: {sentence[:60]}", partial(_is_tried, sentence))
    for family in FAMILIES:
        yield Cell(f"{family} {writing_of(family)} into silence", partial(_silent, family))
        for code, _ in exit_codes():
            if code in CODES:
                yield Cell(f"{family}: exit code {code}", partial(CODES[code], family))
    yield Cell("each exit code is tried", _all_codes)


def _is_tried(sentence: str, _folder: Path) -> None:
    places = [place for words, place in COVERED.items() if words in sentence]
    assert places, f"no test is named for: {sentence}"
    for file, name in places:
        tree = ast.parse((TESTS / file).read_text(encoding="utf-8"))
        assert any(isinstance(node, ast.FunctionDef) and node.name.startswith(name) for node in ast.walk(tree)), (
            file,
            name,
        )


def _silent(family: str, folder: Path) -> None:
    trace = made(folder) / "trace.txt"
    name = writing_of(family)
    needs(typed(family, name, folder, link_of(family, "fault=silent"), "--trace", trace), 4)
    assert not wrote(family, name, passed(trace))


def _done(family: str, _folder: Path) -> None:
    needs(run(family, "status", "-p", link_of(family)), 0)


def _no_output(family: str, folder: Path) -> None:
    """The disk is full."""
    made(folder)
    with mock.patch("os.replace", side_effect=OSError(28, "No space left on device")):
        needs(run(family, "status", "-o", folder / "out.txt", "-p", link_of(family)), 1)


def _usage(family: str, _folder: Path) -> None:
    needs(run(family, "get", "nosuch", "-p", link_of(family)), 2)


def _link(family: str, _folder: Path) -> None:
    needs(run(family, "status", "-p", link_of(family, "fault=disconnect")), 3)


def _silence(family: str, _folder: Path) -> None:
    needs(
        run(family, "status", "-p", link_of(family, "fault=deaf&exchange=mute" if family == "aidin" else "fault=deaf")),
        4,
    )


def _garbage(family: str, _folder: Path) -> None:
    needs(run(family, "status", "-p", link_of(family, "fault=loopback")), 5)


def _refused(family: str, folder: Path) -> None:
    """A device that refuses, or one that is another."""
    state = "fault=refuse" if row_of(family).tcp_port is None or row_of(family).wires else "fault=frozen"
    assert any(
        typed(family, name, made(folder), link_of(family, state)).code in (6, 7)
        for name in facts_of(family).writes
        if name != "stop"
    )


def _failed(family: str, _folder: Path) -> None:
    assert 7 in [run(family, "status", "--check", "-p", link_of(family, state)).code for state in SICK]


def _unconfirmed(family: str, folder: Path) -> None:
    """Of what asks at least one command asks of each family."""
    made(folder)
    names = [name for name in facts_of(family).writes if name != "stop"]
    assert any(
        run(family, *name.split(), *facts_of(family).words(name, folder), "-p", link_of(family)).code == 8
        for name in names
    )


CODES = {
    0: _done,
    1: _no_output,
    2: _usage,
    3: _link,
    4: _silence,
    5: _garbage,
    6: _refused,
    7: _failed,
    8: _unconfirmed,
}
ELSEWHERE = {130: ("contract/test_contract.py", "test_ctrl_c_in_a_movement_sends_its_stop")}


def _all_codes(_folder: Path) -> None:
    assert {code for code, _ in exit_codes()} == {*CODES, *ELSEWHERE}
