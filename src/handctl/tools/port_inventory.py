"""Serial ports, CAN interfaces and programs that grab them, as the operating system reports them. Opens no port.

Everything is read below `Machine.root`, so that tests build a small system of their own. On Linux /sys, /dev and /proc
are read; elsewhere pyserial's list is all there is.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from handctl.link.link_interface import usb_address
from handctl.link.port_users import Process, group_of, groups, holders, processes
from handctl.system import serial_ports
from handctl.system.processes import user_name
from handctl.system.serial_ports import Driver, text_in, usb_folder, usb_name

CAN_TYPE = "280"
"""ARPHRD_CAN in /sys/class/net/*/type."""
IP_SECONDS = 2.0
GRABBERS = ("ModemManager", "brltty")
COM_WAYS = ("ttyUSB", "ttyACM", "ttyAMA", "ttyTHS", "ttymxc", "ttyS", "rfcomm")


# -- the chips of adapters that are met in the field, and which device may be behind them: which one answers, only a scan can say --


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


@dataclass(frozen=True, slots=True)
class Port:
    """One serial port. `usb` is VID:PID[:SERIAL] in hex as in `usb:` links; `held`: the processes that have it open."""

    path: str
    by_id: str = ""
    usb: str = ""
    driver: str = ""
    product: str = ""
    chip: Chip | None = None
    held: tuple[Process, ...] = ()
    permitted: bool = True
    group: str = ""
    member: bool = False
    """Whether /etc/group lists us in `group` already: then logging in again is enough."""
    latency_ms: int | None = None

    @property
    def free(self) -> bool:
        """Whether it may be opened."""
        return self.permitted and not self.held

    @property
    def state(self) -> str:
        """In words."""
        return "free" if self.free else "in use" if self.held else "not permitted"


@dataclass(frozen=True, slots=True)
class CanInterface:
    """One CAN interface of the kernel; `bitrate` in bit/s if the system reports it."""

    name: str
    state: str
    bitrate: int | None = None
    driver: str = ""


def source(address: str) -> str:
    """The address of this computer from which it would speak to `address`; "" where no way leads there. Sends nothing."""
    import socket

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        try:
            asked.connect((address, 9))
            return str(asked.getsockname()[0])
        except OSError:
            return ""


def _run_ip() -> str:
    """`ip -details -json link`; empty where there is no such program or it does not answer in time."""
    import subprocess

    try:
        done = subprocess.run(
            ["ip", "-details", "-json", "link"], capture_output=True, text=True, timeout=IP_SECONDS, check=False
        )
    except (OSError, subprocess.SubprocessError, ValueError):
        return ""
    return done.stdout


def _list_ports() -> list[Any]:
    from handctl.link.serial import listed_ports

    return listed_ports()


@dataclass(frozen=True, slots=True)
class Machine:
    """The system below `root`; the callables are what a test replaces.

    user      our name, as /etc/group spells it    groups  numbers of the groups that this session is in
    access    whether a device file may be read and written
    run_ip    the JSON of `ip -details -json link`
    source    our address towards another one, "" = no way leads there
    listing   pyserial's list of ports, used where there is no /sys
    driver    the driver of a port, and `without_driver` vendor and product of adapters that have none, on Windows
    """

    root: Path = Path("/")
    linux: bool = serial_ports.IN_SYS
    user: Callable[[], str] = user_name
    access: Callable[[Path], bool] = lambda path: os.access(path, os.R_OK | os.W_OK)
    run_ip: Callable[[], str] = _run_ip
    source: Callable[[str], str] = lambda address: source(address)  # noqa: PLW0108 - looked up when it is called
    listing: Callable[[], list[Any]] = _list_ports
    driver: Callable[[str], Driver] = serial_ports.driver_of
    without_driver: Callable[[], list[tuple[str, str]]] = serial_ports.without_driver

    def at(self, path: str | Path) -> Path:
        """Where an absolute path lies below `root`."""
        return self.root / str(path).lstrip("/")

    def read(self, path: str | Path) -> str:
        """A small text file, see `text_in`."""
        return text_in(self.at(path))

    # -- serial ports --------------------------------------------------------------------------------------------

    def ports(self) -> list[Port]:
        """All serial ports that have hardware behind them, by name."""
        if not self.linux:
            return [self._listed(entry) for entry in self.listing()]
        by_id = self._by_id()
        names = sorted(_entries(self.at("/sys/class/tty")), key=_natural)
        return [self._port(name, by_id) for name in names if self._is_port(name)]

    def port(self, path: str) -> Port | None:
        """The port of a device path, which may be a by-id name."""
        real = os.path.realpath(path) if self.root == Path("/") else path
        return next((port for port in self.ports() if path in (port.path, port.by_id) or port.path == real), None)

    def matching(self, link: str) -> list[Port]:
        """The ports that a ``usb:VID:PID[:SERIAL]`` means. Raises UsageError."""
        *address, serial = usb_address(link)
        found = [(port, usb_address(f"usb:{port.usb}")) for port in self.ports() if port.usb]
        return [port for port, (vid, pid, own) in found if [vid, pid] == address and serial in ("", own)]

    def _is_port(self, name: str) -> bool:
        if not name.startswith(COM_WAYS):
            return False
        home = self.at("/sys/class/tty") / name
        if name.startswith("ttyS"):  # the kernel makes these also where no chip is
            return self.read(f"/sys/class/tty/{name}/type") not in ("", "0")
        return name.startswith("rfcomm") or (home / "device").exists()

    def _port(self, name: str, by_id: Mapping[str, str]) -> Port:
        path = f"/dev/{name}"
        device = (self.at("/sys/class/tty") / name / "device").resolve()
        usb = usb_folder(device)
        link = usb_name(usb)
        driver = _link_name(device / "driver")
        owner = group_of(self.at(path), self.root)
        group = owner[1] if owner is not None else ""
        _, members = groups(self.root).get(group, (0, ()))
        latency = self.read(f"/sys/bus/usb-serial/devices/{name}/latency_timer") or text_in(device / "latency_timer")
        return Port(
            path=path,
            by_id=by_id.get(name, ""),
            usb=link,
            driver=driver,
            product=text_in(os.path.join(usb, "product")) if usb else "",
            chip=chip_of(link, driver, name),
            held=tuple(holders(path, self.root)),
            permitted=self.access(self.at(path)),
            group=group,
            member=self.user() in members,
            latency_ms=int(latency) if latency.isdecimal() else None,
        )

    def _by_id(self) -> dict[str, str]:
        folder = self.at("/dev/serial/by-id")
        return {_link_name(folder / name): f"/dev/serial/by-id/{name}" for name in _entries(folder)}

    def _listed(self, entry: Any) -> Port:
        link = ""
        if entry.vid is not None:
            link = ":".join(filter(None, (f"{entry.vid:04x}", f"{entry.pid:04x}", entry.serial_number or "")))
        product = entry.product or (entry.description if entry.description != "n/a" else "")
        path, driver = str(entry.device), self.driver(entry.device)
        return Port(
            path=path,
            usb=link,
            driver=driver.name,
            product=product or "",
            chip=chip_of(link, driver.name, path),
            held=tuple(holders(path, self.root)) if serial_ports.held_by_name(path) else (),
            latency_ms=driver.latency_ms,
        )

    def without_port(self) -> list[Chip]:
        """Adapters that are plugged in but have no port: no driver, or a program took it away (brltty does)."""
        missing = [chip for usb in self.without_driver() if (chip := CHIPS.get(usb)) is not None and chip.serial]
        folder = self.at("/sys/bus/usb/devices")
        for name in _entries(folder):
            home = folder / name
            known = CHIPS.get((text_in(home / "idVendor"), text_in(home / "idProduct")))
            if known is not None and known.serial and not _has_tty(home):
                missing.append(known)
        return missing

    # -- the rest of the machine ---------------------------------------------------------------------------------

    def can_interfaces(self) -> list[CanInterface]:
        """CAN interfaces of the kernel, by name."""
        folder = self.at("/sys/class/net")
        names = [name for name in sorted(_entries(folder)) if self.read(f"/sys/class/net/{name}/type") == CAN_TYPE]
        bitrates = self._bitrates() if names else {}
        return [
            CanInterface(
                name,
                self.read(f"/sys/class/net/{name}/operstate") or "unknown",
                bitrates.get(name),
                _link_name(folder / name / "device" / "driver"),
            )
            for name in names
        ]

    def _bitrates(self) -> dict[str, int]:
        try:
            links = json.loads(self.run_ip())
            return {
                link["ifname"]: int(link["linkinfo"]["info_data"]["bittiming"]["bitrate"])
                for link in links
                if "bittiming" in link.get("linkinfo", {}).get("info_data", {})
            }
        except (ValueError, KeyError, TypeError, AttributeError):
            return {}

    def port_grabbing_programs(self) -> list[Process]:
        """Running programs that open serial ports by themselves."""
        return processes(GRABBERS, self.root)

    def stale_locks(self) -> list[tuple[str, int]]:
        """Lock files of ports (UUCP style) whose process is gone: (path, pid)."""
        found: dict[Path, tuple[str, int]] = {}
        for folder in ("/run/lock", "/var/lock"):
            for name in _entries(self.at(folder)):
                path = f"{folder}/{name}"
                words = self.read(path).split() if name.startswith("LCK..") else []
                if words and words[0].isdecimal() and not self.at(f"/proc/{words[0]}").exists():
                    found.setdefault(self.at(path).resolve(), (path, int(words[0])))
        return list(found.values())


# -- /sys ---------------------------------------------------------------------------------------------------------


def _entries(folder: Path) -> Iterator[str]:
    try:
        yield from os.listdir(folder)
    except OSError:
        return


def _link_name(path: Path) -> str:
    """The last part of what a symbolic link points to; empty where there is none."""
    try:
        return os.path.basename(os.readlink(path))
    except OSError:
        return ""


def _has_tty(home: Path) -> bool:
    """Whether an interface of this USB device has a tty below it."""
    for name in _entries(home):
        if ":" in name and (
            (home / name / "tty").exists() or any(part.startswith("tty") for part in _entries(home / name))
        ):
            return True
    return False


def _natural(name: str) -> tuple[str, int]:
    head = name.rstrip("0123456789")
    return head, int(name[len(head) :] or 0)


# -- the packages that handctl needs -----------------------------------------------------------------------------------


PACKAGES = {"click": "8.1", "pyserial": "3.5", "rich": "13.7", "python-can": "4.3", "crcmod": "1.7", "bincopy": "20.0"}
TOML, BUILT_IN = {"tomli": "2.0"}, (3, 11)
"""What reads the configuration, and the first Python that can do so without it."""


def needed(python: tuple[int, ...] = sys.version_info[:2]) -> dict[str, str]:
    """Package -> oldest version, on a Python. A test compares with the package's own requirements."""
    return dict(PACKAGES) if python >= BUILT_IN else {**PACKAGES, **TOML}
