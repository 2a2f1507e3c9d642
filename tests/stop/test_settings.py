"""No variable, line of the configuration, option, id, speed or name refuses or delays a stop: it falls back, and is told.

Generated: every setting, wherever it may stand, with texts that make no sense, before the stop of every family.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import click
import pytest

from handctl.command.config_file import DEVICE_KEYS
from handctl.command.options import CONNECTION, SharedOption, lasting_options
from handctl.families import FAMILIES, WIRES
from handctl.tools.family_probe import family_of
from tests.support.cli import Result, run
from tests.support.each_row import each_row

SECONDS = 2.0
"""Of processor time, on a busy machine too."""
FIRST = 1.0
"""Seconds until the first byte."""
NONSENSE: dict[str, tuple[str, ...]] = {
    "id": ("999", "-1", "x"),
    "baud": ("7", "0", "1000003", "x"),
    "timeout": ("1000", "0.000001", "-1", "x"),
    "deadline": ("0.000001", "nan", "x"),
    "retries": ("101", "-1", "x"),
    "model": ("nonsense",),
    "poll_json": ("nonsense", '{"hand_mode": 1}'),
    "device": ("nobody", "exo-of-nobody"),
    "output": ("/dev/null/none/x",),
    "trace": ("/dev/null/none/x",),
}
"""Texts by setting; of any other `nonsense`, which is no choice and no truth."""
IN_RANGE = {"id": ("999", "-1"), "baud": ("7", "1000003"), "timeout": ("1000", "0.000001"), "deadline": ("0.000001",)}
"""Those that are numbers as they should be, and mean nothing to a stop."""


class Cell(NamedTuple):
    """A setting with a text, where it stands, and the family that is stopped."""

    where: str
    name: str
    text: str
    family: str


@cache
def options() -> dict[str, SharedOption]:
    """Every setting that a variable or the file may hold, but the LINK itself, and what it is to be sent without."""
    return {str(option.name): option for option in lasting_options(WIRES) if option.key not in ("port", "dry_run")}


def may_stand(where: str, name: str, family: str) -> bool:
    option, row = options()[name], FAMILIES[family]
    own = {one.key for one in row.options}
    if where == "device":
        return name in DEVICE_KEYS or (name in own and any(one.key == name and one.named for one in row.options))
    foreign = option.family and option.key not in own
    # where the result goes is what was typed, and a result that cannot be written is an exit code of its own
    return where != "typed" or not (option.is_flag or foreign or name in ("output", "device", "format"))


def cells(where: str) -> Iterator[Cell]:
    """Each text before the stop of one family in turn; of what concerns a link, the first before that of every family."""
    for name, option in options().items():
        for number, text in enumerate(NONSENSE.get(name, ("nonsense",))):
            turn = list(FAMILIES)[zlib.crc32(f"{name}{text}".encode()) % len(FAMILIES)]
            every = option.section == CONNECTION and not number
            for family in FAMILIES:
                if (every or family == turn) and may_stand(where, name, family):
                    yield Cell(where, name, text, family)


def link_of(family: str) -> str:
    return f"fake://{family}?clock=virtual"


@cache
def plain(family: str) -> Result:
    """The stop with nothing in its way."""
    return run(family, "stop", "--json", "-p", link_of(family))


def in_toml(text: str) -> str:
    return text if text.replace(".", "").replace("-", "").isdecimal() or text == "nan" else f"'{text}'"


def tried(cell: Cell, folder: Path, *more: str) -> tuple[Result, float]:
    """The stop with that in its way; its result and its processor time."""
    where, name, text, family = cell
    place = ["-p", link_of(family)]
    env, config = {}, ""
    if where == "variable":
        env[f"HANDCTL_{name.upper()}"] = text
    elif where == "file":
        config = f"{name} = {in_toml(text)}\n"
    elif where == "device":
        config = f"[devices.left]\nkind = '{family}'\nport = '{link_of(family)}'\n{name} = {in_toml(text)}\n"
        place = ["-d", "left"]
    else:
        more = (*more, max(options()[name].opts, key=len), text)
    path = folder / "config.toml"
    path.write_text(config)
    trace = [] if name == "trace" else ["--trace", str(folder / "trace")]
    began = time.process_time()
    result = run(family, "stop", *place, *trace, *more, "--json", env={**env, "HANDCTL_CONFIG": str(path)})
    return result, time.process_time() - began


def is_told(cell: Cell) -> bool:
    """Whether this text must be told of: it is none of the option, or means nothing to the stop of this family."""
    where, name, text, family = cell
    option, known = options()[name], family_of(family)
    if where != "file" and (option.key == "format" or name in ("device", "fake", "trace")):
        return False  # what was typed stands before it, or it says so under a code of its own
    if text in IN_RANGE.get(name, ()):
        there = {"id": known.ids, "baud": bool(known.speeds)}.get(name, True)
        return there or where == "typed"
    if option.family and option.key not in {one.key for one in FAMILIES[family].options} and where != "file":
        return False
    if where == "file" and option.is_flag:
        return True  # a text is no truth
    try:
        (click.BOOL if option.is_flag else option.type).convert(text, option, None)
    except click.UsageError:
        return True
    return (name, family) in (("model", "hand"), ("poll_json", "aidin"))


@pytest.mark.parametrize("where", ["variable", "file", "device", "typed"])
def test_no_setting_refuses_or_delays_a_stop(where: str, tmp_path: Path) -> None:
    wrong = []
    count = 0
    for cell in cells(where):
        result, seconds = tried(cell, tmp_path)
        wanted = plain(cell.family)
        count += 1
        problems = []
        if result.code != wanted.code:
            problems.append(f"exit {result.code} for {wanted.code}: {result.err or result.out}")
        elif [row["bytes"] for row in result.rows] != [row["bytes"] for row in wanted.rows]:
            problems.append(f"bytes {result.rows}")
        elif is_told(cell) and "passed-over" not in result.codes():
            problems.append(f"not told: {result.codes()}")
        trace = tmp_path / "trace"
        if trace.exists():
            first = next((line for line in trace.read_text().splitlines() if " > " in line), "9 nothing was sent")
            if float(first.split()[0]) > FIRST:
                problems.append(f"first byte: {first}")
            trace.unlink()
        if seconds > SECONDS:
            problems.append(f"{seconds:.1f} s of processor time")
        wrong += [f"{cell}: {problem}" for problem in problems]
    assert not wrong, f"{len(wrong)} of {count}\n" + "\n".join(line[:300] for line in wrong[:40])
    assert count > 20


def times(trace: Path) -> list[float]:
    return [float(line.split()[0]) for line in trace.read_text().splitlines() if " > " in line]


@each_row("seconds", [0.1, 0.3, 1.0])
@each_row("family", FAMILIES)
def test_the_deadline_bounds_the_whole_stop(family: str, seconds: float, tmp_path: Path) -> None:
    """Of a device that says nothing: the first bytes go out all the same, and none behind the deadline."""
    trace = tmp_path / "trace"
    link = f"{link_of(family)}&fault=silent"
    result = run(family, "stop", "-p", link, "--deadline", str(seconds), "--trace", str(trace), "--json")
    free = run(family, "stop", "-p", link, "--trace", str(tmp_path / "free"), "--json")
    assert result.code == free.code == 4 and result.error["hint"], result
    assert times(trace) and max(times(trace)) <= seconds, result
    assert set(times(trace)) <= set(times(tmp_path / "free")), "the same steps as without, as far as it goes"
    if family != "wrist":  # a wrist that does not say where it is cannot be held there
        assert any(not row["reads"] for row in result.rows), result


CONFIG = """
wide = 3
baud = 7
[devices.left]
kind = "exo"
port = "fake://exo?clock=virtual"
[devices.none]
kind = "nothing"
port = 3
[devices.right]
kind = "barrett"
port = "fake://barrett?clock=virtual"
"""


@each_row(
    "words, env, told",
    [
        ("stop -d left", {}, 3),
        ("stop -d left", {"HANDCTL_PORT": "fake://barrett"}, 4),
        ("stop -d left", {"HANDCTL_FAKE": "1"}, 4),
        ("exo stop -d right -p {exo}", {}, 4),
        ("exo stop -d nobody -p {exo}", {}, 3),
        ("exo stop -p {exo} --id 1 --can", {}, None),
        ("wrist stop -p {wrist} --can", {}, 4),
        ("wrist stop -p {wrist} --can --serial", {}, 5),
        ("wrist stop -p {wrist}", {"HANDCTL_SERIAL": "1", "HANDCTL_CAN": "1"}, 4),
        ("--format pretty --id x exo stop -p {exo}", {}, 5),
        ("stop -d left,right", {"HANDCTL_WIDE": "1", "HANDCTL_TRACE": "{folder}/one"}, None),
        ("exo stop -p {exo}", {"HANDCTL_TRACE": "{folder}/config.toml"}, 4),
        ("exo stop -p {exo}", {"HANDCTL_JSON": "1", "HANDCTL_CSV": "1"}, 3),
    ],
)
def test_what_contradicts_itself_holds_up_no_stop(
    words: str, env: dict[str, str], told: int | None, tmp_path: Path
) -> None:
    """With a file of which three lines are wrong beside. None: an option that is none, or no envelope of one device."""
    path = tmp_path / "config.toml"
    path.write_text(CONFIG)
    env = {name: text.format(folder=tmp_path) for name, text in env.items()}
    typed = words.format(**{family: link_of(family) for family in FAMILIES}).split()
    result = run(*typed, "--json", env={"HANDCTL_CONFIG": str(path), **env})
    assert path.read_text() == CONFIG
    if "--id 1 --can" in words:
        assert result.code == 2 and "No such option" in result.out, result
    elif told is None:
        assert result.code == 0 and [one["exit_code"] for one in result.json["results"]] == [0, 0], result
    else:
        family = words.replace("-d left", "exo").split("stop")[0].split()[-1:] or ["exo"]
        wanted = plain(family[0])
        assert result.code == 0 and [row["bytes"] for row in result.rows] == [row["bytes"] for row in wanted.rows], (
            result
        )
        assert result.codes().count("passed-over") == told, result.json["messages"]


def test_names_that_cannot_be_found_hold_up_no_stop_of_the_others(tmp_path: Path) -> None:
    """Whatever is wrong with one of them, the result says that it was not stopped."""
    path = tmp_path / "config.toml"
    path.write_text(CONFIG)
    env = {"HANDCTL_CONFIG": str(path)}
    for names in ("nobody,left", "left,none,nobody"):
        result = run("stop", "-d", names, "--json", env=env)
        assert [(one["name"], one["exit_code"]) for one in result.json["results"]] == [("left", 0)], result
        assert result.code == 2 and all(name in result.error["text"] for name in names.split(",") if name != "left")
    assert run("status", "-d", "left,nobody", env=env).code == 2


def test_a_variable_that_names_a_device_is_no_simulator_and_tells_of_another_port(tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_text(CONFIG)
    env = {"HANDCTL_CONFIG": str(path), "HANDCTL_DEVICE": "left"}
    result = run("stop", "--json", env={**env, "HANDCTL_FAKE": "1"})
    assert (result.code, result.json["device"]["link"]) == (0, "fake://exo?clock=virtual"), result
    assert "HANDCTL_FAKE" in result.out
    result = run("stop", "--json", env={**env, "HANDCTL_PORT": "fake://barrett?clock=virtual"})
    assert (result.code, "other-port" in result.codes()) == (0, True), result


def test_where_nothing_says_which_device_it_is_nothing_is_guessed(tmp_path: Path) -> None:
    path = tmp_path / "config.toml"
    path.write_text(CONFIG)
    env = {"HANDCTL_CONFIG": str(path)}
    for words in (["stop"], ["stop", "-d", "nobody"], ["stop", "-d", "none"], ["wrist", "stop", "-d", "left"]):
        result = run(*words, "--json", env=env)
        assert result.code == 2 and result.json["counters"]["sent"] == 0 and result.error["hint"], result
    both = run("exo", "stop", "--json", env={**env, "HANDCTL_PORT": "fake://exo", "HANDCTL_FAKE": "1"})
    assert both.code == 2 and "exclude each other" in both.out, both
    reads = run("exo", "status", "--id", "x", "-p", link_of("exo"))
    assert reads.code == 2 and "--id" in reads.err, "what reads says so before it begins"
    reads = run("--id", "x", "exo", "status", "-p", "fake://stop")
    assert reads.code == 2 and "--id" in reads.err
