"""Every fault of every simulator, on each of its wires, in every command of its family: what must hold of each cell.

What is read, written and done on a healthy line is the measure: two healthy runs at different speeds of the device say which
values hold still and what the command changes in it. A line that fails may cost time or an exit code, and never leads to another
value, a second write, or a success that is none. The exit codes, and what a fault of the device changes, are written by hand
in `tests/contract/facts/outcomes`.
"""

from __future__ import annotations

import importlib
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache, cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from handctl.families import FAMILIES
from handctl.sim.engine.can_line import CAN_FAULTS
from handctl.sim.engine.line_and_faults import LINE_FAULTS
from tests.contract.cell import in_bytes, judge, stops
from tests.contract.facts import facts_of, passed
from tests.contract.facts.outcomes import Outcomes, Variant, outcomes_of
from tests.harm.cell import _same as same
from tests.harm.cell import fingerprint
from tests.search.causes import causes_of
from tests.search.suite import Listed, bounded, parts
from tests.support.cli import Result, Spy, run, spying

SECONDS = 30.0
"""Of real time: a command that takes longer hangs."""
TURNAROUNDS = ("0", "0.11")
"""How long the device takes to answer in the healthy runs."""
SETTLE = 5.0
"""Virtual seconds after which what a command set going has arrived."""
WARM = ("temperature", "heat", "odometer", "counts", "acts[", "feedback[")
"""Parts of a device that depend on how long everything took."""
IS_WARM = re.compile("|".join(map(re.escape, WARM))).search
PASSING = ("file", "link", "port", "answer", "suspicion", "times")
"""Keys of a row that are of one run: `times` is how often a stop repeated a step, until it was acknowledged or seen."""
CODES = {0, 2, 3, 4, 5, 6, 7, 8}
COMMON = {*LINE_FAULTS, *CAN_FAULTS}
"""Faults that are the same code for every family."""


class Cell:
    """One command line against one fault."""

    def __init__(
        self, family: str, wire: str, row: Any, folder: Path, *options: str, words: tuple[str, ...] = ()
    ) -> None:
        self.family, self.wire, self.row, self.folder = family, wire, row, folder
        self.facts, self.table = facts_of(family), outcomes_of(family)
        own, trace = self.table.wires[wire], folder / "trace.txt"
        kept = (self.table.state, own.options, *(f"posture={row.posture}" for _ in "1" if hasattr(row, "posture")))
        said = dict(
            item.split("=", 1) for item in "&".join(filter(None, ("clock=virtual", *kept, *options))).split("&")
        )
        self.link = f"fake://{family}?{'&'.join(f'{name}={value}' for name, value in said.items())}"
        args = getattr(row, "on_can", ()) if "bus=can" in own.options else ()
        typed = [word.replace("{dir}", str(folder)) for word in (args or row.args)]
        asks = getattr(row, "asks", False) or row.kind == "write"  # some ask in some states only
        asked = ["--yes"] if asks else ["--timeout", "1"] if row.kind == "scan" else []
        more = ["--json", "--trace", str(trace), *own.words, *words, *asked]
        with bounded(SECONDS, f"{family} {row.name}"), spying() as spy:
            self.result: Result = run(
                family, *typed, "-p", self.link, *more, env={"XDG_STATE_HOME": str(folder / "state")}
            )
        self.spy: Spy = spy
        self.passed = passed(trace)

    def __repr__(self) -> str:
        return f"{self.family} {' '.join(self.row.args)} -p '{self.link}': {self.result!r}"

    @cached_property
    def answer(self) -> tuple[list[dict[str, Any]], dict[str, Any]]:
        """Rows and envelope, whatever the format; valid by the schema."""
        if self.row.kind == "stream":
            return self.result.stream
        envelope = self.result.json
        return envelope["rows"], envelope

    @property
    def rows(self) -> list[dict[str, Any]]:
        return self.answer[0]

    @property
    def envelope(self) -> dict[str, Any]:
        return self.answer[1]

    @cached_property
    def command(self) -> str:
        """The words by which the tree knows the command."""
        names = {*self.facts.writes, *self.facts.reads}
        return next((name for size in (2, 1) if (name := " ".join(self.row.args[:size])) in names), self.row.args[0])

    @cached_property
    def written(self) -> list[bytes]:
        """What went out that writes, by the rule of the family; a stop of its movement left out."""
        writing = self.facts.rule(self.command)
        said = [(entry, writing(entry)) for entry in self.passed]
        return [
            _spelled(entry.data, entry.can_id, self.wire)
            for entry, writes in said
            if writes and entry.mark == ">" and entry.data != self.facts.idle
        ]

    @property
    def writes(self) -> list[dict[str, Any]]:
        """The steps of the ledger, those of a stop behind its own."""
        return list(self.envelope.get("writes", ()))

    @property
    def stopped(self) -> Counter[bytes]:
        """What of it the ledger has as the stop behind its own steps: to hold where it has arrived is the frame that sent it there."""
        found = Counter[bytes]()
        for step in self.writes:
            if step["state"] != "not-sent" and stops(step):
                number, can, _ = step["bytes"].partition(" [")
                data = _spelled(in_bytes(step["bytes"]), int(number, 16) if can else None, self.wire)
                found[data] += step.get("count", 1)
        return found

    @property
    def values(self) -> dict[str, Any]:
        return {row["path"]: row["value"] for row in self.rows if row.get("value") is not None and "path" in row}

    @property
    def lacking(self) -> set[str]:
        """The quantities of which it was told that this firmware does not have them."""
        told = (one["text"] for one in self.envelope["messages"] if one["code"] == "not-on-this-firmware")
        return {name for text in told for name in re.findall(r"\w+", text.partition(":")[2])}

    @property
    def held(self) -> dict[str, Any]:
        """What the device holds behind it, field by field, once it has come to rest."""
        if not self.spy.lines:
            return {}
        line = self.spy.lines[-1]
        line.advance(line.device.now + SETTLE)
        return lasting(fingerprint(line))

    @property
    def errors(self) -> list[dict[str, Any]]:
        return [message for message in self.envelope["messages"] if message["level"] == "error"]


