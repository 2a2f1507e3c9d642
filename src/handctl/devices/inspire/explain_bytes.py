"""Explain recorded bytes of the Inspire family: EB 90, CAN and Modbus frames, with the map of their device.

Bytes in, pieces out; knows no link. The wrist's registers are reached through flags 30 and 31 (CAN 4 and 5), a hand's
through 11 and 12 (CAN 0 and 1): what lies in the other space has no names here. Which of two protocols on one pair a
stretch is, its first bytes tell: EB 90 has its mark, Modbus TCP two zeros and a length that fits; RTU its CRC proves.

`InspireWriteRules` tells the ledger which of these bytes write, what acknowledges them, and what to read when nothing does. What is
no read request counts as a write, whatever it is: nobody knows what a damaged frame does.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from functools import cache, lru_cache
from itertools import count, groupby, takewhile
from operator import getitem
from struct import Struct
from typing import Any, NamedTuple

from handctl.devices.inspire import can_frames, eb90, modbus_frames
from handctl.devices.inspire.eb90 import FORCE_COMMAND, READ, WRIST_READ, WRIST_WRITE, WRITE, Frame
from handctl.devices.inspire.identity import At, within
from handctl.devices.inspire.modbus_frames import RTU, TCP, mode_of, pdu_of
from handctl.devices.inspire.register_map import Register
from handctl.fast_classes import replace
from handctl.model.explainer import (
    DEVICE,
    HOST,
    CodedValues,
    Cut,
    Cutter,
    ExplainedBytes,
    Known,
    LazySequence,
    Maker,
    Makers,
    Part,
    Value,
    Values,
    stray,
)
from handctl.model.param import Element, Number, ParamMap
from handctl.model.write_ledger import Addressee, WriteRules
from handctl.model.write_ledger import Frame as Written
from handctl.wording import plural

UNDOCUMENTED = "at "
"""Before the address in the name of bytes of no register."""
OF_HAND = "hand at "
"""The same of each byte of the hand that carries a wrist: the wrist's manual names none of its registers."""


Split = Callable[[bytes], tuple[bytes, ...]]
"""Splits the bytes of a span into its stretches."""


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


def span_values(params: ParamMap[Register] | None, address: int, data: bytes) -> Values:
    """The documented values in the span, and where other bytes are not 0 those in hex by their address."""
    if params is None:
        return ()
    makers, split = _makers(params, address, len(data))
    return CodedValues(makers, split(data))


@lru_cache(256)
def _makers(params: ParamMap[Register], address: int, count: int) -> tuple[Makers, Split]:
    """What makes the stretches of a span values, and what splits its bytes into them."""
    layout = _layout(params, address, count)
    split = Struct("".join(f"{stop - start}s" for _, _, start, stop in layout)).unpack
    return Makers(_maker(register, index) for register, index, _, _ in layout), split


@lru_cache(4096)
def _maker(register: Register | None, index: int) -> Maker:
    if register is None:
        return lambda raw: Value(f"{UNDOCUMENTED}{index}", raw.hex(" ").upper()) if any(raw) else None
    name, unit = Element(register, index).full_name, register.unit
    return lambda raw: Value(name, register.decode(raw), unit)


def span_parts(params: ParamMap[Register] | None, address: int, data: bytes) -> list[Part]:
    """The span field by field."""
    parts = []
    for register, index, raw in stretches(params, address, data):
        if register is None:
            parts.append(
                Part(raw, f"{UNDOCUMENTED}{index}", "undocumented" if params is not None else "another register space")
            )
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
    known, split, places = _groups(params, address, len(data))
    texts = list(map(getitem, known, split(data)))
    gaps = b"".join([data[start:stop] for start, stop in places])
    if not texts:
        return f"undocumented bytes {gaps.hex(' ').upper()}" if gaps else "nothing"
    if any(gaps):
        texts.append(f"{len(gaps)} undocumented bytes, not all zero")
    return ", ".join(texts)


