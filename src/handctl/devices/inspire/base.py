"""A device of registers: reading, writing and reading back by name, over either wire. Knows no particular device.

Everything is checked against the map before a byte is sent; a write is sent once, and the read-back decides.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from handctl.devices.inspire import twins
from handctl.devices.inspire.blocks import BlockReader, Memory
from handctl.devices.inspire.map import Register, register_of
from handctl.devices.inspire.registers import RegisterBus
from handctl.errors import HandctlError, Left, NoAnswer, ProtocolError
from handctl.model.device import Device
from handctl.model.param import Element, Number, ParamMap, Reading, Step
from handctl.model.result import Column, Row, Table, hex_bytes
from handctl.model.stopping import Stopped, interrupted, leaving


class RegisterDevice(Device):
    """Base of the family's devices. A subclass names its kind, its map, its supply, what is live, and how people see it."""

    map: ParamMap[Register]
    supply = "7 to 9 V, 5 A peak"
    save_result = "the result is not documented for this hand"
    """Why the result of a save may stay out."""
    columns = (
        Column("name", "Name"),
        Column("finger", "Finger"),
        Column("address", "Address", right=True),
        Column("value", "Value", right=True),
        Column("unit", "Unit"),
        Column("label", "Meaning"),
        Column("raw", "Raw"),
    )

    def __init__(self, bus: RegisterBus) -> None:
        super().__init__(bus)
        self.bus = bus
        self._reader = BlockReader(bus)
        self.last_blocks: list[tuple[int, bytes]] = []
        self._moving = False
        """Whether this command has set something going: a stop is for that, whichever write it meets."""

    def identity(self) -> dict[str, object]:
        """What tells this device from another. The manuals document no serial number, model or firmware register."""
        return {"kind": self.kind, "id": self.bus.id}

    def identify(self) -> None:
        self.bus.identify()

    def will_move(self) -> None:
        super().will_move()
        self._moving = True

    # -- reading -------------------------------------------------------------------------------------------------

    def read(self, elements: Sequence[Element]) -> list[Reading]:
        registers = {element.param.name: register_of(element) for element in elements}
        memory, gate = Memory(), self.bus.gate
        try:
            with self.keeping(lambda: [_reading(element, memory) for element in elements] if memory.blocks else []):
                self._reader.read(registers.values(), memory)
        except (NoAnswer, ProtocolError) as exc:
            if gate is not None:
                gate.unheard(self.bus, exc)
            raise
        self.last_blocks = sorted(memory.blocks)
        if gate is not None:
            gate.read(self.bus, self.last_blocks)
        return [_reading(element, memory) for element in elements]

    def named(self, element: Element) -> Row:
        register = register_of(element)
        return {"name": register.name, "finger": element.part, "address": register.place_of(element.index)}

    def row(self, reading: Reading) -> Row:
        row = super().row(reading)
        if self.bus.gate is not None and self.bus.gate.assumed and self.about.get("model") == self.product:
            del self.about["model"]  # nobody has looked
        return {**row, "raw": None} if "error" in row else row

    def valued(self, reading: Reading) -> Row:
        register = register_of(reading.element)
        assert reading.value is not None
        label = register.label(reading.value)
        if register.note and (label is None or reading.value):
            label = f"{label} ({register.note})" if label else register.note
        return {"value": reading.value, "unit": register.unit, "raw": hex_bytes(reading.raw), "label": label}

    # -- writing -------------------------------------------------------------------------------------------------

    def plan(self, changes: Sequence[tuple[Element, Number]]) -> list[Step]:
        """The frames that write checked `changes`: adjacent elements of one group share a frame; never across a gap."""
        steps = []
        for run in self.runs(changes):
            address, data = encoded(run)
            register = register_of(run[0][0])
            meaning = ", ".join(f"{element.full_name} = {element.param.text(value)}" for element, value in run)
            step = self.bus.write_step(address, data, f"write {meaning} (address {address})")
            steps.append(step._replace(moves=register.moves, strands=register.strands))
        return steps

    def runs(self, changes: Sequence[tuple[Element, Number]]) -> list[list[tuple[Element, Number]]]:
        """Changes grouped into what one frame may write: adjacent elements of one register group."""
        groups: list[list[tuple[Element, Number]]] = []
        for element, value in changes:
            if groups:
                last = groups[-1][-1][0]
                if last.param.name == element.param.name and last.index + 1 == element.index:
                    groups[-1].append((element, value))
                    continue
            groups.append([(element, value)])
        return groups

    def write(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]:
        """Write checked changes one frame at a time and read all of them back.

        A write without an answer is not repeated: the read-back decides. Raises DeviceRefused when a write is
        refused; CheckFailed when the read-back differs, which it says with both values; Interrupted on Ctrl-C, after
        what moves was stopped.
        """
        if any(element.param.strands for element, _ in changes):
            twins.refuse(self)
        with self.stopped_by_ctrl_c(
            ", ".join(element.full_name for element, _ in changes),
            any(element.param.moves for element, _ in changes),
        ):
            return self._written(changes)

    @contextmanager
    def stopped_by_ctrl_c(self, what: str, moving: bool) -> Iterator[None]:
        """Ctrl-C while `what` is written stops what that, or a write before, set going. Raises Interrupted."""
        self._moving = bool(moving) or self._moving
        before, unsure = self.journal.counters.writes, f"it is not known whether {what} was written"
        look = f"check with `handctl {self.kind} get`"
        left = Left(f"{unsure}, and the device may move" if self._moving else unsure, look, joint=". ")
        if self._moving:
            self.journal.moves(self.stop)
        try:
            with leaving(left, since=self.journal.counters, interrupt=False):
                yield
        except KeyboardInterrupt as exc:
            if self.journal.counters.writes == before:
                raise
            raise interrupted(self.stop() if self._moving else Stopped(unsure, look)) from exc

    def _written(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]:
        written: list[str] = []
        runs = self.runs(changes)
        for number, run in enumerate(runs, 1):
            try:
                self._write_run(run, last=number == len(runs))
            except HandctlError as exc:
                if written:
                    exc.leaves(Left(hint=f"already written: {', '.join(written)}", joint=". "))
                raise
            written.append(_names(run))
        readings = self.read([element for element, _ in changes])
        self._verify(changes, readings)
        return readings

    def _write_run(self, run: Sequence[tuple[Element, Number]], *, last: bool) -> None:
        """One frame. Where its acknowledgement is lost, nothing follows it before it reads back."""
        lost = self.bus.try_write(*encoded(run), f"the write of {_names(run)}", "handctl reads it back")
        if lost is not None and not last:
            self._verify(run, self.read([element for element, _ in run]))

    def _verify(self, changes: Sequence[tuple[Element, Number]], readings: Sequence[Reading]) -> None:
        runs, ledger = self.runs(changes), self.journal.ledger
        found = {reading.element.full_name: reading.value for reading in readings}
        for run in runs:
            (step,) = self.plan(run)
            off = [element.full_name for element, value in run if found[element.full_name] != value]
            for name in off:
                if found[name] is not None:
                    ledger.doubt(f"{name} reads {found[name]}", step)
            if not off:
                ledger.confirm("read back", step)
        self.check_read_back(
            [change for run in runs for change in run],
            readings,
            f"check with `handctl {self.kind} get` before you write again: the device did not take the value, or changed it afterwards",
        )

    # -- tables --------------------------------------------------------------------------------------------------

    def partial(self, failed: Sequence[Reading]) -> HandctlError | None:
        """How many quantities, which, and why."""
        first, names = failed[0].error, dict.fromkeys(reading.element.param.name for reading in failed)
        assert first is not None
        text = f"{len(names)} {'quantity' if len(names) == 1 else 'quantities'} could not be read ({', '.join(names)}): {first.text}"
        return first.retold(f"{self.bus.where}: {text}")

    def dump(self) -> Table:
        """Everything documented, in the fewest reads, with the raw blocks (exo §2.3, wrist §2.1)."""
        return self._with_blocks(super().dump())

    def _with_blocks(self, table: Table) -> Table:
        """The table with the blocks that were read for it."""
        table.extra = {"blocks": [{"address": start, "raw": hex_bytes(data)} for start, data in self.last_blocks]}
        return table


def _reading(element: Element, memory: Memory) -> Reading:
    register = register_of(element)
    data = memory.bytes_at(register.address_of(element.index), register.size)
    if data is None:
        error = memory.errors.get(register.name) or NoAnswer(f"{register.name} was not read")
        return Reading(element, None, b"", error)
    return Reading(element, register.decode(data), data)


def _names(run: Sequence[tuple[Element, Number]]) -> str:
    return ", ".join(element.full_name for element, _ in run)


def encoded(run: Sequence[tuple[Element, Number]]) -> tuple[int, bytes]:
    """Address and bytes of one run of adjacent elements."""
    first = run[0][0]
    data = b"".join(register_of(element).encode(value) for element, value in run)
    return register_of(first).address_of(first.index), data
