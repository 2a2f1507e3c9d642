"""Serial ports of the system: names, one canonical path for each, and the descriptor of an open one. Opens one only to lock it."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

IN_SYS = sys.platform.startswith("linux")
"""Whether the system describes its ports below /sys; elsewhere pyserial's list is all there is."""


WAITED_FOR = SHARED = sys.platform != "win32"
"""Whether an open port has a descriptor that can be waited for, and whether two programs can have one open at once."""


def place(path: str) -> str:
    """The place that the name of a port leads to, the same for all its names: ``tty 188:0``; the real path of what is none."""
    if sys.platform == "win32":
        return path.casefold().removeprefix("\\\\.\\")
    import stat

    try:
        found = os.stat(path)
    except OSError:
        return os.path.realpath(path)  # opening it will say what is wrong
    if stat.S_ISCHR(found.st_mode) and sys.platform == "darwin":
        return cu_name(os.path.realpath(path))  # cu and tty of one port have numbers of their own
    if stat.S_ISCHR(found.st_mode):
        return f"tty {os.major(found.st_rdev)}:{os.minor(found.st_rdev)}"
    return os.path.realpath(path)


def foreign_name(path: str) -> bool:
    """Whether only another system names its serial ports so: COM3 here, or /dev/ttyUSB0 on Windows."""
    if sys.platform == "win32":
        return path.startswith("/dev/")
    return path[:3].upper() == "COM" and path[3:].isdigit()


def cu_name(path: str) -> str:
    """One name for the two of a port on macOS: /dev/cu.x for /dev/tty.x too."""
    return path.replace("/dev/tty.", "/dev/cu.", 1)


def descriptor(port: Any) -> int | None:
    """What an open port of pyserial can be waited for and written to by; None where there is no such thing."""
    return None if sys.platform == "win32" else raw_access(port)


def raw_access(port: Any) -> int | None:
    """What another process can write to an open port of pyserial by: a descriptor, on Windows the handle; None where there is neither."""
    if handle := getattr(port, "_port_handle", None):
        return int(handle)
    try:
        return int(port.fileno())
    except (OSError, AttributeError, ValueError):
        return None


def name_of(descriptor: int) -> str:
    """The name of the open port; "" if it is none, or the system does not report it."""
    if sys.platform == "win32":
        return ""
    try:
        return os.ttyname(descriptor)
    except OSError:
        return ""


def framing_errors(descriptor: int) -> int | None:
    """Framing errors and breaks that the driver of an open port has counted; None where it counts none.

    Only Linux counts them (TIOCGICOUNT), and not for a pty. A driver may have the count and leave it at 0.
    """
    if sys.platform != "linux":
        return None
    import fcntl
    import struct
    import termios

    form = "20i"  # struct serial_icounter_struct of linux/serial.h: eleven counts, and room
    try:
        counted = fcntl.ioctl(descriptor, termios.TIOCGICOUNT, bytes(struct.calcsize(form)))
    except OSError:
        return None
    _cts, _dsr, _rng, _dcd, _rx, _tx, frame, _overrun, _parity, breaks, *_ = struct.unpack(form, counted)
    return int(frame) + int(breaks)


def trouble(exc: BaseException) -> int | None:
    """The errno of a port that could not be opened; None if there is none.

    On Windows pyserial tells it in words only, and what another program holds is "access denied": EBUSY here.
    """
    number = getattr(exc, "errno", None)
    if number is None and exc.__context__ is not None and exc.__context__.args:
        number = exc.__context__.args[0]  # termios.error, which pyserial wraps without its number
    if sys.platform == "win32":
        return of_windows(str(exc))
    return number if isinstance(number, int) else None


def of_windows(text: str) -> int | None:
    """The same from the words of pyserial there, such as ``could not open port 'COM7': FileNotFoundError(2, …, None, 2)``."""
    import re

    found = re.search(r"Error\((\d+), .*?(?:, None, (\d+))?\)", text, re.DOTALL)
    if found is None:
        return None
    number = int(found[2] or found[1])
    return _OF_WINDOWS.get(number) or (errno.EBUSY if int(found[1]) == errno.EACCES else int(found[1]))


_OF_WINDOWS = {
    1: errno.ENOTTY,  # a function that this device has not
    2: errno.ENOENT,
    3: errno.ENOENT,
    5: errno.EBUSY,  # access denied: another program has it
    31: errno.EIO,  # a device attached to the system is not functioning: its driver
    32: errno.EBUSY,
    87: errno.EINVAL,
    121: errno.ETIMEDOUT,  # the semaphore timeout of a Bluetooth port whose device is off
    123: errno.ENOENT,
    170: errno.EBUSY,
    433: errno.ENODEV,
    1167: errno.ENODEV,
}
"""The system's numbers -> errno."""


def held_by_name(path: str) -> bool:
    """Whether the system reports who has this port open by its name."""
    if sys.platform == "darwin":
        return path.startswith(("/dev/cu.", "/dev/tty."))
    return sys.platform.startswith("linux") and os.path.realpath(path).startswith(NAMED)


