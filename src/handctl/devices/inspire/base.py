"""A device of registers: reading, writing and reading back by name, over either wire. Knows no particular device.

Everything is checked against the map before a byte is sent; a write is sent once, and the read-back decides.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager

from handctl.devices.inspire.blocks import BlockReader, Memory
from handctl.devices.inspire.map import Register, register_of
from handctl.devices.inspire.registers import RegisterBus, add
from handctl.errors import CheckFailed, HandctlError, Interrupted, LinkError, NoAnswer
from handctl.link import Link
from handctl.model.param import Element, Number, ParamMap, Reading, Step
from handctl.model.result import Column, Grid, Journal, Row, Table, hex_bytes


class RegisterDevice(ABC):
    """Base of the family's devices. A subclass names its kind, its map, what is live, and how people see it."""

    kind: str
    map: ParamMap[Register]
    live: tuple[str, ...]
    worn = False
    not_covered: tuple[str, ...] = ()
    columns: tuple[Column, ...] = (
        Column("name", "Name"),
        Column("finger", "Finger"),
        Column("address", "Address", right=True),
        Column("value", "Value", right=True),
        Column("unit", "Unit"),
        Column("label", "Meaning"),
        Column("raw", "Raw"),
    )

    def __init__(self, bus: RegisterBus) -> None:
        self.bus = bus
        self._reader = BlockReader(bus)
        self.last_blocks: list[tuple[int, bytes]] = []

    @property
    def link(self) -> Link:
        """Where it is, and its clock."""
        return self.bus.link

    @property
    def journal(self) -> Journal:
        """Where messages and counters go."""
        return self.bus.journal

    def identity(self) -> dict[str, object]:
        """What tells this device from another. The manuals document no serial number, model or firmware register."""
        return {"kind": self.kind, "id": self.bus.id}

    @staticmethod
    @abstractmethod
    def view(rows: list[Row]) -> list[Grid]:
        """How people see rows of registers."""

    def find_for_restore(self, values: dict[str, Number]) -> None:  # noqa: B027 - most have nothing to do
        """Make the bus address the device that a restore is for; nothing to do unless its id is a setting."""

    def identify(self) -> None:
        """Look who is there before anything is read for a plan: a stranger is named, not called silent. Raises NotIdentified."""
        self.bus.identify()

    # -- reading -------------------------------------------------------------------------------------------------

    def read(self, elements: Sequence[Element]) -> list[Reading]:
        """Read elements in the fewest transactions. An element that cannot be read carries its error.

        Raises NoAnswer, ProtocolError when nothing at all could be read, LinkError when the link is lost.
        """
        registers = {element.param.name: register_of(element) for element in elements}
        memory = Memory()
        try:
            self._reader.read(registers.values(), memory)
        except (HandctlError, KeyboardInterrupt):
            if memory.blocks:
                self.journal.leave(self.table([_reading(element, memory) for element in elements]))
            raise
        self.last_blocks = sorted(memory.blocks)
        return [_reading(element, memory) for element in elements]

    def row(self, reading: Reading) -> Row:
        """The data row of one reading (cli contract, row keys of exo and wrist)."""
        register = register_of(reading.element)
        row: Row = {
            "name": register.name,
            "finger": reading.element.part,
            "address": register.address_of(reading.element.index),
        }
        if reading.error is not None or reading.value is None:
            return {
                **row,
                "error": reading.error.text if reading.error is not None else "not read",
                "unit": register.unit,
                "raw": None,
            }
        label = register.label(reading.value)
        if register.note and (label is None or reading.value):
            label = f"{label} ({register.note})" if label else register.note
        return {**row, "value": reading.value, "unit": register.unit, "raw": hex_bytes(reading.raw), "label": label}

    # -- writing -------------------------------------------------------------------------------------------------

    def plan(self, changes: Sequence[tuple[Element, Number]]) -> list[Step]:
        """The frames that write checked `changes`: adjacent elements of one group share a frame; never across a gap."""
        steps = []
        for run in self.runs(changes):
            address, data = _encoded(run)
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
        with self.stopping(
            ", ".join(element.full_name for element, _ in changes),
            {element.param.name for element, _ in changes if element.param.moves},
        ):
            return self._written(changes)

    @contextmanager
    def stopping(self, what: str, moving: Collection[str]) -> Iterator[None]:
        """Ctrl-C while `what` is written stops the registers `moving` set going. Raises Interrupted."""
        before = self.journal.counters.writes
        try:
            yield
        except KeyboardInterrupt as exc:
            if self.journal.counters.writes == before:
                raise
            raise Interrupted(
                f"interrupted: {self.stop(moving) if moving else f'{what} may be written or not'}",
                hint=f"`handctl {self.kind} get` shows what it holds now",
            ) from exc
        except LinkError as exc:
            may_move = ", the device may move" if moving else ""
            if self.journal.counters.writes > before:
                add(exc, f"{what} may be written or not{may_move}", f"`handctl {self.kind} get` shows what it holds")
            raise

    @abstractmethod
    def stop(self, names: Collection[str]) -> str:
        """Stop what was set going by writing `names`, by the manual's means; returns in words what became of it."""

    def _written(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]:
        written: list[str] = []
        runs = self.runs(changes)
        for number, run in enumerate(runs, 1):
            try:
                self._write_run(run, last=number == len(runs))
            except HandctlError as exc:
                if written:
                    exc.hint = f"already written: {', '.join(written)}. {exc.hint}"
                raise
            written.append(_names(run))
        readings = self.read([element for element, _ in changes])
        self._verify(changes, readings)
        return readings

    def _write_run(self, run: Sequence[tuple[Element, Number]], *, last: bool) -> None:
        """One frame. Where its acknowledgement is lost, nothing follows it before it reads back."""
        lost = self.bus.try_write(*_encoded(run), f"the write of {_names(run)}", "reading it back")
        if lost is not None and not last:
            self._verify(run, self.read([element for element, _ in run]))

    def _verify(self, changes: Sequence[tuple[Element, Number]], readings: Sequence[Reading]) -> None:
        wrong, ledger = [], self.journal.ledger
        found = {reading.element.full_name: reading for reading in readings}
        for run in self.runs(changes):
            (step,) = self.plan(run)
            for element, value in run:
                reading = found[element.full_name]
                if reading.error is not None:
                    wrong.append(f"{element.full_name} could not be read back")
                elif reading.value != value:
                    wrong.append(f"{element.full_name} reads {reading.value} after {value} was written")
                    ledger.doubt(f"{element.full_name} reads {reading.value}", step)
            if all(found[element.full_name].value == value for element, value in run):
                ledger.confirm("read back", step)
        if wrong:
            raise CheckFailed(
                f"{self.bus.where}: {'; '.join(wrong)}",
                hint="the device did not take the value, or changed it: look with "
                f"`handctl {self.kind} get` before writing again",
                code="read-back",
            )

    def table(self, readings: Sequence[Reading], title: str = "") -> Table:
        """Readings as a Table; for people one line per register, fingers side by side."""
        return Table(
            rows=[self.row(reading) for reading in readings],
            columns=self.columns,
            title=title,
            view=self.view,
            failure=self._partial(readings),
        )

    def _partial(self, readings: Sequence[Reading]) -> HandctlError | None:
        failed = {reading.element.param.name: reading.error for reading in readings if reading.error is not None}
        if not failed:
            return None
        first = next(iter(failed.values()))
        return first.retold(
            f"{self.bus.where}: {len(failed)} of the quantities could not be read: {', '.join(failed)}; {first.text}"
        )


def _reading(element: Element, memory: Memory) -> Reading:
    register = register_of(element)
    data = memory.bytes_at(register.address_of(element.index), register.size)
    if data is None:
        error = memory.errors.get(register.name) or NoAnswer(f"{register.name} was not read")
        return Reading(element, None, b"", error)
    return Reading(element, register.decode(data), data)


def _names(run: Sequence[tuple[Element, Number]]) -> str:
    return ", ".join(element.full_name for element, _ in run)


def _encoded(run: Sequence[tuple[Element, Number]]) -> tuple[int, bytes]:
    """Address and bytes of one run of adjacent elements."""
    first = run[0][0]
    data = b"".join(register_of(element).encode(value) for element, value in run)
    return register_of(first).address_of(first.index), data
