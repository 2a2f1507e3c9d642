"""`handctl barrett realtime --measure`: round trips, rate and the line's limits, as rows and as tables."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from handctl.model.guide import CTRL_C
from handctl.model.result import Column, Grid, Row, Table

if TYPE_CHECKING:
    from handctl.devices.barrett.realtime.loop import RealtimeLoop
    from handctl.frame.run import Run


def measured(run: Run, loop: RealtimeLoop, blocks: int, rate: float) -> Table:
    """Round trips, rate and the line's limits: what the vendor's "test delays" run is for."""
    for number, _ in enumerate(loop.run(rate=rate, count=blocks, duration=None), 1):
        if number % 20 == 0:
            run.guide.progress(f"{number} of {blocks} blocks.", CTRL_C)
    run.guide.done()
    found = loop.summary()
    latency = found["loop"]["latency"]
    rows: list[Row] = [
        {"name": "rate", "value": found["stream"]["rate_hz"], "unit": "Hz"},
        *({"name": f"limit_{name}", "value": hertz, "unit": "Hz"} for name, hertz in (found["loop"]["line_limit_hz"] or {}).items()),
        {"name": "control_block", "value": found["loop"]["control_bytes"], "unit": "bytes"},
        {"name": "feedback_block", "value": found["loop"]["feedback_bytes"], "unit": "bytes"},
        *({"name": key.removesuffix("_ms"), "value": value, "unit": "ms"} for key, value in latency.items() if key.endswith("_ms")),
        {"name": "late", "value": latency["late"], "unit": None},
        *_fits(loop),
    ]  # fmt: skip
    if not rate:
        _advise(run, found)
    table = Table(
        rows=rows,
        columns=(Column("name", "Name"), Column("value", "Value", right=True), Column("unit", "Unit")),
        extra=found,
        failure=loop.failure,
    )
    table.view = lambda rows: [_rows_grid(rows), _histogram_grid(latency["histogram"])]
    return table


def _fits(loop: RealtimeLoop) -> Iterable[Row]:
    from handctl.devices.barrett.gcl.language import MOTORS
    from handctl.devices.barrett.realtime.blocks import velocity_unit

    for index, points in loop.velocity_points.items():
        unit = velocity_unit(points)
        if unit is not None:
            yield {"name": f"velocity_unit.{MOTORS[index]}", "value": round(unit, 2), "unit": "cts/s"}


def _advise(run: Run, found: dict[str, Any]) -> None:
    """A link that is much slower than its bytes: pipelined blocks queue, so the rate tells, not the round trip."""
    limits, rate = found["loop"]["line_limit_hz"], found["stream"]["rate_hz"]
    if limits is None or not rate:
        return
    cycle_ms, wire_ms = 1000 / rate, 1000 / limits["sequential"]
    if cycle_ms > wire_ms + 8:
        run.journal.warn(
            "slow-adapter",
            f"a block takes {cycle_ms:.1f} ms, its bytes {wire_ms:.1f} ms: the adapter delays them",
            hint="set the latency timer of an FTDI adapter from 16 ms to 1 ms "
            "(/sys/bus/usb-serial/devices/ttyUSB0/latency_timer)",
        )


def _rows_grid(rows: list[Row]) -> Grid:
    lines = tuple(
        (str(row["name"]), "?" if row["value"] is None else f"{row['value']:g}", str(row["unit"] or "")) for row in rows
    )
    return Grid(("Name", "Value", "Unit"), lines, right=frozenset({1}))


def _histogram_grid(histogram: list[list[Any]]) -> Grid:
    most = max(count for _, count in histogram)
    lines = tuple(
        (
            f"<= {edge:g} ms" if edge is not None else "above",
            str(count),
            "█" * max(1, round(20 * count / most)) if count else "",
        )
        for edge, count in histogram
    )
    return Grid(("Round trip", "Blocks", ""), lines, right=frozenset({0, 1}))
