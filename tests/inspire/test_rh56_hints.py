"""What the procedures that the EH55BF1 and the RH56 hands share tell: each cites the source of its own device."""

from __future__ import annotations

from tests.support.cli import run
from tests.support.each_row import each_row

LINK = "fake://{kind}?clock=virtual"
OWN = {"exo": "exo §", "hand": "rh56 §"}


def told(kind: str, words: str, options: str = "") -> str:
    """All messages and hints of a command."""
    link = LINK.format(kind=kind) + (f"&{options}" if options else "")
    answer = run(kind, *words.split(), "-y", "-p", link, "--json")
    return " ".join(f"{one['text']} {one['hint']}" for one in answer.json["messages"])


@each_row(
    ("words", "options", "cited"),
    [
        ("id 2", "", True),
        ("save", "fault=no-late-frames", False),
        ("save", "fault=save-fails", False),
        ("clear-errors", "fault=over-temperature", True),
        ("clear-errors", "fault=locked-rotor", False),
        ("id 2", "fault=silent", False),
        ("id 2", "fault=bad-checksum", False),
    ],
)
def test_a_hand_is_told_of_its_own_manual_and_commands(words: str, options: str, cited: bool) -> None:
    text = told("hand", words, options)
    assert "exo §" not in text and "handctl exo" not in text and "9 V" not in text
    assert not cited or "rh56 §" in text


@each_row(("words", "options"), [("id 2", ""), ("clear-errors", "fault=over-temperature")])
def test_the_exoskeleton_hand_is_told_of_its_own(words: str, options: str) -> None:
    text = told("exo", words, options)
    assert "rh56 §" not in text and "handctl hand" not in text
    assert "exo §" in text


def test_silence_names_what_a_hand_needs() -> None:
    text = told("hand", "id 2", "fault=silent")
    assert "24 V" in text and "`handctl hand scan`" in text


@each_row("fault", ["silent", "truncate", "noise"])
def test_a_connection_has_no_speed_no_second_master_and_one_protocol(fault: str) -> None:
    text = told("hand", "status", f"bus=modbus-tcp&fault={fault}")
    assert not [word for word in ("baud", "RS-485", "eb90", "ground", "master") if word in text], text
