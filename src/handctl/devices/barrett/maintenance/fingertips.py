"""Fingertip positions by forward kinematics, from the joint positions of a hand or given ones (barrett §9.5, §9.6).

Reading moves nothing. Angles in degrees, lengths in mm, in the frame of the palm's centre. The manual's closed form (Eq. 3)
has three misprints; what stands here is the product of the four matrices of Table 9:

    phi = r T1 - 90 j    a = T2 + P2    b = T3 + P3          r = -1 1 0, j = 1 1 -1 for F1 F2 F3
    rho = A1 + A2 cos a + A3 cos(a+b) - D3 sin(a+b)
    x = r AW + rho cos phi    y = rho sin phi    z = DW + A2 sin a + A3 sin(a+b) + D3 cos(a+b)

One encoder count is one degree of the motor (§9.5, note).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from math import cos, radians, sin
from typing import Any, NamedTuple

from handctl.devices.barrett.device import BarrettHand
from handctl.devices.barrett.gcl.codec import MOTORS
from handctl.devices.barrett.parameter_map import FINGERS, implausible
from handctl.devices.barrett.realtime.joint_angles import AFTER, BEFORE, Joints, joints
from handctl.devices.barrett.status_and_parameter_views import (
    DOUBT,
    MOTOR,
    NAME,
    NOT_HOMED,
    UNIT,
    VALUE,
    live,
    row_of,
    why_impossible,
)
from handctl.errors import Hint, ProtocolError, UsageError
from handctl.model.result import Cell, Column, Grid, Row, Table

HIGHEST = 20000
"""Largest position that a GCL command takes (§5.2.1)."""
AW, A1, A2, A3, DW, D3 = 25.0, 50.0, 70.0, 50.0, 84.0, 9.5
"""Link lengths and offsets in mm (Table 8)."""
PHI2, PHI3 = 2.46, 50.0
"""Angles of the links in the zero position in degrees (Table 8)."""
SIDES: dict[str, tuple[int, int]] = {"F1": (-1, 1), "F2": (1, 1), "F3": (0, -1)}
"""Finger -> (r, j) of Table 9."""
LIMITS = (180.0, 140.0, 48.0)
"""Largest angles of the spread, the inner and the outer link without an object (§9.6)."""
TOLERANCE = 0.4
"""Degrees beyond an end that are still at it: 50 counts of a finger, the factory's MPE (§5.3.4)."""
ASSUMED = "assumed before breakaway"
COLUMNS = (NAME, MOTOR, VALUE, UNIT, Column("limit", "Limit", right=True), Column("state", "Breakaway"), DOUBT)
JOINTS = ("joint_spread", "joint_inner", "joint_outer")
RANGES = {name: (0.0, limit) for name, limit in zip(JOINTS, LIMITS, strict=True)}
"""Joint -> the ends of its bar in a live view."""
AXES = ("tip_x", "tip_y", "tip_z")
REACH = 320.0
"""No tip gets farther from the palm's centre, in mm: the ends of the live view's bars."""


def breakaways(texts: Sequence[str]) -> dict[str, int]:
    """``["F1=6000"]`` -> {"F1": 6000}. Raises UsageError."""
    found = {}
    for text in texts:
        name, equals, value = text.upper().partition("=")
        finger = name if name in FINGERS else f"F{name}"
        if not equals or finger not in FINGERS or not value.isdecimal() or int(value) > HIGHEST:
            raise UsageError(
                f"{text!r} is not FINGER=COUNTS",
                hint=f"write it as --breakaway F1=6000, with 0 to {HIGHEST} counts. Nothing was sent.",
            )
        found[finger] = int(value)
    return found


class Point(NamedTuple):
    """A place in mm; z points out of the palm."""

    x: float
    y: float
    z: float


def tip(finger: str, angles: Joints) -> Point:
    """Joint angles -> the tip of `finger` (F1, F2 or F3)."""
    r, j = SIDES[finger]
    phi = radians(r * angles.spread - 90 * j)
    a = radians(angles.inner + PHI2)
    ab = a + radians(angles.outer + PHI3)
    rho = A1 + A2 * cos(a) + A3 * cos(ab) - D3 * sin(ab)
    return Point(r * AW + rho * cos(phi), rho * sin(phi), DW + A2 * sin(a) + A3 * sin(ab) + D3 * cos(ab))


