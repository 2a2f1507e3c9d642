"""Which bytes of the Inspire family write, what acknowledges them, what to read when nothing does (see `ledger`).

What is no read request counts as a write, whatever it is: nobody knows what a damaged frame does. On the serial wire the
acknowledgement names id, flag and address, and 01 accepts; a force or position command is answered with values (exo
§2.2.1, §2.2.2); on CAN the reply carries the identifier of the write (wrist §2.3.2).
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence

from handctl.devices.inspire import canreg, eb90
from handctl.devices.inspire.map import EXO, WRIST, Register
from handctl.model.frames import frames_in
from handctl.model.ledger import Frame
from handctl.model.param import ParamMap

READ_WRIST, WRITE_WRIST = 0x30, 0x31
COMMANDS = {eb90.FORCE_COMMAND: "force_set", eb90.POSITION_COMMAND: "position_set"}
SAVED, NOT_SAVED = 0x00, 0xFF
"""Data of the late result frame of a save (RH56 §2.2.2)."""
SHORTEST = 7
"""Bytes of a request up to its address."""


class InspireWrites:
    """One connection to an exo or a wrist."""

    def __init__(self, params: ParamMap[Register]) -> None:
        self._map = params
        self._own = params is not WRIST  # the hand's register space is its own
        self._per = 1
        """Bytes at one address of a frame: 2 where the device counts words (rh56 §3.2)."""
        self._places = {name: EXO[name].address for name in ("id", "save", "factory_reset")}
        """Addresses whose writes are acknowledged in a way of their own."""
        self._decoder = eb90.Decoder()
        self._key: Hashable = None
        self._can: tuple[int, bytes] | None = None

    # -- WriteWords ----------------------------------------------------------------------------------------------

    def sent(self, data: bytes, can_id: int | None) -> Sequence[Frame]:
        """See WriteWords."""
        if can_id is not None:
            if _reads_can(can_id):
                return ()
            self._can = can_id, data
            return (Frame(data, can_id, (can_id, data), can_id=can_id),)
        if eb90.only_reads(data):
            return ()
        return [self._frame(single) for single in _frames(data) if not _reads(single)]

    def came(self, data: bytes, can_id: int | None) -> Iterable[tuple[Hashable, bool]]:
        """See WriteWords."""
        if can_id is not None:
            sent = self._can
            if sent is None or can_id != sent[0] or len(data) > 1 or data == sent[1]:
                return ()  # longer, or what may be our own write coming back: who asked knows whether it is
            return ((can_id, not data or data[0] == len(sent[1])),)
        self._decoder.feed(data)
        verdicts = [self._verdict(frame) for frame in frames_in(self._decoder)]
        return [(self._key, verdict) for verdict in verdicts if verdict is not None]

    def planned(self, data: bytes, can_id: int | None) -> Hashable:
        """See WriteWords."""
        if can_id is not None:
            return None if _reads_can(can_id) else (can_id, data)
        return None if _reads(data) else data

    def next(self, data: bytes, can_id: int | None) -> str:
        """See WriteWords."""
        kind = self._map.kind
        if can_id is not None:
            access = canreg.parse_identifier(can_id)
            return self._read(
                kind, access.address, len(data), of_hand=not self._own and access.flag == canreg.WRITE_HAND
            )
        flag = data[4] if len(data) > 4 else 0
        if self._map is EXO and flag in COMMANDS:
            return f"`handctl exo get {COMMANDS[flag]} position_actual`"
        if flag not in (eb90.WRITE, WRITE_WRIST) or len(data) <= SHORTEST + 1:
            return f"`handctl {kind} dump`"
        address = int.from_bytes(data[5:7], "little")
        return self._read(kind, address, len(data) - SHORTEST - 1, of_hand=not self._own and flag == eb90.WRITE)

    # -- frames --------------------------------------------------------------------------------------------------

    def _read(self, kind: str, address: int, count: int, *, of_hand: bool) -> str:
        if of_hand:
            return f"`handctl wrist hand-read {address} {count}`"
        for param in self._map:
            if address * self._per in param.span:
                if param.name == "id":
                    return f"`handctl {kind} scan` finds the id"
                if param.name in ("save", "factory_reset"):
                    return f"switch the power off and on, then `handctl {kind} dump`"
                if param.trigger or not param.readable:
                    return f"`handctl {kind} status`"
                return f"`handctl {kind} get {param.name}`"
        return f"`handctl {kind} read {address} {count}`"

    def _frame(self, data: bytes) -> Frame:
        key: Hashable = None
        if data[:2] == eb90.HOST and len(data) >= SHORTEST:
            device_id, flag = data[2], data[4]
            prefixes = []
            if self._map is EXO and flag in COMMANDS and len(data) == 16:
                prefixes = [eb90.command_reply_prefix(device_id, flag)]
            elif flag in (eb90.WRITE, WRITE_WRIST):
                address = int.from_bytes(data[5:7], "little")
                ids = {device_id, *self._new_ids(address, data)}
                prefixes = [eb90.write_ack_prefix(single, address, flag) for single in ids]
                if self._own and address == self._places["save"]:
                    prefixes.append(eb90.read_reply_prefix(device_id, address, 1))  # its result may have either flag
            if prefixes:
                key = data[:SHORTEST]
                self._decoder = eb90.Decoder(prefixes)
                self._key = key
        return Frame(data, key, data)

    def _new_ids(self, address: int, data: bytes) -> tuple[int, ...]:
        """Ids from which the acknowledgement may come, since the write gives them (RH56 ch. 3 ex. 1)."""
        if self._own and address == self._places["id"] and len(data) == SHORTEST + self._per + 1:
            return (data[SHORTEST],)
        return (1,) if self._own and address == self._places["factory_reset"] else ()

    def _verdict(self, frame: eb90.Frame) -> bool | None:
        """What a frame from the device says of the last write; None = a save was taken, whether it is done comes later."""
        if frame.address is None or len(frame.data) != 1:
            return True  # the values that answer a force or position command
        if self._own and frame.address == self._places["save"]:
            return {SAVED: True, NOT_SAVED: False, eb90.ACCEPTED: None}.get(frame.data[0], False)
        return frame.data[0] == eb90.ACCEPTED


def _frames(data: bytes) -> Iterable[bytes]:
    """The request frames in one write of the host; what is none stays together."""
    while data:
        size = data[3] + eb90.OVERHEAD if data[:2] == eb90.HOST and len(data) > 3 else len(data)
        yield data[:size]
        data = data[size:]


def _reads(frame: bytes) -> bool:
    return frame[:2] == eb90.HOST and len(frame) == 9 and frame[3] == 4 and frame[4] in (eb90.READ, READ_WRIST)


def _reads_can(can_id: int) -> bool:
    return canreg.parse_identifier(can_id).flag in (canreg.READ_HAND, canreg.READ_WRIST)
