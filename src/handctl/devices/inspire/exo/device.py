"""The EH55BF1 exoskeleton hand: reading, writing and judging its registers. Returns readings and Tables.

Someone may be wearing it: everything is checked against the manual before a byte is sent. Id and speed are in
`id_baud_save_reset`, and what is kept; the search for hands is in `scan`.

What moves over a time is at the end: a position command until the fingers stand still. The calibration is in `calibration`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from handctl.devices.inspire import eb90, identity
from handctl.devices.inspire.duplicate_id import identify_alone
from handctl.devices.inspire.exo.register_map import EXO, FINGERS
from handctl.devices.inspire.register_bus import may_still_move
from handctl.devices.inspire.register_device import BEGINS, Movement, RegisterDevice, error_finding
from handctl.devices.inspire.register_map import ALONE, BAUD_RATES, DRAWN, NEAR, NOISE, OVER_TEMPERATURE, outside
from handctl.devices.inspire.serial_bus import SerialBus
from handctl.errors import CheckFailed, DeviceRefused, HandctlError, Hint, NoAnswer, ProtocolError, UsageError
from handctl.link import ByteLink
from handctl.model.command_settings import Settings
from handctl.model.device import Release, SetpointPair, limits_of
from handctl.model.movement import REACHED, AxisReading, Goal, Stillness
from handctl.model.param import Element, Number, Reading, Step, given
from handctl.model.prompts import Prompts
from handctl.model.result import Cell, Finding, Grid, Journal, Row, Table
from handctl.model.stop_on_interrupt import stopped_by_ctrl_c

LIVE = ("position_actual", "force_actual", "current", "error", "temperature")
"""What changes by itself: the default of `watch`."""
LEFT_ALONE = ". -1 leaves a finger as it is"
COMMAND_FLAGS = {name: flag for flag, name in eb90.COMMANDS.items()}


def cell(row: Row) -> str | Cell:
    """One value for people: error bits by name, -1 as "-1", a failed read as "?"."""
    if "error" in row:
        return Cell("?", "bad")
    if row["name"] == "error":
        return Cell(f"{row['value']:02X}", "bad" if row["value"] else "")
    return str(row["value"])


def registers_view(rows: list[Row]) -> list[Grid]:
    """One line per register: name, address, unit, then the fingers side by side; remarks below."""
    names = list(dict.fromkeys(row["name"] for row in rows))
    fingers = [finger for finger in (*FINGERS, "thumb_rotation") if any(row["finger"] == finger for row in rows)]
    scalars = any(row["finger"] is None for row in rows)
    heads = {"thumb_rotation": "rot"}
    headings = [
        "Name",
        "Addr",
        *(["Value"] if scalars else []),
        *(heads.get(finger, finger) for finger in fingers),
        "Unit",
    ]
    lines: list[tuple[str | Cell, ...]] = []
    notes: list[str] = []
    for name in names:
        mine = {row["finger"]: row for row in rows if row["name"] == name}
        first = next(iter(mine.values()))
        values: list[str | Cell] = [cell(mine[None]) if None in mine else ""] if scalars else []
        values += [cell(mine[finger]) if finger in mine else "" for finger in fingers]
        address = min((row["address"] for row in mine.values() if row["address"] is not None), default="")
        lines.append((name, str(address), *values, first["unit"] or ""))
        notes += _remarks(name, mine)
    right = frozenset(range(1, len(headings) - 1))
    return [Grid(tuple(headings), tuple(lines), right=right, notes=tuple(notes))]


def _remarks(name: str, rows: dict[str | None, Row]) -> list[str]:
    labels: dict[str, list[str]] = {}
    for finger, row in rows.items():
        label = row.get("label")
        if label and not (name == "error" and label == "ok"):
            labels.setdefault(label, []).append(finger or "")
    remarks = []
    for label, fingers in labels.items():
        who = "" if len(fingers) == len(rows) else f" {', '.join(fingers)}"
        remarks.append(f"{name}{who}: {label}")
    failed = next((row["error"] for row in rows.values() if "error" in row), None)
    return [*remarks, f"{name}: {failed}"] if failed else remarks


NOT_PROVED = (
    "check the label on the device: on another hand this address may erase settings. "
    "Add --skip-identity-check to skip this check. Nothing was written."
)


class ExoHand(RegisterDevice):
    """One hand on a bus. See `model.device`."""

    bus: SerialBus
    kind = "exo"
    product = "EH55BF1"
    map = EXO
    live = LIVE
    vital = ("error", "temperature")
    view = staticmethod(registers_view)
    worn = True
    setpoint_pairs = (SetpointPair("position_set", "position_actual", NEAR, closing=-1, unknown=ALONE),)
    releases = (Release("clear_errors", "error", lambda bits, _: bool(int(bits) & ~OVER_TEMPERATURE)),)
    not_covered = (
        "the results of a calibration (no register holds them)",
        "the flash: restored values last until power-off unless `handctl exo save` keeps them "
        "(the manual marks only id and baud_code as kept)",
        "triggers (clear_errors, save, factory_reset, calibrate)",
    )

    def plan_typed(self, data: bytes, can_id: int | None) -> tuple[Step, str]:
        from handctl.devices.inspire.exo import raw
        from handctl.devices.inspire.raw import asked

        return asked(raw.plan_raw(data, False), raw.WORN)

    def command_steps(self, which: str, values: Mapping[int, int]) -> list[Step]:
        """The frames that command these fingers: one command for all five, writes to the registers of some."""
        if len(values) != len(FINGERS):
            return self.plan(changes_of(which, values))
        request = eb90.command_request(self.bus.id, COMMAND_FLAGS[which], list(values.values()))
        return [Step(f"{which} command, little to thumb: {' '.join(map(str, values.values()))}", request, moves=True)]

    def command_some(self, which: str, values: Mapping[int, int]) -> Table:
        """The same by index of the finger. For some of them their registers are written, and read back.

        The command has no value that leaves a finger alone, which the registers have (exo §2.2.2, §2.3.7).
        """
        if len(values) == len(FINGERS):
            return self.command(which, list(values.values()))
        return self.table(self.write(changes_of(which, values)))

    def write(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]:
        """As every register device; but the id has a procedure, since the hand answers elsewhere afterwards."""
        calm = [change for change in changes if change[0].param.name != "id"]
        readings = super().write(calm) if calm else []
        for element, value in changes:
            if element.param.name == "id":
                self.change_id(int(value))
                readings += self.read([element])
        return readings

    def find_for_restore(self, values: dict[str, Number]) -> None:
        """Make `bus.id` the one that answers: after an interrupted restore that may be the snapshot's id already."""
        from handctl.devices.inspire.id_baud_save_reset import probe

        stored = values.get("id")
        if stored is None or stored == self.bus.id or probe(self.bus, self.bus.id):
            return
        if probe(self.bus, int(stored)):
            self.journal.info("found", f"id {self.bus.id} does not reply: handctl uses the snapshot's id {stored}")
            self.bus.id = int(stored)

    def command(self, which: str, values: Sequence[int]) -> Table:
        """Send a force or position command for all five fingers and show its reply: positions after force, forces after position."""
        replied = EXO["position_actual"] if which == "force" else EXO["force_actual"]
        before = self.journal.counters.writes
        self.journal.moves(self.stop)
        try:
            numbers = self.bus.command(COMMAND_FLAGS[which], values)
        except (NoAnswer, ProtocolError):
            if self.journal.counters.writes > before:
                self.journal.warn(
                    "ack-lost",
                    f"the {which} command got no reply, but the hand may still carry it out",
                    hint=Hint("check with {} before you repeat it", f"exo get {which}_set position_actual"),
                )
            raise
        readings = [
            Reading(element, number, eb90.pack_s16([number]))
            for element, number in zip(replied.each, numbers, strict=True)
        ]
        return self.table(readings)

    # -- tables --------------------------------------------------------------------------------------------------

    def dump(self) -> Table:
        """Everything documented, in two transactions where the device allows it (exo §2.3)."""
        table = super().dump()
        self._strangeness()
        return table

    def _strangeness(self) -> list[str]:
        """What the bytes just read say against an EH55BF1, told as a warning; reads nothing more."""

        at = identity.within(self.last_blocks)
        told = identity.is_six_wide(at)
        if told:
            self.journal.warn("other-device", f"{self.bus.where}: {identity.SIX_FINGERS}: {told}", identity.SIX_HINT)
        bits = (at(*identity.SIXTH_ERROR) or b"\0")[0]
        label = EXO["error"].label(bits)
        sixth = f"thumb rotation: {label} (0x{bits:02X}), if {identity.SIXTH_ERROR[0]} is its error as on an RH56 hand"
        if bits:
            self.journal.warn("unhealthy", sixth)
        return [*([identity.SIX_FINGERS] if told else []), *([sixth] if bits else [])]

    def status(self, check: bool) -> Table:
        """The health summary for each finger. With `check`, any finding is a CheckFailed (exit code 7)."""
        names = ("id", "baud_code", "system_voltage", "position_set", "force_set", *LIVE)
        readings = self.present(self.read([element for name in names for element in EXO[name].each]))
        table = self.table(readings)
        table.view = status_view
        findings = unhealthy(readings)
        return self.with_findings(table, findings, check, more=self._strangeness)

    def confirm_identity(self, *, keeps: bool = True) -> None:
        if keeps:
            self.check_identity()

    def not_at(self, rate: int) -> HandctlError:
        """The error of a hand that does not answer at a speed that it was given. Looks where it does."""
        from handctl.devices.inspire import id_baud_save_reset

        found = id_baud_save_reset.find_speed(self.bus)
        where = f"It replies at {found} bit/s" if found else "It does not reply at any of the three baud rates"
        return NoAnswer(
            f"{self.bus.link.name}: no hand at {rate} bit/s after the power-cycle. {where}",
            hint=Hint(
                "use the RS-232 cable: a Bluetooth module may still use the old baud rate. {} tries all ids and baud rates",
                "exo scan",
            ),
        )

    def check_identity(self) -> None:
        """Refuse to go on when the registers do not look like an EH55BF1's. Raises CheckFailed, DeviceRefused where some are missing.

        On another hand of the same maker address 1005 is the factory reset, so save and reset look first.
        """
        identify_alone(self)
        readings = self.read([element for param in EXO if param.readable for element in param.each])
        for reading in readings:
            if reading.error is not None and not self.lacks(reading.error):
                raise reading.error
        if absent := dict.fromkeys(one.element.param.name for one in readings if one.error is not None):
            raise DeviceRefused(
                f"{self.bus.where}: this device replies, but does not have {', '.join(absent)} of an EH55BF1",
                hint=NOT_PROVED,
                code="in-part",
            )
        odd = [f"{reading.element.full_name} = {reading.value}" for reading in readings if not _plausible(reading)]
        if odd:
            raise CheckFailed(
                f"{self.bus.where}: this does not look like an EH55BF1: {', '.join(odd)}",
                hint=NOT_PROVED,
                code="not-an-exo",
            )