def beyond(angles: Joints, *, broken_away: bool) -> list[int]:
    """Numbers of the joints outside 0 to their limit (§9.6). The outer link's does not hold after breakaway."""
    return [
        number
        for number, (angle, limit) in enumerate(zip(angles, LIMITS, strict=True), 1)
        if not (-TOLERANCE <= angle <= limit + TOLERANCE) and not (number == 3 and broken_away)
    ]


def rows_of(
    positions: Mapping[str, int], broken: Mapping[str, int | None], *, known: bool, lost: Collection[str] = ()
) -> list[Row]:
    """Rows of all fingers whose motors are known: position, three joints, three coordinates.

    `broken` holds for each finger where its clutch let go, None = not; `known` = the firmware tells it. Of the motors
    in `lost`, not initialized, a position means nothing, and nothing that follows from it: its rows say so.
    """
    rows: list[Row] = []
    for finger in FINGERS:
        place = broken.get(finger)
        state = AFTER if place is not None else BEFORE if known else ASSUMED
        angles = joints(finger, positions[finger], positions["SPREAD"], place)
        point = tip(finger, angles)
        own = [finger] if finger in lost else []
        turned = ["SPREAD"] if "SPREAD" in lost and finger != "F3" else []  # the spread turns F1 and F2
        outside = beyond(angles, broken_away=place is not None)
        rows.append(_row("position", finger, positions[finger], "cts", state, own) | {"parameter": "P"})
        for number, (name, angle) in enumerate(zip(JOINTS, angles, strict=True), 1):
            more = {"limit": LIMITS[number - 1], "beyond_limit": number in outside}
            rows.append(_row(name, finger, round(angle, 4), "°", state, own if number > 1 else turned) | more)
        # + 0.0: there is no minus zero
        rows += [
            _row(name, finger, round(at, 4) + 0.0, "mm", state, [*own, *turned])
            for name, at in zip(AXES, point, strict=True)
        ]
    return rows


def _row(name: str, finger: str, value: float, unit: str, state: str, lost: Sequence[str]) -> Row:
    doubt = f"{', '.join(lost)}: {NOT_HOMED}" if lost else None
    return row_of(name, None, finger, value, unit, state=state, doubt=doubt)


def named(name: str) -> list[str]:
    """The paths that a name such as `tip_z` or `tip_z.F1` means in these rows. Raises UsageError."""
    known = [f"{quantity}.{finger}" for quantity in ("position", *JOINTS, *AXES) for finger in FINGERS]
    found = [path for path in known if name in (path, path.partition(".")[0])]
    if not found:
        raise UsageError(f"{name!r} is not in these rows", hint=f"try {', '.join(known[::3])}", code="unknown-name")
    return found


def table_of(rows: list[Row]) -> Table:
    """The rows, for people one line per finger."""
    return Table(rows=rows, columns=COLUMNS, view=_view, plain=("motor", "name", "value"))


def offline(positions: Sequence[int], broken: Mapping[str, int]) -> Table:
    """Fingertips for given counts of F1, F2, F3 and the spread; needs no hand."""
    by_motor = dict(zip(MOTORS, positions, strict=True))
    return table_of(rows_of(by_motor, broken, known=bool(broken)))


