"""A name of a serial port that outlives the next plugging. Opens nothing and sends nothing; reads /dev and /sys."""

from __future__ import annotations

import os

BY_ID = "/dev/serial/by-id"
TTY = "/sys/class/tty"


def stable_name(port: str) -> str:
    """A name of this adapter itself for a path like /dev/ttyUSB0: its by-id link, or usb:VID:PID:SERIAL; "" = none."""
    name = os.path.basename(port)
    if not name.startswith(("ttyUSB", "ttyACM")) or os.path.dirname(port) != "/dev":
        return ""
    real = os.path.realpath(port)
    try:
        links = sorted(os.path.join(BY_ID, entry) for entry in os.listdir(BY_ID))
    except OSError:
        links = []
    for link in links:
        if os.path.realpath(link) == real:
            return link
    folder = os.path.realpath(os.path.join(TTY, name, "device"))
    while len(folder) > 1 and not os.path.exists(os.path.join(folder, "idVendor")):
        folder = os.path.dirname(folder)
    vendor, product, serial = (_line(os.path.join(folder, key)) for key in ("idVendor", "idProduct", "serial"))
    return ":".join(filter(None, ("usb", vendor, product, serial))) if vendor and product else ""


def _line(path: str) -> str:
    try:
        with open(path, encoding="utf-8") as file:
            return file.read().strip()
    except (OSError, UnicodeDecodeError):
        return ""
