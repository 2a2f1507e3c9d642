"""A DataPort that answers GetData as told, and what recording it gives."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from handctl.devices.ekso.recording_source import USUAL_MS, FeedbackLine, RowLayout
from handctl.errors import HandctlError
from handctl.model.device_clock import Moment
from handctl.model.prompts import Prompts
from handctl.record.csv_and_sidecar import Recording
from handctl.record.marks import Heard
from handctl.record.recording_loop import Limits, Loop
from handctl.record.row_source import Sample, Source
from handctl.record.timeline import Place

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


class Device(Source):
    """Answers a script on virtual time: (seconds since the last answer, BootTime or error).

    feedback  what a look at GetFeedback answers; None = it is not looked at
    again     opens a lost port
    asked     counts how often its settings were read
    """

    kind = "ekso"
    period_ms = USUAL_MS
    clock_name = "BootTime"

    def __init__(self, script: Sequence[tuple[float, int | BaseException]], *, raw: bool = False) -> None:
        self.script = list(script)
        self.layout = RowLayout(raw=raw)
        self.clock = 100.0
        self.asked_at: list[float] = []
        self.line = FeedbackLine()
        self.feedback: Callable[[], Sequence[int]] | None = None
        self.again: Callable[[], bool] = lambda: False
        self.asked = 0

    def now(self) -> float:
        return self.clock

    def wall(self) -> float:
        return 1_767_225_600 + self.clock

    def sleep(self, seconds: float) -> None:
        self.clock += max(0.0, seconds)

    def sample(self) -> Sample:
        self.asked_at.append(round(self.clock, 6))
        seconds, what = self.script.pop(0)
        self.clock += seconds
        if isinstance(what, BaseException):
            raise what
        return Sample(Moment(self.clock - 0.004, self.clock), words_at(what), what)

    def settings(self) -> dict[str, dict[str, Any]]:
        self.asked += 1
        return {}

    @property
    def looks(self) -> bool:  # type: ignore[override]
        return self.feedback is not None

    def look(self, place: Place, row: int) -> bool:
        assert self.feedback is not None
        return self.line.add(self.feedback(), place, row)

    def unanswered(self) -> None:
        self.line.unanswered += 1

    def reopen(self) -> bool:
        return self.again()

    def sidecar(self) -> dict[str, Any]:
        return {"feedback": self.line.as_row()}


def steady(count: int, boot: int = 1001, period: int = 20) -> list[tuple[float, int | BaseException]]:
    """So many answers, one every `period` ms by both clocks."""
    return [(period / 1000, boot + i * period) for i in range(count)]


def opened(path: Path, device: Device, *, rate: float = 0.0, force: bool = False, **about: Any) -> Recording:
    """A recording of it, begun."""
    return Recording(str(path), device, device, about, rate=rate, force=force)


def recorded(
    path: Path,
    script: Sequence[tuple[float, int | BaseException]],
    *,
    raw: bool = False,
    limits: Limits | None = None,
    mark: Callable[[], str] = lambda: "",
    feedback: Callable[[], Sequence[int]] | None = None,
    reopen: Callable[[], bool] = lambda: False,
) -> tuple[HandctlError | None, Recording, Device]:
    """Record a script to its end."""
    device = Device(script, raw=raw)
    device.feedback, device.again = feedback, reopen
    limits = limits or Limits(rows=sum(isinstance(what, int) for _, what in script))
    recording = opened(path, device, rate=limits.rate, simulated=True)
    failure = run(recording, limits, mark)
    recording.finish(failure.code if failure is not None else "limit")
    return failure, recording, device


def run(recording: Recording, limits: Limits, mark: Callable[[], str] = str) -> HandctlError | None:
    """The loop of a recording; what ended it."""
    try:
        return Loop(recording, limits, lambda: [Heard(text)] if (text := mark()) else [], Prompts(), {}).run()
    finally:
        recording.close()


def make(
    path: Path,
    boots: Sequence[int],
    words: Sequence[Sequence[int]] = (),
    *,
    raw: bool = False,
    mark: str = "",
    complete: bool = True,
) -> Path:
    """A log with rows at these BootTimes; the host clock runs along, a lower BootTime takes 2 s more."""
    device = Device([], raw=raw)
    recording = opened(path, device, force=True, simulated=True)
    last = boots[0]
    for seq, boot in enumerate(boots, 1):
        device.clock += (boot - last) / 1000 if boot >= last else 2.0
        last = boot
        row = words_at(boot, words[seq - 1] if words else STANDING)
        recording.pending = [Heard(mark)] if mark and seq == 1 else []
        recording.add(Sample(Moment(device.clock, device.clock), row, boot), seq)
    recording.close()
    if complete:
        recording.finish("limit")
    return path
