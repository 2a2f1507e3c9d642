"""What recorded bytes of the Inspire family mean: EB 90 frames and CAN frames in words, by the map of exo or wrist.

Bytes in, pieces out; knows no link. The wrist's registers are reached through flags 30 and 31 (CAN 4 and 5), a hand's
through 11 and 12 (CAN 0 and 1): what lies in the other space has no names here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from handctl.devices.inspire import eb90
from handctl.devices.inspire.canwords import CanWords
from handctl.devices.inspire.eb90 import FORCE_COMMAND, POSITION_COMMAND, READ, WRIST_READ, WRIST_WRITE, WRITE, Frame
from handctl.devices.inspire.map import EXO, FINGERS, WRIST, Register
from handctl.devices.inspire.spans import describe, span_name, span_parts, span_values
from handctl.devices.inspire.wrist.raw import CAN_MISPRINTS, MISPRINTS
from handctl.model.param import ParamMap
from handctl.model.piece import DEVICE, HOST, Cut, Cutter, Later, Part, Piece, Value, stray
from handctl.sentence import plural

CALIBRATION_END = 2
"""Address field of the frame that ends a calibration (RH56 ch. 3 ex. 5)."""
RESULTS = {0x00: "saved", 0xFF: "not saved"}
"""Data of the late result frame of a save (RH56 §2.2.2)."""

MOST_KNOWN = 1024


class InspireExplainer(Cutter):
    """One conversation. Frames are found at every offset; one that fails gives way to a whole one inside it."""

    def __init__(self, params: ParamMap[Register]) -> None:
        super().__init__()
        self._map = params
        self._per = 1
        """Bytes at one address of a frame: 2 where the device counts words (rh56 §3.2)."""
        self._places = {name: EXO[name].address for name in ("id", "save", "calibrate")}
        """Addresses of the writes that something follows."""
        self._can = CanWords(params)
        self._new_id: tuple[int, int] | None = None
        self._known: dict[Frame, tuple[str, Sequence[Value]]] = {}
        """Words of frames told before: the same come again and again."""
        self._started = 0
        """Address of the save or calibration whose late frame may still come."""

    def feed(self, direction: str, data: bytes, can_id: int | None = None) -> list[Piece]:
        """See Explainer."""
        if can_id is not None:
            return [self._can.explain(direction, can_id, data)]
        return super().feed(direction, data)

    def decode(self, data: bytes, side: str = "", can_id: int | None = None) -> list[Piece]:
        """See Explainer. The header says who sent a frame."""
        if can_id is not None:
            return [_annotated(self._can.decode(side, can_id, data), CAN_MISPRINTS.get((can_id, data)))]
        host, device = (data.find(header) if header in data else len(data) for header in (eb90.HOST, eb90.DEVICE))
        self._guess = DEVICE if device < host else HOST
        misprints = MISPRINTS if self._map is WRIST else {}
        return [_annotated(piece, misprints.get(piece.raw)) for piece in super().decode(data, side)]

    def recognises(self, data: bytes, can_id: int | None = None) -> bool:
        """See Explainer."""
        if can_id is not None:
            return self._map is WRIST
        header = data[:2] in (eb90.HOST, eb90.DEVICE)
        return header and (data[4:5] in (b"\x30", b"\x31") and len(data) != 16) == (self._map is WRIST)

    # -- frames -------------------------------------------------------------------------------------------------------

    def cut(self, buffer: bytearray, side: str, *, final: bool) -> Cut:
        start = _header(buffer, 0)
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

    def side_of(self, raw: bytes, cut: Cut) -> str:
        """By the header; what is none goes with what stands before it."""
        if raw[:2] in (eb90.HOST, eb90.DEVICE):
            self._guess = HOST if raw[:2] == eb90.HOST else DEVICE
        return self._guess

    def piece(self, direction: str, raw: bytes, cut: Cut) -> Piece:
        problem = cut.problem
        if problem == "stray":
            if direction == HOST and not raw.strip(b"\0"):
                return stray(direction, raw, "ahead of the first question", "")
            return stray(direction, raw)
        if problem == "cut-short":
            whole = raw[3] + eb90.OVERHEAD if len(raw) > 3 else None
            of = f" of {whole}" if whole else ""
            return stray(direction, raw, f"the beginning of a frame, cut off after {len(raw)}{of} bytes", problem)
        if problem == "bad-checksum":
            return self._damaged(direction, raw)
        frame = Frame(raw[:2], raw[2], raw[4], raw[5:-1])
        if frame.from_device != (direction == DEVICE):
            who = "our own bytes came back" if direction == DEVICE else "bytes of a device, sent by the host"
            return self._made(direction, raw, frame, f"{who}: {self._words(frame)[0]}", problem="echo")
        meaning, title, key, problem, values = self._explain(frame)
        asks, answers = (key, "") if direction == HOST else ("", key)
        return self._made(
            direction, raw, frame, meaning, title=title, problem=problem, asks=asks, answers=answers, values=values
        )

    def _damaged(self, direction: str, raw: bytes) -> Piece:
        right = eb90.checksum(raw[2:-1])
        words = self._words(Frame(raw[:2], raw[2], raw[4], raw[5:-1]))[0]
        meaning = f"bad checksum {raw[-1]:02X}, should be {right:02X}. It would say: {words}"
        return Piece(
            direction=direction, raw=raw, meaning=meaning,
            problem="bad-checksum", frame=False, title="bad-checksum", fields={"checksum": f"{raw[-1]:02X}",
            "expected": f"{right:02X}"}, parts=Later(lambda: self._parts(raw)),
        )  # fmt: skip

    def _made(
        self, direction: str, raw: bytes, frame: Frame, meaning: str, *, title: str = "", problem: str = "",
        asks: str = "", answers: str = "", values: Sequence[Value] = (),
    ) -> Piece:  # fmt: skip
        fields: dict[str, int | str | None] = {"id": frame.id, "flag": f"{frame.flag:02X}", "address": frame.address}
        return Piece(
            direction=direction, raw=raw, meaning=meaning, title=title,
            problem=problem, asks=asks, answers=answers, values=values, fields=fields, parts=Later(lambda: self._parts(raw)),
        )  # fmt: skip

    def _explain(self, frame: Frame) -> tuple[str, str, str, str, Sequence[Value]]:
        """(meaning, title, key of request and answer, problem, values) of a valid frame."""
        words, values = self._words(frame)
        who, flag, address, size = frame.id, frame.flag, frame.address, len(frame.data)
        title = ""
        if self._commands(frame):
            whole = len(frame.payload) == (12 if frame.from_device and flag == FORCE_COMMAND else 10)
            return words, f"flag {flag:02X}", f"{who} {flag:02X}" if whole else "", "" if whole else "odd-frame", values
        if address is None:
            return words, title, "", "odd-frame", values
        name = span_name(self._space(flag), address * self._per, size)
        if flag in (READ, WRIST_READ):
            count = frame.data[0] if not frame.from_device and size == 1 else size
            return self._late(frame, words, values, f"{who} {flag:02X} {address} {count}")
        if flag not in (WRITE, WRIST_WRITE):
            return words, title, "", "odd-frame", values
        if not frame.from_device:
            changes_id = (
                self._map is not WRIST and address == self._places["id"] and flag == WRITE and size == self._per
            )
            self._new_id = (who, frame.data[0]) if changes_id else None
            self._started = address if frame.data == (1).to_bytes(self._per, "little") else 0
            return words, f"write {name}", f"{who} {flag:02X} {address} w", "", values
        if self._new_id is not None and who == self._new_id[1] and address == self._places["id"]:
            who = self._new_id[0]  # the acknowledgement comes from the new id
        key = f"{who} {flag:02X} {address} w"
        if size != 1:
            return words, "", "", "odd-frame", ()
        if frame.data != b"\x01" and self._is_result(frame):
            return self._late(frame, words, values, key)
        return words, title, key, "" if frame.data == b"\x01" else "refused", values

    def _is_result(self, frame: Frame) -> bool:
        return (
            self._map is not WRIST
            and frame.address == self._places["save"] == self._started
            and frame.data[0] in RESULTS
        )

    def _late(
        self, frame: Frame, words: str, values: Sequence[Value], key: str
    ) -> tuple[str, str, str, str, Sequence[Value]]:
        """A read or its answer; or the frame that tells the end of a save or a calibration, which nobody asks for."""
        if not frame.from_device or self._map is WRIST or len(frame.data) != 1:
            return words, "", key, "", values
        if self._is_result(frame):
            self._started = 0
            saved = frame.data[0] == 0
            return (
                f"result of the save: {RESULTS[frame.data[0]]}",
                "result of the save",
                "",
                "" if saved else "refused",
                (),
            )
        if frame.address == CALIBRATION_END and self._started == self._places["calibrate"]:
            self._started = 0
            return f"end of the calibration, code {frame.data[0]:02X}", "end of the calibration", "", "", ()
        return words, "", key, "", values

    # -- words --------------------------------------------------------------------------------------------------------

    def _space(self, flag: int) -> ParamMap[Register] | None:
        """The map behind a flag; None where this family member has no names."""
        return self._map if (flag in (WRIST_READ, WRIST_WRITE)) == (self._map is WRIST) else None

    def _commands(self, frame: Frame) -> bool:
        return self._map is EXO and frame.flag in (FORCE_COMMAND, POSITION_COMMAND) and frame.address is None

    def _words(self, frame: Frame) -> tuple[str, Sequence[Value]]:
        """A frame in words, and its values."""
        known = self._known.get(frame)
        if known is None:
            if len(self._known) >= MOST_KNOWN:
                self._known.clear()
            known = self._known[frame] = self._worded(frame)
        return known

    def _worded(self, frame: Frame) -> tuple[str, Sequence[Value]]:
        if self._commands(frame):
            return self._command(frame)
        where = f"id {frame.id}"
        space = self._space(frame.flag)
        address = int.from_bytes(frame.payload[:2], "little") if len(frame.payload) > 2 else None
        reads, writes = frame.flag in (READ, WRIST_READ), frame.flag in (WRITE, WRIST_WRITE)
        if address is None or not (reads or writes):
            return f"flag {frame.flag:02X}, which is not in the manual, {where}", ()
        at = address * self._per
        other = "" if space is not None else " of another register space"
        if reads and not frame.from_device and len(frame.data) == 1:
            count = frame.data[0]
            unit = "byte" if count == 1 else "bytes"
            return f"read {span_name(space, at, count)}: {count} {unit} at {address}{other}, {where}", ()
        if writes and frame.from_device and len(frame.data) == 1:
            verdict = "accepted" if frame.data == b"\x01" else f"not accepted ({frame.data.hex().upper()})"
            return f"{verdict}: write at {address} {span_name(space, at, 1)}{other}, {where}", ()
        text = describe(space, at, frame.data) + (f" at {address}{other}" if space is None else "")
        if writes and len(frame.data) == 8 and frame.flag == WRIST_WRITE:
            text += " (an exoskeleton hand takes it for a force command)"
        if writes and frame.from_device:
            return f"not an acknowledgement of a write, which has one byte: {frame.data.hex(' ').upper()}, {where}", ()
        return (f"write {text}, {where}" if writes else f"{text}, {where}"), Later(
            lambda: span_values(space, at, frame.data)
        )

    def _command(self, frame: Frame) -> tuple[str, Sequence[Value]]:
        """Force and position commands: five set values out; actual positions (six) or forces (five) back."""
        numbers = eb90.unpack_s16(frame.payload)
        kind = "force" if frame.flag == FORCE_COMMAND else "position"
        name = f"{kind}_set" if not frame.from_device else ("position_actual" if kind == "force" else "force_actual")
        parts = EXO[name].elements
        values = tuple(Value(f"{name}.{part}", number) for part, number in zip(parts, numbers, strict=False))
        text = " ".join(map(str, numbers))
        order = f"{FINGERS[0]} to {FINGERS[-1]}"
        if len(frame.payload) != 2 * len(parts):
            return (
                f"{kind} command with {plural(len(frame.payload), 'byte')}, {2 * len(parts)} expected: {text}, id {frame.id}",
                values,
            )
        if frame.from_device:
            return f"{kind} command taken: {name} = {text}, id {frame.id}", values
        return f"{kind} command, {order}: {text}, id {frame.id}", values

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
            space = self._space(frame.flag)
            at = address * self._per
            found.append(Part(raw[5:7], "address", f"{address} {span_name(space, at, 1)}"))
            if frame.flag in (READ, WRIST_READ) and not frame.from_device and len(frame.data) == 1:
                found.append(Part(frame.data, "count", f"{frame.data[0]} byte{'s' if frame.data[0] != 1 else ''}"))
            elif frame.flag in (WRITE, WRIST_WRITE) and frame.from_device and len(frame.data) == 1:
                found.append(Part(frame.data, "answer", "accepted" if frame.data == b"\x01" else "not accepted"))
            else:
                found += span_parts(space, at, frame.data)
        verdict = "right" if raw[-1] == right else f"wrong, should be {right:02X}"
        return (*found, Part(raw[-1:], "checksum", verdict))

    def _flag_name(self, frame: Frame) -> str:
        if self._commands(frame):
            return "force command" if frame.flag == FORCE_COMMAND else "position command"
        names = {READ: "read, hand", WRITE: "write, hand", WRIST_READ: "read, wrist", WRIST_WRITE: "write, wrist"}
        return names.get(frame.flag, "not in the manual")


def _annotated(piece: Piece, explained: str | None) -> Piece:
    """A frame that the manual prints for something else, with what it says about that."""
    return piece if explained is None else replace(piece, meaning=f"{piece.meaning}. {explained}")


def _header(buffer: bytearray, start: int) -> int:
    """Where a header stands from `start` on, len(buffer) if nowhere."""
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
