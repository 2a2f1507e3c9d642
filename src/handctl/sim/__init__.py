"""Simulated devices: a second, independent reading of the manuals, standard library only.

`create` returns a `Line` (engine/line_and_faults.py), the end of a cable: bytes in, bytes out, time passed in by the caller; or, for
a device on a CAN bus (option bus=can), a `CanLine` (engine/can_line.py): frames in, frames out. The in-process fake link
and the servers of engine/serve.py drive the same object, so both show the same device.

A simulated device is a folder here, called as its command is: `SUMMARY` and `WIRES` ("serial" or "tcp", "can", "modbus-tcp")
of the folder itself tell what it is, its module `device` has the class `Device`, and one more for each further wire.
"""

from __future__ import annotations

import importlib

TYPE_CHECKING = False  # the engine is loaded when a model is
if TYPE_CHECKING:
    from typing import Any

    from handctl.sim.engine.line_and_faults import Line
    from handctl.sim.engine.simulated_device import Model

CLASSES = {"can": "CanDevice", "modbus-tcp": "TcpDevice"}
"""Of a wire that is not the first of its device, by the value of the option `bus`."""


def kinds() -> list[str]:
    """The devices that there are, by name."""
    from pkgutil import iter_modules

    names = (found.name for found in iter_modules(__path__) if found.ispkg)
    return sorted(name for name in names if getattr(folder := folder_of(name), "LISTED", folder is not None))


def folder_of(kind: str) -> Any:
    """The package of a simulated device, with SUMMARY and WIRES; None where there is none."""
    try:
        found = importlib.import_module(f"{__name__}.{kind}") if kind.isidentifier() else None
    except ModuleNotFoundError:
        return None
    return found if hasattr(found, "WIRES") else None


def model_class(kind: str, bus: str = "serial") -> type[Model]:
    """The model of one kind of device on one kind of wire; imported here so that no other model is."""
    folder = folder_of(kind)
    if folder is None:
        raise ValueError(f"no simulated device {kind!r}. Known: {', '.join(kinds())}")
    name = CLASSES.get(bus, "Device") if bus in folder.WIRES else "Device"
    found: type[Model] = getattr(importlib.import_module(f"{folder.__name__}.device"), name)
    return found


def meaning_of(kind: str, fault: str) -> str:
    """What a device does under one of its faults, or one of its line."""
    from handctl.sim.engine.line_and_faults import LINE_FAULTS

    row = model_class(kind).FAULTS.get(fault) or LINE_FAULTS[fault]
    return row if isinstance(row, str) else str(row[1])


def create(kind: str, options: dict[str, str]) -> Line | Any:
    """A simulated device at the end of a line, from the raw option strings of a fake:// link.

    A `CanLine` for the wrist with bus=can, otherwise a `Line`; for "bus" a client's end of the bus in the file of the
    option `file`, which behaves as one of them. The options `facts` and `values` make it a twin (engine/facts_file.py). (Any in the signature is the `CanLine`: a caller that
    never asks for one need not tell them apart.)

    Raises ValueError with one line of text (what is wrong, what is known) for an unknown kind, option or fault, for a
    bad value or FILE, and for a state file that cannot be used.
    """
    if kind == "bus":
        return importlib.import_module(f"{__name__}.bus").create(options)
    if "facts" in options or "values" in options:
        options = importlib.import_module(f"{__name__}.engine.facts_file").Twin(kind, options).raw
    if options.get("bus") == "can" and "can" in getattr(folder_of(kind), "WIRES", ()):
        from handctl.sim.engine.can_line import CanLine

        return CanLine(model_class(kind, "can"), options)
    from handctl.sim.engine.line_and_faults import Line

    return Line(model_class(kind, options.get("bus", "serial")), options)


def words_of_twin(kind: str, options: dict[str, str], values: tuple[list[str], list[str]]) -> str:
    """What became of the facts and values of a device, see engine/facts_file.py; `values` are those of its `Line`."""
    found: str = importlib.import_module(f"{__name__}.engine.facts_file").Twin(kind, options).words(values)
    return found


def carries_frames(kind: str, options: dict[str, str]) -> bool:
    """Whether `create` gives a CAN bus; of a whole bus its file tells."""
    if kind == "bus":
        found: bool = importlib.import_module(f"{__name__}.bus.bus_file").on_can(options.get("file", ""))
        return found
    return options.get("bus") == "can"
