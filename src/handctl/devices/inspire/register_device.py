"""A device with registers: read, write and read back by name, over any wire. Knows no particular device.

Everything is checked against the map before a byte is sent; a write is sent once, and the read-back decides.

Many registers are read in few transactions: reads across undocumented gaps work on this family and halve a dump (dossier:
largest read 252 bytes); a device that stays silent to such a block is asked group by group instead.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from types import MappingProxyType
from typing import TypeVar

from handctl.devices.inspire.duplicate_id import refuse_duplicate_id
from handctl.devices.inspire.eb90 import MAX_COUNT
from handctl.devices.inspire.identity import at_work, within
from handctl.devices.inspire.register_bus import FLOOD, RegisterBus, Span
from handctl.devices.inspire.register_map import BAUD_RATES, Register, register_of
from handctl.errors import (
    Aftermath,
    CheckFailed,
    DeviceRefused,
    HandctlError,
    Hint,
    NoAnswer,
    NotPresent,
    ProtocolError,
    UsageError,
)
from handctl.fast_classes import NamedTuple
from handctl.link import CanFrame
from handctl.model.device import Device
from handctl.model.movement import (
    ASTRAY,
    BLOCKED,
    CONTACT,
    REACHED,
    Arrival,
    AxisReading,
    Goal,
    Stillness,
    Watch,
    by_whom,
    failure_of_arrivals,
    marked,
    watch,
    with_arrival,
)
from handctl.model.param import Element, Number, ParamMap, Reading, Step
from handctl.model.prompts import Prompts
from handctl.model.result import Column, Finding, Journal, Row, Table, hex_bytes
from handctl.model.stop_on_interrupt import interrupt_error, on_early_end
from handctl.model.stop_sequence import Stopped
from handctl.wording import plural

FAILS = (NoAnswer, ProtocolError, DeviceRefused)
"""What ends one read and leaves the others possible; Modbus refuses an address by an exception (rh56 §2.2)."""


class Block(NamedTuple):
    """One read: `size` bytes from `address`, which hold the register groups `groups`."""

    address: int
    size: int
    groups: tuple[Register, ...]


class Memory:
    """What was read: documented and gap bytes by address, and an error per group that could not be read."""

    def __init__(self) -> None:
        self.blocks: list[tuple[int, bytes]] = []
        self.errors: dict[str, HandctlError] = {}
        self.bytes_at = within(self.blocks)


@lru_cache(256)
def plan(registers: tuple[Register, ...], limit: int = MAX_COUNT) -> Sequence[Block]:
    """The fewest blocks of at most `limit` bytes that cover all `registers`, gaps included."""
    blocks: list[Block] = []
    for register in sorted(registers, key=lambda register: register.address):
        last = blocks[-1] if blocks else None
        if last is not None and register.span.stop - last.address <= limit:
            blocks[-1] = Block(last.address, register.span.stop - last.address, (*last.groups, register))
        else:
            blocks.append(Block(register.address, len(register.span), (register,)))
    return blocks


class BlockReader:
    """Reads registers through a bus in as few transactions as the device allows."""

    def __init__(self, bus: RegisterBus) -> None:
        self._bus = bus
        self._across_gaps = bus.across_gaps
        self._most = bus.max_count
        """Bytes of the longest group that may be answered: longer ones were not, but in parts."""
        self._absent: dict[str, NotPresent] = {}
        """Groups that this device lacks: asked for once."""
        self.in_doubt = False
        """Whether several groups are silent on CAN, as with a second device of this id: then their silence shows nothing."""

    def read(self, registers: Iterable[Register], memory: Memory | None = None) -> Memory:
        """Read `registers` into `memory`. Groups that fail are in its `errors`; raises when nothing at all could be read."""
        memory = Memory() if memory is None else memory
        first: HandctlError | None = None
        blocks = list(plan(tuple(registers), self._bus.max_count))
        if len(blocks) > 1:  # what a stranger would act upon is not asked first
            blocks.sort(key=lambda block: not self._bus.quiet(block.address, block.size))
        for block in blocks:
            try:
                if len(block.groups) > 1 and self._across_gaps and self._whole(block, memory):
                    continue
                for group in block.groups:
                    self._group(group, memory)
            except FAILS as exc:
                if (isinstance(exc, NoAnswer) or len(exc.came) > FLOOD) and not memory.blocks:
                    if first is not None:
                        raise first from exc  # what came before tells more than the silence behind it
                    if len(block.groups) == 1 < len(blocks) and self._anybody(block, memory):
                        blocks.append(block)  # behind the others, it shows whether it is this alone that is silent
                        continue
                    raise  # nobody there: asking for the rest would only take longer
                first = first or exc
                memory.errors.update((group.name, exc) for group in block.groups)
        if first is not None and not memory.blocks:
            raise first
        return memory

    def _whole(self, block: Block, memory: Memory) -> bool:
        """Read a block of several groups at once; False when the device must be asked group by group."""
        bus = self._bus
        try:
            # Twice silent means that this device does not answer across gaps, or not at all: the groups will tell.
            data = bus.read(block.address, block.size, retries=min(bus.retries, 1))
        except FAILS as exc:
            if not self._leaves_open(exc) or not (memory.blocks or self._anybody(block, memory)):
                raise
            self._across_gaps = False
            what = "no reply to a read of" if isinstance(exc, NoAnswer) else "the device refused a read of"
            bus.journal.warn(
                "block-silent",
                f"{what} {block.size} bytes at {block.address}. Reading the documented groups one by one instead",
            )
            return False
        memory.blocks.append((block.address, data))
        return True

    def _anybody(self, block: Block, memory: Memory) -> bool:
        """Whether the first group of a block that was not answered is, or else a question in another place."""
        first, bus = block.groups[0], self._bus
        other = next(
            (span for span in reversed(bus.first_questions) if span[0] not in first.span and bus.quiet(*span)), None
        )
        for span, retries in (((first.address, len(first.span)), min(bus.retries, 1)), (other, 0)):
            try:
                if span is not None:
                    memory.blocks.append((span[0], bus.read(*span, retries=retries)))
                    return True
            except FAILS as exc:
                if not self._leaves_open(exc):
                    break
        return False

    def _group(self, group: Register, memory: Memory) -> None:
        """One group, by its elements where the device answers shorter reads only. Raises what it does not answer as long as nothing was read."""
        span, failed = (group.address, len(group.span)), None
        if memory.blocks and memory.bytes_at(*span) is not None:
            return
        if group.name in self._absent:
            memory.errors[group.name] = self._absent[group.name]
            return
        if span[1] <= self._most or group.count == 1:
            try:
                memory.blocks.append((span[0], self._bus.read(*span)))
                return
            except FAILS as exc:
                if not memory.blocks:
                    raise
                failed = exc
                if not self._leaves_open(exc):
                    memory.errors[group.name] = exc
                    return
        for index in range(group.count) if group.count > 1 else ():
            span = group.address_of(index), group.size
            try:
                memory.blocks.append((span[0], self._bus.read(*span, retries=None if failed is None else 0)))
            except FAILS as exc:
                failed = exc
                break
            if failed is not None:
                self._bus.journal.warn(
                    "block-silent",
                    f"no reply to {plural(len(group.span), 'byte')} at {group.address}: handctl reads its elements one by one",
                )
                self._most, failed = min(self._most, len(group.span) - 1), None
        if failed is not None:
            # A group of which some elements were read is on this firmware, whatever the others do.
            whole = span[0] == group.address
            if whole and memory.blocks and self._lacks(span, memory, failed, len(group.span)):
                failed = self._absent[group.name] = NotPresent.shown_by(failed)
            if not memory.blocks:
                raise failed
            memory.errors[group.name] = failed

    def _lacks(self, span: Span, memory: Memory, failed: HandctlError, whole: int) -> bool:
        """Whether the device refuses, or is silent to, this alone: what it answered before it answers again, and not this, twice."""
        bus = self._bus
        if bus.wire == "can" and whole == 1:
            return False  # two bytes are asked for there, and the other one need not exist
        if isinstance(failed, DeviceRefused) and not at_work(failed):
            return True
        if bus.wire == "can" and self._absent:
            self.in_doubt = True
            return False
        address, data = min(memory.blocks, key=lambda block: len(block[1]))
        for _ in range(2):
            try:
                bus.read(address, len(data), retries=0)
            except FAILS:
                return False
            try:
                bus.read(*span, retries=0)
            except FAILS as exc:
                if not self._leaves_open(exc) or bus.over:
                    return False
            else:
                return False
        return True

    def _leaves_open(self, exc: HandctlError) -> bool:
        """Whether this may come of a read that is too long, or of a register that is not there: silence, a refusal, fewer bytes."""
        return isinstance(exc, NoAnswer | DeviceRefused) or exc.code == self._bus.fewer


# -- one device -------------------------------------------------------------------------------------------------------

T = TypeVar("T")


BEGINS = 1.8
"""Seconds at rest that end a movement short of its target where nothing explains it. No manual says how late a movement may
begin, or how long it may pause; this is twice the 0.8 s of a whole stroke (RH56 §2.4.8), and some."""


class Movement(NamedTuple):
    """What is watched of a movement.

    elements  are read again and again, `seen` tells what each goal shows in them
    errors    have the error bits. They are read before it, and at its end: each time where `elements` has them, else once
    currents  are read before it, and at its end where a goal was missed and nothing else tells why
    targets   tell where it is commanded to
    what      moves, in words
    pause     seconds before the first look
    goals_of  the goals that an element tells about
    fault     the error bits of an element in words
    """

    goals: Sequence[Goal]
    still: Stillness
    elements: Sequence[Element]
    seen: Callable[[Sequence[Reading]], dict[str, AxisReading]]
    errors: Sequence[Element]
    currents: Sequence[Element]
    targets: Sequence[Element]
    what: str = "The fingers"
    pause: float = 0.0
    goals_of: Callable[[Element], Sequence[str]] = lambda element: (element.part or "",)
    fault: Callable[[Element, Number], str] = lambda element, bits: element.param.label(bits) or ""

    def drawn(self, goal: str, readings: Sequence[Reading]) -> tuple[Number, ...]:
        """The currents of the actuators of a goal."""
        return tuple(
            one.value or 0 for one in readings if one.element in self.currents and goal in self.goals_of(one.element)
        )

    def faults(
        self, goal: str, readings: Sequence[Reading], known: Mapping[Element, Number], short: Collection[str] = ()
    ) -> str:
        """The error bits that speak against a goal in words, without those that are `known`; "" = none.

        Those of an actuator that may move several goals speak against the ones that are `short`, else against each.
        """
        found = []
        for one in readings:
            bits = int(one.value or 0) & ~int(known.get(one.element, 0))
            goals = self.goals_of(one.element)
            if bits and one.element in self.errors and goal in ([name for name in goals if name in short] or goals):
                found.append(self.fault(one.element, bits))
        return ", ".join(found)


class RegisterDevice(Device):
    """Base of the family's devices. A subclass names its kind, its map, its supply, what is live, and how people see it."""

    map: ParamMap[Register]
    supply = "7 to 9 V, 5 A peak"
    save_result = "the result is not documented for this hand"
    """Why the result of a save may stay out."""
    speed_source = "exo §2.3.2"
    no_value = MappingProxyType({"raw": None})
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
        if bus.gate is not None and bus.gate.assumed:
            self.product = ""  # nobody has looked
        self._reader = BlockReader(bus)
        self.last_blocks: list[tuple[int, bytes]] = []
        self._moving = False
        """Whether this command has set something going: a stop is for that, whichever write it meets."""

    def again(self, journal: Journal) -> bool:
        self.about = {}
        return (self.bus.gate is None or not self.bus.gate.passed) and self.bus.again(journal)

    def identity(self) -> dict[str, object]:
        """The identity of this device. The manuals document no serial number, model or firmware register."""
        return {"kind": self.kind, "id": self.bus.id}

    def identify(self) -> None:
        self.bus.identify()

    def know(self) -> None:
        """Find out which of several kinds of device it is; where a family has one there is nothing to ask."""

    def answered(self, ask: Callable[[], T]) -> T:
        """What `ask` returns; a family with a second wire asks there what the first does not answer."""
        return ask()

    def confirm_identity(self, *, keeps: bool = True) -> None:
        """Identify the device more closely before asking the user; `keeps`: before a permanent write. Raises as `identify` does."""

    def ready_to_ask(self) -> None:
        self.bus.ready_to_ask()

    def will_move(self) -> None:
        super().will_move()
        self._moving = True

    def admit(self, data: bytes, can_id: int | None) -> None:
        self.bus.pass_gate(data if can_id is None else CanFrame(can_id, data))

    # -- reading -------------------------------------------------------------------------------------------------

    def lacks(self, error: HandctlError) -> bool:
        """See Device."""
        return super().lacks(error) and not self._reader.in_doubt

    def read(self, elements: Sequence[Element]) -> list[Reading]:
        registers: dict[str, Register] = {one.param.name: one.param for one in elements}  # type: ignore[misc]
        memory, gate = Memory(), self.bus.gate
        try:
            self._reader.read(registers.values(), memory)
        except (HandctlError, KeyboardInterrupt) as exc:
            if memory.blocks:
                self.journal.keep(self.table([_reading(element, memory) for element in elements]))
            if gate is not None and isinstance(exc, NoAnswer | ProtocolError):
                gate.unheard(self.bus, exc)
            raise
        self.last_blocks = sorted(memory.blocks)
        if gate is not None:
            gate.read(self.bus, self.last_blocks)
        return [_reading(element, memory) for element in elements]

    def element_keys(self, element: Element) -> Row:
        register: Register = element.param  # type: ignore[assignment]
        return {
            "name": register.name,
            "finger": element.part,
            "address": register.address_of(element.index) // register.per,
        }

    def value_keys(self, reading: Reading) -> Row:
        register = reading.element.param
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
        return grouped(changes, lambda last, one: last.param.name == one.param.name and last.index + 1 == one.index)

    def write(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]:
        """Write checked changes one frame at a time and read all of them back.

        A write without an answer is not repeated: the read-back decides. Raises DeviceRefused when a write is
        refused; CheckFailed when the read-back differs, which it says with both values; Interrupted on Ctrl-C, after
        what moves was stopped.
        """
        if any(element.param.strands for element, _ in changes):
            refuse_duplicate_id(self)
        with self.stopped_by_ctrl_c(
            ", ".join(element.full_name for element, _ in changes), any(element.param.moves for element, _ in changes)
        ):
            return self._written(changes)

    @contextmanager
    def stopped_by_ctrl_c(self, what: str, moving: bool) -> Iterator[None]:
        """Ctrl-C while `what` is written stops what that, or a write before, set going. Raises Interrupted."""
        self._moving = bool(moving) or self._moving
        before, unsure = self.journal.counters.writes, f"it is not known whether {what} was written"
        look = Hint("check with {}", f"{self.kind} get")
        left = Aftermath(f"{unsure}, and the device may move" if self._moving else unsure, look, joint=". ")
        if self._moving:
            self.journal.moves(self.stop)
        try:
            with on_early_end(left, since=self.journal.counters, interrupt=False):
                yield
        except (CheckFailed, NoAnswer, ProtocolError) as exc:
            if self.journal.counters.writes > before:
                self.tell_moving(exc)
            raise
        except KeyboardInterrupt as exc:
            if self.journal.counters.writes == before:
                raise
            raise interrupt_error(self.stop() if self._moving else Stopped(unsure, look)) from exc

    def tell_moving(self, error: HandctlError) -> None:
        """Add to the error of a write that may have set something going, and whose read-back failed, how to stop that."""
        if self._moving and error.code != "deadline" and not error.left.moving:
            text = "the device may be moving, perhaps to another target"
            error.add_aftermath(Aftermath(text, Hint("stop it with {}", f"{self.kind} stop"), joint=". ", moving=True))

    def _written(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]:
        written: list[str] = []
        runs = self.runs(changes)
        for number, run in enumerate(runs, 1):
            try:
                self._write_run(run, last=number == len(runs))
            except HandctlError as exc:
                if written:
                    exc.add_aftermath(Aftermath(hint=f"already written: {', '.join(written)}", joint=". "))
                raise
            written.append(_names(run))
        return self.verify(changes)

    def _write_run(self, run: Sequence[tuple[Element, Number]], *, last: bool) -> None:
        """One frame. Where its acknowledgement is lost, nothing follows it before it reads back.

        A refusal is believed once the device does not hold the value: what its reply means is not documented (exo §2.2.4).
        """
        before = self.journal.counters.writes
        try:
            lost = self.bus.try_write(*encoded(run), f"the write of {_names(run)}", "handctl reads it back")
        except DeviceRefused as exc:
            held = False
            if self.journal.counters.writes > before:
                with suppress(HandctlError):
                    held = bool(self.verify(run))
            if not held:
                raise
            text = f"{exc.text}. But {_names(run)} reads what was written, now or already before"
            hint = Hint("look with {}: the reply and the value contradict each other", f"{self.kind} status")
            raise ProtocolError(text, hint=hint, code="taken") from exc
        if lost is not None and not last:
            self.verify(run)

    def verify(self, changes: Sequence[tuple[Element, Number]]) -> list[Reading]:
        """Read back what was written. Raises CheckFailed where the device holds something else."""
        wanted = [value for _, value in changes]
        readings = self.bus.read_back(
            lambda: self.read([element for element, _ in changes]),
            lambda found: [reading.value for reading in found] == wanted,
        )
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
        return readings

    def trigger_step(self, name: str, meaning: str) -> Step:
        """The frame that writes 1 to a trigger register."""
        register = self.map[name]
        meaning = f"{meaning} (write 1 to address {register.place})"
        step = self.bus.write_step(register.address, register.encode(1), meaning)
        return step._replace(moves=register.moves, strands=register.strands)

    # -- moving --------------------------------------------------------------------------------------------------

    def moved(
        self, this: Movement, start: Callable[[], object], prompts: Prompts, *, wait: float, expect: str
    ) -> tuple[Table, list[Arrival]]:
        """Start a movement and watch until it has ended or `wait` seconds have passed. Ctrl-C, an error and the death of this process stop it.

        Rows have the target and what became of it; what was not as expected is the table's failure.
        """
        self.identify()
        last: list[Reading] = []
        at_rest = self.read([*this.elements, *this.errors, *this.currents])
        known = {one.element: one.value for one in at_rest if one.element in this.errors and one.value is not None}
        """Error bits that were set before, which do not speak against a target that is reached."""
        before = {
            name: one._replace(currents=this.drawn(name, at_rest))
            for name, one in this.seen(at_rest[: len(this.elements)]).items()
        }

        def look() -> dict[str, AxisReading]:
            last[:] = self.read(this.elements)
            return {
                name: one._replace(blocked=this.faults(name, last, known) or one.blocked)
                for name, one in this.seen(last).items()
            }

        with self.driven(prompts, who=this.what):
            start()
            clock = self.bus.clock(wait, this.still.refresh)
            self.bus.pause(this.pause)
            seen = watch(this.goals, this.still, look, prompts, clock, before)
            at_end, short = [*last, *self._evidence(this, known, seen)], seen.short
            told = {one.element for one in at_end if one.value is not None}
            if unread := dict.fromkeys(one.param.name for one in this.errors if one not in told):
                text = f"the error bits ({', '.join(unread)}) could not be read, so it is not known whether the device has a fault"
                self.journal.warn("errors-unread", f"{self.bus.where}: {text}")
            deeper = {
                name: AxisReading(
                    None,
                    blocked=this.faults(name, at_end, {} if name in short else known, short),
                    currents=this.drawn(name, at_end),
                )
                for name in before
            }
            arrivals = seen.arrivals(deeper)
            if any(one.verdict == ASTRAY for one in arrivals):
                sent = self._commanded(this)
                arrivals = [by_whom(one, sent.get(one.goal.name)) if one.verdict == ASTRAY else one for one in arrivals]
        at = {one.goal.name: one for one in arrivals}
        rows = [
            marked(self.row(reading), next((at[name] for name in this.goals_of(reading.element) if name in at), None))
            for reading in last
            if reading.value != 0 or not reading.element.param.alarms
        ]
        failure = failure_of_arrivals(
            self.bus.where,
            arrivals,
            expect,
            hint=Hint("check with {}", f"{self.kind} status"),
            blocked=self._step_of_faults([one.why for one in arrivals if one.verdict == BLOCKED]),
        )
        return Table(rows=rows, columns=with_arrival(self.columns), failure=failure), arrivals

    def _evidence(self, this: Movement, known: Collection[Element], seen: Watch) -> list[Reading]:
        """What is read of a movement once more at its end: error bits that were not read all the time, and the currents where
        nothing so far tells why a goal was missed."""
        elements = [element for element in known if element not in this.elements]
        if any(one.verdict not in (REACHED, BLOCKED, CONTACT) for one in seen.arrivals()):
            elements += this.currents
        return self.read(elements) if elements else []

    def _commanded(self, this: Movement) -> dict[str, Number | None]:
        """Where the device says that each goal is commanded to; {} where it does not answer that."""
        try:
            told = self.read(this.targets)
            return {name: reading.value for reading in told for name in this.goals_of(reading.element)}
        except (NoAnswer, ProtocolError):
            return {}

    def _step_of_faults(self, faults: Sequence[str]) -> str:
        """What to do about faults that ended a movement; "" for none."""
        if not faults:
            return ""
        from handctl.model.device_picture import hint_of, remedies_of

        return hint_of(
            self.kind, [Finding(why, tuple(k for k in remedies_of(self.kind) if k in why)) for why in faults]
        )

    # -- where it is found ---------------------------------------------------------------------------------------

    def change_id(self, new: int) -> Table:
        """Give it another id, at once. See `id_baud_save_reset`."""
        from handctl.devices.inspire.id_baud_save_reset import change_id

        return change_id(self, new)

    def speeds(self) -> Mapping[int, int]:
        """Code -> bit/s on its wire."""
        return BAUD_RATES

    def speed_code(self, rate: int) -> int:
        """The code of a speed in bit/s. Raises UsageError for one that no such hand has on this wire."""
        known = self.speeds()
        if (code := next((code for code, value in known.items() if value == rate), None)) is not None:
            return code
        raise UsageError(
            f"{rate} bit/s is not a baud rate of this hand",
            hint=f"choose one of {', '.join(map(str, known.values()))} bit/s ({self.speed_source}). Nothing was sent.",
        )

    def show_speed(self) -> Table:
        """The speed code."""
        table = self.table(self.read([Element(self.map["baud_code"], 0)]))
        table.plain = ("value",)
        return table

    def change_speed(self, rate: int) -> Table:
        """Write the speed that counts after a save and a power cycle. See `id_baud_save_reset`."""
        from handctl.devices.inspire.id_baud_save_reset import change_baud

        return change_baud(self, rate)

    def not_at(self, rate: int) -> HandctlError:
        """The error of a hand that does not answer at a speed that it was given."""
        return CheckFailed(
            f"{self.bus.link.name}: no hand at {rate} bit/s after the power-cycle",
            hint=Hint(
                "one edition of the manual says that this baud rate is not kept. {} tries all ids and baud rates",
                "hand scan",
            ),
            code="not-kept",
        )

    # -- tables --------------------------------------------------------------------------------------------------

    def partial(self, failed: Sequence[Reading]) -> HandctlError | None:
        """How many quantities, which, and why."""
        first, names = failed[0].error, dict.fromkeys(reading.element.param.name for reading in failed)
        assert first is not None
        text = f"{len(names)} {'quantity' if len(names) == 1 else 'quantities'} could not be read ({', '.join(names)}): {first.text}"
        return first.reworded(f"{self.bus.where}: {text}")

    def dump(self) -> Table:
        """Everything documented, in the fewest reads, with the raw blocks (exo §2.3, wrist §2.1)."""
        return self._with_blocks(super().dump())

    def _with_blocks(self, table: Table) -> Table:
        """The table with the blocks that were read for it."""
        table.extra = {"blocks": [{"address": start, "raw": hex_bytes(data)} for start, data in self.last_blocks]}
        return table


