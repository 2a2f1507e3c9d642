"""Which bytes of the Inspire family write, what acknowledges them, what to read when nothing does (see `ledger`).

What a frame means, and which answer belongs to it, the explainer of the same conversation says. What is no read request
counts as a write, whatever it is: nobody knows what a damaged frame does.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence

from handctl.devices.inspire import canreg, eb90, modbus
from handctl.devices.inspire.explain import InspireExplainer
from handctl.devices.inspire.map import EXO, WRIST
from handctl.devices.inspire.modbus import mode_of, pdu_of
from handctl.model.ledger import Frame
from handctl.model.piece import DEVICE

COMMANDS = {eb90.FORCE_COMMAND: "force_set", eb90.POSITION_COMMAND: "position_set"}
SHORTEST = 7
"""Bytes of a request up to its address."""


class InspireWrites:
    """One connection to an exo, a wrist or a hand, on whichever wire."""

    def __init__(self, shown: InspireExplainer) -> None:
        self._shown = shown
        self._can: dict[int, bytes] = {}
        self._save = ""
        """Key of a save, whose acknowledgement tells only that its result will come."""

    def sent(self, data: bytes, can_id: int | None) -> Sequence[Frame]:
        """See WriteWords."""
        found, pieces = [], self._shown.sent(data, can_id)
        for piece in pieces if can_id is not None or not eb90.only_reads(data) else ():
            same = self.planned(piece.raw, can_id)
            if same is None:
                continue
            found.append(Frame(piece.raw, piece.asks or None, same, can_id=can_id))
            if can_id is not None:
                self._can[can_id] = data
            elif piece.fields.get("address") == self._shown.places["save"] and "flag" in piece.fields:
                self._save = piece.asks
        return found

    def came(self, data: bytes, can_id: int | None) -> Iterable[tuple[Hashable, bool]]:
        """See WriteWords."""
        for piece in self._shown.feed(DEVICE, data, can_id):
            if can_id is not None and data == self._can.get(can_id):
                continue  # what may be our own write coming back: who asked knows whether it is
            if self._save and piece.answers == self._save and not piece.problem:
                continue
            key = piece.answers
            if self._save and not key and piece.fields.get("address") == self._shown.places["save"]:
                key = self._save  # its result
            if key:
                yield key, not piece.problem

    def planned(self, data: bytes, can_id: int | None) -> Hashable:
        """See WriteWords."""
        if can_id is not None:
            reads = canreg.parse_identifier(can_id).flag in (canreg.READ_HAND, canreg.READ_WRIST)
            return None if reads else (can_id, data)
        if mode := mode_of(data):
            pdu = pdu_of(data, mode)
            return None if modbus.only_reads(pdu) else (mode, pdu)
        reads = data[:2] == eb90.HOST and len(data) == 9 and data[3] == 4 and data[4] in (eb90.READ, eb90.WRIST_READ)
        return None if reads or eb90.only_reads(data) else data

    def next(self, data: bytes, can_id: int | None) -> str:
        """See WriteWords."""
        params, wrist = self._shown.params, self._shown.params is WRIST
        if can_id is not None:
            access = canreg.parse_identifier(can_id)
            return self._read(access.address, len(data), of_hand=wrist and access.flag == canreg.WRITE_HAND)
        if mode := mode_of(data):
            return self._read(int.from_bytes(pdu_of(data, mode)[1:3], "big"), 2)
        flag = data[4] if len(data) > 4 else 0
        if params is EXO and flag in COMMANDS:
            return f"`handctl exo get {COMMANDS[flag]} position_actual`"
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
