"""The reading of a finger or an axis at rest is not the same each time (rh56 §6: 45 to 47): it stands all the same."""

from __future__ import annotations

from tests.support.cli import run
from tests.support.each_row import each_row

FOUR = ("little=300", "ring=300", "middle=300", "index=300")
LINES = [
    ("exo", ("position", "500", "400", "300", "200", "100", "--wait", "4"), "exo?clock=virtual"),
    ("wrist", ("move", "--pitch", "5", "--time", "500", "--wait", "4"), "wrist?clock=virtual"),
    ("wrist", ("move", "--pitch", "5", "--time", "500", "--wait", "4"), "wrist?clock=virtual&bus=can"),
    ("hand", ("angle", *FOUR, "--wait", "1.5"), "hand?clock=virtual"),
    ("hand", ("position", *FOUR, "--wait", "1.5"), "hand?clock=virtual"),
    ("hand", ("angle", *FOUR, "--wait", "1.5"), "hand?clock=virtual&bus=can"),
    ("hand", ("angle", "index=950", "--wait", "1.5"), "hand?clock=virtual&model=f1"),
]


def model(link: str) -> tuple[str, ...]:
    return ("--model", "f1") if "model=f1" in link else ()


@each_row(("family", "words", "link"), LINES)
def test_who_trembles_at_rest_has_arrived(family: str, words: tuple[str, ...], link: str) -> None:
    result = run(family, *words, "-y", "--json", "-p", f"fake://{link}&jitter=1", *model(link))
    assert result.code == 0, result
    assert {row["arrival"] for row in result.json["rows"] if row.get("arrival")} == {"reached"}


@each_row(("family", "words", "link"), LINES)
def test_who_trembles_at_rest_was_stopped(family: str, words: tuple[str, ...], link: str) -> None:
    result = run(family, "stop", "--json", "-p", f"fake://{link}&jitter=1", *model(link))
    assert result.code == 0, result
