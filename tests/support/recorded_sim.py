"""`python tests/support/recorded_sim.py LOG KIND …` is `handctl sim KIND …`, and notes what reaches the device, with its own clock.

A line of the log is the moment in seconds and the bytes in hex; on CAN they are the identifier and the data of a frame.
The clock of a served simulator is the monotonic clock of this machine.
"""

from __future__ import annotations

import sys
from typing import Any

from handctl.sim import cli

create = cli.create


def recorded(kind: str, options: dict[str, str]) -> Any:
    """The line of a device whose ear is tapped."""
    line = create(kind, options)
    device: Any = line.device
    feed = device.feed

    def note(data: bytes) -> None:
        log.write(f"{device.now:.6f} {data.hex()}\n")
        feed(data)

    device.feed = note
    return line


if __name__ == "__main__":
    with open(sys.argv[1], "w", buffering=1, encoding="utf-8") as log:
        cli.create = recorded
        cli.cli(sys.argv[2:], prog_name="sim")
