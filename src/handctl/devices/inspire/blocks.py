"""Reading many registers in few transactions: plan the blocks, read them, fall back to single groups.

Reads across undocumented gaps work on this family and halve a dump (dossier: largest read 252 bytes); a device that
stays silent to such a block is asked group by group instead.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from handctl.devices.inspire.eb90 import MAX_COUNT
from handctl.devices.inspire.map import Register
from handctl.devices.inspire.registers import RegisterBus
from handctl.errors import DeviceRefused, HandctlError, NoAnswer, ProtocolError

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

    def bytes_at(self, address: int, count: int) -> bytes | None:
        """The bytes, or None if they were not read."""
        for start, data in self.blocks:
            if start <= address and address + count <= start + len(data):
                return data[address - start : address - start + count]
        return None


def plan(registers: Iterable[Register], limit: int = MAX_COUNT) -> list[Block]:
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
        self._across_gaps = True

    def read(self, registers: Iterable[Register], memory: Memory | None = None) -> Memory:
        """Read `registers` into `memory`. Groups that fail are in its `errors`; raises when nothing at all could be read."""
        memory = Memory() if memory is None else memory
        first: HandctlError | None = None
        blocks = plan(registers, self._bus.max_count)
        # What a stranger would act upon is not asked first.
        for block in sorted(blocks, key=lambda block: not self._bus.quiet(block.address, block.size)):
            try:
                if len(block.groups) > 1 and self._across_gaps and self._whole(block, memory):
                    continue
                self._groups(block, memory)
            except FAILS as exc:
                if isinstance(exc, NoAnswer) and not memory.blocks:
                    if first is not None:
                        raise first from exc  # what came before tells more than the silence behind it
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
        except (NoAnswer, DeviceRefused) as exc:
            if not memory.blocks:
                first = block.groups[0]
                try:
                    data = bus.read(first.address, len(first.span), retries=min(bus.retries, 1))
                except (NoAnswer, DeviceRefused):
                    raise exc from None
                memory.blocks.append((first.address, data))
            self._across_gaps = False
            what = "no answer to" if isinstance(exc, NoAnswer) else "the device refused"
            bus.journal.warn(
                "block-silent",
                f"{what} {block.size} bytes at {block.address}: handctl reads the documented groups one by one",
            )
            return False
        memory.blocks.append((block.address, data))
        return True

    def _groups(self, block: Block, memory: Memory) -> None:
        for group in block.groups:
            if memory.bytes_at(group.address, len(group.span)) is not None:
                continue
            try:
                memory.blocks.append((group.address, self._bus.read(group.address, len(group.span))))
            except FAILS as exc:
                if not memory.blocks:
                    raise
                memory.errors[group.name] = exc
