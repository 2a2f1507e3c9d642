"""The pictures checked in are those that the renderer draws, and need nothing from the network."""

from __future__ import annotations

import re
from importlib.metadata import version

import pytest

from tests.pictures import HERE, PICTURES, draw, words
from tests.support.each_row import each_row


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_what_the_renderer_draws(name: str) -> None:
    """To the byte with the version of rich that drew it; another one may place things otherwise, but says the same."""
    kept, drawn = (HERE / f"{name}.svg").read_text(encoding="utf-8"), draw(name)
    assert words(drawn) == words(kept), "run `python -m tests.pictures`"
    if f"rich {version('rich')} " in kept.partition("\n")[0]:
        assert drawn == kept, "run `python -m tests.pictures`"


def test_no_other_picture_is_there() -> None:
    assert {path.stem for path in HERE.glob("*.svg")} == set(PICTURES)


@each_row("name", PICTURES)
def test_a_picture_stands_alone(name: str) -> None:
    svg = (HERE / f"{name}.svg").read_text(encoding="utf-8")
    assert re.findall(r"https?://[^\"' ]*", svg) == ["http://www.w3.org/2000/svg"]
    assert not re.search(r"@import|@font-face|href|<script|<image|url\((?!#)", svg)


@each_row(("name", "parts"), [
    ("exo-status", ("simulated", "locked_rotor", "thumb550555-15-6525", "Position")),
    ("exo-watch", ("simulated", "20.0Hz", "13samples", "109..860", "█", "▂", "[°C]", "-30s")),
    ("barrett-status", ("simulated", "ready", "F101125956", "firmware4.33")),
])  # fmt: skip
def test_a_picture_shows(name: str, parts: tuple[str, ...]) -> None:
    said = words((HERE / f"{name}.svg").read_text(encoding="utf-8"))
    assert [part for part in parts if part not in said] == []
