"""The wrist module of the dexterous hand: two axes, their set angles and one movement time (wrist §2.1).

Its registers are reached through flags 30/31 and CAN flags 4/5 only: at the same addresses of the hand's own space
lie current limits and power-on speeds. On its bench it moves without asking.
"""

from __future__ import annotations

from collections.abc import Sequence

from handctl.devices.inspire.register_device import BEGINS, Movement, RegisterDevice, grouped
from handctl.devices.inspire.register_map import DRAWN, outside, register_of
from handctl.devices.inspire.wrist.register_map import NEAR, NOISE, WRIST
from handctl.errors import CheckFailed, UsageError
from handctl.link import CanFrame
from handctl.model.device import PendingMove
from handctl.model.movement import REACHED, AxisReading, Goal, Stillness
from handctl.model.param import Element, Number, Reading, Step
from handctl.model.prompts import Prompts
from handctl.model.result import Cell, Finding, Grid, Row, Table

SLOWEST_USUAL, FASTEST_USUAL = 5000, 100
"""Milliseconds outside which a movement time is worth a warning; the manual gives no range."""
STILL = Stillness(samples=3, seconds=0.3, refresh=0.03, short=BEGINS, pushing=DRAWN)
ANGLES = tuple(Element(WRIST[name], 0) for name in ("pitch_actual", "yaw_actual"))
ERRORS = tuple(Element(WRIST[name], 0) for name in ("error_1", "error_2"))
CURRENTS = tuple(Element(WRIST[name], 0) for name in ("current_1024", "current_1026"))
SHORT = 40
"""Characters of a remark that fit beside a value."""


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
    vital = live[4:]
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
        groups = grouped(ordered, lambda last, one: register_of(last).span.stop == register_of(one).address)
        return sorted(groups, key=lambda group: group[-1][0].param.name != "move_time")

    def plan_typed(self, data: bytes, can_id: int | None) -> tuple[Step, str]:
        from handctl.devices.inspire import raw as by_number
        from handctl.devices.inspire.wrist import raw

        step = raw.plan_raw(data, False) if can_id is None else raw.plan_can(CanFrame(can_id, data), False)
        return by_number.asked(step, by_number.DEVICE_ITSELF)

    def write(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]:
        """As every register device; an unusual movement time is remarked."""
        for element, value in changes:
            if element.param.name == "move_time" and not FASTEST_USUAL <= value <= SLOWEST_USUAL:
                self.journal.warn("move-time", f"the movement time {value} ms is outside the usual 100 to 5000 ms")
        return super().write(changes)

    def lets_go(self, changes: Sequence[tuple[Element, Number]]) -> list[PendingMove]:
        """The axis that is not named, where it stands off its set angle: both share one block and one time (wrist §2.1).

        So it stands after power-on, or when it was turned by hand: whether it goes to its set angle with the other is not documented.
        """
        named = {element.param.name for element, _ in changes} & {"yaw_set", "pitch_set", "move_time"}
        others = [axis_of(actual.param.name) for actual in ANGLES if f"{axis_of(actual.param.name)}_set" not in named]
        if not named or not others:
            return []
        self.identify()
        elements = [Element(WRIST[f"{axis}_{what}"], 0) for axis in others for what in ("actual", "set")]
        values = [reading.value for reading in self.read(elements)]
        places = zip(others, values[::2], values[1::2], strict=True)
        return [
            PendingMove(axis, f"{axis}_set", here, there)
            for axis, here, there in places
            if here is not None and there is not None and abs(here - there) > NEAR / 100
        ]

    def status(self, check: bool) -> Table:
        """Angles against set angles, currents, temperatures, errors in words. With `check`, errors are exit 7."""
        table = self.dump()
        table.extra = {}
        table.view = status_view
        findings = [
            Finding(f"{row['name']}: {row['label']}", tuple(row["errors"]))
            for row in table.rows
            if row["name"].startswith("error_") and row.get("value")
        ]
        findings += [
            Finding(outside(row["name"], WRIST[row["name"]], row["value"]), ("range",))
            for row in table.rows
            # The range of move_time is this tool's own: what the wrist holds may be right.
            if "value" in row
            and row["name"] != "move_time"
            and not WRIST[row["name"]].bits
            and not WRIST[row["name"]].allowed(row["value"])
        ]
        return self.with_findings(table, findings, check)

    def targets(self, pitch: float | None, yaw: float | None, time: int | None) -> list[tuple[Element, Number]]:
        """Checked changes for a movement. Raises UsageError out of range (wrist §1) or when no axis is named."""
        if pitch is None and yaw is None:
            raise UsageError("no axis given", hint="use --pitch DEG, --yaw DEG or both")
        wanted: list[tuple[Element, Number]] = []
        for name, value in (("yaw_set", yaw), ("pitch_set", pitch), ("move_time", time)):
            if value is not None:
                WRIST[name].check(value, name)
                wanted.append((Element(WRIST[name], 0), value))
        return wanted

    def move(
        self, changes: Sequence[tuple[Element, Number]], prompts: Prompts, *, wait: float | None, expect: str = REACHED
    ) -> Table:
        """Write a movement and watch until the axes have stopped; rows with targets and positions.

        `wait` bounds the watching, default the movement time half as long again and 2 s. Ctrl-C stops it. What was not as
        expected is the table's failure.
        """
        targets = {
            axis_of(element.param.name): value
            for element, value in sorted(changes, key=lambda change: change[0].param.name)  # pitch first, as shown
            if element.param.moves
        }
        time = next((int(value) for element, value in changes if element.param.name == "move_time"), None)
        if time is None:
            self.identify()
            time = int(self.read([Element(WRIST["move_time"], 0)])[0].value or 0)
            if not WRIST["move_time"].allowed(time):
                raise CheckFailed(
                    f"{self.bus.where}: the movement time set in the wrist is {time} ms, so nobody knows how fast it would move",
                    hint="add --time MS, such as --time 1000. Nothing was written.",
                    code="no-time",
                )
        this = Movement(
            [
                Goal(axis, target, NEAR / 100, jitter=NOISE / 100, decimals=2, unit="°")
                for axis, target in targets.items()
            ],
            STILL._replace(least=time / 1000),
            ANGLES,
            lambda readings: {axis_of(reading.element.param.name): AxisReading(reading.value) for reading in readings},
            ERRORS,
            CURRENTS,
            [Element(WRIST[f"{axis}_set"], 0) for axis in targets],
            "The wrist",
            # which actuator turns which axis is not documented: what one shows counts for both
            goals_of=lambda one: [*targets] if one in (*ERRORS, *CURRENTS) else [axis_of(one.param.name)],
            fault=lambda one, bits: f"actuator #{one.param.name[-1]}: {one.param.label(bits)}",
        )
        wait = wait if wait is not None else time * 1.5 / 1000 + 2
        table, arrivals = self.moved(this, lambda: self.write(changes), prompts, wait=wait, expect=expect)
        table.view = arrival_view
        if table.failure is None and all(one.verdict == REACHED for one in arrivals):
            self.journal.info("arrived", "the wrist has arrived")
        return table


def axis_of(name: str) -> str:
    """``pitch_actual`` -> ``pitch``."""
    return name.partition("_")[0]


def value_text(row: Row) -> str:
    """A value with the decimals of its register."""
    return WRIST[row["name"]].text(row["value"])


def arrival_view(rows: list[Row]) -> list[Grid]:
    """The position of each axis next to its target."""
    lines = []
    for row in rows:
        reached: str | Cell = Cell("?", "bad") if "error" in row else value_text(row)
        target = "" if row["target"] is None else f"{row['target']:.2f}"
        lines.append((axis_of(row["name"]), reached, target, row["arrival"] or ""))
    return [Grid(("Axis", "Angle [°]", "Target [°]", "Arrival"), tuple(lines), right=frozenset({1, 2}))]


def status_view(rows: list[Row]) -> list[Grid]:
    """Axes with their set angles, then actuators with what the manual leaves open about them."""
    at = {row["name"]: row for row in rows}

    def text(name: str) -> str | Cell:
        row = at.get(name, {"error": ""})
        return Cell("?", "bad") if "error" in row else value_text(row)

    def errors(name: str) -> str | Cell:
        row = at.get(name, {"error": ""})
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
