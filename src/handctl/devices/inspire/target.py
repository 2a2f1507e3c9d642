"""What a scan of this maker's devices looks for, by family."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from handctl.devices.inspire import canreg, eb90
from handctl.devices.inspire.identity import Kind
from handctl.devices.inspire.quiet import Span
from handctl.devices.inspire.registers import RegisterBus
from handctl.errors import UsageError
from handctl.model.param import ids_in
from handctl.sentence import plural

SPEEDS = (115200, 57600, 19200)
"""exo §2.3.2; the wrist's manual has 115200 only, its hand's the others too."""
MOST = 4096
"""Ids in one CAN scan at the most; all 16383 would only be traffic for the others on the bus."""
WHO = tuple[Kind, "str | None", str]
"""Kind, model (None = open), and what shows it."""


class Target(NamedTuple):
    """What a scan looks for.

    own        the kind
    probe      the register that is read, named `value`
    twin       registers that jitter, for the test of two devices with one id
    speeds     bit/s at which it is looked for where no other maker's device is
    both_ways  its serial line carries both directions at once
    can        read flag and span on CAN, None = not on CAN
    look       (bus) -> who answers, where its family tells more than the kind; it speaks Modbus too
    spoken     (link, --protocol) -> eb90, modbus, tcp, or auto: EB90, then Modbus RTU
    """

    own: Kind
    probe: Span
    twin: Span
    value: str
    silence_hint: str
    speeds: tuple[int, ...] = SPEEDS
    both_ways: bool = False
    can: tuple[int, Span] | None = None
    look: Callable[[RegisterBus], WHO] | None = None
    spoken: Callable[[str, str | None], str] = lambda _link, _typed: "eb90"

    @property
    def family(self) -> str:
        """Its command."""
        return self.own.family


def parse_ids(text: str, wire: str) -> list[int]:
    """``1-254`` or ``1,2,10-20`` -> ids in that order, on CAN up to 16383, at most 4096 of them. Raises UsageError."""
    ids = ids_in(text, canreg.check_id if wire == "can" else eb90.check_id)
    if len(ids) > MOST:
        raise UsageError(
            f"--ids {text}: these are {plural(len(ids), 'id')}, but a scan asks 1 to {MOST}",
            hint="scan in parts, such as --ids 1-254",
        )
    return ids
