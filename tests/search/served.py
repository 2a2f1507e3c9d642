"""The faults over real links: each device on each wire that `handctl sim` serves, in real time and with processes.

A cell starts its simulator with the fault, runs the command against it and judges it by the tables of `tests/search/faults.py`; what
is new here are the link, the deadline by the wall clock, and the next command, which must work once the fault is over.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from handctl.sim.engine.serve import ServeError, send_control
from tests.contract.facts import facts_of, passed
from tests.contract.facts.outcomes import outcomes_of
from tests.search.causes import causes_of
from tests.search.faults import Cell, prepare, truthful
from tests.search.suite import Listed
from tests.support.cli import PATIENCE, Simulator, Spy, run

SERVED: dict[str, dict[str, str]] = {
    "exo": {"pty": "serial", "tcp": "serial"},
    "wrist": {"pty": "serial", "tcp": "serial", "slcan-tcp": "can", "slcan-pty": "can"},
    "barrett": {"pty": "serial", "tcp": "serial"},
    "ekso": {"pty": "serial", "tcp": "serial"},
    "aidin": {"tcp": "tcp"},
    "hand": {"pty": "eb90", "tcp": "eb90", "modbus-pty": "rtu", "modbus-tcp": "tcp", "slcan-tcp": "can"},
}
"""Family -> how it is served -> the wire of the tables."""
ROWS = {
    "exo": ("status", "get", "set", "move", "watch"),
    "wrist": ("status", "get", "set", "center", "watch"),
    "barrett": ("status", "get", "set-all", "step-close", "watch"),
    "ekso": ("data", "get", "set", "cancel", "watch-data"),
    "aidin": ("status", "get", "max-torque", "joints", "watch"),
    "hand": ("status", "get", "set", "angle-wait", "watch"),
}
"""Two that read, one that writes, one that moves (or, where nothing may, stops a movement), one stream."""
MADE = {"barrett": ("initialized=1",), "ekso": ("sway=0", "startup=0.1"), "aidin": ("start=homed", "rate=40")}
BAUD = {"exo": "115200", "wrist": "115200", "barrett": "9600", "hand": "115200"}
"""A speed that is given is not searched for: silence stays one wait per try."""
LATE = 0.08
"""Seconds of the fault `late`, within the timeout."""
TIMEOUTS = {"aidin": 1.0}
TIMEOUT, DRIBBLE = 0.2, 1.0
"""--timeout; of answers each byte of which takes 3 ms."""
DEADLINES = {"aidin": 6.0, "barrett": 6.0, "hand": 6.0}
DEADLINE = 2.5
MARGIN = 0.7
"""Seconds beyond the deadline that a cell may take on a busy machine: what moves is stopped, what was written read."""
BUSY = {"not-still", "no-answer"}
"""How handctl refuses, rightly, when this machine keeps it or the simulator waiting: such a cell is tried again."""
TRIES = 3
UNSTEADY = ("hot", "stale")
"""Readings that fall while they are read; answers of another day."""
ALLOWED = {("wrist", "can", "twin-id"): {4}, ("ekso", "serial", "late"): {0}}
"""Beside those of the tables: an adapter reports that frames were destroyed; late by less than the timeout."""


class Place:
    """`handctl sim FAMILY` on one wire, until the block ends."""

    def __init__(self, family: str, served: str, folder: Path, *settings: str) -> None:
        self.family, self.served, self.panel = family, served, folder / "panel"
        where = [f"--{served}", *(["127.0.0.1:0"] if served.endswith("tcp") else [])]
        options = [word for text in (f"late={LATE}", *MADE.get(family, ()), *settings) for word in ("--set", text)]
        self.simulator = Simulator(*where, "--seed", "1", "--control", self.panel, *options, kind=family)

    def __enter__(self) -> Place:
        return self

    def __exit__(self, *exc: object) -> None:
        self.simulator.stop()

    @property
    def deadline(self) -> float:
        return DEADLINES.get(self.family, DEADLINE)

    def words(self, fault: str) -> tuple[str, ...]:
        """The connection of a command; "" = it must succeed, and a busy machine answers late."""
        timeout = DRIBBLE if fault == "dribble" else TIMEOUTS.get(self.family, TIMEOUT)
        limits = (timeout, self.deadline) if fault else (2, PATIENCE)
        baud = ("--baud", BAUD[self.family]) if self.served in ("pty", "tcp") and self.family in BAUD else ()
        return (
            "-p",
            self.simulator.link,
            "--timeout",
            str(limits[0]),
            "--deadline",
            str(limits[1]),
            "--retries",
            "1",
            *baud,
        )

    def tell(self, command: str) -> bool:
        """One control command; False where the process has gone with the line."""
        with suppress(ServeError, OSError):
            return send_control(str(self.panel), command).startswith("ok")
        return False


class ServedCell(Cell):
    """One command against one fault over a real link."""

    def __init__(self, place: Place, wire: str, row: Any, fault: str, folder: Path) -> None:
        self.family, self.wire, self.row, self.folder = place.family, wire, row, folder
        self.facts, self.table = facts_of(self.family), outcomes_of(self.family)
        own, trace = self.table.wires[wire], folder / "trace.txt"
        self.link = place.simulator.link
        args = getattr(row, "on_can", ()) if "bus=can" in own.options else ()
        typed = [word.replace("{dir}", str(folder)) for word in (args or row.args)]
        asked = ["--yes"] if getattr(row, "asks", False) else []
        began = time.monotonic()
        self.result = run(self.family, *typed, *own.words, *place.words(fault), *asked, "--json", "--trace", trace,
                          env={"XDG_STATE_HOME": str(folder / "state")})  # fmt: skip
        self.late = time.monotonic() - began - place.deadline - MARGIN
        self.spy, self.passed = Spy(), passed(trace)

    def judge(self, fault: str) -> None:
        """In time. One error, which names the link, the cause and the next step. No other value than in this process."""
        assert self.late < 0, (self.late, self)
        assert "Traceback" not in self.result.err and self.envelope["device"]["fake"] is False, self
        codes = {
            *self.table.codes(self.wire, fault, self.row, "always"),
            *ALLOWED.get((self.family, self.wire, fault), ()),
        }
        assert self.result.code in codes, (sorted(codes), self)
        assert len(self.errors) == (self.result.code != 0), self
        for error in self.errors:
            if self.result.code in (3, 4, 5):
                assert self.link in error["text"] and error["hint"], self
                causes = causes_of(fault, self.family, self.wire, self.command)
                assert not causes or error["code"] in causes, (error["code"], causes, self)
        if self.row.kind in ("read", "stream") and fault not in UNSTEADY and self.table.is_told(fault, self.row.name):
            truthful(self, fault)


def check(family: str, served: str, name: str, fault: str, folder: Path) -> ServedCell:
    """One cell, and the next command once the fault is over."""
    wire = SERVED[family][served]
    rows = {row.name: row for row in outcomes_of(family).rows}
    for tries in range(1, TRIES + 1):
        own = folder / str(tries)
        own.mkdir()
        prepare(family, own)
        with Place(family, served, own, f"fault={fault}") as place:
            cell = ServedCell(place, wire, rows[name], fault, own)
            try:
                cell.judge(fault)
            except AssertionError:
                met = {error["code"] for error in cell.errors}
                if tries == TRIES or not (BUSY & met or cell.late >= 0):
                    raise
                continue
            if fault != "hang" and place.tell("fault none"):  # that lasts until a power cycle
                after = run(
                    family, *rows["get"].args, *outcomes_of(family).wires[wire].words, *place.words(""), "--json"
                )
                lost = fault == "disconnect" and after.code in (3, 4)  # on a pty its process may be ending
                assert lost or (after.code == 0 and all("value" in row for row in after.rows)), (fault, name, after)
            return cell
    raise AssertionError("unreachable")


class Served(Listed):
    """Family, how it is served, command, fault."""

    name = "served"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for family, wires in SERVED.items():
            for served, wire in wires.items():
                own = outcomes_of(family).wires[wire]
                for name in ROWS[family]:
                    for fault in (*own.line, *own.device):
                        yield (family, served, name, fault), (family, served, name, fault)

    def tried(self, row: Any, folder: Path) -> str:
        return f"exit {check(*row, folder).result.code}"


SUITES = (Served(),)
