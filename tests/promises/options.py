"""The common options (`handctl help options`): offered by each command or refused, and the same wherever they are said."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

from handctl.command.command_tree import root
from handctl.command.options import SharedOption, shared_options
from handctl.command.run import Run
from handctl.families import FAMILIES
from tests.contract.facts import facts_of
from tests.promises.cells import Cell, exempt, link_of, made, map_for, needs, reached, row_of, typed, unless
from tests.search.suite import Hang, bounded
from tests.support.cli import clean_environment, environment, run, spying

VALUES = {
    "port": "fake://x", "device": "left", "id": "3", "baud": "19200", "timeout": "0.7", "deadline": "9", "retries": "2", "trace": "t.txt", "history": "off",
    "format": "plain", "output": "o.txt", "color": "never", "facts": str(Path(__file__).with_name("exo-facts.json")),
}  # fmt: skip
"""A value of each option that takes one."""
OPTIONS = [option for option in shared_options() if isinstance(option, SharedOption)]
GENERAL = [option for option in OPTIONS if not option.family]
FIFO_SECONDS = 1.0
DEADLINE = "4"
"""Homing takes longer than three seconds."""
FILE = '[devices.left]\nkind = "{family}"\nport = "fake://left"\n'


def long_name(option: SharedOption) -> str:
    return next(name for name in option.opts if name.startswith("--"))


def words_of(option: SharedOption) -> list[str]:
    return [long_name(option)] if option.is_flag else [long_name(option), VALUES[str(option.name)]]


class Took(Exception):
    """A command line was understood: its settings."""

    def __init__(self, settings: Any) -> None:
        self.settings = settings


def settings_of(words: Sequence[str], env: Mapping[str, str]) -> Any:
    """What a line comes to, without running it. Raises what is refused."""

    def take(run: Any) -> None:
        raise Took(run.settings)

    with environment(clean_environment(env)), mock.patch.object(Run, "shown", take):
        try:
            root.main(list(words), "handctl", standalone_mode=False)
        except Took as took:
            return took.settings
    raise AssertionError(f"{words}: nothing ran")


def line_of(family: str, option: SharedOption) -> list[str]:
    """A command that takes this option."""
    writing = option.key in ("dry_run", "yes", "assume_identity")
    return [
        family,
        *_words(next(name for name in facts_of(family).writes if name != "stop") if writing else "status", family),
    ]


def _words(name: str, family: str) -> list[str]:
    return [*name.split(), *(facts_of(family).words(name, Path("x")) if name in facts_of(family).writes else [])]


def everywhere() -> Iterator[Cell]:
    """Root, group and command, a variable, and the file: the same setting."""
    first, *others = FAMILIES
    for option in GENERAL:
        yield Cell(f"{first} {long_name(option)}", partial(_same, first, option))
    for family in others:  # the same code for all, and a line for each
        yield Cell(f"{family}: all options at once", partial(_all_same, family))


def _same(family: str, option: SharedOption, folder: Path) -> None:
    folder.mkdir(parents=True)
    config = folder / "config.toml"
    config.write_text(FILE.format(family=family), encoding="utf-8")
    env = {"HANDCTL_CONFIG": str(config)}
    line, said = line_of(family, option), words_of(option)
    places = {"behind": [*line, *said], "group": [line[0], *said, *line[1:]], "root": [*said, *line]}
    taken = {place: settings_of(words, env) for place, words in places.items()}
    if not option.typed:
        value = "1" if option.is_flag else VALUES[str(option.name)]
        taken["variable"] = settings_of(line, {**env, f"HANDCTL_{str(option.name).upper()}": value})
        if option.key != "device":
            key = f"{option.name} = {_toml(option)}\n"
            config.write_text(key + FILE.format(family=family), encoding="utf-8")
            taken["file"] = settings_of(line, env)
    first = taken["behind"]
    assert first != settings_of(line, {}), "the option changes nothing"
    assert not [place for place, settings in taken.items() if settings != first], taken


APART = ("device", "fake", "facts", "json", "csv", "long", "quiet", "assume_identity")
"""What excludes another option, has no variable, or is of one family."""


def _all_same(family: str, _folder: Path) -> None:
    chosen = [option for option in GENERAL if option.name not in APART]
    chosen = [option for option in chosen if option.key != "id" or row_of(family).ids]
    line = line_of(family, next(option for option in GENERAL if option.key == "dry_run"))
    said = [word for option in chosen for word in words_of(option)]
    env = {
        f"HANDCTL_{str(option.name).upper()}": "1" if option.is_flag else VALUES[str(option.name)] for option in chosen
    }
    behind = settings_of([*line, *said], {})
    assert (
        behind
        == settings_of([*said, *line], {})
        == settings_of([line[0], *said, *line[1:]], {})
        == settings_of(line, env)
    )
    assert behind != settings_of(line, {})


def _toml(option: SharedOption) -> str:
    if option.is_flag:
        return "true"
    value = VALUES[str(option.name)]
    return value if value.replace(".", "", 1).isdigit() else f'"{value}"'


def works() -> Iterator[Cell]:
    """What each option does, for every family. Of --dry-run and --yes see `contract/test_contract.py` and `docs/test_asking.py`."""
    for family in FAMILIES:
        link = link_of(family)
        for name, check in EFFECTS.items():
            yield Cell(f"{family} status {name}", unless(exempt(family, "option", name), partial(check, family, link)))
        for name, command in reached(family):
            yield Cell(f"{family} {name} --deadline, silence", partial(_ends, family, name))
            if any(param.metavar == "FILE" and "--control" in param.opts for param in command.params):
                yield Cell(f"{family} {name} --control FIFO --deadline", partial(_fifo, family, name))


def _json(family: str, link: str, _folder: Path) -> None:
    assert (
        needs(run(family, "status", "--json", "-p", link), 0).out
        == run(family, "status", "--format", "json", "-p", link).out
    )


def _csv(family: str, link: str, _folder: Path) -> None:
    assert (
        needs(run(family, "status", "--csv", "-p", link), 0).out
        == run(family, "status", "--format", "csv", "-p", link).out
    )


def _output(family: str, link: str, folder: Path) -> None:
    file = made(folder) / "out.csv"
    result = needs(run(family, "status", "--csv", "-o", file, "-p", link), 0)
    assert (
        result.out == ""
        and file.read_text(encoding="utf-8").splitlines() == run(family, "status", "--csv", "-p", link).out.splitlines()
    )


def _trace(family: str, link: str, folder: Path) -> None:
    file = made(folder) / "t.txt"
    needs(run(family, "status", "--trace", file, "-p", link), 0)
    needs(run(family, "status", "-p", f"replay:{file}"), 0)


def _quiet(family: str, link: str, _folder: Path) -> None:
    assert needs(run(family, "status", "-q", "-p", link), 0).err == ""


def _verbose(family: str, link: str, _folder: Path) -> None:
    said = needs(run(family, "status", "-v", "-p", link), 0).err
    assert " > " in said or " < " in said


def _debug(family: str, _link: str, _folder: Path) -> None:
    assert "Traceback" in run(family, "status", "--debug", "-p", "/dev/ttyUSB99").err


def _color(family: str, link: str, _folder: Path) -> None:
    assert "\x1b[" in needs(run(family, "status", "--color", "always", "-p", link), 0).out
    assert "\x1b[" not in run(family, "status", "--color", "never", "-p", link).out


def _wide(family: str, link: str, _folder: Path) -> None:
    rows = needs(run(family, "watch", "--count", "2", "--csv", "--wide", "-p", link), 0).lines
    assert len(rows) == 3
    assert len(needs(run(family, "watch", "--count", "2", "--csv", "--long", "-p", link), 0).lines) > 3


def _retries(family: str, link: str, folder: Path) -> None:
    """More questions into silence: from the first on, or behind the one that finds the device."""
    for silence in ("fault=silent", "fault=silent&after=1"):
        counts = []
        for number in ("0", "3"):
            trace = made(folder / silence) / f"{number}.txt"
            words = ("get", _first(family), "--retries", number, "--timeout", "0.2", "--trace", trace)
            run(family, *words, "-p", f"{link}&{silence}")
            counts.append(trace.read_text().count(" > "))
        if counts[0] < counts[1]:
            return
    raise AssertionError(f"{counts[0]} questions with 0 and with 3 retries")


def _first(family: str) -> str:
    return next(param.path for param in map_for(family) if param.readable and not param.optional)


def _timeout(family: str, link: str, _folder: Path) -> None:
    seconds = []
    for wait in ("0.2", "2"):
        with spying() as spy:
            needs(run(family, "status", "--timeout", wait, "--retries", "0", "-p", f"{link}&fault=silent"), 4)
        seconds.append(spy.now)
    assert seconds[0] < seconds[1], seconds


def _device(family: str, link: str, folder: Path) -> None:
    folder.mkdir(parents=True)
    (folder / "c.toml").write_text(f'[devices.left]\nkind = "{family}"\nport = "{link}"\n', encoding="utf-8")
    env = {"HANDCTL_CONFIG": str(folder / "c.toml")}
    direct = needs(run(family, "status", "-p", link, "--json"), 0).rows
    assert needs(run(family, "status", "-d", "left", "--json", env=env), 0).rows == direct
    assert needs(run("-d", "left", "status", "--json", env=env), 0).rows == direct


def _id(family: str, link: str, _folder: Path) -> None:
    there = run(family, "status", "--id", "7", "--json", "-p", f"{link}&id=7")
    needs(there if there.code != 2 else run(family, "status", "--id", "7", "-p", link), 0)
    assert there.json["device"]["id"] == 7


def _baud(family: str, link: str, _folder: Path) -> None:
    slower = next((baud for baud in row_of(family).speeds or (57600,) if baud != row_of(family).baud), 115200)
    needs(run(family, "status", "--baud", str(slower), "-p", f"{link}&baud={slower}"), 0)


EFFECTS = {
    "--id": _id, "--baud": _baud,
    "--json": _json, "--csv": _csv, "-o": _output, "--trace": _trace, "-q": _quiet, "-v": _verbose, "--debug": _debug,
    "--color": _color, "--wide": _wide, "--retries": _retries, "--timeout": _timeout, "-d": _device,
}  # fmt: skip


def _ends(family: str, name: str, folder: Path) -> None:
    """No command hangs: on a silent line it ends at its deadline, but for the stop that follows. Its JSON is valid."""
    with spying() as spy:
        result = typed(
            family, name, made(folder), link_of(family, "fault=silent"), "--deadline", DEADLINE, "--format", "ndjson"
        )
    assert json.loads(result.lines[-1])["end"]["exit_code"] == result.code
    needs(result, *((0, 3, 4, 5, 6, 7) if name == "stop" or name in facts_of(family).unproven else (3, 4, 5, 6, 7)))
    assert spy.now <= float(DEADLINE) + 2.1, f"{spy.now:.1f} s"


def _fifo(family: str, name: str, folder: Path) -> None:
    """Nobody writes to it: the command ends all the same."""
    pipe = made(folder) / "fifo"
    os.mkfifo(pipe)
    try:
        with bounded(FIFO_SECONDS, name):
            result = run(
                family, name, "--control", pipe, "--send", "velocity", "--deadline", "0.2", "-p", link_of(family)
            )
    except Hang as exc:
        raise AssertionError(str(exc)) from None
    assert result.code != 1, result


def cells() -> Iterator[Cell]:
    yield from everywhere()
    yield from works()
