"""A simulated RH56 hand on virtual time, asked with literal bytes. Addresses and vectors are those of the RH56 dossier."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from handctl.sim import create

TRANSCRIPTS = Path(__file__).parents[2] / "transcripts"


class Bench:
    """A line on virtual time; options as in a link, with _ for -."""

    def __init__(self, **options: object) -> None:
        self.line: Any = create("hand", {name.replace("_", "-"): str(value) for name, value in options.items()})
        self.now = 0.0
        self.line.advance(0.0)

    @property
    def hand(self) -> Any:
        return self.line.device.hand

    def ask(self, request: str, wait: float = 0.01) -> str:
        self.line.feed(bytes.fromhex(request))
        return self.wait(wait)

    def wait(self, seconds: float) -> str:
        """Lets time pass at once; returns what came."""
        self.now += seconds
        self.line.advance(self.now)
        heard: str = self.line.take().hex(" ").upper()
        return heard

    def run(self, text: str) -> str:
        """A control command."""
        answer: str = self.line.command(text)
        return answer

    def words(self, address: int, count: int = 6) -> list[int]:
        """Signed values straight from memory, without a request."""
        return list(struct.unpack(f"<{count}h", bytes.fromhex(self.run(f"get {address} {2 * count}"))))

    def bytes_at(self, address: int, count: int = 6) -> list[int]:
        return list(bytes.fromhex(self.run(f"get {address} {count}")))

    def acts(self) -> dict[str, int]:
        """What it was made to do, as far as it was."""
        pairs = (text.split("=") for text in self.run("acts").split())
        return {name: int(number) for name, number in pairs if number != "0"}


def eb90(body: str, number: int = 1) -> str:
    """A request: flag, address and what follows, in hex."""
    data = bytes.fromhex(body)
    inner = bytes([number, len(data)]) + data
    return (b"\xeb\x90" + inner + bytes([sum(inner) % 256])).hex(" ").upper()


def write(address: int, *values: int, size: int = 2) -> str:
    data = b"".join(struct.pack("<h" if size == 2 else "B", value) for value in values)
    return eb90((b"\x12" + struct.pack("<H", address) + data).hex())
