"""Simulated devices: a second, independent reading of the manuals, standard library only.

`create` returns a `Line` (see line.py), the end of a cable: bytes in, bytes out, time passed in by the caller; or, for a
device on a CAN bus (option bus=can), a `CanLine` (canline.py): frames in, frames out. The in-process fake link and the
servers of serve.py drive the same object, so both show the same device.
"""

from __future__ import annotations

import importlib

TYPE_CHECKING = False  # the typing module is not worth its import time here
if TYPE_CHECKING:
    from typing import Any

    from handctl.sim.engine.line import Line
    from handctl.sim.engine.model import Model

KINDS = {
    "exo": "inspire.exo.device",
    "wrist": "inspire.wrist.device",
    "barrett": "barrett.device",
    "ekso": "ekso.device",
    "aidin": "aidin.device",
}
"""Kind -> its module below this package, with a class `Device`."""
CAN = {"wrist": "inspire.wrist.can"}
"""The same for a device on a CAN bus."""


def model_class(kind: str, bus: str = "serial") -> type[Model]:
    """The model of one kind of device on one kind of wire; imported here so that no other model is."""
    if kind not in KINDS:
        raise ValueError(f"no simulated device {kind!r}; known: {', '.join(KINDS)}")
    module = CAN[kind] if kind in CAN and bus == "can" else KINDS[kind]
    found: type[Model] = importlib.import_module(f"handctl.sim.{module}").Device
    return found


def create(kind: str, options: dict[str, str]) -> Line | Any:
    """A simulated device at the end of a line, from the raw option strings of a fake:// link.

    A `CanLine` for the wrist with bus=can, otherwise a `Line`. (Any in the signature is the `CanLine`: a caller that
    never asks for one need not tell them apart.)

    Raises ValueError with one line of text (what is wrong, what is known) for an unknown kind, option or fault, for a
    bad value, and for a state file that cannot be used.
    """
    if kind in CAN and options.get("bus") == "can":
        from handctl.sim.engine.canline import CanLine

        return CanLine(model_class(kind, "can"), options)
    from handctl.sim.engine.line import Line

    return Line(model_class(kind), options)
