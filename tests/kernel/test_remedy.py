"""What a finding means and what to do: one table for each family, complete, and shown where the finding is."""

from __future__ import annotations

import pytest

from handctl.families import FAMILIES
from handctl.model.device_picture import UNKNOWN, Remedy, hint_for, hint_of, remedies_of, worst_of
from handctl.model.result import Finding
from tests.support.cli import run
from tests.support.each_row import each_row

TABLES = [kind for kind in FAMILIES if remedies_of(kind)]
FINDS = {
    # family -> what its simulator is told, so that status finds something
    "exo": ("fault=locked-rotor", "exo clear-errors"),
    "wrist": ("fault=faults", "power-cycle the wrist"),
    "barrett": ("initialized=0", "barrett init"),
    "aidin": ("fault=degrees", "encoders"),
    "ekso": ("fault=frozen-clock", "ekso doctor"),
    "hand": ("fault=faults", "hand clear-errors"),
}


@each_row("kind", TABLES)
def test_every_error_bit_has_a_remedy(kind: str) -> None:
    """The bits of a map and the rows of its table are the same: what is reported can be looked up."""
    table = remedies_of(kind)
    rows = run(kind, "describe", "--json").rows
    for row in rows:
        if row["range"].startswith("bits"):
            assert [one["name"] for one in row["remedies"]].count(UNKNOWN) == 0
            assert len(row["remedies"]) == int(row["range"].rpartition("..")[2]) + 1, row["name"]
        for one in row["remedies"]:
            assert table[one["name"]] == (one["meaning"], one["next"], one["source"])
    for key, remedy in table.items():
        assert all(remedy), key
        assert remedy.step[0].islower() and remedy.step[-1] != ".", key


@pytest.mark.parametrize("kind", TABLES)
def test_plain_status_names_what_to_do(kind: str) -> None:
    fault, step = FINDS[kind]
    at = f"fake://{kind}?clock=virtual&{fault}"
    told = run(kind, "status", "-p", at, "--json")
    found = [message for message in told.json["messages"] if message["code"] == "unhealthy"]
    assert found and all(message["hint"] for message in found)
    assert step in " ".join(message["hint"] for message in found)
    checked = run(kind, "status", "--check", "-p", at, "--json")
    assert (checked.code, checked.error["code"]) == (7, "unhealthy")
    assert checked.error["hint"] in {message["hint"] for message in found}


@each_row("kind", ["exo", "wrist", "hand"])
def test_what_passes_by_itself_leaves_the_others_their_step(kind: str) -> None:
    """0x03: no command clears over_temperature, but one clears the locked rotor (exo §2.3.3, rh56 §3.1)."""
    both = hint_for(kind, Finding("", ("locked_rotor", "over_temperature")))
    for key in ("locked_rotor", "over_temperature"):
        assert remedies_of(kind)[key].step.casefold() in both.casefold()
    assert (
        remedies_of(kind)["locked_rotor"].step.casefold()
        not in hint_for(kind, Finding("", ("over_temperature",))).casefold()
    )


def test_the_most_urgent_one_is_first() -> None:
    table = {
        "hot": Remedy("a", "cool it", "§1"),
        "stuck": Remedy("b", "free it", "§2"),
        UNKNOWN: Remedy("c", "ask", "§3"),
    }
    assert worst_of(table, ("stuck", "hot")) == "hot"
    assert worst_of(table, ("unknown_bit_7",)) == UNKNOWN
    assert worst_of(table, ("new",)) == ""


def test_a_step_that_fits_better_goes_before_the_table() -> None:
    assert hint_for("exo", Finding("x", ("locked_rotor",), "do this")) == "do this"
    assert hint_for("exo", Finding("x", ("nothing",))) == ""
    findings = [Finding("x", ("locked_rotor",)), Finding("y", ("over_temperature",))]
    assert hint_of("exo", findings) == remedies_of("exo")["over_temperature"].hint
    assert hint_of("exo", []) == ""


def test_what_several_fingers_need_is_said_once() -> None:
    told = run("exo", "status", "-p", "fake://exo?clock=virtual&fault=hot")
    assert told.err.count("over_temperature (0x02)") == 5
    assert told.err.count("Next:") == 1
    seen = run("exo", "status", "-p", "fake://exo?clock=virtual&fault=hot", "--json").json["messages"]
    assert len({message["hint"] for message in seen}) == 1 and len(seen) == 5


@each_row(
    ("at", "head"),
    [
        ("fake://hand?clock=virtual", "id 1, RH56DFTP or RH56E2 (TP), serial, 115200 bit/s"),
        ("fake://hand?clock=virtual&bus=can", "CAN, 1000000 bit/s"),
        ("fake://hand?clock=virtual&bus=modbus-tcp", "Modbus TCP"),
    ],
)
def test_a_hand_names_its_generation_and_its_wire(at: str, head: str) -> None:
    assert head in run("hand", "status", "-p", at).lines[0]


def test_encoders_that_are_all_zero_are_told() -> None:
    told = run("aidin", "status", "-p", "fake://aidin?clock=virtual&start=cold", "--json")
    assert (told.code, "homed-unknown" in told.codes()) == (0, True)
    assert "homed-unknown" not in run("aidin", "status", "-p", "fake://aidin?clock=virtual", "--json").codes()
