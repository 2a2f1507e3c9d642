"""Drivers of serial adapters on Windows: which one has a port, its latency timer, and adapters that got none."""

from __future__ import annotations

import sys
from typing import NamedTuple


class Driver(NamedTuple):
    """The driver of a port by its name in the system, and the milliseconds of its latency timer where it has one."""

    name: str = ""
    latency_ms: int | None = None


if sys.platform == "win32":
    import contextlib
    import ctypes
    import winreg
    from collections.abc import Iterator

    ENUM = r"SYSTEM\CurrentControlSet\Enum"
    BUSES = ("FTDIBUS", "USB")
    ENUMERATOR_PRESENT = 0x1 | 0x100
    """CM_GETIDLIST_FILTER_ENUMERATOR, CM_GETIDLIST_FILTER_PRESENT."""

    def _below(key: winreg.HKEYType) -> Iterator[tuple[str, winreg.HKEYType]]:
        for number in range(winreg.QueryInfoKey(key)[0]):
            with contextlib.suppress(OSError):
                name = winreg.EnumKey(key, number)
                with winreg.OpenKey(key, name) as found:
                    yield name, found

    def _value(key: winreg.HKEYType, name: str) -> str | int | None:
        try:
            found = winreg.QueryValueEx(key, name)[0]
        except OSError:
            return None
        return found if isinstance(found, str | int) else None

    def of(path: str) -> Driver:
        """The driver of a port such as COM3."""
        for bus in BUSES:
            with contextlib.suppress(OSError), winreg.OpenKey(winreg.HKEY_LOCAL_MACHINE, rf"{ENUM}\{bus}") as top:
                for _, kind in _below(top):
                    for _, device in _below(kind):
                        with contextlib.suppress(OSError), winreg.OpenKey(device, "Device Parameters") as told:
                            if str(_value(told, "PortName")).casefold() == path.casefold():
                                timer = _value(told, "LatencyTimer")
                                return Driver(
                                    str(_value(device, "Service") or ""), timer if isinstance(timer, int) else None
                                )
        return Driver()

    def without() -> list[tuple[str, str]]:
        """Vendor and product (hex) of USB devices that are plugged in and whose driver is missing or fails."""
        try:
            manager = ctypes.WinDLL("cfgmgr32")
            size = ctypes.c_ulong()
            if manager.CM_Get_Device_ID_List_SizeW(ctypes.byref(size), "USB", ENUMERATOR_PRESENT):
                return []
            names = ctypes.create_unicode_buffer(size.value)
            if manager.CM_Get_Device_ID_ListW("USB", names, size, ENUMERATOR_PRESENT):
                return []
            return [
                usb
                for name in ctypes.wstring_at(names, size.value).split("\0")
                if (usb := usb_of(name)) and _fails(manager, name)
            ]
        except (OSError, AttributeError, ValueError):
            return []  # a system without these calls

    def _fails(manager: ctypes.WinDLL, name: str) -> bool:
        node, status, problem = ctypes.c_ulong(), ctypes.c_ulong(), ctypes.c_ulong()
        if manager.CM_Locate_DevNodeW(ctypes.byref(node), name, 0):
            return False
        asked = manager.CM_Get_DevNode_Status(ctypes.byref(status), ctypes.byref(problem), node, 0)
        return not asked and problem.value != 0

else:

    def of(path: str) -> Driver:
        """The system tells it elsewhere, or not at all."""
        return Driver()

    def without() -> list[tuple[str, str]]:
        return []


def usb_of(name: str) -> tuple[str, str] | None:
    r"""Vendor and product of a device such as ``USB\VID_0403&PID_6001\A1``, in small hex letters."""
    parts = name.upper().replace("\\", "&").split("&")
    found = {part[:4]: part[4:8].lower() for part in parts if part.startswith(("VID_", "PID_"))}
    return (found["VID_"], found["PID_"]) if len(found) == 2 else None