NAMED = ("/dev/tty", "/dev/rfcomm", "/dev/pts/", "/dev/hidraw")


def holders_by_lsof(path: str) -> list[tuple[int, str]]:
    """The processes that have a port open, on a system without /proc (macOS); [] elsewhere."""
    return of_lsof(path) if sys.platform == "darwin" else []


def of_lsof(path: str) -> list[tuple[int, str]]:
    """The same from the output of `lsof`, for both names of the port."""
    import subprocess

    cu = cu_name(path)
    names = [name for name in (cu, cu.replace("/dev/cu.", "/dev/tty.", 1)) if os.path.exists(name)]
    try:
        told = subprocess.run(
            ["lsof", "-F", "pc", "--", *names], capture_output=True, text=True, timeout=LSOF_SECONDS, check=False
        ).stdout
    except (OSError, subprocess.SubprocessError, ValueError):
        return []
    found: dict[int, str] = {}
    pid = 0
    for line in told.splitlines():
        if line[:1] == "p" and line[1:].isdecimal():
            pid = int(line[1:])
        elif line[:1] == "c" and pid != os.getpid():
            found[pid] = line[1:]
    return list(found.items())


LSOF_SECONDS = 2.0


def lock(path: str) -> int | None:
    """Lock a port before it is opened in earnest; the descriptor to keep, None where it cannot be done.

    Raises BlockingIOError when another program has locked it.
    """
    if sys.platform == "win32":
        return None  # who has opened it has it alone
    from handctl.system import disk, file_locks

    try:
        found = os.open(path, os.O_RDWR | disk.TERMINAL_OF_NOBODY | disk.AT_ONCE)
    except OSError:
        return None  # who opens it then says what is wrong with it
    try:
        file_locks.whole(found)
    except OSError:
        os.close(found)
        raise
    return found


def present(listed: Callable[[], list[Any]]) -> list[str]:
    """The ports that are plugged in, by the names that are given to --port; on Windows with what they are.

    `listed` is the list of pyserial, where the system has no folder of them.
    """
    if sys.platform == "win32":
        return [described(port) for port in listed()]
    import glob

    if sys.platform == "darwin":
        return sorted(path for path in glob.glob("/dev/cu.*") if not path.startswith(OF_NOTHING))
    return sorted(glob.glob("/dev/serial/by-id/*") or glob.glob("/dev/ttyUSB*") + glob.glob("/dev/ttyACM*"))


OF_NOTHING = ("/dev/cu.Bluetooth-Incoming-Port", "/dev/cu.debug-console", "/dev/cu.wlan-debug")
"""macOS has these always, and nothing is behind them."""


def described(port: Any) -> str:
    """A port of pyserial's list by name, maker and USB device: ``COM3  FTDI  usb:0403:6001:A1``."""
    serial = f":{port.serial_number}" if port.serial_number else ""
    usb = "" if port.vid is None else f"usb:{port.vid:04X}:{port.pid:04X}{serial}"
    maker = next((text for text in (port.manufacturer, port.product, port.description) if text and text != "n/a"), "")
    return "  ".join(filter(None, (str(port.device), maker, usb)))


# -- adapters as Linux describes them below /sys -----------------------------------------------------------------------


def usb_folder(device: str | os.PathLike[str]) -> str:
    """The folder of the USB device that a port belongs to, by the port's `device` in /sys; "" where it is none."""
    folder = os.path.realpath(device)
    while len(folder) > 1 and not os.path.exists(os.path.join(folder, "idVendor")):
        folder = os.path.dirname(folder)
    return folder if len(folder) > 1 else ""


def usb_name(folder: str) -> str:
    """VID:PID[:SERIAL] of a USB device, in hex, as in a `usb:` link; "" where there is none."""
    parts = [text_in(os.path.join(folder, key)) for key in ("idVendor", "idProduct", "serial")]
    return ":".join(filter(None, parts)) if all(parts[:2]) else ""


def text_in(path: str | os.PathLike[str]) -> str:
    """A small text file of the system without surrounding white space; "" when it cannot be read."""
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            return file.read().strip()
    except OSError:
        return ""


# -- drivers of serial adapters on Windows: name, latency timer, and adapters that got none ---------------------------


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

    def driver_of(path: str) -> Driver:
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

    def without_driver() -> list[tuple[str, str]]:
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

    def driver_of(path: str) -> Driver:
        """The system tells it elsewhere, or not at all."""
        return Driver()

    def without_driver() -> list[tuple[str, str]]:
        return []


def usb_of(name: str) -> tuple[str, str] | None:
    r"""Vendor and product of a device such as ``USB\VID_0403&PID_6001\A1``, in small hex letters."""
    parts = name.upper().replace("\\", "&").split("&")
    found = {part[:4]: part[4:8].lower() for part in parts if part.startswith(("VID_", "PID_"))}
    return (found["VID_"], found["PID_"]) if len(found) == 2 else None
