"""Devices, files, variables, configurations, locales and command lines that mean no good, against every command: `tests/hostile`.

A documented exit code, JSON that is JSON, nothing that acts on a terminal, an end in time, bounded memory, inputs as they were.
"""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from handctl.families import FAMILIES
from tests.harm import lines
from tests.hostile import device_cells, file_cells, locale_cells, random_cells, setting_cells, word_cells
from tests.hostile.cell import Folder, Tried
from tests.hostile.devices import KINDS, places
from tests.search.suite import Listed, Suite, key, parts


def ended(tried: Tried, what: object = "") -> str:
    """How it ended. Raises AssertionError with what is wrong."""
    assert not tried.failure, f"{what}, exit {tried.code}: {tried.failure}"
    return f"exit {tried.code} {tried.told}".rstrip()


def place_in(folder: Path) -> Folder:
    """The inputs that lines name, and a folder to stand in: nonsense may be the name of an output."""
    lines.prepare(folder)
    (folder / "here").mkdir()
    os.chdir(folder / "here")
    return Folder(folder)


class Hostile(Listed):
    """Of these parts of a key every one needs a pin."""

    needed: tuple[int, ...] = ()

    def shows(self, cell: str) -> Iterable[str]:
        words = parts(cell)
        return [words[part] for part in self.needed]

    def wanted(self) -> Iterable[str]:
        return dict.fromkeys(what for cell in self.table for what in self.shows(cell))


class Devices(Hostile):
    """A pin for every command, every family on every wire, and every kind of hostility."""

    name = "hostile-devices"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for place in places():
            for line in device_cells.lines_for(place):
                yield (place.kind, place.wire, place.hostility, line), (place, line)

    def tried(self, row: Any, folder: Path) -> str:
        place, line = row
        how = device_cells.how_of(place, line)
        return ended(device_cells.try_cell(place, line, how, place_in(folder)), f"{line} --{how}")

    def shows(self, cell: str) -> Iterable[str]:
        _, family, wire, hostility, line = parts(cell)
        return f"{family}, {wire}", hostility, line


class Files(Hostile):
    """A pin for every place of a file, and every kind of one."""

    name = "hostile-files"
    needed = (2, 3)

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for place in file_cells.PLACES:
            for kind, make in file_cells.kinds(place).items():
                yield (place.family, place.name, kind), (place, kind, make)

    def tried(self, row: Any, folder: Path) -> str:
        place, kind, make = row
        return ended(file_cells.try_cell(place, kind, make, file_cells.how_of(place, kind), place_in(folder)))


class Contents(Hostile):
    """A pin for every line with an input, and every kind of what it may hold."""

    name = "hostile-contents"
    needed = (2, 3)

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for line in file_cells.READING:
            for kind in KINDS:
                for how in ("json", "table"):
                    yield (line.family, line, kind, how), (line, kind, how)

    def tried(self, row: Any, folder: Path) -> str:
        done = file_cells.try_content(*row, place_in(folder))
        return ended(done) if done else "it reads no such file"


class Pipes(Hostile):
    """A pin for every writer of the one pipe that is read."""

    name = "hostile-pipes"
    needed = (2,)

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for kind in file_cells.WRITERS:
            for how in ("json", "table"):
                yield ("barrett", kind, how), (kind, how)

    def tried(self, row: Any, folder: Path) -> str:
        return ended(file_cells.try_pipe(*row, place_in(folder)))


class Variables(Hostile):
    """A pin for every variable, and every kind of nonsense."""

    name = "hostile-variables"
    needed = (2, 3)

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for name, kind, words in setting_cells.variables():
            yield (words[0], name, kind, " ".join(words)), (name, kind, words)

    def tried(self, row: Any, folder: Path) -> str:
        return ended(setting_cells.try_variable(*row, place_in(folder)))


class Keys(Hostile):
    """A pin for every key of a configuration file, and every kind of nonsense."""

    name = "hostile-keys"
    needed = (2, 3)

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for name, kind, where, words in setting_cells.settings():
            yield (words[0], name, kind, where, " ".join(words)), (name, kind, where, words)

    def tried(self, row: Any, folder: Path) -> str:
        return ended(setting_cells.try_key(*row, place_in(folder)))


class Words(Hostile):
    """A pin for every kind of nonsense in the words of every command."""

    name = "hostile-words"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for name, kind, told, words in word_cells.rows():
            yield (name or "tools", kind, told), (name, words)

    def tried(self, row: Any, folder: Path) -> str:
        return ended(word_cells.try_words(*row, place_in(folder)))

    def shows(self, cell: str) -> Iterable[str]:
        if cell not in self.table:
            return ()
        _, words = self.table[cell]
        path = next((words[:size] for size in (3, 2, 1) if words[:size] in lines.tree()), words[:1])
        return parts(cell)[2], " ".join(path)


class Locales(Hostile):
    """A pin for every encoding, and every line."""

    name = "hostile-locales"
    needed = (2, 3)

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for encoding, words, how in locale_cells.rows():
            name = words[0] if words[0] in FAMILIES else "tools"
            yield (name, encoding, json.dumps(words), how), (encoding, words, how)

    def tried(self, row: Any, folder: Path) -> str:
        code, failure = locale_cells.try_locale(*row, folder)
        return ended(Tried(code, failure))


class Random(Suite):
    """Random command lines from the tree, without end. A pin holds the words themselves, so that it stays when the tree grows."""

    name = "hostile-random"

    def cells(self) -> Iterator[str]:
        for seed in itertools.count(self.seed * 1_000_000):
            for json_wanted, words in random_cells.rows(seed):
                family = next((word for word in words if word in FAMILIES), "tools")
                text = json.dumps(words).replace("|", "\\u007c").replace("  ", " \\u0020")
                yield key(self.name, family, "json" if json_wanted else "any", text)

    def run(self, cell: str, folder: Path) -> str:
        _, _, how, text = parts(cell)
        return ended(random_cells.try_line(json.loads(text), how, place_in(folder)))

    def wanted(self) -> Iterable[str]:
        return (*FAMILIES, "tools")

    def shows(self, cell: str) -> Iterable[str]:
        return (parts(cell)[1],)


SUITES = (Devices(), Files(), Contents(), Pipes(), Variables(), Keys(), Words(), Locales(), Random())