def _reading(element: Element, memory: Memory) -> Reading:
    register: Register = element.param  # type: ignore[assignment]
    data = memory.bytes_at(register.address_of(element.index), register.size)
    if data is None:
        error = memory.errors.get(register.name) or NoAnswer(f"{register.name} was not read")
        return Reading(element, None, b"", error)
    return Reading(element, register.decode(data), data)


def error_finding(reading: Reading, degrees: Number | None, more: str = "") -> Finding:
    """The error bits of an actuator, with `more` behind; of an over-temperature with the `degrees` that it has now."""
    label = reading.element.param.label(reading.value or 0) or ""
    text = f"{reading.element.part}: {label} (0x{int(reading.value or 0):02X})"
    if "over_temperature" in label:
        text += f". over_temperature goes away as it cools, now {degrees} °C"
    return Finding(text + more, tuple(label.split(", ")))


def grouped(
    changes: Sequence[tuple[Element, Number]], together: Callable[[Element, Element], bool]
) -> list[list[tuple[Element, Number]]]:
    """Changes in their order; one that goes `together` with the one before it is in its group."""
    groups: list[list[tuple[Element, Number]]] = []
    for change in changes:
        if groups and together(groups[-1][-1][0], change[0]):
            groups[-1].append(change)
        else:
            groups.append([change])
    return groups


def _names(run: Sequence[tuple[Element, Number]]) -> str:
    return ", ".join(element.full_name for element, _ in run)


def encoded(run: Sequence[tuple[Element, Number]]) -> tuple[int, bytes]:
    """Address and bytes of one run of adjacent elements."""
    first = run[0][0]
    data = b"".join(register_of(element).encode(value) for element, value in run)
    return register_of(first).address_of(first.index), data
