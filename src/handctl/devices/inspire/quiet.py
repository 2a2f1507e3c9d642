"""The first question to an id: a read whose bytes nobody else acts upon who may be there instead. Knows no wire.

Both addresses of a register space are documented, and the sums of their requests differ: for any id one of the two is
quiet, but for 3 and 13, which are such bytes themselves.
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


def question(device_id: int, flag: int) -> Span:
    """What to ask an id first."""
    spans = READS[flag]
    return next((span for span in spans if harmless(eb90.read_request(device_id, *span, flag), None)), spans[0])
