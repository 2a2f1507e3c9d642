"""The chips of adapters that are met in the field, by USB id, and which device may be behind them; which one answers, only a scan can say."""

from __future__ import annotations

from typing import NamedTuple

RS232 = "exo, wrist or barrett behind an adapter"
CDC = "ekso, or an slcan adapter with a wrist (can:slcan:PORT)"


class Chip(NamedTuple):
    """An adapter: its name, what may be behind it, whether it makes a serial port, whether brltty claims its id."""

    name: str
    behind: str
    usb: str = ""
    serial: bool = True
    braille: bool = False


CHIPS: dict[tuple[str, str], Chip] = {
    ("0403", "6001"): Chip("FTDI FT232R", RS232, "0403:6001", braille=True),
    ("0403", "6010"): Chip("FTDI FT2232", RS232, "0403:6010"),
    ("0403", "6011"): Chip("FTDI FT4232", RS232, "0403:6011"),
    ("0403", "6014"): Chip("FTDI FT232H", RS232, "0403:6014"),
    ("0403", "6015"): Chip("FTDI FT-X", RS232, "0403:6015"),
    ("1a86", "7523"): Chip("CH340", RS232, "1a86:7523", braille=True),
    ("1a86", "5523"): Chip("CH341", RS232, "1a86:5523"),
    ("1a86", "55d3"): Chip("CH343", RS232, "1a86:55d3"),
    ("1a86", "55d4"): Chip("CH9102", RS232, "1a86:55d4"),
    ("10c4", "ea60"): Chip("CP210x", RS232, "10c4:ea60", braille=True),
    ("10c4", "ea70"): Chip("CP2105", RS232, "10c4:ea70"),
    ("067b", "2303"): Chip("Prolific PL2303", RS232, "067b:2303"),
    ("067b", "23a3"): Chip("Prolific PL2303", RS232, "067b:23a3"),
    ("16d0", "117e"): Chip("CANable (slcan)", "wrist on CAN: can:slcan:PORT", "16d0:117e"),
    ("ad50", "60c4"): Chip("CANable (slcan)", "wrist on CAN: can:slcan:PORT", "ad50:60c4"),
    ("0c72", "000c"): Chip("PCAN-USB", "wrist on CAN", "0c72:000c", serial=False),
    ("1d50", "606f"): Chip("candleLight (gs_usb)", "wrist on CAN", "1d50:606f", serial=False),
}
VENDORS = {"0403": "FTDI", "1a86": "WCH CH34x", "10c4": "Silicon Labs CP210x", "067b": "Prolific"}


def chip_of(usb: str, driver: str, name: str) -> Chip | None:
    """The chip behind `usb` (VID:PID[:SERIAL] in lower case hex), else a guess by driver and port name."""
    vendor, _, rest = usb.lower().partition(":")
    product = rest.partition(":")[0]
    known = CHIPS.get((vendor, product))
    if known is not None:
        return known
    if vendor in VENDORS:
        return Chip(VENDORS[vendor], RS232, f"{vendor}:{product}")
    if driver == "cdc_acm" or name.startswith("ttyACM"):
        return Chip("CDC ACM", CDC, f"{vendor}:{product}" if vendor else "")
    if name.startswith("rfcomm"):
        return Chip("Bluetooth serial", "exo over Bluetooth")
    if not vendor and name.startswith("ttyS"):
        return Chip("UART of the board", "exo, wrist or barrett")
    return Chip("USB serial", RS232, f"{vendor}:{product}") if vendor else None
