"""Devices that mean no good, against every verb of every family and the tools that look at any device."""

from __future__ import annotations

import zlib

import pytest

from tests.harm import lines
from tests.hostile.cell import Folder
from tests.hostile.device_cells import lines_for, try_cell
from tests.hostile.devices import KINDS, Place, places
from tests.hostile.table import Tried, note, share

pytestmark = pytest.mark.hostile

HOWS = ("json", "table", "json", "csv", "json", "plain", "always")
"""The formats take turns."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Folder:
    path = tmp_path_factory.mktemp("hostile")
    lines.prepare(path)
    return Folder(path)


@pytest.mark.parametrize("place", list(places()), ids=str)
def test_a_device_that_means_no_good(place: Place, folder: Folder, request: pytest.FixtureRequest) -> None:
    tried = Tried(request)
    for line in lines_for(place):
        if share(request.config, f"{place}|{line}"):
            tried.append(try_cell(place, line, HOWS[zlib.crc32(f"{line}{place}".encode()) % len(HOWS)], folder))
    note(request, tried)


def test_every_command_has_a_line() -> None:
    """A command or family that is new in the tree is asked for by name, and every kind of hostility meets it."""
    assert set(lines.examples()) == set(lines.tree())
    assert {place.hostility for place in places()} == set(KINDS)
