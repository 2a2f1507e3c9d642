"""What recorded CAN frames of the Inspire family mean (wrist §2.3). Request and reply carry the same identifier."""

from __future__ import annotations

from handctl.devices.inspire import canreg
from handctl.devices.inspire.map import WRIST, Register
from handctl.devices.inspire.spans import describe, span_name, span_parts, span_values
from handctl.model.param import ParamMap
from handctl.model.piece import DEVICE, HOST, Part, Piece

KINDS = {0: "read hand", 1: "write hand", 4: "read wrist", 5: "write wrist"}
LARGEST = 256
"""Questions that are remembered: a bus may be full of those of others."""


class CanWords:
    """One bus. Which frame answers which is told by what was asked before."""

    def __init__(self, params: ParamMap[Register]) -> None:
        self._map = params
        self._asked: dict[int, bytes] = {}

    def explain(self, direction: str, can_id: int, data: bytes) -> Piece:
        """A recorded frame."""
        if direction == HOST:
            self._asked.pop(can_id, None)
            self._asked[can_id] = data
            if len(self._asked) > LARGEST:
                del self._asked[next(iter(self._asked))]
            return self._request(can_id, data)
        asked = self._asked.get(can_id)
        if asked is None:
            words = self._answer_words(can_id, data) if len(data) != 1 else self._request_words(can_id, data)
            return self._made(DEVICE, can_id, data, f"not asked for here: {words}", title=f"others {can_id:08X}")
        access = canreg.parse_identifier(can_id)
        fits = len(data) <= 1 and (data != asked or data == b"\x01") if access.writes else [len(data)] == list(asked)
        if fits:
            del self._asked[can_id]
            return self._answer(can_id, data, asked)
        if data == asked:
            words = self._request_words(can_id, data)
            return self._made(DEVICE, can_id, data, f"our own frame came back: {words}", problem="echo")
        count = "an acknowledgement" if access.writes else f"{asked[0] if len(asked) == 1 else '?'} bytes"
        words = self._answer_words(can_id, data)
        return self._made(DEVICE, can_id, data, f"{words} ({count} expected, {len(data)} came)", problem="cut-short")

    def decode(self, side: str, can_id: int, data: bytes) -> Piece:
        """A frame without a conversation: a read of one byte is a question, a write with data a request."""
        writes = canreg.parse_identifier(can_id).writes
        asks = len(data) == 1 if not writes else len(data) > 0
        if side == HOST or (not side and asks):
            return self._request(can_id, data)
        return self._answer(can_id, data, None)

    def _request(self, can_id: int, data: bytes) -> Piece:
        access = canreg.parse_identifier(can_id)
        title = f"write {span_name(self._space(access.flag), access.address, len(data))}" if access.writes else ""
        return self._made(HOST, can_id, data, self._request_words(can_id, data), title=title, key=f"{can_id:08X}")

    def _answer(self, can_id: int, data: bytes, asked: bytes | None) -> Piece:
        short = canreg.parse_identifier(can_id).writes and asked is not None and data not in (b"", bytes([len(asked)]))
        words = self._answer_words(can_id, data)
        problem = "refused" if short else ""
        return self._made(DEVICE, can_id, data, words, problem=problem, key=f"{can_id:08X}")

    def _space(self, flag: int) -> ParamMap[Register] | None:
        wrist = flag in (canreg.READ_WRIST, canreg.WRITE_WRIST)
        return self._map if flag in KINDS and wrist == (self._map is WRIST) else None

    def _request_words(self, can_id: int, data: bytes) -> str:
        access = canreg.parse_identifier(can_id)
        space, where = self._space(access.flag), f"id {access.hand_id}"
        if access.flag not in KINDS:
            return f"flag {access.flag}, which is not in the manual, address {access.address}, {where}"
        other = "" if space is not None else " of the hand's own registers"
        if access.writes:
            text = describe(space, access.address, data)
            return f"write {text}{'' if space is not None else f' at {access.address}'}{other}, {where}"
        count = data[0] if len(data) == 1 else None
        if count is None:
            return f"read at {access.address}{other} without a count, {where}"
        name = span_name(space, access.address, count)
        return f"read {name}: {count} {'byte' if count == 1 else 'bytes'} at {access.address}{other}, {where}"

    def _answer_words(self, can_id: int, data: bytes) -> str:
        access = canreg.parse_identifier(can_id)
        space, where = self._space(access.flag), f"id {access.hand_id}"
        if access.flag not in KINDS:
            return f"flag {access.flag}, which is not in the manual, address {access.address}, {where}"
        if access.writes and len(data) <= 1:
            count = "" if not data else f", {data[0]} bytes written"
            return f"acknowledged: write at {access.address} {span_name(space, access.address, 1)}{count}, {where}"
        at = f" at {access.address} of the hand's own registers" if space is None else ""
        return f"{describe(space, access.address, data)}{at}, {where}"

    def _made(
        self,
        direction: str,
        can_id: int,
        data: bytes,
        meaning: str,
        *,
        title: str = "",
        problem: str = "",
        key: str = "",
    ) -> Piece:
        access = canreg.parse_identifier(can_id)
        space = self._space(access.flag)
        holds = access.writes == (direction == HOST) and bool(data) and problem != "echo"
        kind = KINDS.get(access.flag, "not in the manual")
        what = f"{access.address} {span_name(space, access.address, max(1, len(data)))}"
        parts = [Part(can_id.to_bytes(4, "big"), "identifier", f"{kind}, address {what}, id {access.hand_id}")]
        if holds:
            parts += span_parts(space, access.address, data)
        elif data:
            parts.append(Part(data, "written" if access.writes else "count", " ".join(map(str, data))))
        return Piece(
            direction=direction, raw=data, can_id=can_id, title=title, problem=problem,
            meaning=meaning,
            asks=key if direction == HOST else "", answers=key if direction == DEVICE else "",
            fields={"id": access.hand_id, "flag": str(access.flag), "address": access.address},
            values=span_values(space, access.address, data) if holds else (), parts=tuple(parts),
        )  # fmt: skip
