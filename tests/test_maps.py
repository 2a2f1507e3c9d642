"""Every map is sane, and says the same as the memory of its simulator, which was transcribed from the manual by itself.

The simulator is asked through bytes only; the frames are put together by hand here.
"""

from __future__ import annotations

import re

import pytest

from handctl.devices.inspire import registers as books
from handctl.devices.inspire.registers import EXO, Register
from handctl.param import ParamMap
from handctl.sim import KINDS, create

MAPS: list[ParamMap[Register]] = [book for book in vars(books).values() if isinstance(book, ParamMap)]
SOURCE = r"(exo §2\.[23]|wrist §[12]|RH56 §2)(\.\d+)*\b"
AROUND = range(990, 1640)


def sum_of(body: bytes) -> int:
    total = 0
    for byte in body:
        total = (total + byte) & 0xFF
    return total


class Memory:
    """The memory of a simulated exo, one register frame at a time."""

    def __init__(self, **options: str) -> None:
        self.line = create("exo", options)
        self.now = 0.0
        self.line.advance(0.0)
        self.id = int(options.get("id", "1"))

    def ask(self, flag: int, address: int, data: bytes) -> bytes | None:
        """The bytes behind the address of the reply, None for silence."""
        body = bytes([self.id, len(data) + 3, flag, address & 0xFF, address >> 8]) + data
        self.line.feed(b"\xeb\x90" + body + bytes([sum_of(body)]))
        reply = self.line.take()
        if not reply:
            return None
        assert reply[:2] == b"\x90\xeb"
        assert reply[3] == len(reply) - 5
        assert sum_of(reply[2:-1]) == reply[-1]
        return reply[7:-1]

    def read(self, address: int, count: int) -> bytes | None:
        return self.ask(0x11, address, bytes([count]))

    def write(self, address: int, data: bytes) -> bytes | None:
        return self.ask(0x12, address, data)


def named(registers: list[Register]) -> list[object]:
    return [pytest.param(register, id=register.name) for register in registers]


# -- sanity -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("book", MAPS, ids=lambda book: book.kind)
def test_names_and_texts(book: ParamMap[Register]) -> None:
    for param in book:
        assert re.fullmatch(r"[a-z][a-z0-9_]*", param.name), param.name
        assert param.doc, param.name
        assert not param.doc.endswith("."), param.name
        assert re.search(SOURCE, param.source), f"{param.name}: {param.source}"
        assert len(set(param.elements)) == len(param.elements), param.name
        assert "." not in "".join(param.elements), param.name
        assert param.access in ("r", "rw", "w"), param.name
        assert param.persistent in ("yes", "no", "unknown"), param.name
        assert bool(param.verb) == param.trigger, param.name
        assert param.trigger or not param.moves or param.writable, param.name


@pytest.mark.parametrize("book", MAPS, ids=lambda book: book.kind)
def test_no_two_registers_share_a_byte(book: ParamMap[Register]) -> None:
    taken: dict[int, str] = {}
    for register in book:
        for address in register.span:
            assert address not in taken, f"{register.name} and {taken[address]} at {address}"
            taken[address] = register.name
        assert register.size in (1, 2)
        assert len(register.span) == register.size * register.count
        assert register.span.stop <= 0x10000
        assert [register.address_of(index) for index in range(register.count)] == list(register.span)[:: register.size]


@pytest.mark.parametrize("book", MAPS, ids=lambda book: book.kind)
def test_ranges_fit_the_bytes(book: ParamMap[Register]) -> None:
    for register in book:
        bits = 8 * register.size
        least, most = (-(1 << bits - 1), (1 << bits - 1) - 1) if register.signed else (0, (1 << bits) - 1)
        assert (register.low is None) == (register.high is None), register.name
        stated = [value for value in (register.low, register.high) if value is not None]
        assert stated == sorted(stated), register.name
        for value in [*stated, *register.special, *register.choices]:
            assert least <= register.to_raw(value) <= most, f"{register.name}: {value}"
            assert register.allowed(value), f"{register.name}: {value}"
            assert register.decode(register.encode(value)) == value, f"{register.name}: {value}"
        assert len(register.bits) <= bits
        if register.writable:
            assert register.choices or stated, f"{register.name} can be set to anything"


def test_every_map_has_a_simulator() -> None:
    assert EXO in MAPS
    assert {book.kind for book in MAPS} <= {*KINDS, "hand"}


# -- the two books of exo ---------------------------------------------------------------------------------------------


def test_both_books_document_the_same_bytes() -> None:
    """A hand that is silent to undocumented bytes answers exactly to those of the map."""
    memory = Memory(fault="block-silent")
    answered = {address for address in AROUND if memory.read(address, 1) is not None}
    assert answered == {address for register in EXO for address in register.span}