class Tips:
    """Read the positions of a hand, whether they are valid, and its breakaway positions if the firmware reports them.

    Whether the motors are initialized changes with a restart only: it is asked for once a second, not for each moment.
    """

    def __init__(self, hand: BarrettHand) -> None:
        self.hand = hand
        self._tells: bool | None = None
        self._lost: tuple[str, ...] = ()
        self._asked: float | None = None

    def rows(self) -> list[Row]:
        """Rows of this moment. Raises the hand's error when a position could not be read."""
        names = ["P"] if self._tells is False else ["P", "BD", "BP"]
        now = self.hand.link.now()
        if self._asked is None or now - self._asked >= 1.0:
            names.insert(1, "S")
        at = self.hand.by_name(*names, dispensable=("BD", "BP"))
        if "S" in names:
            self._asked = now
            self._tell_lost(tuple(motor for motor in MOTORS if at["S", motor] & 4))
        if self._tells is None:
            self._tells = ("BD", FINGERS[0]) in at
            if not self._tells:
                self.hand.journal.info(
                    "breakaway-unknown",
                    "this firmware does not report whether a clutch has let go, so handctl assumes that none has",
                    hint="open any finger that has met an object: until then the position of its tip is unknown (barrett §9.5)",
                )
        places = {motor: at["P", motor] for motor in MOTORS}
        broken = {
            finger: at.get(("BP", finger)) if at.get(("BD", finger)) else None for finger in FINGERS if self._tells
        }
        self._refuse_impossible("P", places)
        self._refuse_impossible("BP", {finger: place for finger, place in broken.items() if place is not None})
        return rows_of(places, broken, known=bool(self._tells), lost=self._lost)

    def _refuse_impossible(self, name: str, places: Mapping[str, int]) -> None:
        """Raise ProtocolError at a position that no joint reaches: its angles would be false."""
        for motor, place in places.items():
            if implausible(index := MOTORS.index(motor), place):
                raise ProtocolError(
                    f"{self.hand.link.name}: {name} of {motor} reads {place}, which is {why_impossible(index)}",
                    hint=Hint(
                        "read it again with {}. If it stays, {} finds the origin again", "barrett get P", "barrett init"
                    ),
                    code="impossible",
                )

    def _tell_lost(self, lost: tuple[str, ...]) -> None:
        self._lost = lost
        if lost:
            self.hand.journal.warn(
                "not-initialized",
                f"{', '.join(lost)} {NOT_HOMED}. The fingertips calculated from it mean nothing either",
                hint=Hint("{} first. The fingers open fully", "barrett init"),
            )


def now(hand: BarrettHand) -> Table:
    """The fingertips of a hand at this moment."""
    return table_of(Tips(hand).rows())


def stream(hand: BarrettHand, **timing: Any) -> Table:
    return live(
        hand,
        Tips(hand).rows,
        **timing,
        columns=COLUMNS,
        ranges=RANGES | {"tip_x": (-REACH, REACH), "tip_y": (-REACH, REACH), "tip_z": (0.0, REACH)},
        decimals=dict.fromkeys((*JOINTS, *AXES), 1),
    )


def _view(rows: list[Row]) -> list[Grid]:
    """One line per finger: counts, joint angles, coordinates of the tip."""
    lines = []
    for finger in FINGERS:
        mine = {row["name"]: row for row in rows if row["motor"] == finger}
        angles = [_angle(mine[name]) for name in JOINTS]
        point = [_marked(mine[name], f"{mine[name]['value']:.1f}") for name in AXES]
        lines.append((finger, _marked(mine["position"], str(mine["position"]["value"])), *angles, *point))
    states = {finger: next(row["state"] for row in rows if row["motor"] == finger) for finger in FINGERS}
    notes = [
        f"{', '.join(f for f in FINGERS if states[f] == state)}: {state}" for state in dict.fromkeys(states.values())
    ]
    if any(row["doubt"] for row in rows):
        notes.append(f"? {NOT_HOMED}")
    if AFTER in states.values():
        notes.append(
            "after breakaway, a tip is correct only while its finger moves. Open the finger to reset the clutch (§9.5)"
        )
    outside = [f"{row['motor']} {row['name']}" for row in rows if row.get("beyond_limit")]
    if outside:
        notes.append(f"! beyond the joint's limit (§9.6): {', '.join(outside)}")
    notes.append("limits: spread 180°, inner 140°, outer 48°. Frame: centre of the palm, z out of it (§9.5, §9.6)")
    headings = ("Finger", "Counts", "Spread °", "Inner °", "Outer °", "x mm", "y mm", "z mm")
    return [Grid(headings, tuple(lines), right=frozenset(range(1, 8)), notes=tuple(notes))]


def _angle(row: Row) -> str | Cell:
    text = f"{row['value']:.2f}"
    return Cell(f"{text}!", "warn") if row["beyond_limit"] and not row["doubt"] else _marked(row, text)


def _marked(row: Row, text: str) -> str | Cell:
    return Cell(f"{text}?", "dim") if row["doubt"] else text