@lru_cache(256)
def _groups(
    params: ParamMap[Register], address: int, count: int
) -> tuple[list[Known[bytes]], Split, list[tuple[int, int]]]:
    """Of a span: what is said of the neighbouring elements of each register, what splits it into these, and the gaps."""
    known, form, gaps = [], "", []
    for register, group in groupby(_layout(params, address, count), key=lambda item: item[0]):
        members = list(group)
        first, start, stop = members[0][1], members[0][2], members[-1][3]
        if register is None:
            form += f"{stop - start}x"
            gaps.append((start, stop))
        else:
            form += f"{stop - start}s"
            known.append(_group(register, first, (stop - start) // register.size))
    return known, Struct(form).unpack, gaps


@lru_cache(1024)
def _group(register: Register, first: int, count: int) -> Known[bytes]:
    """What the bytes of so many elements of a register say; the same ones come again and again in a recording."""
    elements, name, unit = register.elements, register.name, f" {register.unit}" if register.unit else ""
    if elements and count < len(elements):
        begin, end = elements[first], elements[first + count - 1]
        name += f".{begin}" if begin == end else f".{begin} to {end}"
    remarked = register.choices or register.special or register.bits or (register.note and not elements)
    remarks = [_remarks(register, index) for index in range(first, first + count)] if remarked else []
    known, split = [_texts(register)] * count, Struct(f"{register.size}s" * count).unpack

    def told(data: bytes) -> str:
        cells = split(data)
        text = f"{name} = {' '.join(map(getitem, known, cells))}{unit}"
        said = ", ".join(filter(None, map(getitem, remarks, cells)))
        return f"{text} ({said})" if said else text

    return Known(told)


@cache
def _texts(register: Register) -> Known[bytes]:
    return Known(lambda raw: register.text(register.decode(raw)))


@cache
def _remarks(register: Register, index: int) -> Known[bytes]:
    def remark(raw: bytes) -> str:
        value = register.decode(raw)
        label = register.label(value)
        if label is None or label == "ok":
            label = ""
        if register.elements:
            return label and f"{register.elements[index]} {label}"
        note = "" if register.bits and not value else register.note
        return ", ".join(filter(None, (label, note)))

    return Known(remark)


# -- which elements of a map the bytes at an address hold -------------------------------------------------------------


RESULTS = {0x00: "saved", 0xFF: "not saved"}
"""Data of the late result frame of a save (RH56 §2.2.2)."""
READS, WRITES = (READ, WRIST_READ), (WRITE, WRIST_WRITE)
CAN_KINDS = {0: "read hand", 1: "write hand", 4: "read wrist", 5: "write wrist"}
PREFIX = 7
"""Bytes of an answer before its data, up to the address."""
MOST_KNOWN = 1024
LARGEST = 256
"""Questions on CAN that are remembered: a bus may be full of those of others."""

MISPRINTS: dict[bytes, str] = {
    bytes.fromhex("EB90010430FC030236"): (
        "wrist §2.2 prints these bytes for reading both currents, but 03FC is 1020: this reads pitch_actual. "
        "The currents: EB 90 01 04 30 00 04 04 3D"
    ),
    bytes.fromhex("EB900107310E0418FCEB034D"): (
        "wrist §2.2.1 prints these bytes for pitch -10.00, yaw +10.00, but 1038 is yaw and 03EB is 1003: this sets yaw "
        "-10.00 and pitch +10.03. As the text says: EB 90 01 07 31 0E 04 E8 03 18 FC 4A"
    ),
    bytes.fromhex("90EB010530FC030000000035"): (
        "wrist §2.2 prints this reply, but length 05 means two data bytes. The byte in the place of the sum does not fit, "
        "so a decoder rejects it"
    ),
}
CAN_MISPRINTS: dict[tuple[int, bytes], str] = {
    (0x01100001, b"\x04"): (
        "wrist §2.3.1 prints 28 bits for an identifier of 29: as they stand they read address 1088 of the hand. "
        "Both currents: 11000001 [1] 04"
    ),
    (0x00184001, bytes(4)): (
        "wrist §2.3.1 prints this identifier for the reply with 28 bits of 29. With the zeros it lost it would be a hand "
        "read of 1552. A reply has the request's identifier: 11000001 [4]"
    ),
    (0x15750001, bytes.fromhex("E80318FC")): (
        "wrist §2.3.2 says 1492 beside the binary 1038: this writes address 1492. Yaw and pitch: 15038001 [4] E8 03 18 FC"
    ),
    (0x15038001, bytes.fromhex("FC1803EB")): (
        "wrist §2.3.2 prints these data bytes high byte first. The device reads low byte first: yaw +63.96, pitch -53.73, "
        "out of range. As the text says: 15038001 [4] E8 03 18 FC"
    ),
}


# -- which generation -------------------------------------------------------------------------------------------------

EVENT = "generation "
"""A recording says so when handctl knows it: ``! generation f1``."""
NO_NAME = "undocumented"
MOST = 32
"""Answers that are remembered: they are asked for one behind the other."""


class Generation(NamedTuple):
    """One map: how events name it, how people do, bytes at one address, and what shows it in answers to reads."""

    names: tuple[str, ...]
    words: str
    params: ParamMap[Register]
    per: int
    shows: Callable[[At], str]


class Generations:
    """What is known of one conversation. The first of `known` is taken until another one shows itself."""

    def __init__(self, known: Sequence[Generation]) -> None:
        self._known = known
        self.now = known[0]
        self.sure = len(known) == 1
        self.name = ""
        """That of the one that is sure, where it has one name."""
        self._answers: dict[int, bytes] = {}

    def event(self, text: str) -> bool:
        """An event of the recording; whether it names a generation."""
        name = text.removeprefix(EVENT).strip()
        found = next((one for one in self._known if text.startswith(EVENT) and name in one.names), None)
        if found is not None:
            self.now, self.sure, self.name = found, True, name
        return found is not None

    def answer(self, address: int, data: bytes) -> bool:
        """What a read at `address`, as the frame has it, was answered; whether another map holds from here on."""
        if self.sure:
            return False
        self._answers.pop(address, None)
        self._answers[address] = data
        if len(self._answers) > MOST:
            del self._answers[next(iter(self._answers))]
        shown = [one for one in self._known if one.shows(self._at(one.per))]
        if len(shown) != 1:
            return False
        before, self.now, self.sure = self.now, shown[0], True
        self.name = self.now.names[0] if len(self.now.names) == 1 else ""
        return self.now is not before

    def _at(self, per: int) -> At:
        held = within([(per * address, data) for address, data in self._answers.items()])
        return lambda address, count: held(per * address, count)

    def other_generations(self, address: int, count: int, *, writes: bool, data: bytes = b"") -> str:
        """What this address holds on the others, while it is not sure which generation it is; "" = nothing else."""
        if self.sure:
            return ""
        own = span_name(self.now.params, address * self.now.per, count)
        if not writes and own != NO_NAME:
            return ""
        told: dict[str, list[str]] = {}
        for one in self._known:
            name = span_name(one.params, address * one.per, count)
            if one is self.now or name in (own, NO_NAME):
                continue
            text = describe(one.params, address * one.per, data) if data and not writes else name
            told.setdefault(text, []).append(one.words)
        return "".join(f". On {' and '.join(who)}: {text}" for text, who in told.items())


# -- one conversation -------------------------------------------------------------------------------------------------


class InspireExplainer(Cutter):
    """One conversation. Frames are found at every offset; one that fails gives way to a whole one inside it.

    known  its generation may be any of these, the first, which has this map, until another one shows itself;
           without any it is that of the map, and no Modbus is spoken
    """

    def __init__(self, params: ParamMap[Register], known: Sequence[Generation] = ()) -> None:
        super().__init__()
        self._modbus, self.is_exo, self.is_wrist = (params.kind == kind for kind in ("hand", "exo", "wrist"))
        own = Generation((), "", params, next(iter(params)).per, lambda _: "")
        self._generations = Generations(known or [own])
        self._known: dict[tuple[str, bytes], ExplainedBytes] = {}
        """Reads told before, and answers to them: the same come again and again."""
        self._alike: dict[bytes, tuple[dict[str, Any], ParamMap[Register], int]] = {}
        """How an answer begins -> its piece, and which bytes of which map it holds."""
        self._adopt()
        self._new_id: tuple[int, int, int] | None = None
        """Id that a write was for, the one that its acknowledgement may come from, and its address."""
        self._started = 0
        """Address of the save or calibration whose late frame may still come."""
        self._accepted = False
        """Whether the last write was acknowledged: a save tells its result only then."""
        self._questions: dict[str, bytes] = {}
        """Key of an answer in Modbus -> the PDU that asked for it."""
        self._asked: dict[int, bytes] = {}
        """CAN identifier -> the question."""

    def _adopt(self) -> None:
        """Name everything by the map that holds now. `per`: bytes at one address of a frame; `places`: those of writes that something follows."""
        self.params, self.per = self._generations.now.params, self._generations.now.per
        roles = {"id": "id", "save": "save", "factory_reset": "factory_reset"}
        roles["calibrate"] = "calibrate_force" if self._modbus else "calibrate"
        found = {role: self.params.get(name) for role, name in roles.items()}
        self.places = {role: register.place if register is not None else -1 for role, register in found.items()}
        self._known.clear()
        self._alike.clear()

    def simulated(self, values: Mapping[str, Number | str], moments: Mapping[str, float]) -> Iterator[str]:
        """See Explainer: the generation, and the bytes of each register that is no trigger."""
        if self._generations.name:
            yield f"model={self._generations.name}"
        if values.get("id") in eb90.IDS:  # Modbus TCP has others, which mean none
            yield f"id={values['id']}"
        for name, other in values.items():
            if name.startswith(UNDOCUMENTED):
                yield f"set {int(name.removeprefix(UNDOCUMENTED)) // self.per} {other}"
        of_hand = {
            int(name.removeprefix(OF_HAND)): int(byte) for name, byte in values.items() if name.startswith(OF_HAND)
        }
        for address in sorted(of_hand):
            if address - 1 not in of_hand:  # a run of bytes begins: half a register would be another value
                run = bytes(of_hand[at] for at in takewhile(of_hand.__contains__, count(address)))
                yield f"hand-set {address} {run.hex().upper()}"
        for register in self.params:
            for index, element in enumerate(register.each):
                value = values.get(element.full_name)
                if isinstance(value, int | float) and not register.trigger and register.name != "id":
                    yield f"set {register.address_of(index) // register.per} {register.encode(value).hex().upper()}"

    def event(self, text: str) -> None:
        """See Explainer."""
        if self._generations.event(text):
            self._adopt()

    def _heard(self, address: int, data: bytes) -> None:
        """An answer to a read: it may show the generation, and is named by its map then."""
        if len(data) > 1 and self._generations.answer(address, data):
            self._adopt()

    def feed(self, direction: str, data: bytes, can_id: int | None = None) -> list[ExplainedBytes]:
        """See Explainer."""
        if can_id is not None:
            return [self._can(direction, can_id, data)]
        if not self._started and not self._buffers[direction]:
            if (known := self._known.get((direction, data))) is not None:
                if known.kept is None:
                    known.kept = {}
                return [known]
            if direction == DEVICE and (known := self._other_values(data)) is not None:
                return [known]
        return super().feed(direction, data)

    def _other_values(self, data: bytes) -> ExplainedBytes | None:
        """An answer to a read that differs from one told before in its values and nothing else; None where it is none."""
        alike = self._alike.get(data[:PREFIX])
        if alike is None or len(data) != data[3] + eb90.OVERHEAD or eb90.checksum(data[2:-1]) != data[-1]:
            return None
        rest, space, at = alike
        held = data[PREFIX:-1]
        piece = object.__new__(ExplainedBytes)
        vars(piece).update(
            rest, raw=data, meaning=f"{describe(space, at, held)}, id {data[2]}", values=span_values(space, at, held),
            parts=LazySequence(lambda: self._parts(data)),
        )  # fmt: skip
        self._remember(piece)
        return piece

    def _remember(self, piece: ExplainedBytes) -> None:
        if len(self._known) >= MOST_KNOWN:
            self._known.clear()
        self._known[piece.direction, piece.raw] = piece

    def sent(self, data: bytes, can_id: int | None = None) -> list[ExplainedBytes]:
        """As `feed`, of what the host sends in one write: that is whole, or will never be."""
        return self.feed(HOST, data, can_id) if can_id is not None else super().decode(data, HOST)

    def decode(self, data: bytes, side: str = "", can_id: int | None = None) -> list[ExplainedBytes]:
        """See Explainer. The header says who sent a frame; on CAN a read of one byte is a question, a write with data a request."""
        if can_id is not None:
            asks = len(data) > 0 if can_frames.parse_identifier(can_id).writes else len(data) == 1
            direction = HOST if side == HOST or (not side and asks) else DEVICE
            piece = self._can_piece(direction, can_id, data, key=f"{can_id:08X}")
            return [_annotated(piece, CAN_MISPRINTS.get((can_id, data)))]
        host, device = (data.find(header) if header in data else len(data) for header in (eb90.HOST, eb90.DEVICE))
        self._guess = DEVICE if device < host else HOST
        misprints = MISPRINTS if self.is_wrist else {}
        return [_annotated(piece, misprints.get(piece.raw)) for piece in super().decode(data, side)]

    def recognises(self, data: bytes, can_id: int | None = None) -> bool:
        """See Explainer. An EB 90 frame with flag 11 or 12 is an exoskeleton hand's as well: that family comes first."""
        if can_id is not None:
            return self.is_wrist
        if self._modbus:
            return modbus_frames.mode_of(data) != ""
        header = data[:2] in (eb90.HOST, eb90.DEVICE)
        return header and (data[4:5] in (b"\x30", b"\x31") and len(data) != 16) == self.is_wrist

    def cut(self, buffer: bytearray, side: str, *, final: bool) -> Cut:
        if not self._modbus:
            return _cut_eb90(buffer, final=final)
        either = _cut_eb90 if modbus_frames.is_eb90(buffer) else _cut_modbus
        found = either(buffer, final=final)
        if found.size or modbus_frames.tcp_size(buffer):
            return found
        # what seems to begin here gives way to a whole frame inside it, whose CRC fits
        inner = (place for place in range(1, len(buffer)) if modbus_frames.rtu_size(buffer[place:]))
        return Cut(next(inner, 0), "stray")

    def side_of(self, raw: bytes, cut: Cut) -> str:
        """By the header, in Modbus by the function; what is none goes with what stands before it."""
        if cut.mode:
            pdu = pdu_of(raw, cut.mode)
            asks = modbus_frames.only_reads(pdu) or (pdu[0] == modbus_frames.WRITE_MANY and len(pdu) > 5)
            return HOST if asks else DEVICE
        if raw[:2] in (eb90.HOST, eb90.DEVICE):
            self._guess = HOST if raw[:2] == eb90.HOST else DEVICE
        return self._guess

    def piece(self, direction: str, raw: bytes, cut: Cut) -> ExplainedBytes:
        problem = cut.problem
        if cut.mode:
            return self._modbus_piece(direction, raw, cut.mode)
        if problem == "stray":
            if direction == HOST and not self._modbus and not raw.strip(b"\0"):
                return stray(direction, raw, "ahead of the first question", "")
            return stray(direction, raw)
        if problem == "cut-short":
            whole = raw[3] + eb90.OVERHEAD if len(raw) > 3 else None
            of = f" of {whole}" if whole else ""
            return stray(direction, raw, f"the beginning of a frame, cut off after {len(raw)}{of} bytes", problem)
        if problem == "bad-checksum":
            return self._damaged(direction, raw)
        frame, fields = _framed(raw)
        title, key = "", ""
        values: Values = ()
        if frame.from_device != (direction == DEVICE):
            who = "our own bytes came back" if direction == DEVICE else "bytes of a device, sent by the host"
            meaning, problem = f"{who}: {self._words(frame)[0]}", "echo"
        else:
            meaning, title, key, problem, values = self._explain(frame)
        piece = ExplainedBytes(
            direction=direction, raw=raw, meaning=meaning, title=title, problem=problem, values=values,
            asks=key if direction == HOST else "", answers=key if direction == DEVICE else "",
            fields=fields, parts=LazySequence(lambda: self._parts(raw)),
        )  # fmt: skip
        if frame.flag in READS and self._generations.sure and not self._started:  # whatever was before it
            self._remember(piece)
            space, address = self._space(frame.flag == WRIST_READ), frame.address
            if (
                direction == DEVICE
                and not problem
                and len(frame.data) > 1
                and space is not None
                and address is not None
            ):
                if len(self._alike) >= MOST_KNOWN:
                    self._alike.clear()
                self._alike[raw[:PREFIX]] = {**vars(piece)}, space, address * self.per
        return piece

    # -- registers, whichever wire ------------------------------------------------------------------------------------

    def _space(self, wrist: bool) -> ParamMap[Register] | None:
        """The map behind a flag; None where this family member has no names."""
        return self.params if wrist == self.is_wrist else None

    def _values(self, space: ParamMap[Register] | None, address: int, data: bytes) -> Values:
        """What the bytes at an address hold; of the hand behind a wrist each byte, because nothing says which belong together."""
        if space is None and self.is_wrist:
            return LazySequence(lambda: (Value(f"{OF_HAND}{at}", byte) for at, byte in enumerate(data, address)))
        return span_values(space, address, data)

    def _asks(self, space: ParamMap[Register] | None, address: int, count: int, unit: str = "byte") -> str:
        """``read id: 2 bytes at 1000``."""
        size = count if unit == "byte" else 2 * count
        return f"read {span_name(space, address * self.per, size)}: {plural(count, unit)} at {address}"

    def _holds(self, space: ParamMap[Register] | None, address: int, data: bytes, other: str = "") -> str:
        """``id = 1``; of the other space with the address."""
        return describe(space, address * self.per, data) + (f" at {address}{other}" if space is None else "")

    def _acknowledged(self, verdict: str, space: ParamMap[Register] | None, address: int) -> str:
        return f"{verdict}: write at {address} {span_name(space, address * self.per, 1)}"

    # -- EB 90 --------------------------------------------------------------------------------------------------------

    def _damaged(self, direction: str, raw: bytes) -> ExplainedBytes:
        right = eb90.checksum(raw[2:-1])
        words = self._words(Frame(raw[:2], raw[2], raw[4], raw[5:-1]))[0]
        meaning = f"bad checksum {raw[-1]:02X}, should be {right:02X}. It would say: {words}"
        return ExplainedBytes(
            direction=direction, raw=raw, meaning=meaning,
            problem="bad-checksum", frame=False, title="bad-checksum", fields={"checksum": f"{raw[-1]:02X}",
            "expected": f"{right:02X}"}, parts=LazySequence(lambda: self._parts(raw)),
        )  # fmt: skip

    def _explain(self, frame: Frame) -> tuple[str, str, str, str, Values]:
        """(meaning, title, key of request and answer, problem, values) of a valid frame; see `_told`.

        While the generation is open, what the others have there is said too.
        """
        address, reads, writes = frame.address, frame.flag == READ, frame.flag == WRITE
        if address is None or not (reads or writes):
            return self._told(frame)
        if reads and frame.from_device:
            self._heard(address, frame.data)
        meaning, *rest = self._told(frame)
        asked = reads and not frame.from_device and len(frame.data) == 1
        count, data = (frame.data[0], b"") if asked else (len(frame.data), frame.data)
        if not (writes and frame.from_device) and "result" not in meaning:
            meaning += self._generations.other_generations(address, count, writes=writes, data=data)
        return meaning, *rest  # type: ignore[return-value]

    def _told(self, frame: Frame) -> tuple[str, str, str, str, Values]:
        words, values = self._words(frame)
        who, flag, address, size = frame.id, frame.flag, frame.address, len(frame.data)
        if self._commands(frame):
            whole = len(frame.payload) == (12 if frame.from_device and flag == FORCE_COMMAND else 10)
            return words, f"flag {flag:02X}", f"{who} {flag:02X}" if whole else "", "" if whole else "odd-frame", values
        if address is None or flag not in (*READS, *WRITES):
            return words, "", "", "odd-frame", values
        if flag in READS:
            count = frame.data[0] if not frame.from_device and size == 1 else size
            return self._late(frame, words, values, f"{who} {flag:02X} {address} {count}")
        if not frame.from_device:
            self._new_id = None
            if flag == WRITE and address == self.places["id"] and size == self.per:
                self._new_id = who, frame.data[0], address
            elif flag == WRITE and address == self.places["factory_reset"]:
                self._new_id = who, 1, address
            self._started = address if frame.data == (1).to_bytes(self.per, "little") else 0
            self._accepted = False
            name = span_name(self._space(flag in (WRIST_READ, WRIST_WRITE)), address * self.per, size)
            return words, f"write {name}", f"{who} {flag:02X} {address} w", "", values
        if self._new_id is not None and (who, address) == self._new_id[1:]:
            who = self._new_id[0]  # the acknowledgement comes from the new id
        key = f"{who} {flag:02X} {address} w"
        if size != 1:
            return words, "", "", "odd-frame", ()
        if frame.data != b"\x01" and self._accepted and self._is_result(frame):
            return self._late(frame, words, values, key)
        self._accepted = frame.data == b"\x01"
        return words, "", key, "" if frame.data == b"\x01" else "refused", values

    def _is_result(self, frame: Frame) -> bool:
        """Of a frame that could be an acknowledgement too: only behind one, which is `_accepted`."""
        return not self.is_wrist and frame.address == self.places["save"] == self._started and frame.data[0] in RESULTS

    def _late(self, frame: Frame, words: str, values: Values, key: str) -> tuple[str, str, str, str, Values]:
        """A read or its answer; or the frame that tells the end of a save or a calibration, which nobody asks for."""
        if not frame.from_device or self.is_wrist or len(frame.data) != 1:
            return words, "", key, "", values
        if self._is_result(frame):
            self._started = 0
            what = "result of the save"
            return f"{what}: {RESULTS[frame.data[0]]}", what, "", "refused" if frame.data[0] else "", ()
        if frame.address == eb90.CALIBRATION_END and self._started == self.places["calibrate"]:
            self._started = 0
            return f"end of the calibration, code {frame.data[0]:02X}", "end of the calibration", "", "", ()
        return words, "", key, "", values

    def _commands(self, frame: Frame) -> bool:
        return self.is_exo and frame.flag in eb90.COMMANDS and frame.address is None

    def _words(self, frame: Frame) -> tuple[str, Values]:
        """A frame in words, and its values."""
        if self._commands(frame):
            return self._command(frame)
        where, data, reads, writes = f"id {frame.id}", frame.data, frame.flag in READS, frame.flag in WRITES
        if len(frame.payload) <= 2 or not (reads or writes):
            return f"flag {frame.flag:02X}, which is not in the manual, {where}", ()
        address = int.from_bytes(frame.payload[:2], "little")
        space = self._space(frame.flag in (WRIST_READ, WRIST_WRITE))
        other = " of the hand's own registers" if self.is_wrist else " of another register space"
        other = "" if space is not None else other
        if reads and not frame.from_device and len(data) == 1:
            return f"{self._asks(space, address, data[0])}{other}, {where}", ()
        if writes and frame.from_device and len(data) == 1:
            verdict = "accepted" if data == b"\x01" else f"not accepted ({data.hex().upper()})"
            return f"{self._acknowledged(verdict, space, address)}{other}, {where}", ()
        if writes and frame.from_device:
            return f"not an acknowledgement of a write, which has one byte: {data.hex(' ').upper()}, {where}", ()
        text = self._holds(space, address, data, other)
        if len(data) == 8 and frame.flag == WRIST_WRITE:
            text += " (an exoskeleton hand takes it for a force command)"
        at = address * self.per
        return f"{'write ' if writes else ''}{text}, {where}", self._values(space, at, data)

    def _command(self, frame: Frame) -> tuple[str, Values]:
        """Force and position commands: five set values out; actual positions (six) or forces (five) back."""
        numbers = eb90.unpack_s16(frame.payload)
        kind = eb90.COMMANDS[frame.flag]
        name = f"{kind}_set" if not frame.from_device else ("position_actual" if kind == "force" else "force_actual")
        parts = self.params[name].elements
        values = tuple(Value(f"{name}.{part}", number) for part, number in zip(parts, numbers, strict=False))
        text = " ".join(map(str, numbers))
        if len(frame.payload) != 2 * len(parts):
            came = f"{plural(len(frame.payload), 'byte')}, {2 * len(parts)} expected"
            return f"{kind} command with {came}: {text}, id {frame.id}", values
        if frame.from_device:
            return f"{kind} command taken: {name} = {text}, id {frame.id}", values
        return f"{kind} command, {parts[0]} to {parts[-1]}: {text}, id {frame.id}", values

    def _parts(self, raw: bytes) -> tuple[Part, ...]:
        body = len(raw) - eb90.OVERHEAD
        frame = Frame(raw[:2], raw[2], raw[4], raw[5:-1])
        right = eb90.checksum(raw[2:-1])
        found = [
            Part(raw[:2], "header", "from the device" if frame.from_device else "from the host"),
            Part(raw[2:3], "id", str(frame.id)),
            Part(raw[3:4], "length", f"{body} bytes from the flag to the data"),
            Part(raw[4:5], "flag", self._flag_name(frame)),
        ]
        if self._commands(frame) or len(frame.payload) < 2:
            numbers = eb90.unpack_s16(frame.payload)
            names = [value.name for value in self._words(frame)[1]]
            cells = [frame.payload[i : i + 2] for i in range(0, len(frame.payload), 2)]
            for place, cell in enumerate(cells):
                named = names[place] if place < len(names) else "data"
                found.append(Part(cell, named, str(numbers[place]) if place < len(numbers) else ""))
        else:
            address = int.from_bytes(frame.payload[:2], "little")
            space = self._space(frame.flag in (WRIST_READ, WRIST_WRITE))
            at = address * self.per
            found.append(Part(raw[5:7], "address", f"{address} {span_name(space, at, 1)}"))
            if frame.flag in READS and not frame.from_device and len(frame.data) == 1:
                found.append(Part(frame.data, "count", f"{frame.data[0]} byte{'s' if frame.data[0] != 1 else ''}"))
            elif frame.flag in WRITES and frame.from_device and len(frame.data) == 1:
                found.append(Part(frame.data, "answer", "accepted" if frame.data == b"\x01" else "not accepted"))
            else:
                found += span_parts(space, at, frame.data)
        verdict = "right" if raw[-1] == right else f"wrong, should be {right:02X}"
        return (*found, Part(raw[-1:], "checksum", verdict))

    def _flag_name(self, frame: Frame) -> str:
        if self._commands(frame):
            return f"{eb90.COMMANDS[frame.flag]} command"
        names = {READ: "read, hand", WRITE: "write, hand", WRIST_READ: "read, wrist", WRIST_WRITE: "write, wrist"}
        return names.get(frame.flag, "not in the manual")

    # -- CAN ----------------------------------------------------------------------------------------------------------

    def _can(self, direction: str, can_id: int, data: bytes) -> ExplainedBytes:
        """A recorded frame. Request and reply carry the same identifier: which answers which is told by what was asked before."""
        key, access = f"{can_id:08X}", can_frames.parse_identifier(can_id)
        if direction == HOST:
            self._asked.pop(can_id, None)
            self._asked[can_id] = data
            if len(self._asked) > LARGEST:
                del self._asked[next(iter(self._asked))]
            return self._can_piece(HOST, can_id, data, key=key)
        asked = self._asked.get(can_id)
        if asked is None:
            words = self._can_words(HOST if len(data) == 1 else DEVICE, can_id, data)
            return self._can_piece(DEVICE, can_id, data, f"not asked for here: {words}", title=f"others {can_id:08X}")
        if can_frames.acknowledges(data, asked) if access.writes else [len(data)] == list(asked):
            del self._asked[can_id]
            short = access.writes and data not in (b"", bytes([len(asked)]))
            problem = ("cut-short" if any(data) else "refused") if short else ""
            return self._can_piece(DEVICE, can_id, data, problem=problem, key=key)
        if data == asked:
            words = f"our own frame came back: {self._can_words(HOST, can_id, data)}"
            return self._can_piece(DEVICE, can_id, data, words, problem="echo")
        count = "an acknowledgement" if access.writes else f"{asked[0] if len(asked) == 1 else '?'} bytes"
        words = f"{self._can_words(DEVICE, can_id, data)} ({count} expected, {len(data)} came)"
        return self._can_piece(DEVICE, can_id, data, words, problem="cut-short")

    def _can_space(self, flag: int) -> ParamMap[Register] | None:
        return self._space(flag in (can_frames.READ_WRIST, can_frames.WRITE_WRIST)) if flag in CAN_KINDS else None

    def _can_words(self, direction: str, can_id: int, data: bytes) -> str:
        access = can_frames.parse_identifier(can_id)
        space, address, where = self._can_space(access.flag), access.address, f"id {access.hand_id}"
        other = "" if space is not None else " of the hand's own registers"
        if access.flag not in CAN_KINDS:
            return f"flag {access.flag}, which is not in the manual, address {address}, {where}"
        if direction == HOST and access.writes:
            return f"write {self._holds(space, address, data, other)}, {where}"
        if direction == HOST and len(data) != 1:
            return f"read at {address}{other} without a count, {where}"
        if direction == HOST:
            return f"{self._asks(space, address, data[0])}{other}, {where}"
        if access.writes and len(data) <= 1:
            count = "" if not data else f", {data[0]} bytes written"
            return f"{self._acknowledged('acknowledged', space, address)}{count}, {where}"
        return f"{self._holds(space, address, data, other)}, {where}"

    def _can_piece(
        self, direction: str, can_id: int, data: bytes, meaning: str = "", *, title: str = "", problem: str = "", key: str = ""
    ) -> ExplainedBytes:  # fmt: skip
        access = can_frames.parse_identifier(can_id)
        space, address = self._can_space(access.flag), access.address
        if direction == HOST and access.writes and key:
            title = f"write {span_name(space, address, len(data))}"
        holds = access.writes == (direction == HOST) and bool(data) and problem != "echo"
        kind = CAN_KINDS.get(access.flag, "not in the manual")
        what = f"{address} {span_name(space, address, max(1, len(data)))}"
        parts = [Part(can_id.to_bytes(4, "big"), "identifier", f"{kind}, address {what}, id {access.hand_id}")]
        if holds:
            parts += span_parts(space, address, data)
        elif data:
            parts.append(Part(data, "written" if access.writes else "count", " ".join(map(str, data))))
        return ExplainedBytes(
            direction=direction, raw=data, can_id=can_id, title=title, problem=problem,
            meaning=meaning or self._can_words(direction, can_id, data),
            asks=key if direction == HOST else "", answers=key if direction == DEVICE else "",
            fields={"id": access.hand_id, "flag": str(access.flag), "address": address},
            values=self._values(space, address, data) if holds else (), parts=tuple(parts),
        )  # fmt: skip

    # -- Modbus -------------------------------------------------------------------------------------------------------

    def _modbus_piece(self, direction: str, raw: bytes, mode: str) -> ExplainedBytes:
        pdu = pdu_of(raw, mode)
        unit = raw[6] if mode == TCP else raw[0]
        # Order, not the transaction, pairs an answer: some hands count wrongly (rh56 §2.3).
        key = f"{mode} {'' if mode == TCP else unit} {pdu[0] & ~modbus_frames.FAILED}"
        where = f"transaction {int.from_bytes(raw[:2], 'big')}" if mode == TCP else f"id {unit}"
        echo, fits = direction == DEVICE and modbus_frames.only_reads(pdu), False
        if direction == HOST or echo:
            meaning, title, address, data = self._question(pdu)
            meaning = f"our own bytes came back: {meaning}" if echo else meaning
            self._questions[key] = self._questions.get(key, pdu) if echo else pdu
        else:
            asked = self._questions.get(key)
            meaning, title, address, data = self._answer(pdu, asked)
            fits = asked is not None and modbus_frames.answers(pdu, asked)
        problem = "echo" if echo else "refused" if pdu[0] & modbus_frames.FAILED else ""
        params, at = self.params, None if address is None else address * self.per  # as they are now: looked at later
        return ExplainedBytes(
            direction=direction, raw=raw, meaning=f"{meaning}, {where}", title=title, problem=problem,
            asks=key if direction == HOST else "", answers=key if fits else "",
            fields={"id": unit, "function": pdu[0], "address": address, "wire": "modbus-tcp" if mode == TCP else None},
            values=span_values(params, at, data) if at is not None else (),
            parts=LazySequence(lambda: _modbus_parts(raw, mode, [] if at is None or not data else span_parts(params, at, data), len(data))),
        )  # fmt: skip

    def _question(self, pdu: bytes) -> tuple[str, str, int | None, bytes]:
        """(meaning, title, address, data); no data where nothing is named by it."""
        address, other_generations = int.from_bytes(pdu[1:3], "big"), self._generations.other_generations
        if pdu[0] == modbus_frames.READ:
            words = int.from_bytes(pdu[3:5], "big")
            text = self._asks(self.params, address, words, "register")
            return text + other_generations(address, 2 * words, writes=False), "", address, b""
        data = modbus_frames.to_memory(pdu[3:5] if pdu[0] == modbus_frames.WRITE_ONE else pdu[6:])
        text = f"write {self._holds(self.params, address, data)} at {address}"
        title = f"write {span_name(self.params, address * self.per, len(data))}"
        return text + other_generations(address, len(data), writes=True), title, address, data

    def _answer(self, pdu: bytes, asked: bytes | None) -> tuple[str, str, int | None, bytes]:
        """The same of what the device says."""
        if pdu[0] & modbus_frames.FAILED:
            code = pdu[1] if len(pdu) > 1 else 0
            text = f"refused: exception {code:02X}, {modbus_frames.EXCEPTIONS.get(code, 'unknown')}"
            return text, "refused", None, b""
        if pdu[0] != modbus_frames.READ:
            address = int.from_bytes(pdu[1:3], "big")
            return self._acknowledged("accepted", self.params, address), "", address, b""
        data = modbus_frames.to_memory(pdu[2:])
        if asked is None:
            text = f"{plural(len(data) // 2, 'register')}, not asked for here: {data.hex(' ').upper()}"
            return text, "others", None, b""
        address = int.from_bytes(asked[1:3], "big")
        self._heard(address, data)
        text = self._holds(self.params, address, data)
        text += self._generations.other_generations(address, len(data), writes=False, data=data)
        return text, "", address, data


def _modbus_parts(raw: bytes, mode: str, values: Sequence[Part], size: int) -> list[Part]:
    """A frame of Modbus field by field; its last `size` bytes are the `values`, where there are any."""
    pdu = pdu_of(raw, mode)
    head = raw[: modbus_frames.MBAP] if mode == TCP else raw[:1]
    rest = pdu[1 : len(pdu) - size] if values else pdu[1:]
    found = [Part(head, "header" if mode == TCP else "unit", f"Modbus {mode.upper()}")]
    found += [Part(pdu[:1], "function", f"{pdu[0]:02X}"), Part(rest, "address, count", "")]
    found += [Part(modbus_frames.to_memory(part.raw), part.name, part.meaning) for part in values]
    return [*found, Part(raw[-2:], "CRC", "right")] if mode == RTU else found


@lru_cache(4096)
def _framed(raw: bytes) -> tuple[Frame, Mapping[str, int | str | None]]:
    """A valid frame, and its fields for scripts; a recording holds the same ones again and again."""
    frame = Frame(raw[:2], raw[2], raw[4], raw[5:-1])
    return frame, {"id": frame.id, "flag": f"{frame.flag:02X}", "address": frame.address}


def _cut_eb90(buffer: bytearray, *, final: bool) -> Cut:
    """See Cutter."""
    start = 0 if buffer.startswith((eb90.HOST, eb90.DEVICE)) else _header(buffer, 0)
    if start:
        keep = 0 if final or start < len(buffer) or buffer[-1] not in (0xEB, 0x90) else 1
        return Cut(start - keep, "stray")
    size = _size(buffer, 0)
    if size == 0:
        return Cut(2, "stray")
    if size is not None and size <= len(buffer):
        if _valid(buffer, 0, size):
            return Cut(size)
        whole, begun = _inner(buffer, size)
        if begun and not whole and not final:
            return Cut(0)
        inner = whole or begun
        return Cut(inner, "cut-short") if inner else Cut(size, "bad-checksum")
    whole, _ = _inner(buffer, len(buffer))
    if whole:
        return Cut(whole, "cut-short")
    return Cut(len(buffer) if final else 0, "cut-short")


def _cut_modbus(buffer: bytearray, *, final: bool) -> Cut:
    """See Cutter: what does not begin as EB 90 does."""
    for size, mode in ((modbus_frames.tcp_size(buffer), TCP), (modbus_frames.rtu_size(buffer), RTU)):
        if size and size <= len(buffer):
            return Cut(size, mode=mode)
    waits = modbus_frames.tcp_size(buffer) > len(buffer) or any(
        size > len(buffer) for size in modbus_frames.rtu_sizes(buffer)
    )
    waits = waits or (len(buffer) <= modbus_frames.MBAP and b"\0\0".startswith(buffer[2:4]))
    if waits and not final:
        return Cut(0)

    def begins(rest: bytearray) -> bool:
        tcp = 0 < modbus_frames.tcp_size(rest) <= len(rest)
        return bytes(rest[:2]) in (eb90.HOST, eb90.DEVICE) or tcp or modbus_frames.rtu_size(rest) > 0

    place = next((place for place in range(1, len(buffer)) if begins(buffer[place:])), len(buffer))
    return Cut(place, "stray")


def _annotated(piece: ExplainedBytes, explained: str | None) -> ExplainedBytes:
    """A frame that the manual prints for something else, with what it says about that."""
    return piece if explained is None else replace(piece, meaning=f"{piece.meaning}. {explained}", kept=None)


def _header(buffer: bytearray, start: int) -> int:
    """The position of the next header from `start` on, len(buffer) if there is none."""
    places = [place for place in (buffer.find(eb90.HOST, start), buffer.find(eb90.DEVICE, start)) if place >= 0]
    return min(places, default=len(buffer))


def _size(buffer: bytearray, start: int) -> int | None:
    """Bytes of the frame that begins at `start`: None = its length has not come, 0 = no frame has that length."""
    if len(buffer) < start + 4:
        return None
    length = buffer[start + 3]
    return length + eb90.OVERHEAD if length >= eb90.MIN_LENGTH else 0


def _valid(buffer: bytearray, start: int, size: int) -> bool:
    return eb90.checksum(bytes(buffer[start + 2 : start + size - 1])) == buffer[start + size - 1]


def _inner(buffer: bytearray, end: int) -> tuple[int, int]:
    """Where inside a failed frame a whole, valid one begins, and where one that is not complete yet; 0 = nowhere."""
    begun = 0
    place = _header(buffer, 1)
    while place < end:
        size = _size(buffer, place)
        if size is None or place + size > len(buffer):
            begun = begun or place
        elif size and _valid(buffer, place, size):
            return place, begun
        place = _header(buffer, place + 1)
    return 0, begun


# -- what writes, and what acknowledges it (see model.write_ledger) ---------------------------------------------------------

CALIBRATION_SECONDS = 30.0
"""The longest that a calibration is waited for, on any hand (`exo.calibration`; an RH56 hand needs less)."""
SHORTEST = 7
"""Bytes of a request up to its address."""


class InspireWriteRules(WriteRules):
    """One connection to an exo, a wrist or a hand, on whichever wire."""

    def __init__(self, shown: InspireExplainer) -> None:
        self._shown = shown
        self._own: dict[int | None, bytes] = {}
        """What went out last whose acknowledgement may look as it does: under each CAN id, and of Modbus RTU."""
        self._begun = b""
        """Of a frame that what is sent next may complete."""
        self._save: tuple[str, object] = ("", None)
        """Key and id of a save, whose acknowledgement tells only that its result will come."""

    def sent(self, data: bytes, can_id: int | None) -> Sequence[Written]:
        """See WriteRules."""
        found: list[Written] = []
        if can_id is None and eb90.only_reads(data):  # nearly all that is sent, and nothing follows from it
            return found
        for piece in self._shown.sent(data, can_id):
            same = self.planned(piece.raw, can_id)
            if same is None:
                continue
            calibrates = piece.fields.get("address") == self._shown.places["calibrate"]
            lasts = CALIBRATION_SECONDS if calibrates else 0.0
            names = piece.fields.get("address") == self._shown.places["id"]
            new = next((int(one.value or 0) for one in piece.values if one.name == "id"), 0) if names else 0
            self._begun = b"" if piece.frame else (self._begun + piece.raw)[-LARGEST:]
            to = next(iter(self.addressed(self._begun or piece.raw, can_id)), None)
            found.append(Written(piece.raw, piece.asks or None, same, can_id=can_id, lasts=lasts, to=to, new_id=new))
            if can_id is not None or mode_of(piece.raw) == RTU:
                self._own[can_id] = piece.raw
            elif piece.fields.get("address") == self._shown.places["save"] and "flag" in piece.fields:
                self._save = piece.asks, piece.fields["id"]
        return found

    def came(self, data: bytes, can_id: int | None) -> Iterable[tuple[Hashable, bool]]:
        """See WriteRules."""
        for piece in self._shown.feed(DEVICE, data, can_id):
            if piece.problem not in ("", "refused") or piece.raw == self._own.get(can_id):
                continue  # what may be our own write coming back: who asked knows whether it is
            if piece.problem and (mode := mode_of(piece.raw)) and pdu_of(piece.raw, mode)[1] in modbus_frames.UNSURE:
                continue  # it is no refusal
            key, (save, by) = piece.answers, self._save
            if save and key == save and not piece.problem:
                continue
            place = piece.fields.get("address"), piece.fields.get("id")
            if save and not key and place == (self._shown.places["save"], by):
                key = save  # its result
            if key:
                yield key, not piece.problem

    def planned(self, data: bytes, can_id: int | None) -> Hashable:
        """See WriteRules."""
        if can_id is not None:
            reads = can_frames.parse_identifier(can_id).flag in (can_frames.READ_HAND, can_frames.READ_WRIST)
            return None if reads else (can_id, data)
        if mode := mode_of(data):
            pdu = pdu_of(data, mode)
            # without the running number, but with the device that it is for
            return None if modbus_frames.only_reads(pdu) else data[2:] if mode == TCP else data
        reads = data[:2] == eb90.HOST and len(data) == 9 and data[3] == 4 and data[4] in (eb90.READ, eb90.WRIST_READ)
        return None if reads or eb90.only_reads(data) else data

    def split(self, data: bytes, can_id: int | None) -> Sequence[bytes]:
        """See WriteRules."""
        one = data[:2] == eb90.HOST and len(data) > 3 and len(data) == data[3] + eb90.OVERHEAD
        if one or can_id is not None or mode_of(data):
            return (data,)
        return [piece.raw for piece in InspireExplainer(self._shown.params).sent(data)]

    def addressed(self, data: bytes, can_id: int | None) -> list[Addressee]:
        """See WriteRules. A wrist module passes on what is for the hand that is attached to it."""
        if can_id is not None:
            access = can_frames.parse_identifier(can_id)
            return [(self._kind(access.flag, can_frames.WRITE_WRIST), access.hand_id)]
        if mode := mode_of(data):
            return [(self._shown.params.kind, data[modbus_frames.MBAP - 1 if mode == TCP else 0])]
        found, at = [], data.find(eb90.HOST)
        while 0 <= at < len(data) - 4:
            found.append((self._kind(data[at + 4], eb90.WRIST_WRITE), data[at + 2]))
            at = data.find(eb90.HOST, at + data[at + 3] + eb90.OVERHEAD)
        return found

    def _kind(self, flag: int, of_wrist: int) -> str:
        """Whose write this is."""
        return "exo" if self._shown.is_exo else "wrist" if flag == of_wrist else "hand"

    def next(self, data: bytes, can_id: int | None) -> str:
        """See WriteRules."""
        params, wrist = self._shown.params, self._shown.is_wrist
        if can_id is not None:
            access = can_frames.parse_identifier(can_id)
            return self._read(access.address, len(data), of_hand=wrist and access.flag == can_frames.WRITE_HAND)
        if mode := mode_of(data):
            return self._read(int.from_bytes(pdu_of(data, mode)[1:3], "big"), 2)
        flag = data[4] if len(data) > 4 else 0
        if self._shown.is_exo and flag in eb90.COMMANDS:
            return f"`handctl exo get {eb90.COMMANDS[flag]}_set position_actual`"
        if flag not in (eb90.WRITE, eb90.WRIST_WRITE) or len(data) <= SHORTEST + 1:
            return f"`handctl {params.kind} dump`"
        address = int.from_bytes(data[5:7], "little")
        return self._read(address, len(data) - SHORTEST - 1, of_hand=wrist and flag == eb90.WRITE)

    def _read(self, address: int, count: int, *, of_hand: bool = False) -> str:
        if of_hand:
            return f"`handctl wrist hand-read {address} {count}`"
        kind = self._shown.params.kind
        for param in self._shown.params:
            if address * self._shown.per in param.span:
                if param.name == "id":
                    return f"`handctl {kind} scan` finds the id"
                if param.name in ("save", "factory_reset"):
                    return f"switch the power off and on, then `handctl {kind} dump`"
                if param.trigger or not param.readable:
                    return f"`handctl {kind} status`"
                return f"`handctl {kind} get {param.name}`"
        return f"`handctl {kind} read {address} {count}`"
