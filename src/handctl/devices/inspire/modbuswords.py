"""What recorded Modbus bytes of the RH56 hands mean, and which of them write; beside EB 90 on the same pair.

Which of the two protocols a stretch is, its first bytes tell: EB 90 has its mark. A Modbus TCP frame has two zeros and a
length that fits; what remains is RTU, which its CRC proves.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence

from handctl.devices.inspire import eb90, modbus
from handctl.devices.inspire.canwords import CanWords
from handctl.devices.inspire.eb90 import Frame as Eb90Frame
from handctl.devices.inspire.explain import InspireExplainer
from handctl.devices.inspire.generations import Generation, Generations
from handctl.devices.inspire.map import Register
from handctl.devices.inspire.spans import describe, span_name, span_parts, span_values
from handctl.devices.inspire.writes import InspireWrites
from handctl.model.frames import frames_in
from handctl.model.ledger import Frame
from handctl.model.param import ParamMap
from handctl.model.piece import DEVICE, HOST, Cut, Later, Part, Piece, Value, stray
from handctl.sentence import plural

RTU, TCP = "rtu", "tcp"
FUNCTIONS = (modbus.READ, modbus.WRITE_ONE, modbus.WRITE_MANY)


def is_eb90(data: bytes | bytearray) -> bool:
    """Whether these bytes begin as an EB 90 frame does."""
    return bytes(data[:2]) in (eb90.HOST, eb90.DEVICE) or bytes(data[:2]) in (eb90.HOST[:1], eb90.DEVICE[:1])


def tcp_size(data: bytes | bytearray) -> int:
    """Bytes of the Modbus TCP frame that begins here; 0 where none does."""
    if len(data) < modbus.MBAP + 1 or data[2:4] != b"\0\0":
        return 0
    length = int.from_bytes(data[4:6], "big")
    fits = 3 <= length <= 254 and data[7] & ~modbus.FAILED in FUNCTIONS
    return length + 6 if fits else 0


def rtu_sizes(data: bytes | bytearray) -> list[int]:
    """Bytes that an RTU frame which begins here may have: as a question, as an answer, as a refusal."""
    if len(data) < 3 or not 1 <= data[0] <= 254:
        return []
    function = data[1]
    if function & modbus.FAILED:
        return [5] if function & ~modbus.FAILED in FUNCTIONS else []
    if function == modbus.READ:
        return [8, data[2] + 5]
    if function == modbus.WRITE_ONE:
        return [8]
    if function == modbus.WRITE_MANY:
        return [8, *([data[6] + 9] if len(data) > 6 else [])]
    return []


def rtu_size(data: bytes | bytearray) -> int:
    """Bytes of the whole RTU frame that begins here, by its CRC; 0 where none does."""
    for size in rtu_sizes(data):
        if 5 <= size <= len(data) and modbus.crc(bytes(data[: size - 2])) == data[size - 2 : size]:
            return size
    return 0


def pdu_of(frame: bytes, mode: str) -> bytes:
    """What is inside the envelope."""
    return frame[modbus.MBAP :] if mode == TCP else frame[1:-2]


def mode_of(frame: bytes) -> str:
    """Which envelope a whole frame has; "" = none of Modbus."""
    if is_eb90(frame):
        return ""
    if tcp_size(frame) == len(frame):
        return TCP
    return RTU if rtu_size(frame) == len(frame) else ""


class EitherExplainer(InspireExplainer):
    """One conversation on a wire of an RH56 hand.

    known  its generation may be any of these, the first, which has this map, until another one shows itself;
           without any it is that of the map
    """

    def __init__(self, params: ParamMap[Register], known: Sequence[Generation] = ()) -> None:
        super().__init__(params)
        self._generations = Generations(known or [Generation((), "", params, next(iter(params)).per, lambda _: "")])
        self._adopt()
        self._questions: dict[str, bytes] = {}
        """Key of an answer -> the PDU that asked for it."""

    @property
    def params(self) -> ParamMap[Register]:
        """The map that is taken now."""
        return self._map

    def _adopt(self) -> None:
        """Name everything by the map that holds now."""
        now = self._generations.now
        self._map, self._per = now.params, now.per
        self._can = CanWords(now.params)
        places = {"id": "id", "save": "save", "calibrate": "calibrate_force"}
        self._places = {role: now.params[name].place_of(0) for role, name in places.items()}
        self._known.clear()

    def event(self, text: str) -> None:
        """See Explainer."""
        if self._generations.event(text):
            self._adopt()

    def _heard(self, address: int, data: bytes) -> None:
        """An answer to a read: it may show the generation, and is named by its map then."""
        if len(data) > 1 and self._generations.answer(address, data):
            self._adopt()

    def _explain(self, frame: Eb90Frame) -> tuple[str, str, str, str, Sequence[Value]]:
        """See InspireExplainer. While the generation is open, what the others have there is said too."""
        address = frame.address
        reads, writes = frame.flag == eb90.READ, frame.flag == eb90.WRITE
        if address is None or not (reads or writes):
            return super()._explain(frame)
        if reads and frame.from_device:
            self._heard(address, frame.data)
        meaning, *rest = super()._explain(frame)
        asked = reads and not frame.from_device and len(frame.data) == 1
        count, data = (frame.data[0], b"") if asked else (len(frame.data), frame.data)
        if not (writes and frame.from_device) and "result" not in meaning:
            meaning += self._generations.beside(address, count, writes=writes, data=data)
        return meaning, *rest  # type: ignore[return-value]

    def recognises(self, data: bytes, can_id: int | None = None) -> bool:
        """See Explainer. An EB 90 frame with flag 11 or 12 is an exoskeleton hand's as well: that family comes first."""
        return can_id is None and mode_of(data) != ""

    def cut(self, buffer: bytearray, side: str, *, final: bool) -> Cut:
        if is_eb90(buffer):
            return super().cut(buffer, side, final=final)
        for size, mode in ((tcp_size(buffer), TCP), (rtu_size(buffer), RTU)):
            if size and size <= len(buffer):
                return Cut(size, mode=mode)
        waits = (
            tcp_size(buffer) > len(buffer) or any(size > len(buffer) for size in rtu_sizes(buffer)) or len(buffer) < 3
        )
        if waits and not final:
            return Cut(0)
        places = [place for place in range(1, len(buffer)) if self._begins(buffer[place:])]
        return Cut(places[0] if places else len(buffer), "stray")

    def _begins(self, rest: bytearray) -> bool:
        return bytes(rest[:2]) in (eb90.HOST, eb90.DEVICE) or 0 < tcp_size(rest) <= len(rest) or rtu_size(rest) > 0

    def side_of(self, raw: bytes, cut: Cut) -> str:
        if not cut.mode:
            return super().side_of(raw, cut)
        pdu = pdu_of(raw, cut.mode)
        return HOST if modbus.only_reads(pdu) or (pdu[0] == modbus.WRITE_MANY and len(pdu) > 5) else DEVICE

    def piece(self, direction: str, raw: bytes, cut: Cut) -> Piece:
        if not cut.mode:
            return stray(direction, raw) if cut.problem == "stray" else super().piece(direction, raw, cut)
        pdu = pdu_of(raw, cut.mode)
        unit = raw[6] if cut.mode == TCP else raw[0]
        # Order, not the transaction, pairs an answer: some hands count wrongly (rh56 §2.3).
        key = f"{cut.mode} {'' if cut.mode == TCP else unit} {pdu[0] & ~modbus.FAILED}"
        where = f"transaction {int.from_bytes(raw[:2], 'big')}" if cut.mode == TCP else f"id {unit}"
        echo = direction == DEVICE and modbus.only_reads(pdu)
        if direction == HOST or echo:
            meaning, title, address, data = self._question(pdu)
            meaning = f"our own bytes came back: {meaning}" if echo else meaning
            self._questions[key] = self._questions.get(key, pdu) if echo else pdu
        else:
            meaning, title, address, data = self._answer(pdu, self._questions.get(key))
        problem = "echo" if echo else "refused" if pdu[0] & modbus.FAILED else ""
        params, per = self._map, self._per  # as they are now: values and parts are made when somebody looks
        return Piece(
            direction=direction, raw=raw, meaning=f"{meaning}, {where}", title=title, problem=problem,
            asks=key if direction == HOST else "", answers=key if direction == DEVICE and not echo else "",
            fields={"id": unit, "function": pdu[0], "address": address},
            values=Later(lambda: span_values(params, address * per, data) if address is not None else ()),
            parts=Later(lambda: self._fields(raw, cut.mode, None if address is None else address * per, data, params)),
        )  # fmt: skip

    def _question(self, pdu: bytes) -> tuple[str, str, int | None, bytes]:
        address = int.from_bytes(pdu[1:3], "big")
        at, beside = address * self._per, self._generations.beside
        if pdu[0] == modbus.READ:
            words = int.from_bytes(pdu[3:5], "big")
            text = f"read {span_name(self._map, at, 2 * words)}: {words} register{'s' * (words != 1)} at {address}"
            return text + beside(address, 2 * words, writes=False), "", address, b""
        data = modbus.to_memory(pdu[3:5] if pdu[0] == modbus.WRITE_ONE else pdu[6:])
        text = f"write {describe(self._map, at, data)} at {address}"
        title = f"write {span_name(self._map, at, len(data))}"
        return text + beside(address, len(data), writes=True), title, address, data

    def _answer(self, pdu: bytes, asked: bytes | None) -> tuple[str, str, int | None, bytes]:
        if pdu[0] & modbus.FAILED:
            code = pdu[1] if len(pdu) > 1 else 0
            return f"refused: exception {code:02X}, {modbus.EXCEPTIONS.get(code, 'unknown')}", "refused", None, b""
        if pdu[0] != modbus.READ:
            address = int.from_bytes(pdu[1:3], "big")
            return f"accepted: write at {address} {span_name(self._map, address * self._per, 1)}", "", address, b""
        data = modbus.to_memory(pdu[2:])
        if asked is None:
            return (
                f"{plural(len(data) // 2, 'register')}, not asked for here: {data.hex(' ').upper()}",
                "others",
                None,
                b"",
            )
        address = int.from_bytes(asked[1:3], "big")
        self._heard(address, data)
        text = describe(self._map, address * self._per, data)
        return text + self._generations.beside(address, len(data), writes=False, data=data), "", address, data

    def _fields(
        self, raw: bytes, mode: str, address: int | None, data: bytes, params: ParamMap[Register]
    ) -> list[Part]:
        pdu = pdu_of(raw, mode)
        head = raw[: modbus.MBAP] if mode == TCP else raw[:1]
        found = [Part(head, "header" if mode == TCP else "unit", f"Modbus {mode.upper()}")]
        found.append(Part(pdu[:1], "function", f"{pdu[0]:02X}"))
        values = span_parts(params, address, data) if address is not None and data else []
        rest = pdu[1 : len(pdu) - len(data)] if values else pdu[1:]
        found.append(Part(rest, "address, count", ""))
        found += [Part(modbus.to_memory(part.raw), part.name, part.meaning) for part in values]
        if mode == RTU:
            found.append(Part(raw[-2:], "CRC", "right"))
        return found


