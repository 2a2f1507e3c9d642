"""The frames that mean something else on another generation, from every command over every wire (dossier V24, V30, §6 Q4).

The save of a DF is the factory reset of an F1, its clearing of errors the save of one: neither may reach a hand whose generation
is not proved, nor one of another generation than was typed. Every command that writes against every such hand is the suite harm-generations.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from handctl.families import FAMILIES
from tests.contract.commands import scratch_of, writing_commands
from tests.contract.facts import facts_of, passed
from tests.inspire.generations import DANGERS, FRAMES, SERIAL, STOPS, link_of, unharmed
from tests.support.cli import run, spying
from tests.support.each_row import each_row


@each_row("model", ["f1", "dg2"])
@each_row("wire", SERIAL)
@each_row("assumed", [False, True])
@each_row("frame", FRAMES, ids=lambda frame: frame.hex(" "))
def test_a_frame_that_is_typed_does_not_reach_one_either(
    frame: bytes, assumed: bool, wire: str, model: str, tmp_path: Path
) -> None:
    """--assume-identity alone is no word on the generation."""
    trace = tmp_path / "trace.txt"
    more = ["--assume-identity"] if assumed else []
    with spying() as spy:
        done = run(
            "hand", "raw", frame.hex(), "--force-ambiguous", "-y", *more, "-p", link_of(model, wire), "--trace", trace
        )
    assert done.code in (4, 5, 6), done
    assert frame not in [entry.data for entry in passed(trace) if entry.mark == ">"]
    assert unharmed(spy)


@each_row("frame", [frames[place] for frames in DANGERS.values() for place in (0, 1)])
@each_row("model", ["", "df", "tp"])
def test_a_reset_and_a_stored_movement_need_a_word_more(frame: str, model: str, tmp_path: Path) -> None:
    """Also towards the hand whose frames they are (V24)."""
    with spying() as spy:
        done = run(
            "hand", "raw", frame, "-y", "-p", link_of(model or "tp", "EB90"), *(["--model", model] if model else [])
        )
    assert (done.code, spy.lines) == (2, []), done
    assert "--force-ambiguous" in done.err


@each_row("address", [1003, 1007, 1008, 2320, 2322])
def test_what_lies_beside_the_triggers_is_never_written(address: int) -> None:
    """A stored sequence runs at 2322, a gesture at 1008 (§3.1, §3.3, §9): also with --undocumented."""
    with spying() as spy:
        done = run("hand", "write", str(address), "01", "--undocumented", "-y", "-p", link_of("df", "EB90"))
    assert (done.code, spy.lines) == (2, []), done


@pytest.mark.parametrize("family", [family for family in FAMILIES if family != "hand"])
@pytest.mark.parametrize("model", ["f1", "dg2"])
def test_no_command_of_another_family_sends_one(family: str, model: str, tmp_path: Path) -> None:
    scratch = scratch_of(tmp_path)
    for name in writing_commands(family):
        trace = tmp_path / "trace.txt"
        trace.unlink(missing_ok=True)
        words = [*name.split(), *facts_of(family).words(name, scratch)]
        with spying() as spy:
            done = run(family, *words, "-y", "-p", link_of(model, "EB90"), "--deadline", "20", "--trace", trace)
        assert done.code != 0 or name == STOPS, (name, done)
        sent = b"".join(entry.data for entry in passed(trace) if entry.mark == ">")
        assert not [frame for frame in FRAMES if frame in sent], name
        assert unharmed(spy), (name, done)