def open_exo(link: ByteLink, settings: Settings, journal: Journal) -> ExoHand:
    """An EH55BF1 behind `link` with the options the user gave."""
    bus = SerialBus(link, settings.id if settings.id is not None else 1, journal, **limits_of(settings, link))
    bus.across_gaps = settings.own.get("across_gaps") != "no"
    bus.gate = identity.FamilyGate(identity.EXO, settings.assume_identity)
    return ExoHand(bus)


def changes_of(which: str, values: Mapping[int, int]) -> list[tuple[Element, Number]]:
    """A force or position command for these fingers, by index, as set-points."""
    return [(Element(EXO[f"{which}_set"], index), value) for index, value in values.items()]


def parse_command(which: str, texts: Sequence[str]) -> dict[int, int]:
    """What is typed for a force or position command -> value by index of the finger, without those left alone. Raises UsageError."""
    register = EXO[f"{which}_set"]
    found = {
        index: int(register.parse(text, f"{which} {FINGERS[index]}"))
        for index, text in given(
            texts, FINGERS, what=f"exo {which}", more=LEFT_ALONE if which == "position" else ""
        ).items()
    }
    if which != "position":
        return found  # -1 is a force
    wanted = {index: value for index, value in found.items() if value != ALONE}
    if not wanted:
        raise UsageError(
            "all values are -1, so every finger stays as it is", hint="give at least one position. Nothing was sent."
        )
    return wanted