class EitherWrites(InspireWrites):
    """One connection to an RH56 hand, on whichever wire.

    shown  the explainer that the same bytes go through: they show the generation, and so what an address does
    """

    def __init__(self, params: ParamMap[Register], shown: EitherExplainer | None = None) -> None:
        super().__init__(params)
        self._shown = shown or EitherExplainer(params)
        self._request: bytes | None = None
        self._modbus: modbus.TcpDecoder | modbus.RtuDecoder | None = None

    def _see(self, side: str, data: bytes, can_id: int | None) -> None:
        """What passes on the wire may show another generation."""
        before = self._shown.params
        self._shown.feed(side, data, can_id)
        params = self._shown.params
        if params is not before:
            self._map, self._per = params, next(iter(params)).per
            self._places = {name: params[name].place_of(0) for name in self._places}

    def sent(self, data: bytes, can_id: int | None) -> Sequence[Frame]:
        """See WriteWords."""
        self._see(HOST, data, can_id)
        mode = mode_of(data) if can_id is None else ""
        if not mode:
            return super().sent(data, can_id)
        pdu = pdu_of(data, mode)
        if modbus.only_reads(pdu):
            self._request = None
            return ()
        self._request, self._asked_by = pdu, mode
        self._modbus = modbus.TcpDecoder() if mode == TCP else modbus.RtuDecoder(data[0], pdu)
        return (Frame(data, (mode, pdu), (mode, pdu)),)

    def came(self, data: bytes, can_id: int | None) -> Iterable[tuple[Hashable, bool]]:
        """See WriteWords."""
        self._see(DEVICE, data, can_id)
        if can_id is not None or self._request is None or self._modbus is None:
            return super().came(data, can_id)
        self._modbus.feed(data)
        return [
            ((self._asked_by, self._request), answer.exception is None)
            for answer in frames_in(self._modbus)
            if modbus.answers(answer.pdu, self._request)
        ]

    def planned(self, data: bytes, can_id: int | None) -> Hashable:
        """See WriteWords."""
        mode = mode_of(data) if can_id is None else ""
        if not mode:
            return super().planned(data, can_id)
        pdu = pdu_of(data, mode)
        return None if modbus.only_reads(pdu) else (mode, pdu)

    def next(self, data: bytes, can_id: int | None) -> str:
        """See WriteWords."""
        mode = mode_of(data) if can_id is None else ""
        if not mode:
            return super().next(data, can_id)
        pdu = pdu_of(data, mode)
        return self._read(self._map.kind, int.from_bytes(pdu[1:3], "big"), 2, of_hand=False)
