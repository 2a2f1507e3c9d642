"""`handctl hand describe`: the map of the generation that is named, as its manual counts (rh56 §3)."""

from __future__ import annotations

from tests.support.cli import run
from tests.support.each_row import each_row


@each_row(
    ("model", "places", "elements"),
    [
        ("", {"id": 1000, "save": 1005, "calibrate_force": 1009, "angle_set": 1486, "temperature": 1618}, 6),
        ("tp", {"id": 1000, "save": 1005, "ip_address": 1700, "angle_actual": 1546}, 6),
        ("f1", {"save": 1004, "factory_reset": 1005, "calibrate_force": 1007, "angle_set": 1040, "mode": 1100}, 6),
        ("dg2", {"save": 1004, "current_limit": 1024, "angle_set": 1080, "temperature": 1206, "mode": 1220}, 13),
        ("RH5DG2", {"angle_actual": 1136, "error": 1178, "status": 1192}, 13),
    ],
)
def test_the_map_of_a_generation(model: str, places: dict[str, int], elements: int) -> None:
    answer = run("hand", "describe", *(["--model", model] if model else []), "--json")
    rows = {row["name"]: row for row in answer.rows}
    assert {name: rows[name]["address"] for name in places} == places
    assert len(rows["angle_set"]["elements"]) == elements
    assert {row["source"].partition(" ")[0] for row in rows.values()} == {"rh56"}


def test_a_row_that_was_read_has_the_same_address() -> None:
    answer = run("hand", "get", "angle_set", "-p", "fake://hand?model=dg2&clock=virtual", "--model", "dg2", "--json")
    assert [row["address"] for row in answer.rows] == list(range(1080, 1093))


def test_a_model_that_is_none() -> None:
    answer = run("hand", "describe", "--model", "rh57", "--json")
    assert answer.code == 2 and "rh57" in answer.error["text"]


@each_row("words", ["network 192.168.11.211", "network 192.168.11.211 -n"])
@each_row("model", ["df", "f1", "dg2"])
def test_a_generation_without_an_address_is_given_none(words: str, model: str) -> None:
    link = f"fake://hand?model={model}&clock=virtual"
    answer = run("hand", *words.split(), "--model", model, "-y", "-p", link, "--json")
    assert (answer.code, answer.error["code"]) == (2, "not-on-model"), answer