@pytest.mark.parametrize("register", named(list(EXO)))
def test_both_books_have_the_same_extent(register: Register) -> None:
    memory = Memory(fault="block-silent")
    data = memory.read(register.address, len(register.span))
    assert data is not None
    assert len(data) == len(register.span)
    documented = {address for other in EXO for address in other.span}
    before, behind = register.address - 1, register.span.stop
    assert (memory.read(before, len(register.span) + 1) is not None) == (before in documented)
    assert (memory.read(register.address, len(register.span) + 1) is not None) == (behind in documented)


def test_power_on_values_are_all_different() -> None:
    """So that a swap of two registers or two fingers shows. Errors and triggers are 0 at rest."""
    memory = Memory(fault="faults")
    seen: dict[object, str] = {}
    for register in EXO:
        data = memory.read(register.address, len(register.span))
        assert data is not None
        for index in range(register.count):
            value = register.decode(data[index * register.size : (index + 1) * register.size])
            full_name = f"{register.name}[{index}]"
            if register.name in ("error", "temperature", "id", "baud_code") or register.trigger:
                continue  # errors heat fingers; the others are 0 or 1 by the manual
            assert value not in seen, f"{full_name} and {seen[value]} are both {value}"
            seen[value] = full_name
    assert len(seen) == 1 + 5 + 5 + 6 + 5 + 5


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("id", [1]), ("baud_code", [0]), ("system_voltage", [558]), ("position_set", [151, 252, 353, 454, 555]),
        ("force_set", [-61, 62, -63, 64, -65]), ("position_actual", [110, 220, 330, 440, 550, 660]),
        ("force_actual", [-11, 12, -13, 14, -15]), ("current", [21, 22, 23, 24, 25]), ("error", [0, 0, 0, 0, 0]),
        ("temperature", [31, 32, 33, 34, 35]),
    ],
)  # fmt: skip
def test_power_on_values(name: str, values: list[int]) -> None:
    register = EXO[name]
    data = Memory().read(register.address, len(register.span))
    assert data is not None
    size = register.size
    assert [register.decode(data[start : start + size]) for start in range(0, len(data), size)] == values


@pytest.mark.parametrize("register", named([register for register in EXO if register.name != "id"]))
def test_both_books_allow_the_same_writes(register: Register) -> None:
    """A strict hand is silent to what cannot be written or is out of range. (Writing the id is tested by itself.)"""
    bits = 8 * register.size
    least, most = (-(1 << bits - 1), (1 << bits - 1) - 1) if register.signed else (0, (1 << bits) - 1)
    edges = {value for value in (register.low, register.high) if value is not None}
    edges |= set(register.special) | set(register.choices)
    tried = sorted({int(edge) + step for edge in edges | {least, most} for step in (-1, 0, 1)})
    for index in range(register.count):
        for value in (value for value in tried if least <= value <= most):
            memory = Memory(fault="strict")
            raw = value.to_bytes(register.size, "little", signed=register.signed)
            acked = memory.write(register.address_of(index), raw) == b"\x01"
            assert acked == ("w" in register.access and register.allowed(value)), f"{register.name}[{index}] = {value}"
            if acked and not register.trigger:
                assert memory.read(register.address_of(index), register.size) == raw


def test_both_books_have_the_same_ids() -> None:
    for value in (0, 1, 2, 253, 254, 255):
        memory = Memory(fault="strict")
        assert (memory.write(1000, bytes([value])) == b"\x01") == EXO["id"].allowed(value)


def test_gaps_cannot_be_written() -> None:
    """Nothing but the map's registers takes a byte."""
    documented = {address for register in EXO for address in register.span}
    memory = Memory(fault="strict")
    for address in AROUND:
        if address not in documented:
            assert memory.write(address, b"\x01") is None, address
    assert Memory().write(1474, b"\x07") == b"\x01"
    memory = Memory()
    memory.write(1474, b"\x07")
    assert memory.read(1474, 1) == b"\x00"


@pytest.mark.parametrize("register", named([register for register in EXO if register.access == "r"]))
def test_read_only_registers_stay_as_they_are(register: Register) -> None:
    memory = Memory()
    before = memory.read(register.address, len(register.span))
    assert memory.write(register.address, bytes(len(register.span))) == b"\x01"
    assert memory.read(register.address, len(register.span)) == before


def test_triggers_hold_no_value() -> None:
    for register in EXO:
        if register.trigger:
            assert Memory().read(register.address, 1) == b"\x00", register.name
