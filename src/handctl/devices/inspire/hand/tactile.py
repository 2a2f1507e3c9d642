"""The skin of an RH56DFTP: 17 zones, 1062 values of 0 to 4095, at 3000 to 5123 (rh56 §3.4). Read-only.

A zone is sent row by row; the palm column by column, from the bottom. Mirroring for the other side differs by batch, so
every zone is shown as it is sent.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from handctl.devices.inspire.hand.register_map import DF, MODELS, TP
from handctl.errors import DeviceRefused, HandctlError, UsageError
from handctl.model.result import Cell, Column, Grid, Row, Table, hex_bytes
from handctl.model.sampling import Sampler

if TYPE_CHECKING:
    from handctl.devices.inspire.hand.device import Hand

INVALID = 65280
"""Values from here on were seen from saturated or broken cells."""
CAN_END = 4096
"""A CAN identifier has 12 bits of address: what lies behind cannot be asked for (rh56 §2.4)."""
MOST = 250
"""Bytes of one read that every wire carries: 125 registers, and less than 252 bytes."""
WORDS = (3000, 68)
"""Where an RH56F1 or RH5DG2 has its 34 touch words, and their bytes (rh56 §3.2)."""
SHADES = ".:-=+*#%@"
"""0, then larger and larger values."""
FINGERS = ("little", "ring", "middle", "index", "thumb")
PARTS = ("tip", "nail", "middle", "pad")


class Zone(NamedTuple):
    """One sensor: where its values begin, rows, columns; `upward`: by columns, from the bottom."""

    name: str
    address: int
    rows: int
    columns: int
    upward: bool = False

    @property
    def size(self) -> int:
        """Bytes."""
        return 2 * self.rows * self.columns

    def place(self, index: int) -> tuple[int, int]:
        """Row and column of value `index`, from 1."""
        if self.upward:
            column, up = divmod(index, self.rows)
            return self.rows - up, column + 1
        row, column = divmod(index, self.columns)
        return row + 1, column + 1


ZONES = (
    *(
        zone
        for finger, start in (("little", 3000), ("ring", 3370), ("middle", 3740), ("index", 4110))
        for zone in (
            Zone(f"{finger}_tip", start, 3, 3),
            Zone(f"{finger}_nail", start + 18, 12, 8),
            Zone(f"{finger}_pad", start + 210, 10, 8),
        )
    ),
    Zone("thumb_tip", 4480, 3, 3),
    Zone("thumb_nail", 4498, 12, 8),
    Zone("thumb_middle", 4690, 3, 3),
    Zone("thumb_pad", 4708, 12, 8),
    Zone("palm", 4900, 8, 14, upward=True),
)
"""In the order of their addresses."""
COLUMNS = (
    Column("zone", "Zone"),
    Column("row", "Row", right=True),
    Column("column", "Column", right=True),
    Column("value", "Value", right=True),
)


def chosen(names: Sequence[str]) -> list[Zone]:
    """Zones by name, or all of a finger by its name, in the order of their addresses. Raises UsageError."""
    wanted = set()
    for name in names:
        found = [zone for zone in ZONES if zone.name == name or zone.name.startswith(f"{name}_")]
        if not found:
            raise UsageError(
                f"there is no zone {name!r}",
                hint=f"zones: {', '.join(zone.name for zone in ZONES)}",
                code="unknown-name",
            )
        wanted.update(found)
    return [zone for zone in ZONES if zone in wanted or not names]


def named(name: str) -> list[str]:
    """The values of a zone, a finger or the palm, as `handctl hand tactile` names them. Raises UsageError."""
    cells = [(zone, zone.place(index)) for zone in chosen([name]) for index in range(zone.size // 2)]
    return [f"tactile.{zone.name}.r{row}c{column}" for zone, (row, column) in cells]


def tactile(hand: Hand, zones: Sequence[Zone], *, wide: bool = True) -> Table:
    """All values of `zones`; `wide`: a person's window has room for the fingers side by side. Raises DeviceRefused for a hand without them."""
    zones = _ready(hand, zones)
    rows = _read(hand, zones)
    table = Table(rows=rows, columns=COLUMNS, view=picture if wide else narrow_picture)
    silent = [zone.name for zone in zones if not any(row["value"] for row in rows if row["zone"] == zone.name)]
    if silent:
        hand.journal.info(
            "no-contact", f"all values are 0: {', '.join(silent)}", hint="press each zone: a dead zone stays at 0"
        )
    return table


def reader(hand: Hand, names: Sequence[str]) -> Callable[[], list[Row]]:
    """What reads the values of these zones, for a log. Raises UsageError, DeviceRefused."""
    zones = _ready(hand, chosen(names))
    return lambda: _read(hand, zones)


def watch(hand: Hand, zones: Sequence[Zone], *, rate: float, count: int | None, duration: float | None) -> Table:
    """The same as a stream."""
    zones = _ready(hand, zones)

    def read() -> tuple[list[Row], HandctlError | None]:
        return _read(hand, zones), None

    sampler = Sampler(hand.link, read, rate=rate, count=count, duration=duration)
    pictures = (picture, most)
    return Table(columns=COLUMNS, samples=sampler.samples(), summary=sampler.summary, pictures=pictures)


