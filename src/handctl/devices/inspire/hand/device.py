"""The RH56 hands: reading, writing and judging their registers, whichever generation and wire. Returns readings and Tables.

A hand sits on a robot or a bench. It closes within a second: what moves it is asked for first, and refused while the
hand reports a fault (rh56 §9). Movements are in `motion`, what is kept in `id_baud_save_reset`, which generation it is in `detect_generation`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from handctl.devices.inspire.duplicate_id import naming_duplicate_id
from handctl.devices.inspire.hand.detect_generation import LABEL, Found, ModelGate, refuse_other_generation
from handctl.devices.inspire.hand.register_map import (
    BYTE_MAP,
    DF,
    DG2,
    F1,
    FORCE_MOST,
    HAND_BAUD_RATES,
    HAND_CAN_BITRATES,
    IP_ADDRESS,
    MAPS,
    MODELS,
    NO_MOVE_STATUS,
    NO_TEMPERATURE,
    OF_BYTES,
    THUMB_DEFAULT,
    TP,
    HandRegister,
    too_hot,
)
from handctl.devices.inspire.identity import BYTE_HAND, NOT_SHOWN, UNHEARD, stranger
from handctl.devices.inspire.modbus_frames import is_eb90
from handctl.devices.inspire.register_bus import BETWEEN_PROTOCOLS, RegisterBus
from handctl.devices.inspire.register_device import BlockReader, RegisterDevice, T, error_finding
from handctl.devices.inspire.register_map import NEAR, OVER_TEMPERATURE, outside
from handctl.errors import DeviceRefused, HandctlError, Hint, NoAnswer, ProtocolError, UsageError
from handctl.link import CanFrame
from handctl.model.device import OTHER_FORM, Release, SetpointPair
from handctl.model.param import Element, Number, ParamMap, Reading, Step
from handctl.model.result import Cell, Finding, Grid, Journal, Row, Table
from handctl.model.stop_sequence import StopContext

LIVE = ("stroke_actual", "angle_actual", "force_actual", "current", "error", "status", "temperature")
"""What changes by itself, one block of 90 bytes on DF and TP: the default of `watch`."""
SHOWN = ("id", "baud_code", "angle_set", "force_limit", "speed_set", *LIVE)


STROKE = 2
"""Counts of a stroke for one of an angle: 2000 against 1000."""
SETPOINT_PAIRS = (
    SetpointPair("stroke_set", "stroke_actual", STROKE * NEAR, closing=1),
    SetpointPair("angle_set", "angle_actual", NEAR, closing=-1),
)
"""0 is open as a stroke, closed as an angle."""
RELEASES = (
    Release("speed_set", "speed_set", lambda _, new: new > 0),
    Release("force_limit", "force_limit", lambda now, new: new > now, closing=True),
    Release("clear_errors", "error", lambda bits, _: bool(int(bits) & ~OVER_TEMPERATURE)),
)
"""A target that a finger has not reached waits for the next speed: it may have been written while the speed was 0, or be still on
its way; a closing finger that met the limit waits for a higher one, one with an error for the clearing (rh56, "Movement is a
matter of state")."""

NOT_ON_MODEL = "not-on-model"
"""Code of what a generation does not have."""


class Hand(RegisterDevice):
    """One RH56 hand on a bus. See `model.device`.

    typed  the generation that the user named; it decides the map, and a hand that contradicts it is refused
    side   left or right, as the user says; "" = not said: the hand does not know it (rh56 §1)
    other  the wire with which a hand is asked that is silent on the first: Modbus RTU behind EB90 (rh56 §2.5)
    """

    kind = "hand"
    live = LIVE
    vital = ("error", "status", "temperature")
    releases = RELEASES
    supply = "24 V, 2 A peak (RH56DFTP: 4.5 A)"
    speed_source = "rh56 §2.1"
    save_result = "it arrives about a second later, rh56 §2.1"
    not_covered = (
        "set-points (angle_set, stroke_set), which are never restored",
        "id, speed and network address, which are changed by their own commands",
        "stored action sequences and gestures",
        "triggers (clear_errors, save, factory_reset, calibrate_force)",
    )

    def block(self, name: str) -> Callable[[], list[Row]] | None:
        """See Device: `tactile`, or `tactile.ZONE`."""
        base, _, zone = name.partition(".")
        if base != "tactile":
            return None
        from handctl.devices.inspire.hand.tactile import reader

        return reader(self, [zone] if zone else [])

    def __init__(self, bus: RegisterBus, gate: ModelGate, other: RegisterBus | None = None, *, side: str = "") -> None:
        super().__init__(bus)
        self.side = side
        self.gate = gate
        self.typed = gate.typed
        self._other = other
        self._known: str | None = None
        self._asked = False
        if gate.typed is not None:
            self._is(gate.typed)

    @property
    def map(self) -> ParamMap[Any]:  # type: ignore[override]
        """The map of the generation, as far as it is known."""
        return MAPS[self._known] if self._known is not None else BYTE_MAP

    @property
    def setpoint_pairs(self) -> Sequence[SetpointPair]:  # type: ignore[override]
        """Which way the angles of an RH5DG2 grow is not known (rh56 §3.2)."""
        return [one._replace(closing=0) for one in SETPOINT_PAIRS] if self._known == DG2 else SETPOINT_PAIRS

    def again(self, journal: Journal) -> bool:
        return False  # each command finds out which generation answers

    def identity(self) -> dict[str, object]:
        """The identity of this device: the hand has no register for model, side or serial number (rh56 §1)."""
        self.know()
        return {"kind": self.kind, "id": self.bus.id, "model": self._known}

    def map_of(self, identity: Mapping[str, object]) -> ParamMap[Any]:
        return MAPS.get(str(identity.get("model")), BYTE_MAP)

    # -- who it is -----------------------------------------------------------------------------------------------

    def identify(self) -> None:
        """Identify the device and check whether it may be written to. Raises NotIdentified."""
        if not self.gate.assumed:
            found = self.answered(lambda: self.gate.seen(self.bus, self._other))
            if found.kind.family == self.kind and found.model is not None and self._known is None:
                self._is(found.model)
        self.bus.identify()

    def plan_typed(self, data: bytes, can_id: int | None) -> tuple[Step, str]:
        from handctl.devices.inspire import raw as by_number
        from handctl.devices.inspire.hand import raw

        step = raw.plan(self, data, False) if can_id is None else raw.plan_can(self, CanFrame(can_id, data))
        return by_number.asked(step, by_number.HAND)

    def admit(self, data: bytes, can_id: int | None) -> None:
        """What is no EB90 frame may be for the other wire of the hand: it is looked for on both."""
        if can_id is None and not is_eb90(data):
            self.identify()
        else:
            super().admit(data, can_id)

    def found(self) -> Found:
        """Who answers, asked once. Raises DeviceRefused for a device of another kind or another generation than typed."""
        found = self.answered(lambda: self.gate.seen(self.bus, self._other))
        if found.kind.family != "hand":
            raise stranger(self.bus, found.kind, BYTE_HAND, found.evidence)
        refuse_other_generation(self.bus, found, self.typed)
        return found

    def know(self) -> None:
        """Find the generation, unless it was typed: it decides where everything lies."""
        if self._known is not None or self._asked:
            return
        if self.gate.unasked:
            self._asked = True
            self.gate.tell(self.journal)
            return
        found = self.found()
        self._asked = True
        if found.model is not None:
            self._is(found.model)
        else:
            self.journal.warn(
                "model-open", f"{self.bus.where}: the generation is not certain: {found.evidence}", hint=LABEL
            )

    def own_map(self) -> ParamMap[Any]:
        self.know()
        return self.map

    def _is(self, model: str) -> None:
        self._known = self.about["model"] = model
        self.link.event(f"generation {model}")  # so that a transcript tells what its addresses mean
        for bus in (self.bus, self._other):
            if bus is not None:
                bus.per = 2 if model in (F1, DG2) else 1
                bus.asked_first = (self.map["angle_actual"].address, 2)

    def answered(self, ask: Callable[[], T]) -> T:
        """The result of `ask`; without a reply on the first wire, asked again on the other."""
        try:
            return ask()
        except (NoAnswer, ProtocolError) as exc:
            other, self._other = self._other, None
            if other is None or exc.code not in UNHEARD:
                raise
            first, self.bus = self.bus, other
            self._reader = BlockReader(other)
            self.journal.ledger.forget()  # planned in EB90
            other.pause(BETWEEN_PROTOCOLS)
            try:
                answer = ask()
            except HandctlError as second:
                if isinstance(second, DeviceRefused) or second.code in (NOT_SHOWN, OTHER_FORM):
                    raise  # it speaks there
                self.bus, self._reader = first, BlockReader(first)
                raise exc from None
            self.journal.info("protocol", f"{other.where}: it does not reply in EB90, but does in Modbus RTU")
            return answer

    @property
    def wires(self) -> list[RegisterBus]:
        """The one that it speaks, and behind it one that was not asked yet."""
        return [self.bus] if self._other is None else [self.bus, self._other]

    @property
    def has(self) -> list[HandRegister]:
        """The registers that this generation has."""
        return list(OF_BYTES) if self._known is None else [one for one in self.map if self._known in one.models]

    def further(self, identity: dict[str, object]) -> Collection[str]:
        """Settings that not every generation has."""
        return ["current_limit"] if identity.get("model") == DF else []

    # -- reading -------------------------------------------------------------------------------------------------

    def read(self, elements: Sequence[Element]) -> list[Reading]:
        """Elements by name, wherever this generation has them; one that it has not carries its error."""
        self.know()
        own: list[Element | HandctlError] = [self._own(element) for element in elements]
        there = [element for element in own if isinstance(element, Element)]
        readings = iter(self.answered(lambda: super(Hand, self).read(there)) if there else ())
        return [
            next(readings) if isinstance(element, Element) else Reading(asked, None, b"", element)
            for asked, element in zip(elements, own, strict=True)
        ]

    def lacks(self, error: HandctlError) -> bool:
        """See Device. What its generation does not have is not asked for."""
        return error.code == NOT_ON_MODEL or super().lacks(error)

    def of_this_device(self, elements: Sequence[Element]) -> Sequence[Element]:
        """A quantity of all six actuators is one of all thirteen on an RH5DG2."""
        self.know()
        asked = Counter(element.param.name for element in elements)
        found: dict[str, Element] = {}
        for element in elements:
            own, param = self.map.get(element.param.name), element.param
            whole = own is not None and own.elements != param.elements and asked[param.name] == param.count
            for one in own.each if own is not None and whole else [element]:
                found[one.path] = one
        return list(found.values())

    def _own(self, element: Element) -> Element | HandctlError:
        """The same element in the map of this generation."""
        name, model = element.param.name, self._known
        register = self.map.get(name)
        missing = register is None or (model is not None and model not in register.models)
        if register is None or missing or (element.part is not None and element.part not in register.elements):
            who = MODELS[model] if model is not None else "this hand"
            return UsageError(
                f"{who} has no {element.full_name}",
                hint=Hint("{} shows what it has", f"hand describe --model {model}"),
                code=NOT_ON_MODEL,
            )
        return Element(register, register.elements.index(element.part) if element.part is not None else 0)

    def dump(self) -> Table:
        """Everything documented, in two reads on DF (rh56 §5)."""
        self.know()
        readings = self.present(self.read([e for one in self.has if one.readable for e in one.each]))
        return self._with_blocks(self.table(readings))

    def status(self, check: bool) -> Table:
        """The health summary for each finger. With `check`, any finding gives exit code 7."""
        self.know()
        names = [one for one in self.has if one.name in SHOWN]
        readings = self.present(self.read([element for one in names for element in one.each]))
        table = self.table(readings)
        table.view = lambda rows: status_view(rows, self._spoken())
        return self.with_findings(table, unhealthy(readings), check)

    def _spoken(self) -> tuple[str, str]:
        """Its generation as far as it is known, and what it is connected by: "" on a plain serial line."""
        wires = {"can": "CAN", "tcp": "Modbus TCP", "rtu": "Modbus RTU"}
        return MODELS.get(self._known or "", "generation unknown"), wires.get(self.bus.wire, "")

    @staticmethod
    def view(rows: list[Row]) -> list[Grid]:
        """One line per register, fingers side by side."""
        return registers_view(rows)

    # -- writing -------------------------------------------------------------------------------------------------

    def plan(self, changes: Sequence[tuple[Element, Number]]) -> list[Step]:
        return super().plan(self._placed(changes))

    def write(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]:
        self.identify()
        return super().write(self._placed(changes))

    def runs(self, changes: Sequence[tuple[Element, Number]]) -> list[list[tuple[Element, Number]]]:
        """As every register device; a CAN frame has eight bytes."""
        most = self.bus.max_count // 2 if self.bus.wire == "can" else len(changes)
        groups = super().runs(changes)
        return [group[start : start + most] for group in groups for start in range(0, len(group), most)]

    def _placed(self, changes: Sequence[tuple[Element, Number]]) -> list[tuple[Element, Number]]:
        """The changes in the map that is written to. Raises UsageError for what this generation has not."""
        placed = []
        for element, value in changes:
            own = self._own(element)
            if isinstance(own, HandctlError):
                raise own
            self._refuse_grams(own, value)
            placed.append((own, value))
        return placed

    def _refuse_grams(self, element: Element, value: Number) -> None:
        """Raise UsageError for a force that only another generation has (rh56 §3.1)."""
        name, part = element.param.name, element.part or ""
        if self._known != DF or name not in ("force_limit", "default_force"):
            return
        most = THUMB_DEFAULT if name == "default_force" and part.startswith("thumb") else FORCE_MOST[DF]
        if value > most:
            raise UsageError(
                f"{element.full_name} = {value} is outside 0 to {most} g of {MODELS[DF]}",
                hint=f"choose a value up to {most} g (rh56 §3.1). Nothing was sent.",
                code="out-of-range",
            )

    # -- where it is found ---------------------------------------------------------------------------------------

    def confirm_identity(self, *, keeps: bool = True) -> None:
        """It is of a generation that may be written to. Raises NotIdentified, NoAnswer."""
        with naming_duplicate_id(self):
            self.identify()

    def change_id(self, new: int) -> Table:
        """As of every device of registers, but over TCP, where a hand answers to whatever id."""
        try:
            self.confirm_identity()
        except NoAnswer:
            return super().change_id(new)  # perhaps it has the new id already
        if self.bus.wire == "tcp":
            self.journal.info(
                "unit", "over TCP a hand replies to every unit id: its own id only matters on a serial line or CAN bus"
            )
            return self.table(self.write([(Element(self.map["id"], 0), new)]))
        return super().change_id(new)

    def speeds(self) -> Mapping[int, int]:
        if self.bus.wire == "can":
            return HAND_CAN_BITRATES
        return {code: rate for code, rate in HAND_BAUD_RATES.items() if code < 3 or self.typed in (None, TP, F1)}

    def show_speed(self) -> Table:
        """The baud rate code and its neighbouring register."""
        from handctl.devices.inspire.hand import baud_and_network as place

        place.tell_places(self)
        return self.table(self.read(self.map["baud_code"].each))

    def change_speed(self, rate: int) -> Table:
        from handctl.devices.inspire.hand import baud_and_network as place

        return place.change_speed(self, rate)

    def stop_context(self) -> StopContext:
        """Its generation, protocol and wire as far as they are known, whatever the LINK is called."""
        context, wire = super().stop_context(), self.bus.wire
        if self._other is not None and not self.bus.met:
            return context._replace(proven=False)  # nothing has been read yet: either protocol may be the one
        own = {**context.settings.own, "protocol": "modbus" if wire in ("rtu", "tcp") else "eb90"}
        own |= {"model": self._known} if self._known else {}
        spoken = "modbus-tcp" if wire == "tcp" else None
        known = context.settings._replace(id=self.bus.id, port=None, wire=spoken, own=own)
        return context._replace(settings=known)


# -- findings and views -------------------------------------------------------------------------------------------


def unhealthy(readings: Sequence[Reading]) -> list[Finding]:
    """Findings of `status`: error bits with the status that goes with them, heat, values outside the documented range."""
    at = {reading.element.full_name: reading.value for reading in readings}
    found = []
    for reading in readings:
        param, value, part = reading.element.param, reading.value, reading.element.part
        if value is None:
            continue
        if param.name == "error" and value:
            status = at.get(f"status.{part}")
            more = f", status {status}" if status in NO_MOVE_STATUS else ""
            found.append(error_finding(reading, at.get(f"temperature.{part}"), more))
        elif param.name == "status" and value in NO_MOVE_STATUS and not at.get(f"error.{part}"):
            found.append(Finding(f"{part}: status {value}, {param.label(value)}", (str(param.label(value)),)))
        elif param.name == "temperature" and too_hot(value):
            if int(at.get(f"error.{part}") or 0) & OVER_TEMPERATURE:
                continue  # said there
            found.append(Finding(f"{part}: {value} °C", ("hot",)))
        elif not param.bits and not param.allowed(value):
            found.append(Finding(outside(reading.element.full_name, param, value), ("range",)))
    return found


def cell(row: Row) -> str | Cell:
    """One value for people; what could not be read is a bad "?"."""
    if "error" in row and "value" not in row:
        return Cell("?", "bad")
    value, name = row.get("value"), row["name"]
    nothing = NO_TEMPERATURE if name == "temperature" else -1 if name.endswith("_set") else None
    return str(value) if value != nothing else Cell("-", "dim")


def registers_view(rows: list[Row]) -> list[Grid]:
    """What has one value, the IP address in one piece, then registers down and fingers across."""
    octets = [row for row in rows if row["name"] == IP_ADDRESS]
    whole = len(octets) == 4
    rows = [row for row in rows if row["name"] != IP_ADDRESS or not whole]
    names = list(dict.fromkeys(row["name"] for row in rows))
    parts = list(dict.fromkeys(row["finger"] for row in rows if row["finger"] is not None))
    at = {(row["name"], row["finger"]): row for row in rows}
    vectors = [name for name in names if any((name, part) in at for part in parts if part is not None)]
    lines = [(name, *(cell(at[name, part]) if (name, part) in at else "" for part in parts)) for name in vectors]
    single = [
        (row["name"] or "", cell(row), row["unit"] or "", row.get("label") or row.get("error") or "")
        for row in rows
        if row["finger"] is None
    ]
    if whole:
        texts = [one.text if isinstance(one, Cell) else one for one in map(cell, octets)]
        single.append((IP_ADDRESS, ".".join(texts), "", octets[0].get("error") or ""))
    grids = []
    if single:
        heads = ("Name", "Value", "Unit", "Meaning")
        used = [place for place in range(4) if place < 2 or any(line[place] for line in single)]
        lines_of = tuple(tuple(line[place] for place in used) for line in single)
        grids.append(Grid(tuple(heads[place] for place in used), lines_of, right=frozenset({1})))
    if lines:
        heads = ("Name", *(part.replace("thumb_", "") for part in parts))
        grids.append(Grid(heads, tuple(lines), right=frozenset(range(1, len(heads)))))
    return grids


STATUS_COLUMNS = (
    "angle_actual", "angle_set", "force_actual", "force_limit", "current", "temperature", "status", "error",
)  # fmt: skip


def status_view(rows: list[Row], spoken: tuple[str, str]) -> list[Grid]:
    """One line per finger. `spoken` are the generation, and the wire, "" = a plain serial line."""
    at = {(row["name"], row["finger"]): row for row in rows}
    parts = list(dict.fromkeys(row["finger"] for row in rows if row["finger"] is not None))

    def text(name: str, part: str) -> str | Cell:
        row = at.get((name, part))
        if row is None:
            return ""
        if name in ("status", "error") and "value" in row:
            bad = row["value"] in NO_MOVE_STATUS if name == "status" else bool(row["value"])
            return Cell(str(row.get("label") or row["value"]), "bad" if bad else "good")
        return cell(row)

    lines = tuple((part, *(text(name, part) for name in STATUS_COLUMNS)) for part in parts)
    code = at.get(("baud_code", None), {}).get("value")
    number = at.get(("id", None), {}).get("value", "?")
    model, wire = spoken
    speeds = HAND_CAN_BITRATES if wire == "CAN" else HAND_BAUD_RATES
    rate = f"{speeds.get(code, '?') if isinstance(code, int) else '?'} bit/s"
    line = wire if wire == "Modbus TCP" else f"{wire or 'serial'}, {rate}"
    head = f"id {number}, {model}, {line}"
    next_speeds = " ".join(str(at[name, part].get("value", "?")) for name, part in at if name == "speed_set")
    notes = (
        f"Speed of the next movement: {next_speeds}.",
        "Force: the limit is a threshold in grams, not a force that the hand holds.",
    )
    headings = ("Finger", "Angle", "Set", "Force", "Limit", "mA", "°C", "Status", "Errors")
    return [Grid(headings, lines, title=head, right=frozenset(range(1, 7)), notes=notes)]
