"""Mistakes that somebody could make, put into the host one at a time: the suite finds each."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from handctl import files
from handctl.command import terminal_prompts
from handctl.screen import render
from tests.harm import lines
from tests.hostile import cell, device_cells, file_cells
from tests.hostile.cell import Folder, Tried
from tests.hostile.devices import Place
from tests.search import suite


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Folder:
    path = tmp_path_factory.mktemp("seeded")
    lines.prepare(path)
    return Folder(path)


def unfiltered_csv() -> AbstractContextManager[Any]:
    """The filter is left out in one renderer."""
    return mock.patch.object(render, "value_shown", lambda value: value)


def bypassed() -> AbstractContextManager[Any]:
    """A file is opened past the gate: whatever it is."""
    gate = files.opened

    def opened(path: str, what: str, **more: Any) -> Any:
        return open(path, "rb") if os.path.exists(path) else gate(path, what, **more)

    return mock.patch.object(files, "opened", opened)


@contextmanager
def unbounded() -> Iterator[None]:
    """A file is read to its end, wherever that is."""

    gate = files.read

    def read(path: str, what: str, most: int, **more: Any) -> bytes:
        if not os.path.exists(path):
            return gate(path, what, most, **more)
        with open(path, "rb") as file:
            return file.read()

    with mock.patch.object(files, "read", read):
        yield


def long_messages() -> AbstractContextManager[Any]:
    """A message is as long as what came."""
    return mock.patch.object(terminal_prompts, "short", lambda line: line)


def devices(hostility: str, family: str, words: str) -> Callable[[Folder], list[Tried]]:
    """The cells of one device."""

    def tried(folder: Folder) -> list[Tried]:
        place = Place(family, hostility, "serial")
        wanted = [line for line in device_cells.lines_for(place) if str(line).startswith(words)]
        return [device_cells.try_cell(place, line, how, folder) for line in wanted for how in ("table", "csv", "plain")]

    return tried


def named(kind: str, words: str) -> Callable[[Folder], list[Tried]]:
    """The cells of one kind of file."""

    def tried(folder: Folder) -> list[Tried]:
        wanted = [place for place in file_cells.PLACES if place.name.startswith(words) and place.reads]
        made = [(place, file_cells.kinds(place)[kind]) for place in wanted]
        return [file_cells.try_cell(place, kind, make, "table", folder) for place, make in made]

    return tried


@pytest.mark.parametrize(
    ("mistake", "cells"),
    [
        (unfiltered_csv, devices("escapes behind words", "barrett", "barrett gcl")),
        (bypassed, named("a pipe", "exo restore")),
        (unbounded, named("/dev/zero", "exo diff")),
        (long_messages, named("tables in TOML", "barrett realtime")),
    ],
    ids=["filter-left-out", "opener-bypassed", "bound-removed", "long-messages"],
)
def test_a_mistake_is_found(
    mistake: Callable[[], AbstractContextManager[Any]], cells: Callable[[Folder], list[Tried]], folder: Folder,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    before = cells(folder)
    assert before and not [one for one in before if one.failure]
    monkeypatch.setattr(cell, "SECONDS", 0.3)
    monkeypatch.setattr(cell, "CEILING", 64 << 20)
    with mistake():
        after = [one for one in cells(folder) if one.failure]
    print(
        f"{mistake.__name__}: {len(after)} of {len(before)} cells failed, e.g. {after[0].failure[:100] if after else ''}"
    )
    assert after


def test_a_temporary_file_and_a_changed_input_are_found(tmp_path: Path) -> None:
    (tmp_path / "input").write_text("a", encoding="utf-8")
    place = Folder(tmp_path)
    assert place.tidy() == ("", [])
    (tmp_path / "x.part").write_text("", encoding="utf-8")
    assert place.tidy()[0] == "left behind: x.part"
    (tmp_path / "x.part").unlink()
    (tmp_path / "input").write_text("b", encoding="utf-8")
    assert place.tidy()[0] == "input: an input was changed"


def endless(*_: Any) -> None:
    """A command that switches off every alarm, catches the first that ends it, and goes on."""
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    with suppress(suite.Hang):
        time.sleep(60)
    time.sleep(60)


@pytest.mark.real
def test_a_command_that_does_not_end_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever it does to alarms, and if it catches what ends it."""
    monkeypatch.setattr(cell, "SECONDS", 0.05)
    monkeypatch.setattr(suite, "AGAIN", 0.05)
    monkeypatch.setattr("handctl.cli.main", endless)
    done = cell.attempt(["exo", "status"], "table", Folder(tmp_path))
    assert done[:2] == (None, "no end within 0.05 s: handctl exo status")