def _ready(hand: Hand, zones: Sequence[Zone]) -> list[Zone]:
    """The zones that this hand has on this wire."""
    hand.know()
    model = hand.typed or hand.found().model
    if model not in (TP, None):
        words = (
            "" if model == DF else f". `handctl hand read {WORDS[0]} {WORDS[1]}` shows the touch registers of this hand"
        )
        raise DeviceRefused(
            f"{hand.bus.where}: {MODELS[model]} has no tactile zones",
            hint=f"only an RH56DFTP has them{words}",
            code="not-on-model",
        )
    if hand.bus.wire != "can":
        return list(zones)
    there = [zone for zone in zones if zone.address + zone.size <= CAN_END]
    if there != list(zones):
        left = ", ".join(zone.name for zone in zones if zone not in there)
        hand.journal.warn("beyond-can", f"cannot be read over CAN, whose addresses end at 4095: {left}")
    if not there:
        raise UsageError("none of these zones can be read over CAN", hint="use Modbus TCP or the RS-485 pair")
    return there


def _read(hand: Hand, zones: Sequence[Zone]) -> list[Row]:
    memory: dict[int, int] = {}
    for start, size in _blocks(zones):
        data = hand.bus.read(start, size)
        memory.update((start + 2 * k, int.from_bytes(data[2 * k : 2 * k + 2], "little")) for k in range(size // 2))
    return [_row(zone, index, memory[zone.address + 2 * index]) for zone in zones for index in range(zone.size // 2)]


def _blocks(zones: Sequence[Zone]) -> list[tuple[int, int]]:
    """The fewest reads that cover neighbouring zones, nothing between others."""
    spans: list[list[int]] = []
    for zone in zones:
        if spans and spans[-1][1] == zone.address:
            spans[-1][1] += zone.size
        else:
            spans.append([zone.address, zone.address + zone.size])
    return [(at, min(MOST, stop - at)) for start, stop in spans for at in range(start, stop, MOST)]


def _row(zone: Zone, index: int, value: int) -> Row:
    row, column = zone.place(index)
    return {
        "name": f"tactile.{zone.name}",
        "zone": zone.name,
        "element": f"r{row}c{column}",
        "row": row,
        "column": column,
        "address": zone.address + 2 * index,
        "value": value if value < INVALID else None,
        "unit": None,
        "raw": hex_bytes(value.to_bytes(2, "little")),
        "label": None if value < INVALID else "invalid",
    }


def picture(rows: list[Row]) -> list[Grid]:
    """The hand from its fingertips down to the palm, the fingers side by side, each zone as it is sent."""
    drawn = {zone.name: _drawn(zone, rows) for zone in _in(rows)}
    there = [finger for finger in FINGERS if any(name.startswith(f"{finger}_") for name in drawn)]
    grids = []
    for part in PARTS:
        of = {finger: drawn[f"{finger}_{part}"] for finger in there if f"{finger}_{part}" in drawn}
        if not of:
            continue
        height = max(len(lines) for lines in of.values())
        lines = tuple(tuple(_line(of.get(finger, []), row) for finger in there) for row in range(height))
        grids.append(Grid(tuple(f"{finger:<8}" for finger in there), lines, title=part))
    if "palm" in drawn:
        grids.append(Grid(("palm",), tuple((cell,) for cell in drawn["palm"])))
    return [*grids[:-1], grids[-1]._replace(notes=LEGEND)]


def narrow_picture(rows: list[Row]) -> list[Grid]:
    """The same for a narrow window: one zone below the other."""
    grids = [Grid((zone.name,), tuple((cell,) for cell in _drawn(zone, rows))) for zone in _in(rows)]
    return [*grids[:-1], grids[-1]._replace(notes=LEGEND)]


def most(rows: list[Row]) -> list[Grid]:
    """One line a zone: its largest value, and how many of its cells feel anything."""
    lines = []
    for zone in _in(rows):
        values = [row["value"] for row in rows if row["zone"] == zone.name]
        numbers = [value for value in values if value is not None]
        high, touched = max(numbers, default=0), sum(value > 0 for value in numbers)
        bar = "#" * -(-high * BAR // 4096)
        invalid = f"{len(values) - len(numbers)} invalid" if len(numbers) < len(values) else ""
        lines.append(
            (zone.name, str(high), f"{touched} of {len(values)}", Cell(bar or "-", "good" if high else "dim"), invalid)
        )
    return [Grid(("Zone", "Most", "Touched", "", ""), tuple(lines), right=frozenset({1, 2}))]


BAR = 20
LEGEND = (
    "Each character is one value: . is 0, then : - = + * # % @ up to 4095, ? is invalid.",
    "Zones are shown in the order in which the hand sends them: their orientation differs by batch.",
)


def _in(rows: list[Row]) -> list[Zone]:
    names = {row["zone"] for row in rows}
    return [zone for zone in ZONES if zone.name in names]


def _drawn(zone: Zone, rows: list[Row]) -> list[Cell]:
    """The rows of a zone."""
    own = {(row["row"], row["column"]): row["value"] for row in rows if row["zone"] == zone.name}
    style = "good" if any(own.values()) else "dim"
    return [
        Cell("".join(_shade(own.get((row, column))) for column in range(1, zone.columns + 1)), style)
        for row in range(1, zone.rows + 1)
    ]


def _line(lines: list[Cell], row: int) -> str | Cell:
    return lines[row] if row < len(lines) else ""


def _shade(value: int | None) -> str:
    """One character for one value; a cell that is invalid is marked."""
    if value is None:
        return "?"
    return SHADES[min(len(SHADES) - 1, -(-value * (len(SHADES) - 1) // 4095))]
