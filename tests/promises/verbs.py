"""The commands that every device has (handctl-output(7)): each is there, and does what its row says."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import click

from handctl.docgen.guide_tables import VERBS
from handctl.families import FAMILIES
from handctl.model.param import TRIGGER
from tests.contract.facts import facts_of
from tests.promises.cells import Cell, command_of, commands, exempt, link_of, made, map_for, needs, typed, unless
from tests.support.cli import run, spying

SICK = ("fault=locked-rotor", "fault=hot", "fault=hip-offset", "fault=degrees")
"""States in which something is wrong: each simulator has one of them at least."""
VARIANTS = {"hand": tuple(f"model={model}" for model in ("df", "tp", "f1", "dg2"))}
"""Generations of a device, whose quantities differ."""
TYPOS = {"statsu": "status", "dmup": "dump", "wacth": "watch", "descirbe": "describe"}
TRUE_RATE = "rate_hz"


def there() -> Iterator[Cell]:
    for family in FAMILIES:
        for verb in VERBS:

            def check(_folder: Path, family: str = family, name: str = verb.name) -> None:
                assert command_of(family, name) is not None, "no such command"

            yield Cell(f"{family} {verb.name}", unless(exempt(family, "verb", verb.name), check))


def checked() -> Iterator[Cell]:
    """`status --check`: 0 where nothing is wrong, 7 where something is."""
    for family in FAMILIES:
        yield Cell(
            f"{family} status --check, healthy",
            lambda _, f=family: needs(run(f, "status", "--check", "-p", link_of(f)), 0),
        )
        yield Cell(f"{family} status --check, sick", partial(_sick, family))


def _sick(family: str, _folder: Path) -> None:
    codes = {state: run(family, "status", "--check", "-p", link_of(family, state)).code for state in SICK}
    assert 7 in codes.values(), codes


def read() -> Iterator[Cell]:
    """What `dump` shows `get` takes by its path; what can be set can be got; an element by its name."""
    for family in FAMILIES:
        for variant in VARIANTS.get(family, ("",)):
            yield Cell(
                f"{family} get of all that dump shows{variant and ', '}{variant}", partial(_dumped, family, variant)
            )
        if any(len(param.elements) > 1 for param in map_for(family)):
            yield Cell(f"{family} get of an element", partial(_element, family))
        yield Cell(f"{family} get of what can be set", partial(_settable, family))
        yield Cell(f"{family} describe without a device", lambda _, f=family: needs(run(f, "describe", "--json"), 0))
        yield Cell(f"{family} model in JSON", partial(_model, family))


def _dumped(family: str, variant: str, _folder: Path) -> None:
    link = link_of(family, variant)
    paths = [row["path"] for row in needs(run(family, "dump", "-p", link, "--json"), 0).rows if "path" in row]
    again = needs(run(family, "get", *paths, "-p", link, "--json"), 0).rows
    assert [row["path"] for row in again] == paths


def _element(family: str, _folder: Path) -> None:
    vector = next(
        param for param in map_for(family) if param.readable and len(param.elements) > 1 and not param.optional
    )
    (row,) = needs(run(family, "get", f"{vector.path}.{vector.elements[1]}", "-p", link_of(family), "--json"), 0).rows
    assert row["name"] == vector.name


def _settable(family: str, _folder: Path) -> None:
    unread = [
        param.name for param in map_for(family) if param.writable and not param.readable and param.kind != TRIGGER
    ]
    assert not unread, unread
    paths = [
        element.path
        for param in map_for(family)
        if param.writable and param.readable and not param.optional
        for element in param.each
    ]
    if paths:
        needs(run(family, "get", *paths, "-p", link_of(family)), 0)


def _model(family: str, _folder: Path) -> None:
    assert run(family, "status", "-p", link_of(family), "--json").json["device"].get("model")


def bounded() -> Iterator[Cell]:
    """`watch` ends by each of its bounds, and tells its true rate."""
    for family in FAMILIES:
        for words in (("--count", "2"), ("--duration", "0.5", "--rate", "10")):
            yield Cell(f"{family} watch {' '.join(words)}", partial(_watched, family, words))


def _watched(family: str, words: tuple[str, ...], _folder: Path) -> None:
    with spying() as spy:
        rows, end = needs(run(family, "watch", *words, "-p", link_of(family), "--json"), 0).stream
    assert rows and end["stream"]["samples"] and end["stream"].get(TRUE_RATE) is not None, end["stream"]
    if "--duration" in words:
        assert spy.now < 20


def kept() -> Iterator[Cell]:
    """A snapshot of a device does not differ from it, restores without a write, and `report` is a page."""
    for family in FAMILIES:
        if command_of(family, "snapshot") is not None:
            excused = exempt(family, "settings", "diff")
            yield Cell(f"{family} snapshot, diff, restore", unless(excused, partial(_round, family, ())))
            if excused:
                yield Cell(
                    f"{family} snapshot, diff, restore with --setpoints", partial(_round, family, ("--setpoints",))
                )
        yield Cell(f"{family} report is a page", partial(_reported, family))
        if command_of(family, "log") is not None:
            yield Cell(f"{family} log of three samples", partial(_logged, family))


def _round(family: str, more: tuple[str, ...], folder: Path) -> None:
    file = str(made(folder) / "own.json")
    link = f"{link_of(family)}&state={folder / 'kept.json'}"
    needs(run(family, "snapshot", file, "-p", link), 0)
    needs(run(family, "diff", file, *more, "-p", link), 0)
    needs(typed(family, "diff", folder, link), 7)
    operator = [
        word
        for word in facts_of(family).words("restore", folder)
        if not word.endswith(".json") and word != "--setpoints"
    ]
    result = needs(run(family, "restore", file, *operator, *more, "-y", "-p", link, "--json"), 0)
    assert result.json.get("writes", []) == []


def _reported(family: str, folder: Path) -> None:
    needs(typed(family, "report", made(folder), link_of(family)), 0)
    assert "<html" in (folder / "report.html").read_text(encoding="utf-8")


def _logged(family: str, folder: Path) -> None:
    file = made(folder) / "log.csv"
    needs(run(family, "log", str(file), "--count", "3", "-p", link_of(family)), 0)
    assert len(file.read_text(encoding="utf-8").splitlines()) >= 4


def fingers() -> Iterator[Cell]:
    """Commands that take a vector: one finger by its name, and -1 leaves one alone where it is no value of its own."""
    for family in FAMILIES:
        for name, command in commands(family):
            if not any(
                isinstance(param, click.Argument) and "RING" in (param.metavar or "") for param in command.params
            ):
                continue
            yield Cell(f"{family} {name} ring=…", partial(_named, family, name))
            yield Cell(
                f"{family} {name} -1 …", unless(exempt(family, "leave-alone", name), partial(_alone, family, name))
            )


def _named(family: str, name: str, folder: Path) -> None:
    rows = needs(run(family, name, "ring=300", "-n", "-p", link_of(family), "--json"), 0).rows
    assert len(rows) == 1, rows


def _alone(family: str, name: str, _folder: Path) -> None:
    words = facts_of(family).writes[name].split()
    place = next(place for place, word in enumerate(words) if word.lstrip("-").isdecimal())
    count = len(
        [
            word
            for word in words[place:]
            if word.lstrip("-").isdecimal() and "--wait" not in words[place : words.index(word)]
        ]
    )
    values = ["-1", "300", *["-1"] * (count - 2)]
    one = needs(run(family, name, *words[:place], *values, "-n", "-p", link_of(family), "--json"), 0).rows
    same = needs(run(family, name, "ring=300", "-n", "-p", link_of(family), "--json"), 0).rows
    assert json.dumps(one) == json.dumps(same)


def misspelled() -> Iterator[Cell]:
    """A command that is misspelled leads to the one that was meant."""
    for family in ("", *FAMILIES):
        for typo, meant in TYPOS.items():
            yield Cell(f"{family or 'handctl'} {typo}", partial(_meant, family, typo, meant))


def _meant(family: str, typo: str, meant: str, _folder: Path) -> None:
    text = needs(run(*filter(None, (family, typo))), 2).err
    assert f"'{meant}'" in text or f" {meant}`" in text, text.strip()
    assert family or not any(f"mean '{tool}'" in text for tool in ("stop", "scan")), text.strip()


def cells() -> Iterator[Cell]:
    for table in (there, checked, read, bounded, kept, fingers, misspelled):
        yield from table()
