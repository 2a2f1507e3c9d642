"""A DataPort that answers GetData as told, and what recording it gives."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from handctl.devices.ekso.log.polling import Limits, record
from handctl.devices.ekso.log.recording import Recording
from handctl.errors import HandctlError
from handctl.model.guide import Guide

# Dossier 8.1, GetData standing: boot 5 000 001 ms.
STANDING = struct.unpack(
    ">27H",
    bytes.fromhex(
        "01C2 FFB5 005F 0262 0078 01E0 FFCF 0E10 0062 0E26 FF47 08A2 FFD8 0348 00D2 FD85 FFC9 0140 2040 0404 0000 0000"
        "007D 0001 000C 004C 4B41"
    ),
)


def words_at(boot_ms: int, words: Sequence[int] = STANDING) -> tuple[int, ...]:
    """GetData with another BootTime."""
    return (*words[:25], boot_ms >> 16, boot_ms & 0xFFFF)


class Answer(NamedTuple):
    """A sample as the recorder takes it."""

    sent: float
    received: float
    words: tuple[int, ...]


class Device:
    """Answers a script on virtual time: (seconds since the last answer, BootTime or error)."""

    def __init__(self, script: Sequence[tuple[float, int | BaseException]]) -> None:
        self.script = list(script)
        self.clock = 100.0
        self.asked_at: list[float] = []

    def now(self) -> float:
        return self.clock

    def wall(self) -> float:
        return 1_767_225_600 + self.clock

    def sleep(self, seconds: float) -> None:
        self.clock += max(0.0, seconds)

    def sample(self) -> Answer:
        self.asked_at.append(round(self.clock, 6))
        seconds, what = self.script.pop(0)
        self.clock += seconds
        if isinstance(what, BaseException):
            raise what
        return Answer(self.clock - 0.004, self.clock, words_at(what))


def steady(count: int, boot: int = 1001, period: int = 20) -> list[tuple[float, int | BaseException]]:
    """So many answers, one every `period` ms by both clocks."""
    return [(period / 1000, boot + i * period) for i in range(count)]


def recorded(
    path: Path,
    script: Sequence[tuple[float, int | BaseException]],
    *,
    raw: bool = False,
    limits: Limits | None = None,
    mark: Callable[[], str] = lambda: "",
    on_segment: Callable[[], None] = lambda: None,
    feedback: Callable[[], Sequence[int]] | None = None,
    reopen: Callable[[], bool] = lambda: False,
) -> tuple[HandctlError | None, Recording, Device]:
    """Record a script to its end."""
    device = Device(script)
    limits = limits or Limits(rows=sum(isinstance(what, int) for _, what in script))
    recording = Recording(str(path), device, {"simulated": True}, raw=raw, rate=limits.rate, force=False)
    try:
        failure = record(
            recording, device.sample, device, limits,
            mark=mark, on_segment=on_segment, guide=Guide(), feedback=feedback, reopen=reopen,
        )  # fmt: skip
    finally:
        recording.close()
    recording.write_sidecar(complete=True)
    return failure, recording, device
