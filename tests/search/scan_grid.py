"""`handctl scan` and `FAMILY scan` over lines as they are met: every family, whatever the delay, the line and the id.

The right device, at the right speed and id, or a finding; a silent line is asked for 6 s for each family at the most.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from handctl.families import FAMILIES
from handctl.tools.family_probe import family_of, probe_of
from tests.search.suite import Listed
from tests.support.bus_file import text
from tests.support.cli import run

LATENCIES = (0, 50, 150, 500)
IDS = (1, 2, 77, 254)
SECONDS = 6.0
"""For each family, on a silent line."""
ALONE = {"hand": ((115200, "eb90"), (921600, "eb90"), (115200, "modbus"))}
"""What a family may speak, each with a speed, where it is not EB90 at 115200 bit/s alone."""


class Cell(NamedTuple):
    """One device on one line, and who looks: "" is the scan of all families."""

    looks: str
    family: str
    kind: str
    latency: int
    id: int | None
    speed: int | None
    speaks: str = ""

    def link(self, folder: Path) -> str:
        """The LINK of this line."""
        if self.kind in ("tcp", "can", "plain"):
            late = f"&fault=late&late={self.latency / 1000}" if self.latency else ""
            more = {"tcp": "exchange=poll", "can": f"bus=can&id={self.id}"}.get(
                self.kind, f"id={self.id}&baud={self.speed}"
            )
            return f"fake://{self.family}?{more}{late}&clock=virtual"
        device: dict[str, Any] = {"kind": self.family}
        device |= {"id": self.id} if self.id is not None else {}
        device |= {"speaks": self.speaks} if self.speaks else {}
        device |= {"model": "df"} if self.family == "hand" else {}
        path = folder / "bus.toml"
        path.write_text(text(self.kind, [device], [], baud=self.speed or 115200, latency_ms=self.latency))
        return f"fake://bus?file={path}&clock=virtual"

    @property
    def wanted(self) -> tuple[str, int | None, int | None]:
        """Family, speed and id of its row."""
        ignored = self.kind in ("bluetooth", "tcp", "can") and (self.id is not None or self.kind != "bluetooth")
        return self.family, None if ignored else self.speed, self.id

    def found(self, folder: Path) -> float:
        """Seconds until it was found, on its own clock. Raises AssertionError where it was not, or was another one."""
        words = [self.looks, "scan"] if self.looks else ["scan"]
        if self.speaks == "modbus" and self.kind == "bluetooth" and self.id != 1:
            words.append("--all")  # a delay that varies pushes questions in Modbus RTU together
        if not self.looks and self.kind == "tcp":
            words += ["--family", self.family]
        trace = folder / "trace.txt"
        answer = run(*words, "-p", self.link(folder), "--json", "--trace", str(trace))
        rows = [(row["family"], row["baud"], row["id"]) for row in answer.rows]
        assert (answer.code, rows) == (0, [self.wanted]), answer
        return lasted(trace)


class Silent(NamedTuple):
    """A line on which nobody is, and who looks."""

    looks: str

    def told(self, folder: Path) -> float:
        """Seconds that it took. Raises AssertionError where that is too long, or what was left out is not told."""
        wire = probe_of(self.looks).WIRES[0]
        silent = {"tcp": "exchange=mute"}.get(wire, "found=off" if self.looks == "barrett" else "fault=silent")
        trace = folder / "trace.txt"
        link = f"fake://{self.looks}?{silent}&clock=virtual" + ("&wire=auto" if wire == "serial" else "")
        answer = run(self.looks, "scan", "-p", link, "--json", "--trace", str(trace))
        assert answer.code == 4, answer
        seconds = max(lasted(trace), answer.json["scan"].get("seconds", 0.0))
        assert seconds <= SECONDS, answer
        if family_of(self.looks).ids:
            assert answer.json["scan"]["left"] and "not-asked" in answer.codes(), answer
        return seconds


def lasted(trace: Path) -> float:
    """When the last byte of a transcript went or came."""
    return float(re.findall(r"^(\d+\.\d+) ", trace.read_text(encoding="utf-8"), re.MULTILINE)[-1])


def cells() -> Iterator[Cell]:
    """All of them."""
    for family, latency in product(FAMILIES, LATENCIES):
        probe, ids = probe_of(family), IDS if family_of(family).ids else (None,)
        lines = ("clean", "half-duplex", "bluetooth") if family_of(family).ids else ("clean", "bluetooth")
        for looks in ("", family):
            if "serial" in probe.WIRES:
                for kind, number, (speed, speaks) in product(lines, ids, ALONE.get(family, ((probe.SPEEDS[0], ""),))):
                    if speed == 921600:  # asked by `FAMILY scan` alone: a boot monitor could take it for a trigger
                        if looks and kind == "clean" and latency < 500:  # no line, but a device that answers so late
                            yield Cell(looks, family, "plain", latency, number, speed, speaks)
                    elif kind != "bluetooth" or latency:
                        yield Cell(looks, family, kind, latency, number, speed, speaks)
            elif "tcp" in probe.WIRES:
                yield Cell(looks, family, "tcp", latency, None, None)
            if "can" in probe.WIRES:
                for number in ids:
                    yield Cell(looks, family, "can", latency, number, None)


class Grid(Listed):
    """A device on a line, or a silent line."""

    name = "scan-grid"

    def rows(self) -> Iterator[tuple[tuple[object, ...], Any]]:
        for cell in cells():
            yield (cell.looks or "all", *cell[1:]), cell
        for family in FAMILIES:
            yield ("silent", family), Silent(family)

    def tried(self, row: Any, folder: Path) -> str:
        seconds = row.told(folder) if isinstance(row, Silent) else row.found(folder)
        return f"{seconds:.1f} s"


SUITES = (Grid(),)
