"""Simulated devices: a second, independent reading of the manuals, standard library only.

`create` returns a `Line` (see line.py), the end of a cable: bytes in, bytes out, time passed in by the caller. The
in-process fake link and the servers of serve.py drive the same object, so both show the same device.
"""

from __future__ import annotations

TYPE_CHECKING = False  # the typing module is not worth its import time here
if TYPE_CHECKING:
    from handctl.sim.line import Line
    from handctl.sim.model import Model

KINDS = ("exo",)


def model_class(kind: str) -> type[Model]:
    """The model of one kind of device; imported here so that no other model is."""
    if kind == "exo":
        from handctl.sim.exo import Device

        return Device
    raise ValueError(f"no simulated device {kind!r}; known: {', '.join(KINDS)}")


def create(kind: str, options: dict[str, str]) -> Line:
    """A simulated device at the end of a line, from the raw option strings of a fake:// link.

    Raises ValueError with one line of text (what is wrong, what is known) for an unknown kind, option or fault, for a
    bad value, and for a state file that cannot be used.
    """
    from handctl.sim.line import Line

    return Line(model_class(kind), options)
