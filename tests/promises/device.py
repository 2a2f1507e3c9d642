"""README's symptoms of a device that answers: it refuses, is blocked, hot, not saved, or is asked for too much."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from handctl.docgen.guide_tables import SYMPTOMS
from handctl.families import FAMILIES
from handctl.model.param import TRIGGER
from tests.contract.facts import facts_of
from tests.contract.facts.outcomes import outcomes_of
from tests.promises.cells import (
    Cell,
    command_of,
    commands_in,
    exempt,
    link_of,
    made,
    map_for,
    needs,
    reached,
    row_of,
    step,
    typed,
    unless,
    wires_of,
)
from tests.support.cli import run


def not_initialized() -> Iterator[Cell]:
    family = next(words[0] for row in SYMPTOMS if row.key == "not-initialized" for words in commands_in(row.step))
    state = "initialized=0"

    def refuses(folder: Path, name: str) -> None:
        link = f"fake://{family}?clock=virtual&{state}&state={made(folder) / 'kept.json'}"
        result = needs(typed(family, name, folder, link), 6)
        assert "not initialized" in result.err
        needs(run(*step("not-initialized", family, link)), 0)
        needs(typed(family, name, folder, link.replace(f"&{state}", "")), 0)

    for name in facts_of(family).halts or ():
        if name != "init":
            yield Cell(f"{family} {name}", partial(refuses, name=name))


OPENED = "close"
"""A command that brings what begins open to where a movement has a way to go."""
WAYS = {"open": "", "home": "", "init": "", "step-open": "500", "joints": "index.q3=130 thumb.q1=10"}
"""Arguments of a movement that leads away from where it begins, where those of the facts do not."""


def movements(family: str) -> Iterator[tuple[str, list[str], str]]:
    """Commands that move to a target and wait, with arguments, and what brings the device to another place first."""
    facts = facts_of(family)
    for name in facts.halts or ():
        words = WAYS[name].split() if OPENED in facts.writes and name in WAYS else facts.words(name, Path())
        words = WAYS[name].split() if name == "joints" else words
        yield name, [*name.split(), *words], OPENED if OPENED in facts.writes and name in WAYS else ""


def not_reached() -> Iterator[Cell]:
    """A movement that is held up ends with exit code 7, unless that was expected."""
    for family in FAMILIES:
        unfit = {
            name for name, *_ in movements(family) if exempt(family, "expect", name) or exempt(family, "arrival", name)
        }
        taking = [name for name, *_ in movements(family) if name not in unfit]
        for name, words, before in movements(family):
            excused = exempt(family, "arrival", name)
            tried = partial(_moved, family, name, words, before)
            yield Cell(f"{family} {name}", unless(excused, partial(tried, "fault=blocked", "", 7)))
            if "speed" in dict(reached(family)):
                yield Cell(f"{family} {name} at speed 0", partial(tried, "speed=0", "", 7))
            if excused:
                continue
            takes = partial(_expects, family, name)
            yield Cell(f"{family} {name} takes --expect", unless(exempt(family, "expect", name), takes))
            if name == taking[min(1, len(taking) - 1)]:  # one of them is enough for its effect
                yield Cell(f"{family} {name} --expect any", partial(_any_end, family, name, words, before))
                yield Cell(f"{family} {name} --expect contact", partial(tried, "", "contact", 7))
    yield Cell("handctl aidin home", _homed)


def _expects(family: str, name: str, _folder: Path) -> None:
    command = command_of(family, name)
    assert command is not None and any("--expect" in param.opts for param in command.params)


def _any_end(family: str, name: str, words: list[str], before: str, folder: Path) -> None:
    """A stop short of the target is taken, a movement that never began or a fault that the device reports is not."""
    link = _way_open(family, before, folder)
    result = run(family, *words, "--expect", "any", "-y", "--json", "-p", f"{link}&fault=blocked")
    ends = {row["arrival"] for row in result.json["rows"] if row.get("arrival")}
    assert ends & {"short", "contact", "blocked", "unmoved"}, ends
    assert result.code == (7 if ends & {"unmoved", "blocked", "moving", "no-speed"} else 0), ends


def _moved(
    family: str, name: str, words: list[str], before: str, state: str, expect: str, code: int, folder: Path
) -> None:
    link = _way_open(family, before, folder)
    wanted = ["--expect", expect] if expect else []
    needs(run(family, *words, *wanted, "-y", "-p", f"{link}&{state}" if state else link), code)


def _way_open(family: str, before: str, folder: Path) -> str:
    """The link of a device whose movement has a way to go."""
    link = f"fake://{family}?clock=virtual&{outcomes_of(family).state.replace('rate=25', 'rate=10')}&state={made(folder) / 'kept.json'}"
    if before:
        needs(run(family, before, "-p", link), 0)
    return link


def _homed(folder: Path) -> None:
    family = next(words[0] for row in SYMPTOMS if row.key == "not-reached" for words in commands_in(row.step))
    kept = made(folder) / "kept.json"
    link = f"fake://{family}?clock=virtual&rate=10&state={kept}"
    words = (family, "joints", "index.q3=130", "thumb.q1=10", "-y", "-p", link)
    needs(run(*words[:-1], f"{link}&start=cold"), 7, said="not-reached")
    needs(run(*step("not-reached", family, link), "-y"), 7, said="homing-unproven")  # nothing shows the open stop yet
    needs(run(*words), 0)


def hot() -> Iterator[Cell]:
    """Errors stay while it is hot, and go when it has cooled."""
    for family in FAMILIES:
        if "over-temperature" not in outcomes_of(family).changed:
            continue
        tells = lambda _, f=family: needs(run(f, "status", "--check", "-p", link_of(f, "fault=over-temperature")), 7)  # noqa: E731
        yield Cell(f"{family} status --check", unless(exempt(family, "hot", "status --check"), tells))
        if command_of(family, "clear-errors") is None and not exempt(family, "hot", "clear-errors"):
            continue  # `status` reports no error bits of it
        yield Cell(f"{family} clear-errors", unless(exempt(family, "hot", "clear-errors"), partial(_cools, family)))


def _cools(family: str, folder: Path) -> None:
    kept = made(folder) / "kept.json"
    link = f"fake://{family}?clock=virtual&state={kept}"
    result = needs(run(*step("hot", family, f"{link}&fault=hot")), 0, 7)
    assert "over-temperature" in result.said
    needs(run(family, "status", "--check", "-p", link), 7)
    needs(run(*step("hot", family, f"{link}&elapse=900")), 0)
    needs(run(family, "status", "--check", "-p", link), 0)


def not_saved() -> Iterator[Cell]:
    for family in FAMILIES:
        for name, given, read, old in (("id", "7", "id", 1), ("baud", "57600", "baud_code", 0)):
            if command_of(family, name) is None or command_of(family, "save") is None or not row_of(family).ids:
                continue
            yield Cell(f"{family} {name}", partial(_kept, family, name, given, read, old))


def _kept(family: str, name: str, given: str, read: str, old: int, folder: Path) -> None:
    kept = made(folder) / "kept.json"
    link = f"fake://{family}?clock=virtual&state={kept}"
    at = [f"--{name}", given]
    needs(run(family, name, given, "-y", "-p", link), 0)
    again = needs(run(family, "get", read, "--format", "plain", "-p", f"{link}&power-cycle=1"), 0)
    assert str(old) in again.out.split(), again
    needs(run(family, name, given, "-y", "-p", link), 0)
    now = at if name == "id" else []  # a new speed acts after a power-cycle only
    needs(run(*step("not-saved", family, link), *now, "-y"), 0)
    again = needs(run(family, "get", read, "--format", "plain", *at, "-p", f"{link}&power-cycle=1"), 0)
    assert str(old) not in again.out.split(), again


def out_of_range() -> Iterator[Cell]:
    """A number that is far too large, in each command that takes one. `describe` has the range of what may be set."""
    for family in FAMILIES:
        facts = facts_of(family)
        for name in facts.writes:
            words = facts.writes[name].split()
            place = next((i for i, word in enumerate(words) if re.fullmatch(r"([a-z_.0-9A-Z]+=)?-?\d+", word)), None)
            if place is not None:
                big = re.sub(r"-?\d+$", "9999999", words[place])
                yield Cell(
                    f"{family} {name}",
                    partial(_too_large, family, [*name.split(), *words[:place], big, *words[place + 1 :]]),
                )
        yield Cell(f"{family} describe", partial(_ranges, family))


def _too_large(family: str, words: list[str], folder: Path) -> None:
    trace = made(folder) / "trace.txt"
    needs(run(family, *[word.format(dir=folder) for word in words], "-y", "-p", link_of(family), "--trace", trace), 2)
    assert not trace.exists() or " > " not in trace.read_text()


def _ranges(family: str, _folder: Path) -> None:
    rows = {row["name"]: row for row in needs(run(*step("out-of-range", family, ""), "--json"), 0).rows}
    for param in map_for(family):
        if param.writable and param.kind != TRIGGER and param.low is not None:
            assert rows[param.name]["range"], param.name


def wrong_values() -> Iterator[Cell]:
    for family in FAMILIES:
        for wire, option in wires_of(family).items():
            yield Cell(f"{family} status, {wire}", partial(_decoded, family, link_of(family, option)))


def _decoded(family: str, link: str, folder: Path) -> None:
    trace = str(made(folder) / "run.txt")
    words = step("wrong-values", family, link)
    needs(run(*(trace if word == "run.txt" else word for word in words), "-p", link), 0)
    words = [trace if word == "run.txt" else word for word in step("wrong-values", family, link, 1)]
    rows = needs(run(*words, "--json"), 0).rows
    assert rows and not [row for row in rows if row.get("problem")], rows
    assert all(row.get("meaning") for row in rows if row.get("bytes")), rows
