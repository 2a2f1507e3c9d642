"""`python tests/support/recorded_sim.py LOG KIND …` is `handctl sim KIND …`, and notes what reaches the device, with its own clock.

A line of the log is the moment in seconds and the bytes in hex; on CAN they are the identifier and the data of a frame.
The clock of a served simulator is the monotonic clock of this machine.
"""

from __future__ import annotations

import sys
from typing import Any

from handctl.sim import cli
from handctl.sim.engine import wires

create, add = cli.create, wires.Wires.add


def noted(line: Any) -> Any:
    """The line of a device, its ear tapped."""
    device: Any = line.device
    feed = device.feed

    def note(data: bytes) -> None:
        log.write(f"{device.now:.6f} {data.hex()}\n")
        feed(data)

    device.feed = note
    return line


def recorded(kind: str, options: dict[str, str]) -> Any:
    """A device with one wire."""
    return noted(create(kind, options))


def one_more(whole: wires.Wires, bus: str) -> Any:
    """A wire of a device that has several, or one more client of it."""
    return noted(add(whole, bus))


if __name__ == "__main__":
    with open(sys.argv[1], "w", buffering=1, encoding="utf-8") as log:
        cli.create = recorded
        wires.Wires.add = one_more  # type: ignore[method-assign]
        cli.cli(sys.argv[2:], prog_name="sim")
