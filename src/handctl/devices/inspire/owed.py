"""Which Modbus questions were given up, so that their late answers pass for no other question. Knows no link.

An answer to a read names no address: on a serial line only its size tells which question it belongs to, and over TCP a
number that some hands count wrongly (rh56 §2.3). A hand answers in order. So an answer of a size that no open question
has settles all that was asked before it; where the size is one of theirs, another question goes first (`Owed.between`).
"""

from __future__ import annotations

from handctl.devices.inspire import modbus

SYSTEM = 1000
"""Documented on every generation from here on (rh56 §3)."""
SIZES = range(1, 6)
"""Registers of the question between."""


class Owed:
    """The questions of one unit that were given up, in their order: (number on TCP, PDU)."""

    def __init__(self) -> None:
        self._open: list[tuple[int, bytes]] = []

    def __bool__(self) -> bool:
        return bool(self._open)

    def given_up(self, number: int, pdu: bytes) -> None:
        """The answer may still come."""
        self._open.append((number, pdu))

    def answered(self, number: int, pdu: bytes) -> None:
        """An answer that fits `pdu` came. It may belong to the same question, asked before: then the last one stays open."""
        same = [place for place, (_, open_pdu) in enumerate(self._open) if open_pdu == pdu]
        self._open = [*self._open[same[0] + 1 :], (number, pdu)] if same else []

    def settled(self) -> None:
        """The answer to the last question came, for sure."""
        self._open.clear()

    def between(self, pdu: bytes) -> bytes | None:
        """The read that must be answered before `pdu` is asked; None where no late answer can pass for that to `pdu`."""
        if not self._mistakable(pdu):
            return None
        asked = [modbus.read_request(SYSTEM, words) for words in SIZES]
        return next((one for one in asked if not self._mistakable(one)), asked[0])

    def _mistakable(self, pdu: bytes) -> bool:
        return pdu[0] == modbus.READ and any(
            one != pdu and one[0] == pdu[0] and modbus.reply_size(one) == modbus.reply_size(pdu)
            for _, one in self._open
        )