def _plausible(reading: Reading) -> bool:
    value = reading.value
    assert value is not None
    if reading.element.param.name == "system_voltage":
        return value > 0  # FF FF is what a register reads that nothing has filled
    return reading.element.param.allowed(value)


def unhealthy(readings: Sequence[Reading]) -> list[Finding]:
    """Findings: error bits, values outside the documented range, a supply reading of 0 or below (FF FF)."""
    by_name = {reading.element.full_name: reading.value for reading in readings}
    found = []
    for reading in readings:
        param, value = reading.element.param, reading.value
        if value is None:
            continue
        if param.bits and value:
            found.append(error_finding(reading, by_name.get(f"temperature.{reading.element.part}")))
        elif not _plausible(reading):
            text = outside(reading.element.full_name, param, value)
            found.append(Finding(text, ("range" if param.range_text else "supply",)))
    return found


# -- how people see it -------------------------------------------------------------------------------------------


def status_view(rows: list[Row]) -> list[Grid]:
    """Per finger: position against set point, force against set point, current, temperature, errors in words."""
    at = {(row["name"], row["finger"]): row for row in rows}

    def text(name: str, finger: str | None) -> str | Cell:
        row = at.get((name, finger))
        if row is None:
            return ""
        if name == "error" and "error" not in row:
            return Cell(row["label"], "bad" if row["value"] else "good")
        if name == "position_set" and row.get("value") == -1:
            return Cell("-", "dim")
        return cell(row)

    columns = ("position_actual", "position_set", "force_actual", "force_set", "current", "temperature", "error")
    lines = tuple((finger, *(text(name, finger) for name in columns)) for finger in FINGERS)
    rotation = ("rotation", text("position_actual", "thumb_rotation"), *[""] * 6)

    def single(name: str) -> Any:
        return at.get((name, None), {}).get("value")

    code = single("baud_code")
    head = (
        f"id {single('id') or '?'}, "
        f"{BAUD_RATES.get(code, '?') if isinstance(code, int) else '?'} bit/s (code {code if code is not None else '?'}), "
        f"supply {'?' if (supply := single('system_voltage')) is None else supply} (raw, scale unknown)"
    )
    notes = (
        "Position: 0 bent to 1000 open. Force (raw): set + opens the hand, measured + means that the user closes it.",
    )
    headings = ("Finger", "Position", "Set", "Force", "Set", "mA", "°C", "Errors")
    return [Grid(headings, (*lines, rotation), title=head, right=frozenset(range(1, 7)), notes=notes)]


