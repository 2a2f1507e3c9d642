"""Describe a span of registers: which elements of a map the bytes at an address contain. Knows no wire."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, lru_cache
from itertools import groupby

from handctl.devices.inspire.map import Register
from handctl.model.explainer import Part, Value
from handctl.model.param import Element, ParamMap


@cache
def _places(params: ParamMap[Register]) -> dict[int, tuple[Register, int]]:
    """Every element of a map by its address: a long recording asks often."""
    return {register.address_of(index): (register, index) for register in params for index in range(register.count)}


def stretches(
    params: ParamMap[Register] | None, address: int, data: bytes
) -> Iterator[tuple[Register | None, int, bytes]]:
    """(register, element index, bytes) of each whole element; bytes of none in one stretch, with their address.

    A register that can only be written is named where it stands alone.
    """
    for register, index, start, stop in _layout(params, address, len(data)):
        yield register, index, data[start:stop]


@lru_cache(256)
def _layout(
    params: ParamMap[Register] | None, address: int, count: int
) -> tuple[tuple[Register | None, int, int, int], ...]:
    """(register, element index, start, stop) of each stretch of a span: a long recording asks for few spans."""
    found: list[tuple[Register | None, int, int, int]] = []
    place = start = 0
    while place < count:
        here = _places(params).get(address + place) if params is not None else None
        if here is None or place + here[0].size > count or not (here[0].readable or here[0].size == count):
            place += 1
            continue
        if place > start:
            found.append((None, address + start, start, place))
        register, index = here
        found.append((register, index, place, place + register.size))
        place = start = place + register.size
    if place > start:
        found.append((None, address + start, start, place))
    return tuple(found)


def span_values(params: ParamMap[Register] | None, address: int, data: bytes) -> tuple[Value, ...]:
    """The documented values in the span."""
    return tuple(
        Value(Element(register, index).full_name, register.decode(raw), register.unit)
        for register, index, raw in stretches(params, address, data)
        if register is not None
    )


def span_parts(params: ParamMap[Register] | None, address: int, data: bytes) -> list[Part]:
    """The span field by field."""
    parts = []
    for register, index, raw in stretches(params, address, data):
        if register is None:
            parts.append(Part(raw, f"at {index}", "undocumented" if params is not None else "another register space"))
            continue
        value = register.decode(raw)
        unit = f" {register.unit}" if register.unit else ""
        remarks = "; ".join(filter(None, (register.label(value), register.note)))
        text = f"{register.text(value)}{unit}" + (f" ({remarks})" if remarks else "")
        parts.append(Part(raw, Element(register, index).full_name, text))
    return parts


@lru_cache(1024)
def span_name(params: ParamMap[Register] | None, address: int, count: int) -> str:
    """What lies in a span, in short: ``position_actual``, ``position_actual to temperature``, ``undocumented``."""
    if params is None:
        return "unnamed registers"
    touched = [register for register in params if address < register.span.stop and register.address < address + count]
    if not touched:
        return "undocumented"
    if len(touched) > 1:
        return f"{touched[0].name} to {touched[-1].name}"
    register = touched[0]
    index, odd = divmod(address - register.address, register.size)
    whole = address <= register.address and address + count >= register.span.stop
    if whole or not register.elements or odd or not 0 <= index < len(register.elements):
        return register.name
    single = count <= register.size
    return f"{register.name}.{register.elements[index]}" + ("" if single else " and on")


def describe(params: ParamMap[Register] | None, address: int, data: bytes) -> str:
    """The values of a span: ``position_set = 500 500 -1 0 500 (middle not commanded)``."""
    if params is None:
        return f"{data.hex(' ').upper()}"
    texts = [
        _group(register, first, data[start:stop])
        for register, first, start, stop in _groups(params, address, len(data))
        if register is not None
    ]
    gaps = b"".join(raw for register, _, raw in stretches(params, address, data) if register is None)
    if not texts:
        return f"undocumented bytes {gaps.hex(' ').upper()}" if gaps else "nothing"
    if any(gaps):
        texts.append(f"{len(gaps)} undocumented bytes, not all zero")
    return ", ".join(texts)


@lru_cache(256)
def _groups(
    params: ParamMap[Register] | None, address: int, count: int
) -> tuple[tuple[Register | None, int, int, int], ...]:
    """The stretches of a span with the neighbouring elements of one register in one: (register, first index, start, stop)."""
    found = []
    for register, group in groupby(_layout(params, address, count), key=lambda item: item[0]):
        members = list(group)
        found.append((register, members[0][1], members[0][2], members[-1][3]))
    return tuple(found)


@lru_cache(4096)
def _group(register: Register, first_index: int, data: bytes) -> str:
    """Neighbouring elements of a register in words; the same bytes come again and again in a recording."""
    size = register.size
    elements = [(first_index + place, data[place * size : (place + 1) * size]) for place in range(len(data) // size)]
    values = [register.decode(raw) for _, raw in elements]
    name = register.name
    if register.elements and len(elements) < len(register.elements):
        first, last = register.elements[elements[0][0]], register.elements[elements[-1][0]]
        name += f".{first}" if first == last else f".{first} to {last}"
    labels = [(index, register.label(value)) for (index, _), value in zip(elements, values, strict=True)]
    remarks = [
        f"{register.elements[index]} {label}" if register.elements else label
        for index, label in labels
        if label is not None and label != "ok"
    ]
    if register.note and not register.elements and not (register.bits and not values[0]):
        remarks.append(register.note)
    unit = f" {register.unit}" if register.unit else ""
    text = f"{name} = {' '.join(register.text(value) for value in values)}{unit}"
    return f"{text} ({', '.join(remarks)})" if remarks else text
