"""The wrist module of the dexterous hand: two axes, their set angles and one movement time (wrist §2.1).

Its registers are reached through flags 30/31 and CAN flags 4/5 only: at the same addresses of the hand's own space
lie current limits and power-on speeds. On its bench it moves without asking.
"""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.inspire.base import RegisterDevice
from handctl.devices.inspire.map import WRIST, register_of
from handctl.devices.inspire.registers import may_still_move
from handctl.errors import CheckFailed, UsageError
from handctl.model.guide import CTRL_C, Guide
from handctl.model.param import Element, Number, Reading
from handctl.model.result import Cell, Column, Grid, Row, Table

SLOWEST_USUAL, FASTEST_USUAL = 5000, 100
"""Milliseconds outside which a movement time is worth a warning; the manual gives no range."""
ARRIVED_DEGREES = 0.5
STILL_SECONDS, STILL_SAMPLES = 0.3, 3
ANGLES = tuple(Element(WRIST[name], 0) for name in ("pitch_actual", "yaw_actual"))
SHORT = 40
"""Characters of a remark that fit beside a value."""
WIRING_HINT = (
    "Check the hand's power, the wire (RS-232 against RS-485, A/B, TX/RX) and that this hand carries a wrist. "
    "A wrong id, a wrong speed (115200 bit/s by the manual), no power and no cable all end in silence. "
    "For CAN give -p can:INTERFACE:CHANNEL"
)


class Wrist(RegisterDevice):
    """One wrist module on a serial or CAN bus. See `model.device`."""

    kind = "wrist"
    product = "wrist module"
    map = WRIST
    live = (
        "pitch_actual",
        "yaw_actual",
        "current_1024",
        "current_1026",
        "error_1",
        "error_2",
        "temperature_1",
        "temperature_2",
    )
    not_covered = (
        "id, speed and everything else in the hand's own register space (undocumented for the wrist)",
        "whether set angles and time survive power-off (not documented)",
    )

    @staticmethod
    def view(rows: list[Row]) -> list[Grid]:
        """One line per register; what the manual leaves open about one stands below."""
        lines, notes = [], []
        for row in rows:
            value: str | Cell = Cell("?", "bad") if "error" in row else value_text(row)
            remark: str | Cell = row.get("label") or ""
            if "error" in row or len(str(remark)) > SHORT:
                notes.append(f"{row['name']}: {row.get('error') or remark}")
                remark = ""
            elif row["name"].startswith("error_") and row.get("value"):
                remark = Cell(str(remark), "bad")
            lines.append((row["name"] or "", str(row["address"]), value, row["unit"] or "", remark))
        return [
            Grid(
                ("Name", "Addr", "Value", "Unit", "Meaning"), tuple(lines), right=frozenset({1, 2}), notes=tuple(notes)
            )
        ]

    def runs(self, changes: Sequence[tuple[Element, Number]]) -> list[list[tuple[Element, Number]]]:
        """Angles and time that lie side by side go in one frame (1038..1043); otherwise the time goes first."""
        ordered = sorted(changes, key=lambda change: register_of(change[0]).address)
        groups: list[list[tuple[Element, Number]]] = []
        for change in ordered:
            register = register_of(change[0])
            if groups and register_of(groups[-1][-1][0]).span.stop == register.address:
                groups[-1].append(change)
            else:
                groups.append([change])
        return sorted(groups, key=lambda group: group[-1][0].param.name != "move_time")

    def write(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]:
        """As every register device; an unusual movement time is remarked."""
        for element, value in changes:
            if element.param.name == "move_time" and not FASTEST_USUAL <= value <= SLOWEST_USUAL:
                self.journal.warn("move-time", f"the movement time {value} ms is outside the usual 100 to 5000 ms")
        return super().write(changes)

    def status(self, check: bool) -> Table:
        """Angles against set angles, currents, temperatures, errors in words. With `check`, errors are exit 7."""
        table = self.dump()
        table.extra = {}
        table.view = status_view
        findings = [
            f"{row['name']}: {row['label']}"
            for row in table.rows
            if row["name"].startswith("error_") and row.get("value")
        ]
        findings += [
            f"{row['name']} = {value_text(row)} is outside {WRIST[row['name']].range_text} ({WRIST[row['name']].source})"
            for row in table.rows
            # The range of move_time is this tool's own: what the wrist holds may be right.
            if "value" in row
            and row["name"] != "move_time"
            and not WRIST[row["name"]].bits
            and not WRIST[row["name"]].allowed(row["value"])
        ]
        hint = (
            "let it cool, free the axis, then power-cycle it: the manual has no command that clears errors of the wrist"
        )
        return self.judge(table, findings, check, hint=hint)

    def targets(self, pitch: float | None, yaw: float | None, time: int | None) -> list[tuple[Element, Number]]:
        """Checked changes for a movement. Raises UsageError out of range (wrist §1) or when no axis is named."""
        if pitch is None and yaw is None:
            raise UsageError("no axis given", hint="give --pitch DEG, --yaw DEG or both")
        wanted: list[tuple[Element, Number]] = []
        for name, value in (("yaw_set", yaw), ("pitch_set", pitch), ("move_time", time)):
            if value is not None:
                WRIST[name].check(value, name)
                wanted.append((Element(WRIST[name], 0), value))
        return wanted

    def move(self, changes: Sequence[tuple[Element, Number]], guide: Guide, *, wait: float | None) -> Table:
        """Write a movement and watch until both axes stand still; tells targets and what was reached.

        `wait` bounds the watching, default the movement time half as long again and 2 s. Ctrl-C stops it. Raises CheckFailed beyond 0.5 degree off the target.
        """
        self.bus.identify()
        targets = {element.param.name: float(value) for element, value in changes if element.param.moves}
        time = next((int(value) for element, value in changes if element.param.name == "move_time"), None)
        if time is None:
            time = int(self.read([Element(WRIST["move_time"], 0)])[0].value or 0)
        wait = wait if wait is not None else time * 1.5 / 1000 + 2
        with self.driven(guide), may_still_move("the wrist"):
            self.write(changes)
            readings = self._watch(targets, guide, wait, time / 1000)
        return self._arrival(readings, targets)

    def _watch(self, targets: dict[str, float], guide: Guide, wait: float, expected: float) -> list[Reading]:
        bus = self.bus
        started, end = bus.link.now(), bus.link.deadline(wait)
        last: list[Number | None] = []
        still_since, equal = started, 0
        while True:
            readings = self.read(ANGLES)
            here = [reading.value for reading in readings]
            now = bus.link.now()
            if here != last:
                still_since, equal = now, 0
            last, equal = here, equal + 1
            guide.progress(f"{now - started:4.1f} s  pitch {_degrees(here[0])}, yaw {_degrees(here[1])}", CTRL_C)
            at = dict(zip(("pitch_set", "yaw_set"), here, strict=True))
            there = all(at[name] == target for name, target in targets.items())
            stands = equal >= STILL_SAMPLES and now - still_since >= STILL_SECONDS and now - started >= expected
            if there or stands or end.expired:
                guide.done()
                return readings
            bus.pause(0.03)
            bus.out_of_time("the arrival. The wrist may still move")

    def _arrival(self, readings: Sequence[Reading], targets: dict[str, float]) -> Table:
        rows = []
        off = []
        for reading in readings:
            axis = reading.element.param.name.partition("_")[0]
            target = targets.get(f"{axis}_set")
            rows.append({**self.row(reading), "target": target})
            if target is not None and reading.value is not None and abs(reading.value - target) > ARRIVED_DEGREES:
                off.append(f"{axis} is at {reading.value:.2f}°, {reading.value - target:+.2f}° off its target")
        table = Table(
            rows=rows,
            columns=(*self.columns[:4], Column("target", "Target", right=True), *self.columns[4:]),
            view=arrival_view,
        )
        if off:
            table.failure = CheckFailed(
                f"{self.bus.where}: not arrived: {'; '.join(off)}",
                hint="check with `handctl wrist status`: something holds the axis, or the time was too short",
                code="not-arrived",
            )
        else:
            self.journal.info("arrived", "the wrist has arrived")
        return table