# -- what moves it over a time ----------------------------------------------------------------------------------------

STILL = Stillness(samples=3, seconds=0.5, refresh=0.05, short=BEGINS, pushing=DRAWN)


def command(hand: ExoHand, which: str, values: Mapping[int, int], prompts: Prompts) -> Table:
    """Send a force or position command and show its reply. Raises Interrupted on Ctrl-C, after the hand was stopped."""
    with stopped_by_ctrl_c(hand.stop, prompts), may_still_move("the fingers"):
        return hand.command_some(which, values)


def move(hand: ExoHand, values: Mapping[int, int], prompts: Prompts, *, wait: float, expect: str = REACHED) -> Table:
    """Send a position command, then watch until the fingers have stopped or `wait` seconds have passed.

    `values` by index of the finger; others are left alone. Ctrl-C stops the hand. Rows have the target and what became of
    it; what was not as expected is the table's failure.
    """
    this = Movement(
        [Goal(FINGERS[index], value, NEAR, jitter=NOISE) for index, value in values.items()],
        STILL,
        EXO["position_actual"].each,
        lambda readings: {reading.element.part or "": AxisReading(_place(reading)) for reading in readings},
        errors=EXO["error"].each,
        currents=EXO["current"].each,
        targets=EXO["position_set"].each,
    )
    return hand.moved(this, lambda: hand.command_some("position", values), prompts, wait=wait, expect=expect)[0]


def _place(reading: Reading) -> Number | None:
    """Where a finger is; -1, the mark for no value (exo §2.3.7), is near 0 and no place."""
    return None if reading.value == ALONE else reading.value
