"""Whichever way leads to an effect asks before it: `set`, a verb, `write`, `raw`, `gcl`, `load`, `restore`.

The routes are made from the maps. Each is carried out on a simulator, so that it is known to have the effect; then without
--yes: where `set` asks, every route asks and writes nothing. A route that asks more than that is declared with its reason.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from handctl.docgen.read_command_tree import map_of
from handctl.model.param import Element, Param
from tests.support.cli import run
from tests.support.each_row import each_row
from tests.support.snapshots import signed

MORE = {
    ("wrist", "raw"): "bytes typed by hand: anything but a read asks",
    ("wrist", "restore"): "a plan of many writes is shown before it is carried out",
    ("barrett", "restore"): "a plan of many writes is shown before it is carried out",
}
"""Routes that ask although `set` of the same quantity asks nothing."""


class Route(NamedTuple):
    """One way: the words after the family; `content` is the snapshot that they name as {}."""

    name: str
    words: tuple[str, ...]
    content: dict[str, float] | None = None


def inspire(kind: str, flag: int, element: Element, value: float) -> Iterator[Route]:
    """`write` and `raw` of a register, put together by hand."""
    from handctl.devices.inspire.register_map import register_of

    register = register_of(element)
    address, data = register.address_of(element.index), register.encode(value)
    if register.name != "id":  # `write` refuses it: `id` finds the device again
        yield Route("write", ("write", str(address), data.hex()))
    body = bytes([1, len(data) + 3, flag]) + address.to_bytes(2, "little") + data
    frame = b"\xeb\x90" + body + bytes([sum(body) & 0xFF])
    yield Route("raw", ("raw", frame.hex()))


def routes(kind: str, element: Element, value: float) -> Iterator[Route]:
    """Every way to write `value` to `element`."""
    name, text = element.full_name, element.param.text(value)
    yield Route("set", ("set", f"{name}={text}"))
    setpoints = ("--setpoints",) if element.param.kind == "command" else ()
    yield Route("restore", ("restore", "{}", *setpoints), {name: value})
    if kind == "exo":
        yield from inspire(kind, 0x12, element, value)
        verbs = {"id": ("id", text), "baud_code": ("baud", {"1": "57600", "2": "19200"}.get(text, "115200"))}
        for which in ("position", "force"):
            verbs[f"{which}_set"] = (which, *[text] * 5)
        yield Route("verb", verbs[element.param.name])
    if kind == "wrist":
        yield from inspire(kind, 0x31, element, value)
    if kind == "barrett":
        if name == "baud_rate":
            yield Route("verb", ("baud", str(int(value) * 100)))
        else:
            prefix = {"F1": "1", "F2": "2", "F3": "3", "SPREAD": "4"}.get(element.part or "", "")
            command = f"{prefix}FSET" if prefix else "PSET"
            yield Route("gcl", ("gcl", f"{command} {element.param.mnemonic} {text}"))  # type: ignore[attr-defined]


def link(kind: str, folder: Path) -> str:
    return f"fake://{kind}?clock=virtual&state={folder / 'state.json'}"


def held(kind: str, folder: Path) -> dict[str, object]:
    """What the device holds now, by name."""
    place = ("-p", link(kind, folder))
    for extra in ((), ("--id", "127")):  # the id may be another one
        result = run(kind, "snapshot", folder / "now.json", *place, *extra)
        if result.code == 0:
            return dict(json.loads((folder / "now.json").read_text())["values"])
    raise AssertionError(result)


def now(kind: str, folder: Path, element: Element) -> object:
    """What the device holds now of one quantity: all of it takes ten times as long."""
    place = ("-p", link(kind, folder), "--json")
    for extra in ((), ("--id", "127")):
        result = run(kind, "get", element.full_name, *place, *extra)
        if result.code == 0:
            return next(row["value"] for row in result.rows if row["path"] == element.path)
    raise AssertionError(result)


def power_on(kind: str) -> dict[str, object]:
    """What the simulated device holds in the beginning."""
    with tempfile.TemporaryDirectory() as folder:
        return held(kind, Path(folder))


def other_value(param: Param, now: object) -> float:
    """A value in the middle of its range, or another of its choices."""
    if param.choices:
        return next(value for value in param.choices if value != now)
    assert param.low is not None and param.high is not None
    return 1.5 if param.decimals else int(param.low + param.high) // 2


KINDS = ("exo", "wrist", "barrett")
"""Those whose maps are written by `set` and ask by their rules; an ekso asks before every setting (test_cli_ekso)."""


@cache
def before(kind: str) -> dict[str, object]:
    return power_on(kind)


@cache
def cases(kind: str) -> list[tuple[Route, Element, float]]:
    return [
        (route, element, value)
        for param in map_of(kind) or ()
        if param.writable and not param.optional
        for element in param.each[:1]
        for value in (other_value(param, before(kind)[element.full_name]),)
        for route in routes(kind, element, value)
    ]


def words(route: Route, kind: str, folder: Path) -> list[str]:
    """The command line; its snapshot is written to `folder`."""
    path = folder / "snapshot.json"
    if route.content is not None:
        content = {"schema": "handctl-snapshot/1", "kind": kind, "device": {}, "values": route.content, "fake": True}
        path.write_text(json.dumps(signed(content)))
    force = ["--force"] if kind == "barrett" and route.name in ("set", "restore", "gcl") else []
    return [kind, *(word.format(path) for word in route.words), *force]


@pytest.mark.parametrize("kind", KINDS)
def test_every_route_to_a_quantity_asks_as_set_does(tmp_path: Path, kind: str) -> None:
    where = ("-p", link(kind, tmp_path))
    for route, element, value in cases(kind):
        told = f"{element.full_name} by {route.name}"
        (tmp_path / "state.json").unlink(missing_ok=True)
        refused = run(*words(route, kind, tmp_path), *where)
        asks = refused.code == 8
        if not asks:
            assert refused.code == 0, (told, refused)
            (tmp_path / "state.json").unlink()
        else:
            assert held(kind, tmp_path) == before(kind), f"{told}: unconfirmed, nothing is written"
        expected = element.param.strands or (kind == "exo" and element.param.moves)
        assert asks == (expected or (kind, route.name) in MORE), (told, refused)
        done = run(*words(route, kind, tmp_path), "-y", *where)
        assert done.code == 0, (told, done)
        assert now(kind, tmp_path, element) == value, f"{told}: the route has the effect"


def test_what_is_declared_is_in_use() -> None:
    assert {(kind, route.name) for kind in KINDS for route, _, _ in cases(kind)} >= set(MORE)


# -- the speed and the EEPROM of a BarrettHand ------------------------------------------------------------------------------

SPEED_ROUTES = (
    ("set", "BAUD=192"), ("baud", "19200"), ("defaults",), ("load",), ("reset",), ("gcl", "PDEF"), ("gcl", "PLOAD"),
    ("gcl", "FGET P", "pdef"), ("restore", "{}"),
)  # fmt: skip
EEPROM_ROUTES = (
    ("save",),
    ("gcl", "FSAVE"),
    ("gcl", "2fsave"),
    ("gcl", "PSAVE"),
    ("baud", "9600", "--save"),
    ("restore", "{}", "--save"),
)


@each_row("args", [*SPEED_ROUTES, *EEPROM_ROUTES], ids=" ".join)
def test_whatever_may_change_the_speed_or_wear_the_eeprom_asks(tmp_path: Path, args: tuple[str, ...]) -> None:
    route = Route("x", args, {"baud_rate": 192} if "{}" in args else None)
    trace = tmp_path / "t.txt"
    result = (
        run(*words(route, "barrett", tmp_path), "--force", "-p", link("barrett", tmp_path), "--json", "--trace", trace)
        if args[0] in ("set", "restore", "save")
        else run(*words(route, "barrett", tmp_path), "-p", link("barrett", tmp_path), "--json", "--trace", trace)
    )
    assert result.code == 8, result
    wanted = ("EEPROM",) if args in EEPROM_ROUTES[:4] else ("baud rate", "bit/s", "EEPROM", "unreachable: baud_rate")
    assert any(word in result.error["text"] for word in wanted), result.error
    sent = trace.read_text() if trace.exists() else ""
    assert not any(
        word in bytes.fromhex("".join(line.split()[2:])).decode("latin-1").upper()
        for line in sent.splitlines()
        if " > " in line
        for word in ("SET", "DEF", "LOAD", "SAVE", "RESET")
    )
    planned = run(
        *words(route, "barrett", tmp_path),
        "-n",
        *(("--force",) if args[0] in ("set", "restore", "save") else ()),
        "--json",
    )
    assert any(row["strands"] for row in planned.rows), planned


@each_row(
    "args", [("defaults", "--motors", "3"), ("load", "--motors", "S"), ("gcl", "FDEF"), ("gcl", "FLOAD")], ids=" ".join
)
def test_what_leaves_speed_and_eeprom_alone_asks_nothing(tmp_path: Path, args: tuple[str, ...]) -> None:
    assert run("barrett", *args, "-p", link("barrett", tmp_path)).code == 0


# -- nobody asked, by a variable or a file ---------------------------------------------------------------------------------

UNASKED = "A device that someone may be wearing moves without asking"


def moving() -> Iterator[tuple[str, ...]]:
    """Every exo command line that moves the worn hand, and an ekso setting."""
    yield from (("exo", "force", *["5"] * 5), ("exo", "position", *["500"] * 5), ("exo", "calibrate"))
    yield from (
        ("exo", "set", "force_set.index=5"),
        ("exo", "set", "position_set.index=5"),
        ("exo", "write", "1498", "0500"),
    )
    yield ("exo", "raw", "EB 90 01 0B 31 64 00 9C FF 00 00 E8 03 18 FC 3B")
    yield ("exo", "restore", "{}", "--setpoints")
    yield ("ekso", "set", "step_length=15.5", "--operator", "me")


@each_row("args", list(moving()), ids=lambda args: " ".join(args[:2]))
@each_row("by", ["variable", "file"])
def test_a_worn_device_never_moves_without_a_word(tmp_path: Path, args: tuple[str, ...], by: str) -> None:
    """HANDCTL_YES=1, or `yes = true` with `quiet = true` in the file: one line on stderr, also with -q and --json."""
    route = Route("x", args[1:], {"force_set.index": 5} if "{}" in args else None)
    line = words(route, args[0], tmp_path)
    where = (
        "-p",
        f"fake://{args[0]}?clock=virtual",
        *(("--audit", str(tmp_path / "a.jsonl")) if args[0] == "ekso" else ()),
    )
    env = {"HANDCTL_YES": "1"}
    if by == "file":
        (tmp_path / "handctl").mkdir()
        (tmp_path / "handctl" / "config.toml").write_text("yes = true\nquiet = true\n")
        env = {"XDG_CONFIG_HOME": str(tmp_path)}
    for extra in (("-q",), ("-q", "--json")):
        result = run(*line, *where, *extra, env=env)
        assert result.code == 0, result
        (said,) = [text for text in result.err.splitlines() if UNASKED in text]
        assert ("HANDCTL_YES" if by == "variable" else "config.toml:1") in said
        (tmp_path / "a.jsonl").unlink(missing_ok=True)
    assert "yes-unasked" in result.codes()
    typed = run(*line, *where, "-q", "-y")
    assert (typed.code, UNASKED in typed.err) == (0, False)


@each_row(
    "args",
    [("exo", "save"), ("exo", "id", "3"), ("barrett", "save", "--force"), ("wrist", "restore", "{}", "--setpoints")],
    ids=" ".join,
)
def test_quiet_is_quiet_where_nobody_is_moved(tmp_path: Path, args: tuple[str, ...]) -> None:
    line = words(Route("x", args[1:], {"yaw_set": 5.0} if "{}" in args else None), args[0], tmp_path)
    result = run(*line, "-q", "-p", link(args[0], tmp_path), env={"HANDCTL_YES": "1"})
    assert (result.code, result.err) == (0, "")