def _degrees(value: Number | None) -> str:
    return "?" if value is None else f"{value:.2f}°"


def value_text(row: Row) -> str:
    """A value with the decimals of its register."""
    return WRIST[row["name"]].text(row["value"])


def arrival_view(rows: list[Row]) -> list[Grid]:
    """Where each axis stands beside its target."""
    lines = []
    for row in rows:
        reached: str | Cell = Cell("?", "bad") if "error" in row else value_text(row)
        target = "" if row["target"] is None else f"{row['target']:.2f}"
        lines.append((row["name"].partition("_")[0], reached, target))
    return [Grid(("Axis", "Angle [°]", "Target [°]"), tuple(lines), right=frozenset({1, 2}))]


def status_view(rows: list[Row]) -> list[Grid]:
    """Axes with their set angles, then actuators with what the manual leaves open about them."""
    at = {row["name"]: row for row in rows}

    def text(name: str) -> str | Cell:
        return Cell("?", "bad") if "error" in at[name] else value_text(at[name])

    def errors(name: str) -> str | Cell:
        row = at[name]
        return Cell("?", "bad") if "error" in row else Cell(row["label"] or "ok", "bad" if row["value"] else "good")

    axes = (("pitch", text("pitch_actual"), text("pitch_set")), ("yaw", text("yaw_actual"), text("yaw_set")))
    actuators = tuple((f"#{n}", text(f"temperature_{n}"), errors(f"error_{n}")) for n in (1, 2))
    currents = (
        ("current_1024", text("current_1024"), WRIST["current_1024"].note),
        ("current_1026", text("current_1026"), WRIST["current_1026"].note),
    )
    time = text("move_time")
    return [
        Grid(
            ("Axis", "Angle [°]", "Set [°]"),
            axes,
            right=frozenset({1, 2}),
            notes=(f"movement time {getattr(time, 'text', time)} ms",),
        ),
        Grid(("Actuator", "°C", "Errors"), actuators, right=frozenset({1})),
        Grid(("Current", "mA", "Which actuator"), currents, right=frozenset({1})),
    ]
