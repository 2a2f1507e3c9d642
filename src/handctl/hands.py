"""The classes that `handctl.connect` and `handctl.simulate` return, one for each family. Their types: `hands.pyi`."""

from __future__ import annotations

from typing import Any

from handctl.api import Device, Rows, Stream, class_of, connect, simulate
from handctl.command.library_call import Confirm
from handctl.families import FAMILIES
from handctl.model.result import Row

__all__ = ["Confirm", "Device", "Row", "Rows", "Stream", "connect", "simulate"]


def __getattr__(name: str) -> Any:
    kind = name.lower()
    if kind in FAMILIES and name == kind.capitalize():
        return class_of(kind)
    raise AttributeError(f"module 'handctl.hands' has no attribute {name!r}")