def _spelled(data: bytes, can_id: int | None, wire: str) -> bytes:
    """A frame by what it means: a transaction has another number each time."""
    if can_id is not None:
        return can_id.to_bytes(4, "big") + data
    return data[2:] if wire == "tcp" else data


# -- the measure --------------------------------------------------------------------------------------------------------


class Usual(NamedTuple):
    """What is the same in the healthy runs.

    values   by path
    paths    that have a value
    said     everything in its rows, by place and key
    """

    values: dict[str, Any]
    paths: frozenset[str]
    said: dict[str, Any]


@cache
def healthy(family: str, wire: str, name: str, turnaround: str = TURNAROUNDS[0]) -> Cell:
    """The command on a healthy line."""
    row = next(row for row in outcomes_of(family).rows if row.name == name)
    with TemporaryDirectory() as folder:
        prepare(family, Path(folder))
        cell = Cell(family, wire, row, Path(folder), f"turnaround={turnaround}", "seed=1")
    assert cell.result.code in (0, 7), cell
    return cell


def both(family: str, wire: str, name: str) -> list[Cell]:
    """The command on both healthy lines."""
    cells = [healthy(family, wire, name, turnaround) for turnaround in TURNAROUNDS]
    assert len({cell.result.code for cell in cells}) == 1, cells
    return cells


@cache
def usual(family: str, wire: str, name: str) -> Usual:
    """How the command ends on a healthy line."""
    cells = both(family, wire, name)
    return Usual(
        _steady([cell.values for cell in cells]),
        frozenset(cells[0].values),
        _steady([command_line(cell) for cell in cells]),
    )


@cache
def changes(family: str, wire: str, name: str) -> dict[str, Any]:
    """What the command changes in a device on a healthy line."""
    return _steady([differing(cell.held, at_rest(family, cell.link)) for cell in both(family, wire, name)])


def at_rest(family: str, link: str) -> dict[str, Any]:
    """The device of a link, to which nobody has talked."""
    import handctl.sim

    options = dict(item.split("=", 1) for item in link.partition("?")[2].split("&"))
    line = handctl.sim.create(family, {name: text for name, text in options.items() if name not in ("clock", "seed")})
    line.advance(SETTLE)
    return lasting(fingerprint(line))


def lasting(held: dict[str, Any]) -> dict[str, Any]:
    """Without what goes its own way."""
    return {place: value for place, value in held.items() if not IS_WARM(place)}


