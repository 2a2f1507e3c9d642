"""Somebody talks all the time: what reads ends within the deadline of one exchange and its retries, in every family."""

from __future__ import annotations

import pytest

from handctl.command.family import Family, load
from handctl.errors import JUDGED, HandctlError
from handctl.families import FAMILIES
from handctl.link import ByteLink, Deadline
from handctl.model.command_settings import Settings
from handctl.model.result import Journal

WIRE, FAST = 11_520, 400_000
"""Bytes a second: as many as a line at 115200 carries, and what a USB device of its own speed sends."""
NOISE = bytes(byte * 167 % 256 for byte in range(997))
PATTERNS = {"noise": NOISE, "zeros": bytes(12), "text": b"counter 17\r\n", "begun": b"\x90\xeb\x01\xff"}
SECONDS = {"exo": 1.2, "wrist": 1.2, "hand": 1.5, "ekso": 3.2, "aidin": 1.5, "barrett": 16.0}
"""Three attempts with the usual timeout of the family; of the BarrettHand the table by which it is met
(`gcl.connect_table`), which listens for as long as a boot monitor may take."""

NEW = 10.0
"""Of a family that is not among them yet."""


class Flooded(ByteLink):
    """A line on which bytes come, so many a second, whatever is asked. Time passes while it is waited for."""

    name, baud, can_set_baud = "flooded", 115200, True

    def __init__(self, pattern: bytes, rate: int) -> None:
        self.clock = self._taken = 0.0
        self._pattern, self._place, self._rate = pattern, 0, rate

    def now(self) -> float:
        return self.clock

    def sleep(self, seconds: float) -> None:
        self.clock += max(0.0, seconds)

    def write(self, data: bytes, deadline: Deadline) -> None:
        self.clock += len(data) / WIRE

    def read(self, deadline: Deadline, size: int = 4096) -> bytes:
        if self.clock - self._taken < 0.001:
            if deadline.expired:
                return b""
            self.clock += 0.001
        count = min(size, int((self.clock - self._taken) * self._rate))
        self._taken = self.clock
        begin = self._place % len(self._pattern)
        self._place = begin + count
        return (self._pattern * (self._place // len(self._pattern) + 1))[begin : self._place]

    def set_baud(self, baud: int) -> None:
        self.baud = baud

    def close(self) -> None:
        """Nothing to release."""


@pytest.mark.parametrize("rate", [WIRE, FAST])
@pytest.mark.parametrize("family", FAMILIES)
def test_a_read_ends_in_time(family: str, rate: int) -> None:
    known: Family = load(family, "cli").cli.family
    for name, pattern in PATTERNS.items():
        link, journal = Flooded(pattern, rate), Journal()
        device = known.open(link, Settings(kind=family, port="flooded"), journal)
        try:
            told = device.dump().failure
        except HandctlError as exc:
            told = exc
        assert told is not None, name
        if known.explain_silence is not None:
            told = known.explain_silence(device, told)
        assert link.clock < SECONDS.get(family, NEW), f"{name}: {link.clock:.2f} s"
        assert told.exit_code in (4, 5), name
        assert len(told.came) <= JUDGED, name
