"""Somebody else asks on the same two wires, and does not look whether the line is free."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from tests.contract.facts import passed
from tests.support.bus_file import text
from tests.support.cli import run

OTHER = bytes.fromhex("EB 90 C8 04 11 E8 03 01 C9")


def bus(folder: Path, kind: str, every: int = 100) -> str:
    path = folder / "bus.toml"
    master: dict[str, Any] = {"ask": OTHER.hex(), "every_ms": every}
    path.write_text(text("half-duplex", [{"kind": kind, "id": 1}], [master]), encoding="utf-8")
    return f"fake://bus?file={path}&clock=virtual"


@pytest.mark.parametrize(
    ("kind", "data"), [("exo", "EB 90 01 04 11 E8 03 01 02"), ("wrist", "EB 90 01 04 30 FC 03 02 36")]
)
def test_raw_ends_where_others_never_fall_silent(tmp_path: Path, kind: str, data: str) -> None:
    trace = tmp_path / "trace.txt"
    done = run(kind, "raw", data, "-p", bus(tmp_path, kind), "--json", "--trace", trace)
    assert done.code == 0, done
    assert done.json["line"]["others"] is True
    assert sum(entry.mark == "<" for entry in passed(trace)) < 60, "some seconds"


@pytest.mark.parametrize("every", [25, 46, 50])
def test_nobody_is_spoken_to_in_the_middle_of_a_frame(tmp_path: Path, every: int) -> None:
    """The time for an answer that was destroyed ends within a frame of the other master: the end of that is waited for."""
    trace, link = tmp_path / "trace.txt", bus(tmp_path, "wrist", every)
    words = ["wrist", "move", "--pitch", "5", "--yaw", "-5", "--time", "300", "--timeout", "0.05"]
    done = run(*words, "-p", link, "--json", "--trace", trace)
    assert done.code == 0, done
    cut_off = [
        before.data
        for before, after in pairwise(passed(trace))
        if (before.mark, after.mark) == ("<", ">") and OTHER.startswith(before.data) and before.data != OTHER
    ]
    assert cut_off == []