def differing(held: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """What of it is not so in the other, field by field; memory byte by byte, and only where it differs: it may be large."""
    found: dict[str, Any] = {}
    for place, value in held.items():
        old = other.get(place)
        if not isinstance(value, bytes):
            if old != value:
                found[place] = value
        elif old != value:
            was = old if isinstance(old, bytes) else b""
            found |= {f"{place}[{at}]": byte for at, byte in enumerate(value) if was[at : at + 1] != value[at : at + 1]}
    return found


def held_at(held: dict[str, Any], place: str) -> Any:
    """A field, or a byte of one; None where there is none."""
    if place in held:
        return held[place]
    name, _, at = place.removesuffix("]").rpartition("[")
    memory = held.get(name)
    return memory[int(at)] if isinstance(memory, bytes) and int(at) < len(memory) else None


def _steady(found: list[dict[str, Any]]) -> dict[str, Any]:
    first, *others = found
    return {key: value for key, value in first.items() if all(key in other and other[key] == value for other in others)}


def command_line(cell: Cell) -> dict[str, Any]:
    """Its rows as one table, without what is only of this run."""
    timed = cell.table.timed or ("\0",)
    return {
        f"{place}.{key}": value
        for place, row in enumerate(cell.rows)
        if not any(str(row.get(word)).startswith(timed) for word in ("path", "name"))
        for key, value in row.items()
        if key not in PASSING
    }


@cache
def before(family: str, wire: str) -> dict[str, Any]:
    """What the device reads before any command, by path: of those that hold still."""
    table = outcomes_of(family)
    shown: dict[str, Any] = {}
    for name in ("dump", "status", "get"):
        if any(row.name == name for row in table.rows):
            shown |= usual(family, wire, name).values
    return shown


def prepare(family: str, folder: Path) -> None:
    """The files that its lines name."""
    if module := facts_of(family).rows_in:
        importlib.import_module(module).prepare(folder)


# -- what must hold -----------------------------------------------------------------------------------------------------


def holds(cell: Cell, fault: str, variant: str) -> None:
    """Raise AssertionError with what is wrong."""
    table, own = cell.table, cell.table.wires[cell.wire]
    sound(cell, fault)
    codes = table.codes(cell.wire, fault, cell.row, variant)
    assert cell.result.code in codes, (sorted(codes), cell)
    assert fault in table.lacks or not cell.lacking, (cell.lacking, cell)
    if not table.is_told(fault, cell.row.name):
        return
    truthful(cell, fault)
    if variant == "always" and cell.result.code in (3, 4, 5):
        (error,) = cell.errors
        assert error["hint"] and cell.link.partition("?")[0] in error["text"], cell
        causes = causes_of(fault, cell.family, cell.wire, cell.command)
        assert not causes or error["code"] in causes, (error["code"], causes, cell)
    if cell.result.code == 0 and not table.variants.get(variant, ALWAYS).bound:
        complete(cell, fault, line=fault in own.line)


def sound(cell: Cell, fault: str) -> None:
    """No bug of ours, one error, an end in time, a true ledger, nothing written twice."""
    assert cell.result.code in CODES and "Traceback" not in cell.result.err, cell
    assert len([error for error in cell.errors if error["code"] != "leaving"]) == (cell.result.code != 0), cell
    assert not cell.spy.lines or cell.spy.now < cell.table.seconds, (cell.spy.now, cell)
    assert not [row for row in cell.rows if "error" in row and "value" in row], cell
    if fault in cell.facts.confusing or fault in cell.table.erratic:
        return
    assert cell.result.code not in (2, 8) or not cell.written, (cell.written, cell)
    if not cell.written and cell.command not in cell.facts.writes:
        return  # as it should be
    meant = healthy(cell.family, cell.wire, cell.row.name).written
    if not meant:
        assert not cell.written, (cell.written, cell)
        return
    if cell.command in set(cell.facts.writes) - cell.facts.unproven:
        judge(cell.family, cell.command, cell.envelope["writes"], cell.passed)
    if cell.row.name not in cell.table.again:
        sent = Counter(cell.written) - cell.stopped
        twice = {data: count for data, count in sent.items() if count > meant.count(data) > 0}
        assert not twice, (twice, cell)


def truthful(cell: Cell, fault: str) -> None:
    """No value that is not the device's: before or after what the command does; of what moves between both."""
    changed = cell.table.changed.get(fault, {})
    for row in cell.rows:
        path = row.get("path")
        unknown = row.get("value") is None or str(row["value"]).startswith("? (")
        if (
            unknown
            or path is None
            or str(row.get("name")).startswith(cell.table.timed or ("\0",))
            or path.startswith(cell.table.timed or ("\0",))
        ):
            continue
        first, after = before(cell.family, cell.wire), usual(cell.family, cell.wire, cell.row.name).values
        good = [changed[path]] if path in changed else [values[path] for values in (first, after) if path in values]
        if path in changed and path in after and after[path] != first.get(path):
            good.append(after[path])  # what the command writes, it writes there as well
        if (settle := cell.table.settles.get(cell.row.name)) is not None:
            good = list(dict.fromkeys([*good, *map(settle, good)]))
        if row["value"] in good or not good:
            continue
        assert cell.row.kind in ("move", "command") and len(good) == 2, (row, good, cell)
        assert min(good) <= row["value"] <= max(good), (row, good, cell)


def complete(cell: Cell, fault: str, *, line: bool) -> None:
    """Success: everything is there and right, and the device holds what was written."""
    wanted = usual(cell.family, cell.wire, cell.row.name)
    lacking = {path for path in wanted.paths if path.partition(".")[0] in cell.lacking}
    assert frozenset(cell.values) | lacking == wanted.paths, (frozenset(cell.values) ^ wanted.paths, cell)
    if not line or cell.row.kind == "stream":
        return
    if cell.row.kind not in ("raw", "gcl", "reset"):  # these show whatever comes, an echo too
        shown = command_line(cell)
        wrong = {
            key: value for key, value in wanted.said.items() if shown.get(key) != value and key not in settling(cell)
        }
        assert not wrong, (wrong, cell)
    right = changes(cell.family, cell.wire, cell.row.name)
    if right and (held := cell.held):
        found = {place: held_at(held, place) for place in right}
        differ = {place: (value, found[place]) for place, value in right.items() if not same(found[place], value)}
        assert not differ, (differ, cell)
    if cell.command not in cell.facts.adapts and cell.row.name not in cell.table.again:
        meant = healthy(cell.family, cell.wire, cell.row.name).written
        assert [data for data in cell.written if data in meant] == meant, cell


def settling(cell: Cell) -> set[str]:
    """What its rows say, by place and key, of values that were still settling when they were read."""
    settle = cell.table.settles.get(cell.row.name)
    if settle is None:
        return set()
    first = before(cell.family, cell.wire)
    return {
        f"{place}.{key}"
        for place, row in enumerate(cell.rows)
        if (old := first.get(row.get("path", ""))) is not None and row.get("value") == settle(old) != old
        for key in ("value", "raw", "label")
    }


# -- the suite ----------------------------------------------------------------------------------------------------------


ALWAYS = Variant()


def cells_of(family: str) -> Iterator[tuple[str, str, str, str]]:
    """(wire, command, fault, variant)."""
    table = outcomes_of(family)
    for wire, own in table.wires.items():
        for row in table.rows:
            for fault in (*own.line, *own.device):
                yield wire, row.name, fault, "always"
            for name, variant in table.variants.items():
                for fault in own.line if variant.faults is None else variant.faults:
                    if all(
                        at in (chosen or [at]) for at, chosen in ((row.name, variant.commands), (wire, variant.wires))
                    ):
                        yield wire, row.name, fault, name


class Faults(Listed):
    """Family, wire, command, fault, when it comes."""

    name = "faults"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for family in FAMILIES:
            for cell in cells_of(family):
                yield (family, *cell), (family, *cell)

    def tried(self, row: Any, folder: Path) -> str:
        """Its exit code, and the codes of its errors."""
        done = try_cell(*row, folder)
        return " ".join([f"exit {done.result.code}", *(error["code"] for error in done.errors)])

    def wanted(self) -> Iterable[str]:
        """Every command, every wire, every fault, every moment."""
        return dict.fromkeys(what for cell in self.cells() for what in self.shows(cell))

    def shows(self, cell: str) -> Iterator[str]:
        _, family, wire, command, fault, when = parts(cell)
        yield from (f"command {family} {command}", f"wire {family} {wire}", f"when {when}")
        yield f"fault {fault}" if fault in COMMON else f"fault {family} {fault}"


def try_cell(family: str, wire: str, name: str, fault: str, when: str, folder: Path) -> Cell:
    """Run one cell and judge it."""
    table: Outcomes = outcomes_of(family)
    row = next(row for row in table.rows if row.name == name)
    variant = table.variants.get(when, ALWAYS)
    prepare(family, folder)
    options = variant.options.split("&") if variant.options else []
    options += [f"fault={fault}"] * (not any(option.startswith("fault=") for option in options))
    options += ["seed=1"] * (not any(option.startswith("seed=") for option in options))
    cell = Cell(family, wire, row, folder, *options, words=table.words if variant.words is None else variant.words)
    holds(cell, fault, when)
    if variant.bound:
        stopped = len(cell.writes) > len(healthy(family, wire, name).writes)
        bound = variant.bound + (variant.stop if stopped else 0.0)
        assert cell.spy.now <= bound, (cell.spy.now, bound, cell)
    table.also(cell)
    return cell


SUITES = (Faults(),)
