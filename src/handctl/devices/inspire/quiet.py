"""The first question to an id: a read upon whose bytes nobody else acts who may be there instead. Knows no wire.

Both addresses of a register space are documented, and the sums of their requests differ: for any id one of the two is
quiet, but for 3 and 13, which are such bytes themselves.

A BarrettHand that starts listens at 9600 whatever its speed, and FF opens its boot monitor: it hears one where the line falls
idle behind the beginning of a byte. At 115200 a read is shorter than one byte at 9600, which holds all of it. At other speeds
bytes ahead of the frame see to that. (A test samples the bits.)
"""

from __future__ import annotations

from handctl.devices.inspire import eb90
from handctl.model.foreign import harmless

Span = tuple[int, int]
"""Address and count of bytes."""

READS: dict[int, tuple[Span, ...]] = {eb90.READ: ((1472, 2), (1546, 2)), eb90.WRIST_READ: ((1024, 2), (1026, 2))}
"""Read flag -> system_voltage, position_actual (exo §2.3); the two currents (wrist §2.1).

Two bytes each: an answer is longer than its request, so an echo never passes for one.
"""


FRESH: dict[int, tuple[Span, ...]] = {
    eb90.READ: tuple((1546 + start, count) for start in (0, 2, 4, 6) for count in (4, 6, 8, 10) if start + count <= 12),
    eb90.WRIST_READ: ((1020, 6), (1020, 8), (1022, 4), (1022, 6), (1024, 4)),
}
"""Read flag -> parts of what is documented (position_actual, exo §2.3.9; wrist §2.1) that no first question asks for.

For an id that has answered: an answer to one of these is younger than that to any first question.
"""


def question(device_id: int, flag: int) -> Span:
    """What to ask an id first."""
    spans = READS[flag]
    return next((span for span in spans if harmless(eb90.read_request(device_id, *span, flag), None)), spans[0])


AHEAD = {19200: 1, 57600: 2, 921600: 32}
"""bit/s -> how many 00 go ahead of a read: it ends within a byte that they have begun, and none begins at its end."""


def ahead(baud: int | None) -> bytes:
    """What goes ahead of a read at a speed in bit/s at which nobody has answered yet; None = the port has none."""
    return bytes(AHEAD.get(baud or 0, 0))
