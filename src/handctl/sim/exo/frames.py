"""Flags of the simulated exoskeleton hand and the lengths of their requests (exo §2.2)."""

from __future__ import annotations

from handctl.sim.inspire import frames
from handctl.sim.inspire.frames import frame

__all__ = ["FORCE", "POSITION", "READ", "WRITE", "find", "frame"]

READ, WRITE, FORCE, POSITION = 17, 18, 49, 50  # flags


def find(buffer: bytes | bytearray, device_id: int) -> tuple[int, int, int]:
    """The first request for this id: bytes before it, its size (0: none yet), bytes needed to be sure of it."""
    return frames.find(buffer, device_id, _possible)


def _possible(flag: int, length: int) -> bool:
    """Whether a request can have this flag and length: reads 4, writes 3 + data, commands 11."""
    if flag == WRITE:
        return length >= 4
    return length == {READ: 4, FORCE: 11, POSITION: 11}.get(flag, -1)
