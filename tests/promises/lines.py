"""What `scan` and `doctor` say of a line: they find the device whatever its id and the line's delay, and name two of one id."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from unittest import mock

from handctl.families import FAMILIES
from tests.promises.cells import Cell, command_of, found_in, has_serial, link_of, needs, row_of
from tests.support.cli import run

LINES = (
    ("50 ms", "latency_ms = 50\n", 2),
    ("150 ms", "latency_ms = 150\n", 1),
    ("bluetooth", 'model = "bluetooth"\n', 1),
)
"""What the line is, and the id of the device."""


def cells() -> Iterator[Cell]:
    for family in FAMILIES:
        if has_serial(family) and row_of(family).ids and command_of(family, "scan") is not None:
            for name, keys, number in LINES:
                yield Cell(f"{family} scan, {name}, id {number}", partial(_scanned, family, keys, number))
        yield Cell(f"{family}: handctl doctor finds the device", partial(_met, family))
        if row_of(family).ids:
            yield Cell(f"{family}: handctl doctor, two devices with one id", partial(_twins, family))


def _scanned(family: str, keys: str, number: int, folder: Path) -> None:
    folder.mkdir(parents=True)
    file = folder / "line.toml"
    file.write_text(f'[line]\nwire = "rs232"\n{keys}[[device]]\nkind = "{family}"\nid = {number}\n', encoding="utf-8")
    (row,) = found_in(needs(run(family, "scan", "-p", f"fake://bus?file={file}&clock=virtual", "--json"), 0))
    assert (row["family"], row["id"]) == (family, number), row
    assert (row["baud"] is None) == ("bluetooth" in keys), row


def _met(family: str, _folder: Path) -> None:
    """It is not told which family is there."""
    with mock.patch("handctl.tools.port_inventory.source", lambda _address: ""):
        rows = run("doctor", "-p", link_of(family), "--count", "5", "--json").rows
    assert [row["status"] for row in rows if row["check"] == "answer"] == ["ok"], [row["check"] for row in rows]


def _twins(family: str, _folder: Path) -> None:
    with mock.patch("handctl.tools.port_inventory.source", lambda _address: ""):
        result = run("doctor", "-p", link_of(family, "fault=twin-id"), "--family", family, "--count", "5", "--json")
    rows = needs(result, 7).rows
    assert [row["status"] for row in rows if row["check"] == "same_id"] == ["fail"], [
        (row["check"], row["status"]) for row in rows
    ]
