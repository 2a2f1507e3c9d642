"""Every map is sane, and says the same as the memory of its simulator, which was transcribed from the manual by itself.

The simulator is asked through bytes only; the frames are put together by hand here.
"""

from __future__ import annotations

import re

import pytest

from handctl.devices.inspire.exo.register_map import EXO
from handctl.devices.inspire.register_map import Register
from handctl.devices.inspire.wrist.register_map import WRIST
from handctl.model.param import ParamMap
from handctl.sim import create, kinds
from tests.support.each_row import each_row

MAPS: list[ParamMap[Register]] = [EXO, WRIST]
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


@each_row("book", MAPS, ids=lambda book: book.kind)
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


@each_row("book", MAPS, ids=lambda book: book.kind)
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


@each_row("book", MAPS, ids=lambda book: book.kind)
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
    assert {book.kind for book in MAPS} <= {*kinds(), "hand"}


# -- the two books of exo ---------------------------------------------------------------------------------------------


def test_both_books_document_the_same_bytes() -> None:
    """A hand that is silent to undocumented bytes answers exactly to those of the map."""
    memory = Memory(fault="block-silent")
    answered = {address for address in AROUND if memory.read(address, 1) is not None}
    assert answered == {address for register in EXO for address in register.span}


@each_row("register", named(list(EXO)))
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


@each_row(
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


@each_row("register", named([register for register in EXO if register.name != "id"]))
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


@each_row("register", named([register for register in EXO if register.access == "r"]))
def test_read_only_registers_stay_as_they_are(register: Register) -> None:
    memory = Memory()
    before = memory.read(register.address, len(register.span))
    assert memory.write(register.address, bytes(len(register.span))) == b"\x01"
    assert memory.read(register.address, len(register.span)) == before


def test_triggers_hold_no_value() -> None:
    for register in EXO:
        if register.trigger:
            assert Memory().read(register.address, 1) == b"\x00", register.name


# -- the two books of the wrist, on both wires ------------------------------------------------------------------------

AROUND_WRIST = range(1000, 1060)
WRIST_POWER_ON = {
    "pitch_actual": -345, "yaw_actual": 1125, "current_1024": 111, "current_1026": 222, "error_1": 0, "error_2": 0,
    "temperature_1": 31, "temperature_2": 34, "yaw_set": 1100, "pitch_set": -300, "move_time": 700,
}  # fmt: skip


class WristMemory:
    """The registers of a simulated wrist, or with `hand` those of the hand that carries it, on either wire."""

    def __init__(self, wire: str, hand: bool = False, **options: str) -> None:
        self.can, self.hand = wire == "can", hand
        self.line = create("wrist", {**options, **({"bus": "can"} if self.can else {})})
        self.line.advance(0.0)

    def ask(self, writes: bool, address: int, data: bytes) -> bytes | None:
        """What the reply carries, None for silence."""
        if self.can:
            identifier = (writes + 4 * (not self.hand)) << 26 | address << 14 | 1
            self.line.feed_frame(identifier, data)
            answers = self.line.take_frames()
            assert all(found == identifier for found, _ in answers)
            return bytes(answers[0][1]) if answers else None
        body = bytes([1, len(data) + 3, (0x11 if self.hand else 0x30) + writes]) + address.to_bytes(2, "little") + data
        self.line.feed(b"\xeb\x90" + body + bytes([sum_of(body)]))
        reply = self.line.take()
        assert not reply or (reply[:2] == b"\x90\xeb" and sum_of(reply[2:-1]) == reply[-1])
        return reply[7:-1] if reply else None

    def read(self, address: int, count: int) -> bytes | None:
        return self.ask(False, address, bytes([count]))

    def accepts(self, address: int, data: bytes) -> bool:
        """Whether a write is acknowledged."""
        answer = self.ask(True, address, data)
        assert answer is None or answer == (b"" if self.can else b"\x01")
        return answer is not None


both_wires = pytest.mark.parametrize("wire", ["serial", "can"])


@both_wires
def test_both_books_of_the_wrist_document_the_same_bytes(wire: str) -> None:
    memory = WristMemory(wire, fault="block-silent")
    answered = {address for address in AROUND_WRIST if memory.read(address, 1) is not None}
    assert answered == {address for register in WRIST for address in register.span}


@both_wires
@each_row("register", named(list(WRIST)))
def test_power_on_values_of_the_wrist(wire: str, register: Register) -> None:
    data = WristMemory(wire).read(register.address, register.size)
    assert data is not None
    assert register.to_raw(register.decode(data)) == WRIST_POWER_ON[register.name]


def test_power_on_values_of_the_wrist_are_all_different() -> None:
    seen = [value for value in WRIST_POWER_ON.values() if value]
    assert len(set(seen)) == len(seen) == len(WRIST) - 2


@both_wires
@each_row("register", named([register for register in WRIST if register.name != "move_time"]))
def test_both_books_of_the_wrist_allow_the_same_writes(wire: str, register: Register) -> None:
    """A strict wrist is silent to what cannot be written or is out of range (wrist §1, §2.1)."""
    edges = [register.to_raw(value) for value in (register.low, register.high) if value is not None]
    tried = sorted({edge + step for edge in [*edges, 0, -(2**15), 2**15 - 1] for step in (-1, 0, 1)})
    bits = 8 * register.size
    least, most = (-(1 << bits - 1), (1 << bits - 1) - 1) if register.signed else (0, (1 << bits) - 1)
    for value in (value for value in tried if least <= value <= most):
        memory = WristMemory(wire, fault="strict")
        raw = value.to_bytes(register.size, "little", signed=register.signed)
        wanted = register.writable and register.allowed(register.decode(raw))
        assert memory.accepts(register.address, raw) == wanted, f"{register.name} = {value}"
        if wanted:
            assert memory.read(register.address, register.size) == raw


@both_wires
def test_the_range_of_the_time_is_the_tools_own(wire: str) -> None:
    """The manual gives none (dossier W15); the wrist must take at least what the tool allows."""
    for value in (1, 99, 100, 5000, 32767):
        assert WRIST["move_time"].allowed(value)
        assert WristMemory(wire, fault="strict").accepts(1042, value.to_bytes(2, "little"))
    assert not WRIST["move_time"].allowed(0)
    assert not WRIST["move_time"].allowed(32768)


@both_wires
def test_gaps_of_the_wrist_cannot_be_written(wire: str) -> None:
    writable = {address for register in WRIST if register.writable for address in register.span}
    memory = WristMemory(wire, fault="strict")
    for address in AROUND_WRIST:
        if address not in writable:
            assert not memory.accepts(address, b"\x01"), address


@both_wires
def test_the_hand_has_other_bytes_at_the_same_addresses(wire: str) -> None:
    """RH56 §2.4.7, §2.4.8: current limits and power-on speeds; a mix-up of the flags would show in every register."""
    wrist, hand = WristMemory(wire), WristMemory(wire, hand=True)
    for register in WRIST:
        assert wrist.read(register.address, register.size) != hand.read(register.address, register.size), register.name
    before = hand.read(1038, 6)
    assert wrist.accepts(1038, bytes(6))
    assert hand.read(1038, 6) == before
